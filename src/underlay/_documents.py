"""JSON and TOML from files: neither nested nor filled beyond reason, and no integer beyond 64 bits.

Python's parsers take a hundred thousand brackets, keys of twenty thousand parts and integers of four thousand
digits, and whoever walks, prints or converts the result later fails on them.
"""

from __future__ import annotations

import json
import re
import tomllib
from collections.abc import Iterator
from typing import Any

__all__ = ["parse_json", "parse_toml"]

# Our own files nest about ten deep; what is walked by recursion later must stay far from Python's limit.
_DEEPEST = 50
# An empty list takes 60 bytes of memory for its two in the text, so their number is bounded too.
_MOST_CONTAINERS = 2_000_000
_LONGEST_INTEGER = 20  # digits: the largest of 64 bits has 20
_LONGEST_KEY = (
    16  # parts of a dotted key: a scene file has three, and the time of tomllib grows as their square
)
# Strings and comments of TOML, whose dots are no parts of a key. One without an end takes the rest, so that
# no place is looked at twice: tomllib refuses it anyhow.
_TOML_TEXT = re.compile(
    r'"""(?:[^\\"]|\\.|"(?!""))*+(?:"""|\Z)|\'\'\'.*?(?:\'\'\'|\Z)'
    r'|"(?:[^"\\\n]|\\[^\n])*+"?|\'[^\'\n]*+\'?|#[^\n]*+',
    re.DOTALL,
)
_LONG_KEY = re.compile(rf"(?<![\w-])(?:[\w-]++[ \t]*+\.[ \t]*+){{{_LONGEST_KEY}}}")
_LONG_NUMBER = re.compile(rf"(?<![\w.])\d[\d_]{{{_LONGEST_INTEGER},}}+(?![\w.])")


def parse_json(text: str) -> Any:
    """Read JSON that is neither nested nor filled beyond reason; for use inside `understood`.

    Raises
    ------
    ValueError, RecursionError
        If it is not JSON, or goes beyond the bounds.
    """
    if text.count("[") + text.count("{") > _MOST_CONTAINERS:
        raise ValueError(f"more than {_MOST_CONTAINERS} lists and tables")
    return _checked(json.loads(text, parse_int=_integer))


def parse_toml(text: str) -> dict[str, Any]:
    """Read TOML whose keys and tables are not nested beyond reason; for use inside `understood`.

    Raises
    ------
    ValueError, RecursionError
        If it is not TOML, or goes beyond the bounds.
    """
    bare = _TOML_TEXT.sub("s", text)
    if _LONG_KEY.search(bare):
        raise ValueError(f"a key has more than {_LONGEST_KEY} parts")
    if _LONG_NUMBER.search(bare):
        raise ValueError(f"an integer of more than {_LONGEST_INTEGER} digits")
    document: dict[str, Any] = _checked(tomllib.loads(text))
    return document


def _integer(digits: str) -> int:
    if len(digits) > _LONGEST_INTEGER:
        raise ValueError(f"an integer of {len(digits)} digits")
    return int(digits)


def _checked(document: Any) -> Any:
    """Refuse what is nested too deeply or holds an integer that no number here can be."""
    level, deep = [document], 0
    while level:
        deep += 1
        if deep > _DEEPEST:
            raise ValueError(f"nested more than {_DEEPEST} deep")
        below: list[Any] = []
        for part in level:
            below += _containers(part)
        level = below
    return document


def _containers(part: Any) -> Iterator[Any]:
    values = part.values() if isinstance(part, dict) else part if isinstance(part, list) else (part,)
    for value in values:
        if isinstance(value, dict | list):
            yield value
        elif type(value) is int and abs(value) >> 64:
            raise ValueError("an integer beyond 64 bits")
