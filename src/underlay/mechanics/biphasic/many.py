"""Many draining layers under one motion of one tip, as a fit's draws are, off tables: shipped, or of its own."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from contextlib import suppress
from dataclasses import dataclass
from functools import cached_property
from itertools import product
from typing import Self

import numpy as np
from numpy.typing import NDArray

from underlay._arrays import FloatArray
from underlay.errors import InputError
from underlay.mechanics.biphasic.contacts import DrainingTip, comes_off
from underlay.mechanics.biphasic.history import Polyline
from underlay.mechanics.biphasic.material import Biphasic
from underlay.mechanics.biphasic.tables import Axis, shipped_punch, shipped_tip
from underlay.mechanics.indenters import Indenter

# A44/A33 from incompressible to nu = 0: the compliance of a drained layer is a polynomial in it, to 1e-9.
_SOFTNESS = Axis(0.0, 0.5, 16)
# Spacing of the lattice, of logarithms and of Poisson's ratios, fractions and so on: parabolas between its points
# are within 2e-4 of the peak (transversely isotropic layers, Prony series; see the tests).
_LOG_SPACING, _SPACING = 0.15, 0.05


@dataclass(frozen=True, eq=False)
class Layers:
    """Isotropic draining layers, one for each parameter set of a fit (arrays (sets,)).

    Parameters
    ----------
    E, nu, permeability : FloatArray
        Young's modulus (Pa) and Poisson's ratio of the drained skeleton, permeability (m^4/(N s)), (sets,) each.
    """

    E: FloatArray
    nu: FloatArray
    permeability: FloatArray

    def of(self, rows: NDArray[np.bool_]) -> Self:
        """Return the layers of the sets that the mask `rows`, (sets,), selects."""
        return type(self)(self.E[rows], self.nu[rows], self.permeability[rows])

    @cached_property
    def shear_modulus(self) -> FloatArray:
        """Shear modulus G (Pa), (sets,)."""
        return 0.5 * self.E / (1.0 + self.nu)

    @property
    def softness(self) -> FloatArray:
        """Shear over aggregate modulus of the drained skeleton, A44/A33 = (1 - 2 nu)/(2 (1 - nu)), (sets,)."""
        return (0.5 - self.nu) / (1.0 - self.nu)

    def drainage_time(self, length: float | FloatArray) -> FloatArray:
        """Drainage time length^2/c (s), (sets,), of a length (m), (sets,) or one for all; c is the diffusivity."""
        return length**2 * self.softness / (self.permeability * self.shear_modulus)


def punch_forces(
    layers: Layers,
    radius: FloatArray,
    thickness: FloatArray,
    drainage: str,
    depth: Polyline,
    contact: FloatArray,
    time: FloatArray,
) -> tuple[FloatArray, NDArray[np.bool_]]:
    """Forces of many layers under flat punches along one depth history, each from its own contact depth on.

    Parameters
    ----------
    layers : Layers
        The layers, one for each set.
    radius, thickness : FloatArray
        Radii of the punches and thicknesses (m), (sets,).
    drainage : str
        One of `DRAINAGES`.
    depth : Polyline
        The history of depths (m), as recorded, not counted from contact.
    contact : FloatArray
        Depth of first contact in that history (m), (sets,).
    time : FloatArray
        Times (s), (n,).

    Returns
    -------
    (FloatArray, FloatArray)
        Forces (N), (sets, n), and mask (sets,) of the sets inside the table whose punch stays in contact.
    """
    table = shipped_punch(drainage)
    eps = radius / thickness
    served = table.covers(eps, layers.nu)
    own, found = layers.of(served), np.zeros((served.size, time.size))
    if served.any():
        a = radius[served]
        stiffness = 4.0 * own.shear_modulus / (1.0 - own.nu) * a
        response = table(eps[served], own.nu).scaled(stiffness[:, None], own.drainage_time(a)[:, None])
        found[served], answered = depth.superposed_above(contact[served], response, time)
        served[served] = answered & ~comes_off(found[served])
    return found, served


def tip_forces(
    layers: Layers,
    tip: Indenter,
    thickness: float,
    drainage: str,
    history: Polyline,
    depth: FloatArray,
    time: FloatArray,
) -> tuple[FloatArray, NDArray[np.bool_]]:
    """Forces of many layers of one thickness under one rounded tip.

    Parameters
    ----------
    layers : Layers
        The layers, one for each set.
    tip : Sphere or Paraboloid
        The tip.
    thickness : float
        Thickness h of the layers (m).
    drainage : str
        One of `DRAINAGES`.
    history : Polyline
        Ramps and holds that approximate the record (m, s); no force is computed unless it is one ramp and hold.
    depth, time : FloatArray
        The record's depths since contact (m) and times (s), (n,) each.

    Returns
    -------
    (FloatArray, FloatArray)
        Forces (N), (sets, n), and mask (sets,) of the sets inside the table.
    """

    def contact(softness: float) -> DrainingTip:
        """Contact of the tip with a layer of shear modulus 1 Pa and this ratio of shear to aggregate modulus."""
        nu = (0.5 - softness) / (1.0 - softness)
        return DrainingTip(tip, Biphasic(2.0 * (1.0 + nu), nu, 1.0), thickness, drainage)

    table, by_softness = shipped_tip(drainage), [contact(float(x)) for x in _SOFTNESS.nodes]
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


def lattice_forces(
    columns: Sequence[tuple[FloatArray, bool]], solve: Callable[[list[float]], FloatArray], most: int
) -> tuple[FloatArray, NDArray[np.bool_]] | None:
    """Forces for many parameter sets, by quadratic interpolation between the points of a fixed lattice.

    The lattice does not depend on the sets, so that the force of one set does not depend on the others.

    Parameters
    ----------
    columns : sequence of (FloatArray, bool)
        For each parameter that varies its values, (sets,), and whether the lattice is even in its logarithm.
    solve : callable
        Forces, (n,), at the parameter values (not logarithms) of one point; InputError where there are none.
    most : int
        Largest number of lattice points to solve for.

    Returns
    -------
    (FloatArray, ndarray of bool) or None
        Forces, (sets, n), and mask (sets,) of the sets all of whose lattice points have forces; None where more
        than `most` points are needed.
    """
    spacing = np.array([_LOG_SPACING if by_log else _SPACING for _, by_log in columns])
    fine = np.logical_and.reduce([(values > 0.0) | (not by_log) for values, by_log in columns])
    x = np.stack([np.log(np.where(fine, v, 1.0)) if by_log else v for v, by_log in columns], axis=1) / spacing
    nearest = np.rint(x)
    off = x - nearest
    parabolas = np.stack((0.5 * off * (off - 1.0), 1.0 - off * off, 0.5 * off * (off + 1.0)), axis=1)
    steps = list(product((0, 1, 2), repeat=len(columns)))
    corners = nearest[:, None, :] + np.array(steps) - 1.0
    points, which = np.unique(corners.reshape(-1, len(columns)), axis=0, return_inverse=True)
    if len(points) > most:
        return None
    which = which.reshape(len(x), len(steps))
    solved: dict[int, FloatArray] = {}
    for number, point in enumerate(points * spacing):
        natural = [
            float(np.exp(v)) if by_log else float(v) for v, (_, by_log) in zip(point, columns, strict=True)
        ]
        with suppress(InputError):
            solved[number] = solve(natural)
    served = fine & np.isin(which, list(solved)).all(axis=1)
    if not solved:
        return np.zeros((len(x), 1)), served
    own = which[served]
    found = np.zeros((len(x), next(iter(solved.values())).size))
    for corner, step in enumerate(steps):
        weight = np.prod([parabolas[served, way, k] for k, way in enumerate(step)], axis=0)
        found[served] += weight[:, None] * np.array([solved[int(one)] for one in own[:, corner]])
    return found, served
