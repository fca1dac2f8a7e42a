"""Numbers that other programs keep in binary files: MATLAB's .mat and National Instruments' .tdms (Optics11).

Their columns have names, and those of .tdms units; what lacks a unit gets it from a column mapping. A file is looked
over before a library reads it: no part of it may claim more numbers than it has bytes.
"""

from __future__ import annotations

import io
import struct
import zlib
from collections.abc import Iterator, Sequence
from importlib import import_module
from typing import Any

import numpy as np

from underlay._arrays import FloatArray
from underlay._door import understood
from underlay.data.curve import Curve
from underlay.data.readers._format import Format, Options
from underlay.data.readers._source import CURVES, MAX_BYTES, Source
from underlay.data.readers._table import Table, table_curves
from underlay.data.readers._text import Arrays
from underlay.errors import FileFormatError, MissingExtraError

__all__ = ["MATLAB_FORMAT", "TDMS_FORMAT"]

_MATLAB, _TDMS = b"MATLAB 5.0 MAT-file", b"TDSm"
# MAT-file format (MathWorks, "MAT-File Format", level 5): types of elements, and classes of arrays.
_MATRIX, _COMPRESSED = 14, 15
_STRUCT, _FIRST_NUMBER, _LAST_NUMBER = 2, 6, 15
_HEADER, _TAG, _MOST_DIMENSIONS, _DEEPEST = 128, 8, 8, 4
_FEWEST, _MOST_COLUMNS = 3, 256


def _sniff_matlab(source: Source) -> bool:
    return source.data.startswith(_MATLAB)


def _read_matlab(source: Source, options: Options) -> list[Curve]:
    from scipy.io import loadmat  # noqa: PLC0415  takes a tenth of a second to load

    with understood(source.name, CURVES):
        sound = _checked_matlab(source)
        content = loadmat(io.BytesIO(sound), squeeze_me=True, struct_as_record=True)
        columns = dict(_columns("", {key: content[key] for key in content if not key.startswith("__")}, 0))
    return _curves(source, options, [("", columns)])


def _checked_matlab(source: Source) -> bytes:
    """The arrays of numbers of a file and structures of them, unpacked: nothing that claims more than it holds."""
    order = {b"IM": "<", b"MI": ">"}.get(source.data[126:128])
    if order is None:
        raise FileFormatError(f"{source.name} starts as a MATLAB file but its header is damaged")
    kept, size = [source.data[:_HEADER]], 0
    for kind, body, whole in _elements(source.data[_HEADER:], order):
        element = whole
        if kind == _COMPRESSED:
            stream = zlib.decompressobj()
            element = stream.decompress(body, MAX_BYTES - size + 1)
        size += len(element)
        if size > MAX_BYTES:
            raise FileFormatError(f"{source.name} unpacks to more than {MAX_BYTES // 1_000_000} MB")
        inner = next(_elements(element, order), None)
        if inner is not None and inner[0] == _MATRIX and _is_sound(inner[1], order, 0):
            kept.append(element)
    return b"".join(kept)


def _elements(data: bytes, order: str) -> Iterator[tuple[int, bytes, bytes]]:
    """Type, content and all bytes of each element."""
    at = 0
    while at + _TAG <= len(data):
        kind, size = struct.unpack_from(f"{order}II", data, at)
        if kind >> 16:  # up to four bytes are kept in the tag
            yield kind & 0xFFFF, data[at + 4 : at + 4 + min(kind >> 16, 4)], data[at : at + _TAG]
            at += _TAG
            continue
        end = at + _TAG + size
        if end > len(data):
            return
        padded = end if kind == _COMPRESSED else end + -size % 8
        yield kind, data[at + _TAG : end], data[at:padded]
        at = padded


