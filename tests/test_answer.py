"""One curve, one answer: its parts add in quadrature, its budget is what refits say, and it covers."""

import math
from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest

import underlay as ul
from support.places import Written, differences
from support.user_scenes import user_test
from support.worlds import Clean, world_curves

E, H, C, B = "layer.E", "layer.thickness", "instrument.contact_depth", "instrument.baseline"
DEPTH = np.linspace(-6e-5, 1.5e-4, 240)
BOUNDED = {E: (1e4, 1e8), C: (-1e-4, 1e-4)}


def scene(**changes):
    made = {"radius": 1e-3, "thickness": 1.5e-3, "nu": 0.45, "uncertainties": None} | changes
    layer = ul.Layer(ul.Isotropic(1e6, made["nu"]), made["thickness"])
    return ul.Scene(ul.Sphere(made["radius"]), layer, ul.RIGID, uncertainties=made["uncertainties"])


def measured(noise=2e-4, seed=0, made=None, depth=DEPTH):
    return ul.synthesize(made or scene(), depth, ul.Noise(force=noise), np.random.default_rng(seed))


def fitted(free=(E, C, B), *, seed=0, noise=2e-4, **changes):
    assumed = scene(**changes)
    return ul.fit(ul.Problem(assumed, measured(noise, seed), free))


def test_the_value_is_least_squares_and_both_parts_add_in_quadrature():
    fit = fitted(uncertainties={"layer.nu": 0.0, "force": 0.1})
    fit = ul.fit(fit.problem.revised(scenes=[replace(fit.scene, friction="none", finite_strain=False)]))
    known = fit.answer(E)
    assert known.value == fit.values[E]
    for side in ("low", "high"):
        arms = [math.log(getattr(part, side) / known.value) for part in (known.statistical, known.systematic)]
        assert abs(math.log(getattr(known, side) / known.value)) == pytest.approx(math.hypot(*arms), rel=1e-9)
    assert fit.interval(E) == known.interval
    assert fit.interval(E, part="statistical") == known.statistical


def test_sources_of_the_systematic_part_add_in_quadrature():
    known = fitted().answer(E)
    sources = [own for own in known.contributions if own.origin != "seen"]
    for side in ("low", "high"):
        arm = abs(getattr(known.systematic, side) - known.value)
        together = sum(getattr(own, side) ** 2 for own in sources) ** 0.5
        # The parts add on the logarithm of the number, a tenth of it here: some per cents of the arm.
        assert arm == pytest.approx(together, rel=0.1)
        assert arm < 0.8 * sum(getattr(own, side) for own in sources)


def test_without_uncertainties_the_answer_is_the_statistical_part():
    fit = fitted(uncertainties="none")
    known = fit.answer(E)
    assert (known.low, known.high) == (known.statistical.low, known.statistical.high)
    assert known.budget["source"].to_list() == ["noise and misfit"]
    assert known.budget["share"].to_list() == pytest.approx([1.0])


def test_a_force_scale_moves_every_modulus_by_as_much():
    row = fitted(uncertainties={"force": 0.05}).answer(E).budget.set_index("source").loc["force"]
    assert row["origin"] == "given"
    assert row["high"] / fitted().values[E] == pytest.approx(math.expm1(0.05), rel=2e-3)


@pytest.mark.parametrize(
    ("path", "share", "free"),
    [
        ("indenter.radius", 0.04, (E, C, B)),
        ("layer.thickness", 0.05, (E, C, B)),
        ("indenter.radius", 0.04, (E, H, C, B)),
    ],
)
def test_a_row_of_the_budget_is_what_a_refit_with_the_input_moved_says(path, share, free):
    fit = fitted(free, uncertainties={path: share * scene().parameters[path]})
    row = fit.answer(E).budget.set_index("source").loc[path]
    moved = []
    for sign in (-1.0, 1.0):
        there = fit.scene.with_values({path: (1.0 + sign * share) * scene().parameters[path]})
        moved.append(ul.fit(fit.problem.revised(scenes=[there])).values[E] - fit.values[E])
    assert row["low"] == pytest.approx(-min(moved), rel=0.1)
    assert row["high"] == pytest.approx(max(moved), rel=0.1)


