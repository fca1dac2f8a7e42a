"""Confidence interval of one parameter, with ends that may not be there, and in words."""

from __future__ import annotations

from dataclasses import dataclass

from underlay.scene.parameters import kind_of
from underlay.units import format_ends

__all__ = ["Interval"]


@dataclass(frozen=True)
class Interval:
    """Confidence interval of one parameter (SI); infinite where the data set no end.

    Parameters
    ----------
    name : str
        The parameter.
    level : float
        Confidence, e.g. 0.95.
    low, high : float
        Ends (SI): -inf or inf where the data set none. Where a bound given by the caller or the reach of the
        law ends it, that value.
    low_reason, high_reason : str
        ``"data"``, ``"bound"`` (the caller's), ``"law"`` (no contact law beyond), or ``"none"``.
    calibrated : bool
        Whether its thresholds come from curves drawn at its ends.
    """

    name: str
    level: float
    low: float
    high: float
    low_reason: str
    high_reason: str
    calibrated: bool = False

    def __str__(self) -> str:
        kind = kind_of(self.name)
        low, high = format_ends(self.low, self.high, kind)
        at = f"({100.0 * self.level:g} %{', calibrated' if self.calibrated else ''})"
        has_low, has_high = self.low_reason == "data", self.high_reason == "data"
        if has_low and has_high:
            return f"{self.name} between {low} and {high} {at}"
        if has_low:
            limit = self._limit(self.high_reason, high)
            return f"{self.name} > {low} {at}; no upper bound from these data{limit}"
        if has_high:
            limit = self._limit(self.low_reason, low)
            return f"{self.name} < {high} {at}; no lower bound from these data{limit}"
        return f"{self.name} is not bounded by these data {at}"

    @staticmethod
    def _limit(reason: str, value: str) -> str:
        words = {"bound": f", only its own limit {value}", "law": f", as far as the law reaches ({value})"}
        return words.get(reason, "")
