"""The interval, the verdict and the inputs that a fit states: laws first, then what the data leave open."""

import json
import math
from dataclasses import FrozenInstanceError
from types import SimpleNamespace

import numpy as np
import pytest
from scipy import stats

import underlay as ul
from support.inverse import ambiguous
from support.worlds import Clean, assumed, disturbed
from underlay.inference.headline.averaged import averaged_fit
from underlay.inference.headline.known_inputs import FORCE
from underlay.inference.headline.plain import quadratic_interval
from underlay.inference.least_squares.fit_result import Verdict
from underlay.report import words
from underlay.report.intervals import Estimate

E, H, C = "layer.E", "layer.thickness", "instrument.contact_depth"
NOISE = ul.Noise(force=1e-4)


def scene(**changes):
    values = {"radius": 1e-3, "E": 1e6, "nu": 0.45, "thickness": 1.5e-3} | changes
    layer = ul.Layer(ul.Isotropic(values["E"], values["nu"]), values["thickness"])
    return ul.Scene(ul.Paraboloid(values["radius"]), layer, ul.RIGID)


def curve(noise=NOISE, seed=1, made=None):
    return ul.synthesize(made or scene(), np.linspace(-3e-5, 1.2e-4, 200), noise, seed)


def fitted(noise=NOISE, free=(E, C), **changes):
    return ul.fit(ul.Problem(scene(**changes), curve(), free, noise))


def test_a_stated_noise_and_a_linear_parameter_have_the_quadratic_interval():
    fit = fitted()
    found = fit.interval(E)
    assert found.kind == "quadratic"
    assert found == fit.interval(E)
    half = stats.norm.ppf(0.975) * fit.stderr[E] / fit.values[E]
    assert math.log(found.high / found.value) == pytest.approx(half, rel=1e-9)
    assert found.low * found.high == pytest.approx(found.value**2, rel=1e-12)
    with pytest.raises(FrozenInstanceError):
        found.low = 0.0


def test_the_interval_is_the_profiles_where_the_quadratic_one_is_not_good():
    # A base that might be rigid: its modulus has a lower end and no upper one.
    base = ul.Isotropic(1e9, 0.3)
    made = ul.Scene(ul.Paraboloid(1e-3), ul.Layer(ul.Isotropic(1e6, 0.45), 1e-3), base)
    noise = ul.Noise(force=1e-2)
    problem = ul.Problem(made, curve(noise, made=made), [E, "substrate.E"], noise)
    fit = ul.fit(problem)
    found = fit.interval("substrate.E")
    assert found.kind == "profile"
    walked = ul.profile(fit, "substrate.E").interval()
    assert walked.low_reason == "data"
    assert walked.high_reason != "data"
    # Both read a monotone cubic through steps of half a unit of z.
    assert found.low == pytest.approx(walked.low, rel=1e-2)
    assert found.high == math.inf
    assert found.is_open
    assert fit.verdict == "doubtful"


def test_levels_are_nested_and_names_are_checked():
    fit = fitted(noise=None)
    narrow, wide = fit.interval(E, 0.68), fit.interval(E, 0.99)
    assert wide.low < narrow.low < narrow.value < narrow.high < wide.high
    with pytest.raises(ul.InputError, match="not free here; free are"):
        fit.interval("layer.nu")
    with pytest.raises(ul.InputError, match="level must be above 0"):
        fit.interval(E, 1.0)


def test_without_a_stated_noise_the_interval_is_about_the_least_squares_value():
    fit = fitted(noise=None)
    found, plain = fit.interval(E), quadratic_interval(fit, E, 0.95)
    assert found.value == fit.values[E]
    assert fit.verdict == "good"
    ratio = math.log(found.high / found.low) / math.log(plain.high / plain.low)
    assert ratio > 0.8
    assert 1e6 in found


def test_noise_that_is_stated_to_be_white_is_not_averaged():
    fit = fitted(noise=ul.Noise())
    assert fit.interval(E) == quadratic_interval(fit, E, 0.95)
    unsaid = fitted(noise=None).interval(E)
    assert unsaid.high / unsaid.low >= fit.interval(E).high / fit.interval(E).low


