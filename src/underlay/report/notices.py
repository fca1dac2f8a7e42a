"""Words of the library and of files on their way to people: warnings kept for a result, text inside Markdown.

`gathered_warnings` keeps warnings until the result that they belong to is shown; `markdown_text` shows words of
unknown origin as they are.
"""

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


@contextmanager
def gathered_warnings() -> Iterator[list[str]]:
    """Collect our own warnings while something is worked out, to show them after its result."""
    texts: list[str] = []
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always", UnderlayWarning)
        yield texts
    for entry in caught:
        if issubclass(entry.category, UnderlayWarning):
            texts.append(str(entry.message))
        else:
            warnings.warn_explicit(entry.message, entry.category, entry.filename, entry.lineno)
