"""Friction and finite strain: errors of a law whose scene does not say that they are absent.

Friction lies between none and full, and real friction between a law without it and one without slip (they bracket
it to 0.03 %): a share of their difference, any between 0 and 1, here a normal distribution. Finite strain has a
measured shape (`mechanics/finite_strain`) and a size that depends on a strain energy nobody knows: 1 +- 0.5.

The two are not a sum: what friction adds in large strains alone has a measured shape too, and a size between a part
taken off (nu = 0.3) and nearly all of it added (nu = 0.49).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from underlay._arrays import FloatArray
from underlay.inference.misfit.known_error import KnownError, Pressed
from underlay.mechanics.discrepancy import (
    finite_strain_excess,
    friction_in_large_strains,
    require_measured,
    why_unmeasured,
)
from underlay.mechanics.solvers import Exact, Stuck
from underlay.scene.scene import Scene

__all__ = ["BOTH", "FINITE_STRAIN", "FRICTION", "LeftOut", "left_out"]

FRICTION, FINITE_STRAIN, BOTH = "friction", "finite strain", "friction in large strains"
# Of the share of full friction. A flat prior between none and full has its ends outside every 95 % interval, and a
# tip that slides and one that sticks are both common: there it covers 75 % where this covers 92 (a modulus at 0.3 %
# noise; 84 to 87 and 90 to 92 with the thickness free), for intervals up to 1.4 times as long
# (tests/studies/friction_prior.py).
_SHARE = 0.35
# What the columns are computed to: they are known to a tenth at best.
_RTOL = 1e-4


@dataclass(frozen=True)
class LeftOut:
    """What the law of a scene leaves out.

    Parameters
    ----------
    errors : tuple of KnownError
        What can be computed of it.
    unknown : tuple of str
        What cannot, and why.
    declared : tuple of str
        What the scene says.
    """

    errors: tuple[KnownError, ...] = ()
    unknown: tuple[str, ...] = ()
    declared: tuple[str, ...] = ()


def left_out(scene: Scene, depth: float) -> LeftOut:
    """Say what the law of a scene leaves out for depths up to `depth` (m).

    Raises
    ------
    InputError
        If the scene asks for finite strain where it was not measured.
    """
    if scene.discrepancy is not None:
        return LeftOut(declared=("the sizes of friction and finite strain",))
    parts = (_friction(scene), _finite_strain(scene, depth), _both(scene, depth))
    return LeftOut(*(tuple(entry for part in parts for entry in getattr(part, name)) for name in _FIELDS))


_FIELDS = ("errors", "unknown", "declared")


def _friction(scene: Scene) -> LeftOut:
    if scene.friction != "unknown":
        return LeftOut(declared=(f'friction = "{scene.friction}"',))
    if scene.adhesion is not None or scene.memory is not None:
        return LeftOut(unknown=(f"{FRICTION} beside adhesion or relaxation",))
    return LeftOut((KnownError(FRICTION, _stuck_less_free, mean=0.5, deviation=_SHARE),))


def _stuck_less_free(test: Pressed) -> FloatArray:
    sticks, free = _forces(test)
    return np.asarray(test.force * (np.divide(sticks, free, out=np.ones_like(free), where=free > 0.0) - 1.0))


def _forces(test: Pressed) -> tuple[FloatArray, FloatArray]:
    """With a tip that sticks and with one that slides (N), both by solvers of their own."""
    inside = np.maximum(test.depth, 0.0)
    return test.by(Stuck(_RTOL)).force(inside), test.by(Exact(_RTOL)).force(inside)


def _both(scene: Scene, depth: float) -> LeftOut:
    unknown = scene.friction == "unknown" and scene.finite_strain is not False
    if not unknown or scene.adhesion is not None or scene.memory is not None:
        return LeftOut()
    if why_unmeasured(scene.contact, depth):
        return LeftOut()
    told = (FRICTION, FINITE_STRAIN)
    return LeftOut((KnownError(BOTH, _stuck_in_large_strains, mean=0.25, deviation=0.5, told=told),))


def _stuck_in_large_strains(test: Pressed) -> FloatArray:
    sticks, free = _forces(test)
    further = friction_in_large_strains(test.scene.contact, sticks, free, test.depth)
    return np.asarray(test.force * further)


def _finite_strain(scene: Scene, depth: float) -> LeftOut:
    if scene.finite_strain is False:
        return LeftOut(declared=("finite_strain = false",))
    why = why_unmeasured(scene.contact, depth)
    if scene.adhesion is not None or scene.memory is not None:
        why = "measured without adhesion and relaxation"
    if not why:
        return LeftOut((KnownError(FINITE_STRAIN, _excess, mean=1.0, deviation=0.5),))
    if scene.finite_strain:
        require_measured(scene.contact, depth)
    return LeftOut(unknown=(f"{FINITE_STRAIN} is beyond what is known here ({why})",))


def _excess(test: Pressed) -> FloatArray:
    inside = np.maximum(test.depth, 0.0)
    excess = finite_strain_excess(test.scene.contact, inside, test.law.contact_radius(inside))
    return np.asarray(test.force * excess)
