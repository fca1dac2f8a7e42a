"""The files that a fit writes into a folder: its table, its full result, its pictures, and the modulus by depth."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
import pandas as pd

from underlay._csv import csv_text
from underlay._files import write_atomic
from underlay.errors import UnderlayError
from underlay.inference.pointwise.modulus import modulus_by_depth
from underlay.inference.pointwise.result import ModulusCurve, PointwiseModulus
from underlay.report import plots
from underlay.report.adhesion_tables import adhesion_frame
from underlay.report.screen import interval_text
from underlay.report.tables import beyond_loading, labelled_table
from underlay.units import format_quantity, human_unit, printed, printed_unit

if TYPE_CHECKING:
    from underlay.inference.least_squares.fit_result import Fit

__all__ = ["pointwise_of", "pointwise_sentence", "pointwise_table", "write_fit"]

# Rows of a table that is read and not plotted.
_ROWS = 10


def pointwise_of(result: Fit) -> list[PointwiseModulus | str]:
    """Return for every curve of a fit the modulus at each depth or, as text, the reason why there is none."""
    found: list[PointwiseModulus | str] = []
    for curve in range(len(result.curves)):
        try:
            found.append(modulus_by_depth(result, curve=curve))
        except UnderlayError as error:
            found.append(str(error))
    return found


def pointwise_sentence(found: PointwiseModulus | str) -> str:
    """Say at how many depths the modulus read there agrees with the fit's, and what a half-space would give.

    `found` is the modulus at each depth, or the reason why there is none.
    """
    if isinstance(found, str):
        return f"Not read depth by depth: {found}."
    layer, bare = found.apparent, found.apparent_halfspace
    held = int(np.count_nonzero((layer.low <= layer.expected) & (layer.expected <= layer.high)))
    whose = "what the fit's modulus has relaxed to by then" if found.relaxing else "the fit's modulus"
    text = (
        f"Read from the force at each depth, the {100.0 * found.level:.0f} % interval holds {whose}, "
        f"{format_quantity(float(layer.expected[-1]), 'pressure')}, at {held} of {len(found.depth)} depths."
    )
    if not found.layered:
        return text
    first, last = (
        f"{format_quantity(float(bare.modulus[end]), 'pressure')} at "
        f"{format_quantity(float(found.depth[end]), 'length')}"
        for end in (0, -1)
    )
    return printed(f"{text} The formula of a half-space reads {first} and {last}.")


def pointwise_table(found: PointwiseModulus) -> pd.DataFrame:
    """Return the modulus at ten of the depths, as text with intervals: from the force and from the slope.

    Where the scene has a layer, columns with the modulus by the half-space formula are added.
    """
    unit, metre = human_unit(float(found.depth[-1]), "length")
    length = printed_unit(unit)
    name, pascal = human_unit(float(found.apparent.expected[-1]), "pressure")
    what = ", layer in the model" if found.layered else ""
    rows = []
    for n in np.unique(np.linspace(0, len(found.depth) - 1, _ROWS).round().astype(int)):
        row = {
            f"depth ({length})": f"{found.depth[n] / metre:.3g}",
            "points": f"{found.points[n]:.0f}",
            f"from the force{what} ({name})": _cell(found.apparent, n, pascal),
            f"from the slope{what} ({name})": _cell(found.incremental, n, pascal),
        }
        if found.layered:
            bare = found.apparent_halfspace
            row[f"from the force, half-space ({name})"] = _cell(bare, n, pascal)
            row["half-space, were the model right"] = f"{bare.expected[n] / pascal:.4g}"
        rows.append(row)
    return labelled_table(rows)


def _cell(curve: ModulusCurve, n: int, pascal: float) -> str:
    value, low, high = (float(column[n]) / pascal for column in (curve.modulus, curve.low, curve.high))
    return "none" if np.isnan(value) else interval_text(value, low, high, "dimensionless")


def write_fit(result: Fit, folder: Path, stem: str) -> list[Path]:
    """Write the table (CSV), the full result (JSON) and the pictures of a fit; return the paths of the files.

    They begin with `stem`. What is written depends on the scene: relaxation, drainage and adhesion have pictures of
    their own. A curve that was measured beyond loading gets a picture of its segments.
    """
    # Not loaded by a page, which needs the words and tables of this module alone.
    from underlay.report.excel import result_rows  # noqa: PLC0415  see above

    written = [
        write_atomic(folder / f"{stem}.fit.csv", csv_text(result_rows(result))),
        result.to_json(folder / f"{stem}.fit.json"),
        plots.save(plots.fit(result), folder / f"{stem}.fit.png"),
    ]
    by_depth = pointwise_of(result)[0]
    if isinstance(by_depth, PointwiseModulus):
        written.append(write_atomic(folder / f"{stem}.depth.csv", csv_text(by_depth.table)))
    if result.scene.memory is not None:
        written.append(plots.save(plots.fit_in_time(result), folder / f"{stem}.time.png"))
    if result.scene.layer.material.drains:
        written.append(plots.save(plots.drainage(result), folder / f"{stem}.drainage.png"))
    if result.scene.layer.relaxation is not None:
        written.append(plots.save(plots.relaxation(result), folder / f"{stem}.relaxation.png"))
    if result.scenes[0].adhesion is not None:
        table = csv_text(adhesion_frame(result))
        written.append(write_atomic(folder / f"{stem}.adhesion.csv", table))
        written.append(plots.save(plots.adhesion(result), folder / f"{stem}.adhesion.png"))
    whole = beyond_loading(result.curves[0])
    if whole is not None:
        written.append(plots.save(plots.segments(whole), folder / f"{stem}.segments.png"))
    return written
