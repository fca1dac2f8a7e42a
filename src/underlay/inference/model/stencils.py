"""Difference quotients of laws, taken where they exist."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import TypeAlias

import numpy as np

from underlay._arrays import FloatArray
from underlay.errors import InputError

__all__ = ["ROUGH_STENCILS", "STENCILS", "Stencil", "first_possible"]

#: (steps, weights) of a difference quotient.
Stencil: TypeAlias = tuple[tuple[float, ...], tuple[float, ...]]

ROUGH_STENCILS: tuple[Stencil, ...] = (((0.0, 1.0), (-1.0, 1.0)), ((0.0, -1.0), (1.0, -1.0)))
# Central, backward and forward differences of second order.
STENCILS: tuple[Stencil, ...] = (
    ((-1.0, 1.0), (-0.5, 0.5)),
    ((0.0, -1.0, -2.0), (1.5, -2.0, 0.5)),
    ((0.0, 1.0, 2.0), (-1.5, 2.0, -0.5)),
)


def first_possible(force: Callable[[float], FloatArray], stencils: Sequence[Stencil]) -> FloatArray:
    """Difference quotient per step, by the first stencil that stays inside what is physically possible.

    At nu = 0.5 and at the incompressible limit of an anisotropic material only one side exists.
    """
    problem: InputError | None = None
    for steps, weights in stencils:
        try:
            forces = [force(step) for step in steps]
        except InputError as error:
            problem = error
            continue
        return np.asarray(sum(weight * value for weight, value in zip(weights, forces, strict=True)))
    raise InputError(f"the law has no neighbours to differentiate with: {problem}") from problem
