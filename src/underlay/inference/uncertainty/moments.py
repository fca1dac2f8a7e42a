"""The moments Q'r of the residuals that least squares sets to zero, and their covariance.

Least squares solves J'r = 0, r being the rows less the model and J the model's derivatives. Whatever the
disturbance, the likelihood of these moments t(theta) alone,

    t ~ N(0, V),   V = s^2 Q'(noise + columns of misfit, step, ramp, turn and line) Q,

with s the standard deviation of the white noise, has its maximum where least squares has its optimum: disturbances
widen an interval and never shift its value. Linearised, the covariance of the parameters is the sandwich H^-1 V
H^-1, H = Q'J. Q is J, except where the only disturbance is a step, a ramp or a turn: there Q is J with these
projected out, and they do correct the value.

Far along a ridge the k moments no longer hold what the curve's shape says. Further moments X'r do, X being the
directions in which the force curves along the ridge, orthogonal to J; they do not shift the maximum either.

All moments are linear combinations of the projections of r on one basis for each curve: derivatives, step, ramp,
turn, and X.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from underlay._arrays import FloatArray
from underlay.inference.uncertainty.columns import TURN, Columns
from underlay.inference.uncertainty.hypotheses import Hypotheses, grams
from underlay.inference.uncertainty.noise import NoiseTable, cosines


@dataclass(frozen=True, eq=False)
class CurveMoments:
    """Moments of one curve's residuals under each of its m hypotheses; symbols as in the module.

    Parameters
    ----------
    basis : FloatArray
        Basis of a curve: derivatives (k columns), step, ramp, turn, bends; (n, q).
    residual : FloatArray
        Rows less the model at least squares, (n,).
    coefficients : FloatArray
        Q as combinations of the basis, (m, q, k).
    information, covariance : FloatArray
        H = Q'J and V, (m, k, k).
    offset : FloatArray
        Q'r at least squares where a step, a ramp or a turn corrects it, else zero, (m, k).
    taken : FloatArray
        Matrix T (m, q, t) by which step, ramp and turn lower a sum of squares to r'r - |T' basis' r|^2; zero
        without them.
    is_whole : ndarray of bool
        Whether the hypothesis has white noise, step, ramp and turn only, (m,): then the whole sum of squares can be
        used.
    variance : FloatArray
        Variance of the white noise, (m,).
    bends : int
        Number p of further directions X in which the force curves along the ridge.
    bend_precision : FloatArray
        Inverse covariance of X'r, (m, p, p).
    bend_offset : FloatArray
        X'r at least squares, (p,).
    """

    basis: FloatArray
    residual: FloatArray
    coefficients: FloatArray
    information: FloatArray
    covariance: FloatArray
    offset: FloatArray
    taken: FloatArray
    is_whole: NDArray[np.bool_]
    variance: FloatArray
    bends: int
    bend_precision: FloatArray
    bend_offset: FloatArray

    @classmethod
    def of(
        cls,
        columns: Columns,
        hypotheses: Hypotheses,
        table: NoiseTable,
        growth: FloatArray,
        bends: FloatArray | None = None,
    ) -> CurveMoments:
        """Moments for a linearised curve; `bends` (n, p) are directions orthogonal to its derivatives."""
        n, k, m = len(columns.values), columns.law.stop, len(hypotheses.weight)
        bends = np.zeros((n, 0)) if bends is None else bends
        p, shapes = bends.shape[1], columns.turn.stop
        values = np.hstack((columns.values, bends))
        plain, residual = values.T @ values, values[:, columns.residual.start]
        coefficients = np.zeros((m, values.shape[1], k))
        coefficients[:, :k] = np.eye(k)
        taken = np.zeros((m, values.shape[1], shapes - k))
        sizes = np.array([hypotheses.sizes(columns, one) for one in range(m)])
        for one in np.flatnonzero(hypotheses.can_be_taken):
            taken[one, k:shapes] = _taking(plain[k:shapes, k:shapes], sizes[one, k:shapes])
        corrects = np.flatnonzero(hypotheses.corrects)
        coefficients[corrects] -= taken[corrects] @ (np.swapaxes(taken[corrects], 1, 2) @ plain[:, :k])
        bend = np.eye(values.shape[1])[:, columns.values.shape[1] :]
        # Covariances of all columns' projections of the disturbances.
        used, place = np.unique(hypotheses.noise, return_inverse=True)
        noisy = grams(cosines(values * np.sqrt(growth)[:, None]), table.spectra[used])[place]
        along = plain[None, :, : sizes.shape[1]] * sizes[:, None, :]
        spread = hypotheses.variance[:, None, None] * (noisy + along @ np.swapaxes(along, 1, 2))
        offset = np.zeros((m, k))
        offset[corrects] = np.swapaxes(coefficients[corrects], 1, 2) @ plain[:, columns.residual.start]
        kept = np.r_[:shapes, columns.values.shape[1] : values.shape[1]]
        return cls(
            basis=values[:, kept],
            residual=residual,
            coefficients=coefficients[:, kept],
            information=np.swapaxes(coefficients, 1, 2) @ plain[:, :k],
            covariance=_quadratic(spread, coefficients),
            offset=offset,
            taken=taken[:, kept],
            is_whole=(hypotheses.noise == 0)
            & ((hypotheses.family < 0) | (hypotheses.family >= TURN))
            & (np.ptp(growth) == 0.0),
            variance=hypotheses.variance,
            bends=p,
            bend_precision=np.asarray(
                np.linalg.inv(_quadratic(spread, np.broadcast_to(bend, (m, *bend.shape))))
            ),
            bend_offset=bends.T @ residual,
        )

    def along(self, rows: FloatArray) -> FloatArray:
        """Q' times the given rows (n,), for each hypothesis: (m, k)."""
        return np.asarray((self.basis.T @ rows) @ self.coefficients)


def _taking(gram: FloatArray, sizes: FloatArray) -> FloatArray:
    """T (q, q) with which (I + Z Z')^-1 = I - Z T T' Z'.

    Z are columns with the Gram matrix `gram` (q, q), each multiplied by its entry of `sizes` (q,).
    """
    active = np.flatnonzero(sizes)
    scaled = gram[active[:, None], active] * sizes[active] * sizes[active, None]
    found = np.zeros_like(gram)
    root = np.linalg.inv(np.linalg.cholesky(scaled + np.eye(len(active)))).T
    found[active[:, None], active] = sizes[active, None] * root
    return found


def _quadratic(form: FloatArray, columns: FloatArray) -> FloatArray:
    return np.asarray(np.swapaxes(columns, 1, 2) @ form @ columns)
