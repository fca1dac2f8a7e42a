"""A walked profile likelihood, and where it crosses the threshold of an interval."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy import interpolate, optimize, stats

from underlay._arrays import FloatArray
from underlay.errors import InputError
from underlay.inference.fitting.fit_result import Fit
from underlay.inference.profiling.interval import Interval

__all__ = ["Profile", "interval_threshold"]


@dataclass(frozen=True, eq=False)
class Profile:
    """Profile likelihood of one parameter.

    Parameters
    ----------
    name : str
        The parameter.
    fit : Fit
        The optimum it starts from; a better one than was handed in, if the walk found one.
    values : FloatArray
        Values of the parameter (SI), (m,), increasing.
    rise : FloatArray
        t at each, (m,): zero at the optimum.
    vectors : FloatArray
        Scaled vectors with the other parameters fitted, (m, k).
    ends : tuple of str
        Why the walk ended below and above: ``"data"``, ``"bound"``, ``"law"`` or ``"none"``.
    branches : tuple of Profile
        The same about every other optimum of the fit, t still measured from the best.
    """

    name: str
    fit: Fit
    values: FloatArray
    rise: FloatArray
    vectors: FloatArray
    ends: tuple[str, str]
    branches: tuple[Profile, ...] = ()

    def threshold(self, level: float) -> float:
        """t that bounds an interval of this confidence.

        Raises
        ------
        InputError
            If the level is not between 0 and 0.999.
        """
        return interval_threshold(self.fit, level)

    def interval(self, level: float = 0.95) -> Interval:
        """Values the data do not reject at this level; see `Interval` for ends that are not there.

        With a second optimum that is not rejected it is the hull of both.
        """
        z = float(np.sqrt(self.threshold(level)))
        parts = [self, *(branch for branch in self.branches if np.sqrt(branch.rise.min()) <= z)]
        low, low_reason = min((part.end(z, upper=False) for part in parts), key=lambda end: end[0])
        high, high_reason = max((part.end(z, upper=True) for part in parts), key=lambda end: end[0])
        return Interval(self.name, level, low, high, low_reason, high_reason)

    def end(self, z: float, *, upper: bool) -> tuple[float, str]:
        """Where the values below `z` end on one side (SI), and why: a reason as in `Interval`."""
        index = self.fit.names.index(self.name)
        coordinate = self.fit.problem.coordinates[index]
        best = int(np.argmin(self.rise))
        outwards = slice(best, None) if upper else slice(best, None, -1)
        q, reason = self.vectors[outwards, index], self.ends[int(upper)]
        crossing = _crossing(q, np.sqrt(self.rise[outwards]), z)
        if crossing is not None:
            return float(coordinate.physical(np.asarray(crossing))), "data"
        if reason == "bound":
            return coordinate.high if upper else coordinate.low, "bound"
        if reason == "law":
            return float(coordinate.physical(q[-1])), "law"
        return (np.inf if upper else -np.inf), "none"


def interval_threshold(fit: Fit, level: float) -> float:
    """Rise t that bounds an interval: chi-square's quantile, F's where the noise was estimated.

    Raises
    ------
    InputError
        If the level is not between 0 and 0.999.
    """
    if not 0.0 < level <= 0.999:
        raise InputError(f"level must be above 0 and at most 0.999; got {level!r}")
    if fit.statistics.noise_estimated or fit.problem.noise_entries:
        return float(stats.f.ppf(level, 1, fit.statistics.points - fit.statistics.parameters))
    return float(stats.chi2.ppf(level, 1))


def _crossing(q: FloatArray, z: FloatArray, level: float) -> float | None:
    """Outermost place where z passes `level`, walking outwards; None if it never does for good."""
    inside = np.flatnonzero(z <= level)
    last = int(inside[-1])
    if last == len(z) - 1:
        return None
    outwards = np.abs(q - q[0])
    z_at = interpolate.PchipInterpolator(outwards, z)
    reached = optimize.brentq(lambda x: float(z_at(x)) - level, outwards[last], outwards[last + 1])
    return float(q[0] + np.sign(q[-1] - q[0]) * reached)
