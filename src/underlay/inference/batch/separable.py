"""A fast fit of modulus, contact point and baseline, for maps of many thousand curves.

The force reading F at the depth reading d is

    F(d) = P(d - c; E) + baseline + slope d,

with P the contact force, c the contact depth and E the layer's modulus. Where that is the only modulus, P is E
times a force that does not depend on E: the model is linear in all parameters but c. For a given c the others are a
linear least-squares problem, so the search runs over c alone (variable projection: Golub and Pereyra 1973,
doi:10.1137/0710036; the step is Kaufman's 1975, doi:10.1007/BF01932995). On an elastic base of modulus E2 the law
changes with E / E2: it is linearised in ln E about the last iterate, with dP/d ln E from `LawSlopes`, and E changes
with every step of c, the force being nearly a power of it. The search ends where `least_squares.fit` ends, on the
same sum of squares.

Measured on 1000 points on a rigid base, modulus and contact free: the general search takes 3 times as long for a
whole row of a map, its scan and the construction of its problem included (processor time, median of 9 pairs of maps
of 24 curves); on a base ten times stiffer 3.5 times, under a sphere there 3 times. Whatever is unusual (a parameter
near a bound, a step that does not descend, an ill-conditioned set, a depth the law does not reach) is left to
`least_squares.fitting.quick_fit`: the result is then None.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from math import exp, log, nan
from typing import Self

import numpy as np

from underlay._arrays import FloatArray
from underlay.data.curve import Curve
from underlay.errors import InputError
from underlay.inference.least_squares.diagnostics import correlated
from underlay.inference.least_squares.fit_result import FitStatistics
from underlay.inference.least_squares.fit_warnings import warnings_of
from underlay.inference.model.coordinates import Coordinate
from underlay.inference.model.forward import Forward
from underlay.inference.model.law_slopes import LawSlopes
from underlay.inference.problem import Problem
from underlay.mechanics.contact_law import ScaledLaw
from underlay.mechanics.published.law import published_names
from underlay.scene.noise import Noise

# Largest step of ln E: where it would be larger the force hardly depends on E.
_FARTHEST = log(1e6)
#: Paths of the parameters that such a fit may have.
MODULUS = "layer.E"
CONTACT = "instrument.contact_depth"
BASELINE = "instrument.baseline"
SLOPE = "instrument.baseline_slope"
# Contact points tried first, in ranges of depth from the first reading (the search converges from half a step
# away), or as shares of the interval between narrower bounds.
_CONTACT_STEPS = np.linspace(-0.25, 0.95, 25)
_BETWEEN_BOUNDS = np.linspace(0.0, 1.0, 25)[1:-1]
_BLOCKS = 32  # number of averages of successive readings for that trial
# Step of the contact, as a share of the depth range, at which the search ends: it would change E by some 2e-8 of
# itself.
_SETTLED = 1e-8
# Step, as the same share, over which the stiffness, and so the standard errors, change by the same order.
_LINEAR = 2e-6
# Change of ln E up to which a law is reused: the error is at most its square, 1e-10.
_SAME_LAW = 1e-5
# Standard error of ln E from which the base may hide E, and there may be other optima: left to `quick_fit`.
_LOOSE = 0.1
# Largest number of steps of the search, and of halvings of one step, before the fit is left to `quick_fit`.
_MOST_STEPS = 25
_MOST_HALVINGS = 6
# Ratio of two sums of squares that are equal but for rounding.
_NO_ASCENT = 1.0 + 1e-9
# Nearer to a bound than this (log of a modulus, ranges of depth or force), the bounded search decides.
_NEAR_BOUND = 1e-3
# Smallest eigenvalue of the correlation matrix of the columns: below, normal equations lose half the digits.
_CONDITION = 1e-8
_EXPONENT = "indenter.exponent"
_SEPARABLE = frozenset({MODULUS, CONTACT, BASELINE, SLOPE})
# These thresholds catch every fit that `fit_warnings` could warn of, and a few more; published corrections warn of
# their range. Runs fewer than expected, in standard deviations: this many have a probability of 6e-3; a warning
# needs 1e-3.
_FEW_RUNS = -2.5
# Correlation, and standard error in a scaled coordinate: a warning needs 0.99 and one.
_CORRELATED, _WIDE = 0.98, 0.5


@dataclass(frozen=True)
class SeparableModel:
    """What all curves of a map have in common, compiled for the fast fit; the entry point of this module.

    Parameters
    ----------
    forward : Forward
        Forward model of the common scene, with a cache of the laws that curves share.
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
        """Compile the model of a problem of one curve, or return None where the fast fit cannot be used."""
        if len(problem.members) != 1:
            return None
        member = problem.members[0]
        noise = member.noise
        separable = (
            MODULUS in member.entries
            and member.forward.history is None
            and member.forward.left_out is None
            and member.scene.lever is None
            and set(problem.names) <= _SEPARABLE
            and MODULUS in member.forward.similarity.force_scales
            and not member.forward.similarity.energies
            and (member.forward.similarity.force_scales == (MODULUS,) or member.forward.laws.know_slopes)
            and not any(coordinate.prior.informative for coordinate in problem.coordinates)
            and isinstance(noise, Noise)
            and not (noise.follows_force or noise.correlation)
        )
        known = noise.force if isinstance(noise, Noise) else None
        return cls(member.forward, problem.coordinates, known) if separable else None

    def fit(self, curve: Curve, values: Mapping[str, float]) -> SeparableFit | None:
        """Fit one curve; None where `least_squares.fitting.quick_fit` has to do it.

        Parameters
        ----------
        curve : Curve
            The readings, (n,).
        values : mapping
            Every number of its scene (SI); those of free parameters are starting values.

        Returns
        -------
        SeparableFit or None
            None where anything is unusual; see the head of this module.
        """
        if values["instrument.compliance"]:
            return None
        try:
            forward = self._forward_of(curve, values)
            return SeparableSearch(self.coordinates, self.noise, forward, curve, values).solve()
        except InputError:
            # No law reaches a contact that was tried; the bounded search can step back from such points.
            return None

    def _forward_of(self, curve: Curve, values: Mapping[str, float]) -> Forward:
        """The forward model of a curve, with its own tables where its numbers differ from the shared scene's."""
        similarity, laws = self.forward.similarity, self.forward.laws
        served = {MODULUS, similarity.length, *similarity.shape} - {_EXPONENT}
        if laws.table is not None:
            # The table of a stack has the thicknesses relative to that of its top layer.
            served = (served - ({similarity.length} if similarity.lengths else set())) | {laws.table.path}
        served |= set() if laws.tips is None else {laws.tips.path, *similarity.lengths}
        own = {
            path: values[path]
            for path, held in similarity.values.items()
            if path not in served and not path.startswith("instrument.") and values[path] != held
        }
        if not own:
            return replace(self.forward, depth=curve.depth)
        scene, free = similarity.scene.with_values(own), [entry.path for entry in self.coordinates]
        return Forward.compile(scene, curve.depth, free, laws.solver, laws.store)


