"""The law of an indenter on whose surface points stick where they touch, in the form of a master curve.

Assumes a rigid, axisymmetric indenter whose contact is one disc, small strains, monotone loading, and friction
enough to hold every point (a tenth to a third of the pressure on thin, nearly incompressible layers). Range:
contact radii up to 20 thicknesses, up to the end of the indenter's shape, and up to where a film much stiffer
than its base folds: there points do not stick in the order in which they are touched. The contact that grows is
that of `stuck_punch`; its answer is held as the frictionless one's is (`MasterCurve`).
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from math import acosh, ceil, log, log10
from typing import Self

import numpy as np

from underlay._arrays import FloatArray
from underlay.errors import RangeError
from underlay.mechanics.contact import Contact
from underlay.mechanics.contact_law import ContactLaw
from underlay.mechanics.exact.contact_problem import LARGEST_EPS, ContactProblem, RadiusGuess, out_of_reach
from underlay.mechanics.exact.law import ExactLaw, ExactPunchLaw, punch_width, without_dimensions
from underlay.mechanics.exact.master_curve import (
    MOST_TERMS,
    Factor,
    MasterCurve,
    RadiusSeries,
    Stretch,
    chebyshev_angles,
    chebyshev_coefficients,
    truncation_error,
)
from underlay.mechanics.exact.nodes import Resolution, curve_terms
from underlay.mechanics.exact.punch_solution import proved_resolution
from underlay.mechanics.stuck.stuck_punch import Growth, StuckPunch, chebyshev_radii

# A stuck contact at equal depth is 0.955 to 1.021 times as wide as a frictionless one.
_WIDER = 1.03
# Points that overshoot the wanted depth by more would only cost.
_OVERSHOOT = 1.5
_MOST_ATTEMPTS = 12
_MOST_RADII, _MOST_STEPS = 180, 90
_GROWTH_OF_COUNTS = 1.35
# Steps for every radius: polynomials are integrated of as many terms as there are radii. With a third of it the
# growth of 107 radii is wrong by 1e-5, at a/h = 14; with it by what its terms leave, 1e-9.
_STEPS_PER_RADIUS = 1.1
# What each part of the solution may take of the relative error: quadrature, the curve, and the growth.
_SHARE, _SHARE_OF_GROWTH = 0.3, 0.4
# Depth against radius is looked at on so many radii per term of its polynomial.
_SAMPLES_PER_TERM = 6
# A measured tip has corners in its curvature: its radii converge as 1/n only, its integrals take more steps, and
# what its coefficients say of the error is taken so many times. With 48 radii forces are right to 1e-3.
_MEASURED_RADII, _MEASURED_STEPS, _UNEVEN = 48, 240, 4.0


@dataclass(frozen=True)
class _Counts:
    """Node counts of one solution: basis functions, contact radii, and steps of the growth's integral.

    Fits, with a margin, to what errors of 1e-3 to 1e-9 in P(w) took for rigid bases and ratios of 0.1 to 10, at
    a/h of 0.5 to 10; every solution is checked by how its coefficients fall.
    """

    modes: int
    radii: int
    steps: int

    @classmethod
    def choose(cls, eps: float, rtol: float, softness: float, end: float = np.inf) -> Self:
        """Counts for contact radii up to `eps` and relative error `rtol`.

        `softness` is that of `Scales`; the shape is smooth up to the radius `end`. `eps` and `end` are over the
        thickness.
        """
        digits = 0.5 - log10(rtol)
        wide = 0.9 + 0.58 * eps + 0.02 * eps * eps + 0.1 * np.log1p(softness * eps)
        radii = 7 + max(0, ceil(digits * wide) - 5)
        if end < np.inf:
            # A polynomial's error falls as rho^-n, rho by the ellipse through what is not smooth; its logarithm
            # takes 0.85 of that.
            z = max(float(Stretch.to(eps, softness).z(np.array([end]))[0]), 1.01)
            radii = max(radii, ceil(0.85 * digits * log(10.0) / acosh(z)))
        return cls.of(radii, digits)

    @classmethod
    def of(cls, radii: int, digits: float) -> Self:
        steps = max(14 + ceil(3.2 * digits), ceil(_STEPS_PER_RADIUS * radii))
        return cls(2 + ceil(0.64 * radii), radii, steps)

    def more(self, most: int) -> _Counts:
        """Larger counts for the next attempt, with at most `most` radii."""
        radii = min(ceil(_GROWTH_OF_COUNTS * self.radii), most)
        steps = min(ceil(1.2 * self.steps), max(self.steps, _MOST_STEPS))
        return _Counts(2 + ceil(0.64 * radii), radii, max(steps, ceil(_STEPS_PER_RADIUS * radii)))


@dataclass(frozen=True)
class _Solved:
    """A growth, with varpi and the logarithms of the three factors (`Factor`) at its Chebyshev radii.

    varpi is the half-space contact radius at the depth over the thickness. `samples` are further radii over the
    thickness from 0 on, closely spaced, with varpi and b = w'/H' at them.
    """

    growth: Growth
    resolution: Resolution
    varpi: FloatArray
    logarithms: FloatArray
    error: float
    samples: FloatArray
    varpi_at_samples: FloatArray
    rate_at_samples: FloatArray


def stuck_law(contact: Contact, max_depth: float, rtol: float = 1e-6) -> ContactLaw:
    """Solve the contact problem with full friction for depths up to `max_depth`.

    Parameters
    ----------
    contact : Contact
        Of any shape, on any body whose kernel has the compliance in shear.
    max_depth : float
        Largest depth (m), positive.
    rtol : float, default 1e-6
        Relative error allowed in force, contact radius and stiffness.

    Returns
    -------
    ExactLaw or ExactPunchLaw
        With ``method = "stuck"``.

    Raises
    ------
    RangeError
        If the contact would pass 20 thicknesses, the end of the shape, or a fold.

    Examples
    --------
    >>> from underlay.mechanics.indenters import Paraboloid
    >>> from underlay.mechanics.body import RIGID, Layer
    >>> from underlay.mechanics.materials import Isotropic
    >>> contact = Contact.of(Paraboloid(0.5), Layer(Isotropic(1.5, 0.5), 1.0), RIGID)
    >>> law = stuck_law(contact, max_depth=1.2)
    >>> f"{law.force(1.10407546804):.5f}"  # a/h = 1: P = 7.731771 theta A a^3
    '7.73177'
    """
    if contact.indenter.has_edge:
        return _punch_law(contact, max_depth, rtol)
    problem, top = without_dimensions(contact, max_depth)
    solved, last = _reaching(problem, top, rtol)
    curve, error = _curve(problem, solved, top, rtol)
    return ExactLaw(
        method="stuck",
        reason=(
            f"contact without slip, solved for a/h up to {last:.3g}, {solved.resolution.radial} functions"
            if contact.thickness < np.inf
            else "contact without slip on a half-space"
        ),
        max_depth=max_depth,
        error_estimate=solved.error + error,
        measure=problem.measure,
        theta=contact.theta,
        thickness=problem.thickness,
        curve=curve,
        resolution=solved.resolution,
    )


def _punch_law(contact: Contact, max_depth: float, rtol: float) -> ExactPunchLaw:
    radius, eps = contact.indenter.max_radius, punch_width(contact)
    resolution = proved_resolution(contact.kernel, eps, rtol)
    counts = _Counts.choose(eps, rtol, 0.0)
    while True:
        punch = StuckPunch.solve(contact.kernel, np.array([eps]), counts.modes, resolution)
        # kappa is variational: its error is the square of the field's.
        error = _tail(punch) ** 2
        if error <= _SHARE * rtol or counts.radii >= _MOST_RADII:
            break
        counts = counts.more(_MOST_RADII)
    return ExactPunchLaw(
        method="stuck",
        reason=f"contact without slip, a/h = {eps:.3g}, {counts.modes} functions",
        max_depth=max_depth,
        error_estimate=error + _SHARE * rtol,
        radius=radius,
        incremental=4.0 * contact.theta * radius * float(punch.kappa[0]),
        resolution=_with_modes(resolution, counts),
    )


def _tail(punch: StuckPunch) -> float:
    """Largest of the last two coefficients of the fields over the largest of all: a measure of truncation."""
    size = np.abs(punch.fields)
    return float((size[:, -2:].max(axis=1) / size.max(axis=1)).max())


def _with_modes(resolution: Resolution, counts: _Counts) -> Resolution:
    return Resolution(counts.modes, resolution.wavenumbers, resolution.first, resolution.reach)


def _reaching(problem: ContactProblem, top: float, rtol: float) -> tuple[_Solved, float]:
    """Solve up to a contact radius at which varpi is `top`, or a little more.

    Returns the solution and that radius over the thickness. varpi is the half-space contact radius at the depth
    over the thickness.
    """
    end = min(problem.indenter.max_radius / problem.thickness, LARGEST_EPS)
    guess = RadiusGuess.of(problem.scales, problem.measure.exponent).radius(np.array([top]))[0]
    last = min(_WIDER * problem.widest(guess), end)
    foreseen = problem.scales.charted and problem.scales.ratio > _OVERSHOOT / 5.0
    allowed = rtol if foreseen else max(rtol, 1e-2)
    for _ in range(_MOST_ATTEMPTS):
        solved = _solve(problem, last, allowed)
        reached, depth = _reached(problem, solved, top)
        if depth < top:
            if last >= end:
                raise out_of_reach(problem, top, depth)
            last = min(last * min(1.02 * top / depth, 2.0), end)
        elif reached < last / _OVERSHOOT or allowed > rtol:
            last, allowed = min(1.02 * reached, end), rtol
        else:
            return solved, last
    raise RangeError(
        f"no contact radius was found for depth {_depth(problem, top):.6g} m: press less deep, or take a contact "
        "without friction"
    )


def _solve(problem: ContactProblem, last: float, rtol: float) -> _Solved:
    """Grow the contact up to a/h = `last` at relative error `rtol`, with as many nodes as that takes."""
    scales = problem.scales
    resolution = proved_resolution(problem.kernel, last, rtol)
    end = problem.indenter.max_radius / problem.thickness if problem.indenter.smooth else np.inf
    counts, most, uneven = _Counts.choose(last, rtol, scales.softness, end), _MOST_RADII, 1.0
    if not problem.indenter.smooth:
        counts, most, uneven = replace(counts, steps=_MEASURED_STEPS), _MEASURED_RADII, _UNEVEN
    stretch = Stretch.to(last, scales.softness)
    while True:
        radii = chebyshev_radii(stretch, counts.radii)
        punch = StuckPunch.solve(problem.kernel, radii, counts.modes, resolution)
        growth = Growth.solve(punch, stretch, problem.indenter, problem.thickness, counts.steps)
        varpi, logarithms = _factors(problem, radii, growth)
        angles = chebyshev_angles(counts.radii)
        own = np.column_stack((logarithms, np.log(varpi / radii)))
        error = growth.error + _tail(punch) ** 2
        error += uneven * float(truncation_error(chebyshev_coefficients(own, angles)))
        if error <= _SHARE_OF_GROWTH * rtol or counts.radii >= most:
            break
        counts = counts.more(most)
    samples = last * np.linspace(0.0, 1.0, _SAMPLES_PER_TERM * counts.radii + 1)
    ratios = growth.values(samples)
    return _Solved(
        growth,
        _with_modes(resolution, counts),
        varpi,
        logarithms,
        error + _SHARE * rtol,
        samples,
        _varpi(problem, samples, ratios[:, 1]),
        ratios[:, 3],
    )


def _varpi(problem: ContactProblem, eps: FloatArray, depth: FloatArray) -> FloatArray:
    """varpi at contact radii `eps` over the thickness where the depth over H(a), w/H, is `depth`.

    Values of `depth` that are not positive were not resolved, or lie beyond a fold: the caller finds both.

    varpi is the half-space contact radius at the depth over the thickness. H(r) is the depth at which
    the contact radius on a half-space is r.
    """
    halfspace = problem.indenter.abel(eps * problem.thickness)
    return problem.measure.halfspace_radius(np.abs(depth) * halfspace) / problem.thickness


def _factors(problem: ContactProblem, eps: FloatArray, growth: Growth) -> tuple[FloatArray, FloatArray]:
    """varpi (n,) and the logarithms of the three factors (n, 3) at contact radii `eps` over the thickness.

    varpi is the half-space contact radius at the depth over the thickness.
    """
    kappa, depth, force = growth.values(eps)[:, :3].T
    varpi = _varpi(problem, eps, depth)
    factors = np.empty((eps.size, len(Factor)))
    factors[:, Factor.RADIUS] = eps / varpi
    factors[:, Factor.FORCE] = (1.0 + 1.0 / problem.measure.exponent) * force * eps / (depth * varpi)
    factors[:, Factor.STIFFNESS] = kappa
    return varpi, np.log(np.abs(factors))


def _reached(problem: ContactProblem, solved: _Solved, top: float) -> tuple[float, float]:
    """The contact radius over thickness at which varpi is `top`, and varpi there; or both at the end.

    varpi is the half-space contact radius at the depth over the thickness.

    Raises
    ------
    RangeError
        If the contact stops growing with depth before.
    """
    samples, varpi, rate = solved.samples, solved.varpi_at_samples, solved.rate_at_samples
    beyond = np.flatnonzero(varpi >= top)
    stop = int(beyond[0]) if beyond.size else samples.size
    folded = np.flatnonzero(rate[: stop + 1] <= 0.0)
    if folded.size:
        before = max(int(folded[0]) - 1, 0)
        deepest = _depth(problem, float(varpi[before]))
        raise RangeError(
            f"depth {_depth(problem, top):.6g} m is beyond the largest that works here with a tip that sticks, "
            f"{deepest:.6g} m: there the film, much stiffer than its base, wraps the tip in a jump, and points do "
            "not stick in the order in which they are touched; press less deep, or leave friction out",
            max_depth=deepest,
        )
    if not beyond.size:
        return float(samples[-1]), float(varpi[-1])
    return float(samples[stop]), float(varpi[stop])


def _depth(problem: ContactProblem, varpi: float) -> float:
    """Depth (m) at which the half-space contact radius over the thickness is `varpi`."""
    return float(problem.measure.abel(np.array([varpi * problem.thickness]))[0])


def _curve(problem: ContactProblem, solved: _Solved, top: float, rtol: float) -> tuple[MasterCurve, float]:
    """Invert the relation: the master curve for varpi up to `top`, and its truncation error.

    varpi is the half-space contact radius at the depth over the thickness.
    """
    stretch = Stretch.to(top, problem.scales.softness)
    terms = curve_terms(problem.scales, top, problem.measure.exponent, rtol)
    while terms <= MOST_TERMS:
        wanted = stretch.v(np.cos(chebyshev_angles(terms)))
        at, logarithms = _factors(
            problem, np.interp(wanted, solved.varpi_at_samples, solved.samples), solved.growth
        )
        curve = MasterCurve.through(at, logarithms, stretch, _SHARE * rtol)
        if curve.error_estimate <= _SHARE * rtol:
            return curve, curve.error_estimate
        terms += 4
    radii = chebyshev_radii(solved.growth.stretch, solved.varpi.size)
    # Column RADIUS is ln(eps/chi), and the radius stands for itself.
    relation = np.column_stack((solved.logarithms, np.log(solved.varpi / radii)))
    relation[:, Factor.RADIUS] = 0.0
    series = RadiusSeries(
        solved.growth.stretch, chebyshev_coefficients(relation, chebyshev_angles(radii.size))
    )
    inverted = series.inverted(top, _SHARE * rtol)
    return inverted, inverted.error_estimate