def test_assumed_sizes_are_marked_and_a_free_number_is_no_input():
    rows = fitted((E, H, C, B)).answer(E).budget.set_index("source")
    assert H not in rows.index
    assert rows.loc["indenter.radius", "origin"] == "assumed"
    assert rows.loc["layer.nu", "size"] == "± 0.04"
    assert fitted(nu=0.5).answer(E).budget.set_index("source").loc["layer.nu", "size"] == "0.48 to 0.5"


def test_what_is_free_has_no_uncertainty_beside():
    stated = scene(uncertainties={H: 1e-5})
    with pytest.raises(ul.InputError, match=r"layer\.thickness is free and has an uncertainty"):
        ul.Problem(stated, measured(), [E, H, C])


def test_intervals_of_every_level_are_nested():
    fit = fitted((E, H, C, B))
    ends = [fit.interval(H, level) for level in (0.5, 0.68, 0.9, 0.95, 0.99)]
    assert all(a.low >= b.low and a.high <= b.high for a, b in pairwise(ends))


def test_what_cannot_be_asked_is_said():
    fit = fitted()
    for name, level in ((E, 0.0), (E, 1.0), ("layer.nu", 0.95), ("nonsense", 0.95)):
        with pytest.raises(ul.InputError):
            fit.answer(name, level)
    with pytest.raises(ul.InputError, match="known: combined, statistical, systematic"):
        fit.interval(E, part="all")


@pytest.mark.parametrize("kind", ["E, h", "disturbed"])
def test_every_place_says_the_same_digits(kind, tmp_path):
    """One curve of two of the kinds; `studies/answers.py places` takes twenty of every kind."""
    written = Written.of(kind, 3, tmp_path)
    _, found = written.said(tmp_path)
    assert differences(found) == []
    assert set(found) == {"fit", "map", "JSON", "Excel", "page", "screen", "report"}


def test_a_quick_map_has_least_squares_errors_alone():
    table = ul.fit_many([measured()], scene(), [E, C, B], workers=0, options=ul.MapOptions(answers=False))
    assert f"{E}.stderr" in table.columns
    assert f"{E}.low" not in table.columns


def covered(noise, count, stated=None):
    held = 0
    for seed in range(count):
        rng, time = np.random.default_rng([5, seed]), np.linspace(0.0, 1.0, len(DEPTH))
        curve = ul.synthesize(scene(), DEPTH, noise, rng, time=time)
        fit = ul.fit(ul.Problem(scene(), curve, [E, C, B], stated))
        held += 1e6 in fit.interval(E, part="statistical")
    return held


def test_the_statistical_part_covers_and_white_noise_alone_does_not():
    """Of 60 curves 95 % are 57, give or take 1.7; white intervals under correlated noise hold a third."""
    assert covered(ul.Noise(force=2e-4), 60) >= 52
    correlated = ul.Noise(force=4e-4, correlation_time=0.05)
    assert covered(correlated, 60) >= 50
    assert covered(correlated, 60, ul.Noise()) < 40


def test_clean_curves_are_good():
    words = [fitted(seed=seed, uncertainties="none").verdict for seed in range(40)]
    assert sum(word != "good" for word in words) <= 1


def test_two_loadings_fitted_as_one_are_rejected():
    curve = measured()
    depth = np.concatenate((curve.depth, curve.depth + 0.3 * np.ptp(curve.depth)))
    found = ul.fit(ul.Problem(scene(), ul.Curve(depth, np.tile(curve.force, 2)), BOUNDED))
    assert found.verdict == "reject"
    assert "does not describe" in found.verdict.reason


