"""Layers that stiffen, and samples with sides, in scenes, files and fits; and that nothing of it runs elsewhere."""

import html
import sys
from dataclasses import replace

import numpy as np
import pytest

import underlay as ul
from underlay.report.screen import fit_lines

R = 25e-6
TIP = ul.Sphere(R)
SCENE = ul.Scene(TIP, ul.Layer(ul.Isotropic(3e3, 0.5), 4.0 * R, stiffening=ul.Gent(1.0)), ul.RIGID)
SIDES = replace(SCENE, layer=replace(SCENE.layer, half_width=8.0 * R, shape="block"))
LINEAR = replace(SCENE, layer=replace(SCENE.layer, stiffening=None))
NARROW = replace(LINEAR, layer=replace(LINEAR.layer, half_width=6.0 * R))
DEPTH = np.linspace(-0.1, 0.35, 120) * R
FORCE = float(SCENE.force(DEPTH[-1]))
FREE = {
    "layer.E": ul.LogUniform(1e2, 1e6),
    "instrument.contact_depth": (-0.2 * R, 0.2 * R),
    "instrument.baseline": (-FORCE, FORCE),
    "layer.stiffening.inverse_limit": None,
}
LIMIT, FORM, HEIGHTS = (f"layer.stiffening.{name}" for name in ("inverse_limit", "form", "height_spread"))


def made(scene=SCENE, share=0.003, seed=0):
    return ul.synthesize(scene, DEPTH, ul.Noise(force=share * FORCE), rng=seed)


def problem(scene=SCENE, free=FREE, **options):
    return ul.Problem(scene, made(scene, **options), free)


# --- scenes and files -----------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    "layer",
    [
        SCENE.layer,
        SIDES.layer,
        NARROW.layer,
        replace(SCENE.layer, stiffening=ul.Gent(0.5, form=-0.2, height_spread=1e-7), bond="slip"),
    ],
)
def test_scene_files(layer, tmp_path):
    scene = replace(SCENE, layer=layer)
    assert ul.load_scene(scene.save(tmp_path / "scene.toml")) == scene


def test_a_scene_file_as_people_write_it(tmp_path):
    path = tmp_path / "scene.toml"
    path.write_text(
        '[indenter]\nshape = "sphere"\nradius = "25 um"\n\n'
        '[layer]\nE = "3 kPa"\nnu = 0.5\nthickness = "100 um"\nhalf_width = "0.2 mm"\nshape = "block"\n\n'
        '[layer.stiffening]\nmodel = "gent"\ninverse_limit = 1.0\n\n[substrate]\nrigid = true\n'
    )
    assert ul.load_scene(path) == SIDES


@pytest.mark.parametrize(
    ("written", "instead", "message"),
    [
        (
            'model = "gent"',
            'model = "ogden"',
            r"\[layer.stiffening\] model: 'ogden' is not known; allowed: gent",
        ),
        ("inverse_limit = 1.0", "limit = 1.0", "inverse_limit"),
        ("inverse_limit = 1.0", "inverse_limit = -0.1", "zero \\(neo-Hookean\\) or more; got -0.1"),
        ('shape = "block"', 'shape = "disc"', r"\[layer\] shape"),
        ('half_width = "0.0002 m"', 'half_width = "2 Pa"', r"\[layer\] half_width"),
        ('shape = "sphere"', 'shape = "paraboloid"', "true spheres; a paraboloid is one below"),
        ("rigid = true", 'E = "1 MPa"\nnu = 0.3', "here an elastic base"),
        ("nu = 0.5", "nu = 0.2", r"nu from 0\.3 to 0\.5; here 0\.2"),
    ],
)
def test_scene_files_that_are_refused(written, instead, message, tmp_path):
    path = SIDES.save(tmp_path / "scene.toml")
    text = path.read_text()
    assert written in text
    path.write_text(text.replace(written, instead, 1))
    with pytest.raises(ul.InputError, match=message) as raised:
        ul.load_scene(path)
    assert "\n" not in str(raised.value)


def test_an_infinite_width_is_none():
    layer = ul.Layer(ul.Isotropic(3e3, 0.5), 4.0 * R, half_width=np.inf)
    assert layer == LINEAR.layer
    assert layer.linear is layer


