"""Hayes et al. (1972): a flat punch on cartilage bonded to bone, by a table.

P = 2 a d kappa(a/h, nu) E/(1-nu^2), with kappa tabulated. Only the column of nu = 0.5 could be confirmed
from more than one place, so only it is here; another Poisson's ratio is refused rather than given the
wrong column, as is often done. Between the entries a cubic spline is drawn, with kappa(0) = 1 of the
half-space as one more entry; it adds less than 0.3 % to the table's own drift, which is -0.9 % at a/h = 2.
"""

from __future__ import annotations

import numpy as np
from scipy.interpolate import CubicSpline

from underlay.errors import InputError
from underlay.mechanics.published.correction import RIGID_BONDED, PublishedCorrection
from underlay.mechanics.published.factor import ConstantFactor
from underlay.mechanics.published.layer_contact import LayerContact
from underlay.mechanics.published.measured_error import MeasuredError
from underlay.mechanics.published.quantities import LAYER_NU

__all__ = ["PUNCH"]

_RADIUS = (0.0, 0.2, 0.4, 0.6, 0.8, 1.0, 1.2, 1.4, 1.6, 1.8, 2.0)
_KAPPA = (1.0, 1.281, 1.683, 2.211, 2.855, 3.609, 4.469, 5.441, 6.528, 7.735, 9.069)


def _punch(contact: LayerContact) -> ConstantFactor:
    if contact.layer.nu != 0.5:
        raise InputError(
            "hayes1972 holds the table's column for nu = 0.5 alone; the layer's nu is "
            f"{contact.layer.nu:.6g}. Set nu = 0.5, or take method='exact', which knows every nu"
        )
    ratio = contact.radius_ratio
    if ratio > _RADIUS[-1]:
        raise InputError(
            f"the table of hayes1972 ends at a/h = {_RADIUS[-1]:g}; here a/h = {ratio:.6g}. "
            "Take method='exact'"
        )
    return ConstantFactor(float(CubicSpline(_RADIUS, _KAPPA)(np.float64(ratio))))


PUNCH = PublishedCorrection(
    name="hayes1972",
    indenter="flat punch",
    substrate=RIGID_BONDED,
    equation=(
        "P = 2 a d kappa(a/h) E/(1-nu^2); nu = 0.5, a/h = 0.2 to 2.0 in steps of 0.2: "
        "kappa = 1.281 1.683 2.211 2.855 3.609 4.469 5.441 6.528 7.735 9.069"
    ),
    valid_range=(0.2, 2.0),
    range_basis="the entries of the table",
    nu_range=(0.5, 0.5),
    assumptions=(
        "linear elasticity, no friction under the punch",
        "incompressible layer, nu = 0.5",
        "entries joined by a cubic spline",
    ),
    source="Hayes, Keer, Herrmann & Mockros 1972, Journal of Biomechanics 5, 541-551",
    doi="10.1016/0021-9290(72)90010-3",
    factor=_punch,
    measured_error=MeasuredError.from_table(
        (LAYER_NU,),
        """
       0.2    0.4    0.6   0.8     1   1.2  1.4   1.6   1.8     2
0.5  0.029  0.043  0.086  0.19  0.27  0.41  0.5  0.62  0.75  0.88
""",
    ),
)
