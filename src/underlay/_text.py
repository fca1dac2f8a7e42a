"""Makes text from a file or a name safe to show: as one printable line, or as a cell of a spreadsheet."""

from __future__ import annotations

import re
import unicodedata
from collections.abc import Iterable
from itertools import islice

# A spreadsheet takes a cell that begins with one of these, or with its full-width form, as a formula.
_SIGN = "[=+\\-@\uff1d\uff0b\uff0d\uff20]"
# Where a cell may begin inside a text: half of Europe's spreadsheets split a file with commas at semicolons.
_BEGINNING = r"(^|[;\t\r\n])"
_FORMULA = rf"(?:[^\S\t\r\n]|')*{_SIGN}"
_NUMBER = r"[^\S\t\r\n]*[+-]?(?:\d+\.?\d*|\.\d+)(?:[eE][+-]?\d+)?\s*(?:;|$)"
_DANGER = re.compile(rf"(^)(?='*[\t\r\n])|{_BEGINNING}(?!{_NUMBER})(?={_FORMULA})")
_GUARD = re.compile(rf"(^)'(?='*[\t\r\n])|{_BEGINNING}'(?={_FORMULA})")
_MOST_NAMES, _LONGEST_NAME = 20, 40
# Python represents bytes of a file name that are not UTF-8 by these code points.
_FIRST_BYTE, _LAST_BYTE = 0xDC80, 0xDCFF


def one_line(text: object, longest: int | None = None) -> str:
    r"""Return `text` as one printable line: line ends, control characters and bare bytes become escapes.

    Parameters
    ----------
    text : object
        What to show; made a string first.
    longest : int, optional
        What is longer ends in an ellipsis there.

    Examples
    --------
    >>> one_line("a\nb\udce9")
    'a\\nb\\xe9'
    """
    line = str(text)
    if longest is not None and len(line) > longest:
        line = line[: longest - 1] + "\N{HORIZONTAL ELLIPSIS}"
    return line if line.isprintable() else "".join(map(_printable, line))


def names_there(names: Iterable[object]) -> str:
    """List names that a file holds, for a message: the first twenty, each no longer than forty characters.

    Examples
    --------
    >>> names_there(["depth (nm)", "force (nN)"])
    "'depth (nm)', 'force (nN)'"
    """
    listed = [one_line(repr(name), _LONGEST_NAME) for name in islice(names, _MOST_NAMES + 1)]
    more = ["..."] if len(listed) > _MOST_NAMES else []
    return ", ".join([*listed[:_MOST_NAMES], *more]) or "nothing"


def guarded_cell(text: str) -> str:
    """Return `text` safe for a spreadsheet: an apostrophe goes before what could be read as a formula.

    That is before ``=``, ``+``, ``-``, ``@``, a tab or a line end at the beginning of the text, and before such a
    sign where a semicolon or a line end within the text could make it a beginning. Text that is a number stays as
    it is. `unguarded_cell` restores every text.

    Examples
    --------
    >>> guarded_cell("=cmd|'/C calc'!A0"), guarded_cell("-1.5")
    ("'=cmd|'/C calc'!A0", '-1.5')
    """
    return _DANGER.sub(lambda found: f"{found[0]}'", text)


def unguarded_cell(text: str) -> str:
    """Return the text from which `guarded_cell` made `text`."""
    return _GUARD.sub(lambda found: found[0][:-1], text)


def comment_line(text: str) -> str:
    """Return `text` as one comment line of a CSV table, guarded at its commas too (spreadsheets split there)."""
    return "# " + ",".join(map(guarded_cell, one_line(text).split(",")))


def _printable(character: str) -> str:
    if character.isprintable():
        return character
    if unicodedata.category(character) == "Zs":
        return " "
    code = ord(character)
    if _FIRST_BYTE <= code <= _LAST_BYTE:
        return f"\\x{code & 0xFF:02x}"
    return character.encode("unicode_escape").decode("ascii")
