"""Atomic force microscopes: JPK and .tab by our own readers; NT-MDT, AFM Workshop, HDF5 by afmformats.

Tables (.tab) of afmformats: metadata as JSON behind ``#``, a row of names behind ``#``, and SI numbers.

Read here and not by that package, which opens a path of its own and takes the metadata as they are.

The calibration that a file of AFM Workshop states, which afmformats drops where another is given.

The content is recognised here and handed to afmformats in memory, because that package goes by the
extension of the file. Both give the height of the scanner, falling towards the sample, and the force. The
tip is at height + force / spring constant, so depth = -(height + force / spring constant); its zero is
arbitrary and contact is found later. A file without a spring constant gives depth = -height, which still
holds the bending of the cantilever: a note says so.
"""

from __future__ import annotations

import io
import itertools
import math
import re
from collections.abc import Callable, Collection, Mapping
from importlib import import_module
from typing import Any

import numpy as np

from underlay._arrays import FloatArray
from underlay._door import parse_json
from underlay._text import names_there
from underlay.data.curve import Curve
from underlay.data.readers._format import Format, Options, make_curve
from underlay.data.readers._hdf5 import HDF5_MAGIC, Checked, curve_groups, is_own, open_checked
from underlay.data.readers._lever import Lever, lever_curve
from underlay.data.readers._source import Source
from underlay.data.readers._text import decode, lines_of, numbers
from underlay.data.readers.jpk import JpkCurve, read_jpk
from underlay.data.segments import HOLD, label_pieces, segments_from_motion
from underlay.errors import FileFormatError, InputError, UnderlayError, missing_extra

__all__ = ["FORMAT", "TAB_MARK", "read_tab", "workshop_calibration"]

#: What opens the metadata.
TAB_MARK = "# BEGIN METADATA"


_END = "# END METADATA"


_WANTED = ("force", "height (measured)", "height (piezo)", "time", "segment")


_OLD_SEGMENTS = {"False": "0", "True": "1"}


_NUMBERS = ("spring constant", "sensitivity", "setpoint", "position x", "position y")


def read_tab(source: Source) -> tuple[dict[str, FloatArray], dict[str, Any]]:
    """Return the columns that are used (SI) and the metadata of a table.

    Raises
    ------
    FileFormatError
        If the metadata do not end, there is no row of names or of numbers, or the height or the force is
        missing.
    """
    lines = lines_of(source)
    comments = [line.strip() for line in lines if line.startswith("#")]
    rows = [line.split("\t") for line in lines if not line.startswith("#")]
    if TAB_MARK not in comments or _END not in comments or not rows:
        raise FileFormatError(
            f"{source.name}: no line {TAB_MARK!r} or {_END!r}, or no rows of numbers below them"
        )
    names = comments[-1].lstrip("# ").split("\t")
    wanted = [name for name in _WANTED if name in names]
    if "force" not in wanted or not any(name.startswith("height") for name in wanted):
        there = names_there(names)
        raise FileFormatError(f"{source.name} has no column 'force' or no height; it has {there}")
    # Of two segments, older versions wrote which one as True or False; no other column of booleans is used.
    if "segment" in wanted:
        _number_segments(rows, names.index("segment"))
    table = numbers(rows, [names.index(name) for name in wanted], source.name)
    metadata = _metadata(source, comments[comments.index(TAB_MARK) + 1 : comments.index(_END)])
    return dict(zip(wanted, table.T, strict=True)), metadata


def _number_segments(rows: list[list[str]], index: int) -> None:
    for row in rows:
        if index < len(row) and row[index] in _OLD_SEGMENTS:
            row[index] = _OLD_SEGMENTS[row[index]]


def _metadata(source: Source, comments: list[str]) -> dict[str, Any]:
    try:
        found = parse_json("\n".join(line.lstrip("#") for line in comments))
    except (ValueError, RecursionError) as error:
        raise FileFormatError(f"{source.name}: its metadata are damaged JSON: {error!s:.120}") from error
    entries: Mapping[str, Any] = found if isinstance(found, dict) else {}
    # A number that other parts rely on is one, or is left out.
    return {key: value for key, value in entries.items() if key not in _NUMBERS or _is_number(value)}