def test_effects():
    table = SIDES.effects(0.3 * R).set_index("effect")
    at = np.array([0.3 * R])
    whole, wide = SIDES.force(at), SCENE.force(at)
    soft = replace(SCENE, layer=replace(SCENE.layer, stiffening=ul.Gent(0.0))).force(at)
    expected = {"sides": whole / wide, "stiffening": wide / soft, "finite strain": soft / LINEAR.force(at)}
    for name, ratio in expected.items():
        assert table.loc[name, "simulated"]
        assert table.loc[name, "size_percent"] == pytest.approx(100.0 * (ratio[0] - 1.0), rel=1e-6)
    assert not {"sides", "stiffening"} & set(LINEAR.effects(0.3 * R)["effect"])


def test_load_control_is_the_inverse():
    depth = np.linspace(0.02, 0.35, 7) * R
    assert SIDES.depth(SIDES.force(depth)) == pytest.approx(depth, rel=1e-8)


def test_nothing_of_it_runs_where_nothing_stiffens_and_there_are_no_sides():
    places = ("mechanics/stiffening", "mechanics/finite_width", "on_law")

    def calls(scene, free):
        count = 0

        def seen(frame, event, _):
            nonlocal count
            name = frame.f_code.co_filename.replace("\\", "/")
            count += event == "call" and any(place in name for place in places)

        curve = made(scene)
        ul.fit(ul.Problem(scene, curve, free)).answer("layer.E")  # what is imported is not counted
        sys.setprofile(seen)
        try:
            scene.force(DEPTH)
            scene.effects(0.3 * R)
            found = ul.fit(ul.Problem(scene, curve, free))
            assert found.answer("layer.E").value > 0.0
        finally:
            sys.setprofile(None)
        return count

    elastic = {path: known for path, known in FREE.items() if path != LIMIT}
    assert calls(LINEAR, elastic) == 0
    assert calls(SCENE, FREE) > 0


# --- the model of a problem -----------------------------------------------------------------------------------

ALL = {
    "layer.E": None,
    "layer.thickness": ul.Normal(4.0 * R, 0.2 * R),
    "indenter.radius": ul.Normal(R, 0.05 * R),
    "instrument.contact_depth": None,
    LIMIT: None,
    FORM: None,
    HEIGHTS: None,
}


@pytest.mark.parametrize("scene", [SCENE, SIDES, NARROW])
@pytest.mark.parametrize("compliance", [0.0, 0.3])
def test_slopes_are_derivatives(scene, compliance):
    stiff = scene.layer.stiffening is not None
    free = {path: known for path, known in ALL.items() if stiff or "stiffening" not in path}
    if scene.layer.half_width is not None:
        free["layer.half_width"] = None
    instrument = ul.Instrument(compliance=compliance * R / FORCE)
    posed = problem(replace(scene, instrument=instrument), free)
    member, physical = posed.members[0], posed.physical(posed.start)
    _, columns = member.jacobian(physical)
    for entry, name in enumerate(posed.names):
        step = 1e-4 * (abs(physical[entry]) or (R if name.endswith("depth") else 1.0))
        up, down = (member.model(physical + sign * step * np.eye(len(physical))[entry]) for sign in (1, -1))
        measured = (up - down) / (2.0 * step)
        assert columns[:, entry] == pytest.approx(measured, rel=2e-4, abs=2e-5 * np.abs(measured).max()), name


@pytest.mark.parametrize("scene", [SCENE, SIDES, NARROW])
def test_the_model_is_the_scene_and_many_sets_are_each_alone(scene):
    free = {path: known for path, known in FREE.items() if scene.layer.stiffening or path != LIMIT}
    posed = problem(scene, {**free, **({FORM: None, HEIGHTS: None} if scene.layer.stiffening else {})})
    rng = np.random.default_rng(0)
    physical = posed.physical(0.1 * rng.standard_normal((6, len(posed.names))))
    member = posed.members[0]
    together = member.readings(physical)
    assert together.possible.all()
    for row, one in enumerate(physical):
        alone = member.reading(one)
        scale = np.abs(alone.contact).max()
        assert together.contact[row] == pytest.approx(alone.contact, abs=3e-6 * scale)
        assert together.force[row] == pytest.approx(alone.force, abs=3e-6 * scale)
        assert together.stiffness[row] == pytest.approx(alone.stiffness, abs=3e-5 * alone.stiffness.max())
        simulated = member.scene_at(one).force(DEPTH)
        assert alone.force == pytest.approx(simulated, abs=3e-6 * scale)


