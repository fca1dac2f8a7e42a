"""The published corrections by name, and the contact law of one: the half-space force times its factor.

The list of corrections is here; `fitting_correction` picks the one with a given name that is made for the tip, and
`published_law` builds its law.
"""

from __future__ import annotations

import warnings
from collections.abc import Mapping
from dataclasses import dataclass
from difflib import get_close_matches
from functools import cache
from importlib.resources import files
from typing import Any, ClassVar

import numpy as np

from underlay._arrays import FloatArray, positive
from underlay._door import parse_toml
from underlay.errors import InputError, RangeError, UnderlayWarning
from underlay.mechanics.contact import Contact
from underlay.mechanics.contact_law import ContactLaw
from underlay.mechanics.halfspace import halfspace_law, largest_halfspace_depth
from underlay.mechanics.indenters import Indenter
from underlay.mechanics.published.correction import (
    DEPTH_OVER_RADIUS,
    ELASTIC,
    KINDS,
    QUANTITIES,
    Factor,
    LayerContact,
    Limit,
    MeasuredError,
    OutOfRange,
    PublishedCorrection,
    kind_of,
    tip_of,
)
from underlay.mechanics.published.formulas import formula_of

# Where a formula is watched for a force that stops growing. The factors are smooth in the contact size.
_WATCHED_DEPTHS = 200
# The paraboloid that stands for a true sphere has a contact as wide as the sphere at d = R, and wider below.
_WITHIN_RADIUS = Limit(DEPTH_OVER_RADIUS, 0.0, 1.0)


@cache
def published_corrections() -> tuple[PublishedCorrection, ...]:
    """Every published correction the library knows, with its source, range and assumptions.

    They are read from ``corrections.toml`` when first asked for.

    Examples
    --------
    >>> [c.indenter for c in published_corrections() if c.name == "garcia2018"]
    ['sphere', 'cone', 'flat punch']
    """
    text = files(__package__).joinpath("corrections.toml").read_text(encoding="utf-8")
    return tuple(_recorded(entry) for entry in parse_toml(text)["correction"])


def published_names() -> tuple[str, ...]:
    """Names of the published corrections, without repetition."""
    return tuple(dict.fromkeys(correction.name for correction in published_corrections()))


def _recorded(entry: Mapping[str, Any]) -> PublishedCorrection:
    """Correction of one entry, whose keys are the fields of the record."""
    limits = entry.get("further_limits", {})
    measured = tuple(QUANTITIES[name] for name in entry["measured_over"])
    return PublishedCorrection(
        **{name: entry[name] for name in ("name", "indenter", "substrate", "equation", "source", "doi")},
        valid_range=tuple(entry["valid_range"]),
        range_basis=entry["range_basis"],
        nu_range=tuple(entry["nu_range"]),
        assumptions=tuple(entry["assumptions"]),
        further_limits=tuple(Limit(QUANTITIES[name], *ends) for name, ends in limits.items()),
        factor=formula_of(entry),
        measured_error=MeasuredError.from_table(measured, entry["measured_error"]),
    )


def fitting_correction(name: str | PublishedCorrection, indenter: Indenter) -> PublishedCorrection:
    """Find the correction called `name` for this kind of indenter, or check a `PublishedCorrection`.

    Raises
    ------
    InputError
        If there is no such name, or it holds for other indenters.
    """
    known = (name,) if isinstance(name, PublishedCorrection) else published_corrections()
    name = name.name if isinstance(name, PublishedCorrection) else name
    named = {c.indenter: c for c in known if c.name == name}
    if not named:
        near = get_close_matches(name, published_names(), n=1)
        hint = f" Did you mean {near[0]!r}?" if near else ""
        raise InputError(
            f"no published correction is called {name!r}.{hint} Known: {', '.join(published_names())}"
        )
    kind = kind_of(indenter)
    if kind not in named:
        shapes = " or ".join(shape.__name__ for needed in named for shape in KINDS[needed])
        raise InputError(
            f"{name} needs a {' or a '.join(named)} ({shapes}); got {indenter!r}. "
            'the solver "exact" takes every shape'
        )
    return named[kind]


def is_made_for(name: str, contact: Contact) -> bool:
    """Whether the correction called `name` is for this kind of indenter and base, whatever their numbers."""
    try:
        _layer_contact(fitting_correction(name, contact.indenter), contact)
    except InputError:
        return False
    return True


@dataclass(frozen=True, kw_only=True)
class PublishedLaw(ContactLaw):
    """Contact law P(d) of a published correction; dP/dd is the exact derivative of the formula.

    The contact radius is that of a half-space at the same depth: the sources correct the force alone.

    Parameters
    ----------
    correction : PublishedCorrection
        The formula, its source and its ranges.
    contact : LayerContact
        The test it is applied to.
    factor : Factor
        P over the half-space force, for this test.
    warnings : tuple of OutOfRange
        Quantities of this test outside the correction's ranges; empty when all are inside.
    """

    correction: PublishedCorrection
    contact: LayerContact
    factor: Factor
    warnings: tuple[OutOfRange, ...] = ()

    _beyond: ClassVar[str] = "the law was asked for up to there; ask for less depth, or build it for more"

    def _force(self, depth: FloatArray) -> FloatArray:
        return self.contact.halfspace.force(depth) * self.factor.value(self.contact.variable(depth))

    def _contact_radius(self, depth: FloatArray) -> FloatArray:
        return self.contact.halfspace.contact_radius(depth)

    def _stiffness(self, depth: FloatArray) -> FloatArray:
        """d(P_halfspace f(u))/dd, with f the factor and u ~ d^q the contact size."""
        halfspace, u = self.contact.halfspace, self.contact.variable(depth)
        growth = self.contact.exponent * u / depth
        return halfspace.stiffness(depth) * self.factor.value(u) + halfspace.force(
            depth
        ) * growth * self.factor.slope(u)


