"""The interface of solvers: what builds a contact law.

To add one, derive a frozen dataclass from `Solver` and implement `build`; its fields are its settings. It can then
be computed, fitted, sampled, mapped and reported wherever a ``solver=`` is taken. The other methods say what
callers may rely on (accuracy, tables, batches, derivatives); the defaults promise nothing.
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


class Scaling(Enum):
    """How the laws of a solver follow from one another when the parameters of a contact change."""

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
        """Build the law for depths up to `max_depth` (m), which is zero for a record without contact.

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
        """Name with whatever tells the solver from others of that name, such as its order."""
        return self.name

    @property
    def numbers(self) -> dict[str, Any]:
        """Its settings by name: the fields, where it is a dataclass."""
        own: object = self
        return {field.name: getattr(self, field.name) for field in fields(own)} if is_dataclass(own) else {}

    @property
    def tolerance(self) -> float:
        """Relative error against the exact contact problem that its laws keep; zero where none is promised."""
        return 0.0

    def with_tolerance(self, rtol: float) -> Solver:
        """The same solver with relative error `rtol`; itself where it has no tolerance."""
        del rtol
        return self

    @property
    def without_slip(self) -> Solver:
        """The solver for the same contact with full friction (a tip on which points stick).

        Raises
        ------
        InputError
            If there is none.
        """
        raise InputError(
            f"the solver {self.name} has no law for a tip that sticks (friction): take auto, exact or stuck"
        )

    def for_differences(self, rtol: float) -> Solver:
        """A solver for finite differences of laws: always by one method, smooth in the parameters within `rtol`."""
        del rtol
        return self

    # --- many contacts -----------------------------------------------------------------------------------

    def has_table(self, contact: Contact) -> bool:
        """Whether laws of contacts that differ from this one in one ratio can be read off a table."""
        del contact
        return False

    def table_number(self, contact: Contact, depth: float) -> int:
        """Number of the range of depths whose table reaches `depth` (m)."""
        del contact, depth
        return 0

    def tabulated(
        self, contact: Contact, family: Family | None, ratio: float, depth: float, *, alone: bool = False
    ) -> ContactLaw | None:
        """Law read off a table, for `depth` (m) and up to the end of the table's range; None without a table.

        Parameters
        ----------
        contact : Contact
            Gives tip, thickness and modulus of the layer.
        family : Family or None
            The bodies, which differ in one ratio; None for an isotropic layer on a rigid base, a single body.
        ratio : float
            The ratio to use; that of `contact` is ignored.
        depth : float
            Depth (m) that must be reached.
        alone : bool
            Whether no ratio near this one will be needed: the law may then be solved directly, without a table.
        """
        del contact, family, ratio, depth, alone
        return None

    def side_by_side(
        self, contact: Contact, family: Family, ratios: Sequence[float], depth: float
    ) -> Callable[[FloatArray], FloatArray] | None:
        """Function from depths (m) to the forces (N) of several bodies, (bodies, n); None where not available.

        The bodies are those of `family` with the given `ratios`, `depth` (m) the largest. The function takes depths
        (bodies, n), or (1, n) for all.
        """
        del contact, family, ratios, depth
        return None

    def has_slopes(self, contact: Contact) -> bool:
        """Whether laws of contacts like this one give derivatives in the parameters of `Contact.variants`."""
        del contact
        return False

    def has_tip_tables(self, contact: Contact) -> bool:
        """Whether laws of tips that are no power law are read off tables, for bodies that differ in one ratio."""
        del contact
        return False

    def tip_number(self, contact: Contact, depth: float) -> int:
        """Number of the range of depths of `tabulated_tips` that reaches `depth` (m)."""
        del contact, depth
        return 0

    def tabulated_tips(
        self,
        contacts: Sequence[Contact],
        family: Family,
        ratios: Sequence[float] | None,
        depths: Sequence[float],
    ) -> Sequence[ContactLaw | RangeError | None]:
        """Laws of tips that are no power law, each for its depth (m) and to the end of its range.

        Parameters
        ----------
        contacts : sequence of Contact
            Tips of one shape on bodies of one family.
        family : Family
            The bodies, which differ in one ratio.
        ratios : sequence of float or None
            The ratio of each contact; None for a family with a single member.
        depths : sequence of float
            Depths (m) that must be reached.

        Returns
        -------
        sequence of ContactLaw, RangeError or None
            A RangeError (returned, not raised) where no law reaches so deep; None without a table.
        """
        del family, ratios, depths
        return [None] * len(contacts)

    def has_batches(self, contact: Contact) -> bool:
        """Whether many contacts like this one, with other moduli, can be solved at once by `ExactBatch`."""
        del contact
        return False

    def has_surfaces(self, contact: Contact) -> bool:
        """Whether laws of such contacts are smooth in one parameter and costly, so that interpolation pays."""
        del contact
        return False

    def ranges(self, contact: Contact, depth: FloatArray) -> FloatArray:
        """Range numbers (sets,) of depths (m), (sets,): sets in one range can share a law."""
        del contact
        return np.ceil(np.log2(np.maximum(depth, np.finfo(float).tiny)))

    @one_thread()
    def law(self, contact: Contact, max_depth: float) -> ContactLaw:
        """Build and check the law of a contact, with adhesion, friction and modifications as the contact has them.

        Adds a warning where `max_depth` (m) is more than the layer's thickness.

        Raises
        ------
        LawError
            If `build` fails with an error that is not underlay's, or returns something else.
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
