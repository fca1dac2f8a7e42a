"""Thresholds from drawn curves: the law of t where it is known, coverage where chi-square fails."""

import sys
from pathlib import Path

import numpy as np
import pytest
from scipy import stats

import underlay as ul
from support.inverse import layer_on, measured, problem
from support.p_values import delta_chi_square_at, p_value_at
from underlay.inference.least_squares.models import freeze
from underlay.inference.least_squares.objective import Objective
from underlay.inference.profiling.profile import draw_delta_chi_squares, redrawn
from underlay.inference.profiling.profile_result import Draws

sys.path.insert(0, str(Path(__file__).parent / "studies"))
import coverage

E, H, C, BASELINE = "layer.E", "layer.thickness", "instrument.contact_depth", "instrument.baseline"
HARD = next(case for case in coverage.all_cases() if case.hard and case.noise == "ar1")


@pytest.fixture(scope="module")
def two_optima():
    """A curve that a thin soft layer explains as well as a thick stiff one."""
    return HARD.fit_of(111)


def test_the_threshold_is_an_order_statistic():
    drawn = Draws(1.0, np.arange(1.0, 100.0))
    assert drawn.threshold(0.95) == 95.0
    assert drawn.threshold(0.68) == 68.0
    assert Draws(1.0, np.arange(1.0, 20.0)).threshold(0.95) == 19.0
    with pytest.raises(ul.InputError, match="at least 19 curves; there are 18"):
        Draws(1.0, np.arange(1.0, 19.0)).threshold(0.95)
    with pytest.raises(ul.InputError, match="between 0 and 1"):
        drawn.threshold(1.0)


@pytest.mark.parametrize("noise", [None, ul.Noise(force=1e-4)], ids=["unknown", "known"])
def test_rises_of_a_linear_parameter_have_the_law_of_the_textbook(noise):
    # t is exactly F(1, n - k), or chi-square, for whatever value is the truth.
    scene = layer_on(ul.RIGID)
    found = ul.fit(problem(scene, [BASELINE], measured(scene, points=40), noise=noise))
    value = found.values[BASELINE] + 2.0 * found.stderr[BASELINE]
    rises = draw_delta_chi_squares(found, BASELINE, value, 150, 0).delta_chi_squares
    law = stats.f(1, 39) if noise is None else stats.chi2(1)
    assert stats.kstest(rises, law.cdf).pvalue > 1e-3


def test_a_p_value_agrees_with_the_textbook():
    scene = layer_on(ul.RIGID)
    found = ul.fit(problem(scene, [BASELINE], measured(scene, points=40)))
    value = found.values[BASELINE] + found.stderr[BASELINE]
    expected = 2.0 * stats.t.sf(1.0, 39)
    # Five standard deviations of a share of 150.
    assert p_value_at(found, BASELINE, value, 150) == pytest.approx(expected, abs=5.0 * (0.22 / 150) ** 0.5)
    early = p_value_at(found, BASELINE, value, 150, enough=5)
    assert early > 5.0 / 151.0


def test_a_calibrated_profile_of_a_linear_parameter_keeps_its_interval():
    scene = layer_on(ul.RIGID)
    found = ul.fit(problem(scene, [BASELINE], measured(scene, points=40)))
    plain, calibrated = ul.profile(found, BASELINE), ul.profile(found, BASELINE, calibrate=99)
    # The 95th of 99 has a share below it of Beta(95, 5); z there, between its 0.1 % quantiles.
    low, high = stats.t.ppf(0.5 + 0.5 * stats.beta.ppf([0.001, 0.999], 95, 5), 39)
    for upper in (False, True):
        assert low**2 < calibrated.threshold(0.95, upper=upper) < high**2
    assert calibrated.interval().calibrated
    assert "(95 %, calibrated)" in str(calibrated.interval())
    assert not plain.interval().calibrated
    assert "99 curves drawn at each end (seed 0)" in calibrated.basis()
    assert "F(1, 39), the noise estimated" in plain.basis()


def test_the_same_seed_gives_the_same_interval():
    scene = layer_on(ul.RIGID)
    found = ul.fit(problem(scene, [E, C], measured(scene, points=40)))
    first, again, other = (ul.profile(found, E, calibrate=19, seed=seed).interval() for seed in (1, 1, 2))
    assert first == again
    assert first.low != other.low


