"""Intervals of fitted parameters as they are printed: those of `Fit.interval`, and words where there is none."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

from underlay.data.quality import check_quality
from underlay.quantities import path_of

if TYPE_CHECKING:
    from underlay.inference.least_squares.fit_result import Fit, FitWarning

__all__ = ["Estimate", "doubts_of_curves", "estimates", "is_averaged", "standing"]


@dataclass(frozen=True)
class Estimate:
    """One fitted parameter with its interval (SI).

    Parameters
    ----------
    name, path : str
        As in `Fit`; the path lacks the number of the curve.
    value, low, high : float
        Middle and ends; infinite ends where the data leave them open.
    kind : str
        As in `StatedInterval`.
    not_fixed : str
        Why the data do not fix it; empty where they set an end.
    wide_low, wide_high : float
        Ends with what the law leaves out; those of the noise where that is no more.
    left_out : tuple of str
        What these allow for; empty where it does nothing.
    """

    name: str
    path: str
    value: float
    low: float
    high: float
    kind: str
    not_fixed: str
    wide_low: float
    wide_high: float
    left_out: tuple[str, ...]


def estimates(result: Fit, level: float = 0.95) -> list[Estimate]:
    """Return every parameter and derived modulus with its interval at `level`: the one of `Fit.interval`."""
    rows = []
    for coordinate in result.problem.coordinates:
        known = result.interval(coordinate.name, level)
        reason = ""
        if known.low == -float("inf") and known.high == float("inf"):
            bound = result.bounds_hit.get(coordinate.name)
            reason = (
                f"it ended on its {bound}"
                if bound
                else result.no_error_bars.get(coordinate.name, "the data bound it neither below nor above")
            )
        wide = result.interval(coordinate.name, level, model_error=True)
        rows.append(
            Estimate(
                coordinate.name,
                coordinate.path,
                known.value,
                known.low,
                known.high,
                known.kind,
                reason,
                wide.low,
                wide.high,
                () if wide == known else result.allowed_for.allowed,
            )
        )
    for name in result.derived:
        known, wide = result.interval(name, level), result.interval(name, level, model_error=True)
        open_ = known.low == -float("inf") and known.high == float("inf")
        reason = "what it follows from is not fixed" if open_ else ""
        rows.append(
            Estimate(
                name,
                path_of(name),
                known.value,
                known.low,
                known.high,
                known.kind,
                reason,
                wide.low,
                wide.high,
                () if wide == known else result.allowed_for.allowed,
            )
        )
    return rows


def is_averaged(result: Fit) -> bool:
    """Whether the printed intervals are averaged over what the residuals may be."""
    return any(result.interval(name).kind.startswith("averaged") for name in result.names)


def doubts_of_curves(result: Fit) -> list[str]:
    """What speaks against the curves of a fit, each once, before anything is fitted to them."""
    found = [
        check_quality(curve, scene)
        for curve, scene in zip(result.problem.curves, result.problem.base_scenes, strict=True)
    ]
    return list(dict.fromkeys(reason for quality in found for reason in quality.reasons))


def standing(result: Fit) -> list[FitWarning]:
    """Warnings that hold for the printed intervals.

    Those that are averaged over correlated noise are not too narrow for it; what is said of standard errors is not
    said of them.
    """
    spared = {"correlated-residuals"} if is_averaged(result) else set()
    return [warning for warning in result.warnings if warning.code not in spared]
