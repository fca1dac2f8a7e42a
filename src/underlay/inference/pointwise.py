"""Modulus by depth, E(w): the layer modulus that reproduces what a curve shows at each depth w by itself.

Two moduli at each depth, each for a half-space and for the layer on what it stands on:

- apparent: the modulus at which the law has the force that was measured at that depth;
- incremental: the modulus at which it has the local slope dP/dw of force P (Argatov and Sabina, 9.1), which does
  not depend on shallower depths.

Both are the fit's modulus times the ratio of the elastic moduli by which data and fitted model are reproduced at
the depth: what a sample with memory (relaxation, drainage) has lost by then is in both. Where the model is right
the modulus with the layer is that of the fit at every depth, and the half-space's is a curve that can be predicted.
Contact point, baseline and all other numbers are those of the fit, with their uncertainty.

The force and slope at a depth are means over a bin, relative to the fitted model: in every bin a straight line is
fitted to the residuals of the fit, and its value at the middle of the bin is added to the model there. Where the
model is right the line is zero, however curved the model is in the bin.

Every modulus of the layer is multiplied by one factor, the share, their ratios kept. Where the layer's are the only
moduli of the sample, P and dP/dw are proportional to the share. On an elastic base they are not, and the share is
interpolated between the laws of a ladder of shares.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy import interpolate, special

from underlay._arrays import FloatArray
from underlay.data.segments import LOADING
from underlay.errors import CurveError, InputError
from underlay.inference.least_squares.fit_result import Fit
from underlay.inference.model.forward import Forward
from underlay.inference.model.laws import LawStore
from underlay.inference.model.members import Member
from underlay.inference.uncertainty.answer import KINDS, ModulusCurve, PointwiseModulus
from underlay.inference.uncertainty.verdict import SURE, change_with_depth
from underlay.mechanics.body import Layer
from underlay.mechanics.contact_law import ContactLaw
from underlay.mechanics.solver import Solver
from underlay.scene.instrument import Chain, ContactDepth
from underlay.scene.scene import Scene

# Readings of a bin at least: fewer say nothing of their own scatter.
_FEWEST = 8
# Half of an interval over the expected modulus beyond which a modulus is not shown.
_KNOWN = 1.0
# Factor to which the shares of the ladder reach to both sides, and how many there are. ln P is a smooth function of
# ln share; a cubic through rungs ln 30 / 8 apart is within 2e-5 of it, one of ln dP/dw within 5e-5
# (test_pointwise.py holds both).
_REACH, _RUNGS = 30.0, 17


def _bins(fit: Fit, curve: int, contact: float, most: int) -> tuple[NDArray[np.intp], ...]:
    """Indices of the readings beyond contact in each of `most` bins of equal width, or of fewer.

    Of a curve with loading and unloading only the loading part is taken. `curve` is the number of the curve in the
    fit, `contact` the depth reading of the contact (m).

    Raises
    ------
    CurveError
        If fewer than two bins could be filled.
    """
    measured = fit.curves[curve]
    inside = measured.depth > contact
    labels = measured.segments()
    if (labels == LOADING).any():
        inside &= labels == LOADING
    used = np.flatnonzero(inside)
    count = min(most, len(used) // _FEWEST)
    if count < 2:
        raise CurveError(
            f"a modulus depth by depth needs {2 * _FEWEST} points beyond contact; there are {len(used)}"
        )
    depth = measured.depth[used]
    edges = np.linspace(contact, depth.max(), count + 1)
    which = np.minimum(np.searchsorted(edges, depth, side="right") - 1, count - 1)
    groups = [used[which == k] for k in range(count)]
    filled = tuple(own for own in groups if len(own) >= _FEWEST // 2)
    if len(filled) < 2:
        raise CurveError("a modulus depth by depth needs points at several depths beyond contact")
    return filled


def _residuals_in(fit: Fit, curve: int, bins: Sequence[NDArray[np.intp]], centre: FloatArray) -> FloatArray:
    """Residuals of a fit in depth bins, from a straight line through each, weighted by the noise.

    The error of a slope falls with the width of a bin to the power 3/2: slopes are those of the bin and its
    neighbours.

    Returns
    -------
    FloatArray
        Data minus model (N) at the `centre` (n,) of each of the bins, and its derivative along the depth (N/m);
        second axis the estimate and its standard error, (2, 2, n).
    """
    depth, (sigma, inflation) = fit.curves[curve].depth, _noise_in(fit, curve, bins, centre)
    wide = [np.concatenate(bins[max(k - 1, 0) : k + 2]) for k in range(len(bins))]
    found = np.zeros((2, 2, len(bins)))
    for which, groups in enumerate((bins, wide)):
        for k, points in enumerate(groups):
            residual, own = fit.residuals[curve][points], sigma[points]
            design = _design(depth[points] - centre[k])
            covariance = np.linalg.inv((design / own[:, None] ** 2).T @ design)
            found[which, 0, k] = (covariance @ design.T @ (residual / own**2))[which]
            found[which, 1, k] = inflation * np.sqrt(covariance[which, which])
    return found


def _design(offset: FloatArray) -> FloatArray:
    return np.stack((np.ones_like(offset), offset), axis=1)


def _noise_in(
    fit: Fit, curve: int, bins: Sequence[NDArray[np.intp]], centre: FloatArray
) -> tuple[FloatArray, float]:
    """Noise of the readings about a straight line in every bin: as given to the fit, else from the scatter.

    Misfit that changes slowly with depth does not count as noise: the modulus is to show it. Errors of means grow
    by sqrt((1 + r) / (1 - r)) where neighbours are correlated by r (AR(1)).

    Returns
    -------
    sigma : FloatArray
        Standard deviation of every reading of the curve (N).
    inflation : float
        Factor by which correlation makes errors of means larger than those of independent readings.
    """
    depth, sigma = fit.curves[curve].depth, fit.sigmas[curve]
    square = product = freedom = 0.0
    for k, points in enumerate(bins):
        z = fit.residuals[curve][points] / sigma[points]
        design = _design(depth[points] - centre[k])
        left = z - design @ np.linalg.lstsq(design, z, rcond=None)[0]
        square += float(left @ left)
        product += float(left[1:] @ left[:-1])
        freedom += len(points) - 2
    variance = square / max(freedom, 1.0)
    correlation = min(max(product / max(square, np.finfo(float).tiny), 0.0), 0.99)
    size = 1.0 if fit.problem.noise_is_stated and not fit.statistics.noise_estimated else np.sqrt(variance)
    return sigma * size, float(np.sqrt((1.0 + correlation) / (1.0 - correlation)))


@dataclass(frozen=True, eq=False)
class BinnedCurve:
    """One curve of a fit in n depth bins, with the two scenes for which moduli are computed.

    Parameters
    ----------
    fit : Fit
        The fit.
    curve : int
        Number of the curve.
    bins : tuple of ndarray of int
        Indices of the curve's readings in each bin.
    centre : FloatArray
        Mean depth reading (m) of each bin, (n,).
    residuals : FloatArray
        Residuals of the fit in each bin, as `_residuals_in` returns them.
    layer, bare : Body
        The scene, and the same with the layer as a half-space.
    bare_numbers : mapping of str to float
        Every number (SI) of the half-space.
    """

    fit: Fit
    curve: int
    bins: tuple[NDArray[np.intp], ...]
    centre: FloatArray
    residuals: FloatArray
    layer: Body
    bare: Body
    bare_numbers: Mapping[str, float]

    @classmethod
    def of(cls, fit: Fit, curve: int, points: int) -> BinnedCurve:
        """Group the readings of a curve into at most `points` bins, and compile the scenes for their depths."""
        member, scene = fit.problem.members[curve], fit.scenes[curve]
        if scene.adheres:
            raise InputError(
                "the modulus depth by depth is not defined for a tip that sticks: work of adhesion and modulus "
                "would be two unknowns of one force; read the fit's own modulus"
            )
        contact = member.values_at(fit.problem.physical(fit.vector))[ContactDepth.path]
        bins = _bins(fit, curve, contact, points)
        centre = np.array([float(fit.curves[curve].depth[own].mean()) for own in bins])
        free, bare = tuple(member.entries), halfspace_of(scene)
        return cls(
            fit=fit,
            curve=curve,
            bins=bins,
            centre=centre,
            residuals=_residuals_in(fit, curve, bins, centre),
            layer=Body.of(scene, centre, free, fit.solver),
            bare=Body.of(bare, centre, free, fit.solver),
            bare_numbers=bare.parameters,
        )

    @property
    def member(self) -> Member:
        """The compiled curve."""
        return self.fit.problem.members[self.curve]

    @cached_property
    def numbers(self) -> dict[str, float]:
        """Every number of the fitted scene (SI) by path."""
        return self.member.values_at(self.fit.problem.physical(self.fit.vector))

    @cached_property
    def measured(self) -> tuple[FloatArray, FloatArray]:
        """Measured force (N) and slope (N/m) in each bin, (n,)."""
        force, slope = self.model(self.fit.problem.physical(self.fit.vector))
        return force + self.residuals[0, 0], slope + self.residuals[1, 0]

    def model(self, physical: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Force reading (N) and its slope (N/m) by the model at the centre of each bin, (n,).

        `physical` are the parameters (k,), SI.
        """
        if self.member.scene.memory is None:
            return self.layer.reading(self.member.values_at(physical))
        # A sample with memory has a force at the measured times only: a parabola through the readings of each bin.
        force, depth = self.member.model(physical), self.member.curve.depth
        parabolas = [
            np.polynomial.Polynomial.fit(depth[own] - centre, force[own], 2).convert(domain=[-1.0, 1.0])
            for own, centre in zip(self.bins, self.centre, strict=True)
        ]
        return (
            np.array([parabola(0.0) for parabola in parabolas]),
            np.array([parabola.deriv()(0.0) for parabola in parabolas]),
        )

    def moduli(self, physical: FloatArray) -> FloatArray:
        """Moduli (Pa) at parameters (k,), SI, (8, n): of the data by the names in `KINDS`, then of the model.

        The model's with its layer are the fit's modulus.
        """
        values = self.member.values_at(physical)
        bare = {p: values[p] if p in self.member.entries else v for p, v in self.bare_numbers.items()}
        model = self.model(physical)
        elastic: FloatArray = np.concatenate(
            [
                body.explain(numbers, *readings)[:2]
                for readings in (self.measured, model)
                for body, numbers in ((self.layer, values), (self.bare, bare))
            ]
        )
        remaining = np.tile(elastic[4:6] / values["layer.E"], (4, 1))
        moduli = np.full_like(elastic, np.nan)
        np.divide(elastic, remaining, out=moduli, where=remaining != 0.0)
        return moduli

    def curves(self, level: float) -> dict[str, ModulusCurve]:
        """The four moduli with their intervals at a confidence `level`, by the names in `KINDS`."""
        n, z = len(self.centre), float(special.ndtri(0.5 * (1.0 + level)))

        def of(draws: FloatArray) -> FloatArray:
            return np.array([self.moduli(draw).ravel() for draw in draws])

        low, middle, high = (end.reshape(8, n) for end in self.fit.band(of, level))
        layer = self.layer.explain(self.numbers, *self.measured)
        # Relative standard errors of contact force and stiffness, from the noise in each bin. The derivative of
        # dP/dw = s / (1 - C s) in s is its square over s squared.
        contact = self.layer.contact(self.numbers, *self.measured)
        along = self.measured[1] - self.numbers["instrument.baseline_slope"]
        force_error, slope_error = self.residuals[:, 1]
        error = force_error / np.abs(contact.force), slope_error * np.abs(contact.stiffness / along**2)
        powers = (layer.apparent_power, layer.incremental_power, np.ones(n), np.ones(n))
        found = {}
        for row, (name, power) in enumerate(zip(KINDS, powers, strict=True)):
            widened = _widened(low[row], middle[row], high[row], z * power * error[row % 2])
            positive = np.where(middle[row] > 0.0, middle[row], np.nan)
            found[name] = ModulusCurve(positive, *widened, expected=middle[4 + row])
        return found


