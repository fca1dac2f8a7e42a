"""Solve for the curves that the package keeps in a file, and write it.

python tests/studies/stored_curves.py
"""

from __future__ import annotations

from math import inf, log1p

import numpy as np

import underlay as ul
from underlay.mechanics.body import PlaneConstants, isotropic_constants
from underlay.mechanics.exact import stored_curves as module
from underlay.mechanics.exact.contact_problem import ContactProblem, solve_curve
from underlay.mechanics.exact.master_curve import Factor, chebyshev_angles, chebyshev_coefficients
from underlay.mechanics.exact.stored_curves import (
    CROWDING,
    EXPONENT,
    LOG_RATIOS,
    MADE_FOR,
    STRETCH,
    TERMS,
    TOP,
    StoredCurves,
)
from underlay.mechanics.kernel import LayerKernel

# A thirtieth of what the series leave out.
RTOL = 3e-9


def grid():
    """Bodies (ratios + 1, shares) and values of varpi (terms,) for which the file is solved; the last is rigid."""
    log_ratios, spread, z = (np.cos(chebyshev_angles(count)) for count in TERMS)
    low, high = LOG_RATIOS
    ratios = np.exp(0.5 * (low + high) + 0.5 * (high - low) * log_ratios).tolist()
    shares = (np.expm1(0.5 * (spread + 1.0) * log1p(CROWDING)) / CROWDING).tolist()
    return [[body(ratio, share) for share in shares] for ratio in (*ratios, inf)], STRETCH.v(z)


def body(ratio, share):
    """A body of this r = theta_base/theta_layer (infinite: rigid base) and this share; many have both.

    Here gamma is half the share in the layer, and half of 1 - share in the base.
    """
    halves = (0.5 * share, 0.5 * (1.0 - share))
    layer, base = (isotropic_constants(1.0, (1.0 - 2.0 * part) / (2.0 - 2.0 * part)) for part in halves)
    if np.isinf(ratio):
        return LayerKernel(layer, None)
    # Isotropic constants of another modulus: compliances and stiffness scale.
    stiffer = float(ratio * layer.theta / base.theta)
    return LayerKernel(layer, PlaneConstants(base.q, base.c / stiffer, base.g * stiffer, base.S / stiffer))


def solved():
    """Return what the file holds: series of the logarithms of the three factors."""
    bodies, varpi = grid()
    tip = ul.PowerLaw(EXPONENT, 1.0)
    found = [[solve_curve(ContactProblem.of(tip, 1.0, body), TOP, RTOL) for body in row] for row in bodies]
    # One polynomial per factor is for curves that do not jump.
    assert not any(one.curve.jumps for row in found for one in row)
    values = np.array(
        [[[one.curve.logarithm(which, varpi) for which in Factor] for one in row] for row in found]
    )
    finest = max((one.resolution for row in found for one in row), key=lambda one: one.radial)
    ratios, shares, terms = (chebyshev_coefficients(np.eye(n), chebyshev_angles(n)) for n in TERMS)
    both = np.concatenate((np.tensordot(ratios, values[:-1], 1), values[-1:]))
    series = np.einsum("su,tv,rufv->rstf", shares, terms, both)
    nodes = np.array([finest.radial, finest.wavenumbers, finest.first, finest.reach])
    return StoredCurves(np.array(MADE_FOR), series, nodes)


def write(curves):
    """Write the file, in single precision, which is finer than the truncation of the series."""
    kept = curves._replace(series=curves.series.astype(np.float32))
    named = list(zip(curves._fields, kept, strict=True))
    record = np.zeros((), dtype=[(name, part.dtype, part.shape) for name, part in named])
    for name, part in named:
        record[name] = part
    np.save(module.FILE, record, allow_pickle=False)


if __name__ == "__main__":
    write(solved())
