"""A film by its contact stiffness S(h): what `underlay film` finds, for the page."""

from __future__ import annotations

from typing import TYPE_CHECKING

from underlay.app.folder import AnalysisFolder
from underlay.app.kept import keep
from underlay.app.results import rows_of
from underlay.app.shown import Film, Row
from underlay.app.snapshot import Snapshot
from underlay.errors import InputError
from underlay.inference.film_from_files import fit_film
from underlay.report.film_files import write_film
from underlay.report.film_tables import film_notes, film_table
from underlay.report.labels import label
from underlay.report.spoken import spoken

if TYPE_CHECKING:
    import pandas as pd

__all__ = ["film_of", "film_rows"]

#: What the command says otherwise.
_WORDS = {
    "left of the trend with depth": "What is left of the trend with depth, once the base is in the model",
    "give --calibration": "bring a test of a known sample",
}


def film_rows(table: pd.DataFrame) -> tuple[Row, ...]:
    """Rows of `underlay film`, with every parameter called by its words."""
    return tuple(row | {"parameter": label(row["parameter"])} for row in rows_of(table))


def film_of(folder: AnalysisFolder, tested: Snapshot, base: str, modulus: str, ends: tuple[str, str]) -> Film:
    """Fit the contact stiffness of the curve that is looked at.

    Parameters
    ----------
    folder : AnalysisFolder
        Holds both files.
    tested : Snapshot
        The test; its indenter is a cone.
    base : str
        File of the test on a sample of known modulus with the same tip; empty for a perfect tip.
    modulus : str
        E / (1 - nu^2) of that sample, with its unit.
    ends : (str, str)
        Shallowest and deepest depth that count, with units.

    Raises
    ------
    CurveError, InputError
        As `underlay film`.
    """
    curve = folder.curve_file(tested.curve_name)
    if base and not modulus.strip():
        raise InputError('the known sample needs its modulus, such as "165 GPa" for (001) silicon')
    calibration = folder.curve_file(base) if base else None
    found = fit_film(tested.file, curve, calibration, modulus or None, ends)
    write_film(found, folder.results, tested.stem)
    notes = tuple(spoken(_on_the_page(note)) for note in film_notes(found, perfect=not base))
    film = Film(tested.of, notes, film_rows(film_table(found)), f"{tested.stem}.film.png")
    keep(folder, tested.stem, film)
    return film


def _on_the_page(note: str) -> str:
    for words, others in _WORDS.items():
        note = note.replace(words, others)
    return note
