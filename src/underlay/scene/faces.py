"""The lower faces of a scene's layers: which there are, and how each holds to what is under it."""

from __future__ import annotations

from dataclasses import replace

from underlay.errors import InputError
from underlay.mechanics.body import Layer
from underlay.mechanics.bonds import Bond
from underlay.mechanics.stack import Stack
from underlay.scene.scene import Scene

__all__ = ["bond_of", "faces", "has_face", "unknown_faces", "with_bond"]


def faces(scene: Scene) -> list[str]:
    """Names of the layers that stand on something, downwards: ``"layer"``, ``"substrate.layers[0]"``, ..."""
    if scene.base is None:
        return []
    return ["layer", *(f"substrate.layers[{number}]" for number in range(len(scene.layers) - 1))]


def has_face(scene: Scene, face: str = "layer") -> bool:
    """Whether a layer of that name stands on something."""
    return face in faces(scene)


def unknown_faces(scene: Scene) -> list[str]:
    """Names of the layers of which nobody knows how they hold to what is under them."""
    return [face for face in faces(scene) if _layer(scene, face).bond == "unknown"]


def bond_of(scene: Scene, face: str) -> Bond:
    """Bond of a face as it is computed: bonded where nobody knows."""
    return _layer(scene, face).held.bond


def with_bond(scene: Scene, face: str, bond: Bond) -> Scene:
    """Return the scene with another bond of one face.

    Raises
    ------
    InputError
        If nothing is under that layer.
    """
    layers, base = list(scene.layers), scene.base
    if base is None:
        raise InputError(f"nothing is under {face!r}")
    number = faces(scene).index(face)
    layers[number] = replace(layers[number], bond=bond)
    if number == 0:
        return replace(scene, layer=layers[0])
    return replace(scene, substrate=Stack(layers[1:], base))


def _layer(scene: Scene, face: str) -> Layer:
    return scene.layers[faces(scene).index(face)]
