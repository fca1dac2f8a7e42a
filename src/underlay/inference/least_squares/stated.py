"""What a fit states to people: intervals, a verdict with its reasons, and what the numbers stand on."""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import TypeAlias

from underlay._arrays import FloatArray

__all__ = ["AllowedFor", "Follows", "StatedBonds", "StatedInterval", "Statements", "Verdict"]


#: Quantities (draws, n) that follow from parameters (draws, k), SI.
Follows: TypeAlias = Callable[[FloatArray], FloatArray]


@dataclass(frozen=True)
class StatedInterval:
    """The interval of a parameter, the one that every headline, table, page and file prints.

    Parameters
    ----------
    name : str
        The parameter.
    level : float
        Confidence, e.g. 0.95.
    value : float
        What stands in the middle (SI): the optimum of the fit, or the median where noise and misfit are averaged
        over, which may lie elsewhere.
    low, high : float
        Ends (SI); -inf or inf where the data leave that side open.
    kind : str
        Why this wide: ``"quadratic"`` (the standard error, which was checked at both ends), ``"profile"``
        (likelihood profile), ``"averaged"`` (over what the residuals may be), ``"averaged profile"`` (the same, and
        as far as the profile under the most likely noise reaches), ``"with model error"`` (with what the law leaves
        out as well).
    """

    name: str
    level: float
    value: float
    low: float
    high: float
    kind: str

    @property
    def is_open(self) -> bool:
        """Whether the data leave a side open."""
        return math.isinf(self.low) or math.isinf(self.high)

    def __contains__(self, value: float) -> bool:
        return self.low <= value <= self.high


@dataclass(frozen=True)
class AllowedFor:
    """What a law leaves out, and what became of it in the interval with model error.

    Parameters
    ----------
    allowed : tuple of str
        What that interval allows for.
    negligible : tuple of str
        What would move no parameter by a tenth of its standard error.
    unknown : tuple of str
        What cannot be allowed for, and why.
    declared : tuple of str
        What the scene says, and the interval believes.
    """

    allowed: tuple[str, ...] = ()
    negligible: tuple[str, ...] = ()
    unknown: tuple[str, ...] = ()
    declared: tuple[str, ...] = ()


@dataclass(frozen=True)
class StatedBonds:
    """What a curve says with a face bonded, and with it free to slip, where nobody knows which it is.

    Parameters
    ----------
    face : str
        The layer whose lower face it is: ``"layer"``, ``"substrate.layers[0]"``, ...
    bonded, slipping : mapping of name to StatedInterval
        From the noise, at 95 %.
    difference : float
        AIC of the slipping face above that of the bonded one: negative where the data speak for slip.
    """

    face: str
    bonded: Mapping[str, StatedInterval]
    slipping: Mapping[str, StatedInterval]
    difference: float


@dataclass(frozen=True)
class Verdict:
    """Whether a fit is to be believed.

    Parameters
    ----------
    word : str
        ``"good"``, ``"doubtful"`` or ``"model wrong"``.
    reasons : tuple of str
        Why, in words; empty where it is good.

    A verdict equals its word: ``fit.verdict == "good"``.
    """

    word: str
    reasons: tuple[str, ...] = ()

    def __str__(self) -> str:
        return f"{self.word}: {'; '.join(self.reasons)}" if self.reasons else self.word

    def __eq__(self, other: object) -> bool:
        if isinstance(other, str):
            return self.word == other
        return isinstance(other, Verdict) and (self.word, self.reasons) == (other.word, other.reasons)

    def __hash__(self) -> int:
        return hash(self.word)


class Statements(ABC):
    """What can be stated of one fit; computed when it is asked for, and once."""

    @abstractmethod
    def interval(self, name: str, level: float, *, model_error: bool) -> StatedInterval:
        """Interval of a parameter; raises InputError for a name or a level that is none."""

    @abstractmethod
    def band(self, of: Follows, level: float) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Lower ends, middles and upper ends, (n,), of quantities that follow from the parameters."""

    @property
    @abstractmethod
    def allowed_for(self) -> AllowedFor:
        """What the interval with model error allows for."""

    @property
    @abstractmethod
    def bonds(self) -> Sequence[StatedBonds]:
        """What each bond gives, of every face of which nobody knows how it holds."""

    @property
    @abstractmethod
    def verdict(self) -> Verdict:
        """Whether the fit is to be believed."""

    @property
    @abstractmethod
    def sensitivity(self) -> Mapping[str, Mapping[str, float]]:
        """d ln(value) / d ln(input), by fitted parameter and by number taken as known."""
