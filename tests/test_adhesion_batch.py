"""Many parameter sets with adhesion at once: the same as one by one, whatever is beside them; and a posterior."""

from dataclasses import replace

import numpy as np
import pytest

import underlay as ul
from underlay.inference.model.forward_batch import batched_pull_offs, batched_readings
from underlay.mechanics.adhesion.jkr_table import Columns, PunchNodes, Quantity
from underlay.mechanics.adhesion.radius_relation import solve_relation

SCENE = ul.Scene(
    ul.Paraboloid(1e-5),
    ul.Layer(ul.Isotropic(5e3, 0.45), 8e-6),
    ul.RIGID,
    instrument=ul.Instrument(contact_depth=2e-7),
    adhesion=ul.JKR(work=2e-4),
)
DEPTH = np.linspace(2e-6, -1e-6, 60)
ELASTIC = ul.Isotropic(2e4, 0.3)
HALFSPACE = replace(SCENE, layer=ul.Layer(SCENE.layer.material), substrate=None)
RTOL = 1e-8

#: A scene, and what of it varies between the sets.
CASES = {
    "rigid base": (SCENE, ("layer.E", "layer.thickness", "adhesion.work", "indenter.radius")),
    "elastic base": (replace(SCENE, substrate=ELASTIC), ("layer.E", "layer.thickness", "adhesion.work")),
    "free base": (replace(SCENE, substrate=ELASTIC), ("substrate.E", "adhesion.work")),
    "half-space": (HALFSPACE, ("layer.E", "adhesion.work")),
    "sphere": (replace(SCENE, indenter=ul.Sphere(2e-5)), ("layer.E", "adhesion.work")),
    "cone": (replace(SCENE, indenter=ul.Cone(1.3)), ("layer.E", "adhesion.work", "layer.thickness")),
    "work alone": (SCENE, ("adhesion.work",)),
    "contact alone": (SCENE, ("instrument.contact_depth",)),
    "slipping layer": (
        replace(SCENE, layer=ul.Layer(SCENE.layer.material, 8e-6, bond="slip")),
        ("layer.E", "adhesion.work"),
    ),
    "stack": (
        replace(SCENE, substrate=ul.Stack([ul.Layer(ELASTIC, 4e-6)], base=ul.RIGID)),
        ("adhesion.work", "instrument.contact_depth"),
    ),
}


def asked(scene, free, sets=5, solver=None, depth=DEPTH):
    """Compiled model and values of sets of these parameters, up to 40 % off."""
    curve = ul.synthesize(scene, depth, ul.Noise(force=1e-10), rng=0)
    problem = ul.Problem(scene, curve, list(free), ul.Noise(force=1e-10), solver=solver or ul.Exact(RTOL))
    member = problem.members[0]
    spread = np.random.default_rng(1).uniform(0.6, 1.4, (sets, len(free)))
    start = np.array([scene.parameters[path] for path in free])
    return member.forward, member.values_of(start * spread)


@pytest.mark.parametrize("compliance", [0.0, 10.0])
@pytest.mark.parametrize("states", ["separating", "cycle"])
@pytest.mark.parametrize("case", CASES)
def test_sets_together_are_those_one_by_one(case, states, compliance, monkeypatch):
    scene, free = CASES[case]
    instrument = replace(scene.instrument, compliance=compliance)
    scene = replace(scene, adhesion=ul.JKR(2e-4, branch=states), instrument=instrument)
    way = DEPTH if states == "separating" else np.concatenate((DEPTH[::-3], DEPTH[::3]))
    forward, values = asked(scene, free, depth=way)
    single = [
        forward.reading({path: float(v[row]) if np.ndim(v) else v for path, v in values.items()})
        for row in range(5)
    ]
    # From here on no law may be built: the sets come off tables.
    monkeypatch.setattr(type(forward.laws), "law", None)
    together = batched_readings(forward, values, 5)
    assert together.possible.all()
    for row, one in enumerate(single):
        scale = np.abs(one.contact).max()
        np.testing.assert_allclose(together.force[row], one.force, atol=4e-7 * scale)
        loaded = one.contact > 0.1 * scale
        np.testing.assert_allclose(together.stiffness[row, loaded], one.stiffness[loaded], rtol=1e-4)


@pytest.mark.parametrize("case", ["rigid base", "elastic base", "cone"])
def test_a_set_does_not_depend_on_those_beside_it(case):
    forward, values = asked(*CASES[case])
    together = batched_readings(forward, values, 5)
    for row in (0, 3):
        alone = {path: v[row : row + 1] if np.ndim(v) else v for path, v in values.items()}
        found = batched_readings(forward, alone, 1)
        np.testing.assert_array_equal(found.force[0], together.force[row])
        np.testing.assert_array_equal(found.stiffness[0], together.stiffness[row])


def test_a_free_compliance_is_read_off_the_table_too():
    scene = replace(SCENE, instrument=ul.Instrument(contact_depth=2e-7, compliance=10.0))
    forward, values = asked(scene, ("instrument.compliance", "layer.E"))
    found = batched_readings(forward, values, 5)
    for row in range(5):
        one = forward.reading({path: float(v[row]) if np.ndim(v) else v for path, v in values.items()})
        np.testing.assert_allclose(found.force[row], one.force, atol=4e-7 * np.abs(one.force).max())


