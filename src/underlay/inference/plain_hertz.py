"""The fit that everybody writes first: Hertz's formula through lmfit, the unit in which fits are timed."""

from __future__ import annotations

from typing import Any

import lmfit
import numpy as np

from underlay._arrays import FloatArray

__all__ = ["plain_hertz_fit"]


def plain_hertz_fit(
    depth: FloatArray, force: FloatArray, radius: float, nu: float, *, E: float, contact_depth: float = 0.0
) -> dict[str, float]:
    """Fit modulus, contact depth and baseline with lmfit's defaults: leastsq, its own numeric derivatives.

    P = 4 E sqrt(R) w^(3/2) / (3 (1 - nu^2)) for a paraboloid on a half-space (Hertz 1882,
    doi:10.1515/crll.1882.92.156).

    Parameters
    ----------
    depth, force : FloatArray
        Readings (m, N), (n,).
    radius : float
        Of the tip (m).
    nu : float
        Poisson's ratio.
    E, contact_depth : float
        Where it starts (Pa, m); the baseline starts at zero.

    Returns
    -------
    dict
        ``E`` (Pa), ``contact_depth`` (m), ``baseline`` (N).
    """
    scale = 4.0 / 3.0 * radius**0.5 / (1.0 - nu * nu)

    def residual(current: Any) -> FloatArray:
        w = np.maximum(depth - current["contact_depth"].value, 0.0)
        model: FloatArray = scale * current["E"].value * w**1.5 + current["baseline"].value
        return model - force

    start = lmfit.Parameters()
    start.add("E", value=E, min=0.0)
    start.add("contact_depth", value=contact_depth)
    start.add("baseline", value=0.0)
    result = lmfit.minimize(residual, start)
    return {name: float(entry.value) for name, entry in result.params.items()}
