"""Stacks with unknowns: one comes from tables, with its derivative; several are solved for many sets at once.

End to end: fits of many curves, posteriors, what a test can tell, and which test would tell.
"""

from dataclasses import replace

import numpy as np
import pytest

import underlay as ul
from underlay.inference.model.forward import Forward
from underlay.inference.model.forward_batch import batched_readings
from underlay.inference.model.laws import LawStore

FILM = ul.Scene(
    ul.Paraboloid(50e-6),
    ul.Layer(ul.Isotropic(1e6, 0.3), 20e-6),
    ul.Stack([ul.Layer(ul.Isotropic(3e6, 0.49), 10e-6)], ul.Isotropic(7e10, 0.2)),
)
LOOSE = replace(FILM, layer=replace(FILM.layer, bond="slip"))
DEPTH = np.linspace(-1e-6, 4e-6, 40)
UNKNOWNS = {
    "layer.E": 1e6,
    "layer.thickness": 20e-6,
    "substrate.E": 7e10,
    "substrate.layers[0].E": 3e6,
    "substrate.layers[0].thickness": 10e-6,
}


def compiled(scene, *free, rtol=1e-5):
    return Forward.compile(scene, DEPTH, free, ul.Exact(rtol), LawStore())


@pytest.mark.parametrize("scene", [FILM, LOOSE], ids=["bonded", "slip"])
@pytest.mark.parametrize("path", UNKNOWNS)
def test_laws_of_one_unknown_are_read_off_a_table(scene, path):
    forward = compiled(scene, path)
    for factor in (0.3, 1.0, 2.7):
        values = scene.with_values({path: factor * UNKNOWNS[path]}).parameters
        law = forward.law(values, float(DEPTH[-1])).inner
        assert "tabulated" in law.reason
        solved = scene.with_values(values).force(DEPTH, solver=ul.Exact(1e-9))
        np.testing.assert_allclose(forward.reading(values).force, solved, rtol=1e-5)


@pytest.mark.parametrize("path", UNKNOWNS)
def test_a_table_knows_its_derivative(path):
    forward = compiled(FILM, path)
    value = UNKNOWNS[path]
    _, columns = forward.jacobian(FILM.parameters, (path,))
    up, down = (
        FILM.with_values({path: value * np.exp(s)}).force(DEPTH, solver=ul.Exact(1e-9)) for s in (1e-3, -1e-3)
    )
    # The difference errs by 1e-6 of the third derivative and by 1e-9/1e-3 of the force, the table by its rtol.
    np.testing.assert_allclose(columns[:, 0] * value, (up - down) / 2e-3, atol=3e-5 * up.max())


@pytest.mark.parametrize("path", UNKNOWNS)
def test_many_sets_are_answered_as_each_alone(path):
    forward = compiled(FILM, path, "instrument.contact_depth")
    rng = np.random.default_rng(1)
    values = FILM.parameters | {
        path: UNKNOWNS[path] * np.exp(rng.normal(0.0, 0.7, 12)),
        "instrument.contact_depth": rng.normal(0.0, 3e-7, 12),
    }
    together = batched_readings(forward, values, 12)
    assert together.possible.all()
    for row in range(12):
        own = {name: float(v[row]) if np.ndim(v) else v for name, v in values.items()}
        alone = forward.reading(own)
        np.testing.assert_allclose(together.force[row], alone.force, rtol=1e-12, atol=1e-18)
        np.testing.assert_allclose(together.stiffness[row], alone.stiffness, rtol=1e-12)


def test_tables_do_not_ask_where_a_fit_starts():
    families = [
        compiled(FILM.with_values({"layer.E": E}), "layer.E").laws.table.family for E in (1e5, 1e6, 2.2e6)
    ]
    assert families[0] == families[1] == families[2]
    assert len({hash(family) for family in families}) == 1


SOFT = replace(FILM, substrate=ul.Stack([ul.Layer(ul.Isotropic(1e4, 0.49), 10e-6)], ul.Isotropic(1e9, 0.3)))


@pytest.mark.parametrize("rtol", [1e-3, 1e-6])
@pytest.mark.parametrize("scene", [FILM, SOFT, LOOSE], ids=["stiff", "soft", "slip"])
def test_several_unknowns_are_solved_for_together(scene, rtol):
    free = ("layer.E", "layer.thickness", "substrate.layers[0].E")
    forward = compiled(scene, *free, rtol=rtol)
    rng = np.random.default_rng(3)
    varied = {path: scene.parameters[path] * np.exp(rng.normal(0.0, 0.1, 16)) for path in free}
    readings = batched_readings(forward, scene.parameters | varied, 16)
    assert readings.possible.all()
    assert forward.laws.store.built <= 1  # laws of single sets
    for row in range(0, 16, 5):
        own = scene.with_values({path: float(values[row]) for path, values in varied.items()})
        expected = own.force(DEPTH, solver=ul.Exact(1e-9))
        np.testing.assert_allclose(readings.force[row], expected, rtol=rtol)


