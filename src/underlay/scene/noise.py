"""The noise model of the house: white, in proportion to the force, of the depth, correlated in time.

Each part is off unless named. The standard deviations of white noise, of noise in proportion to the force and of an
uncertain depth add in squares,

    sigma^2 = force^2 + (relative * P)^2 + (depth * dP/dw)^2,

with P the contact force; the last term is the effective variance of an uncertain depth, first order in the depth
error (Orear 1982, doi:10.1119/1.12972). The readings are independent, or correlated over a time constant
(`correlated_noise`).
"""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import dataclass, field, replace
from typing import ClassVar, Self

import numpy as np

from underlay._arrays import FloatArray, PerSet, finite
from underlay.errors import InputError
from underlay.quantities import field_quantities, quantity
from underlay.scene.correlated_noise import ar1_coefficients, ar1_sample, ar1_whiten
from underlay.scene.noise_model import NoiseModel
from underlay.units import KINDS

__all__ = ["Noise"]


@dataclass(frozen=True)
class Noise(NoiseModel):
    """What disturbs a force reading; every part is off unless named.

    Parameters
    ----------
    force : float, optional
        Standard deviation of the white force noise (N). None means unknown: an inference estimates it, a
        generator leaves it out.
    relative : float, default 0
        Standard deviation proportional to the contact force (dimensionless).
    correlation_time : float, default 0
        Time constant tau (s) over which the noise stays correlated; zero means independent points.
    depth : float, default 0
        Standard deviation of the depth reading (m), seen in the force through the stiffness.

    Raises
    ------
    InputError
        If a number is negative or not finite, or all that could disturb the reading is zero.

    Examples
    --------
    >>> Noise(force=3e-6, relative=0.02).sigma(np.array([0.0, 2e-4]))
    array([3.e-06, 5.e-06])
    """

    model: ClassVar[str] = "gaussian"

    force: float | None = field(
        default=None, metadata=quantity("force", "noise of the force", bounds=(0.0, np.inf))
    )
    relative: float = field(
        default=0.0,
        metadata=quantity("dimensionless", "relative noise", bounds=(0.0, np.inf), natural_scale=0.01),
    )
    correlation_time: float = field(
        default=0.0, metadata=quantity("time", "correlation time of the noise", bounds=(0.0, np.inf))
    )
    depth: float = field(default=0.0, metadata=quantity("length", "noise of the depth", bounds=(0.0, np.inf)))

    def __post_init__(self) -> None:
        for name, known in field_quantities(self).items():
            given, unit = getattr(self, name), KINDS[known.kind].si or "dimensionless"
            if given is None and name == "force":
                continue
            value = finite(given, f"noise.{name}", unit)
            if value < 0.0:
                raise InputError(f"noise.{name} must be zero or positive ({unit}); got {given!r}")
            object.__setattr__(self, name, value)
        if self.force == 0.0 and self.relative == 0.0 and self.depth == 0.0:
            raise InputError(
                "zero noise: noise.force, noise.relative and noise.depth are all 0, and no measurement is "
                "exact; give one of them, or leave force out (None) to have it estimated"
            )

    def sigma(
        self, force: FloatArray, stiffness: FloatArray | None = None, time: FloatArray | None = None
    ) -> FloatArray:
        """Standard deviation (N) of the reading, (..., n); see `NoiseModel.sigma`.

        Where white noise is alone it is a read-only broadcast view, which `log_determinant` knows.

        Raises
        ------
        InputError
            If the white noise is unknown, or the stiffness is needed and missing.
        """
        del time
        if self.force is None:
            raise InputError(
                "noise.force is unknown (None): give it a value (N), or a prior so that it is estimated"
            )
        white = np.asarray(self.force, dtype=np.float64)
        if not self.follows_force:
            shape = np.broadcast_shapes(white.shape, np.shape(force)) if white.ndim else np.shape(force)
            return np.broadcast_to(white, shape)
        variance = white * white
        if not _is_off(self.relative):
            variance = variance + np.square(self.relative * force)
        if self.needs_stiffness:
            if stiffness is None:
                raise InputError("depth noise acts through the stiffness dP/dw (N/m): pass it")
            variance = variance + np.square(self.depth * stiffness)
        return np.asarray(np.sqrt(variance))

    def whiten(self, standardised: FloatArray, time: FloatArray | None = None) -> FloatArray:
        """Independent unit-variance residuals (..., n) from `standardised` ones; see `ar1_whiten`."""
        if _is_off(self.correlation_time):
            return standardised
        return ar1_whiten(standardised, time, self.correlation_time)

    def log_deviations(self, sigma: FloatArray, time: FloatArray | None = None) -> FloatArray:
        """log sigma_k, and log(1 - rho_k^2) / 2 more for every point but the first, (..., n)."""
        own = np.log(sigma)
        if not _is_off(self.correlation_time):
            _, spread = ar1_coefficients(time, self.correlation_time)
            own = np.array(np.broadcast_to(own, np.broadcast_shapes(own.shape, (*spread.shape[:-1], 1))))
            own[..., 1:] += np.log(spread)
        return np.asarray(own)

    def sample(
        self, rng: np.random.Generator, sigma: FloatArray, time: FloatArray | None = None
    ) -> FloatArray:
        """Draw noise (N) of standard deviation `sigma` (N), same shape (..., n), at `time` (s), (n,).

        Raises
        ------
        InputError
            If a correlation time is set and `time` is missing or does not increase.
        """
        return sigma * ar1_sample(rng, np.shape(sigma), time, self.correlation_time)

    @property
    def follows_force(self) -> bool:
        """Whether there is proportional or depth noise."""
        return not (_is_off(self.relative) and _is_off(self.depth))

    @property
    def needs_stiffness(self) -> bool:
        """Whether there is depth noise."""
        return not _is_off(self.depth)

    @property
    def correlation(self) -> tuple[PerSet, ...]:
        """The correlation time, where there is one."""
        return () if _is_off(self.correlation_time) else (self.correlation_time,)

    @property
    def size_is_unknown(self) -> bool:
        """Whether the white noise is unknown."""
        return self.force is None

    def of_size(self, size: float) -> Self:
        """Return the model with this white noise (N); itself where it is known.

        Raises
        ------
        InputError
            If the size is zero: scatter that is not there cannot be told from the curve.
        """
        if self.force is None and not size:
            raise InputError(
                "the curve follows the law to the last digit, so the size of its noise cannot be estimated from "
                "it: state noise.force, such as the last digit of the instrument"
            )
        return replace(self, force=size) if self.force is None else self

    def of_force(self) -> Noise | None:
        """White and proportional parts: the depth noise acts on the depth itself."""
        if self.force is None and not self.follows_force:
            raise InputError(
                "noise.force is unknown (None), which a generator cannot draw: give it a value (N), or pass no "
                "noise for a clean curve"
            )
        if not (self.force or self.relative):
            return None
        return replace(self, force=self.force or 0.0, depth=0.0)

    @property
    def depth_deviation(self) -> float:
        """The depth noise (m)."""
        return self.depth

    def check(self, free: Collection[str], points: int, time: FloatArray | None) -> None:
        """Refuse white noise that is unknown beside other parts, or zero; and times that do not increase."""
        del points
        if (
            self.force is None
            and "force" not in free
            and (self.follows_force or {"relative", "depth"} & set(free))
        ):
            raise InputError(
                "noise.force is unknown beside relative or depth noise: give its value (N), or free it "
                "(free={'noise.force': None, ...})"
            )
        if self.force == 0.0 and "force" not in free:
            raise InputError(
                "noise.force is zero: points before contact, where relative and depth noise vanish, would count "
                "as exact; give the white noise of the force reading (N)"
            )
        if not _is_off(self.correlation_time) or "correlation_time" in free:
            ar1_coefficients(time, self.correlation_time or 1.0)


def _is_off(part: PerSet) -> bool:
    """Whether a part of the noise is zero in every set; a fit asks this of single numbers at every step."""
    return part == 0.0 if isinstance(part, float) else not np.any(part)
