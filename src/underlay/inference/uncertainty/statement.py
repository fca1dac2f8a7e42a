"""The answer of every quantity of a fit, and its verdict, each computed at its first use and kept."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np
from scipy import special

from underlay._arrays import FloatArray
from underlay._given import require_level
from underlay._threads import one_thread
from underlay.errors import InputError
from underlay.inference.sampling.derived import derived_quantities, kind_of_quantity
from underlay.inference.uncertainty.answer import Advice, Answer, Contribution, Follows, Interval
from underlay.inference.uncertainty.budget import Refit, Source, sensitivities, sources_of
from underlay.inference.uncertainty.likelihood import Likelihood
from underlay.inference.uncertainty.mixture import weighted_quantiles
from underlay.inference.uncertainty.reading import OpenReading, Reading, widened
from underlay.inference.uncertainty.tree import NothingDrawnError
from underlay.inference.uncertainty.verdict import verdict_of
from underlay.quantities import declared, kind_of
from underlay.units import KINDS, format_quantity

if TYPE_CHECKING:
    from underlay.inference.least_squares.fit_result import Fit
    from underlay.inference.uncertainty.answer import PointwiseModulus

#: Name of the statistical part in the budget.
NOISE = "noise and misfit"
_LEVEL = 0.95  # default confidence of answers, and that of the shifts of a source
# Distance in scaled coordinates from which an interval's end is infinite: a factor of 400, or six spans of the
# curve.
_FARTHEST = 6.0
# Step of central differences in scaled coordinates: truncation 1e-10 of the derivative, rounding 1e-11.
_STEP = 1e-5
# Logarithm of a ratio beyond which a float overflows.
_HIGHEST = 700.0


@dataclass(frozen=True, eq=False)
class _Scale:
    """The scale on which errors of one quantity add: its scaled coordinate, its logarithm, or its plain value.

    Parameters
    ----------
    name, unit : str
        The quantity, and its SI unit.
    low, high : float
        Ends of the statistical interval, on the scale.
    places : FloatArray
        The quantity, on the scale, at each of the scaled vectors `Statement._places`, (p,).
    physical : callable
        Converts a number on the scale to the quantity (SI).
    possible : (float, float)
        Bounds of the quantity (SI), physical and of the fit, which no finite end passes.
    """

    name: str
    unit: str
    low: float
    high: float
    places: FloatArray
    physical: Callable[[float], float]
    possible: tuple[float, float] = (-math.inf, math.inf)

    @property
    def value(self) -> float:
        """The answer's value, on the scale."""
        return float(self.places[0])

    def about(self, arms: FloatArray, bias: float) -> tuple[float, float]:
        """Ends (SI) of an interval with `arms` (2,) down and up about the value shifted by `bias`, on the scale.

        They enclose the value; infinite arms give infinite ends.
        """
        below, above = max(float(arms[0]) - bias, 0.0), max(float(arms[1]) + bias, 0.0)
        lowest, highest = self.possible
        low = max(self.physical(self.value - below), lowest) if math.isfinite(below) else -math.inf
        high = min(self.physical(self.value + above), highest) if math.isfinite(above) else math.inf
        return low, high


