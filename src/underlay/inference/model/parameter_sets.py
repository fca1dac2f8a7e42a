"""Parameter sets of one curve as arrays: what they have in common, where they differ, how they scale.

`set_by_set` computes their readings one by one, which always works.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from functools import cached_property
from typing import Any, NamedTuple, TypeAlias

import numpy as np
from numpy.typing import NDArray

from underlay._arrays import FloatArray
from underlay.errors import InputError
from underlay.inference.model.forward import Forward
from underlay.mechanics.indenters import PowerLawShape
from underlay.scene.instrument import Chain

#: Numbers of a scene by path: one for all sets, or one per set, (sets,).
Values: TypeAlias = Mapping[str, float | FloatArray]


def upright(values: Values) -> dict[str, Any]:
    """Return the numbers shaped to broadcast over readings: (sets, 1) where they vary."""
    return {path: v[:, None] if isinstance(v, np.ndarray) else v for path, v in values.items()}


def values_of(values: Values, row: int) -> dict[str, float]:
    """Every number (SI) of one parameter set, by path; `row` is the set's index."""
    return {path: float(v[row]) if isinstance(v, np.ndarray) else v for path, v in values.items()}


class ParameterSets:
    """Many parameter sets of one curve.

    Parameters
    ----------
    forward : Forward
        The compiled scene.
    values : mapping of path to float or ndarray
        Every number of the scene (SI), (sets,) where it varies.
    sets : int
        How many sets.

    Attributes
    ----------
    ratios : tuple of float or ndarray (sets,)
        Ratios of moduli and lengths that the laws depend on; see `Similarity.reduced`.
    shared : tuple of float or None
        The ratios of all sets where none varies between them.
    tip : ndarray (sets, n)
        Indentation depths (m) from the readings, the compliance of a frame not subtracted.
    deepest : ndarray (sets,)
        Largest indentation depth (m) of each set, not negative.
    """

    def __init__(self, forward: Forward, values: Values, sets: int) -> None:
        self.forward, self.values, self.sets = forward, values, sets
        similarity = forward.similarity
        # `reduced` and `factors` divide and multiply: arrays go through them as numbers do.
        numbers: Any = values
        self.ratios: tuple[Any, ...] = similarity.reduced(numbers)
        # By what may vary, not by what does: a single set is computed in the way it would be among others.
        self.shared = None if any(isinstance(ratio, np.ndarray) for ratio in self.ratios) else self.ratios
        columns = upright(values)
        self.chain = Chain.of(columns)
        travel = self.chain.travel(forward.depth_at(columns))
        shape = (sets, forward.depth.shape[-1])
        self.tip = travel if travel.shape == shape else np.broadcast_to(travel, shape)
        self.deepest = np.maximum(self.tip.max(axis=1), 0.0)

    @property
    def rtol(self) -> float:
        """Relative tolerance of the contact laws."""
        return self.forward.laws.solver.tolerance

    def varies(self, path: str) -> bool:
        """Whether the number at `path` may differ between the sets."""
        return isinstance(self.values[path], np.ndarray)

    def column(self, path: str) -> FloatArray:
        """Values (SI) of the number at `path`, (sets, 1)."""
        value = self.values[path]
        return value[:, None] if isinstance(value, np.ndarray) else np.full((self.sets, 1), value)

    @property
    def gain(self) -> FloatArray:
        """Force reading over true force of each set, (sets,): one unless a cantilever's calibration is off."""
        numbers: Any = self.values  # as in __init__
        gain = self.forward.similarity.gain(numbers)
        return gain if isinstance(gain, np.ndarray) else np.full(self.sets, gain)

    def instrument_force(self, contact: FloatArray) -> FloatArray:
        """Force reading of the instrument (N), (sets, n), for a contact force (N), (sets, n)."""
        return self.chain.reading(contact, self.forward.depth)

    def varpi(self, thickness: FloatArray) -> FloatArray:
        """varpi (sets,): the largest contact radius of each set on a half-space, over the layer's thickness.

        `thickness` is in m, (sets,).
        """
        measure = self.forward.similarity.scene.indenter.power_law
        # w = A F_2 a^lambda, so a goes with A^(-1/lambda).
        radius = measure.halfspace_radius(self.deepest)
        if self._shape_varies:
            radius = radius * self._coefficient_ratio() ** (-1.0 / measure.exponent)
        return np.asarray(radius / thickness)

    @property
    def _shape_varies(self) -> bool:
        return any(self.varies(path) for path in self.forward.similarity.shape)

    def _coefficient_ratio(self) -> FloatArray:
        """Coefficient A of the tip's shape A r^lambda over that of the reference shape, (sets,)."""
        similarity = self.forward.similarity
        if not similarity.shape or similarity.exponent is None:
            return np.ones(self.sets)
        thin = np.broadcast_to(self.values["layer.thickness"], self.sets)
        stretch = thin / float(similarity.values["layer.thickness"])
        return np.asarray(stretch**-similarity.exponent / self.factors[0])

    def abel_coefficients(self) -> FloatArray | None:
        """A F_2 of each set, (sets,), in the half-space relation w = A F_2 a^lambda; None where the shape is fixed.

        w is the depth, a the contact radius, A r^lambda the tip's shape, and F_2 a function of lambda.
        """
        indenter = self.forward.similarity.scene.indenter
        if not self._shape_varies or not isinstance(indenter, PowerLawShape):
            return None
        return np.asarray(indenter.abel_coefficient * self._coefficient_ratio())

    @cached_property
    def factors(self) -> tuple[FloatArray, FloatArray]:
        """Factors b and c of each set in P(w) = c P_ref(b w), with P the force at the depth w, each (sets,).

        P_ref is the force of the reference scene; see `Similarity`.
        """
        numbers: Any = self.values  # as in __init__
        b, c = self.forward.similarity.factors(numbers)
        return np.broadcast_to(b, self.sets), np.broadcast_to(c, self.sets)


