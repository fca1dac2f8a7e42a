"""What was found on one curve, as the page shows it: words, tables, pictures; kept as plain files."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from typing import Any

import numpy as np
import pandas as pd

from underlay._csv_text import csv_text
from underlay._files import write_atomic
from underlay.app.folder import AnalysisFolder
from underlay.app.kept import keep
from underlay.app.shown import Found, Row
from underlay.app.snapshot import Snapshot
from underlay.app.work import Tell
from underlay.errors import UnderlayError
from underlay.inference.least_squares import Fit
from underlay.inference.pointwise.modulus import PointwiseModulus
from underlay.inference.problem import Problem
from underlay.report import plots
from underlay.report.fit_files import write_fit
from underlay.report.intervals import Estimate, estimates
from underlay.report.labels import labelled
from underlay.report.model_limits import model_limits
from underlay.report.open_ends import advice, rivals
from underlay.report.pointwise_tables import pointwise_of, pointwise_sentence
from underlay.report.reservations import quality_doubts, reservations
from underlay.report.scene_tables import ledger_in_words
from underlay.report.spoken import spoken
from underlay.report.tables import interval_table
from underlay.report.words import headline, stands_on, verdict_sentence
from underlay.scene.effects import effects_table
from underlay.units import printed

__all__ = ["rows_of", "tell_found"]


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
        "values": {entry.name: _exact(entry) for entry in estimates(result)},
        "table": rows_of(interval_table(result)),
    }
    doubts = [*quality_doubts(problem), *reservations(result, notes)]
    yield {"doubts": tuple(dict.fromkeys(_named(doubt, result) for doubt in doubts))}
    written = write_fit(result, folder.results, stem)
    yield {"pictures": tuple(path.name for path in written if path.suffix == ".png")}
    yield from _by_depth(folder, result, [path.name for path in written if path.suffix == ".png"], stem)
    told = [*rivals(result), stands_on(result), *model_limits(result), *advice(result)]
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


def _exact(entry: Estimate) -> list[str]:
    """The numbers that are printed of a parameter, as Python writes them."""
    numbers = (entry.value, entry.low, entry.high, entry.wide_low, entry.wide_high)
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
