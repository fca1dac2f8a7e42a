"""The modulus depth by depth, E(w): the layer modulus that explains what a curve shows at each depth by itself.

Two readings of a curve, each with the half-space and with the layer and what it stands on:

- apparent: the modulus at which the law has the force that was measured at that depth;
- incremental: the modulus at which it has the local slope dP/dw (9.1), which does not remember shallower depths.

Where the model is right the modulus with the layer is the same at every depth, and the half-space's is a curve that
can be said beforehand. Contact point, baseline and all other numbers are those of the fit, with their uncertainty.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np
import pandas as pd
from numpy.typing import NDArray
from scipy import special

from underlay._arrays import FloatArray
from underlay._given import require_given
from underlay.errors import CurveError, InputError
from underlay.inference.least_squares.fit_result import Fit
from underlay.inference.least_squares.fitting import fit as least_squares_fit
from underlay.inference.model.members import Member
from underlay.inference.pointwise.explained import Body, Explained, halfspace_of, require_without_adhesion
from underlay.inference.pointwise.local import Bins, Residuals, bins_of, noise_in, residuals_in
from underlay.inference.problem import Problem

__all__ = ["ModulusCurve", "PointwiseModulus", "pointwise_modulus"]

#: Names of the four moduli, in the order of the table.
_KINDS = ("apparent", "incremental", "apparent_halfspace", "incremental_halfspace")
# Half of an interval over the expected modulus: what is known to less than that is not shown.
_KNOWN = 1.0


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
class PointwiseModulus:
    """Modulus of the layer at each depth of one curve.

    Parameters
    ----------
    name : str
        Of the curve.
    depth : FloatArray
        Tip depth since contact (m), (n,).
    force : FloatArray
        Contact force there (N), (n,), without the baseline.
    points : FloatArray
        How many points each depth stands on, (n,).
    apparent, incremental : ModulusCurve
        With the layer's thickness and what is under it, from the force and from its local slope.
    apparent_halfspace, incremental_halfspace : ModulusCurve
        The same by the formula of a half-space.
    layered : bool
        Whether there is anything under the layer; otherwise both pairs are the same.
    relaxing : bool
        Whether the sample relaxes: each modulus is then what was left of it when the tip came by.
    level : float
        Confidence of the intervals, point by point.
    """

    name: str
    depth: FloatArray
    force: FloatArray
    points: FloatArray
    apparent: ModulusCurve
    incremental: ModulusCurve
    apparent_halfspace: ModulusCurve
    incremental_halfspace: ModulusCurve
    layered: bool
    relaxing: bool
    level: float

    @property
    def table(self) -> pd.DataFrame:
        """One row per depth (SI): depth, force, points, and of each modulus value, low, high and expected.

        Columns are named as in ``apparent``, ``apparent.low``, ``apparent.high``, ``apparent.expected``.
        """
        columns = {"depth": self.depth, "force": self.force, "points": self.points.astype(int)}
        for kind in _KINDS if self.layered else _KINDS[:2]:
            curve: ModulusCurve = getattr(self, kind)
            columns[kind] = curve.modulus
            columns |= {f"{kind}.{end}": getattr(curve, end) for end in ("low", "high", "expected")}
        return pd.DataFrame(columns)


def pointwise_modulus(
    result: Fit | Problem, *, curve: int = 0, points: int = 30, level: float = 0.95
) -> PointwiseModulus:
    """Read the modulus of the layer from every depth of a curve by itself.

    Parameters
    ----------
    result : Fit or Problem
        Says contact point, baseline and all that is not the layer's modulus; a problem is fitted first.
    curve : int, default 0
        Which curve of a joint fit.
    points : int, default 30
        Most depths; each stands on eight points of the curve or more.
    level : float, default 0.95
        Confidence of the intervals. They hold the noise of the points about each depth and what the fit does not
        know of its parameters, under the noise that `Fit.interval` assumes.

    Returns
    -------
    PointwiseModulus
        Depths at which the interval is narrower than twice the modulus; the first after contact are not.

    Raises
    ------
    InputError
        If the tip sticks, or the curve is not one of the fit.
    CurveError
        If the modulus is known at no depth.

    Examples
    --------
    >>> import numpy as np, underlay as ul
    >>> scene = ul.Scene(ul.Paraboloid(1e-3), ul.Layer(ul.Isotropic(1e6, 0.45), 5e-4), ul.RIGID)
    >>> curve = ul.synthesize(scene, np.linspace(0.0, 1e-4, 400), ul.Noise(force=1e-4), rng=0)
    >>> fit = ul.fit(ul.Problem(scene, curve, {"layer.E": (1e4, 1e8)}, noise=ul.Noise(force=1e-4)))
    >>> found = ul.pointwise_modulus(fit)
    >>> bool(np.all(np.abs(found.apparent.modulus[10:] / 1e6 - 1.0) < 0.01))
    True
    >>> bool(found.apparent_halfspace.modulus[-1] > 2e6)
    True
    """
    require_given(result, "result", Fit, Problem)
    fit = least_squares_fit(result) if isinstance(result, Problem) else result
    if not 0 <= curve < len(fit.curves):
        raise InputError(f"curve must be a number from 0 to {len(fit.curves) - 1}; got {curve!r}")
    if points < 2 or not 0.0 < level <= 0.999:
        raise InputError(
            f"points must be 2 or more and level above 0 and at most 0.999; got {points!r} and {level!r}"
        )
    reading = _Reading.of(fit, curve, points)
    z = float(special.ndtri(0.5 * (1.0 + level)))
    curves = reading.curves(fit, level, z)
    apparent = curves["apparent"]
    # Against what is expected: a depth must not be shown because noise made its modulus large.
    shown = np.isfinite(apparent.high) & (apparent.high - apparent.low < 2.0 * _KNOWN * apparent.expected)
    if not shown.any():
        raise CurveError(
            "the modulus is known at no single depth: the noise is as large as the force, or"
            " the contact point is open"
        )
    contact = reading.layer.contact(reading.values(fit.problem.physical(fit.vector)), *reading.measured)
    return PointwiseModulus(
        name=str(fit.curves[curve].metadata.get("name") or ""),
        depth=contact.depth[shown],
        force=contact.force[shown],
        points=np.array([len(own) for own in reading.bins.points], dtype=float)[shown],
        layered=fit.problem.base_scenes[curve].substrate is not None,
        relaxing=fit.problem.base_scenes[curve].memory is not None,
        level=level,
        **{name: _selected(found, shown) for name, found in curves.items()},
    )


@dataclass(frozen=True, eq=False)
class _Reading:
    """What one curve of a fit says in each bin, and the two bodies with which it is read."""

    member: Member
    bins: Bins
    residuals: Residuals
    layer: Body
    bare: Body
    bare_numbers: Mapping[str, float]
    measured: tuple[FloatArray, FloatArray]

    @classmethod
    def of(cls, fit: Fit, curve: int, points: int) -> _Reading:
        member, scene = fit.problem.members[curve], fit.scenes[curve]
        require_without_adhesion(scene)
        bins = bins_of(fit, curve, scene.instrument.contact_depth, points)
        free, bare = tuple(member.entries), halfspace_of(scene)
        made = cls(
            member=member,
            bins=bins,
            residuals=residuals_in(fit, curve, bins, noise_in(fit, curve, bins)),
            layer=Body.of(scene, bins.centre, free, fit.solver),
            bare=Body.of(bare, bins.centre, free, fit.solver),
            bare_numbers=bare.parameters,
            measured=(bins.centre, bins.centre),
        )
        force, slope = made.model(fit.problem.physical(fit.vector))
        return replace(made, measured=(force + made.residuals.force, slope + made.residuals.slope))

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

    def explained(self, physical: FloatArray) -> tuple[Explained, Explained, Explained, Explained]:
        """Moduli at a vector (k,): of the measured curve by layer and half-space, then of the model's by both."""
        values = self.values(physical)
        bare = {p: values[p] if p in self.member.entries else v for p, v in self.bare_numbers.items()}
        model = self.model(physical)
        return (
            self.layer.explain(values, *self.measured),
            self.bare.explain(bare, *self.measured),
            self.layer.explain(values, *model),
            self.bare.explain(bare, *model),
        )

    def curves(self, fit: Fit, level: float, z: float) -> dict[str, ModulusCurve]:
        """The four moduli with their intervals, by name."""
        n = len(self.bins.centre)

        def of(draws: FloatArray) -> FloatArray:
            return np.array([_row(self.explained(draw)) for draw in draws])

        low, middle, high = (ends.reshape(8, n) for ends in fit.band(of, level))
        optimum = fit.problem.physical(fit.vector)
        layer = self.explained(optimum)[0]
        error = self._relative_errors(optimum)
        powers = (layer.apparent_power, layer.incremental_power, np.ones(n), np.ones(n))
        found = {}
        for row, (name, power) in enumerate(zip(_KINDS, powers, strict=True)):
            own = z * power * error[row % 2]
            ends = _widened(low[row], middle[row], high[row], own)
            positive = np.where(middle[row] > 0.0, middle[row], np.nan)
            found[name] = ModulusCurve(positive, *ends, expected=middle[4 + row])
        return found

    def _relative_errors(self, physical: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Standard errors of contact force and stiffness in each bin from the noise of its own points, relative."""
        values = self.values(physical)
        contact = self.layer.contact(values, *self.measured)
        along = self.measured[1] - values["instrument.baseline_slope"]
        # dP/dw = s / (1 - C s): its derivative in s is its square over s squared.
        force = self.residuals.force_error / np.abs(contact.force)
        return force, self.residuals.slope_error * np.abs(contact.stiffness / along**2)


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


def _selected(curve: ModulusCurve, shown: NDArray[np.bool_]) -> ModulusCurve:
    return ModulusCurve(curve.modulus[shown], curve.low[shown], curve.high[shown], curve.expected[shown])