def test_the_profile_of_an_averaged_fit_ends_where_its_interval_does():
    made = scene(thickness=2e-2)
    data = curve(ul.Noise(force=1e-3), made=made)
    problems = [
        ul.Problem(made, data, {E: None, H: (1e-4, 1.0), C: None}),
    ]
    for fit in map(ul.fit, problems):
        for name in {E, H} & set(fit.names):
            walked = ul.profile(fit, name)
            assert walked.averaged
            assert "averaged over correlated noise" in walked.basis()
            for level in (0.68, 0.95):
                stated, read = fit.interval(name, level), walked.interval(level)
                # Ends that are read by a monotone cubic between ends which are these very ones; walked ones anew.
                allowed = 1e-6 if stated.kind == "averaged" else 0.05
                for end, known, reason in (
                    (read.low, stated.low, read.low_reason),
                    (read.high, stated.high, read.high_reason),
                ):
                    assert (reason == "data") == math.isfinite(known)
                    if math.isfinite(known):
                        width = math.log(stated.high / stated.low) if math.isfinite(stated.high) else 1.0
                        assert math.log(end / known) == pytest.approx(0.0, abs=allowed * width)


def half_space_of(sample, rng):
    """Fit of a half-space, to a curve with white noise."""
    data = disturbed(Clean.of(sample, 1.2e-4, 300), "Hertz on a layer", rng, 0.003)
    return ul.fit(ul.Problem(assumed(sample, "Hertz on a layer"), data, [E, C, "instrument.baseline"]))


def test_an_interval_leaves_out_less_where_the_exact_law_is_given_up():
    rng = np.random.default_rng(12)
    bare = assumed(scene(), "Hertz on a layer")
    own = averaged_fit(half_space_of(bare, rng))
    assert own.exact_law > 0.5
    assert own.inside(0.95) == 0.95
    for thickness in (6e-4, 1e-3, 1.5e-3):
        fit = half_space_of(scene(thickness=thickness), rng)
        assert fit.verdict.word == "model wrong"
        assert fit.interval(E).value == fit.values[E]
        left = 1.0 - averaged_fit(fit).inside(0.95)
        assert left < 0.05 * 0.1


@pytest.mark.parametrize(("world", "gives_up"), [("clean", False), ("drag step", True), ("AR(1)", True)])
def test_an_interval_leaves_out_less_where_a_fitted_shape_may_take_up_what_disturbs_a_curve(world, gives_up):
    made = scene(thickness=6e-4)
    data = disturbed(Clean.of(made, 1.5e-4, 300), world, np.random.default_rng(4), 0.003)
    free = [E, "layer.thickness", C, "instrument.baseline"]
    own = averaged_fit(ul.fit(ul.Problem(made, data, free)))
    # White noise and nothing else is likely, or next to impossible; the law drifts in neither.
    assert (own.undisturbed < 0.01) == gives_up
    assert own.exact_law > 0.1
    assert (own.inside(0.95) == 0.95) != gives_up
    if gives_up:
        assert own.inside(0.95) > 1.0 - 0.1 * 0.05
    # With the thickness known the noise is averaged over, and what is left is sure.
    known = averaged_fit(ul.fit(ul.Problem(made, data, [name for name in free if "thickness" not in name])))
    assert known.inside(0.95) == 0.95


def test_a_wide_interval_is_carried_along_the_profile_and_may_stay_open():
    # A thick layer barely touched shows no base.
    made = scene(thickness=2e-2)
    data = curve(ul.Noise(force=1e-3), made=made)
    fit = ul.fit(ul.Problem(made, data, {E: None, H: (1e-4, 1.0), C: None}))
    found = fit.interval(H)
    assert found.kind == "averaged profile"
    assert found.high == math.inf
    assert found.low < made.layer.thickness
    assert made.layer.material.E in fit.interval(E)


