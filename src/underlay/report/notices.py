"""Warnings that are held back until a result is shown, and text of unknown origin inside Markdown."""

from __future__ import annotations

import re
import warnings
from collections.abc import Iterator
from contextlib import contextmanager

from underlay._text import one_line
from underlay.errors import UnderlayWarning

__all__ = ["gathered_warnings", "markdown_text"]

# Marks of Markdown, of HTML and of addresses that become links by themselves. One underscore between letters,
# as file names have it, marks nothing. A dollar or a backslash would still begin mathematics in a notebook
# if it were written as an entity: only code is left alone there.
_MARKS = re.compile(r"[`*\[\]<>&~!|#@]|(?<![^\W_])_|_(?![^\W_])|(?<=:)/|(?<=www)\.", re.IGNORECASE)
_MATHEMATICS = re.compile(r"[$\\]+")


def markdown_text(text: object, longest: int | None = None) -> str:
    """Return `text` as one line of Markdown that shows it literally: no markup, no link, no formula.

    Parameters
    ----------
    text : object
        Text from a file, or a name.
    longest : int, optional
        Number of characters to which it is cut; as in `one_line`.
    """
    plain = _MARKS.sub(lambda mark: f"&#{ord(mark[0])};", one_line(text, longest))
    return _MATHEMATICS.sub(lambda mark: f"`{mark[0]}`", plain)


@contextmanager
def gathered_warnings() -> Iterator[list[str]]:
    """Collect this package's warnings inside a ``with`` block into the list it gives; others are raised after it.

    The list is filled when the block ends.
    """
    texts: list[str] = []
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always", UnderlayWarning)
        yield texts
    for entry in caught:
        if issubclass(entry.category, UnderlayWarning):
            texts.append(str(entry.message))
        else:
            warnings.warn_explicit(entry.message, entry.category, entry.filename, entry.lineno)
