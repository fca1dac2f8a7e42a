"""The cause and the next step that a verdict names, on curves whose fault is known."""

import numpy as np
import pytest

import underlay as ul

BALL = ul.Paraboloid(3e-3)
SCENE = ul.Scene(BALL, ul.Layer(ul.Isotropic(5e5, 0.45)), None)
FREE = {"layer.E": (1e3, 1e8), "instrument.contact_depth": None, "instrument.baseline": None}
DEPTH = np.linspace(-2e-4, 3e-4, 900)


def measured(change=None, noise=3e-3, depth=DEPTH, scene=SCENE):
    """A curve of the scene (N over m), with white noise (N); `change` makes another force of depth and force."""
    force = scene.contact_law(4e-4).force(np.maximum(depth, 0.0))
    force = force if change is None else change(depth, force)
    return ul.Curve(depth, force + noise * np.random.default_rng(1).standard_normal(len(depth)))


def verdict(curve, free=FREE, scene=SCENE, **more):
    return ul.fit(ul.Problem(scene, curve, free, **more)).verdict


def saturated():
    """Readings at the detector's end are all the same."""
    return ul.Curve(DEPTH, np.minimum(measured(noise=1e-4).force, 0.08))


def three_ramps():
    """Three ramps to the same depth, each softer than the one before."""
    up = np.linspace(-1e-4, 3e-4, 300)
    soft = np.repeat([1.0, 1.0, 0.5, 0.5, 0.3], 300)
    depth = np.concatenate((up, up[::-1], up, up[::-1], up))
    return measured(lambda _, force: soft * force, depth=depth, noise=1e-3)


HELD = {name: given for name, given in FREE.items() if name != "layer.E"}
FAULTS = {
    "none": (measured, FREE, 5e5, "good", "", ()),
    "a saturated detector": (saturated, FREE, 5e5, "reject", "saturated", ("curve.fit_to", "95 % of force")),
    "a modulus on its bound": (
        measured,
        FREE | {"layer.E": (1e6, 1e8)},
        2e6,
        "reject",
        "its lower bound",
        (),
    ),
    "a modulus that is held": (measured, HELD, 1e6, "reject", "held", ("fit.layer.E", "{}")),
    "several loadings": (three_ramps, FREE, 5e5, "reject", "loadings", ("curve.segment", "ramp 1")),
}


@pytest.mark.parametrize(("curve", "free", "begin", "word", "cause", "setting"), FAULTS.values(), ids=FAULTS)
def test_a_fault_is_named_with_what_to_do_about_it(curve, free, begin, word, cause, setting):
    told = verdict(curve(), free, SCENE.with_values({"layer.E": begin}))
    assert (told.word, told.setting) == (word, setting)
    assert cause in told.cause


@pytest.mark.parametrize("seed", [0, 2, 3])
def test_a_baseline_that_drifts_is_the_cause_of_a_wide_interval(seed):
    """A slope that adds a fifth of the force over the record, and noise of 1 %: E is known to a factor of 2."""
    depth = np.linspace(-2e-4, 3e-4, 1500)
    force = SCENE.contact_law(4e-4).force(np.maximum(depth, 0.0)) + 150.0 * depth
    curve = ul.Curve(depth, force + 3e-3 * np.random.default_rng(seed).standard_normal(1500))
    told = verdict(curve)
    assert told == "check"
    assert told.setting == ("fit.instrument.baseline_slope", "{}")
    assert verdict(curve, {**FREE, "instrument.baseline_slope": None}) == "good"


def test_a_dip_before_contact_is_a_tip_that_adheres():
    """The force falls by 13 % of its peak before it rises, over a tenth of the depth."""

    def dipped(depth, force):
        return force - 0.13 * force.max() * np.exp(-((depth / 3e-5) ** 2))

    told = verdict(measured(dipped, noise=1e-4))
    assert told in ("check", "reject")
    advice = [told, *told.others]
    assert any("adheres" in entry.cause for entry in advice)
    assert not any("indent deeper" in entry.next for entry in advice)


def test_residuals_beyond_the_stated_noise_are_a_misfit():
    curve = measured(noise=3e-3)
    told = verdict(curve, noise=ul.Noise(force=3e-4))
    assert told == "check"
    assert "9.9 times the noise that you stated" in told.reason
    assert verdict(curve, noise=ul.Noise(force=3e-3)) == "good"


def test_a_flat_punch_is_not_told_to_indent_deeper_for_its_thickness():
    scene = ul.Scene(ul.FlatPunch(6e-4), ul.Layer(ul.Isotropic(1e6, 0.45), 1e-3), ul.RIGID)
    depth = np.linspace(-1e-5, 4e-5, 300)
    told = verdict(
        measured(noise=1e-3, depth=depth, scene=scene),
        {"layer.E": (1e4, 1e8), "layer.thickness": (6e-4, 2e-3)},
        scene,
    )
    assert told == "check"
    assert not any("indent deeper" in entry.next for entry in (told, *told.others))
    assert any("thickness" in entry.next or "second tip" in entry.next for entry in (told, *told.others))


