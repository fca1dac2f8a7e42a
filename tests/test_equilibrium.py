"""Equilibrium points of relaxation tests: means, standard errors by coverage, and the check of rest."""

import numpy as np
import pytest

import underlay as ul


def staircase(steps=4, *, tau=0.5, noise=0.0, correlation=0.0, rng=None):
    """Ramps of 20 points and rests of 400; the force relaxes with `tau` (s) to half of each ramp's rise."""
    time = np.arange(steps * 420) * 0.05
    into = np.concatenate((np.linspace(0.0, 1.0, 20), np.ones(400)))
    depth = np.concatenate([i + into for i in range(steps)]) * 1e-4
    since = np.concatenate([np.concatenate((np.zeros(20), np.arange(400) * 0.05))] * steps)
    level = np.concatenate([np.full(420, i + 1.0) for i in range(steps)])
    pressing = np.concatenate([np.concatenate((np.linspace(0.0, 1.0, 20), np.ones(400)))] * steps)
    ramp = (level - 1.0) + (level + 1.0) * pressing  # from the last step at rest to twice this one's
    force = np.where(since > 0.0, level * (1.0 + np.exp(-since / tau)), ramp) * 1e-3
    if rng is not None:
        white = rng.standard_normal(len(force))
        red = np.empty_like(white)
        red[0] = white[0]
        for i in range(1, len(white)):
            red[i] = correlation * red[i - 1] + np.sqrt(1 - correlation**2) * white[i]
        force = force + noise * red
    return ul.Curve(depth, force, time=time)


def test_each_step_gives_its_relaxed_force():
    points = staircase().equilibrium()
    np.testing.assert_allclose(points.depth, np.arange(1, 5) * 1e-4, rtol=1e-12)
    # 18 s of rest at tau = 0.5 s leave exp(-36) of the relaxation.
    np.testing.assert_allclose(points.force, np.arange(1, 5) * 1e-3, rtol=1e-12)
    assert points.metadata["stationary"] == (True,) * 4


@pytest.mark.parametrize("since", [420, 1000], ids=["at every ramp", "within a hold"])
def test_a_clock_that_begins_again_changes_nothing(since):
    curve = staircase()
    begins_again = ul.Curve(curve.depth, curve.force, time=curve.time % (since * 0.05))
    assert np.count_nonzero(begins_again.segments() != curve.segments()) <= 4
    points = begins_again.equilibrium()
    np.testing.assert_allclose(points.force, np.arange(1, 5) * 1e-3, rtol=1e-12)
    assert points.metadata["stationary"] == (True,) * 4


def test_a_force_still_relaxing_is_said_aloud():
    points = staircase(2, tau=20.0).equilibrium()
    assert points.metadata["stationary"] == (False, False)
    assert "hold 1 was still relaxing at its end" in points.metadata["notes"]
    assert all(drift < 0.0 for drift in points.metadata["drift"])


@pytest.mark.parametrize("correlation", [0.0, 0.6])
def test_the_standard_error_covers_the_truth(correlation):
    """Of 400 rests, 68 % (binomial: +-5 %, twice 2.3 %) lie within one standard error.

    The correlation is itself estimated from 41 readings, which narrows the interval somewhat.
    """
    rng = np.random.default_rng(5)
    hits = []
    for _ in range(100):
        points = staircase(4, noise=1e-5, correlation=correlation, rng=rng).equilibrium()
        error = np.array(points.metadata["force_standard_error"])
        hits.extend(np.abs(points.force - np.arange(1, 5) * 1e-3) < error)
    assert np.mean(hits) == pytest.approx(0.68, abs=0.1)


def test_without_the_correlation_the_interval_would_be_too_narrow():
    """The control of the test above: the plain standard error covers far less."""
    rng = np.random.default_rng(6)
    hits = []
    for _ in range(60):
        curve = staircase(4, noise=1e-5, correlation=0.6, rng=rng)
        for step in range(4):
            end = curve.force[420 * step + 370 : 420 * step + 411]
            hits.append(abs(end.mean() - (step + 1) * 1e-3) < end.std(ddof=1) / np.sqrt(len(end)))
    assert np.mean(hits) < 0.5


def test_what_has_no_hold_is_refused():
    ramp = np.linspace(0.0, 1.0, 50)
    with pytest.raises(ul.CurveError, match="no hold after loading"):
        ul.Curve(ramp, ramp).equilibrium()
    with pytest.raises(ul.InputError, match="share must be in"):
        staircase().equilibrium(share=0.0)
    with pytest.raises(ul.CurveError, match="average a larger share"):
        staircase().equilibrium(share=1e-4)
