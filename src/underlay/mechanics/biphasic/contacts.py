"""Contacts of a draining layer in units: forces under a history of depth, and depths under a history of load.

`DrainingPunch` is a flat punch: force under any depth history and depth under any load history. `DrainingTip` is a
sphere or paraboloid: force under ramps and holds of depth.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cached_property
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from underlay._arrays import ArrayLike, FloatArray, as_finite, positive
from underlay.errors import InputError, RangeError
from underlay.mechanics.biphasic.history import Polyline, Response
from underlay.mechanics.biphasic.judgement import checked_contact, checked_thickness
from underlay.mechanics.biphasic.material import BiphasicMaterial, elastic_law
from underlay.mechanics.biphasic.moving import Stepping, between_bends
from underlay.mechanics.biphasic.tables import PunchTable, TipTable
from underlay.mechanics.biphasic.transfer import (
    PunchTransfer,
    Relaxing,
    Transfer,
    as_drainage,
    creep,
    relaxation,
)
from underlay.mechanics.contact_law import ContactLaw
from underlay.mechanics.indenters import Indenter, Paraboloid, Sphere
from underlay.mechanics.relaxation import Modes

# Forces above minus this share of the largest are what the noise of a depth record makes of none.
_RIPPLED = 1e-3
# Of the depth: what a hold may fall back by.
_RIPPLE = 3e-3
_ELASTIC_RTOL = 1e-8
# a0/R up to which a sphere is read off the table of paraboloids: what it is wrong by goes as the square, 8e-4 here.
_FLAT_ENOUGH = 0.2
# Of a0^2/c: of the water that leaves while a single ramp is this short (4 % of the fall under its peak) nothing is
# left to see a decade later, and steps of time that resolve it would cost minutes.
_QUICKEST = 1e-3
# For the rounding of depths in other units.
_ROOM = 1e-9


@dataclass(frozen=True)
class DrainingPunch:
    """A flat punch on a biphasic layer on a rigid sealed base, or on a biphasic half-space.

    Parameters
    ----------
    radius : float
        Radius of the punch (m).
    material : BiphasicMaterial
        Material of the layer.
    thickness : float
        Thickness h of the layer (m); inf for a half-space.
    drainage : str
        One of `DRAINAGES`: how water leaves at the tip.
    modes : Modes or None
        Relaxation of the skeleton's moduli, times in s; the material's moduli are then the instantaneous ones.
    table : PunchTable or None
        Table of responses of isotropic layers; layers that it does not cover are solved for.
    solve : callable
        Computes the response of a transfer function; a caller may pass one that caches.

    Examples
    --------
    >>> from underlay.mechanics.biphasic.history import ramp_and_hold
    >>> from underlay.mechanics.biphasic.material import Biphasic
    >>> punch = DrainingPunch(0.5e-3, Biphasic(E=0.5e6, nu=0.1, permeability=1e-15), 1e-3, "solid")
    >>> force = punch.force(ramp_and_hold(5e-5, 10.0), [10.0, 100.0, 1e5])
    """

    radius: float
    material: BiphasicMaterial
    thickness: float
    drainage: str
    modes: Modes | None = None
    table: PunchTable | None = None
    solve: Callable[[Transfer], Response] = relaxation

    def __post_init__(self) -> None:
        object.__setattr__(self, "radius", positive(self.radius, "punch radius", "m"))
        object.__setattr__(self, "thickness", checked_thickness(self.thickness))
        as_drainage(self.drainage)

    @property
    def eps(self) -> float:
        """Contact radius over thickness, a/h."""
        return self.radius / self.thickness

    @cached_property
    def unit_time(self) -> float:
        """Drainage time a^2/c (s), the contact's unit of time: a the punch radius, c the diffusivity."""
        return self.material.drainage_time(self.radius)

    @cached_property
    def unit_stiffness(self) -> float:
        """Unit of stiffness 4 theta_d a (N/m): theta_d half the drained indentation modulus, a the punch radius."""
        return 4.0 * float(self.material.plane_constants.theta) * self.radius

    @cached_property
    def _elastic(self) -> PunchTransfer:
        return PunchTransfer(self.material.skeleton, self.eps, self.drainage)

    @cached_property
    def transfer(self) -> Transfer:
        """Transfer function khat(s) of depth w to force P: P/(4 theta_d a w), s the Laplace variable in c/a^2.

        a is the punch radius, c the diffusivity, theta_d half the drained indentation modulus.
        """
        if self.modes is None:
            return self._elastic
        return Relaxing(self._elastic, replace(self.modes, times=self.modes.times / self.unit_time))

    @cached_property
    def _tabulated(self) -> PunchTable | None:
        """The table of responses if it covers this layer, else None."""
        if self.table is None or not self.material.isotropic:
            return None
        return self.table if self.table.covers(self.eps, self.material.nu) else None

    @property
    def is_tabulated(self) -> bool:
        """Whether the response is interpolated in the table rather than solved for."""
        return self._tabulated is not None and self.modes is None

    @cached_property
    def response(self) -> Response:
        """Force (N) after a unit step of depth (m), times in s."""
        if self._tabulated is None or self.modes is not None:
            found = self.solve(self.transfer)
        else:
            found = self._tabulated(self.eps, self.material.nu)
        return found.scaled(self.unit_stiffness, self.unit_time)

    @cached_property
    def compliance(self) -> Response:
        """Depth (m) after a unit step of load (N), times in s."""
        return creep(self.transfer).scaled(1.0 / self.unit_stiffness, self.unit_time)

    @property
    def peak_ratio(self) -> float:
        """Undrained over drained stiffness of the contact: peak over equilibrium force after a sudden step."""
        if self._tabulated is None:
            return self._elastic.undrained / self._elastic.drained
        start, end = self._tabulated.ends(self.eps, self.material.nu)
        return float(start / end)

    def force(self, depth: Polyline, time: ArrayLike) -> FloatArray:
        """Force (N), (n,), at times (s) under a depth history (m; negative before contact), by superposition.

        Raises
        ------
        RangeError
            If the punch comes off: the force would pull.
        """
        t = as_finite(time, "time")
        found = depth.in_contact.superposed(self.response, t)
        if found.size and comes_off(found):
            lowest = int(found.argmin())
            raise RangeError(
                f"the punch comes off at {t[lowest]:.6g} s: under it the layer would have to pull with "
                f"{-found[lowest]:.3g} N; end the record before it is withdrawn"
            )
        return found

    def depth(self, load: Polyline, time: ArrayLike) -> FloatArray:
        """Depth (m), (n,), at times (s) under a history of load (N), as in a creep test."""
        return load.superposed(self.compliance, time)


