"""What stands between the contact and the numbers in the file: the numbers of an instrument.

What each of them does to a reading is said by its link (`chain.py`).
"""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cached_property
from typing import ClassVar

import numpy as np

from underlay._arrays import finite
from underlay.errors import InputError
from underlay.quantities import Part, field_quantities, quantity
from underlay.scene.chain import Chain
from underlay.units import KINDS

__all__ = ["Instrument"]


@dataclass(frozen=True)
class Instrument(Part):
    """Contact point, force baseline and compliance of an instrument; the default is ideal.

    Parameters
    ----------
    contact_depth : float
        Reading of the depth axis at first contact (m).
    baseline : float
        Force reading without contact at zero of the depth axis (N).
    baseline_slope : float
        Change of that reading along the depth axis (N/m).
    compliance : float
        Compliance of frame or cantilever not yet removed from the depth (m/N), zero or positive.
    """

    parts: ClassVar[tuple[str, ...]] = ("instrument",)

    contact_depth: float = field(default=0.0, metadata=quantity("length", "contact point"))
    baseline: float = field(default=0.0, metadata=quantity("force", "baseline", linear=True))
    baseline_slope: float = field(default=0.0, metadata=quantity("stiffness", "baseline slope", linear=True))
    compliance: float = field(
        default=0.0,
        metadata=quantity("compliance", "instrument compliance", symbol="C", bounds=(0.0, np.inf)),
    )

    def __post_init__(self) -> None:
        for name, known in field_quantities(self).items():
            object.__setattr__(self, name, finite(getattr(self, name), name, KINDS[known.kind].si))
        if self.compliance < 0.0:
            raise InputError(f"instrument compliance must be zero or positive (m/N); got {self.compliance!r}")

    @cached_property
    def chain(self) -> Chain:
        """The links of what is not zero here."""
        return Chain.of({f"instrument.{name}": getattr(self, name) for name in field_quantities(self)})
