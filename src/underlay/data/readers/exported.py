"""Curves that underlay itself wrote, read back from JSON and HDF5 (`underlay.data.export`).

A file that says it is ours may have been changed: of what it says about its curve, only what is of the right
kind is taken (`restored`).
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import Any

import numpy as np

from underlay._arrays import FloatArray
from underlay._door import parse_json, understood
from underlay.data.curve import Curve
from underlay.data.export import HDF5_MARK
from underlay.data.readers._format import Format, Options, make_curve
from underlay.data.readers._hdf5 import curve_groups, is_own, open_checked
from underlay.data.readers._source import CURVES, Source
from underlay.data.readers._text import decode

__all__ = ["HDF5_FORMAT", "JSON_FORMAT", "restored"]

# What says where a file came from; that of the original is kept under "origin" and not mixed with the copy's.
_PROVENANCE = ("path", "member", "sha256", "format", "reader", "test")
_SIGNS = {"depth": "as exported", "force": "as exported"}
# What the reading says anew.
_ANEW = ("units", "points_left_out", "comments")
_LARGEST = 2**53
# What other parts rely on being a number.
_NUMBERS = {
    *("indenter_radius", "spring_constant", "software_contact_depth", "instrument_reduced_modulus"),
    *("search_criterion", "search_reached", "contact_height", "initial_gap"),
}


def restored(curve: Curve, about: Any) -> Curve:
    """Add to a curve what its file says about the curve it was exported from.

    A file is not trusted: what is not of its kind is left out.
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
    told = [note for note in notes if isinstance(note, str)] if isinstance(notes, list) else []
    # Further columns (SI) as far as they are columns of numbers, null for none, as long as the curve.
    columns = {
        name: np.array(values, dtype=np.float64)
        for name, values in (further if isinstance(further, dict) else {}).items()
        if isinstance(values, list) and len(values) == len(curve) and all(map(_is_number_or_none, values))
    }
    first = {"origin": origin} if origin else {}
    return replace(
        curve,
        metadata={**curve.metadata, **kept, **first, "notes": (*told, *curve.metadata["notes"])},
        truth=truth if isinstance(truth, dict) else None,
        columns=columns,
    )


def _is_number_or_none(value: Any) -> bool:
    # Whole numbers of any length are JSON; beyond a float they are no reading.
    return value is None or isinstance(value, float) or (type(value) is int and abs(value) < _LARGEST)


def _read_json(source: Source, options: Options) -> list[Curve]:
    del options
    with understood(source.name, CURVES):
        content = parse_json(decode(source))
    entries = content.get("curves") if isinstance(content, dict) else None
    if not isinstance(entries, list) or not all(isinstance(entry, dict) for entry in entries):
        raise source.wrong("holds no list of curves")
    return [_curve(source, entry, entry) for entry in entries]


def _read_hdf5(source: Source, options: Options) -> list[Curve]:
    del options
    curves = []
    with open_checked(source) as file:
        for name in sorted(curve_groups(source, file), key=int):
            group = file[name]
            columns: dict[str, Any] = {key: group[key] for key in group}
            about = columns.pop("about", b"{}")
            segment = columns.get("segment")
            if segment is not None:
                columns["segment"] = np.char.decode(np.asarray(segment, dtype=np.bytes_), "ascii").tolist()
            curves.append(_curve(source, columns, parse_json(bytes(about).decode("utf-8"))))
    return curves


def _curve(source: Source, columns: Mapping[str, Any], about: Any) -> Curve:
    depth = _numbers(source, columns, "depth")
    count, labels = len(depth), columns.get("segment")
    if labels is not None and (
        not isinstance(labels, list) or len(labels) != count or not all(isinstance(v, str) for v in labels)
    ):
        raise source.wrong(": segment is not a list of names as long as the depth")
    curve = make_curve(
        source,
        depth,
        _numbers(source, columns, "force", count),
        None if columns.get("time") is None else _numbers(source, columns, "time", count),
        None if labels is None else np.array(labels, dtype=np.str_),
        units={"depth": "m", "force": "N", "time": "s"},
        sign_rules=_SIGNS,
    )
    return restored(curve, about)


def _numbers(source: Source, columns: Mapping[str, Any], name: str, length: int | None = None) -> FloatArray:
    try:
        array = np.array(columns.get(name), dtype=np.float64)  # null becomes NaN
    except (TypeError, ValueError, OverflowError) as error:
        raise source.wrong(f": {name} does not hold numbers") from error
    whole = array.ndim == 1 and length in (None, len(array))
    source.require(whole, f": {name} is not one column as long as the depth")
    return array


JSON_FORMAT = Format(
    name="json",
    description="curves written by underlay as JSON",
    sniff=lambda source: (head := source.head(400).lstrip()).startswith("{") and f'"{HDF5_MARK}"' in head,
    read_all=_read_json,
)

HDF5_FORMAT = Format(
    name="hdf5",
    description="curves written by underlay as HDF5",
    sniff=is_own,
    read_all=_read_hdf5,
    extra="afm",
)
