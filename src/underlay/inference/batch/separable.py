"""The fit a map repeats ten thousand times: a modulus, a contact point and a baseline on a held law.

Where the layer's modulus is the only one, the reading is linear in all parameters but one:

    F(d) = E p(d - c) + baseline + slope d,

with p the force per modulus of a law that stays put. For a contact depth c the rest is a linear least-squares
problem, so the search runs over c alone (variable projection: Golub and Pereyra 1973, doi:10.1137/0710036;
the step is Kaufman's 1975, doi:10.1007/BF01932995). It ends where `least_squares.fit` ends, on the same sum
of squares. Measured on 1000 points on a rigid base, modulus and contact free: by the engine a whole row of a map
takes 3 times as long, its scan and the making of its problem included (processor time, median of 9 pairs of maps of
24 curves). Whatever is unusual (a parameter near a bound, a step that does not descend, an ill-conditioned set,
a depth the law does not reach) is left to `least_squares.fitting.quick_fit`: the answer is then None.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Self

import numpy as np

from underlay._arrays import FloatArray
from underlay.data.curve import Curve
from underlay.errors import InputError
from underlay.inference.model.coordinates import Coordinate
from underlay.inference.model.forward import Forward
from underlay.inference.problem import Problem
from underlay.mechanics.scaled_law import ScaledLaw
from underlay.scene.noise import Noise

__all__ = ["SeparableFit", "SeparableModel"]

_MODULUS = "layer.E"
_CONTACT = "instrument.contact_depth"
_BASELINE = "instrument.baseline"
_SLOPE = "instrument.baseline_slope"
_SEPARABLE = frozenset({_MODULUS, _CONTACT, _BASELINE, _SLOPE})

# Contacts tried first, in ranges of depth from the first reading: half a step is within reach of the search.
_CONTACT_STEPS = np.linspace(-0.25, 0.95, 25)
_BLOCKS = 32  # means of neighbouring points for that trial
# The search ends before a step of the contact below this share of the depth range: it would move E by some
# 2e-8 of itself.
_SETTLED = 1e-8
# Over a step below this share the stiffness, and so the standard errors, change by as little.
_LINEAR = 2e-6
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


@dataclass(frozen=True)
class _Model:
    """Model at one contact, the linear parameters solved for.

    Parameters
    ----------
    columns : FloatArray
        d model / d linear parameter, brought to unit length, (p, n); the first is the force's.
    products : FloatArray
        Their inner products, (p, p).
    lengths : FloatArray
        What they were divided by, (p,).
    weights : FloatArray
        Solution in the unit columns, (p,).
    stiffness : FloatArray
        dP/dw (N/m) at the starting modulus, (n,).
    residuals : FloatArray
        Data minus model (N), (n,).
    sum_of_squares : float
        Of them.
    law_method, law_error
        Of the contact law.
    """

    columns: FloatArray
    products: FloatArray
    lengths: FloatArray
    weights: FloatArray
    stiffness: FloatArray
    residuals: FloatArray
    sum_of_squares: float
    law_method: str
    law_error: float

    @property
    def linear(self) -> FloatArray:
        """Modulus over the starting one, then baseline and slope (SI) as far as free, (p,)."""
        return self.weights / self.lengths

    def step(self) -> _Step:
        """Kaufman's step of the contact depth; of NaN metres where the contact does not act."""
        along = _solve(self.products, self.columns @ self.stiffness)
        across = self.stiffness - along @ self.columns
        power, amplitude = float(across @ across), float(self.weights[0] / self.lengths[0])
        if not (power > 0.0 and amplitude > 0.0):
            return _Step(float("nan"), along, across)
        return _Step(-float(across @ self.residuals) / (amplitude * power), along, across)

    def after(self, step: _Step) -> _Model:
        """The model after a step so short that it is linear there."""
        change = float(self.linear[0]) * step.length
        residuals = self.residuals + change * step.across
        return replace(
            self,
            weights=self.weights + change * step.along,
            residuals=residuals,
            sum_of_squares=float(residuals @ residuals),
        )


@dataclass(frozen=True)
class _Step:
    """Length (m) of a step of the contact; the stiffness along (p,) and across (n,) the linear columns."""

    length: float
    along: FloatArray
    across: FloatArray


def _solve(matrix: FloatArray, right: FloatArray) -> FloatArray:
    """Solve a small symmetric system; a single equation needs no library."""
    return np.asarray(right / matrix[0, 0] if len(right) == 1 else np.linalg.solve(matrix, right))