def _widened(
    low: FloatArray, middle: FloatArray, high: FloatArray, own: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Ends of intervals of moduli with a further uncertainty added in quadrature, in the logarithm.

    Parameters
    ----------
    low, middle, high : FloatArray
        Ends and values of the moduli (Pa), (n,).
    own : FloatArray
        Half width of ln(modulus) to add, (n,). From 1 on the force may as well be zero, so that the ends are open.

    Returns
    -------
    tuple of FloatArray
        New lower and upper ends (Pa), (n,); NaN where there is no modulus, infinite where an end is open.
    """
    known = np.isfinite(middle) & (middle > 0.0)
    closed = known & np.isfinite(high) & (low > 0.0) & (own < 1.0)
    ends = np.where(known, -np.inf, np.nan), np.where(known, np.inf, np.nan)
    for end, limit, sign in zip(ends, (low, high), (-1.0, 1.0), strict=True):
        half = np.hypot(np.log(limit[closed] / middle[closed]), own[closed])
        end[closed] = middle[closed] * np.exp(sign * half)
    return ends


def modulus_by_depth(fit: Fit, *, curve: int = 0, points: int = 30, level: float = 0.95) -> PointwiseModulus:
    """Modulus of the layer at each depth of one curve of a fit; see `pointwise_modulus`."""
    if not 0 <= curve < len(fit.curves):
        raise InputError(f"curve must be a number from 0 to {len(fit.curves) - 1}; got {curve!r}")
    if points < 2 or not 0.0 < level <= 0.999:
        raise InputError(
            f"points must be 2 or more and level above 0 and at most 0.999; got {points!r} and {level!r}"
        )
    binned = BinnedCurve.of(fit, curve, points)
    curves = binned.curves(level)
    apparent = curves["apparent"]
    # Compared with the expected modulus: a depth must not be shown only because noise made its modulus large.
    shown = np.isfinite(apparent.high) & (apparent.high - apparent.low < 2.0 * _KNOWN * apparent.expected)
    if not shown.any():
        raise CurveError(
            "the modulus is known at no single depth: the noise is as large as the force, or"
            " the contact point is open"
        )
    contact = binned.layer.contact(binned.numbers, *binned.measured)
    # One test of the whole curve: of some thirty intervals of 95 % one misses the fit in most curves by chance.
    change, deviation = change_with_depth(fit, curve)
    return PointwiseModulus(
        name=str(fit.curves[curve].metadata.get("name") or ""),
        depth=contact.depth[shown],
        force=contact.force[shown],
        points=np.array([len(own) for own in binned.bins], dtype=float)[shown],
        layered=fit.problem.base_scenes[curve].substrate is not None,
        level=level,
        change=change,
        trend="constant" if abs(change) < SURE * deviation else "rising" if change > 0.0 else "falling",
        **{name: found.at(shown) for name, found in curves.items()},
    )


class Explained(NamedTuple):
    """Layer moduli (Pa) that reproduce n measured forces and stiffnesses, and their sensitivity.

    NaN where no modulus of the range that is tried reproduces them.

    Parameters
    ----------
    apparent, incremental : FloatArray
        Modulus (Pa) from the force P and from the stiffness S = dP/dw, w the depth, (n,).
    apparent_power, incremental_power : FloatArray
        d ln(modulus) / d ln(P), and d ln(modulus) / d ln(S), (n,).
    """

    apparent: FloatArray
    incremental: FloatArray
    apparent_power: FloatArray
    incremental_power: FloatArray


@dataclass(frozen=True)
class Body:
    """An elastic scene whose law is inverted for the layer's modulus.

    Parameters
    ----------
    forward : Forward
        Compiled for the depths at which it is evaluated.
    moduli : tuple of str
        Paths of the layer's moduli.
    proportional : bool
        Whether they are the only moduli of the sample, so that the force is proportional to them.
    """

    forward: Forward
    moduli: tuple[str, ...]
    proportional: bool

    @classmethod
    def of(
        cls,
        scene: Scene,
        depth: FloatArray,
        free: tuple[str, ...],
        solver: Solver,
    ) -> Body:
        """Compile `scene` without its memory for depth readings (m), (n,), where the paths `free` vary."""
        elastic = scene.elastic
        known = elastic.quantities
        moduli = tuple(p for p in known if p.startswith("layer.") and known[p].scales == "force")
        others = [
            p
            for p in known
            if p not in moduli
            and p.startswith(("layer.", "substrate."))
            and known[p].kind in ("pressure", "stiffness per area")
        ]
        paths = tuple(dict.fromkeys((*moduli, *(p for p in free if p in known))))
        forward = Forward.compile(elastic, depth, paths, solver, LawStore())
        return cls(forward, moduli, not others)

    def explain(self, values: Mapping[str, float], force: FloatArray, slope: FloatArray) -> Explained:
        """Layer moduli that reproduce force readings and their slopes, each (n,).

        Parameters
        ----------
        values : mapping of str to float
            Every number of the scene (SI).
        force, slope : FloatArray
            Force readings (N) and their derivative along the depth readings (N/m).

        Raises
        ------
        InputError
            If these are no values of a possible scene, or its law does not reach as deep.
        """
        contact = self.contact(values, force, slope)
        E = values["layer.E"]
        if self.proportional:
            P, S = self._law(values, 1.0, contact.depth).force_and_stiffness(contact.depth)
            ones = np.ones_like(P)
            return Explained(E * _ratio(contact.force, P), E * _ratio(contact.stiffness, S), ones, ones)
        log_shares = np.linspace(-np.log(_REACH), np.log(_REACH), _RUNGS)
        rungs = [
            self._law(values, float(share), contact.depth).force_and_stiffness(contact.depth)
            for share in np.exp(log_shares)
        ]
        P, S = (np.array(column) for column in zip(*rungs, strict=True))
        apparent, apparent_power = _looked_up(P, contact.force, log_shares)
        incremental, incremental_power = _looked_up(S, contact.stiffness, log_shares)
        return Explained(E * np.exp(apparent), E * np.exp(incremental), apparent_power, incremental_power)

    def contact(self, values: Mapping[str, float], force: FloatArray, slope: FloatArray) -> Contacts:
        """Tip depth (m), contact force (N) and stiffness dP/dw (N/m), each (n,), from force readings and slopes.

        `force` (N) and `slope` (N/m) are (n,), `values` all numbers of the scene (SI) by path.
        """
        chain, depth = Chain.of(values), self.forward.depth
        compliance = 0.0 if chain.frame is None else chain.frame.compliance
        P = force - chain.reading(np.zeros_like(depth), depth)
        along = slope - values.get("instrument.baseline_slope", 0.0)
        # dw = dd - C dP, less what a lever bends beyond what was taken off: (sigma - 1) dF / k.
        beyond = float(self.forward.lever_compliances(values))
        travel = chain.travel(depth - beyond * force)
        return Contacts(travel - compliance * P, P, along / (1.0 - beyond * slope - compliance * along))

    def reading(self, values: Mapping[str, float]) -> tuple[FloatArray, FloatArray]:
        """Force reading of the model (N) and its slope along the depth readings (N/m), each (n,).

        `values` are all numbers of the scene (SI) by path.
        """
        chain = Chain.of(values)
        found = self.forward.reading(values)
        share = np.ones_like(found.force) if chain.frame is None else chain.frame.share(found.stiffness)
        tilt = values.get("instrument.baseline_slope", 0.0)
        # Of a lever of spring constant k whose sensitivity is sigma times what was calibrated:
        # dF/dd = S share (1 - (sigma - 1)/k dF/dd) + tilt
        beyond = float(self.forward.lever_compliances(values))
        slope = found.stiffness * share
        return found.force, (slope + tilt) / (1.0 + beyond * slope)

    def _law(self, values: Mapping[str, float], share: float, depth: FloatArray) -> ContactLaw:
        shared = {path: share * values[path] for path in self.moduli}
        return self.forward.law({**values, **shared}, float(depth.max()))


class Contacts(NamedTuple):
    """Tip depths (m), contact forces (N) and stiffnesses (N/m), each (n,)."""

    depth: FloatArray
    force: FloatArray
    stiffness: FloatArray


def halfspace_of(scene: Scene) -> Scene:
    """Return the scene with the layer made infinitely thick: what a half-space formula assumes."""
    layer = Layer(scene.layer.material, relaxation=scene.layer.relaxation)
    return Scene(
        scene.indenter,
        layer,
        None,
        scene.instrument,
        scene.history,
        adhesion=scene.adhesion,
        lever=scene.lever,
    )


def _ratio(measured: FloatArray, by_law: FloatArray) -> FloatArray:
    """Quotient (n,); nan before contact, where the law has no force that a modulus could scale."""
    return np.divide(measured, by_law, out=np.full_like(by_law, np.nan), where=by_law > 0.0)


def _looked_up(
    rungs: FloatArray, targets: FloatArray, log_shares: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """ln of the share at which each column of computed values reaches its target, by interpolation.

    The share is the factor on the layer's moduli.

    Parameters
    ----------
    rungs : FloatArray
        Forces or stiffnesses by the laws of the ladder, (laws, n).
    targets : FloatArray
        Measured ones, (n,).
    log_shares : FloatArray
        ln of the share of each law, (laws,).

    Returns
    -------
    tuple of FloatArray
        ln share, and d ln share / d ln target, (n,); NaN where the ladder does not reach the target.
    """
    found, power = np.full(len(targets), np.nan), np.full(len(targets), np.nan)
    for n, target in enumerate(targets):
        column = rungs[:, n]
        if not (target > 0.0 and column[0] > 0.0 and (np.diff(column) > 0.0).all()):
            continue
        if not column[0] <= target <= column[-1]:
            continue
        curve = interpolate.CubicSpline(np.log(column), log_shares)
        found[n], power[n] = curve(np.log(target)), curve(np.log(target), 1)
    return found, power