def test_a_set_is_answered_the_same_in_any_company():
    forward = compiled(FILM, "layer.E", "layer.thickness")
    varied = {"layer.E": np.array([1e6, 3e5, 1.05e6]), "layer.thickness": np.array([2e-5, 3e-5, 2.1e-5])}
    together = batched_readings(forward, FILM.parameters | varied, 3)
    alone = batched_readings(forward, FILM.parameters | {path: v[2:] for path, v in varied.items()}, 1)
    np.testing.assert_allclose(together.force[2], alone.force[0], rtol=1e-14)


@pytest.mark.parametrize("free", [("substrate.layers[0].nu",), ("layer.E", "layer.nu")])
def test_a_poissons_ratio_is_solved_for_set_by_set(free):
    forward = compiled(FILM, *free)
    assert forward.laws.table is None
    varied = {path: np.array([1.0, 1.01]) * FILM.parameters[path] for path in free}
    readings = batched_readings(forward, FILM.parameters | varied, 2)
    assert readings.possible.all()
    assert forward.laws.store.built == 2
    expected = FILM.with_values({path: v[1] for path, v in varied.items()}).force(
        DEPTH, solver=ul.Exact(1e-9)
    )
    np.testing.assert_allclose(readings.force[1], expected, rtol=1e-5)


def test_a_slipping_layer_on_a_rigid_base_needs_one_law():
    scene = ul.Scene(FILM.indenter, LOOSE.layer, ul.RIGID)
    forward = compiled(scene, "layer.E", "layer.thickness")
    values = scene.parameters | {
        "layer.E": np.array([1e5, 1e6, 3e7]),
        "layer.thickness": np.array([2e-5, 3e-5, 2e-5]),
    }
    readings = batched_readings(forward, values, 3)
    assert readings.possible.all()
    assert forward.laws.store.built <= 2
    for row in (0, 1):
        own = scene.with_values({name: float(values[name][row]) for name in ("layer.E", "layer.thickness")})
        np.testing.assert_allclose(readings.force[row], own.force(DEPTH, solver=ul.Exact(1e-8)), rtol=1e-5)


# --- end to end -------------------------------------------------------------------------------------------

FREE = {"layer.E": ul.LogUniform(1e4, 1e8), "instrument.contact_depth": ul.Uniform(-2e-6, 2e-6)}
NOISE = ul.Noise(force=0.005 * float(FILM.force(4e-6)))


def measured(scene=FILM, rng=1):
    return ul.synthesize(scene, DEPTH, NOISE, rng=rng)


def test_a_posterior_of_a_stack_agrees_with_its_fit():
    free = {"layer.E": FREE["layer.E"]}
    problem = ul.Problem(FILM, measured(), free=free, noise=NOISE, solver=ul.Exact(1e-4))
    fit, post = ul.fit(problem), ul.sample(problem, walkers=16, max_steps=2000, rng=0)
    told = post.summary().loc["layer.E"]
    assert abs(told["median"] - fit.values["layer.E"]) < 0.5 * fit.stderr["layer.E"]
    width = 0.5 * (told["hdi68_high"] - told["hdi68_low"])
    assert width == pytest.approx(fit.stderr["layer.E"], rel=0.25)


def test_a_map_of_a_stack():
    truths = (3e5, 1e6, 4e6)
    curves = [measured(FILM.with_values({"layer.E": E}), rng) for rng, E in enumerate(truths)]
    table = ul.fit_many(curves, FILM, free=FREE, workers=0)
    assert table["status"].tolist() == ["fitted"] * 3
    deviations = (table["layer.E.stat.high"] - table["layer.E.stat.low"]) / 3.92
    assert (abs(table["layer.E"] - np.array(truths)) < 4.0 * deviations).all()
    alone = ul.fit(ul.Problem(FILM, curves[1], free=FREE))
    # Each search leaves a thousandth of a standard error at most.
    assert abs(table["layer.E"][1] - alone.values["layer.E"]) < 2e-3 * deviations[1]


def test_what_a_test_of_a_stack_can_tell():
    deeper = {"substrate.layers[0].E": ul.LogUniform(1e5, 1e8), **FREE}
    known, both = (
        ul.identifiability(ul.Problem(FILM, measured(), free=f, noise=NOISE)) for f in (FREE, deeper)
    )
    assert [entry.formula for entry in known.combinations] == ["layer.E"]
    # A second modulus hangs together with the first: the best product is known as well, each alone is not.
    best, worst = (both.combinations[place].relative_sd for place in (0, -1))
    assert best < 1.2 * known.combinations[0].relative_sd
    assert worst > 3.0 * best


def test_which_test_of_a_stack_would_tell():
    plan = ul.plan(
        FILM,
        free=["substrate.layers[0].E", "instrument.contact_depth"],
        noise=NOISE,
        radii=[2e-5, 2e-4],
        depths=[5e-7, 4e-6],
        parameter="substrate.layers[0].E",
    )
    # What lies under the film is seen by wide contacts.
    assert plan.stderr[1, 1] == plan.stderr.min()
    assert plan.stderr[0, 0] == plan.stderr.max()
