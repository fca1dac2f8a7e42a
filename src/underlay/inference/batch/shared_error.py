"""What a calibration that is not quite known does to the modulus of every curve of a map alike.

A spring constant or a sensitivity is off by the same factor on all curves: the mean over a map is as wrong as each
of them, and no scatter shows it. Of one of them, known as its prior says, the part of ln E is

    |ln E(one standard deviation above) - ln E(as stated)|,

both fitted to the same readings, so that the noise is no part of it; two are independent, and add in squares.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from math import hypot, log

import numpy as np
from scipy.special import ndtr

from underlay.data.calibration import Calibration
from underlay.data.curve import Curve
from underlay.inference.batch.curves import CurvePlace
from underlay.inference.batch.model import BatchModel
from underlay.inference.known_lever import UNCERTAINTIES, known_lever
from underlay.scene.scene import Scene

__all__ = ["shared_error", "states_doubt"]

_MODULUS = "layer.E"
_ABOVE = np.array(ndtr(1.0))


def states_doubt(model: BatchModel, places: Sequence[CurvePlace]) -> bool:
    """Whether a map fits the modulus and its scene file, or a curve, says how well the calibration is known."""
    if _MODULUS not in model.free:
        return False
    stated = None if model.file is None else model.file.curve.get("calibration")
    held = (place.curve.metadata for place in places if place.curve is not None)
    return bool(Calibration.of(stated).uncertainties) or any(
        key in told for told in held for key in UNCERTAINTIES
    )


def shared_error(model: BatchModel, scene: Scene, curve: Curve) -> float | None:
    """Relative standard error of the modulus that all curves of this calibration have in common.

    Parameters
    ----------
    model : BatchModel
        What the map fits.
    scene : Scene
        Of this curve, its fitted numbers in it.
    curve : Curve
        With what is known of its calibration in its metadata.

    Returns
    -------
    float or None
        None where the curve does not say how well its calibration is known, or the scene remembers, of which no
        calibration is fitted.
    """
    known = known_lever(scene, curve)
    priors = {path: prior for path, prior in known.priors.items() if path not in model.free}
    if not priors:
        return None
    scene = replace(scene, lever=known.lever)
    as_stated = _log_modulus(model, scene, curve)
    moved = [
        _log_modulus(model, scene.with_values({path: float(prior.quantile(_ABOVE))}), curve) - as_stated
        for path, prior in priors.items()
    ]
    return hypot(*moved)


def _log_modulus(model: BatchModel, scene: Scene, curve: Curve) -> float:
    # Most maps say nothing of their calibration, and never load this.
    from underlay.inference.least_squares.fitting import quick_fit  # noqa: PLC0415

    return log(quick_fit(model.problem(scene, curve)).values[_MODULUS])