def test_redrawn_curves_have_the_model_the_noise_and_the_priors_of_the_fit():
    scene = layer_on(ul.RIGID)
    noise = ul.Noise(force=2e-4, relative=0.01, correlation_time=0.05, depth=1e-7)
    free = {E: ul.LogNormal(1e6, 0.1), H: ul.Normal(5e-4, 1e-5), C: None, BASELINE: ul.HalfNormal(1e-3)}
    found = ul.fit(problem(scene, free, measured(scene, points=60), noise=noise))
    made = [
        redrawn(found.problem, found.vector, found.noises, np.random.default_rng([3, b])) for b in range(300)
    ]
    objective = Objective(found.problem, freeze(found.problem, found.vector, found.noises))
    model = objective.asked.models(found.problem.physical(found.vector))[0]
    member, sigma = found.problem.members[0], objective.noise.sigmas[0]
    white = np.array(
        [noise.whiten((p.curves[0].force - model) / sigma, member.curve.time) for p in made]
    ).ravel()
    # 18,000 independent unit normals, if the noise is that of the model.
    assert white.mean() == pytest.approx(0.0, abs=4.0 / len(white) ** 0.5)
    assert white.var() == pytest.approx(1.0, abs=4.0 * (2.0 / len(white)) ** 0.5)
    means = np.array([p.priors[H].mean for p in made])
    medians = np.array([p.priors[E].median for p in made])
    assert means.mean() == pytest.approx(found.values[H], abs=4.0 * 1e-5 / 300**0.5)
    assert means.std() == pytest.approx(1e-5, rel=4.0 / 600**0.5)
    assert np.log(medians / found.values[E]).std() == pytest.approx(0.1, rel=4.0 / 600**0.5)
    assert all(p.priors[BASELINE] == ul.HalfNormal(1e-3) for p in made)
    assert made[0].names == found.names


def test_a_joint_problem_with_unknown_and_correlated_noise_is_calibrated():
    scene = layer_on(ul.RIGID)
    wide = layer_on(ul.RIGID, indenter=ul.Paraboloid(3e-3))
    tests = [(s, measured(s, points=60, rng=i, level=0.003)) for i, s in enumerate((scene, wide))]
    noises = [None, ul.Noise(correlation_time=0.01)]
    found = ul.fit(ul.Problem.joint(tests, {E: None, H: ul.Normal(5e-4, 5e-5), C: None}, [E, H], noises))
    assert found.names == (E, H, f"{C}[0]", f"{C}[1]")
    assert 0.0 < p_value_at(found, H, found.values[H], 19) <= 1.0
    # Twenty standard errors away no drawn curve goes as badly.
    far = found.values[E] * np.exp(20.0 * found.scaled_covariance[0, 0] ** 0.5)
    assert p_value_at(found, E, float(far), 19) == 0.05


def test_a_fit_with_two_optima_is_told_to_calibrate(two_optima):
    walked = ul.profile(two_optima, E)
    assert walked.has_two_basins
    assert "calibrate it with drawn curves (99 are usual)" in walked.basis()
    interval = walked.interval()
    assert interval.low < 0.3e6
    assert interval.high > 1e6


@pytest.mark.parametrize("replica", [111, 155])
def test_a_value_behind_a_fold_is_found(replica):
    # From the thin optimum a step in the contact depth leads up a wall of t = 73 and 76.
    found = HARD.fit_of(replica)
    here = delta_chi_square_at(found, C, 1e-5)
    assert here < 2.5
    # As low as a fit that is begun at the truth, above the lower of two optima: the fit of curve 111 is not it.
    scene, curve, noise = HARD.scene, found.curves[0], found.noises[0]
    free, held = (
        ul.fit(ul.Problem(scene, curve, names, noise), start="given") for names in (found.names, [E, H])
    )
    best = min(free.statistics.chi_square, found.statistics.chi_square)
    # Two minimisers at one optimum: flat to their tolerance, squared.
    assert here == pytest.approx(held.statistics.chi_square - best, abs=1e-5)


def test_words_of_bad_numbers():
    scene = layer_on(ul.RIGID)
    found = ul.fit(problem(scene, [BASELINE], measured(scene, points=40)))
    with pytest.raises(ul.InputError, match="at least 19 curves"):
        ul.profile(found, BASELINE, calibrate=18)
    with pytest.raises(ul.InputError, match="whole number"):
        ul.profile(found, BASELINE, calibrate=-1)
    with pytest.raises(ul.InputError, match="the seed must be"):
        ul.profile(found, BASELINE, calibrate=19, seed=-1)
    with pytest.raises(ul.InputError, match="not free here"):
        p_value_at(found, E, 1e6)


def test_calibrated_intervals_cover_where_chi_square_does_not():
    # The study has hundreds of replicas and 99 curves each; here 19, of which one as bad as the data is enough.
    # Of 25 at 95 %, 19 or fewer inside have probability 1e-3.
    *_, found = coverage.run_calibrated(HARD, 25, seed=1, draws=19, enough=1, names=[E])
    assert found["coverage"][E] * 25 > 19


def test_curves_drawn_with_too_little_noise_do_not_cover():
    # The control: with the noise four times too small the truth is as far out as four standard deviations are
    # usual. A normal estimate would be inside in 38 %: of 12, 10 or more then have probability 2e-3.
    *_, found = coverage.run_calibrated(HARD, 12, seed=1, draws=19, enough=1, names=[E], understated=4.0)
    assert found["coverage"][E] * 12 < 10
