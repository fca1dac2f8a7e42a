"""The search of `separable` for one curve: over the contact, where all else is linear or moves along with it."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from math import exp

import numpy as np

from underlay._arrays import FloatArray
from underlay.data.curve import Curve
from underlay.inference.batch.separable_step import ContactStep, LinearModel, solved
from underlay.inference.model.coordinates import Coordinate
from underlay.inference.model.forward import Forward
from underlay.inference.model.law_slopes import LawSlopes
from underlay.mechanics.scaled_law import ScaledLaw

__all__ = ["BASELINE", "CONTACT", "MODULUS", "SLOPE", "SeparableFit", "SeparableSearch"]

MODULUS = "layer.E"
CONTACT = "instrument.contact_depth"
BASELINE = "instrument.baseline"
SLOPE = "instrument.baseline_slope"

# Contacts tried first, in ranges of depth from the first reading: half a step is within reach of the search.
_CONTACT_STEPS = np.linspace(-0.25, 0.95, 25)
_BETWEEN_BOUNDS = np.linspace(0.0, 1.0, 25)[1:-1]
_BLOCKS = 32  # means of neighbouring points for that trial
# The search ends before a step of the contact below this share of the depth range: it would move E by some
# 2e-8 of itself.
_SETTLED = 1e-8
# Over a step below this share the stiffness, and so the standard errors, change by as little.
_LINEAR = 2e-6
# A change of ln E below this leaves an error of its square at most: 1e-10.
_SAME_LAW = 1e-5
# Where E is known no better than this, a base may hide it, and there may be other optima: `quick_fit` looks.
_LOOSE = 0.1
_MOST_STEPS = 25
_MOST_HALVINGS = 6
# Sums of squares that differ by less than their rounding are the same.
_NO_ASCENT = 1.0 + 1e-9
# Nearer to a bound than this (log of a modulus, ranges of depth or force), the bounded search decides.
_NEAR_BOUND = 1e-3
# Smallest eigenvalue of the correlation matrix of the columns: below, normal equations lose half the digits.
_CONDITION = 1e-8


@dataclass(frozen=True)
class SeparableFit:
    """An optimum.

    Parameters
    ----------
    values : FloatArray
        Parameters (SI) in the order of the problem, (k,).
    covariance : FloatArray
        Of them (SI), (k, k).
    sum_of_squares : float
        Of the residuals (N^2).
    noise : float
        White noise (N) that the covariance stands on: the given one, or the scatter about the fit.
    residuals : FloatArray
        Data minus model (N), (n,).
    modulus : int
        Which parameter is the layer's modulus.
    scaled_errors : tuple of float
        Standard errors in shares of the natural size of each parameter, (k,).
    law_method : str
        Contact law.
    law_error : float
        Its estimated relative error.
    steps : int
        Models computed.
    """

    values: FloatArray
    covariance: FloatArray
    sum_of_squares: float
    noise: float
    residuals: FloatArray
    modulus: int
    scaled_errors: tuple[float, ...]
    law_method: str
    law_error: float
    steps: int


class SeparableSearch:
    """One curve on its way to the optimum."""

    def __init__(
        self,
        coordinates: Sequence[Coordinate],
        noise: float | None,
        forward: Forward,
        curve: Curve,
        values: Mapping[str, float],
    ) -> None:
        self._coordinates, self._noise, self._forward, self._values = coordinates, noise, forward, values
        self._free = {coordinate.path: coordinate for coordinate in coordinates}
        depth, force = curve.depth, curve.force
        # In the order of depth, the points in contact are one piece.
        self._order = np.argsort(depth, kind="stable") if (depth[1:] < depth[:-1]).any() else None
        if self._order is not None:
            depth, force = depth[self._order], force[self._order]
        self._depth = depth
        fixed = [0.0 if path in self._free else values[path] for path in (BASELINE, SLOPE)]
        self._force = force - (fixed[0] + fixed[1] * self._depth) if any(fixed) else force
        self._deepest = float(depth[-1])
        self._span = self._deepest - float(depth[0])
        self._force_span = float(force.max() - force.min())
        self._law: ScaledLaw | None = None
        # Whether a law serves one modulus alone.
        self._follows = bool(forward.similarity.ratio_slopes(MODULUS, values))
        self._linear = self._linear_columns(self._depth)

    def solve(self) -> SeparableFit | None:
        """Return the optimum, or None if the search met something unusual."""
        if CONTACT in self._free:
            start = self._first_contact()
            found = None if start is None else self._descend(start)
        else:
            found = self._descend(self._values[CONTACT])
        if found is None or found.model is None or not found.model.gain > 0.0:
            return None
        return self._result(found.contact, found.model, found.steps)

    def _linear_columns(self, depth: FloatArray) -> list[FloatArray]:
        columns = {BASELINE: np.ones_like(depth), SLOPE: depth}
        return [column for path, column in columns.items() if path in self._free]

    def _law_for(self, deepest: float, modulus: float) -> ScaledLaw:
        """Law for tip depths up to `deepest` (m); the one at hand where it is the same."""
        law = self._law
        # Laws reach to a power of two (see `forward`): within the last octave the store would give the same.
        is_other = modulus != self._values[MODULUS]
        if law is None or is_other or not 0.5 * law.max_depth < deepest <= law.max_depth:
            self._values = {**self._values, MODULUS: modulus}
            law = self._law = self._forward.bare_law(self._values, deepest)
        return law

    def _at(self, contact: float, modulus: float) -> LinearModel | None:
        """Model at a contact depth (m) and a modulus (Pa); None where the contact gives no force at all."""
        deepest = max(self._deepest - contact, 0.0)
        law = self._law_for(deepest, modulus)
        before = int(np.searchsorted(self._depth, contact, side="right"))
        if before == len(self._depth):
            return None
        w = self._depth[before:] - contact
        columns = np.zeros((1 + len(self._linear), len(self._depth)))
        stiffness = np.zeros(len(self._depth))
        force, stiffness[before:], told = law.with_slopes(w)
        columns[0, before:] = force
        data, power = self._force, 1.0
        if self._follows:
            slopes = LawSlopes(
                self._forward.similarity,
                self._forward.laws,
                self._values,
                law,
                deepest,
                w,
                force,
                stiffness[before:],
                told,
                rough=False,
            )
            column = columns[0, before:] = modulus * slopes.of(MODULUS)
            power = float(column @ force) / float(force @ force)
            data = data.copy()
            data[before:] += column - force
        for row, column in enumerate(self._linear, start=1):
            columns[row] = column
        # Columns of unit length: newtons beside ones and metres would cost digits.
        lengths = np.sqrt(np.einsum("pn,pn->p", columns, columns))
        columns /= lengths[:, None]
        products = columns @ columns.T
        weights = solved(products, columns @ data)
        residuals = data - weights @ columns
        return LinearModel(
            modulus=modulus,
            power=power,
            columns=columns,
            products=products,
            lengths=lengths,
            weights=weights,
            stiffness=stiffness,
            residuals=residuals,
            sum_of_squares=float(residuals @ residuals),
            law_method=law.law.method,
            law_error=law.law.error_estimate,
        )

    def _descend(self, contact: float) -> _Place | None:
        model, steps = self._at(contact, self._values[MODULUS]), 1
        before = 0.0
        while model is not None and steps < _MOST_STEPS:
            step = self._step(model)
            length, turn = step.length, model.turn(step) if self._follows else 0.0
            # Steps shrink at a steady rate at least: the next one would be shorter by as much again.
            rate = min(1.0, abs(length) / before) if before else 1.0
            is_short = abs(length) <= _LINEAR * self._span and abs(length) * rate <= _SETTLED * self._span
            if is_short and abs(turn) <= _SAME_LAW:
                return _Place(contact + length, model.after(step), steps)
            before = abs(length)
            for _ in range(_MOST_HALVINGS):
                modulus = model.modulus * exp(turn)
                if not (self._allows(CONTACT, contact + length) and self._allows(MODULUS, modulus)):
                    return None
                trial, steps = self._at(contact + length, modulus), steps + 1
                if trial is not None and self._merit(trial) <= self._merit(model) * _NO_ASCENT:
                    break
                length, turn = 0.5 * length, 0.5 * turn
            else:
                return None
            contact, model = contact + length, trial
        return None

    def _merit(self, model: LinearModel) -> float:
        """Sum of squares at the modulus of the law itself, without the change of ln E that is solved for."""
        change = (float(model.linear[0]) - 1.0) * float(model.lengths[0]) if self._follows else 0.0
        return model.sum_of_squares + change * change  # residuals are at right angles to the columns

    def _step(self, model: LinearModel) -> ContactStep:
        """Step of the contact; none where it is held."""
        if CONTACT in self._free:
            return model.step()
        return ContactStep(0.0, np.zeros(len(model.lengths)), np.zeros(len(self._depth)))

    def _allows(self, path: str, value: float) -> bool:
        """Whether a value lies within its bounds, if it is free; not where it is not a number."""
        if path not in self._free:
            return True
        return self._free[path].low < value < self._free[path].high

    def _first_contact(self) -> float | None:
        """Best contact of a coarse grid on block means; None where no contact explains any force."""
        depth, force = self._blocks()
        coordinate = self._free[CONTACT]
        low, high = coordinate.low, coordinate.high
        grid = float(depth[0]) + _CONTACT_STEPS * self._span
        if np.isfinite(low) and np.isfinite(high) and high - low < grid[-1] - grid[0]:
            grid = low + (high - low) * _BETWEEN_BOUNDS
        else:
            grid = grid[(grid > low) & (grid < high)]
            if not grid.size:
                return None
        w = depth - grid[:, None]
        shapes = self._law_for(max(float(depth[-1] - grid[0]), 0.0), self._values[MODULUS]).force(w)
        linear = self._linear_columns(depth)
        if linear:
            q, _ = np.linalg.qr(np.stack([column / np.linalg.norm(column) for column in linear], axis=1))
            force, shapes = force - q @ (q.T @ force), shapes - (shapes @ q) @ q.T
        power = np.einsum("cm,cm->c", shapes, shapes)
        along = shapes @ force
        explained = np.square(along) / np.where(power > 0.0, power, np.inf)
        explained[along <= 0.0] = 0.0
        best = int(np.argmax(explained))
        return _parabola_top(grid, explained, best) if explained[best] > 0.0 else None

    def _blocks(self) -> tuple[FloatArray, FloatArray]:
        depth, force = self._depth, self._force
        count = min(_BLOCKS, len(depth))
        ends = np.arange(count + 1) * len(depth) // count
        edges, sizes = ends[:-1], ends[1:] - ends[:-1]
        return np.add.reduceat(depth, edges) / sizes, np.add.reduceat(force, edges) / sizes

    def _result(self, contact: float, model: LinearModel, steps: int) -> SeparableFit | None:
        n, k = len(self._depth), len(self._free)
        if n <= k or not model.sum_of_squares > 0.0:
            return None
        paths = [MODULUS, *(path for path in (BASELINE, SLOPE) if path in self._free)]
        found = dict(zip(paths, model.linear.tolist(), strict=True))
        rows = dict(zip(paths, model.columns, strict=True))
        units = dict(zip(paths, model.lengths.tolist(), strict=True))
        reference = model.modulus
        steepness = float(np.sqrt(model.stiffness @ model.stiffness))
        rows[CONTACT] = model.stiffness / steepness
        units[CONTACT] = -model.gain * steepness
        found[CONTACT] = contact
        found[MODULUS] = reference * (found[MODULUS] if not self._follows else exp(found[MODULUS] - 1.0))
        units[MODULUS] /= reference
        values = np.array([found[c.path] for c in self._coordinates])
        jacobian = np.stack([rows[c.path] for c in self._coordinates])
        lengths = np.array([units[c.path] for c in self._coordinates])
        products = jacobian @ jacobian.T
        # Its eigenvalues say whether it can be inverted, and with its vectors the inverse.
        powers, ways = np.linalg.eigh(products)
        if self._is_near_a_bound(values) or powers[0] < _CONDITION:
            return None
        noise = self._noise or float(np.sqrt(model.sum_of_squares / (n - k)))
        ways *= noise / lengths[:, None]
        covariance = (ways / powers) @ ways.T
        errors = np.sqrt(np.diag(covariance)) / np.array(self._natural_sizes(values))
        modulus = [c.path for c in self._coordinates].index(MODULUS)
        if self._follows and not errors[modulus] < _LOOSE:
            return None
        return SeparableFit(
            values=values,
            covariance=covariance,
            sum_of_squares=model.sum_of_squares,
            noise=noise,
            residuals=self._as_measured(model.residuals),
            modulus=modulus,
            scaled_errors=tuple(errors.tolist()),
            law_method=model.law_method,
            law_error=model.law_error,
            steps=steps,
        )

    def _as_measured(self, values: FloatArray) -> FloatArray:
        """Values in the order of the curve's points, (n,)."""
        if self._order is None:
            return values
        turned = np.empty_like(values)
        turned[self._order] = values
        return turned

    def _natural_sizes(self, values: FloatArray) -> list[float]:
        """Size (SI) of a change of each parameter that is of order one: see `coordinates`."""
        spans = {CONTACT: self._span, BASELINE: self._force_span, SLOPE: self._force_span / self._span}
        # A modulus is searched in its logarithm: a share of itself is the distance there.
        return [
            spans.get(coordinate.path, value)
            for coordinate, value in zip(self._coordinates, values.tolist(), strict=True)
        ]

    def _is_near_a_bound(self, values: FloatArray) -> bool:
        for coordinate, value, size in zip(
            self._coordinates, values.tolist(), self._natural_sizes(values), strict=True
        ):
            room = _NEAR_BOUND * min(size, coordinate.high - coordinate.low)
            if not coordinate.low + room < value < coordinate.high - room:
                return True
        return False


@dataclass(frozen=True)
class _Place:
    """A contact depth (m), the model there and how many were computed."""

    contact: float
    model: LinearModel | None
    steps: int


def _parabola_top(grid: FloatArray, values: FloatArray, best: int) -> float:
    """Top of the parabola through the largest of `values` and its neighbours on an even grid."""
    if not 0 < best < len(grid) - 1:
        return float(grid[best])
    before, top, after = values[best - 1 : best + 2].tolist()
    bend = before - 2.0 * top + after
    shift = 0.5 * (before - after) / bend if bend < 0.0 else 0.0
    return float(grid[best] + shift * (grid[1] - grid[0]))
