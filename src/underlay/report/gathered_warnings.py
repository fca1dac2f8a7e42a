"""Our own warnings, kept until the result that they belong to is shown."""

from __future__ import annotations

import warnings
from collections.abc import Iterator
from contextlib import contextmanager

from underlay.errors import UnderlayWarning

__all__ = ["gathered_warnings"]


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
