"""Numbers that programs keep: underlay's own JSON and HDF5, MATLAB's .mat, National Instruments' .tdms (Optics11).

A file that says underlay wrote it may have been changed: of what it says about its curve, only what is of the right
kind is taken (`underlay.data.export.restored`).

Their columns have names, and those of .tdms units; what lacks a unit gets it from a column mapping. No part of a
file may claim more numbers than it has bytes. MAT-files are read here: of a small one with single bytes turned,
scipy 1.17's loadmat ended the process (a segmentation fault), so that no check of ours behind it would have helped.
"""

from __future__ import annotations

import io
import logging
import re
import struct
import zlib
from collections.abc import Iterator, Mapping
from importlib import import_module
from typing import Any

import numpy as np

from underlay._arrays import FloatArray
from underlay._door import parse_json, understood
from underlay._text import one_line
from underlay.data.curve import Curve
from underlay.data.export import HDF5_MARK, restored
from underlay.data.readers._format import Options, declared, library, make_curve
from underlay.data.readers._hdf5 import curve_groups, is_own, open_checked
from underlay.data.readers._source import CURVES, MAX_BYTES, MOST_PARTS, Source
from underlay.data.readers._table import Table, table_curves
from underlay.data.readers._text import Arrays, decode
from underlay.errors import FileFormatError

# MAT-file format (MathWorks, "MAT-File Format", level 5): types of elements, and classes of arrays.
_MATRIX, _COMPRESSED = 14, 15
_STRUCT, _FIRST_NUMBER, _LAST_NUMBER = 2, 6, 15
_TYPES = {1: "i1", 2: "u1", 3: "i2", 4: "u2", 5: "i4", 6: "u4", 7: "f4", 9: "f8", 12: "i8", 13: "u8"}
_HEADER, _TAG, _COMPLEX, _DEEPEST = 128, 8, 0x800, 4
_FEWEST = 3


# --- what underlay wrote


_OWN_JSON = re.compile(rf'\s*{{.*"{HDF5_MARK}"', re.DOTALL)
_SIGNS = {"depth": "as exported", "force": "as exported"}


def _read_json(source: Source, options: Options) -> list[Curve]:
    del options
    with understood(source.name, CURVES):
        content = parse_json(decode(source))
    entries = content.get("curves") if isinstance(content, dict) else None
    if not isinstance(entries, list) or not all(isinstance(entry, dict) for entry in entries):
        raise source.wrong("holds no list of curves")
    return [_exported(source, entry, entry) for entry in entries]


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
            curves.append(_exported(source, columns, parse_json(bytes(about).decode("utf-8"))))
    return curves


def _exported(source: Source, columns: Mapping[str, Any], about: Any) -> Curve:
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


JSON_FORMAT = declared("json", _read_json, lambda source: bool(_OWN_JSON.match(source.head(400))))

HDF5_FORMAT = declared("hdf5", _read_hdf5, is_own)


# --- MATLAB and TDMS


def _read_matlab(source: Source, options: Options) -> list[Curve]:
    order = {b"IM": "<", b"MI": ">"}.get(source.data[126:128], "")
    source.require(order, "starts as a MATLAB file but its header is damaged")
    columns: dict[str, FloatArray] = {}
    size = 0
    for outer, element in _elements(source.data[_HEADER:], order):
        kind, body = outer, element
        if kind == _COMPRESSED:
            try:
                unpacked = zlib.decompressobj().decompress(element, MAX_BYTES - size + 1)
            except zlib.error as error:
                raise source.wrong(f"is a damaged MATLAB file: {error!s:.80}") from error
            kind, body = next(_elements(unpacked, order), (0, b""))
        size += len(body)
        source.require(size <= MAX_BYTES, f"unpacks to more than {MAX_BYTES // 1_000_000} MB")
        if kind == _MATRIX:
            columns |= _columns(body, order, "", 0)
    return _curves(source, options, {"": columns})


def _elements(data: bytes, order: str) -> Iterator[tuple[int, bytes]]:
    """Yield type and content of each data element of a MAT-file; `order` is the byte order, ``<`` or ``>``."""
    at = 0
    while at + _TAG <= len(data):
        kind, size = struct.unpack_from(f"{order}II", data, at)
        if kind >> 16:  # up to four bytes are kept in the tag
            yield kind & 0xFFFF, data[at + 4 : at + 4 + min(kind >> 16, 4)]
            at += _TAG
            continue
        end = at + _TAG + size
        if end > len(data):
            return
        yield kind, data[at + _TAG : end]
        at = end if kind == _COMPRESSED else end + -size % 8


