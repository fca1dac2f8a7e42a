"""A curve as the text of a plain table that `read` takes back."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np

from underlay._text import comment_line
from underlay.data.curve import Curve
from underlay.units import human_unit

__all__ = ["curve_csv"]

# Seven digits: a ten-thousandth of the finest noise, and the same text wherever the last bit of a force
# comes out differently.
_FORMAT = "{:.7g}"


def curve_csv(curve: Curve, comments: Iterable[str] = ()) -> str:
    """Return `curve` as comma-separated text with names and units in the header.

    Parameters
    ----------
    curve : Curve
        What to write: time (where there is one), depth, force and segment.
    comments : iterable of str
        Lines written above the header behind ``#``.
    """
    columns: list[tuple[str, list[str]]] = []
    for name, kind, values in (
        ("time", "time", curve.time),
        ("depth", "length", curve.depth),
        ("force", "force", curve.force),
    ):
        if values is not None:
            unit, factor = human_unit(float(np.max(np.abs(values))), kind)
            columns.append((f"{name} ({unit})", [_FORMAT.format(value) for value in values / factor]))
    if curve.segment is not None:
        columns.append(("segment", [str(label) for label in curve.segment]))
    lines = [comment_line(comment) for comment in comments]
    lines.append(",".join(name for name, _ in columns))
    lines += [",".join(row) for row in zip(*(cells for _, cells in columns), strict=True)]
    return "\n".join(lines) + "\n"
