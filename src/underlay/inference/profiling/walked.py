"""A profile walked to both sides of every optimum that a fit knows."""

from __future__ import annotations

import numpy as np

from underlay._arrays import FloatArray, read_only
from underlay.inference.least_squares.fit_result import Fit
from underlay.inference.profiling.profile_result import LikelihoodProfile
from underlay.inference.profiling.walk import Walk

__all__ = ["walked"]

# A fit found to be this much worse (in t) than a point of its own profile was not the optimum.
_BETTER = 1e-3


def walked(fit: Fit, name: str, highest: float) -> tuple[LikelihoodProfile, FloatArray | None]:
    """Profile of a parameter up to z = `highest`, and a scaled vector (k,) that fits better, were one met."""
    index = fit.names.index(name)
    below, above = _both_sides(fit, index, fit.vector, highest)
    rise, deepest = min((below.deepest, above.deepest), key=lambda basin: basin[0])
    branches = []
    for other in fit.alternatives:
        left, right = _both_sides(fit, index, other.vector, highest)
        branches.append(_joined(fit, name, left, right))
    return _joined(fit, name, below, above, tuple(branches)), deepest if rise < -_BETTER else None


def _both_sides(fit: Fit, index: int, vector: FloatArray, highest: float) -> list[Walk]:
    """Walk down and up from an optimum."""
    return [Walk.start(fit, index, vector).go(side, highest).with_bottoms() for side in (-1.0, 1.0)]


def _joined(
    fit: Fit, name: str, below: Walk, above: Walk, branches: tuple[LikelihoodProfile, ...] = ()
) -> LikelihoodProfile:
    index = fit.names.index(name)
    vectors = np.array([*below.vectors[:0:-1], *above.vectors])
    rise = np.maximum(np.array([*below.delta_chi_squares[:0:-1], *above.delta_chi_squares]), 0.0)
    return LikelihoodProfile(
        name=name,
        fit=fit,
        values=read_only(fit.problem.coordinates[index].physical(vectors[:, index])),
        delta_chi_square=read_only(rise),
        vectors=read_only(vectors),
        ends=(below.reason, above.reason),
        branches=branches,
    )