def _columns(matrix: bytes, order: str, above: str, deep: int) -> dict[str, FloatArray]:
    """Columns (n,) of a MATLAB matrix of real numbers, or of those in a structure, by name; {} for anything else.

    `above` is the name of the structure that holds it, `deep` how many structures it lies in.
    """
    parts = list(_elements(matrix, order))
    if len(parts) < 4 or len(parts[0][1]) < 4 or deep > _DEEPEST:
        return {}
    flags = struct.unpack_from(f"{order}I", parts[0][1])[0]
    size = np.frombuffer(parts[1][1][: len(parts[1][1]) // 4 * 4], f"{order}i4").tolist()
    own = one_line(parts[2][1].rstrip(b"\0").decode("latin-1"))
    name = ".".join(part for part in (above, own) if part)
    if flags & 0xFF == _STRUCT and size == [1, 1] and len(parts) >= 5:
        width = int(np.frombuffer(parts[3][1][:4].ljust(4, b"\0"), f"{order}i4")[0])
        letters = parts[4][1] if 0 < width < MOST_PARTS else b""
        fields = (letters[at : at + width] for at in range(0, len(letters), max(width, 1)))
        found: dict[str, FloatArray] = {}
        for field, (kind, body) in zip(fields, parts[5:], strict=False):
            called = one_line(field.partition(b"\0")[0].decode("latin-1"))
            if kind == _MATRIX:
                found |= _columns(body, order, f"{name}.{called}" if name else called, deep + 1)
        return found
    kind, content = parts[3]
    if not _FIRST_NUMBER <= flags & 0xFF <= _LAST_NUMBER or flags & _COMPLEX or kind not in _TYPES:
        return {}
    type_ = np.dtype(order + _TYPES[kind])
    numbers = np.frombuffer(content[: len(content) // type_.itemsize * type_.itemsize], type_)
    whole = len(size) == 2 and min(size) >= 1 and size[0] * size[1] == len(numbers)
    if not whole or max(size) < _FEWEST or min(size) > MOST_PARTS:
        return {}
    table = numbers.reshape(size[1], size[0]).astype(np.float64)
    table = table if size[0] >= size[1] else table.T
    return {(name if len(table) == 1 else f"{name} {at}"): column for at, column in enumerate(table, start=1)}


def _read_tdms(source: Source, options: Options) -> list[Curve]:
    nptdms = library(
        "nptdms",
        f"{source.name} is a TDMS file, as Optics11 writes; reading it needs npTDMS",
        "export the curve as text from the instrument's program",
    )
    # It prints parts of a damaged file; what is wrong with one is said here.
    import_module("nptdms.log").log_manager.set_level(logging.CRITICAL + 1)
    with understood(source.name, CURVES):
        file = nptdms.TdmsFile.read_metadata(io.BytesIO(source.data))
        declared = sum(len(channel) for group in file.groups() for channel in group.channels())
        if declared > len(source.data):
            raise FileFormatError(f"it claims {declared} numbers and holds {len(source.data)} bytes")
        groups = [
            (str(group.name), dict(map(_tdms_column, group.channels())))
            for group in nptdms.TdmsFile.read(io.BytesIO(source.data)).groups()
        ]
    return _curves(source, options, dict(groups))


def _tdms_column(channel: Any) -> tuple[str, FloatArray]:
    """Name of a TDMS channel with its unit, and its numbers (n,); an empty array where it holds no numbers."""
    unit = str(channel.properties.get("unit_string", "") or channel.properties.get("NI_UnitDescription", ""))
    name, values = str(channel.name), np.asarray(channel[:])
    sound = values.dtype.kind in "fiu" and values.ndim == 1
    label = f"{name} ({unit})" if unit and unit not in name else name
    return label, values.astype(np.float64) if sound else np.empty(0)


def _curves(source: Source, options: Options, groups: Mapping[str, dict[str, FloatArray]]) -> list[Curve]:
    """Make the curves of each group from those of its columns that have the most common length."""
    curves: list[Curve] = []
    for name, columns in groups.items():
        lengths = [len(column) for column in columns.values() if len(column) >= _FEWEST]
        length = max(set(lengths), key=lambda one: (lengths.count(one), one), default=0)
        kept = {label: column for label, column in columns.items() if len(column) == length}
        if not lengths or (len(kept) < 2 and len(groups) > 1):
            continue
        called = {"name": f"{source.path.stem}, {name}"} if name and len(groups) > 1 else {}
        table = Table(list(kept), Arrays(list(kept.values())), comma=False)
        curves += table_curves(source, table, options, **called)
    source.require(curves, "holds no two columns of numbers of one length")
    return curves


MATLAB_FORMAT = declared("matlab", _read_matlab)

TDMS_FORMAT = declared("tdms", _read_tdms)