def published_law(name: str | PublishedCorrection, contact: Contact, max_depth: float) -> PublishedLaw:
    """Build the contact law of a published correction.

    Parameters
    ----------
    name : str or PublishedCorrection
        One of the names of `published_corrections`, e.g. ``"garcia2018"``, or a correction of your own.
    contact : Contact
        A paraboloid, sphere, cone or flat punch on an isotropic layer of finite thickness, on a base as the
        correction needs. A true sphere is taken as the paraboloid of its radius, as the sources do; what
        that costs is added to the error estimate.
    max_depth : float
        Largest depth (m) of the test; the ranges and the error estimate are judged there.

    Returns
    -------
    PublishedLaw
        Its `error_estimate` is measured against the exact contact problem with a bonded layer (inf where
        it was not measured).

    Raises
    ------
    InputError
        If the name is unknown, or the indenter, layer or substrate are not those the correction is for.
    RangeError
        If the formula's force stops growing before `max_depth`.

    Warns
    -----
    UnderlayWarning
        Once, if the test leaves a range of the correction. The law answers all the same.

    Examples
    --------
    >>> from underlay.mechanics.indenters import Paraboloid
    >>> from underlay.mechanics.body import Layer, RIGID
    >>> from underlay.mechanics.materials import Isotropic
    >>> gel = Layer(Isotropic(E=3e3, nu=0.5), thickness=10e-6)
    >>> law = published_law("garcia2018", Contact.of(Paraboloid(5e-6), gel, RIGID), max_depth=1e-6)
    >>> round(float(law.force(1e-6) / law.contact.halfspace.force(1e-6)), 3)
    1.347
    """
    correction = fitting_correction(name, contact.indenter)
    test = _layer_contact(correction, contact)
    deepest = positive(max_depth, "max_depth", "m")
    limits = correction.limits
    if test.indenter is not contact.indenter and _WITHIN_RADIUS not in limits:
        limits = (*limits, _WITHIN_RADIUS)
    out_of_range = tuple(broken for limit in limits if (broken := limit.broken_by(test, deepest)) is not None)
    error = correction.measured_error.up_to(test, deepest) + _sphere_excess(contact, test, deepest)
    law = PublishedLaw(
        method=correction.name,
        reason=f"asked for by name: {correction.source} ({correction.indenter}; base {correction.substrate})",
        max_depth=deepest,
        error_estimate=error,
        correction=correction,
        contact=test,
        factor=correction.factor(test),
        warnings=out_of_range,
    )
    _require_growth(law)
    if out_of_range:
        warnings.warn(
            f"{correction.name} is used outside its range ({correction.range_basis}): "
            + "; ".join(str(broken) for broken in out_of_range),
            UnderlayWarning,
            stacklevel=2,
        )
    return law


def _layer_contact(correction: PublishedCorrection, contact: Contact) -> LayerContact:
    name = correction.name
    if not np.isfinite(contact.thickness):
        raise InputError(
            f"{name} needs a layer of finite thickness on a substrate; the law without one is the solver "
            '"halfspace"'
        )
    body, elastic = contact.isotropic, correction.substrate == ELASTIC
    if body is None or (body.base is not None) != elastic:
        needed = "an isotropic elastic substrate" if elastic else "a rigid substrate"
        others = '"garcia2018"' if elastic else '"clifford2009" or "hay2011"'
        raise InputError(
            f"{name} needs an isotropic layer on {needed}; got {contact.kernel.description}. "
            f"For another base take, e.g., {others}; the "
            'solver "exact" takes every material and base'
        )
    return LayerContact(
        indenter=tip_of(contact.indenter), thickness=contact.thickness, layer=body.layer, base=body.base
    )


def _sphere_excess(contact: Contact, test: LayerContact, depth: float) -> float:
    """Relative error of the force, on a half-space at `depth` (m), of taking a true sphere for a paraboloid."""
    if test.indenter is contact.indenter:
        return 0.0
    if depth > largest_halfspace_depth(contact.indenter):
        return np.inf
    true_sphere = halfspace_law(contact)
    return abs(float(test.halfspace.force(depth) / true_sphere.force(depth)) - 1.0)


def _require_growth(law: PublishedLaw) -> None:
    depth = law.max_depth * (np.arange(1, _WATCHED_DEPTHS + 1) / _WATCHED_DEPTHS) ** 2
    growing = law.stiffness(depth) > 0.0
    if growing.all():
        return
    first = int(np.argmin(growing))
    if first == 0:
        raise RangeError(
            f"{law.method} gives no growing force at all here ({law.correction.variable} is "
            f'{law.contact.size_at(law.max_depth):.4g} at the largest depth); take the solver "exact"',
            max_depth=0.0,
        )
    last_good = float(depth[first - 1])
    raise RangeError(
        f"the force of {law.method} stops growing before a depth of {depth[first]:.6g} m, which no contact "
        f'does; ask for it up to {last_good:.6g} m at most, or take the solver "exact"',
        max_depth=last_good,
    )
