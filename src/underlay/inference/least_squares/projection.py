"""Variable projection: parameters in which the model is linear, solved for at every place of a search.

A step along the valley of modulus and thickness leaves the modulus behind; solving for what is linear (Golub and
Pereyra 1973, doi:10.1137/0710036) puts it right without another model.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Self

import numpy as np
from numpy.typing import NDArray

from underlay._arrays import FloatArray
from underlay.inference.model.members import Member
from underlay.inference.problem import Problem

__all__ = ["LinearDirections", "LinearStep", "Point", "acting"]

_LINEAR = ("instrument.baseline", "instrument.baseline_slope")
# The linear parameters stay where they are rather than make a force that is not there.
_LEAST_FACTOR = 0.1
# An entry whose column is this small beside the largest, or that moves all readings together by less than this
# many standard deviations per unit, does not act any more (a base so stiff that it might be rigid). Levenberg
# and Marquardt measure a step by the columns: that entry's is then without end, the law refuses it, and the
# steps of all entries shrink below the tolerance before that one is short enough.
_IDLE, _FLAT = 1e-10, 1e-4


@dataclass(frozen=True)
class Point:
    """A place of a search; r are the whitened residuals there, J their derivatives.

    Parameters
    ----------
    vector : FloatArray
        Scaled, (k,).
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
class LinearStep:
    """A step in the linear parameters.

    Parameters
    ----------
    change : FloatArray
        Of the scaled vector, (k,).
    along : FloatArray
        The residuals change by J times this, exactly, (k,).
    grown : FloatArray
        Factors (k,) by which the derivatives have grown there.
    """

    change: FloatArray
    along: FloatArray
    grown: FloatArray


@dataclass(frozen=True)
class LinearDirections:
    """Directions in which the model is linear.

    Parameters
    ----------
    rows : FloatArray
        The directions, (p, k): baselines, and the moduli together where one factor on them is a factor on the
        force of every curve.
    scales : bool
        Whether the last is that of the moduli: a step there is the logarithm of the factor.
    through_force : ndarray of bool (k,)
        Entries that act through the contact force.
    """

    rows: FloatArray
    scales: bool
    through_force: NDArray[np.bool_]

    @classmethod
    def of(cls, problem: Problem, free: set[int]) -> Self:
        """Directions among the entries `free` to be solved for: neither held nor measured otherwise."""
        unit = np.eye(len(problem.coordinates))
        baseline = np.array([coordinate.path in _LINEAR for coordinate in problem.coordinates])
        rows = [unit[i] for i in np.flatnonzero(baseline).tolist() if i in free]
        moduli = _common_moduli(problem.members)
        scales = bool(moduli) and moduli <= free
        if scales:
            rows.append(unit[sorted(moduli)].sum(axis=0))
        return cls(np.reshape(rows, (len(rows), len(unit))), scales, ~baseline)

    def step(self, point: Point) -> LinearStep | None:
        """The step to their best; None where there are none, they do not act, or the force would vanish."""
        normal = self.rows @ point.normal @ self.rows.T
        if not len(self.rows) or not (np.diag(normal) > 0.0).all():
            return None
        along = -np.linalg.solve(normal, self.rows @ point.gradient)
        change, grown = along, np.ones(len(point.vector))
        if self.scales:
            factor = 1.0 + float(along[-1])
            if factor <= _LEAST_FACTOR:
                return None
            change = np.append(along[:-1], np.log(factor))
            # All that acts through the contact force grows with it.
            grown[self.through_force] = factor
        return LinearStep(change @ self.rows, along @ self.rows, grown)


def _common_moduli(members: Sequence[Member]) -> set[int]:
    """Entries that carry all moduli (and works of adhesion) of all curves in one factor; or none."""
    found: list[set[int]] = []
    for member in members:
        gives = bool(member.base["instrument.compliance"]) or "instrument.compliance" in member.entries
        moduli = member.forward.similarity.force_scales
        if gives or any(path not in member.entries for path in moduli):
            return set()
        found.append({member.entries[path] for path in moduli})
    return found[0] if all(moduli == found[0] for moduli in found) else set()


def acting(norms: FloatArray) -> NDArray[np.bool_]:
    """Which entries act at all, (k,), by the lengths of their columns of whitened derivatives, (k,)."""
    return np.asarray(norms > max(_IDLE * float(norms.max(initial=0.0)), _FLAT))
