"""The sum of squares of a problem whose curves are taken in blocks, with its linear parameters solved for.

Parameters in which the model is linear are solved for wherever it is asked: a step along the valley of modulus
and thickness leaves the modulus behind, and variable projection (Golub and Pereyra 1973,
doi:10.1137/0710036) puts it right without another model.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from underlay._arrays import FloatArray
from underlay.errors import InputError
from underlay.inference.fitting.blocks import Blocks
from underlay.inference.fitting.trial import BASE_MODULUS, MODULUS
from underlay.inference.model.forward import Forward
from underlay.inference.model.laws import LawStore
from underlay.inference.model.members import Member
from underlay.inference.problem import Problem

__all__ = ["BlockedSquares", "Point"]

_RTOL = 1e-3
_BLOCKS = 32
# Chi-square per block below which a model explains the data: nothing explains them better than to their scatter.
_EXPLAINED = 1.4
# A fit stays between the neighbours of its grid point: 0.55 apart in ln h, 2.3 in the logarithm of a ratio; the
# modulus goes with h^3 along the valley of a thin layer. Beyond is another start's.
_REACH, _MODULUS_REACH = 0.6, 2.5
_LINEAR = ("instrument.baseline", "instrument.baseline_slope")
# The linear parameters stay where they are rather than make a force that is not there.
_LEAST_FACTOR = 0.1


@dataclass(frozen=True)
class Point:
    """A scaled vector (k,), its residuals (n,), their derivatives (n, k) and their sum of squares."""

    at: FloatArray
    residuals: FloatArray
    jacobian: FloatArray
    square: float


@dataclass(frozen=True)
class _Blocked:
    """One curve in blocks: its model at the depths of the blocks, their forces over `sigma` (N), its entries."""

    member: Member
    forward: Forward
    force: FloatArray
    sigma: float
    entries: list[int]

    @classmethod
    def of(cls, member: Member, *, robust: bool) -> _Blocked:
        blocks = Blocks.of(member.curve, _BLOCKS, averages=not robust)
        laws = member.forward.laws
        laws = replace(laws, solver=laws.solver.with_tolerance(_RTOL), store=LawStore())
        forward = replace(member.forward, depth=blocks.depth, laws=laws)
        sigma = member.scatter * (len(blocks.force) / len(member.force)) ** 0.5
        return cls(member, forward, blocks.force / sigma, sigma, list(member.entries.values()))


@dataclass(frozen=True)
class BlockedSquares:
    """Sum of squares of a problem in blocks.

    Parameters
    ----------
    problem : Problem
        What is fitted.
    curves : list of _Blocked
        Its curves.
    reach : FloatArray
        How far each entry may go, (k,); the noise's rest.
    bounds : FloatArray
        Of the scaled coordinates, (k, 2).
    informative : list of int
        Entries whose prior is a measurement.
    linear : FloatArray
        Directions (p, k) in which the model is linear; the last may multiply the contact force.
    scales : bool
        Whether it does: a step there is the logarithm of a factor.
    """

    problem: Problem
    curves: list[_Blocked]
    reach: FloatArray
    bounds: FloatArray
    informative: list[int]
    linear: FloatArray
    scales: bool

    @classmethod
    def of(cls, problem: Problem, *, robust: bool) -> BlockedSquares:
        """Take the curves in blocks: averages, whose optimum is nearly that of all points, or robust medians."""
        reach = np.full(len(problem.coordinates), _REACH)
        informative = []
        for i, coordinate in enumerate(problem.coordinates):
            if i in problem.noise_entries:
                reach[i] = 0.0
            elif coordinate.prior.informative:
                informative.append(i)
            if coordinate.path in (MODULUS, BASE_MODULUS):
                reach[i] = _MODULUS_REACH
        curves = [_Blocked.of(member, robust=robust) for member in problem.members]
        linear, scales = _linear_directions(problem, informative)
        return cls(problem, curves, reach, problem.bounds, informative, linear, scales)

    @property
    def points(self) -> int:
        """Number of blocks of all curves."""
        return sum(len(curve.force) for curve in self.curves)

    @property
    def explained(self) -> float:
        """Sum of squares below which a minimum explains the data."""
        return _EXPLAINED * self.points

    @property
    def degrees(self) -> int:
        """Blocks more than there are parameters."""
        return max(self.points - int(np.count_nonzero(self.reach)), 1)

    def box(self, start: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Lowest and highest entries (k,): the bounds and the reach about a start."""
        low, high = self.bounds.T
        return np.maximum(low, start - self.reach), np.minimum(high, start + self.reach)

    def point(self, vector: FloatArray, low: FloatArray, high: FloatArray) -> Point | None:
        """Residuals where the linear parameters are solved for at `vector` (k,); None where there is no law."""
        try:
            residuals, jacobian = self._evaluate(vector)
        except InputError:
            return None
        if len(self.linear):
            vector, residuals, jacobian = self._solved(vector, residuals, jacobian, low, high)
        square = float(residuals @ residuals)
        return Point(vector, residuals, jacobian, square) if np.isfinite(square) else None

    def _solved(
        self,
        vector: FloatArray,
        residuals: FloatArray,
        jacobian: FloatArray,
        low: FloatArray,
        high: FloatArray,
    ) -> tuple[FloatArray, FloatArray, FloatArray]:
        """The same with the linear parameters at their best, if that is allowed and they act."""
        columns = jacobian @ self.linear.T
        normal = columns.T @ columns
        if not (np.diag(normal) > 0.0).all():
            return vector, residuals, jacobian
        change = -np.linalg.solve(normal, columns.T @ residuals)
        moves, factor = change, 1.0
        if self.scales:
            factor = 1.0 + float(change[-1])
            if factor <= _LEAST_FACTOR:
                return vector, residuals, jacobian
            moves = np.append(change[:-1], np.log(factor))
        settled = vector + moves @ self.linear
        if (settled < low).any() or (settled > high).any():
            return vector, residuals, jacobian
        if self.scales:
            # All that acts through the contact force grows with it.
            baseline = [c.path in _LINEAR for c in self.problem.coordinates]
            jacobian[: self.points] *= np.where(baseline, 1.0, factor)
        return settled, residuals + columns @ change, jacobian

    def _evaluate(self, vector: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Residuals (n,) and their derivatives (n, k); raises InputError where there is no law."""
        physical = self.problem.physical(vector)
        slopes = self.problem.space.slopes(physical)
        residuals = np.empty(self.points + len(self.informative))
        jacobian = np.zeros((len(residuals), len(vector)))
        end = 0
        for curve in self.curves:
            rows = slice(end, end := end + len(curve.force))
            values = curve.member.values_at(physical)
            reading, own = curve.forward.jacobian(values, tuple(curve.member.entries), rough=True)
            residuals[rows] = reading.force / curve.sigma - curve.force
            jacobian[rows, curve.entries] = own * (slopes[curve.entries] / curve.sigma)
        for row, entry in enumerate(self.informative, start=end):
            residuals[row], slope = self.problem.coordinates[entry].prior.penalty(float(physical[entry]))
            jacobian[row, entry] = slope * slopes[entry]
        return residuals, jacobian


def _linear_directions(problem: Problem, informative: list[int]) -> tuple[FloatArray, bool]:
    """Directions (p, k) in which the model is linear, and whether the last multiplies the contact force.

    Baselines, and the moduli together where one factor on them is a factor on the force of every curve.
    """
    unit = np.eye(len(problem.coordinates))
    directions = [
        unit[i] for i, c in enumerate(problem.coordinates) if c.path in _LINEAR and i not in informative
    ]
    moduli = _common_moduli(problem)
    scales = bool(moduli) and not moduli & set(informative)
    if scales:
        directions.append(unit[sorted(moduli)].sum(axis=0))
    return np.reshape(directions, (len(directions), len(unit))), scales


def _common_moduli(problem: Problem) -> set[int]:
    """Entries that carry all moduli of all curves, in one factor; empty where there are none."""
    found: list[set[int]] = []
    for member in problem.members:
        gives = bool(member.base["instrument.compliance"]) or "instrument.compliance" in member.entries
        moduli = member.forward.similarity.moduli
        if gives or any(path not in member.entries for path in moduli):
            return set()
        found.append({member.entries[path] for path in moduli})
    return found[0] if all(moduli == found[0] for moduli in found) else set()
