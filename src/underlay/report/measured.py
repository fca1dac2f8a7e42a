"""What was measured besides the points that were used: shown in a report, not fitted."""

from __future__ import annotations

from typing import TYPE_CHECKING

from underlay.data.segments import LOADING
from underlay.inference.from_files import whole_curve
from underlay.report.notebook import Cell, Source, filled

if TYPE_CHECKING:
    from collections.abc import Mapping

    from underlay.data.curve import Curve

__all__ = ["beyond_loading", "segments_of_file", "segments_part"]


def beyond_loading(part: Curve) -> Curve | None:
    """Return the whole curve of which `part` was taken, if it holds more than loading and its file is there."""
    whole = whole_curve(part)
    return whole if whole is not None and (whole.segments() != LOADING).any() else None


def segments_part(files: Mapping[int, str]) -> tuple[Cell, ...]:
    """Return the part of a notebook that draws the segments of whole curves.

    Parameters
    ----------
    files : mapping of int to str
        Files of whole curves by number of the curve, from 1; nothing is drawn of none.
    """
    if not files:
        return ()
    pairs = ", ".join(f"{number}: ul.read({file!r})" for number, file in files.items())
    return filled("segments", {"measured": Source(f"measured = {{{pairs}}}")})


def segments_of_file() -> tuple[Cell, ...]:
    """Return that part for the one curve of the notebook's problem, read again as its scene file says."""
    source = (
        "from underlay.inference.from_files import whole_curve\n\n"
        "measured = {1: whole_curve(problem.curves[0])}"
    )
    return filled("segments", {"measured": Source(source)})
