"""What one curve of a fit says of the modulus in each of its bins, with intervals.

A quantity depends on the parameters of the fit, and where noise and misfit are averaged over also on what the
baseline creeps by: that goes with the baseline and its slope, and what is left of the force without all three is
far better known than any of them.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np
from scipy import special

from underlay._arrays import FloatArray
from underlay.inference.headline.derived import band
from underlay.inference.least_squares.fit_result import Fit
from underlay.inference.misfit.averaging import Averaged
from underlay.inference.misfit.blocked import clock_of
from underlay.inference.model.members import Member
from underlay.inference.pointwise.explained import Body, Explained, halfspace_of, require_without_adhesion
from underlay.inference.pointwise.local import Bins, Residuals, bins_of, noise_in, residuals_in
from underlay.scene.chain import ContactDepth

__all__ = ["KINDS", "BinnedCurve", "ModulusCurve"]

#: Names of the four moduli, in the order of the table.
KINDS = ("apparent", "incremental", "apparent_halfspace", "incremental_halfspace")


@dataclass(frozen=True, eq=False)
class ModulusCurve:
    """One modulus at every depth.

    Parameters
    ----------
    modulus, low, high : FloatArray
        The modulus and its interval (Pa), (n,); NaN where no modulus explains the curve there: the noise of a slope
        may turn it downwards.
    expected : FloatArray
        What it would be if the fitted model were right (Pa), (n,).
    """

    modulus: FloatArray
    low: FloatArray
    high: FloatArray
    expected: FloatArray


@dataclass(frozen=True, eq=False)
class BinnedCurve:
    """What one curve of a fit says in each bin, and the two bodies with which it is read.

    Parameters
    ----------
    fit : Fit
        The fit.
    averaged : Averaged or None
        What it was averaged over.
    curve : int
        Number of the curve.
    optimum : FloatArray
        Parameters (k,), SI, about which the moduli and their intervals are.
    bins : Bins
        Its points by depth.
    residuals : Residuals
        Those of the fit in each bin.
    layer, bare : Body
        The scene, and the layer as a half-space.
    bare_numbers : mapping of str to float
        Every number of the latter.
    measured : tuple of FloatArray
        Force (N) and slope (N/m) that each bin shows, (n,).
    creep : tuple of FloatArray
        Force (N) and slope (N/m) there of a baseline that creeps by the largest force, (n,).
    """

    fit: Fit
    averaged: Averaged | None
    curve: int
    optimum: FloatArray
    bins: Bins
    residuals: Residuals
    layer: Body
    bare: Body
    bare_numbers: Mapping[str, float]
    measured: tuple[FloatArray, FloatArray]
    creep: tuple[FloatArray, FloatArray]

    @classmethod
    def of(cls, fit: Fit, averaged: Averaged | None, curve: int, points: int) -> BinnedCurve:
        """Put the readings of a curve into at most `points` bins, and prepare what they are read with."""
        member, scene = fit.problem.members[curve], fit.scenes[curve]
        require_without_adhesion(scene)
        optimum = fit.problem.physical(fit.vector if averaged is None else averaged.vector)
        bins = bins_of(fit, curve, member.values_at(optimum)[ContactDepth.path], points)
        free, bare = tuple(member.entries), halfspace_of(scene)
        made = cls(
            fit=fit,
            averaged=averaged,
            curve=curve,
            optimum=optimum,
            bins=bins,
            residuals=residuals_in(fit, curve, bins, noise_in(fit, curve, bins)),
            layer=Body.of(scene, bins.centre, free, fit.solver),
            bare=Body.of(bare, bins.centre, free, fit.solver),
            bare_numbers=bare.parameters,
            measured=(bins.centre, bins.centre),
            creep=_creep_in(fit, averaged, curve, bins),
        )
        force, slope = made.model(fit.problem.physical(fit.vector))
        return replace(made, measured=(force + made.residuals.force, slope + made.residuals.slope))

    @property
    def member(self) -> Member:
        """The curve that is read."""
        return self.fit.problem.members[self.curve]

    def values(self, physical: FloatArray) -> dict[str, float]:
        """Every number of the scene (SI) at a physical vector (k,)."""
        return self.member.values_at(physical)

    def model(self, physical: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Force reading (N) and slope (N/m) of the model in the middle of each bin, (n,), at a vector (k,)."""
        if self.member.scene.memory is None:
            return self.layer.reading(self.values(physical))
        # Between the points of a sample that remembers nobody knows the time: a parabola through each bin.
        force, depth = self.member.model(physical), self.member.curve.depth
        parabolas = [
            np.polynomial.Polynomial.fit(depth[own] - centre, force[own], 2).convert(domain=[-1.0, 1.0])
            for own, centre in zip(self.bins.points, self.bins.centre, strict=True)
        ]
        return (
            np.array([parabola(0.0) for parabola in parabolas]),
            np.array([parabola.deriv()(0.0) for parabola in parabolas]),
        )

    def explained(
        self, physical: FloatArray, creep: float = 0.0
    ) -> tuple[Explained, Explained, Explained, Explained]:
        """Moduli at a vector (k,): of the measured curve by layer and half-space, then of the model's by both.

        What its baseline creeps by, a share of the largest force, is taken off the measured curve.
        """
        values = self.values(physical)
        force, slope = (own - creep * moved for own, moved in zip(self.measured, self.creep, strict=True))
        bare = {p: values[p] if p in self.member.entries else v for p, v in self.bare_numbers.items()}
        model = self.model(physical)
        return (
            self.layer.explain(values, force, slope),
            self.bare.explain(bare, force, slope),
            self.layer.explain(values, *model),
            self.bare.explain(bare, *model),
        )

    def curves(self, level: float) -> dict[str, ModulusCurve]:
        """The four moduli with their intervals, by name."""
        n, z = len(self.bins.centre), float(special.ndtri(0.5 * (1.0 + level)))

        def of(draws: FloatArray) -> FloatArray:
            return np.array([_row(self.explained(draw[:-1], draw[-1])) for draw in draws])

        ends = band(self.fit, self.averaged, of, level, creeping=self.curve)
        low, middle, high = (end.reshape(8, n) for end in ends)
        layer = self.explained(self.optimum)[0]
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
        """Standard errors of contact force and stiffness in each bin from the noise of its own points, relative."""
        values = self.values(physical)
        contact = self.layer.contact(values, *self.measured)
        along = self.measured[1] - values["instrument.baseline_slope"]
        # dP/dw = s / (1 - C s): its derivative in s is its square over s squared.
        force = self.residuals.force_error / np.abs(contact.force)
        return force, self.residuals.slope_error * np.abs(contact.stiffness / along**2)


