"""Results on one curve for the page: its fit, its posterior, or the moduli of a film.

All results are written as plain files. Sampling reports progress, can be stopped, and continues from its stored
chain; a film is fitted to its contact stiffness S(h), as by `underlay film`.
"""

from __future__ import annotations

from dataclasses import replace

import pandas as pd

from underlay._files import write_atomic
from underlay.app.folder import AnalysisFolder, keep
from underlay.app.shown import Film, Found, Progress, Row, Sampled, each_once
from underlay.app.state import Snapshot
from underlay.app.work import Tell
from underlay.data.curve import Curve
from underlay.errors import InputError, gathered_warnings
from underlay.inference.films import fit_film
from underlay.inference.from_files import problem_from, weak_bounds
from underlay.inference.least_squares.fit_result import Fit
from underlay.inference.sampling.run import sample
from underlay.inference.uncertainty.answer import Answer
from underlay.report.details import write_fit, write_posterior
from underlay.report.film_tables import film_notes, film_table, write_film
from underlay.report.labels import label
from underlay.report.page import today
from underlay.report.page_fit import FitPage
from underlay.report.page_posterior import PosteriorPage
from underlay.report.tables import notes_of

_WALKERS, _EVERY = 64, 10
_OPEN_NOISE = "looking for where to begin; no noise is stated, so it is averaged over, which takes longer"
_UNFINISHED = "Its intervals may be wrong: press Sample again, which goes on from there, or allow more steps."


def tell_found(folder: AnalysisFolder, tested: Snapshot, result: Fit, tell: Tell) -> Found:
    """Send the numbers of a fit to the page, then all of its report; write the files that `underlay fit` writes.

    Parameters
    ----------
    folder : AnalysisFolder
        The analysis; results of an earlier fit of the curve are deleted.
    tested : Snapshot
        The scene and curve that were fitted: the form may have changed since.
    result : Fit
        The fit.
    tell : callable
        Called with a `Found` twice: with the numbers alone, then with the pictures.
    """
    for old in folder.result_files(tested.stem, (".csv", ".json", ".png"), ("found",)):
        old.unlink()
    page = FitPage(result, today())
    values = {name: _exact(result.answer(name)) for name in (*result.names, *result.derived)}
    notes = each_once(*notes_of(*result.curves))
    found = Found(tested.stem, tested.of, tested.text, values, page.head(), notes)
    tell(found)
    found = replace(found, sheet=page.sheet())
    keep(folder, tested.stem, found)
    write_fit(result, folder.results, tested.stem)
    tell(found)
    return found


def _exact(known: Answer) -> list[str]:
    """Return value, low and high end, and the ends of the statistical part (SI), with all digits."""
    numbers = (known.value, known.low, known.high, known.statistical.low, known.statistical.high)
    return [repr(float(number)) for number in numbers]


def sample_posterior(
    folder: AnalysisFolder, tested: Snapshot, curve: Curve, most: int, tell: Tell
) -> Sampled:
    """Sample until the chain has converged, `most` steps are done or a stop was asked for; write the results.

    Parameters
    ----------
    folder : AnalysisFolder
        Where chain and posterior are written; a chain of the same test and `most` is continued.
    tested : Snapshot
        The test that is sampled.
    curve : Curve
        The points to fit.
    most : int
        Maximum number of steps.
    tell : callable
        Called with a `Progress` during the run.
    """
    file, stem, of = tested.file, tested.stem, tested.of
    chain = folder.result(f"{stem}.chain.h5")
    mark = f"{of} {most}".encode()
    if folder.read_result(f"{stem}.chain.txt") != mark:
        chain.unlink(missing_ok=True)
    write_atomic(folder.result(f"{stem}.chain.txt"), mark)

    def step(done: int, needed: int, effective: float) -> None:
        if done % _EVERY == 0:
            words = f"{done} of about {needed} steps; {effective:.0f} effective samples so far"
            tell(Progress(done, needed, words))

    with gathered_warnings() as notes:
        problem = problem_from(file, curve, weak_bounds(file, curve))
        tell(Progress(0, most, _OPEN_NOISE if problem.noise_is_open else "looking for where to begin"))
        posterior = sample(problem, _WALKERS, most, backend=chain, resume=chain.exists(), progress=step)
    write_posterior(posterior, folder.results, stem)
    if not posterior.converged:
        # What the sampler warns of is the verdict already; what to do about it is not.
        notes = [_UNFINISHED, *(note for note in notes if posterior.diagnostics.reason not in note)]
    sampled = Sampled(of, PosteriorPage(posterior, today()).sheet(), each_once(*notes))
    keep(folder, stem, sampled)
    return sampled


def film_rows(table: pd.DataFrame) -> tuple[Row, ...]:
    """Return the rows of `film_table` with parameters called by their names for people."""
    rows = table.assign(parameter=[label(name) for name in table["parameter"]]).to_dict("records")
    return tuple({str(key): str(value) for key, value in row.items()} for row in rows)


def film_of(folder: AnalysisFolder, tested: Snapshot, base: str, modulus: str, ends: tuple[str, str]) -> Film:
    """Fit the moduli of a film to the contact stiffness of the selected curve.

    Parameters
    ----------
    folder : AnalysisFolder
        Holds both files.
    tested : Snapshot
        The test; its indenter is a cone.
    base : str
        File of a test on a sample of known modulus with the same tip; empty for a perfect tip.
    modulus : str
        E / (1 - nu^2) of that sample, with its unit.
    ends : (str, str)
        Shallowest and deepest depth that are fitted, with units.

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
    notes = tuple(film_notes(found, perfect=not base))
    film = Film(tested.of, notes, film_rows(film_table(found)), f"{tested.stem}.film.png")
    keep(folder, tested.stem, film)
    return film
