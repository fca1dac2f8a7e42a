"""The relation with the contact radius as the variable, and its inversion into a `MasterCurve`."""

from __future__ import annotations

from dataclasses import dataclass
from math import ceil, log10

import numpy as np

from underlay._arrays import FloatArray
from underlay.mechanics.master_curve import (
    MOST_TERMS,
    MasterCurve,
    Stretch,
    chebyshev_angles,
    chebyshev_coefficients,
)

__all__ = ["RadiusSeries"]

_NEWTON_STEPS = 60
# A piece this narrow in z that still has not converged sits on a kink: there the estimate says so.
_NARROWEST = 2.0**-12


@dataclass(frozen=True)
class RadiusSeries:
    """The relation with the contact radius as the variable: what the solver gives.

    Parameters
    ----------
    stretch : Stretch
        Of eps = a/h.
    coefficients : ndarray (terms, 3)
        Chebyshev coefficients in z(eps) of ln(varpi/eps), ln(P/P_half) and ln(kappa_inf).
    """

    stretch: Stretch
    coefficients: FloatArray

    @property
    def tail(self) -> float:
        """Size of the last coefficients: the truncation error, overestimated."""
        return float(np.abs(self.coefficients[-2:]).sum(axis=0).max())

    def values(self, eps: FloatArray) -> FloatArray:
        """The three logarithms (n, 3) at `eps` (n,)."""
        angle = np.arccos(np.minimum(self.stretch.z(eps), 1.0))
        return np.cos(np.multiply.outer(angle, np.arange(self.coefficients.shape[0]))) @ self.coefficients

    def varpi(self, eps: FloatArray) -> FloatArray:
        """Depth measure varpi at `eps`."""
        return eps * np.exp(self.values(eps)[:, 0])

    def radius(self, varpi: FloatArray) -> FloatArray:
        """Eps at `varpi`: Newton on ln varpi(eps), inside the bracket a table gives."""
        orders = np.arange(self.coefficients.shape[0])
        series = self.coefficients[:, 0]
        grid = np.append(0.0, self.stretch.v(np.linspace(-1.0, 1.0, 4 * orders.size)[1:]))
        table = np.append(0.0, self.varpi(grid[1:]))
        index = np.searchsorted(table, varpi).clip(1, grid.size - 1)
        low, high = grid[index - 1], grid[index]
        eps = np.interp(varpi, table, grid)
        for _ in range(_NEWTON_STEPS):
            angle = np.arccos(np.minimum(self.stretch.z(eps), 1.0))
            phase = np.multiply.outer(angle, orders)
            slope = (np.sin(phase) @ (orders * series)) / np.sin(angle)
            error = np.cos(phase) @ series + np.log(eps / varpi)
            low, high = np.where(error < 0.0, eps, low), np.where(error > 0.0, eps, high)
            proposal = eps - error * eps / (1.0 + eps * slope * self.stretch.dz(eps))
            proposal = np.where((proposal > low) & (proposal < high), proposal, 0.5 * (low + high))
            step = np.abs(proposal - eps)
            eps = proposal
            if (step <= 1e-13 * eps).all():
                break
        return eps

    def inverted(self, top: float, rtol: float) -> MasterCurve:
        """Turn the relation round: the curve for varpi in [0, `top`], in as many pieces as it takes."""
        stretch = Stretch(top, self.stretch.softness)
        terms = 4 * ceil(0.25 * (1.0 - log10(rtol) * (1.2 + 0.75 * stretch.length)))
        count = ceil(terms / MOST_TERMS)
        terms = min(terms, MOST_TERMS)
        angles = chebyshev_angles(terms)
        points = np.cos(angles)
        ends = np.linspace(-1.0, 1.0, count + 1)
        todo = list(zip(ends[:-1], ends[1:], strict=True))
        done: dict[float, FloatArray] = {}
        while todo:
            low, high = todo.pop()
            varpi = stretch.v(0.5 * (low + high) + 0.5 * (high - low) * points)
            eps = self.radius(varpi)
            logarithms = self.values(eps)
            logarithms[:, 0] = np.log(eps / varpi)
            piece = chebyshev_coefficients(logarithms, angles)
            if np.abs(piece[-2:]).sum(axis=0).max() > rtol and high - low > _NARROWEST:
                middle = 0.5 * (low + high)
                todo += [(low, middle), (middle, high)]
            else:
                done[low] = piece
        starts = sorted(done)
        return MasterCurve.of_pieces(stretch, [*starts, 1.0], [done[start] for start in starts])
