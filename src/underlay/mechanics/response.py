"""How a sample responds to indentation depths, dependent on time or not.

A `Response` turns indentation depths into forces. A `ContactLaw` is a response independent of time. The response of
a sample with memory is a law combined with a `History`: the force follows from the elastic forces of all earlier
depths,

    P(t) = H[P_el(w(.))](t),   e.g.  P(t) = int_0^t e(t - s) dP_el(w(s))      (Lee and Radok 1960),

with H *linear* in the elastic force. So whatever changes that force by a small amount changes the response by H
of that amount: derivatives in the law's parameters and in the contact point go through the same operator.

To add a memory: a frozen dataclass that derives from `History`, its parameters declared in its fields.
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

#: A function of depths (m), (n,): the elastic force (N), or a derivative of it.
Elastic: TypeAlias = Callable[[FloatArray], FloatArray]

# Central difference: truncation 1e-10 of the derivative, rounding of the force 1e-11.
_STEP = 1e-5


@runtime_checkable
class Invertible(Protocol):
    """A law that also gives the depth at a force, as every `ContactLaw` does."""

    def depth(self, force: ArrayLike) -> FloatArray:
        """Depth (m), shape of `force` (N)."""

    def force(self, depth: ArrayLike) -> FloatArray:
        """Force (N), shape of `depth` (m)."""


class Response(ABC):
    """Force against depth and, where the sample has a memory, time."""

    max_depth: float

    @property
    def domain(self) -> tuple[float, float]:
        """Smallest and largest depth (m) of the law; up to the smallest there is no contact."""
        return 0.0, self.max_depth

    @abstractmethod
    def force(self, depth: ArrayLike, time: ArrayLike | None = None) -> FloatArray:
        """Force (N), shape of `depth` (m); `time` (s), (n,), is needed where the response depends on it."""

    @abstractmethod
    def stiffness(self, depth: ArrayLike, time: ArrayLike | None = None) -> FloatArray:
        """Instantaneous stiffness dP/dw (N/m), to a sudden change of depth, shape of `depth` (m)."""

    @property
    def beginning(self) -> tuple[float, float]:
        """Depth (m) and force (N) at which contact begins or is lost: zero without adhesion."""
        return 0.0, 0.0

    def tip_depth(self, travel: FloatArray, compliance: float) -> FloatArray | None:
        """Depth w (m), (n,), with w + `compliance` P(w) = `travel` (m), where the law has its own solution.

        `compliance` is that of a spring (m/N). None: the caller solves by Newton's method, which works wherever the
        force increases with depth.
        """
        del travel, compliance
        return None


class History(Part, ABC):
    """How earlier depths act on the force (memory); its parameters have paths that begin with ``history.``.

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
            If it is not available for this history (the default), or not for such forces.
        """
        del law, force, time
        raise InputError(
            f"the history {self.model or type(self).__name__} is simulated for given depths only"
        )

    def dynamic_modulus(self, frequency: FloatArray, longest: float) -> FloatArray:
        """Complex dynamic modulus E*(i omega) over E at angular frequencies omega (1/s), same shape.

        `longest` (s) is how long the oscillation lasts.

        Raises
        ------
        InputError
            If it is not available for this history (the default).
        """
        del frequency, longest
        raise InputError(f"the history {self.model or type(self).__name__} has no dynamic modulus")

    def prepared(self, depth: FloatArray, time: FloatArray) -> Motion:
        """The map from elastic forces to forces for one motion: depths since contact (m) and times (s), each (n,).

        Override it where the motion alone decides much of the work, or where derivatives are known.
        """
        return Motion(self, depth, time)

    def require_told(self, free: Sequence[str], time: FloatArray) -> None:
        """Raise if a record at these times (s) cannot determine one of the free parameters, given by their paths.

        By default nothing is raised.

        Raises
        ------
        ParameterError
            With what to do instead.
        """
        del free, time


class Doubt(NamedTuple):
    """Advice on a fit of a memory's parameters: verdict word, finding, cause, and what to do next.

    `setting` is the path of a parameter and the value to set it to, if there is one.
    """

    word: str
    reason: str
    cause: str
    next: str
    setting: tuple[str, str] | tuple[()] = ()


class WholeHistory(History):
    """A memory whose force is not linear in the force of one elastic law, and which computes it itself.

    Its parameters are those of the scene's parts that are its fields, under their own paths.
    """

    parts: ClassVar[tuple[str, ...]] = ()
    prefix: ClassVar[str] = ""

    @abstractmethod
    def answer(self, depth: FloatArray, time: FloatArray) -> FloatArray:
        """Force (N), (n,), at depths since contact (m) and times (s), each (n,)."""

    def answers(
        self, values: Mapping[str, float | FloatArray], sets: int, depth: FloatArray, time: FloatArray
    ) -> tuple[FloatArray, NDArray[np.bool_]] | None:
        """Forces (N), (sets, n), for many sets of parameters at once, and a mask (sets,) of those computed.

        `depth` since contact (m) is (n,), or (sets, n) where contacts differ; `values` maps parameter paths to
        floats, or to arrays (sets,) where they vary. The caller computes the others one by one; None, the default,
        leaves all to it.
        """
        del values, sets, depth, time
        return None

    @abstractmethod
    def stiffness(self, depth: FloatArray, force: FloatArray) -> FloatArray:
        """dP/dw (N/m), (n,), for a change of all depths (m) by one factor; `force` (N) is that of `answer`."""

    @abstractmethod
    def slopes(self, paths: Sequence[str], depth: FloatArray, time: FloatArray) -> Mapping[str, FloatArray]:
        """Derivatives of the force, (n,), by parameter path (SI), at `paths` and ``instrument.contact_depth``."""

    @abstractmethod
    def starts(
        self, free: Mapping[str, tuple[float, float]], depth: FloatArray, force: FloatArray, time: FloatArray
    ) -> Sequence[Mapping[str, float]]:
        """Starting values (SI) for a search, best first, from a record.

        `free` maps the paths of the free parameters to their bounds; depths since contact (m), forces (N) and times
        (s) are (n,) each.
        """

    def doubts(self, depth: FloatArray, force: FloatArray, time: FloatArray) -> Sequence[Doubt]:
        """Advice on a fit: what the record of depths (m), forces (N) and times (s) cannot determine; none here."""
        del depth, force, time
        return ()

    def derived(self) -> Mapping[str, float]:
        """Quantities that follow from its parameters (SI), by name; none by default."""
        return {}

    def require_record(self, depth: FloatArray, force: FloatArray, time: FloatArray) -> None:
        """Raise if a record of depths (m), forces (N) and times (s), (n,) each, cannot determine its parameters.

        By default nothing is raised.

        Raises
        ------
        InputError
            With what to do instead.
        """

    def force(self, elastic: Elastic, depth: FloatArray, time: FloatArray) -> FloatArray:
        """Force (N), (n,), by `answer`; `elastic` is ignored."""
        del elastic
        return self.answer(depth, time)

    def at(self, values: Mapping[str, float]) -> WholeHistory:
        """Copy with the parameter values of `values`, by path; paths that are not its own are ignored."""
        own = numbers_of(self)
        changed = {path: value for path, value in values.items() if path in own and value != own[path].value}
        return replace_values(self, changed, known=own) if changed else self


@dataclass(frozen=True)
class Motion:
    """One motion of the tip on a sample with memory: a map from elastic forces to forces.

    Parameters
    ----------
    history : History
        The memory.
    depth : FloatArray
        Depths since contact (m), (n,), negative before it.
    time : FloatArray
        Their times (s), (n,), increasing.
    """

    history: History
    depth: FloatArray
    time: FloatArray

    def __call__(self, elastic: Elastic) -> FloatArray:
        """Force (N), (n,), for an elastic force as a function of depth; linear in it."""
        return self.history.force(elastic, self.depth, self.time)

    def slopes(self, paths: Sequence[str], law: Response) -> Mapping[str, FloatArray]:
        """Derivatives of the force, (n,), in the history's own parameters `paths`; by finite differences here."""
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
    """Response of a sample with memory: an elastic law combined with a history.

    Parameters
    ----------
    law : Response
        The elastic law.
    history : History
        The memory.

    Raises
    ------
    InputError
        If the law has contact at negative depths, as with adhesion.
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
        """Largest depth (m) of the elastic law."""
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
        """Stiffness of the elastic law (N/m): the instantaneous response is elastic."""
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
        """Complex stiffness (N/m) for small oscillations about a depth held.

        It is the elastic stiffness at that depth times the dynamic modulus E*(i omega) over E.

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
    """Return `time` (s) as an array (n,) after checking it against `depth` (n,); `what` names it in messages.

    Raises
    ------
    InputError
        If the times are missing, do not increase, or do not match.
    """
    if time is None:
        raise InputError(f"this sample remembers: it needs the times of every {what}; pass time (s)")
    t = as_finite(time, "time")
    if t.shape != depth.shape or depth.ndim != 1:
        raise InputError(f"a history needs one time for each {what}, (n,); got {t.shape} and {depth.shape}")
    if not (t[1:] > t[:-1]).all():
        raise InputError("the times of a history must increase from point to point")
    return t
