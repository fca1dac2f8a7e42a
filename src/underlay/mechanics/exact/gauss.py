"""Gauss-Legendre rules: ready-made, for even integrands, and for a power times an even integrand."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from underlay._arrays import FloatArray, read_only

__all__ = ["EvenRule", "even_legendre", "even_rule", "legendre_rule"]


def even_legendre(nodes: FloatArray, count: int) -> FloatArray:
    """P_0, P_2, ..., P_(2 count - 2) at `nodes`: shape (nodes, count)."""
    return np.asarray(np.polynomial.legendre.legvander(nodes, 2 * count - 2)[:, ::2], dtype=np.float64)


class EvenRule(NamedTuple):
    """Positive half of a Gauss-Legendre rule: exact on (0, 1) for even polynomials of degree 4 n - 2.

    An even integrand needs half the nodes that the ordinary rule on (0, 1) would take.

    Parameters
    ----------
    nodes, weights : ndarray (n,)
        The rule.
    projection : ndarray (n, n)
        From values p(x_i) to the coefficients of p in P_0, P_2, ...: exact up to degree 2 n.
    with_edge : ndarray (n + 1,)
        The nodes and 1.
    """

    nodes: FloatArray
    weights: FloatArray
    projection: FloatArray
    with_edge: FloatArray

    def power_weights(self, exponent: float) -> FloatArray:
        """Weights v_i with sum v_i p(x_i) = int_0^1 x^exponent p(x) dx.

        Exact for even polynomials p of degree up to 2 n - 2, whatever the exponent, because
        int_0^1 x^a P_2k dx = prod_(j<=k) (a - 2j + 2) / prod_(j<=k) (a + 2j + 1) / (a + 1).
        """
        even = 2.0 * np.arange(1, self.nodes.size)
        moments = np.empty(self.nodes.size)
        moments[0] = 1.0 / (exponent + 1.0)
        moments[1:] = (exponent + 2.0 - even) / (exponent + 1.0 + even)
        return np.multiply.accumulate(moments) @ self.projection


# The starting points are right to 1/n^4: four steps reach rounding for every even count.
_NEWTON_STEPS = 6


def _legendre(count: int) -> tuple[FloatArray, FloatArray]:
    """Nodes by Newton's method on P_n, weights 2/((1 - x^2) P_n'^2), for even counts.

    numpy's and scipy's rules, from eigenvalues, carry weights with errors of 1e-11 at 128 nodes and 1e-10 at
    400, which the condition of wide contacts raises to 1e-8; these stay at 1e-15 in every integral tried.
    """
    half = np.arange(count // 2, 0, -1)
    x = np.cos(np.pi * (half - 0.25) / (count + 0.5))
    for _ in range(_NEWTON_STEPS):
        before, here = np.ones_like(x), x
        for n in range(2, count + 1):
            before, here = here, ((2 * n - 1) * x * here - (n - 1) * before) / n
        slope = count * (x * here - before) / (x * x - 1.0)
        step = here / slope
        x = x - step
        if np.abs(step).max() <= 4.0 * np.finfo(float).eps:
            break
    weights = 2.0 / ((1.0 - x * x) * slope * slope)
    return (
        read_only(np.concatenate((-x[::-1], x))),
        read_only(np.concatenate((weights[::-1], weights))),
    )


def _even(count: int) -> EvenRule:
    nodes, weights = _legendre(2 * count)
    nodes, weights = nodes[count:], weights[count:]
    orders = 4.0 * np.arange(count) + 1.0
    projection = read_only((even_legendre(nodes, count) * orders).T * weights)
    return EvenRule(nodes, weights, projection, read_only(np.append(nodes, 1.0)))


# Finding the nodes takes longer than solving a contact problem with them, so the common rules are constants;
# larger ones belong to problems that take milliseconds anyway.
_LEGENDRE = {count: _legendre(count) for count in range(4, 68, 4)}
_EVEN = {count: _even(count) for count in range(1, 17)}


def legendre_rule(count: int) -> tuple[FloatArray, FloatArray]:
    """Gauss-Legendre nodes and weights on (-1, 1), for an even count."""
    return _LEGENDRE[count] if count in _LEGENDRE else _legendre(count)


def even_rule(count: int) -> EvenRule:
    """Return the rule of `count` nodes on (0, 1) for even integrands."""
    return _EVEN[count] if count in _EVEN else _even(count)