@pytest.mark.parametrize("scene", [SCENE, SIDES, NARROW])
def test_sets_of_many_thicknesses_are_each_alone(scene):
    free = {path: known for path, known in FREE.items() if scene.layer.stiffening or path != LIMIT}
    posed = problem(scene, {**free, "layer.thickness": ul.Normal(4.0 * R, 0.2 * R)})
    physical = np.tile(posed.physical(posed.start), (12, 1))
    physical[:, posed.names.index("layer.thickness")] = 4.0 * R * np.geomspace(0.5, 40.0, 12)
    member = posed.members[0]
    together = member.readings(physical)
    assert together.possible.all()
    for row, one in enumerate(physical):
        alone = member.reading(one)
        assert together.contact[row] == pytest.approx(alone.contact, abs=1e-6 * np.abs(alone.contact).max())
        assert together.stiffness[row] == pytest.approx(alone.stiffness, abs=1e-5 * alone.stiffness.max())


def test_sets_that_are_out_of_reach_do_not_exist():
    posed = problem()
    physical = np.tile(posed.physical(posed.start), (3, 1))
    physical[1, posed.names.index(LIMIT)] = 200.0
    physical[2, posed.names.index("instrument.contact_depth")] = -1.0 * R
    readings = posed.members[0].readings(physical)
    assert readings.possible.tolist() == [True, False, False]
    with pytest.raises(ul.RangeError, match="known up to"):
        posed.members[0].reading(physical[1])
    rough = problem(free={**FREE, HEIGHTS: None})
    physical = np.tile(rough.physical(rough.start), (2, 1))
    physical[1, rough.names.index(HEIGHTS)] = 100.0 * R
    assert rough.members[0].readings(physical).possible.tolist() == [True, False]
    with pytest.raises(ul.RangeError, match="a height_spread so large is beyond it at any depth"):
        rough.members[0].reading(physical[1])


def test_a_lever_whose_calibration_is_off():
    lever = ul.Lever(spring_constant=0.1, spring_constant_ratio=1.1)
    scene = replace(SIDES, lever=lever)
    posed = ul.Problem(scene, made(scene), {**FREE, "lever.spring_constant_ratio": ul.LogNormal(1.0, 0.1)})
    start = posed.physical(posed.start)
    assert posed.members[0].model(start) == pytest.approx(scene.force(DEPTH), abs=1e-6 * FORCE)


# --- what is free ---------------------------------------------------------------------------------------------


def test_priors_where_nothing_is_said():
    posed = problem(free={**FREE, FORM: None, HEIGHTS: None, "layer.E": ul.LogUniform(1e2, 1e6)})
    known = {coordinate.path: coordinate for coordinate in posed.coordinates}
    assert known[LIMIT].prior == ul.LogNormal(0.5, 1.6)
    assert known[FORM].prior == ul.Normal(0.0, 0.3)
    assert known[HEIGHTS].prior == ul.LogNormal(0.02 * R, 1.5)
    assert known[HEIGHTS].reference == pytest.approx(0.02 * R)
    assert known[LIMIT].reference == 1.0
    own = problem(free={**FREE, LIMIT: (0.1, 3.0)})
    assert own.coordinates[-1].prior == ul.LogUniform(0.1, 3.0)


def test_thickness_and_stiffening_are_not_told_apart():
    with pytest.raises(ul.ParameterError, match="Normal prior of 5 % or better") as raised:
        problem(free={**FREE, "layer.thickness": (R, 10.0 * R)})
    assert "\n" not in str(raised.value)
    problem(free={**FREE, "layer.thickness": ul.Normal(4.0 * R, 0.2 * R)})


def test_a_discrepancy_beside_it_is_refused():
    free = {path: known for path, known in FREE.items() if path != LIMIT}
    with pytest.raises(ul.InputError, match=r"its own is layer\.stiffening\.form"):
        ul.free_model_error(problem(free=free))


# --- fits -----------------------------------------------------------------------------------------------------