@dataclass(frozen=True)
class SeparableFit:
    """Optimum of one curve of a map.

    Parameters
    ----------
    values : FloatArray
        Parameters (SI) in the order of the problem, (k,).
    covariance : FloatArray
        Covariance of the parameters (SI), (k, k).
    sum_of_squares : float
        Sum of the squared residuals (N^2).
    noise : float
        White noise (N) used for the covariance: the given one, or the scatter about the fit.
    residuals : FloatArray
        Data minus model (N), (n,).
    modulus : int
        Index of the layer's modulus among the parameters.
    scaled_errors : tuple of float
        Standard errors over the natural size of each parameter, (k,).
    law_method : str
        Method of the contact law.
    law_error : float
        Estimated relative error of that law.
    steps : int
        Number of model evaluations.
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
    """Search for the optimum of one curve over the contact depth, all else being solved for linearly."""

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
        # In the order of depth, the points in contact are contiguous.
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
        # Whether the law has to be computed again for each modulus.
        self._follows = bool(forward.similarity.ratio_slopes(MODULUS, values))
        self._linear = self._linear_columns(self._depth)

    def solve(self) -> SeparableFit | None:
        """Return the optimum, or None where the search met a case that it does not handle."""
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
        """Contact law for tip depths up to `deepest` (m) at a modulus (Pa); the last one if it is the same."""
        law = self._law
        # Laws reach to a power of two (see `forward`): within the last octave the cache would return the same.
        is_other = modulus != self._values[MODULUS]
        if law is None or is_other or not 0.5 * law.max_depth < deepest <= law.max_depth:
            self._values = {**self._values, MODULUS: modulus}
            law = self._law = self._forward.bare_law(self._values, deepest)
        return law

    def _at(self, contact: float, modulus: float) -> LinearModel | None:
        """Model at a contact depth (m) and a modulus (Pa); None where no reading lies beyond that contact."""
        deepest = max(self._deepest - contact, 0.0)
        law = self._law_for(deepest, modulus)
        before = int(np.searchsorted(self._depth, contact, side="right"))
        if before == len(self._depth):
            return None
        w = self._depth[before:] - contact
        columns = np.zeros((1 + len(self._linear), len(self._depth)))
        stiffness = np.zeros(len(self._depth))
        force, stiffness[before:], known_slopes = law.with_slopes(w)
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
                known_slopes,
                rough=False,
            )
            column = columns[0, before:] = modulus * slopes.of(MODULUS)
            power = float(column @ force) / float(force @ force)
            data = data.copy()
            data[before:] += column - force
        for row, column in enumerate(self._linear, start=1):
            columns[row] = column
        # Columns of unit length: different units (N, 1, m) would cost digits.
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
            law_method=law.method,
            law_error=law.error_estimate,
        )

    def _descend(self, contact: float) -> _Place | None:
        model, steps = self._at(contact, self._values[MODULUS]), 1
        before = 0.0
        while model is not None and steps < _MOST_STEPS:
            step = self._step(model)
            length, turn = step.length, model.turn(step) if self._follows else 0.0
            # Steps shrink at least at a steady rate: the next one would be shorter by the same factor.
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
        """Sum of squares with the modulus kept at the law's, before the linear change of ln E solved for."""
        change = (float(model.linear[0]) - 1.0) * float(model.lengths[0]) if self._follows else 0.0
        return model.sum_of_squares + change * change  # residuals are orthogonal to the columns

    def _step(self, model: LinearModel) -> ContactStep:
        """Step of the contact depth; of length zero where it is not free."""
        if CONTACT in self._free:
            return model.step()
        return ContactStep(0.0, np.zeros(len(model.lengths)), np.zeros(len(self._depth)))

    def _allows(self, path: str, value: float) -> bool:
        """Whether a value lies within its bounds; True for parameters that are not free, False for NaN."""
        if path not in self._free:
            return True
        return self._free[path].low < value < self._free[path].high

    def _first_contact(self) -> float | None:
        """Starting contact depth (m), the best of a coarse grid on averaged readings; None if none has a force."""
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
        # The eigenvalues show whether it can be inverted, and with the eigenvectors give the inverse.
        powers, vectors = np.linalg.eigh(products)
        if self._is_near_a_bound(values) or powers[0] < _CONDITION:
            return None
        noise = self._noise or float(np.sqrt(model.sum_of_squares / (n - k)))
        vectors *= noise / lengths[:, None]
        covariance = (vectors / powers) @ vectors.T
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
        """Values (n,) brought from the order of depth to that of the curve's points."""
        if self._order is None:
            return values
        turned = np.empty_like(values)
        turned[self._order] = values
        return turned

    def _natural_sizes(self, values: FloatArray) -> list[float]:
        """Size (SI) of a change of each parameter that is of order one in scaled coordinates."""
        spans = {CONTACT: self._span, BASELINE: self._force_span, SLOPE: self._force_span / self._span}
        # A modulus is searched in its logarithm, in which a relative change is the distance.
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
    """A contact depth (m), the model there, and the number of evaluations so far."""

    contact: float
    model: LinearModel | None
    steps: int


