"""A plain solution of the exact contact problem, to judge approximate laws by.

f(x) = w - G(x) + (2 eps/pi) int_0^1 K(eps x, eps y) f(y) dy,  f(1) = 0 (a flat punch has no such condition),
K(s, t) = int_0^inf [1 - L(u)] cos(s u) cos(t u) du,  P = 4 theta a int_0^1 f dx.

The equations are those of `reference_contact`. Lengths in units of the layer thickness, forces in units of
theta h^2. Shares nothing with the library but the values of 1 - L handed in.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

import underlay as ul
from support.reference_contact import equations

# Geometric convergence: 13 nodes give 1e-10 at a/h = 3 on a rigid base (the worst here); 24 leave nothing.
NODES = 24


class Indentation(NamedTuple):
    """Exact answers over contact radii: depth w/h, force P/(theta h^2), and P over the half-space force."""

    depth: np.ndarray
    force: np.ndarray
    factor: np.ndarray


def bonded_kernel(layer, substrate):
    """1 - L(u) of a layer bonded to `substrate`, from the library."""
    return ul.SubstrateKernel(layer, substrate).one_minus_L


def frictionless_kernel(u):
    """1 - L(u) of a layer that rests without friction on a rigid base, whatever its Poisson's ratio.

    Papkovich stream function with w = 0 and no shear at both faces but the indented one gives
    L = (cosh 2u - 1)/(sinh 2u + 2u); with t = exp(-2u), 1 - L = 2 (2u + 1 - t) t/(1 + 4 u t - t^2).
    """
    t = np.exp(-2.0 * u)
    return 2.0 * (2.0 * u + 1.0 - t) * t / (1.0 + 4.0 * u * t - t * t)


def flat_punch(kernel, eps):
    """Layer factor kappa_inf(eps) of a flat punch of radius eps h: P = 4 theta a w kappa_inf."""
    return np.array([system.mean for _, system in _systems(kernel, eps)])


def power_law(kernel, eps, exponent):
    """Exact `Indentation` by a tip of H = a^exponent (in units of h) at contact radii eps h.

    The half-space force at the same depth w is 4 theta w^(1+1/exponent) exponent/(exponent+1).
    """
    depth, force = [], []
    for e, system in _systems(kernel, eps):
        profile = np.linalg.solve(system.operator, -((e * system.x) ** exponent))
        edge = -(e**exponent) + system.edge_row @ profile
        w = -edge / system.edge  # f(1) = 0
        depth.append(w)
        force.append(4.0 * e * (w * system.mean + system.weight @ profile))
    depth, force = np.array(depth), np.array(force)
    halfspace = 4.0 * depth ** (1.0 + 1.0 / exponent) * exponent / (exponent + 1.0)
    return Indentation(depth, force, force / halfspace)


def fixed_radius_factor(kernel, eps):
    """P/P_Hertz of a paraboloid whose contact radius is held at its half-space value, eps h."""
    factor = []
    for _, system in _systems(kernel, eps):
        profile = np.linalg.solve(system.operator, 1.0 - system.x**2)
        factor.append(1.5 * (system.weight @ profile))
    return np.array(factor)


class _System(NamedTuple):
    x: np.ndarray
    weight: np.ndarray
    operator: np.ndarray
    edge_row: np.ndarray
    mean: float  # of the solution for w = 1 and a flat face
    edge: float  # its value at x = 1


def _systems(kernel, eps):
    """(eps, its system) of each contact radius; the kernel does not know of them."""
    for e in np.atleast_1d(eps):
        x, weight, operator, edge_row = equations(kernel, e, NODES)
        unit = np.linalg.solve(operator, np.ones(NODES))
        yield e, _System(x, weight, operator, edge_row, weight @ unit, 1.0 + edge_row @ unit)
