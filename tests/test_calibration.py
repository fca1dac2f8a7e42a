"""A small calibration of the whole chain, generator to posterior, with a control that must fail.

The full study is tests/studies/calibration.py; its result is kept beside it.
"""

from dataclasses import replace

import numpy as np
import pytest
from scipy import stats

import underlay as ul
from support.calibration import BINS, DRAWS, cases, levels, replica, uniformity

REPLICAS = 30


def study(understated):
    """Ranks and coverage of E and contact depth of a half-space whose noise is known."""
    case = cases()["half-space"]
    free = {path: prior for path, prior in case.free.items() if not path.startswith("noise.")}
    case = replace(case, free=free, noise=ul.Noise(force=5e-5))
    rows = [
        row
        for seed in range(REPLICAS)
        for row in replica(case, seed, walkers=24, max_steps=100, understated=understated)[0].values()
    ]
    return np.array([row["rank"] for row in rows]), sum(row["inside90"] for row in rows)


@pytest.fixture(scope="module")
def honest():
    return study(1.0)


@pytest.fixture(scope="module")
def understated():
    return study(2.0)


def test_ranks_of_the_truth_are_uniform(honest):
    assert uniformity(honest[0])[1] > 0.01


def test_intervals_hold_the_truth_as_often_as_they_say(honest):
    assert stats.binomtest(honest[1], 2 * REPLICAS, 0.9).pvalue > 0.01


def test_noise_understated_by_two_is_found_out(understated):
    ranks, inside = understated
    # 60 ranks in 20 bins: the chance that uniform ones look as bad is below one in a thousand.
    assert uniformity(ranks)[1] < 1e-3
    # Intervals half as wide: a 90 % one holds 2 Phi(1.645 / 2) - 1 = 59 %.
    assert stats.binomtest(inside, 2 * REPLICAS, 0.9).pvalue < 1e-6
    assert stats.binomtest(inside, 2 * REPLICAS, 0.59).pvalue > 0.01


def test_ranks_fill_the_bins_evenly():
    assert (DRAWS + 1) % BINS == 0
    assert uniformity(np.arange(DRAWS + 1))[0] == 0.0


def test_the_sampler_agrees_with_importance_sampling_on_one_curve():
    case = cases()["rigid base"]
    ranks = {name: row["rank"] for name, row in replica(case, 3)[0].items()}
    below, size = levels(case, 3)
    assert size > 1000.0
    for name, level in below.items():
        # A rank among 99 draws scatters by sqrt(level (1 - level) 99), at most 5: four of those, and the
        # importance sampler's own error of 0.016 at a thousand effective draws.
        assert abs(ranks[name] - 99.0 * level) < 4.0 * (5.0 + 1.6)
