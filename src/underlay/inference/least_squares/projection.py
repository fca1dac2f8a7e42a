"""Variable projection: parameters in which the model is linear are solved for at every point of a search.

Such are baselines, moduli, and relaxing fractions of a Prony series. A step along the valley of modulus and
thickness leaves the modulus behind; solving for what is linear (Golub and Pereyra 1973, doi:10.1137/0710036)
corrects it without another model. Several points are treated at once: the time of a step goes into calls, not
arithmetic, and the same calls serve all of them.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple, Self

import numpy as np
from numpy.typing import NDArray

from underlay._arrays import FloatArray
from underlay.inference.model.members import Member
from underlay.inference.problem import Problem
from underlay.scene.instrument import SENSITIVITY_RATIO

# Paths of the parameters in which a reading is linear by themselves.
_LINEAR = ("instrument.baseline", "instrument.baseline_slope")
# Least factor on the moduli that is taken: below it the linear parameters stay where they are, rather than make a
# force that is not there.
_LEAST_FACTOR = 0.1
# An entry whose column is this small beside the largest, or that moves all readings together by less than this
# many standard deviations per unit, does not act any more (a base so stiff that it might be rigid). Levenberg
# and Marquardt measure a step by the columns: that entry's is then without end, the law refuses it, and the
# steps of all entries shrink below the tolerance before that one is short enough.
_IDLE, _FLAT = 1e-10, 1e-4


# A solution that promises to lower the sum of squares by less than this share of it waits for the next step of
# the search, which moves the fractions too: a model costs as much as a step.
_WORTH = 0.02
# A share this far below zero is zero but for the rounding of the solution.
_ROUNDING = 1e-9


@dataclass(frozen=True)
class Point:
    """A point of a search; r are the whitened residuals there, J their derivatives in the scaled parameters.

    Parameters
    ----------
    vector : FloatArray
        Scaled parameters, (k,).
    square : float
        Sum of squares r'r.
    gradient : FloatArray
        J'r, (k,).
    normal : FloatArray
        J'J, (k, k).
    """

    vector: FloatArray
    square: float
    gradient: FloatArray
    normal: FloatArray


@dataclass(frozen=True)
class LinearDirections:
    """Directions of the scaled parameters in which the model is linear.

    Parameters
    ----------
    rows : FloatArray
        The directions, (p, k): baselines, and the moduli together where one factor on them is a factor on the force
        of every curve.
    scales : bool
        Whether the last is that of the moduli: a step there is the logarithm of the factor.
    through_force : ndarray of bool (k,)
        Parameters that act through the contact force.
    """

    rows: FloatArray
    scales: bool
    through_force: NDArray[np.bool_]

    @classmethod
    def of(cls, problem: Problem, free: set[int]) -> Self:
        """Find the directions of a problem's parameters in which the model is linear.

        `free` are the entries that vary and have no measured prior.
        """
        unit = np.eye(len(problem.coordinates))
        baseline = np.array([coordinate.path in _LINEAR for coordinate in problem.coordinates])
        # The bending of a cantilever depends on the whole reading, baseline included, which is then not linear.
        bends = any(_may_bend(member) for member in problem.members)
        rows = [
            unit[i] for i, is_linear in enumerate(baseline.tolist()) if is_linear and i in free and not bends
        ]
        moduli = _common_moduli(problem.members)
        scales = bool(moduli) and moduli <= free
        if scales:
            rows.append(unit[sorted(moduli)].sum(axis=0))
        return cls(np.reshape(rows, (len(rows), len(unit))), scales, ~baseline)

    def steps(
        self, places: Places, low: FloatArray, high: FloatArray
    ) -> tuple[FloatArray, FloatArray, FloatArray] | None:
        """Steps that bring the linear parameters to their least-squares values at s points, within limits (s, k).

        A point takes no step where a linear parameter has no effect, the force would vanish, or a limit would be
        passed; None where no point takes one.

        Returns
        -------
        tuple of FloatArray
            Changes of the scaled vectors; the step times which the residuals' derivatives are their exact change;
            factors by which it multiplies these derivatives; (s, k) each.
        """
        if not len(self.rows):
            return None
        normal = self.rows @ places.normal @ self.rows.T
        usable = np.asarray((normal.diagonal(axis1=1, axis2=2) > 0.0).all(axis=1))
        if not usable.all():
            normal = np.where(usable[:, None, None], normal, np.eye(len(self.rows)))
        slopes = places.gradient @ self.rows.T
        # Mostly there is one, and a solver takes ten times as long as a quotient.
        alone = len(self.rows) == 1
        along = -(slopes / normal[:, 0] if alone else np.linalg.solve(normal, slopes[:, :, None])[:, :, 0])
        change, grown = along, np.ones(places.vector.shape)
        if self.scales:
            factor = 1.0 + along[:, -1]
            usable = usable & (factor > _LEAST_FACTOR)
            factor = np.where(usable, factor, 1.0)
            change = along.copy()
            change[:, -1] = np.log(factor)
            # All that acts through the contact force grows with it.
            grown[:, self.through_force] = factor[:, None]
        change, along = change @ self.rows, along @ self.rows
        there = places.vector + change
        usable = np.asarray(usable & ((there >= low) & (there <= high)).all(axis=1))
        if usable.all():
            return change, along, grown
        if not usable.any():
            return None
        kept = usable[:, None]
        return np.where(kept, change, 0.0), np.where(kept, along, 0.0), np.where(kept, grown, 1.0)


def _common_moduli(members: Sequence[Member]) -> set[int]:
    """Entries of all moduli (and works of adhesion) where one factor on them is a factor on every curve's force.

    Empty where there is no such factor: a modulus is fixed, the frame or the cantilever yields, or curves differ.
    """
    found: list[set[int]] = []
    for member in members:
        gives = bool(member.base["instrument.compliance"]) or "instrument.compliance" in member.entries
        gives = gives or _may_bend(member)
        moduli = member.forward.similarity.force_scales
        if gives or any(path not in member.entries for path in moduli):
            return set()
        found.append({member.entries[path] for path in moduli})
    return found[0] if all(moduli == found[0] for moduli in found) else set()


def _may_bend(member: Member) -> bool:
    """Whether the cantilever may bend by other than what was subtracted from the depth readings."""
    return SENSITIVITY_RATIO in member.entries or member.forward.bends(member.base)


def acting(norms: FloatArray) -> NDArray[np.bool_]:
    """Which parameters have an effect, (..., k), by the norms of their whitened derivatives, (..., k)."""
    largest = norms.max(axis=-1, keepdims=True, initial=0.0)
    return np.asarray(norms > np.maximum(_IDLE * largest, _FLAT))


class Rows(NamedTuple):
    """Residuals and derivatives of one curve at s points.

    Parameters
    ----------
    residuals : FloatArray
        Whitened, (s, n).
    derivatives : FloatArray
        Derivatives of the residuals in the scaled parameters that the curve depends on, (s, own, n).
    entries : ndarray of int (own,) or None
        Entries of those parameters in a vector; None where they are all, in order.
    """

    residuals: FloatArray
    derivatives: FloatArray
    entries: NDArray[np.intp] | None


@dataclass(frozen=True)
class Places:
    """Several points of a search, each as `Point` describes one; the first axis counts them.

    Parameters
    ----------
    vector : FloatArray
        Scaled parameters, (s, k).
    square : FloatArray
        Sum of squares r'r of the whitened residuals r, (s,); infinite where there is no law.
    gradient : FloatArray
        J'r, with J the derivatives of the residuals, (s, k).
    normal : FloatArray
        J'J, (s, k, k).
    """

    vector: FloatArray
    square: FloatArray
    gradient: FloatArray
    normal: FloatArray

    def point(self, row: int) -> Point:
        """The point at a row."""
        return Point(self.vector[row], float(self.square[row]), self.gradient[row], self.normal[row])

    def __getitem__(self, rows: NDArray[np.intp] | NDArray[np.bool_]) -> Self:
        """The points at some rows, by indices or a mask (s,)."""
        return type(self)(self.vector[rows], self.square[rows], self.gradient[rows], self.normal[rows])

    def replaced(self, which: NDArray[np.bool_], other: Self) -> Self:
        """These points, with those of `other` at the rows `which` (s,)."""
        if not which.any():
            return self
        if which.all():
            return other
        return type(self)(
            np.where(which[:, None], other.vector, self.vector),
            np.where(which, other.square, self.square),
            np.where(which[:, None], other.gradient, self.gradient),
            np.where(which[:, None, None], other.normal, self.normal),
        )


def projected(
    curves: Sequence[Rows], prior: Places, linear: LinearDirections, low: FloatArray, high: FloatArray
) -> Places:
    """Points with the linear parameters at their least-squares values, where those are within the limits (s, k).

    Parameters
    ----------
    curves : sequence of Rows
        Residuals and derivatives of every curve at the scaled vectors of `prior`.
    prior : Places
        The scaled vectors, and what the priors add to the sums there; squares are infinite where there is no law.
    linear : LinearDirections
        Directions that are solved for.
    low, high : FloatArray
        Limits of the scaled vectors, (s, k).
    """
    normal = prior.normal.copy()
    for curve in curves:
        J = curve.derivatives
        own = J @ J.swapaxes(-1, -2)
        if curve.entries is None:
            normal += own
        else:
            normal[:, curve.entries[:, None], curve.entries] += own
    gradient, square = _against(curves, [curve.residuals for curve in curves], prior)
    step = linear.steps(Places(prior.vector, square, gradient, normal), low, high)
    if step is None:
        return Places(prior.vector, square, gradient, normal)
    change, along, grown = step
    # From the residuals, not from their products: a small sum of squares keeps its digits.
    residuals = []
    for curve in curves:
        own = along if curve.entries is None else along[:, curve.entries]
        residuals.append(curve.residuals + (own[:, None] @ curve.derivatives)[:, 0])
    gradient, square = _against(curves, residuals, prior, grown)
    normal = (normal - prior.normal) * (grown[:, :, None] * grown[:, None, :]) + prior.normal
    return Places(prior.vector + change, square, gradient, normal)


def _against(
    curves: Sequence[Rows], residuals: Sequence[FloatArray], prior: Places, grown: FloatArray | None = None
) -> tuple[FloatArray, FloatArray]:
    """J'r (s, k) and r'r (s,) of all curves and the priors, with residuals r and their derivatives J.

    `residuals` are those of each curve at s points, (s, n); `grown` (s, k) are factors on the derivatives, one by
    default.
    """
    gradient, square = np.zeros(prior.gradient.shape), prior.square.copy()
    for curve, r in zip(curves, residuals, strict=True):
        square += np.einsum("sn,sn->s", r, r)
        own = (curve.derivatives @ r[:, :, None])[:, :, 0]
        if curve.entries is None:
            gradient += own
        else:
            gradient[:, curve.entries] += own
    if grown is not None:
        gradient *= grown
    return gradient + prior.gradient, square


class RelaxingLayer(NamedTuple):
    """Fractions of one relaxing layer: entries of the free ones in a vector, and the sum of the fixed ones."""

    entries: list[int]
    fixed: float


@dataclass(frozen=True)
class Fractions:
    """The relaxing fractions among the free parameters, solved for together with the moduli and never negative.

    The force is nearly linear in them. While the contact grows, P = E_inf A + sum_k E f_k z_k, with P the force,
    E the instantaneous modulus, f_k the relaxing fractions, A the elastic force per modulus and z_k its integrals
    over the record: linear in the moduli E_inf = E (1 - sum f) and E f_k, all of which are positive or zero. During
    unloading the earlier moment of equal contact radius changes with them, so the force at the solution is computed
    again.

    Parameters
    ----------
    problem : Problem
        The problem of which they are parameters.
    layers : list
        The fractions of each relaxing layer.
    directions : LinearDirections
        Directions in which the model is linear: baselines, fractions, and the moduli together where they scale the
        force, in this order.
    """

    problem: Problem
    layers: list[RelaxingLayer]
    directions: LinearDirections

    @classmethod
    def of(cls, problem: Problem, free: set[int], linear: LinearDirections) -> Self | None:
        """Find the relaxing fractions among the entries `free` of a parameter vector; None where there are none.

        `linear` are the other directions in which the model is linear, solved for at the same time.
        """
        layers = [_layer_of(member, free) for member in problem.members]
        entries = sorted({entry for layer in layers for entry in layer.entries})
        if not entries:
            return None
        rows = np.insert(
            linear.rows, len(linear.rows) - linear.scales, np.eye(len(problem.coordinates))[entries], 0
        )
        known = LinearDirections(rows, linear.scales, linear.through_force)
        return cls(problem, [layer for layer in layers if layer.entries], known)

    def feasible(self, vector: FloatArray) -> FloatArray:
        """Return the scaled vector (k,) with relaxing fractions that sum to more than 1 reduced in proportion."""
        for layer in self.layers:
            values = self._values(vector, layer)
            if values.sum() > 1.0 - layer.fixed:
                vector = self._placed(vector, layer, values * ((1.0 - layer.fixed) / values.sum()))
        return vector

    def solved(self, point: Point) -> FloatArray | None:
        """Scaled vector (k,) with the fractions and the other linear parameters at their least-squares values.

        None where that is infeasible or promises too little to be worth another evaluation of the model.
        """
        rows = self.directions.rows
        normal, gradient = rows @ point.normal @ rows.T, rows @ point.gradient
        if not (np.diag(normal) > 0.0).all():
            return None
        slope, offset = self._moduli(point.vector)
        step = _least(normal, gradient, slope @ rows.T, offset)
        if step is None or -(2.0 * gradient + normal @ step) @ step < _WORTH * point.square:
            return None
        factor = 1.0 + float(step[-1]) if self.directions.scales else 1.0
        if factor <= _LEAST_FACTOR:
            return None
        others = len(step) - self.directions.scales
        along = step[:others] @ rows[:others]
        is_fraction = np.zeros(len(along), dtype=bool)
        is_fraction[[entry for layer in self.layers for entry in layer.entries]] = True
        vector = point.vector + np.where(is_fraction, along / factor, along)
        if self.directions.scales:
            vector = vector + np.log(factor) * rows[-1]
        for layer in self.layers:
            # On a bound but for the rounding of the solution.
            values = self._values(vector, layer)
            if (values < -_ROUNDING).any() or values.sum() > 1.0 - layer.fixed + _ROUNDING:
                return None
            vector = self._placed(vector, layer, np.maximum(values, 0.0))
        return self.feasible(vector)

    def _moduli(self, vector: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Relaxed and relaxing moduli of every layer, over its E, as a linear function of a step.

        They are `slope` (m, k) times the step (k,) plus `offset` (m,), and must not be negative. A step is that of
        the linear model: for the moduli the relative change of E, for a fraction F (f' - f), with F the factor on E
        and f, f' the fraction before and after.
        """
        scale = np.array([1.0 if c.scale is None else c.scale for c in self.problem.coordinates])
        grows = self.directions.rows[-1] if self.directions.scales else np.zeros(len(scale))
        # The moduli take the same step, which counts once.
        grows = grows / max(float(grows.sum()), 1.0)
        slopes, offsets = [], []
        for layer in self.layers:
            values = self._values(vector, layer)
            rest = 1.0 - layer.fixed - float(values.sum())
            for entry, value in zip(layer.entries, values.tolist(), strict=True):
                slopes.append(value * grows + scale[entry] * np.eye(len(scale))[entry])
                offsets.append(value)
            shares = np.zeros(len(scale))
            shares[layer.entries] = scale[layer.entries]
            slopes.append(rest * grows - shares)
            offsets.append(rest)
        return np.array(slopes), np.array(offsets)

    def _values(self, vector: FloatArray, layer: RelaxingLayer) -> FloatArray:
        return np.array([float(self.problem.coordinates[i].physical(vector[i])) for i in layer.entries])

    def _placed(self, vector: FloatArray, layer: RelaxingLayer, values: FloatArray) -> FloatArray:
        vector = np.array(vector)
        for entry, value in zip(layer.entries, values.tolist(), strict=True):
            vector[entry] = self.problem.coordinates[entry].scaled(value)
        return vector


