"""What a sample answers to a depth, in time or without it.

A `Response` turns indentation depths into forces. A `ContactLaw` is the response that ignores time. A sample
that remembers is a law behind a `History`: the force is then made of the elastic forces of all earlier depths,

    P(t) = H[P_el(w(.))](t),   e.g.  P(t) = int_0^t e(t - s) dP_el(w(s))      (Lee and Radok 1960),

with H *linear* in the elastic force. So whatever changes that force by a small amount changes the response by H
of that amount: derivatives in the law's numbers and in the contact point go through the same operator.

To add a memory: a frozen dataclass that derives from `History`, its numbers declared in its fields.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import ClassVar, NamedTuple, Protocol, TypeAlias, runtime_checkable

import numpy as np
from numpy.typing import NDArray

from underlay._arrays import ArrayLike, FloatArray, as_finite
from underlay.errors import InputError
from underlay.quantities import Part, numbers_of, replace_values

__all__ = [
    "Doubt",
    "Elastic",
    "History",
    "Invertible",
    "Motion",
    "Remembered",
    "Response",
    "WholeHistory",
    "checked_times",
]

#: A function of depths (m), (n,): the elastic force (N), or a derivative of it.
Elastic: TypeAlias = Callable[[FloatArray], FloatArray]

# Central difference: truncation 1e-10 of the derivative, rounding of the force 1e-11.
_STEP = 1e-5


@runtime_checkable
class Invertible(Protocol):
    """A law that says the depth of a force, as every `ContactLaw` does."""

    def depth(self, force: ArrayLike) -> FloatArray:
        """Depth (m), shape of `force` (N)."""

    def force(self, depth: ArrayLike) -> FloatArray:
        """Force (N), shape of `depth` (m)."""


class Response(ABC):
    """Force against depth and, where the sample remembers, time."""

    max_depth: float

    @property
    def domain(self) -> tuple[float, float]:
        """Smallest and largest depth (m); up to the smallest there is no contact."""
        return 0.0, self.max_depth

    @abstractmethod
    def force(self, depth: ArrayLike, time: ArrayLike | None = None) -> FloatArray:
        """Force (N), shape of `depth` (m); `time` (s), (n,), where the response depends on it."""

    @abstractmethod
    def stiffness(self, depth: ArrayLike, time: ArrayLike | None = None) -> FloatArray:
        """Stiffness dP/dw (N/m) against a sudden change of depth, shape of `depth` (m)."""

    @property
    def beginning(self) -> tuple[float, float]:
        """Depth (m) and force (N) with which contact begins or is lost: zero where nothing sticks."""
        return 0.0, 0.0

    def tip_depth(self, travel: FloatArray, compliance: float) -> FloatArray | None:
        """Depth w (m) with w + `compliance` P(w) = `travel` (m), (n,), where the law knows better than Newton.

        None: the caller solves for it, which works wherever the force increases with depth.
        """
        del travel, compliance
        return None


class History(Part, ABC):
    """What a sample makes of its earlier depths; its numbers stand under ``history.``.

    A concrete class names itself in `model`; scene files know it by that name.
    """

    parts: ClassVar[tuple[str, ...]] = ("history",)
    #: Under which path its numbers stand.
    prefix: ClassVar[str] = "history"
    chosen_by: ClassVar[str] = "model"
    #: Name in scene files.
    model: ClassVar[str] = ""

    @abstractmethod
    def force(self, elastic: Elastic, depth: FloatArray, time: FloatArray) -> FloatArray:
        """Force (N), (n,), of a history of depths.

        Parameters
        ----------
        elastic : callable
            Elastic force (N) at depths (m), zero before contact. The result must be linear in it.
        depth : FloatArray
            Depths since contact (m), (n,), negative before it.
        time : FloatArray
            Their times (s), (n,), increasing.
        """

    def depth(self, law: Invertible, force: FloatArray, time: FloatArray) -> FloatArray:
        """Depth since contact (m), (n,), under forces (N), (n,), at times (s), (n,): load control, creep.

        Raises
        ------
        InputError
            If that is not simulated, as here, or not for such forces.
        """
        del law, force, time
        raise InputError(
            f"the history {self.model or type(self).__name__} is simulated for given depths only"
        )

    def dynamic_modulus(self, frequency: FloatArray, longest: float) -> FloatArray:
        """E*(i omega) / E, complex, at angular frequencies (1/s) of an oscillation that lasts `longest` (s).

        Raises
        ------
        InputError
            If that is not known, as here.
        """
        del frequency, longest
        raise InputError(f"the history {self.model or type(self).__name__} has no dynamic modulus")

    def prepared(self, depth: FloatArray, time: FloatArray) -> Motion:
        """One motion, to be asked for several elastic forces and for derivatives.

        Override it where the motion alone decides a good part of the work, or where derivatives are known.
        """
        return Motion(self, depth, time)

    def require_told(self, free: Sequence[str], time: FloatArray) -> None:
        """Refuse numbers at the paths `free` of which a record at these times (s) says nothing; default: none.

        Raises
        ------
        ParameterError
            With what to do instead.
        """
        del free, time


class Doubt(NamedTuple):
    """What a memory says of a fit of its numbers: a verdict's word, what is the case, why, and what to do."""

    word: str
    reason: str
    cause: str
    next: str
    setting: tuple[str, str] | tuple[()] = ()


