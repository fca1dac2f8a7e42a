"""What an instrument does to a force reading beside its noise: drift, outliers, and the steps of its load cell."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import ClassVar

import numpy as np

from underlay._arrays import FloatArray, finite
from underlay.errors import InputError
from underlay.quantities import Part, field_quantities, quantity

__all__ = ["Disturbances"]


@dataclass(frozen=True)
class Disturbances(Part):
    """What else disturbs a made curve; every part is off unless named.

    Parameters
    ----------
    drift : float, default 0
        Drift of the force reading (N/s), from the first point on; needs times.
    quantisation : float, default 0
        Step of the load cell (N): the force is rounded to multiples of it.
    outliers : float, default 0
        Probability of a point to be an outlier, in [0, 1].
    outlier_sd : float, default 0
        Standard deviation (N) of what an outlier adds; needed when `outliers` is not zero.

    Raises
    ------
    InputError
        If a number is not allowed, or outliers have no size.
    """

    parts: ClassVar[tuple[str, ...]] = ("disturbances",)

    drift: float = field(default=0.0, metadata=quantity("loading rate", "drift of the force"))
    quantisation: float = field(default=0.0, metadata=quantity("force", "step of the load cell"))
    outliers: float = field(default=0.0, metadata=quantity("dimensionless", "share of outliers"))
    outlier_sd: float = field(default=0.0, metadata=quantity("force", "size of the outliers"))

    def __post_init__(self) -> None:
        for name, unit in (
            ("drift", "N/s"),
            ("quantisation", "N"),
            ("outliers", "probability of a point"),
            ("outlier_sd", "N"),
        ):
            object.__setattr__(self, name, finite(getattr(self, name), name, unit))
        for name in ("quantisation", "outlier_sd"):
            if getattr(self, name) < 0.0:
                raise InputError(f"{name} must be zero or positive (N); got {getattr(self, name)!r}")
        if not (0.0 <= self.outliers <= 1.0):
            raise InputError(
                f"outliers is the probability of a point, between 0 and 1; got {self.outliers!r}"
            )
        if self.outliers and not self.outlier_sd:
            raise InputError("outliers need their size: give outlier_sd, a standard deviation (N)")

    @property
    def numbers(self) -> dict[str, float]:
        """What it holds, by name (SI)."""
        return {name: getattr(self, name) for name in field_quantities(type(self))}

    def on(self, force: FloatArray, clock: FloatArray | None, rng: np.random.Generator) -> FloatArray:
        """Return the force reading (N), (n,), disturbed; `clock` (s), (n,), is what a drift needs.

        Raises
        ------
        InputError
            If there is a drift and no clock.
        """
        if self.drift:
            if clock is None:
                raise InputError(
                    "drift (N/s) needs the times of the points: pass time (s) or sampling_rate (Hz)"
                )
            force = force + self.drift * (clock - clock[0])
        if self.outliers:
            hit = rng.random(force.size) < self.outliers
            force = force + hit * rng.normal(scale=self.outlier_sd, size=force.size)
        return np.round(force / self.quantisation) * self.quantisation if self.quantisation else force
