"""A posterior that is a sum: nodes of every part by itself.

Of a narrow and a wide density the sum has the ridge of neither, and a walk along it ends where the narrow one does.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy import special

from underlay._arrays import FloatArray
from underlay.inference.ridge.budget import Budget, OutOfTimeError
from underlay.inference.ridge.climb import Density, climb, small_basis
from underlay.inference.ridge.march import Node, march

__all__ = ["Part", "nodes_of"]

# A part that weighs less than this share is taken for normal: it does not pay to walk it.
_WALKED = 5e-3
# Otherwise it is so where at this many standard deviations its density is off a normal's by less than this.
_PROBE, _BENT = 2.0, 0.7


@dataclass(frozen=True, eq=False)
class Part:
    """One of the densities that a posterior is a sum of.

    Parameters
    ----------
    log_density : callable
        Its logarithm (n,) at places (n, p), where the prior is a standard normal.
    place, factor : FloatArray
        The normal distribution that it looks like about its top: middle (p,), factor of the covariance (p, p).
    """

    log_density: Density
    place: FloatArray
    factor: FloatArray

    def as_normal(self) -> tuple[Node, bool]:
        """One node for all of it, and whether it looks otherwise along its axes."""
        axes, widths, _ = np.linalg.svd(self.factor)
        steps = _PROBE * np.concatenate([axes.T * widths[:, None], -axes.T * widths[:, None]])
        values = self.log_density(self.place + np.concatenate([np.zeros((1, len(widths))), steps]))
        mass = float(values[0] + np.log(widths).sum() + 0.5 * np.log(2.0 * np.pi))
        is_bent = bool((np.abs(values[1:] - values[0] + 0.5 * _PROBE**2) > _BENT).any())
        return Node(self.place, self.factor, np.zeros((len(widths), 0)), mass), is_bent


def nodes_of(parts: Sequence[Part], budget: Budget) -> tuple[list[Node], str]:
    """Nodes of all parts, along its ridge where one is bent; and why these are not all, empty where they are."""
    normal = [(part, *part.as_normal()) for part in parts]
    normal = [entry for entry in normal if np.isfinite(entry[1].log_weight)]
    if not normal:
        return [], ""
    total = special.logsumexp([node.log_weight for _, node, _ in normal])
    nodes: list[Node] = []
    for part, node, is_bent in normal:
        try:
            walked = _walked(part, budget) if is_bent and node.log_weight > total + np.log(_WALKED) else ()
        except OutOfTimeError:
            return nodes + [node for _, node, _ in normal], "the processor time for walking was used up"
        nodes += walked or (node,)
    return nodes, ""


def _walked(part: Part, budget: Budget) -> tuple[Node, ...]:
    """Nodes along the ridge of a part; none where it has no density at its middle."""

    def density(z: FloatArray) -> FloatArray:
        budget.require()
        return part.log_density(z)

    top = climb(density, part.place, small_basis(len(part.place)))
    return () if top is None else march(density, top).nodes
