"""Moduli of a layer by depth, as a fit gives them."""

from __future__ import annotations

from dataclasses import dataclass

import pandas as pd

from underlay._arrays import FloatArray

__all__ = ["KINDS", "ModulusCurve", "PointwiseModulus"]

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
        How many points each depth stands on, (n,).
    apparent, incremental : ModulusCurve
        With the layer's thickness and what is under it, from the force and from its local slope.
    apparent_halfspace, incremental_halfspace : ModulusCurve
        The two moduli by the formula of a half-space.
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
