"""The forward model for many parameter sets at once, as a sampler asks for it.

Four ways, the first that applies:

1. no ratio varies between the sets: one law of the reference serves them all through `Similarity`'s factors;
2. only the ratio of two moduli varies: every set's curve is read off the table of its cell (`curve_family`);
3. an isotropic layer on an isotropic or rigid base and the exact law allowed (``"auto"`` or ``"exact"``): the
   sets go through `ExactBatch`, in groups whose stiffness ratio and range are alike;
4. otherwise set by set, through `Forward.reading`.

The groups' limits are fixed numbers, not taken from the sets at hand, so a set's answer does not depend on
the company it is asked in: a chain can be repeated bit by bit.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import replace
from typing import Any, NamedTuple, TypeAlias

import numpy as np
from numpy.typing import NDArray

from underlay._arrays import FloatArray
from underlay.errors import InputError, RangeError
from underlay.inference.model.forward import Forward
from underlay.mechanics.accuracy import Accuracy
from underlay.mechanics.exact.batch import ExactBatch
from underlay.mechanics.exact.contact_curve import depth_measure
from underlay.mechanics.exact.family_batch import family_batch
from underlay.mechanics.halfspace import largest_halfspace_depth
from underlay.mechanics.indenters import FlatPunch, PowerLawShape, Sphere
from underlay.mechanics.materials import Isotropic, PlaneConstants, Rigid, isotropic_constants

__all__ = ["Readings", "batched_readings"]

#: Numbers of a scene by path: one for all sets, or one per set, (sets,).
Values: TypeAlias = Mapping[str, float | FloatArray]

# Sets share nodes when their stiffness ratios lie within this factor, and their ranges within the second.
_RATIO_STEP = 4.0
_RANGE_STEP = 2.0
# What is compiled reaches this much further than asked: another Poisson's ratio than the scene's bends the
# relation of depth and contact radius, and nodes that stop short leave the polynomial to extrapolate.
_MARGIN = 1.1
# Compiled this much finer than asked, so that the sets at the edges of a group keep the promise: the largest
# error seen in 300 sets over E2/E1 from 0.01 to 1000 is then a third of the tolerance, and one set in
# fourteen, on the softest bases, goes alone; without it one in eight.
_SPARE = 0.1
# No further than this share of the depth at which the contact would reach the end of a sphere.
_SHAPE_SHARE = 0.5


class Readings(NamedTuple):
    """Contact force (N), stiffness (N/m), instrument force (N), (sets, n), and which sets exist."""

    contact: FloatArray
    stiffness: FloatArray
    force: FloatArray
    possible: NDArray[np.bool_]

    @classmethod
    def empty(cls, sets: int, points: int) -> Readings:
        """Room for `sets` sets, none of which exists yet."""
        contact, stiffness, force = (np.zeros((sets, points)) for _ in range(3))
        return cls(contact, stiffness, force, np.zeros(sets, dtype=bool))


def batched_readings(forward: Forward, values: Values, sets: int, *, stiffness: bool = True) -> Readings:
    """Model of one curve at many parameter sets.

    Parameters
    ----------
    forward : Forward
        The compiled scene.
    values : mapping of path to float or FloatArray
        Every number of the scene (SI), (sets,) where it varies.
    sets : int
        How many.
    stiffness : bool, default True
        Without it the stiffness is left zero, for a likelihood that does not ask.

    Returns
    -------
    Readings
        A set without a law does not exist; its row is zero.
    """
    readings = Readings.empty(sets, len(forward.depth))
    everything = np.arange(sets)
    if not np.any(values["instrument.compliance"]) and _scales(forward):
        batch = _Batch(forward, values, sets)
        if batch.shared is None and forward.laws.tabulated:
            return batch.from_tables(stiffness=stiffness)
        readings = Readings.empty(sets, len(forward.depth))
        if batch.shared is not None:
            batch.shared_law(batch.shared, readings, stiffness=stiffness)
        elif batch.exact_possible:
            batch.exact(readings, stiffness=stiffness)
        else:
            _one_by_one(forward, values, everything, readings)
            return readings
        return readings._replace(force=batch.instrument_force(readings.contact))
    readings = Readings.empty(sets, len(forward.depth))
    _one_by_one(forward, values, everything, readings)
    return readings


def _scales(forward: Forward) -> bool:
    """Whether tip shape is either fixed or acts through one coefficient only."""
    shape = [path for path in forward.similarity.direct if path.startswith(("indenter.", "layer.thickness"))]
    return not shape


def _one_by_one(forward: Forward, values: Values, rows: NDArray[np.intp], readings: Readings) -> None:
    for row in rows:
        try:
            one = forward.reading(_row(values, row))
        except InputError:
            continue
        readings.contact[row], readings.stiffness[row] = one.contact, one.stiffness
        readings.force[row] = one.force
        readings.possible[row] = True


def _row(values: Values, row: int) -> dict[str, float]:
    return {path: float(v[row]) if isinstance(v, np.ndarray) else v for path, v in values.items()}


def _take(constants: PlaneConstants, rows: NDArray[np.intp]) -> PlaneConstants:
    """Plane constants of some of the sets, entries (rows, 1)."""
    return PlaneConstants(*(np.asarray(entry)[rows] for entry in constants))


class _Batch:
    """Parameter sets of one curve: what they have in common and where they differ."""

    def __init__(self, forward: Forward, values: Values, sets: int) -> None:
        self.forward, self.values, self.sets = forward, values, sets
        similarity = forward.similarity
        # `reduced` and `factors` divide and multiply: arrays go through them as numbers do.
        numbers: Any = values
        ratios = similarity.reduced(numbers)
        # By what may vary, not by what happens to: one set alone goes the way it would go in company.
        self.shared = None if any(isinstance(ratio, np.ndarray) for ratio in ratios) else ratios
        self.b, self.c = self._factors()
        self.tip = forward.depth - self.column("instrument.contact_depth")
        self.deepest = np.maximum(self.tip.max(axis=1), 0.0)

    @property
    def _rtol(self) -> float:
        return (self.forward.laws.options.accuracy or Accuracy()).rtol

    def column(self, path: str) -> FloatArray:
        """Values of one number, (sets, 1)."""
        return np.broadcast_to(self.values[path], self.sets)[:, None]

    def _factors(self) -> tuple[FloatArray, FloatArray]:
        similarity = self.forward.similarity
        if any(isinstance(self.values[path], np.ndarray) for path in similarity.shape):
            both = np.array([similarity.factors(_row(self.values, row)) for row in range(self.sets)])
            return both[:, 0], both[:, 1]
        numbers: Any = self.values  # as in __init__
        b, c = similarity.factors(numbers)
        return np.broadcast_to(b, self.sets), np.broadcast_to(c, self.sets)

    def shared_law(self, reduced: tuple[float, ...], readings: Readings, *, stiffness: bool) -> None:
        """All sets through one law, rebuilt only where the range it needs passes a power of two."""
        depth = self.b * self.deepest
        octaves = np.ceil(np.log2(np.maximum(depth, np.finfo(float).tiny)))
        for octave in np.unique(octaves):
            rows = np.flatnonzero(octaves == octave)
            try:
                law = self.forward.reference_law(reduced, float(depth[rows].max()))
                w = self.b[rows, None] * self.tip[rows]
                readings.contact[rows] = self.c[rows, None] * law.force(w)
                if stiffness:
                    readings.stiffness[rows] = (self.b * self.c)[rows, None] * law.stiffness(w)
            except InputError:
                # One of them is out of reach: the others are not.
                _one_by_one(self.forward, self.values, rows, readings)
                continue
            readings.possible[rows] = True

    def instrument_force(self, contact: FloatArray) -> FloatArray:
        """Force of the instrument (N), (sets, n): contact, baseline and slope."""
        force = contact
        for path, column in (("instrument.baseline", 1.0), ("instrument.baseline_slope", self.forward.depth)):
            if np.any(self.values[path]):
                force = force + self.column(path) * column
        return force

    def from_tables(self, *, stiffness: bool) -> Readings:
        """All sets through the tables of the exact law; those without a table one by one."""
        scene = self.forward.similarity.scene
        if not isinstance(scene.indenter, PowerLawShape):
            raise TypeError(f"only power-law tips are tabulated, not {scene.indenter!r}")
        layer_E, nu = self.column("layer.E")[:, 0], float(self.values["layer.nu"])
        thickness = np.ascontiguousarray(self.column("layer.thickness")[:, 0])
        # On a rigid base no ratio varies: there one law serves all.
        curves = family_batch(
            scene.indenter,
            layer_nu=nu,
            base_nu=float(self.values["substrate.nu"]),
            ratio=self.column("substrate.E")[:, 0] / layer_E,
            varpi=self._varpi(thickness),
            rtol=self._rtol,
        )
        theta = np.asarray(isotropic_constants(layer_E, nu).theta, dtype=np.float64)
        every = np.arange(self.sets)
        arguments = (self.tip, theta, thickness, self._abel_coefficients(every))
        contact = curves.force(*arguments)
        slopes = curves.stiffness(*arguments) if stiffness else np.zeros_like(contact)
        possible = curves.error_estimate <= self._rtol
        readings = Readings(contact, slopes, self.instrument_force(contact), possible)
        _one_by_one(self.forward, self.values, np.flatnonzero(~possible), readings)
        return readings

    @property
    def exact_possible(self) -> bool:
        """Whether the exact law of an isotropic layer on an isotropic or rigid base may be taken."""
        scene, method = self.forward.similarity.scene, self.forward.laws.options.method
        indenter = scene.indenter
        known = isinstance(indenter, PowerLawShape) and not isinstance(indenter, FlatPunch)
        fixed_sphere = isinstance(indenter, Sphere) and not isinstance(
            self.values["indenter.radius"], np.ndarray
        )
        return (
            method in ("auto", "exact")
            and (known or fixed_sphere)
            and isinstance(scene.layer.material, Isotropic)
            and isinstance(scene.substrate, Isotropic | Rigid)
            and bool(np.isfinite(scene.layer.thickness))
        )

    def exact(self, readings: Readings, *, stiffness: bool) -> None:
        """All sets through compiled batches of the exact law."""
        inner = isotropic_constants(self.column("layer.E"), self.column("layer.nu"))
        theta = np.asarray(inner.theta)[:, 0]
        outer, hardness = None, np.full(self.sets, np.inf)
        if "substrate.E" in self.values:
            outer = isotropic_constants(self.column("substrate.E"), self.column("substrate.nu"))
            hardness = np.asarray(outer.theta)[:, 0] / theta
        thickness = np.ascontiguousarray(self.column("layer.thickness")[:, 0])
        for rows, compiled in self._groups(hardness, thickness):
            if compiled is None:
                _one_by_one(self.forward, self.values, rows, readings)
                continue
            base = None if outer is None else _take(outer, rows)
            curves = compiled.curves(_take(inner, rows), base, thickness[rows])
            arguments = (self.tip[rows], theta[rows], thickness[rows], self._abel_coefficients(rows))
            try:
                readings.contact[rows] = curves.force(*arguments)
                if stiffness:
                    readings.stiffness[rows] = curves.stiffness(*arguments)
            except RangeError:
                # The shape ends before the group's range does: each set knows its own reach.
                _one_by_one(self.forward, self.values, rows, readings)
                continue
            readings.possible[rows] = True
            coarse = rows[np.broadcast_to(curves.error_estimate > self._rtol, rows.size)]
            readings.possible[coarse] = False
            _one_by_one(self.forward, self.values, coarse, readings)

    def _groups(
        self, hardness: FloatArray, thickness: FloatArray
    ) -> Iterator[tuple[NDArray[np.intp], ExactBatch | None]]:
        """Rows whose stiffness ratio, thickness and range are alike, with what is compiled for them."""
        tops = self._varpi(thickness)
        soft = np.where(np.isfinite(hardness), np.round(np.log(hardness) / np.log(_RATIO_STEP)), np.inf)
        ranges = np.ceil(np.log(np.maximum(_MARGIN * tops, 1e-3)) / np.log(_RANGE_STEP))
        # A sphere is no power law: its thickness counts on its own.
        power = isinstance(self.forward.similarity.scene.indenter, PowerLawShape)
        thin = np.zeros(self.sets) if power else np.floor(np.log(thickness) / np.log(_RANGE_STEP))
        keys = np.column_stack([soft, ranges, thin])
        for key in np.unique(keys, axis=0):
            rows = np.flatnonzero((keys == key).all(axis=1))
            yield rows, self._compiled(float(key[0]), float(key[1]), None if power else float(key[2]))

    def _varpi(self, thickness: FloatArray) -> FloatArray:
        """Largest half-space contact radius over thickness of each set."""
        measure = depth_measure(self.forward.similarity.scene.indenter)
        # w = A F_2 a^lambda, so a goes with A^(-1/lambda).
        wider = self._coefficient_ratio() ** (-1.0 / measure.exponent)
        return np.asarray(wider * measure.halfspace_radius(self.deepest) / thickness)

    def _coefficient_ratio(self) -> FloatArray:
        """A over that of the reference shape, (sets,): what b leaves when the thickness is taken out."""
        similarity = self.forward.similarity
        if not similarity.shape or similarity.exponent is None:
            return np.ones(self.sets)
        thin = np.broadcast_to(self.values["layer.thickness"], self.sets)
        stretch = thin / float(similarity.values["layer.thickness"])
        return np.asarray(stretch**-similarity.exponent / self.b)

    def _abel_coefficients(self, rows: NDArray[np.intp]) -> FloatArray | None:
        indenter = self.forward.similarity.scene.indenter
        varies = any(isinstance(self.values[path], np.ndarray) for path in self.forward.similarity.shape)
        if not varies or not isinstance(indenter, PowerLawShape):
            return None
        return np.asarray(indenter.abel_coefficient * self._coefficient_ratio()[rows])

    def _compiled(self, soft: float, octave: float, thin: float | None) -> ExactBatch | None:
        """What is compiled for a group, kept in the problem's store; None where no law reaches it."""
        forward = self.forward
        scene, store = forward.similarity.scene, forward.laws.store
        key = ("batch", forward.laws.number, soft, octave, thin)
        if key in store.batches:
            return store.batches[key]
        material = scene.layer.material
        thickness = scene.layer.thickness if thin is None else _RANGE_STEP**thin
        radius = _RANGE_STEP**octave * thickness
        reach = _SHAPE_SHARE * largest_halfspace_depth(scene.indenter)
        depth = min(float(depth_measure(scene.indenter).abel(np.array(radius))), reach)
        outer = None
        if np.isfinite(soft) and isinstance(scene.substrate, Isotropic) and isinstance(material, Isotropic):
            # The hardest of the group needs the largest contact radius for its range.
            ratio = _RATIO_STEP ** (soft + 0.5)
            base = replace(scene.substrate, E=1.0)
            outer = replace(base, E=ratio * material.theta / base.theta).plane_constants
        try:
            compiled = ExactBatch.compile(
                scene.indenter,
                material.plane_constants,
                outer,
                thickness=thickness,
                max_depth=depth,
                rtol=_SPARE * self._rtol,
            )
        except RangeError:
            compiled = None
        store.batches[key] = compiled
        return compiled
