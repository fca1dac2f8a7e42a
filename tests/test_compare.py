"""One curve under several laws: each answers for itself, none disturbs another."""

import numpy as np
import pytest

import underlay as ul
from support.inverse import layer_on, measured, problem
from underlay.inference.compare import Comparison
from underlay.inference.least_squares import fit_warnings

E, H, C = "layer.E", "layer.thickness", "instrument.contact_depth"


@pytest.fixture(scope="module")
def comparison():
    scene = layer_on(ul.RIGID, thickness=1e-3)
    return ul.compare(problem(scene, [E, C], measured(scene, depth=2e-4, level=0.003)))


def test_the_truth_wins_and_the_half_space_is_too_stiff(comparison):
    frame = comparison.to_frame()
    assert frame.loc["exact", "AIC"] < 2.0
    assert abs(frame.loc["exact", E] / 1e6 - 1.0) < 4.0 * frame.loc["exact", f"{E} stderr"] / 1e6
    assert frame.loc["halfspace", E] > 1.5e6
    assert frame.loc["halfspace", "AIC"] > 100.0
    assert frame["AIC"].min() == 0.0


def test_chi_square_is_measured_with_one_noise(comparison):
    frame = comparison.to_frame()
    best = comparison.fits[comparison.best]
    expected = sum(np.sum(np.square(r / s)) for r, s in zip(best.residuals, best.sigmas, strict=True))
    assert frame.loc[comparison.best, "chi-square"] == pytest.approx(expected)
    assert (frame["chi-square"] >= 0.99 * expected).all()


def test_published_corrections_take_part_and_say_where_they_leave_their_range(comparison):
    frame = comparison.to_frame()
    assert {"dimitriadis2002", "garcia2018", "long2011"} <= set(frame.index)
    # Garcia and Garcia's correction is for nu = 0.5; this layer has 0.45.
    assert "outside its range" in frame.loc["garcia2018", "notes"]
    assert "hayes1972" not in frame.index


def test_laws_that_do_not_know_a_parameter_say_so():
    scene = layer_on(ul.RIGID, thickness=1e-3)
    found = ul.compare(problem(scene, [E, H, C], measured(scene)), ["halfspace", "asymptotic:2", "exact"])
    assert found.dropped["halfspace"] == (H,)
    frame = found.to_frame()
    assert np.isnan(frame.loc["halfspace", H])
    assert "does not know layer.thickness" in frame.loc["halfspace", "notes"]
    assert frame.loc["exact", H] > 0.0


def test_a_law_without_error_bars_says_why():
    # The first order on a large contact: its series has no end there, and the fit runs off to a layer of nothing.
    scene = layer_on(ul.RIGID, indenter=ul.Paraboloid(6e-3))
    found = ul.compare(problem(scene, [E, H, C], measured(scene)), ["asymptotic:1", "exact"])
    frame = found.to_frame()
    assert np.isinf(frame.loc["asymptotic:1", f"{H} stderr"])
    assert "has no error bar" in frame.loc["asymptotic:1", "notes"]
    assert not frame.loc["exact", "notes"]


def test_an_error_far_beyond_sense_is_said_in_words():
    p = problem(layer_on(ul.RIGID), [E, H], measured(layer_on(ul.RIGID)))
    # Scaled: a factor of e^3 either way, and of e^700, which is no number that a reader could use.
    loose, lost = fit_warnings._unfixed(p, np.diag([3.0**2, 700.0**2]))
    assert "its standard error is a factor of 20.1;" in str(loose)
    assert "its standard error is beyond any factor;" in str(lost)


def test_a_law_that_cannot_be_fitted_does_not_disturb_the_others():
    scene = layer_on(ul.Isotropic(4e6, 0.3), thickness=1e-3)
    p = problem(scene, [E, C], measured(scene))
    found = ul.compare(p, ["exact", "garcia2018", "asymptotic:7", "nonsense"])
    assert list(found.fits) == ["exact"]
    assert "rigid substrate" in found.refused["garcia2018"]
    assert "order 0 to 4" in found.refused["asymptotic:7"]
    assert "no solver is called" in found.refused["nonsense"]
    assert found.to_frame().loc["nonsense", "notes"].startswith("no solver is called")


def test_a_half_space_has_nothing_to_fit_to_a_thickness():
    scene = layer_on(ul.RIGID, thickness=1e-3)
    found = ul.compare(problem(scene, [H], measured(scene)), ["halfspace"])
    assert "knows none" in found.refused["halfspace"]
    with pytest.raises(ul.FitError, match="no law could be fitted"):
        _ = found.best


