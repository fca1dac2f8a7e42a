"""Profile intervals: the truth inside as often as said, and ends that are not there said to be missing."""

import sys
import time
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from scipy import stats

import underlay as ul
from support.inverse import layer_on, measured, problem
from support.p_values import delta_chi_square_at
from support.user_scenes import user_test
from support.worlds import Clean, disturbed
from underlay.inference.least_squares.engine import Search, minimise
from underlay.inference.least_squares.projection import Point
from underlay.inference.profiling.profile_result import Interval, _constant, _crossing
from underlay.inference.profiling.walk import Walk

sys.path.insert(0, str(Path(__file__).parent / "studies"))
import coverage

E, H, C, BASE = "layer.E", "layer.thickness", "instrument.contact_depth", "substrate.E"


def test_a_linear_parameter_has_the_interval_of_students_t():
    scene = layer_on(ul.RIGID)
    found = ul.fit(problem(scene, ["instrument.baseline", "instrument.baseline_slope"], measured(scene)))
    for name in found.names:
        interval = ul.profile(found, name).interval(0.9)
        half = stats.t.ppf(0.95, 298) * found.stderr[name]
        # A parabola read through monotone cubics in steps of half a unit of z: 1e-3 of the half-width.
        assert interval.low == pytest.approx(found.values[name] - half, abs=2e-3 * half)
        assert interval.high == pytest.approx(found.values[name] + half, abs=2e-3 * half)


def test_known_noise_takes_the_normal_quantile():
    scene = layer_on(ul.RIGID)
    p = problem(scene, ["instrument.baseline"], noise=ul.Noise(force=1e-3))
    found = ul.fit(p)
    interval = ul.profile(found, "instrument.baseline").interval(0.95)
    half = 1.9599639845400545 * found.stderr["instrument.baseline"]
    assert interval.high - interval.low == pytest.approx(2.0 * half, rel=2e-3)


@pytest.mark.parametrize("name", [E, H, C])
def test_the_ends_are_where_the_rise_is_the_threshold(name):
    scene = layer_on(ul.RIGID)
    found = ul.fit(problem(scene, [E, H, C], measured(scene, level=0.003)))
    result = ul.profile(found, name)
    interval = result.interval(0.95)
    for end in (interval.low, interval.high):
        assert delta_chi_square_at(found, name, end) == pytest.approx(result.threshold(0.95), rel=1e-2)
    assert result.delta_chi_square.min() == 0.0
    assert (np.diff(result.values) > 0.0).all()


@pytest.mark.parametrize("name", ["layer.E", "layer.thickness"])
def test_a_curve_without_noise_has_the_interval_of_the_noise_that_is_stated(name):
    """What a search leaves counts in units of the stated noise, not of the residuals, which are next to none."""
    scene = ul.Scene(ul.Sphere(1e-3), ul.Layer(ul.Isotropic(1e6, 0.45), 1e-3), ul.Isotropic(2e7, 0.3))
    depth = np.linspace(-2e-5, 1.2e-4, 300)
    sigma = 0.005 * float(scene.force(depth[-1]))
    free = ["layer.E", "layer.thickness", "substrate.E", "instrument.contact_depth"]
    curve = ul.synthesize(scene, depth, ul.Noise(force=1e-9 * sigma), 3)
    known = ul.profile(ul.Problem(scene, curve, free, ul.Noise(sigma)), name).interval(0.95)
    others = [path for path in free if path != name]
    for end in (known.low, known.high):
        held = ul.fit(ul.Problem(scene.with_values({name: end}), curve, others, ul.Noise(sigma)))
        # The rise above a fit that leaves nothing; an end lies between two steps, to a hundredth of the interval.
        assert float(np.sum((held.residuals[0] / sigma) ** 2)) == pytest.approx(3.84, rel=0.04)


