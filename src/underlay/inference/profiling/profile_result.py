"""The profile likelihood of a parameter, its thresholds, and the confidence interval where it crosses them.

An interval may have no end on one side, and its text then says so. Thresholds from simulated curves (`Draws`,
`Calibration`) are made by `profile.py`.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import TypeAlias

import numpy as np
from scipy import interpolate, optimize, special

from underlay._arrays import FloatArray
from underlay.errors import InputError
from underlay.inference.least_squares.fit_result import Fit
from underlay.quantities import kind_of
from underlay.units import format_ends

#: Largest z inside an interval, by scaled value of the parameter, any shape.
Limit: TypeAlias = Callable[[FloatArray], FloatArray]
#: Largest z to which a profile is computed: that of a 99.9 % interval, and a little more.
HIGHEST = 3.4
# Fall of t between two steps of a walk that is a second basin: rounding of two refits is a thousand times less.
_FALL = 1e-3


@dataclass(frozen=True)
class Interval:
    """Confidence interval of one parameter (SI); infinite where the data set no end.

    Parameters
    ----------
    name : str
        The parameter.
    level : float
        Confidence, e.g. 0.95.
    low, high : float
        Ends (SI): -inf or inf where the data set none. Where a bound given by the caller or the reach of the law
        ends it, that value.
    low_reason, high_reason : str
        ``"data"``, ``"bound"`` (the caller's), ``"law"`` (no contact law beyond), or ``"none"``.
    calibrated : bool
        Whether its thresholds come from curves simulated at its ends.
    """

    name: str
    level: float
    low: float
    high: float
    low_reason: str
    high_reason: str
    calibrated: bool = False

    def __str__(self) -> str:
        kind = kind_of(self.name)
        low, high = format_ends(self.low, self.high, kind)
        at = f"({100.0 * self.level:g} %{', calibrated' if self.calibrated else ''})"
        has_low, has_high = self.low_reason == "data", self.high_reason == "data"
        if has_low and has_high:
            return f"{self.name} between {low} and {high} {at}"
        if has_low:
            limit = self._limit(self.high_reason, high)
            return f"{self.name} > {low} {at}; no upper bound from these data{limit}"
        if has_high:
            limit = self._limit(self.low_reason, low)
            return f"{self.name} < {high} {at}; no lower bound from these data{limit}"
        return f"{self.name} is not bounded by these data {at}"

    @staticmethod
    def _limit(reason: str, value: str) -> str:
        words = {"bound": f", only its own limit {value}", "law": f", as far as the law reaches ({value})"}
        return words.get(reason, "")


@dataclass(frozen=True, eq=False)
class Draws:
    """Rises t of chi-square at one value of a parameter, in curves simulated with that value.

    Parameters
    ----------
    value : float
        The value (SI).
    delta_chi_squares : FloatArray
        t in every curve, (N,), increasing: the sum of squares with the parameter held at the value, less its
        minimum.
    failures : int
        Curves that could not be fitted.
    """

    value: float
    delta_chi_squares: FloatArray
    failures: int = 0

    def threshold(self, level: float) -> float:
        """Rise t of chi-square up to which a value lies inside an interval of this confidence.

        Raises
        ------
        InputError
            If there are too few curves for the level.
        """
        return float(self.delta_chi_squares[_rank(len(self.delta_chi_squares), level) - 1])


@dataclass(frozen=True, eq=False)
class Calibration:
    """Thresholds of a profile from simulated curves, separately for the two ends of the interval.

    Parameters
    ----------
    level : float
        Confidence of the interval at whose ends the curves were simulated.
    draws, seed : int
        Curves per simulated value, and the seed of their random numbers.
    below, above : tuple of Draws
        Simulations at the lower and at the upper end; none where the data set no end.
    """

    level: float
    draws: int
    seed: int
    below: tuple[Draws, ...] = ()
    above: tuple[Draws, ...] = ()

    def side(self, *, upper: bool) -> tuple[Draws, ...]:
        """Simulated curves at the upper or at the lower end of the interval."""
        return self.above if upper else self.below

    def with_side(self, centres: tuple[Draws, ...], *, upper: bool) -> Calibration:
        """Return the calibration with the simulations of one end replaced."""
        return replace(self, above=centres) if upper else replace(self, below=centres)


def _rank(curves: int, level: float) -> int:
    """Rank of the threshold among the rises of so many curves, counted from the smallest.

    Raises as `Draws.threshold`.
    """
    if not 0.0 < level < 1.0:
        raise InputError(f"level must be between 0 and 1; got {level!r}")
    # Rounded first: 20 times 0.95 is 19, not a rounding error above it.
    rank = math.ceil(round((curves + 1) * level, 9))
    if rank > curves:
        needed = math.ceil(round(level / (1.0 - level), 9))
        raise InputError(
            f"a level of {level:g} needs at least {needed} curves; there are {curves}: "
            f"calibrate with {needed} or more"
        )
    return rank


def require_draws(draws: int, level: float, seed: int) -> None:
    """Refuse a number of simulated curves too small for the confidence level.

    Raises
    ------
    InputError
        If the number is too small, or the seed is negative.
    """
    require_chance(draws, seed)
    _rank(draws, level)


def require_chance(draws: int, seed: int) -> None:
    """Refuse, by InputError, a number of curves below 1, a negative seed, or either if not whole."""
    for name, value, least in (("the number of curves to draw", draws, 1), ("the seed", seed, 0)):
        if value != int(value) or value < least:
            raise InputError(f"{name} must be a whole number, {least} or more; got {value!r}")


@dataclass(frozen=True, eq=False)
class LikelihoodProfile:
    """Profile likelihood of one parameter.

    Parameters
    ----------
    name : str
        The parameter.
    fit : Fit
        The optimum it starts from; a better one than the caller's, if one was found along the profile.
    values : FloatArray
        Values of the parameter (SI), (m,), increasing.
    delta_chi_square : FloatArray
        t at each, (m,): the rise of chi-square, minimised over the other parameters; zero at the optimum.
    vectors : FloatArray
        Scaled vectors with the other parameters fitted, (m, k).
    ends : tuple of str
        Why the profile ends below and above: ``"data"``, ``"bound"``, ``"law"`` or ``"none"``.
    branches : tuple of LikelihoodProfile
        Profiles about every other optimum of the fit, t still measured from the best.
    calibration : Calibration, optional
        Curves simulated at the ends, where the thresholds come from them.
    averaged : bool
        Whether `delta_chi_square` is the squared normal deviate of the level at which a value becomes an end of the
        interval that averages over what the residuals may be, as in `Fit.interval`.
    """

    name: str
    fit: Fit
    values: FloatArray
    delta_chi_square: FloatArray
    vectors: FloatArray
    ends: tuple[str, str]
    branches: tuple[LikelihoodProfile, ...] = ()
    calibration: Calibration | None = None
    averaged: bool = False

    @property
    def index(self) -> int:
        """Entry of the parameter in a scaled vector."""
        return self.fit.names.index(self.name)

    @property
    def has_two_basins(self) -> bool:
        """Whether the profile may have two minima, so that thresholds of chi-square are too small.

        So it is if the fit has another optimum, or the profile falls again away from its minimum.
        """
        outwards = (self.delta_chi_square[self.best :], self.delta_chi_square[self.best :: -1])
        falls = any((np.diff(side) < -_FALL).any() for side in outwards)
        return falls or bool(self.fit.alternatives)

    @property
    def best(self) -> int:
        """Index into `values` at which the profile is lowest."""
        return int(np.argmin(self.delta_chi_square))

    def threshold(self, level: float, *, upper: bool | None = None) -> float:
        """Rise t of chi-square up to which a value lies inside an interval of this confidence.

        Parameters
        ----------
        level : float
            The confidence.
        upper : bool, optional
            Which end of a calibrated profile; by default the larger threshold of both.

        Raises
        ------
        InputError
            If the level is not between 0 and 0.999, or higher than the number of simulated curves allows.
        """
        plain = self._plain(level)
        if upper is None:
            return max(self.threshold(level, upper=False), self.threshold(level, upper=True))
        centres = () if self.calibration is None else self.calibration.side(upper=upper)
        return centres[-1].threshold(level) if centres else plain

    @property
    def _is_of_one_noise(self) -> bool:
        return not self.averaged and not self.name.startswith("noise.")

    def _plain(self, level: float) -> float:
        """Threshold of chi-square's rise t without calibration, by F or chi-square as the noise requires.

        Chi-square's where the profile is averaged over noise models or of a noise parameter.
        """
        plain = interval_threshold(self.fit, level)
        return plain if self._is_of_one_noise else float(special.chdtri(1, 1.0 - level))

    def basis(self, level: float = 0.95) -> str:
        """One sentence with the threshold and the distribution that it comes from."""
        plain = self._plain(level)
        if self.averaged:
            return (
                f"threshold {plain:.3g}, the squared normal deviate of {100.0 * level:g} %: the ends are those "
                "of intervals averaged over correlated noise, a drifting law, a jump at contact and a creeping "
                "baseline"
            )
        if self._is_of_one_noise and _estimates_noise(self.fit):
            law = f"F(1, {self.fit.statistics.points - self.fit.statistics.parameters}), the noise estimated"
        else:
            law = "chi-square with one degree of freedom"
        at = f"{100.0 * level:g} %"
        if self.calibration is None:
            doubt = (
                "; there are two basins, where it is too small: calibrate it with drawn curves (99 are usual)"
                if self.has_two_basins
                else ""
            )
            return f"threshold {plain:.3g}, the {at} quantile of {law}{doubt}"
        ends = [
            f"{self.threshold(level, upper=upper):.3g} {where}"
            for upper, where in ((False, "below"), (True, "above"))
            if self.calibration.side(upper=upper)
        ]
        if not ends:
            return f"threshold {plain:.3g}, the {at} quantile of {law}: the data set no end to calibrate"
        return (
            f"threshold {' and '.join(ends)}, the {at} quantile of t in {self.calibration.draws} curves drawn "
            f"at each end (seed {self.calibration.seed}); that of {law} would be {plain:.3g}"
        )

    def interval(self, level: float = 0.95) -> Interval:
        """Confidence interval: the values that the data do not reject at this level.

        With a second optimum that is not rejected it is the hull of both. See `Interval` for sides without an end.
        """
        low, low_reason = self.end_of_hull(level, upper=False)
        high, high_reason = self.end_of_hull(level, upper=True)
        known = self.calibration is not None and any(self.calibration.side(upper=u) for u in (False, True))
        return Interval(self.name, level, low, high, low_reason, high_reason, known)

    def parts(self, level: float = 0.95) -> list[tuple[float, float]]:
        """Connected parts of the interval (SI), lowest first: one per optimum, joined where they overlap.

        Where the data set no end a part goes as far as the profile was computed.
        """
        limits = [self.limit(level, upper=upper) for upper in (False, True)]
        stretches = []
        for part in (self, *self.branches):
            if not self._keeps(part, limits[0]) and not self._keeps(part, limits[1]):
                continue
            (low, below), (high, above) = (
                part.end(limit, upper=upper) for limit, upper in zip(limits, (False, True), strict=True)
            )
            stretches.append(
                (low if below == "data" else part.values[0], high if above == "data" else part.values[-1])
            )
        joined: list[tuple[float, float]] = []
        for low, high in sorted(stretches):
            if joined and low <= joined[-1][1]:
                joined[-1] = (joined[-1][0], max(high, joined[-1][1]))
            else:
                joined.append((low, high))
        return joined

    def _keeps(self, part: LikelihoodProfile, limit: Limit) -> bool:
        return bool((np.sqrt(part.delta_chi_square) <= limit(part.vectors[:, self.index])).any())

    def end_of_hull(self, level: float, *, upper: bool) -> tuple[float, str]:
        """One end of the interval over all optima (SI), and the reason for it as in `Interval`."""
        limit = self.limit(level, upper=upper)
        ends = [part.end(limit, upper=upper) for part in (self, *self.branches) if self._keeps(part, limit)]
        return (max if upper else min)(ends, key=lambda end: end[0])

    def bottoms_beyond(self, value: float, *, upper: bool) -> list[float]:
        """Values (SI) beyond `value` at which the profile has a minimum not rejected at 99.9 %, nearest first."""
        bottoms = []
        for part in (self, *self.branches):
            t = np.concatenate([[np.inf], part.delta_chi_square, [np.inf]])
            lowest = (t[1:-1] <= t[:-2]) & (t[1:-1] <= t[2:]) & (t[1:-1] < HIGHEST**2)
            bottoms += part.values[lowest].tolist()
        beyond = [bottom for bottom in bottoms if (bottom > value if upper else bottom < value)]
        return sorted(beyond, reverse=not upper)

    def limit(self, level: float, *, upper: bool) -> Limit:
        """Largest z = sqrt(t) inside the interval on one side, as a function of the scaled parameter.

        t is the rise of chi-square. Raises as `threshold`.
        """
        plain = self._plain(level)
        centres = () if self.calibration is None else self.calibration.side(upper=upper)
        if not centres:
            return _constant(float(np.sqrt(plain)))
        coordinate = self.fit.problem.coordinates[self.index]
        pairs = sorted((coordinate.scaled(at.value), np.sqrt(at.threshold(level))) for at in centres)
        places, roots = np.array(pairs).T
        return lambda q: np.interp(q, places, roots)

    def end(self, z: float | Limit, *, upper: bool) -> tuple[float, str]:
        """One end of the interval (SI) on this branch only, and the reason for it as in `Interval`.

        `z` is the limit of sqrt(t), a number or a function of the scaled parameter, with t the rise of chi-square.
        """
        limit = z if callable(z) else _constant(z)
        coordinate = self.fit.problem.coordinates[self.index]
        outwards = slice(self.best, None) if upper else slice(self.best, None, -1)
        q, reason = self.vectors[outwards, self.index], self.ends[int(upper)]
        crossing = _crossing(q, np.sqrt(self.delta_chi_square[outwards]), limit)
        if crossing is not None:
            return float(coordinate.physical(np.asarray(crossing))), "data"
        if reason == "bound":
            return coordinate.high if upper else coordinate.low, "bound"
        if reason == "law":
            return float(coordinate.physical(q[-1])), "law"
        return (np.inf if upper else -np.inf), "none"


def interval_threshold(fit: Fit, level: float) -> float:
    """Rise t of chi-square at the ends of an interval of this confidence.

    It is the quantile of chi-square with one degree of freedom, or of F where the noise was estimated.

    Raises
    ------
    InputError
        If the level is not between 0 and 0.999.
    """
    if not 0.0 < level <= 0.999:
        raise InputError(f"level must be above 0 and at most 0.999; got {level!r}")
    if _estimates_noise(fit):
        return float(special.fdtri(1, fit.statistics.points - fit.statistics.parameters, level))
    return float(special.chdtri(1, 1.0 - level))


def _estimates_noise(fit: Fit) -> bool:
    return fit.statistics.noise_estimated or bool(fit.problem.noise_entries)


def _constant(z: float) -> Limit:
    return lambda q: np.full(np.shape(q), z)


def _crossing(q: FloatArray, z: FloatArray, limit: Limit) -> float | None:
    """Outermost scaled value at which z = sqrt(t) rises above the limit for good; None if it never does.

    `q` and `z` are the profile from its minimum outwards, (m,); t is the rise of chi-square.
    """
    last = int(np.flatnonzero(z <= limit(q))[-1])
    if last == len(z) - 1:
        return None
    outwards = np.abs(q - q[0])
    towards = np.sign(q[-1] - q[0])
    z_at = interpolate.PchipInterpolator(outwards, z)

    def over(x: float) -> float:
        return float(z_at(x) - limit(np.asarray(q[0] + towards * x)))

    # The walk may have ended on the limit: what is drawn through its points is below it there by a rounding.
    if over(outwards[last + 1]) <= 0.0:
        return float(q[last + 1])
    reached = optimize.brentq(over, outwards[last], outwards[last + 1])
    return float(q[0] + towards * reached)
