"""On curves of real instruments the number that is printed is the least-squares one of the fitted range."""

from pathlib import Path

import numpy as np
import pytest

import underlay as ul
from support.real_data import real_data, real_file

DATA = Path(__file__).resolve().parents[1] / "data_samples"
E = "layer.E"


@pytest.mark.parametrize("location", [0, 1, 2])
def test_a_cartilage_test_reads_its_least_squares_value(location):
    curve = ul.read_all(real_file("mach1/Hayes_data_3locations_thinned.txt"))[location].loading()
    start, span = float(curve.depth.min()), float(np.ptp(curve.depth))
    scene = ul.Scene(
        ul.Paraboloid(0.15e-3),
        ul.Layer(ul.Isotropic(1e5, 0.5), 2.8e-3),
        ul.RIGID,
        instrument=ul.Instrument(contact_depth=start),
    )
    contact = ul.Uniform(start - 0.2 * span, start + 0.9 * span)
    free = {E: None, "instrument.contact_depth": contact, "instrument.baseline": None}
    fit = ul.fit(ul.Problem(scene, curve, free))
    white = ul.fit(ul.Problem(scene, curve, free, ul.Noise()))
    assert fit.interval(E).value == pytest.approx(white.values[E], rel=1e-6)
    assert fit.values[E] in fit.interval(E)


@pytest.mark.parametrize(
    "sample", ["cartilage_on_bone", "gel_on_glass", "soft_film_on_softer_base", "chiaro_cell_indentation"]
)
def test_a_shipped_curve_reads_its_least_squares_value(sample):
    scene = "chiaro_cell" if sample.startswith("chiaro") else sample
    problem = ul.load_problem(DATA / f"{sample}.csv", DATA / f"{scene}.toml")
    fit = ul.fit(problem)
    white = ul.fit(problem.revised(noise=ul.Noise()))
    assert fit.interval(E).value == pytest.approx(white.values[E], rel=1e-6)
    assert fit.values[E] in fit.interval(E)


def test_a_lever_softer_than_the_sample_is_fitted_against_its_travel():
    """Errors in the variable: against the depth the averaged modulus was 0.80 MPa for 3.00."""
    cases = real_data()
    if cases is None:
        pytest.skip("no folder of real instrument files")
    problem = ul.load_problem(cases / "cases/stiff_gel_soft_lever.csv", cases / "cases/soft_lever.toml")
    fit = ul.fit(problem)
    found = fit.interval(E)
    assert found.value == pytest.approx(3e6, rel=0.01)
    assert 3e6 in found
    assert fit.scene.instrument.compliance == pytest.approx(1 / 0.2, rel=1e-3)
    assert any("piezo position" in note for note in problem.curves[0].metadata["notes"])


@pytest.mark.parametrize("ratio", [2.0, 6.0, 20.0])
@pytest.mark.parametrize("noise", [0.1e-9, 0.5e-9])
def test_soft_levers_of_every_kind_hold_the_truth(ratio, noise):
    """Lever k, sample so stiff that the contact is `ratio` times stiffer at full depth, white deflection noise."""
    k, rng = 0.2, np.random.default_rng(int(10 * ratio))
    scene = ul.Scene(ul.Paraboloid(2e-6), ul.Layer(ul.Isotropic(3e6, 0.5)))
    law = ul.contact_law(scene.indenter, scene.layer, None, max_depth=1e-5)
    depths = np.linspace(0.0, 1e-6, 4000)
    deepest = depths[np.searchsorted(law.stiffness(depths[1:]), ratio * k)]
    w = np.concatenate([np.linspace(-deepest, 0.0, 200, endpoint=False), np.linspace(0.0, deepest, 400)])
    force = np.where(w > 0.0, law.force(np.maximum(w, 0.0)), 0.0)
    shake = rng.normal(0.0, noise, len(w))
    curve = ul.Curve(w - shake, force + k * shake)
    fit = ul.fit(ul.Problem(scene, curve, [E, "instrument.contact_depth", "instrument.baseline"]))
    assert fit.scene.instrument.compliance == pytest.approx(1.0 / k, rel=0.01)
    half = 0.5 * np.log(fit.interval(E).high / fit.interval(E).low)
    assert abs(np.log(fit.values[E] / 3e6)) < 2.0 * half


def test_independent_noises_of_depth_and_force_are_no_lever():
    rng = np.random.default_rng(3)
    scene = ul.Scene(ul.Paraboloid(2e-6), ul.Layer(ul.Isotropic(3e4, 0.5)))
    curve = ul.synthesize(scene, np.linspace(-1e-7, 4e-7, 300), ul.Noise(force=2e-12), rng)
    shaken = ul.Curve(curve.depth + rng.normal(0.0, 1e-9, 300), curve.force)
    problem = ul.Problem(scene, shaken, [E, "instrument.contact_depth"])
    assert problem.base_scenes[0].instrument.compliance == 0.0


@pytest.mark.parametrize(
    ("name", "test"),
    [("fischer/FS1.txt", 1), ("keysight/FQ.xls", 1), ("keysight/Tungsten_FrameStiffness.xlsx", 1)],
)
def test_cycles_that_press_an_imprint_deeper_are_refused(tmp_path, name, test):
    """Each way in of such a test begins where the last imprint ends; the first way out left little of it."""
    scene = tmp_path / "scene.toml"
    scene.write_text(
        '[indenter]\nshape = "cone"\nhalf_angle = "70.3 deg"\n[layer]\nE = "100 GPa"\nnu = 0.2\n'
        f'[fit]\nlayer.E = {{ min = "1 Pa", max = "10 TPa" }}\n[curve]\ntest = {test}\n'
    )
    with pytest.raises(ul.CurveError, match="the loading is elastoplastic"):
        ul.load_problem(real_file(name), scene)


def test_a_tip_too_small_for_the_travel_is_judged_all_the_same(tmp_path):
    """The law ends where the sphere does, before the first contact that is tried: quality raised an error."""
    scene = tmp_path / "scene.toml"
    scene.write_text(
        '[indenter]\nshape = "sphere"\nradius = "1 um"\n[layer]\nE = "10 kPa"\nnu = 0.5\n'
        '[curve]\ncalibration = { spring_constant = "0.04 N/m" }\n'
        '[fit]\nlayer.E = { min = "1 Pa", max = "100 GPa" }\ninstrument.baseline = {}\n'
        'instrument.contact_depth = { min = "0 um", max = "13 um" }\n'
    )
    problem = ul.load_problem(real_file("softmech_gels/h1000_curve.csv"), scene)
    assert ul.check_quality(problem.curves[0], problem.base_scenes[0]).verdict in {
        "good",
        "doubtful",
        "unusable",
    }
