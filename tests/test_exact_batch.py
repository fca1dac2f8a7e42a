"""Many parameter sets at once: each must be what it is alone."""

import tracemalloc

import numpy as np
import pytest

import underlay as ul
from support.laws import exact_law
from underlay.mechanics.body import isotropic_constants
from underlay.mechanics.exact.batch import ExactBatch
from underlay.mechanics.kernel import LayerKernel

RTOL = 1e-6
SETS = 12


def parameters(ratio, nu):
    rng = np.random.default_rng(3)
    E = np.exp(0.2 * rng.standard_normal(SETS))
    nus = np.minimum(nu + 0.03 * rng.standard_normal(SETS), 0.5)
    bases = None if ratio is None else ratio * np.exp(0.2 * rng.standard_normal(SETS))
    return E, nus, bases, rng.uniform(0.9, 1.1, SETS)


@pytest.mark.parametrize(
    "shape", [ul.Paraboloid(2.0), ul.Cone(1.3), ul.Sphere(2.0)], ids=lambda shape: type(shape).__name__
)
@pytest.mark.parametrize(("ratio", "nu"), [(None, 0.45), (None, 0.3), (10.0, 0.45), (1.0, 0.4), (0.4, 0.3)])
def test_each_set_is_what_it_is_alone(shape, ratio, nu):
    E, nus, bases, thickness = parameters(ratio, nu)
    deepest = float(shape.abel(np.array(0.9)))
    w = deepest * np.array([-0.5, 0.0, 0.01, 0.3, 1.0])
    inner = isotropic_constants(E[:, None], nus[:, None])
    outer = None if bases is None else isotropic_constants(bases[:, None], np.full((SETS, 1), 0.3))
    middle = isotropic_constants(1.0, nu), None if ratio is None else isotropic_constants(ratio, 0.3)
    batch = ExactBatch.compile(shape, LayerKernel(*middle), thickness=0.9, max_depth=deepest, rtol=RTOL)
    curves = batch.curves(inner, outer, thickness)
    theta = np.ravel(inner.theta)
    force, stiffness = curves.force(w, theta, thickness), curves.stiffness(w, theta, thickness)
    assert force.shape == (SETS, w.size)
    for k in range(SETS):
        base = ul.RIGID if bases is None else ul.Isotropic(bases[k], 0.3)
        law = exact_law(
            shape, ul.Layer(ul.Isotropic(E[k], nus[k]), thickness[k]), base, max_depth=deepest, rtol=1e-9
        )
        error = curves.error_estimate[k]
        np.testing.assert_allclose(force[k], law.force(w), rtol=3.0 * error)
        np.testing.assert_allclose(stiffness[k, 2:], law.stiffness(w[2:]), rtol=3.0 * error)
    assert np.median(curves.error_estimate) < RTOL


def test_shapes_may_differ_in_size():
    shape, bigger = ul.Paraboloid(2.0), ul.Paraboloid(2.5)
    inner = isotropic_constants(np.ones((2, 1)), np.full((2, 1), 0.5))
    batch = ExactBatch.compile(
        shape, LayerKernel(isotropic_constants(1.0, 0.5), None), thickness=1.0, max_depth=0.5
    )
    curves = batch.curves(inner, None)
    w, theta, thickness = np.array([0.1, 0.3]), np.ravel(inner.theta), np.ones(2)
    sizes = np.array([shape.abel_coefficient, bigger.abel_coefficient])
    force = curves.force(np.array([w, w]), theta, thickness, sizes)
    for row, tip in zip(force, (shape, bigger), strict=True):
        law = exact_law(tip, ul.Layer(ul.Isotropic(1.0, 0.5), 1.0), ul.RIGID, max_depth=0.5, rtol=1e-9)
        np.testing.assert_allclose(row, law.force(w), rtol=2 * RTOL)


def test_slope_in_the_thickness():
    shape, h, step = ul.Paraboloid(2.0), 1.0, 1e-4
    w = np.array([0.05, 0.3])

    def law(thickness):
        return exact_law(
            shape, ul.Layer(ul.Isotropic(1.0, 0.45), thickness), ul.RIGID, max_depth=0.3, rtol=1e-11
        )

    slope = ((shape.exponent + 1.0) * law(h).force(w) - shape.exponent * w * law(h).stiffness(w)) / h
    central = (law(h + step).force(w) - law(h - step).force(w)) / (2.0 * step)
    # A central difference misses by step^2/6 of the third derivative, and by the law's error over the step.
    np.testing.assert_allclose(slope, central, rtol=1e-6)


def test_beyond_what_was_compiled_is_refused():
    constants = isotropic_constants(1.0, 0.5)
    curves = ExactBatch.compile(
        ul.Paraboloid(2.0), LayerKernel(constants, None), thickness=1.0, max_depth=0.5
    ).curves(constants, None)
    with pytest.raises(ul.RangeError, match="or compile it for more"):
        curves.force(np.array([0.6]), np.array([1.0]), np.array([1.0]))
    with pytest.raises(ul.RangeError, match="or compile it for more"):
        curves.force(np.array([0.5]), np.array([1.0]), np.array([0.9]))


def test_a_large_batch_stays_small_in_memory():
    sets = 256
    rng = np.random.default_rng(0)
    inner = isotropic_constants(np.ones((sets, 1)), rng.uniform(0.4, 0.5, (sets, 1)))
    batch = ExactBatch.compile(
        ul.Paraboloid(2.0), LayerKernel(isotropic_constants(1.0, 0.45), None), thickness=1.0, max_depth=0.5
    )
    w, theta = np.linspace(5e-4, 0.5, 1000), np.ravel(inner.theta)
    tracemalloc.start()
    batch.curves(inner, None).force(w, theta, np.ones(sets))
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    assert peak < 200e6


def test_a_set_whose_radii_pass_the_end_of_a_sphere_is_marked_and_harms_no_other():
    sphere, inner = ul.Sphere(2.0), isotropic_constants(np.ones((2, 1)), np.full((2, 1), 0.45))
    deepest = float(sphere.abel(np.array(0.9)))
    batch = ExactBatch.compile(
        sphere, LayerKernel(isotropic_constants(1.0, 0.45), None), thickness=0.9, max_depth=deepest, rtol=RTOL
    )
    curves = batch.curves(inner, None, np.array([0.9, 20.0]))
    assert curves.error_estimate[0] < RTOL
    assert curves.error_estimate[1] == np.inf
    alone = exact_law(sphere, ul.Layer(ul.Isotropic(1.0, 0.45), 0.9), ul.RIGID, max_depth=deepest, rtol=1e-10)
    theta = np.ravel(inner.theta)
    found = curves.force(np.array([0.5 * deepest]), theta, np.array([0.9, 20.0]))[0, 0]
    assert found == pytest.approx(float(alone.force(0.5 * deepest)), rel=RTOL)
