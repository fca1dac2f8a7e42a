"""The kernel in Laplace and Hankel space against a transfer matrix in many digits, and its limits."""

import numpy as np
import pytest
from scipy.special import spherical_jn

from biphasic_reference import TRANSVERSE, isotropic, transfer_matrix, transverse
from underlay.mechanics.biphasic.material import BiphasicTransverse
from underlay.mechanics.biphasic.surface import Sampled, SurfaceKernel, WavenumberRule, spherical_bessel
from underlay.mechanics.kernel import LayerKernel

LAPLACE = (1e-3, 0.1, 1.0, 30.0 + 80.0j, -20.0 + 70.0j, 1e4)
WAVES = (0.05, 1.0, 5.0, 20.0)


def kernel(skeleton, xi, s, h=1.0, **options):
    xi = np.atleast_1d(np.asarray(xi, dtype=float))
    return SurfaceKernel(skeleton, h).matrix(xi, np.full(xi.shape, s, dtype=complex), **options)


def materials():
    yield from ((name, transverse(name)) for name in TRANSVERSE)
    yield from ((nu, isotropic(nu)) for nu in (-0.5, 0.0, 0.3, 0.49))


@pytest.mark.parametrize(("name", "material"), list(materials()))
def test_kernel_equals_a_transfer_matrix_in_many_digits(name, material):
    del name
    for s in LAPLACE[1::2]:
        found = kernel(material.skeleton, WAVES[1:], s)
        exact = np.array([transfer_matrix(material.skeleton, xi, s, 1.0) for xi in WAVES[1:]])
        assert np.abs(found / exact - 1.0).max() < 1e-12


def test_transversely_isotropic_with_isotropic_constants_is_isotropic():
    same = BiphasicTransverse(2.6, 2.6, 0.3, 0.3, 1.0, 1.0).skeleton
    xi = np.geomspace(0.05, 30.0, 40)
    for s in (1e-2, 1.0, 30.0 + 50.0j):
        assert np.abs(kernel(same, xi, s) / kernel(isotropic(0.3).skeleton, xi, s) - 1.0).max() < 1e-9
    # The stated exception: triple root.
    wrong = kernel(same, xi, 1e-7) / kernel(isotropic(0.3).skeleton, xi, 1e-7) - 1.0
    assert np.abs(wrong).max() < 2e-7


@pytest.mark.parametrize(("name", "material"), list(materials()))
def test_drained_and_undrained_kernels_are_the_elastic_ones(name, material):
    del name
    skeleton, u = material.skeleton, np.geomspace(0.05, 20.0, 40)
    for constants, s, theta in (
        (skeleton.drained, 1e-11, skeleton.theta_drained),
        (skeleton.undrained, 1e22, skeleton.theta_undrained),
    ):
        compliance = (kernel(skeleton, u, s)[:, 0, 0] * u * theta).real
        elastic = 1.0 - LayerKernel(constants, None).values(u)
        assert np.abs(compliance - elastic).max() < 1e-9


def test_half_space_is_a_thick_layer():
    for material in (isotropic(0.3), transverse("ten")):
        xi = np.geomspace(0.5, 20.0, 20)
        thick, half = (kernel(material.skeleton, xi, 3.0 + 1.0j, h) for h in (120.0, np.inf))
        assert np.abs(thick / half - 1.0).max() < 1e-12


@pytest.mark.parametrize("s", [0.1, 3.0, 10.0 + 20.0j])
def test_long_waves_are_confined_compression(s):
    for material in (isotropic(0.3), transverse("five")):
        confined = material.skeleton.A33
        root = np.sqrt(s / confined + 0j)
        found = kernel(material.skeleton, 1e-4, s)[0, 0, 0]
        assert abs(found / (np.tanh(root) / (confined * root)) - 1.0) < 1e-6


def test_sealed_surface_is_the_one_whose_flux_is_none():
    material, xi = transverse("three"), np.geomspace(0.1, 20.0, 20)
    open_, sealed = (kernel(material.skeleton, xi, 2.0 + 5.0j, sealed=flag) for flag in (False, True))
    expected = open_[:, 0, 0] - open_[:, 0, 1] * open_[:, 1, 0] / open_[:, 1, 1]
    assert np.abs(sealed[:, 0, 0] / expected - 1.0).max() < 1e-11


def test_nothing_overflows_in_thick_layers_left_of_the_axis():
    xi = np.geomspace(0.01, 500.0, 200)
    for material in (isotropic(0.3), transverse("ten")):
        with np.errstate(all="raise", under="ignore"):
            found = kernel(material.skeleton, xi, -3e3 + 8e3j, 1e4)
        assert np.isfinite(found).all()


def test_bessel_functions():
    x = np.concatenate(([0.0, 1e-8, 1e-4, 2e-4], np.linspace(0.01, 80.0, 4001)))
    expected = np.array([spherical_jn(n, x) for n in range(20)])
    assert np.abs(spherical_bessel(20, x) - expected).max() < 1e-12


@pytest.mark.parametrize(("name", "material"), list(materials())[::2])
def test_a_few_places_give_the_kernel_at_all_nodes(name, material):
    """Of twelve places an e-fold in xi: on the positive axis, on the imaginary one, and where a contour ends."""
    del name
    nodes = WavenumberRule(500.0).nodes
    for h in (0.5, 4.0, np.inf):
        sampled = Sampled(nodes, h)
        for s, allowed in ((3.0, 5e-10), (1e3, 5e-10), (300.0j, 1e-6), (1e3 * np.exp(2.5j), 2e-3)):
            for count in (20, 700, nodes.size):
                found = sampled.read(kernel(material.skeleton, sampled.places(count), s, h), count)
                assert np.abs(found / kernel(material.skeleton, nodes[:count], s, h) - 1.0).max() < allowed
        assert sampled.places(nodes.size).size < 0.3 * nodes.size
