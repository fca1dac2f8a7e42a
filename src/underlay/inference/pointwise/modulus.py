"""The modulus depth by depth, E(w): the layer modulus that explains what a curve shows at each depth by itself.

Two readings of a curve, each with the half-space and with the layer and what it stands on:

- apparent: the modulus at which the law has the force that was measured at that depth;
- incremental: the modulus at which it has the local slope dP/dw (9.1), which does not remember shallower depths.

Where the model is right the modulus with the layer is the same at every depth, and the half-space's is a curve that
can be said beforehand. Contact point, baseline and all other numbers are those of the fit, with their uncertainty.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from underlay._arrays import FloatArray
from underlay._given import require_given
from underlay.errors import CurveError, InputError
from underlay.inference.headline.averaged import averaged_fit
from underlay.inference.least_squares.fit_result import Fit
from underlay.inference.least_squares.fitting import fit as least_squares_fit
from underlay.inference.pointwise.binned import KINDS, BinnedCurve, ModulusCurve
from underlay.inference.problem import Problem

__all__ = ["ModulusCurve", "PointwiseModulus", "pointwise_modulus"]

# Half of an interval over the expected modulus: what is known to less than that is not shown.
_KNOWN = 1.0


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
        for kind in KINDS if self.layered else KINDS[:2]:
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
    binned = BinnedCurve.of(fit, averaged_fit(fit), curve, points)
    curves = binned.curves(level)
    apparent = curves["apparent"]
    # Against what is expected: a depth must not be shown because noise made its modulus large.
    shown = np.isfinite(apparent.high) & (apparent.high - apparent.low < 2.0 * _KNOWN * apparent.expected)
    if not shown.any():
        raise CurveError(
            "the modulus is known at no single depth: the noise is as large as the force, or"
            " the contact point is open"
        )
    contact = binned.layer.contact(binned.values(binned.optimum), *binned.measured)
    return PointwiseModulus(
        name=str(fit.curves[curve].metadata.get("name") or ""),
        depth=contact.depth[shown],
        force=contact.force[shown],
        points=np.array([len(own) for own in binned.bins.points], dtype=float)[shown],
        layered=fit.problem.base_scenes[curve].substrate is not None,
        relaxing=fit.problem.base_scenes[curve].memory is not None,
        level=level,
        **{name: _selected(found, shown) for name, found in curves.items()},
    )


def _selected(curve: ModulusCurve, shown: NDArray[np.bool_]) -> ModulusCurve:
    return ModulusCurve(curve.modulus[shown], curve.low[shown], curve.high[shown], curve.expected[shown])