def test_a_fit_finds_small_strain_modulus_and_stiffening():
    fit = ul.fit(problem())
    answer, limit = fit.answer("layer.E"), fit.answer(LIMIT)
    assert answer.low < 3e3 < answer.high
    assert answer.value == pytest.approx(3e3, rel=0.02)
    assert limit.low < 1.0 < limit.high
    rows = set(answer.budget["source"])
    assert {"stiffening formula", "form of the energy", "gradual contact", "finite strain"} <= rows
    assert {"layer.thickness", "indenter.radius", "layer.nu"} <= rows
    assert "sides" not in rows
    factor = fit.answer("layer.stiffening_factor")
    law = SCENE.contact_law(DEPTH[-1])
    assert factor.low < law.stiffening(DEPTH[-1:])[0] < factor.high
    assert "layer.stiffening_factor" in fit.answers.index


def test_a_thickness_beside_stiffening_leaves_intervals_of_the_width_of_bars():
    """Noise is white and h known to 5 %: nothing else widens them."""
    fit = ul.fit(problem(free={**FREE, "layer.thickness": ul.Normal(4.0 * R, 0.2 * R)}))
    for name in (path for path in FREE if path != "instrument.baseline"):  # which may wiggle
        told = fit.answer(name).statistical
        width = np.log(told.high / told.low) if name == "layer.E" else told.high - told.low
        bar = fit.stderr[name] / (fit.values[name] if name == "layer.E" else 1.0)
        assert 0.9 < width / (2.0 * 1.96 * bar) < 1.7, name


def test_stiffening_that_is_not_told_from_zero_has_a_bound_above_alone():
    """By its logarithm a source of 0.3 makes a factor of 40 of a value of 0.08."""
    depth = np.linspace(-0.1, 0.2, 120) * R
    scene = body(stiffening=ul.Gent(0.0))
    curve = ul.synthesize(scene, depth, ul.Noise(force=0.003 * float(scene.force(depth[-1]))), rng=0)
    fit = ul.fit(ul.Problem(body(stiffening=ul.Gent(0.5)), curve, FREE))
    answer = fit.answer(LIMIT)
    assert answer.low == answer.statistical.low == 0.0
    assert answer.value < answer.statistical.high < answer.high < 2.0
    assert fit.verdict.reason.startswith(f"{LIMIT} may as well be zero: it is below {answer.high:.2g}")


def test_depths_at_which_the_form_matters_are_a_warning():
    assert not ul.fit(problem()).warnings
    thin = replace(SCENE, layer=replace(SCENE.layer, thickness=2.0 * R))
    curve = ul.synthesize(thin, DEPTH, ul.Noise(force=0.003 * FORCE), rng=0)
    fit = ul.fit(ul.Problem(thin, curve, FREE))
    assert any("another form of the strain energy gives another modulus" in str(one) for one in fit.warnings)
    assert fit.law_reason.startswith("exact: stiffening, 1/Jm = ")


def test_the_form_of_the_energy_shifts_as_fits_at_its_sizes_do():
    """Sizes that the curve allows, one by one, with heights as they are; the row searches several at once."""
    curve = made()
    row = (
        ul.fit(ul.Problem(SCENE, curve, FREE))
        .answer("layer.E")
        .budget.set_index("source")
        .loc["form of the energy"]
    )
    found = []
    for size in np.linspace(-0.66, 0.66, 45):
        scene = replace(SCENE, layer=replace(SCENE.layer, stiffening=ul.Gent(1.0, form=size)))
        try:
            fit = ul.fit(ul.Problem(scene, curve, FREE, ul.Noise(force=0.003 * FORCE)))
        except ul.FitError:
            continue
        off = np.log(fit.values[LIMIT] / 0.5) / 1.6  # as its prior has it
        found.append((fit.statistics.chi_square + off**2, fit.values["layer.E"]))
    squares, moduli = np.array(found).T
    # What the formula of Ogden's energy leaves at worst is no evidence: 5.3e-4 of the largest force.
    allowed = 5.3e-4 / 0.003 * np.sqrt(len(DEPTH)) + 1.96
    inside = np.flatnonzero(np.sqrt(squares - squares.min()) <= allowed)
    fitted = ul.fit(ul.Problem(SCENE, curve, FREE)).values["layer.E"]
    # At large sizes E falls; the row ends between the last size inside and the next.
    last = fitted - moduli[inside[-1]], fitted - moduli[inside[-1] + 1]
    assert 0.95 * last[0] < row["low"] < 1.05 * last[1]
    assert last[1] < 1.5 * last[0]
    assert row["high"] == pytest.approx(moduli[inside].max() - fitted, rel=0.05)


