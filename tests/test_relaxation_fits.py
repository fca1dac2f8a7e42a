"""Fits of a relaxing layer: derivatives, fractions solved for, moduli that follow, what the record tells."""

import itertools
import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np
import pandas as pd
import pytest
from scipy import optimize

import underlay as ul
from support.call_counter import count_calls
from underlay.inference.least_squares.engine import minimise
from underlay.inference.least_squares.models import freeze
from underlay.inference.least_squares.objective import Objective
from underlay.inference.least_squares.projection import Fractions
from underlay.inference.least_squares.settle import first_noises
from underlay.inference.model.forward import Forward
from underlay.inference.sampling.derived import derived_quantities
from underlay.mechanics.viscoelastic import history
from underlay.mechanics.viscoelastic.bed import Bed
from underlay.mechanics.viscoelastic.history import Loading, Unloading, Viscoelastic
from underlay.report import plots, screen, tables
from underlay.report.scene_tables import scene_table

STUDIES = Path(__file__).parent / "studies"
sys.path.insert(0, str(STUDIES))
import relaxation_coverage  # noqa: E402  a study, beside the tests

SCENE = ul.Scene(
    ul.Sphere(1e-3),
    ul.Layer(ul.Isotropic(1e6, 0.5), 1e-3, relaxation=ul.Prony((0.4, 0.3), (0.2, 3.0))),
    ul.RIGID,
)
TIME = np.linspace(0.0, 12.0, 401)
LOADING = np.interp(TIME, (0.0, 0.5, 12.0), (-1e-5, 1e-4, 1e-4))
CYCLE = np.interp(TIME, (0.0, 0.5, 8.5, 9.5, 12.0), (-1e-5, 1e-4, 1e-4, -1e-5, -1e-5))
NOISE = ul.Noise(force=2e-4)
RELAXATION = {
    "layer.relaxation.fractions[0]": (0.0, 1.0),
    "layer.relaxation.fractions[1]": (0.0, 1.0),
    "layer.relaxation.times[0]": (3e-2, 10.0),
    "layer.relaxation.times[1]": (3e-2, 12.0),
}
FREE = {
    "layer.E": (1e4, 1e8),
    "layer.thickness": (2e-4, 5e-3),
    "instrument.contact_depth": (-2e-5, 2e-5),
} | RELAXATION
WRONG = {
    "layer.E": 4e5,
    "layer.thickness": 8e-4,
    "layer.relaxation.times[0]": 0.5,
    "layer.relaxation.times[1]": 5.0,
    "layer.relaxation.fractions[0]": 0.3,
    "layer.relaxation.fractions[1]": 0.2,
}


def problem_of(depth, scene=SCENE, free=FREE, start=WRONG):
    curve = ul.synthesize(scene, depth, NOISE, rng=1, time=TIME)
    return ul.Problem(scene.with_values(start), curve, free, noise=NOISE)


def objective_of(problem):
    return Objective(problem, freeze(problem, problem.start, first_noises(problem, problem.start)))


def test_a_map_takes_every_relaxation_time_that_its_records_tell():
    """The times stand a factor of a thousand apart: whether a record tells them is asked of that record."""
    relaxation = ul.Prony((0.2, 0.2), (0.01, 10.0))
    scene = ul.Scene(SCENE.indenter, ul.Layer(ul.Isotropic(1e6, 0.5), 1e-3, relaxation=relaxation), ul.RIGID)
    free = {"layer.E": (1e4, 1e8)} | {path: RELAXATION[path] for path in list(RELAXATION)[:2]}
    curves = [
        ul.synthesize(scene, np.interp(time, (0.0, 0.5, 12.0), (0.0, 1e-4, 1e-4)), NOISE, rng=1, time=time)
        for time in (np.concatenate((np.linspace(0.0, 1.0, 201), np.linspace(1.1, 12.0, 100))), TIME)
    ]
    table = ul.fit_many(curves, scene, free, workers=0, options=ul.MapOptions(noise=NOISE))
    assert table["layer.E"][0] == pytest.approx(1e6, rel=0.05)
    assert "this record tells times" in table["reason"][1]


