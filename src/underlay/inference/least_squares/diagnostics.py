"""Whether the residuals of a fit look like the noise that was assumed.

Whitened residuals of a right model with the right noise are independent. Where they are not, each of the n
readings tells less than it seems, and errors computed as if readings were independent are too small by the square
root of n / n_eff. With autocorrelations rho_k,

    n_eff = n / (1 + 2 sum_k rho_k),

the sum over the initial positive sequence of pairs (Geyer 1992, doi:10.1214/ss/1177011137). The runs test
counts changes of sign (Wald and Wolfowitz 1940, doi:10.1214/aoms/1177731909).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy import fft, special

from underlay._arrays import FloatArray

# Probability of a false alarm: one in a thousand honest curves.
_SIGNIFICANT = 1e-3
# n_eff / n above which errors are too small by a tenth or less, which does not matter.
_HARMLESS = 0.8
# Lag-one correlation of residuals that alternate enough to matter.
_ALTERNATING = -0.2


@dataclass(frozen=True)
class ResidualDiagnostics:
    """Scatter and autocorrelation of the residuals of one curve.

    Parameters
    ----------
    points : int
        Number of residuals n.
    rms : float
        Root mean square of the force residuals (N).
    lag_one : float
        Autocorrelation of neighbouring whitened residuals.
    runs, expected_runs : int, float
        Number of runs of one sign, and the number expected of independent residuals.
    runs_probability : float
        Probability of so few runs or fewer, were the residuals independent.
    effective_points : float
        n_eff, the number of independent points that would carry as much information.
    """

    points: int
    rms: float
    lag_one: float
    runs: int
    expected_runs: float
    runs_probability: float
    effective_points: float

    @property
    def too_narrow_by(self) -> float:
        """Factor by which errors that assume independence are too small; 1 where they are not."""
        return float(np.sqrt(self.points / self.effective_points))

    @property
    def correlated(self) -> bool:
        """Whether the residuals are correlated significantly (p < 0.001) and enough to matter (n_eff < 0.8 n)."""
        return self.runs_probability < _SIGNIFICANT and self.effective_points < _HARMLESS * self.points


def over_whitened(whitened: FloatArray) -> bool:
    """Whether whitened residuals (n,) alternate more than independent ones: the noise is assumed too correlated."""
    return bool(_runs(whitened)[2] > 1.0 - _SIGNIFICANT and _autocorrelation(whitened)[1] < _ALTERNATING)


def diagnose(whitened: FloatArray, force_residuals: FloatArray) -> ResidualDiagnostics:
    """Describe the residuals of one curve, in the order of measurement.

    Parameters
    ----------
    whitened : FloatArray
        Whitened residuals, (n,).
    force_residuals : FloatArray
        Data minus model (N), (n,).
    """
    n = len(whitened)
    rho = _autocorrelation(whitened)
    runs, expected, probability = _runs(whitened)
    # 1 + 2 sum rho_k, up to the first pair rho_2m + rho_2m+1 that is not positive.
    pairs = rho[: 2 * (n // 2)].reshape(-1, 2).sum(axis=1)
    negative = np.flatnonzero(pairs <= 0.0)
    total = 2.0 * float(pairs[: negative[0] if negative.size else None].sum()) - 1.0
    return ResidualDiagnostics(
        points=n,
        rms=float(np.sqrt(np.mean(np.square(force_residuals)))),
        lag_one=float(rho[1]) if n > 1 else 0.0,
        runs=runs,
        expected_runs=expected,
        runs_probability=probability,
        effective_points=n / max(total, 1.0),
    )


def correlated(whitened: FloatArray, force_residuals: FloatArray) -> ResidualDiagnostics | None:
    """`diagnose` a curve if its residuals are correlated enough to matter; None, at a tenth of the cost, otherwise.

    Parameters
    ----------
    whitened : FloatArray
        Whitened residuals in the order of measurement, (n,).
    force_residuals : FloatArray
        Data minus model (N), (n,).
    """
    if _runs(whitened)[2] >= _SIGNIFICANT:
        return None
    entry = diagnose(whitened, force_residuals)
    return entry if entry.correlated else None


def _autocorrelation(values: FloatArray) -> FloatArray:
    centred = values - values.mean()
    size = fft.next_fast_len(2 * len(centred), real=True)
    spectrum = np.abs(fft.rfft(centred, size)) ** 2
    covariance = fft.irfft(spectrum, size)[: len(centred)]
    if not covariance[0] > 0.0:
        return np.concatenate([[1.0], np.zeros(len(values) - 1)])
    return np.asarray(covariance / covariance[0])


def _runs(values: FloatArray) -> tuple[int, float, float]:
    n = np.count_nonzero(values)
    signs = (values if n == values.size else values[values != 0.0]) > 0.0
    above = np.count_nonzero(signs)
    below = n - above
    runs = 1 + int(np.count_nonzero(signs[1:] != signs[:-1])) if signs.size else 0
    if not (above and below) or n < 3:
        return runs, float(runs), 1.0
    expected = 1.0 + 2.0 * above * below / n
    variance = (expected - 1.0) * (expected - 2.0) / (n - 1.0)
    if not variance > 0.0:
        return runs, expected, 1.0
    return runs, expected, float(special.ndtr((runs - expected) / np.sqrt(variance)))