@pytest.mark.parametrize("limit", [0.0, 0.1, 1.0])
def test_the_form_of_the_energy_goes_to_both_sides(limit):
    """On a thin layer 1/Jm near zero grows many times beside a form that softens."""
    scene = replace(SCENE, layer=replace(SCENE.layer, thickness=2.0 * R, stiffening=ul.Gent(limit)))
    depth = np.linspace(-0.1, 0.2, 240) * R
    noise = ul.Noise(force=0.003 * float(scene.force(depth[-1])))
    for seed in range(3):
        curve = ul.synthesize(scene, depth, noise, rng=seed)
        posed = ul.Problem(scene.with_values({LIMIT: 0.5}), curve, FREE)
        row = ul.fit(posed).answer("layer.E").budget.set_index("source").loc["form of the energy"]
        assert row["low"] > 0.02 * 3e3
        assert row["high"] > 0.02 * 3e3


@pytest.mark.parametrize("free", [FREE, {**FREE, FORM: None, HEIGHTS: None}])
def test_answers_do_not_depend_on_where_the_scene_begins(free):
    begun = {"layer.E": 1.5e3, LIMIT: 0.4}
    first, second = (
        ul.fit(ul.Problem(scene, made(), free)).answer("layer.E")
        for scene in (SCENE, SCENE.with_values(begun))
    )
    width = first.high - first.low
    for name in ("value", "low", "high"):
        assert getattr(second, name) == pytest.approx(getattr(first, name), abs=0.03 * width)


@pytest.mark.parametrize("limit", [0.3, 1.0, 5.0])
def test_priors_do_not_make_searches_long(limit):
    """With first derivatives alone the second, in which forms and heights are free too, takes 40 evaluations."""
    scene = SCENE.with_values({LIMIT: limit})
    for more, most in (({}, 8), ({FORM: None, HEIGHTS: None}, 14)):
        statistics = ul.fit(ul.Problem(SCENE, made(scene), FREE | more)).statistics
        assert statistics.success
        assert statistics.evaluations <= most


def test_what_is_free_is_no_row():
    fit = ul.fit(problem(free={**FREE, FORM: None, HEIGHTS: None}))
    answer = fit.answer("layer.E")
    assert answer.low < 3e3 < answer.high
    assert not {"form of the energy", "gradual contact"} & set(answer.budget["source"])


def test_sides_are_a_row():
    fit = ul.fit(problem(SIDES))
    assert {"sides", "stiffening formula"} <= set(fit.answer("layer.E").budget["source"])
    narrow = ul.fit(problem(NARROW, {path: known for path, known in FREE.items() if path != LIMIT}))
    answer = narrow.answer("layer.E")
    assert "sides" in set(answer.budget["source"])
    assert answer.low < 3e3 < answer.high


def test_leaving_stiffening_out_is_wrong_by_more_than_the_noise():
    """8 % on a half-space at w = 0.5 R, s = 1; here, h = 4 R and w = 0.35 R, 3 % and a standard error of 0.1."""
    free = {path: known for path, known in FREE.items() if path != LIMIT}
    linear = ul.fit(ul.Problem(LINEAR, made(share=0.001), free))
    assert linear.values["layer.E"] > 3e3 + 10.0 * linear.stderr["layer.E"]


# --- what else a curve may be -----------------------------------------------------------------------------------


def body(thickness=np.inf, stiffening=None):
    layered = bool(np.isfinite(thickness))
    layer = ul.Layer(ul.Isotropic(3e3, 0.5), thickness, stiffening=stiffening)
    return ul.Scene(TIP, layer, ul.RIGID if layered else None, friction="none")


def linear_fit(thickness, limit, deepest, **options):
    depth = np.linspace(-0.1, deepest, 120) * R
    scene = body(thickness, ul.Gent(limit))
    top = float(scene.force(depth[-1]))
    curve = ul.synthesize(scene, depth, ul.Noise(force=0.003 * top), rng=0)
    posed = replace(body(thickness), **options)
    return ul.fit(
        ul.Problem(posed, curve, {path: FREE[path] for path in ("layer.E", "instrument.contact_depth")})
    )


