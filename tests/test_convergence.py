"""Convergence diagnostics against independent code, against theory, and on chains that must fail."""

import emcee
import numpy as np
import pytest
from scipy import stats

from underlay.inference.sampling.convergence import (
    autocorrelation_time,
    effective_size,
    highest_density_interval,
    judge,
    median_error,
    quantile_error,
    rank_normalised_rhat,
    tail_size,
)
from underlay.inference.sampling.posterior import arviz_library

arviz = arviz_library()


def ar1(phi, steps=2000, walkers=8, seed=0):
    rng = np.random.default_rng(seed)
    noise = rng.standard_normal((steps, walkers)) * np.sqrt(1.0 - phi**2)
    chain = np.empty((steps, walkers))
    chain[0] = rng.standard_normal(walkers)
    for t in range(1, steps):
        chain[t] = phi * chain[t - 1] + noise[t]
    return chain


@pytest.mark.parametrize("phi", [-0.5, 0.0, 0.5, 0.95])
def test_same_as_arviz(phi):
    chain = np.exp(ar1(phi))
    data = {"x": chain.T}
    assert rank_normalised_rhat(chain) == pytest.approx(float(arviz.rhat(data)["x"]), rel=1e-12)
    # The two differ in how the last pair of the truncated sum is counted, which is of order 1 / ESS.
    assert effective_size(chain) == pytest.approx(float(arviz.ess(data)["x"]), rel=0.01)
    ours, theirs = median_error(chain), float(arviz.mcse(data, method="median")["x"])
    # The order statistics are picked one draw apart.
    assert ours == pytest.approx(theirs, rel=0.03)


@pytest.mark.parametrize("phi", [0.0, 0.5, 0.9])
def test_autocorrelation_time_is_that_of_the_process(phi):
    chain = ar1(phi, steps=20_000)
    exact = (1.0 + phi) / (1.0 - phi)
    # Sokal: relative variance 2 (2 M + 1) / N with window M = 5 tau; four of that.
    error = np.sqrt(2.0 * (10.0 * exact + 1.0) / chain.size)
    assert autocorrelation_time(chain) == pytest.approx(exact, rel=4.0 * error + 1e-12)
    assert autocorrelation_time(chain) == pytest.approx(
        float(emcee.autocorr.integrated_time(chain, quiet=True)[0]), rel=1e-10
    )


@pytest.mark.parametrize("side", [-1.0, 1.0])
def test_a_walker_that_rests_at_an_end_hides_no_tail(side):
    """One walker of 32 is more than the 2.5 % beyond the outer quantile: no draw lies beyond it."""
    steps, walkers = 100, 32
    chain = ar1(0.0, steps, walkers)
    chain[:, 0] = side * 9.0
    # Halves of a walker of which one rests say what their number says, and no more.
    assert 1.0 < tail_size(chain) <= 4 * walkers
    outer = 0.5 + side * 0.475
    assert quantile_error(chain, outer) > 10.0 * quantile_error(chain, 0.5)
    outcome = judge(chain[:, :, None], steps)
    assert not outcome.converged
    assert np.isfinite(outcome.quantile_errors).all()


def test_a_chain_that_never_moved_is_worth_nothing():
    still = np.ones((50, 4))
    assert np.isnan(quantile_error(still, 0.5))
    assert autocorrelation_time(still) == np.inf
    assert np.isnan(rank_normalised_rhat(still))


def test_rhat_sees_a_walker_elsewhere_and_a_walker_of_another_width():
    good = ar1(0.5)
    assert rank_normalised_rhat(good) < 1.01
    moved, wide, drifting = good.copy(), good.copy(), good.copy()
    moved[:, 0] += 1.0
    wide[:, 0] *= 3.0
    drifting += np.linspace(0.0, 1.0, len(good))[:, None]
    for bad in (moved, wide, drifting):
        assert rank_normalised_rhat(bad) > 1.01


def test_increasing_changes_of_the_parameter_change_nothing():
    chain = ar1(0.8)
    assert rank_normalised_rhat(np.exp(5.0 * chain)) == pytest.approx(rank_normalised_rhat(chain), abs=2e-3)
    assert effective_size(np.exp(5.0 * chain)) == pytest.approx(effective_size(chain), rel=1e-9)


def test_highest_density_interval_is_the_shortest():
    levels = (np.arange(100_001) + 0.5) / 100_001
    low, high = highest_density_interval(stats.expon.ppf(levels), 0.95)
    # The density falls everywhere, so the interval starts at zero; the grid's spacing there is 1e-5.
    assert (low, high) == pytest.approx((0.0, stats.expon.ppf(0.95)), abs=3e-4)
    low, high = highest_density_interval(stats.norm.ppf(levels), 0.68)
    assert (low, high) == pytest.approx((-0.99446, 0.99446), abs=3e-3)


def test_stop_rule_needs_length_and_agreement():
    chain = ar1(0.9, steps=4000, walkers=16)[..., None]
    assert judge(chain, 10_000).converged
    early = judge(chain[:300], 10_000)
    assert not early.converged
    assert "50 autocorrelation times are needed" in early.reason
    stuck = chain.copy()
    stuck[:, 0] = 4.0
    assert not judge(stuck, 10_000).converged


def test_stop_rule_waits_for_tails_that_walkers_rarely_visit():
    """White in the bulk, and centred; one state in twelve is three times as wide, held for 200 steps on average."""
    rng = np.random.default_rng(11)
    steps, walkers = 1000, 64
    far = np.zeros((steps, walkers), dtype=bool)
    far[0] = rng.random(walkers) < 1 / 12
    for step in range(1, steps):
        switch = rng.random(walkers) < np.where(far[step - 1], 1 / 200, 1 / 2200)
        far[step] = far[step - 1] ^ switch
    white = rng.standard_normal((steps, walkers))
    chain = white * np.where(far, 3.0, 1.0)
    assert judge(white[..., None], steps).converged
    outcome = judge(chain[..., None], steps)
    kept = steps - outcome.burn_in
    assert kept > 50.0 * outcome.times.max()
    assert kept < 50.0 * outcome.tail_times.max()
    assert not outcome.converged


def test_tail_size_is_that_of_arviz():
    for phi in (0.0, 0.8):
        chain = ar1(phi)
        assert tail_size(chain) == pytest.approx(float(arviz.ess(chain.T, method="tail")), rel=1e-2)


def test_burn_in_drops_a_far_start():
    chain = ar1(0.9, steps=4000, walkers=16)
    chain += 50.0 * 0.9 ** np.arange(4000)[:, None]
    outcome = judge(chain[..., None], 4000)
    # The start fades as 0.9^t: after 60 steps 50 is 0.09.
    assert 100 < outcome.burn_in < 600
    assert outcome.converged