@pytest.mark.parametrize("ramps", [1, 3])
def test_ramps_whose_holds_are_left_out_are_several_loadings(ramps):
    """The force of each begins below where the one before ended, as after a hold in which it relaxed."""
    made = ul.Scene(ul.Sphere(1e-3), ul.Layer(ul.Isotropic(1e6, 0.45)), uncertainties="none")
    depth = np.linspace(1e-7, 1.2e-4, 600)
    part = np.arange(600) * ramps // 600
    force = made.contact_law(2e-4).force(depth) - 0.25 * part * made.contact_law(2e-4).force(4e-5)
    force += 1e-4 * np.random.default_rng(5).standard_normal(600) - 2.0 * 1e-2 * (ramps > 1) * (part % 2)
    curve = ul.Curve(depth, force, time=0.1 * np.arange(600) + 300.0 * part)
    verdict = ul.fit(ul.Problem(made, curve, {"layer.E": (1e4, 1e8), "instrument.baseline": None})).verdict
    assert ("several loadings" in verdict.cause) == (ramps > 1)
    assert (verdict.word == "good") == (ramps == 1)


@pytest.mark.parametrize(("depths", "word"), [(12.0, "check"), (np.inf, "good")])
def test_a_half_space_whose_modulus_rises_is_not_called_good(depths, word):
    """A base twelve depths below makes E 13 % too large, of which the contact point hides the most."""
    layer = ul.Layer(ul.Isotropic(1e4, 0.45), depths * 1e-6)
    sample = ul.Scene(ul.Sphere(5e-6), layer, ul.RIGID if np.isfinite(depths) else None)
    depth = np.linspace(-5e-7, 1e-6, 400)
    curve = ul.synthesize(sample, depth, ul.Noise(force=4e-11), 3)
    half_space = ul.Scene(ul.Sphere(5e-6), ul.Layer(ul.Isotropic(1e4, 0.45)))
    told = verdict(curve, FREE, half_space)
    assert told == word
    assert ("E rises with depth" in told.reason) == (word == "check")


@pytest.mark.parametrize(("entered", "word"), [("cone", "check"), ("paraboloid", "good")])
def test_a_range_is_not_good_that_does_not_foretell_the_rest(tmp_path, entered, word):
    """A wrong tip is hidden by fitting ever less of the curve; what lies beyond the range shows it."""
    curve = ul.synthesize(SCENE, DEPTH, ul.Noise(force=1e-4), 2)
    (tmp_path / "curve.csv").write_text(
        "depth (um),force (mN)\n"
        + "\n".join(f"{1e6 * w:.6g},{1e3 * P:.6g}" for w, P in zip(curve.depth, curve.force, strict=True))
    )
    tip = {
        "cone": 'shape = "cone"\nhalf_angle = "80 deg"',
        "paraboloid": 'shape = "paraboloid"\nradius = "3 mm"',
    }
    (tmp_path / "scene.toml").write_text(
        f'[indenter]\n{tip[entered]}\n[layer]\nE = "0.5 MPa"\nnu = 0.45\n[curve]\nfit_to = "40 um"\n'
        '[fit]\nlayer.E = { min = "1 kPa", max = "100 MPa" }\n'
        'instrument.contact_depth = { min = "-100 um", max = "100 um" }\ninstrument.baseline = {}\n'
    )
    told = ul.fit(ul.load_problem(tmp_path / "curve.csv", tmp_path / "scene.toml")).verdict
    assert told == word
    beyond = [reason for reason in told.reasons if "beyond the fitted range" in reason]
    assert len(beyond) == (word == "check")


@pytest.mark.parametrize(
    ("other", "named"), [({}, ""), ({"E": 1.3e6}, "layer.E"), ({"h": 1.6e-3}, "thickness")]
)
def test_curves_that_exclude_each_other_are_no_good_joint_fit(other, named):
    """Two tips on two sites: a number between both, or outside, fits each a little, and neither is right."""
    depth = np.linspace(-3e-5, 1.2e-4, 400)

    def site(radius, E=1e6, h=1.2e-3):
        return ul.Scene(ul.Sphere(radius), ul.Layer(ul.Isotropic(E, 0.46), h), ul.RIGID)

    tests = [
        (site(radius, 5e5, 1e-3), ul.synthesize(site(radius, **its), depth, ul.Noise(force=2e-4), seed))
        for seed, (radius, its) in enumerate(((5e-4, {}), (1.5e-3, other)))
    ]
    shared = {"layer.E": (1e4, 1e8), "layer.thickness": (2e-4, 1e-2)}
    own = {"instrument.contact_depth": (-3e-5, 8e-5), "instrument.baseline": (-0.05, 0.05)}
    told = ul.fit(ul.Problem.joint(tests, shared | own, list(shared)), refine=True).verdict
    assert told == ("check" if named else "good")
    contradictions = [reason for reason in told.reasons if "contradict each other" in reason]
    assert len(contradictions) == bool(named)
    assert named in "".join(contradictions)
