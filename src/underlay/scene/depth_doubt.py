"""Where linear elasticity has nothing to say: a tip pressed deeper than the layer is thick."""

from __future__ import annotations

from underlay.scene.scene import Scene
from underlay.units import format_quantity

__all__ = ["depth_doubt"]


def depth_doubt(scene: Scene, tip_depth: float) -> str | None:
    """Say that the depth of the tip (m, since contact) passes the thickness; None where it does not.

    Every law here is linear in the displacements. On a rigid base such a tip would stand inside the base; on a
    soft one a film may bend that far, and its stretch is not in the law. The numbers are those of the linear
    problem, so they are given, and doubted: a sample is not fitted worse for being refused.
    """
    thickness = scene.layer.thickness
    if not tip_depth > thickness:
        return None
    return (
        f"the tip goes {format_quantity(tip_depth, 'length')} deep into a layer "
        f"{format_quantity(thickness, 'length')} thick, where linear elasticity says nothing true: use less of "
        "the curve ([curve] max_depth), or check depth, thickness and their units"
    )
