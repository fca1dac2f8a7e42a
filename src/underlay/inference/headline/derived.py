"""Intervals of what follows from the fitted parameters, such as the modulus that a layer relaxes to.

A quantity of one parameter alone has the interval of that parameter, turned over. Of others the logarithm is taken
to first order in the scaled coordinates to find how far the parameters go, along the line on which the least change
of chi-square moves it most; what the quantity is at the ends of that line is computed, not extrapolated.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from scipy import special

from underlay._arrays import FloatArray
from underlay.errors import InputError
from underlay.inference.least_squares.fit_result import Fit, Follows, StatedInterval
from underlay.inference.misfit.averaging import Averaged
from underlay.inference.misfit.mixture import Mixture
from underlay.inference.sampling.derived import derived_quantities

__all__ = ["band", "derived_interval", "derived_value"]

# Central difference in scaled coordinates: truncation 1e-10 of the derivative, rounding 1e-11.
_STEP = 1e-5
# A factor of e, as for a fitted parameter, fixes nothing.
_OPEN = 1.0


def derived_interval(
    fit: Fit,
    averaged: Averaged | None,
    name: str,
    level: float,
    *,
    known: Callable[[str], StatedInterval] | None = None,
) -> StatedInterval:
    """Interval of a derived quantity.

    `known` are the intervals of the parameters themselves; by default those that the fit states from the noise.

    Raises
    ------
    InputError
        If the quantity does not follow from what is fitted.
    """

    def of(physical: FloatArray) -> FloatArray:
        found = derived_quantities(fit.problem, physical)
        if name not in found:
            free, derived = ", ".join(fit.names), ", ".join(found)
            raise InputError(
                f"{name!r} is not free here; free are {free}; from these follow {derived or 'none'}"
            )
        return found[name][:, None]

    alone = _of_one_parameter(fit, of)
    if alone is not None:
        parameter = fit.names[alone]
        own = fit.interval(parameter, level) if known is None else known(parameter)
        at = fit.problem.physical(fit.vector)
        ends = np.sort([_turned_over(of, at, alone, end) for end in (own.low, own.high)])
        middle = _turned_over(of, at, alone, own.value)
        return StatedInterval(name, level, middle, float(ends[0]), float(ends[1]), own.kind)
    low, middle, high = _along_line(
        fit, averaged, of, *(float(end[0]) for end in band(fit, averaged, of, level))
    )
    return StatedInterval(name, level, middle, low, high, "quadratic" if averaged is None else "averaged")


def derived_value(fit: Fit, name: str) -> float:
    """Value (SI) of a derived quantity at the optimum."""
    return float(derived_quantities(fit.problem, fit.problem.physical(fit.vector)[None])[name][0])


def _of_one_parameter(fit: Fit, of: Follows) -> int | None:
    """Entry of the one parameter that a quantity follows from; None where there are several."""
    k = len(fit.names)
    moved = of(fit.problem.physical(fit.vector + np.concatenate((np.zeros((1, k)), _STEP * np.eye(k)))))[:, 0]
    acting = np.flatnonzero(moved[1:] != moved[0])
    return int(acting[0]) if acting.size == 1 else None


def _turned_over(of: Follows, at: FloatArray, entry: int, value: float) -> float:
    """The quantity with one parameter at a value; an open end stays open."""
    if not math.isfinite(value):
        return value
    moved = at.copy()
    moved[entry] = value
    return float(of(moved[None, :])[0, 0])


def _along_line(
    fit: Fit, averaged: Averaged | None, of: Follows, low: float, middle: float, high: float
) -> tuple[float, float, float]:
    """The quantity where its logarithm, to first order, has come to these ends.

    The line is C g, C the covariance and g the gradient. Where that leaves what is possible the first order stands.
    """
    if not (np.isfinite([low, middle, high]).all() and low > 0.0):
        return low, middle, high
    vector = fit.vector if averaged is None else averaged.vector
    k = len(vector)
    beside = of(
        fit.problem.physical(vector + _STEP * np.concatenate((np.eye(k), -np.eye(k), np.zeros((1, k)))))
    )
    logs = np.log(beside[:, 0])
    gradient = (logs[:k] - logs[k : 2 * k]) / (2.0 * _STEP)
    spread = fit.scaled_covariance @ gradient
    if not gradient @ spread > 0.0:
        return low, middle, high
    change = np.log([low, middle, high]) - logs[-1]
    at = vector + np.outer(change, spread / (gradient @ spread))
    if not ((at >= fit.problem.bounds[:, 0]) & (at <= fit.problem.bounds[:, 1])).all():
        return low, middle, high
    ends = of(fit.problem.physical(at))[:, 0]
    if not ((ends > 0.0).all() and (np.diff(ends) >= 0.0).all()):
        return low, middle, high
    return float(ends[0]), float(ends[1]), float(ends[2])


def band(
    fit: Fit, averaged: Averaged | None, of: Follows, level: float, *, creeping: int | None = None
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Lower ends, middles and upper ends, each (n,), of quantities that follow from the parameters.

    `of` takes parameters (draws, k), SI, and gives the quantities (draws, n). An end is infinite where the data
    leave it open, or the quantity is not positive. With `creeping`, the number of a curve, `of` takes one column
    more: what the baseline of that curve creeps by, as a share of its largest force (`Averaged.creep_at`).
    """
    vector = fit.vector if averaged is None else averaged.vector
    k, beside = len(fit.names), creeping is not None
    steps = np.concatenate(
        (np.zeros((1, k + beside)), _STEP * np.eye(k + beside), -_STEP * np.eye(k + beside))
    )
    physical = fit.problem.physical(vector + steps[:, :k])
    found = _quantities(of, np.hstack((physical, steps[:, k:])))
    spread = None if averaged is None else _Spread.of(averaged, k, creeping)
    low, middle, high = np.full(found.shape[1], -np.inf), np.array(found[0]), np.full(found.shape[1], np.inf)
    for n, values in enumerate(found.T):
        if not (values > 0.0).all():
            continue
        above, below = np.split(np.log(values[1:]), 2)
        ends = _ends(fit, spread, (above - below) / (2.0 * _STEP), level)
        if ends is not None:
            low[n], middle[n], high[n] = values[0] * np.exp(ends)
    return low, middle, high