@pytest.mark.parametrize("name", [E, H, BASE])
def test_a_valley_that_is_open_at_the_optimum_and_closed_further_on(name):
    # A thin layer on a soft base answers as a thicker one on bone does: the thickness may rise by a half while the
    # modulus of the base runs away, and no further, for beyond rigid there is nothing. What the curvature at
    # the optimum foretells is then a step far too long.
    scene = layer_on(ul.Isotropic(1e9, 0.3), thickness=8e-4, nu=0.5, indenter=ul.Paraboloid(5e-4))
    curve = measured(scene, depth=5e-5, first=-1e-5, level=0.003, points=400)
    found = ul.fit(problem(scene.with_values({BASE: 1e8}), [E, H, BASE, C], curve))
    result = ul.profile(found, name)
    interval = result.interval(0.95)
    ends = [(interval.low, interval.low_reason), (interval.high, interval.high_reason)]
    assert interval.low < scene.parameters[name] < interval.high
    assert [reason for _, reason in ends] == ["data", "none" if name == BASE else "data"]
    for end, reason in ends:
        if reason == "data":
            # Where the base becomes rigid the profile has a corner; cubics across it miss z by some hundredths.
            assert delta_chi_square_at(found, name, end) == pytest.approx(result.threshold(0.95), rel=5e-2)
    steps = np.diff(np.sqrt(result.delta_chi_square))
    assert np.abs(steps).max() < 1.5


@pytest.mark.parametrize("seed", [2, 3, 6])
def test_a_base_that_might_be_rigid_has_a_lower_bound_and_one_optimum(seed):
    # The fit ends anywhere on the plateau of rigid bases, ten orders of magnitude above where the data object.
    scene = layer_on(ul.Isotropic(1e9, 0.3), thickness=8e-4, nu=0.5)
    curve = measured(scene, depth=8e-5, first=-2e-5, level=0.003, points=400, rng=seed)
    found = ul.fit(problem(scene.with_values({BASE: 1e8}), [E, H, BASE, C], curve))
    assert not found.alternatives
    interval = ul.profile(found, BASE).interval()
    assert (interval.low_reason, interval.high_reason) == ("data", "none")
    assert 1e6 < interval.low < 1e9
    # With the base held rigid the thickness would end 5 % below its optimum.
    assert ul.profile(found, H).interval().low < 0.85 * found.values[H]


def test_an_end_beyond_a_hump_is_read_from_its_last_rise():
    walk = ul.profile(problem(layer_on(ul.RIGID), [E, C]), E)
    q = np.arange(7.0)
    made = replace(
        walk,
        delta_chi_square=np.array([0.0, 1.0, 9.0, 1.0, 1.0, 4.0, 16.0]),
        vectors=np.column_stack([q, np.zeros(7)]),
        ends=("bound", "data"),
    )
    end, reason = made.end(1.9, upper=True)
    assert reason == "data"
    scaled = made.fit.problem.coordinates[0].scaled(end)
    assert 4.0 < scaled < 5.0


def test_an_asymmetric_interval_is_wider_where_the_data_say_less():
    scene = layer_on(ul.RIGID, thickness=2e-3)
    found = ul.fit(problem(scene, [E, H, C], measured(scene)))
    interval = ul.profile(found, H).interval()
    assert interval.high - found.values[H] > 1.5 * (found.values[H] - interval.low)


def test_no_upper_bound_for_a_layer_that_is_thick():
    # Contact radius over thickness 0.04: the layer changes the force by less than the noise.
    scene = layer_on(ul.RIGID, thickness=1e-2)
    interval = ul.profile(problem(scene, [E, H, C], measured(scene)), H).interval()
    assert interval.high == np.inf
    assert interval.high_reason == "none"
    assert 0.0 < interval.low < 1e-2
    assert str(interval).startswith("layer.thickness > ")
    assert "no upper bound from these data" in str(interval)


def test_the_callers_own_bound_is_told_from_the_datas():
    scene = layer_on(ul.RIGID, thickness=1e-2)
    interval = ul.profile(problem(scene, {E: None, H: (1e-4, 2e-2), C: None}, measured(scene)), H).interval()
    assert interval.high == 2e-2
    assert interval.high_reason == "bound"
    assert "only its own limit 20 mm" in str(interval)


def test_a_stiff_base_has_no_upper_bound():
    scene = layer_on(ul.Isotropic(1e9, 0.3))
    interval = ul.profile(problem(scene, [E, BASE, C], measured(scene)), BASE).interval()
    assert interval.high_reason == "none"
    assert interval.low < 1e9


def test_a_prior_takes_part():
    scene = layer_on(ul.RIGID, thickness=1e-2)
    free = {E: None, H: ul.Normal(1e-2, 1e-3), C: None}
    interval = ul.profile(problem(scene, free, measured(scene)), H).interval()
    assert interval.low == pytest.approx(8e-3, rel=0.1)
    assert interval.high == pytest.approx(1.2e-2, rel=0.1)


