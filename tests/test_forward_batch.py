"""Many parameter sets at once give what each gives alone."""

import numpy as np
import pytest

from underlay.data.curve import Curve
from underlay.errors import InputError
from underlay.inference.model import forward_batch, ratio_batch
from underlay.inference.model import forward_batch as adhesion_batch
from underlay.inference.model import groups as batch_readings
from underlay.inference.priors import LogUniform, Normal, Uniform
from underlay.inference.problem import Problem
from underlay.mechanics.body import RIGID, Layer
from underlay.mechanics.indenters import Cone, FlatPunch, Paraboloid, PowerLaw, Sphere
from underlay.mechanics.materials import Isotropic, TransverselyIsotropic
from underlay.mechanics.solvers import Auto
from underlay.scene.instrument import Instrument
from underlay.scene.noise import Noise
from underlay.scene.scene import Scene

DEPTH = np.linspace(-1e-5, 1e-4, 30)
CURVE = Curve(DEPTH, np.maximum(DEPTH, 0.0), time=np.arange(30.0))
SOFT = Isotropic(1e6, 0.45)
LAYER = Layer(SOFT, 5e-4)
CONTACT = {"instrument.contact_depth": Normal(0.0, 2e-6)}
E = {"layer.E": LogUniform(1e5, 1e7)}
THICKNESS = {"layer.thickness": LogUniform(3e-4, 2e-3)}
BASE = {"substrate.E": LogUniform(1e5, 1e8)}
NU = {"layer.nu": Uniform(0.3, 0.5)}

#: scene, free parameters, and whether the sets must not be taken one by one.
CASES = {
    "half-space": (Scene(Paraboloid(1e-3), Layer(SOFT)), E | CONTACT, True),
    "rigid": (Scene(Paraboloid(1e-3), LAYER, RIGID), E | THICKNESS | CONTACT, True),
    "rigid, radius": (
        Scene(Paraboloid(1e-3), LAYER, RIGID),
        E | THICKNESS | {"indenter.radius": Normal(1e-3, 5e-5)},
        True,
    ),
    "rigid, nu": (Scene(Paraboloid(1e-3), LAYER, RIGID), E | THICKNESS | NU, True),
    "elastic": (
        Scene(Paraboloid(1e-3), LAYER, Isotropic(1e7, 0.3)),
        E | THICKNESS | BASE | CONTACT | {"substrate.nu": Uniform(0.2, 0.5)},
        True,
    ),
    "elastic, radius": (
        Scene(Paraboloid(1e-3), LAYER, Isotropic(1e7, 0.3)),
        E | BASE | {"indenter.radius": Normal(1e-3, 5e-5)},
        True,
    ),
    "cone": (
        Scene(Cone(1.2), LAYER, Isotropic(1e7, 0.3)),
        E | BASE | {"indenter.half_angle": Normal(1.2, 0.02)},
        True,
    ),
    "power": (Scene(PowerLaw(3.0, 4e5), LAYER, Isotropic(1e7, 0.3)), E | BASE | NU, True),
    "sphere": (Scene(Sphere(1e-3), LAYER, Isotropic(1e7, 0.3)), E | THICKNESS | BASE | CONTACT, True),
    "sphere, radius": (
        Scene(Sphere(1e-3), LAYER, RIGID),
        E | THICKNESS | {"indenter.radius": Normal(1e-3, 5e-5)},
        False,
    ),
    "baseline": (
        Scene(Paraboloid(1e-3), LAYER, RIGID),
        E | {"instrument.baseline": Normal(0.0, 1e-3), "instrument.baseline_slope": Normal(0.0, 1.0)},
        True,
    ),
    "compliance": (
        Scene(Paraboloid(1e-3), LAYER, RIGID, Instrument(compliance=1e-5)),
        E | {"instrument.compliance": LogUniform(1e-6, 1e-4)},
        False,
    ),
    "anisotropic": (
        Scene(Paraboloid(1e-3), Layer(TransverselyIsotropic(1e6, 5e5, 0.3, 0.2, 3e5), 5e-4), RIGID),
        E | {"layer.G_axial": LogUniform(1e5, 1e6)},
        False,
    ),
    "punch": (Scene(FlatPunch(5e-4), LAYER, Isotropic(1e7, 0.3)), E | BASE, False),
}


def draws(problem, count, seed=0):
    rng = np.random.default_rng(seed)
    return np.column_stack([prior.sample(rng, count) for prior in problem.priors.values()])


def replace_set_by_set(monkeypatch, other):
    """Another way for the sets that no batch takes."""
    for module in (adhesion_batch, forward_batch, ratio_batch):
        monkeypatch.setattr(module, "set_by_set", other)


