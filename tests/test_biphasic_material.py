"""Biphasic materials: validation, derived quantities, elastic ends."""

import numpy as np
import pytest

from biphasic_reference import transverse
from underlay.errors import InputError, MaterialError
from underlay.mechanics.biphasic.material import Biphasic, BiphasicTransverse
from underlay.mechanics.body import Layer
from underlay.mechanics.materials import Isotropic


def test_derived_numbers():
    material = Biphasic(E=1.0, nu=0.25, permeability=2.0)
    assert material.shear_modulus == 0.4
    assert material.aggregate_modulus == pytest.approx(1.2)
    assert material.diffusivity == pytest.approx(2.4)
    assert material.drainage_time(1.2) == pytest.approx(0.6)
    assert (material.undrained.E, material.undrained.nu) == (pytest.approx(1.2), 0.5)
    assert material.drained == Isotropic(1.0, 0.25)
    assert material.skeleton.theta_drained * material.shear_modulus == pytest.approx(
        material.theta, rel=1e-14
    )


@pytest.mark.parametrize("name", ["five", "ten", "three"])
def test_undrained_engineering_constants_are_the_undrained_skeleton(name):
    material = transverse(name)
    found, exact = material.undrained.plane_constants, material.skeleton.undrained
    assert found.q == pytest.approx(exact.q, rel=1e-13)
    assert found.c == pytest.approx(0.0, abs=1e-14)
    assert found.g == pytest.approx(exact.g * material.G_axial, rel=1e-13)
    assert pytest.approx(1.0 / material.G_axial, rel=1e-13) == found.S
    assert found.theta == pytest.approx(material.skeleton.theta_undrained * material.G_axial, rel=1e-12)


def test_isotropic_constants_of_a_transversely_isotropic_one():
    same = BiphasicTransverse(2.6, 2.6, 0.3, 0.3, 1.0, 1.0)
    one = Biphasic(2.6, 0.3, 1.0)
    assert same.aggregate_modulus == pytest.approx(one.aggregate_modulus, rel=1e-14)
    for name in ("A11", "A13", "A33", "theta_drained", "theta_undrained"):
        assert getattr(same.skeleton, name) == pytest.approx(getattr(one.skeleton, name), rel=1e-13)
    undrained = same.undrained
    found = (undrained.E, undrained.E_axial, undrained.nu, undrained.nu_axial, undrained.G_axial)
    assert found == pytest.approx((3.0, 3.0, 0.5, 0.5, 1.0))


def test_a_layer_is_made_of_it():
    layer = Layer(Biphasic(1e6, 0.2, 1e-15), 1e-3)
    assert layer.material.plane_constants == Isotropic(1e6, 0.2).plane_constants
    assert BiphasicTransverse(5.0, 1.0, 0.2, 0.1, 0.6, 1.0).in_plane == Isotropic(5.0, 0.2)
    numbers = {"E": 1e6, "nu": np.array([0.2, 0.3]), "permeability": 1e-15}
    assert Biphasic.constants_of(**numbers).q == pytest.approx([0.25, 3.0 / 7.0])


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"nu": 0.5}, r"must be in \(-1, 0.5\); got 0.5"),
        ({"nu": -1.0}, r"must be in \(-1, 0.5\); got -1.0"),
        ({"permeability": 0.0}, r"permeability must be positive and finite \(m\^4/\(N s\)\); got 0.0"),
        ({"permeability": float("nan")}, "permeability must be positive"),
        ({"E": -1.0}, "Young's modulus E must be positive"),
    ],
)
def test_isotropic_refusals(change, message):
    with pytest.raises(InputError, match=message):
        Biphasic(**({"E": 1.0, "nu": 0.2, "permeability": 1.0} | change))


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"nu": 1.0}, "-1 < nu < 1"),
        ({"nu_axial": 0.9}, r"1 - nu - 2 \(E/E_axial\) nu_axial\^2 >= 0 fails"),
        ({"nu": 0.5, "E": 1.0, "nu_axial": 0.5}, "is compressible"),
        ({"permeability_ratio": -1.0}, "permeability_ratio must be positive"),
        ({"G_axial": 0.0}, "G_axial must be positive"),
    ],
)
def test_transverse_refusals(change, message):
    given = {"E": 5.0, "E_axial": 1.0, "nu": 0.2, "nu_axial": 0.1, "G_axial": 0.6, "permeability": 1.0}
    with pytest.raises(InputError, match=message):
        BiphasicTransverse(**(given | change))


def test_refusals_are_of_the_material():
    with pytest.raises(MaterialError):
        Biphasic(1.0, 0.5, 1.0)