def test_a_thickness_that_a_touch_says_nothing_of_is_said_so():
    # 1 nm into 1 mm: the base stiffens the contact by a ten-thousandth, and 5 % would move the thickness by e^500.
    touched = ul.Scene(ul.Sphere(1e-5), ul.Layer(ul.Isotropic(1e4, 0.45), 1e-3), ul.RIGID)
    data = ul.synthesize(touched, np.linspace(-3e-10, 1e-9, 60), ul.Noise(force=1e-15), 1)
    fit = ul.fit(ul.Problem(touched, data, [E, H, C]))
    known = fit.interval(H)
    assert known.is_open
    assert np.isfinite(known.value)
    assert "by a factor of 7 or more" in str(fit.verdict)


def test_two_optima_are_inside_one_interval():
    fit = ul.fit(ambiguous(noise=None))
    (other,) = fit.alternatives
    for name in (E, H):
        assert fit.values[name] in fit.interval(name)
        assert other.values[name] in fit.interval(name)
    assert fit.verdict == "doubtful"


@pytest.mark.parametrize(("world", "word"), [("stiffening", "model wrong"), ("drag step", "doubtful")])
def test_the_verdict_says_what_disturbs(world, word):
    rng = np.random.default_rng(4)
    clean = Clean.of(scene(), 1.5e-4)
    disturbance = {"stiffening": lambda: clean.force * 0.3 * np.maximum(clean.depth, 0.0) / 1.5e-4}
    data = disturbed(clean, "clean" if world in disturbance else world, rng)
    if world in disturbance:
        data = ul.Curve(data.depth, data.force + disturbance[world](), time=data.time)
    fit = ul.fit(ul.Problem(scene(), data, [E, C, "instrument.baseline"]))
    assert fit.verdict == word
    said = {"model wrong": "the apparent modulus changes by", "doubtful": "at contact"}[word]
    assert said in str(fit.verdict)
    if word == "model wrong":
        # 30 % at full depth were added.
        size = float(str(fit.verdict).split("changes by ")[1].split(" %")[0])
        assert 15.0 < size < 50.0


def test_a_verdict_equals_its_word_and_its_like():
    assert Verdict("good") == "good"
    assert Verdict("doubtful", ("a", "b")) == Verdict("doubtful", ("a", "b"))
    assert Verdict("doubtful", ("a",)) != Verdict("doubtful")
    assert str(Verdict("doubtful", ("a", "b"))) == "doubtful: a; b"


def test_noise_taken_for_more_correlated_than_it_is_is_said():
    depth, time = np.linspace(0.0, 1e-4, 400), np.linspace(0.0, 4.0, 400)
    data = ul.synthesize(scene(), depth, NOISE, 3, time=time)
    noise = ul.Noise(force=1e-4, correlation_time=0.5)
    fit = ul.fit(ul.Problem(scene(), data, [E], noise))
    assert "over-whitened" in {warning.code for warning in fit.warnings}
    assert fit.verdict == "doubtful"
    right = ul.synthesize(scene(), depth, noise, 3, time=time)
    fit = ul.fit(ul.Problem(scene(), right, [E], noise))
    assert "over-whitened" not in {warning.code for warning in fit.warnings}


def test_data_that_contradict_a_prior_say_so():
    """The contact point takes up what the prior of the modulus asks: nothing of it is in the residuals."""
    noise = ul.Noise(force=3e-3)
    data = curve(noise)
    told = {"prior of another sample": ul.LogNormal(1.5e6, 0.01), "fair prior": ul.LogNormal(1.1e6, 0.1)}
    for name, prior in told.items():
        fit = ul.fit(ul.Problem(scene(), data, {E: prior, C: ul.Normal(0.0, 1e-6)}, noise))
        assert 0.8 < fit.statistics.reduced_chi_square < 4.0, name
        contradicted = [warning.message for warning in fit.warnings if warning.code == "prior"]
        assert bool(contradicted) == (name != "fair prior")
        assert fit.verdict == ("doubtful" if contradicted else "good")
        if contradicted:
            assert contradicted[0].startswith("layer.E ended ")


