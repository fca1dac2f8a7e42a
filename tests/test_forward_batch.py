"""Many parameter sets at once give what each gives alone."""

import numpy as np
import pytest

import underlay as ul
from underlay.inference.model import forward_batch, parameter_sets

DEPTH = np.linspace(-1e-5, 1e-4, 30)
CURVE = ul.Curve(DEPTH, np.maximum(DEPTH, 0.0), time=np.arange(30.0))
SOFT = ul.Isotropic(1e6, 0.45)
LAYER = ul.Layer(SOFT, 5e-4)
CONTACT = {"instrument.contact_depth": ul.Normal(0.0, 2e-6)}
E = {"layer.E": ul.LogUniform(1e5, 1e7)}
THICKNESS = {"layer.thickness": ul.LogUniform(3e-4, 2e-3)}
BASE = {"substrate.E": ul.LogUniform(1e5, 1e8)}
NU = {"layer.nu": ul.Uniform(0.3, 0.5)}

#: scene, free parameters, and whether the sets must not be taken one by one.
CASES = {
    "half-space": (ul.Scene(ul.Paraboloid(1e-3), ul.Layer(SOFT)), E | CONTACT, True),
    "rigid": (ul.Scene(ul.Paraboloid(1e-3), LAYER, ul.RIGID), E | THICKNESS | CONTACT, True),
    "rigid, radius": (
        ul.Scene(ul.Paraboloid(1e-3), LAYER, ul.RIGID),
        E | THICKNESS | {"indenter.radius": ul.Normal(1e-3, 5e-5)},
        True,
    ),
    "rigid, nu": (ul.Scene(ul.Paraboloid(1e-3), LAYER, ul.RIGID), E | THICKNESS | NU, True),
    "elastic": (
        ul.Scene(ul.Paraboloid(1e-3), LAYER, ul.Isotropic(1e7, 0.3)),
        E | THICKNESS | BASE | CONTACT | {"substrate.nu": ul.Uniform(0.2, 0.5)},
        True,
    ),
    "elastic, radius": (
        ul.Scene(ul.Paraboloid(1e-3), LAYER, ul.Isotropic(1e7, 0.3)),
        E | BASE | {"indenter.radius": ul.Normal(1e-3, 5e-5)},
        True,
    ),
    "cone": (
        ul.Scene(ul.Cone(1.2), LAYER, ul.Isotropic(1e7, 0.3)),
        E | BASE | {"indenter.half_angle": ul.Normal(1.2, 0.02)},
        True,
    ),
    "power": (ul.Scene(ul.PowerLaw(3.0, 4e5), LAYER, ul.Isotropic(1e7, 0.3)), E | BASE | NU, True),
    "sphere": (
        ul.Scene(ul.Sphere(1e-3), LAYER, ul.Isotropic(1e7, 0.3)),
        E | THICKNESS | BASE | CONTACT,
        True,
    ),
    "sphere, radius": (
        ul.Scene(ul.Sphere(1e-3), LAYER, ul.RIGID),
        E | THICKNESS | {"indenter.radius": ul.Normal(1e-3, 5e-5)},
        True,
    ),
    "baseline": (
        ul.Scene(ul.Paraboloid(1e-3), LAYER, ul.RIGID),
        E | {"instrument.baseline": ul.Normal(0.0, 1e-3), "instrument.baseline_slope": ul.Normal(0.0, 1.0)},
        True,
    ),
    "compliance": (
        ul.Scene(ul.Paraboloid(1e-3), LAYER, ul.RIGID, ul.Instrument(compliance=1e-5)),
        E | {"instrument.compliance": ul.LogUniform(1e-6, 1e-4)},
        True,
    ),
    "anisotropic": (
        ul.Scene(
            ul.Paraboloid(1e-3), ul.Layer(ul.TransverselyIsotropic(1e6, 5e5, 0.3, 0.2, 3e5), 5e-4), ul.RIGID
        ),
        E | {"layer.G_axial": ul.LogUniform(1e5, 1e6)},
        False,
    ),
    "punch": (ul.Scene(ul.FlatPunch(5e-4), LAYER, ul.Isotropic(1e7, 0.3)), E | BASE, False),
}


def draws(problem, count, seed=0):
    rng = np.random.default_rng(seed)
    return np.column_stack([prior.sample(rng, count) for prior in problem.priors.values()])


@pytest.mark.parametrize("rtol", [1e-4, 1e-6])
@pytest.mark.parametrize("name", CASES)
def test_a_batch_is_its_members(name, rtol, monkeypatch):
    scene, free, together = CASES[name]
    problem = ul.Problem(scene, CURVE, free, ul.Noise(force=1e-3), solver=ul.Auto(rtol))
    member = problem.members[0]
    physical = draws(problem, 40)
    alone = []

    def counted(forward, values, readings, **options):
        alone.extend(np.flatnonzero(~readings.possible))
        return parameter_sets.set_by_set(forward, values, readings, **options)

    monkeypatch.setattr(forward_batch, "set_by_set", counted)
    batch = member.readings(physical)
    # A few sets, on very soft bases, are too coarse on the nodes of their group and go alone.
    assert len(alone) <= 8 if together else len(alone) == 40
    for row, vector in enumerate(physical):
        try:
            one = member.reading(vector)
        except ul.InputError:
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
    curve = ul.Curve(depth, np.maximum(depth, 0.0))
    substrate = ul.Isotropic(1e7, 0.3) if base is BASE else ul.RIGID
    scene = ul.Scene(ul.Sphere(1e-3), ul.Layer(SOFT, 1.5e-3), substrate)
    problem = ul.Problem(scene, curve, E | base | CONTACT, ul.Noise(force=1e-3), solver=ul.Auto(rtol))
    member, physical = problem.members[0], draws(problem, 12)
    alone = np.array([member.reading(vector).contact for vector in physical])
    monkeypatch.setattr(forward_batch, "set_by_set", lambda *asked, **_: asked[2])
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
    problem = ul.Problem(scene, CURVE, free, ul.Noise(force=1e-3), solver=ul.Auto(1e-4))
    member, physical = problem.members[0], draws(problem, 24)
    together = member.readings(physical)
    fresh = ul.Problem(scene, CURVE, free, ul.Noise(force=1e-3), solver=ul.Auto(1e-4)).members[0]
    for row in (23, 5, 11):
        alone = fresh.readings(physical[row : row + 1])
        # The nodes are the same; the order of sums inside matrix products is not, and the condition of the
        # problem on a soft base, up to 1e3 twice over, is what that rounding is multiplied by.
        np.testing.assert_allclose(alone.contact[0], together.contact[row], rtol=1e-7)


def test_sets_without_a_law_do_not_spoil_the_others():
    scene = ul.Scene(ul.Paraboloid(1e-3), LAYER, ul.Isotropic(1e7, 0.3))
    problem = ul.Problem(
        scene, CURVE, E | {"layer.thickness": ul.LogUniform(1e-6, 1e-2)}, ul.Noise(force=1e-3)
    )
    member = problem.members[0]
    physical = np.array([[1e6, 1e-3], [1e6, 2e-6], [2e6, 5e-4]])
    with pytest.raises(ul.InputError):
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
    member = ul.Problem(scene, CURVE, free, ul.Noise(force=1e-3)).members[0]
    physical = draws(ul.Problem(scene, CURVE, free, ul.Noise(force=1e-3)), 4)
    assert not member.readings(physical, stiffness=False).stiffness.any()
    assert member.readings(physical).stiffness.any()
