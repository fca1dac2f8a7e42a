"""Curves that underlay itself wrote, read back from JSON and HDF5 (`underlay.data.export`).

A file that says it is ours may have been changed: of what it says about its curve, only what is of the right
kind is taken (`underlay.data.export.restored`).
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from underlay._arrays import FloatArray
from underlay._door import parse_json, understood
from underlay.data.curve import Curve
from underlay.data.export import HDF5_MARK, restored
from underlay.data.readers._format import Options, declared, make_curve
from underlay.data.readers._hdf5 import curve_groups, is_own, open_checked
from underlay.data.readers._source import CURVES, Source
from underlay.data.readers._text import decode

__all__ = ["HDF5_FORMAT", "JSON_FORMAT"]

_SIGNS = {"depth": "as exported", "force": "as exported"}


def _is_json(head: str) -> bool:
    return head.startswith("{") and f'"{HDF5_MARK}"' in head


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


JSON_FORMAT = declared("json", _read_json, lambda source: _is_json(source.head(400).lstrip()))

HDF5_FORMAT = declared("hdf5", _read_hdf5, is_own)
