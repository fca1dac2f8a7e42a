"""The available solvers, by name, and the entry point to the mechanics: `contact_law`.

==================  ===========================================================================================
``Auto``            half-space where a bound says that nothing under the surface matters, else exact
``Exact``           the contact problem solved to a relative error
``Stuck``           the same with full friction: points stick where they touch the tip
``Asymptotic``      the paper's explicit formulas, orders 0 to 4: contacts smaller than the layer is thick
``HalfSpace``       no layer effect: Hertz, Sneddon, Boussinesq
``Published``       a correction from the literature, by name
==================  ===========================================================================================

Solvers of the contact problem to a relative error: `Exact`, `Stuck`, and `Auto`, which takes the cheapest.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, fields, is_dataclass, replace
from difflib import get_close_matches
from math import inf
from typing import Any, ClassVar, TypeAlias

import numpy as np

from underlay._arrays import FloatArray, finite
from underlay.errors import InputError, RangeError
from underlay.mechanics.asymptotic.law import asymptotic_law, require_known
from underlay.mechanics.body import Body, Layer
from underlay.mechanics.contact import Contact
from underlay.mechanics.contact_law import ContactLaw
from underlay.mechanics.discrepancy import as_friction
from underlay.mechanics.exact.curve_family import IsotropicPair, range_numbers
from underlay.mechanics.exact.law import exact_law
from underlay.mechanics.exact.table_laws import side_by_side, table_number, tabulated_law, tip_laws, tip_range
from underlay.mechanics.halfspace import halfspace_law, largest_halfspace_depth, layer_effect
from underlay.mechanics.indenters import Indenter, PowerLawShape
from underlay.mechanics.kernel import Family
from underlay.mechanics.published.correction import PublishedCorrection
from underlay.mechanics.published.law import published_law, published_names
from underlay.mechanics.solver import Scaling, Solver
from underlay.mechanics.stuck.law import stuck_law
from underlay.plugins import SOLVERS, Plugin, faults, plugins

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
        """Law read off a table, by `table_laws.tabulated_law`; None without a table."""
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
        """Function from depths to the forces of several bodies, by `table_laws.side_by_side`; or None."""
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
    reason = "no contact: the largest depth is not positive"
    return replace(halfspace_law(contact), method=name, max_depth=0.0, reason=reason)


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
            return _no_contact(contact, "halfspace")
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


#: What a ``solver=`` takes: a `Solver`, a name, or any object with ``build(contact, max_depth)``.
AnySolver: TypeAlias = Solver | PublishedCorrection | str | Any


@dataclass(frozen=True)
class Asymptotic(Solver):
    """The paper's asymptotic model: explicit formulas, for contacts smaller than the layer is thick.

    Equation numbers are those of Argatov and Sabina.

    Parameters
    ----------
    order : int, default 4
        0 to 4: terms kept, up to (a/h)^order.
    form : str, default "auto"
        ``"explicit"`` (5.9), ``"parametric"`` (4.14)/(4.15), ``"compliance"`` (8.4), or ``"auto"``.
    """

    order: int = 4
    form: str = "auto"
    scaling: ClassVar[Scaling] = Scaling.POWER_LAW
    name: ClassVar[str] = "asymptotic"

    def __post_init__(self) -> None:
        require_known(self.order, self.form)

    @property
    def label(self) -> str:
        """Name with the order, ``"asymptotic:4"``."""
        return f"asymptotic:{self.order}"

    def build(self, contact: Contact, max_depth: float) -> ContactLaw:
        """Build the asymptotic law for depths up to `max_depth` (m), by `asymptotic_law`."""
        return asymptotic_law(contact, max_depth, order=self.order, form=self.form)


@dataclass(frozen=True)
class HalfSpace(Solver):
    """No layer effect: a half-space of the material that the indenter touches.

    On a layered body the law's `error_estimate` is a bound on the effect of what is under the surface; a bound
    above 1 only says that this effect may exceed the force.
    """

    scaling: ClassVar[Scaling] = Scaling.POWER_LAW
    sees_base: ClassVar[bool] = False
    name: ClassVar[str] = "halfspace"

    def build(self, contact: Contact, max_depth: float) -> ContactLaw:
        """Build the half-space law, to the end of the indenter's shape; its error is for up to `max_depth` (m)."""
        return halfspace_law(contact, max_depth)


