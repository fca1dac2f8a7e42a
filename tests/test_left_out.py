"""What the law leaves out: its size where it was measured, the second interval, and what is said of it."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from scipy import optimize

import underlay as ul
from underlay.inference.uncertainty.known_errors import Pressed, left_out
from underlay.mechanics.discrepancy import finite_strain_excess, friction_in_large_strains, why_unmeasured

PAGE = Path(__file__).parents[1] / ".reference" / "pages" / "models.md"
BALL = ul.Scene(ul.Sphere(1e-3), ul.Layer(ul.Isotropic(1e6, 0.49), 5e-4), ul.RIGID)

# Finite elements over the linear law of the same sphere (model-error table): nu, h/R, then P/P_linear by w/R.
NEO_HOOKEAN = {
    (0.3, np.inf): {0.05: 1.019, 0.1: 1.027, 0.2: 1.040, 0.3: 1.051},
    (0.3, 2.0): {0.05: 1.023, 0.1: 1.037, 0.2: 1.063, 0.3: 1.090, 0.5: 1.145},
    (0.3, 1.0): {0.05: 1.028, 0.1: 1.054, 0.2: 1.109, 0.3: 1.169},
    (0.3, 0.5): {0.05: 1.052, 0.1: 1.104},
    (0.49, np.inf): {0.05: 0.988, 0.1: 0.984, 0.2: 0.976, 0.3: 0.970},
    (0.49, 2.0): {0.05: 0.988, 0.1: 0.982, 0.2: 0.975, 0.3: 0.970, 0.5: 0.959},
    (0.49, 1.0): {0.05: 0.987, 0.1: 0.986, 0.2: 0.987, 0.3: 0.987},
    (0.49, 0.5): {0.05: 0.996, 0.1: 1.000},
}


def contact(nu: float, ratio: float, tip: type[ul.Sphere | ul.Paraboloid] = ul.Sphere) -> ul.Contact:
    base = ul.RIGID if np.isfinite(ratio) else None
    return ul.Contact.of(tip(1.0), ul.Layer(ul.Isotropic(1.0, nu), ratio), base)


@pytest.mark.parametrize(("nu", "ratio"), NEO_HOOKEAN)
def test_the_function_meets_finite_elements_to_two_per_cent(nu: float, ratio: float) -> None:
    table = NEO_HOOKEAN[nu, ratio]
    here, depth = contact(nu, ratio), np.array(list(table))
    law = ul.Exact().law(here, float(depth.max()))
    known = [not why_unmeasured(here, float(w)) for w in depth]
    excess = finite_strain_excess(here, depth, law.contact_radius(depth))
    assert all(known)
    assert 1.0 + excess == pytest.approx(np.array(list(table.values())), abs=0.022)


def test_it_is_nil_at_contact_and_before() -> None:
    depth, radius = np.array([-1.0, 0.0]), np.zeros(2)
    assert finite_strain_excess(contact(0.3, 1.0), depth, radius) == pytest.approx(0.0, abs=0.0)


@pytest.mark.parametrize(
    ("scene", "depth", "words"),
    [
        (BALL, 2e-4, "depths up to 0.3 h; here 0.4 h"),
        (replace(BALL, layer=ul.Layer(ul.Isotropic(1e6, 0.2), 5e-4)), 1e-4, "nu from 0.3; here 0.2"),
        (replace(BALL, layer=ul.Layer(ul.Isotropic(1e6, 0.4), 4e-4)), 1e-4, "layers from 0.5 R thick"),
        (replace(BALL, layer=ul.Layer(ul.Isotropic(1e6, 0.4), 1e-2)), 6e-4, "depths up to 0.5 R; here 0.6 R"),
        (replace(BALL, indenter=ul.Cone(1.2)), 1e-5, "spheres on one isotropic layer"),
        (replace(BALL, substrate=ul.Isotropic(1e7, 0.3)), 1e-5, "rigid bases"),
    ],
)
def test_finite_strain_asked_outside_its_range_is_refused_with_the_range(
    scene: ul.Scene, depth: float, words: str
) -> None:
    with pytest.raises(ul.InputError, match=f"beyond what is known here: .*{words}"):
        left_out(replace(scene, finite_strain=True), depth)
    assert any(words in told for told in left_out(scene, depth).unknown)
    assert not left_out(replace(scene, finite_strain=False), depth).unknown


def test_a_problem_that_asks_for_finite_strain_outside_its_range_is_refused() -> None:
    scene = replace(BALL, finite_strain=True)
    curve = ul.simulate(scene, np.linspace(0.0, 2e-4, 20))
    with pytest.raises(ul.InputError, match=r"depths up to 0\.3 h; here 0\.4 h"):
        ul.Problem(scene, curve, free={"layer.E": None})


def test_a_scene_that_says_more_is_believed() -> None:
    told = left_out(replace(BALL, friction="none", finite_strain=False), 1e-4)
    assert told.errors == ()
    assert told.declared == ('friction = "none"', "finite_strain = false")
    words = [error.words for error in left_out(BALL, 1e-4).errors]
    assert words == ["friction", "finite strain", "friction in large strains"]
    slides = left_out(replace(BALL, friction="none"), 1e-4)
    assert [error.words for error in slides.errors] == ["finite strain"]


STORED = Path(__file__).parent / "studies" / "results"
CURVES = [pd.read_csv(STORED / f"finite_element_curves_{nu}.csv") for nu in (0.3, 0.49)]


@pytest.mark.parametrize(
    ("table", "ratio"), [(table, ratio) for table in (0, 1) for ratio in (0.5, 1.0, 2.0)]
)
def test_what_friction_adds_in_large_strains_lies_within_its_prior(table: int, ratio: float) -> None:
    """Of finite elements, stuck over sliding, what small strains do not have; to two standard deviations."""
    own = CURVES[table]
    own = own[own["h/R"] == ratio].pivot_table(index="w/h", columns="stuck", values="P/(E h^2)").dropna()
    own = own[own.index >= 0.1]
    depth = own.index.to_numpy()
    nu = float(CURVES[table]["nu"].iloc[0])
    scene = ul.Scene(ul.Sphere(1.0 / ratio), ul.Layer(ul.Isotropic(1.0, nu), 1.0), ul.RIGID)
    law = scene.contact_law(0.3)
    pressed = Pressed(scene.parameters, law, depth, law.force(depth), law.stiffness(depth), scene)
    friction, _, both = left_out(scene, 0.2).errors
    small, column = (error.column(pressed) / pressed.force for error in (friction, both))
    amplitude = ((own[1] / own[0]).to_numpy() - 1.0 - small) / column
    assert (np.abs(amplitude - both.mean) < 2.0 * both.deviation).all()
    assert np.abs(amplitude).max() > 0.1


# --- as parameters -----------------------------------------------------------------------------------


def posed(free: dict[str, ul.Prior], discrepancy: ul.Discrepancy | None = None) -> ul.Problem:
    """A curve with most of full friction and finite strain, and some of both, on 40 points."""
    depth = np.linspace(-2e-5, 1e-4, 40)
    sizes = ul.Discrepancy(friction=0.8, finite_strain=1.2, friction_in_large_strains=0.4)
    truth = replace(BALL, discrepancy=sizes)
    curve = ul.synthesize(truth, depth, ul.Noise(force=2e-4), rng=1)
    return ul.Problem(replace(BALL, discrepancy=discrepancy), curve, free, ul.Noise(force=2e-4))


FREE = {"layer.E": ul.LogUniform(1e5, 1e7), "instrument.contact_depth": ul.Uniform(-1e-5, 1e-5)}


def test_a_discrepancy_is_a_share_of_friction_and_a_size_of_finite_strain() -> None:
    depth = np.linspace(-1e-5, 1e-4, 9)
    slides, sticks = (replace(BALL, friction=word).force(depth) for word in ("none", "stuck"))
    law = BALL.contact_law(1e-4)
    excess = finite_strain_excess(BALL.contact, depth, law.contact_radius(depth))
    further = friction_in_large_strains(BALL.contact, sticks, slides, depth)
    assert further[-1] == pytest.approx(
        (np.sqrt(sticks[-1] / slides[-1] - 1.0) + 0.125) ** 2 - (sticks[-1] / slides[-1] - 1.0), rel=1e-9
    )
    given = replace(BALL, discrepancy=ul.Discrepancy(0.3, 2.0, friction_in_large_strains=0.7))
    assert given.force(depth) == pytest.approx(
        slides + 0.3 * (sticks - slides) + slides * (2.0 * excess + 0.7 * further), rel=1e-12
    )
    found = given.contact_law(1e-4)
    w, step = np.array([2e-5, 6e-5, 9e-5]), 1e-9
    assert found.stiffness(w) == pytest.approx(
        (found.force(w + step) - found.force(w - step)) / (2 * step), rel=5e-6
    )


@pytest.mark.parametrize("size", ["finite_strain", "friction_in_large_strains"])
def test_a_size_of_what_is_not_known_there_is_refused_as_a_fit_refuses_it(size: str) -> None:
    """It was continued beyond where it was measured, and was NaN where it has no shape."""
    sizes = {"friction": 0.0, "finite_strain": 0.0} | {size: 0.5}
    ball = replace(BALL, discrepancy=ul.Discrepancy(**sizes))
    end = 0.3 * ball.layer.thickness
    ball.force(np.linspace(0.0, end, 20))
    beyond = (
        rf"^discrepancy\.{size} is beyond what is known here: measured for depths up to 0.3 h.*; set it to 0"
    )
    with pytest.raises(ul.InputError, match=beyond):
        ball.force(np.linspace(0.0, 1.1 * end, 20))
    cone = replace(ball, indenter=ul.Cone(np.pi / 2 - 0.3))
    with pytest.raises(ul.InputError, match="measured for spheres"):
        cone.force(np.array([0.1 * end]))
    # Of no size it is not asked.
    none = replace(cone, discrepancy=ul.Discrepancy(0.0, 0.0))
    assert none.force(np.array([2.0 * end]))[0] > 0.0


def test_a_discrepancy_is_kept_in_a_scene_file_and_refused_beside_what_is_said(tmp_path: Path) -> None:
    given = replace(BALL, discrepancy=ul.Discrepancy(0.3, 0.0, friction_in_large_strains=0.1))
    assert ul.load_scene(given.save(tmp_path / "ball.toml")) == given
    with pytest.raises(ul.InputError, match='a discrepancy of the law beside friction = "none"'):
        replace(given, friction="none")
    with pytest.raises(ul.InputError, match="a discrepancy of the law beside finite_strain = false"):
        replace(given, finite_strain=False)
    for path in ("finite_strain", "friction_in_large_strains"):
        sizes = {"friction": 0.5, "finite_strain": 0.0, path: 1.0}
        deep = replace(BALL, discrepancy=ul.Discrepancy(**sizes))
        words = rf"discrepancy\.{path} is beyond .* depths up to 0\.3 h; here 0\.4 h"
        with pytest.raises(ul.InputError, match=words):
            ul.Problem(deep, ul.simulate(BALL, np.linspace(0.0, 2e-4, 20)), free={"layer.E": None})
    declared = replace(BALL, friction="none", finite_strain=False)
    with pytest.raises(ul.InputError, match="no size of friction or finite strain can be freed here"):
        ul.free_model_error(
            ul.Problem(declared, ul.simulate(BALL, np.linspace(0.0, 1e-4, 20)), {"layer.E": None})
        )


def test_batches_are_the_laws_one_by_one_and_slopes_their_differences() -> None:
    problem = ul.free_model_error(posed({**FREE, "layer.thickness": ul.LogUniform(2e-4, 1e-3)}))
    sizes = ("friction", "finite_strain", "friction_in_large_strains")
    assert problem.names[-3:] == tuple(f"discrepancy.{name}" for name in sizes)
    (member,) = problem.members
    near = problem.start + 0.02 * np.random.default_rng(0).standard_normal((4, 6))
    physical = problem.physical(near)
    together = member.readings(physical, stiffness=False)
    alone = np.array([member.model(row) for row in physical])
    assert together.possible.all()
    assert together.force == pytest.approx(alone, rel=2e-6, abs=1e-9)
    _, columns = member.jacobian(physical[0])
    for entry, step in enumerate(problem.slopes(near[0]) * 1e-3):
        sides = [member.model(physical[0] + side * step * np.eye(6)[entry]) for side in (-1.0, 1.0)]
        slope = (sides[1] - sides[0]) / (2.0 * step)
        assert columns[:, entry] == pytest.approx(slope, abs=1e-3 * np.abs(slope).max())


def test_a_free_size_acts_from_zero_as_well() -> None:
    """A scene that starts without large strains is fitted with them: they were left out, in silence."""
    sizes = {f"discrepancy.{name}": 0.0 for name in ("finite_strain", "friction_in_large_strains")}
    scene = replace(BALL, discrepancy=ul.Discrepancy(0.3, 0.0))
    truth = scene.with_values(
        {"discrepancy.finite_strain": 0.6, "discrepancy.friction_in_large_strains": 0.3}
    )
    depth = np.linspace(-1e-5, 1e-4, 40)
    curve = ul.simulate(truth, depth)
    problem = ul.Problem(scene, curve, {"layer.E": None, **dict.fromkeys(sizes)}, ul.Noise(force=2e-4))
    (member,) = problem.members
    physical = np.array([1e6, 0.6, 0.3])
    shown = truth.force(depth)
    assert member.model(physical) == pytest.approx(shown, rel=1e-6, abs=1e-9)
    assert member.readings(physical[None], stiffness=False).force[0] == pytest.approx(
        shown, rel=1e-6, abs=1e-9
    )
    _, columns = member.jacobian(problem.physical(problem.start))
    assert (np.abs(columns[-1]) > 0.0).all()
    deep = ul.simulate(scene, np.linspace(0.0, 2e-4, 20))
    for path in sizes:
        with pytest.raises(ul.InputError, match=rf"{path} is beyond .* depths up to 0\.3 h; here 0\.4 h"):
            ul.Problem(scene, deep, {"layer.E": None, path: ul.Normal(0.0, 1.0)})


# --- facts of the literature -----------------------------------------------------------------------------


def test_long_2011_is_the_true_sphere_in_finite_strain() -> None:
    """Over the sphere's law, h = R: within 0.7 % of our function up to w = 0.3 h; over a paraboloid's, 12 %."""
    layer, depth = ul.Layer(ul.Isotropic(1.0, 0.5), 1.0), np.array([0.05, 0.1, 0.2, 0.3])
    laws = [
        ul.contact_law(tip, layer, ul.RIGID, max_depth=0.3, solver=solver)
        for tip, solver in (
            (ul.Sphere(1.0), "long2011"),
            (ul.Sphere(1.0), "exact"),
            (ul.Paraboloid(1.0), "exact"),
        )
    ]
    published, sphere, paraboloid = (law.force(depth) for law in laws)
    here = contact(0.5, 1.0)
    expected = 1.0 + finite_strain_excess(here, depth, laws[1].contact_radius(depth))
    assert published / sphere == pytest.approx(expected, abs=0.007)
    assert published[-1] / paraboloid[-1] < 0.92


@pytest.mark.parametrize(
    ("nu", "column", "drift"),
    [
        (0.5, (1.281, 1.683, 2.211, 2.855, 3.609, 4.469, 5.441, 6.528, 7.735, 9.069), 0.009),
        (0.1, (1.183, 1.413, 1.677, 1.963, 2.260, 2.564, 2.872, 3.181, 3.492, 3.804), 0.0035),
    ],
)
def test_hayes_columns_are_those_of_their_poissons_ratio_and_drift(
    nu: float, column: tuple[float, ...], drift: float
) -> None:
    """A column in circulation as an equilibrium value is nu = 0.1. Both fall behind as a/h grows to 2."""
    exact = [
        float(
            ul.contact_law(
                ul.FlatPunch(a), ul.Layer(ul.Isotropic(1.0, nu), 1.0), ul.RIGID, max_depth=1.0, solver="exact"
            ).force(1.0)
        )
        * (1.0 - nu**2)
        / (2.0 * a)
        for a in np.arange(0.2, 2.01, 0.2)
    ]
    error = np.array(column) / exact - 1.0
    assert np.abs(error[:2]).max() < 6e-4
    assert (np.diff(error[4:]) < 0.0).all()
    assert -drift < error[-1] < -0.9 * drift


def test_hayes_table_to_eight_thicknesses_falls_behind_more_and_more() -> None:
    """The longer column of nu = 0.5 in circulation, against the exact law: -0.9 % at 2, -2.5 at 4, -5.9 at 8."""
    column = {
        0.2: 1.281, 0.6: 2.211, 1.0: 3.609, 1.5: 5.970, 2.0: 9.069, 2.5: 13.0, 3.0: 17.86, 3.5: 23.74, 4.0: 30.75,
        5.0: 48.47, 6.0: 71.75, 7.0: 101.27, 8.0: 137.7,
    }  # fmt: skip
    layer = ul.Layer(ul.Isotropic(1.0, 0.5), 1.0)
    drift = {}
    for a, kappa in column.items():
        law = ul.contact_law(ul.FlatPunch(a), layer, ul.RIGID, max_depth=1.0, solver="exact")
        drift[a] = 100.0 * (kappa / (0.75 * float(law.force(1.0)) / (2.0 * a)) - 1.0)
    assert abs(drift[0.2]) < 0.05
    assert (np.diff(list(drift.values())) < 0.0).all()
    for a, said in {1.0: -0.3, 2.0: -0.9, 4.0: -2.5, 6.0: -4.2, 8.0: -5.9}.items():
        assert drift[a] == pytest.approx(said, abs=0.05)
        assert f"{said:.1f} % at {a:g}" in PAGE.read_text(encoding="utf-8")


def test_the_printed_table_is_what_the_laws_say() -> None:
    rows = {
        0.3: ("+1.7", "+1.2", "+0.3", "+0.0"),
        0.45: ("+0.1", "-0.0", "+1.4", "+6.6"),
        0.5: ("+0.0", "+0.6", "+5.9", "+30"),
    }
    text = PAGE.read_text(encoding="utf-8")
    for nu, row in rows.items():
        assert f"| {nu:g} | {' | '.join(row)} |" in text
        layer = ul.Layer(ul.Isotropic(1.0, nu), 1.0)
        free, stuck = (
            ul.contact_law(ul.Paraboloid(1.0), layer, ul.RIGID, max_depth=4.0, solver=s)
            for s in ("exact", "stuck")
        )
        for eps, said in zip((0.2, 0.5, 1.0, 2.0), row, strict=True):
            depth = float(
                optimize.brentq(lambda w, law=free, eps=eps: law.contact_radius(w) - eps, 1e-4, 4.0)
            )
            size = 100.0 * float(stuck.force(depth) / free.force(depth) - 1.0)
            assert size == pytest.approx(float(said), abs=0.06 if abs(size) < 10.0 else 0.6)


@pytest.mark.parametrize("share", [0.0, 1.0])
def test_friction_is_a_row_of_the_budget_and_the_answer_holds_both_ends(share: float) -> None:
    """A tip that slides, and one that sticks, fitted as one that slides."""
    friction = "stuck" if share else "none"
    made = replace(BALL, friction=friction)
    curve = ul.synthesize(made, np.linspace(-2e-5, 6e-5, 200), ul.Noise(force=1e-4), 3)
    bare = replace(BALL, finite_strain=False)
    fit = ul.fit(ul.Problem(bare, curve, {"layer.E": None, "instrument.contact_depth": None}))
    known = fit.answer("layer.E")
    assert 1e6 in known.interval
    assert "friction" in known.budget["source"].to_list()
    declared = ul.fit(fit.problem.revised(scenes=[replace(bare, friction=friction)])).answer("layer.E")
    assert "friction" not in declared.budget["source"].to_list()
