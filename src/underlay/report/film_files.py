"""The files that the fit of a film leaves in a folder: its moduli, what was measured at each depth, its picture."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from underlay._csv_text import csv_text
from underlay._files import write_atomic
from underlay.report import plots
from underlay.report.film_tables import film_by_depth, film_moduli

if TYPE_CHECKING:
    from underlay.inference.films import StiffnessFit

__all__ = ["write_film"]


def write_film(found: StiffnessFit, folder: Path, stem: str) -> list[Path]:
    """Write both tables and the picture of a film; return the files."""
    return [
        write_atomic(folder / f"{stem}.film.csv", csv_text(film_moduli(found))),
        write_atomic(folder / f"{stem}.film.depths.csv", csv_text(film_by_depth(found))),
        plots.save(plots.film(found), folder / f"{stem}.film.png"),
    ]