def test_no_method_at_all():
    with pytest.raises(ul.InputError, match="at least one"):
        ul.compare(problem(layer_on(ul.RIGID), [E]), [])
    assert isinstance(ul.compare(problem(layer_on(ul.RIGID), [E]), ["exact"]), Comparison)


def test_a_published_law_is_flagged_by_the_depth_of_the_data_alone():
    # The series of Dimitriadis (2002) holds up to X = sqrt(R w)/h = 0.385; laws are kept up to 0.5 here.
    radius, thickness = 1e-3, 1e-3
    scene = ul.Scene(ul.Paraboloid(radius), ul.Layer(ul.Isotropic(1e6, 0.5), thickness), ul.RIGID)
    for share, flagged in ((0.37, False), (0.40, True)):
        depth = np.linspace(0.0, (share * thickness) ** 2 / radius, 80)
        curve = ul.synthesize(scene, depth, ul.Noise(force=1e-7), 0)
        found = ul.fit(ul.Problem(scene, curve, ["layer.E"], solver="dimitriadis2002"))
        assert any(warning.code == "law-range" for warning in found.warnings) == flagged


def test_every_curve_of_a_joint_fit_answers_for_its_own_range():
    layer = ul.Layer(ul.Isotropic(1e6, 0.5), 1e-3)
    tests = []
    for radius in (2e-4, 2e-3):
        scene = ul.Scene(ul.Paraboloid(radius), layer, ul.RIGID)
        # X = sqrt(R w)/h: 0.13 for the small tip and 0.41 for the large one, with 0.385 allowed.
        tests.append((scene, ul.synthesize(scene, np.linspace(0.0, 8.5e-5, 60), ul.Noise(force=1e-6), 0)))
    found = ul.fit(ul.Problem.joint(tests, [E], [E], solver="dimitriadis2002"))
    told = [str(warning) for warning in found.warnings if warning.code == "law-range"]
    assert len(told) == 1
    assert "outside its range on curve 2" in told[0]


@pytest.fixture(scope="module")
def punched():
    """A flat punch: its force is a straight line, to whatever law it is fitted."""
    scene = layer_on(ul.RIGID, indenter=ul.FlatPunch(6e-4), thickness=1e-3)
    return ul.compare(problem(scene, [E, C], measured(scene, depth=4e-5, level=0.003)))


def test_where_a_curve_tells_no_law_from_another_theory_orders_them(punched):
    frame = punched.to_frame()
    assert frame["AIC"].max() < 1e-3
    assert punched.best == "exact"
    assert punched.order == punched.alike
    assert punched.order[-1] == "halfspace"
    errors = [punched.errors[label] for label in punched.order]
    assert errors == sorted(errors)


@pytest.mark.filterwarnings("ignore::underlay.errors.UnderlayWarning")
def test_the_error_of_a_law_is_that_against_the_exact_one(punched):
    scene, frame = punched.fits["exact"].scene, punched.to_frame()
    for label in ("halfspace", "asymptotic:4", "garcia2018"):
        off = scene.contact_law(4e-5, solver=label).force(4e-5) / scene.contact_law(4e-5).force(4e-5) - 1.0
        assert frame.loc[label, "law error"] == pytest.approx(abs(float(off)), rel=1e-3)
    # What the modulus of a half-space is wrong by: a straight line hides all of it.
    ratio = frame.loc["exact", E] / frame.loc["halfspace", E]
    assert frame.loc["halfspace", "law error"] == pytest.approx(1.0 - ratio, rel=1e-3)


def test_a_correction_for_this_punch_that_cannot_be_used_says_why(punched):
    # Its table has columns for nu = 0.3 and 0.5; this layer has 0.45.
    assert "nu = 0.3 and 0.5 alone" in punched.refused["hayes1972"]
    assert "nu = 0.3 and 0.5 alone" in punched.to_frame().loc["hayes1972", "notes"]
    # Those for spheres, or for an elastic base, are no candidates.
    assert set(punched.refused) == {"hayes1972"}


def test_a_curve_that_tells_laws_apart_orders_them_by_aic(comparison):
    assert comparison.alike[0] == "exact"
    assert comparison.order[-1] == "halfspace"
    assert "halfspace" not in comparison.alike
