"""The top of a posterior and its width there: where the walkers of a sampler start.

Newton's method on a log-density of which only values are known, many at a time. Derivatives are differences
over about one standard deviation, taken in a basis that is whitened again after every step: at that size
they are far above rounding, they see a bent ridge as wide as it is, and parameters correlated to 0.999 cost
no digits. Where the data say nothing the curvature vanishes and the width of the prior takes its place.
"""

from __future__ import annotations

from collections.abc import Callable
from itertools import combinations
from typing import NamedTuple

import numpy as np

from underlay._arrays import FloatArray
from underlay.errors import FitError

__all__ = ["Laplace", "find_mode", "overdispersed"]

_MAX_STEPS = 40
# Halvings of a step that is to stay inside the prior; 2^-40 of a prior's width is nothing.
_MAX_HALVINGS = 40
_STEP_LENGTHS = 2.0 ** -np.arange(12.0)
# A thousandth of a log unit is 1/20 of a standard deviation; widths within 30 % are enough for a start.
_NEGLIGIBLE = 0.001
_SETTLED = 0.5
# At the wall of the box there is always something to gain beyond it.
_PATIENCE = 3
_TRIAL_WIDTHS = 10.0 ** -np.arange(0.0, 9.0, 0.5)


class Laplace(NamedTuple):
    """Mode (p,) and factor (p, p): ``mode + factor @ z`` with normal z is the posterior near its top."""

    mode: FloatArray
    factor: FloatArray
    log_density: float


def find_mode(
    log_density: Callable[[FloatArray], FloatArray],
    start: FloatArray,
    width: FloatArray,
    box: tuple[FloatArray, FloatArray],
) -> Laplace:
    """Climb from `start` to the nearest top inside a box.

    Parameters
    ----------
    log_density : callable
        (m, p) -> (m,); -inf where not allowed.
    start : FloatArray
        (p,), where the density is not zero.
    width : FloatArray
        (p,): standard deviation of the prior of each coordinate, the widest the result may be.
    box : pair of FloatArray
        Lower and upper ends (p,), within the priors: a top at the very edge of a prior has no neighbours to
        take differences with.

    Raises
    ------
    FitError
        If the density is zero or not a number at the start.
    """
    mode = np.clip(start, *box)
    top = float(log_density(mode[None])[0])
    if not np.isfinite(top):
        raise FitError(f"the log-posterior is {top} at the start: move the start inside the priors")
    basis = np.diag(_coordinate_widths(log_density, mode, top, width))
    idle = 0
    for _ in range(_MAX_STEPS):
        gradient, hessian, size = _derivatives(log_density, mode, top, basis)
        basis = basis * size
        curvature, directions = np.linalg.eigh(-hessian)
        longest = np.linalg.norm((basis @ directions) / width[:, None], axis=0)
        # A direction the density does not bend in, or bends upwards, is as wide as the prior.
        precision = np.maximum(curvature, longest**2)
        slope = directions.T @ gradient
        still_to_gain = 0.5 * float(np.sum(slope**2 / precision))
        step = basis @ (directions @ (slope / precision))
        basis = (basis @ directions) / np.sqrt(precision)
        candidates = np.clip(mode + _STEP_LENGTHS[:, None] * step, *box)
        values = log_density(candidates)
        best = int(np.argmax(values))
        idle = 0 if values[best] - top > _NEGLIGIBLE else idle + 1
        if values[best] > top:
            mode, top = candidates[best], float(values[best])
        settled = bool((np.abs(np.log(precision)) < _SETTLED).all())
        if settled and (still_to_gain < _NEGLIGIBLE or idle == _PATIENCE):
            break
    return Laplace(mode, basis, top)


def overdispersed(
    log_density: Callable[[FloatArray], FloatArray],
    laplace: Laplace,
    count: int,
    rng: np.random.Generator,
    *,
    spread: float = 2.0,
) -> FloatArray:
    """Draw `count` points (count, p) around the mode, `spread` times as wide as the posterior.

    Points that are not allowed, or so far down a bent ridge that a walker would take long to come back
    (more than ten log units per parameter), are drawn again, a little closer each time.

    Raises
    ------
    FitError
        If they do not fit inside the prior.
    """
    parameters = laplace.mode.size
    floor = laplace.log_density - 10.0 * parameters
    points = np.empty((count, parameters))
    missing = np.arange(count)
    for _ in range(_MAX_HALVINGS):
        drawn = laplace.mode + spread * rng.standard_normal((missing.size, parameters)) @ laplace.factor.T
        points[missing] = drawn
        missing = missing[~(log_density(drawn) > floor)]
        if not missing.size:
            return points
        spread *= 0.9
    raise FitError(
        f"{missing.size} of {count} walkers found no place inside the priors near the best fit; is the start "
        "at the edge of a prior?"
    )


def _coordinate_widths(
    log_density: Callable[[FloatArray], FloatArray], mode: FloatArray, top: float, width: FloatArray
) -> FloatArray:
    """Distance (p,) over which each coordinate alone costs half a log unit, at most the prior's width."""
    parameters = mode.size
    steps = (_TRIAL_WIDTHS[:, None, None] * np.diag(width)).reshape(-1, parameters)
    values = log_density(np.concatenate([mode + steps, mode - steps]))
    bend = (2.0 * top - values[: len(steps)] - values[len(steps) :]).reshape(-1, parameters)
    found = np.array(width)
    for i in range(parameters):
        usable = np.isfinite(bend[:, i]) & (bend[:, i] > 0.0)
        if usable.any():
            nearest = np.flatnonzero(usable)[np.argmin(np.abs(np.log(bend[usable, i])))]
            found[i] = min(width[i], width[i] * _TRIAL_WIDTHS[nearest] / np.sqrt(bend[nearest, i]))
    return found


def _derivatives(
    log_density: Callable[[FloatArray], FloatArray], mode: FloatArray, top: float, basis: FloatArray
) -> tuple[FloatArray, FloatArray, float]:
    """Gradient (p,), Hessian (p, p) in steps of the basis' columns, and by how much these were shortened."""
    parameters = mode.size
    pairs = list(combinations(range(parameters), 2))
    unit = np.eye(parameters)
    offsets = np.concatenate([unit, [unit[i] + unit[j] for i, j in pairs]]) if pairs else unit
    size = 1.0
    for _ in range(_MAX_HALVINGS):
        steps = size * offsets @ basis.T
        values = log_density(np.concatenate([mode + steps, mode - steps]))
        if np.isfinite(values).all():
            break
        size *= 0.5
    else:
        raise FitError("the log-posterior is not finite beside the best fit: is it at the edge of a prior?")
    up, down = values[: len(offsets)], values[len(offsets) :]
    even = up + down - 2.0 * top
    gradient = 0.5 * (up - down)[:parameters]
    hessian = np.diag(even[:parameters])
    for (i, j), both in zip(pairs, even[parameters:], strict=True):
        hessian[i, j] = hessian[j, i] = 0.5 * (both - even[i] - even[j])
    return gradient, hessian, size
