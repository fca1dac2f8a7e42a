"""The inverse problem: pure functions of a vector, and every mistake found before anything is computed."""

import pickle

import numpy as np
import pytest
from scipy import integrate, stats

import underlay as ul
from support.inverse import exact_curve, layer_on, measured, problem

ELASTIC = ul.Isotropic(4e6, 0.3)
EVERYTHING = {
    "layer.E": None,
    "layer.nu": (0.0, 0.49),
    "layer.thickness": None,
    "indenter.radius": None,
    "instrument.contact_depth": None,
    "instrument.baseline": None,
    "instrument.baseline_slope": None,
    "instrument.compliance": None,
}
SCENES = {
    "paraboloid on rigid": (layer_on(ul.RIGID, compliance=0.02), EVERYTHING),
    "paraboloid on elastic": (
        layer_on(ELASTIC, compliance=0.02),
        EVERYTHING | {"substrate.E": None, "substrate.nu": None},
    ),
    "half-space": (
        ul.Scene(
            ul.Paraboloid(1e-3), ul.Layer(ul.Isotropic(1e6, 0.45)), None, ul.Instrument(compliance=0.01)
        ),
        {path: given for path, given in EVERYTHING.items() if path != "layer.thickness"},
    ),
    "incompressible": (
        layer_on(ul.RIGID, nu=0.5),
        {"layer.E": None, "layer.nu": None, "layer.thickness": None},
    ),
    "sphere": (layer_on(ul.RIGID, indenter=ul.Sphere(5e-4), compliance=0.02), EVERYTHING),
    "cone": (
        layer_on(ELASTIC, indenter=ul.Cone(1.2)),
        {"layer.E": None, "layer.thickness": None, "indenter.half_angle": None, "substrate.E": None},
    ),
    "power law": (
        layer_on(ul.RIGID, indenter=ul.PowerLaw(1.5, 20.0)),
        {"layer.E": None, "layer.thickness": None, "indenter.coefficient": None, "indenter.exponent": None},
    ),
    "flat punch": (
        layer_on(ELASTIC, indenter=ul.FlatPunch(2e-4)),
        {"layer.E": None, "layer.thickness": None, "indenter.radius": None, "substrate.E": None},
    ),
    "anisotropic": (
        ul.Scene(
            ul.Paraboloid(1e-3),
            ul.Layer(ul.TransverselyIsotropic(E=1e6, E_axial=5e5, nu=0.3, nu_axial=0.2, G_axial=2e5), 5e-4),
            ul.RIGID,
        ),
        {"layer.E": None, "layer.E_axial": None, "layer.G_axial": None, "layer.nu_axial": None},
    ),
}


@pytest.mark.parametrize("name", SCENES)
def test_the_model_is_that_of_the_scene(name):
    # The law behind it is solved at a reference and scaled: equal to the scene's own to twice rtol = 1e-6.
    scene, free = SCENES[name]
    p = problem(scene, free, exact_curve(scene), noise=ul.Noise(force=1e-6))
    vector = np.full(len(free), -0.05) * np.where(np.arange(len(free)) % 3, 1.0, -1.0)
    moved = p.scenes(vector)[0]
    force = moved.force(p.curves[0].depth)
    model = p.curves[0].force - 1e-6 * p.residuals(vector)
    assert model == pytest.approx(force, abs=2e-6 * np.ptp(force))


@pytest.mark.parametrize("name", SCENES)
def test_the_analytic_jacobian_is_the_slope_of_the_model(name):
    # Against central differences of the model itself: their error is step^2 + rtol / step = 2e-6 of the scale
    # of the column, up to the curvature of the model (below 100 here). Points at the kink of first contact
    # have no derivative.
    scene, free = SCENES[name]
    p = ul.Problem(scene, exact_curve(scene), free, solver=ul.Auto(1e-9), noise=ul.Noise(force=1e-6))
    vector = np.array([-0.02 if path == "layer.nu" else 0.01 for path in free])
    columns = p.members[0].jacobian(p.physical(vector))[1] * p.slopes(vector)
    step = 1e-3
    smooth = np.abs(p.curves[0].depth - scene.instrument.contact_depth) > 4e-6
    for index, path in enumerate(p.names):
        offset = step * (np.arange(len(free)) == index)
        up, down = (p.members[0].model(p.physical(vector + s * offset)) for s in (1.0, -1.0))
        slope = (up - down) / (2.0 * step)
        assert columns[smooth, index] == pytest.approx(slope[smooth], abs=2e-4 * np.abs(slope).max()), path