# --- derivatives -------------------------------------------------------------------------------------------


@pytest.mark.parametrize("relaxation", [ul.Prony((0.4, 0.3), (0.2, 3.0)), ul.PowerLawRelaxation(0.2, 2.0)])
@pytest.mark.parametrize(("depth", "form"), [(LOADING, Loading), (CYCLE, Unloading)])
def test_derivatives_are_those_of_the_force(relaxation, depth, form):
    """Against central differences of the force in every number of the relaxation."""
    law = SCENE.contact_law(1.1e-4, solver=ul.Exact(1e-9))
    memory = Viscoelastic(relaxation)
    # Uneven steps too.
    for time in (TIME, TIME + 0.01 * np.sin(3.0 * TIME)):
        motion = memory.prepared(depth, time)
        assert isinstance(motion.form, form)
        numbers = (
            {"fractions": 2, "times": 2} if isinstance(relaxation, ul.Prony) else {"exponent": 0, "time": 0}
        )
        paths = [
            f"layer.relaxation.{name}{f'[{k}]' if many else ''}"
            for name, many in numbers.items()
            for k in range(max(many, 1))
        ]
        found = motion.slopes(paths, law)
        by_differences = super(type(motion), motion).slopes(paths, law)
        for path in paths:
            scale = np.abs(by_differences[path]).max()
            # The difference has 1e-5 of the value as its step: 1e-10 of truncation, 1e-9 of rounding. A point
            # that loses contact within the step is the difference's fault.
            away = np.abs(found[path] - by_differences[path]) < 1e-6 * scale
            assert np.count_nonzero(~away) <= 1, path


def test_a_jacobian_follows_one_motion(monkeypatch):
    """Nothing is asked again with other numbers: the motion is prepared once, and once for the force."""
    problem = problem_of(CYCLE)
    physical = problem.physical(problem.start)
    counted = count_calls(monkeypatch, Viscoelastic, "prepared")
    problem.members[0].jacobian(physical)
    assert counted.calls == 1


# --- fractions ---------------------------------------------------------------------------------------------


def test_fractions_and_modulus_are_solved_for_at_once():
    """At the true times, thickness and contact one point of the search finds modulus and fractions."""
    right = {name: value for name, value in SCENE.parameters.items() if name in FREE}
    start = right | {name: WRONG[name] for name in WRONG if "fraction" in name or name == "layer.E"}
    for depth, most in ((LOADING, 1.02), (CYCLE, 2.0)):
        problem = problem_of(depth, start=start)
        objective = objective_of(problem)
        low, high = problem.bounds.T
        point = objective.point(problem.start, low, high)
        # On the way out the point of equal radius moves with them: nearly at once.
        assert point.square < most * objective.square(problem.vector(right))
        assert objective.square(problem.start) > 1e3 * point.square


def test_the_solution_agrees_with_non_negative_least_squares():
    """One term too many, in the tail of a curve without it: the fraction is zero, not negative."""
    one = replace(SCENE, layer=replace(SCENE.layer, relaxation=ul.Prony((0.5,), (0.3,))))
    curve = ul.synthesize(one, LOADING, NOISE, rng=3, time=TIME)
    three = replace(SCENE, layer=replace(SCENE.layer, relaxation=ul.Prony((0.2, 0.1, 0.1), (0.3, 1.0, 4.0))))
    names = ["layer.E", *(f"layer.relaxation.fractions[{k}]" for k in range(3))]
    problem = ul.Problem(three, curve, {name: FREE.get(name, (0.0, 1.0)) for name in names}, NOISE)
    found = minimise(objective_of(problem), problem.start)
    values = problem.values(found.vector)
    # Columns: the elastic force, and its integrals.
    law = three.contact_law(1.1e-4)
    memory = [Viscoelastic(ul.Prony((1.0,), (tau,))) for tau in (0.3, 1.0, 4.0)]
    columns = [law.force(LOADING), *(m.force(law.force, LOADING, TIME) for m in memory)]
    moduli, misfit = optimize.nnls(np.stack(columns, axis=1) / NOISE.force, curve.force / NOISE.force)
    assert min(moduli) == 0.0, "the case is on a bound"
    assert values["layer.E"] / 1e6 == pytest.approx(moduli.sum(), rel=1e-5)
    for k in range(3):
        share = values[f"layer.relaxation.fractions[{k}]"]
        assert share == pytest.approx(moduli[k + 1] / moduli.sum(), abs=1e-5)
        assert share >= 0.0
    assert found.point.square == pytest.approx(misfit**2, rel=1e-6)