def test_a_model_that_leaves_little_is_not_rejected():
    """Changed by 40 % over the range, and described to a per cent by another contact point: a number is given."""
    clean = measured()
    w = np.maximum(clean.depth, 0.0) / clean.depth.max()
    curve = ul.Curve(clean.depth, clean.force * (0.8 + 0.25 * np.sqrt(w)))
    found = ul.fit(ul.Problem(scene(), curve, BOUNDED))
    residual = found.residuals[0]
    assert np.sqrt(np.mean(residual**2)) < 0.02 * curve.force.max()
    assert found.verdict == "check"


def test_a_half_space_over_a_hidden_base_names_the_base():
    curve = measured(made=scene(thickness=4e-4))
    bare = ul.Scene(ul.Sphere(1e-3), ul.Layer(ul.Isotropic(1e6, 0.45)), uncertainties="none")
    verdict = ul.fit(ul.Problem(bare, curve, [E, C, B])).verdict
    assert verdict in ("check", "reject")
    assert "stiffer base" in verdict.cause
    assert "thickness" in verdict.next
    assert verdict.reasons[0] == verdict.reason


def test_a_thickness_that_a_touch_says_nothing_of_is_open():
    layer = ul.Layer(ul.Isotropic(1e4, 0.45), 1e-3)
    touched = ul.Scene(ul.Sphere(1e-5), layer, ul.RIGID, uncertainties="none")
    data = ul.synthesize(touched, np.linspace(-3e-10, 1e-9, 60), ul.Noise(force=1e-15), 1)
    fit = ul.fit(ul.Problem(touched, data, {E: None, H: (1e-5, 1.0), C: None}))
    assert fit.answer(H).is_open
    assert fit.verdict == "check"


def test_stated_noise_goes_the_same_way():
    curve = measured(2e-4)
    stated = ul.fit(ul.Problem(scene(uncertainties="none"), curve, [E, C, B], ul.Noise(force=2e-4)))
    half = 0.5 * math.log(stated.interval(E).high / stated.interval(E).low)
    assert half == pytest.approx(1.96 * stated.stderr[E] / stated.values[E], rel=0.02)


def test_a_joint_fit_has_one_answer_for_what_is_shared():
    second = scene(radius=3e-4)
    tests = [(scene(), measured()), (second, measured(5e-5, made=second, seed=3, depth=0.5 * DEPTH))]
    fit = ul.fit(ul.Problem.joint(tests, [E, H, C, B], [E, H]))
    assert 1e6 in fit.interval(E)
    assert 1.5e-3 in fit.interval(H)
    assert {"indenter.radius"} <= set(fit.answer(E).budget["source"])


def test_a_step_at_contact_is_taken_out_or_covered_and_said():
    curve = measured()
    held = curve.depth > 0.0
    jumped = ul.Curve(curve.depth, curve.force + 0.02 * curve.force.max() * held)
    fit = ul.fit(ul.Problem(scene(uncertainties="none"), jumped, [E, C, B]))
    known = fit.answer(E)
    assert 1e6 in known.interval
    assert known.value == fit.values[E] or any("taken out" in note for note in known.notes)


def test_a_value_without_the_dip_at_contact_lies_well_inside_its_own_interval():
    clean = Clean.of(scene(uncertainties="none"), 1.5e-4, 240)
    for seed in range(3):
        curve, _ = world_curves(clean, "adhesion", np.random.default_rng([11, seed]))
        free = {E: (1e4, 1e8), H: (3e-4, 8e-3), C: (-1e-4, 1e-4), B: None}
        fit = ul.fit(ul.Problem(scene(uncertainties="none"), curve, free))
        known = fit.answer(H)
        assert any("taken out" in note for note in known.notes)
        # The thickness of least squares is 40 % off; the interval is about 60 % wide in all.
        assert known.value == pytest.approx(1.5e-3, rel=0.3)
        assert min(known.value / known.low, known.high / known.value) > 1.05


