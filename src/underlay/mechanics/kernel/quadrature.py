"""Quadrature over the wavenumber u for integrals of the kernel, int_0^inf [1 - L(u)] cos(s u) cos(t u) du.

Three scales shape the integrand. Near u = 0 a substrate of another stiffness bends L: a soft one at
u ~ ratio (the layer stretches) and ratio^(1/3) (it bends), a stiff one at u ~ ratio^(-1/3). From there to
the roots of the layer it varies slowly on a logarithmic scale, its poles standing 60 degrees or more off
the real axis: panels that triple in width serve, each with the same few Gauss-Legendre nodes. Beyond, it
decays as exp(-2 slow u) while the cosines oscillate: panels of equal width, with as many nodes as make them
cheapest.
"""

from __future__ import annotations

from math import ceil, e, hypot, lgamma, log
from typing import NamedTuple

import numpy as np

from underlay._arrays import FloatArray, read_only
from underlay.errors import RangeError
from underlay.mechanics.plane_constants import PlaneConstants, Real

__all__ = ["MOST_NODES", "u_rule"]

_LARGEST_ORDER = 40
#: Most nodes of a rule: a hundred times those of any pair of real materials at a/h = 20.
MOST_NODES = 100_000
_ORDERS = np.arange(1.0, _LARGEST_ORDER + 1.0)
_GAUSS = tuple(
    tuple(read_only(array) for array in np.polynomial.legendre.leggauss(n))
    for n in range(1, _LARGEST_ORDER + 1)
)
_GROWTH = 3.0
# n nodes leave rho^(-2 n), rho the Bernstein ellipse through the nearest pole: 3.85 in a tripling panel with
# a pole at 60 degrees, 3.7 in [0, 1] with the pole at 0.74i of nu = 0.5 on a rigid base.
_PER_NODE = log(3.7)


