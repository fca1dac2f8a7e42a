"""The contact relation as a series in the contact radius, and its inversion into a `MasterCurve` of the depth."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise
from math import ceil, log10
from typing import NamedTuple

import numpy as np

from underlay._arrays import FloatArray
from underlay.mechanics.exact.master_curve import (
    MOST_TERMS,
    Factor,
    MasterCurve,
    Stretch,
    chebyshev_angles,
    chebyshev_coefficients,
    truncation_error,
)

_NEWTON_STEPS = 60
_BISECTIONS = 50
# Points of the table per term of the series.
_TABLE_POINTS = 6
# A piece this narrow in z that still has not converged sits on a kink: there the estimate says so.
_NARROWEST = 2.0**-12


class Branch(NamedTuple):
    """Points of the table of varpi(chi) on an interval where both increase; varpi and chi as in `RadiusSeries`.

    varpi is the half-space contact radius at the depth over the thickness. chi is the radius variable
    of `ContactProblem.chi`, a/h for a power law.
    """

    chi: FloatArray
    varpi: FloatArray


@dataclass(frozen=True)
class RadiusSeries:
    """Depth, force and stiffness as Chebyshev series in the contact radius, the solver's own variable.

    varpi, the measure of depth, is the half-space contact radius at that depth over the thickness h.

    H(r) is the depth at which the contact radius on a half-space is r.

    Parameters
    ----------
    stretch : Stretch
        Of chi: a/h, or for a shape that is not a power law the radius over h at which the shape that measures
        depth has the same H(a).
    coefficients : ndarray (terms, 4 + slopes)
        Chebyshev coefficients in z(chi) of ln(eps/chi) with eps = a/h, ln(P/P_half), ln(kappa_inf), of d ln P/ds at
        fixed depth for each parameter s of `ContactProblem.variants`, and last of ln(varpi/chi).
    """

    stretch: Stretch
    coefficients: FloatArray

    @property
    def error_estimate(self) -> float:
        """Estimated truncation error of the four logarithms (the derivatives are left out)."""
        slopes = slice(len(Factor), -1)
        return float(truncation_error(np.delete(self.coefficients, slopes, axis=1)))

    def values(self, chi: FloatArray) -> FloatArray:
        """Columns of `coefficients` evaluated at `chi` (n,): shape (n, 4 + slopes).

        chi is the radius variable of `ContactProblem.chi`, a/h for a power law.
        """
        angle = np.arccos(np.minimum(self.stretch.z(chi), 1.0))
        return np.cos(np.multiply.outer(angle, np.arange(self.coefficients.shape[0]))) @ self.coefficients

    def varpi(self, chi: FloatArray) -> FloatArray:
        """Dimensionless depth varpi (n,) at `chi` (n,).

        varpi is the half-space contact radius at the depth over the thickness. chi is the radius variable
        of `ContactProblem.chi`, a/h for a power law.
        """
        return chi * np.exp(self.values(chi)[:, -1])

    def radius(self, varpi: FloatArray, branch: Branch) -> FloatArray:
        """chi (n,) at `varpi` (n,) on one branch, by Newton's method within the brackets of its table.

        chi is the radius variable of `ContactProblem.chi`, a/h for a power law.
        """
        orders = np.arange(self.coefficients.shape[0])
        series = self.coefficients[:, -1]
        derivative = np.polynomial.chebyshev.chebder(series)
        index = np.searchsorted(branch.varpi, varpi).clip(1, branch.chi.size - 1)
        low, high = branch.chi[index - 1], branch.chi[index]
        chi = np.interp(varpi, branch.varpi, branch.chi)
        for _ in range(_NEWTON_STEPS):
            angle = np.arccos(np.minimum(self.stretch.z(chi), 1.0))
            waves = np.cos(np.multiply.outer(angle, orders))
            slope = waves[:, :-1] @ derivative
            error = waves @ series + np.log(chi / varpi)
            low, high = np.where(error < 0.0, chi, low), np.where(error > 0.0, chi, high)
            proposal = chi - error * chi / (1.0 + chi * slope * self.stretch.dz(chi))
            # An end of the bracket is as good as what is inside: a step to rounding ends there, and halving the
            # bracket would send it back out (31 steps in place of 5).
            proposal = np.where((proposal >= low) & (proposal <= high), proposal, 0.5 * (low + high))
            step = np.abs(proposal - chi)
            chi = proposal
            if (step <= 1e-13 * chi).all():
                break
        return chi

    def branches(self) -> list[Branch]:
        """Intervals on which varpi(chi) increases: one, unless the relation folds.

        varpi is the half-space contact radius at the depth over the thickness. chi is the radius variable
        of `ContactProblem.chi`, a/h for a power law.
        """
        count = _TABLE_POINTS * self.coefficients.shape[0]
        chi = np.append(0.0, self.stretch.v(np.linspace(-1.0, 1.0, count)[1:]))
        varpi = np.append(0.0, self.varpi(chi[1:]))
        rising = np.diff(varpi) > 0.0
        turns = np.flatnonzero(np.diff(rising.astype(np.int8)))
        bounds = [0, *(int(turn) + 1 for turn in turns), chi.size - 1]
        return [
            Branch(chi[start : stop + 1], varpi[start : stop + 1])
            for start, stop in pairwise(bounds)
            if rising[start]
        ]

    def inverted(self, top: float, rtol: float) -> MasterCurve:
        """Invert the relation: the master curve for varpi in [0, `top`], at truncation error `rtol`.

        It has as many pieces as that takes. A cone on a stiff film over a soft base folds: over some depths three
        contact radii satisfy the equations. The contact then jumps from disc to disc where both carry the same
        force, since of all contact areas the true one carries the largest load (Barber 1974,
        doi:10.1243/03093247V094230).

        varpi is the half-space contact radius at the depth over the thickness.
        """
        stretch = self.stretch.over(top)
        ends, branches = [0.0], self.branches()
        for lower, upper in pairwise(branches):
            ends.append(self._crossing(lower, upper))
        jumps = [end for end in ends[1:] if end < top]
        spans = zip([*ends[: len(jumps) + 1]], [*jumps, top], branches, strict=False)
        pieces: list[tuple[float, FloatArray]] = []
        for start, stop, branch in spans:
            low, high = stretch.z(np.array([start, stop]))
            pieces += self._pieces(stretch, float(low), float(high), branch, rtol)
        edges = [*(low for low, _ in pieces), 1.0]
        return MasterCurve.of_pieces(stretch, edges, [piece for _, piece in pieces], rtol, tuple(jumps))

    def _crossing(self, lower: Branch, upper: Branch) -> float:
        """varpi at which two overlapping branches carry the same force, by bisection: there the radius jumps.

        varpi is the half-space contact radius at the depth over the thickness.
        """
        low, high = float(upper.varpi[0]), float(lower.varpi[-1])
        for _ in range(_BISECTIONS):
            middle = 0.5 * (low + high)
            at = np.array([middle])
            forces = [self.values(self.radius(at, branch))[0, Factor.FORCE] for branch in (lower, upper)]
            low, high = (low, middle) if forces[1] > forces[0] else (middle, high)
        return 0.5 * (low + high)

    def _pieces(
        self, stretch: Stretch, start: float, stop: float, branch: Branch, rtol: float
    ) -> list[tuple[float, FloatArray]]:
        """Start in z and Chebyshev coefficients of each piece of one branch, halved until `rtol` is met.

        `start` and `stop` are the ends of the branch in z, the variable of `stretch` on [-1, 1].
        """
        length = 0.5 * (stop - start) * stretch.length
        count = ceil((1.0 - log10(rtol) * (1.2 + 0.75 * length)) / MOST_TERMS)
        angles = chebyshev_angles(MOST_TERMS)
        points = np.cos(angles)
        ends = np.linspace(start, stop, count + 1)
        low, high = ends[:-1], ends[1:]
        done: dict[float, FloatArray] = {}
        while low.size:
            # All at once: calls, not their arithmetic, are what a piece costs.
            varpi = stretch.v((0.5 * (low + high)[:, None] + 0.5 * (high - low)[:, None] * points).ravel())
            chi = self.radius(varpi, branch)
            logarithms = self.values(chi)[:, :-1]
            logarithms[:, Factor.RADIUS] += np.log(chi / varpi)
            pieces = chebyshev_coefficients(logarithms.reshape(low.size, MOST_TERMS, -1), angles)
            coarse = (truncation_error(pieces[..., : len(Factor)]) > rtol) & (high - low > _NARROWEST)
            done |= {float(low[i]): pieces[i] for i in np.flatnonzero(~coarse)}
            low, high = low[coarse], high[coarse]
            middle = 0.5 * (low + high)
            low, high = np.concatenate((low, middle)), np.concatenate((middle, high))
        return sorted(done.items())
