"""The work on one curve of a map: it is read, checked and fitted, and gives one row of the table.

A row is a function of the model and the curve alone, whichever worker makes it and in which order; only the time it
took may differ.
"""

from __future__ import annotations

import hashlib
import math
import time
import warnings
from collections.abc import Generator, Iterable, Iterator, Mapping, Sequence
from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np

from underlay._arrays import FloatArray
from underlay._door import sha256_of
from underlay.data.curve import Curve
from underlay.data.quality import GOOD, REFUSED, check_quality
from underlay.data.readers import KeptOpen
from underlay.errors import CurveError, FitError, UnderlayError, UnderlayWarning
from underlay.inference.batch.curves import CurvePlace, read_place
from underlay.inference.batch.model import BatchModel, Sampling
from underlay.inference.batch.results_table import (
    DIFFERENCE,
    FAILED,
    FITTED,
    INSTRUMENT,
    LIKELIHOOD,
    Layout,
)
from underlay.inference.file_facts import EVERYTHING, settle
from underlay.inference.from_files import require_elastic, within_range
from underlay.inference.least_squares.fit_result import Fit
from underlay.inference.least_squares.fit_warnings import NO_CONTACT
from underlay.inference.least_squares.provenance import STATED, curve_hash, instrument_modulus
from underlay.inference.plausibility import in_doubt, require_sizes, require_travel
from underlay.inference.problem import Problem
from underlay.inference.sampling.derived import adhesive_numbers
from underlay.inference.uncertainty.answer import Answer
from underlay.inference.uncertainty.verdict import CHECK, REJECT

if TYPE_CHECKING:
    from underlay.inference.sampling.posterior import Posterior

_MODULUS = "layer.E"
#: Reason in the row of a curve that is given up because worker processes died on it.
DIED = "the worker process died on this curve twice; out of memory, or killed from outside?"
_MODULUS_LIKELIHOOD = f"{_MODULUS}.{LIKELIHOOD}"
#: Longest interval between two batches of rows (s), so that few rows are lost with a process.
HANDED_ON = 0.2
# Largest ratio of the arms of an interval of ln E, and longest arm, for a normal density.
_LOPSIDED, _WIDE = 1.5, 0.4


def answer_cells(answers: Mapping[str, Answer]) -> dict[str, float]:
    """Interval ends (SI) of the answers of a curve, by column of the table; infinite ends are left out."""
    cells: dict[str, float] = {}
    for name, known in answers.items():
        parts = {"": known.interval, ".stat": known.statistical, ".syst": known.systematic}
        for part, interval in parts.items():
            cells |= {f"{name}{part}.low": interval.low, f"{name}{part}.high": interval.high}
    return {column: end for column, end in cells.items() if math.isfinite(end)}


#: Rows (index, CSV text) of one message.
Rows = list[tuple[int, str]]


def work(model: BatchModel, layout: Layout, places: Sequence[CurvePlace]) -> Rows:
    """Fit some curves and return their rows; the function that workers of a Dask cluster run."""
    return list(CurveFitter(model, layout).rows(places))


def file_hash(path: str) -> str:
    """SHA-256 of a file; the empty string where it cannot be read."""
    try:
        return sha256_of(path)
    except UnderlayError:
        return ""


def given_up(place: CurvePlace, layout: Layout, reason: str) -> tuple[int, str]:
    """Row of a curve whose fit is given up, e.g. because worker processes died on it."""
    return place.index, layout.text({**_about(place), **_failure(reason), "seconds": None})


