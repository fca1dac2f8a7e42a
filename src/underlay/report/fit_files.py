"""The files that a fit leaves in a folder: its table, its full result, its pictures."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from underlay._csv_text import csv_text
from underlay._files import write_atomic
from underlay.report import plots
from underlay.report.adhesion_tables import adhesion_frame
from underlay.report.measured import beyond_loading
from underlay.report.result_rows import result_rows

if TYPE_CHECKING:
    from underlay.inference.least_squares import Fit

__all__ = ["write_fit"]


def write_fit(result: Fit, folder: Path, stem: str) -> list[Path]:
    """Write the table, the full result and the pictures of a fit; return the files.

    A curve that was measured beyond loading gets a picture of its segments.
    """
    written = [
        write_atomic(folder / f"{stem}.fit.csv", csv_text(result_rows(result))),
        result.to_json(folder / f"{stem}.fit.json"),
        plots.save(plots.fit(result), folder / f"{stem}.fit.png"),
    ]
    if result.scene.memory is not None:
        written.append(plots.save(plots.fit_in_time(result), folder / f"{stem}.time.png"))
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