@dataclass(frozen=True)
class Published(Solver):
    """A correction from the literature.

    Parameters
    ----------
    correction : str or PublishedCorrection
        One of the names of `published_corrections`, e.g. ``"garcia2018"``, or a correction of your own.

    Raises
    ------
    InputError
        If there is no correction of that name.
    """

    correction: str | PublishedCorrection
    # Its formulas are in engineering units of length and modulus; a fitted one need not keep more than that.
    scaling: ClassVar[Scaling] = Scaling.DIMENSIONS

    def __post_init__(self) -> None:
        if isinstance(self.correction, str) and self.correction not in published_names():
            raise _unknown("published correction", self.correction, published_names())

    @property
    def name(self) -> str:
        """Name of the correction."""
        return self.correction if isinstance(self.correction, str) else self.correction.name

    def build(self, contact: Contact, max_depth: float) -> ContactLaw:
        """Build the law of the correction for depths up to `max_depth` (m), by `published_law`."""
        return published_law(self.correction, contact, max_depth)


@dataclass(frozen=True, eq=False)
class _Own(Solver):
    """Wrapper for a caller's object with a method ``build``, which is no `Solver`."""

    builder: Any

    @property
    def name(self) -> str:
        return type(self.builder).__name__

    def build(self, contact: Contact, max_depth: float) -> ContactLaw:
        law: ContactLaw = self.builder.build(contact, max_depth)
        return law


_NAMED: Mapping[str, type[Any]] = {
    "auto": Auto,
    "halfspace": HalfSpace,
    "asymptotic": Asymptotic,
    "exact": Exact,
    "stuck": Stuck,
}


def solver_names() -> tuple[str, ...]:
    """Names that `as_solver` accepts, those of plug-in packages included."""
    return (*_NAMED, *published_names(), *_plugged())


def plugged_solvers() -> tuple[Plugin, ...]:
    """Load the solvers of plug-in packages; see `underlay.plugins`."""
    return plugins(SOLVERS, _fault)


def _fault(name: str, thing: object) -> str:
    if name in (*_NAMED, *published_names()):
        return "a solver of underlay has that name"
    if isinstance(thing, PublishedCorrection) or (isinstance(thing, type) and issubclass(thing, Solver)):
        return ""
    return "it is neither a class that derives from Solver nor a PublishedCorrection"


def _plugged() -> dict[str, Any]:
    """Solver classes and corrections of plug-in packages that passed the checks, by name."""
    return {entry.name: entry.thing for entry in plugged_solvers() if not entry.fault}


def as_solver(given: AnySolver) -> Solver:
    """Return the `Solver` for an argument ``solver=``: a name, a solver, a correction, or an object with ``build``.

    Raises
    ------
    InputError
        If it is an unknown name, or has no ``build``.

    Examples
    --------
    >>> as_solver("exact"), as_solver("asymptotic:2"), as_solver("garcia2018")
    (Exact(rtol=1e-06), Asymptotic(order=2, form='auto'), Published(correction='garcia2018'))
    """
    if isinstance(given, str):
        name, _, order = given.partition(":")
        if order and (name != "asymptotic" or order not in {"0", "1", "2", "3", "4"}):
            raise InputError(
                f"unknown solver {given!r}: an order 0 to 4 goes with 'asymptotic', as in 'asymptotic:2'"
            )
        return solver_named(name, **({"order": int(order)} if order else {}))
    if isinstance(given, PublishedCorrection):
        return Published(given)
    if isinstance(given, Solver):
        try:
            hash(given)
        except TypeError as error:
            raise InputError(
                f"the solver {given.name} must be hashable, so that laws can be kept by it: make it a frozen "
                "dataclass"
            ) from error
        return given
    if isinstance(given, type) or not callable(getattr(given, "build", None)):
        raise InputError(
            "a solver is a name, one of Auto, Exact, Asymptotic, HalfSpace and Published, or an object "
            f"with a method build; got {given!r:.80}"
        )
    return _Own(given)