@dataclass(frozen=True, eq=False)
class Statement:
    """Computes answers, verdict and sensitivities of one fit.

    Parameters
    ----------
    fit : Fit
        The fit.
    refit : callable
        Fits a problem, with the values of its scenes as the starting point.
    """

    fit: Fit
    refit: Refit
    _answers: dict[tuple[str, float], Answer] = field(default_factory=dict, init=False)
    _followed: dict[float, Mapping[str, FloatArray]] = field(default_factory=dict, init=False)

    @cached_property
    @one_thread()
    def likelihood(self) -> Likelihood:
        """The likelihood of the fit's curves."""
        return Likelihood.of(self.fit)

    @cached_property
    @one_thread()
    def reading(self) -> Reading:
        """Intervals and draws of the fitted numbers, from the likelihood; open where nothing can be drawn."""
        try:
            return self.likelihood.read(0)
        except NothingDrawnError:
            return OpenReading(self.likelihood)

    @cached_property
    @one_thread()
    def sources(self) -> tuple[Source, ...]:
        """Sources of the systematic part of the intervals; none for a robust fit."""
        if self.fit.statistics.robust != "none":
            return ()
        return sources_of(self.fit, self.likelihood.moved, self.refit)

    @one_thread()
    def answer(self, name: str, level: float = _LEVEL) -> Answer:
        """The answer of a parameter, or of a quantity computed from parameters; see `Fit.answer`."""
        require_level(level)
        key = (name, level)
        if key not in self._answers:
            scale = self._of_parameter if name in self.fit.names else self._of_derived
            self._answers[key] = self._found(scale(name, level), level)
        return self._answers[key]

    @cached_property
    @one_thread()
    def verdict(self) -> Advice:
        """Whether the fit can be used, why not, and what to do next."""
        return verdict_of(self.fit, self.reading, self.answer)

    @cached_property
    @one_thread()
    def sensitivity(self) -> Mapping[str, Mapping[str, float]]:
        """d ln(value) / d ln(input), by fitted number and by input."""
        return sensitivities(self.fit, self.likelihood.moved)

    def band(self, of: Follows, level: float) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Lower ends, middles and upper ends, (n,) each, of quantities that `of` computes; see `Fit.band`."""
        require_level(level)
        at, k = self.reading.corrected, len(self.fit.names)
        # Beside a bound a step leads to it, and no further.
        ends = [np.clip(at + side * _STEP * np.eye(k), *self.fit.problem.bounds.T) for side in (1.0, -1.0)]
        apart = np.diagonal(ends[0] - ends[1])
        found = _quantities(of, self.fit.problem.physical(np.vstack([at, *ends])))
        low, middle, high = np.full(found.shape[1], -np.inf), found[0].copy(), np.full(found.shape[1], np.inf)
        tails = np.array([0.5 - 0.5 * level, 0.5 + 0.5 * level])
        drawn, weights = self._drawn
        away = drawn - at
        for n in np.flatnonzero((found > 0.0).all(axis=0)):
            above, below = np.split(np.log(found[1:, n]), 2)
            along = away @ ((above - below) / apart)
            reach = weighted_quantiles(along, weights, tails)
            low[n], high[n] = (_exponential(math.log(middle[n]) + end) for end in reach.tolist())
        return low, middle, high

    def modulus_by_depth(self, curve: int, points: int, level: float) -> PointwiseModulus:
        """Young's modulus fitted at each depth of one curve; see `Fit.modulus_by_depth`."""
        from underlay.inference.pointwise import modulus_by_depth  # noqa: PLC0415  few ask

        return modulus_by_depth(self.fit, curve=curve, points=points, level=level)

    # --- one quantity -------------------------------------------------------------------------------------
    @cached_property
    def _places(self) -> FloatArray:
        """Scaled vectors (p, k) at which each quantity is computed.

        The first is the answer's value, the second the least-squares optimum; then come the two sides of every
        shift by a source of systematic error, then the mean shift of every source.
        """
        at = self.reading.corrected
        moved = [(at + source.moves).reshape(-1, len(at)) for source in self.sources]
        middles = [(at + source.bias)[None] for source in self.sources]
        return np.concatenate((at[None], self.fit.vector[None], *moved, *middles))

    @cached_property
    def _drawn(self) -> tuple[FloatArray, FloatArray]:
        """Draws (m, k) and their weights (m,), without those that no prior allows: they lie at any distance."""
        weighs = self.reading.weights > 0.0
        return self.reading.draws[weighs], self.reading.weights[weighs]

    def _derived(self, level: float) -> Mapping[str, FloatArray]:
        """All derived quantities, by name, at the vectors of `_places`, the draws and the edge; kept by level."""
        if level not in self._followed:
            problem = self.fit.problem
            vectors = np.vstack((self._places, self._drawn[0], self.reading.edge(level)))
            self._followed[level] = derived_quantities(problem, problem.physical(vectors))
        return self._followed[level]

    def _of_parameter(self, name: str, level: float) -> _Scale:
        index = self.fit.names.index(name)
        coordinate, places = self.fit.problem.coordinates[index], self._places[:, index]
        low, high = (
            end if abs(end - places[0]) < _FARTHEST else math.copysign(math.inf, end - places[0])
            for end in self.reading.interval(index, level)
        )
        unit = KINDS[kind_of(name)].si

        def physical(q: float) -> float:
            is_beyond = coordinate.scale is None and q > _HIGHEST
            return math.inf if is_beyond else float(coordinate.physical(np.asarray(q)))

        if not declared(coordinate.path).from_zero:
            value = physical(places[0])
            allowed = min(coordinate.low, value), max(coordinate.high, value)
            return _Scale(name, unit, low, high, places, physical, allowed)
        # Its errors add in the plain value: in logarithms small errors near zero become factors of 100.
        own, top = physical(places[0]), physical(high)
        slope = float(self.fit.problem.slopes(self.reading.corrected)[index])
        # Within two standard deviations of zero, judged by the upper end, which no prior sets, it has an upper
        # bound only.
        floor = 0.0 if top >= 2.0 * own else physical(low)
        straight = own + slope * (places - places[0])
        return _Scale(name, unit, floor, top, straight, lambda number: max(float(number), 0.0))

    def _of_derived(self, name: str, level: float) -> _Scale:
        followed = self._derived(level)
        if name not in followed:
            free, derived = ", ".join(self.fit.names), ", ".join(followed)
            raise InputError(
                f"{name!r} is not free here; free are {free}; from these follow {derived or 'none'}"
            )
        # In the logarithm; in the plain value where draws, or a shift by a source, reach zero.
        found = followed[name]
        positive = bool((found > 0.0).all())
        found = np.log(found) if positive else found
        first = len(self._places)
        weights = self._drawn[1]
        places, draws, edge = np.split(found, [first, first + len(weights)])
        tails = np.array([0.5 - 0.5 * level, 0.5 + 0.5 * level])
        low, high = widened(weighted_quantiles(draws, weights, tails), edge)
        unit = KINDS[kind_of_quantity(name)].si
        return _Scale(name, unit, low, high, places, _exponential if positive else float)

    def _found(self, scale: _Scale, level: float) -> Answer:
        """The answer: statistical and systematic part added in quadrature on the scale, and the budget's rows."""
        seen = np.array([max(scale.value - scale.low, 0.0), max(scale.high - scale.value, 0.0)])
        times = float(special.ndtri(0.5 + 0.5 * level) / special.ndtri(0.5 + 0.5 * _LEVEL))
        arms = [times * own for own in self._arms(scale)]
        # Mean shifts by the sources of systematic error.
        biases = scale.places[len(scale.places) - len(self.sources) :] - scale.value
        systematic = np.sqrt(sum((own * own for own in arms), np.zeros(2)))
        both = np.array([math.hypot(*own) for own in zip(seen, systematic, strict=True)])
        bias, total = (
            sum(biases.tolist()),
            float(seen[0] ** 2 + seen[1] ** 2) + float(systematic @ systematic),
        )
        rows = [_row(scale, (NOISE, "", "seen"), seen, 0.0, total)]
        rows += [
            _row(scale, (source.name, source.size, source.origin), own, shift, total)
            for source, own, shift in zip(self.sources, arms, biases.tolist(), strict=True)
        ]
        name, value = scale.name, scale.physical(scale.value)
        return Answer(
            name,
            value,
            *scale.about(both, bias),
            level,
            scale.unit,
            Interval(name, level, value, *scale.about(seen, 0.0)),
            Interval(name, level, value, *scale.about(systematic, bias)),
            tuple(sorted(rows, key=lambda row: -row.share)),
            self._notes(scale),
        )

    def _arms(self, scale: _Scale) -> list[FloatArray]:
        """How far each source of systematic error moves the quantity down and up on the scale, (2,).

        The independent rows of a source add in quadrature.
        """
        arms, first = [], 2
        for source in self.sources:
            shape = source.moves.shape[:2]
            count = shape[0] * shape[1]
            ends = scale.places[first : first + count].reshape(shape) - scale.value
            down, up = np.maximum(-ends.min(axis=1), 0.0), np.maximum(ends.max(axis=1), 0.0)
            arms.append(np.sqrt([down @ down, up @ up]))
            first += count
        return arms

    def _notes(self, scale: _Scale) -> tuple[str, ...]:
        """Sentences on what was corrected in the value, with the value before the correction."""
        plain = float(scale.places[1])
        if plain == scale.value:
            return ()
        kinds = {
            "step": "a force step at contact",
            "ramp": "a drifting baseline",
            "turn": "a turn of the baseline",
        }
        likely = [
            words
            for kind, words in kinds.items()
            if any(getattr(seen, kind) > 0.5 for seen in self.reading.likelihood.seen)
        ]
        taken_out = " and ".join(likely) or "a disturbance"
        before = format_quantity(scale.physical(plain), kind_of_quantity(scale.name))
        return (f"{taken_out} is taken out; with it in, {before}",)