def _is_sound(matrix: bytes, order: str, deep: int) -> bool:
    """Whether a matrix is of real numbers, or one structure of such, and holds as many as its size says."""
    parts = list(_elements(matrix, order))
    if len(parts) < 4 or len(parts[0][1]) < 4 or deep > _DEEPEST:
        return False
    flags = struct.unpack_from(f"{order}I", parts[0][1])[0]
    kind, is_complex = flags & 0xFF, bool(flags & 0x800)
    dimensions = parts[1][1]
    count = 1
    for number in struct.unpack(f"{order}{len(dimensions) // 4}i", dimensions[: len(dimensions) // 4 * 4]):
        count *= number
    if not 0 < count <= len(matrix) or len(dimensions) // 4 > _MOST_DIMENSIONS:
        return False
    if _FIRST_NUMBER <= kind <= _LAST_NUMBER:
        return not is_complex and len(parts) == 4
    # Flags, size, name, length of a field's name, names, and one matrix a field.
    return (
        kind == _STRUCT
        and count == 1
        and all(part[0] == _MATRIX and _is_sound(part[1], order, deep + 1) for part in parts[5:])
    )


def _columns(name: str, content: Any, deep: int) -> Iterator[tuple[str, FloatArray]]:
    """Columns of numbers by name, those of structures and of matrices too."""
    if isinstance(content, dict):
        for key, value in content.items():
            yield from _columns(f"{name}.{key}" if name else str(key), value, deep)
        return
    array = np.asarray(content)
    if array.dtype.names and deep < _DEEPEST and array.size == 1:
        record = array.reshape(-1)[0]
        yield from _columns(name, {key: record[key] for key in array.dtype.names}, deep + 1)
    elif array.dtype.kind in "fiu" and array.ndim == 1 and len(array) >= _FEWEST:
        yield name, array.astype(np.float64)
    elif array.dtype.kind in "fiu" and array.ndim == 2 and min(array.shape) <= _MOST_COLUMNS:
        longer = array if array.shape[0] >= array.shape[1] else array.T
        for at in range(longer.shape[1]):
            yield f"{name} {at + 1}", np.array(longer[:, at], dtype=np.float64)


def _sniff_tdms(source: Source) -> bool:
    return source.data.startswith(_TDMS)


def _read_tdms(source: Source, options: Options) -> list[Curve]:
    try:
        library = import_module("nptdms")
    except ImportError as error:
        raise MissingExtraError(
            f"{source.name} is a TDMS file, as Optics11 writes; reading it needs the package npTDMS: pip install "
            '"underlay[afm]", or export the curve as text from the instrument\'s program'
        ) from error
    with understood(source.name, CURVES):
        file = library.TdmsFile.read_metadata(io.BytesIO(source.data))
        claimed = sum(len(channel) for group in file.groups() for channel in group.channels())
        if claimed > len(source.data):
            raise FileFormatError(f"it claims {claimed} numbers and holds {len(source.data)} bytes")
        file = library.TdmsFile.read(io.BytesIO(source.data))
        groups = [
            (str(group.name), {_tdms_label(channel): _numbers(channel[:]) for channel in group.channels()})
            for group in file.groups()
        ]
    return _curves(
        source, options, [(name, {k: v for k, v in found.items() if len(v)}) for name, found in groups]
    )


def _tdms_label(channel: Any) -> str:
    unit = str(channel.properties.get("unit_string", "") or channel.properties.get("NI_UnitDescription", ""))
    name = str(channel.name)
    return f"{name} ({unit})" if unit and unit not in name else name


def _numbers(values: Any) -> FloatArray:
    array = np.asarray(values)
    return array.astype(np.float64) if array.dtype.kind in "fiu" and array.ndim == 1 else np.empty(0)


def _curves(
    source: Source, options: Options, groups: Sequence[tuple[str, dict[str, FloatArray]]]
) -> list[Curve]:
    """One curve of each group of columns: those of the length that most of them have."""
    curves: list[Curve] = []
    for name, columns in groups:
        lengths = [len(column) for column in columns.values() if len(column) >= _FEWEST]
        if not lengths:
            continue
        length = max(set(lengths), key=lambda one: (lengths.count(one), one))
        kept = {label: column for label, column in columns.items() if len(column) == length}
        if len(kept) < 2 and len(groups) > 1:
            continue
        called = f"{source.path.stem}, {name}" if name and len(groups) > 1 else None
        table = Table(list(kept), Arrays(list(kept.values())), may_use_comma=False)
        curves += table_curves(source, table, options, **({"name": called} if called else {}))
    if not curves:
        raise FileFormatError(f"{source.name} holds no two columns of numbers of one length")
    return curves


MATLAB_FORMAT = Format(
    name="matlab",
    description="columns of numbers in MATLAB files (.mat, up to version 7)",
    sniff=_sniff_matlab,
    read_all=_read_matlab,
    takes_columns=True,
    takes_calibration=True,
)

TDMS_FORMAT = Format(
    name="tdms",
    description="National Instruments TDMS files, as newer Optics11 instruments write (.tdms)",
    sniff=_sniff_tdms,
    read_all=_read_tdms,
    extra="afm",
    takes_columns=True,
    takes_calibration=True,
)