def test_a_profile_begun_at_a_poor_optimum_moves_to_the_better():
    scene = layer_on(ul.RIGID)
    curve = measured(scene, points=200, depth=2e-4, first=-5e-5, level=0.002)
    thin = scene.with_values({E: 2.5e5, H: 1.8e-4, C: 1e-6})
    poor = ul.fit(problem(thin, [E, H, C], curve), start="given")
    best = ul.fit(problem(scene, [E, H, C], curve))
    if poor.statistics.chi_square * poor.noises[0].force ** 2 <= 1.001 * (
        best.statistics.chi_square * best.noises[0].force ** 2
    ):
        pytest.skip("the minimiser left the poor optimum by itself")
    interval = ul.profile(best, E).interval()
    assert interval.low < 1e6 < interval.high


@pytest.mark.parametrize("level", [0.0, 1.0, -0.1, 0.9999])
def test_levels_that_are_none(level):
    with pytest.raises(ul.InputError, match="level"):
        ul.profile(problem(layer_on(ul.RIGID), [E]), E).interval(level)


def test_parameters_that_cannot_be_profiled():
    p = problem(layer_on(ul.RIGID), {E: (1e5, 1e7), "noise.force": None})
    with pytest.raises(ul.InputError, match="not free here"):
        ul.profile(p, "layer.nu")
    with pytest.raises(ul.InputError, match="the noise is frozen"):
        ul.profile(p, "noise.force", calibrate=19)
    with pytest.raises(ul.InputError, match="the noise is frozen"):
        delta_chi_square_at(ul.fit(p), "noise.force", 1e-3)
    with pytest.raises(ul.InputError, match="outside its bounds"):
        delta_chi_square_at(ul.fit(p), E, 1e8)


def test_words_of_an_interval():
    assert str(Interval(E, 0.95, 1e6, 2e6, "data", "data")) == "layer.E between 1 MPa and 2 MPa (95 %)"
    assert "no lower bound from these data, as far as the law" in str(
        Interval(H, 0.9, 1e-4, 2e-3, "law", "data")
    )
    assert str(Interval(H, 0.9, -np.inf, np.inf, "none", "none")) == (
        "layer.thickness is not bounded by these data (90 %)"
    )


CASES = [case for case in coverage.all_cases() if case.noise != "loud"]


@pytest.mark.parametrize("case", [CASES[0], CASES[1], CASES[5], CASES[6]], ids=lambda case: case.name)
def test_intervals_cover(case):
    # The study runs 1000 replicas per case (tests/studies/coverage.json). Of 30, 24 or fewer inside has
    # probability 0.003 at 95 %.
    found = coverage.run(case, 30, seed=1)
    assert all(share * 30 > 24 for share in found["coverage"].values())


def test_intervals_of_correlated_noise_taken_for_white_do_not_cover():
    # The control: it must fail, and the fit must have warned.
    case = next(case for case in CASES if case.noise == "ar1" and case.fitted_as == "white")
    found = coverage.run(case, 30, seed=1)
    assert all(share < 0.8 for share in found["coverage"].values())
    assert found["warned"] > 0.9


def test_a_walk_that_ends_on_the_limit_has_its_end_there():
    """The curve through the points is off by a rounding at the last of them: no sign changes before it."""
    rng = np.random.default_rng(0)
    for _ in range(500):
        places, z = np.sort(rng.uniform(0.0, 1.0, 9)), np.sort(rng.uniform(0.0, 4.0, 9))
        found = _crossing(places, z, _constant(float(np.nextafter(z[-1], 0.0))))
        # Where the curve is level there, a rounding of z is the root of one along the walk.
        assert found == pytest.approx(places[-1], abs=1e-6)


def test_a_bottom_that_a_walk_stood_on_takes_the_place_of_that_step():
    # Beside it, at the same value to rounding, it left a profile that no cubic goes through.
    found = ul.fit(problem(layer_on(ul.RIGID), [E, C]))
    beside = [found.vector + step * np.array([0.1, 0.0]) for step in (-1.0, 0.0, 1.0)]
    walk = replace(Walk.start(found, 0, found.vector), vectors=beside, delta_chi_squares=[1.0, 0.5, 1.0])
    walked = walk.with_bottoms()
    places = np.array(walked.vectors)[:, 0]
    assert (np.diff(places) > 1e-3).all()
    assert len(places) == 3
    assert walked.delta_chi_squares[1] < 0.5


def all_free(seed):
    """Fit a random test of a user's range on an elastic base, its noise known."""
    rng = np.random.default_rng(seed)
    while True:
        _, scene, depth, points, noise = user_test(rng)
        if isinstance(scene.substrate, ul.Isotropic):
            break
    clean = Clean.of(scene, depth, points)
    curve = disturbed(clean, "clean", rng, noise)
    free = [E, H, BASE, C, "instrument.baseline"]
    return ul.fit(ul.Problem(scene, curve, free, ul.Noise(force=noise * clean.top)))


