"""What people type that can be taken in two ways: commas between numbers and in them."""

from __future__ import annotations

import re

from underlay.errors import InputError

__all__ = ["comma_problem", "pairs_of"]

# A comma with a digit on each side: of 0.45, of 45 thousand, or between 0 and 45.
_COMMA = re.compile(r"\d*,\d+(?:,\d+)*")


def comma_problem(text: str, *, may_list: bool = True) -> str:
    """Return what is wrong with the commas of a number, or of a list of numbers; empty if nothing is.

    Examples
    --------
    >>> comma_problem("0,45 MPa")
    "write numbers with a point, such as 0.45, and thousands without a comma; got '0,45'"
    >>> comma_problem("0.4, 0.3"), comma_problem("0.4,")
    ('', '')
    """
    found = _COMMA.search(text)
    if found is None and (may_list or "," not in text):
        return ""
    got = text.strip() if found is None else found[0]
    words = f"write numbers with a point, such as 0.45, and thousands without a comma; got {got[:40]!r}"
    listed = found is not None and may_list and "," in text.replace(found[0], "", 1)
    return f"{words}; where several numbers stand, put a space behind each comma" if listed else words


def pairs_of(text: str) -> dict[str, str]:
    """Return names and values of a text such as ``"depth = h (nm), force = F (mN)"``.

    Raises
    ------
    InputError
        If a part of it has no ``=``, or a number a comma: nothing is left out without a word.
    """
    wrong = comma_problem(text)
    if wrong:
        raise InputError(wrong)
    pairs = {}
    for part in filter(None, map(str.strip, text.split(","))):
        name, equals, value = (piece.strip() for piece in part.partition("="))
        if not (name and equals and value):
            raise InputError(
                f"write name = value, with commas between; got {part[:60]!r} (what holds a comma itself can be "
                "written in the test as text, step 2)"
            )
        pairs[name] = value
    return pairs
