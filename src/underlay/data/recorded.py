"""Which instrument recorded a curve, and when, in the words of its file."""

from __future__ import annotations

from collections.abc import Mapping

from underlay._text import one_line
from underlay.data.curve import Curve

__all__ = ["RECORDED", "recorded"]

#: How a copy of a curve says it in a comment.
RECORDED = "recorded: "
# Entries of a file's header, in the order they are told; what a file calls them, in lower case.
_ENTRIES = (("device", "instrument"), ("software version",), ("date",), ("time",))


def recorded(curve: Curve) -> str:
    """Return instrument, software, date and time as the file writes them; empty where it says none of it.

    Examples
    --------
    >>> from underlay import Curve
    >>> recorded(Curve([0.0, 1e-6], [0.0, 1e-6], metadata={"header": {"Device": "Chiaro", "Date": "12/05/2025"}}))
    'Chiaro, 12/05/2025'
    """
    for comment in curve.metadata.get("comments", ()):
        if str(comment).startswith(RECORDED):
            return str(comment)[len(RECORDED) :]
    header = curve.metadata.get("header", {})
    if not isinstance(header, Mapping):
        return ""
    told = {str(key).strip().lower(): one_line(value).strip() for key, value in header.items()}
    found = [next((told[word] for word in words if told.get(word)), "") for words in _ENTRIES]
    return ", ".join(text for text in found if text)