@dataclass(frozen=True)
class SeparableModel:
    """What all curves of a map have in common, compiled.

    Parameters
    ----------
    forward : Forward
        Of the common scene; its store holds the laws that curves share.
    coordinates : tuple of Coordinate
        The free parameters.
    noise : float or None
        White noise (N), or None where it is estimated.
    """

    forward: Forward
    coordinates: tuple[Coordinate, ...]
    noise: float | None

    @classmethod
    def of(cls, problem: Problem) -> Self | None:
        """Compile the model of a problem of one curve, or return None where it is not separable."""
        if len(problem.members) != 1:
            return None
        member = problem.members[0]
        noise = member.noise
        separable = (
            _MODULUS in member.entries
            and member.forward.history is None
            and member.forward.left_out is None
            and member.scene.lever is None
            and set(problem.names) <= _SEPARABLE
            and member.forward.similarity.force_scales == (_MODULUS,)
            and not any(coordinate.prior.informative for coordinate in problem.coordinates)
            and isinstance(noise, Noise)
            and not (noise.follows_force or noise.correlation)
        )
        known = noise.force if isinstance(noise, Noise) else None
        return cls(member.forward, problem.coordinates, known) if separable else None

    def fit(self, curve: Curve, values: Mapping[str, float]) -> SeparableFit | None:
        """Fit one fittable curve; None hands it to `least_squares.fit`.

        Parameters
        ----------
        curve : Curve
            The points, (n,).
        values : mapping
            Every number of its scene (SI).
        """
        if values["instrument.compliance"]:
            return None
        try:
            return _Search(self, replace(self.forward, depth=curve.depth), curve, values).solve()
        except InputError:
            # No law reaches a contact that was tried; the bounded search steps back from such places.
            return None


