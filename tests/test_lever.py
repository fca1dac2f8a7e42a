"""A cantilever whose calibration may be off: its two numbers in the scene, the forward model, fits and files."""

import numpy as np
import pytest

import underlay as ul
from support import microscope_files
from underlay.report.scene_tables import scene_table

K = 0.05
KAPPA, SIGMA = "lever.spring_constant_ratio", "lever.sensitivity_ratio"
CONTACT, BASELINE = "instrument.contact_depth", "instrument.baseline"

BODIES = {
    "half-space": (ul.Paraboloid(5e-6), ul.Layer(ul.Isotropic(2e4, 0.5)), None),
    "on a rigid base": (ul.Paraboloid(5e-6), ul.Layer(ul.Isotropic(2e4, 0.5), 3e-6), ul.RIGID),
    "on an elastic base": (ul.Cone(1.2), ul.Layer(ul.Isotropic(2e4, 0.45), 3e-6), ul.Isotropic(2e5, 0.3)),
    "true sphere": (ul.Sphere(5e-6), ul.Layer(ul.Isotropic(2e4, 0.45), 3e-6), ul.Isotropic(2e5, 0.3)),
}
CALIBRATIONS = [(1.0, 1.0), (1.2, 1.0), (1.0, 1.1), (0.9, 0.93)]


def measured(body, kappa, sigma, *, contact=3e-7, baseline=2e-10, slope=5e-5, points=200):
    """The scene, and the curve that an instrument so calibrated shows of true depths: from the definitions."""
    true = ul.Scene(*body)
    w = np.linspace(-1e-6, 0.8e-6, points)
    lever = ul.Lever(K, kappa, sigma)
    shown = true.force(w) / (kappa * sigma)
    depth = w + contact
    for _ in range(100):  # the reading is in its own offset and bending
        force = shown + baseline + slope * depth
        depth = w + contact + (sigma - 1.0) * force / K
    scene = ul.Scene(*body, ul.Instrument(contact, baseline, slope), lever=lever)
    return scene, ul.Curve(depth, force, segment=np.full(points, "loading"))


@pytest.mark.parametrize("body", BODIES.values(), ids=BODIES)
@pytest.mark.parametrize(("kappa", "sigma"), CALIBRATIONS)
def test_a_scene_shows_what_its_definition_says(body, kappa, sigma):
    scene, curve = measured(body, kappa, sigma)
    # Laws are built to 1e-6; that of the other sign of bending reaches twice as far.
    np.testing.assert_allclose(scene.force(curve.depth), curve.force, atol=1e-6 * np.ptp(curve.force))


def problem_of(body, kappa=0.9, sigma=0.93, **more):
    scene, curve = measured(body, kappa, sigma)
    free = {
        "layer.E": ul.LogUniform(1e3, 1e6),
        CONTACT: ul.Uniform(-1e-6, 1e-6),
        BASELINE: ul.Uniform(-1e-9, 1e-9),
        KAPPA: ul.LogNormal(1.0, 0.1),
        SIGMA: ul.LogNormal(1.0, 0.05),
        **more,
    }
    return ul.Problem(scene, curve, free, noise=ul.Noise(force=1e-11))


@pytest.mark.parametrize("body", BODIES.values(), ids=BODIES)
def test_the_forward_model_is_the_scene_and_its_slopes_are_its_own(body):
    problem = problem_of(body)
    (member,) = problem.members
    values = dict(member.base)
    np.testing.assert_allclose(
        member.forward.reading(values).force, member.force, atol=1e-6 * np.ptp(member.force)
    )
    _, columns = member.forward.jacobian(values, (KAPPA, SIGMA))
    for path, column in zip((KAPPA, SIGMA), columns.T, strict=True):
        step = 1e-5
        up, down = (member.forward.reading({**values, path: values[path] + d}).force for d in (step, -step))
        # Central difference: h^2/6 of the third derivative is 1e-10; laws of other ranges differ by 1e-8.
        np.testing.assert_allclose(column, (up - down) / (2.0 * step), atol=1e-5 * np.abs(column).max())


