"""Further layers under the one on top, on a base: what may stand where a substrate stands."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import ClassVar, TypeAlias

import numpy as np

from underlay.errors import InputError
from underlay.mechanics.materials import RIGID, Isotropic, Layer, Rigid, Substrate, TransverselyIsotropic
from underlay.quantities import Part, inlined, no_number

__all__ = ["MOST_LAYERS", "Body", "Stack"]

#: Most layers of a body, the one on top included: graded materials want another method.
MOST_LAYERS = 8


@dataclass(frozen=True)
class Stack(Part):
    """Layers on a base, under the layer of a scene.

    Parameters
    ----------
    layers : sequence of Layer
        From the top down, each of finite thickness; one to seven.
    base : Isotropic, TransverselyIsotropic or RIGID, default RIGID
        The half-space under them.

    Raises
    ------
    InputError
        If a part is of the wrong kind, a layer has no finite thickness, or there are too many.

    Examples
    --------
    A gel stuck to a film of PDMS on glass:

    >>> film = Layer(Isotropic(E=2e6, nu=0.49), thickness=50e-6)
    >>> Stack([film], base=Isotropic(E=70e9, nu=0.2)).layers[0].material.E
    2000000.0
    """

    parts: ClassVar[tuple[str, ...]] = ("substrate",)

    layers: Sequence[Layer] = field(metadata=no_number())
    base: Substrate = field(default=RIGID, metadata=inlined())

    def __post_init__(self) -> None:
        given = (self.layers,) if isinstance(self.layers, Layer) else tuple(self.layers)
        if not given:
            raise InputError("a Stack has one layer or more; without one pass its base as substrate")
        for number, layer in enumerate(given):
            if not isinstance(layer, Layer):
                raise InputError(
                    f"layers[{number}] of a Stack must be Layer(material, thickness); got {layer!r}"
                )
            if not np.isfinite(layer.thickness):
                raise InputError(
                    f"layers[{number}] of a Stack needs a finite thickness: what goes on for ever is its base"
                )
        if len(given) >= MOST_LAYERS:
            raise InputError(
                f"a Stack has up to {MOST_LAYERS - 1} layers, {MOST_LAYERS} with the one on top; got {len(given)}. "
                "Join layers that are alike"
            )
        if not isinstance(self.base, Isotropic | TransverselyIsotropic | Rigid):
            raise InputError(f"the base of a Stack must be a material or RIGID; got {self.base!r}")
        object.__setattr__(self, "layers", given)

    def without(self, index: int) -> Substrate | Stack:
        """Return what is left when one layer is taken out."""
        left = (*self.layers[:index], *self.layers[index + 1 :])
        return Stack(left, self.base) if left else self.base


#: What a layer may stand on.
Body: TypeAlias = Substrate | Stack
