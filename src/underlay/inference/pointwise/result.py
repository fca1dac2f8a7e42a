"""Modulus of a layer at each depth of a curve: the result of `pointwise_modulus`."""

from __future__ import annotations

from dataclasses import dataclass

import pandas as pd

from underlay._arrays import FloatArray

#: Names of the four moduli, in the order of the table.
KINDS = ("apparent", "incremental", "apparent_halfspace", "incremental_halfspace")


@dataclass(frozen=True, eq=False)
class ModulusCurve:
    """One kind of modulus at every depth.

    Parameters
    ----------
    modulus, low, high : FloatArray
        The modulus and its interval (Pa), (n,); NaN where no modulus reproduces the curve there: the noise of a
        slope may make it negative.
    expected : FloatArray
        The modulus if the fitted model were right (Pa), (n,).
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
        Name of the curve.
    depth : FloatArray
        Tip depth since contact (m), (n,).
    force : FloatArray
        Contact force there (N), (n,), without the baseline.
    points : FloatArray
        Number of readings averaged at each depth, (n,).
    apparent, incremental : ModulusCurve
        For the layer with its thickness and base, from the force and from its local slope.
    apparent_halfspace, incremental_halfspace : ModulusCurve
        The same two moduli by the formula of a half-space.
    layered : bool
        Whether there is anything under the layer; otherwise both pairs are the same.
    level : float
        Confidence of the intervals, point by point.
    change : float
        ln of the modulus at full depth over that at a tenth of it, were contact point, baseline and all else that
        is free fitted together with it. At the fit's own contact point a part of it is hidden.
    trend : str
        ``"constant"`` unless the change exceeds four of its standard deviations; else ``"rising"`` or
        ``"falling"``.
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
    level: float
    change: float
    trend: str

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