class Readings(NamedTuple):
    """Predictions of the forward model at many parameter sets.

    Parameters
    ----------
    contact : FloatArray
        Contact force (N), (sets, n).
    stiffness : FloatArray
        Its derivative in the tip's depth (N/m), (sets, n).
    force : FloatArray
        Force reading of the instrument (N), (sets, n).
    possible : ndarray of bool (sets,)
        Which sets have a contact law; rows of the others are zero.
    """

    contact: FloatArray
    stiffness: FloatArray
    force: FloatArray
    possible: NDArray[np.bool_]

    @classmethod
    def empty(cls, sets: int, points: int) -> Readings:
        """Zeros for `sets` sets of `points` readings, none of which has been computed."""
        contact, stiffness, force = (np.zeros((sets, points)) for _ in range(3))
        return cls(contact, stiffness, force, np.zeros(sets, dtype=bool))


def set_by_set(
    forward: Forward,
    values: Values,
    readings: Readings,
    rows: Iterable[int] | None = None,
    *,
    stiffness: bool = True,
) -> Readings:
    """Compute the readings of some sets one by one.

    Parameters
    ----------
    forward : Forward
        The compiled scene.
    values : mapping of path to float or FloatArray
        Every number of the scene (SI), (sets,) where it varies.
    readings : Readings
        Readings of all sets, into which the results are written; a set without a law is left as it is.
    rows : iterable of int, optional
        The sets that are computed; by default those that are not possible so far.
    stiffness : bool
        Whether the stiffness is computed too.
    """
    for row in np.flatnonzero(~readings.possible).tolist() if rows is None else rows:
        try:
            one = forward.of_set(row).reading(values_of(values, row), stiffness=stiffness)
        except InputError:
            continue
        readings.contact[row], readings.stiffness[row] = one.contact, one.stiffness
        readings.force[row] = one.force
        readings.possible[row] = True
    return readings


def is_shaped_by_lengths(forward: Forward) -> bool:
    """Whether the size or shape of the tip, or the thickness, acts in a way that no scaling of a law covers."""
    return any(path.startswith(("indenter.", "layer.thickness")) for path in forward.similarity.direct)
