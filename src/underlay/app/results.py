"""What was found on one curve, its posterior, or a film, as the page shows it.

What was found on one curve, as the page shows it: words, tables, pictures; kept as plain files.

The posterior of the curve that is looked at: with progress, a stop, and a chain that goes on from there.

A film by its contact stiffness S(h): what `underlay film` finds, for the page.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from typing import Any

import numpy as np
import pandas as pd

from underlay._csv import csv_text
from underlay._files import write_atomic
from underlay.app.folder import AnalysisFolder, keep
from underlay.app.shown import Film, Found, Progress, Row, Sampled
from underlay.app.state import Snapshot
from underlay.app.work import Tell
from underlay.data.curve import Curve
from underlay.errors import InputError, UnderlayError
from underlay.inference.films import fit_film
from underlay.inference.from_files import problem_from, weak_bounds
from underlay.inference.least_squares.fit_result import Fit
from underlay.inference.pointwise.result import PointwiseModulus
from underlay.inference.problem import Problem
from underlay.inference.sampling.run import sample
from underlay.inference.uncertainty.answer import Answer
from underlay.report import plots
from underlay.report.film_tables import film_notes, film_table, write_film
from underlay.report.fit_files import pointwise_of, pointwise_sentence, write_fit
from underlay.report.labels import label, labelled
from underlay.report.limits import advice, quality_doubts, reservations, rivals
from underlay.report.posterior_tables import posterior_table
from underlay.report.scene_tables import ledger_in_words
from underlay.report.screen import budget_words, told_names
from underlay.report.spoken import gathered_warnings, spoken
from underlay.report.tables import interval_table
from underlay.report.words import headline, posterior_summary, verdict_sentence
from underlay.scene.effects import effects_table
from underlay.units import printed

__all__ = ["film_of", "film_rows", "rows_of", "sample_posterior", "tell_found"]


def tell_found(
    folder: AnalysisFolder, tested: Snapshot, problem: Problem, result: Fit, notes: list[str], tell: Tell
) -> Found:
    """Put a fit into words, tables and pictures; each part is kept and told when it is there.

    Parameters
    ----------
    tested : Snapshot
        What the fit began with: the form may say something else by now.
    """
    for old in folder.result_files(tested.stem, (".csv", ".json", ".png"), ("found",)):
        old.unlink()
    found = Found(tested.stem, tested.of, tested.text)
    for more in _parts(folder, tested.stem, problem, result, notes):
        found = replace(found, **more)
        keep(folder, tested.stem, found)
        tell(found)
    return found


def _parts(
    folder: AnalysisFolder, stem: str, problem: Problem, result: Fit, notes: list[str]
) -> Iterator[dict[str, Any]]:
    """The parts of `Found`, quickest first."""
    yield {
        "headline": spoken(headline(result)),
        "verdict": printed(spoken(verdict_sentence(result))),
        "values": {name: _exact(result.answer(name)) for name in (*result.names, *result.derived)},
        "table": rows_of(interval_table(result)),
    }
    doubts = [*quality_doubts(problem), *reservations(result, notes)]
    yield {"doubts": tuple(dict.fromkeys(_named(doubt, result) for doubt in doubts))}
    written = write_fit(result, folder.results, stem)
    yield {"pictures": tuple(path.name for path in written if path.suffix == ".png")}
    yield from _by_depth(folder, result, [path.name for path in written if path.suffix == ".png"], stem)
    told = [_sources(result), *rivals(result), *advice(result)]
    yield {"more": tuple(_named(sentence, result) for sentence in told if sentence)}
    try:
        scene = result.scenes[0]
        deepest = float(np.max(result.curves[0].depth)) - scene.instrument.contact_depth
        effects = effects_table(scene, deepest, result.solver)
        write_atomic(folder.result(f"{stem}.effects.csv"), csv_text(effects))
        plots.save(plots.effects(scene, deepest, result.solver), folder.result(f"{stem}.effects.png"))
    except UnderlayError:
        # A scene that the ledger has no rows for: the fit stands without it.
        return
    yield {"effects": rows_of(ledger_in_words(effects))}


def _sources(result: Fit) -> str:
    """What the uncertainty of the first number of the sample is made of."""
    (name,) = told_names(result)[:1] or ("",)
    if not name or result.verdict == "reject":
        return ""
    sources, assumed = budget_words(result.answer(name))
    return f"Uncertainty of the {label(name)}: {sources}. {assumed}" if sources else ""


def _exact(known: Answer) -> list[str]:
    """The numbers that are printed of a quantity: value, ends, and ends of the statistical part."""
    numbers = (known.value, known.low, known.high, known.statistical.low, known.statistical.high)
    return [repr(float(number)) for number in numbers]


def _named(sentence: str, result: Fit) -> str:
    """Say a sentence of the library as the page does, with every parameter called by its words."""
    return printed(spoken(labelled(sentence, result.names)))


def _by_depth(
    folder: AnalysisFolder, result: Fit, pictures: list[str], stem: str
) -> Iterator[dict[str, Any]]:
    """The modulus depth by depth, where it can be read."""
    (found,) = pointwise_of(result)[:1]
    if isinstance(found, PointwiseModulus):
        plots.save(plots.pointwise_modulus(found), folder.result(f"{stem}.depths.png"))
        write_atomic(folder.result(f"{stem}.depths.csv"), csv_text(found.table))
        yield {"pictures": (*pictures, f"{stem}.depths.png")}
    yield {"depths": spoken(pointwise_sentence(found))}


def rows_of(frame: pd.DataFrame) -> tuple[Row, ...]:
    """Rows of a table as texts; an index of names becomes the first column."""
    if not pd.api.types.is_integer_dtype(frame.index):
        name = frame.columns.name if frame.index.name is None else frame.index.name
        frame = frame.rename_axis(index="parameter" if name is None else str(name)).reset_index()
    return tuple({str(key): _cell(value) for key, value in row.items()} for row in frame.to_dict("records"))


def _cell(value: object) -> str:
    if isinstance(value, bool | np.bool_):
        return "yes" if value else "no"
    if isinstance(value, float):
        return "" if np.isnan(value) else f"{value:.4g}"
    return str(value)


_WALKERS, _EVERY = 64, 10


_OPEN_NOISE = "looking for where to begin; no noise is stated, so it is averaged over, which takes longer"


_UNFINISHED = "Its intervals may be wrong: press Sample again, which goes on from there, or allow more steps."


def sample_posterior(
    folder: AnalysisFolder, tested: Snapshot, curve: Curve, most: int, tell: Tell
) -> Sampled:
    """Sample until the chain has converged, `most` steps are done or a stop was asked for; keep what came of it."""
    file, stem, of = tested.file, tested.stem, tested.of
    chain = folder.result(f"{stem}.chain.h5")
    mark = f"{of} {most}".encode()
    if folder.read_result(f"{stem}.chain.txt") != mark:
        chain.unlink(missing_ok=True)
    write_atomic(folder.result(f"{stem}.chain.txt"), mark)

    def step(done: int, needed: int, effective: float) -> None:
        if done % _EVERY == 0:
            words = f"{done} of about {needed} steps; worth {effective:.0f} independent draws so far"
            tell(Progress(done, needed, words))

    with gathered_warnings() as notes:
        problem = problem_from(file, curve, weak_bounds(file, curve))
        tell(Progress(0, most, _OPEN_NOISE if problem.noise_is_open else "looking for where to begin"))
        posterior = sample(problem, _WALKERS, most, backend=chain, resume=chain.exists(), progress=step)
    pictures = []
    for name, draw in (("corner", plots.corner), ("predictive", plots.predictive)):
        plots.save(draw(posterior), folder.result(f"{stem}.{name}.png"))
        pictures.append(f"{stem}.{name}.png")
    posterior.save(folder.result(f"{stem}.posterior.npz"))
    summary = csv_text(posterior.summary().rename_axis("parameter"))
    write_atomic(folder.result(f"{stem}.posterior.csv"), summary)
    words = posterior_summary(posterior).replace("**", "").split("\n\n")
    # What the sampler warns of is the second sentence already; what to do about it is not.
    unfinished = not posterior.converged
    notes = [note for note in notes if not (unfinished and posterior.diagnostics.reason in note)]
    advice = (_UNFINISHED,) if unfinished else ()
    said = (*words[:2], *advice, *words[2:], *map(spoken, notes))
    sampled = Sampled(of, said, rows_of(posterior_table(posterior)), tuple(pictures))
    keep(folder, stem, sampled)
    return sampled


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
