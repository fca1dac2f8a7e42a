"""A contact that grows and sticks: every increment is a stuck punch of the radius it has by then.

After Abel's transform, with H(x) the half-space depth function of the shape and lengths in thicknesses,

    int_0^x D(s, x) w'(s) ds = H(x),    P = 4 theta int_0^a s kappa(s) w'(s) ds,
    D(s, x) = 1 - sum_n c_n(s) V_n(x/s) + (2/pi) int_0^inf [m22 f^_s - m12 g^_s] cos(u x) du.

D is bounded; on a half-space it is cos(eta ln((x+s)/(x-s))). By collocation at Chebyshev radii, with
w'(s) = H'(s) b(s), b a polynomial in the variable of `Stretch`; c(s) is interpolated in it too. dP/dw is
4 theta a kappa(a) for every shape, and also the first slope of unloading.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Self

import numpy as np

from underlay._arrays import FloatArray
from underlay.mechanics.exact.master_curve import Stretch, chebyshev_angles, chebyshev_coefficients
from underlay.mechanics.indenters import Indenter, PowerLawShape
from underlay.mechanics.stuck.basis import end_rule
from underlay.mechanics.stuck.stuck_punch import StuckPunch

__all__ = ["Growth", "chebyshev_radii"]


def chebyshev_radii(stretch: Stretch, count: int) -> FloatArray:
    """Radii over the thickness at the Chebyshev points of a stretch, increasing."""
    return stretch.v(np.cos(chebyshev_angles(count)))


@dataclass(frozen=True)
class Growth:
    """How a contact grows, in ratios that are smooth down to a = 0.

    Parameters
    ----------
    stretch : Stretch
        Of a/h.
    coefficients : ndarray (terms, 4)
        Chebyshev coefficients in its variable of kappa, w/H(a), P/(4 theta a H(a)) and b = w'/H'.
    """

    stretch: Stretch
    coefficients: FloatArray

    @classmethod
    def solve(
        cls, punch: StuckPunch, stretch: Stretch, indenter: Indenter, thickness: float, steps: int
    ) -> Self:
        """Grow by the punches of the Chebyshev radii of `stretch`, integrating over `steps` nodes."""
        radii, count = punch.eps, punch.eps.size
        rule, angles = end_rule(steps), chebyshev_angles(count)
        orders = np.arange(count)
        # T_k at s = x t, (radii x, steps, terms), and interpolation from values at the radii.
        within = np.arccos(np.minimum(stretch.z(np.multiply.outer(radii, rule.nodes)), 1.0))
        table = np.cos(np.multiply.outer(within, orders))
        to_terms = chebyshev_coefficients(np.eye(count), angles)
        beside = to_terms @ punch.beside(radii)
        bond = 1.0 + (table @ beside.T[:, :, None])[:, :, 0]
        if punch.basis.gamma:
            outside = to_terms @ punch.fields @ punch.basis.outside(rule)
            bond -= np.einsum("iqk,kq->iq", table, outside)
        weights = rule.weights * _share_of_growth(indenter, radii * thickness, rule.nodes)
        matrix = ((weights * bond)[:, None, :] @ table)[:, 0, :]
        rate = np.linalg.solve(matrix, np.ones(count))
        kappa = to_terms @ punch.kappa
        grown = weights * (table @ rate)
        depth = grown.sum(axis=1)
        force = (grown * rule.nodes * (table @ kappa)).sum(axis=1)
        found = (kappa, to_terms @ depth, to_terms @ force, rate)
        return cls(stretch, np.column_stack(found))

    def values(self, eps: FloatArray) -> FloatArray:
        """The four ratios (n, 4) at `eps` (n,)."""
        angle = np.arccos(np.minimum(self.stretch.z(eps), 1.0))
        return np.cos(np.multiply.outer(angle, np.arange(len(self.coefficients)))) @ self.coefficients


def _share_of_growth(indenter: Indenter, lengths: FloatArray, nodes: FloatArray) -> FloatArray:
    """x H'(x t)/H(x) at contact radii x = `lengths` (m) and t = `nodes`: (radii, nodes) or (1, nodes)."""
    if isinstance(indenter, PowerLawShape):
        return np.asarray(indenter.exponent * nodes ** (indenter.exponent - 1.0))[None, :]
    slope = indenter.abel_slope(np.multiply.outer(lengths, nodes))
    return np.asarray(slope * (lengths / indenter.abel(lengths))[:, None])