def _layer_of(member: Member, free: set[int]) -> RelaxingLayer:
    """Relaxing fractions of a curve's layer; no free ones where some are held fixed by the search.

    `free` are the entries of a parameter vector that may be solved for.
    """
    paths = [path for path in member.base if ".relaxation.fractions[" in path]
    held = [path for path in paths if member.entries.get(path) not in free]
    if any(path in member.entries for path in held):
        # One of them has a measured prior or is held by a search: the force is not linear in the others alone.
        return RelaxingLayer([], 0.0)
    entries = [member.entries[path] for path in paths if path not in held]
    return RelaxingLayer(entries, sum(member.base[path] for path in held))


def _least(
    normal: FloatArray, gradient: FloatArray, slope: FloatArray, offset: FloatArray
) -> FloatArray | None:
    """Minimise s'Ns / 2 + g's over steps s (p,) with slope s + offset >= 0, by an active-set method.

    Parameters
    ----------
    normal, gradient : FloatArray
        N, (p, p), and g, (p,).
    slope, offset : FloatArray
        The m linear constraints, (m, p) and (m,).

    Returns
    -------
    FloatArray or None
        The step s; None where the iteration does not end or the active constraints are not independent.
    """
    active: list[int] = []
    p = len(gradient)
    for _ in range(3 * len(offset) + 1):
        rows, corner = slope[active], np.zeros((len(active), len(active)))
        system = np.block([[normal, -rows.T], [rows, corner]])
        try:
            solution = np.linalg.solve(system, np.concatenate((-gradient, -offset[active])))
        except np.linalg.LinAlgError:
            return None
        step, pressed = solution[:p], solution[p:]
        if active and pressed.min() < 0.0:
            active.pop(int(np.argmin(pressed)))
            continue
        left = slope @ step + offset
        left[active] = 0.0
        if left.min() >= -_ROUNDING:
            return np.asarray(step)
        active.append(int(np.argmin(left)))
    return None
