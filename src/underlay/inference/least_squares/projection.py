"""Variable projection: parameters in which the model is linear are solved for at every point of a search.

A step along the valley of modulus and thickness leaves the modulus behind; solving for what is linear (Golub and
Pereyra 1973, doi:10.1137/0710036) corrects it without another model. Several points are treated at once: the time
of a step goes into calls, not arithmetic, and the same calls serve all of them.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple, Protocol, Self

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


class Sums(Protocol):
    """What `LinearDirections.steps` needs of s points: scaled vectors (s, k), J'r (s, k) and J'J (s, k, k).

    r are the whitened residuals, J their derivatives in the scaled parameters.
    """

    @property
    def vector(self) -> FloatArray:
        """Scaled parameters, (s, k)."""

    @property
    def gradient(self) -> FloatArray:
        """J'r of residuals r and their derivatives J, (s, k)."""

    @property
    def normal(self) -> FloatArray:
        """J'J of the residuals' derivatives J, (s, k, k)."""


@dataclass(frozen=True)
class LinearSteps:
    """Steps in the linear parameters from s points; zero for a point that takes none.

    Parameters
    ----------
    change : FloatArray
        Changes of the scaled vectors, (s, k).
    along : FloatArray
        Step by which the residuals change as J times it, exactly, (s, k); J are their derivatives.
    grown : FloatArray
        Factors (s, k) by which the step multiplies the derivatives.
    """

    change: FloatArray
    along: FloatArray
    grown: FloatArray


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

    def steps(self, places: Sums, low: FloatArray, high: FloatArray) -> LinearSteps | None:
        """Steps that bring the linear parameters to their least-squares values at s points, within limits (s, k).

        A point takes no step where a linear parameter has no effect, the force would vanish, or a limit would be
        passed; None where no point takes one.
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
            return LinearSteps(change, along, grown)
        if not usable.any():
            return None
        kept = usable[:, None]
        return LinearSteps(
            np.where(kept, change, 0.0), np.where(kept, along, 0.0), np.where(kept, grown, 1.0)
        )


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

    @classmethod
    def of(cls, points: Sequence[Point | None], vectors: FloatArray) -> Self:
        """Gather s points; None stands for one without a law, at its row of `vectors` (s, k)."""
        count, k = vectors.shape
        places = cls(np.array(vectors), np.full(count, np.inf), np.zeros((count, k)), np.zeros((count, k, k)))
        for row, point in enumerate(points):
            if point is not None:
                places.vector[row], places.square[row] = point.vector, point.square
                places.gradient[row], places.normal[row] = point.gradient, point.normal
        return places

    def point(self, row: int) -> Point:
        """The point at a row."""
        return Point(self.vector[row], float(self.square[row]), self.gradient[row], self.normal[row])

    def part(self, rows: NDArray[np.intp] | NDArray[np.bool_]) -> Self:
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
    gradient, normal, square = prior.gradient, prior.normal.copy(), prior.square
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
    # From the residuals, not from their products: a small sum of squares keeps its digits.
    residuals = []
    for curve in curves:
        along = step.along if curve.entries is None else step.along[:, curve.entries]
        residuals.append(curve.residuals + (along[:, None] @ curve.derivatives)[:, 0])
    gradient, square = _against(curves, residuals, prior, step.grown)
    grown = step.grown[:, :, None] * step.grown[:, None, :]
    normal = (normal - prior.normal) * grown + prior.normal
    return Places(prior.vector + step.change, square, gradient, normal)


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