def u_rule(
    layer: PlaneConstants,
    substrate: PlaneConstants | None,
    eps_max: float,
    rtol: float,
    *,
    power: int = 0,
    smallest: float = np.inf,
) -> tuple[FloatArray, FloatArray]:
    """Nodes and weights on [0, inf) for int [1 - L(u)] u^power cos(s u) cos(t u) du, s, t <= `eps_max`.

    Parameters
    ----------
    layer, substrate : PlaneConstants
        Entries floats, or arrays (batch, 1): then one rule serves all members. `substrate` None is rigid.
    eps_max : float
        Largest frequency: the largest contact radius over thickness.
    rtol : float
        Wanted error of the integral, relative to int |1 - L(u)| u^power du: kept for 99 % of
        random pairs of anisotropic materials, within a factor 2 for the rest.
    power : int, default 0
        Power of u in the integrand, for the moments of (1.8).
    smallest : float, optional
        A smaller scale of u than those of layer and substrate, where the body has one.

    Returns
    -------
    nodes, weights : array (n,)
        Nodes in increasing order.

    Raises
    ------
    RangeError
        If there would be more than `MOST_NODES`, which is said before any is made.
    """
    digits = 1.0 - log(rtol)
    slow, fast, turn = _rates(layer)
    rate = 2.0 * hypot(slow, eps_max + turn)
    reach = _reach(digits, power) / (2.0 * slow)
    # Complex roots bring the poles nearer to the real axis: found by trial over random materials.
    per_node = _PER_NODE / (1.0 + 0.3 * turn / slow)
    least = min(ceil(digits / (2.0 * per_node)) + 1 + power // 2, _LARGEST_ORDER - 6)
    first = 1.0 / fast
    if substrate is not None:
        first = min(first, _first_panel(layer, substrate, digits, least, fast))
    first = min(first, smallest)
    # Largest half-phase phi that n nodes hold: int_-1^1 exp(i phi x) dx to (e phi/(4 n))^(2 n).
    widths = (8.0 / (e * rate)) * _ORDERS * np.exp(-0.5 * digits / _ORDERS)
    plan = _plan(first, reach, widths, least, least)
    for order in (least + 2, least + 4, least + 6):
        if not plan.tail_panels:
            break
        plan = min(plan, _plan(first, reach, widths, least, order), key=_nodes)
    if not _nodes(plan) <= MOST_NODES:
        raise RangeError(
            f"the kernel of this layer takes {_nodes(plan):.3g} nodes, and the most is {MOST_NODES}: its "
            f"displacements decay as exp(-{slow:.2g} z) while they oscillate as cos({turn:.2g} z), for a/h up "
            f"to {eps_max:.3g}; check the moduli of the layer (E, E_axial, G_axial) and their units"
        )
    graded = _panels(np.array(plan.edges), plan.order)
    if not plan.tail_panels:
        return graded
    tail = _panels(np.linspace(plan.edges[-1], reach, plan.tail_panels + 1), plan.tail_order)
    return np.concatenate((graded[0], tail[0])), np.concatenate((graded[1], tail[1]))


class _Plan(NamedTuple):
    """Edges and order of the tripling panels; number and order of the equal ones after them."""

    edges: list[float]
    order: int
    tail_panels: int
    tail_order: int


def _nodes(plan: _Plan) -> int:
    return (len(plan.edges) - 1) * plan.order + plan.tail_panels * plan.tail_order


def _plan(first: float, reach: float, widths: FloatArray, least: int, order: int) -> _Plan:
    """Triple the panels up to the width that `order` nodes can hold, then take the cheapest equal ones."""
    widest = float(widths[order - 1])
    edge = min(first, widest, reach)
    edges = [0.0, edge]
    while edge < reach and (_GROWTH - 1.0) * edge <= widest:
        edge = min(_GROWTH * edge, reach)
        edges.append(edge)
    if edge >= reach:
        return _Plan(edges, order, 0, 0)
    # A panel wider than its distance from zero also needs nodes for the poles near zero.
    allowed = np.minimum(widths[least - 1 :], ((_GROWTH - 1.0) * edge / least) * _ORDERS[least - 1 :])
    panels = np.ceil((reach - edge) / allowed)
    cheapest = int(np.argmin(panels * _ORDERS[least - 1 :]))
    return _Plan(edges, order, int(panels[cheapest]), least + cheapest)


def _rates(layer: PlaneConstants) -> tuple[float, float, float]:
    """Slowest decay, largest modulus and fastest oscillation of the layer's roots, over the batch."""
    p, half = layer.p, 0.5 * layer.sigma
    d2 = half * half - p
    d = np.maximum(d2, 0.0) ** 0.5
    slow = _extremes(np.minimum(half, p / (half + d)))[0]
    # sqrt(p) is the modulus of complex roots; of real ones it is between the two.
    fast = _extremes(np.maximum(half + d, p**0.5))[1]
    return slow, fast, _extremes(np.maximum(-d2, 0.0) ** 0.5)[1]


def _extremes(value: Real) -> tuple[float, float]:
    if isinstance(value, np.ndarray):
        return float(value.min()), float(value.max())
    return float(value), float(value)


def _first_panel(
    layer: PlaneConstants, substrate: PlaneConstants, digits: float, order: int, fast: float
) -> float:
    """Width of the first panel over a substrate that is not rigid.

    A pole at -x is resolved on [0, x/delta] by n nodes to exp(-4 n sqrt(delta)). With r the ratio of the
    thetas: the pole of a stretching layer, at -1/(sigma1 + sigma2 g1/g2), carries r^(2/3) of the integral on
    a soft base; the bend on a stiff base, at r^(-1/3), carries r^(-4/3). What is below the tolerance needs
    no panel.
    """
    softest, stiffest = _extremes(substrate.theta / layer.theta)
    width = min(1.0, 2.0 * softest ** (1.0 / 3.0)) / fast
    wanted = digits + 1.0 + 2.0 / 3.0 * log(min(stiffest, 1.0))
    if wanted > 0.0:
        stretch = _extremes(1.0 / (layer.sigma + layer.g / substrate.g * substrate.sigma))[0]
        width = min(width, stretch * (4.0 * order / wanted) ** 2)
    if stiffest > 1.0:
        wanted = digits - 4.0 / 3.0 * log(max(softest, 1.0))
        if wanted > 0.0:
            width = min(width, stiffest ** (-1.0 / 3.0) * (4.0 * order / wanted) ** 2 / fast)
    return float(width)


def _reach(digits: float, power: int) -> float:
    """x where the tail of int x^(power + 2) exp(-x) falls to exp(-digits) of the whole."""
    x = digits + power + 2.0
    for _ in range(6):
        x = digits + (power + 2.0) * log(x) - lgamma(power + 3.0)
    return x


def _panels(edges: FloatArray, order: int) -> tuple[FloatArray, FloatArray]:
    x, w = _GAUSS[order - 1]
    half = 0.5 * np.diff(edges)[:, None]
    middle = edges[:-1, None] + half
    return (middle + half * x).ravel(), (half * w).ravel()
