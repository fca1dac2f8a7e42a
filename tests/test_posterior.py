"""The frozen result: its table, its derived quantities, its bands, and its way to disk and to others."""

import json
import os
import subprocess
import sys
import warnings
from dataclasses import FrozenInstanceError, replace

import numpy as np
import pytest
from scipy import stats

import underlay as ul
from support.posterior_cases import WHITE, halfspace_curve, halfspace_problem, halfspace_scene
from underlay.inference.sampling.diagnostics import (
    DETERMINED,
    PREDICTIVE_LEVELS,
    UNDETERMINED,
    WEAKLY_DETERMINED,
    arviz_library,
    compare_with_prior,
    highest_density_interval,
    prior_levels,
)


@pytest.fixture(scope="module")
def posterior():
    return ul.sample(halfspace_problem(halfspace_curve(points=80)), walkers=32, method="emcee")


# --- the table --------------------------------------------------------------------------------------------


def test_summary_is_that_of_the_draws(posterior):
    summary = posterior.summary()
    assert list(summary.index) == list(posterior.names) == ["layer.E", "instrument.contact_depth"]
    draws = posterior.samples["layer.E"].to_numpy()
    row = summary.loc["layer.E"]
    assert row["median"] == np.median(draws)
    assert (row["hdi95_low"], row["hdi95_high"]) == highest_density_interval(draws, 0.95)
    assert row["hdi95_low"] < row["hdi68_low"] < row["median"] < row["hdi68_high"] < row["hdi95_high"]
    assert 500 < row["ess"] <= draws.size
    assert 0 < row["mcse"] < 0.1 * draws.std()
    assert row["informed"] == DETERMINED
    assert abs(row["median"] - posterior.truth["layer.E"]) < 4.0 * draws.std()


def test_the_result_cannot_be_changed(posterior):
    with pytest.raises(FrozenInstanceError):
        posterior.names = ()
    with pytest.raises(ValueError, match="read-only"):
        posterior.chain[0, 0, 0] = 1.0


def test_an_unknown_quantity_names_the_known(posterior):
    with pytest.raises(ul.InputError, match=r"no 'layer\.nu' here; there are layer\.E, .*stiffness"):
        posterior.of("layer.nu")


def test_prior_against_posterior(posterior):
    table = posterior.prior_comparison()
    row = table.loc["instrument.contact_depth"]
    # Uniform on +-1e-5: every 68 % is as short; the widths are what counts.
    assert row["prior"] == "Uniform(low=-1e-05, high=1e-05)"
    assert row["prior_high"] - row["prior_low"] == pytest.approx(0.95 * 2e-5, rel=2e-3)
    width = np.subtract(*highest_density_interval(posterior.of("instrument.contact_depth"), 0.68)[::-1])
    assert row["narrowing"] == pytest.approx(1.0 - width / (0.68 * 2e-5), abs=1e-3)
    assert row["distance"] > 0.4


@pytest.mark.parametrize(
    ("shift", "ratio", "verdict"),
    [
        (0.0, 1.0, UNDETERMINED),
        (0.2, 1.0, UNDETERMINED),
        (0.0, 0.7, UNDETERMINED),
        (0.4, 1.0, WEAKLY_DETERMINED),
        (0.0, 0.5, WEAKLY_DETERMINED),
        (0.0, 0.3, DETERMINED),
        (2.0, 1.0, DETERMINED),
    ],
)
def test_verdicts_on_normal_posteriors(shift, ratio, verdict):
    prior = stats.norm.ppf(prior_levels(1001))
    draws = np.random.default_rng(0).normal(shift, ratio, size=(2000, 20))
    answer = compare_with_prior(draws, prior)
    grid = np.linspace(-6.0, 6.0, 20_001)
    exact = np.abs(stats.norm.cdf(grid) - stats.norm.cdf(grid, shift, ratio)).max()
    # Kolmogorov: 1.6 / sqrt(n) at 1 %, and half a level of the grid.
    assert answer.distance == pytest.approx(exact, abs=1.63 / np.sqrt(draws.size) + 1e-3)
    assert answer.narrowing == pytest.approx(1.0 - ratio, abs=0.02)
    assert answer.informed == verdict