def _row(
    scale: _Scale, said: tuple[str, str, str], own: FloatArray, bias: float, total: float
) -> Contribution:
    """Row of the budget for one source.

    `said` is its name, size and origin, `own` (2,) how far it moves the quantity down and up about its mean shift
    `bias`, and `total` the variance of all sources on the scale.
    """
    low, high = scale.about(own, bias)
    value, square = scale.physical(scale.value), float(own @ own)
    share = 1.0 if not math.isfinite(square) else square / total if 0.0 < total < math.inf else 0.0
    return Contribution(*said, value - low, high - value, share)


def _exponential(logarithm: float) -> float:
    return math.exp(logarithm) if logarithm <= _HIGHEST else math.inf


def _quantities(of: Follows, physical: FloatArray) -> FloatArray:
    """Quantities (draws, n) that a caller's function returns for parameters (draws, k), after checks."""
    asked: object = of
    given: object = asked(physical) if callable(asked) else asked
    try:
        found = np.asarray(given, dtype=np.float64)
    except (TypeError, ValueError):
        found = np.zeros(0)
    if not (callable(asked) and found.ndim == 2 and len(found) == len(physical)):
        shown = f"an array of shape {np.shape(given)}" if isinstance(given, np.ndarray) else f"{given!r:.80}"
        where = f"at {len(physical)} draws it gave" if callable(asked) else "got"
        raise InputError(
            "of must be a function that takes parameters (draws, k), SI, and gives quantities (draws, n), a row "
            f"per draw, such as lambda p: p[:, :1]; {where} {shown}"
        )
    return found
