"""`Accuracy` keeps its promise with method="auto", says how far it may be off, and decides cheaply.

The reference is the exact law at 1e-11, itself held to independent solutions in test_exact.py.
"""

import itertools
import time

import numpy as np
import pytest

from underlay.errors import InputError, RangeError
from underlay.mechanics import asymptotic, automatic, exact, kernel
from underlay.mechanics.accuracy import Accuracy, contact_law
from underlay.mechanics.automatic import compliance_contrast
from underlay.mechanics.exact import exact_law
from underlay.mechanics.indenters import Cone, FlatPunch, Paraboloid, PowerLaw, Sphere
from underlay.mechanics.materials import RIGID, Isotropic, Layer, TransverselyIsotropic
from underlay.mechanics.series_error import EXTENDED, relation, series_error

RTOLS = (1e-2, 1e-3, 1e-4, 1e-6)
VARPI = (0.01, 0.03, 0.1, 0.3, 1.0, 3.0, 8.0)
#: Depths asked of every law, as fractions of the deepest.
FRACTIONS = np.array([1e-3, 0.1, 0.5, 1.0])

ZINC = TransverselyIsotropic.from_stiffness(A11=161e9, A12=34.2e9, A13=50.1e9, A33=61.0e9, A44=38.3e9)
SOFT_AXIS = TransverselyIsotropic(E=5.8e6, E_axial=0.46e6, nu=0.3, nu_axial=0.02, G_axial=0.37e6)
STIFF_AXIS = TransverselyIsotropic(E=1e6, E_axial=20e6, nu=0.3, nu_axial=0.25, G_axial=0.5e6)

PAIRS = {
    **{f"rigid, nu = {nu}": (Isotropic(1.0, nu), RIGID) for nu in (0.1, 0.3, 0.4, 0.45, 0.5)},
    **{
        f"E2/E1 = {ratio:g}, nu = {nu1} on {nu2}": (Isotropic(1.0, nu1), Isotropic(ratio, nu2))
        for ratio, nu1, nu2 in (
            (1e-3, 0.5, 0.3),
            (1e-2, 0.3, 0.3),
            (0.1, 0.5, 0.5),
            (0.5, 0.3, 0.4),
            (0.9, 0.45, 0.45),
            (0.999, 0.4, 0.4),
            (1.0, 0.5, 0.2),
            (1.0, 0.1, 0.45),
            (1.1, 0.3, 0.3),
            (2.0, 0.5, 0.5),
            (10.0, 0.3, 0.2),
            (1e3, 0.5, 0.3),
        )
    },
    "zinc on rigid": (ZINC, RIGID),
    "zinc on steel": (ZINC, Isotropic(210e9, 0.3)),
    "soft axis on stiff axis": (SOFT_AXIS, STIFF_AXIS),
    "stiff axis on soft axis": (STIFF_AXIS, SOFT_AXIS),
}

SHAPES = {
    "flat": lambda radius: FlatPunch(radius),
    "cone": lambda _: Cone(1.2),
    "lambda 1.5": lambda _: PowerLaw(1.5, 0.7),
    "paraboloid": lambda _: Paraboloid(2.0),
    "lambda 4": lambda _: PowerLaw(4.0, 0.3),
    "sphere, a = R/2": lambda radius: Sphere(2.0 * radius),
    "sphere, a = R/5": lambda radius: Sphere(5.0 * radius),
}


def deepest(indenter, varpi):
    """Depth (m) at which the half-space radius is `varpi` on a layer 1 m thick; 1 m for a flat punch."""
    return 1.0 if isinstance(indenter, FlatPunch) else float(indenter.abel(np.array(varpi)))


def answers(law, depth):
    return np.array([law.force(depth), law.contact_radius(depth), law.stiffness(depth)])


@pytest.mark.parametrize("shape", SHAPES)
@pytest.mark.parametrize("pair", PAIRS)
def test_auto_keeps_its_promise_and_its_estimate_is_honest(pair, shape):
    material, substrate = PAIRS[pair]
    layer = Layer(material, 1.0)
    broken, dishonest = [], []
    for varpi in VARPI:
        indenter = SHAPES[shape](varpi)
        deep = deepest(indenter, varpi)
        depth = deep * FRACTIONS
        reference = answers(exact_law(indenter, layer, substrate, max_depth=deep, rtol=1e-11), depth)
        for rtol in RTOLS:
            law = contact_law(indenter, layer, substrate, max_depth=deep, accuracy=Accuracy(rtol))
            error = float(np.abs(answers(law, depth) / reference - 1.0).max())
            case = f"a/h {varpi:g}, rtol {rtol:g}: error {error:.2e}, estimate {law.error_estimate:.2e} ({law.reason})"
            if error > rtol:
                broken.append(case)
            if law.error_estimate < error / 3.0:
                dishonest.append(case)
    assert not broken, broken
    assert not dishonest, dishonest