def test_fractions_that_sum_over_one_are_brought_back():
    problem = problem_of(LOADING)
    objective = objective_of(problem)
    fractions = Fractions.of(problem, set(objective.active), objective._linear)
    wild = problem.vector({"layer.relaxation.fractions[0]": 0.9, "layer.relaxation.fractions[1]": 0.6})
    brought = problem.values(fractions.feasible(wild))
    assert brought["layer.relaxation.fractions[0]"] == pytest.approx(0.6)
    assert brought["layer.relaxation.fractions[1]"] == pytest.approx(0.4)
    low, high = problem.bounds.T
    assert objective.point(wild, low, high) is not None
    assert not objective.failures


@pytest.mark.parametrize("depth", [LOADING, CYCLE])
def test_few_steps_lead_from_wrong_numbers_to_the_optimum(depth):
    problem = problem_of(depth)
    fit = ul.fit(problem)
    assert fit.statistics.success
    # 19 and 15 before the fractions were solved for.
    assert fit.statistics.evaluations <= 14
    for name in FREE:
        assert abs(fit.values[name] - SCENE.parameters[name]) < 4.0 * fit.stderr[name], name


# --- what follows ------------------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def fitted():
    return ul.fit(problem_of(CYCLE))


@pytest.mark.parametrize("rate", [5e-6, 1e-4], ids=["ramp", "step"])
@pytest.mark.parametrize(
    "relaxation", [ul.Prony((0.5,), (0.3,)), ul.PowerLawRelaxation(0.3)], ids=["prony", "power law"]
)
def test_a_hold_does_not_lead_to_the_thinnest_layer(relaxation, rate):
    """The grid of starts took the fall of the force at one depth for noise; of a step three readings go in."""
    layer = ul.Layer(ul.Isotropic(2e4, 0.45), 6e-6, relaxation=relaxation)
    scene = ul.Scene(ul.Sphere(5e-6), layer, ul.RIGID, ul.Instrument(1e-7))
    depth, time = ul.Program.at(-5e-7).ramp(1.6e-6, rate).hold(1.2).sampled(200)
    noise = ul.Noise(force=0.01 * float(scene.force(depth, time).max()))
    curve = ul.synthesize(scene, depth, noise, rng=1, time=time)
    numbers = [path for path in scene.parameters if path.endswith(("exponent", "fractions[0]"))]
    free = {"layer.E": ul.LogUniform(1e2, 1e7), "layer.thickness": ul.LogUniform(1e-6, 3e-5)}
    free |= {"instrument.contact_depth": ul.Uniform(-1e-6, 1e-6), **dict.fromkeys(numbers)}
    truth = ul.Problem(scene, curve, free, noise)
    residuals = truth.residuals(truth.start)
    guess = scene.with_values({"layer.E": 1e4, "layer.thickness": 1e-5, "instrument.contact_depth": 0.0})
    found = ul.fit(ul.Problem(guess, curve, free, noise))
    assert found.statistics.chi_square <= residuals @ residuals


