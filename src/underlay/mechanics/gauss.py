"""Quadrature on fixed intervals: Gauss-Legendre, its even half, and product rules for powers."""

from __future__ import annotations

import numpy as np

from underlay._arrays import FloatArray, read_only

__all__ = ["even_legendre", "even_rule", "legendre_rule", "power_weights"]


def _compute(count: int) -> tuple[FloatArray, FloatArray]:
    nodes, weights = np.polynomial.legendre.leggauss(count)
    return read_only(nodes), read_only(weights)


# Finding the nodes takes longer than solving a contact problem with them, so the small rules, which are
# the common ones, are constants of the module; larger ones belong to problems that take milliseconds.
_RULES = {count: _compute(count) for count in (*range(2, 26, 2), *range(28, 52, 4))}


def legendre_rule(count: int) -> tuple[FloatArray, FloatArray]:
    """Gauss-Legendre nodes and weights on (-1, 1)."""
    return _RULES[count] if count in _RULES else _compute(count)


def even_rule(count: int) -> tuple[FloatArray, FloatArray]:
    """Nodes and weights on (0, 1) that integrate even polynomials of degree up to 4 `count` - 2 exactly.

    They are the positive half of the Gauss-Legendre rule of 2 `count` nodes: an even integrand needs half the
    nodes that the ordinary rule on (0, 1) would take.
    """
    nodes, weights = legendre_rule(2 * count)
    return nodes[count:], weights[count:]


def even_legendre(nodes: FloatArray, count: int) -> FloatArray:
    """P_0, P_2, ..., P_(2 count - 2) at `nodes`: shape (nodes, count)."""
    return np.polynomial.legendre.legvander(nodes, 2 * count - 2)[:, ::2]


def power_weights(nodes: FloatArray, weights: FloatArray, exponent: float) -> FloatArray:
    """Weights v_i with sum v_i p(x_i) = int_0^1 x^exponent p(x) dx for even p, on nodes of `even_rule`.

    Exact for even polynomials p of degree up to 2 n - 2, whatever the exponent: p is expanded in even
    Legendre polynomials, whose moments are int_0^1 x^a P_2k dx = prod_j (a - 2j + 2) / prod_j (a + 2j + 1).
    """
    count = nodes.size
    k = np.arange(1, count)
    factors = np.concatenate(([1.0], (exponent - 2.0 * k + 2.0) / (exponent + 2.0 * k + 1.0)))
    moments = np.cumprod(factors) / (exponent + 1.0) * (4.0 * np.arange(count) + 1.0)
    return weights * (even_legendre(nodes, count) @ moments)