@dataclass(frozen=True)
class LinearModel:
    """Model at one contact depth, linear in all else, with the linear parameters solved for.

    Parameters
    ----------
    modulus : float
        Young's modulus of the layer (Pa) at which the law is evaluated.
    power : float
        d ln P / d ln E; one where the force is proportional to the modulus.
    columns : FloatArray
        d model / d linear parameter, scaled to unit length, (p, n); the first is dP/d ln E.
    products : FloatArray
        Inner products of the columns, (p, p).
    lengths : FloatArray
        Lengths of the columns before scaling, (p,).
    weights : FloatArray
        Solution in the unit columns, (p,).
    stiffness : FloatArray
        dP/dw (N/m), (n,).
    residuals : FloatArray
        Data minus model (N), (n,).
    sum_of_squares : float
        Sum of the squared residuals (N^2).
    law_method, law_error
        Method of the contact law, and its estimated relative error.
    """

    modulus: float
    power: float
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
        """Linear parameters (p,): one plus the first-order change of ln E, then baseline and slope (SI) if free."""
        return self.weights / self.lengths

    @property
    def gain(self) -> float:
        """Fitted force over the law's, if the force is a power of the modulus."""
        return 1.0 + self.power * (float(self.linear[0]) - 1.0)

    def turn(self, step: ContactStep) -> float:
        """Change of ln E after a step of the contact; NaN where it would exceed a factor of 1e6."""
        after = self.after(step).gain
        turn = log(after) / self.power if after > 0.0 < self.power else nan
        return turn if abs(turn) < _FARTHEST else nan

    def step(self) -> ContactStep:
        """Kaufman's step of the contact depth (m); NaN where the contact has no effect on the force."""
        along = solved(self.products, self.columns @ self.stiffness)
        across = self.stiffness - along @ self.columns
        power, gain = float(across @ across), self.gain
        if not (power > 0.0 and gain > 0.0):
            return ContactStep(nan, along, across)
        return ContactStep(-float(across @ self.residuals) / (gain * power), along, across)

    def after(self, step: ContactStep) -> LinearModel:
        """The model after a step, linearised in the step."""
        change = self.gain * step.length
        residuals = self.residuals + change * step.across
        return replace(
            self,
            weights=self.weights + change * step.along,
            residuals=residuals,
            sum_of_squares=float(residuals @ residuals),
        )