def _is_number(value: Any) -> bool:
    return isinstance(value, int | float) and not isinstance(value, bool) and math.isfinite(value)


# The maker's names, and what makes SI of their numbers: nN/nm is N/m; mV/nm is the inverse of a sensitivity.
_KEYS: dict[str, tuple[str, Callable[[float], float]]] = {
    "spring constant": ("Force Constant, nN/nm", float),
    "sensitivity": ("Light Lever Gain, mV/nm", lambda gain: 1e-6 / gain),
}


# What the maker's program writes where nothing was calibrated.
_UNSET = 1.0


def workshop_calibration(text: str, names: Collection[str]) -> dict[str, float]:
    """SI numbers (N/m, m/V) of those `names` that the header of a file states."""
    found = {}
    for name in names:
        key, in_si = _KEYS[name]
        match = re.search(rf"^{re.escape(key)}:\s*([0-9.eE+-]+)\s*$", text, re.MULTILINE)
        value = _UNSET if match is None else float(match[1])
        if value > 0.0 and value != _UNSET:
            found[name] = in_si(value)
    return found


_WORKSHOP = "Force-Distance Curve"


_JPK = b"header.properties"


# NT-MDT: no header, three columns with decimal commas.
_NTMDT_ROW = re.compile(r"-?\d+,\d+\t-?\d+,\d+\t-?\d+,\d+")


# By kind of file: what afmformats calls a calibration, and the kind of quantity we ask for. NT-MDT records
# the detector as a current.
_CALIBRATION = {"spring constant": "stiffness", "sensitivity": "sensitivity"}


_CURRENT_CALIBRATION = {"spring constant": "stiffness", "sensitivity": "current sensitivity"}


_QUANTITIES = {"stiffness": "spring_constant", "sensitivity": "sensitivity"}


# A segment that travels less than this share of the whole rests: creep under a held force is a few per cent.
_REST = 0.1


_NOTHING: Mapping[str, Any] = {}


_KNOWN = {"spring constant": "spring_constant", "sensitivity": "sensitivity", "setpoint": "setpoint"}


# What `_curve` takes: the better height that there is, and these.
_HEIGHTS = ("height (measured)", "height (piezo)")


_COLUMNS = ("force", "time", "segment")


def _sniff(source: Source) -> bool:
    return bool(_kind(source))


def _kind(source: Source) -> str:
    data = source.data
    if source.is_zip:
        return "jpk" if _JPK in data else ""
    if data.startswith(HDF5_MAGIC):
        return "" if is_own(source) else "hdf5"
    head = source.head(2000)
    if TAB_MARK in head:
        return "tab"
    if head.startswith(_WORKSHOP) and "File Format" in head:
        return "workshop"
    lines = [line for line in head.split("\n") if line][:4]
    return "ntmdt" if len(lines) == 4 and all(map(_NTMDT_ROW.fullmatch, lines[:3])) else ""


def _read_all(source: Source, options: Options) -> list[Curve]:
    kind = _kind(source)
    if not kind:
        raise FileFormatError(f"{source.name} is none of JPK, NT-MDT, AFM Workshop, HDF5 or .tab")
    override = _override(source, kind, options.calibration)
    if kind == "jpk":
        curves = enumerate(read_jpk(source, options.calibration), start=1)
        return [_jpk_curve(source, number, curve, options.calibration) for number, curve in curves]
    if kind == "tab":
        if override:
            raise InputError(f"{source.name} holds forces, not signals; a calibration cannot be given")
        return [_curve(source, 1, *read_tab(source))]
    return _guarded(source, kind, override)


