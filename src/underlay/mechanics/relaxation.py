"""Relaxation functions: how the stress after a sudden strain falls with time, e(t) = E(t) / E0.

Poisson's ratio is taken as constant, so every modulus of the layer relaxes in the same proportion. Computations
use the `Modes` of a relaxation, a sum of exponentials

    e(t) = constant + sum_k weight_k exp(-t / time_k),

which is the definition of a Prony series and a quadrature of any other function that falls completely
monotonically. To add one: derive a frozen dataclass from `Relaxation` and declare its parameters in its fields.
"""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import ClassVar, NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy import special

from underlay._arrays import ArrayLike, FloatArray, as_finite, finite, positive
from underlay.errors import InputError
from underlay.quantities import Part, quantity

#: What may relax; with shear alone Poisson's ratio changes in time unless it is 0.5.
RELAXES = ("shear_and_bulk", "shear")

# Fractions of a fit may add up to one but for the rounding of their sum.
_ROUNDING = 1e-12
# Trapezoid rule in ln(1/time): its error falls as exp(-pi^2 / step), up to 2e-8 at 0.5 (a test measures it).
_STEP = 0.5
# The rule ends where the modes that are left out change e(t) by less than this part of it.
_TAIL = 1e-9
# Ends of the rule at exponents below and above these would lie beyond what floats hold.
_EXPONENTS = (0.01, 0.7)


@dataclass(frozen=True)
class Modes:
    """A relaxation function e(t) as a sum of exponentials (K of them).

    Parameters
    ----------
    constant : float
        The part that does not relax.
    weights, times : FloatArray
        Weight (dimensionless) and relaxation time (s) of each exponential, (K,).
    """

    constant: float
    weights: FloatArray
    times: FloatArray

    def __call__(self, time: FloatArray) -> FloatArray:
        """Relaxation function e(t) = E(t)/E(0) at times (s), (n,)."""
        decay = np.exp(-time[..., None] / self.times)
        return np.asarray(self.constant + decay @ self.weights)


class ModesOfSets(NamedTuple):
    """`Modes` of many parameter sets: constants (sets, 1), weights and times (s), each (K, sets, 1)."""

    constant: FloatArray
    weights: FloatArray
    times: FloatArray

    def of(self, rows: NDArray[np.intp] | NDArray[np.bool_]) -> ModesOfSets:
        """Modes of the sets selected by `rows`, indices or a mask."""
        return ModesOfSets(self.constant[rows], self.weights[:, rows], self.times[:, rows])


class Relaxation(Part, ABC):
    """How the modulus of a layer falls with time; its parameters' paths begin with ``layer.relaxation.``.

    A concrete class names itself in `model`; scene files know it by that name.
    """

    parts: ClassVar[tuple[str, ...]] = ("layer",)
    chosen_by: ClassVar[str] = "model"
    #: Name in scene files.
    model: ClassVar[str] = ""

    #: "shear_and_bulk" (constant Poisson's ratio) or "shear"; a field of the concrete class.
    relaxes: str

    @abstractmethod
    def modulus(self, time: ArrayLike) -> FloatArray:
        """E(t)/E at `time` (s) after a sudden strain, shape of `time`; E is the layer's modulus in the scene."""

    @abstractmethod
    def modes(self, shortest: float, longest: float) -> Modes:
        """Sum of exponentials that represents it between the times `shortest` and `longest` (s)."""

    def mode_slopes(self, modes: Modes) -> Mapping[str, Modes] | None:
        """Derivatives of constant, weights and times of `modes` in each parameter, by field name (``times[0]``).

        None where they are not available; a caller then takes finite differences.
        """
        del modes
        return None

    def modes_of(self, numbers: Mapping[str, FloatArray]) -> tuple[ModesOfSets, NDArray[np.bool_]] | None:
        """Modes of many sets of its parameters, (sets,) by field name, and a mask (sets,) of the valid sets.

        None where the number of exponentials differs between sets.
        """
        del numbers
        return None

    @property
    @abstractmethod
    def longest_time(self) -> float:
        """Longest time (s) among its parameters."""

    @property
    @abstractmethod
    def equilibrium(self) -> float:
        """Limit of e(t) at long times."""

    @property
    def bounded(self) -> bool:
        """Whether the instantaneous modulus e(0) is finite."""
        return True


def _checked_relaxes(given: str) -> None:
    if given not in RELAXES:
        raise InputError(f"relaxes must be one of {', '.join(map(repr, RELAXES))}; got {given!r}")


