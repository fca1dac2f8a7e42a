"""Priors: densities that integrate to one, and agree with their own quantiles and draws."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy import integrate, stats

import underlay as ul
from underlay.inference.model.coordinates import Spans, make_coordinate
from underlay.inference.priors import Flat, Truncated, prior_from_numbers
from underlay.quantities import declared

PRIORS = [
    ul.Uniform(-2.0, 3.0),
    ul.LogUniform(1e3, 1e7),
    ul.Normal(1.5, 0.2),
    ul.LogNormal(2e5, 0.7),
    ul.HalfNormal(3e-6),
    ul.Normal(0.45, 0.05).truncated(-1.0, 0.5),
    ul.LogNormal(1e6, 2.0).truncated(1e5, 1e6),
    ul.HalfNormal(1.0).truncated(0.5, 2.0),
]


@pytest.mark.parametrize("prior", PRIORS, ids=repr)
def test_the_density_is_the_slope_of_the_probability(prior):
    # Integrated over the middle 98 %, in the probability's own scale; quad's error is below 1e-8.
    low, high = prior.quantile(np.array([0.01, 0.99]))
    if low > 0.0:
        mass = integrate.quad(
            lambda t: float(np.exp(prior.log_density(np.exp(t)) + t)), np.log(low), np.log(high), epsabs=1e-10
        )[0]
    else:
        mass = integrate.quad(lambda x: float(np.exp(prior.log_density(x))), low, high, epsabs=1e-10)[0]
    assert mass == pytest.approx(0.98, abs=1e-8)


@pytest.mark.parametrize("prior", PRIORS, ids=repr)
@settings(max_examples=30)
@given(probability=st.floats(1e-6, 1.0 - 1e-6))
def test_quantile_inverts_probability(prior, probability):
    # The inverse loses what the slope of the distribution loses: 1e-9 in probability is ample.
    value = prior.quantile(np.array(probability))
    low, high = prior.support
    assert low <= value <= high
    assert float(prior.probability_below(value)) == pytest.approx(probability, abs=1e-9)


@pytest.mark.parametrize("prior", PRIORS, ids=repr)
def test_draws_follow_the_distribution(prior):
    draws = prior.sample(np.random.default_rng(1), 2000)
    assert stats.kstest(draws, lambda x: prior.probability_below(np.asarray(x))).pvalue > 1e-3


@pytest.mark.parametrize("prior", PRIORS, ids=repr)
def test_nothing_outside_the_support(prior):
    low, high = prior.support
    outside = [x for x in (low - 1.0, high + 1.0) if np.isfinite(x)]
    assert all(prior.log_density(np.array(x)) == -np.inf for x in outside)


@pytest.mark.parametrize("prior", [ul.Normal(1.5, 0.2), ul.LogNormal(2.0, 0.7), ul.HalfNormal(1.0)], ids=repr)
def test_penalty_is_the_residual_of_the_density(prior):
    # Half its square falls as the log-density does, in the prior's own measure: ln x for LogNormal.
    x, y = 0.8, 1.9
    extra = np.log(x / y) if isinstance(prior, ul.LogNormal) else 0.0
    fall = float(prior.log_density(np.array(x)) - prior.log_density(np.array(y))) + extra
    assert 0.5 * (prior.penalty(y)[0] ** 2 - prior.penalty(x)[0] ** 2) == pytest.approx(fall, rel=1e-12)
    step = 1e-6
    slope = (prior.penalty(x + step)[0] - prior.penalty(x - step)[0]) / (2.0 * step)
    assert prior.penalty(x)[1] == pytest.approx(slope, rel=1e-8)


@pytest.mark.parametrize(
    ("path", "start", "prior"),
    [
        ("layer.E", 1e5, ul.LogUniform(1e4, 1e6)),
        ("layer.E", 1e5, ul.Normal(1e5, 2e4).truncated(1e3, 1e6)),
        ("instrument.contact_depth", 1e-6, ul.Normal(0.0, 1e-5)),
        ("layer.nu", 0.4, ul.Normal(0.45, 0.1)),
    ],
)
def test_the_prior_in_scaled_coordinates_is_a_density_there(path, start, prior):
    # ln|dx/dq| is included: the integral over q is the mass of the prior inside the physical bounds.
    coordinate = make_coordinate(path, path, declared(path), start, prior, Spans(1e-4, 1e-3))
    ends = [coordinate.scaled(float(x)) for x in prior.quantile(np.array([1e-4, 1.0 - 1e-4]))]
    high = min(ends[1], coordinate.bounds[1])
    mass = integrate.quad(
        lambda q: float(np.exp(coordinate.log_prior(np.array(q)))), ends[0], high, limit=200
    )[0]
    inside = prior.probability_below(
        np.array(min(coordinate.high, float(prior.quantile(np.array(1.0 - 1e-4)))))
    )
    assert mass == pytest.approx(float(inside) - 1e-4, abs=1e-6)


def test_flat_is_improper_and_says_so():
    flat = Flat(0.0, np.inf, log=True)
    assert not flat.proper
    with pytest.raises(ul.InputError, match="improper"):
        flat.sample(np.random.default_rng(0), 3)
    assert not Flat().truncated(low=0.0).proper
    assert Flat().truncated(0.0, 1.0) == ul.Uniform(0.0, 1.0)
    assert Flat(log=True).truncated(1.0, 2.0) == ul.LogUniform(1.0, 2.0)


def test_truncation_that_cuts_nothing_is_the_prior_itself():
    prior = ul.Uniform(0.0, 1.0)
    assert prior.truncated(-1.0, 2.0) is prior
    with pytest.raises(ul.InputError, match="no probability"):
        Truncated(prior, 2.0, 3.0)


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: ul.Uniform(2.0, 1.0), "below"),
        (lambda: ul.Uniform(0.0, np.inf), "finite"),
        (lambda: ul.LogUniform(0.0, 1.0), "positive"),
        (lambda: ul.Normal(0.0, 0.0), "positive"),
        (lambda: ul.LogNormal(-1.0, 1.0), "positive"),
        (lambda: ul.HalfNormal(np.nan), "positive"),
        (lambda: prior_from_numbers("gauss", 0.0, 1.0, {}), "unknown prior"),
        (lambda: prior_from_numbers("normal", 0.0, 1.0, {"sd": 1.0}), "needs 'mean'"),
    ],
)
def test_bad_numbers_are_refused(make, message):
    with pytest.raises(ul.InputError, match=message):
        make()


def test_words_of_a_scene_file_become_priors():
    assert prior_from_numbers(None, -np.inf, np.inf, {}) is None
    assert prior_from_numbers(None, 0.0, 1.0, {}) == (0.0, 1.0)
    assert prior_from_numbers("uniform", 0.0, 1.0, {}) == ul.Uniform(0.0, 1.0)
    assert prior_from_numbers("loguniform", 1.0, 2.0, {}) == ul.LogUniform(1.0, 2.0)
    assert prior_from_numbers("normal", -np.inf, np.inf, {"mean": -2.0, "relative_sd": 0.1}) == ul.Normal(
        -2.0, 0.2
    )
    assert prior_from_numbers("lognormal", 0.0, 9.0, {"median": 2.0, "relative_sd": 0.1}).support == (
        0.0,
        9.0,
    )
    assert prior_from_numbers("halfnormal", -np.inf, np.inf, {"sd": 2.0}) == ul.HalfNormal(2.0)