@pytest.mark.parametrize("share", [-0.05, 0.05, 0.15])
def test_a_turn_of_the_baseline_is_taken_out_and_said(share):
    """A kink of the baseline in contact moves E by up to 25 %: to first order its correction would miss by 3 %."""
    curve = measured(seed=5)
    time = np.linspace(0.0, 1.0, len(curve.depth))
    turned = ul.Curve(curve.depth, curve.force + share * curve.force.max() * np.abs(time - 0.55))
    fit = ul.fit(ul.Problem(scene(uncertainties="none"), turned, [E, C, B]))
    known = fit.answer(E)
    assert abs(math.log(fit.values[E] / 1e6)) > 0.04
    assert abs(math.log(known.value / 1e6)) < 0.02
    assert 1e6 in known.interval
    assert any("a turn of the baseline is taken out" in note for note in known.notes)


def test_e_by_depth_is_constant_where_the_model_is_right():
    found = fitted().modulus_by_depth()
    inside = (found.apparent.low <= 1e6) & (found.apparent.high >= 1e6)
    assert inside.mean() > 0.85
    assert found.apparent_halfspace.modulus[-1] > 1.1e6


def test_a_correction_that_leads_to_no_law_leaves_the_walk_at_least_squares():
    """A film so thin at its optimum that the value without the ramp would be thinner than the tip goes deep."""
    rng = np.random.default_rng([99002, 203])
    _, made, deep, _, noise = user_test(rng)
    clean = Clean.of(made, deep, 280)
    force = clean.force + noise * clean.top * rng.standard_normal(len(clean.depth))
    bounds = {
        E: (18794.0076, 24832748.7),
        H: (1.71611763e-8, 1.06255356e-6),
        C: (-0.4 * deep, 0.4 * deep),
        B: None,
    }
    known = ul.fit(ul.Problem(made, ul.Curve(clean.depth, force, time=clean.time), bounds)).answer(E)
    assert known.low < made.layer.material.E < known.high


# At a Poisson's ratio of zero its factor of the force is 0/0; two moduli of which one curve tells one combination
# lead the draws to the edge of positive definite materials, and beyond.
EDGES = {
    "Poisson's ratio of zero": (ul.Isotropic(1e6, 0.0), {E: None, "layer.nu": (0.0, 0.5)}, 0),
    "Poisson's ratio on its lower bound": (ul.Isotropic(1e6, 0.02), {E: None, "layer.nu": (0.0, 0.5)}, 1),
    "Poisson's ratio on its upper bound": (ul.Isotropic(1e6, 0.49), {E: None, "layer.nu": (0.0, 0.5)}, 4),
    "two moduli": (
        ul.TransverselyIsotropic(E=2e6, E_axial=1e6, nu=0.3, nu_axial=0.2, G_axial=4e5),
        {E: None, "layer.E_axial": None},
        0,
    ),
}


@pytest.mark.parametrize(("material", "free", "seed"), EDGES.values(), ids=EDGES)
def test_at_the_edge_of_what_is_possible_there_is_an_answer(material, free, seed, tmp_path):
    made = ul.Scene(ul.Cone(1.2), ul.Layer(material, 1e-3), ul.RIGID)
    depth = np.linspace(-2e-5, 1e-4, 120)
    noise = ul.Noise(force=0.02 * float(made.force(depth[-1])))
    curve = ul.synthesize(made, depth, noise, np.random.default_rng(seed))
    fit = ul.fit(ul.Problem(made, curve, free))
    for name in fit.names:
        known, (lowest, highest) = fit.answer(name), (-1.0, 0.5) if name == "layer.nu" else (0.0, math.inf)
        assert known.low <= known.value <= known.high
        assert not known.low < lowest or known.low == -math.inf
        assert not known.high > highest or known.high == math.inf
        end = ul.profile(fit, name).interval()
        assert end.low <= known.value <= end.high
    assert fit.verdict.reason
    assert (fit.modulus_by_depth().apparent.modulus > 0.0).all()
    assert ul.report(fit, tmp_path / "page.html").stat().st_size > 10_000