def _guarded(source: Source, kind: str, override: Mapping[str, float]) -> list[Curve]:
    """Call a loader of afmformats and turn its errors into ours."""
    formats = _afmformats()
    try:
        return _LOADERS[kind](formats, source, override)
    except (UnderlayError, KeyboardInterrupt, SystemExit):
        raise
    except BaseException as error:  # the errors of afmformats derive from BaseException
        if hasattr(error, "meta_keys"):
            raise InputError(f"{source.name} does not hold its calibration; {_example(kind)}") from error
        raise FileFormatError(
            f"{source.name} is damaged or of an unknown kind: {type(error).__name__}: {error!s:.120}"
        ) from error


def _override(source: Source, kind: str, given: Mapping[str, float]) -> dict[str, float]:
    wanted = _CURRENT_CALIBRATION if kind == "ntmdt" else _CALIBRATION
    unused = set(given) - set(wanted.values())
    if unused:
        raise InputError(f"{source.name} takes no {unused.pop()}; {_example(kind)}")
    return {name: given[quantity] for name, quantity in wanted.items() if quantity in given}


def _example(kind: str) -> str:
    unit = "nm/nA" if kind == "ntmdt" else "nm/V"
    return f"give calibration={{'spring_constant': '0.04 N/m', 'sensitivity': '60 {unit}'}} with your numbers"


def _afmformats() -> Any:
    try:
        return import_module("afmformats.formats")
    except ImportError as error:
        raise missing_extra("reading AFM files needs afmformats", "afm") from error


def _load_hdf5(formats: Any, source: Source, override: Mapping[str, float]) -> list[Curve]:
    del formats
    if override:
        raise InputError(f"{source.name} holds forces, not signals; a calibration cannot be given")
    with open_checked(source) as file:
        groups = [(number, file[number]) for number in curve_groups(source, file)]
        _require_afmformats(source, file, groups[0][1] if groups else None)
        # The columns of a curve alone: `afmformats.formats.fmt_hdf5` lists all that there might be for every one.
        return _curves(
            source,
            [
                {
                    "data": {name: group[name] for name in _columns(group)},
                    "metadata": {**group.said(), "enum": int(number)},
                }
                for number, group in groups
            ],
        )


def _columns(group: Checked) -> list[str]:
    """Columns of a curve that are read."""
    return [*[name for name in _HEIGHTS if name in group][:1], *[name for name in _COLUMNS if name in group]]


def _require_afmformats(source: Source, file: Checked, group: Any) -> None:
    """Refuse a sound HDF5 file whose layout is not known here, and say what it holds."""
    if file.is_said("software") and isinstance(group, Checked) and "force" in group:
        return
    there = names_there(file)
    if file.is_said("nsf_file_version_major"):
        raise FileFormatError(
            f"{source.name} is a Nanosurf Studio file (.nhf), which is not read here: export its curves from "
            "Studio as .nid, or as text with names and units in the first row"
        )
    raise FileFormatError(
        f"{source.name} is an HDF5 file of a layout not known here (it holds {there}): known are those written "
        "by underlay and by afmformats. Export its curves as text with names and units in the first row, such "
        "as 'depth (um),force (mN),time (s)', or read it in Python and make an underlay.Curve of its columns"
    )


def _renamed(calibration: Mapping[str, float]) -> dict[str, Any]:
    """What the file says, to stand beside what was given in its place."""
    return {f"file_{_KNOWN[name]}": value for name, value in calibration.items()}


def _load_workshop(formats: Any, source: Source, override: Mapping[str, float]) -> list[Curve]:
    text = decode(source)
    if "sensitivity" in override and "T-B(V)" not in text:
        raise InputError(f"{source.name} holds forces, not volts; a sensitivity cannot be given")
    loaded = formats.fmt_workshop.ws_single.load_csv(io.StringIO(text), meta_override=dict(override))
    return _curves(source, loaded, _renamed(workshop_calibration(text, override)))


def _load_ntmdt(formats: Any, source: Source, override: Mapping[str, float]) -> list[Curve]:
    text = io.StringIO(decode(source))
    return _curves(source, formats.fmt_ntmdt_txt.load_txt(text, meta_override=dict(override)))