@pytest.mark.parametrize("case", ["rigid base", "free base", "sphere"])
def test_pull_offs_of_many_sets(case):
    scene, free = CASES[case]
    forward, values = asked(scene, free)
    force, depth = batched_pull_offs(forward, values, 5)
    for row in range(5):
        one = {path: float(values[path][row]) for path in free}
        law = scene.with_values(one).contact_law(0.0, solver=ul.Exact(RTOL))
        assert force[row] == pytest.approx(law.pull_off_force, rel=1e-7)
        assert depth[row] == pytest.approx(law.pull_off_depth, rel=1e-7)


def test_what_no_table_holds_goes_one_by_one():
    """A fold, a flat punch, DMT, Maugis, and adhesion too small to matter."""
    cone = replace(SCENE, indenter=ul.Cone(0.8), substrate=ul.Isotropic(50.0, 0.3), adhesion=ul.JKR(1e-6))
    punch = replace(SCENE, indenter=ul.FlatPunch(2e-6))
    small = replace(SCENE, adhesion=ul.JKR(1e-14))
    for scene in (cone, punch, replace(SCENE, adhesion=ul.DMT(1e-4)), small):
        forward, values = asked(scene, ("adhesion.work",), sets=2, solver=ul.Exact(1e-6))
        found = batched_readings(forward, values, 2)
        for row in range(2):
            one = forward.reading({path: float(v[row]) if np.ndim(v) else v for path, v in values.items()})
            np.testing.assert_allclose(found.force[row], one.force, atol=1e-6 * np.abs(one.force).max())


def test_a_set_that_is_no_contact_is_not_possible():
    forward, values = asked(SCENE, ("adhesion.work", "layer.E"), sets=3)
    values["adhesion.work"] = np.array([2e-4, 1e9, 1e-4])
    assert batched_readings(forward, values, 3).possible.tolist() == [True, False, True]


@pytest.mark.parametrize("which", list(Quantity))
def test_tables_between_their_nodes(which):
    """Cubics with exact slopes: the error is below the 1e-8 that is claimed, and the slope's below 1e-6."""
    contact, end = replace(SCENE, substrate=ELASTIC).contact, 2.4e-5
    relation = solve_relation(contact, end, 1e-11)
    nodes = PunchNodes.of(relation, end)
    log_radius = np.log(end) - np.linspace(0.013, 6.0, 301)
    value, slope = Columns(nodes, np.zeros(301, dtype=int), log_radius).at(which)
    radius = np.exp(log_radius)
    here, theta = relation.at(radius), relation.theta
    stiffness = 4.0 * theta * radius * here.kappa
    exact = {
        Quantity.DEPTH: (here.depth, radius * here.depth_slope),
        Quantity.PULL: (
            pull := np.sqrt(np.pi * radius / theta) / here.edge,
            pull * (0.5 - radius * here.edge_rate),
        ),
        Quantity.FORCE: (here.force, radius * stiffness * here.depth_slope),
        Quantity.STIFFNESS: (stiffness, stiffness * here.edge**2 / here.kappa),
    }[which]
    np.testing.assert_allclose(value, exact[0], rtol=1e-8)
    np.testing.assert_allclose(slope, exact[1], rtol=2e-6)


def test_the_posterior_of_modulus_thickness_and_work():
    """From a curve to draws: where the fit is, as wide as it says, with the pull-off beside them.

    A short chain with weighted draws beside it: were it 40 autocorrelation times of 16 walkers alone, a median
    would be known to 0.1 standard errors and a width to a tenth; the bounds are three times as much.
    """
    noise = ul.Noise(force=1e-10)
    free = {
        "layer.E": ul.LogUniform(1e2, 1e6),
        "layer.thickness": ul.LogUniform(1e-6, 1e-4),
        "adhesion.work": ul.LogUniform(1e-6, 1e-1),
    }
    problem = ul.Problem(SCENE, ul.synthesize(SCENE, DEPTH, noise, rng=3), free, noise)
    fit = ul.fit(problem, start="given")
    post = ul.sample(problem, walkers=16, max_steps=250, rng=0, progress=False)
    assert post.converged
    assert post.diagnostics.failures == 0
    summary = post.summary(derived=True)
    for path in free:
        row = summary.loc[path]
        assert abs(row["median"] - fit.values[path]) < 0.3 * fit.stderr[path]
        width = 0.5 * (row["hdi68_high"] - row["hdi68_low"])
        assert width == pytest.approx(fit.stderr[path], rel=0.25)
        assert abs(row["median"] - SCENE.parameters[path]) < 4.0 * fit.stderr[path]
    law = fit.scenes[0].contact_law(0.0)
    for name, value in (("pull_off_force", law.pull_off_force), ("pull_off_depth", law.pull_off_depth)):
        assert summary.loc[f"adhesion.{name}", "median"] == pytest.approx(value, rel=0.01)
