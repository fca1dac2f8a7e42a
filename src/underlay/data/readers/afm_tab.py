"""Tables (.tab) of afmformats: metadata as JSON behind ``#``, a row of names behind ``#``, and SI numbers.

Read here and not by that package, which opens a path of its own and takes the metadata as they are.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

from underlay._arrays import FloatArray
from underlay._documents import parse_json
from underlay._text import names_there
from underlay.data.readers._source import Source
from underlay.data.readers._text import lines_of, numbers
from underlay.errors import FileFormatError

__all__ = ["TAB_MARK", "read_tab"]

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
