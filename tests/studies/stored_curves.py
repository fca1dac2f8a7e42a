"""Solve for the curves that the package keeps in a file, and write it.

python tests/studies/stored_curves.py
"""

from __future__ import annotations

import numpy as np

import underlay as ul
from underlay.mechanics.exact.contact_problem import ContactProblem, solve_curve
from underlay.mechanics.exact.master_curve import Factor
from underlay.mechanics.exact.stored_curves import EXPONENT, TOP, StoredCurves, grid

# A thirtieth of what the series leave out.
RTOL = 3e-9


def solved():
    """Return what the file holds."""
    bodies, varpi = grid()
    tip = ul.PowerLaw(EXPONENT, 1.0)
    found = [[solve_curve(ContactProblem.of(tip, 1.0, body), TOP, RTOL) for body in row] for row in bodies]
    # One polynomial per factor is for curves that do not jump.
    assert not any(one.curve.jumps for row in found for one in row)
    values = np.array(
        [[[one.curve.logarithm(which, varpi) for which in Factor] for one in row] for row in found]
    )
    finest = max((one.resolution for row in found for one in row), key=lambda one: one.radial)
    nodes = np.array([finest.radial, finest.wavenumbers, finest.first, finest.reach])
    return StoredCurves.through(np.moveaxis(values, 2, -1), nodes)


if __name__ == "__main__":
    solved().write()
