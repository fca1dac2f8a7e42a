"""Which effects a scene calls for: how large each one is, whether it is simulated, what it costs.

An effect is measured by leaving it out: the force at the deepest point with it and without it. What the
scene does not declare, or what changes the force by less than the accuracy asked, runs none of its code.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np
import pandas as pd

from underlay.mechanics.accuracy import Accuracy
from underlay.mechanics.indenters import Paraboloid, Sphere
from underlay.mechanics.materials import RIGID, Isotropic, Layer, Material, Rigid, TransverselyIsotropic

if TYPE_CHECKING:
    from underlay.scene.scene import Scene

__all__ = ["effects_table"]

# Depths at which the cost of an effect is timed, and how often: the median of a few calls, a few ms each.
_COST_POINTS = 200
_COST_CALLS = 5


@dataclass(frozen=True)
class _Effect:
    """One effect: the scene without it, and whether this scene has it switched on."""

    name: str
    without: Scene
    declared: bool
    note: str


def effects_table(scene: Scene, max_depth: float, accuracy: Accuracy | None = None) -> pd.DataFrame:
    """List every effect of `scene` at tip depth `max_depth` (m).

    Parameters
    ----------
    scene : Scene
        The test.
    max_depth : float
        Deepest tip depth (m).
    accuracy : Accuracy, optional
        Below its rtol an effect need not be simulated.

    Returns
    -------
    pandas.DataFrame
        One row per effect: ``effect``, ``size_percent`` (change of the force at the deepest point when the
        effect is put in, in per cent of the force without it; NaN where the scene says nothing of it),
        ``simulated`` (bool), ``cost_percent`` (time it adds to a force curve of 200 depths, in per cent of
        the curve without it), ``note``.
    """
    wanted = accuracy or Accuracy()
    deepest = max_depth + scene.instrument.contact_depth
    rows = [_row(effect, scene, deepest, wanted) for effect in _effects(scene)]
    return pd.DataFrame(rows, columns=["effect", "size_percent", "simulated", "cost_percent", "note"])


def _effects(scene: Scene) -> list[_Effect]:
    bare = replace(scene, instrument=replace(scene.instrument, compliance=0.0))
    level = replace(scene, instrument=replace(scene.instrument, baseline=0.0, baseline_slope=0.0))
    finite = scene.substrate is not None and np.isfinite(scene.layer.thickness)
    return [
        _Effect(
            "finite thickness",
            replace(scene, layer=Layer(scene.layer.material), substrate=None),
            finite,
            "against a half-space of the layer",
        ),
        _Effect(
            "substrate compliance",
            replace(scene, substrate=RIGID) if finite else scene,
            finite and not isinstance(scene.substrate, Rigid),
            "against a rigid base",
        ),
        _Effect("anisotropy", _isotropic(scene), _anisotropic(scene), "against the isotropic part"),
        _Effect(
            "true sphere", _paraboloid(scene), isinstance(scene.indenter, Sphere), "against a paraboloid"
        ),
        _Effect("instrument compliance", bare, bare != scene, "against a stiff instrument"),
        _Effect("baseline", level, level != scene, "against no baseline"),
    ]


def _row(effect: _Effect, scene: Scene, deepest: float, accuracy: Accuracy) -> dict[str, object]:
    if not effect.declared:
        note = "not in this scene: none of its code runs"
        return {
            "effect": effect.name,
            "size_percent": np.nan,
            "simulated": False,
            "cost_percent": 0.0,
            "note": note,
        }
    depth = np.array([deepest])
    with_it = float(scene.force(depth, accuracy=accuracy)[0])
    without = float(effect.without.force(depth, accuracy=accuracy)[0])
    size = with_it / without - 1.0
    simulated = abs(size) >= accuracy.rtol
    return {
        "effect": effect.name,
        "size_percent": 100.0 * size,
        "simulated": simulated,
        "cost_percent": _added_cost(scene, effect.without, deepest, accuracy) if simulated else 0.0,
        "note": effect.note if simulated else f"below rtol = {accuracy.rtol:g}: left out where a law allows",
    }


def _added_cost(scene: Scene, without: Scene, deepest: float, accuracy: Accuracy) -> float:
    depth = np.linspace(0.0, deepest, _COST_POINTS)
    with_it = _seconds(lambda: scene.force(depth, accuracy=accuracy))
    return 100.0 * (with_it / _seconds(lambda: without.force(depth, accuracy=accuracy)) - 1.0)


def _seconds(call: Callable[[], object]) -> float:
    call()
    times = []
    for _ in range(_COST_CALLS):
        start = time.perf_counter()
        call()
        times.append(time.perf_counter() - start)
    return float(np.median(times))


def _paraboloid(scene: Scene) -> Scene:
    if not isinstance(scene.indenter, Sphere):
        return scene
    return replace(scene, indenter=Paraboloid(scene.indenter.radius))


def _anisotropic(scene: Scene) -> bool:
    return TransverselyIsotropic in (type(scene.layer.material), type(scene.substrate))


def _isotropic(scene: Scene) -> Scene:
    """Return the scene with each anisotropic material replaced by its in-plane E and nu."""
    layer = replace(scene.layer, material=_in_plane(scene.layer.material))
    substrate = scene.substrate
    if isinstance(substrate, TransverselyIsotropic):
        substrate = _in_plane(substrate)
    return replace(scene, layer=layer, substrate=substrate)


def _in_plane(material: Material) -> Isotropic:
    if isinstance(material, Isotropic):
        return material
    # An isotropic material cannot have the in-plane ratio above 0.5 that an anisotropic one may.
    return Isotropic(material.E, min(material.nu, 0.5))
