"""The modulus that the instrument's own software found, on the footing of ours."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

from underlay.data.curve import Curve
from underlay.inference.problem import Problem
from underlay.scene.scene import Scene

__all__ = ["STATED", "InstrumentModulus", "instrument_moduli", "instrument_modulus"]

#: Entry of a curve's metadata by which its file says a reduced modulus (Pa).
STATED = "instrument_reduced_modulus"
_PATH = "layer.E"


@dataclass(frozen=True)
class InstrumentModulus:
    """What the file of a curve says of the sample's stiffness, beside what was found here.

    Instruments write the reduced modulus E / (1 - nu^2), or a Young's modulus at a Poisson's ratio of their
    own; readers keep the first. Both are brought to the Young's modulus of our Poisson's ratio.

    Parameters
    ----------
    reduced : float
        The instrument's E / (1 - nu^2) (Pa), nearly always of a half-space.
    youngs : float
        Young's modulus ``layer.E`` (Pa) that has this reduced modulus; of a transversely isotropic layer, with
        the ratios of its other moduli kept.
    nu : float
        Poisson's ratio ``layer.nu`` with which that was done.
    difference : float
        Our modulus over the instrument's, less one.
    """

    reduced: float
    youngs: float
    nu: float
    difference: float


def instrument_modulus(scene: Scene, curve: Curve) -> InstrumentModulus | None:
    """Compare the layer of a fitted scene with what the curve's file says; None where it says nothing."""
    reduced = curve.metadata.get(STATED)
    if isinstance(reduced, bool) or not isinstance(reduced, int | float):
        return None
    if not (math.isfinite(reduced) and reduced > 0.0):
        return None
    material = scene.layer.material
    # theta is half the indentation modulus of the paper, E / (1 - nu^2) of an isotropic material.
    ratio = 2.0 * material.theta / reduced
    return InstrumentModulus(float(reduced), material.E / ratio, material.nu, ratio - 1.0)


def instrument_moduli(
    problem: Problem, scenes: Sequence[Scene], curves: Sequence[Curve]
) -> dict[str, InstrumentModulus]:
    """Comparison for every fitted ``layer.E``, by its name; none for one that several curves share."""
    found: dict[str, InstrumentModulus] = {}
    for member, scene, curve in zip(problem.members, scenes, curves, strict=True):
        entry = member.entries.get(_PATH)
        told = instrument_modulus(scene, curve)
        shared = (
            sum(_PATH in other.entries and other.entries[_PATH] == entry for other in problem.members) > 1
        )
        if entry is not None and told is not None and not shared:
            found[problem.names[entry]] = told
    return found
