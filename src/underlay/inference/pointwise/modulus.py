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
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy import special

from underlay._arrays import FloatArray
from underlay.data.segments import LOADING
from underlay.errors import CurveError, InputError
from underlay.inference.least_squares.fit_result import Fit
from underlay.inference.model.members import Member
from underlay.inference.pointwise.explained import Body, halfspace_of, require_without_adhesion
from underlay.inference.pointwise.result import KINDS, ModulusCurve, PointwiseModulus
from underlay.inference.uncertainty.verdict import SURE, change_with_depth
from underlay.scene.instrument import ContactDepth

# Readings of a bin at least: fewer say nothing of their own scatter.
_FEWEST = 8
# Half of an interval over the expected modulus beyond which a modulus is not shown.
_KNOWN = 1.0


@dataclass(frozen=True)
class Bins:
    """Readings of one curve, grouped by depth.

    Parameters
    ----------
    centre : FloatArray
        Mean depth reading (m) of each bin, (n,).
    points : tuple of arrays of int
        Indices of the curve's readings in each bin.
    """

    centre: FloatArray
    points: tuple[NDArray[np.intp], ...]


@dataclass(frozen=True)
class Residuals:
    """Residuals of a fit in depth bins, from a straight line through each, with standard errors.

    Parameters
    ----------
    force, slope : FloatArray
        Data minus model (N) at the centre of each bin, and its derivative along the depth (N/m), (n,).
    force_error, slope_error : FloatArray
        Their standard errors, (n,).
    """

    force: FloatArray
    slope: FloatArray
    force_error: FloatArray
    slope_error: FloatArray


@dataclass(frozen=True)
class Noise:
    """Noise of the readings of one curve.

    Parameters
    ----------
    sigma : FloatArray
        Standard deviation of every reading (N).
    inflation : float
        Factor by which correlation makes errors of means larger than those of independent readings.
    """

    sigma: FloatArray
    inflation: float


