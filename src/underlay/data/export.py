"""Write curves to CSV, JSON and HDF5 files that `read` reads back.

Each file is written whole or not at all. Numbers are written with all their digits, in SI, with the unit in the
header. Metadata and true parameters are included, so the origin of a curve is kept.
"""

from __future__ import annotations

import io
import json
import math
import os
import re
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import replace
from importlib import import_module
from pathlib import Path
from typing import Any

import numpy as np

from underlay._files import write_atomic
from underlay._text import comment_line
from underlay.data.curve import Curve, Metadata
from underlay.errors import InputError, missing_extra
from underlay.units import human_unit

# Seven digits: a ten-thousandth of the finest noise, and the same text wherever the last bit of a force
# comes out differently.
_FORMAT = "{:.7g}"
#: A comment line of a CSV that starts with this carries metadata and truth as JSON.
METADATA_MARK = "underlay-metadata:"
#: What the JSON and HDF5 files of curves say they are.
HDF5_MARK = "underlay-curves"
#: Columns of an exported curve and their units.
UNITS = {"depth": "m", "force": "N", "time": "s"}
_JSON_TEXT = re.compile(r'"(?:[^"\\]|\\.)*"')


def curve_csv(curve: Curve, comments: Iterable[str] = ()) -> str:
    """Return a curve as comma-separated text for people, to seven digits, with names and units in the header.

    Parameters
    ----------
    curve : Curve
        What to write: time (where there is one), depth, force and segment.
    comments : iterable of str
        Lines written above the header, each after ``#``.
    """
    columns: list[tuple[str, list[str]]] = []
    for name, kind, values in (
        ("time", "time", curve.time),
        ("depth", "length", curve.depth),
        ("force", "force", curve.force),
    ):
        if values is not None:
            unit, factor = human_unit(float(np.max(np.abs(values))), kind)
            columns.append((f"{name} ({unit})", [_FORMAT.format(value) for value in values / factor]))
    if curve.segment is not None:
        columns.append(("segment", [str(label) for label in curve.segment]))
    lines = [comment_line(comment) for comment in comments]
    lines.append(",".join(name for name, _ in columns))
    lines += [",".join(row) for row in zip(*(cells for _, cells in columns), strict=True)]
    return "\n".join(lines) + "\n"


def write_curves(curves: Curve | Sequence[Curve], path: str | os.PathLike[str]) -> Path:
    """Write curves to a file, atomically.

    Parameters
    ----------
    curves : Curve or sequence of Curve
        A CSV takes one, JSON and HDF5 take any number.
    path : str or path
        Ends in .csv, .json, .h5 or .hdf5.

    Returns
    -------
    Path
        The file.

    Raises
    ------
    InputError
        If the ending is another, or several curves are to go into one CSV.
    FileAccessError
        If the file cannot be written; an old one of that name is then untouched.
    MissingExtraError
        If HDF5 is wanted and h5py is not installed.
    """
    chosen = [curves] if isinstance(curves, Curve) else list(curves)
    file = Path(path)
    try:
        encode = _ENCODERS[file.suffix.lower()]
    except KeyError:
        raise InputError(
            f"cannot tell the format from {file.name!r}; end it in {', '.join(_ENCODERS)}"
        ) from None
    if not chosen:
        raise InputError("there is no curve to write")
    return write_atomic(file, encode(chosen))


def write_json(content: Mapping[str, Any], path: str | os.PathLike[str]) -> Path:
    """Write a mapping of plain values, such as results with their units and provenance, as JSON, atomically.

    NaN and infinity, which JSON does not have, become null.

    Raises
    ------
    FileAccessError
        If the file cannot be written; an old one of that name is then untouched.
    """
    return write_atomic(path, _json_text(Metadata(content).to_dict(), indent=2) + "\n")


def _json_text(content: Any, indent: int | None = None, *, ascii_only: bool = False) -> str:
    return json.dumps(_without_nan(content), allow_nan=False, indent=indent, ensure_ascii=ascii_only)


def _json_bytes(content: Any) -> bytes:
    # A bare byte in a file name, a lone surrogate here, becomes the escape that JSON has for it.
    return _json_text(content).encode("utf-8", "backslashreplace")


def _json_comment(content: Any) -> str:
    """Return JSON for a comment line of a CSV: one line of ASCII, with commas and semicolons in texts escaped.

    A spreadsheet splits comment lines too: no part of a text may become a cell of its own.
    """
    text = _json_text(content, ascii_only=True)
    return _JSON_TEXT.sub(lambda word: word[0].replace(",", "\\u002c").replace(";", "\\u003b"), text)


def _without_nan(content: Any) -> Any:
    if isinstance(content, float):
        return content if math.isfinite(content) else None
    if isinstance(content, dict):
        return {key: _without_nan(value) for key, value in content.items()}
    if isinstance(content, list):
        return [_without_nan(value) for value in content]
    return content


