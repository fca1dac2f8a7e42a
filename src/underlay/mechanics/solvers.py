"""The solvers there are, by name, and the door to the mechanics: `contact_law`.

==================  ===========================================================================================
``Auto``            half-space where a bound says that nothing under the surface matters, else exact
``Exact``           the contact problem solved to a relative error
``Stuck``           the same with a tip on which points stick where they touch
``Asymptotic``      the paper's explicit formulas, orders 0 to 4: contacts smaller than the layer is thick
``HalfSpace``       no layer effect: Hertz, Sneddon, Boussinesq
``Published``       a correction from the literature, by name
==================  ===========================================================================================
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, fields, replace
from difflib import get_close_matches
from typing import Any, ClassVar, TypeAlias

import numpy as np

from underlay._arrays import FloatArray, finite
from underlay.errors import InputError
from underlay.mechanics.asymptotic.law import FORMS, asymptotic_law
from underlay.mechanics.body import Body, Layer
from underlay.mechanics.contact import Contact
from underlay.mechanics.contact_law import ContactLaw
from underlay.mechanics.exact.curve_family import range_numbers
from underlay.mechanics.exact.family_law import table_number, tabulated_law
from underlay.mechanics.exact.law import exact_law
from underlay.mechanics.friction import as_friction
from underlay.mechanics.halfspace import halfspace_law, largest_halfspace_depth
from underlay.mechanics.indenters import FlatPunch, Indenter, PowerLawShape, Sphere
from underlay.mechanics.published import PublishedCorrection, published_law, published_names
from underlay.mechanics.solver import Scaling, Solver
from underlay.mechanics.stuck.law import stuck_law

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
    "solver_named",
    "solver_names",
    "solver_record",
]

# The layer's effect on force, contact radius and stiffness at a given depth. Over contrast: a theorem bounds that
# on the force by about 1, the others move by up to twice as much. Over contrast times varpi over the decay rate,
# where that is small: at most 1.6 for 400 random pairs of isotropic and anisotropic materials, flat punch to
# cone. Both are measured again in tests/test_solvers.py.
_CONTRAST_MARGIN, _SHALLOW_MARGIN = 4.0, 2.0
_LARGEST_SHALLOW = 0.02
# Of rtol, what may be lost by joining layers.
_SHARE_OF_JOINS = 0.2
_RANGES = 4096  # more than there are powers of two


@dataclass(frozen=True)
class _ToTolerance(Solver):
    """What solvers of the contact problem to a tolerance have in common."""

    rtol: float = 1e-6
    scaling: ClassVar[Scaling] = Scaling.POWER_LAW
    judges_range: ClassVar[bool] = False

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
        """Return the same solver at `rtol`."""
        return replace(self, rtol=rtol)

    @property
    def without_slip(self) -> Solver:
        """`Stuck` at the same tolerance."""
        return Stuck(self.rtol)

    def for_differences(self, rtol: float) -> Solver:
        """Return the exact solver, at `rtol` or finer."""
        return Exact(min(self.rtol, rtol))

    def has_table(self, contact: Contact) -> bool:
        """Tables are for power-law tips on an isotropic layer."""
        return _is_rounded_power_law(contact.indenter) and _is_plain_layer(contact)

    def table_number(self, contact: Contact, depth: float) -> int:
        """See `curve_family`."""
        return table_number(contact, depth)

    def tabulated(self, contact: Contact, ratio: float, depth: float) -> ContactLaw | None:
        """See `tabulated_law`."""
        return tabulated_law(contact, ratio, depth, self.rtol)

    def has_batches(self, contact: Contact) -> bool:
        """Batches are for power-law tips and spheres on an isotropic layer."""
        tip = contact.indenter
        return (_is_rounded_power_law(tip) or isinstance(tip, Sphere)) and _is_plain_layer(contact)

    def ranges(self, contact: Contact, depth: FloatArray) -> FloatArray:
        """Both the range that a law is solved for and that of its table."""
        octaves = super().ranges(contact, depth)
        return octaves + _RANGES * range_numbers(contact.varpi(depth)) if self.has_table(contact) else octaves


def _is_rounded_power_law(tip: Indenter) -> bool:
    return isinstance(tip, PowerLawShape) and not isinstance(tip, FlatPunch)


def _is_plain_layer(contact: Contact) -> bool:
    """Whether it is an isotropic layer on its base, without adhesion and friction."""
    isotropic = contact.isotropic is not None and bool(np.isfinite(contact.thickness))
    return isotropic and contact.adhesion is None and not contact.sticks


@dataclass(frozen=True)
class Exact(_ToTolerance):
    """The exact contact problem, solved to a relative error.

    Parameters
    ----------
    rtol : float, default 1e-6
        Relative error allowed in force, contact radius and stiffness, between 1e-12 and 0.5. For fitting, a
        tenth of the relative noise is enough; tighter costs little.
    """

    @property
    def name(self) -> str:
        """``"exact"``."""
        return "exact"

    def build(self, contact: Contact, max_depth: float) -> ContactLaw:
        """Solve; see `exact_law`."""
        return exact_law(contact, max_depth, self.rtol)


@dataclass(frozen=True)
class Stuck(_ToTolerance):
    """The contact problem without slip: points stick where the tip touches them.

    Parameters
    ----------
    rtol : float, default 1e-6
        As for `Exact`.
    """

    @property
    def name(self) -> str:
        """``"stuck"``."""
        return "stuck"

    def build(self, contact: Contact, max_depth: float) -> ContactLaw:
        """Solve; see `stuck_law`."""
        if not max_depth > 0.0:
            # No contact is asked for: any law says that there is no force.
            return replace(halfspace_law(contact), method=self.name, max_depth=0.0, reason="no contact")
        return stuck_law(contact, max_depth, self.rtol)

    def law(self, contact: Contact, max_depth: float) -> ContactLaw:
        """Build the law; a contact with adhesion is refused."""
        if contact.adhesion is not None:
            raise InputError(
                "adhesion beside a tip that sticks is not simulated: leave the adhesion out, or take friction "
                'as "none"'
            )
        return super().law(contact, max_depth)

    def for_differences(self, rtol: float) -> Solver:
        """Return the same at `rtol` or finer."""
        return Stuck(min(self.rtol, rtol))

    def has_table(self, contact: Contact) -> bool:
        """There are no tables."""
        del contact
        return False

    def has_batches(self, contact: Contact) -> bool:
        """There are no batches."""
        del contact
        return False


@dataclass(frozen=True)
class Auto(_ToTolerance):
    """The half-space where a bound says that nothing under the surface matters, else the exact contact problem.

    Parameters
    ----------
    rtol : float, default 1e-6
        As for `Exact`.
    """

    @property
    def name(self) -> str:
        """``"auto"``."""
        return "auto"

    def build(self, contact: Contact, max_depth: float) -> ContactLaw:
        """Build the cheapest law that keeps the tolerance in force, contact radius and stiffness."""
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
        contrast, varpi = contact.kernel.contrast, float(contact.varpi(np.array([max_depth]))[0])
        effect = contrast * _CONTRAST_MARGIN
        shallow = contrast * _SHALLOW_MARGIN * varpi / contact.kernel.decay
        if shallow <= _LARGEST_SHALLOW:
            effect = min(effect, shallow)
        if effect > self.rtol:
            return exact_law(contact, max_depth, self.rtol)
        return replace(
            halfspace_law(contact),
            max_depth=max_depth,
            error_estimate=effect,
            reason=(
                f"a/h = {varpi:.2g}, layer and substrate differ by {contrast:.2g} in compliance: the layer "
                f"changes the contact by at most {effect:.1g}, below rtol = {self.rtol:g}"
            ),
        )


@dataclass(frozen=True)
class Asymptotic(Solver):
    """The paper's asymptotic model: explicit formulas, for contacts smaller than the layer is thick.

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

    def __post_init__(self) -> None:
        if self.form not in FORMS:
            raise InputError(f"unknown form {self.form!r}; known: {', '.join(FORMS)}")
        if self.order not in range(5):
            raise InputError(f"order must be 0, 1, 2, 3 or 4; got {self.order!r}")

    @property
    def name(self) -> str:
        """``"asymptotic"``."""
        return "asymptotic"

    @property
    def label(self) -> str:
        """``"asymptotic:4"``: with its order."""
        return f"asymptotic:{self.order}"

    def build(self, contact: Contact, max_depth: float) -> ContactLaw:
        """See `asymptotic_law`."""
        return asymptotic_law(contact, max_depth, order=self.order, form=self.form)


