"""Parameter sets of one curve as arrays, and their grouping for `ExactBatch`, the solver of many laws at once.

`ParameterSets` holds what the sets have in common, where they differ, and how they scale; `set_by_set` computes
them one by one, which always works. The groups' limits are fixed numbers, not taken from the sets at hand: the
result of a set does not depend on the other sets of the batch.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from functools import cached_property
from typing import Any, NamedTuple, TypeAlias

import numpy as np
from numpy.typing import NDArray

from underlay._arrays import FloatArray
from underlay.errors import InputError, RangeError
from underlay.inference.model.forward import Forward
from underlay.mechanics.body import PlaneConstants, isotropic_constants, transversely_isotropic_constants
from underlay.mechanics.exact.batch import ExactBatch
from underlay.mechanics.halfspace import largest_halfspace_depth
from underlay.mechanics.indenters import PowerLawShape
from underlay.mechanics.kernel import LayerKernel, StackKernel
from underlay.mechanics.kernel.bodies import sheets_of
from underlay.mechanics.kernel.recursion import Recursion
from underlay.scene.instrument import Chain

#: Numbers of a scene by path: one for all sets, or one per set, (sets,).
Values: TypeAlias = Mapping[str, float | FloatArray]
# Factors within which the stiffness ratios, and the ranges, of sets lie that share nodes.
_RATIO_STEP = 4.0
_RANGE_STEP = 2.0
# Reach of what is compiled over that asked for: another Poisson's ratio than the scene's bends the relation of
# depth and contact radius, and nodes that stop short leave the polynomial to extrapolate.
_MARGIN = 1.1
# Tolerance of what is compiled over that asked for, so that the sets at the edges of a group keep the promise: the
# largest error seen in 300 sets over E2/E1 from 0.01 to 1000 is then a third of the tolerance, and one set in
# fourteen, on the softest bases, goes alone; without it one in eight.
_SPARE = 0.1
# Share of the depth at which the contact would reach the end of a sphere, beyond which nothing is compiled.
_SHAPE_SHARE = 0.5
# The same numbers for the groups of a stack, with narrower ratios: of 32 sets each of a stiff, a soft and a
# slipping stack, at 1e-3 and 1e-6, the largest error was 0.11 of the tolerance.
_STACK_GROUPS_RATIO_STEP, _STACK_GROUPS_RANGE_STEP, _STACK_GROUPS_MARGIN, _STACK_GROUPS_SPARE = (
    2.0,
    2.0,
    1.1,
    0.1,
)
# Ratios of a stack that may vary: with more of them a group holds few sets.
_MOST_RATIOS = 4


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
        upright = {path: v[:, None] if isinstance(v, np.ndarray) else v for path, v in values.items()}
        self.chain = Chain.of(upright)
        travel = self.chain.travel(forward.depth_at(upright))
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
    forward: Forward, values: Values, rows: Iterable[int], readings: Readings, *, stiffness: bool = True
) -> Readings:
    """Compute the readings of some sets one by one.

    Parameters
    ----------
    forward : Forward
        The compiled scene.
    values : mapping of path to float or FloatArray
        Every number of the scene (SI), (sets,) where it varies.
    rows : iterable of int
        The sets that are computed.
    readings : Readings
        Readings of all sets, into which the results are written; a set without a law is left as it is.
    stiffness : bool
        Whether the stiffness is computed too.
    """
    for row in rows:
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


def exact_groups(
    sets: ParameterSets, stiffness_ratio: FloatArray, thickness: FloatArray
) -> Iterator[tuple[NDArray[np.intp], ExactBatch | None]]:
    """Group sets whose stiffness ratio, thickness and range are alike.

    Parameters
    ----------
    sets : ParameterSets
        Of an isotropic layer on an isotropic or rigid base.
    stiffness_ratio : FloatArray
        Indentation modulus of the base over that of the layer, (sets,); infinite on a rigid base.
    thickness : FloatArray
        Thickness of the layer (m), (sets,).

    Yields
    ------
    (ndarray of int, ExactBatch or None)
        Rows of a group, and the solver compiled for them; None where no law reaches them.
    """
    tops = sets.varpi(thickness)
    soft = np.where(
        np.isfinite(stiffness_ratio), np.round(np.log(stiffness_ratio) / np.log(_RATIO_STEP)), np.inf
    )
    ranges = np.ceil(np.log(np.maximum(_MARGIN * tops, 1e-3)) / np.log(_RANGE_STEP))
    # A sphere is no power law: its thickness counts on its own.
    power = isinstance(sets.forward.similarity.scene.indenter, PowerLawShape)
    thin = np.zeros(sets.sets) if power else np.floor(np.log(thickness) / np.log(_RANGE_STEP))
    keys = np.column_stack([soft, ranges, thin])
    for key in np.unique(keys, axis=0):
        rows = np.flatnonzero((keys == key).all(axis=1))
        yield rows, _compiled(sets, float(key[0]), float(key[1]), None if power else float(key[2]))


def _compiled(sets: ParameterSets, soft: float, octave: float, thin: float | None) -> ExactBatch | None:
    """Solver compiled for one group, kept in the problem's store; None where no law reaches so deep.

    Parameters
    ----------
    sets : ParameterSets
        All sets.
    soft : float
        Logarithm of the group's stiffness ratio, in the steps of the grouping; infinite on a rigid base.
    octave, thin : float, float or None
        Logarithms, in its steps, of the group's range over the thickness, and of the thickness (m) of a sphere's
        layer.
    """
    forward = sets.forward
    scene, store = forward.similarity.scene, forward.laws.store
    key = ("batch", forward.laws.number, soft, octave, thin)
    if key in store.batches:
        return store.batches[key]
    body = scene.contact.isotropic
    if body is None:
        return None
    thickness = scene.layer.thickness if thin is None else _RANGE_STEP**thin
    radius = _RANGE_STEP**octave * thickness
    reach = _SHAPE_SHARE * largest_halfspace_depth(scene.indenter)
    depth = min(float(scene.indenter.power_law.abel(np.array(radius))), reach)
    outer = None
    if np.isfinite(soft) and body.base is not None:
        # The hardest of the group needs the largest contact radius for its range.
        ratio = _RATIO_STEP ** (soft + 0.5) * body.layer.theta / body.base.theta
        outer = isotropic_constants(ratio * body.base.E, body.base.nu)
    try:
        compiled = ExactBatch.compile(
            scene.indenter,
            LayerKernel(body.layer.plane_constants, outer),
            thickness=thickness,
            max_depth=depth,
            rtol=_SPARE * sets.rtol,
        )
    except RangeError:
        compiled = None
    store.batches[key] = compiled
    return compiled


def has_stack_batches(asked: ParameterSets) -> bool:
    """Whether the sets are of a stack under a power-law tip, and differ in moduli and thicknesses only."""
    similarity, laws = asked.forward.similarity, asked.forward.laws
    if not (isinstance(laws.contact.kernel, StackKernel) and laws.solver.has_table(laws.contact)):
        return False
    if similarity.exponent is None or any(asked.varies(path) for path in similarity.direct):
        return False
    return 0 < len(_varying(asked)) <= _MOST_RATIOS


def _varying(asked: ParameterSets) -> dict[str, FloatArray]:
    """Ratios that differ between the sets, (sets,) each, by path as in `Similarity.ratio_paths`."""
    similarity = asked.forward.similarity
    # `reduced` divides arrays as it does numbers.
    values: Any = asked.values
    ratios: Sequence[Any] = similarity.reduced(values)
    numbers = zip(similarity.ratio_paths, ratios, strict=True)
    return {path: ratio for path, ratio in numbers if isinstance(ratio, np.ndarray)}


def stack_groups(asked: ParameterSets) -> Iterator[tuple[NDArray[np.intp], ExactBatch | None]]:
    """Group sets of a stack of layers whose ratios and range are alike.

    Sets share integration nodes when every ratio of moduli and of thicknesses that varies lies within a factor, and
    so does their range; the nodes are checked by doubling at the group's middle, at a tenth of the tolerance.

    Yields
    ------
    (ndarray of int, ExactBatch or None)
        Rows of a group, and the solver compiled for them; None where no law reaches them.
    """
    ratios = _varying(asked)
    thickness = asked.column("layer.thickness")[:, 0]
    ranges = np.ceil(
        np.log(np.maximum(_STACK_GROUPS_MARGIN * asked.varpi(thickness), 1e-3))
        / np.log(_STACK_GROUPS_RANGE_STEP)
    )
    steps = [np.round(np.log(ratio) / np.log(_STACK_GROUPS_RATIO_STEP)) for ratio in ratios.values()]
    keys = np.column_stack([*steps, ranges])
    for key in np.unique(keys, axis=0):
        rows = np.flatnonzero((keys == key).all(axis=1))
        middle = dict(zip(ratios, np.power(_STACK_GROUPS_RATIO_STEP, key[:-1]).tolist(), strict=True))
        yield rows, _stack_groups_compiled(asked, middle, float(key[-1]))


def _stack_groups_compiled(
    asked: ParameterSets, middle: dict[str, float], octave: float
) -> ExactBatch | None:
    laws = asked.forward.laws
    key = ("stack batch", laws.number, tuple(middle.items()), octave)
    if key not in laws.store.batches:
        scene = asked.forward.similarity.scene
        thickness = scene.layer.thickness
        depth = float(scene.indenter.power_law.abel(np.array(_STACK_GROUPS_RANGE_STEP**octave * thickness)))
        try:
            kernel = scene.with_values(middle).contact.kernel
            laws.store.batches[key] = ExactBatch.compile(
                scene.indenter,
                kernel,
                thickness=thickness,
                max_depth=depth,
                rtol=_STACK_GROUPS_SPARE * asked.rtol,
            )
        except InputError:
            laws.store.batches[key] = None
    return laws.store.batches[key]


def stacked(asked: ParameterSets, rows: NDArray[np.intp]) -> tuple[Recursion, FloatArray]:
    """Kernel of the stack for some of the sets, and half the indentation modulus of its surface (Pa), (rows,)."""
    kernel = asked.forward.laws.contact.kernel
    if not isinstance(kernel, StackKernel):
        raise TypeError(f"no stack: {kernel.description}")
    parts = ["layer", *(f"substrate.layers[{number}]" for number in range(len(kernel.layers) - 1))]
    constants = [_constants(asked, part, rows) for part in parts]
    base = None if kernel.base.plane_constants is None else _constants(asked, "substrate", rows)
    thicknesses = [asked.column(f"{part}.thickness")[rows] for part in parts]
    bonds = [layer.bond for layer in kernel.layers]
    return Recursion(*sheets_of(constants, base, thicknesses, bonds)), np.asarray(constants[0].theta)[:, 0]


def _constants(asked: ParameterSets, part: str, rows: NDArray[np.intp]) -> PlaneConstants:
    """Plane elastic constants of one layer or of the base, for some of the sets, entries (rows, 1).

    `part` is the path of the layer or base, such as ``"layer"``.
    """
    axial = f"{part}.E_axial" in asked.values
    names = ("E", "E_axial", "nu", "nu_axial", "G_axial") if axial else ("E", "nu")
    numbers = [asked.column(f"{part}.{name}")[rows] for name in names]
    return (transversely_isotropic_constants if axial else isotropic_constants)(*numbers)
