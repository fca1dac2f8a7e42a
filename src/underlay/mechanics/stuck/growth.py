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
from underlay.mechanics.stuck.basis import GROWTH_RULES, end_rule
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
        rule, angles = GROWTH_RULES.get(steps) or end_rule(steps), chebyshev_angles(count)
        # T_k at s = x t, (terms, radii x, steps), and interpolation from values at the radii.
        table = _chebyshev(stretch.z(np.multiply.outer(radii, rule.nodes)), count)
        to_terms = chebyshev_coefficients(np.eye(count), angles)
        bonds = (to_terms @ punch.beside(radii))[:, :, None]
        if punch.basis.gamma:
            bonds = bonds - (to_terms @ punch.fields @ punch.basis.outside(rule))[:, None, :]
        bond = 1.0 + (table * bonds).sum(axis=0)
        weights = rule.weights * _share_of_growth(indenter, radii * thickness, rule.nodes)
        matrix = (table * (weights * bond)).sum(axis=2).T
        rate = np.linalg.solve(matrix, np.ones(count))
        kappa = to_terms @ punch.kappa
        flat = table.reshape(count, -1)
        grown = weights * (rate @ flat).reshape(bond.shape)
        carried = grown * rule.nodes * (kappa @ flat).reshape(bond.shape)
        both = to_terms @ np.stack((grown.sum(axis=1), carried.sum(axis=1)), axis=1)
        return cls(stretch, np.column_stack((kappa, both, rate)))

    def values(self, eps: FloatArray) -> FloatArray:
        """The four ratios (n, 4) at `eps` (n,)."""
        angle = np.arccos(np.minimum(self.stretch.z(eps), 1.0))
        return np.cos(np.multiply.outer(angle, np.arange(len(self.coefficients)))) @ self.coefficients


def _chebyshev(z: FloatArray, count: int) -> FloatArray:
    """T_k(z) for k < `count`, (count, *z.shape); at least two, z in [-1, 1] but for rounding."""
    table = np.empty((count, *z.shape))
    table[0], table[1] = 1.0, z
    twice = 2.0 * z
    for k in range(2, count):
        np.multiply(twice, table[k - 1], out=table[k])
        table[k] -= table[k - 2]
    return table


def _share_of_growth(indenter: Indenter, lengths: FloatArray, nodes: FloatArray) -> FloatArray:
    """x H'(x t)/H(x) at contact radii x = `lengths` (m) and t = `nodes`: (radii, nodes) or (1, nodes)."""
    if isinstance(indenter, PowerLawShape):
        return np.asarray(indenter.exponent * nodes ** (indenter.exponent - 1.0))[None, :]
    slope = indenter.abel_slope(np.multiply.outer(lengths, nodes))
    return np.asarray(slope * (lengths / indenter.abel(lengths))[:, None])
