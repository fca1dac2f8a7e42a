"""Parameter sets of one curve as arrays: what they have in common, where they differ, and their scales."""

from __future__ import annotations

from collections.abc import Mapping
from functools import cached_property
from typing import Any, TypeAlias

import numpy as np

from underlay._arrays import FloatArray
from underlay.inference.model.forward import Forward
from underlay.mechanics.exact.contact_problem import depth_measure
from underlay.mechanics.indenters import PowerLawShape
from underlay.scene.chain import Chain

__all__ = ["ParameterSets", "Values", "values_of"]

#: Numbers of a scene by path: one for all sets, or one per set, (sets,).
Values: TypeAlias = Mapping[str, float | FloatArray]


def values_of(values: Values, row: int) -> dict[str, float]:
    """Every number of one set."""
    return {path: float(v[row]) if isinstance(v, np.ndarray) else v for path, v in values.items()}


class ParameterSets:
    """Parameter sets of one curve.

    Parameters
    ----------
    forward : Forward
        The compiled scene.
    values : mapping of path to float or ndarray
        Every number of the scene (SI), (sets,) where it varies.
    sets : int
        How many.

    Attributes
    ----------
    ratios : tuple of float or ndarray (sets,)
        See `Similarity.reduced`.
    shared : tuple of float or None
        The ratios of all sets where none varies between them.
    tip : ndarray (sets, n)
        Indentation depths (m) by the reading, without compliance.
    deepest : ndarray (sets,)
        The largest of each, not negative.
    """

    def __init__(self, forward: Forward, values: Values, sets: int) -> None:
        self.forward, self.values, self.sets = forward, values, sets
        similarity = forward.similarity
        # `reduced` and `factors` divide and multiply: arrays go through them as numbers do.
        numbers: Any = values
        self.ratios: tuple[Any, ...] = similarity.reduced(numbers)
        # By what may vary, not by what happens to: one set alone goes the way it would go in company.
        self.shared = None if any(isinstance(ratio, np.ndarray) for ratio in self.ratios) else self.ratios
        upright = {path: v[:, None] if isinstance(v, np.ndarray) else v for path, v in values.items()}
        self.chain = Chain.of(upright)
        travel = self.chain.travel(forward.depth_at(upright))
        shape = (sets, forward.depth.shape[-1])
        self.tip = travel if travel.shape == shape else np.broadcast_to(travel, shape)
        self.deepest = np.maximum(self.tip.max(axis=1), 0.0)

    @property
    def rtol(self) -> float:
        """Relative error asked of the laws."""
        return self.forward.laws.solver.tolerance

    def varies(self, path: str) -> bool:
        """Whether a number may differ between the sets."""
        return isinstance(self.values[path], np.ndarray)

    def column(self, path: str) -> FloatArray:
        """Values of one number, (sets, 1)."""
        value = self.values[path]
        return value[:, None] if isinstance(value, np.ndarray) else np.full((self.sets, 1), value)

    @property
    def gain(self) -> FloatArray:
        """Force reading over force of each set, (sets,)."""
        numbers: Any = self.values  # as in __init__
        gain = self.forward.similarity.gain(numbers)
        return gain if isinstance(gain, np.ndarray) else np.full(self.sets, gain)

    def instrument_force(self, contact: FloatArray) -> FloatArray:
        """Force of the instrument (N), (sets, n), of that of the contact."""
        return self.chain.reading(contact, self.forward.depth)

    def varpi(self, thickness: FloatArray) -> FloatArray:
        """Largest half-space contact radius over thickness of each set."""
        measure = depth_measure(self.forward.similarity.scene.indenter)
        # w = A F_2 a^lambda, so a goes with A^(-1/lambda).
        radius = measure.halfspace_radius(self.deepest)
        if self._shape_varies:
            radius = radius * self._coefficient_ratio() ** (-1.0 / measure.exponent)
        return np.asarray(radius / thickness)

    @property
    def _shape_varies(self) -> bool:
        return any(self.varies(path) for path in self.forward.similarity.shape)

    def _coefficient_ratio(self) -> FloatArray:
        """A over that of the reference shape, (sets,): what b leaves when the thickness is taken out."""
        similarity = self.forward.similarity
        if not similarity.shape or similarity.exponent is None:
            return np.ones(self.sets)
        thin = np.broadcast_to(self.values["layer.thickness"], self.sets)
        stretch = thin / float(similarity.values["layer.thickness"])
        return np.asarray(stretch**-similarity.exponent / self.factors[0])

    def abel_coefficients(self) -> FloatArray | None:
        """A F_2 of the shape of each set, (sets,), where it varies."""
        indenter = self.forward.similarity.scene.indenter
        if not self._shape_varies or not isinstance(indenter, PowerLawShape):
            return None
        return np.asarray(indenter.abel_coefficient * self._coefficient_ratio())

    @cached_property
    def factors(self) -> tuple[FloatArray, FloatArray]:
        """The factors b and c of `Similarity`, each (sets,)."""
        numbers: Any = self.values  # as in __init__
        b, c = self.forward.similarity.factors(numbers)
        return np.broadcast_to(b, self.sets), np.broadcast_to(c, self.sets)
