"""What accuracy costs: the table, its front, its picture, the commands that make them and the README."""

from dataclasses import replace
from itertools import combinations
from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np
import pytest
from matplotlib.text import Text

import underlay as ul
from underlay.report import plots
from underlay.report.plots.style import PAGE
from underlay.report.tables import accuracy_summary
from underlay.scene.accuracy_cost import explicit_formula

GEL = ul.Scene(ul.Paraboloid(5e-6), ul.Layer(ul.Isotropic(2e3, 0.5), 6e-6), ul.RIGID)
DEEPEST = 1e-6
ROOT = Path(__file__).resolve().parents[1]


@pytest.fixture(scope="module")
def table():
    return ul.accuracy_cost(GEL, DEEPEST, rounds=2)


def row(table, **wanted):
    found = table
    for column, value in wanted.items():
        found = found[found[column] == value]
    assert len(found) == 1, wanted
    return found.iloc[0]


def test_every_method_order_and_form_is_there(table):
    assert {"halfspace", "asymptotic", "exact", "auto", "garcia2018", "dimitriadis2002"} <= set(
        table["method"]
    )
    series = table[table["method"] == "asymptotic"]
    assert {(f, o) for f in ("explicit", "parametric", "compliance") for o in (1, 2, 3, 4)} == set(
        zip(series["form"], series["order"], strict=True)
    )
    # For another tip or another base: not in the table, rather than wrong in it.
    assert {"hayes1972", "clifford2009", "hay2011"}.isdisjoint(table["method"])


def test_errors_are_those_against_the_exact_law(table):
    depth = np.linspace(0.0, DEEPEST, 1001)[1:]
    exact = GEL.contact_law(DEEPEST, solver="exact")
    for method in ("halfspace", "garcia2018"):
        law = GEL.contact_law(DEEPEST, solver=method)
        error = np.abs(law.force(depth) / exact.force(depth) - 1.0).max()
        assert row(table, method=method).error == pytest.approx(error, rel=1e-4)
    radius = np.abs(
        GEL.contact_law(DEEPEST, solver="halfspace").contact_radius(depth) / exact.contact_radius(depth)
    )
    assert row(table, method="halfspace").error_radius == pytest.approx(np.abs(radius - 1.0).max(), rel=1e-4)


def test_more_accuracy_is_more_accurate(table):
    exact = table[table["method"] == "exact"].sort_values("rtol", ascending=False)
    kept = exact[["error", "error_radius", "error_stiffness"]].max(axis=1)
    assert (kept.to_numpy() <= exact["rtol"].to_numpy()).all()
    # Laws read off stored curves have the nodes of the finest of these behind them.
    assert (np.diff(exact.loc[exact["rtol"] < 4e-7, "nodes"].to_numpy(dtype=float)) >= 0.0).all()
    for form in ("explicit", "parametric", "compliance"):
        first, fourth = (row(table, method="asymptotic", form=form, order=order).error for order in (1, 4))
        assert fourth < first
    auto = table[table["method"] == "auto"]
    assert (auto["error"] <= auto["rtol"]).all()


@pytest.mark.parametrize("times", ["cold", "held"])
def test_nothing_beats_the_front_and_the_front_beats_the_rest(table, times):
    flag = "pareto" if times == "cold" else "pareto_held"
    cost, error = table[f"{times}_ratio"], table["error"]
    for index in table.index[error.notna()]:
        beaten = ((cost < cost[index]) & (error <= error[index])).any()
        assert table.loc[index, flag] == (not beaten)


def test_a_form_that_ends_before_the_deepest_point_says_where():
    soft = replace(GEL, substrate=ul.Isotropic(1e2, 0.5))
    table = ul.accuracy_cost(soft, 3e-5, rounds=1)
    ended = row(table, method="asymptotic", form="parametric", order=4)
    assert np.isnan(ended.error)
    assert np.isnan(ended.cold_ratio)
    assert "largest depth" in ended.note
    assert not ended.pareto
    assert "parametric 4" not in set(accuracy_summary(table)["law"])


def test_a_correction_outside_its_range_is_kept_with_a_note():
    ball_on_compressible_gel = replace(
        GEL, indenter=ul.Sphere(5e-6), layer=ul.Layer(ul.Isotropic(2e3, 0.2), 6e-6)
    )
    table = ul.accuracy_cost(ball_on_compressible_gel, 2e-6, rounds=1)
    assert "nu of the layer is 0.2, outside" in row(table, method="long2011").note


def test_the_unit_is_the_explicit_law():
    depth = np.linspace(1e-8, 1e-7, 5)
    law = GEL.contact_law(1e-7, solver=ul.Asymptotic(form="explicit"))
    assert explicit_formula(GEL)(depth) == pytest.approx(law.force(depth), rel=1e-12)


def test_what_cannot_be_compared_is_refused():
    with pytest.raises(ul.InputError, match="half-space"):
        ul.accuracy_cost(ul.Scene(ul.Paraboloid(1e-3), ul.Layer(ul.Isotropic(1e4, 0.5))), 1e-5)
    with pytest.raises(ul.InputError, match="positive depths"):
        ul.accuracy_cost(GEL, [0.0, 1e-6])
    with pytest.raises(ul.RangeError):
        ul.accuracy_cost(GEL, 1e-2)


