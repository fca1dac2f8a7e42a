"""Intervals of what follows from the fitted parameters, such as the modulus that a layer relaxes to.

To first order in the scaled coordinates, in the logarithm of the quantity: its interval is one of ratios, like that
of a modulus.
"""

from __future__ import annotations

import math

import numpy as np
from scipy import special

from underlay._arrays import FloatArray
from underlay.errors import InputError
from underlay.inference.least_squares.fit_result import Fit
from underlay.inference.least_squares.stated import StatedInterval
from underlay.inference.misfit.averaging import Averaged
from underlay.inference.misfit.mixture import Mixture
from underlay.inference.sampling.derived import derived_quantities

__all__ = ["derived_interval"]

# Central difference in scaled coordinates: truncation 1e-10 of the derivative, rounding 1e-11.
_STEP = 1e-5
# A factor of e, as for a fitted parameter, fixes nothing.
_OPEN = 1.0


def derived_interval(fit: Fit, averaged: Averaged | None, name: str, level: float) -> StatedInterval:
    """Interval of a derived quantity.

    Raises
    ------
    InputError
        If the quantity does not follow from what is fitted.
    """
    value, gradient = _about(fit, name, fit.vector if averaged is None else averaged.vector)
    half = 0.5 * (1.0 + level)
    acting = [n for n, g in zip(fit.names, gradient, strict=True) if g]
    unknown = any(n in fit.no_error_bars for n in acting if n not in fit.bounds_hit)
    if unknown or not np.isfinite(gradient).all():
        return StatedInterval(name, level, value, -math.inf, math.inf, "quadratic")
    if averaged is not None:
        mixture = _along(averaged, gradient)
        low, middle, high = (mixture.quantile(0, tail) for tail in (1.0 - half, 0.5, half))
        low, middle, high = (value * math.exp(shift) for shift in (low, middle, high))
        return StatedInterval(name, level, middle, low, high, "averaged")
    s = fit.statistics
    freedom = max(s.points - s.parameters, 1)
    times = float(special.stdtrit(freedom, half) if s.noise_estimated else special.ndtri(half))
    deviation = math.sqrt(float(gradient @ fit.scaled_covariance @ gradient))
    if deviation > _OPEN:
        return StatedInterval(name, level, value, -math.inf, math.inf, "quadratic")
    ends = (value * math.exp(-times * deviation), value * math.exp(times * deviation))
    return StatedInterval(name, level, value, *ends, "quadratic")


def _about(fit: Fit, name: str, vector: FloatArray) -> tuple[float, FloatArray]:
    """The quantity (SI) at a vector (k,), and d ln / d coordinate, (k,); infinite where it is not positive."""
    k = len(fit.names)
    steps = np.concatenate((np.zeros((1, k)), _STEP * np.eye(k), -_STEP * np.eye(k)))
    found = derived_quantities(fit.problem, fit.problem.physical(vector + steps))
    if name not in found:
        free, derived = ", ".join(fit.names), ", ".join(found)
        raise InputError(f"{name!r} is not free here; free are {free}; from these follow {derived or 'none'}")
    values = found[name]
    if not (values > 0.0).all():
        return float(values[0]), np.full(k, np.inf)
    logs = np.log(values)
    return float(values[0]), np.asarray((logs[1 : k + 1] - logs[k + 1 :]) / (2.0 * _STEP))


def _along(averaged: Averaged, gradient: FloatArray) -> Mixture:
    """Distribution of the change of the logarithm, from the optimum of the likeliest combination."""
    weights, shifts, deviations = [], [], []
    for share, (vector, competition) in zip(averaged.shares, averaged.optima, strict=True):
        kept = competition.kept
        covariance = competition.covariance(kept)
        moved = competition.shift[kept][:, : competition.parameters] + (vector - averaged.vector)
        own = competition.weights[kept]
        weights.append(share * own / own.sum())
        shifts.append(moved @ gradient)
        deviations.append(np.sqrt(np.einsum("i,gij,j->g", gradient, covariance, gradient)))
    degrees = averaged.competition.degrees
    return Mixture(
        np.concatenate(weights), np.concatenate(shifts)[:, None], np.concatenate(deviations)[:, None], degrees
    )