@pytest.mark.parametrize(
    ("name", "more"),
    [
        ("half-space", {}),
        ("on a rigid base", {"layer.thickness": ul.Normal(3e-6, 3e-7)}),
        ("on an elastic base", {"substrate.E": ul.LogUniform(1e4, 1e7)}),
        ("true sphere", {"layer.thickness": ul.Normal(3e-6, 3e-7)}),
    ],
)
def test_sets_together_are_sets_alone(name, more):
    problem = problem_of(BODIES[name], **more)
    (member,) = problem.members
    rng = np.random.default_rng(1)
    start = np.array([member.base[coordinate.path] for coordinate in problem.coordinates])
    vectors = start * (1.0 + 0.05 * rng.standard_normal((6, len(start))))
    together = member.readings(vectors)
    assert together.possible.all()
    for vector, force in zip(vectors, together.force, strict=True):
        np.testing.assert_allclose(force, member.model(vector), atol=1e-6 * np.ptp(member.force))


@pytest.mark.parametrize("body", BODIES.values(), ids=BODIES)
def test_the_likelihood_is_that_of_the_scenes_own_force(body):
    """Also away from the optimum, and with a frame that gives: the bending is the model's, not the noise's."""
    sd = 1e-10
    scene = ul.Scene(*body, ul.Instrument(3e-7, 2e-10, 5e-5, 1.0), lever=ul.Lever(K, 1.1, 0.95))
    curve = ul.synthesize(scene, np.linspace(-5e-7, 1e-6, 60), ul.Noise(force=sd), rng=1)
    free = {"layer.E": None, KAPPA: ul.LogNormal(1.0, 0.1), SIGMA: ul.LogNormal(1.0, 0.05)}
    free |= {"instrument.compliance": ul.HalfNormal(1.0), CONTACT: None, "instrument.baseline_slope": None}
    problem = ul.Problem(scene, curve, free, noise=ul.Noise(force=sd))
    rng = np.random.default_rng(2)
    (member,) = problem.members
    for _ in range(3):
        at = {path: scene.parameters[path] * (1.0 + 0.05 * rng.standard_normal()) for path in free}
        misfit = (curve.force - scene.with_values(at).force(curve.depth)) / sd
        expected = -0.5 * misfit @ misfit - len(misfit) * np.log(sd * np.sqrt(2.0 * np.pi))
        vector = problem.vector(at)
        assert float(problem.log_likelihood(vector)) == pytest.approx(expected, rel=1e-4)
        physical = problem.physical(vector)
        columns = member.jacobian(physical)[1]
        for entry, (path, column) in enumerate(zip(problem.names, columns.T, strict=True)):
            step = np.zeros(len(physical))
            step[entry] = 1e-5 * abs(physical[entry])
            change = member.model(physical + step) - member.model(physical - step)
            np.testing.assert_allclose(
                column, change / (2.0 * step[entry]), atol=1e-4 * np.abs(column).max(), err_msg=path
            )


def test_noise_is_not_taken_for_bending():
    """Of 2000 readings each would pull at a sensitivity that made its own noise smaller: to 0.6 for 1."""
    scene = ul.Scene(ul.Paraboloid(5e-6), ul.Layer(ul.Isotropic(2e4, 0.5)), lever=ul.Lever(K))
    depth = np.linspace(-2e-7, 1e-6, 2000)
    noise = ul.Noise(force=0.03 * float(scene.force(depth).max()))
    free = {"layer.E": None, CONTACT: ul.Uniform(-1e-6, 1e-6), SIGMA: ul.LogNormal(1.0, 0.1)}
    for seed in range(3):
        fit = ul.fit(ul.Problem(scene, ul.synthesize(scene, depth, noise, rng=seed), free, noise=noise))
        assert abs(fit.values[SIGMA] - 1.0) < 3.0 * fit.stderr[SIGMA] < 0.06
        interval = fit.interval("layer.E")
        assert interval.low < 2e4 < interval.high


@pytest.mark.parametrize("ratio", [0.97, 1.03])
def test_a_tip_that_sticks_bends_its_lever_too(ratio):
    """Either way: the force is that at the depth less the further bending, of a scene and of its sets."""
    body = ul.Paraboloid(5e-6), ul.Layer(ul.Isotropic(2e4, 0.5))
    adhesion, depth = ul.JKR(1e-4), np.linspace(0.0, 1e-6, 50)
    scene = ul.Scene(*body, lever=ul.Lever(K, 1.0, ratio), adhesion=adhesion)
    curve = ul.simulate(scene, depth)
    tip = depth - (ratio - 1.0) * curve.force / K
    expected = ul.Scene(*body, adhesion=adhesion).force(tip) / ratio
    np.testing.assert_allclose(curve.force, expected, atol=1e-6 * np.ptp(expected))
    problem = ul.Problem(scene, curve, {"layer.E": None, SIGMA: None}, noise=ul.Noise(force=1e-11))
    together = problem.members[0].readings(problem.physical(np.zeros((3, 2))))
    np.testing.assert_allclose(together.force[1], curve.force, atol=1e-6 * np.ptp(curve.force))