def test_the_picture_shows_every_method_that_answers(table):
    drawn = plots.accuracy_cost(table)
    assert {"exact 1e-6", "auto 1e-4", "half-space", "explicit 4", "Garcia 2018"} <= named(drawn)
    assert drawn.get_xscale() == drawn.get_yscale() == "log"
    plt.close(drawn.figure)
    with pytest.raises(ul.InputError, match="'cold' or 'held'"):
        plots.accuracy_cost(table, times="warm")


def named(drawn):
    """The names written beside the points, none of which may cover another."""
    drawn.figure.canvas.draw()
    boxes = [Text.get_window_extent(text) for text in drawn.texts]  # without the lines to the points
    assert not any(one.overlaps(other) for one, other in combinations(boxes, 2))
    return {text.get_text() for text in drawn.texts}


# --- what it does to the answer -----------------------------------------------------------------------------


@pytest.fixture(scope="module")
def answers():
    return ul.answer_cost(
        GEL, DEEPEST, solvers=("halfspace", "garcia2018", ul.Exact(1e-2), ul.Exact(1e-6)), rounds=1
    )


def test_a_wrong_law_makes_the_modulus_wrong_and_the_exact_one_does_not(answers):
    exact = row(answers, method="exact", rtol=1e-6)
    assert abs(exact.E_error) < 1e-6
    assert abs(exact.thickness_error) < 1e-5
    hertz = row(answers, method="halfspace")
    # The same least squares by hand: on a rigid base the force is proportional to the modulus, the contact known.
    assert hertz.E_error > 0.5
    assert np.isnan(hertz.thickness_error)
    assert 1e-4 < abs(row(answers, method="garcia2018").E_error) < 0.1
    assert (answers["ratio"] > 0.0).all()


def test_the_fitted_modulus_is_that_of_a_fit_of_the_same_curve(answers):
    depth = np.linspace(-0.15, 1.0, 400) * DEEPEST
    force = GEL.force(depth, solver=ul.Exact(1e-10))
    problem = ul.Problem(
        GEL,
        ul.Curve(depth, force),
        ("layer.E", "instrument.contact_depth"),
        noise=ul.Noise(force=0.005 * force.max()),
        solver="halfspace",
    )
    expected = ul.fit(problem).values["layer.E"] / 2e3 - 1.0
    assert row(answers, method="halfspace").E_error == pytest.approx(expected, rel=1e-3)


def test_leaving_an_effect_out_changes_the_answer_as_a_fit_without_it_says():
    ball = ul.Scene(ul.Sphere(5e-6), GEL.layer, ul.RIGID)
    found = ul.effects_on_answers(ball, DEEPEST, ul.Exact(1e-4)).set_index("effect")
    # The half-space row of the other table is the same fit of another tip.
    assert found.loc["finite thickness", "E_percent"] > 50.0
    assert np.isnan(found.loc["finite thickness", "h_percent"])
    assert -12.0 < found.loc["true sphere", "E_percent"] < -2.0
    assert np.isnan(found.loc["relaxation", "E_percent"])


def test_longer_chains_come_closer_and_the_panels_name_everything(table, answers):
    drawn = ul.posterior_cost(GEL, DEEPEST, steps=(20, 300))
    chains = drawn[drawn["way"] == "emcee"]
    assert chains["error"].iloc[1] < chains["error"].iloc[0]
    assert (chains["seconds"] > 0.0).all()
    assert 0.0 < drawn.attrs["reference_error"] < 0.2
    figure = plots.what_accuracy_costs(table, answers, drawn)
    force, answer, posterior = figure.axes
    assert "half-space" in named(force)
    assert {"half-space", "Garcia 2018", "exact 1e-2", "exact 1e-6"} <= named(answer)
    assert {"emcee, 20 steps", "emcee, 300 steps", "fit, as a normal", "importance"} == named(posterior)
    assert figure.get_figwidth() == pytest.approx(PAGE)
    plt.close(figure)


def test_a_halfspace_has_no_answers_to_compare():
    halfspace = ul.Scene(ul.Paraboloid(1e-3), ul.Layer(ul.Isotropic(1e4, 0.5)))
    for compared in (ul.answer_cost, ul.posterior_cost):
        with pytest.raises(ul.InputError, match="half-space"):
            compared(halfspace, 1e-5)


SCENE_FILE = """
[indenter]
shape = "paraboloid"
radius = "5 um"

[layer]
E = "2 kPa"
nu = 0.5
thickness = "6 um"

[substrate]
rigid = true

[simulate]
max_depth = "1 um"
"""


def test_the_command_writes_table_and_pictures(done, tmp_path):
    scene = tmp_path / "gel.toml"
    scene.write_text(SCENE_FILE)
    out = tmp_path / "out"
    assert "garcia2018" in done("accuracy", scene, "--quick", "--output", out)
    assert (out / "gel.accuracy.csv").read_text().startswith("method,form,order,rtol,nodes,error")
    assert (out / "gel.accuracy.png").read_bytes().startswith(b"\x89PNG")