def bins_of(fit: Fit, curve: int, contact: float, most: int) -> Bins:
    """Group the readings beyond contact into bins of equal width.

    Of a curve with loading and unloading only the loading part is taken.

    Parameters
    ----------
    fit : Fit
        The fit.
    curve : int
        Number of the curve.
    contact : float
        Depth reading of the contact (m).
    most : int
        Largest number of bins.

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
    filled = [k for k in range(count) if np.count_nonzero(which == k) >= _FEWEST // 2]
    if len(filled) < 2:
        raise CurveError("a modulus depth by depth needs points at several depths beyond contact")
    return Bins(
        np.array([float(depth[which == k].mean()) for k in filled]),
        tuple(used[which == k] for k in filled),
    )


def residuals_in(fit: Fit, curve: int, bins: Bins, noise: Noise) -> Residuals:
    """Fit a straight line to the residuals in every bin, weighted by the noise.

    The error of a slope falls with the width of a bin to the power 3/2: slopes are those of the bin and its
    neighbours. `curve` is the number of the curve in the fit.
    """
    force, force_error = _lines(fit, curve, bins.points, bins.centre, noise)[0]
    wide = tuple(np.concatenate(bins.points[max(k - 1, 0) : k + 2]) for k in range(len(bins.points)))
    slope, slope_error = _lines(fit, curve, wide, bins.centre, noise)[1]
    return Residuals(force, slope, force_error, slope_error)


def _lines(
    fit: Fit, curve: int, groups: Sequence[NDArray[np.intp]], centre: FloatArray, noise: Noise
) -> FloatArray:
    """Value and slope of a straight line through the residuals of each group, and their errors, (2, 2, n).

    Parameters
    ----------
    fit, curve : Fit, int
        The fit, and the number of the curve.
    groups : sequence of ndarray of int
        Indices of the readings in each of the n groups.
    centre : FloatArray
        Depth readings (m) at which the value is taken, (n,).
    noise : Noise
        Noise of the readings.

    Returns
    -------
    FloatArray
        First axis estimate and standard error, second value (N) and slope (N/m).
    """
    depth = fit.curves[curve].depth
    found = np.zeros((2, 2, len(groups)))
    for k, points in enumerate(groups):
        residual, sigma = fit.residuals[curve][points], noise.sigma[points]
        design = _design(depth[points] - centre[k])
        covariance = np.linalg.inv((design / sigma[:, None] ** 2).T @ design)
        found[:, 0, k] = covariance @ design.T @ (residual / sigma**2)
        found[:, 1, k] = noise.inflation * np.sqrt(np.diag(covariance))
    return found


def _design(offset: FloatArray) -> FloatArray:
    return np.stack((np.ones_like(offset), offset), axis=1)


def noise_in(fit: Fit, curve: int, bins: Bins) -> Noise:
    """Noise of the readings about a straight line in every bin: as given to the fit, else from the scatter.

    Misfit that changes slowly with depth does not count as noise: the modulus is to show it. Errors of means grow
    by sqrt((1 + r) / (1 - r)) where neighbours are correlated by r (AR(1)).
    """
    depth, sigma = fit.curves[curve].depth, fit.sigmas[curve]
    square = product = freedom = 0.0
    for k, points in enumerate(bins.points):
        z = fit.residuals[curve][points] / sigma[points]
        design = _design(depth[points] - bins.centre[k])
        left = z - design @ np.linalg.lstsq(design, z, rcond=None)[0]
        square += float(left @ left)
        product += float(left[1:] @ left[:-1])
        freedom += len(points) - 2
    variance = square / max(freedom, 1.0)
    correlation = min(max(product / max(square, np.finfo(float).tiny), 0.0), 0.99)
    size = 1.0 if fit.problem.noise_is_stated and not fit.statistics.noise_estimated else np.sqrt(variance)
    return Noise(sigma * size, float(np.sqrt((1.0 + correlation) / (1.0 - correlation))))


@dataclass(frozen=True, eq=False)
class BinnedCurve:
    """One curve of a fit in depth bins, with the two scenes for which moduli are computed.

    Parameters
    ----------
    fit : Fit
        The fit.
    curve : int
        Number of the curve.
    optimum : FloatArray
        Parameters (k,), SI, of the fit.
    bins : Bins
        Its readings by depth.
    residuals : Residuals
        Residuals of the fit in each bin.
    layer, bare : Body
        The scene, and the same with the layer as a half-space.
    bare_numbers : mapping of str to float
        Every number (SI) of the half-space.
    measured : tuple of FloatArray
        Measured force (N) and slope (N/m) in each bin, (n,).
    """

    fit: Fit
    curve: int
    optimum: FloatArray
    bins: Bins
    residuals: Residuals
    layer: Body
    bare: Body
    bare_numbers: Mapping[str, float]
    measured: tuple[FloatArray, FloatArray]

    @classmethod
    def of(cls, fit: Fit, curve: int, points: int) -> BinnedCurve:
        """Group the readings of a curve into at most `points` bins, and compile the scenes for their depths."""
        member, scene = fit.problem.members[curve], fit.scenes[curve]
        require_without_adhesion(scene)
        optimum = fit.problem.physical(fit.vector)
        bins = bins_of(fit, curve, member.values_at(optimum)[ContactDepth.path], points)
        free, bare = tuple(member.entries), halfspace_of(scene)
        made = cls(
            fit=fit,
            curve=curve,
            optimum=optimum,
            bins=bins,
            residuals=residuals_in(fit, curve, bins, noise_in(fit, curve, bins)),
            layer=Body.of(scene, bins.centre, free, fit.solver),
            bare=Body.of(bare, bins.centre, free, fit.solver),
            bare_numbers=bare.parameters,
            measured=(bins.centre, bins.centre),
        )
        force, slope = made.model(fit.problem.physical(fit.vector))
        return replace(made, measured=(force + made.residuals.force, slope + made.residuals.slope))

    @property
    def member(self) -> Member:
        """The compiled curve."""
        return self.fit.problem.members[self.curve]

    def values(self, physical: FloatArray) -> dict[str, float]:
        """Every number of the scene (SI) by path, at parameters (k,), SI."""
        return self.member.values_at(physical)

    def model(self, physical: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Force reading (N) and its slope (N/m) by the model at the centre of each bin, (n,).

        `physical` are the parameters (k,), SI.
        """
        if self.member.scene.memory is None:
            return self.layer.reading(self.values(physical))
        # A sample with memory has a force at the measured times only: a parabola through the readings of each bin.
        force, depth = self.member.model(physical), self.member.curve.depth
        parabolas = [
            np.polynomial.Polynomial.fit(depth[own] - centre, force[own], 2).convert(domain=[-1.0, 1.0])
            for own, centre in zip(self.bins.points, self.bins.centre, strict=True)
        ]
        return (
            np.array([parabola(0.0) for parabola in parabolas]),
            np.array([parabola.deriv()(0.0) for parabola in parabolas]),
        )

    def moduli(self, physical: FloatArray) -> FloatArray:
        """Moduli (Pa) at parameters (k,), SI, (8, n): of the data by the names in `KINDS`, then of the model.

        The model's with its layer are the fit's modulus.
        """
        values = self.values(physical)
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
        n, z = len(self.bins.centre), float(special.ndtri(0.5 * (1.0 + level)))

        def of(draws: FloatArray) -> FloatArray:
            return np.array([self.moduli(draw).ravel() for draw in draws])

        ends = self.fit.band(of, level)
        low, middle, high = (end.reshape(8, n) for end in ends)
        layer = self.layer.explain(self.values(self.optimum), *self.measured)
        error = self._relative_errors(self.optimum)
        powers = (layer.apparent_power, layer.incremental_power, np.ones(n), np.ones(n))
        found = {}
        for row, (name, power) in enumerate(zip(KINDS, powers, strict=True)):
            own = z * power * error[row % 2]
            widened = _widened(low[row], middle[row], high[row], own)
            positive = np.where(middle[row] > 0.0, middle[row], np.nan)
            found[name] = ModulusCurve(positive, *widened, expected=middle[4 + row])
        return found

    def _relative_errors(self, physical: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Relative standard errors of contact force and stiffness in each bin, (n,), from the noise in that bin.

        `physical` are the parameters (k,), SI.
        """
        values = self.values(physical)
        contact = self.layer.contact(values, *self.measured)
        along = self.measured[1] - values["instrument.baseline_slope"]
        # dP/dw = s / (1 - C s): its derivative in s is its square over s squared.
        force = self.residuals.force_error / np.abs(contact.force)
        return force, self.residuals.slope_error * np.abs(contact.stiffness / along**2)


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
    """Modulus of the layer at each depth of one curve of a fit; see `pointwise_modulus`.

    Raises
    ------
    InputError
        If the tip sticks, or the curve is not one of the fit.
    CurveError
        If the modulus is known at no depth.
    """
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
    contact = binned.layer.contact(binned.values(binned.optimum), *binned.measured)
    # One test of the whole curve: of some thirty intervals of 95 % one misses the fit in most curves by chance.
    change, deviation = change_with_depth(fit, curve)
    return PointwiseModulus(
        name=str(fit.curves[curve].metadata.get("name") or ""),
        depth=contact.depth[shown],
        force=contact.force[shown],
        points=np.array([len(own) for own in binned.bins.points], dtype=float)[shown],
        layered=fit.problem.base_scenes[curve].substrate is not None,
        level=level,
        change=change,
        trend="constant" if abs(change) < SURE * deviation else "rising" if change > 0.0 else "falling",
        **{name: _selected(found, shown) for name, found in curves.items()},
    )


def _selected(curve: ModulusCurve, shown: NDArray[np.bool_]) -> ModulusCurve:
    return ModulusCurve(curve.modulus[shown], curve.low[shown], curve.high[shown], curve.expected[shown])
