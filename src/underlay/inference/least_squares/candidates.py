"""Search from several starts on block averages of the curves, and keep the minima that may be the optimum."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from underlay._arrays import FloatArray
from underlay.inference.least_squares.engine import Ahead, Minimum, Search, descend
from underlay.inference.least_squares.objective import Objective
from underlay.inference.least_squares.scan_curve import BASE_MODULUS, MODULUS

# The search on blocks. A step that lowers the sum of squares by less than `settled` of it came from within a third
# of a standard error of the blocks; what is left is far less.
_SEARCH = Search(steps=24, settled=3e-3, damping=1e-6)
# Steps after which a search is abandoned that neither is nor promises to be low enough to be the optimum, once
# another one explains the data down to their scatter: no optimum can be much lower.
_PATIENCE = 1
#: Chi-square per block below which a model explains the data.
EXPLAINED = 1.4
# How far a search may go from its start in a scaled coordinate, and in that of a modulus: to the neighbours of its
# grid point, 0.55 apart in ln h and 2.3 in the logarithm of a ratio; the modulus goes with h^3 along the valley of
# a thin layer. What lies beyond is found from another start.
_REACH, _MODULUS_REACH = 0.6, 2.5
#: Minima closer than this in every scaled parameter are one; what is as near to the path of a search lies on it.
ONE_PLACE = 0.05
# A search whose next step leads within `_ON_THE_WAY` standard errors of a minimum that explains the data is taken
# to end there; a minimum whose chi-square on the blocks is higher than the best by `_MAY_BE` is not the best on all
# readings.
_ON_THE_WAY, _MAY_BE = 2.0, 30.0


@dataclass(frozen=True)
class Candidate:
    """A local minimum of the sum of squares over block averages of the curves.

    Parameters
    ----------
    square : float
        Sum of the squared weighted residuals of the blocks.
    vector : FloatArray
        Scaled parameters, (k,).
    normal : FloatArray
        Inverse covariance of the scaled parameters: J'J over the variance of a block's residual, J being the
        derivatives of the residuals, (k, k); None where the minimum does not explain the data.
    at_edge : bool
        Whether the search ended at the largest distance that it may go from its start.
    """

    square: float
    vector: FloatArray
    normal: FloatArray | None
    at_edge: bool

    @cached_property
    def deviation(self) -> FloatArray:
        """Standard errors (k,) of the scaled parameters; zeros where `normal` is None."""
        if self.normal is None:
            return np.zeros(len(self.vector))
        inverse = np.linalg.pinv(self.normal, hermitian=True)
        return np.asarray(np.sqrt(np.maximum(np.diag(inverse), 0.0)))


def candidates(blocked: Objective, starts: Sequence[FloatArray]) -> list[Candidate]:
    """Search from several starts and return the minima that may be the optimum, best first.

    Parameters of the noise keep their starting values.

    Parameters
    ----------
    blocked : Objective
        Residuals over block averages of the curves.
    starts : sequence of FloatArray
        Vectors of scaled parameters, (k,).

    Returns
    -------
    list of Candidate
        Distinct minima; empty if no start has a contact law.
    """
    degrees = max(blocked.points - len(blocked.active), 1)
    vectors, coordinates = np.array(starts), blocked.problem.coordinates
    reach = np.array([_MODULUS_REACH if c.path in (MODULUS, BASE_MODULUS) else _REACH for c in coordinates])
    reach[list(blocked.problem.noise_entries)] = 0.0
    low, high = blocked.problem.bounds.T
    low, high = np.maximum(low, vectors - reach), np.minimum(high, vectors + reach)
    begun = blocked.places(vectors, low, high)
    order = np.argsort(begun.square, kind="stable")[: np.count_nonzero(np.isfinite(begun.square))]
    begun, low, high = begun[order], low[order], high[order]
    enough = np.inf
    found: list[Candidate] = []

    # One after another, so that a search can be abandoned for what an earlier one found; where evaluating several
    # vectors at once is less work, together.
    rows = np.arange(len(order))
    for group in [rows] if blocked.asked.in_batches else rows[:, None]:
        ends = low[group], high[group]

        def give_up(ahead: Ahead, ends: tuple[FloatArray, FloatArray] = ends) -> bool:
            """Whether to abandon a search that leads to a minimum already found, or to none as good."""
            known = [entry for entry in found if entry.square <= ahead.square]
            if not known:
                return False
            if ahead.steps >= _PATIENCE and enough < np.inf:
                if min(ahead.square, ahead.promised) > enough:
                    return True
                # A search that stays at its limit leads to where another start lies.
                if all(
                    _at_edge(blocked, at, *(end[ahead.row] for end in ends))
                    for at in (ahead.here, ahead.there)
                ):
                    return True
            return _near(ahead.there, known)

        def ended(row: int, minimum: Minimum, ends: tuple[FloatArray, FloatArray] = ends) -> None:
            nonlocal enough
            at_edge = _at_edge(blocked, minimum.vector, *(end[row] for end in ends))
            square, normal = minimum.point.square, None
            if square <= EXPLAINED * blocked.points:
                normal = minimum.point.normal * (degrees / square)
                enough = min(enough, square * (1.0 + _MAY_BE / degrees))
            found.append(Candidate(square, minimum.vector, normal, at_edge))

        descend(blocked, begun[group], *ends, _SEARCH, give_up, ended)
    found.sort(key=lambda entry: entry.square)
    return _distinct(found, degrees)


def _at_edge(blocked: Objective, at: FloatArray, low: FloatArray, high: FloatArray) -> bool:
    """Whether the scaled vector `at` (k,) lies on a limit (k,) of its search that is not a bound of the problem."""
    bounds = blocked.problem.bounds.T
    edge = ((at <= low) & (low > bounds[0])) | ((at >= high) & (high < bounds[1]))
    return bool(edge[blocked.active].any())


def _distinct(found: list[Candidate], degrees: int) -> list[Candidate]:
    """Keep each minimum once, and only those that may be the optimum on all readings; best first.

    A minimum is dropped if its sum of squares exceeds the best by more than the blocks may be wrong by, if it lies
    within two standard errors of a better one, or if its search ended at its limit while the best explains the
    data.

    Parameters
    ----------
    found : list of Candidate
        Minima, best first.
    degrees : int
        Degrees of freedom: residuals minus free parameters.
    """
    kept: list[Candidate] = []
    for entry in found:
        best = found[0]
        may_be = entry.square - best.square <= _MAY_BE * best.square / degrees
        # Beyond the limit of a search lies another start; and no minimum is much better than one that explains the
        # data.
        leaves = entry is not best and entry.at_edge and best.normal is not None
        if may_be and not leaves and not _near(entry.vector, kept):
            kept.append(entry)
    return kept


def _near(vector: FloatArray, minima: Sequence[Candidate]) -> bool:
    """Whether a scaled vector (k,) is within 0.05 or two standard errors of a minimum in every parameter."""
    return any(
        bool((np.abs(vector - other.vector) <= np.maximum(ONE_PLACE, _ON_THE_WAY * other.deviation)).all())
        for other in minima
    )