def test_one_law_serves_every_modulus_thickness_and_radius():
    scene, _ = SCENES["paraboloid on rigid"]
    p = problem(scene, ["layer.E", "layer.thickness", "indenter.radius", "instrument.contact_depth"])
    for vector in np.random.default_rng(0).normal(scale=0.1, size=(20, 4)):
        p.residuals(vector)
    # One set of ratios; a law for every octave of depth that was needed.
    assert len({key[2] for key in p.store.laws}) == 1
    assert p.store.built <= 3


def test_log_likelihood_is_the_gaussian_of_the_residuals():
    scene = layer_on(ul.RIGID)
    curve = measured(scene, points=40, relative=0.02, correlation_time=0.05)
    noise = ul.Noise(force=1e-3, relative=0.02, correlation_time=0.05)
    p = ul.Problem(scene, curve, ["layer.E", "instrument.contact_depth"], noise)
    vector = np.array([0.02, 0.01])
    model = p.members[0].reading(p.physical(vector))
    sigma = np.hypot(1e-3, 0.02 * model.contact)
    correlation = np.exp(-np.abs(curve.time[:, None] - curve.time) / 0.05)
    dense = stats.multivariate_normal(model.force, sigma[:, None] * correlation * sigma).logpdf(curve.force)
    # Rounding of the dense factorisation: condition 1e3 of the correlation.
    assert float(p.log_likelihood(vector)) == pytest.approx(float(dense), rel=1e-10)


def test_unknown_size_of_the_noise_is_integrated_out():
    scene = layer_on(ul.RIGID)
    curve = measured(scene, points=30)
    unknown = problem(scene, ["layer.E"], curve)
    vectors = np.array([[0.0], [0.05]])

    def evidence(vector):
        def density(log_sigma):
            known = problem(scene, ["layer.E"], curve, noise=ul.Noise(force=float(np.exp(log_sigma))))
            return np.exp(float(known.log_likelihood(vector)) - offset)

        offset = float(
            problem(scene, ["layer.E"], curve, noise=ul.Noise(force=2e-3)).log_likelihood(vectors[0])
        )
        centre = np.log(np.sqrt(np.mean(np.square(unknown.residuals(vector)))) * np.ptp(curve.force))
        return integrate.quad(density, centre - 3.0, centre + 3.0, epsabs=0.0, epsrel=1e-9)[0]

    expected = np.log(evidence(vectors[0]) / evidence(vectors[1]))
    found = unknown.log_likelihood(vectors)
    # At six widths of ln sigma (3 / sqrt(2 * 30) each side) the integrand is below e^-18.
    assert float(found[0] - found[1]) == pytest.approx(expected, abs=1e-6)


def test_any_number_of_vectors_at_once():
    scene = layer_on(ELASTIC)
    free = {
        "layer.E": ul.LogUniform(1e5, 1e7),
        "substrate.E": ul.LogUniform(1e5, 1e8),
        "noise.force": ul.LogUniform(1e-6, 1),
    }
    p = problem(scene, free)
    vectors = np.random.default_rng(0).normal(scale=0.1, size=(3, 4, 3))
    batch = p.log_posterior(vectors)
    assert batch.shape == (3, 4)
    one_by_one = [float(p.log_posterior(vector)) for vector in vectors.reshape(-1, 3)]
    assert batch.ravel() == pytest.approx(one_by_one, rel=1e-12)


