"""What is said of a curve before anything is fitted to it: how it was read, how good it is, what its file found."""

from __future__ import annotations

import numpy as np
import pandas as pd

from underlay.app.shown import Row
from underlay.data.curve import Curve
from underlay.data.quality import check_quality
from underlay.report.spoken import spoken
from underlay.scene.scene_file import SceneFile
from underlay.units import format_quantity, printed

__all__ = ["printed_rows", "quality_of", "spoken_once", "vendor_words"]

_SPANS = ("depth", "force")


def spoken_once(*messages: str) -> tuple[str, ...]:
    """Each message once, in the words of the page."""
    return tuple(dict.fromkeys(map(spoken, messages)))


def quality_of(curve: Curve, file: SceneFile) -> tuple[str, list[str]]:
    """Verdict on a curve, and what speaks against it."""
    quality = check_quality(curve, file.draft)
    return quality.verdict, list(quality.reasons)


def vendor_words(curve: Curve) -> str:
    """What the instrument itself found, in words."""
    reduced = curve.metadata.get("instrument_reduced_modulus")
    if not isinstance(reduced, int | float) or isinstance(reduced, bool) or not np.isfinite(reduced):
        return ""
    return f"{format_quantity(float(reduced), 'pressure')} (reduced modulus)"


def printed_rows(table: pd.DataFrame) -> tuple[Row, ...]:
    """Rows for a page: spans with their units as printed, what a file calls its tests as it does."""
    return tuple(
        {str(key): printed(str(value)) if key in _SPANS else str(value) for key, value in row.items()}
        for row in table.to_dict("records")
    )
