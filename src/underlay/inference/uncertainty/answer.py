"""What people read of a fit: the number of one quantity, its verdict, and the modulus at each depth.

Everything that is printed of a fit, a posterior, a row of a map or a film is an `Answer`. The statistical and the
systematic part of an interval have the same confidence and add in quadrature, in the logarithm of quantities that
are positive by nature.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from typing import TypeAlias

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from underlay._arrays import FloatArray

#: Names of the four moduli, in the order of the table.
KINDS = ("apparent", "incremental", "apparent_halfspace", "incremental_halfspace")
#: Half width of a normal 95 % interval in standard deviations.
NORMAL_95 = 1.96

#: Function from parameters (draws, k), SI, to quantities computed from them, (draws, n).
Follows: TypeAlias = Callable[[FloatArray], FloatArray]


@dataclass(frozen=True)
class Interval:
    """An interval of one quantity.

    Parameters
    ----------
    name : str
        The quantity.
    level : float
        Confidence, e.g. 0.95.
    value : float
        The quantity's value (SI).
    low, high : float
        Ends (SI); -inf or inf where the data set no limit on that side.
    """

    name: str
    level: float
    value: float
    low: float
    high: float

    @property
    def is_open(self) -> bool:
        """Whether the data set no limit on one side, so that an end is infinite."""
        return math.isinf(self.low) or math.isinf(self.high)

    def __contains__(self, value: float) -> bool:
        return self.low <= value <= self.high


@dataclass(frozen=True)
class Contribution:
    """One row of an uncertainty budget.

    Parameters
    ----------
    source : str
        Path of an input (``"indenter.radius"``), or a name: ``"noise and misfit"``, ``"force"``, ``"friction"``.
    size : str
        Uncertainty of the source, at 95 %, as people write it; empty where only its effect is known.
    origin : str
        ``"given"`` (stated for this test), ``"assumed"`` (not stated), ``"seen"`` (in the curve) or ``"model"``
        (what the contact model leaves out).
    low, high : float
        How far it alone moves the quantity down and up (SI, both zero or more); infinite where that side has no
        limit.
    share : float
        Share of the variance of the quantity.
    """

    source: str
    size: str
    origin: str
    low: float
    high: float
    share: float

    @property
    def half_width(self) -> float:
        """The larger of `low` and `high`."""
        return max(self.low, self.high)


@dataclass(frozen=True)
class Answer:
    """The number of one quantity as people read it: its value, its interval, and what makes it uncertain.

    Parameters
    ----------
    name : str
        A fitted parameter, or a quantity that is computed from parameters.
    value : float
        The quantity at the best fit (SI).
    low, high : float
        Ends of the combined interval (SI); -inf or inf where the data set no limit on that side.
    level : float
        Confidence of all intervals here.
    unit : str
        SI unit; empty for a pure number.
    statistical, systematic : Interval
        The interval from noise and misfit that the curve shows; the interval from uncertain inputs and from what
        the model leaves out.
    contributions : sequence of Contribution
        The rows of the uncertainty budget, largest first.
    notes : tuple of str
        Sentences on what changed the value, e.g. that a step of the force at contact was corrected for.
    """

    name: str
    value: float
    low: float
    high: float
    level: float
    unit: str
    statistical: Interval
    systematic: Interval
    contributions: Sequence[Contribution]
    notes: tuple[str, ...] = ()

    @property
    def interval(self) -> Interval:
        """The combined interval."""
        return Interval(self.name, self.level, self.value, self.low, self.high)

    @property
    def is_open(self) -> bool:
        """Whether the data set no limit on one side, so that an end of the combined interval is infinite."""
        return self.interval.is_open

    @property
    def budget(self) -> pd.DataFrame:
        """The budget as a table: source, size, origin, contribution (SI, the larger side), low, high, share."""
        rows = [
            (row.source, row.size, row.origin, row.half_width, row.low, row.high, row.share)
            for row in self.contributions
        ]
        columns = ["source", "size", "origin", "contribution", "low", "high", "share"]
        return pd.DataFrame(rows, columns=columns)

    def as_dict(self) -> dict[str, object]:
        """The answer as plain values, for files."""
        return {
            "value": self.value,
            "low": self.low,
            "high": self.high,
            "level": self.level,
            "unit": self.unit,
            "statistical": {"low": self.statistical.low, "high": self.statistical.high},
            "systematic": {"low": self.systematic.low, "high": self.systematic.high},
            "budget": self.budget.to_dict("records"),
            "notes": list(self.notes),
        }


@dataclass(frozen=True)
class Advice:
    """A judgement of a fit in words: the finding, its likeliest cause, and what to do next.

    Parameters
    ----------
    word : str
        ``"good"``, ``"check"`` or ``"reject"``; an advice compares equal to its word.
    reason : str
        One clause that says what was found.
    cause, next : str
        One sentence each; empty where the word is good.
    setting : tuple of (str, str)
        The next step as data: a key of the scene file and its new value; empty where the step is not such a
        setting.
    others : tuple of Advice
        Further, less serious findings.
    """

    word: str
    reason: str
    cause: str = ""
    next: str = ""
    setting: tuple[str, str] | tuple[()] = ()
    others: tuple[Advice, ...] = ()

    def __str__(self) -> str:
        return f"{self.word}: {self.reason}"

    def __eq__(self, other: object) -> bool:
        if isinstance(other, str):
            return self.word == other
        return isinstance(other, Advice) and (self.word, self.reason, self.others) == (
            other.word,
            other.reason,
            other.others,
        )

    def __hash__(self) -> int:
        return hash(self.word)

    @property
    def reasons(self) -> tuple[str, ...]:
        """Reasons of this advice and of `others`, the most serious first; empty where all is good."""
        own = () if self.word == "good" else (self.reason,)
        return (*own, *(other.reason for other in self.others))


def answers_table(answers: Iterable[Answer]) -> pd.DataFrame:
    """A table with one row for each answer: value, combined, statistical and systematic ends (SI), and the unit."""
    rows = {
        known.name: {
            "value": known.value,
            "low": known.low,
            "high": known.high,
            "stat low": known.statistical.low,
            "stat high": known.statistical.high,
            "syst low": known.systematic.low,
            "syst high": known.systematic.high,
            "unit": known.unit,
        }
        for known in answers
    }
    return pd.DataFrame.from_dict(rows, orient="index")


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

    def at(self, which: NDArray[np.bool_]) -> ModulusCurve:
        """The depths that a mask (n,) selects."""
        return ModulusCurve(self.modulus[which], self.low[which], self.high[which], self.expected[which])


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