def test_numbers_of_which_a_curve_tells_one_combination_spread_along_it():
    """The force of a flat punch is a straight line, which a thin soft layer has as well as a thick stiff one."""
    made = ul.Scene(ul.FlatPunch(1.8e-4), ul.Layer(ul.Isotropic(4e7, 0.5), 4.1e-4), ul.RIGID)
    depth = np.linspace(-1e-5, 5e-5, 77)
    noise = ul.Noise(force=0.02 * float(made.force(depth[-1])))
    free = {E: ul.LogUniform(4e5, 4e9), H: ul.LogUniform(4e-5, 4e-3)}
    for seed in range(6):
        curve = ul.synthesize(made, depth, noise, np.random.default_rng(seed))
        fit = ul.fit(ul.Problem(made, curve, free))
        known = fit.answer(E)
        # On the thickest layer it is what a half-space has, on the thinnest one what the bound leaves.
        assert 10.0 * known.low < known.high < 1e8
        assert fit.answer(H).high == math.inf
    drawn = ul.sample(fit.problem, method="importance").samples
    assert np.log(drawn[E]).std() > 0.5
    forces = [float(made.with_values(row).force(depth[-1])) for row in drawn.head(200).to_dict("records")]
    assert np.std(forces) < 0.02 * np.mean(forces)


@pytest.mark.parametrize(
    ("base", "free"),
    [
        (ul.RIGID, {E: (1e4, 1e9), H: (1e-4, 1e-2)}),
        (ul.Isotropic(7e5, 0.3), {E: None, B: None}),
        (ul.Isotropic(1e6, 0.3), {E: None, H: None, "layer.nu": (0.0, 0.5), "substrate.E": (1e2, 1e12)}),
    ],
)
def test_a_curve_without_contact_sets_no_lower_limit(base, free):
    """The search ends in a corner of the bounds, or so far away that no draw has a contact law."""
    assumed = ul.Scene(ul.Paraboloid(3e-3), ul.Layer(ul.Isotropic(1e6, 0.45), 1e-3), base)
    depth = np.linspace(-2e-5, 1e-4, 120)
    force = 1e-9 * np.random.default_rng(1).standard_normal(len(depth))
    fit = ul.fit(ul.Problem(assumed, ul.Curve(depth, force), free))
    assert fit.answer(E).low == -math.inf
    assert fit.verdict != "good"


@pytest.mark.parametrize("approach", [2e-6, 5e-6, 1e-5])
def test_a_punch_that_begins_close_to_contact_is_fitted_at_its_kink(approach):
    """Contacts before the first reading explain a straight line equally badly, and no search leaves them."""
    layer = ul.Layer(ul.Isotropic(8e5, 0.45), 1e-3)
    made = ul.Scene(ul.FlatPunch(6e-4), layer, ul.RIGID, uncertainties="none")
    depth = np.linspace(-approach, 6e-5, 400)
    for seed in range(3):
        curve = ul.synthesize(made, depth, ul.Noise(force=2e-3), np.random.default_rng(seed))
        free = {E: (1e4, 1e8), C: (-5e-5, 5e-5), B: None}
        known = ul.fit(ul.Problem(made, curve, free)).answer(E)
        assert known.value == pytest.approx(8e5, rel=0.01)
        assert 8e5 in known.interval


@pytest.mark.parametrize("tip", [ul.Sphere(3e-3), ul.Cone(math.radians(60)), ul.FlatPunch(6e-4)])
def test_numbers_that_move_the_force_alike_are_not_determined(tip):
    """E and Poisson's ratio of a half-space scale the force alike: their covariance is singular."""
    layer = ul.Layer(ul.Isotropic(1e6, 0.45))
    made = ul.Scene(tip, layer, uncertainties="none")
    curve = ul.synthesize(made, np.linspace(-2e-5, 1e-4, 300), ul.Noise(force=1e-4), np.random.default_rng(1))
    fit = ul.fit(ul.Problem(made, curve, {E: (1e4, 1e8), "layer.nu": (0.0, 0.5), C: (-5e-5, 5e-5), B: None}))
    assert 1e6 in fit.answer(E).interval
    assert "not determined" in fit.verdict.reason