class CurveFitter:
    """Fits curves of a map into rows.

    Parameters
    ----------
    model : BatchModel
        What the curves have in common.
    layout : Layout
        Columns of the rows.
    """

    def __init__(self, model: BatchModel, layout: Layout) -> None:
        self._model, self._layout = model, layout
        self._kept = KeptOpen()

    def rows(self, places: Iterable[CurvePlace]) -> Iterator[tuple[int, str]]:
        """Rows (index, CSV text), one per curve, in order."""
        with self._kept:
            for place in places:
                yield place.index, self._layout.text(self._row(place))

    def batches(self, places: Iterable[CurvePlace]) -> Generator[Rows, None, None]:
        """Rows of the curves, in order, as many at once as were finished within a fifth of a second."""
        rows: Rows = []
        sent = time.monotonic()
        try:
            for row in self.rows(places):
                rows.append(row)
                if time.monotonic() - sent > HANDED_ON:
                    yield rows
                    rows, sent = [], time.monotonic()
        except KeyboardInterrupt:
            # Rows that are there are kept first, then the interruption is passed on.
            yield rows
            raise
        yield rows

    def _row(self, place: CurvePlace) -> dict[str, Any]:
        began = time.perf_counter()
        row = _about(place)
        try:
            with warnings.catch_warnings(record=True) as caught:
                warnings.simplefilter("always", UnderlayWarning)
                curve = self._read(place, row)
                place, curve, notes = self._settled(place, curve)
                row.update(place.values)
                if self._model.file is not None:
                    require_elastic(self._model.scene, curve, self._model.file.curve.get("overrule", ()))
                    curve = within_range(self._model.file, self._model.scene.with_values(place.values), curve)
                self._fit(place, curve, row)
                _add_notes(row, notes)
        except UnderlayError as error:
            row.update(_failure(str(error)))
        except MemoryError:
            row.update(_failure("not enough memory for this curve"))
        except Exception as error:  # noqa: BLE001  one curve that meets a mistake of ours must not cost the night
            row.update(_failure(f"unexpected {type(error).__name__}: {error}"))
        else:
            _add_notes(row, [str(entry.message) for entry in caught])
        if "sha256" not in row and place.path:
            row["sha256"] = file_hash(place.path)
        row["seconds"] = time.perf_counter() - began
        return row

    def _settled(self, place: CurvePlace, curve: Curve) -> tuple[CurvePlace, Curve, tuple[str, ...]]:
        """Complete the scene's numbers with those that the curve's own file states.

        Returns the curve's entry with these numbers, the curve with a note on them, and notes for the row.
        """
        file = self._model.file
        settled = settle(
            self._model.scene.with_values(place.values),
            curve,
            left_out=() if file is None else [path for path in file.left_out if path not in place.values],
            # Only a scene file can say which of two numbers is right: without one the row states the difference.
            overrule=EVERYTHING if file is None else file.curve.get("overrule", ()),
            free=self._model.free,
        )
        notes = settled.notes[len(settled.values) :]  # the values themselves are in the row
        noted = curve.with_metadata(notes=(*curve.metadata.get("notes", ()), *notes)) if notes else curve
        if settled.values:
            place = replace(place, values={**place.values, **settled.values})
        return place, noted, notes

    def _read(self, place: CurvePlace, row: dict[str, Any]) -> Curve:
        """Read the curve and select the part that is fitted; write its hash and position into `row`."""
        curve = read_place(place, self._model.file, self._kept)
        row["sha256"] = place.sha256 or curve.metadata.get("sha256") or curve_hash(curve)
        position = curve.metadata.get("position")
        if row["x"] is None and isinstance(position, tuple) and len(position) >= 2:
            row["x"], row["y"] = float(position[0]), float(position[1])
        return curve

    def _fit(self, place: CurvePlace, curve: Curve, row: dict[str, Any]) -> None:
        # A worker is a fresh Python: it loads what most maps never use (pandas, emcee) at its first use.
        from underlay.inference.least_squares.fitting import fit, quick_fit  # noqa: PLC0415

        scene = self._model.scene.with_values(place.values)
        notes: list[str] = []
        if self._model.quality:
            quality = check_quality(curve, scene)
            quality.require()
            notes += quality.reasons
        problem = self._model.problem(scene, curve)
        require_travel(problem)
        try:
            # An answer is that of a single fit, to the last digit.
            found = fit(problem) if self._model.answers else quick_fit(problem)
        except FitError:
            require_sizes(problem)
            raise
        if in_doubt(found):
            require_sizes(problem)
        # A reading left out near a jump is no reason to doubt the fit.
        doubts = [str(warning) for warning in found.warnings if warning.code not in ("jump", NO_CONTACT)]
        without = "; ".join(warning.message for warning in found.warnings if warning.code == NO_CONTACT)
        if without:
            raise CurveError("; ".join([f"{without} (are the units right?)", *doubts]))
        residuals: FloatArray = found.residuals[0]
        row.update(
            status=FITTED,
            verdict=GOOD,
            reason="",
            cause="",
            law=found.statistics.law_method,
            reduced_chi_square=found.statistics.reduced_chi_square,
            rms=float(np.sqrt(float(residuals @ residuals) / len(curve))),
            warnings=0,
        )
        if self._model.sampling is not None:
            row.update(self._sampled(problem, place.name, self._model.sampling))
        elif self._model.answers:
            row.update(self._answered(found))
        else:
            row.update(found.values)
            row.update({f"{path}.stderr": error for path, error in found.stderr.items()})
            notes += doubts
        fitted = scene.with_values({path: row[path] for path in problem.names if path in scene.parameters})
        if "layer.E" in problem.names and STATED in curve.metadata:
            stated = instrument_modulus(fitted, curve)
            if stated is not None:
                row.update({INSTRUMENT: stated.youngs, DIFFERENCE: 100.0 * stated.difference})
        if fitted.adhesion is not None:
            row.update(adhesive_numbers(fitted, self._model.solver))
        _add_notes(row, notes)

    def _answered(self, found: Fit | Posterior) -> dict[str, Any]:
        """Cells of the answers and the verdict of a fit or a posterior."""
        answers = {name: found.answer(name) for name in found.names}
        verdict = found.verdict
        cells: dict[str, Any] = {name: known.value for name, known in answers.items()}
        cells |= answer_cells(answers)
        cells |= {"verdict": verdict.word, "reason": "; ".join(verdict.reasons), "cause": verdict.cause}
        if _MODULUS_LIKELIHOOD in self._layout.kinds and _is_lopsided(answers[_MODULUS]):
            # Most maps do not need this.
            from underlay.inference.population.likelihood import CurveLikelihood  # noqa: PLC0415

            cells[_MODULUS_LIKELIHOOD] = CurveLikelihood.of_answers(found.answer, _MODULUS).as_text()
        return cells

    def _sampled(self, problem: Problem, name: str, sampling: Sampling) -> dict[str, Any]:
        """Cells of the answers of a posterior, which is sampled here; `name` is that of the curve."""
        from underlay.inference.sampling.run import sample  # noqa: PLC0415  as for `quick_fit`

        seed = _seed(sampling.seed, name)
        posterior = sample(
            problem, walkers=sampling.walkers, max_steps=sampling.max_steps, rng=seed, progress=False
        )
        return {**self._answered(posterior), "converged": bool(posterior.converged), "seed": seed}