def test_outside_the_prior_no_law_is_asked_for():
    p = problem(layer_on(ul.RIGID), {"layer.E": ul.Uniform(5e5, 2e6)})
    built = p.store.built
    assert p.log_posterior(np.array([[5.0], [-5.0]])).tolist() == [-np.inf, -np.inf]
    assert p.store.built == built


def test_where_no_law_exists_the_likelihood_is_zero_and_the_prior_is_not():
    # A third Poisson's ratio so large that the layer is not positive definite.
    scene, _ = SCENES["anisotropic"]
    p = problem(
        scene, {"layer.nu_axial": ul.Uniform(0.0, 2.0)}, exact_curve(scene), noise=ul.Noise(force=1e-4)
    )
    vector = p.vector({"layer.nu_axial": 1.5})
    assert np.isfinite(p.log_prior(vector))
    assert p.log_likelihood(vector) == -np.inf


def test_vectors_and_values_invert_each_other():
    scene, free = SCENES["paraboloid on elastic"]
    p = problem(scene, free, exact_curve(scene), noise=ul.Noise(force=1e-6))
    vector = np.linspace(-0.2, 0.2, len(free))
    assert p.vector(p.values(vector)) == pytest.approx(vector, abs=1e-14)
    assert p.values(p.start) == {name: scene.parameters[name] for name in p.names}
    with pytest.raises(ul.InputError, match="not free here"):
        p.vector({"layer.nue": 0.4})
    with pytest.raises(ul.InputError, match="entries"):
        p.residuals(np.zeros(3))


def test_evaluations_leave_the_inputs_alone_and_do_not_depend_on_what_came_before():
    scene = layer_on(ELASTIC)
    p, fresh = (problem(scene, ["layer.E", "layer.thickness"]) for _ in range(2))
    target = np.array([0.1, -0.2])
    for other in (np.array([1.0, 0.5]), np.array([-0.5, -0.5])):
        p.residuals(other)
    assert p.residuals(target).tolist() == fresh.residuals(target).tolist()
    assert p.base_scenes == (scene,)


def test_a_problem_travels_to_another_process():
    p = problem(layer_on(ul.RIGID), {"layer.E": ul.LogUniform(1e4, 1e8), "instrument.contact_depth": None})
    again = pickle.loads(pickle.dumps(p))  # noqa: S301  our own bytes
    assert again.residuals(np.zeros(2)).tolist() == p.residuals(np.zeros(2)).tolist()


def test_joint_names_and_sharing():
    scenes = [layer_on(ul.RIGID, indenter=ul.Paraboloid(radius)) for radius in (5e-4, 2e-3)]
    tests = [(scene, measured(scene, rng=k)) for k, scene in enumerate(scenes)]
    p = ul.Problem.joint(
        tests,
        {"layer.E": None, "instrument.contact_depth": None, "indenter.radius[1]": ul.Normal(2e-3, 1e-5)},
        shared=["layer.E"],
    )
    assert p.names == (
        "layer.E",
        "instrument.contact_depth[0]",
        "instrument.contact_depth[1]",
        "indenter.radius[1]",
    )
    moved = p.scenes(p.vector({"layer.E": 2e6, "indenter.radius[1]": 2.1e-3}))
    assert [scene.layer.material.E for scene in moved] == pytest.approx([2e6, 2e6])
    assert [scene.indenter.radius for scene in moved] == pytest.approx([5e-4, 2.1e-3])
    alone = [ul.Problem(scene, curve, ["layer.E", "instrument.contact_depth"]) for scene, curve in tests]
    expected = sum(float(q.log_likelihood(np.zeros(2))) for q in alone)
    assert float(p.log_likelihood(np.zeros(4))) == pytest.approx(expected, rel=1e-12)


RIGID = layer_on(ul.RIGID)
HALF_SPACE = ul.Scene(ul.Paraboloid(1e-3), ul.Layer(ul.Isotropic(1e6, 0.4)))
CURVE = measured(RIGID)
PATH, GIVEN = ul.ParameterError, ul.InputError


