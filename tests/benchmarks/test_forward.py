"""What the forward models cost; run with `python -m pytest tests/benchmarks --benchmark-enable`.

The unit is the explicit fourth-order formula in plain numpy on the same depths: compare the medians of
one run. Nothing here asserts seconds.
"""

import numpy as np
import pytest

import underlay as ul
from support.laws import exact_law
from underlay.mechanics.body import isotropic_constants
from underlay.mechanics.exact.batch import ExactBatch

SHAPE = ul.Paraboloid(1e-3)
LAYER = ul.Layer(ul.Isotropic(3e6, 0.5), 1e-3)
BASES = {
    "rigid": ul.RIGID,
    "ten times stiffer": ul.Isotropic(3e7, 0.3),
    "ten times softer": ul.Isotropic(3e5, 0.3),
}
# On the rigid base the largest depth gives a/h = 2.
DEEPEST = 1.8e-3
SETS = 256


def depths(count=1000):
    return np.linspace(DEEPEST / count, DEEPEST, count)


def explicit(w, theta=2e6, A=500.0, F2=2.0, F3=0.9, lam=2.0, h=1e-3, C=(0.5, 0.3, 0.2, 0.1)):
    v = (w / (A * F2)) ** (1 / lam) / h
    return (
        theta
        * A ** (-1 / lam)
        * F3
        * w ** ((lam + 1) / lam)
        * (1 + C[0] * v + C[1] * v**2 + C[2] * v**3 + C[3] * v**4)
    )


def test_unit(benchmark):
    benchmark(explicit, depths())


@pytest.mark.parametrize("base", sorted(BASES))
def test_exact_from_cold(benchmark, base):
    w = depths()
    benchmark(lambda: exact_law(SHAPE, LAYER, BASES[base], max_depth=DEEPEST, rtol=1e-6).force(w))


@pytest.mark.parametrize("count", [10, 100, 1000, 10_000, 100_000, 1_000_000])
def test_exact_with_the_curve_held(benchmark, count):
    law, w = exact_law(SHAPE, LAYER, ul.RIGID, max_depth=DEEPEST, rtol=1e-6), depths(count)
    benchmark(law.force, w)


@pytest.mark.parametrize("base", ["rigid", "ten times stiffer"])
def test_exact_batch(benchmark, base):
    rng = np.random.default_rng(0)
    E = 3e6 * np.exp(0.1 * rng.standard_normal((SETS, 1)))
    nu = rng.uniform(0.4, 0.5, (SETS, 1))
    thickness = 1e-3 * rng.uniform(0.95, 1.05, SETS)
    layer = isotropic_constants(E, nu)
    below = None if base == "rigid" else isotropic_constants(10.0 * E, nu - 0.1)
    middle = (isotropic_constants(3e6, 0.45), None if base == "rigid" else isotropic_constants(3e7, 0.35))
    batch = ExactBatch.compile(SHAPE, *middle, thickness=0.95e-3, max_depth=DEEPEST, rtol=1e-6)
    w, theta = depths(), np.ravel(layer.theta)
    benchmark(lambda: batch.curves(layer, below).force(w, theta, thickness))
