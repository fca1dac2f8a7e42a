"""The flat punch that sticks, at many contact radii: a small system in the basis of `basis`.

With eps = a/h, rho = eps u and (m11, m12, m22) what the body changes of a half-space's compliance,

    S_mn = (2 eps/pi) int_0^inf [m22 A_m A_n + m11 B_m B_n - m12 (A_m B_n + B_m A_n)] du,
    (1 - S) c = b_0 e_0,    kappa = b_0 c_0,    P = 4 theta a kappa w.

S is symmetric and 1 - S positive definite; kappa is variational: its error is the square of the field's.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Self

import numpy as np

from underlay._arrays import FloatArray
from underlay.mechanics.exact.nodes import Resolution
from underlay.mechanics.kernel import Kernel
from underlay.mechanics.stuck.basis import Basis

__all__ = ["StuckPunch"]


@dataclass(frozen=True)
class StuckPunch:
    """The flat punch at contact radii eps = a/h, on one body.

    Parameters
    ----------
    eps : ndarray (radii,)
        Contact radii over the layer's thickness.
    basis : Basis
        Its functions.
    fields : ndarray (radii, modes)
        c.
    u, weights : ndarray (wavenumbers,)
        Nodes over which the body is integrated, with 2/pi in the weights.
    change : ndarray (radii, wavenumbers)
        m22 f^ - m12 g^ over the radius: what the body adds to the displacement of a half-space.
    """

    eps: FloatArray
    basis: Basis
    fields: FloatArray
    u: FloatArray
    weights: FloatArray
    change: FloatArray

    @classmethod
    def solve(cls, body: Kernel, eps: FloatArray, modes: int, resolution: Resolution) -> Self:
        """Solve for all `eps` in one batch, with `modes` functions."""
        u, weights = resolution.wavenumber_rule()
        weights = (2.0 / np.pi) * weights
        radial, mixed, axial = body.compliance(u)
        rho = np.multiply.outer(eps, u)
        basis = Basis.of(body.coupling, modes, float(rho.max()))
        even, odd = basis.transform(float(rho.max()))(rho)
        strength = (eps[:, None] * weights)[:, :, None]
        # What the body adds, axially and radially, to the displacement under each function.
        down = axial[:, None] * even - mixed[:, None] * odd
        out = radial[:, None] * odd - mixed[:, None] * even
        matrix = -(even.transpose(0, 2, 1) @ (strength * down) + odd.transpose(0, 2, 1) @ (strength * out))
        matrix.reshape(eps.size, modes * modes)[:, :: modes + 1] += 1.0
        side = np.zeros((eps.size, modes, 1))
        side[:, 0, 0] = basis.load
        fields = np.asarray(np.linalg.solve(matrix, side)[:, :, 0], dtype=np.float64)
        return cls(eps, basis, fields, u, weights, (down @ fields[:, :, None])[:, :, 0])

    @property
    def kappa(self) -> FloatArray:
        """kappa (radii,): P/(4 theta a w), and (dP/dw)/(4 theta a) of every indenter that sticks."""
        return self.basis.load * self.fields[:, 0]

    @property
    def edge(self) -> FloatArray:
        """|phi(1)|^2 (radii,), phi the field over Z: d(eps kappa)/d eps = kappa_half (1 - gamma^2) |phi(1)|^2."""
        return np.abs(self.fields @ self.basis.at_edge) ** 2

    def beside(self, eps: FloatArray) -> FloatArray:
        """What the body adds to the punch's displacement at `eps` (n,), after Abel's transform: (radii, n)."""
        return (self.change * self.weights * self.eps[:, None]) @ np.cos(np.multiply.outer(self.u, eps))
