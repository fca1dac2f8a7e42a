"""Further layers under the one on top, on a base: what may stand where a substrate stands."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from typing import ClassVar

import numpy as np

from underlay.errors import InputError
from underlay.mechanics.body import RIGID, Base, Body, Layer
from underlay.quantities import inlined, no_number

__all__ = ["MOST_LAYERS", "Stack", "stacked"]

#: Most layers of a body, the one on top included: graded materials want another method.
MOST_LAYERS = 8


@dataclass(frozen=True)
class Stack(Body):
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

    >>> from underlay.mechanics.materials import Isotropic
    >>> film = Layer(Isotropic(E=2e6, nu=0.49), thickness=50e-6)
    >>> Stack([film], base=Isotropic(E=70e9, nu=0.2)).layers[0].material.E
    2000000.0
    """

    parts: ClassVar[tuple[str, ...]] = ("substrate",)

    layers: Sequence[Layer] = field(metadata=no_number())
    base: Base = field(default=RIGID, metadata=inlined())

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
        if not isinstance(self.base, Base):
            raise InputError(f"the base of a Stack must be a material or RIGID; got {self.base!r}")
        object.__setattr__(self, "layers", given)

    def on(self, base: Base) -> Stack:
        """Return the same layers on another half-space."""
        return replace(self, base=base)

    @property
    def in_plane(self) -> Stack:
        """The stack of isotropic materials of the in-plane E and nu."""
        return Stack([layer.in_plane for layer in self.layers], self.base.in_plane)

    @property
    def bonded(self) -> Stack:
        """The stack without slip and springs."""
        return replace(self, layers=tuple(replace(layer, bond="bonded") for layer in self.layers))


def stacked(layers: Sequence[Layer], base: Base) -> Body:
    """Return layers on a base, or the base alone where there are none."""
    return Stack(layers, base) if layers else base
