"""Convergence diagnostics against independent code, against theory, and on chains that must fail."""

import sys

import numpy as np
import pytest
from scipy import stats

from underlay.inference.sampling.diagnostics import (
    autocorrelation_times,
    chain_errors,
    highest_density_interval,
    judge,
    quantile_errors,
)


def ar1(phi, steps=2000, walkers=8, seed=0):
    rng = np.random.default_rng(seed)
    noise = rng.standard_normal((steps, walkers)) * np.sqrt(1.0 - phi**2)
    chain = np.empty((steps, walkers))
    chain[0] = rng.standard_normal(walkers)
    for t in range(1, steps):
        chain[t] = phi * chain[t - 1] + noise[t]
    return chain


@pytest.mark.parametrize("phi", [0.0, 0.5, 0.9])
def test_autocorrelation_time_is_that_of_the_process(phi):
    chain = ar1(phi, steps=20_000)
    exact = (1.0 + phi) / (1.0 - phi)
    # Sokal: relative variance 2 (2 M + 1) / N with window M = 5 tau; four of that.
    error = np.sqrt(2.0 * (10.0 * exact + 1.0) / chain.size)
    assert autocorrelation_times(chain[..., None])[0] == pytest.approx(exact, rel=4.0 * error + 1e-12)


@pytest.mark.parametrize("phi", [0.0, 0.8])
def test_errors_of_quantiles_are_what_repeated_chains_scatter_by(phi):
    stated, found = [], []
    for seed in range(60):
        chain = ar1(phi, 400, 32, seed)[..., None]
        stated.append(chain_errors(chain)[:, 0])
        found.append(np.quantile(chain, [0.025, 0.5, 0.975]))
    # Sixty standard deviations are known to 9 %, and each stated one to 13 %.
    assert np.mean(stated, axis=0) == pytest.approx(np.std(found, axis=0), rel=0.35)


def test_errors_of_weighted_quantiles_are_those_of_their_shares():
    draws = stats.norm.ppf((np.arange(20_000) + 0.5) / 20_000)[:, None]
    even = np.full(len(draws), 1.0 / len(draws))
    errors = quantile_errors(draws, even, np.full((3, 1), 0.01))[:, 0]
    expected = [0.5 * np.ptp(stats.norm.ppf([level - 0.01, level + 0.01])) for level in (0.025, 0.5, 0.975)]
    assert errors == pytest.approx(expected, rel=1e-2)


@pytest.mark.parametrize("side", [-1.0, 1.0])
def test_a_walker_that_rests_at_an_end_hides_no_tail(side):
    """One walker of 32 is more than the 2.5 % beyond the outer quantile: no other draw lies beyond it."""
    steps, walkers = 100, 32
    chain = ar1(0.0, steps, walkers)
    chain[:, 0] = side * 9.0
    assert not judge(chain[:, :, None], steps).converged


def test_a_chain_that_never_moved_is_worth_nothing():
    still = np.ones((50, 4, 1))
    assert np.isnan(chain_errors(still)).all()
    assert autocorrelation_times(still)[0] == np.inf
    assert not judge(still, 50).converged


def test_a_walker_elsewhere_and_a_walker_of_another_width_are_seen():
    good = ar1(0.5, 4000, 32)
    assert judge(good[..., None], 4000).converged
    moved, wide, drifting = good.copy(), good.copy(), good.copy()
    moved[:, 0] += 1.0
    wide[:, 0] *= 3.0
    drifting += np.linspace(0.0, 1.0, len(good))[:, None]
    for bad in (moved, wide, drifting):
        assert not judge(bad[..., None], 4000).converged


def test_without_arviz_length_and_errors_decide(monkeypatch):
    monkeypatch.setitem(sys.modules, "arviz", None)
    good = ar1(0.5, 4000, 32)[..., None]
    outcome = judge(good, 4000)
    assert outcome.converged
    assert np.isnan(outcome.rhat).all()
    assert "R-hat" not in outcome.reason
    assert not judge(good[:40], 40).converged


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
    assert "autocorrelation times (50 are needed)" in early.reason
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
    assert steps - outcome.burn_in > 50.0 * outcome.times.max()
    assert outcome.quantile_errors[[0, 2]].min() > 0.06
    assert not outcome.converged


def test_burn_in_drops_a_far_start():
    chain = ar1(0.9, steps=4000, walkers=16)
    chain += 50.0 * 0.9 ** np.arange(4000)[:, None]
    outcome = judge(chain[..., None], 4000)
    # The start fades as 0.9^t: after 60 steps 50 is 0.09.
    assert 100 < outcome.burn_in < 600
    assert outcome.converged