@pytest.mark.parametrize(
    ("scene", "free", "options", "error", "message"),
    [
        (RIGID, ["layer.youngs"], {}, PATH, "did you mean"),
        (RIGID, ["layer.thicknes"], {}, PATH, r"did you mean 'layer\.thickness'"),
        (RIGID, ["adhesion.work"], {}, PATH, r"'adhesion\.work'\. It has: indenter\.radius"),
        (RIGID, ["substrate.E"], {}, PATH, "is rigid"),
        (HALF_SPACE, ["substrate.E"], {}, PATH, "no sub"),
        (HALF_SPACE, ["layer.thickness"], {}, PATH, "half"),
        (RIGID, ["layer.thickness"], {"solver": "halfspace"}, PATH, "halfspace depend on"),
        (layer_on(ul.Isotropic(1e6, 0.45)), ["layer.thickness"], {}, PATH, "same material"),
        (RIGID, [], {}, PATH, "nothing is free"),
        (RIGID, {"layer.E": (2e6, 3e6)}, {}, GIVEN, "outside its bounds"),
        (RIGID, {"layer.E": (3e6, 2e6)}, {}, GIVEN, "below"),
        (RIGID, {"layer.E": "wide"}, {}, GIVEN, "give a prior"),
        (RIGID, {"layer.E": None}, {"noise": 0.1}, GIVEN, "must be a Noise"),
        (RIGID, {"layer.E": None}, {"noise": ul.Noise(force=0.0, relative=0.1)}, GIVEN, "zero"),
        (RIGID, {"layer.E": None}, {"noise": ul.Noise(relative=0.1)}, GIVEN, "unknown"),
        (RIGID, ["layer.E[1]"], {}, PATH, "numbered from 0"),
    ],
)
def test_what_cannot_be_fitted_is_refused(scene, free, options, error, message):
    with pytest.raises(error, match=message):
        ul.Problem(scene, CURVE, free, **options)


def test_more_parameters_than_points():
    scene = layer_on(ul.RIGID)
    curve = exact_curve(scene, points=8)
    with pytest.raises(ul.InputError, match="only 8 points"):
        ul.Problem(scene, curve, list(EVERYTHING))


def test_a_curve_counted_twice():
    scene = layer_on(ul.RIGID)
    curve = measured(scene)
    with pytest.raises(ul.CurveError, match="same data"):
        ul.Problem.joint([(scene, curve), (scene, curve)], ["layer.E"])
    one, two = (measured(scene, rng=k).with_metadata(path="a.csv", sha256="12ab") for k in (1, 2))
    with pytest.raises(ul.CurveError, match=r"same file \(a\.csv\)"):
        ul.Problem.joint([(scene, one), (scene, two)], ["layer.E"])
    tests = [(scene, one.with_metadata(test=1)), (scene, two.with_metadata(test=2))]
    assert ul.Problem.joint(tests, ["layer.E"]).names == ("layer.E[0]", "layer.E[1]")


def test_sharing_what_is_not_free_or_does_not_agree():
    tests = [(layer_on(ul.RIGID, E=E), measured(layer_on(ul.RIGID), rng=k)) for k, E in enumerate((1e6, 2e6))]
    with pytest.raises(ul.ParameterError, match="shared but not free"):
        ul.Problem.joint(tests, ["layer.E"], shared=["layer.thickness"])
    with pytest.raises(ul.InputError, match="different values"):
        ul.Problem.joint(tests, ["layer.E"], shared=["layer.E"])
    with pytest.raises(ul.InputError, match="one for each"):
        ul.Problem.joint(tests, ["layer.E"], noise=[None])


def test_no_point_beyond_a_known_contact():
    scene = layer_on(ul.RIGID, contact_depth=1.0)
    with pytest.raises(ul.CurveError, match="no point beyond contact"):
        ul.Problem(scene, CURVE, ["layer.E"])


def test_correlated_noise_needs_times():
    curve = ul.Curve(CURVE.depth, CURVE.force)
    with pytest.raises(ul.InputError, match="times"):
        ul.Problem(layer_on(ul.RIGID), curve, ["layer.E"], ul.Noise(force=1e-3, correlation_time=0.1))
