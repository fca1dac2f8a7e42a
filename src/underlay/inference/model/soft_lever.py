"""A lever softer than the sample: its noise is in depth and force alike, and the travel is the coordinate.

Depth is the scanner's travel less the deflection, w = z - F/k. The detector's noise is then in both with opposite
signs: their second differences correlate at -1, and the ratio of their sizes is k. Against the travel z = w + F/k,
with the lever a compliance 1/k in series, the same noise is in the force alone and white again. Fitted against the
depth it is an error in the variable, which no weight of the force's residuals makes good (Fuller 1987,
doi:10.1002/9780470316665).
"""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import replace

import numpy as np

from underlay._arrays import FloatArray
from underlay.data.curve import Curve
from underlay.scene.chain import Frame
from underlay.scene.scene import Scene
from underlay.units import format_quantity

__all__ = ["against_travel", "lever_seen"]

# Second differences of independent noises of 100 readings correlate at -0.9 in none of 10^9 curves; a lever whose
# own noise is 2.1 times that of the travel does.
_SHARED = -0.9
# Second differences of white noise have neighbours that correlate at -2/3, those of what is smooth at +1.
_ROUGH = -0.3
_FEWEST = 30
# At a correlation of -0.9 a noise of the detector alone, not of the lever, makes k too large by a fifth (1/0.81).
_LIKE_THE_FILE = 0.24
# Share of the readings, the shallowest, whose force is that of a free lever.
_BEFORE = 0.05


def lever_seen(depth: FloatArray, force: FloatArray) -> float | None:
    """Spring constant (N/m) of the lever whose noise is in both depth (m) and force (N), (n,); None without one."""
    if len(depth) < _FEWEST:
        return None
    rough_depth, rough_force = (np.diff(values, n=2) for values in (depth, force))
    if not (_is_rough(rough_depth) and _is_rough(rough_force)):
        return None
    depths, forces, both = rough_depth @ rough_depth, rough_force @ rough_force, rough_depth @ rough_force
    if both > _SHARED * np.sqrt(depths * forces):
        return None
    # What else shakes the depth, the scanner, is in `depths` alone.
    return float(-forces / both)


def against_travel(scene: Scene, curve: Curve, free: Collection[str]) -> tuple[Scene, Curve]:
    """A test with its lever as a compliance in series and its curve against the travel, where its noise asks it.

    Readings keep their depth where the lever is free, so that the contact depth keeps its meaning. What has a lever
    or a frame of its own is left as it is.
    """
    if scene.lever is not None or scene.instrument.compliance != 0.0 or Frame.path in free:
        return scene, curve
    stiffness = lever_seen(curve.depth, curve.force)
    if stiffness is None:
        return scene, curve
    told = curve.metadata.get("spring_constant")
    if isinstance(told, float) and abs(stiffness / told - 1.0) < _LIKE_THE_FILE:
        stiffness = told
    count = max(int(_BEFORE * len(curve)), 1)
    at_rest = float(np.median(curve.force[np.argpartition(curve.depth, count)[:count]]))
    travel = curve.depth + (curve.force - at_rest) / stiffness
    note = (
        f"the noise of a lever of {format_quantity(stiffness, 'stiffness')} is in depth and force alike: the curve "
        "is fitted against the travel (depth + force/k), with the lever in series"
    )
    instrument = replace(scene.instrument, compliance=1.0 / stiffness)
    notes = (*curve.metadata.get("notes", ()), note)
    return replace(scene, instrument=instrument), replace(curve, depth=travel).with_metadata(notes=notes)


def _is_rough(differences: FloatArray) -> bool:
    """Whether second differences (n,) are those of a noise."""
    square = differences @ differences
    return bool(square > 0.0 and differences[1:] @ differences[:-1] < _ROUGH * square)