def _quantities(of: object, physical: FloatArray) -> FloatArray:
    """What a caller's function gives (draws, n) at parameters (draws, k); refused where it is not that."""
    given: object = of(physical) if callable(of) else of
    try:
        found = np.asarray(given, dtype=np.float64)
    except (TypeError, ValueError):
        found = np.zeros(0)
    if not (callable(of) and found.ndim == 2 and len(found) == len(physical)):
        told = f"an array of shape {np.shape(given)}" if isinstance(given, np.ndarray) else f"{given!r:.80}"
        asked = f"at {len(physical)} draws it gave" if callable(of) else "got"
        raise InputError(
            "of must be a function that takes parameters (draws, k), SI, and gives quantities (draws, n), a row "
            f"per draw, such as lambda p: p[:, :1]; {asked} {told}"
        )
    return found


def _ends(
    fit: Fit, spread: _Spread | None, gradient: FloatArray, level: float
) -> tuple[float, float, float] | None:
    """Lower end, middle and upper end of the change of a logarithm with this gradient; None where open."""
    own = gradient[: len(fit.names)]
    acting = [name for name, slope in zip(fit.names, own, strict=True) if slope]
    if any(name in fit.no_error_bars and name not in fit.bounds_hit for name in acting):
        return None
    if spread is not None:
        low, middle, high = spread.along(gradient, level)
        return low, middle, high
    half, s = 0.5 * (1.0 + level), fit.statistics
    freedom = max(s.points - s.parameters, 1)
    times = float(special.stdtrit(freedom, half) if s.noise_estimated else special.ndtri(half))
    deviation = math.sqrt(float(own @ fit.scaled_covariance @ own))
    return None if deviation > _OPEN else (-times * deviation, 0.0, times * deviation)


@dataclass(frozen=True)
class _Spread:
    """The parameters about the likeliest optimum, one Gaussian for each combination of noise and misfit.

    Weights (c,), shifts (c, k) and covariances (c, k, k) of the scaled vector, and of the creep of one curve's
    baseline behind it if that was asked for.
    """

    averaged: Averaged
    weights: FloatArray
    shift: FloatArray
    covariance: FloatArray

    @classmethod
    def of(cls, averaged: Averaged, k: int, creeping: int | None) -> _Spread:
        weights, shifts, covariances = [], [], []
        for share, (vector, model, competition) in zip(averaged.shares, averaged.optima, strict=True):
            shift, covariance = competition.shift, competition.covariance
            wanted = np.arange(k)  # the amplitudes of known errors come after the coordinates
            if creeping is not None:
                shift, covariance = competition.with_creep(model, creeping)
                wanted = np.append(wanted, shift.shape[1] - 1)
            shift = shift[:, wanted]
            shift[:, :k] += (vector - averaged.vector)[:k]
            weights.append(share * competition.weights)
            shifts.append(shift)
            covariances.append(covariance[:, wanted[:, None], wanted])
        return cls(averaged, *(np.concatenate(each) for each in (weights, shifts, covariances)))

    def along(self, gradient: FloatArray, level: float) -> list[float]:
        """Lower end, middle and upper end of the change of what has this gradient."""
        deviations = np.sqrt(np.einsum("i,gij,j->g", gradient, self.covariance, gradient))
        moved, degrees = self.shift @ gradient, self.averaged.competition.degrees
        out = 0.5 * (1.0 - self.averaged.inside(level))
        mixture = Mixture(self.weights, moved[:, None], deviations[:, None], degrees)
        return mixture.quantiles(0, [out, 0.5, 1.0 - out])