def _numbers(values: object, what: str) -> tuple[float, ...]:
    """The entries of `values` as floats; InputError, naming the field `what`, if they are not numbers."""
    if not isinstance(values, Sequence | np.ndarray) or isinstance(values, str) or len(values) == 0:
        raise InputError(f"{what} must be a list of at least one number; got {values!r:.80}")
    return tuple(finite(value, f"{what}[{index}]", "") for index, value in enumerate(values))


@dataclass(frozen=True)
class Prony(Relaxation):
    """A generalised Maxwell solid: e(t) = 1 - sum(fractions) + sum_k fractions_k exp(-t / times_k).

    One term is the standard linear solid. The layer's modulus is the one at t = 0.

    Parameters
    ----------
    fractions : sequence of float
        Share of the modulus that each term loses, zero or more, together at most 1.
    times : sequence of float
        Relaxation time (s) of each term, positive.
    relaxes : str, default "shear_and_bulk"
        What relaxes: with ``"shear_and_bulk"`` Poisson's ratio is constant; ``"shear"`` alone is allowed for an
        incompressible layer, where it is the same.

    Raises
    ------
    InputError
        If the lists do not match or a number is not allowed.

    Examples
    --------
    >>> Prony(fractions=(0.5, 0.25), times=(0.1, 2.0)).equilibrium
    0.25
    """

    model: ClassVar[str] = "prony"

    fractions: tuple[float, ...] = field(
        metadata=quantity(
            "dimensionless",
            "relaxing fraction of the {part} modulus",
            symbol="f",
            bounds=(0.0, 1.0),
            natural_scale=0.1,
            linear=True,
            many=True,
        )
    )
    times: tuple[float, ...] = field(
        metadata=quantity(
            "time", "relaxation time of the {part}", symbol=r"\tau", bounds=(0.0, np.inf), many=True
        )
    )
    relaxes: str = "shear_and_bulk"

    def __post_init__(self) -> None:
        object.__setattr__(self, "fractions", _numbers(self.fractions, "fractions"))
        object.__setattr__(self, "times", _numbers(self.times, "times"))
        if len(self.fractions) != len(self.times):
            raise InputError(
                f"a Prony series needs one time for each fraction; got {len(self.fractions)} fractions and "
                f"{len(self.times)} times"
            )
        for index, (fraction, time) in enumerate(zip(self.fractions, self.times, strict=True)):
            if fraction < 0.0:
                raise InputError(f"fractions[{index}] must be zero or more; got {fraction!r}")
            if not time > 0.0:
                raise InputError(f"times[{index}] must be positive (s); got {time!r}")
        if sum(self.fractions) > 1.0 + _ROUNDING:
            raise InputError(
                f"the fractions add up to {sum(self.fractions):.6g}; a layer cannot lose more than all of its "
                "modulus: make them add up to 1 or less"
            )
        _checked_relaxes(self.relaxes)

    @property
    def equilibrium(self) -> float:
        """Share of the modulus that remains in the long run, 1 - sum(fractions)."""
        return max(1.0 - math.fsum(self.fractions), 0.0)  # the rounding of a sum of 1

    @property
    def longest_time(self) -> float:
        """Longest relaxation time (s)."""
        return max(self.times)

    def modulus(self, time: ArrayLike) -> FloatArray:
        """E(t)/E at `time` (s) after a sudden strain, shape of `time`; E is the instantaneous modulus."""
        return self.modes(0.0, np.inf)(as_finite(time, "time"))

    def modes(self, shortest: float, longest: float) -> Modes:
        """The series itself, which does not depend on the times `shortest` and `longest` (s)."""
        del shortest, longest
        return Modes(self.equilibrium, np.array(self.fractions), np.array(self.times))

    def modes_of(self, numbers: Mapping[str, FloatArray]) -> tuple[ModesOfSets, NDArray[np.bool_]]:
        """Modes of many sets, and a mask of valid ones: no negative fraction, and a sum of at most 1."""
        count = range(len(self.times))
        weights = np.stack([numbers[f"fractions[{k}]"] for k in count])
        times = np.stack([numbers[f"times[{k}]"] for k in count])
        total = weights.sum(axis=0)
        possible = (weights >= 0.0).all(axis=0) & (times > 0.0).all(axis=0) & (total <= 1.0 + _ROUNDING)
        constant = np.maximum(1.0 - total, 0.0)
        return ModesOfSets(constant[:, None], weights[..., None], times[..., None]), possible

    def mode_slopes(self, modes: Modes) -> Mapping[str, Modes]:
        """Derivatives of the modes in each fraction (a weight, taken from the constant) and each time."""
        del modes
        unit, none = np.eye(len(self.times)), np.zeros(len(self.times))
        return {f"fractions[{k}]": Modes(-1.0, row, none) for k, row in enumerate(unit)} | {
            f"times[{k}]": Modes(0.0, none, row) for k, row in enumerate(unit)
        }