@dataclass(frozen=True)
class HalfSpace(Solver):
    """No layer effect: the half-space of what the indenter touches."""

    scaling: ClassVar[Scaling] = Scaling.POWER_LAW
    sees_base: ClassVar[bool] = False

    @property
    def name(self) -> str:
        """``"halfspace"``."""
        return "halfspace"

    def build(self, contact: Contact, max_depth: float) -> ContactLaw:
        """Build it to the end of the indenter's shape."""
        del max_depth
        return halfspace_law(contact)


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
        """The name of the correction."""
        return self.correction if isinstance(self.correction, str) else self.correction.name

    def build(self, contact: Contact, max_depth: float) -> ContactLaw:
        """See `published_law`."""
        return published_law(self.correction, contact, max_depth)


@dataclass(frozen=True, eq=False)
class _Own(Solver):
    """An object that builds laws and is no `Solver`: nothing more is known of it."""

    builder: Any

    @property
    def name(self) -> str:
        return type(self.builder).__name__

    def build(self, contact: Contact, max_depth: float) -> ContactLaw:
        law: ContactLaw = self.builder.build(contact, max_depth)
        return law


#: What a ``solver=`` takes: a `Solver`, a name, or any object with ``build(contact, max_depth)``.
AnySolver: TypeAlias = Solver | PublishedCorrection | str | Any