def _is_lopsided(known: Answer) -> bool:
    """Whether a modulus' likelihood is far from normal in ln E: an infinite end, or unequal or long arms."""
    ends = known.statistical
    if ends.is_open or not ends.low > 0.0:
        return True
    below, above = math.log(known.value / ends.low), math.log(ends.high / known.value)
    return max(below, above) > _LOPSIDED * min(below, above) or max(below, above) > _WIDE


def _seed(seed: int, name: str) -> int:
    """Random seed of a curve from the map's seed and the curve's name, whatever the order and number of workers."""
    words = np.frombuffer(hashlib.sha256(name.encode("utf-8", "backslashreplace")).digest(), dtype="<u4")
    return int(np.random.SeedSequence([seed, *words.tolist()]).generate_state(1)[0])


def _about(place: CurvePlace) -> dict[str, Any]:
    return {
        "name": place.name,
        "path": place.path,
        "x": place.x,
        "y": place.y,
        **place.labels,
        **place.values,
    }


def _failure(reason: str) -> dict[str, Any]:
    return {"status": FAILED, "verdict": REFUSED, "reason": " ".join(reason.split()), "warnings": 0}


def _add_notes(row: dict[str, Any], notes: Sequence[str]) -> None:
    fresh = list(dict.fromkeys(" ".join(note.split()) for note in notes))
    if fresh:
        row["verdict"] = REJECT if row["verdict"] == REJECT else CHECK
        row["reason"] = "; ".join([row["reason"], *fresh] if row["reason"] else fresh)
        row["warnings"] += len(fresh)