def test_moduli_at_once_and_at_equilibrium_have_intervals(fitted):
    assert fitted.derived == ("layer.instantaneous_modulus", "layer.equilibrium_modulus")
    at_once, later = (fitted.interval(name, part="statistical") for name in fitted.derived)
    same = fitted.interval("layer.E", part="statistical")
    # A quantity of one parameter: its interval is that of the parameter, whatever kind that is of.
    assert (at_once.low, at_once.high) == pytest.approx((same.low, same.high), rel=1e-12)
    assert later.low < 3e5 < later.high
    # The delta method by hand: Einf = E (1 - f1 - f2).
    share = (
        1.0 - fitted.values["layer.relaxation.fractions[0]"] - fitted.values["layer.relaxation.fractions[1]"]
    )
    gradient = np.array([share, 0.0, 0.0, -fitted.values["layer.E"], -fitted.values["layer.E"], 0.0, 0.0])
    spread = float(np.sqrt(gradient @ fitted.covariance @ gradient)) / later.value
    assert np.log(later.high / later.low) == pytest.approx(2.0 * 1.959964 * spread, rel=0.05)
    wide = fitted.interval("layer.equilibrium_modulus", 0.99, part="statistical")
    assert wide.low < later.low < later.high < wide.high
    with pytest.raises(ul.InputError, match="from these follow layer"):
        fitted.interval("layer.soft_modulus")


@pytest.mark.parametrize(
    ("own", "others", "expected"),
    [
        # The number of a fraction in its path is not that of a curve, and a thickness has no part in a modulus.
        ((), {}, [""]),
        (("layer.thickness",), {}, [""]),
        (("layer.E",), {}, ["[0]", "[1]"]),
        (("layer.relaxation.fractions[1]",), {}, ["[0]", "[1]"]),
        # A known fraction that differs makes two moduli of one.
        ((), {"layer.relaxation.fractions[1]": 0.2}, ["[0]", "[1]"]),
        ((), {"layer.relaxation.times[1]": 4.0}, [""]),
    ],
)
def test_a_modulus_that_curves_share_is_named_once(own, others, expected):
    free = {"layer.E": None, "layer.thickness": None, "layer.relaxation.fractions[0]": (0.0, 1.0)}
    if "layer.relaxation.fractions[1]" in own:
        free["layer.relaxation.fractions[1]"] = (0.0, 1.0)
    scenes = SCENE, SCENE.with_values(others)
    tests = [(s, ul.simulate(s, depth, time=TIME)) for s, depth in zip(scenes, (LOADING, CYCLE), strict=True)]
    problem = ul.Problem.joint(tests, free, [path for path in free if path not in own], NOISE)
    found = derived_quantities(problem, problem.physical(problem.start)[None])
    told = [name for name in found if name.startswith("layer.equilibrium_modulus")]
    assert told == [f"layer.equilibrium_modulus{suffix}" for suffix in expected]
    kept = [1.0 - sum(s.layer.relaxation.fractions) for s in scenes]
    for name, scene_kept in zip(told, kept, strict=False):
        assert found[name].item() == pytest.approx(1e6 * scene_kept)
    # So are those that follow from E alone, or from E and nu.
    for other in ("instantaneous", "reduced"):
        told = [name for name in found if name.startswith(f"layer.{other}_modulus")]
        suffixes = ["[0]", "[1]"] if "layer.E" in own else [""]
        assert told == [f"layer.{other}_modulus{suffix}" for suffix in suffixes]


def test_an_equilibrium_modulus_near_zero_is_not_taken_to_first_order():
    """E (1 - f) with f = 0.93 known to 0.01: against draws of the same normal distribution of the parameters.

    The first order of the logarithm is off by 3 % there, the ends by a third of a per cent, to which 200,000 draws
    know them.
    """
    layer = ul.Layer(ul.Isotropic(1e6, 0.5), 1e-3, relaxation=ul.Prony((0.93,), (2.0,)))
    scene = ul.Scene(ul.Paraboloid(1e-3), layer, ul.RIGID)
    time = np.linspace(0.0, 16.0, 120)
    depth = np.interp(time, (0.0, 2.0, 16.0), (1e-6, 2e-4, 2e-4))
    noise = ul.Noise(force=0.09 * float(scene.force(depth, time).max()))
    curve = ul.synthesize(scene, depth, noise, rng=4, time=time)
    free = {"layer.E": (1e4, 1e8), "layer.relaxation.fractions[0]": (0.0, 1.0)}
    fit = ul.fit(ul.Problem(scene, curve, free, noise))
    name = "layer.equilibrium_modulus"
    told = fit.interval(name, part="statistical")
    draws = np.random.default_rng(0).multivariate_normal(fit.vector, fit.scaled_covariance, 200_000)
    found = derived_quantities(fit.problem, fit.problem.physical(draws))[name]
    ends = np.quantile(found, [0.025, 0.975])
    np.testing.assert_allclose([told.low, told.high], ends, rtol=0.02)
    first_order = fit.band(lambda physical: derived_quantities(fit.problem, physical)[name][:, None])
    assert abs(float(first_order[0][0]) / ends[0] - 1.0) > 0.02


