"""How deep a test is taken to go that does not say it."""

from __future__ import annotations

import numpy as np

from underlay._arrays import FloatArray
from underlay.scene.scene import Scene

__all__ = ["default_depth"]

# A contact as wide as the layer is thick, where the substrate is felt and strains are small; a tenth of that
# depth, on a half-space, of a tip's radius; a cone has no length of its own.
_WIDE, _SHALLOW, _CONE_DEPTH = 0.5, 0.1, 1e-6


def default_depth(scene: Scene) -> float:
    """Return a depth since contact (m) at which a scene shows what it is about.

    The contact is then as wide as the layer is thick, or the tip at half its width, by the half-space's relation of
    depth and contact radius (Sneddon 1965), but no deeper than a tenth of the thickness; on a half-space it is a
    tenth of the tip's radius, and 1 um for a tip without any length.

    Examples
    --------
    >>> import underlay as ul
    >>> soft = ul.Isotropic(1e6, 0.45)
    >>> default_depth(ul.Scene(ul.Sphere(1e-3), ul.Layer(soft, 1e-3), ul.RIGID))
    0.0001
    >>> default_depth(ul.Scene(ul.Cone(1.2), ul.Layer(soft)))
    1e-06
    """
    radius = scene.parameters.get("indenter.radius")
    thickness = scene.layer.thickness
    if not np.isfinite(thickness):
        return _CONE_DEPTH if radius is None else _SHALLOW * radius
    wide = min(_WIDE * thickness, _WIDE * scene.indenter.max_radius)
    depth: FloatArray = scene.indenter.abel(np.array([wide]))
    return min(float(depth[0]), _SHALLOW * thickness) or _SHALLOW * thickness
