"""Effects left out by frictionless linear elasticity: friction, large strains, and a law with both added.

What large strains add is one function (`finite_strain_excess`) fitted to independent finite elements (a true
sphere on a neo-Hookean layer, mu/2 (I1bar - 3) + K/2 (J - 1)^2, no friction, bonded to a rigid base). Another
strain energy gives another force (at nu = 0.3, w = 0.1 R and h = R 4.5 % in place of 5.4 %; at w = 0.5 R 19 %
in place of 32 %): it is not a correction to be trusted, but an error of which the shape is known, and the size
within about a half. The leading error is of order a/R, the square root of w/R, with w the depth, a the contact
radius, h the thickness and R the sphere's radius.

Friction is a share of what full friction adds (`as_friction` has the allowed values). The two effects do not simply
add: what friction adds goes as the square of how far points would slide, and in large strains they would slide
further (`friction_in_large_strains`). `DiscrepantLaw` is a law with a share of full friction, and large strains
with and without friction.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Self

import numpy as np

from underlay._arrays import FloatArray, PerSet
from underlay.errors import InputError
from underlay.mechanics.contact import Contact
from underlay.mechanics.contact_law import ContactLaw

#: ``"none"``: points slide freely. ``"stuck"``: they stick where they touch. ``"unknown"``: computed without, and
#: what friction could do is said beside a fit. What real friction does lies between the two.
FRICTIONS = ("unknown", "none", "stuck")
_LEAST_NU, _MOST_DEPTH, _LEAST_THICKNESS, _MOST_DEPTH_IN_RADII = 0.3, 0.3, 0.5, 0.5
# A depth read off a curve may exceed the end of the range by rounding.
_ROUNDING = 1e-9
# Relative step of the slope of what large strains add, second order, to smaller depths alone: the law ends at its
# largest.
_STEP = 1e-3


def as_friction(given: object) -> str:
    """Check and return the friction under the tip, one of `FRICTIONS`.

    Raises
    ------
    InputError
        If it is none of these.
    """
    if isinstance(given, str) and given in FRICTIONS:
        return given
    raise InputError(
        f"friction is one of {', '.join(FRICTIONS)}; got {given!r:.60}. A given coefficient lies between "
        '"none" and "stuck": compute both'
    )


def finite_strain_excess(contact: Contact, depth: FloatArray, radius: FloatArray) -> FloatArray:
    """P/P_linear - 1 of large strains at depths (m), (n,); zero before contact.

    With b = (1 - 2 nu)/(1 - nu),

        ln(P/P_linear) = 0.239 b a/R - 0.063 a/R + 0.168 (w/h)^2 + 0.53 b w/h

    collapses 56 points of finite elements, nu 0.3 to 0.499, w/h up to 0.3 and h/R from 0.5, from 15.6 % at
    worst to 2.0 % (rms 0.7 %); on a half-space up to w/R = 0.5.

    Parameters
    ----------
    contact : Contact
        One for which `why_unmeasured` is empty; the function is not extrapolated.
    depth, radius : FloatArray
        Indentation depth and contact radius of the linear law (m), (n,).
    """
    tip_radius = contact.indenter.curvature_radius
    if contact.isotropic is None or tip_radius is None:
        return np.full_like(depth, np.nan)
    return excess_of(contact.isotropic.layer.nu, depth / contact.thickness, radius / tip_radius)


def excess_of(nu: PerSet, deep: FloatArray, wide: FloatArray) -> FloatArray:
    """The formula of `finite_strain_excess` in dimensionless variables.

    Parameters
    ----------
    nu : float or FloatArray
        Poisson's ratios that broadcast with the rest.
    deep, wide : FloatArray
        w/h and a/R, (..., n): depth over thickness, contact radius over the sphere's.

    Returns
    -------
    FloatArray
        P/P_linear - 1, (..., n).
    """
    b = (1.0 - 2.0 * nu) / (1.0 - nu)
    deep = np.maximum(deep, 0.0)
    return np.asarray(np.expm1((0.239 * b - 0.063) * wide + 0.168 * deep**2 + 0.53 * b * deep))


def friction_in_large_strains(
    contact: Contact, sticks: FloatArray, free: FloatArray, depth: FloatArray
) -> FloatArray:
    """Force added by friction in large strains beyond that in small ones, over the force P, (n,).

    With f = P_stuck/P - 1 the excess of a stuck tip in small strains, it is (+-sqrt(f) + q)^2 in large ones by
    the finite elements of tests/studies/finite_elements.py, q = w/(4 R) + w/(2 h), the sign that of outward
    sliding: nearly all of q^2 + 2 sqrt(f) q, which is returned, is added at nu = 0.49, a part of it taken off
    at nu = 0.3.

    Parameters
    ----------
    contact : Contact
        One for which `why_unmeasured` is empty.
    sticks, free : FloatArray
        Forces (N) in small strains with a tip that sticks and one that slides, (n,).
    depth : FloatArray
        Indentation depth (m), (n,).
    """
    radius = contact.indenter.curvature_radius
    if radius is None:
        return np.full_like(depth, np.nan)
    return further_of(sticks, free, depth, radius, contact.thickness)


def further_of(
    sticks: FloatArray, free: FloatArray, depth: FloatArray, radius: PerSet, thickness: PerSet
) -> FloatArray:
    """The formula of `friction_in_large_strains`, from arrays.

    Parameters
    ----------
    sticks, free : FloatArray
        Forces (N) in small strains with full and without friction, (..., n).
    depth : FloatArray
        Indentation depth (m), (..., n).
    radius, thickness : float or FloatArray
        Radius R of the tip and thickness h (m), which broadcast with the rest.

    Returns
    -------
    FloatArray
        q^2 + 2 sqrt(f) q, (..., n).
    """
    over = np.divide(sticks, free, out=np.ones_like(free), where=free > 0.0) - 1.0
    # In small strains the excess may be negative by 3e-4.
    root = np.sqrt(np.maximum(over, 0.0))
    further = np.maximum(depth, 0.0) * (0.25 / radius + 0.5 / thickness)
    return np.asarray(further * (further + 2.0 * root))


def require_measured(contact: Contact, depth: float, size: str = "") -> None:
    """Raise for a contact at `depth` (m) outside the range of the finite elements on large strains.

    `size` is the path of the parameter that asks for large strains, for the message; "" for ``finite_strain =
    true``.

    Raises
    ------
    InputError
        With the range.
    """
    why = why_unmeasured(contact, depth)
    if why:
        asks = f"{size} is" if size else "finite_strain = true asks for what is"
        raise InputError(f"{asks} beyond what is known here: {why}{'; set it to 0' if size else ''}")


def why_unmeasured(contact: Contact, depth: float) -> str:
    """Why large strains are not known for this contact at `depth` (m), with the range; "" where they are."""
    radius, thickness = contact.indenter.curvature_radius, contact.thickness
    if contact.isotropic is None or radius is None:
        return "measured for spheres on one isotropic layer, bonded"
    if contact.isotropic.base is not None and np.isfinite(contact.thickness):
        return "measured on rigid bases"
    nu = contact.isotropic.layer.nu
    more = 1.0 + _ROUNDING
    ends = (
        (nu < _LEAST_NU, f"nu from {_LEAST_NU:g}; here {nu:g}"),
        (
            thickness < _LEAST_THICKNESS * radius,
            f"layers from {_LEAST_THICKNESS:g} R thick; here {thickness / radius:.3g} R",
        ),
        (
            depth > _MOST_DEPTH * thickness * more,
            f"depths up to {_MOST_DEPTH:g} h; here {depth / thickness:.3g} h",
        ),
        (
            depth > _MOST_DEPTH_IN_RADII * radius * more,
            f"depths up to {_MOST_DEPTH_IN_RADII:g} R; here {depth / radius:.3g} R",
        ),
    )
    return next((f"measured for {words}" for beyond, words in ends if beyond), "")


@dataclass(frozen=True, kw_only=True)
class DiscrepantLaw(ContactLaw):
    """Law with friction and large strains added to linear elasticity: P + s (P_stuck - P) + P (A e + B g).

    Parameters
    ----------
    free : ContactLaw
        P, without friction, in small strains.
    sticks : ContactLaw or None
        P_stuck, of a tip that sticks; None where s and B are zero.
    friction, finite_strain, both : float
        The sizes s, A and B: the share of full friction, of the large strains, and of friction in large strains.
    excess : callable
        e at depths (m), (n,); see `finite_strain_excess`.
    further : callable
        g from the forces P_stuck and P (N) at depths (m), each (n,); see `friction_in_large_strains`.
    """

    free: ContactLaw
    sticks: ContactLaw | None
    friction: float
    finite_strain: float
    both: float
    excess: Callable[[FloatArray], FloatArray]
    further: Callable[[FloatArray, FloatArray, FloatArray], FloatArray]

    @classmethod
    def of(
        cls,
        free: ContactLaw,
        sticks: ContactLaw | None,
        sizes: tuple[float, float, float],
        excess: Callable[[FloatArray], FloatArray],
        further: Callable[[FloatArray, FloatArray, FloatArray], FloatArray],
    ) -> Self:
        """Add the effects to a law, with `sizes` (s, A, B); the other parameters are those of the class."""
        friction, finite_strain, both = sizes
        laws = [free] if sticks is None else [free, sticks]
        return cls.over(
            free,
            reason=(
                f"{free.reason}; {friction:.3g} of full friction, {finite_strain:.3g} of finite strain, "
                f"{both:.3g} of friction in large strains"
            ),
            max_depth=min(law.max_depth for law in laws),
            error_estimate=max(law.error_estimate for law in laws),
            free=free,
            sticks=sticks,
            friction=friction,
            finite_strain=finite_strain,
            both=both,
            excess=excess,
            further=further,
        )

    @property
    def nodes(self) -> int | None:
        """Number of radial nodes of the law without friction."""
        return self.free.nodes

    def _force(self, depth: FloatArray) -> FloatArray:
        force = self.free.force(depth)
        found = force if self.sticks is None else force + self.friction * (self.sticks.force(depth) - force)
        return found + force * self._strained(depth) if self.finite_strain or self.both else found

    def _strained(self, depth: FloatArray) -> FloatArray:
        """Relative excess of large strains, A e + B g, at depths (m), (n,)."""
        found = self.finite_strain * self.excess(depth) if self.finite_strain else np.zeros_like(depth)
        if self.sticks is not None and self.both:
            found = found + self.both * self.further(self.sticks.force(depth), self.free.force(depth), depth)
        return np.asarray(found)

    def _stiffness(self, depth: FloatArray) -> FloatArray:
        force, slope = self.free.force_and_stiffness(depth)
        found = (
            slope if self.sticks is None else slope + self.friction * (self.sticks.stiffness(depth) - slope)
        )
        if not (self.finite_strain or self.both):
            return found
        here, before, far = (self._strained(depth * (1.0 - k * _STEP)) for k in (0.0, 1.0, 2.0))
        rising = (1.5 * here - 2.0 * before + 0.5 * far) / (_STEP * depth)
        return found + slope * here + force * rising

    def _contact_radius(self, depth: FloatArray) -> FloatArray:
        return np.asarray(self.free.contact_radius(depth))

    @property
    def _beyond(self) -> str:
        law = (
            self.free if self.sticks is None or self.free.max_depth <= self.sticks.max_depth else self.sticks
        )
        return law._beyond  # noqa: SLF001  own class
