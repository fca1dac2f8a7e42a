"""A table of how a file was read: tests, points, spans in units for people, segments.

`beyond_loading` finds a curve's whole measurement, of which often the loading alone is fitted.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np
import pandas as pd

from underlay.data.readers import all_formats
from underlay.data.segments import HOLD, LOADING, UNLOADING
from underlay.inference.from_files import whole_curve
from underlay.report.tables import span

if TYPE_CHECKING:
    from underlay._arrays import FloatArray
    from underlay.data.curve import Curve

__all__ = ["beyond_loading", "format_name", "reading_table"]


def beyond_loading(part: Curve) -> Curve | None:
    """Return the whole curve that `part` was cut from, if it has points beyond loading; otherwise None.

    It is read again from the curve's file: also None where the file is no longer there.
    """
    whole = whole_curve(part)
    return whole if whole is not None and (whole.segments() != LOADING).any() else None


def format_name(curve: Curve) -> str:
    """Return the name and description of the file format a curve was read in: ``"mach1 (Biomomentum ...)"``."""
    name = str(curve.metadata["format"])
    described = next((entry.description for entry in all_formats() if entry.name == name), "")
    return name + (f" ({described})" if described else "")


def reading_table(tests: Sequence[tuple[int, Curve]]) -> pd.DataFrame:
    """Return one row per test, as text: number, name, points, spans of depth and force, points of each segment.

    Parameters
    ----------
    tests : sequence of (int, Curve)
        The number of each test in its file, from 1, and its curve as it was read.
    """
    return pd.DataFrame([_row(number, curve) for number, curve in tests])


def _row(number: int, curve: Curve) -> dict[str, object]:
    labels = curve.segments()
    counts = {label: int((labels == label).sum()) for label in (LOADING, HOLD, UNLOADING)}
    return {
        "test": number,
        "name": str(curve.metadata.get("name", "")),
        "points": len(curve),
        "depth": _span(curve.depth, "length"),
        "force": _span(curve.force, "force"),
        "segments": ", ".join(f"{label} {count}" for label, count in counts.items() if count),
    }


def _span(values: FloatArray, kind: str) -> str:
    finite = values[np.isfinite(values)]
    if not finite.size:
        return "no finite number"
    return span(float(finite.min()), float(finite.max()), kind)
