"""The asymptotic law of a layer on a substrate: orders 0 to 4, three forms, every shape, and its error.

Formula: the curves of `series`, from the kernel's moments a_0 and a_1 (1.8). Assumes a
frictionless, rigid, axisymmetric, convex indenter and a contact radius a below the layer's thickness h; the
error grows as (a/h)^(order + 1). Source: Argatov and Sabina, asymptotic analysis of the substrate effect for
an arbitrary indenter, sections 4 to 9.

Which form. Relative error of the force, fourth order, paraboloid, against the exact contact problem:

===================  =========  ==============  ==============  ==============
substrate            a/h        explicit        parametric      compliance
===================  =========  ==============  ==============  ==============
rigid, nu = 0.5      0.2, 0.6   4e-5, 1e-2      2e-4, 2e-2      2e-4, 7e-2
E2 = 10 E1           0.2, 0.6   2e-4, 2e-2      1e-4, 2e-2      2e-4, 6e-2
E2 = 0.9 E1          0.2, 0.6   7e-6, 1e-3      8e-6, 2e-3      8e-6, 2e-3
E2 = 0.5 E1          0.2, 0.6   8e-5, 2e-2      5e-5, 1e-2      4e-5, 6e-3
E2 = 0.1 E1          0.2, 0.6   5, 2e3          1e-4, no root   6e-5, 3e-3
E2 = 0.001 E1        0.2, 0.6   2e10, 2e13      4e-5, no root   3e-6, 1e-3
===================  =========  ==============  ==============  ==============

So ``form="auto"`` takes the compliance form where a_0 < 0 (the substrate softens the contact; the series in eps
= a/h has a radius of convergence of about h/|b|, b = 2 a_0/pi), and where a_0 >= 0 the explicit form for a
power law, the parametric one for any other shape.

How far the model is from the exact contact problem is estimated from the terms left out (`force_error`). The
displacement-force relation has, in powers of eps = s/h with s the half-space radius at the force, the
exact first-order correction of every moment a_m: the complementary energy changes by half the work of the
half-space pressure p against the perturbed compliance (1.5), (1.7),

    w = d/dP [ U_halfspace(P) - (1/(4 pi theta h)) sum_m (a_m/h^(2m)) int int p p |x - y|^(2m) dx dy ],

which gives the paper's a_0 and a_1 terms of (8.4) and, from int int p p |x - y|^4 = 2 P P_4 + 4 P_2^2, the
first term the paper leaves out, d_5 eps^5. The next is -(a_1 terms)^2 eps^6.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TypeAlias

import numpy as np

from underlay._arrays import FloatArray, positive
from underlay.errors import InputError, RangeError
from underlay.mechanics.asymptotic import blunt
from underlay.mechanics.asymptotic.series import ContactSeries, PunchSeries, ShapeSeries, power_law_series
from underlay.mechanics.body import Real
from underlay.mechanics.contact import Contact
from underlay.mechanics.contact_law import CHOSEN_FOR_DEPTH, ContactLaw
from underlay.mechanics.indenters import Indenter, PowerLawShape

#: (a_0, a_1, a_2) of (1.8).
Moments: TypeAlias = tuple[float, float, float]
# The error can pass through zero on its way up; four depths see it on either side.
_FRACTIONS = np.array([0.25, 0.5, 0.75, 1.0])
# The half-space radius at the depth, times this, is where the compliance curve's parameter is looked for: on
# a base 1e8 times softer a cone's is 1e-4 of it, on a rigid one twice it.
_SEARCH = np.geomspace(1e-6, 8.0, 81)
FORMS = ("auto", "explicit", "parametric", "compliance")


def fifth_coefficient(exponent: Real, a_2: Real) -> Real:
    """d_5 of w = A F_2 s^lambda (1 + d_1 eps + d_3 eps^3 + d_5 eps^5 + ...), the depth at given force.

    s is the half-space contact radius at the force, eps = s/h, and a_2 the third moment (1.8); `exponent` lambda
    may be inf (flat punch): -256 a_2/(45 pi).

    The shape is A r^lambda. F_2(lambda) is `abel_factor`. Equation numbers are those of Argatov and
    Sabina.
    """
    # In 1/(lambda + 1), so that the flat punch, lambda = inf, needs no case of its own.
    v = 1.0 / (exponent + 1.0)
    squares = 16.0 / 15.0 / (1.0 + 4.0 * v) + 16.0 / 9.0 / (1.0 + 2.0 * v) ** 2
    return -2.0 * a_2 / np.pi * squares * (1.0 - v) * (1.0 + 2.0 * v)


def sixth_coefficient(a_1: Real) -> Real:
    """d_6 of the series of `fifth_coefficient` for a flat punch, -64 a_1^2/(45 pi^2); used for every shape.

    a_0 and a_1 are moments of the kernel (1.8).
    """
    return -64.0 * a_1**2 / (45.0 * np.pi**2)


def omitted_terms(exponent: Real, a_1: Real, a_2: Real, eps: Real) -> Real:
    """|d_5| eps^5 + |d_6| eps^6: the compliance form's error in depth over the half-space depth.

    eps is the half-space contact radius at the force over the thickness, a_1 and a_2 moments of the kernel (1.8).

    Equation numbers are those of Argatov and Sabina.
    """
    return np.abs(fifth_coefficient(exponent, a_2)) * eps**5 + np.abs(sixth_coefficient(a_1)) * eps**6


def punch_error(kappa: float, eps: float, moments: Moments) -> float:
    """Estimated relative error of a flat punch's factor `kappa` at eps = a/h; inf where the form breaks down.

    `moments` are (a_0, a_1, a_2) of (1.8).

    Equation numbers are those of Argatov and Sabina.
    """
    a_0, a_1, a_2 = moments
    inverse = 1.0 / blunt.kappa_infinity(eps, a_0, a_1, form="compliance")
    omitted = omitted_terms(np.inf, a_1, a_2, eps)
    if not inverse > omitted:
        return np.inf
    return float(abs(kappa * inverse - 1.0) + omitted / inverse)


def force_error(
    series: ContactSeries,
    compliance: ContactSeries,
    thickness: float,
    moments: Moments,
    depth: float,
) -> float:
    """Estimate the largest relative error of `series` in force for depths up to `depth` (m).

    The estimate is the distance of a form to the fourth-order compliance form plus the two terms of the latter
    that are left out (`omitted_terms`). Against brute-force solutions of 13 pairs of materials (rigid to 1000
    times softer; equal moduli with other Poisson's ratios), four shapes, a/h = 0.05 to 1, all forms and orders,
    it was 0.5 to 120 times the error, 1.1 times in the median and below 5 times in 19 cases of 20
    (tests/test_asymptotic.py).

    Equation numbers are those of Argatov and Sabina.

    Parameters
    ----------
    series : ContactSeries
        The curve in question.
    compliance : ContactSeries
        The fourth-order compliance curve of the same shape and materials.
    thickness : float
        h (m).
    moments : (a_0, a_1, a_2)
        Moments of the kernel (1.8).
    depth : float
        Largest depth (m).

    Returns
    -------
    float
        The estimate; infinite where the compliance curve itself has ended.
    """
    s = _sampled(compliance, depth)
    if s is None:
        return np.inf
    (w, depth_slope), (reference, force_slope) = compliance.depth(s), compliance.force(s)
    exponent, halfspace_depth = _exponent_and_depth(compliance, s)
    omitted = halfspace_depth * omitted_terms(exponent, moments[1], moments[2], s / thickness)
    own = omitted * force_slope / (depth_slope * reference)
    distance = np.abs(series.load(w, series.parameter(w)) / reference - 1.0)
    return float(np.max(distance + own))


def _sampled(compliance: ContactSeries, depth: float) -> FloatArray | None:
    """Parameters s (m) of the compliance curve at fractions of `depth` (m), to 0.5 %; None beyond its end.

    The error is estimated at the depths of these parameters, so that they need not be exact, and no equation
    is solved.
    """
    s = compliance.start(np.array([depth]))[0] * _SEARCH
    s = s[s < compliance.end]
    if np.isfinite(compliance.end):
        s = np.append(s, compliance.end)
    w = compliance.depth(s)[0]
    if w[-1] < depth:
        return None
    # High powers of the smallest radii underflow to zero.
    seen = w > 0.0
    log_s = np.interp(np.log(depth * _FRACTIONS), np.log(w[seen]), np.log(s[seen]))
    return np.asarray(np.exp(log_s))


def _exponent_and_depth(curve: ContactSeries, s: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Local exponent dlnH/dlns of the shape's half-space depth H at s (m), and H(s) (m)."""
    shape = curve.shape
    H = shape.abel(s)
    return s * shape.abel_slope(s) / H, H


@dataclass(frozen=True, kw_only=True)
class AsymptoticLaw(ContactLaw):
    """Force against depth by the asymptotic model; built by `asymptotic_law`.

    `max_depth` is the turning point: the largest depth at which depth and force still increase together,
    infinite where there is none. `error_estimate` holds up to `error_depth`.

    Parameters
    ----------
    order : int
        Terms kept: up to (a/h)^order.
    form : str
        ``"explicit"``, ``"parametric"`` or ``"compliance"``.
    error_depth : float
        Depth (m) up to which `error_estimate` holds: the one the law was built for.
    max_radius_depth : float
        Largest depth (m) for `contact_radius`: beyond, its series decreases or passes the
        end of the indenter's shape.
    series : ContactSeries
        Depth, force and contact radius as functions of the parameter s (m).
    series_end : float
        Largest s (m) used: depth and force increase up to there.
    """

    order: int
    form: str
    error_depth: float
    max_radius_depth: float
    series: ContactSeries
    series_end: float

    @property
    def _beyond(self) -> str:
        if self.max_depth < _depth_at(self.series, self.series_end):
            return CHOSEN_FOR_DEPTH
        form = f"the {self.form} form of order {self.order}"
        return f'there {form} has no root or stops increasing; use the solver "exact"'

    def _force(self, depth: FloatArray) -> FloatArray:
        return self.series.load(depth, self.series.parameter(depth, self.series_end))

    def _contact_radius(self, depth: FloatArray) -> FloatArray:
        if not (depth <= self.max_radius_depth).all():
            raise RangeError(
                f"contact radius at depth {depth.max():.6g} m: the series of the {self.form} form of order "
                f"{self.order} decreases or passes the end of the indenter's shape beyond "
                f'{self.max_radius_depth:.6g} m; use the solver "exact"',
                max_depth=self.max_radius_depth,
            )
        return self.series.radius(self.series.parameter(depth, self.series_end))

    def _stiffness(self, depth: FloatArray) -> FloatArray:
        s = self.series.parameter(depth, self.series_end)
        deeper = self.series.depth(s)[1]
        # Where the series of the depth turns, the law ends: more force, no more depth.
        return np.divide(
            self.series.force(s)[1], deeper, out=np.full_like(deeper, np.inf), where=deeper != 0.0
        )


def asymptotic_law(
    contact: Contact, max_depth: float, *, order: int = 4, form: str = "auto"
) -> AsymptoticLaw:
    """Build the asymptotic law of a contact.

    Equation numbers are those of Argatov and Sabina.

    Parameters
    ----------
    contact : Contact
        Of any shape; the explicit form needs a power law (or a flat punch). Where nothing differs under the
        surface, no kernel is computed.
    max_depth : float
        Largest depth (m) that will be asked; the error is estimated for it.
    order : int, default 4
        0 to 4: terms kept, up to (a/h)^order.
    form : str, default "auto"
        ``"explicit"`` (5.9), ``"parametric"`` (4.14)/(4.15), ``"compliance"`` (8.4), or ``"auto"``.

    Returns
    -------
    AsymptoticLaw

    Raises
    ------
    RangeError
        If the form stops working before `max_depth`; `max_depth` of the error is where.
    InputError
        If `order` or `form` is unknown, or the form does not exist for the shape.

    Examples
    --------
    >>> from underlay.mechanics.indenters import Paraboloid
    >>> from underlay.mechanics.body import Layer, RIGID
    >>> from underlay.mechanics.materials import Isotropic
    >>> contact = Contact.of(Paraboloid(1e-3), Layer(Isotropic(1e4, 0.5), 1e-3), RIGID)
    >>> law = asymptotic_law(contact, 2e-5)
    >>> law.form, f"{law.force(2e-5):.4e}"
    ('explicit', '6.0016e-05')
    """
    require_known(order, form)
    deepest = positive(max_depth, "max_depth", "m")
    moments = kernel_moments(contact)
    chosen, reason = choose_form(contact.indenter, form, moments[0])
    series = contact_series(contact, moments, order, chosen)
    end = series.end
    last = _depth_at(series, end)
    if deepest > last:
        raise RangeError(
            f"max_depth {deepest:.6g} m is beyond {last:.6g} m, the largest depth that the {chosen} form of "
            f'order {order} reaches here; use the solver "exact" or less depth',
            max_depth=last,
        )
    return AsymptoticLaw(
        method="asymptotic",
        reason=reason,
        max_depth=last,
        error_estimate=_error(series, contact, moments, deepest),
        order=order,
        form=chosen,
        error_depth=deepest,
        max_radius_depth=_depth_at(series, min(end, series.radius_end)),
        series=series,
        series_end=end,
    )


def require_known(order: int, form: str) -> None:
    """Raise InputError for an order or a form that there is not."""
    if form not in FORMS:
        raise InputError(f"unknown form {form!r}; known: {', '.join(FORMS)}")
    if order not in range(5):
        raise InputError(f"order must be 0, 1, 2, 3 or 4; got {order!r}")


def kernel_moments(contact: Contact) -> Moments:
    """Moments (a_0, a_1, a_2) of the kernel, (1.8); zeros, without computing a kernel, on a half-space.

    Equation numbers are those of Argatov and Sabina.
    """
    if not contact.layered:
        return 0.0, 0.0, 0.0
    a_0, a_1, a_2 = contact.kernel.coefficients(3)
    return float(a_0), float(a_1), float(a_2)


def choose_form(indenter: Indenter, form: str, a_0: float) -> tuple[str, str]:
    """The form to use for an indenter and the moment a_0, and the reason in words."""
    closed = indenter.has_edge or isinstance(indenter, PowerLawShape)
    if form == "explicit" and not closed:
        raise InputError(
            f"the explicit form needs a power-law shape or a flat punch; for {type(indenter).__name__} use "
            'the form "parametric", "compliance" or "auto"'
        )
    if form != "auto":
        return form, f"the {form} form was asked for"
    if a_0 == 0.0:
        return "explicit" if closed else "parametric", "no layer effect: a half-space"
    if a_0 < 0.0:
        return "compliance", (
            f"the substrate softens the contact (a_0 = {a_0:.4g} < 0): the compliance form is closest"
        )
    if closed:
        return "explicit", (
            f"the substrate does not soften the contact (a_0 = {a_0:.4g}): the explicit form is closest"
        )
    return "parametric", (
        f"the substrate does not soften the contact (a_0 = {a_0:.4g}) and the shape is not a power law: the "
        "parametric form is closest"
    )


def contact_series(contact: Contact, moments: Moments, order: int, form: str) -> ContactSeries:
    """Depth, force and contact radius as a curve of one parameter, in the chosen form and order."""
    a_0, a_1, _ = moments
    if a_0 == 0.0 and a_1 == 0.0:
        # A half-space: the corrections are zeros, and order 0 solves nothing.
        order = 0
    indenter, theta, h = contact.indenter, contact.theta, contact.thickness
    if indenter.has_edge:
        kappa = punch_factor(indenter.max_radius / h, a_0, a_1, order=order, form=form)
        return PunchSeries(indenter, theta, kappa)
    if isinstance(indenter, PowerLawShape):
        return power_law_series(indenter, theta, h, (a_0, a_1), order=order, form=form)
    b, c = (float(term) for term in blunt.kernel_terms(a_0, a_1))
    b, c = b if order >= 1 else 0.0, c if order >= 3 else 0.0
    by_force = form == "compliance"
    cross = b * c if order == 4 and not by_force else 0.0
    return ShapeSeries(indenter, theta, h, b, c, cross, by_force)


def punch_factor(eps: float, a_0: float, a_1: float, *, order: int = 4, form: str = "auto") -> float:
    """kappa_inf (9.5), a flat punch's stiffness over that on a half-space, at eps = a/h in one order and form.

    a_0 and a_1 are moments of the kernel (1.8).

    Equation numbers are those of Argatov and Sabina.

    Raises
    ------
    RangeError
        If the form gives no positive stiffness there.
    InputError
        If `order` or `form` is unknown.
    """
    require_known(order, form)
    if form == "auto":
        form = "compliance" if a_0 < 0.0 else "explicit"
    kappa = float(blunt.kappa_infinity(eps, a_0, a_1, order=order, form=form))
    if not 0.0 < kappa < np.inf:
        raise RangeError(
            f"the {form} form of order {order} gives no positive stiffness for a flat punch with "
            f'a/h = {eps:.4g}; use the solver "exact"',
            max_depth=0.0,
        )
    return kappa


def _depth_at(series: ContactSeries, s: float) -> float:
    """Depth (m) at the parameter s (m) of a curve; inf where s is."""
    return float(series.depth(np.array([s]))[0][0]) if np.isfinite(s) else np.inf


def _error(series: ContactSeries, contact: Contact, moments: Moments, depth: float) -> float:
    """Estimated relative error of the force up to `depth` (m); zero on a half-space."""
    if moments == (0.0, 0.0, 0.0):
        return 0.0
    if isinstance(series, PunchSeries):
        return punch_error(series.kappa, series.shape.max_radius / contact.thickness, moments)
    compliance = contact_series(contact, moments, 4, "compliance")
    return force_error(series, compliance, contact.thickness, moments, depth)