@pytest.mark.parametrize("rtol", [1e-4, 1e-6])
@pytest.mark.parametrize("name", CASES)
def test_a_batch_is_its_members(name, rtol, monkeypatch):
    scene, free, together = CASES[name]
    problem = Problem(scene, CURVE, free, Noise(force=1e-3), solver=Auto(rtol))
    member = problem.members[0]
    physical = draws(problem, 40)
    alone = []

    def counted(forward, values, rows, readings):
        alone.extend(rows)
        return batch_readings.set_by_set(forward, values, rows, readings)

    replace_set_by_set(monkeypatch, counted)
    batch = member.readings(physical)
    # A few sets, on very soft bases, are too coarse on the nodes of their group and go alone.
    assert len(alone) <= 8 if together else len(alone) == 40
    for row, vector in enumerate(physical):
        try:
            one = member.reading(vector)
        except InputError:
            assert not batch.possible[row]
            continue
        assert batch.possible[row]
        top = np.abs(one.contact).max()
        # Each keeps rtol against the exact contact problem, so they agree within two.
        np.testing.assert_allclose(batch.contact[row], one.contact, rtol=2 * rtol, atol=1e-12 * top)
        np.testing.assert_allclose(
            batch.stiffness[row], one.stiffness, rtol=2 * rtol, atol=1e-12 * top / 1e-4
        )
        np.testing.assert_allclose(batch.force[row], one.force, rtol=2 * rtol, atol=2 * rtol * top)


@pytest.mark.parametrize("rtol", [1e-4, 1e-6])
@pytest.mark.parametrize("base", [THICKNESS, BASE])
def test_a_sphere_is_read_off_a_surface_up_to_near_its_end(rtol, base, monkeypatch):
    # The contact is six tenths as wide as the sphere: groups of like thickness and range reached past its end.
    depth = np.linspace(-1e-5, 3e-4, 30)
    curve = Curve(depth, np.maximum(depth, 0.0))
    substrate = Isotropic(1e7, 0.3) if base is BASE else RIGID
    scene = Scene(Sphere(1e-3), Layer(SOFT, 1.5e-3), substrate)
    problem = Problem(scene, curve, E | base | CONTACT, Noise(force=1e-3), solver=Auto(rtol))
    member, physical = problem.members[0], draws(problem, 12)
    alone = np.array([member.reading(vector).contact for vector in physical])
    replace_set_by_set(monkeypatch, lambda *asked: asked[-1])
    batch = member.readings(physical, stiffness=False)
    assert batch.possible.all()
    top = np.abs(alone).max(axis=1, keepdims=True)
    np.testing.assert_array_less(np.abs(batch.contact - alone), 2 * rtol * alone + 1e-12 * top)
    assert member.forward.laws.store.surfaces
    # No set minds the company it is asked in, but for how a product of matrices of so many rows rounds.
    again = member.readings(physical[5:6], stiffness=False)
    np.testing.assert_allclose(again.contact[0], batch.contact[5], rtol=1e-14)


def test_a_set_does_not_depend_on_its_company():
    scene, free, _ = CASES["elastic"]
    problem = Problem(scene, CURVE, free, Noise(force=1e-3), solver=Auto(1e-4))
    member, physical = problem.members[0], draws(problem, 24)
    together = member.readings(physical)
    fresh = Problem(scene, CURVE, free, Noise(force=1e-3), solver=Auto(1e-4)).members[0]
    for row in (23, 5, 11):
        alone = fresh.readings(physical[row : row + 1])
        # The nodes are the same; the order of sums inside matrix products is not, and the condition of the
        # problem on a soft base, up to 1e3 twice over, is what that rounding is multiplied by.
        np.testing.assert_allclose(alone.contact[0], together.contact[row], rtol=1e-7)


def test_sets_without_a_law_do_not_spoil_the_others():
    scene = Scene(Paraboloid(1e-3), LAYER, Isotropic(1e7, 0.3))
    problem = Problem(scene, CURVE, E | {"layer.thickness": LogUniform(1e-6, 1e-2)}, Noise(force=1e-3))
    member = problem.members[0]
    physical = np.array([[1e6, 1e-3], [1e6, 2e-6], [2e6, 5e-4]])
    with pytest.raises(InputError):
        member.reading(physical[1])
    readings = member.readings(physical)
    np.testing.assert_array_equal(readings.possible, [True, False, True])
    np.testing.assert_allclose(readings.contact[2], member.reading(physical[2]).contact, rtol=2e-6)
    likelihood = problem.log_likelihood(
        np.stack([problem.vector(dict(zip(problem.names, row, strict=True))) for row in physical])
    )
    np.testing.assert_array_equal(np.isfinite(likelihood), [True, False, True])


def test_stiffness_only_where_asked():
    scene, free, _ = CASES["elastic"]
    member = Problem(scene, CURVE, free, Noise(force=1e-3)).members[0]
    physical = draws(Problem(scene, CURVE, free, Noise(force=1e-3)), 4)
    assert not member.readings(physical, stiffness=False).stiffness.any()
    assert member.readings(physical).stiffness.any()
