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
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np

from underlay._arrays import FloatArray
from underlay._door import sha256_of
from underlay.data.curve import Curve, check_fittable
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
from underlay.inference.batch.separable import SeparableModel, separable_warnings
from underlay.inference.file_facts import EVERYTHING, settle
from underlay.inference.from_files import require_elastic, within_range
from underlay.inference.least_squares.fit_result import Fit
from underlay.inference.least_squares.fit_warnings import NO_CONTACT, no_contact
from underlay.inference.least_squares.provenance import STATED, curve_hash, instrument_modulus
from underlay.inference.plausibility import in_doubt, require_sizes, require_travel
from underlay.inference.problem import Problem
from underlay.inference.sampling.derived import adhesive_numbers
from underlay.inference.uncertainty.answer import Advice, Answer
from underlay.inference.uncertainty.verdict import CHECK, REJECT
from underlay.scene.scene import Scene

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


@dataclass(frozen=True)
class _Found:
    """The parts of a row that a fit gives: values and standard errors (SI) by path, law, statistics, warnings.

    `more` are further cells by column.
    """

    values: Mapping[str, float]
    stderr: Mapping[str, float]
    law: str
    reduced_chi_square: float
    sum_of_squares: float
    notes: tuple[str, ...]
    more: Mapping[str, Any]