def comes_off(force: FloatArray) -> NDArray[np.bool_]:
    """Whether a punch would lose contact, (...): some of its forces (N), (..., n), are tensile beyond noise."""
    return np.asarray(force.min(axis=-1) < -_RIPPLED * np.abs(force).max(axis=-1))


class SingleRamp(NamedTuple):
    """A ramp of depth: its start and duration (s), final depth (m) and undrained contact radius there (m)."""

    start: float
    duration: float
    deepest: float
    radius: float


@dataclass(frozen=True)
class DrainingTip:
    """A rounded tip on a biphasic layer on a rigid sealed base, or on a biphasic half-space.

    Parameters
    ----------
    indenter : Sphere or Paraboloid
        The tip.
    material : BiphasicMaterial
        Material of the layer.
    thickness : float
        Thickness h of the layer (m); inf for a half-space.
    drainage : str
        One of `DRAINAGES`: how water leaves at the tip.
    modes : Modes or None
        Relaxation of the skeleton's moduli, times in s; the material's moduli are then the instantaneous ones.
    steps : int, default 20
        Time steps of the shortest ramp. With Richardson extrapolation from half as many, the error of the force is
        1.5e-4 of the undrained force at the deepest point; 5e-4 in the first steps of the hold if E/E_axial is 5.
        Twice the steps leave a third of the error.
    table : TipTable or None
        Table of ramps and holds on isotropic layers; histories that it does not cover are solved for.
    """

    indenter: Indenter
    material: BiphasicMaterial
    thickness: float
    drainage: str
    modes: Modes | None = None
    steps: int = 20
    table: TipTable | None = None

    def __post_init__(self) -> None:
        if not isinstance(self.indenter, Sphere | Paraboloid):
            raise InputError(
                f"drainage is simulated under flat punches, spheres and paraboloids; got {self.indenter!r:.80}"
            )
        object.__setattr__(self, "thickness", checked_thickness(self.thickness))
        as_drainage(self.drainage)

    def undrained(self, max_depth: float) -> ContactLaw:
        """Elastic law (N, m) up to `max_depth` (m) of a test too fast for water to flow: the undrained layer."""
        return elastic_law(
            self.material.undrained.plane_constants,
            self.indenter,
            self.thickness,
            max_depth * (1.0 + _ROOM),
            _ELASTIC_RTOL,
        )

    def drained(self, max_depth: float) -> ContactLaw:
        """Elastic law (N, m) up to `max_depth` (m) of a test so slow that pressures vanish: the drained layer."""
        return elastic_law(
            self.material.plane_constants, self.indenter, self.thickness, max_depth, _ELASTIC_RTOL
        )

    def force(self, depth: Polyline, time: ArrayLike, now: FloatArray | None = None) -> FloatArray:
        """Force (N), (n,), at times (s), under a history of depth (m; negative before contact).

        The history is one of ramps and holds, or one sudden step. `now` are the depths (m), (n,), at those times as
        measured, where the history only approximates a record; the history's own by default.

        Raises
        ------
        InputError
            If the depth falls back, or a sudden step comes beside other rises.
        RangeError
            If the tip goes too deep, or the history needs too many steps.
        """
        t, depth = as_finite(time, "time"), depth.in_contact
        deepest = checked_contact(depth, self.thickness, _RIPPLE)
        law = self.undrained(deepest)
        end = float(t.max(initial=depth.time[0]))
        w = np.minimum(np.maximum(depth.at(t) if now is None else now, 0.0), deepest)
        if end == depth.time[0]:
            return np.asarray(law.force(w))
        radius = float(law.contact_radius(deepest))
        depth = _sudden(depth, _QUICKEST * self.material.drainage_time(radius))
        kept = self._tabulated(depth, end)
        if kept is None:
            return np.asarray(law.force(w) * self.record(depth, end).ratio_at(t))
        drained = self.drained(deepest).force(w)
        return np.asarray(drained + kept(t) * (law.force(w) - drained))

    def is_tabulated(self, depth: Polyline, end: float) -> bool:
        """Whether the force under a depth history (m) up to the time `end` (s) is read from the table."""
        return self._tabulated(depth, end) is not None

    def single_ramp(self, depth: Polyline) -> SingleRamp | None:
        """Return the ramp of a depth history (m), or None.

        None unless it is one ramp and hold under a tip that is near enough to a paraboloid for the table.
        """
        depth = depth.in_contact
        deepest = checked_contact(depth, self.thickness, _RIPPLE)
        radius = float(self.undrained(deepest).contact_radius(deepest))
        one_ramp = not depth.jumps[0].size and depth.rises.size == 1 and depth.value[0] == 0.0
        tip_radius = self.indenter.curvature_radius or 0.0
        blunt = isinstance(self.indenter, Paraboloid) or radius <= _FLAT_ENOUGH * tip_radius
        if not (one_ramp and blunt):
            return None
        return SingleRamp(float(depth.bends[0][0]), float(depth.rises[0]), deepest, radius)

    def _tabulated(self, depth: Polyline, end: float) -> Callable[[FloatArray], FloatArray] | None:
        """Return the undrained share of the force as a function of time (s), from the table.

        None if the table does not cover this history up to the time `end` (s).
        """
        plain = self.modes is None and self.material.isotropic
        ramped = self.single_ramp(depth) if plain and self.table is not None else None
        if ramped is None or self.table is None:
            return None
        unit, eps = self.material.drainage_time(ramped.radius), ramped.radius / self.thickness
        ramp, nu = ramped.duration / unit, self.material.nu
        if not self.table.covers(eps, nu, ramp, (end - ramped.start) / unit):
            return None
        found = self.table(eps, nu, ramp)
        return lambda time: found.at((time - ramped.start) / unit)

    def record(self, depth: Polyline, end: float) -> TipRecord:
        """Solve for the moving contact under a depth history (m), up to the time `end` (s)."""
        depth = depth.in_contact
        deepest = checked_contact(depth, self.thickness, _RIPPLE)
        law = self.undrained(deepest)
        length = float(law.contact_radius(deepest))
        unit = self.material.drainage_time(length)
        start = float(depth.time[0])
        solved = Stepping(
            self.material.skeleton,
            self.thickness / length,
            self.drainage,
            None if self.modes is None else replace(self.modes, times=self.modes.times / unit),
            lambda radius: self.indenter.surface(radius * length) / length,
            lambda w: (
                law.force(w * length) / (self.material.shear_modulus * length**2),
                law.contact_radius(w * length) / length,
            ),
            Polyline((depth.time - start) / unit, np.minimum(depth.value, deepest) / length),
            self.steps,
        )
        nodes, ratio = solved.until((end - start) / unit)
        return TipRecord(law, depth, start + unit * nodes, ratio, solved.first)


