"""Searches that follow one another down the same valley: the later one ends where it comes onto the way."""

import numpy as np
import pytest

import underlay as ul
from support.user_scenes import user_test
from support.worlds import Clean, disturbed
from underlay.inference.least_squares import fitting
from underlay.inference.least_squares.engine import Ahead
from underlay.inference.least_squares.fitting import VisitedPaths, quick_fit

WAY = np.array([[0.0, 0.0], [3.0, -1.0], [6.0, -2.0]])
ALONG = np.array([1.5, -0.5])


def ahead(here, step, square):
    here = np.asarray(here, dtype=float)
    return Ahead(0, 1, square, square, here, here + step)


def gone_before(lowest=1.0):
    """Paths on which one search went before, to a square of `lowest`."""
    visited = VisitedPaths()
    visited.begin()
    for place, square in zip(WAY, (9.0, 4.0, lowest), strict=True):
        assert not visited(ahead(place, ALONG, square))
    visited.begin()
    return visited


@pytest.mark.parametrize(
    ("here", "step", "square", "joins"),
    [
        ((2.0, -0.66), ALONG, 5.0, True),
        ((4.5, -1.52), 0.1 * ALONG, 3.0, True),
        # Beside the way; across it; back along it; and where it never was.
        ((2.0, -0.8), ALONG, 5.0, False),
        ((2.0, -0.66), np.array([0.5, 1.5]), 5.0, False),
        ((2.0, -0.66), -ALONG, 5.0, False),
        ((7.5, -2.5), ALONG, 3.0, False),
        # Already lower than the other ever was: it goes on for itself.
        ((2.0, -0.66), ALONG, 0.9, False),
    ],
)
def test_a_search_joins_a_way_only_along_it_and_only_where_it_led_lower(here, step, square, joins):
    assert gone_before()(ahead(here, step, square)) == joins


def test_steps_at_a_minimum_are_no_way():
    visited = VisitedPaths()
    visited.begin()
    for place in (np.zeros(2), np.array([0.1, 0.1]), np.array([0.12, 0.1])):
        visited(ahead(place, np.array([0.1, 0.0]), 1.0))
    visited.begin()
    assert not visited(ahead((0.05, 0.05), np.array([0.1, 0.1]), 2.0))


def relaxing(seed):
    """A sample that loses modulus while it is pressed, fitted by an elastic law: on a soft base E h^3 acts."""
    rng = np.random.default_rng(seed)
    _, scene, depth, points, noise = user_test(rng)
    clean = Clean.of(scene, depth, points)
    curve = disturbed(clean, "relaxation", rng, noise)
    free = ("layer.E", "layer.thickness", "instrument.contact_depth")
    return ul.Problem(scene, curve, dict.fromkeys(free), ul.Noise(force=noise * clean.top))


def test_joined_searches_spare_models_and_lose_no_optimum(monkeypatch):
    spared = 0
    # Some of those whose starts all lie in one valley.
    for number in (0, 51, 68, 78, 85):
        joined = quick_fit(relaxing([4017, number]))
        with monkeypatch.context() as patch:
            patch.setattr(fitting, "VisitedPaths", lambda: None)
            alone = quick_fit(relaxing([4017, number]))
        # Where a valley has no end a search stops once a step gains less than 5e-4 of the sum of squares.
        assert joined.statistics.chi_square <= alone.statistics.chi_square * (1.0 + 5e-3)
        spared += alone.statistics.evaluations - joined.statistics.evaluations
    assert spared > 0
