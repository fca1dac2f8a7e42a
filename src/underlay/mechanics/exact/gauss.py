"""Gauss-Legendre rules: ready-made, for even integrands, and for a power times an even integrand."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from underlay._arrays import FloatArray, read_only
from underlay.mechanics.exact.tables import TABLES

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


# The starting points are off by 4 % of a node's distance from the end of the interval at most: there the terms of
# P_n fall as 0.06^k / k!^2, and ten of them, and four steps on their sum, reach rounding for every even count.
_TERMS, _NEWTON_STEPS = 10, 4


def _legendre(*counts: int) -> dict[int, tuple[FloatArray, FloatArray]]:
    """Nodes by Newton's method on P_n, weights 2/((1 - x^2) P_n'^2), for even counts, which increase.

    The recurrence of P_n runs once for all counts, so that the rules of them all take as long as the largest alone,
    and once for all steps: they are made on its Taylor series about the starting points, from Legendre's equation.
    numpy's and scipy's rules, from eigenvalues, carry weights with errors of 1e-11 at 128 nodes and 1e-10 at
    400, which the condition of wide contacts raises to 1e-8; these stay at 1e-15 in every integral tried.
    """
    sizes = [count // 2 for count in counts]
    ends = np.cumsum(sizes)
    degree = np.repeat(counts, sizes)
    half = np.concatenate([np.arange(size, 0, -1) for size in sizes])
    start = np.cos(np.pi * (half - 0.25) / (degree + 0.5))
    before, here = np.ones_like(start), start.copy()
    for n in range(2, counts[-1] + 1):
        # Nodes of smaller rules have come to their end.
        on = slice(int(np.searchsorted(degree, n)), None)
        after = ((2 * n - 1) * start[on] * here[on] - (n - 1) * before[on]) / n
        before[on], here[on] = here[on], after
    terms = [here, degree * (start * here - before) / (start * start - 1.0)]
    for k in range(_TERMS - 2):
        # (1 - x^2) P^(k+2) = 2 (k + 1) x P^(k+1) + (k (k + 1) - n (n + 1)) P^(k), each over its factorial.
        bend = 2.0 * (k + 1) ** 2 * start * terms[-1] + (k * (k + 1) - degree * (degree + 1.0)) * terms[-2]
        terms.append(bend / ((k + 1) * (k + 2) * (1.0 - start * start)))
    series = np.array(terms)
    derivative = series[1:] * np.arange(1.0, _TERMS)[:, None]
    step = np.zeros_like(start)
    for _ in range(_NEWTON_STEPS):
        step -= _polynomial(series, step) / _polynomial(derivative, step)
    x, slope = start + step, _polynomial(derivative, step)
    weights = 2.0 / ((1.0 - x * x) * slope * slope)
    rules = zip(np.split(x, ends), np.split(weights, ends), strict=True)
    return {
        count: (
            read_only(np.concatenate((-nodes[::-1], nodes))),
            read_only(np.concatenate((own[::-1], own))),
        )
        for count, (nodes, own) in zip(counts, rules, strict=False)
    }


def _polynomial(coefficients: FloatArray, x: FloatArray) -> FloatArray:
    """Sum of coefficients (terms, n) times powers of x (n,)."""
    total = np.zeros_like(x)
    for coefficient in coefficients[::-1]:
        total = total * x + coefficient
    return total


def _even(count: int) -> EvenRule:
    nodes, weights = legendre_rule(2 * count)
    nodes, weights = nodes[count:], weights[count:]
    orders = 4.0 * np.arange(count) + 1.0
    projection = read_only((even_legendre(nodes, count) * orders).T * weights)
    return EvenRule(nodes, weights, projection, read_only(np.append(nodes, 1.0)))


# Finding the nodes takes longer than solving a contact problem with them, so the common rules are constants: those
# of up to 64 nodes, those a sphere asks for beside a solution of up to 16 nodes (40 + 4 n), and twice 1 to 20 for
# the even rules. Larger ones are kept with the tables.
_LEGENDRE = _legendre(*sorted({*range(2, 42, 2), *range(4, 108, 4)}))


def legendre_rule(count: int) -> tuple[FloatArray, FloatArray]:
    """Gauss-Legendre nodes and weights on (-1, 1), for an even count."""
    if count in _LEGENDRE:
        return _LEGENDRE[count]
    return TABLES.get(("legendre", count), lambda: _legendre(count)[count])


_EVEN = {count: _even(count) for count in range(1, 21)}


def even_rule(count: int) -> EvenRule:
    """Return the rule of `count` nodes on (0, 1) for even integrands."""
    return _EVEN[count] if count in _EVEN else TABLES.get(("even rule", count), lambda: _even(count))