def test_sensitivity_is_that_of_a_fit_with_the_other_input():
    fit = fitted(free=(E, C))
    told = fit.sensitivity[E]
    # All forces p per cent larger: E p per cent larger, exactly.
    assert told[FORCE] == pytest.approx(1.0, abs=1e-6)
    for path, field, value in (("indenter.radius", "radius", 1e-3), ("layer.nu", "nu", 0.45)):
        step = 1e-3
        up, down = (
            ul.fit(ul.Problem(scene(**{field: value * (1 + s)}), curve(), (E, C), NOISE)).values[E]
            for s in (step, -step)
        )
        # Gauss and Newton leave out curvature times residual, here 1e-3 of the signal.
        assert told[path] == pytest.approx(math.log(up / down) / (2.0 * step), rel=2e-2)
    # Of a half-space E is known to be R^-1/2 with the contact point known.
    half = ul.Scene(ul.Paraboloid(1e-3), ul.Layer(ul.Isotropic(1e6, 0.45)))
    alone = ul.fit(ul.Problem(half, curve(made=half), [E], NOISE))
    assert alone.sensitivity[E]["indenter.radius"] == pytest.approx(-0.5, abs=1e-6)


def test_the_file_holds_what_is_printed(tmp_path):
    fit = fitted(noise=None)
    written = json.loads(fit.to_json(tmp_path / "fit.json").read_text(encoding="utf-8"))
    known = fit.interval(E)
    assert written["intervals"][E]["low"] == known.low
    assert written["intervals"][E]["kind"] == known.kind
    assert written["verdict"] == {"word": "good", "reasons": []}
    assert written["sensitivity"][E][FORCE] == pytest.approx(1.0, abs=1e-6)


def told(monkeypatch, low, high, wide_low, wide_high):
    entry = Estimate(
        H, H, 1.91e-3, low, high, "averaged profile", "", wide_low, wide_high, ("friction", "finite strain")
    )
    monkeypatch.setattr(words, "estimates", lambda _: [entry])
    return words.headline(SimpleNamespace(bonds=()))


def test_an_end_near_zero_is_not_rounded_to_twice_itself(monkeypatch):
    # Two digits of a width of 21 mm are whole millimetres: 0.5468 was told as 1, above the end from the noise.
    text = told(monkeypatch, 0.5468e-3, 21.85e-3, 0.5468e-3, 21.85e-3)
    assert text == (
        "Layer thickness 1.9 mm (0.5 to 21.9 from the noise; with friction and finite strain unknown 0.5 to 21.9, "
        "95 %)."
    )


@pytest.mark.parametrize(
    ("low", "high", "end"),
    [
        (1.2e-3, math.inf, "at least 1.20"),
        (-math.inf, 2.6e-3, "at most 2.60"),
        (-math.inf, math.inf, "anything"),
    ],
)
def test_an_interval_that_only_what_is_left_out_opens_is_told(low, high, end, monkeypatch):
    assert f"unknown {end}, 95 %" in told(monkeypatch, 1.5e-3, 2.4e-3, low, high)


def test_an_end_beyond_what_a_parameter_may_be_is_open():
    """Poisson's ratio is badly known beside a modulus: what bounds it is what it may be."""
    free = {E: None, "layer.nu": ul.Uniform(0.42, 0.48), C: None}
    found = ul.fit(ul.Problem(scene(), curve(), free)).interval("layer.nu")
    assert (found.low, found.high) == (-math.inf, math.inf)
    assert 0.42 <= found.value <= 0.48


@pytest.mark.parametrize(
    ("wide_low", "left_out", "told"),
    [
        (0.76e6, (), "more than 0.76 MPa (95 %)"),
        (
            0.5e6,
            ("friction",),
            "more than 0.76 MPa from the noise, with friction unknown more than 0.5 MPa (95 %)",
        ),
        (
            -math.inf,
            ("friction",),
            "more than 0.76 MPa from the noise, with friction unknown anything (95 %)",
        ),
    ],
)
def test_an_open_interval_is_told_with_what_the_law_leaves_out(monkeypatch, wide_low, left_out, told):
    entry = Estimate(
        "substrate.E", "substrate.E", 5.9e11, 0.76e6, math.inf, "profile", "", wide_low, math.inf, left_out
    )
    monkeypatch.setattr(words, "estimates", lambda _: [entry])
    monkeypatch.setattr(words, "_bonds", lambda _: [])
    assert words.headline(None) == f"Substrate modulus is {told}; the data set no upper end."
