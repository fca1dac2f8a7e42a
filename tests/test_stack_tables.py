"""Stacks with one unknown: their laws come from tables, one by one and many at once, with their derivative."""

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
        law = forward.law(values, float(DEPTH[-1])).law
        assert "tabulated" in law.reason
        solved = scene.with_values(values).force(DEPTH, solver=ul.Exact(1e-9))
        np.testing.assert_allclose(forward.force(values), solved, rtol=1e-5)


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


@pytest.mark.parametrize(
    "free", [("layer.E", "layer.thickness"), ("substrate.layers[0].nu",), ("layer.E", "layer.nu")]
)
def test_what_is_no_single_ratio_is_solved_for(free):
    forward = compiled(FILM, *free)
    assert forward.laws.table is None
    values = FILM.parameters | {path: np.array([1.0, 1.01]) * FILM.parameters[path] for path in free[:1]}
    readings = batched_readings(forward, values, 2)
    assert readings.possible.all()
    expected = FILM.with_values({free[0]: values[free[0]][1]}).force(DEPTH, solver=ul.Exact(1e-9))
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
