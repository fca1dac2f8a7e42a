"""Corrections from the literature, to reproduce results obtained with them and to see their error.

One correction, one entry of ``corrections.toml``: equation, assumptions, range, source, measured error; and its
function in `formulas` where it is more than a polynomial. To add one: an entry, and its function.
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