def test_an_order_of_magnitude_is_told_by_its_logarithm():
    """The upper half, in decades, of four decades."""
    prior = 10.0 ** (4.0 * prior_levels(1001))
    draws = 10.0 ** np.random.default_rng(0).uniform(2.0, 4.0, size=(2000, 20))
    # The shortest interval of a flat density is anywhere: its width is known to 1 / sqrt(40,000).
    assert compare_with_prior(draws, prior).narrowing == pytest.approx(0.5, abs=0.02)


def test_few_draws_do_not_claim_information():
    prior = stats.norm.ppf(prior_levels(1001))
    few = np.random.default_rng(0).normal(size=(12, 4))
    assert compare_with_prior(few, prior).informed == UNDETERMINED


# --- answers ----------------------------------------------------------------------------------------------


def test_an_answer_has_the_fits_value_and_sources_and_the_draws_scatter(posterior, tmp_path):
    known = ul.fit(posterior.problem)
    for name in (*posterior.names, "layer.reduced_modulus"):
        own, theirs = posterior.answer(name), known.answer(name)
        assert own.value == theirs.value
        assert own.systematic == theirs.systematic
        width = theirs.statistical.high - theirs.statistical.low
        assert own.statistical.low == pytest.approx(theirs.statistical.low, abs=0.05 * width)
        assert own.statistical.high == pytest.approx(theirs.statistical.high, abs=0.05 * width)
    low, high = np.quantile(posterior.samples["layer.E"], [0.025, 0.975])
    stated = posterior.answer("layer.E").statistical
    # Quantiles between draws are interpolated otherwise.
    assert (stated.low, stated.high) == pytest.approx((low, high), rel=1e-5)
    assert {*known.answers.columns} == {*posterior.answers.columns}
    assert posterior.answers.loc["layer.E", "value"] == known.values["layer.E"]
    path = tmp_path / "posterior.npz"
    posterior.save(path)
    assert ul.Posterior.load(path).answer("layer.E").as_dict() == posterior.answer("layer.E").as_dict()
    bare = replace(posterior, problem=None, fit=None, missing="gone")
    alone = bare.answer("layer.E")
    assert alone.value == np.median(posterior.of("layer.E"))
    assert alone.systematic.low == alone.systematic.high == alone.value
    assert alone.notes == ("the draws alone were kept, without the test they are of: gone",)
    assert bare.verdict == "check"


# --- derived quantities -----------------------------------------------------------------------------------


def test_derived_moduli_of_an_isotropic_layer(posterior):
    E = posterior.of("layer.E")[:: step_of_derived(posterior)]
    np.testing.assert_allclose(posterior.derived["layer.reduced_modulus"], E / (1.0 - 0.45**2), rtol=1e-12)
    oedometric = E * (1.0 - 0.45) / ((1.0 + 0.45) * (1.0 - 0.9))
    np.testing.assert_allclose(posterior.derived["layer.oedometric_modulus"], oedometric, rtol=1e-12)


