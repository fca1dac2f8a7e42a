"""Aim a frozen mixture at quantiles, so that fewer draws do for them.

The error of a quantile q of level a is that of the share of the posterior pi below it, over the density f there:
the draws that tell most of it are not spread as pi but as pi |1[x < q] - a| (Kahn and Marshall 1953, J. Oper. Res.
Soc. Am. 1, 263). In a posterior with a narrow core and wide, thin wings an end of an interval lies where f is
small, and only the few draws in the wings tell of it. Here the components get weight by
pi sqrt(sum (1[x < q] - a)^2 / f^2) over all quantiles, in standard deviations.
"""

from __future__ import annotations

import numpy as np

from underlay._arrays import FloatArray
from underlay.inference.ridge.mixture import Mixture
from underlay.inference.ridge.weights import LEVELS, WeightedDraws

__all__ = ["aimed"]

# Share that stays as it was: no weight grows by more than twice.
_KEPT = 0.5
# Levels on either side over which the density at a quantile is taken.
_BESIDE = 0.01


def aimed(mixture: Mixture, drawn: WeightedDraws) -> Mixture:
    """The same components, their weights such that the quantiles at `LEVELS` are known best.

    Parameters
    ----------
    mixture : Mixture
        A good proposal for the posterior.
    drawn : WeightedDraws
        Draws of it: no quantile is reported from these.
    """
    kept = drawn.weights > 0.0
    z, weights = drawn.z[kept], drawn.weights[kept]
    told = weights * np.sqrt(_influence(drawn, drawn.vectors[kept]))
    share = told @ mixture.responsibilities(z)
    return mixture.reweighted(_KEPT * mixture.weights + (1.0 - _KEPT) * share / share.sum())


def _influence(drawn: WeightedDraws, vectors: FloatArray) -> FloatArray:
    """Sum over quantiles of (1[x < q] - a)^2 / f^2, f per standard deviation, at vectors (n, p)."""
    total = np.zeros(len(vectors))
    for level, quantile in zip(LEVELS, drawn.quantiles(), strict=True):
        ends = drawn.quantiles((level - _BESIDE, level + _BESIDE))
        slopes = (ends[1] - ends[0]) / (2.0 * _BESIDE * drawn.deviations)
        total += np.square(((vectors < quantile) - level) * slopes).sum(axis=1)
    return total
