"""The available solvers, by name, and the entry point to the mechanics: `contact_law`.

==================  ===========================================================================================
``Auto``            half-space where a bound says that nothing under the surface matters, else exact
``Exact``           the contact problem solved to a relative error
``Stuck``           the same with full friction: points stick where they touch the tip
``Asymptotic``      the paper's explicit formulas, orders 0 to 4: contacts smaller than the layer is thick
``HalfSpace``       no layer effect: Hertz, Sneddon, Boussinesq
``Published``       a correction from the literature, by name
==================  ===========================================================================================
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, fields, is_dataclass, replace
from difflib import get_close_matches
from typing import Any, ClassVar, TypeAlias

from underlay.errors import InputError
from underlay.mechanics.asymptotic.law import FORMS, asymptotic_law
from underlay.mechanics.body import Body, Layer
from underlay.mechanics.contact import Contact
from underlay.mechanics.contact_law import ContactLaw
from underlay.mechanics.discrepancy import as_friction
from underlay.mechanics.exact_solvers import Auto, Exact, Stuck
from underlay.mechanics.halfspace import halfspace_law
from underlay.mechanics.indenters import Indenter
from underlay.mechanics.published import PublishedCorrection, published_law, published_names
from underlay.mechanics.solver import Scaling, Solver
from underlay.plugins import SOLVERS, Plugin, faults, plugins

__all__ = [
    "AnySolver",
    "Asymptotic",
    "Auto",
    "Exact",
    "HalfSpace",
    "Published",
    "Stuck",
    "as_solver",
    "contact_law",
    "plugged_solvers",
    "solver_named",
    "solver_names",
    "solver_record",
]

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
        if self.form not in FORMS:
            raise InputError(f"unknown form {self.form!r}; known: {', '.join(FORMS)}")
        if self.order not in range(5):
            raise InputError(f"order must be 0, 1, 2, 3 or 4; got {self.order!r}")

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
