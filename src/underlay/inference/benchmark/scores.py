"""What an estimate of the modulus scores on the curves of the benchmark."""

from __future__ import annotations

import warnings
from collections.abc import Callable, Collection
from dataclasses import dataclass

import numpy as np
import pandas as pd

from underlay._text import one_line
from underlay.errors import InputError, UnderlayError, UnderlayWarning
from underlay.inference.benchmark.cases import Case, benchmark_cases
from underlay.inference.benchmark.estimates import Estimate, Estimator, one_law, whole_model
from underlay.mechanics.solvers import AnySolver, as_solver

__all__ = ["Score", "Scores", "benchmark"]


@dataclass(frozen=True)
class Score:
    """One estimate beside its truth.

    Parameters
    ----------
    case : Case
        The curve.
    estimate : Estimate or None
        None where there is none.
    reason : str
        Why there is none.
    """

    case: Case
    estimate: Estimate | None
    reason: str = ""

    @property
    def error(self) -> float:
        """Error of the modulus over the truth; NaN without an estimate."""
        return np.nan if self.estimate is None else self.estimate.modulus / self.case.modulus - 1.0

    @property
    def holds(self) -> bool | None:
        """Whether the interval holds the truth; None where none was given."""
        if self.estimate is None or not self.estimate.low < self.estimate.high:
            return None
        return self.estimate.low <= self.case.modulus <= self.estimate.high


@dataclass(frozen=True)
class Scores:
    """What one way to a modulus scores.

    Parameters
    ----------
    label : str
        What was scored.
    scores : tuple of Score
        One for each curve.
    """

    label: str
    scores: tuple[Score, ...]

    def to_frame(self) -> pd.DataFrame:
        """One row a curve: truth, estimate and its interval (Pa), error (%), and why there is none."""
        return pd.DataFrame(
            [
                {
                    "kind": score.case.kind,
                    "noise": score.case.noise,
                    "truth (Pa)": score.case.modulus,
                    "estimate (Pa)": np.nan if score.estimate is None else score.estimate.modulus,
                    "low (Pa)": np.nan if score.estimate is None else score.estimate.low,
                    "high (Pa)": np.nan if score.estimate is None else score.estimate.high,
                    "error (%)": 100.0 * score.error,
                    "reason": score.reason,
                }
                for score in self.scores
            ]
        )

    def summary(self) -> pd.DataFrame:
        """One row a kind of sample: median and largest size of the error (%), intervals that hold the truth."""
        rows = []
        for kind in dict.fromkeys(score.case.kind for score in self.scores):
            own = [score for score in self.scores if score.case.kind == kind]
            sizes = [100.0 * abs(score.error) for score in own if score.estimate is not None]
            held = [score.holds for score in own if score.holds is not None]
            rows.append(
                {
                    "kind": kind,
                    "answered": f"{len(sizes)} of {len(own)}",
                    "median error (%)": float(np.median(sizes)) if sizes else np.nan,
                    "largest error (%)": max(sizes, default=np.nan),
                    "intervals hold the truth": f"{sum(held)} of {len(held)}" if held else "",
                }
            )
        return pd.DataFrame(rows)


def benchmark(
    solver: AnySolver | None = None,
    *,
    estimate: Estimator | None = None,
    kinds: Collection[str] = (),
    progress: Callable[[Case], None] | None = None,
) -> Scores:
    """Score a way from a curve to a modulus on the open benchmark of layered indentation.

    Accuracy is measured here; `underlay bench` measures speed.

    Parameters
    ----------
    solver : Solver or str, optional
        One elastic contact law, as most programs fit it. Without it, and without `estimate`, the whole model is
        scored: what ``underlay fit`` makes of the scene as it is told.
    estimate : callable, optional
        Takes a `Case` (with the paths ``curve`` and ``scene``) and gives a modulus (Pa), or an `Estimate` with an
        interval. An error that it raises is the score of that curve.
    kinds : collection of str
        Which kinds of sample; all by default.
    progress : callable, optional
        Called with each case before it is estimated.

    Returns
    -------
    Scores
        With ``to_frame()`` and ``summary()``.

    Raises
    ------
    InputError
        If both a solver and an estimate are given, or a name is not known.

    Examples
    --------
    >>> found = benchmark(estimate=lambda case: 2e3, kinds=["elastic"])
    >>> found.summary()["answered"].tolist()
    ['5 of 5']
    """
    if solver is not None and estimate is not None:
        raise InputError("give a solver or an estimate, not both")
    if estimate is None:
        chosen = None if solver is None else as_solver(solver)
        way, label = (whole_model, "whole model") if chosen is None else (one_law(chosen), chosen.label)
    else:
        way, label = estimate, getattr(estimate, "__name__", type(estimate).__name__)
    scores = []
    for case in benchmark_cases(kinds):
        if progress is not None:
            progress(case)
        scores.append(_scored(case, way))
    return Scores(label, tuple(scores))


def _scored(case: Case, way: Estimator) -> Score:
    try:
        with warnings.catch_warnings():
            # Thirty curves that were made to be difficult: what is said of each is not the score.
            warnings.simplefilter("ignore", UnderlayWarning)
            found = way(case)
        estimate = found if isinstance(found, Estimate) else Estimate(float(found))
    except UnderlayError as error:
        return Score(case, None, one_line(error))
    except Exception as error:  # noqa: BLE001  another's code: that it failed is its score
        return Score(case, None, one_line(f"{type(error).__name__}: {error}"))
    if not np.isfinite(estimate.modulus):
        return Score(case, None, f"the estimate is {estimate.modulus}")
    return Score(case, estimate)
