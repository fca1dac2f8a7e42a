"""The last step of a search: when it may be made without asking for its model, and what that leaves."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

import underlay as ul
from support.posed import CASES, posed
from support.user_scenes import user_test
from support.worlds import Clean, disturbed
from underlay.inference.least_squares import engine, settle
from underlay.inference.least_squares.engine import FINE, Search, minimise
from underlay.inference.least_squares.fitting import quick_fit
from underlay.inference.least_squares.models import freeze
from underlay.inference.least_squares.objective import Objective
from underlay.inference.least_squares.projection import Places


@pytest.mark.parametrize("case", CASES)
def test_a_last_step_that_tells_nothing_asks_for_no_law_and_says_what_a_law_says(case):
    p = posed(case)
    found = quick_fit(p)
    objective = Objective(p, freeze(p, found.vector, p.noises(found.vector)))
    asked = objective.residuals(found.vector)[: p.n_points]
    # What is not straight in the last step leaves residuals, each in units of its noise, wrong by a thousandth
    # together, and derivatives by a thousandth of themselves.
    assert np.linalg.norm(found.whitened[0] - asked) < 1e-3
    normal = objective.normals(found.vector)[1]
    deviations = np.sqrt(np.diag(np.linalg.inv(normal)))
    assert np.sqrt(np.diag(found.scaled_covariance)) == pytest.approx(deviations, rel=2e-3)


def test_a_straight_last_step_spares_models_and_moves_nothing(monkeypatch):
    spared = 0
    for case in CASES:
        found = quick_fit(posed(case))
        with monkeypatch.context() as patch:
            for name in ("FINE", "_KNOWN_BASE"):
                patch.setattr(settle, name, Search())
            asked = quick_fit(posed(case))
        deviations = np.sqrt(np.diag(found.scaled_covariance))
        # Half a thousandth times what a derivative changes by over its own scale, a power of some units.
        assert (np.abs(found.vector - asked.vector) < 2e-3 * deviations).all(), case
        spared += asked.statistics.evaluations - found.statistics.evaluations
    assert spared > 0


def test_models_follow_only_where_a_step_tells_nothing():
    p = posed("rigid")
    objective = Objective(p, freeze(p, p.start, p.noises(p.start)))
    assert objective.exists(p.start)
    square, count = objective.square(p.start), objective.evaluations
    assert not objective.follows(p.start + 2e-3, square)
    assert objective.follows(p.start + 1e-7, square)
    assert objective.asked.asked_for(p.physical(p.start + 1e-7)) == pytest.approx(
        p.physical(p.start), rel=1e-12
    )
    # Not from what itself followed: small steps would add up.
    assert not objective.follows(p.start + 2e-7, square)
    assert objective.evaluations == count


class _Bent:
    """Residuals in a valley that bends: y = x^2, nearly flat along x up to one."""

    points, active, courses = 1000, [0, 1], ()
    problem = SimpleNamespace(coordinates=(None, None), bounds=np.array([[-9.0, 9.0]] * 2))

    @staticmethod
    def residuals(vector):
        x, y = vector
        return np.array([300.0 * (y - x * x), 0.01 * (x - 1.0), 1000.0**0.5])

    def places(self, vectors, low, high):
        del low, high
        r = np.array([self.residuals(vector) for vector in vectors])
        J = np.array([[[-600.0 * x, 300.0], [0.01, 0.0], [0.0, 0.0]] for x, _ in vectors])
        normal = J.swapaxes(1, 2) @ J
        return Places(vectors, (r * r).sum(axis=1), (J.swapaxes(1, 2) @ r[:, :, None])[:, :, 0], normal)


def test_a_long_last_step_is_not_believed(monkeypatch):
    """What it should gain is far below what a fit tells, and where it leads the sum is ninety times as high."""
    objective = _Bent()
    start = np.zeros(2)
    begin = objective.residuals(start)
    assert FINE.settled * (begin @ begin) > 1e-4
    ends = {}
    for name, longest in {"now": engine._SURE, "believed": np.inf}.items():
        monkeypatch.setattr(engine, "_SURE", longest)
        there = objective.residuals(minimise(objective, start, FINE).vector)
        ends[name] = there @ there
    assert ends["now"] <= begin @ begin
    assert ends["believed"] > 50.0 * (begin @ begin)


class _Walled(_Bent):
    """One entry whose sum falls towards a wall at one, beyond which there is no law."""

    problem = SimpleNamespace(coordinates=(None,), bounds=np.array([[-9.0, 9.0]]))
    active, asked = [0], 0

    @staticmethod
    def residuals(vector):
        return np.array([0.1 * (vector[0] - 5.0), 1000.0**0.5])

    def places(self, vectors, low, high):
        del low, high
        self.asked += 1
        x = vectors[:, 0]
        square = np.where(x < 1.0, 1000.0 + 0.01 * (x - 5.0) ** 2, np.inf)
        return Places(vectors, square, 0.01 * (vectors - 5.0), np.full((1, 1, 1), 0.01))


def test_a_search_does_not_creep_along_the_end_of_the_laws():
    """What is left there to gain is a thousandth of a unit of chi-square."""
    asked, ends = {}, {}
    for name, search in {"now": FINE, "creeping": replace(FINE, walled=0.0)}.items():
        objective = _Walled()
        ends[name] = minimise(objective, np.zeros(1), search).point
        asked[name] = objective.asked
    assert asked["now"] < asked["creeping"]
    assert ends["now"].square - ends["creeping"].square < 0.05
    assert ends["now"].vector[0] > 0.5


def test_a_search_that_swings_about_the_lowest_place_of_a_valley_ends(monkeypatch):
    """What a fit leaves there is less than a twentieth of the variance, of a sum of some hundred."""
    rng = np.random.default_rng([4017, 96])
    _, scene, depth, points, noise = user_test(rng)
    curve = disturbed(Clean.of(scene, depth, points), "stiffening", rng, noise)
    free = ["layer.E", "layer.thickness", "instrument.contact_depth", "instrument.baseline"]
    asked, ends = {}, {}
    for name, share in {"now": settle._SWINGING, "swinging": 0.0}.items():
        monkeypatch.setattr(settle, "_SWINGING", share)
        found = ul.fit(ul.Problem(scene, curve, free))
        asked[name], ends[name] = found.statistics.evaluations, found.statistics.chi_square
    assert asked["now"] < 0.75 * asked["swinging"]
    assert ends["now"] - ends["swinging"] < 0.2 * ends["swinging"] / points
