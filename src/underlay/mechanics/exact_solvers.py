"""Solvers of the contact problem to a relative error: `Exact`, `Stuck`, and `Auto`, which takes the cheapest."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from math import inf
from typing import ClassVar

import numpy as np

from underlay._arrays import FloatArray, finite
from underlay.errors import InputError, RangeError
from underlay.mechanics.contact import Contact
from underlay.mechanics.contact_law import ContactLaw
from underlay.mechanics.exact.curve_family import IsotropicPair, range_numbers
from underlay.mechanics.exact.family_law import side_by_side, table_number, tabulated_law
from underlay.mechanics.exact.law import exact_law
from underlay.mechanics.exact.tip_law import tip_laws, tip_range
from underlay.mechanics.halfspace import halfspace_law, largest_halfspace_depth, layer_effect
from underlay.mechanics.indenters import PowerLawShape
from underlay.mechanics.kernel import Family
from underlay.mechanics.solver import Scaling, Solver
from underlay.mechanics.stuck.law import stuck_law

__all__ = ["Auto", "Exact", "Stuck"]

# Of rtol, what may be lost by joining layers.
_SHARE_OF_JOINS = 0.2
_RANGES = 4096  # more than there are powers of two


@dataclass(frozen=True)
class _ToTolerance(Solver):
    """Base of the solvers that solve the contact problem to a relative error `rtol`."""

    rtol: float = 1e-6
    scaling: ClassVar[Scaling] = Scaling.POWER_LAW
    judges_range: ClassVar[bool] = False
    #: Whether points slide along the tip where the contact does not say that they stick.
    slides: ClassVar[bool] = True

    def __post_init__(self) -> None:
        rtol = finite(self.rtol, "rtol", "relative error")
        if not (1e-12 <= rtol <= 0.5):
            raise InputError(f"rtol must be between 1e-12 and 0.5; got {self.rtol!r}")
        object.__setattr__(self, "rtol", rtol)

    @property
    def tolerance(self) -> float:
        """Relative error of force, contact radius and stiffness."""
        return self.rtol

    def with_tolerance(self, rtol: float) -> Solver:
        """Return the same solver with relative error `rtol`."""
        return replace(self, rtol=rtol)

    @property
    def without_slip(self) -> Solver:
        """The solver `Stuck` at the same tolerance."""
        return Stuck(self.rtol)

    def for_differences(self, rtol: float) -> Solver:
        """The solver `Exact`, at `rtol` or finer."""
        return Exact(min(self.rtol, rtol))

    def _is_plain(self, contact: Contact, *, isotropic: bool = False) -> bool:
        """Whether the contact is frictionless, not adhesive, and on a layer (an isotropic one if `isotropic`)."""
        slides = self.slides and not contact.sticks and contact.adhesion is None
        return (
            slides and bool(np.isfinite(contact.thickness)) and not (isotropic and contact.isotropic is None)
        )

    def has_table(self, contact: Contact) -> bool:
        """Whether there are tables: for frictionless contacts of power-law tips on layers, without adhesion."""
        return isinstance(contact.indenter, PowerLawShape) and self._is_plain(contact)

    def table_number(self, contact: Contact, depth: float) -> int:
        """Number of the range of depths whose table reaches `depth` (m)."""
        return table_number(contact, depth)

    def tabulated(
        self, contact: Contact, family: Family | None, ratio: float, depth: float, *, alone: bool = False
    ) -> ContactLaw | None:
        """Law read off a table, by `family_law.tabulated_law`; None without a table."""
        return tabulated_law(contact, family, ratio, depth, self.rtol, alone=alone)

    def kept_law(self, contact: Contact, depth: float) -> ContactLaw | None:
        """Cached law for depths up to `depth` (m) or more, solved on first use; None where none is cached.

        Laws are cached for power-law tips on isotropic layers.
        """
        body = contact.isotropic
        if body is None or not self.has_table(contact):
            return None
        if body.base is None:
            return self.tabulated(contact, None, inf, depth, alone=True)
        family, ratio = IsotropicPair(body.layer.nu, body.base.nu), body.base.E / body.layer.E
        return self.tabulated(contact, family, ratio, depth, alone=True)

    def side_by_side(
        self, contact: Contact, family: Family, ratios: Sequence[float], depth: float
    ) -> Callable[[FloatArray], FloatArray] | None:
        """Function from depths to the forces of several bodies, by `family_law.side_by_side`; or None."""
        return side_by_side(contact, family, ratios, depth, self.rtol)

    def has_slopes(self, contact: Contact) -> bool:
        """Whether laws give derivatives: for frictionless contacts of all tips but the flat punch on layers."""
        return not contact.indenter.has_edge and self._is_plain(contact)

    def has_tip_tables(self, contact: Contact) -> bool:
        """Whether there are tables for the tip: one of finite size, such as a sphere, on an isotropic layer."""
        tip = contact.indenter
        return np.isfinite(tip.max_radius) and not tip.has_edge and self._is_plain(contact, isotropic=True)

    def tip_number(self, contact: Contact, depth: float) -> int:
        """Number of the range of depths of `tip_laws` that reaches `depth` (m)."""
        return tip_range(contact, depth)

    def tabulated_tips(
        self,
        contacts: Sequence[Contact],
        family: Family,
        ratios: Sequence[float] | None,
        depths: Sequence[float],
    ) -> Sequence[ContactLaw | RangeError | None]:
        """Laws of tips that are no power law, read off tables by `tip_laws`."""
        return tip_laws(contacts, family, ratios, depths, self.rtol)

    def has_batches(self, contact: Contact) -> bool:
        """Whether `ExactBatch` can solve such contacts: for smooth tips on an isotropic layer."""
        return contact.indenter.smooth and self._is_plain(contact, isotropic=True)

    def has_surfaces(self, contact: Contact) -> bool:
        """Whether laws are smooth in one parameter and costly to solve.

        True for smooth tips with full friction, and for smooth tips of finite size on an isotropic layer.
        """
        tip = contact.indenter
        if contact.sticks or not self.slides:
            return tip.smooth and bool(np.isfinite(contact.thickness))
        return tip.smooth and bool(np.isfinite(tip.max_radius)) and self._is_plain(contact, isotropic=True)

    def ranges(self, contact: Contact, depth: FloatArray) -> FloatArray:
        """Range numbers (sets,) of depths (m): combine the range a law is solved for with that of its table."""
        octaves = super().ranges(contact, depth)
        return octaves + _RANGES * range_numbers(contact.varpi(depth)) if self.has_table(contact) else octaves


def _no_contact(contact: Contact, name: str) -> ContactLaw:
    """Law of a record that never touches: the force is zero."""
    return replace(halfspace_law(contact), method=name, max_depth=0.0, reason="no contact")


@dataclass(frozen=True)
class Exact(_ToTolerance):
    """The exact contact problem, solved to a relative error.

    Parameters
    ----------
    rtol : float, default 1e-6
        Relative error allowed in force, contact radius and stiffness, between 1e-12 and 0.5. For fitting, a
        tenth of the relative noise is enough; tighter costs little.
    """

    name: ClassVar[str] = "exact"

    def build(self, contact: Contact, max_depth: float) -> ContactLaw:
        """Solve the contact problem for depths up to `max_depth` (m), by `exact_law`."""
        if not max_depth > 0.0:
            return _no_contact(contact, self.name)
        return exact_law(contact, max_depth, self.rtol)


@dataclass(frozen=True)
class Stuck(_ToTolerance):
    """The contact problem with full friction: points of the surface stick where the tip touches them.

    Parameters
    ----------
    rtol : float, default 1e-6
        As for `Exact`.
    """

    slides: ClassVar[bool] = False
    name: ClassVar[str] = "stuck"

    def build(self, contact: Contact, max_depth: float) -> ContactLaw:
        """Solve the contact problem with full friction for depths up to `max_depth` (m), by `stuck_law`."""
        if not max_depth > 0.0:
            return _no_contact(contact, self.name)
        return stuck_law(contact, max_depth, self.rtol)

    def law(self, contact: Contact, max_depth: float) -> ContactLaw:
        """Build the law; raises InputError for a contact with adhesion."""
        if contact.adhesion is not None:
            raise InputError(
                "adhesion beside a tip that sticks is not simulated: leave the adhesion out, or take friction "
                'as "none"'
            )
        return super().law(contact, max_depth)

    def for_differences(self, rtol: float) -> Solver:
        """The same solver, at `rtol` or finer."""
        return Stuck(min(self.rtol, rtol))


@dataclass(frozen=True)
class Auto(_ToTolerance):
    """The half-space where a bound says that nothing under the surface matters, else the exact contact problem.

    Parameters
    ----------
    rtol : float, default 1e-6
        As for `Exact`.
    """

    name: ClassVar[str] = "auto"

    def build(self, contact: Contact, max_depth: float) -> ContactLaw:
        """Build the cheapest law with relative error `rtol` in force, contact radius and stiffness."""
        if not contact.layered:
            return halfspace_law(contact)
        if not max_depth > 0.0:
            reason = "no contact: the largest depth is not positive"
            return replace(halfspace_law(contact), max_depth=0.0, reason=reason)
        if max_depth > largest_halfspace_depth(contact.indenter):
            return exact_law(contact, max_depth, self.rtol)
        simpler, joined = contact.simplified(max_depth, _SHARE_OF_JOINS * self.rtol)
        if joined:
            law = replace(self, rtol=(1.0 - _SHARE_OF_JOINS) * self.rtol).build(simpler, max_depth)
            error = law.error_estimate + _SHARE_OF_JOINS * self.rtol
            return replace(law, error_estimate=error, reason=f"{law.reason}; taken together: {joined}")
        effect = layer_effect(contact, max_depth)
        if effect > self.rtol:
            return exact_law(contact, max_depth, self.rtol)
        return replace(
            halfspace_law(contact),
            max_depth=max_depth,
            error_estimate=effect,
            reason=(
                f"a/h = {float(contact.varpi(np.array([max_depth]))[0]):.2g}, layer and substrate differ by "
                f"{contact.kernel.contrast:.2g} in compliance: the layer changes the contact by at most "
                f"{effect:.1g}, below rtol = {self.rtol:g}"
            ),
        )
