"""What a scene and a fit ask of a layer that drains: its force along any record of depths, and where to begin.

A flat punch superposes exactly, along the record itself; its response comes from the shipped table where that
covers it, and is solved for and kept otherwise. A rounded tip goes by the ramps and holds of the record, through
their table or by the moving contact. Derivatives are differences: in Poisson's ratio and the permeability the force
is not that of one elastic law seen through a memory.
"""

from __future__ import annotations

from collections.abc import Callable, Hashable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from itertools import pairwise, product

import numpy as np
from numpy.typing import NDArray

from underlay._arrays import FloatArray
from underlay.errors import InputError
from underlay.mechanics.biphasic.contacts import DrainingPunch, DrainingTip
from underlay.mechanics.biphasic.history import Polyline, Response, followed, ramps_and_holds
from underlay.mechanics.biphasic.judgement import (
    anisotropy_doubt,
    checked_hold,
    hold_doubt,
    peak_doubt,
    ramp_doubt,
    refuse_load_control,
)
from underlay.mechanics.biphasic.many import Layers, lattice_forces, punch_forces, tip_forces
from underlay.mechanics.biphasic.material import Biphasic, BiphasicMaterial
from underlay.mechanics.biphasic.tables import shipped_punch, shipped_tip
from underlay.mechanics.biphasic.transfer import Relaxing, Transfer, relaxation
from underlay.mechanics.body import Layer
from underlay.mechanics.exact.nodes import TableStore
from underlay.mechanics.indenters import FlatPunch, Indenter, Paraboloid, Sphere
from underlay.mechanics.relaxation import Modes
from underlay.mechanics.response import Doubt, Invertible, WholeHistory
from underlay.quantities import numbers_of, replace_values

CONTACT_DEPTH = "instrument.contact_depth"
_E, _K, _NU, _AXIAL = "layer.E", "layer.permeability", "layer.nu", "layer.E_axial"
_THICKNESS, _RADIUS = "layer.thickness", "indenter.radius"
# Relative steps (of Poisson's ratios absolute; of the contact over the deepest reading) of differences: fine ones
# where the force is smooth to 1e-7, coarse ones where a moving contact is solved, which its steps make so to 1e-5;
# both ways where a table answers, one way where each neighbour is solved for.
_FINE_STEP, _COARSE_STEP = 1e-4, 3e-3
# What is kept of one problem: responses of a punch, and answers to one record.
_RESPONSES, _ANSWERS = 512, 16
# A search begins from the best of these: Poisson's ratios and ratios of moduli of cartilage, times a^2/c a decade.
_RATIOS, _ANISOTROPIES, _PER_DECADE = (0.05, 0.2, 0.35), (1.5, 4.0, 10.0), 2
# Reach of those times beyond the record's own, and starts that are kept.
_BEYOND, _STARTS = 10.0, 2
# The last share of a record that stands for equilibrium, how near to the deepest it must be, and how many standard
# deviations of noise the largest of many readings may be above the peak.
_LATE, _AT_REST, _SURE = 0.05, 0.01, 4.0
_TRANSVERSE = "stiffer in plane than along the axis: transversely isotropic"
_TRY = "fit a transversely isotropic layer: give E_axial, nu_axial and G_axial, and free layer.E and layer.E_axial"
_SETTING = ("layer.E_axial", "<a fifth of E>")
# Readings of a record that a search begins with.
_SEEN = 200
# Knots of a ramp by which a search sees a rounded tip.
_RAMP_KNOTS = 8


class Kept:
    """Cache of the responses of a punch and of the forces of whole records that one problem computed last."""

    def __init__(self) -> None:
        self._responses, self._answers = TableStore(_RESPONSES), TableStore(_ANSWERS)

    def response(self, transfer: Transfer) -> Response:
        """Response of a transfer function, from the cache or computed."""
        return self._responses.get(_key(transfer), lambda: relaxation(transfer))

    def answer(self, key: Hashable, solve: Callable[[], FloatArray]) -> FloatArray:
        """Force (N), (n,), under the motion that `key` identifies, from the cache or by calling `solve`."""
        return self._answers.get(key, solve)


def _thinned(count: int) -> NDArray[np.intp]:
    """Indices of at most 400 of `count` readings for a search's starting values: evenly spaced, denser at first."""
    even = np.linspace(0.0, count - 1.0, min(count, _SEEN))
    first = np.geomspace(1.0, count, min(count, _SEEN)) - 1.0
    return np.unique(np.concatenate((even, first)).astype(np.intp))


