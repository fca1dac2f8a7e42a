"""An independent reference: the contact problem as a Fredholm equation, solved by brute force.

Plain Nystrom with far more nodes than needed and its own u-quadrature, so that it shares with the library
only the kernel function 1 - L(u). Equation: f(x) = w - H(a x) + (2 eps/pi) int_0^1 K(eps x, eps y) f(y) dy,
K(s, t) = int_0^inf [1 - L(u)] cos(s u) cos(t u) du, f(1) = 0, P = 4 theta a int_0^1 f dx.
"""

from dataclasses import dataclass

import numpy as np

import underlay as ul


def dyadic_rule(lowest=2.0**-40, highest=48.0, widest=1.0, per_panel=16):
    """Gauss-Legendre nodes and weights on panels that halve towards zero."""
    edges = [0.0, lowest]
    while edges[-1] < highest:
        edges.append(edges[-1] + min(edges[-1], widest))
    edges = np.array(edges)
    x, w = np.polynomial.legendre.leggauss(per_panel)
    half = 0.5 * np.diff(edges)[:, None]
    return (edges[:-1, None] + half * (x + 1.0)).ravel(), (half * w).ravel()


def moments(layer, substrate, count=3):
    """a_0, a_1, ... of (1.8) by the same quadrature."""
    u, weight = dyadic_rule()
    values = weight * ul.SubstrateKernel(layer, substrate).one_minus_L(u)
    a, factor = [], 1.0
    for m in range(count):
        factor *= -1.0 / (2 * m) ** 2 if m else 1.0
        a.append(factor * float(values @ u ** (2 * m)))
    return np.array(a)


@dataclass
class Contact:
    """The solution at one contact radius; f at the nodes x in (0, 1) with their weights."""

    depth: float
    force: float
    kappa_inf: float
    x: np.ndarray
    weight: np.ndarray
    f: np.ndarray


def equations(kernel, eps, nodes):
    """Nodes and weights in (0, 1), 1 - K at them and K at the edge, weights within, for contact radius eps h."""
    u, wu = dyadic_rule(widest=min(1.0, 1.0 / eps))
    x, w = np.polynomial.legendre.leggauss(nodes)
    x, w = 0.5 * (x + 1.0), 0.5 * w
    cosine = np.cos(eps * np.outer(np.append(x, 1.0), u))
    kernel = (2.0 * eps / np.pi) * (cosine * (wu * kernel(u))) @ cosine[:-1].T * w
    return x, w, np.eye(nodes) - kernel[:-1], kernel[-1]


def solve(indenter, radius, thickness, layer, substrate, nodes=40):
    """Solve for one contact radius; for a flat punch the depth is 1."""
    kernel = ul.SubstrateKernel(layer, substrate).one_minus_L
    x, w, system, edge = equations(kernel, radius / thickness, nodes)
    H = indenter.abel(radius * np.append(x, 1.0))
    unit, shape = np.linalg.solve(system, np.stack([np.ones(nodes), H[:-1]], axis=1)).T
    depth = (H[-1] + edge @ shape) / (1.0 + edge @ unit) if H[-1] > 0.0 else 1.0
    f = depth * unit - shape
    return Contact(
        depth=float(depth),
        force=float(4.0 * layer.theta * radius * (w @ f)),
        kappa_inf=float(w @ unit),
        x=x,
        weight=w,
        f=f,
    )