@dataclass(frozen=True)
class PowerLawRelaxation(Relaxation):
    """e(t) = (t / time)**-exponent, without a characteristic time; the layer's modulus is the one at t = time.

    The instantaneous modulus is infinite, so depths must grow from zero within the record.

    Parameters
    ----------
    exponent : float
        Between 0.01 and 0.7.
    time : float, default 1.0
        Time (s) at which the modulus is the layer's E.
    relaxes : str, default "shear_and_bulk"
        As in `Prony`.

    Raises
    ------
    InputError
        If a number is not allowed.

    Examples
    --------
    >>> float(PowerLawRelaxation(exponent=0.5).modulus(4.0))
    0.5
    """

    model: ClassVar[str] = "power_law"

    exponent: float = field(
        metadata=quantity(
            "dimensionless", "relaxation exponent of the {part}", symbol=r"\alpha", bounds=_EXPONENTS
        )
    )
    time: float = field(
        default=1.0,
        metadata=quantity("time", "time of the modulus of the {part}", symbol="t_0", bounds=(0.0, np.inf)),
    )
    relaxes: str = "shear_and_bulk"

    def __post_init__(self) -> None:
        exponent = finite(self.exponent, "exponent", "dimensionless")
        low, high = _EXPONENTS
        if not low <= exponent <= high:
            raise InputError(f"exponent must be between {low} and {high}; got {exponent!r}")
        object.__setattr__(self, "exponent", exponent)
        object.__setattr__(self, "time", positive(self.time, "time", "s"))
        _checked_relaxes(self.relaxes)

    @property
    def equilibrium(self) -> float:
        """Zero: e(t) falls to zero at long times."""
        return 0.0

    @property
    def longest_time(self) -> float:
        """The reference time (s) at which the modulus is the layer's."""
        return self.time

    @property
    def bounded(self) -> bool:
        """False: e(t) is infinite at t = 0."""
        return False

    def modulus(self, time: ArrayLike) -> FloatArray:
        """E(t)/E at `time` (s), positive, after a sudden strain; E is the modulus at the reference time."""
        t = as_finite(time, "time")
        if not (t > 0.0).all():
            raise InputError("a power-law relaxation has a modulus at positive times only")
        return np.asarray((t / self.time) ** -self.exponent)

    def modes(self, shortest: float, longest: float) -> Modes:
        """Exponentials by the trapezoid rule for t^-a = (1 / Gamma(a)) int exp(a y - t e^y) dy, y = ln(1/time).

        The slow end, y < y0, changes too little within the longest time to be told from its value at t = 0, the
        geometric sum of exp(a y): off by (longest exp(y0))^(1 + a) / Gamma(a). The fast modes left out, from X on,
        hold (X shortest)^(a - 1) / Gamma(a) of a load that rises within the shortest time.
        """
        a = self.exponent
        low = math.log(_TAIL) / (1.0 + a) - math.log(longest)
        high = -math.log(_TAIL) / (1.0 - a) - math.log(shortest)
        y = low + _STEP * np.arange(int((high - low) / _STEP) + 2)
        scale = self.time**a / math.gamma(a)
        constant = scale * _STEP * math.exp(a * low) / math.expm1(a * _STEP)
        return Modes(constant, scale * _STEP * np.exp(a * y), np.exp(-y))

    def mode_slopes(self, modes: Modes) -> Mapping[str, Modes]:
        """Derivatives of the modes in exponent and time, with the points of the quadrature kept fixed."""
        a, none = self.exponent, np.zeros(len(modes.times))
        common = math.log(self.time) - float(special.digamma(a))
        low = -math.log(modes.times[0])
        end = common + low - _STEP / -math.expm1(-a * _STEP)
        in_exponent = Modes(modes.constant * end, modes.weights * (common - np.log(modes.times)), none)
        in_time = Modes(modes.constant * a / self.time, modes.weights * (a / self.time), none)
        return {"exponent": in_exponent, "time": in_time}
