"""What builds a contact law: the seam at which a solver is plugged in.

To add one, derive a frozen dataclass from `Solver` and implement `build`; its fields are what can be asked of
it. It can then be computed, fitted, sampled, mapped and reported wherever a ``solver=`` is taken. The other
methods say what callers may rely on (accuracy, tables, batches, derivatives); the defaults promise nothing.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Sequence
from dataclasses import fields, is_dataclass, replace
from enum import Enum
from typing import Any, ClassVar

import numpy as np

from underlay._arrays import FloatArray, finite
from underlay._threads import one_thread
from underlay.errors import InputError, LawError, RangeError, UnderlayError
from underlay.mechanics.contact import Contact
from underlay.mechanics.contact_law import ContactLaw, DeeperThanLayer
from underlay.mechanics.kernel import Family

__all__ = ["Scaling", "Solver"]


class Scaling(Enum):
    """How the laws of a solver follow from one another when the numbers of a contact change."""

    #: Nothing is known: a law has constants of its own, e.g. an energy of adhesion.
    NONE = "none"
    #: Lengths and moduli are the only units: P = theta h^2 F(w/h; ratios of lengths and of moduli).
    DIMENSIONS = "dimensions"
    #: For a power-law shape also P = theta A h^(lambda+1) F(w/(A h^lambda); ratios of moduli): what every
    #: solution of the contact problem of linear elasticity keeps.
    POWER_LAW = "power law"


class Solver(ABC):
    """Builds the contact law of a contact.

    Examples
    --------
    A law twice as stiff as Hertz's, usable wherever a ``solver=`` is taken:

    >>> from dataclasses import dataclass, replace
    >>> import underlay as ul
    >>> @dataclass(frozen=True)
    ... class TwiceHertz(ul.Solver):
    ...     def build(self, contact, max_depth):
    ...         stiffer = replace(contact, theta=2.0 * contact.theta)
    ...         return ul.HalfSpace().build(stiffer, max_depth)
    >>> tip, gel = ul.Paraboloid(1e-3), ul.Layer(ul.Isotropic(1e4, 0.5))
    >>> law, hertz = (ul.contact_law(tip, gel, max_depth=1e-4, solver=s) for s in (TwiceHertz(), "halfspace"))
    >>> float(law.force(1e-4) / hertz.force(1e-4))
    2.0
    """

    #: See `Scaling`; what is claimed here saves laws, and is not checked.
    scaling: ClassVar[Scaling] = Scaling.NONE
    #: Whether its laws depend on what is under the surface.
    sees_base: ClassVar[bool] = True
    #: Whether what a law says of itself (error, warnings) depends on the depth it was built for.
    judges_range: ClassVar[bool] = True

    @abstractmethod
    def build(self, contact: Contact, max_depth: float) -> ContactLaw:
        """Build the law for depths up to `max_depth` (m), which is zero where no contact is asked for.

        Raises
        ------
        RangeError
            If the law does not reach so deep; with the depth that it reaches.
        InputError
            If there is no law for this contact.
        """

    @property
    def name(self) -> str:
        """Name of the solver in tables and messages."""
        return type(self).__name__

    @property
    def label(self) -> str:
        """Name of the solver with what tells it from others of that name."""
        return self.name

    @property
    def numbers(self) -> dict[str, Any]:
        """What was asked of it, by name: its fields, where it is a dataclass."""
        own: object = self
        return {field.name: getattr(self, field.name) for field in fields(own)} if is_dataclass(own) else {}

    @property
    def tolerance(self) -> float:
        """Relative error against the exact contact problem that its laws keep; zero: no such promise."""
        return 0.0

    def with_tolerance(self, rtol: float) -> Solver:
        """Return the same solver at another tolerance, where it has one."""
        del rtol
        return self

    @property
    def without_slip(self) -> Solver:
        """The solver of the same contact with a tip that sticks.

        Raises
        ------
        InputError
            If there is none.
        """
        raise InputError(
            f"the solver {self.name} has no law for a tip that sticks (friction): take auto, exact or stuck"
        )

    def for_differences(self, rtol: float) -> Solver:
        """Return a solver whose laws may be subtracted: of one kind, and smooth within `rtol`."""
        del rtol
        return self

    # --- many contacts -----------------------------------------------------------------------------------

    def has_table(self, contact: Contact) -> bool:
        """Whether laws of contacts that differ from this one in one ratio are read off a table."""
        del contact
        return False

    def table_number(self, contact: Contact, depth: float) -> int:
        """Number of the range of tables that reaches `depth` (m)."""
        del contact, depth
        return 0

    def tabulated(
        self, contact: Contact, family: Family | None, ratio: float, depth: float, *, alone: bool = False
    ) -> ContactLaw | None:
        """Law read off a table, for `depth` (m) and to the end of the table's range; None: there is none.

        `family` are the bodies, of which `ratio` tells which stands in place of the contact's own; None where
        there is one alone, an isotropic layer on a rigid base. Where no ratio near this one will be asked for,
        the law may be solved for `alone`.
        """
        del contact, family, ratio, depth, alone
        return None

    def side_by_side(
        self, contact: Contact, family: Family, ratios: Sequence[float], depth: float
    ) -> Callable[[FloatArray], FloatArray] | None:
        """Forces (N) of several bodies at depths (m) up to `depth`, (bodies, n) or (1, n) for all; None: none."""
        del contact, family, ratios, depth
        return None

    def has_slopes(self, contact: Contact) -> bool:
        """Whether laws of contacts like this one say their derivatives towards the bodies `Contact.beside`."""
        del contact
        return False

    def has_tip_tables(self, contact: Contact) -> bool:
        """Whether laws of tips that are no power law are read off tables, on bodies that differ in one ratio."""
        del contact
        return False

    def tip_number(self, contact: Contact, depth: float) -> int:
        """Number of the range of such laws that reaches `depth` (m)."""
        del contact, depth
        return 0

    def tabulated_tips(
        self,
        contacts: Sequence[Contact],
        family: Family,
        ratios: Sequence[float] | None,
        depths: Sequence[float],
    ) -> Sequence[ContactLaw | RangeError | None]:
        """Laws of such contacts, each for its depth (m) and to the end of its range.

        Or why there is no law so deep; None: there is no table. `ratios` tells which body stands in place of each
        contact's own; None where there is one alone.
        """
        del family, ratios, depths
        return [None] * len(contacts)

    def has_batches(self, contact: Contact) -> bool:
        """Whether many contacts like this one, with other moduli, may be solved by `ExactBatch` at once."""
        del contact
        return False

    def has_surfaces(self, contact: Contact) -> bool:
        """Whether laws of contacts that differ from this one in one number are smooth in it, and dear to solve."""
        del contact
        return False

    def ranges(self, contact: Contact, depth: FloatArray) -> FloatArray:
        """Numbers of the ranges that depths (m), (sets,), belong to: those of one range share a law."""
        del contact
        return np.ceil(np.log2(np.maximum(depth, np.finfo(float).tiny)))

    @one_thread()
    def law(self, contact: Contact, max_depth: float) -> ContactLaw:
        """Build a law and see that it is one, with a warning where it is to go deeper than the layer is thick.

        Raises
        ------
        LawError
            If `build` fails with an error that is not underlay's, or hands back something else.
        UnderlayError
            As `build` does.
        """
        deepest = finite(max_depth, "max_depth", "m")
        if contact.on_law:
            *inner, outer = contact.on_law
            below = replace(contact, on_law=tuple(inner))
            return outer.law(lambda depth: self.law(below, depth), deepest)
        solver = self.without_slip if contact.sticks else self
        if contact.adhesion is not None:
            return contact.adhesion.law(contact, deepest, solver)
        try:
            law = solver.build(contact, deepest)
        except UnderlayError:
            raise
        except Exception as error:
            raise LawError(
                f"the solver {self.name} failed for depths up to {deepest:.6g} m: "
                f"{type(error).__name__}: {error}"
            ) from error
        if not isinstance(law, ContactLaw):
            raise LawError(
                f"the solver {self.name} must build a ContactLaw; for depths up to {deepest:.6g} m it gave "
                f"{law!r:.80}"
            )
        doubt = DeeperThanLayer.of(deepest, contact.thickness)
        return law if doubt is None else law.warned(doubt)
