"""The record of a published correction: what it holds for, where it comes from, and how far off it is."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field

from underlay.mechanics.published.factor import Factor
from underlay.mechanics.published.layer_contact import LayerContact
from underlay.mechanics.published.limits import Limit
from underlay.mechanics.published.measured_error import MeasuredError
from underlay.mechanics.published.quantities import LAYER_NU, VARIABLES

__all__ = [
    "ELASTIC",
    "FRICTIONLESS",
    "MEASURED_RANGE",
    "RIGID_BONDED",
    "PublishedCorrection",
]

RIGID_BONDED = "rigid, layer bonded"
FRICTIONLESS = "rigid, layer free to slip"
ELASTIC = "elastic, layer bonded"

MEASURED_RANGE = "measured: within 5 % of the exact contact law there"


@dataclass(frozen=True, kw_only=True)
class PublishedCorrection:
    """One published correction for one kind of indenter.

    Parameters
    ----------
    name : str
        How it is asked for; one name may stand for several kinds of indenter.
    indenter : str
        ``"sphere"`` (a paraboloid in every source), ``"cone"`` or ``"flat punch"``.
    substrate : str
        ``"rigid, layer bonded"``, ``"rigid, layer free to slip"`` or ``"elastic, layer bonded"``.
    equation : str
        The formula, with d the depth, h the thickness and alpha the half-angle from the axis.
    valid_range : tuple of float
        Range of `variable`.
    range_basis : str
        Where that range comes from.
    nu_range : tuple of float
        Range of the layer's Poisson's ratio.
    assumptions : tuple of str
        What the source takes for granted.
    source : str
        Author, year, journal.
    doi : str or None
        Its DOI, where confirmed.
    further_limits : tuple of Limit
        Other ranges the source or the measurement sets.
    """

    name: str
    indenter: str
    substrate: str
    equation: str
    valid_range: tuple[float, float]
    range_basis: str
    nu_range: tuple[float, float]
    assumptions: tuple[str, ...]
    source: str
    doi: str | None
    further_limits: tuple[Limit, ...] = ()
    factor: Callable[[LayerContact], Factor] = field(repr=False, compare=False)
    measured_error: MeasuredError = field(repr=False, compare=False)

    @property
    def variable(self) -> str:
        """The contact size that the factor depends on."""
        return VARIABLES[self.indenter].name

    @property
    def limits(self) -> tuple[Limit, ...]:
        """Every range the correction sets."""
        return (
            Limit(VARIABLES[self.indenter], *self.valid_range),
            Limit(LAYER_NU, *self.nu_range),
            *self.further_limits,
        )
