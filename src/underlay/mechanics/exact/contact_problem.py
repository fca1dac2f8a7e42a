"""One tip over one layer on one body: its solution at given contact radii, and from there its master curve.

`ContactProblem` is what is asked of the body, and solves at contact radii; `solve_curve` places the radii, solves,
makes a `MasterCurve` of the answers and checks its error. The depth is measured by varpi, the half-space radius at
that depth over the thickness, and the contact radius by chi (`ContactProblem.chi`), which is a/h for a power law.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import partial
from math import ceil, log, log2, sqrt
from typing import Any, Self

import numpy as np

from underlay._arrays import FloatArray, read_only
from underlay.errors import RangeError
from underlay.mechanics.body import Real
from underlay.mechanics.contact import Variant
from underlay.mechanics.exact.master_curve import (
    MOST_TERMS,
    Branch,
    Factor,
    MasterCurve,
    RadiusSeries,
    Stretch,
    chebyshev_angles,
    chebyshev_coefficients,
)
from underlay.mechanics.exact.nodes import (
    PER_OCTAVE,
    TABLES,
    EvenRule,
    Resolution,
    curve_terms,
    even_legendre,
    legendre_rule,
    series_terms,
)
from underlay.mechanics.exact.punch_solution import PunchGrid, PunchSolution, proved_resolution
from underlay.mechanics.indenters import Indenter, PowerLawShape, abel_factor
from underlay.mechanics.kernel import Kernel, Scales, values_of

#: Largest contact radius over thickness that is solved for.
LARGEST_EPS = 20.0
# Towards a sphere's equator the coefficients fall unevenly, and a pole is near: up to 8 times the
# estimate was measured, over layers of R/3 to 10 R on bases of 0.03 of the layer's modulus to rigid.
UNEVEN = 8.0
# Gauss nodes of int H p dx for a shape that is not a power law: the sphere's H is analytic, a measured tip's
# has corners in its derivatives.
_SMOOTH_NODES, _MEASURED_NODES = 40, 240
# Cosines beyond which contacts are solved for octave by octave of their radii, at most so many: a film on a base
# 1e6 times softer takes 79 x 440 for each of a hundred radii at a/h = 20, and 10 x 60 at a/h = 2.
_MUCH, _MOST_OCTAVES = 500_000, 5.0
# The node counts of `exact_nodes` keep their share of the error, measured: a tenth of rtol where the fit is
# tightest, three tenths claimed.
SHARE_OF_NODES = 0.3
SHARE_OF_CURVE = 0.6
# Points that stop this much short of the wanted range would leave the polynomial to extrapolate.
_SHORT = 0.99
# Below this ratio of theta, varpi(eps) bends too much for points placed without knowing it.
SOFT = 0.3
# There a coarse solution comes first.
_COARSE = 1e-2
_MOST_SERIES_TERMS = 400
# So many more terms of a series, as a share of those it has, at least: a solution too few costs more than a few
# terms too many.
_MORE = 0.25
# Beyond this growth of errors, at a fold, the radius is not asked for more digits; below this the solution is
# rounding.
_LARGEST_GAIN = 30.0
_FINEST = 1e-12


@dataclass(frozen=True)
class ContactProblem:
    """An indenter over a layer of given thickness on a given body: solved at contact radii, not at depths.

    Parameters
    ----------
    indenter : Indenter
        Any shape but the flat punch.
    measure : PowerLawShape
        Power-law shape by which depth is made dimensionless: varpi, its contact radius on a half-space at that
        depth over the layer's thickness. The indenter itself where that is a power law.
    thickness : float
        Thickness of the layer (m).
    kernel : Kernel
        1 - L(u) of the body (layer and what lies under it), u the wavenumber times the thickness.
    variants : tuple of Variant
        Bodies a small step away in one parameter each, for the derivatives of the force in these parameters.
    """

    indenter: Indenter
    measure: PowerLawShape
    thickness: float
    kernel: Kernel
    variants: tuple[Variant, ...] = ()

    @classmethod
    def of(
        cls, indenter: Indenter, thickness: float, kernel: Kernel, variants: tuple[Variant, ...] = ()
    ) -> Self:
        """Build the problem of a tip over a layer of `thickness` (m) on the body of `kernel`."""
        return cls(indenter, indenter.power_law, thickness, kernel, variants)

    @property
    def scales(self) -> Scales:
        """Characteristic rates and stiffness ratios of the body, from which the node counts are chosen."""
        return self.kernel.scales

    @property
    def end(self) -> float:
        """Largest chi (radius variable of the method `chi`): that of a/h = 20, or of the end of the shape."""
        return self.chi(min(self.indenter.max_radius / self.thickness, LARGEST_EPS))

    @property
    def unevenness(self) -> float:
        """Safety factor on estimated truncation errors: 1 for a power law, `UNEVEN` for other shapes."""
        return 1.0 if self.indenter is self.measure else UNEVEN

    def chi(self, eps: float) -> float:
        """chi of a contact radius eps = a/h: the radius over h at which `measure` is as deep as the tip.

        As deep means: the power law `measure` has there the half-space depth H(a) that the indenter has at radius
        a. For a power law chi is a/h. It stands for the contact radius in every expansion: where a sphere's H grows
        without bound, chi does too, and varpi(chi) stays smooth.
        """
        if self.indenter is self.measure:
            return eps
        depth = self.indenter.abel(np.array([eps * self.thickness]))
        return float(self.measure.halfspace_radius(depth)[0]) / self.thickness

    def eps(self, chi: FloatArray) -> FloatArray:
        """Contact radius over thickness, a/h, at `chi` (n,), at most the end of the shape: inverse of `chi`.

        chi is the radius variable of `ContactProblem.chi`, a/h for a power law.
        """
        if self.indenter is self.measure:
            return chi
        deepest = self.indenter.abel(np.array(self.indenter.max_radius))
        depth = np.minimum(self.measure.abel(chi * self.thickness), deepest)
        return np.minimum(self.indenter.halfspace_radius(depth), self.indenter.max_radius) / self.thickness

    def widest(self, chi: float) -> float:
        """Contact radius over thickness, a/h, at one value of chi: `eps` for a single float.

        chi is the radius variable of `ContactProblem.chi`, a/h for a power law.
        """
        return chi if self.indenter is self.measure else float(self.eps(np.array([chi]))[0])

    def resolution(self, eps: float, rtol: float) -> Resolution:
        """Node counts for a/h up to `eps` at error `rtol`, checked by doubling where none were fitted."""
        return proved_resolution(self.kernel, eps, rtol)

    def solve(
        self,
        chi: FloatArray,
        resolution: Resolution,
        rtol: float | None = None,
        octaves: dict[int, Resolution] | None = None,
    ) -> tuple[FloatArray, FloatArray]:
        """Solve at radii `chi` (radii,) for varpi (radii,) and a table of logarithms (radii, 3 + bodies beside).

        varpi is the half-space contact radius at the depth over the thickness. The first three columns are the
        logarithms of the factors (radius, force, stiffness over those of the half-space, see `Factor`); then, for
        each body of `variants`, d ln P/ds at fixed depth, s the parameter in which that body differs.

        Parameters
        ----------
        chi : ndarray (radii,)
            Radii in the variable of the method `chi`.
        resolution : Resolution
            Nodes that serve the largest radius.
        rtol : float, optional
            Relative error for which `resolution` was chosen. If given, and the system is large, narrower contacts
            are solved with fewer nodes, an octave of radii at a time.
        octaves : dict, optional
            Cache of those node counts by octave, filled here, for later calls up to the same largest radius.
        """
        eps = self.eps(chi)
        if rtol is None or eps.size * resolution.size < _MUCH:
            return self.on(PunchGrid.of(eps, resolution))
        known = {} if octaves is None else octaves
        top = float(eps.max())
        octave = np.minimum(np.floor(np.log2(top / eps)), _MOST_OCTAVES).astype(int)
        varpi, columns = np.empty(eps.size), np.empty((eps.size, len(Factor) + len(self.variants)))
        for number in np.unique(octave).tolist():
            rows = octave == number
            if number not in known:
                widest = 0.5**number * top
                known[number] = proved_resolution(self.kernel, widest, rtol) if number else resolution
            varpi[rows], columns[rows] = self.on(PunchGrid.of(eps[rows], known[number]))
        return varpi, columns

    def on(self, grid: PunchGrid) -> tuple[FloatArray, FloatArray]:
        """varpi (radii,) and the table of `solve` (radii, 3 + bodies) at the contact radii and nodes of a grid.

        varpi is the half-space contact radius at the depth over the thickness.
        """
        if not self.variants:
            punch = grid.solve(self.kernel.values(grid.u))
            return contact_factors(punch, self.indenter, self.measure, self.thickness)
        weights = weights_over_depth(self.indenter, self.measure, grid.rule, grid.eps * self.thickness)
        bodies, stretches = zip(
            (self.kernel, 1.0), *((body.kernel, body.thickness) for body in self.variants), strict=True
        )
        here, *there = values_of(bodies, grid.u, stretches)
        punch = grid.solve(here, weights)
        varpi, logarithms = contact_factors(punch, self.indenter, self.measure, self.thickness)
        steps = np.array([body.step for body in self.variants])
        moved = punch.in_kernel @ ((np.array(there) - here).T / steps)
        moved /= punch.depth_and_force(weights)[1][:, None]
        moved += np.array([body.log_theta for body in self.variants]) / steps
        return varpi, np.concatenate((logarithms, moved), axis=1)


def contact_factors(
    punch: PunchSolution,
    indenter: Indenter,
    measure: PowerLawShape,
    thickness: Real,
    lengths: FloatArray | None = None,
) -> tuple[FloatArray, FloatArray]:
    """varpi (..., radii) and the logarithms of the three factors (..., radii, 3) from solutions for the flat punch.

    varpi is the half-space contact radius of `measure` at the depth over the thickness; the factors are radius,
    force and stiffness over those of the half-space (see `Factor`). `thickness` (m) is a float, or (batch, 1) with
    a batch of solutions; `lengths` are the contact radii (m), to be given where several solutions share one radius.
    """
    exponent = measure.exponent
    factors = np.empty((*punch.kappa.shape, len(Factor)))
    factors[..., Factor.STIFFNESS] = punch.kappa
    if lengths is None:
        lengths = punch.eps * thickness
    depth, force = punch.depth_and_force(weights_over_depth(indenter, measure, punch.rule, lengths))
    if indenter is measure:
        swell = depth ** (1.0 / exponent)
        factors[..., Factor.RADIUS] = 1.0 / swell
        factors[..., Factor.FORCE] = (1.0 + 1.0 / exponent) * force / (depth * swell)
        return punch.eps * swell, np.log(factors, out=factors)
    shape = indenter.abel(lengths)
    depth = depth * shape
    radius = measure.halfspace_radius(depth)
    factors[..., Factor.RADIUS] = lengths / radius
    factors[..., Factor.FORCE] = (1.0 + 1.0 / exponent) * force * shape * lengths / (depth * radius)
    return radius / thickness, np.log(factors, out=factors)


def weights_over_depth(
    indenter: Indenter, measure: PowerLawShape, rule: EvenRule, lengths: FloatArray
) -> FloatArray:
    """Weights of int_0^1 H(a x)/H(a) p(x) dx, H the indenter's half-space depth, p smooth and even.

    For contact radii a = `lengths` (m): shape (..., radii, nodes); for a power law (nodes,), the same for all
    radii.
    """
    if indenter is measure:
        key = ("power", rule.nodes.size, measure.exponent)
        return TABLES.get(key, lambda: rule.power_weights(measure.exponent))
    return _shape_weights(indenter, rule, lengths) / indenter.abel(lengths)[..., None]


def _shape_weights(indenter: Indenter, rule: EvenRule, lengths: FloatArray) -> FloatArray:
    """Weights (..., radii, nodes) of int_0^1 H(a x) p(x) dx for any shape, at contact radii `lengths` (m).

    A smooth step bunches the nodes at both ends, where H may be |x|^lambda or nearly singular; p has degree
    2 n - 2, up to n half waves squeezed by two, and takes its share of them.

    H(r) is the depth at which the contact radius on a half-space is r.
    """
    count = rule.nodes.size
    nodes = (_SMOOTH_NODES if indenter.smooth else _MEASURED_NODES) + 4 * count
    fine, project = TABLES.get(("shape", nodes, count), lambda: _shape_rule(nodes, rule))
    return indenter.abel(np.multiply.outer(lengths, fine)) @ project


def _shape_rule(nodes: int, rule: EvenRule) -> tuple[FloatArray, FloatArray]:
    """Nodes x in (0, 1), (nodes,), and their weights times the interpolation from `rule`, (nodes, rule)."""
    s, weights = legendre_rule(nodes)
    s = 0.5 * (s + 1.0)
    fine = s**3 * (10.0 - s * (15.0 - 6.0 * s))
    weights = 15.0 * weights * (s * (1.0 - s)) ** 2
    project = even_legendre(fine, rule.nodes.size) @ rule.projection
    return read_only(fine), read_only(weights[:, None] * project)


@dataclass(frozen=True)
class SolvedCurve:
    """A master curve with the accuracy and the node counts of its solution.

    Parameters
    ----------
    curve : MasterCurve
        Force, contact radius and stiffness against depth, without dimensions.
    resolution : Resolution
        Node counts of the solutions behind it.
    eps : float
        Largest contact radius over thickness that was solved for.
    error_estimate : float
        Estimated relative error of force, contact radius and stiffness.
    """

    curve: MasterCurve
    resolution: Resolution
    eps: float
    error_estimate: float


def solve_curve(
    problem: ContactProblem, top: float, rtol: float, left_out: float = SHARE_OF_CURVE
) -> SolvedCurve:
    """Solve for the master curve up to `top` at relative error `rtol`.

    Parameters
    ----------
    problem : ContactProblem
        Indenter, layer and body.
    top : float
        Largest varpi, the half-space contact radius at the depth over the thickness.
    rtol : float
        Relative error allowed in force, contact radius and stiffness.
    left_out : float
        Share of `rtol` up to which small last terms of the polynomials may be dropped. Zero where curves are then
        interpolated between bodies, since each would drop other terms.

    Raises
    ------
    RangeError
        If the contact radius would pass 20 thicknesses, or the end of the indenter's shape.
    """
    guess = RadiusGuess.of(problem.scales, problem.measure.exponent)
    found = _on_grid(problem, guess, top, rtol, left_out)
    if found is not None:
        return found
    last = _widened(problem, top, guess.radius(top), rtol)
    place, last, gain = _placement(problem, guess, top, last)
    found = None if place is None else _direct(problem, place, top, last, rtol, gain, left_out)
    return found if found is not None else _by_branches(problem, top, last, rtol, gain)


def _on_grid(
    problem: ContactProblem, guess: RadiusGuess, top: float, rtol: float, left_out: float
) -> SolvedCurve | None:
    """One polynomial through radii of a cached grid that bodies much alike share; None where that misses `rtol`.

    None too where there is no such grid: on stacks, whose contacts may lie so far from the guess that estimated
    errors of 1e-6 were 1e-4 in truth, and on soft bases.
    """
    if not (problem.scales.charted and problem.scales.softest > SOFT):
        return None
    last = problem.widest(guess.radius(top))
    end = 2.0 ** (ceil(PER_OCTAVE * log2(last)) / PER_OCTAVE)
    # Up to this share of its end a shape that is no power law has its contacts where a power law has them.
    blunt = 1.0 if problem.indenter is problem.measure else 0.6
    if end > min(blunt * problem.indenter.max_radius / problem.thickness, LARGEST_EPS):
        return None
    # Rounded, so that bodies much alike share a grid: a tail longer or shorter by 5 % is within the nodes' margin.
    nodes = problem.resolution(end, rtol)
    resolution = replace(nodes, first=float(f"{nodes.first:.2g}"), reach=float(f"{nodes.reach:.2g}"))
    terms = curve_terms(problem.scales, top * end / last, problem.measure.exponent, rtol / problem.unevenness)
    wanted = Stretch.to(top, problem.scales.softness)
    while terms <= MOST_TERMS and terms * resolution.size < 0.1 * _MUCH:
        varpi, logarithms = problem.on(guess.grid(end, terms, resolution))
        if varpi[-1] < _SHORT * top:
            return None
        curve = MasterCurve.through(varpi, logarithms, wanted, left_out * rtol / problem.unevenness)
        error = problem.unevenness * curve.error_estimate
        if error <= SHARE_OF_CURVE * rtol:
            return SolvedCurve(curve, resolution, end, SHARE_OF_NODES * rtol + error)
        terms += 4
    return None


def _by_branches(problem: ContactProblem, top: float, last: float, rtol: float, gain: float) -> SolvedCurve:
    """Expand the depth in the contact radius first, then invert: works for any varpi(chi), folds included.

    `last` is the largest chi to begin with; `gain` the growth of errors from depth to radius (see `_placement`).

    varpi is the half-space contact radius at the depth over the thickness.
    """
    fine = max(rtol / gain, _FINEST)
    series, resolution = _series(problem, last, fine)
    while last < problem.end and (reached := float(series.varpi(np.array([last]))[0])) < top:
        last = _widened(problem, top, 1.02 * last * top / reached, rtol)
        series, resolution = _series(problem, last, fine)
    uneven = problem.unevenness
    curve = series.inverted(top, 0.25 * rtol / uneven)
    error = gain * (SHARE_OF_NODES * fine + uneven * series.error_estimate) + uneven * curve.error_estimate
    return SolvedCurve(curve, resolution, problem.widest(last), error)


@dataclass(frozen=True)
class RadiusGuess:
    """Guessed contact radius for a depth, a little too large: chi = varpi (1 + gain rate varpi/(1 + rate varpi)).

    varpi is the half-space contact radius at the depth and chi the contact radius (of a power law), both over the
    thickness. The gain is that of a thin incompressible layer on a rigid base, a = (F_2 (lambda+2)/2)^(1/lambda)
    a_half, lambda the exponent of the shape and F_2 its Abel factor, and two thirds of it for a compressible one;
    the rate is fitted. On a rigid base the guess is within 5 % of the solution; on an elastic one the solution
    stays below it.
    """

    gain: float
    rate: float

    @classmethod
    def of(cls, scales: Scales, exponent: float) -> Self:
        """Guess for a body, by its scales, and for the exponent of the shape."""
        gain = float((0.5 * abel_factor(exponent) * (exponent + 2.0)) ** (1.0 / exponent)) - 1.0
        gain *= (0.66 + 0.34 * scales.firmness) * max(0.0, 1.0 - 1.0 / scales.stiffest)
        return cls(gain, 0.72 * (2.0 / exponent) ** 0.4)

    def radius(self, varpi: Any) -> Any:
        """Guessed contact radius over thickness (chi) at `varpi`, a float or an array.

        chi is the radius variable of `ContactProblem.chi`, a/h for a power law.
        """
        share = self.rate * varpi
        return varpi * (1.0 + self.gain * share / (1.0 + share))

    def grid(self, end: float, terms: int, resolution: Resolution) -> PunchGrid:
        """`terms` contact radii up to a/h = `end` with the nodes of `resolution`, cached.

        Bodies of nearly the same guess share them: the guess is rounded (its gain to tenths), which moves the
        points by 3 % at most.
        """
        near = RadiusGuess(round(self.gain, 1), self.rate)
        key = ("grid", near, end, terms, resolution)
        return TABLES.get(key, lambda: PunchGrid.of(near.radii(end, terms), resolution))

    def radii(self, end: float, terms: int) -> FloatArray:
        """`terms` radii over thickness up to about `end`, with the stretched varpi at Chebyshev points.

        varpi is the half-space contact radius at the depth over the thickness.
        """
        # Where varpi is `end` the quadratic of `radius` has this root.
        half, most = 0.5 * (1.0 - self.rate * end), self.rate * (1.0 + self.gain)
        top = (sqrt(half * half + most * end) - half) / most
        return np.asarray(self.radius(Stretch.to(top, 0.0).v(np.cos(chebyshev_angles(terms)))))


def _placement(
    problem: ContactProblem, guess: RadiusGuess, top: float, last: float
) -> tuple[Callable[[FloatArray], FloatArray] | None, float, float]:
    """How to place contact radii for given varpi: a function of varpi, the largest chi, and how errors grow.

    The guess serves unless something under the surface is much softer than the layer: then a coarse solution comes
    first. Where varpi(chi) folds, or ends before `top`, radii cannot be placed beforehand, and the function is
    None. The growth of relative errors from depth to radius is the largest slope d ln chi/d ln varpi: one, except
    near a fold.

    varpi is the half-space contact radius at the depth over the thickness. chi is the radius variable
    of `ContactProblem.chi`, a/h for a power law.
    """
    if problem.scales.softest > SOFT:
        return guess.radius, last, 1.0
    branches = _series(replace(problem, variants=()), last, _COARSE)[0].branches()
    gain = min(max(_steepest(branch) for branch in branches), _LARGEST_GAIN)
    if len(branches) > 1 or branches[0].varpi[-1] < top:
        return None, last, gain
    last = 1.02 * float(np.interp(top, branches[0].varpi, branches[0].chi))
    return partial(_interpolated, branches[0]), min(last, problem.end), gain


def _interpolated(branch: Branch, varpi: FloatArray) -> FloatArray:
    return np.interp(varpi, branch.varpi, branch.chi)


def _steepest(branch: Branch) -> float:
    slope = np.diff(np.log(branch.chi[1:])) / np.diff(np.log(branch.varpi[1:]))
    return max(1.0, float(slope.max(initial=1.0)))


def _direct(
    problem: ContactProblem,
    place: Callable[[FloatArray], FloatArray],
    top: float,
    last: float,
    rtol: float,
    gain: float,
    left_out: float,
) -> SolvedCurve | None:
    """One polynomial in varpi through radii placed beforehand; None where that does not reach `rtol`.

    `place` maps varpi to chi, `last` is the largest chi, and `gain` the growth of errors, all from `_placement`;
    the other parameters are those of `solve_curve`.

    varpi is the half-space contact radius at the depth over the thickness. chi is the radius variable
    of `ContactProblem.chi`, a/h for a power law.
    """
    wanted = Stretch.to(top, problem.scales.softness)
    fine = max(rtol / gain, _FINEST)
    widen = last / float(place(np.array([top]))[0])
    terms = curve_terms(problem.scales, top, problem.measure.exponent, rtol / problem.unevenness)
    if terms > MOST_TERMS:
        return None
    eps = problem.widest(last)
    resolution = problem.resolution(eps, fine)
    while terms <= MOST_TERMS:
        targets = wanted.v(np.cos(chebyshev_angles(terms)))
        varpi, logarithms = problem.solve(place(targets) * widen, resolution, fine)
        if varpi[-1] < _SHORT * targets[-1] and last < problem.end:
            wider = _widened(problem, top, 1.05 * last * float(targets[-1] / varpi[-1]), rtol)
            widen, last, eps = widen * wider / last, wider, problem.widest(wider)
            resolution = problem.resolution(eps, fine)
            continue
        curve = MasterCurve.through(varpi, logarithms, wanted, left_out * rtol / problem.unevenness)
        # Towards a fold the terms fall unevenly: of 2000 curves two there were 1.3 of what their last terms say.
        error = gain * problem.unevenness * curve.error_estimate
        if error <= SHARE_OF_CURVE * rtol:
            return SolvedCurve(curve, resolution, eps, gain * SHARE_OF_NODES * fine + error)
        terms += 4
    return None


def _series(problem: ContactProblem, last: float, rtol: float) -> tuple[RadiusSeries, Resolution]:
    """Solve at Chebyshev points in chi up to `last`, and expand in chi with as many terms as `rtol` takes.

    chi is the radius variable of `ContactProblem.chi`, a/h for a power law.
    """
    stretch = Stretch.to(last, problem.scales.softness)
    # What is asked for to place the radii of another solution needs no proof.
    nodes = problem.resolution if rtol < _COARSE else partial(Resolution.choose, problem.scales)
    resolution = nodes(problem.widest(last), rtol)
    terms = series_terms(problem.scales, last, rtol / problem.unevenness)
    octaves: dict[int, Resolution] = {}
    while True:
        angles = chebyshev_angles(terms)
        chi = stretch.v(np.cos(angles))
        varpi, logarithms = problem.solve(chi, resolution, rtol, octaves)
        values = np.column_stack((logarithms, np.log(varpi / chi)))
        # What is left of the radius is ln(eps/chi): smooth, and zero for a power law. Slopes towards other bodies
        # are those at fixed depth, which a change of the radius leaves as they are.
        values[:, Factor.RADIUS] += values[:, -1]
        series = RadiusSeries(stretch, chebyshev_coefficients(values, angles))
        missed = problem.unevenness * series.error_estimate / (SHARE_OF_NODES * rtol)
        if missed <= 1.0 or 2 * terms > _MOST_SERIES_TERMS:
            return series, resolution
        # The terms fall at a steady rate: as many more as the digits that are missing.
        share = log(missed) / -log(min(series.error_estimate, 0.1))
        terms += ceil(terms * min(max(share, _MORE), 0.5))


def _widened(problem: ContactProblem, top: float, wider: float, rtol: float) -> float:
    """Return `wider` as the next largest chi, or the end of the range if it is beyond.

    At the end, RangeError is raised if varpi = `top` is not reached there. Without this check the curve would be
    extrapolated: over a thin layer a sphere's contact reaches its equator long before the guess does.

    varpi is the half-space contact radius at the depth over the thickness. chi is the radius variable
    of `ContactProblem.chi`, a/h for a power law.
    """
    if wider >= problem.end:
        _check_reach(problem, top, rtol)
        return problem.end
    return wider


def _check_reach(problem: ContactProblem, top: float, rtol: float) -> None:
    """Raise RangeError if varpi = `top` needs a contact radius beyond the end of the shape or of a/h = 20.

    varpi is the half-space contact radius at the depth over the thickness.
    """
    end = problem.end
    last = float(problem.solve(np.array([end]), problem.resolution(problem.widest(end), rtol))[0][0])
    if last >= top:
        return
    raise out_of_reach(problem, top, last)


def out_of_reach(problem: ContactProblem, top: float, last: float) -> RangeError:
    """RangeError for varpi = `top` where the shape or a/h = 20 ends the contact at varpi = `last`.

    varpi is the half-space contact radius at the depth over the thickness.
    """
    asked, deepest = problem.measure.abel(np.array([top, last]) * problem.thickness).tolist()
    if problem.indenter.max_radius >= LARGEST_EPS * problem.thickness:
        return too_wide(asked, deepest)
    why = "there the contact reaches the end of the indenter's shape; use a larger radius or less depth"
    return RangeError(_beyond(asked, deepest, why), max_depth=deepest)


def too_wide(asked: float, deepest: float) -> RangeError:
    """RangeError for a depth `asked` (m) that needs a/h > 20; `deepest` (m) is the depth at which a/h = 20."""
    why = (
        f"there the contact radius is {LARGEST_EPS:g} thicknesses; use less depth or, for contacts wider still, "
        "the half-space law of the substrate"
    )
    return RangeError(_beyond(asked, deepest, why), max_depth=deepest)


def _beyond(asked: float, deepest: float, why: str) -> str:
    return f"depth {asked:.6g} m is beyond the largest that works here, {deepest:.6g} m: {why}"