@dataclass(frozen=True)
class ContactStep:
    """A step of the contact depth.

    `length` is the step (m); `along` (p,) are the coefficients of the stiffness in the linear columns, `across`
    (n,) its part orthogonal to them.
    """

    length: float
    along: FloatArray
    across: FloatArray


def solved(matrix: FloatArray, right: FloatArray) -> FloatArray:
    """Solution (p,) of a small symmetric system; a 1 x 1 system is divided directly, for speed."""
    return np.asarray(right / matrix[0, 0] if len(right) == 1 else np.linalg.solve(matrix, right))


def _parabola_top(grid: FloatArray, values: FloatArray, best: int) -> float:
    """Position of the maximum of the parabola through the largest value and its neighbours on an even grid."""
    if not 0 < best < len(grid) - 1:
        return float(grid[best])
    before, top, after = values[best - 1 : best + 2].tolist()
    bend = before - 2.0 * top + after
    shift = 0.5 * (before - after) / bend if bend < 0.0 else 0.0
    return float(grid[best] + shift * (grid[1] - grid[0]))


def separable_warnings(found: SeparableFit, problem: Callable[[], Problem]) -> tuple[str, ...]:
    """Return the warnings of a separable fit as texts, the same as those of a general fit (`warnings_of`).

    Parameters
    ----------
    found : SeparableFit
        The optimum.
    problem : callable
        Builds the problem that was solved; called only where a warning is possible.
    """
    deviation = np.sqrt(np.diag(found.covariance))
    correlation = np.abs(found.covariance / (deviation[:, None] * deviation))
    np.fill_diagonal(correlation, 0.0)
    harmless = (
        correlation.max() < _CORRELATED
        and found.law_error < found.scaled_errors[found.modulus] < _WIDE
        and max(found.scaled_errors) < _WIDE
        and _runs_score(found.residuals) > _FEW_RUNS
        and found.law_method not in published_names()
    )
    if harmless:
        return ()
    made = problem()
    vector = made.vector(dict(zip(made.names, found.values.tolist(), strict=True)))
    law, slopes = made.members[0].law(made.physical(vector)), made.slopes(vector)
    scaled = found.covariance / np.outer(slopes, slopes)
    related = correlated(found.residuals / found.noise, found.residuals)
    warnings = warnings_of(made, [law], {}, {}, scaled, (related,), _statistics(found, made), ())
    return tuple(str(warning) for warning in warnings)


def _runs_score(residuals: FloatArray) -> float:
    """Number of runs of residuals of one sign, less the expected number, in standard deviations."""
    above = residuals > 0.0
    n, positive = len(above), int(np.count_nonzero(above))
    expected = 1.0 + 2.0 * positive * (n - positive) / n
    variance = (expected - 1.0) * (expected - 2.0) / (n - 1.0)
    if not variance > 0.0:
        return 0.0
    runs = 1 + int(np.count_nonzero(above[1:] != above[:-1]))
    return (runs - expected) / float(np.sqrt(variance))


def _statistics(found: SeparableFit, problem: Problem) -> FitStatistics:
    n, k = len(found.residuals), len(found.values)
    estimated = problem.members[0].scale_is_unknown
    chi_square = found.sum_of_squares / found.noise**2
    # The likelihood is maximal at S / n; the noise was estimated with n - k.
    variance = found.sum_of_squares / n if estimated else found.noise**2
    log_likelihood = -0.5 * n * float(np.log(2.0 * np.pi * variance)) - 0.5 * found.sum_of_squares / variance
    free_count = k + estimated
    return FitStatistics(
        points=n,
        parameters=k,
        chi_square=chi_square,
        reduced_chi_square=chi_square / (n - k),
        log_likelihood=log_likelihood,
        aic=2.0 * free_count - 2.0 * log_likelihood,
        bic=free_count * float(np.log(n)) - 2.0 * log_likelihood,
        evaluations=found.steps,
        failures=0,
        laws_built=0,
        seconds=0.0,
        success=True,
        stopped="the contact moves no more",
        method="variable projection",
        robust="none",
        law_method=found.law_method,
        law_reason="",
        law_error=found.law_error,
        noise_estimated=estimated,
    )