def test_they_stand_in_tables_sentences_and_files(fitted, tmp_path):
    table = tables.interval_table(fitted)
    assert "follows from the others" in table.loc["equilibrium modulus of the layer", "before the test"]
    assert "layer.equilibrium_modulus" in set(tables.fit_table(fitted)["parameter"])
    assert [line for line in screen.fit_lines(fitted) if line.startswith("Equilibrium     E∞ = ")]
    assert '"layer.equilibrium_modulus"' in fitted.to_json(tmp_path / "fit.json").read_text()


def test_lists_and_long_names_can_be_read(fitted):
    """The numbers of a relaxation stand in the table of the scene; the columns of a matrix do not overlap."""
    rows = scene_table(SCENE).set_index("quantity")["value"]
    assert rows["fractions"] == "0.4, 0.3"
    assert rows["times"] == "0.2 s, 3 s"
    panel = plots.correlations(fitted)
    panel.figure.canvas.draw()
    boxes = sorted((text.get_window_extent() for text in panel.get_xticklabels()), key=lambda box: box.x0)
    assert all(left.x1 < right.x0 for left, right in itertools.pairwise(boxes))
    letters = [text.get_text() for text in panel.get_xticklabels()]
    assert len(set(letters)) == len(letters)
    plt.close("all")


def test_an_elastic_layer_has_none_of_it():
    elastic = SCENE.elastic
    curve = ul.synthesize(elastic, LOADING, NOISE, rng=1, time=TIME)
    fit = ul.fit(ul.Problem(elastic, curve, ["layer.E"], NOISE))
    assert fit.derived == ()
    assert "layer.equilibrium_modulus" not in set(tables.fit_table(fit)["parameter"])


def test_without_relaxation_none_of_its_modules_is_loaded():
    """An elastic layer simulated, fitted, told its intervals and sampled."""
    code = """
import sys
import numpy as np
import underlay as ul

scene = ul.Scene(ul.Sphere(1e-3), ul.Layer(ul.Isotropic(1e6, 0.5), 1e-3), ul.RIGID)
depth = np.linspace(0.0, 1e-4, 50)
curve = ul.synthesize(scene, depth, ul.Noise(force=1e-4), rng=0)
problem = ul.Problem(scene, curve, {"layer.E": (1e4, 1e8)}, ul.Noise(force=1e-4))
fit = ul.fit(problem)
fit.interval("layer.E"), fit.report(), ul.identifiability(fit).report(), scene.effects(1e-4)
problem.log_likelihood(np.zeros((4, 1)))
loaded = [name for name in sys.modules if "viscoelastic" in name or "ageing" in name or "remembered" in name]
print(loaded)
"""
    ran = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert ran.stdout.strip() == "[]"


def test_the_band_is_that_of_the_intervals(fitted):
    panel = plots.relaxation(fitted)
    (band,) = panel.collections
    corners = band.get_paths()[0].vertices
    first = corners[corners[:, 0] == corners[:, 0].min()][:, 1] * 1e6
    known = fitted.interval("layer.instantaneous_modulus")
    # The record's first step is 0.15 of the shorter time: less than 0.06 of the modulus is gone.
    assert 0.9 * known.low < first.min() < known.value
    assert 0.9 * known.high < first.max() < 1.1 * known.high
    low, middle, high = fitted.band(lambda physical: physical[:, :1])
    assert (low[0], high[0]) == pytest.approx(
        (known.low, known.high),
        rel=0.02,  # 4000 draws place an end to 0.05 standard deviations
    )
    assert middle[0] == fitted.values["layer.E"]


