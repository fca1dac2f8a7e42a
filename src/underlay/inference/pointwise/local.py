"""What a curve says of its force at some depths: means over bins, anchored on the fitted model.

In every bin a straight line is laid through the residuals of the fit, and what it says at the middle of the bin is
added to the model there. Where the model is right the line is zero, however bent the model is in the bin.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from underlay._arrays import FloatArray
from underlay.data.segments import LOADING
from underlay.errors import CurveError
from underlay.inference.least_squares.fit_result import Fit

__all__ = ["Bins", "Noise", "Residuals", "bins_of", "noise_in", "residuals_in"]

# Points below which a bin says nothing of its own scatter.
_FEWEST = 8


@dataclass(frozen=True)
class Bins:
    """Points of one curve, put together by depth.

    Parameters
    ----------
    centre : FloatArray
        Depth readings in the middle of each bin (m), (n,).
    points : tuple of arrays of int
        Which points of the curve lie in each.
    """

    centre: FloatArray
    points: tuple[NDArray[np.intp], ...]


@dataclass(frozen=True)
class Residuals:
    """Force residual (N) and its slope along the depth (N/m) in the middle of each bin, (n,), with their errors."""

    force: FloatArray
    slope: FloatArray
    force_error: FloatArray
    slope_error: FloatArray


@dataclass(frozen=True)
class Noise:
    """Standard deviation of every point (N), and how far errors of means exceed those of independent points."""

    sigma: FloatArray
    inflation: float


def bins_of(fit: Fit, curve: int, contact: float, most: int) -> Bins:
    """Put the points beyond `contact` (a depth reading, m) into at most `most` bins of equal width.

    Of a curve that goes in and comes back only the way in is taken.

    Raises
    ------
    CurveError
        If fewer than two bins could be filled.
    """
    measured = fit.curves[curve]
    inside = measured.depth > contact
    labels = measured.segments()
    if (labels == LOADING).any():
        inside &= labels == LOADING
    taken = np.flatnonzero(inside)
    count = min(most, len(taken) // _FEWEST)
    if count < 2:
        raise CurveError(
            f"a modulus depth by depth needs {2 * _FEWEST} points beyond contact; there are {len(taken)}"
        )
    depth = measured.depth[taken]
    edges = np.linspace(contact, depth.max(), count + 1)
    which = np.minimum(np.searchsorted(edges, depth, side="right") - 1, count - 1)
    filled = [k for k in range(count) if np.count_nonzero(which == k) >= _FEWEST // 2]
    if len(filled) < 2:
        raise CurveError("a modulus depth by depth needs points at several depths beyond contact")
    return Bins(
        np.array([float(depth[which == k].mean()) for k in filled]),
        tuple(taken[which == k] for k in filled),
    )


def residuals_in(fit: Fit, curve: int, bins: Bins, noise: Noise) -> Residuals:
    """Lay a straight line through the residuals of every bin, weighted by the noise.

    The error of a slope falls with the width of a bin to the power 3/2: slopes are those of the bin and its
    neighbours.
    """
    force, force_error = _lines(fit, curve, bins.points, bins.centre, noise)[0]
    wide = tuple(np.concatenate(bins.points[max(k - 1, 0) : k + 2]) for k in range(len(bins.points)))
    slope, slope_error = _lines(fit, curve, wide, bins.centre, noise)[1]
    return Residuals(force, slope, force_error, slope_error)


def _lines(
    fit: Fit, curve: int, groups: Sequence[NDArray[np.intp]], centre: FloatArray, noise: Noise
) -> FloatArray:
    """Height at `centre` and slope of a line through the residuals of each group, and their errors: (2, 2, n)."""
    depth = fit.curves[curve].depth
    found = np.zeros((2, 2, len(groups)))
    for k, points in enumerate(groups):
        residual, sigma = fit.residuals[curve][points], noise.sigma[points]
        design = _design(depth[points] - centre[k])
        covariance = np.linalg.inv((design / sigma[:, None] ** 2).T @ design)
        found[:, 0, k] = covariance @ design.T @ (residual / sigma**2)
        found[:, 1, k] = noise.inflation * np.sqrt(np.diag(covariance))
    return found


def _design(offset: FloatArray) -> FloatArray:
    return np.stack((np.ones_like(offset), offset), axis=1)


def noise_in(fit: Fit, curve: int, bins: Bins) -> Noise:
    """Noise of the points about a straight line in every bin: stated by the fit's noise, else from the scatter.

    A misfit that changes slowly is no noise here: the modulus is to show it. Errors of means grow by
    sqrt((1 + r) / (1 - r)) where neighbours hang together by r (AR(1)).
    """
    depth, sigma = fit.curves[curve].depth, fit.sigmas[curve]
    square = product = freedom = 0.0
    for k, points in enumerate(bins.points):
        z = fit.residuals[curve][points] / sigma[points]
        design = _design(depth[points] - bins.centre[k])
        left = z - design @ np.linalg.lstsq(design, z, rcond=None)[0]
        square += float(left @ left)
        product += float(left[1:] @ left[:-1])
        freedom += len(points) - 2
    variance = square / max(freedom, 1.0)
    together = min(max(product / max(square, np.finfo(float).tiny), 0.0), 0.99)
    size = 1.0 if fit.problem.noise_is_stated and not fit.statistics.noise_estimated else np.sqrt(variance)
    return Noise(sigma * size, float(np.sqrt((1.0 + together) / (1.0 - together))))
