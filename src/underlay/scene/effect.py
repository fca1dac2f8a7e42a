"""One effect of a scene: what it is with it and without it; and what the ledger asks of a scene."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, ClassVar, Protocol, TypeAlias

from underlay._arrays import ArrayLike, FloatArray
from underlay.mechanics.body import Base, Body, Layer
from underlay.mechanics.contact import Adhesion, Contact
from underlay.mechanics.contact_law import ContactLaw
from underlay.mechanics.indenters import Indenter
from underlay.mechanics.response import History
from underlay.mechanics.solvers import AnySolver
from underlay.scene.instrument import Instrument

__all__ = ["Effect", "EffectRule", "Simulated"]


class Simulated(Protocol):
    """What the ledger asks of a scene: its parts, its law and its force. `Scene` is one."""

    __dataclass_fields__: ClassVar[dict[str, Any]]

    @property
    def indenter(self) -> Indenter:
        """What is pressed in."""

    @property
    def layer(self) -> Layer:
        """What it is pressed into."""

    @property
    def substrate(self) -> Body | None:
        """What the layer stands on."""

    @property
    def layers(self) -> tuple[Layer, ...]:
        """Every layer, from the top down."""

    @property
    def base(self) -> Base | None:
        """The half-space that the layers stand on."""

    @property
    def instrument(self) -> Instrument:
        """What reads depth and force."""

    @property
    def history(self) -> History | None:
        """What the sample remembers."""

    @property
    def adhesion(self) -> Adhesion | None:
        """What holds tip and surface together."""

    @property
    def friction(self) -> str:
        """What is known of friction under the tip."""

    @property
    def contact(self) -> Contact:
        """Indenter and body: what a solver is given."""

    @property
    def elastic(self) -> Simulated:
        """The scene without memory."""

    @property
    def ages(self) -> bool:
        """Whether the layer relaxes on an elastic base."""

    def contact_law(self, max_depth: float, *, solver: AnySolver = "auto") -> ContactLaw:
        """Law of its contact up to `max_depth` (m)."""

    def force(
        self, depth: ArrayLike, time: ArrayLike | None = None, *, solver: AnySolver = "auto"
    ) -> FloatArray:
        """Force reading (N) at depth readings (m)."""


@dataclass(frozen=True)
class Effect:
    """One effect: the scene with it and without it.

    Parameters
    ----------
    name : str
        What it is called.
    with_it, without : Scene or None
        The two scenes; None where the scene says too little to build one.
    simulated : bool
        Whether the scene as it stands runs the effect's code.
    note : str
        What the size is measured against, or why there is none.
    duration : float, optional
        Time (s) of the even motion to the deepest point, for an effect that acts in time.
    excess : callable, optional
        Relative change of the force at depths (m), (n,), of an effect that no scene simulates; NaN where unknown.
    note_at : callable, optional
        The note of an effect that is known to a depth (m) only.
    """

    name: str
    with_it: Simulated | None
    without: Simulated | None
    simulated: bool
    note: str
    duration: float | None = None
    excess: Callable[[FloatArray], FloatArray] | None = None
    note_at: Callable[[float], str] | None = None


#: How an effect is found: from a scene and the law of its contact.
EffectRule: TypeAlias = "Callable[[Simulated, ContactLaw], Effect]"
