"""Ranges of a published correction, and the record of a test that leaves one."""

from __future__ import annotations

from dataclasses import dataclass

from underlay.mechanics.published.layer_contact import LayerContact
from underlay.mechanics.published.quantities import Quantity

__all__ = ["Limit", "OutOfRange"]


@dataclass(frozen=True)
class OutOfRange:
    """A quantity outside the range for which a correction was published or measured.

    Parameters
    ----------
    variable : str
        The quantity, e.g. ``"X = sqrt(R d)/h"`` or ``"nu of the layer"``.
    value : float
        Its value in this test, at the largest depth.
    low, high : float
        The range.
    """

    variable: str
    value: float
    low: float
    high: float

    def __str__(self) -> str:
        return f"{self.variable} is {self.value:.4g}, outside {self.low:.4g} to {self.high:.4g}"


@dataclass(frozen=True)
class Limit:
    """A range that a quantity of the test has to keep."""

    quantity: Quantity
    low: float
    high: float

    def broken_by(self, contact: LayerContact, max_depth: float) -> OutOfRange | None:
        """Say how this test leaves the range, None if it keeps it."""
        value = self.quantity.of(contact, max_depth)
        if self.low <= value <= self.high:
            return None
        return OutOfRange(self.quantity.name, value, self.low, self.high)