def test_a_prediction_among_places_without_a_law_does_not_end_a_walk(monkeypatch):
    """From a thick layer to a thin one on a base as soft the last two steps point far beyond what has a law."""
    found = all_free([3004, 6])
    begun, follow = [], Walk.follow

    def counted(walk, q, **options):
        failures = walk.objective.failures
        step = follow(walk, q, **options)
        begun.append((step is not None, walk.objective.failures - failures))
        return step

    monkeypatch.setattr(Walk, "follow", counted)
    end = ul.profile(found, E)
    assert end.interval().high_reason == "data"
    # Searches from the prediction were refused, and yet it was made.
    assert max(refused for made, refused in begun if made) > 2


@pytest.mark.parametrize("number", [4, 16])
def test_beside_a_plateau_the_others_are_at_their_best(number):
    """Where a base does not act, steps along it must not leave the others short of their best."""
    found = all_free([3001, number])
    at, base = found.names.index(H), found.names.index(BASE)
    end = found.problem.coordinates[at].scaled(ul.profile(found, H).interval().high)
    walk = Walk.start(found, at, found.vector)
    rises = []
    for away in np.linspace(-6.0, 6.0, 9):
        start = np.array(found.vector)
        start[[at, base]] = end, away
        other = minimise(walk.objective, start, Search(steps=200, settled=1e-9))
        rises += [] if other is None else [walk.delta_chi_square(other.point)]
    # A crossing is placed to 1e-3 standard deviations of a profile that is nearly straight, dt = 2 z dz; ten times
    # that for one that is bent.
    assert min(rises) == pytest.approx(stats.chi2.ppf(0.95, 1), abs=0.04)


def test_a_walk_halves_the_way_to_where_the_laws_end(monkeypatch):
    found = ul.fit(problem(layer_on(ul.RIGID), [E, C]))
    here = float(found.vector[0])
    deviation = float(np.sqrt(found.scaled_covariance[0, 0]))
    wall, asked = here + 300.7 * deviation, []

    def follow(self, q, **_):
        asked.append(q)
        there = Point(np.array([q, found.vector[1]]), self.base, np.zeros(2), np.eye(2))
        return there if q < wall else None

    monkeypatch.setattr(Walk, "follow", follow)
    walked = Walk.start(found, 0, found.vector).go(1.0)
    assert walked.reason == "law"
    # A level profile: steps double to the wall in ten, and halve what is left to a twentieth of the way.
    assert len(asked) < 20
    assert walked.vectors[-1][0] < wall < walked.vectors[-1][0] + 0.06 * (wall - here) + deviation


@pytest.mark.parametrize("points", [10, 60, 300])
def test_many_radii_are_read_off_a_table_as_exact_as_the_sums(points: int) -> None:
    """Between the knots, at corners and at the apex; 5000 radii of 300 points in a tenth of the time and less."""
    r = np.linspace(0.0, 1.2e-3, points)
    for height in (
        r**2 / 2e-3 * (1.0 + 100.0 * r),
        np.hypot(r, 1e-4) - 1e-4,
        np.maximum(0.1 * r, 0.5 * (r - 6e-4) + 6e-5),
    ):
        tip = ul.Profile(r, height)
        radius = np.sort(np.random.default_rng(0).uniform(0.0, r[-1], 5000))
        one_by_one = [f(part) for f in (tip.abel, tip.abel_slope) for part in np.split(radius, 50)]
        sums = np.concatenate(one_by_one).reshape(2, -1)
        assert tip.abel(radius) == pytest.approx(sums[0], rel=2e-12, abs=0.0)
        assert tip.abel_slope(radius) == pytest.approx(sums[1], rel=5e-11, abs=0.0)
        assert tip.abel(tip.halfspace_radius(sums[0])) == pytest.approx(sums[0], rel=1e-11, abs=0.0)

    def seconds(parts: int) -> float:
        start = time.process_time()
        for part in np.split(radius, parts):
            tip.abel(part)
        return time.process_time() - start

    if points == 300:
        tip = ul.Profile(r, np.hypot(r, 1e-4) - 1e-4)
        tip.abel(radius)
        assert 10.0 * min(seconds(1) for _ in range(3)) < min(seconds(50) for _ in range(3))