_LOADERS = {
    "hdf5": _load_hdf5,
    "workshop": _load_workshop,
    "ntmdt": _load_ntmdt,
}


def _curves(
    source: Source, loaded: list[dict[str, Any]], of_file: Mapping[str, Any] = _NOTHING
) -> list[Curve]:
    """Curves of afmformats; `of_file` is the file's own calibration where another was given in its place."""
    return [
        _curve(source, number, entry["data"], entry["metadata"], of_file)
        for number, entry in enumerate(loaded, start=1)
    ]


def _curve(
    source: Source, number: int, data: Any, found: Any, of_file: Mapping[str, Any] = _NOTHING
) -> Curve:
    names = set(data)
    channel = next((name for name in _HEIGHTS if name in names), _HEIGHTS[-1])
    height = _column(data, channel)
    force = _column(data, "force")
    time = _column(data, "time") if "time" in names else None
    stiffness = found.get("spring constant")
    notes = []
    if not stiffness:
        notes.append(
            "depth still holds the bending of the cantilever: give calibration={'spring_constant': ...}, "
            "or set the instrument's compliance to its inverse"
        )
        depth, rule = -height, f"minus {channel}"
    else:
        depth, rule = -(height + force / stiffness), f"minus ({channel} + force / spring constant)"
    known = {name: found[key] for key, name in _KNOWN.items() if key in found}
    if "position x" in found and "position y" in found:
        known["position"] = (float(found["position x"]), float(found["position y"]))
    return make_curve(
        source,
        depth,
        force,
        time,
        _segments(data, height, time),
        name=_name(source, number),
        header={key: str(found[key]) for key in found if key not in {"path", "z range"}},
        units={"height": "m", "force": "N", "time": "s"},
        sign_rules={
            "depth": rule,
            "force": "positive in compression, as afmformats gives it",
            "segment": "from the file's segments where it has several, else from the motion of the height",
        },
        notes=notes,
        bending_taken_off=bool(stiffness),
        **known,
        **of_file,
    )


def _jpk_curve(source: Source, number: int, curve: JpkCurve, given: Mapping[str, float]) -> Curve:
    used = {**curve.known, **given, "stiffness": curve.stiffness}
    about = {_QUANTITIES[name]: value for name, value in used.items()}
    # What the file says stands beside what was given in its place.
    about |= {f"file_{_QUANTITIES[name]}": value for name, value in curve.known.items() if name in given}
    return lever_curve(
        source,
        -curve.height,
        curve.force,
        Lever(curve.stiffness, used.get("sensitivity"), about),
        channel="minus height",
        time=curve.time,
        segment=np.array(curve.segment, dtype="<U9"),
        name=_name(source, number),
        header=curve.about,
        sign_rules={"segment": "from the header of each segment"},
        position=curve.position,
    )


def _name(source: Source, number: int) -> str:
    return source.path.stem if number == 1 else f"{source.path.stem}, curve {number}"


def _column(data: Any, name: str) -> FloatArray:
    return np.array(data[name], dtype=np.float64)


def _segments(data: Any, height: FloatArray, time: FloatArray | None) -> Any:
    """Label each numbered segment by its motion: the numbers say where one ends, not what it is."""
    if not np.isfinite(height).all():
        return None
    numbers = np.asarray(data["segment"]) if "segment" in set(data) else np.zeros(len(height))
    ends = np.flatnonzero(np.diff(numbers)) + 1
    if not ends.size:
        return segments_from_motion(-height, time)
    starts = np.concatenate(([0], ends, [len(height)]))
    travel = np.abs([height[last - 1] - height[first] for first, last in itertools.pairwise(starts)])
    resting = starts[:-1][travel < _REST * np.ptp(height)]
    return label_pieces(-height, starts, {int(first): HOLD for first in resting})


FORMAT = Format(
    name="afm",
    description="AFM files: JPK, NT-MDT and AFM Workshop text, HDF5 and .tab of afmformats",
    sniff=_sniff,
    read_all=_read_all,
    extra="afm",
    takes_calibration=True,
)