class CurveFitter:
    """Fits curves of a map into rows, with the common model compiled once for all curves of one worker.

    Parameters
    ----------
    model : BatchModel
        What the curves have in common.
    layout : Layout
        Columns of the rows.
    """

    def __init__(self, model: BatchModel, layout: Layout) -> None:
        self._model, self._layout = model, layout
        template = model.template
        self._separable = SeparableModel.of(template)
        self._names, self._coordinates = template.names, template.coordinates
        self._base = model.scene.parameters
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
                _add_notes(row, notes, are_doubts=True)  # the file says otherwise than the scene
        except UnderlayError as error:
            row.update(_failure(str(error)))
        except MemoryError:
            row.update(_failure("not enough memory for this curve"))
        except Exception as error:  # noqa: BLE001  one curve that meets a mistake of ours must not cost the night
            row.update(_failure(f"unexpected {type(error).__name__}: {error}"))
        else:
            _add_notes(row, [str(entry.message) for entry in caught], are_doubts=not self._model.answers)
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
        notes: tuple[str, ...] = ()
        if self._model.quality:
            quality = check_quality(curve, self._model.scene.with_values(place.values))
            quality.require()
            notes = quality.reasons
        outcome = self._fast(place, curve) or self._thorough(place, curve)
        row.update(outcome.values)
        if "layer.E" in outcome.values and STATED in curve.metadata:
            stated = instrument_modulus(self._fitted(place, outcome), curve)
            if stated is not None:
                row.update({INSTRUMENT: stated.youngs, DIFFERENCE: 100.0 * stated.difference})
        if self._model.scene.adheres:
            row.update(adhesive_numbers(self._fitted(place, outcome), self._model.solver))
        row.update({f"{path}.stderr": error for path, error in outcome.stderr.items()})
        row.update(
            status=FITTED,
            verdict=GOOD,
            reason="",
            cause="",
            law=outcome.law,
            reduced_chi_square=outcome.reduced_chi_square,
            rms=float(np.sqrt(outcome.sum_of_squares / len(curve))),
            warnings=0,
        )
        row.update(outcome.more)
        # Answers have the verdict of a single fit.
        _add_notes(row, [*notes, *outcome.notes], are_doubts=not self._model.answers)

    def _fitted(self, place: CurvePlace, outcome: _Found) -> Scene:
        """The scene with the fitted values."""
        found = {path: value for path, value in outcome.values.items() if path in self._base}
        return self._model.scene.with_values({**place.values, **found})

    def _fast(self, place: CurvePlace, curve: Curve) -> _Found | None:
        if self._separable is None or self._model.sampling is not None or self._model.answers:
            return None
        values = {**self._base, **place.values}
        contact_is_free = any(c.path == "instrument.contact_depth" for c in self._separable.coordinates)
        check_fittable(curve, None if contact_is_free else values["instrument.contact_depth"])
        found = self._separable.fit(curve, values)
        if found is None:
            return None
        paths = [coordinate.path for coordinate in self._separable.coordinates]
        fitted = dict(zip(paths, found.values.tolist(), strict=True))
        known = values | fitted
        pressed = float(curve.depth.max()) - known["instrument.contact_depth"]
        if pressed > known.get("layer.thickness", np.inf):
            return None  # deeper than the layer's thickness: the general fit reports what that means
        noise, n, k = found.noise, len(curve), len(paths)
        notes = separable_warnings(found, lambda: self._problem(place, curve))
        _require_contact(no_contact(curve.depth, curve.force, found.sum_of_squares, paths), notes)
        return _Found(
            fitted,
            dict(zip(paths, np.sqrt(np.diag(found.covariance)).tolist(), strict=True)),
            found.law_method,
            found.sum_of_squares / noise**2 / (n - k),
            found.sum_of_squares,
            notes,
            {},
        )

    def _thorough(self, place: CurvePlace, curve: Curve) -> _Found:
        # A worker is a fresh Python: it loads what most maps never use (pandas, emcee) at its first use.
        from underlay.inference.least_squares.fitting import fit, quick_fit  # noqa: PLC0415

        problem = self._problem(place, curve)
        require_travel(problem)
        try:
            # An answer is that of a single fit, to the last digit.
            found = fit(problem) if self._model.answers else quick_fit(problem)
        except FitError:
            require_sizes(problem)
            raise
        if in_doubt(found):
            require_sizes(problem)
        residuals: FloatArray = found.residuals[0]
        # A reading left out near a jump is no reason to doubt the fit.
        notes = tuple(str(warning) for warning in found.warnings if warning.code not in ("jump", NO_CONTACT))
        without = [warning.message for warning in found.warnings if warning.code == NO_CONTACT]
        _require_contact("; ".join(without), notes)
        outcome = _Found(
            found.values,
            found.stderr,
            found.statistics.law_method,
            found.statistics.reduced_chi_square,
            float(residuals @ residuals),
            notes,
            {},
        )
        if self._model.sampling is not None:
            return self._sampled(problem, place, self._model.sampling, outcome)
        if not self._model.answers:
            return outcome
        return self._answered(outcome, found, found.verdict)

    def _answered(self, outcome: _Found, found: Fit | Posterior, verdict: Advice) -> _Found:
        """The outcome with answers and verdict of a fit or a posterior in place of least-squares numbers."""
        answers = {name: found.answer(name) for name in self._names}
        more: dict[str, Any] = answer_cells(answers)
        more |= {"verdict": verdict.word, "reason": "; ".join(verdict.reasons), "cause": verdict.cause}
        if _MODULUS_LIKELIHOOD in self._layout.kinds and _is_lopsided(answers[_MODULUS]):
            # Most maps do not need this.
            from underlay.inference.population.likelihood import CurveLikelihood  # noqa: PLC0415

            more[_MODULUS_LIKELIHOOD] = CurveLikelihood.of_answers(found.answer, _MODULUS).as_text()
        values = {name: known.value for name, known in answers.items()}
        return replace(outcome, values=values, notes=(), more=more)

    def _sampled(self, problem: Problem, place: CurvePlace, sampling: Sampling, outcome: _Found) -> _Found:
        """The outcome with the answers of a posterior, which is sampled here."""
        from underlay.inference.sampling.run import sample  # noqa: PLC0415  as for `quick_fit`

        seed = _seed(sampling.seed, place.name)
        posterior = sample(
            problem, walkers=sampling.walkers, max_steps=sampling.max_steps, rng=seed, progress=False
        )
        answered = self._answered(outcome, posterior, posterior.verdict)
        more = {**answered.more, "converged": bool(posterior.converged), "seed": seed}
        return replace(answered, more=more)

    def _problem(self, place: CurvePlace, curve: Curve) -> Problem:
        return self._model.problem(self._model.scene.with_values(place.values), curve)


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


def _require_contact(reason: str, notes: Sequence[str]) -> None:
    """Raise CurveError where there is a reason that a curve has no contact (`no_contact`); notes are added."""
    if reason:
        raise CurveError("; ".join([f"{reason} (are the units right?)", *notes]))


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


def _add_notes(row: dict[str, Any], notes: Sequence[str], *, are_doubts: bool) -> None:
    """Add notes to a row's reasons; doubts make a good verdict a doubtful one."""
    fresh = list(dict.fromkeys(" ".join(note.split()) for note in notes))
    if fresh:
        if are_doubts and row["verdict"] != REJECT:
            row["verdict"] = CHECK
        row["reason"] = "; ".join([row["reason"], *fresh] if row["reason"] else fresh)
        row["warnings"] += len(fresh)