def noisy(seed=3, noise=1e-11, points=300):
    body = BODIES["half-space"]
    w = np.linspace(-1e-6, 0.6e-6, points)
    force = ul.Scene(*body).force(w) + noise * np.random.default_rng(seed).standard_normal(len(w))
    return body, ul.Curve(w, force, segment=np.full(len(w), "loading"))


def fitted(free, *, lever=None, noise=1e-11):
    body, curve = noisy(noise=noise)
    priors = {"layer.E": ul.LogUniform(1e2, 1e7), CONTACT: ul.Uniform(-5e-7, 5e-7), **free}
    return ul.fit(ul.Problem(ul.Scene(*body, lever=lever), curve, priors, noise=ul.Noise(force=noise)))


def test_a_spring_constant_known_to_a_tenth_is_a_modulus_known_to_a_tenth():
    """It scales the force and nothing else: ln E carries its deviation, 0.1, beside that of the noise."""
    bare = fitted({})
    fit = fitted({KAPPA: ul.LogNormal(1.0, 0.1)}, lever=ul.Lever(K))
    E = fit.values["layer.E"]
    assert pytest.approx(bare.values["layer.E"], rel=1e-4) == E
    known = np.hypot(bare.stderr["layer.E"] / E, 0.1)
    assert fit.stderr["layer.E"] / E == pytest.approx(known, rel=1e-3)
    interval = fit.interval("layer.E", part="statistical")
    assert (interval.low / E, interval.high / E) == pytest.approx(
        (np.exp(-0.196), np.exp(0.196)),
        rel=1e-2,  # 4000 draws place an end to 0.05 standard deviations
    )


def test_the_sensitivity_acts_on_force_and_depth_together():
    """The deviation of ln E is its slope times that of ln s, where the noise leaves the sensitivity to its prior.

    The slope is that of fits with the sensitivity held a little off; on this lever, which bends 1.2 times as far
    as it presses, it is about three: more than the one of the force alone.
    """
    loud = 2e-9
    held = []
    for ratio in (1.01, 0.99):
        fit = fitted({}, lever=ul.Lever(K, 1.0, ratio))
        held.append(np.log(fit.values["layer.E"]))
    slope = (held[0] - held[1]) / np.log(1.01 / 0.99)
    assert slope == pytest.approx(3.1, abs=0.2)
    bare = fitted({}, noise=loud)
    fit = fitted({SIGMA: ul.LogNormal(1.0, 0.03)}, lever=ul.Lever(K), noise=loud)
    found = fit.stderr["layer.E"] / fit.values["layer.E"]
    expected = np.hypot(bare.stderr["layer.E"] / bare.values["layer.E"], slope * 0.03)
    assert found == pytest.approx(expected, rel=0.15)


@pytest.mark.parametrize("body", BODIES.values(), ids=BODIES)
def test_one_factor_on_spring_constant_and_all_moduli_changes_nothing(body):
    """A curve cannot tell them apart: the prior alone says what a sampler finds."""
    moduli = ["layer.E", *(["substrate.E"] if isinstance(body[2], ul.Isotropic) else [])]
    problem = problem_of(body, **{path: ul.LogUniform(1e3, 1e7) for path in moduli})
    (member,) = problem.members
    start = np.array([member.base[coordinate.path] for coordinate in problem.coordinates])
    scaled = np.array([coordinate.path in {KAPPA, *moduli} for coordinate in problem.coordinates])
    vectors = np.array([np.where(scaled, factor * start, start) for factor in (0.5, 1.0, 3.0)])
    forces = member.readings(vectors).force
    np.testing.assert_allclose(forces[[0, 2]], forces[[1, 1]], rtol=1e-12, atol=1e-12 * np.ptp(member.force))


