"""Hayes et al. (1972): a flat punch on cartilage bonded to bone, by a table.

P = 2 a d kappa(a/h, nu) E/(1-nu^2), with force P, punch radius a, depth d, thickness h, and kappa tabulated.
The columns of nu = 0.3 and nu = 0.5 could be confirmed, so only they are here; another Poisson's ratio is
refused rather than given the wrong column, as is often done. Between the entries a cubic spline is drawn, with
kappa(0) = 1 of the half-space as one more entry; it adds less than 0.03 % to the table's own drift, which at
a/h = 2 is -0.4 % (nu = 0.3) and -0.9 % (nu = 0.5).
"""

from __future__ import annotations

import numpy as np
from scipy.interpolate import CubicSpline

from underlay.errors import InputError
from underlay.mechanics.published.correction import (
    LAYER_NU,
    RIGID_BONDED,
    ConstantFactor,
    LayerContact,
    MeasuredError,
    PublishedCorrection,
)

_RADIUS = (0.0, 0.2, 0.4, 0.6, 0.8, 1.0, 1.2, 1.4, 1.6, 1.8, 2.0)
_KAPPA = {
    0.3: (1.0, 1.207, 1.472, 1.784, 2.124, 2.480, 2.845, 3.214, 3.586, 3.960, 4.336),
    0.5: (1.0, 1.281, 1.683, 2.211, 2.855, 3.609, 4.469, 5.441, 6.528, 7.735, 9.069),
}


def _punch(contact: LayerContact) -> ConstantFactor:
    column = _KAPPA.get(contact.layer.nu)
    if column is None:
        raise InputError(
            f"hayes1972 holds the table's columns for nu = {' and '.join(map(str, _KAPPA))} alone; the "
            f'layer\'s nu is {contact.layer.nu:.6g}. Take one of those, or the solver "exact", for every nu'
        )
    ratio = contact.radius_ratio
    if ratio > _RADIUS[-1]:
        raise InputError(
            f"the table of hayes1972 ends at a/h = {_RADIUS[-1]:g}; here a/h = {ratio:.6g}. "
            'Take the solver "exact"'
        )
    return ConstantFactor(float(CubicSpline(_RADIUS, column)(np.float64(ratio))))


PUNCH = PublishedCorrection(
    name="hayes1972",
    indenter="flat punch",
    substrate=RIGID_BONDED,
    equation=(
        "P = 2 a d kappa(a/h, nu) E/(1-nu^2); a/h = 0.2 to 2.0 in steps of 0.2; nu = 0.3: "
        "kappa = 1.207 1.472 1.784 2.124 2.480 2.845 3.214 3.586 3.960 4.336; nu = 0.5: "
        "kappa = 1.281 1.683 2.211 2.855 3.609 4.469 5.441 6.528 7.735 9.069"
    ),
    valid_range=(0.2, 2.0),
    range_basis="the entries of the table",
    nu_range=(0.3, 0.5),
    assumptions=(
        "linear elasticity, no friction under the punch",
        "nu = 0.3 or 0.5",
        "entries joined by a cubic spline",
    ),
    source="Hayes, Keer, Herrmann & Mockros 1972, Journal of Biomechanics 5, 541-551",
    doi="10.1016/0021-9290(72)90010-3",
    factor=_punch,
    measured_error=MeasuredError.from_table(
        (LAYER_NU,),
        """
       0.2    0.4    0.6    0.8     1   1.2   1.4   1.6   1.8     2
0.3  0.039  0.042  0.048  0.094  0.15  0.18  0.25  0.31  0.36   0.4
0.5  0.029  0.043  0.086   0.19  0.27  0.41   0.5  0.62  0.75  0.88
""",
    ),
)
