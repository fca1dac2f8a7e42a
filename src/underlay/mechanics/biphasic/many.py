"""Many isotropic draining layers under one motion of one tip, off the shipped tables: the draws of a fit."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Self

import numpy as np
from numpy.typing import NDArray

from underlay._arrays import FloatArray
from underlay.mechanics.biphasic import punch_table, tip_table
from underlay.mechanics.biphasic.contacts import DrainingTip, comes_off
from underlay.mechanics.biphasic.history import Polyline
from underlay.mechanics.biphasic.material import Biphasic
from underlay.mechanics.biphasic.punch_table import Axis
from underlay.mechanics.indenters import Paraboloid, Sphere

__all__ = ["Layers", "punch_forces", "tip_forces"]

# A44/A33 from incompressible to nu = 0: the compliance of a drained layer is a polynomial in it, to 1e-9.
_SOFTNESS = Axis(0.0, 0.5, 16)


@dataclass(frozen=True, eq=False)
class Layers:
    """Isotropic draining layers.

    Parameters
    ----------
    E, nu, permeability : FloatArray
        As of `Biphasic`, (sets,).
    """

    E: FloatArray
    nu: FloatArray
    permeability: FloatArray

    def of(self, rows: NDArray[np.bool_]) -> Self:
        """Some of them."""
        return type(self)(self.E[rows], self.nu[rows], self.permeability[rows])

    @cached_property
    def shear_modulus(self) -> FloatArray:
        """G (Pa), (sets,)."""
        return 0.5 * self.E / (1.0 + self.nu)

    @property
    def softness(self) -> FloatArray:
        """A44/A33, (sets,)."""
        return (0.5 - self.nu) / (1.0 - self.nu)

    def drainage_time(self, length: float | FloatArray) -> FloatArray:
        """length^2/c (s), (sets,), of a length (m)."""
        return length**2 * self.softness / (self.permeability * self.shear_modulus)


def punch_forces(
    layers: Layers,
    radius: FloatArray,
    thickness: FloatArray,
    drainage: str,
    depth: Polyline,
    time: FloatArray,
) -> tuple[FloatArray, NDArray[np.bool_]]:
    """Forces (N), (sets, n), under flat punches (m), (sets,), and which sets the table serves, (sets,)."""
    table = punch_table.shipped(drainage)
    eps = radius / thickness
    served = table.covers(eps, layers.nu)
    own, found = layers.of(served), np.zeros((served.size, time.size))
    if served.any():
        a = radius[served]
        stiffness = 4.0 * own.shear_modulus / (1.0 - own.nu) * a
        response = table(eps[served], own.nu).scaled(stiffness[:, None], own.drainage_time(a)[:, None])
        found[served] = depth.in_contact.superposed(response, time)
        served[served] = ~comes_off(found[served])
    return found, served


def tip_forces(
    layers: Layers,
    tip: Sphere | Paraboloid,
    thickness: float,
    drainage: str,
    history: Polyline,
    depth: FloatArray,
    time: FloatArray,
) -> tuple[FloatArray, NDArray[np.bool_]]:
    """The same under one rounded tip on layers of one thickness (m), at a record's depths (m), (n,)."""

    def contact(softness: float) -> DrainingTip:
        """On a layer of shear modulus 1."""
        nu = (0.5 - softness) / (1.0 - softness)
        return DrainingTip(tip, Biphasic(2.0 * (1.0 + nu), nu, 1.0), thickness, drainage)

    table, by_softness = tip_table.shipped(drainage), [contact(float(x)) for x in _SOFTNESS.nodes]
    ramped = by_softness[0].single_ramp(history)
    found, served = np.zeros((layers.nu.size, time.size)), np.zeros(layers.nu.size, dtype=bool)
    if ramped is None:
        return found, served
    w = np.minimum(np.maximum(depth, 0.0), ramped.deepest)
    touching = w > 0.0
    at_once = by_softness[0].undrained(ramped.deepest).force(w[touching])
    compliance = np.array([1.0 / one.drained(ramped.deepest).force(w[touching]) for one in by_softness])
    units = layers.drainage_time(ramped.radius)
    eps = ramped.radius / thickness
    for row, (unit, nu) in enumerate(zip(units.tolist(), layers.nu.tolist(), strict=True)):
        served[row] = table.covers(eps, nu, ramped.duration / unit, (float(time[-1]) - ramped.start) / unit)
        if served[row]:
            ramp = table(eps, nu, ramped.duration / unit)
            found[row, touching] = ramp.at((time[touching] - ramped.start) / unit)
    own = layers.of(served)
    drained = 1.0 / (_SOFTNESS.weights(own.softness) @ compliance)
    undrained_share = found[np.ix_(served, touching)]
    forces = drained + undrained_share * (at_once - drained)
    found[np.ix_(served, touching)] = own.shear_modulus[:, None] * forces
    return found, served
