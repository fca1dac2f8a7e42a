"""Words of unknown origin inside Markdown."""

from __future__ import annotations

import re

from underlay._text import one_line

__all__ = ["markdown_text"]

# Marks of Markdown, of HTML and of addresses that become links by themselves. One underscore between letters,
# as file names have it, marks nothing. A dollar or a backslash would still begin mathematics in a notebook
# if it were written as an entity: only code is left alone there.
_MARKS = re.compile(r"[`*\[\]<>&~!|#@]|(?<![^\W_])_|_(?![^\W_])|(?<=:)/|(?<=www)\.", re.IGNORECASE)
_MATHEMATICS = re.compile(r"[$\\]+")


def markdown_text(text: object, longest: int | None = None) -> str:
    """Return `text` as one line of Markdown that shows it as it is: no markup, no link, no formula.

    Parameters
    ----------
    text : object
        Words from a file or a name.
    longest : int, optional
        As in `one_line`.
    """
    plain = _MARKS.sub(lambda mark: f"&#{ord(mark[0])};", one_line(text, longest))
    return _MATHEMATICS.sub(lambda mark: f"`{mark[0]}`", plain)
