"""What a test can tell: the known Cramer-Rao bounds, and the words made of them."""

import numpy as np
import pytest

import underlay as ul
from support.inverse import layer_on, measured, problem
from underlay.inference.design.identifiability import Combination, marginal

E, H, C, BASE = "layer.E", "layer.thickness", "instrument.contact_depth", "substrate.E"
RADIUS, THICKNESS, MODULUS = 1e-3, 1e-3, 1e6

#: Base over layer modulus (None: rigid), X = sqrt(R w_max)/h, then relative standard deviations in per cent:
#: E with (E, w0) free, E and h with (E, h, w0) free, and their correlation. Independent calculation for a
#: paraboloid, nu = 0.5 (base 0.3), 500 readings, a third before contact, noise 1 % of the largest force.
BOUNDS = [
    (None, 0.1, 0.35, 2.8, 18.0, 0.992),
    (None, 0.3, 0.41, 3.0, 4.9, 0.991),
    (None, 0.6, 0.53, 5.4, 3.9, 0.995),
    (None, 1.5, 0.68, 21.0, 9.7, 0.999),
    (10.0, 1.0, 0.8, 15.0, 8.8, 0.999),
    (3.0, 1.5, 1.9, 59.0, 45.0, 0.999),
    (0.3, 1.0, 1.1, 7.2, 4.0, -0.988),
]


def scene_of(ratio):
    base = ul.RIGID if ratio is None else ul.Isotropic(ratio * MODULUS, 0.3)
    return ul.Scene(ul.Paraboloid(RADIUS), ul.Layer(ul.Isotropic(MODULUS, 0.5), THICKNESS), base)


def judged(scene, x, free, points=500, level=0.01):
    depth = (x * THICKNESS) ** 2 / RADIUS
    noise = ul.Noise(force=level * float(scene.force(depth)))
    return ul.identifiability(scene, depth=np.linspace(-0.5 * depth, depth, points), free=free, noise=noise)


@pytest.mark.parametrize(("ratio", "x", "alone", "modulus", "thickness", "correlation"), BOUNDS)
def test_cramer_rao_bounds(ratio, x, alone, modulus, thickness, correlation):
    # The references have two digits.
    scene = scene_of(ratio)
    assert 100.0 * judged(scene, x, [E, C]).relative[E] == pytest.approx(alone, rel=0.06)
    both = judged(scene, x, [E, H, C])
    assert 100.0 * both.relative[E] == pytest.approx(modulus, rel=0.06)
    assert 100.0 * both.relative[H] == pytest.approx(thickness, rel=0.06)
    assert both.correlations.loc[E, H] == pytest.approx(correlation, abs=1.5e-3)


def test_three_unknowns_on_an_elastic_base():
    told = judged(scene_of(10.0), 1.0, [E, H, BASE, C])
    for name, per_cent in {E: 33.0, H: 27.0, BASE: 20.0}.items():
        assert 100.0 * told.relative[name] == pytest.approx(per_cent, rel=0.06)


def test_the_bound_is_the_standard_error_of_the_fit():
    scene = layer_on(ul.RIGID)
    found = ul.fit(problem(scene, [E, H, C], measured(scene)))
    told = ul.identifiability(found)
    for name in found.names:
        # One inverts J'J, the other decomposes J.
        assert told.stderr[name] == pytest.approx(found.stderr[name], rel=1e-4)
    assert told.correlations.to_numpy() == pytest.approx(found.correlations.to_numpy(), abs=1e-5)


def test_information_grows_with_the_number_of_points():
    scene = scene_of(None)
    few, many = (judged(scene, 0.5, [E, H, C], points=points) for points in (400, 1600))
    # Four times the points, up to the last interval of the grid.
    assert few.stderr[E] / many.stderr[E] == pytest.approx(2.0, rel=0.01)


def test_combinations_are_the_eigenvectors_and_their_deviations():
    told = judged(scene_of(None), 0.5, [E, H, C])
    best, worst = told.combinations
    covariance = told.covariance[:2, :2]
    for combination in (best, worst):
        powers = np.array([combination.powers[E], combination.powers[H]])
        assert np.abs(powers).max() == pytest.approx(1.0)
        assert combination.relative_sd == pytest.approx(np.sqrt(powers @ covariance @ powers), rel=1e-6)
    assert best.relative_sd < worst.relative_sd
    assert np.dot(list(best.powers.values()), list(worst.powers.values())) == pytest.approx(0.0, abs=1e-9)


