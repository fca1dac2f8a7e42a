"""What was measured besides the points that were used: shown in a report, not fitted."""

from __future__ import annotations

from string import Template
from typing import TYPE_CHECKING

from underlay.data.segments import LOADING
from underlay.inference.from_files import whole_curve
from underlay.report.notebook import template_text

if TYPE_CHECKING:
    from collections.abc import Mapping

    from underlay.data.curve import Curve

__all__ = ["beyond_loading", "segments_part"]


def beyond_loading(part: Curve) -> Curve | None:
    """Return the whole curve of which `part` was taken, if it holds more than loading and its file is there."""
    whole = whole_curve(part)
    return whole if whole is not None and (whole.segments() != LOADING).any() else None


def segments_part(files: Mapping[int, str] | None) -> str:
    """Return the part of a notebook that draws the segments of whole curves.

    Parameters
    ----------
    files : mapping of int to str, or None
        Files of whole curves by number of the curve, from 1; nothing is drawn of none. None: the one curve of
        the notebook's problem is read again as its scene file says.
    """
    if files is None:
        source = (
            "from underlay.inference.from_files import whole_curve\n\n"
            "measured = {1: whole_curve(problem.curves[0])}"
        )
    elif files:
        pairs = ", ".join(f"{number}: ul.read({file!r})" for number, file in files.items())
        source = f"measured = {{{pairs}}}"
    else:
        return ""
    return Template(template_text("segments")).substitute(measured=source)