@pytest.mark.parametrize(
    ("thickness", "limit", "deepest"), [(2.0 * R, 1.0, 0.3), (4.0 * R, 3.0, 0.35), (10.0 * R, 2.0, 0.5)]
)
def test_a_linear_fit_says_that_the_sample_stiffens_and_what_to_set(thickness, limit, deepest):
    verdict = linear_fit(thickness, limit, deepest).verdict
    assert verdict == "check"
    assert "the sample stiffens with strain" in verdict.cause
    assert verdict.setting == ("layer.stiffening.model", "gent")


def test_the_screen_says_where_it_is_set_and_the_report_that_it_may_be(tmp_path):
    """A report is read by people without the scene file: of its keys only the screen speaks."""
    fit = linear_fit(4.0 * R, 3.0, 0.35)
    said = " ".join(" ".join(fit_lines(fit)).split())
    assert 'inverse_limit (1/Jm, such as 0.5) free: model = "gent" in [layer.stiffening]' in said
    text = html.unescape(ul.report(fit, tmp_path / "report.html").read_text(encoding="utf-8"))
    assert "inverse_limit (1/Jm, such as 0.5) free." in text
    assert "[layer.stiffening]" not in text.partition("<details")[0]


def test_where_stiffening_is_not_known_the_verdict_does_not_ask_for_it():
    verdict = linear_fit(4.0 * R, 3.0, 0.35, friction="stuck").verdict
    assert verdict.setting[0] == "curve.fit_to"
    verdict = linear_fit(np.inf, 4.0, 0.5).verdict
    assert verdict.cause == "a stiffer base below the layer, or a sample that stiffens with strain"


MODELS = {
    "linear": (body(), {}),
    "stiffening": (body(stiffening=ul.Gent(0.5)), {LIMIT: None}),
    "gradual contact": (body(stiffening=ul.Gent(0.0, height_spread=0.02 * R)), {HEIGHTS: None}),
    "substrate below": (body(5.0 * R), {"layer.thickness": ul.LogUniform(2.0 * R, 20.0 * R)}),
}
TRUTHS = {
    "linear": body(),
    "stiffening": body(stiffening=ul.Gent(3.0)),
    "gradual contact": body(stiffening=ul.Gent(0.0, height_spread=0.05 * R)),
    "substrate below": body(5.0 * R),
}


@pytest.mark.parametrize(
    "truth",
    [
        "stiffening",
        "gradual contact",
        *(pytest.param(n, marks=pytest.mark.study) for n in ("linear", "substrate below")),
    ],
)
def test_the_evidence_names_what_the_sample_is_and_what_each_makes_of_its_modulus(truth):
    depth = np.linspace(-0.1, 0.5, 120) * R
    top = float(TRUTHS[truth].force(depth[-1]))
    noise = ul.Noise(force=0.003 * top)
    curve = ul.synthesize(TRUTHS[truth], depth, noise, rng=0)
    known = {"layer.E": ul.LogUniform(3e2, 3e4), "instrument.contact_depth": ul.Uniform(-0.2 * R, 0.2 * R)}
    models = {}
    for name, (scene, more) in MODELS.items():
        posed = ul.Problem(scene, curve, known | more, noise)
        models[name] = posed, ul.sample(posed, method="importance", rng=0)
    table = ul.compare_models(models)
    assert table["probability"].idxmax() == truth
    assert table.loc[truth, "probability"] > 0.85
    moduli = {name: posterior.answer("layer.E") for name, (_, posterior) in models.items()}
    assert moduli[truth].low < 3e3 < moduli[truth].high
    if truth != "linear":
        assert abs(moduli["linear"].value / 3e3 - 1.0) > 0.05


def test_a_plan_says_how_deep_tells_stiffening():
    depths = np.array([0.1, 0.2, 0.3, 0.5, 0.7]) * R
    free = {path: FREE[path] for path in ("layer.E", "instrument.contact_depth", LIMIT)}
    noise = ul.Noise(force=0.003 * FORCE)
    found = ul.plan(
        body(stiffening=ul.Gent(1.0)), free=free, noise=noise, radii=[R], depths=depths, parameter=LIMIT
    )
    error = found.stderr[0]
    assert (np.diff(error[:4]) < 0.0).all()
    assert error[3] < 0.15
    assert error[0] > 0.5
    assert np.isnan(error[4])
    assert "known up to w/R = 0.6" in found.refusals[0, 4]