def test_on_a_half_space_only_a_product_acts():
    scene = ul.Scene(ul.Paraboloid(1e-3), ul.Layer(ul.Isotropic(1e6, 0.5)))
    told = ul.identifiability(
        scene, depth=np.linspace(0.0, 1e-4, 100), free=[E, "indenter.radius"], noise=ul.Noise(force=1e-3)
    )
    # Hertz: P ~ E R^(1/2), so the other combination E^(-1/2) R is free.
    fixed, lost = told.combinations
    assert fixed.powers == pytest.approx({E: 1.0, "indenter.radius": 0.5}, abs=1e-6)
    assert str(fixed).endswith("layer.E * indenter.radius^0.5")
    assert lost.relative_sd == np.inf
    assert str(lost) == "not determined: indenter.radius * layer.E^-0.5"
    assert told.stderr[E] == np.inf
    assert "layer.E: not determined by these data" in told.report()
    assert np.isnan(told.correlations.loc[E, "indenter.radius"])


def test_a_prior_is_told_from_the_data():
    scene = scene_of(None)
    told = judged(scene, 0.1, {E: None, H: ul.Normal(1e-3, 5e-5), C: None})
    assert told.stderr[H] == pytest.approx(5e-5, rel=0.1)
    assert told.stderr_data_only[H] > 3.0 * told.stderr[H]
    assert "by its prior" in told.report()
    assert told.to_frame().loc[E, "stderr"] < told.to_frame().loc[E, "stderr, data only"]


@pytest.mark.parametrize(
    ("sd", "text"),
    [
        (0.004, "well determined, ± 0.78 %: a"),
        (0.3, "weakly determined, to a factor of 1.8: a"),
        (2.0, "not determined: a"),
        (np.inf, "not determined: a"),
    ],
)
def test_verdicts(sd, text):
    assert str(Combination({"a": 1.0, "b": 0.01}, sd)) == text


def test_marginal_information_is_the_inverse_of_the_covariances_block():
    root = np.random.default_rng(0).normal(size=(6, 4))
    matrix = root.T @ root
    block = np.linalg.inv(np.linalg.inv(matrix)[:2, :2])
    assert marginal(matrix, [0, 1], [2, 3]) == pytest.approx(block, rel=1e-9)


def test_before_a_test_everything_must_be_said():
    scene = scene_of(None)
    with pytest.raises(ul.InputError, match="depth, free and noise"):
        ul.identifiability(scene, free=[E])
    with pytest.raises(ul.InputError, match="noise must be given"):
        ul.identifiability(scene, depth=np.linspace(0.0, 1e-4, 50), free=[E], noise=ul.Noise())


@pytest.mark.parametrize("noise", [None, ul.Noise(force=2e-4)])
def test_after_a_test_it_says_the_statistical_part_of_the_fit(noise):
    scene = layer_on(ul.RIGID)
    made = ul.synthesize(scene, np.linspace(-3e-5, 1.5e-4, 300), ul.Noise(force=2e-4), rng=1)
    found = ul.fit(ul.Problem(scene, made, [E, C, "instrument.baseline"], noise))
    told = ul.identifiability(found)
    report = told.report().splitlines()
    for name in found.names:
        known = found.answer(name).statistical
        assert told.intervals[name] == known
        half = max(known.value - known.low, known.high - known.value)
        written = ul.units.format_quantity(known.value, ul.quantities.kind_of(name), half)
        assert f"{name}: {written} (95 %) is what this test can tell" in report
    known = found.answer(E).statistical
    half = 1.96 * told.combinations[0].relative_sd
    assert half == pytest.approx(max(known.value - known.low, known.high - known.value) / known.value)
    assert "the statistical part of a fit" in report[-1]


def test_of_a_product_it_says_what_the_draws_of_the_fit_do():
    scene = layer_on(ul.RIGID)
    found = ul.fit(problem(scene, [E, H, C], measured(scene)))
    told = ul.identifiability(found)
    for one in told.combinations:
        powers = [one.powers[E], one.powers[H]]
        low, _, high = found.band(lambda p, powers=powers: np.prod(p[:, :2] ** powers, axis=1)[:, None])
        assert 1.96 * one.relative_sd >= 0.5 * np.log(high[0] / low[0]) * (1.0 - 1e-9)


def test_a_zero_is_written_in_the_unit_of_its_uncertainty():
    scene = ul.Scene(ul.Paraboloid(1e-6), ul.Layer(ul.Isotropic(1e4, 0.5), 4e-6), ul.RIGID)
    told = ul.identifiability(
        scene, depth=np.linspace(-2e-7, 5e-7, 200), free=[E, C, "instrument.baseline"], noise=ul.Noise(1e-10)
    )
    half = 1.96 * told.stderr[C]
    assert 1e-9 < half < 1e-8
    assert f"{C}: 0.0 ± {1e9 * half:.1f} nm (95 %)" in told.report()
