"""Origin of a result: versions, hashes of the input, and the modulus found by the instrument's own software."""

from __future__ import annotations

import hashlib
import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from importlib import metadata
from typing import Any

from underlay._version import VERSION
from underlay.data.curve import Curve, recorded
from underlay.inference.problem import Problem
from underlay.scene.scene import Scene

#: Entry of a curve's metadata by which its file says a reduced modulus (Pa).
STATED = "instrument_reduced_modulus"
# Parameter that the instrument's modulus is compared with.
_PATH = "layer.E"


def curve_hash(curve: Curve) -> str:
    """SHA-256 of the depths and forces of a curve as they were fitted, in hexadecimal."""
    digest = hashlib.sha256(curve.depth.tobytes())
    digest.update(curve.force.tobytes())
    return digest.hexdigest()


def provenance(curves: Sequence[Curve]) -> dict[str, Any]:
    """Versions of this program and its libraries; of every curve its name, file, hashes and assumed inputs."""
    return {
        "versions": {"underlay": VERSION} | version_record(("numpy", "scipy", "lmfit")),
        "curves": [
            {
                "name": curve.metadata.get("name"),
                "path": curve.metadata.get("path"),
                "scene_path": curve.metadata.get("scene_path"),
                "recorded": recorded(curve),
                "file_sha256": curve.metadata.get("sha256"),
                "data_sha256": curve_hash(curve),
                "points": len(curve),
                "assumed": list(curve.metadata.get("assumed", ())),
            }
            for curve in curves
        ],
    }


def version_record(names: Iterable[str]) -> dict[str, str]:
    """Versions of installed packages, by name."""
    return {name: _version(name) for name in names}


def _version(name: str) -> str:
    try:
        return metadata.version(name)
    except metadata.PackageNotFoundError:
        return "from source"


@dataclass(frozen=True)
class InstrumentModulus:
    """Modulus that the file of a curve states, compared with the fitted one.

    Instruments write the reduced modulus E / (1 - nu^2), or a Young's modulus at a Poisson's ratio of their own;
    readers keep the first. Both are converted to the Young's modulus at our Poisson's ratio.

    Parameters
    ----------
    reduced : float
        The instrument's E / (1 - nu^2) (Pa), nearly always of a half-space.
    youngs : float
        Young's modulus ``layer.E`` (Pa) that has this reduced modulus; of a transversely isotropic layer, with the
        ratios of its other moduli kept.
    nu : float
        Poisson's ratio ``layer.nu`` of that conversion.
    difference : float
        Our modulus over the instrument's, less one.
    """

    reduced: float
    youngs: float
    nu: float
    difference: float


def instrument_modulus(scene: Scene, curve: Curve) -> InstrumentModulus | None:
    """Compare the layer of a fitted scene with the modulus in the curve's file; None where the file gives none."""
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
    """The instrument's modulus beside every fitted ``layer.E``, by the name of that parameter.

    None is given for a parameter that several curves share.
    """
    found: dict[str, InstrumentModulus] = {}
    for member, scene, curve in zip(problem.members, scenes, curves, strict=True):
        entry = member.entries.get(_PATH)
        stated = instrument_modulus(scene, curve)
        shared = (
            sum(_PATH in other.entries and other.entries[_PATH] == entry for other in problem.members) > 1
        )
        if entry is not None and stated is not None and not shared:
            found[problem.names[entry]] = stated
    return found
