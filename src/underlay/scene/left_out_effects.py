"""Effects that a law leaves out unless the scene says otherwise: friction under the tip, and finite strain."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from underlay._arrays import FloatArray
from underlay.mechanics.finite_strain import finite_strain_excess, why_unmeasured
from underlay.scene.effect import Effect, Simulated

__all__ = ["left_out_effects"]

_FRICTION, _FINITE_STRAIN = "friction", "finite strain"


def left_out_effects(level: Simulated) -> list[Effect]:
    """Friction and finite strain; `level` is the scene without memory and baseline."""
    return [_friction(level), _finite_strain(level)]


def _friction(level: Simulated) -> Effect:
    """A tip that sticks against one that slides; real friction lies between."""
    if level.adhesion is not None:
        note = "how a tip that sticks and adheres behaves is not simulated"
        return Effect(_FRICTION, None, None, simulated=False, note=note)
    simulated = level.friction == "stuck"
    said = {"stuck": "the tip is declared to stick", "none": "declared none", "unknown": "unknown"}
    return Effect(
        _FRICTION,
        replace(level, friction="stuck"),
        replace(level, friction="none"),
        simulated=simulated,
        note=f"a tip that sticks against one that slides; {said[level.friction]}",
    )


def _finite_strain(level: Simulated) -> Effect:
    """What large strains do to the linear law, by the function that was measured; nothing is simulated."""

    def excess(depth: FloatArray) -> FloatArray:
        why = why_unmeasured(level.contact, float(depth.max()))
        if why:
            return np.full(depth.shape, np.nan)
        radius = level.contact_law(float(depth.max())).contact_radius(depth)
        return finite_strain_excess(level.contact, depth, radius)

    def note(deepest: float) -> str:
        why = why_unmeasured(level.contact, deepest)
        return (
            f"beyond what is known here: {why}"
            if why
            else "a neo-Hookean layer against small strains, known to a half of itself"
        )

    return Effect(
        _FINITE_STRAIN, None, None, simulated=False, note="against small strains", excess=excess, note_at=note
    )