def step_of_derived(posterior):
    """Derived quantities are those of every so many-th draw."""
    return -(-len(posterior.chain) // len(posterior.derived["stiffness"]))


def test_derived_stiffness_is_that_of_the_scene(posterior):
    scene, curve = halfspace_scene(), halfspace_curve(points=80)
    E, contact = posterior.chain[:: step_of_derived(posterior)][3, 2]
    changed = scene.with_values({"layer.E": E, "instrument.contact_depth": contact})
    law = changed.contact_law(1e-4)
    expected = law.stiffness(curve.depth.max() - contact)
    assert posterior.derived["stiffness"][3, 2] == pytest.approx(float(expected), rel=1e-6)


def test_incompressible_layers_have_no_oedometric_modulus():
    scene = ul.Scene(ul.Paraboloid(1e-3), ul.Layer(ul.Isotropic(1e6, 0.5)))
    curve = ul.synthesize(scene, np.linspace(0.0, 5e-5, 40), ul.Noise(force=WHITE), 2)
    found = ul.sample(
        ul.Problem(scene, curve, {"layer.E": ul.LogUniform(1e4, 1e8)}, ul.Noise(force=WHITE)), walkers=8
    )
    assert set(found.derived) == {"layer.reduced_modulus", "stiffness"}
    np.testing.assert_allclose(found.derived_samples["layer.reduced_modulus"].median(), 4e6 / 3.0, rtol=0.01)


def test_derived_moduli_of_an_anisotropic_layer():
    material = ul.TransverselyIsotropic(1e6, 5e5, 0.3, 0.2, 3e5)
    scene = ul.Scene(ul.Paraboloid(1e-3), ul.Layer(material))
    curve = ul.synthesize(scene, np.linspace(0.0, 5e-5, 40), ul.Noise(force=WHITE), 2)
    problem = ul.Problem(scene, curve, {"layer.E_axial": ul.LogUniform(1e5, 5e6)}, ul.Noise(force=WHITE))
    found = ul.sample(problem, walkers=8)
    E_axial = float(found.samples["layer.E_axial"].iloc[0])
    exact = replace(material, E_axial=E_axial)
    assert found.derived_samples["layer.reduced_modulus"].iloc[0] == pytest.approx(
        2.0 * exact.theta, rel=1e-12
    )
    oedometric = 1.0 / exact.plane_constants.c
    assert found.derived_samples["layer.oedometric_modulus"].iloc[0] == pytest.approx(oedometric, rel=1e-12)


def test_derived_quantities_of_several_curves_carry_their_number():
    tests = []
    for number, E in enumerate((1e6, 3e6)):
        scene = ul.Scene(ul.Paraboloid(1e-3), ul.Layer(ul.Isotropic(E, 0.45), 5e-4), ul.RIGID)
        tests.append((scene, ul.synthesize(scene, np.linspace(0.0, 5e-5, 30), ul.Noise(force=1e-3), number)))
    problem = ul.Problem.joint(
        tests,
        {"layer.E": ul.LogUniform(1e5, 1e7), "layer.thickness": ul.Normal(5e-4, 2e-5)},
        ["layer.thickness"],
        ul.Noise(force=1e-3),
    )
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        found = ul.sample(problem, walkers=8, max_steps=300)
    assert found.names == ("layer.E[0]", "layer.E[1]", "layer.thickness")
    assert {"layer.reduced_modulus[0]", "stiffness[0]", "stiffness[1]"} <= set(found.derived)
    assert len(found.predictive) == 2
    assert found.truth == {"layer.E[0]": 1e6, "layer.E[1]": 3e6, "layer.thickness": 5e-4}
    ratio = (
        found.derived_samples["layer.reduced_modulus[1]"].median()
        / found.derived_samples["layer.reduced_modulus[0]"].median()
    )
    assert ratio == pytest.approx(3.0, rel=0.1)


# --- predictive bands -------------------------------------------------------------------------------------


def test_the_band_of_a_new_reading_covers_new_readings(posterior):
    band = posterior.predictive[0]
    assert band.model.shape == band.reading.shape == (len(PREDICTIVE_LEVELS), 80)
    assert (np.diff(band.model, axis=0) >= 0.0).all()
    # 400 new curves of the truth: each point's share inside the 95 % band, averaged over the curve. The band
    # comes from 500 draws, so its own probability is uncertain by 1 %; a posterior off by a sigma costs 2 %.
    inside = []
    for seed in range(400):
        new = halfspace_curve(points=80, seed=1000 + seed).force
        inside.append(np.mean((new >= band.reading[0]) & (new <= band.reading[-1])))
    assert np.mean(inside) == pytest.approx(0.95, abs=0.03)
    # The model's own band is far narrower: it is no band for readings.
    assert (band.model[-1] - band.model[0]).mean() < 0.5 * (band.reading[-1] - band.reading[0]).mean()


@pytest.mark.parametrize(
    "noise", [ul.Noise(), ul.Noise(force=WHITE, relative=0.02), ul.Noise(correlation_time=0.05)]
)
def test_coverage_of_the_fitted_data(noise):
    depth = np.linspace(-1e-5, 5e-5, 200)
    made = replace(noise, force=WHITE)
    curve = ul.synthesize(halfspace_scene(), depth, made, 7, sampling_rate=200.0)
    free = {"layer.E": ul.LogUniform(1e4, 1e8), "instrument.contact_depth": ul.Uniform(-1e-5, 1e-5)}
    found = ul.sample(ul.Problem(halfspace_scene(), curve, free, noise), walkers=16)
    # Binomial: 0.95 +- 4 sqrt(0.95 * 0.05 / n), n the effective number of points, 200 or some 10 for AR(1).
    points = 10 if noise.correlation_time else 200
    assert found.predictive[0].coverage() == pytest.approx(0.95, abs=4.0 * np.sqrt(0.0475 / points))


# --- to disk and to others --------------------------------------------------------------------------------


def test_saved_and_loaded_is_the_same(posterior, tmp_path):
    path = tmp_path / "posterior"
    posterior.save(path)
    assert path.exists()
    loaded = ul.Posterior.load(path)
    np.testing.assert_array_equal(loaded.chain, posterior.chain)
    np.testing.assert_array_equal(loaded.predictive[0].reading, posterior.predictive[0].reading)
    assert loaded.diagnostics == posterior.diagnostics
    assert loaded.truth == dict(posterior.truth)
    assert loaded.summary(derived=True).equals(posterior.summary(derived=True))
    assert loaded.prior_comparison().equals(posterior.prior_comparison())
    # Nothing in the file is a pickle.
    with np.load(path, allow_pickle=False) as file:
        assert all(file[name].dtype.kind in "fU" for name in file.files)


def test_a_saved_posterior_holds_its_problem(posterior, tmp_path):
    path = tmp_path / "posterior.npz"
    posterior.save(path)
    loaded = ul.Posterior.load(path)
    assert loaded.missing == ""
    assert loaded.problem.names == posterior.names
    assert loaded.problem.base_scenes == posterior.problem.base_scenes
    at = np.full(len(posterior.names), 0.01)
    assert loaded.problem.log_posterior(at) == posterior.problem.log_posterior(at)
    assert loaded.provenance == posterior.provenance
    assert loaded.provenance["curves"][0]["points"] == len(posterior.problem.curves[0])


def rewritten(path, change):
    """The file with its document changed; what an older or a damaged one holds."""
    with np.load(path) as file:
        arrays = {name: file[name] for name in file.files}
    about = json.loads(str(arrays.pop("about")))
    change(about, arrays)
    np.savez_compressed(path, about=np.array(json.dumps(about)), **arrays)


def test_files_without_a_problem_load_and_say_what_is_missing(posterior, tmp_path):
    path = tmp_path / "posterior.npz"
    posterior.save(path)
    rewritten(path, lambda about, _: about.pop("problem"))
    older = ul.Posterior.load(path)
    assert older.problem is None
    assert "kept the draws alone" in older.missing
    assert older.provenance["curves"] == []
    np.testing.assert_array_equal(older.chain, posterior.chain)
    # Saved again it does not forget why.
    older.save(path)
    assert ul.Posterior.load(path).missing == older.missing


class Own(ul.LogUniform):
    """A prior from outside."""


def test_a_problem_that_cannot_be_kept_costs_nothing_else(posterior, tmp_path):
    path = tmp_path / "posterior.npz"
    own = posterior.problem.revised(free={**posterior.problem.free, "layer.E": Own(1e4, 1e8)})
    replace(posterior, problem=own).save(path)
    loaded = ul.Posterior.load(path)
    assert loaded.problem is None
    assert "the prior of layer.E, Own, is not part of underlay" in loaded.missing
    # A shape that the reading program lacks.
    posterior.save(path)

    def unknown(about, _):
        test = about["problem"]["tests"][0]
        test["scene"] = test["scene"].replace("paraboloid", "tetrahedron")

    rewritten(path, unknown)
    loaded = ul.Posterior.load(path)
    assert loaded.problem is None
    assert "tetrahedron" in loaded.missing


def test_a_damaged_problem_is_refused(posterior, tmp_path):
    path = tmp_path / "posterior.npz"
    posterior.save(path)
    rewritten(path, lambda _, arrays: arrays.update({"problem/0/force": arrays["problem/0/force"] * 2.0}))
    with pytest.raises(ul.FileFormatError, match="is damaged: the points of curve 1"):
        ul.Posterior.load(path)


def test_other_files_are_no_posteriors(tmp_path):
    text, arrays = tmp_path / "a.txt", tmp_path / "b.npz"
    text.write_text("median")
    np.savez(arrays, x=np.ones(3))
    for path in (text, arrays):
        with pytest.raises(ul.FileFormatError, match="is not a saved posterior"):
            ul.Posterior.load(path)
    with pytest.raises(ul.FileAccessError, match="cannot open"):
        ul.Posterior.load(tmp_path / "missing.npz")


def test_a_file_that_cannot_be_written(posterior, tmp_path):
    with pytest.raises(ul.FileAccessError, match="cannot write"):
        posterior.save(tmp_path / "no" / "such" / "folder.npz")


def test_inference_data_holds_one_chain_per_walker(posterior, tmp_path):
    data = posterior.to_inference_data()
    E = data.posterior["layer.E"]
    assert dict(E.sizes) == {"chain": 32, "draw": len(posterior.chain)}
    np.testing.assert_array_equal(E.values, posterior.of("layer.E").T)
    assert {"posterior", "prior", "sample_stats"} <= set(data.groups())
    arviz = arviz_library()
    assert float(arviz.rhat(data)["layer.E"]) == pytest.approx(posterior.summary().loc["layer.E", "rhat"])
    data.to_netcdf(str(tmp_path / "posterior.nc"))
    again = arviz.from_netcdf(str(tmp_path / "posterior.nc"))
    np.testing.assert_array_equal(again.posterior["layer.E"].values, E.values)


def test_without_the_extra_the_error_names_it(posterior, monkeypatch):
    monkeypatch.setitem(sys.modules, "arviz", None)
    with pytest.raises(ul.MissingExtraError, match=r"pip install '\.\[uq\]'"):
        posterior.to_inference_data()


def test_a_process_that_imports_arviz_beside_another_gets_it(tmp_path):
    # What arviz 0.23 does where another process moves the draft of its daily note away: it fails once.
    package = tmp_path / "arviz"
    package.mkdir()
    (package / "__init__.py").write_text(
        "import pathlib\n"
        "draft, note = (pathlib.Path(__file__).with_name(name) for name in ('draft', 'note'))\n"
        "if not note.exists():\n"
        "    note.touch()\n"
        "    draft.replace(note)\n"
    )
    program = (
        "from underlay.inference.sampling.diagnostics import arviz_library; print(arviz_library().__file__)"
    )
    path = os.pathsep.join([str(tmp_path), *sys.path])
    call = [sys.executable, "-c", program]
    done = subprocess.run(
        call, env={**os.environ, "PYTHONPATH": path}, capture_output=True, text=True, check=True
    )
    assert done.stdout.strip() == str(package / "__init__.py")
