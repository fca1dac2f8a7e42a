"""Layers of a stack that do not matter: joined with a neighbour where the contact cannot tell.

Elastic energy is monotone in the surface compliance, and that is diagonal in the wavenumber: if the compliance of
two bodies differs by a share of at most delta at every wavenumber, so does the force at a given depth, whatever
the contact. Where the contact is small, what counts is the mean over the wavenumbers it sees: to first order
kappa changes by (2 eps/pi) int |L' - L| du.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from math import pi

from underlay._arrays import FloatArray
from underlay.mechanics.body import Base, Layer
from underlay.mechanics.kernel.kernel import Kernel, Layers
from underlay.mechanics.kernel.substrate import material_contrast

__all__ = ["joined", "relative_effect"]

# Radius and stiffness move by up to twice as much as the force; the rest is margin, as for `Auto`.
_MARGIN = 4.0
# First order holds below this.
_LARGEST_SHALLOW = 0.02
# Only a layer this thin and alike, for its depth, or this deep for the contact, is worth a look.
_THIN, _DEEP = 1e-2, 5.0


def joined(body: Layers, eps: float) -> Iterator[Layers]:
    """Bodies with one layer less that may serve contact radii up to `eps` thicknesses of the layer on top."""
    layers, base = body[:2]
    depth = 0.0
    for number, layer in enumerate(layers):
        lower = layers[number + 1] if number + 1 < len(layers) else None
        beneath = base if lower is None else lower.material
        name = f"layer {number + 1}" if number else "the layer on top"
        below = "the base" if lower is None else f"layer {number + 2}"
        deep = depth + layer.thickness
        if layer.bond == "bonded":
            if lower is not None and _worth(layer, lower.material, lower.thickness, deep, eps, layers[0]):
                one = replace(layer, thickness=deep - depth + lower.thickness, bond=lower.bond)
                left = (*layers[:number], one, *layers[number + 2 :])
                yield Layers(left, base, (*body.said, f"{below} as {name}"))
            if number and _worth(layer, beneath, layer.thickness, depth, eps, layers[0]):
                said = (*body.said, f"{name} as {below}")
                if lower is None:
                    yield Layers((*layers[:number], *layers[number + 1 :]), base, said)
                else:
                    one = replace(lower, thickness=layer.thickness + lower.thickness)
                    yield Layers((*layers[:number], one, *layers[number + 2 :]), base, said)
            if number and lower is None and deep >= _DEEP * eps * layers[0].thickness:
                yield Layers(layers[:number], layer.material, (*body.said, f"{below} as {name}"))
        depth = deep


def _worth(layer: Layer, other: Base, thickness: float, depth: float, eps: float, top: Layer) -> bool:
    if other == layer.material or depth >= _DEEP * eps * top.thickness:
        return True
    contrast = material_contrast(layer.material.plane_constants, other.plane_constants)
    return contrast * thickness <= _THIN * depth


def relative_effect(whole: Kernel, simpler: Kernel, stretch: float, eps: float) -> float:
    """Largest relative change of force, radius and stiffness, for contact radii up to `eps` thicknesses on top.

    `stretch` is the thickness on top of the simpler body over that of the whole.
    """
    u, weights = whole.rule(eps, 1e-3)
    L: FloatArray = 1.0 - whole.values(u)
    change = abs(1.0 - simpler.values(u * stretch) - L)
    # What the rest of the kernel does to the contact enters twice.
    around = 1.0 + (2.0 * eps / pi) * float(abs(1.0 - L) @ weights)
    shallow = _MARGIN * around**2 * (2.0 * eps / pi) * float(change @ weights)
    anywhere = _MARGIN * float((change / L).max())
    return min(anywhere, shallow) if shallow <= _LARGEST_SHALLOW else anywhere