def _about(curve: Curve) -> dict[str, Any]:
    return {
        "metadata": Metadata(curve.metadata).to_dict(),
        "truth": None if curve.truth is None else Metadata(curve.truth).to_dict(),
        **(
            {"columns": {name: values.tolist() for name, values in curve.columns.items()}}
            if curve.columns
            else {}
        ),
    }


def _columns(curve: Curve) -> dict[str, Any]:
    columns: dict[str, Any] = {"depth": curve.depth, "force": curve.force}
    if curve.time is not None:
        columns["time"] = curve.time
    return columns


def _csv(curves: Sequence[Curve]) -> bytes:
    if len(curves) > 1:
        raise InputError(f"a CSV holds one curve, not {len(curves)}; use .json or .h5, or one file each")
    curve = curves[0]
    columns = _columns(curve)
    labels = [f"{name} ({UNITS[name]})" for name in columns]
    texts = [[repr(float(value)) for value in column] for column in columns.values()]
    if curve.segment is not None:
        labels.append("segment")
        texts.append([str(value) for value in curve.segment])
    lines = [
        f"# {METADATA_MARK} {_json_comment(_about(curve))}",
        ",".join(labels),
        *(",".join(row) for row in zip(*texts, strict=True)),
    ]
    return ("\n".join(lines) + "\n").encode()


def _json(curves: Sequence[Curve]) -> bytes:
    entries = [
        {
            **_about(curve),
            "units": {name: UNITS[name] for name in _columns(curve)},
            **{name: column.tolist() for name, column in _columns(curve).items()},
            "segment": None if curve.segment is None else curve.segment.tolist(),
        }
        for curve in curves
    ]
    return _json_bytes({"format": HDF5_MARK, "version": 1, "curves": entries}) + b"\n"


def _hdf5(curves: Sequence[Curve]) -> bytes:
    try:
        h5py: Any = import_module("h5py")
    except ImportError as error:
        raise missing_extra("writing HDF5 needs h5py", "afm") from error
    stream = io.BytesIO()
    with h5py.File(stream, "w") as file:
        file.attrs["format"] = np.bytes_(HDF5_MARK)
        file.attrs["version"] = 1
        for number, curve in enumerate(curves):
            group = file.create_group(str(number))
            for name, column in _columns(curve).items():
                group.create_dataset(name, data=column).attrs["unit"] = np.bytes_(UNITS[name])
            if curve.segment is not None:
                group.create_dataset("segment", data=np.char.encode(curve.segment, "ascii"))
            # A dataset and not an attribute: attributes end at 64 kB.
            group.create_dataset("about", data=np.bytes_(_json_bytes(_about(curve))))
    return stream.getvalue()


_ENCODERS: Mapping[str, Callable[[Sequence[Curve]], bytes]] = {
    ".csv": _csv,
    ".json": _json,
    ".h5": _hdf5,
    ".hdf5": _hdf5,
}


# --- and read back


# What says where a file came from; that of the original is kept under "origin" and not mixed with the copy's.
_PROVENANCE = ("path", "member", "sha256", "format", "reader", "test")
# What the reading says anew.
_ANEW = ("units", "points_left_out", "comments")
_LARGEST = 2**53
# What other parts rely on being a number.
_NUMBERS = {
    *("indenter_radius", "spring_constant", "software_contact_depth", "instrument_reduced_modulus"),
    *("search_criterion", "search_reached", "contact_height", "initial_gap"),
}


def restored(curve: Curve, about: Any) -> Curve:
    """Return a curve that was read from an exported file, with metadata, truth and columns that the file stores.

    `about` is the parsed JSON of the file, which is not trusted: entries of a wrong type are left out. The
    provenance of the original file is kept in the metadata under ``origin``.
    """
    if not isinstance(about, dict):
        return curve
    stored = about.get("metadata")
    metadata = dict(stored) if isinstance(stored, dict) else {}
    origin = {key: metadata.pop(key) for key in _PROVENANCE if key in metadata}
    notes, truth, further = metadata.pop("notes", []), about.get("truth"), about.get("columns")
    kept = {
        key: value
        for key, value in metadata.items()
        if key not in _ANEW
        and (key not in _NUMBERS or (isinstance(value, int | float) and not isinstance(value, bool)))
        and (key != "name" or isinstance(value, str))
    }
    texts = [note for note in notes if isinstance(note, str)] if isinstance(notes, list) else []
    # Further columns (SI) as far as they are columns of numbers, null for none, as long as the curve.
    columns = {
        name: np.array(values, dtype=np.float64)
        for name, values in (further if isinstance(further, dict) else {}).items()
        if isinstance(values, list) and len(values) == len(curve) and all(map(_is_number_or_none, values))
    }
    first = {"origin": origin} if origin else {}
    return replace(
        curve,
        metadata={**curve.metadata, **kept, **first, "notes": (*texts, *curve.metadata["notes"])},
        truth=truth if isinstance(truth, dict) else None,
        columns=columns,
    )


def _is_number_or_none(value: Any) -> bool:
    # Whole numbers of any length are JSON; beyond a float they are no reading.
    return value is None or isinstance(value, float) or (type(value) is int and abs(value) < _LARGEST)