def _key(transfer: Transfer) -> Hashable:
    if isinstance(transfer, Relaxing):
        modes = transfer.modes
        return transfer.elastic, modes.constant, modes.weights.tobytes(), modes.times.tobytes()
    return (transfer,)


@dataclass(frozen=True)
class Drainage(WholeHistory):
    """The history dependence of a draining (biphasic) layer under a tip, as a scene and a fit use it.

    Parameters
    ----------
    indenter : FlatPunch, Sphere or Paraboloid
        The tip.
    layer : Layer
        Layer of a biphasic material, alone or on a rigid sealed base; its Prony series relaxes the skeleton.
    drainage : str
        "solid" for an impervious tip, "porous" for one that lets water through.
    kept : Kept, optional
        Cache of what was computed; a problem owns one and shares it among its steps.

    Raises
    ------
    InputError
        If the tip is of another shape.
    """

    indenter: Indenter
    layer: Layer
    drainage: str
    kept: Kept = field(default_factory=Kept, compare=False, repr=False)

    def __post_init__(self) -> None:
        if not isinstance(self.indenter, FlatPunch | Sphere | Paraboloid):
            raise InputError(
                f"drainage is simulated under flat punches, spheres and paraboloids; got {self.indenter!r:.80}"
            )

    @property
    def material(self) -> BiphasicMaterial:
        """The biphasic material of the layer; InputError where it is of another kind."""
        if not isinstance(self.layer.material, BiphasicMaterial):
            raise InputError(f"this layer does not drain: {self.layer.material!r:.80}")
        return self.layer.material

    @property
    def _modes(self) -> Modes | None:
        relaxing = self.layer.relaxation
        return None if relaxing is None else relaxing.modes(0.0, np.inf)

    @cached_property
    def contact(self) -> DrainingPunch | DrainingTip:
        """The contact of tip and layer, in SI."""
        tip, material, thickness = self.indenter, self.material, self.layer.thickness
        if isinstance(tip, FlatPunch):
            table = shipped_punch(self.drainage)
            return DrainingPunch(
                tip.radius, material, thickness, self.drainage, self._modes, table, self.kept.response
            )
        ramps = shipped_tip(self.drainage)
        return DrainingTip(tip, material, thickness, self.drainage, self._modes, table=ramps)

    # --- forces -------------------------------------------------------------------------------------------
    def answer(self, depth: FloatArray, time: FloatArray) -> FloatArray:
        """Force (N), (n,), under depths since contact (m) at times (s), (n,) each; the last results are cached."""
        key = (tuple(numbers_of(self).values()), depth.tobytes(), time.tobytes())
        return self.kept.answer(key, lambda: self._answered(depth, time))

    def _answered(self, depth: FloatArray, time: FloatArray) -> FloatArray:
        if not (depth > 0.0).any():
            return np.zeros_like(depth)
        contact = self.contact
        if isinstance(contact, DrainingPunch):
            return contact.force(followed(depth, time), time)
        return contact.force(ramps_and_holds(depth, time), time, depth)

    def answers(
        self, values: Mapping[str, float | FloatArray], sets: int, depth: FloatArray, time: FloatArray
    ) -> tuple[FloatArray, NDArray[np.bool_]] | None:
        """Forces (N), (sets, n), for many sets of parameters, and the mask (sets,) of those computed, or None.

        Arguments as of `WholeHistory.answers`. Isotropic layers are interpolated in the shipped tables, under a
        punch also where contact depths differ between sets; others in a lattice solved for here.
        """
        tip, thickness = self.indenter, values.get(_THICKNESS, self.layer.thickness)
        if not (depth > 0.0).any():
            return None
        sized = isinstance(thickness, np.ndarray) or isinstance(values[_RADIUS], np.ndarray)
        punched, contact = isinstance(tip, FlatPunch), np.broadcast_to(values[CONTACT_DEPTH], sets)
        if not self.material.isotropic or self._modes is not None or (sized and not punched):
            return self._on_a_lattice(values, sets, depth, time) if depth.ndim == 1 else None
        if depth.ndim > 1 and not punched:
            return None
        layers = Layers(*(np.broadcast_to(values[path], sets) for path in (_E, _NU, _K)))
        if not punched:
            line = ramps_and_holds(depth, time)
            return tip_forces(layers, tip, self.layer.thickness, self.drainage, line, depth, time)
        radius, h = (np.broadcast_to(length, sets) for length in (values[_RADIUS], thickness))
        # Of the depths as recorded, so that no set's answer depends on the others' contacts.
        recorded = followed((depth if depth.ndim == 1 else depth[0]) + contact[0], time)
        return punch_forces(layers, radius, h, self.drainage, recorded, contact, time)

    def _on_a_lattice(
        self, values: Mapping[str, float | FloatArray], sets: int, depth: FloatArray, time: FloatArray
    ) -> tuple[FloatArray, NDArray[np.bool_]] | None:
        """Forces (N), (sets, n), and mask (sets,), of layers outside the shipped tables, interpolated in a lattice.

        None where the lattice has more than half as many points as there are sets.
        """
        own = numbers_of(self)
        vary = {path: v for path, v in values.items() if path in own and isinstance(v, np.ndarray)}
        modulus = np.broadcast_to(values[_E], sets)
        known = self.layer.material.E
        if self.material.isotropic and _E in vary:
            # All forces go with the modulus, and all times with its product with the permeability.
            del vary[_E]
            vary[_K] = values[_K] * modulus / known

        def solve(point: list[float]) -> FloatArray:
            changed = dict(zip(vary, point, strict=True))
            # Over the modulus, which bends a logarithm's axis most.
            return self.at(changed).answer(depth, time) / changed.get(_E, known)

        columns = [(v, own[path].quantity.is_scale) for path, v in vary.items()]
        found = lattice_forces(columns, solve, sets // 2)
        return None if found is None else (modulus[:, None] * found[0], found[1])

    def depth(self, law: Invertible, force: FloatArray, time: FloatArray) -> FloatArray:
        """Depth (m), (n,), of a flat punch under forces (N) at times (s): creep; InputError for another tip."""
        del law
        if not isinstance(self.contact, DrainingPunch):
            raise InputError(
                "under a given force drainage is simulated for a flat punch only: give the depths"
            )
        if (force < 0.0).any():
            raise InputError(
                f"under a given force the punch must be pressed: {force.min():.6g} N is below zero"
            )
        return self.contact.depth(followed(force, time), time)

    def stiffness(self, depth: FloatArray, force: FloatArray) -> FloatArray:
        """dP/dw (N/m), (n,), if all depths (m) grew by one common factor, from depths and forces (N), (n,) each.

        The force of a punch is proportional to depth; that of another tip is taken to follow its drained law.
        """
        touching = depth > 0.0
        w, found = depth[touching], np.zeros_like(depth)
        if isinstance(self.contact, DrainingPunch) or not touching.any():
            found[touching] = force[touching] / w
            return found
        law = self.contact.drained(float(w.max()))
        found[touching] = force[touching] * law.stiffness(w) / law.force(w)
        return found

    # --- derivatives --------------------------------------------------------------------------------------
    def slopes(self, paths: Sequence[str], depth: FloatArray, time: FloatArray) -> Mapping[str, FloatArray]:
        """Derivatives of the force (N), (n,), in the parameters at `paths` (SI), by finite differences."""
        tabulated = self._is_tabulated(depth, time)
        return {path: self._slope(path, depth, time, tabulated=tabulated) for path in paths}

    def _is_tabulated(self, depth: FloatArray, time: FloatArray) -> bool:
        contact = self.contact
        if isinstance(contact, DrainingPunch):
            return contact.is_tabulated
        return not (depth > 0.0).any() or contact.is_tabulated(ramps_and_holds(depth, time), float(time[-1]))

    def _slope(self, path: str, depth: FloatArray, time: FloatArray, *, tabulated: bool) -> FloatArray:
        smooth = tabulated or isinstance(self.contact, DrainingPunch)
        size = _FINE_STEP if smooth else _COARSE_STEP
        own = numbers_of(self)
        if path == CONTACT_DEPTH:
            size *= float(depth.max())
        elif path not in own:
            return np.zeros_like(depth)
        elif own[path].quantity.is_scale:
            size *= own[path].value

        def force(steps: float) -> FloatArray:
            if path == CONTACT_DEPTH:
                return self.answer(depth - steps * size, time)
            return self.at({path: own[path].value + steps * size}).answer(depth, time)

        one_way = (0.0, 1.0), (-1.0, 0.0)
        for low, high in ((-1.0, 1.0), *one_way) if tabulated else one_way:
            try:
                return np.asarray((force(high) - force(low)) / ((high - low) * size))
            except InputError:
                continue
        raise InputError(f"no neighbour of {path} = {own[path].value:.6g} is a draining layer")

    # --- what follows, and what is doubtful ---------------------------------------------------------------
    def derived(self) -> Mapping[str, float]:
        """Aggregate modulus (Pa), diffusivity (m^2/s); for a punch drainage time (s) and peak ratio; by name."""
        material = self.material
        found = {
            "layer.aggregate_modulus": material.aggregate_modulus,
            "layer.diffusivity": material.diffusivity,
        }
        if isinstance(self.contact, DrainingPunch):
            found["layer.drainage_time"] = self.contact.unit_time
            found["layer.peak_ratio"] = self.contact.peak_ratio
        return found

    def doubts(self, depth: FloatArray, force: FloatArray, time: FloatArray) -> Sequence[Doubt]:
        """Doubts about a fit: hold too short, ramp too slow, peak too high or a parameter at the end of its range.

        From depths since contact (m), forces (N) and times (s), (n,) each, at the fitted parameters.
        """
        line, deepest = ramps_and_holds(depth, time).in_contact, float(depth.max())
        radius = self._radius(deepest)
        unit, eps = self.material.drainage_time(radius), radius / self.layer.thickness
        rises = np.flatnonzero(np.diff(line.value) > 0.0)
        if not rises.size:
            return ()
        hold = float(time[-1] - line.time[rises[-1] + 1])
        ramp = float(line.time[rises[0] + 1] - line.time[rises[0]])
        found = [
            self._peak_doubt(force, depth),
            Doubt(
                "check",
                hold_doubt(hold, unit, eps),
                "the hold ends before the water has drained",
                "hold longer",
            ),
            Doubt("check", ramp_doubt(ramp, unit), "water drains while the tip goes in", "ramp faster"),
            self._shape_doubt(),
        ]
        return [doubt for doubt in found if doubt.reason]

    def _shape_doubt(self) -> Doubt:
        own = {path: number.value for path, number in numbers_of(self).items()}
        if _AXIAL in own:
            reason = anisotropy_doubt(modulus_ratio=own[_E] / own[_AXIAL])
            return Doubt("check", reason, "thickness or drainage is not as entered", "check both")
        return Doubt("check", anisotropy_doubt(nu=own[_NU]), _TRANSVERSE, _TRY, _SETTING)

    def _peak_doubt(self, force: FloatArray, depth: FloatArray) -> Doubt:
        """Doubt that an isotropic layer fits: its reason is empty unless peak over equilibrium force is too large.

        The limit is the ratio of an isotropic layer with nu = 0 after a sudden step.
        """
        nothing = Doubt("reject", "", _TRANSVERSE, _TRY, _SETTING)
        deepest = float(depth.max())
        level = deepest - 2.0 * _AT_REST * deepest
        late = force[-max(int(_LATE * force.size), 1) :]
        if not self.material.isotropic or self._modes is not None or depth[-1] < level or late.mean() <= 0.0:
            return nothing
        contact = replace(self, layer=replace(self.layer, material=Biphasic(1.0, 0.0, 1.0))).contact
        if isinstance(contact, DrainingPunch):
            largest = contact.peak_ratio
        else:
            laws = contact.undrained(deepest), contact.drained(deepest)
            largest = float(laws[0].force(deepest) / laws[1].force(deepest))
        noise = float(np.std(late)) * _SURE
        ratio = (float(force.max()) - noise) / float(late.mean())
        return nothing._replace(reason=peak_doubt(ratio, largest))

    # --- a search -----------------------------------------------------------------------------------------
    def require_record(self, depth: FloatArray, force: FloatArray, time: FloatArray) -> None:
        """Refuse a record without a hold under constant depth, from which drainage cannot be determined.

        Depths (m), forces (N) and times (s), (n,) each.

        Raises
        ------
        InputError
            If the depth never rises, the hold has too few points or the test is a creep test.
        """
        line = ramps_and_holds(depth, time)
        rises = np.flatnonzero(np.diff(line.value) > 0.0)
        if not rises.size:
            raise InputError("the depth never rises: a draining layer is tested by a ramp and a hold")
        checked_hold(time, float(line.time[rises[0] + 1]))
        held = slice(int(np.searchsorted(time, line.time[rises[-1] + 1])), None)
        if force[held].size > 1:
            refuse_load_control(depth, force, held)

    def starts(
        self, free: Mapping[str, tuple[float, float]], depth: FloatArray, force: FloatArray, time: FloatArray
    ) -> Sequence[Mapping[str, float]]:
        """Starting values (SI) of a least-squares search, best first, by path.

        `free` gives the bounds of the free parameters. Drainage times (contact radius^2/diffusivity) and Poisson's
        ratios (or ratios of moduli) are tried on a grid, each with the moduli that fit the record best. The record
        is depths (m), forces (N) and times (s), (n,) each.
        """
        seen = _thinned(time.size)
        depth, force, time = depth[seen], force[seen], time[seen]
        found = []
        for shape, unit in product(self._shapes(free), self._units(free, depth, time)):
            try:
                found.append(self._like(shape).begun(free, unit, depth, force, time))
            except InputError:
                continue
        found.sort(key=lambda entry: entry[0])
        return [values for _, values in found[:_STARTS]]

    def _like(self, values: Mapping[str, float]) -> Drainage:
        """Return this drainage with the parameters (SI) of `values`, by path."""
        return replace_values(self, values) if values else self

    def _shapes(self, free: Mapping[str, tuple[float, float]]) -> list[dict[str, float]]:
        """Trial values of the free parameters besides the size of the moduli and the permeability, by path.

        Poisson's ratios of an isotropic layer, or ratios of in-plane to axial modulus.
        """
        own = {path: number.value for path, number in numbers_of(self).items()}
        if _AXIAL in own and {_E, _AXIAL} & free.keys():
            moved, other = (_E, _AXIAL) if _E in free else (_AXIAL, _E)
            power = 1.0 if moved == _E else -1.0
            return [{moved: own[other] * ratio**power} for ratio in _ANISOTROPIES]
        if _NU in free and _AXIAL not in own:
            low, high = free[_NU]
            inside = [{_NU: nu} for nu in _RATIOS if low < nu < high]
            return inside or [{}]
        return [{}]

    def _units(
        self, free: Mapping[str, tuple[float, float]], depth: FloatArray, time: FloatArray
    ) -> list[float]:
        """Drainage times (s), contact radius^2/diffusivity, to try; only one if the permeability is fixed."""
        own = self.material.drainage_time(self._radius(float(depth.max())))
        if _K not in free:
            return [own]
        span = float(time[-1] - time[0])
        count = max(int(_PER_DECADE * np.log10(len(time) * _BEYOND)), 2)
        return [*np.geomspace(span / len(time), _BEYOND * span, count).tolist(), own]

    def _radius(self, deepest: float) -> float:
        contact = self.contact
        if isinstance(contact, DrainingPunch):
            return contact.radius
        return float(contact.undrained(deepest).contact_radius(deepest))

    def begun(
        self,
        free: Mapping[str, tuple[float, float]],
        unit: float,
        depth: FloatArray,
        force: FloatArray,
        time: FloatArray,
    ) -> tuple[float, dict[str, float]]:
        """Evaluate one start: its sum of squared residuals (N^2) and its parameter values (SI) by path.

        Parameters
        ----------
        free : mapping of str to (float, float)
            Bounds of the free parameters, by path.
        unit : float
            Drainage time (s) of the start, contact radius^2/diffusivity, which sets the permeability.
        depth, force, time : FloatArray
            The record: depths (m), forces (N), times (s), (n,) each; the moduli are scaled to fit it best.
        """
        own = {path: number.value for path, number in numbers_of(self).items()}
        moduli = [path for path in (_E, _AXIAL) if path in free]
        present = self.material.drainage_time(self._radius(float(depth.max())))
        k = own[_K] * present / unit
        model = self._like({_K: k}).seen(depth, time)
        columns = np.stack((model, np.ones_like(model)), axis=1)
        factor = float(np.linalg.lstsq(columns, force, rcond=None)[0][0]) if moduli else 1.0
        if not factor > 0.0:
            raise InputError("the forces pull")
        values = {path: factor * own[path] for path in moduli}
        if _K in free:
            values[_K] = k / factor
        values |= {path: own[path] for path in free if path == _NU and path in own}
        inside = {path: min(max(value, free[path][0]), free[path][1]) for path, value in values.items()}
        left = force - factor * model
        return float(np.square(left - left.mean()).sum()), inside

    def seen(self, depth: FloatArray, time: FloatArray) -> FloatArray:
        """Approximate force (N), (n,), for starting values: a rounded tip drains as a punch (within 10 %)."""
        contact = self.contact
        if isinstance(contact, DrainingPunch):
            return self.answer(depth, time)
        line = ramps_and_holds(depth, time).in_contact
        deepest = float(line.value.max())
        undrained, drained = contact.undrained(deepest), contact.drained(deepest)
        punch = DrainingPunch(
            self._radius(deepest),
            self.material,
            contact.thickness,
            self.drainage,
            self._modes,
            shipped_punch(self.drainage),
            self.kept.response,
        )
        response = replace(punch.response, start=1.0, end=0.0)
        t = np.unique(np.concatenate([np.linspace(*ends, _RAMP_KNOTS) for ends in pairwise(line.time)]))
        w = np.minimum(np.maximum(line.at(t), 0.0), deepest)
        above = Polyline(t, undrained.force(w) - drained.force(w))
        return np.asarray(
            drained.force(np.minimum(np.maximum(depth, 0.0), deepest)) + above.superposed(response, time)
        )
