"""A first guess of each number of a noise model, from the curve itself."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np

from underlay.data.curve import Curve
from underlay.inference.priors.prior import Prior
from underlay.quantities import field_quantities
from underlay.scene.noise_model import NoiseModel

__all__ = ["noise_start", "scatter"]

# A smooth curve has small second differences; those of white noise have variance 6 sigma^2. The median
# absolute value of a normal variable is 0.6745 sigma.
_SECOND_DIFFERENCE = 6.0**0.5 * 0.6744897501960817


def scatter(curve: Curve) -> float:
    """Standard deviation (N) of the force about a smooth curve, robust; never zero."""
    force = curve.force[np.argsort(curve.depth, kind="stable")] if curve.time is None else curve.force
    # In order, which takes a third of numpy.median's time.
    second = np.sort(np.abs(np.diff(force, 2)))
    median = 0.5 * float(second[(len(second) - 1) // 2] + second[len(second) // 2])
    floor = 1e-9 * float(np.ptp(curve.force))
    return max(median / _SECOND_DIFFERENCE, floor)


def noise_start(
    field: str,
    noise: NoiseModel,
    curves: Sequence[Curve],
    prior: Prior | None,
    bounds: tuple[float, float] | None,
) -> float:
    """Start (SI) of a free number of the noise: the model's own, else a guess inside prior and bounds."""
    given = getattr(noise, field)
    if given:
        return float(given)
    known = field_quantities(noise)[field]
    guesses: dict[str, Callable[[], float]] = {
        "force": lambda: float(np.median([scatter(curve) for curve in curves])),
        "length": lambda: 1e-3 * max(float(np.ptp(curve.depth)) for curve in curves),
        "time": lambda: 3.0 * float(np.median([_time_step(curve) for curve in curves])),
    }
    guess = guesses.get(known.kind, lambda: known.natural_scale)()
    low, high = prior.support if prior is not None else bounds or (0.0, np.inf)
    if low <= guess <= high:
        return guess
    if prior is not None and prior.proper:
        return float(prior.quantile(np.array(0.5)))
    if np.isfinite(high):
        return float(np.sqrt(low * high)) if low > 0.0 else 0.5 * (low + high)
    return 2.0 * low


def _time_step(curve: Curve) -> float:
    return 1.0 if curve.time is None else float(np.median(np.abs(np.diff(curve.time))))
