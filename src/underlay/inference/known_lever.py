"""How well a curve's calibration is known, as priors of a fit."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

from underlay.data.curve import Curve
from underlay.inference.priors.densities import LogNormal
from underlay.inference.priors.prior import Prior
from underlay.scene.lever import SENSITIVITY_RATIO, SPRING_CONSTANT_RATIO, Lever
from underlay.scene.scene import Scene

__all__ = ["UNCERTAINTIES", "KnownLever", "known_lever"]

# Path of what may be off, and the entry of a curve's metadata that says by how much.
_RATIOS = {
    SPRING_CONSTANT_RATIO: ("spring_constant_uncertainty", "spring constant"),
    SENSITIVITY_RATIO: ("sensitivity_uncertainty", "sensitivity"),
}
#: Entries of a curve's metadata that say how well its calibration is known.
UNCERTAINTIES = tuple(key for key, _ in _RATIOS.values())


@dataclass(frozen=True)
class KnownLever:
    """What a curve's calibration adds to a problem.

    Parameters
    ----------
    lever : Lever or None
        Of the scene; none where nothing is said of how well the calibration is known.
    priors : mapping of path to Prior
        Of the ratios of true to stated calibration.
    notes : tuple of str
        What was added.
    """

    lever: Lever | None = None
    priors: Mapping[str, Prior] = field(default_factory=dict)
    notes: tuple[str, ...] = ()


def known_lever(scene: Scene, curve: Curve) -> KnownLever:
    """Return what the uncertainties in the metadata of `curve` add to a fit of `scene`.

    A relative standard uncertainty u is the prior LogNormal(1, u) of the ratio of the true number to the stated.
    """
    told = {path: curve.metadata.get(key) for path, (key, _) in _RATIOS.items()}
    shares = {path: float(share) for path, share in told.items() if isinstance(share, float) and share > 0.0}
    stiffness = curve.metadata.get("spring_constant")
    if not shares or not isinstance(stiffness, float) or not curve.metadata.get("bending_taken_off"):
        return KnownLever(scene.lever)
    said = " and ".join(f"{_RATIOS[path][1]} to {100.0 * share:g} %" for path, share in shares.items())
    if scene.memory is not None:
        note = f"how well the calibration is known ({said}) is not in this fit of a sample that remembers"
        return KnownLever(None, {}, (note,))
    priors = {path: LogNormal(1.0, share) for path, share in shares.items()}
    note = f"the calibration is a parameter of the fit: known is the {said}"
    return KnownLever(scene.lever or Lever(stiffness), priors, (note,))