# --- many sets at once --------------------------------------------------------------------------------------


@pytest.mark.parametrize("depth", [LOADING, CYCLE])
def test_many_sets_at_once_are_each_its_own(depth):
    """A sampler's sets, impossible ones among them: as each alone, and in any company."""
    problem = problem_of(depth, start={})
    rng = np.random.default_rng(0)
    spread = np.array([0.1 if "fraction" in name or "contact" in name else 0.3 for name in problem.names])
    sets = spread * rng.standard_normal((12, len(problem.names)))
    sets[3] = problem.vector({"layer.relaxation.fractions[0]": 0.8, "layer.relaxation.fractions[1]": 0.7})
    together = problem.log_likelihood(sets)
    alone = np.array([problem.log_likelihood(row) for row in sets])
    assert together == pytest.approx(alone, rel=1e-12)
    assert not np.isfinite(together[3])
    assert np.isfinite(np.delete(together, 3)).all()
    for row, density in zip(np.delete(sets, 3, axis=0), np.delete(together, 3), strict=True):
        model = problem.members[0].model(problem.physical(row))
        square = np.sum(((model - problem.curves[0].force) / NOISE.force) ** 2)
        normal = len(model) * np.log(NOISE.force * np.sqrt(2.0 * np.pi))
        assert density == pytest.approx(-0.5 * square - normal, rel=1e-5)


def test_cycles_of_many_sets_share_one_pass(monkeypatch):
    """Contact before the record and within it; what no closed construction holds for goes alone."""
    single = count_calls(monkeypatch, Forward, "reading")
    cycle = np.interp(TIME, (0.0, 0.5, 8.5, 12.0), (0.0, 1e-4, 1e-4, -3e-5))
    problem = problem_of(cycle, start={})
    sets = np.tile(problem.start, (5, 1))
    sets[:, problem.names.index("layer.relaxation.times[0]")] += np.linspace(-1.0, 1.0, 5)
    entry = problem.names.index("instrument.contact_depth")
    for row, contact in zip(sets, (-1.5e-5, -1e-6, 0.0, 5e-6, 1.5e-5), strict=True):
        row[entry] = problem.vector({"instrument.contact_depth": contact})[entry]
    single.calls = 0
    together = problem.log_likelihood(sets)
    assert single.calls == 0
    assert together == pytest.approx(np.array([problem.log_likelihood(row) for row in sets]), rel=1e-12)
    for row, density in zip(sets, together, strict=True):
        square = np.sum(
            ((problem.members[0].model(problem.physical(row)) - problem.curves[0].force) / NOISE.force) ** 2
        )
        assert density == pytest.approx(
            -0.5 * square - len(TIME) * np.log(NOISE.force * np.sqrt(2.0 * np.pi)), rel=1e-5
        )
    again = problem_of(np.interp(TIME, (0.0, 2.0, 4.0, 12.0), (0.0, 1e-4, 5e-5, 1e-4)), start={})
    single.calls = 0
    again.log_likelihood(np.tile(again.start, (5, 1)))
    assert single.calls == 5


# --- what the record tells ---------------------------------------------------------------------------------


def test_identifiability_says_which_times_are_told(fitted):
    told = ul.identifiability(fitted)
    ((shortest, longest),) = told.times_told
    assert shortest == pytest.approx(0.03)
    assert longest == pytest.approx(12.0)
    assert "relaxation times from 30 ms to 12 s can be determined" in told.report()
    # Before the test, by program.
    depth, time = ul.Program.triangle(1e-4, 2e-4, hold=30.0).sampled(points=300)
    before = ul.identifiability(SCENE, depth=depth, time=time, free=list(FREE), noise=NOISE)
    assert before.times_told == ((pytest.approx(31.0 / 299), pytest.approx(31.0)),)
    # A longer hold tells the longer time better.
    assert before.stderr["layer.relaxation.times[1]"] < told.stderr["layer.relaxation.times[1]"]
    with pytest.raises(ul.InputError, match="its times"):
        ul.identifiability(SCENE, depth=depth, free=list(FREE), noise=NOISE)