_NAMED: Mapping[str, type[Any]] = {
    "auto": Auto,
    "halfspace": HalfSpace,
    "asymptotic": Asymptotic,
    "exact": Exact,
    "stuck": Stuck,
}


def solver_names() -> tuple[str, ...]:
    """List the names that `as_solver` knows."""
    return (*_NAMED, *published_names())


def as_solver(given: AnySolver) -> Solver:
    """Return the solver that a ``solver=`` stands for.

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
    """Return the solver of a name with its numbers, as a scene file gives them.

    Raises
    ------
    InputError
        If there is no solver of that name, or it has no such number.

    Examples
    --------
    >>> solver_named("exact", rtol=1e-8)
    Exact(rtol=1e-08)
    """
    if name not in solver_names():
        raise _unknown("solver", name, solver_names())
    known = [field.name for field in fields(_NAMED[name])] if name in _NAMED else []
    for key in numbers:
        if key not in known:
            raise InputError(f"the solver {name!r} has no {key}; it has {', '.join(known) or 'no numbers'}")
    solver: Solver = _NAMED[name](**numbers) if name in _NAMED else Published(name)
    return solver


def solver_record(solver: Solver) -> dict[str, Any]:
    """Return ``{"name": ..., numbers}``, from which `solver_named` makes it again.

    Raises
    ------
    InputError
        If it is a solver of one's own, which has no name here.
    """
    if isinstance(solver, Published) and isinstance(solver.correction, str):
        return {"name": solver.name}
    if _NAMED.get(solver.name) is not type(solver):
        raise InputError(f"the solver {solver.name} is not part of underlay")
    return {"name": solver.name, **solver.numbers}


def _unknown(what: str, name: object, known: tuple[str, ...]) -> InputError:
    near = get_close_matches(str(name), known, n=1)
    hint = f" Did you mean {near[0]!r}?" if near else ""
    return InputError(f"no {what} is called {name!r}.{hint} Known: {', '.join(known)}")


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