def solver_named(name: str, **numbers: Any) -> Solver:
    """Return the solver of a given name with its settings (``rtol``, ``order``), as a scene file has them.

    Raises
    ------
    InputError
        If there is no solver of that name, or it has no such setting.

    Examples
    --------
    >>> solver_named("exact", rtol=1e-8)
    Exact(rtol=1e-08)
    """
    own = name in _NAMED or name in published_names()  # then no other package is looked into
    if not own and name not in _plugged():
        raise _unknown("solver", name, solver_names(), faults(plugged_solvers()))
    kind: Any = _NAMED.get(name) if own else _plugged()[name]
    is_class = isinstance(kind, type)
    known = [field.name for field in fields(kind)] if is_class and is_dataclass(kind) else []
    for key in numbers:
        if key not in known:
            raise InputError(f"the solver {name!r} has no {key}; it has {', '.join(known) or 'no numbers'}")
    solver: Solver = kind(**numbers) if is_class else Published(name if own else kind)
    return solver


def solver_record(solver: Solver) -> dict[str, Any]:
    """Return ``{"name": ..., settings}``, the arguments from which `solver_named` makes it again.

    Raises
    ------
    InputError
        If it is a caller's own solver, which has no registered name.
    """
    if isinstance(solver, Published) and isinstance(solver.correction, str):
        return {"name": solver.name}
    if _NAMED.get(solver.name) is type(solver):
        return {"name": solver.name, **solver.numbers}
    for name, kind in _plugged().items():
        if kind is type(solver):
            return {"name": name, **solver.numbers}
        if isinstance(solver, Published) and kind is solver.correction:
            return {"name": name}
    raise InputError(f"the solver {solver.name} is not part of underlay, nor a plug-in of its own name")


def _unknown(what: str, name: object, known: tuple[str, ...], more: str = "") -> InputError:
    near = get_close_matches(str(name), known, n=1)
    hint = f" Did you mean {near[0]!r}?" if near else ""
    return InputError(f"no {what} is called {name!r}.{hint} Known: {', '.join(known)}{more}")


def contact_law(
    indenter: Indenter,
    layer: Layer,
    substrate: Body | None = None,
    *,
    max_depth: float,
    solver: AnySolver = "auto",
    friction: str = "none",
) -> ContactLaw:
    """Build the law of an indenter on a layer on a substrate.

    Parameters
    ----------
    indenter : Indenter
        Its shape.
    layer : Layer
        Material and thickness.
    substrate : material, RIGID, Stack or None
        What the layer stands on; None for a half-space of the layer.
    max_depth : float
        Largest indentation depth (m) that will be asked.
    solver : Solver, str or object, default "auto"
        ``Auto(rtol)``, ``Exact(rtol)``, ``Stuck(rtol)``, ``Asymptotic(order, form)``, ``HalfSpace()``,
        ``Published(name)``; a name (``"auto"``, ``"exact"``, ``"stuck"``, ``"asymptotic"``, ``"halfspace"``, or
        that of a published correction) as shorthand; or an object of your own with ``build(contact, max_depth)``.
    friction : {"none", "stuck"}
        Whether points slide freely along the tip, or stick where they touch it.

    Returns
    -------
    ContactLaw
        With `method`, `reason`, `error_estimate` and `max_depth`.

    Raises
    ------
    RangeError
        If the law cannot reach `max_depth`.
    InputError
        If the solver is unknown, or has no law for this contact.
    LawError
        If a solver of your own does not build a law.
    """
    contact = replace(Contact.of(indenter, layer, substrate), friction=as_friction(friction))
    return as_solver(solver).law(contact, max_depth)
