"""Quadrature over the wavenumber u for integrals of the kernel, int_0^inf [1 - L(u)] cos(s u) cos(t u) du.

Three scales shape the integrand. Near u = 0 a substrate of another stiffness bends L: a soft one at
u ~ ratio (the layer stretches) and ratio^(1/3) (it bends), a stiff one at u ~ ratio^(-1/3). From there to
the roots of the layer it varies slowly on a logarithmic scale, its poles standing 60 degrees or more off
the real axis: panels that triple in width serve, each with the same few Gauss-Legendre nodes. Beyond, it
decays as exp(-2 slow u) while the cosines oscillate: panels of equal width, with as many nodes as make them
cheapest.
"""

from __future__ import annotations

from math import ceil, e, exp, hypot, lgamma, log

import numpy as np

from underlay._arrays import FloatArray
from underlay.mechanics.materials import PlaneConstants, Real

__all__ = ["u_rule"]

_LARGEST_ORDER = 40
_GAUSS = tuple(np.polynomial.legendre.leggauss(n) for n in range(1, _LARGEST_ORDER + 1))
_GROWTH = 3.0
# Half of ln(1/error) that one node of a tripling panel brings: ln rho, rho the Bernstein ellipse through a
# pole at 60 degrees, 3.85; a pole at 0.74i (nu = 0.5 on a rigid base) leaves 3.7 in the first panel.
_PER_NODE = log(3.7)


def u_rule(
    layer: PlaneConstants,
    substrate: PlaneConstants | None,
    eps_max: float,
    rtol: float,
    *,
    power: int = 0,
) -> tuple[FloatArray, FloatArray]:
    """Nodes and weights on [0, inf) for int [1 - L(u)] u^power cos(s u) cos(t u) du, s, t <= `eps_max`.

    Parameters
    ----------
    layer, substrate : PlaneConstants
        Entries floats, or arrays (batch, 1): then one rule serves all members. `substrate` None is rigid.
    eps_max : float
        Largest frequency: the largest contact radius over thickness.
    rtol : float
        Wanted error of the integral, relative to int |1 - L(u)| u^power du.
    power : int, default 0
        Power of u in the integrand, for the moments of (1.8).

    Returns
    -------
    nodes, weights : array (n,)
        Nodes in increasing order.
    """
    digits = -log(rtol)
    graded_order = min(ceil(digits / (2.0 * _PER_NODE)) + 1 + power // 2, _LARGEST_ORDER)
    slow, fast, turn = _rates(layer)
    rate = 2.0 * hypot(slow, eps_max + turn)
    reach = _reach(digits, power) / (2.0 * slow)
    widest = 2.0 * _half_phase(graded_order, digits) / rate
    first = _FIRST / fast
    if substrate is not None:
        first *= _first_panel(_extremes(substrate.theta / layer.theta), digits, graded_order)
    edges = [0.0, min(first, widest, reach)]
    while edges[-1] < reach and (_GROWTH - 1.0) * edges[-1] <= widest:
        edges.append(min(_GROWTH * edges[-1], reach))
    graded = _panels(np.array(edges), graded_order)
    left = reach - edges[-1]
    if left <= 0.0:
        return graded
    order, count = _cheapest(left, edges[-1], rate, digits, graded_order)
    uniform = _panels(edges[-1] + left / count * np.arange(count + 1.0), order)
    return np.concatenate((graded[0], uniform[0])), np.concatenate((graded[1], uniform[1]))


_FIRST = 1.0


def _rates(layer: PlaneConstants) -> tuple[float, float, float]:
    """Slowest decay, fastest decay and largest oscillation of the layer's roots, over the batch."""
    p, half = layer.p, 0.5 * layer.sigma
    d2 = half * half - p
    d = np.maximum(d2, 0.0) ** 0.5
    slow = _extremes(np.minimum(half, p / (half + d)))[0]
    return slow, _extremes(half + d)[1], _extremes(np.maximum(-d2, 0.0) ** 0.5)[1]


def _extremes(value: Real) -> tuple[float, float]:
    if isinstance(value, np.ndarray):
        return float(value.min()), float(value.max())
    return float(value), float(value)


def _first_panel(ratios: tuple[float, float], digits: float, order: int) -> float:
    """Width of the first panel over that of a rigid base, for substrates `ratios` as stiff (least, most).

    A pole at -x is resolved on [0, x/delta] by n nodes to exp(-4 n sqrt(delta)). The bend at u ~ ratio
    carries ratio^(2/3) of the integral, that at ratio^(-1/3) carries ratio^(-4/3): what is below the
    tolerance needs no panel.
    """
    softest, stiffest = ratios
    width = 1.0
    if softest < 1.0:
        width = min(width, 2.0 * softest ** (1.0 / 3.0))
        wanted = digits + 2.0 / 3.0 * log(min(stiffest, 1.0))
        if wanted > 0.0:
            width = min(width, softest * (4.0 * order / wanted) ** 2)
    if stiffest > 1.0:
        wanted = digits - 4.0 / 3.0 * log(max(softest, 1.0))
        if wanted > 0.0:
            width = min(width, stiffest ** (-1.0 / 3.0) * (4.0 * order / wanted) ** 2)
    return width


def _reach(digits: float, power: int) -> float:
    """x where the tail of int x^(power + 2) exp(-x) falls to exp(-digits) of the whole."""
    x = digits + power + 2.0
    for _ in range(6):
        x = digits + (power + 2.0) * log(x) - lgamma(power + 3.0)
    return x


def _half_phase(order: int, digits: float) -> float:
    """Largest phi for which n Gauss-Legendre nodes hold int_-1^1 exp(i phi x) dx to exp(-digits).

    The error is (e phi/(4 n))^(2 n) to leading order.
    """
    return 4.0 * order / e * exp(-digits / (2.0 * order))


def _cheapest(length: float, start: float, rate: float, digits: float, least: int) -> tuple[int, int]:
    """Order and number of equal panels from `start` over `length` with the fewest nodes."""
    best = (0, 0)
    for order in range(least, _LARGEST_ORDER + 1):
        # A panel wider than its distance from zero also needs nodes for the poles near zero.
        width = min(2.0 * _half_phase(order, digits) / rate, (_GROWTH - 1.0) * start * order / least)
        count = ceil(length / width)
        if not best[0] or order * count < best[0] * best[1]:
            best = (order, count)
    return best


def _panels(edges: FloatArray, order: int) -> tuple[FloatArray, FloatArray]:
    x, w = _GAUSS[order - 1]
    half = 0.5 * np.diff(edges)[:, None]
    middle = edges[:-1, None] + half
    return (middle + half * x).ravel(), (half * w).ravel()