def test_a_free_slope_is_as_certain_as_a_straight_line_before_contact():
    """A ramp of the force beside it would only say the same once more."""
    depth = np.linspace(-1e-6, 1e-6, 800)
    half = ul.Scene(ul.Paraboloid(2.5e-6), ul.Layer(ul.Isotropic(5e3, 0.5)), uncertainties="none")
    for seed in range(3):
        curve = ul.synthesize(half, depth, ul.Noise(force=2e-11), np.random.default_rng(seed))
        tilted = ul.Curve(depth, curve.force + 1e-4 * depth)
        slope = "instrument.baseline_slope"
        fit = ul.fit(ul.Problem(half, tilted, {E: (1e1, 1e6), C: (-5e-7, 8e-7), B: None, slope: None}))
        before = depth < 0.0
        line = 1.96 * 2e-11 / (np.sqrt(before.sum()) * depth[before].std())
        known = fit.interval(slope, part="statistical")
        assert 1e-4 in known
        assert known.high - known.low < 4.0 * line


def test_the_less_the_noise_the_shorter_the_interval():
    """Zeros before contact are not the steps of a coarse converter."""
    made = ul.Scene(ul.Paraboloid(3e-3), ul.Layer(ul.Isotropic(5e5, 0.45)), uncertainties="none")
    depth = np.linspace(-2e-5, 1e-4, 300)
    force = made.contact_law(1e-4).force(np.maximum(depth, 0.0))
    rng, widths = np.random.default_rng(3), []
    for noise in (1e-3, 1e-5, 0.0):
        noisy = ul.Curve(depth, force + noise * force.max() * rng.standard_normal(300))
        known = ul.fit(ul.Problem(made, noisy, {E: (1e4, 1e8), C: (-5e-5, 5e-5), B: None})).answer(E)
        assert known.value == pytest.approx(5e5, rel=0.01)
        widths.append(known.high / known.low - 1.0)
    assert widths[0] > widths[1] > widths[2]


@pytest.mark.parametrize("approach", [0.0, 3e-6])
def test_a_sample_that_relaxes_is_no_drifting_baseline(approach):
    """Without readings before contact nothing tells a drift from a misfit: the value stays as fitted."""
    time = np.arange(0.0, 1.2 + approach / 1e-4, 0.01)
    depth = 1e-4 * time - approach
    memory = ul.Prony((0.4,), (1.0,))
    layer = ul.Layer(ul.Isotropic(1e6, 0.46), 1.2e-3)
    elastic = ul.Scene(ul.Sphere(5e-4), layer, ul.RIGID)
    relaxing = replace(elastic, layer=replace(layer, relaxation=memory))
    curve = ul.synthesize(relaxing, depth, ul.Noise(force=2e-4), 8, time=time)
    apparent = 1e6 * relaxing.force(depth, time)[-1] / elastic.force(depth)[-1]
    free = {
        "layer.E": (1e4, 1e8),
        "instrument.contact_depth": (-5e-5, 8e-5),
        "instrument.baseline": (-0.1, 0.1),
    }
    fit = ul.fit(ul.Problem(elastic, ul.Curve(depth, curve.force), free))
    answer = fit.answer("layer.E")
    assert answer.value == fit.values["layer.E"]
    assert answer.low < apparent < answer.high
    assert not answer.notes


def test_no_end_passes_the_bounds_of_the_fit():
    """A thickness that its inputs move by a factor stays within what was allowed."""
    bounds = (1.3e-3, 1.75e-3)
    curve = measured(noise=5e-5)
    free = {E: (1e4, 1e8), H: bounds, C: None}
    answer = ul.fit(ul.Problem(scene(uncertainties={"layer.nu": 0.2}), curve, free)).answer(H)
    assert bounds[0] <= answer.low < answer.value < answer.high <= bounds[1]
    assert answer.low == bounds[0] or answer.high == bounds[1]