def _sudden(depth: Polyline, shortest: float) -> Polyline:
    """Replace the ramp of one ramp and hold, if no longer than `shortest` (s), by a sudden step at its end."""
    ramps = depth.rises
    if depth.jumps[0].size or ramps.size != 1 or ramps[0] > shortest:
        return depth
    after = depth.time >= depth.bends[0][-1]
    return Polyline(depth.time[after], depth.value[after])


@dataclass(frozen=True, eq=False)
class TipRecord:
    """Solved force of a rounded tip under one depth history, at any time up to the end of the solution.

    Parameters
    ----------
    law : ContactLaw
        Undrained elastic law.
    depth : Polyline
        The depth history (m, s).
    time, ratio : FloatArray
        Times of the steps (s), and the force there over the undrained force at the same depth, (n,).
    first : float, optional
        The ratio at the beginning, where it is known: 1 after a sudden step. On a ramp it is not: the contact grows
        as the water spreads, and the ratio begins with what a half-space gives.
    """

    law: ContactLaw
    depth: Polyline
    time: FloatArray
    ratio: FloatArray
    first: float | None = None

    def force(self, time: FloatArray) -> FloatArray:
        """Force (N), (n,), at times (s), (n,)."""
        depth = np.maximum(self.depth.at(time), 0.0)
        return np.asarray(self.law.force(depth) * self.ratio_at(time))

    def ratio_at(self, time: FloatArray) -> FloatArray:
        """Force over the undrained force at the same depth, (n,), at times (s), (n,)."""
        return between_bends(self.depth.time, self.time, self.ratio, self.first, time)