def _creep_in(fit: Fit, averaged: Averaged | None, curve: int, bins: Bins) -> tuple[FloatArray, FloatArray]:
    """Force (N) and slope (N/m) in the middle of each bin, (n,), of a baseline that creeps by the largest force."""
    if averaged is None:
        return np.zeros_like(bins.centre), np.zeros_like(bins.centre)
    measured = fit.curves[curve]
    added = averaged.creep_at(curve, clock_of(measured))
    lines = [
        np.polynomial.Polynomial.fit(measured.depth[own] - centre, added[own], 1).convert(domain=[-1.0, 1.0])
        for own, centre in zip(bins.points, bins.centre, strict=True)
    ]
    return np.array([line(0.0) for line in lines]), np.array([line.deriv()(0.0) for line in lines])


def _row(found: tuple[Explained, ...]) -> FloatArray:
    return np.concatenate([part for entry in found for part in (entry.apparent, entry.incremental)])


def _widened(
    low: FloatArray, middle: FloatArray, high: FloatArray, own: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Ends of intervals, (n,), with a half width `own` of ln(modulus) added in quadrature; NaN for no modulus."""
    known = np.isfinite(middle) & (middle > 0.0)
    closed = known & np.isfinite(high) & (low > 0.0)
    ends = np.where(known, -np.inf, np.nan), np.where(known, np.inf, np.nan)
    for end, limit, sign in zip(ends, (low, high), (-1.0, 1.0), strict=True):
        half = np.hypot(np.log(limit[closed] / middle[closed]), own[closed])
        end[closed] = middle[closed] * np.exp(sign * half)
    return ends