class _Search:
    """One curve on its way to the optimum."""

    def __init__(
        self, model: SeparableModel, forward: Forward, curve: Curve, values: Mapping[str, float]
    ) -> None:
        self._model, self._forward, self._values = model, forward, values
        self._free = {coordinate.path: coordinate for coordinate in model.coordinates}
        depth, force = curve.depth, curve.force
        # In the order of depth, the points in contact are one piece.
        self._order = np.argsort(depth, kind="stable") if (np.diff(depth) < 0.0).any() else None
        if self._order is not None:
            depth, force = depth[self._order], force[self._order]
        self._depth = depth
        fixed = [0.0 if path in self._free else values[path] for path in (_BASELINE, _SLOPE)]
        self._force = force - (fixed[0] + fixed[1] * self._depth) if any(fixed) else force
        self._deepest = float(depth[-1])
        self._span = self._deepest - float(depth[0])
        self._force_span = float(force.max() - force.min())
        self._law: ScaledLaw | None = None
        self._linear = self._linear_columns(self._depth)

    def solve(self) -> SeparableFit | None:
        """Return the optimum, or None if the search met something unusual."""
        if _CONTACT in self._free:
            start = self._first_contact()
            found = None if start is None else self._descend(start)
        else:
            found = _Place(self._values[_CONTACT], self._at(self._values[_CONTACT]), 1)
        if found is None or found.model is None or not found.model.linear[0] > 0.0:
            return None
        return self._result(found.contact, found.model, found.steps)

    def _linear_columns(self, depth: FloatArray) -> list[FloatArray]:
        columns = {_BASELINE: np.ones_like(depth), _SLOPE: depth}
        return [column for path, column in columns.items() if path in self._free]

    def _law_for(self, deepest: float) -> ScaledLaw:
        """Law for tip depths up to `deepest` (m); the one at hand where it is the same."""
        law = self._law
        # Laws reach to a power of two (see `forward`): within the last octave the store would give the same.
        if law is None or not 0.5 * law.max_depth < deepest <= law.max_depth:
            law = self._law = self._forward.bare_law(self._values, deepest)
        return law

    def _at(self, contact: float) -> _Model | None:
        """Model at a contact depth (m); None where the contact gives no force at all."""
        law = self._law_for(max(self._deepest - contact, 0.0))
        before = int(np.searchsorted(self._depth, contact, side="right"))
        if before == len(self._depth):
            return None
        w = self._depth[before:] - contact
        columns = np.zeros((1 + len(self._linear), len(self._depth)))
        stiffness = np.zeros(len(self._depth))
        columns[0, before:] = law.force(w)
        stiffness[before:] = law.stiffness(w)
        for row, column in enumerate(self._linear, start=1):
            columns[row] = column
        # Columns of unit length: newtons beside ones and metres would cost digits.
        lengths = np.sqrt(np.einsum("pn,pn->p", columns, columns))
        columns /= lengths[:, None]
        products = columns @ columns.T
        weights = _solve(products, columns @ self._force)
        residuals = self._force - weights @ columns
        return _Model(
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
        low, high = self._free[_CONTACT].low, self._free[_CONTACT].high
        model, steps = self._at(contact), 1
        before = 0.0
        while model is not None and steps < _MOST_STEPS:
            step = model.step()
            length = step.length
            # Steps shrink at a steady rate at least: the next one would be shorter by as much again.
            rate = min(1.0, abs(length) / before) if before else 1.0
            if abs(length) <= _LINEAR * self._span and abs(length) * rate <= _SETTLED * self._span:
                return _Place(contact + length, model.after(step), steps)
            before = abs(length)
            for _ in range(_MOST_HALVINGS):
                if not low < contact + length < high:
                    return None
                trial, steps = self._at(contact + length), steps + 1
                if trial is not None and trial.sum_of_squares <= model.sum_of_squares * _NO_ASCENT:
                    break
                length *= 0.5
            else:
                return None
            contact, model = contact + length, trial
        return None

    def _first_contact(self) -> float | None:
        """Best contact of a coarse grid on block means; None where no contact explains any force."""
        depth, force = self._blocks()
        coordinate = self._free[_CONTACT]
        low, high = coordinate.low, coordinate.high
        grid = float(depth[0]) + _CONTACT_STEPS * self._span
        if np.isfinite(low) and np.isfinite(high) and high - low < grid[-1] - grid[0]:
            grid = np.linspace(low, high, len(grid))
        grid = grid[(grid > low) & (grid < high)]
        if not grid.size:
            return None
        w = depth - grid[:, None]
        shapes = self._law_for(max(float(depth[-1] - grid[0]), 0.0)).force(w)
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
        edges = np.linspace(0, len(depth), min(_BLOCKS, len(depth)), endpoint=False).astype(np.intp)
        sizes = np.diff(edges, append=len(depth))
        return np.add.reduceat(depth, edges) / sizes, np.add.reduceat(force, edges) / sizes

    def _result(self, contact: float, model: _Model, steps: int) -> SeparableFit | None:
        n, k = len(self._depth), len(self._free)
        if n <= k or not model.sum_of_squares > 0.0:
            return None
        paths = [_MODULUS, *(path for path in (_BASELINE, _SLOPE) if path in self._free)]
        found = dict(zip(paths, model.linear.tolist(), strict=True))
        rows = dict(zip(paths, model.columns, strict=True))
        units = dict(zip(paths, model.lengths.tolist(), strict=True))
        reference = self._values[_MODULUS]
        steepness = float(np.sqrt(model.stiffness @ model.stiffness))
        rows[_CONTACT] = model.stiffness / steepness
        units[_CONTACT] = -found[_MODULUS] * steepness
        found[_CONTACT] = contact
        found[_MODULUS] *= reference
        units[_MODULUS] /= reference
        values = np.array([found[c.path] for c in self._model.coordinates])
        jacobian = np.stack([rows[c.path] for c in self._model.coordinates])
        lengths = np.array([units[c.path] for c in self._model.coordinates])
        products = jacobian @ jacobian.T
        if self._is_near_a_bound(values) or np.linalg.eigvalsh(products)[0] < _CONDITION:
            return None
        noise = self._model.noise or float(np.sqrt(model.sum_of_squares / (n - k)))
        covariance = np.linalg.inv(products) * (noise**2 / np.outer(lengths, lengths))
        errors = np.sqrt(np.diag(covariance)) / np.array(self._natural_sizes(values))
        return SeparableFit(
            values=values,
            covariance=covariance,
            sum_of_squares=model.sum_of_squares,
            noise=noise,
            residuals=self._as_measured(model.residuals),
            modulus=[c.path for c in self._model.coordinates].index(_MODULUS),
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
        spans = {_CONTACT: self._span, _BASELINE: self._force_span, _SLOPE: self._force_span / self._span}
        # A modulus is searched in its logarithm: a share of itself is the distance there.
        return [
            spans.get(coordinate.path, value)
            for coordinate, value in zip(self._model.coordinates, values.tolist(), strict=True)
        ]

    def _is_near_a_bound(self, values: FloatArray) -> bool:
        for coordinate, value, size in zip(
            self._model.coordinates, values.tolist(), self._natural_sizes(values), strict=True
        ):
            room = _NEAR_BOUND * min(size, coordinate.high - coordinate.low)
            if not coordinate.low + room < value < coordinate.high - room:
                return True
        return False


@dataclass(frozen=True)
class _Place:
    """A contact depth (m), the model there and how many were computed."""

    contact: float
    model: _Model | None
    steps: int


def _parabola_top(grid: FloatArray, values: FloatArray, best: int) -> float:
    """Top of the parabola through the largest of `values` and its neighbours on an even grid."""
    if not 0 < best < len(grid) - 1:
        return float(grid[best])
    before, top, after = values[best - 1 : best + 2].tolist()
    bend = before - 2.0 * top + after
    shift = 0.5 * (before - after) / bend if bend < 0.0 else 0.0
    return float(grid[best] + shift * (grid[1] - grid[0]))