def test_what_a_lever_is_not():
    body = BODIES["half-space"]
    _, curve = noisy()
    with pytest.raises(ul.InputError, match="lever spring_constant must be positive"):
        ul.Lever(0.0)
    with pytest.raises(ul.InputError, match="lever must be a Lever or None"):
        ul.Scene(*body, lever=0.04)
    with pytest.raises(
        ul.ParameterError, match=r"lever.spring_constant cannot act: it is the one that made the curve"
    ):
        ul.Problem(ul.Scene(*body, lever=ul.Lever(K)), curve, ["layer.E", "lever.spring_constant"])
    relaxing = ul.Layer(ul.Isotropic(2e4, 0.5), relaxation=ul.Prony((0.5,), (1.0,)))
    with pytest.raises(ul.InputError, match="beside a history or a relaxation is not simulated"):
        ul.Scene(body[0], relaxing, lever=ul.Lever(K))
    scene = ul.Scene(*body, lever=ul.Lever(K))
    with pytest.raises(ul.InputError, match="under given forces a lever's calibration is not simulated"):
        scene.depth([1e-9])
    # A lever far softer than the sample, and a sensitivity half the stated one.
    soft = ul.Scene(*body, lever=ul.Lever(1e-4, 1.0, 0.5))
    with pytest.raises(ul.RangeError):
        soft.force(np.linspace(0.0, 1e-6, 20))


# --- from files


SCENE = """
[indenter]
shape = "paraboloid"
radius = "5 um"

[layer]
E = "20 kPa"
nu = 0.5

[fit]
layer.E = {{ min = "100 Pa", max = "100 MPa" }}
instrument.contact_depth = {{ min = "-3 um", max = "3 um" }}
instrument.baseline = {{}}
{free}

[curve]
calibration = {{ {calibration} }}
{more}
"""


@pytest.fixture
def load(tmp_path):
    def write(calibration, more="", free="", name="x.spm"):
        scene = tmp_path / "scene.toml"
        scene.write_text(SCENE.format(calibration=calibration, more=more, free=free), encoding="utf-8")
        curve = tmp_path / name
        curve.write_bytes(microscope_files.nanoscope(points=200))
        return ul.load_problem(curve, scene)

    return write


def test_a_calibration_without_its_uncertainty_adds_nothing(load):
    problem = load('spring_constant = "0.04 N/m"')
    assert problem.members[0].scene.lever is None
    assert KAPPA not in problem.names


def test_a_lever_is_written_and_read_back(tmp_path):
    scene = ul.Scene(*BODIES["half-space"], lever=ul.Lever(0.04, 1.01, 0.98))
    assert ul.load_scene(scene.save(tmp_path / "scene.toml")) == scene


def test_a_report_lists_the_lever():
    table = scene_table(ul.Scene(*BODIES["half-space"], lever=ul.Lever(0.04, 1.01)))
    rows = table[table.index == "lever"] if "part" not in table else table[table["part"] == "lever"]
    assert list(rows["value"]) == ["40 mN/m", "1.01", "1"]


def test_a_lever_of_the_scene_and_the_file_of_the_curve_are_compared(load):
    with pytest.raises(ul.InputError, match=r"says lever.spring_constant = 40 mN/m, the scene 50 mN/m"):
        load('sensitivity = "± 3 %"', '[lever]\nspring_constant = "0.05 N/m"')


def test_a_calibration_known_to_a_share_is_a_row_of_the_budget(load):
    """A file that states its calibration to 10 and 3 %: 95 % is twice that, and the modulus follows."""
    problem = load('spring_constant = "0.04 N/m ± 10 %", sensitivity = "± 3 %"')
    rows = ul.fit(problem).answer("layer.E").budget.set_index("source")
    assert rows.loc["spring_constant", "origin"] == "given"
    assert rows.loc["spring_constant", "size"] == "± 20 %"
    assert rows.loc["sensitivity", "size"] == "± 5.9 %"
    assert KAPPA not in problem.names


def test_a_lever_in_series_is_no_compliance_of_the_scene():
    """Its bending is in the depth again, and nothing is taken off twice."""
    k, made = 0.06, ul.Scene(ul.Paraboloid(5e-6), ul.Layer(ul.Isotropic(2e3, 0.5)), uncertainties="none")
    w, rng = np.linspace(-1e-6, 1e-6, 600), np.random.default_rng(6)
    shake = rng.normal(0.0, 2e-10, 600)
    force = made.contact_law(1e-6).force(np.maximum(w, 0.0)) + k * shake
    curve = ul.Curve(w - shake, force).with_metadata(spring_constant=k, bending_taken_off=True)
    free = {"layer.E": (1e1, 1e6), "instrument.contact_depth": (-5e-7, 5e-7), "instrument.baseline": None}
    fit = ul.fit(ul.Problem(made, curve, free))
    assert fit.problem.scenes(fit.vector)[0].instrument.compliance == pytest.approx(1.0 / k, rel=0.05)
    assert "compliance" not in fit.verdict.reason
