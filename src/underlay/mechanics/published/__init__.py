"""Corrections from the literature, to reproduce results obtained with them and to see their error.

One correction, one file: formula, assumptions, range, source, measured error. To add one: a file with a
`PublishedCorrection` (`correction`), and its line in the list of `law`.
"""

from underlay.mechanics.published.correction import OutOfRange, PublishedCorrection
from underlay.mechanics.published.law import (
    PublishedLaw,
    published_corrections,
    published_law,
    published_names,
)

__all__ = [
    "OutOfRange",
    "PublishedCorrection",
    "PublishedLaw",
    "published_corrections",
    "published_law",
    "published_names",
]