def test_what_the_record_does_not_tell_is_refused_or_said():
    late = SCENE.with_values({"layer.relaxation.times[1]": 40.0})
    curve = ul.simulate(SCENE, LOADING, TIME)
    free = {"layer.E": FREE["layer.E"], "layer.relaxation.fractions[1]": (0.0, 1.0)}
    with pytest.raises(ul.ParameterError, match=r"times\[1\] is 40 s, .* 12 s: leave the fraction fixed"):
        ul.Problem(late, curve, free)
    # With both of its numbers fixed it is the scene's.
    ul.Problem(late, curve, ["layer.E"])
    # A time that runs away in the fit is named.
    made = ul.synthesize(replace(late), LOADING, NOISE, rng=2, time=TIME)
    wide = {"layer.E": FREE["layer.E"], "layer.relaxation.times[1]": (3e-2, 1e3)}
    fit = ul.fit(ul.Problem(late.with_values({"layer.relaxation.times[1]": 10.0}), made, wide, NOISE))
    (warning,) = [entry for entry in fit.warnings if entry.code == "relaxation-time"]
    assert "its length" in warning.message


@pytest.mark.parametrize(
    ("change", "error", "said"),
    [
        (lambda c: ul.Curve(c.depth, c.force), ul.CurveError, "times of its points"),
        (lambda c: ul.Curve(c.depth, c.force, time=c.time[::-1]), ul.InputError, "must increase"),
        (
            lambda c: ul.Curve(c.depth[:40], c.force[:40], time=c.time[:40]),
            ul.ParameterError,
            "its length, 1.17 s",
        ),
    ],
)
def test_bad_records_are_one_line(change, error, said):
    curve = ul.simulate(SCENE, LOADING, TIME)
    with pytest.raises(error, match=said) as told:
        ul.Problem(SCENE, change(curve), FREE, NOISE)
    assert "\n" not in str(told.value)


def test_adhesion_beside_relaxation_is_one_line():
    with pytest.raises(
        ul.InputError, match="adhesion beside a history or a relaxation is not simulated"
    ) as told:
        replace(SCENE, adhesion=ul.JKR(work=1e-3))
    assert "\n" not in str(told.value)


# --- coverage ----------------------------------------------------------------------------------------------


def test_stored_coverage_is_that_of_the_study():
    """500 curves: 95 % of them to 1 %, one standard error."""
    stored = pd.read_csv(STUDIES / "results" / "relaxation_coverage.csv").set_index("parameter")
    assert {"layer.E", "layer.equilibrium_modulus", "layer.thickness", "layer.relaxation.times[0]"} <= {
        *stored.index
    }
    assert (stored["curves"] >= 500).all()
    assert stored["coverage"].between(93.0, 97.0).all()
    # Of 5 curves 2 or fewer inside has probability 0.001.
    rows = pd.DataFrame(row for seed in range(5) for row in relaxation_coverage.intervals(seed))
    assert (rows.groupby("parameter")["inside"].sum() > 2).all()
    widths = rows.groupby("parameter")["half width"].median() / stored["half_width"]
    assert widths.between(0.6, 1.6).all()


def test_a_general_history_is_fitted_by_differences():
    depth = 1e-4 * np.interp(TIME, (0.0, 3.0, 5.0, 8.0, 12.0), (-0.1, 0.6, 0.2, 1.0, 1.0))
    motion = SCENE.memory.prepared(depth, TIME)
    assert isinstance(motion.form, Bed)
    slopes = motion.slopes(["layer.relaxation.fractions[0]"], SCENE.contact_law(1.1e-4))
    assert slopes["layer.relaxation.fractions[0]"].min() < 0.0
    assert history.RIPPLES[0] == 0.0