class WholeHistory(History):
    """A memory that is not linear in the force of one elastic law: it answers a motion itself.

    Its numbers are those of the scene that it is made of (its fields are the scene's parts), under their own paths.
    """

    parts: ClassVar[tuple[str, ...]] = ()
    prefix: ClassVar[str] = ""

    @abstractmethod
    def answer(self, depth: FloatArray, time: FloatArray) -> FloatArray:
        """Force (N), (n,), of depths since contact (m) at times (s), (n,) each."""

    def answers(
        self, values: Mapping[str, float | FloatArray], sets: int, depth: FloatArray, time: FloatArray
    ) -> tuple[FloatArray, NDArray[np.bool_]] | None:
        """Answers (N), (sets, n), with each of many sets of numbers, by path, (sets,) where they vary.

        Depths since contact (m) are (n,), or (sets, n) where contacts differ. And which sets are answered, (sets,);
        others are asked one by one. None, the default, answers none.
        """
        del values, sets, depth, time
        return None

    @abstractmethod
    def stiffness(self, depth: FloatArray, force: FloatArray) -> FloatArray:
        """dP/dw (N/m), (n,), were all depths (m) larger by one share, from the force (N) that it answered."""

    @abstractmethod
    def slopes(self, paths: Sequence[str], depth: FloatArray, time: FloatArray) -> Mapping[str, FloatArray]:
        """d force / d number (SI), (n,), at `paths` of its numbers, and of ``instrument.contact_depth``."""

    @abstractmethod
    def starts(
        self, free: Mapping[str, tuple[float, float]], depth: FloatArray, force: FloatArray, time: FloatArray
    ) -> Sequence[Mapping[str, float]]:
        """Values (SI) to begin a search from, best first, of the `free` paths with their bounds, from a record.

        Depths since contact (m), forces (N) and times (s), (n,) each.
        """

    def doubts(self, depth: FloatArray, force: FloatArray, time: FloatArray) -> Sequence[Doubt]:
        """What a record of depths since contact (m), forces (N) and times (s) cannot tell, at fitted numbers."""
        del depth, force, time
        return ()

    def derived(self) -> Mapping[str, float]:
        """What follows from its numbers (SI), by name; none by default."""
        return {}

    def require_record(self, depth: FloatArray, force: FloatArray, time: FloatArray) -> None:
        """Refuse a record of depths (m), forces (N) and times (s), (n,) each, that cannot tell its numbers.

        Raises
        ------
        InputError
            With what to do instead.
        """

    def force(self, elastic: Elastic, depth: FloatArray, time: FloatArray) -> FloatArray:
        """Force (N), (n,), by `answer`; the elastic force of one law is not what it goes by."""
        del elastic
        return self.answer(depth, time)

    def at(self, values: Mapping[str, float]) -> WholeHistory:
        """The same memory with the numbers of `values`, by path; others than its own are left aside."""
        own = numbers_of(self)
        told = {path: value for path, value in values.items() if path in own and value != own[path].value}
        return replace_values(self, told, known=own) if told else self


