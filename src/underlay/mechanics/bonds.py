"""How a layer holds to what is under it: bonded, free to slip, by springs, or nobody knows."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import ClassVar, TypeAlias

import numpy as np

from underlay._arrays import finite
from underlay.errors import InputError
from underlay.quantities import Part, quantity

__all__ = ["BONDS", "Bond", "Spring", "as_bond"]

#: Bonds that have a name: no gap and no slip; no gap and no friction; and one that nobody knows, which is computed
#: as bonded, and a fit says what slip would give.
BONDS = ("bonded", "slip", "unknown")


@dataclass(frozen=True)
class Spring(Part):
    """An imperfect interface: it opens and slides in proportion to the stress on it.

    Parameters
    ----------
    normal : float, default inf
        Stress per opening (Pa/m), positive; infinite where it does not open.
    shear : float, default inf
        Stress per sliding (Pa/m), zero or more; zero slides freely, infinite does not slide. A glue of
        thickness t and moduli M (confined) and G has normal = M/t and shear = G/t.
    """

    parts: ClassVar[tuple[str, ...]] = ("layer", "substrate")

    normal: float = field(
        default=np.inf,
        metadata=quantity(
            "stiffness per area", "normal stiffness of the {part}'s bond", bounds=(0.0, np.inf)
        ),
    )
    shear: float = field(
        default=np.inf,
        metadata=quantity("stiffness per area", "shear stiffness of the {part}'s bond", bounds=(0.0, np.inf)),
    )

    def __post_init__(self) -> None:
        for name, least in (("normal", "positive"), ("shear", "zero or more")):
            given = getattr(self, name)
            value = np.inf if given == np.inf else finite(given, f"the spring's {name} stiffness", "Pa/m")
            if not (value > 0.0 or (value == 0.0 and name == "shear")):
                why = ": nothing would hold the layer" if value == 0.0 else ""
                raise InputError(f"the spring's {name} stiffness must be {least} (Pa/m); got {value!r}{why}")
            object.__setattr__(self, name, value)


Bond: TypeAlias = str | Spring


def as_bond(given: object) -> Bond:
    """Return a bond as it is.

    Raises
    ------
    InputError
        If it is none.
    """
    if isinstance(given, Spring) or (isinstance(given, str) and given in BONDS):
        return given
    raise InputError(
        f'unknown bond {given!r:.60}: a layer\'s lower face is "bonded", "slip", "unknown" or a Spring'
    )
