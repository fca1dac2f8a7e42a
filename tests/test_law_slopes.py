"""Derivatives that an exact law says of itself: towards a body beside its own, at fixed depth."""

from dataclasses import replace

import numpy as np
import pytest

import underlay as ul
from support.inverse import layer_on, measured, problem
from underlay.inference.model.forward import Forward
from underlay.inference.model.laws import LawStore
from underlay.mechanics.contact import Variant

E, NU, H, C, BASE = "layer.E", "layer.nu", "layer.thickness", "instrument.contact_depth", "substrate.E"
DEPTH = np.linspace(-5e-6, 4e-5, 60)
BODIES = {
    "rigid": layer_on(ul.RIGID),
    "stiff": layer_on(ul.Isotropic(4e6, 0.3)),
    "soft": layer_on(ul.Isotropic(3e5, 0.3)),
    "sphere": layer_on(ul.Isotropic(4e6, 0.3), indenter=ul.Sphere(1e-3)),
    "cone": layer_on(ul.Isotropic(4e6, 0.3), indenter=ul.Cone(1.2)),
}


@pytest.mark.parametrize(
    ("name", "path"),
    [(name, path) for name in BODIES for path in (E, NU, BASE) if (name, path) != ("rigid", BASE)],
)
def test_a_law_says_its_derivative_towards_a_body_beside(name, path):
    scene = BODIES[name]
    forward = Forward.compile(scene, DEPTH, list({E: 0, NU: 0, C: 0, path: 0}), ul.Exact(1e-8), LawStore())
    values = dict(scene.parameters)
    said = forward.jacobian(values, [path])[1][:, 0]
    assert forward.laws.slope_ratios
    assert forward.laws.store.built == 1
    step = 1e-3 * values[path]
    above, below = (
        forward.reading(values | {path: values[path] + side * step}).force for side in (1.0, -1.0)
    )
    asked = (above - below) / (2.0 * step)
    # The difference leaves out (1e-3)^2 of the third derivative, some thirty times the first in Poisson's ratio;
    # laws of 1e-8 enter it with 1e-5.
    assert np.abs(said - asked).max() < 1e-4 * np.abs(asked).max()
    assert np.abs(asked).max() > 0.0


def test_the_earlier_name_of_the_variants_of_a_contact_still_reads_them():
    contact = BODIES["rigid"].contact
    varied = replace(contact, variants=(Variant(contact.kernel, 0.0, -1e-6, 1.0 - 1e-6),))
    with pytest.warns(DeprecationWarning, match=r"Contact\.variants"):
        assert varied.beside == varied.variants != ()


RADII = np.linspace(0.0, 5e-6, 40)
SPRING, SHEAR, FILM = "layer.bond.normal", "layer.bond.shear", "substrate.layers[0].thickness"
GLUED = ul.Layer(ul.Isotropic(4e6, 0.2), 4.7e-6, bond=ul.Spring(4e11, 2e11))
ON_A_FILM = ul.Stack([ul.Layer(ul.Isotropic(5e5, 0.45), 4e-6)], ul.RIGID)
MEASURED_TIP = ul.Profile(RADII, RADII**2 / 1e-5 + 0.1 * RADII**4 / 1.25e-16)


@pytest.mark.parametrize(
    ("scene", "path"),
    [
        (ul.Scene(ul.Sphere(5e-6), GLUED, ul.Isotropic(3e6, 0.3)), SPRING),
        (ul.Scene(ul.Paraboloid(5e-6), GLUED, ul.RIGID), SHEAR),
        (ul.Scene(ul.Cone(1.2), GLUED, ul.RIGID), E),
        (ul.Scene(MEASURED_TIP, ul.Layer(ul.Isotropic(1e6, 0.4), 3e-6), ON_A_FILM), FILM),
    ],
)
def test_a_step_to_a_body_beside_is_a_share_of_what_has_a_unit(scene, path):
    """Of a number that is no ratio: the step was 1e-6 of its unit, 1e-6 Pa/m of a spring and 1 um of a film."""
    depth = np.linspace(-1e-7, 5e-7, 40)
    forward = Forward.compile(scene, depth, [path], ul.Exact(1e-8), LawStore())
    values = dict(scene.parameters)
    said = forward.jacobian(values, [path])[1][:, 0]
    assert path in forward.laws.slope_ratios
    assert path in forward.similarity.direct
    step = 1e-3 * values[path]
    above, below = (
        forward.reading(values | {path: values[path] + side * step}).force for side in (1.0, -1.0)
    )
    asked = (above - below) / (2.0 * step)
    # The difference as above; kernels of 1e-14 enter the slope said with 1e-8.
    assert np.abs(said - asked).max() < 1e-4 * np.abs(asked).max()


def test_tables_and_a_solved_law_say_the_same_derivative():
    scene = BODIES["stiff"]
    columns = []
    for free in ([E, BASE], [E, BASE, NU]):
        forward = Forward.compile(scene, DEPTH, free, ul.Exact(1e-8), LawStore())
        columns.append(forward.jacobian(dict(scene.parameters), [E, BASE])[1])
        assert forward.laws.is_solved == (NU in free)
    assert columns[0] == pytest.approx(columns[1], rel=1e-5, abs=1e-7 * np.abs(columns[0]).max())


# Far along the valley E h^3 = const of a film on a soft base: beyond the tables, expanded in the radius; the cone's
# contact jumps on the way.
FILMS = {
    "sphere": (ul.Sphere(1e-3), 5e-6, 1e-5, 4.5e-5),
    "paraboloid": (ul.Paraboloid(1e-3), 1e-5, 1e-5, 2e-4),
    "cone": (ul.Cone(1.2217), 5e-6, 1e-3, 7e-5),
}


@pytest.mark.parametrize("name", FILMS)
@pytest.mark.parametrize("path", [E, H, BASE])
def test_a_law_beyond_the_tables_says_its_derivative_as_well(name, path):
    tip, thickness, ratio, deepest = FILMS[name]
    scene = ul.Scene(tip, ul.Layer(ul.Isotropic(1e6, 0.4), thickness), ul.Isotropic(ratio * 1e6, 0.45))
    # Clear of the depth at which the cone's contact jumps: there one disc is rough.
    depth = np.concatenate((np.linspace(0.05, 0.75, 20), np.linspace(0.85, 1.0, 5))) * deepest
    forward = Forward.compile(scene, depth, [E, H, BASE, C], ul.Exact(1e-8), LawStore())
    values = dict(scene.parameters)
    forward.reading(values)
    built = forward.laws.store.built
    said = forward.jacobian(values, [path])[1][:, 0]
    assert forward.laws.store.built == built
    assert "table" not in forward.law_behind(values).reason
    step = 1e-3 * values[path]
    above, below = (
        forward.reading(values | {path: values[path] + side * step}).force for side in (1.0, -1.0)
    )
    asked = (above - below) / (2.0 * step)
    assert np.abs(said - asked).max() < 1e-4 * np.abs(asked).max()


def test_a_fit_of_poissons_ratio_solves_one_law_a_model():
    scene = layer_on(ul.Isotropic(4e6, 0.3))
    found = ul.fit(problem(scene, [E, NU, C], measured(scene)))
    assert found.statistics.laws_built == found.statistics.evaluations