@dataclass(frozen=True)
class Motion:
    """One motion of the tip as a history sees it: the map from elastic forces to forces.

    Parameters
    ----------
    history : History
        What remembers.
    depth : FloatArray
        Depths since contact (m), (n,), negative before it.
    time : FloatArray
        Their times (s), (n,), increasing.
    """

    history: History
    depth: FloatArray
    time: FloatArray

    def __call__(self, elastic: Elastic) -> FloatArray:
        """Force (N), (n,), that the history makes of an elastic force; linear in it."""
        return self.history.force(elastic, self.depth, self.time)

    def slopes(self, paths: Sequence[str], law: Response) -> Mapping[str, FloatArray]:
        """d force / d number, (n,), at the history's own `paths` (``history.time``); by differences here."""
        history = self.history
        numbers, found = numbers_of(history, history.prefix), {}
        for path in paths:
            value, known = numbers[path]
            step = _STEP * (abs(value) or known.natural_scale)
            up, down = (
                replace_values(history, {path: value + sign * step}, history.prefix).force(
                    law.force, self.depth, self.time
                )
                for sign in (1.0, -1.0)
            )
            found[path] = (up - down) / (2.0 * step)
        return found


@dataclass(frozen=True)
class Remembered(Response):
    """A law seen through a history.

    Parameters
    ----------
    law : Response
        The elastic law.
    history : History
        What the sample remembers.

    Raises
    ------
    InputError
        If the law holds on below its first contact, as adhesion makes it.
    """

    law: Response
    history: History

    def __post_init__(self) -> None:
        if self.law.domain[0] < 0.0:
            raise InputError(
                "a sample that remembers is simulated without adhesion: how a sticking contact opens in time is "
                "not known here; leave the adhesion or the memory out"
            )

    @property
    def max_depth(self) -> float:  # type: ignore[override]  # a plain attribute elsewhere
        """Largest depth (m)."""
        return self.law.max_depth

    def force(self, depth: ArrayLike, time: ArrayLike | None = None) -> FloatArray:
        """Force (N), (n,), at depths (m) and times (s), (n,).

        Raises
        ------
        InputError
            If the times are missing, do not increase, or do not match the depths.
        RangeError
            If the law does not reach the deepest point.
        """
        w = as_finite(depth, "depth")
        return np.asarray(self.history.force(self.law.force, w, checked_times(time, w)))

    def stiffness(self, depth: ArrayLike, time: ArrayLike | None = None) -> FloatArray:
        """Stiffness of the elastic law (N/m): at once the sample answers elastically."""
        return self.law.stiffness(depth, time)

    def depth(self, force: ArrayLike, time: ArrayLike | None) -> FloatArray:
        """Depth (m), (n,), under given forces (N) at times (s), (n,): load control.

        Raises
        ------
        InputError
            If the times do not increase or match, or such a force is not simulated.
        RangeError
            If the law does not reach that deep.
        """
        load = as_finite(force, "force")
        times = checked_times(time, load, "force")
        if not isinstance(self.law, Invertible):
            raise InputError("this law does not say the depth of a force")
        return np.asarray(self.history.depth(self.law, load, times))

    def dynamic_stiffness(self, depth: ArrayLike, frequency: ArrayLike, longest: float = 1e3) -> FloatArray:
        """Stiffness against a micro-oscillation about a depth held, complex (N/m): k(w) E*(i omega) / E.

        Parameters
        ----------
        depth : ArrayLike
            Depths held (m).
        frequency : ArrayLike
            Frequencies (Hz), positive; broadcast against `depth`.
        longest : float, default 1000
            How long the oscillation lasts (s), for a relaxation without a longest time.
        """
        hertz = as_finite(frequency, "frequency")
        if not (hertz > 0.0).all():
            raise InputError(f"frequencies must be positive (Hz); got {hertz.min():.6g}")
        ratio = self.history.dynamic_modulus(2.0 * np.pi * hertz, longest)
        return np.asarray(self.law.stiffness(depth) * ratio)


def checked_times(time: ArrayLike | None, depth: FloatArray, what: str = "depth") -> FloatArray:
    """Times (s), (n,), of depths (n,), or of `what` else, for a sample that remembers.

    Raises
    ------
    InputError
        If they are missing, do not increase, or do not match.
    """
    if time is None:
        raise InputError(f"this sample remembers: it needs the times of every {what}; pass time (s)")
    t = as_finite(time, "time")
    if t.shape != depth.shape or depth.ndim != 1:
        raise InputError(f"a history needs one time for each {what}, (n,); got {t.shape} and {depth.shape}")
    if not (t[1:] > t[:-1]).all():
        raise InputError("the times of a history must increase from point to point")
    return t
