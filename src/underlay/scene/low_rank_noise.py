"""Noise with errors that all readings of a curve share: known shapes, unknown sizes.

The reading at point k is F_k + sigma_k (z_k + sum_j C_kj u_j), z as `Noise` has it and u_j ~ N(0, 1): the variance
is D (R + C C') D. An error that is smooth along a curve does not average away with the number of points.
Whitened is z's own whitening, then each point less what those before it say of u,

    e_k = (y_k - a_k' M_k^-1 b_k) / s_k,   M_k = 1 + sum_{i<k} a_i a_i',   b_k = sum_{i<k} a_i y_i,
    s_k^2 = 1 + a_k' M_k^-1 a_k,

y and the rows a of the whitened readings and columns: recursive least squares, O(n m^2).
"""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import dataclass, field, replace
from typing import ClassVar, Self

import numpy as np
from numpy.typing import NDArray

from underlay._arrays import FloatArray, PerSet, as_finite, read_only
from underlay.errors import InputError
from underlay.quantities import no_number
from underlay.scene.noise import Noise

__all__ = ["LowRankNoise"]


@dataclass(frozen=True)
class LowRankNoise(Noise):
    """`Noise` and errors that the readings of one curve share.

    Parameters
    ----------
    force, relative, correlation_time, depth
        As in `Noise`; numbers that are given, not fitted.
    columns : FloatArray
        What each error of size one adds to the readings, over the standard deviation of their noise, (n, m); the
        sizes are normal with standard deviation one.
    common : FloatArray
        The same, (n, q), of errors that have one size in all curves of a problem. `whiten` and `log_deviations` are
        those of the curve where these sizes are known: what the curves have in common is theirs together.

    Raises
    ------
    InputError
        As `Noise` does, or if the columns are not of shape (n, m) and finite.

    Examples
    --------
    An offset of 2 uN that nobody knows better, beside white noise of 1 uN:

    >>> noise = LowRankNoise(force=1e-6, columns=np.full((3, 1), 2.0))
    >>> round(float(np.exp(noise.log_determinant(noise.sigma(np.zeros(3)))) / 1e-18), 10)
    3.6055512755
    """

    model: ClassVar[str] = ""

    columns: FloatArray = field(
        default_factory=lambda: np.zeros((0, 0)), metadata=no_number(), compare=False, repr=False
    )
    common: FloatArray = field(
        default_factory=lambda: np.zeros((0, 0)), metadata=no_number(), compare=False, repr=False
    )

    def __post_init__(self) -> None:
        super().__post_init__()
        for name in ("columns", "common"):
            columns = as_finite(getattr(self, name), name)
            if columns.ndim != 2:
                raise InputError(f"{name} are (readings, errors); got shape {columns.shape}")
            object.__setattr__(self, name, read_only(np.array(columns)))
        # Without errors of a kind the other says how many readings there are.
        points = max(len(self.columns), len(self.common))
        for name in ("columns", "common"):
            if not getattr(self, name).size:
                object.__setattr__(self, name, read_only(np.zeros((points, 0))))

    def whiten(self, standardised: FloatArray, time: FloatArray | None = None) -> FloatArray:
        """Independent unit-variance residuals (..., n) from `standardised` ones; see the module."""
        self._require(standardised.shape[-1])
        rows, gain, spread = self._steps(time)
        own = super().whiten(standardised, time)
        so_far = np.zeros((*own.shape, rows.shape[1]))
        np.cumsum(own[..., :-1, None] * rows[:-1], axis=-2, out=so_far[..., 1:, :])
        return np.asarray((own - np.einsum("...nm,nm->...n", so_far, gain)) / spread)

    def log_deviations(self, sigma: FloatArray, time: FloatArray | None = None) -> FloatArray:
        """Logarithm of the standard deviation (N) of each point given those before it, (..., n)."""
        return np.asarray(super().log_deviations(sigma, time) + np.log(self._steps(time)[2]))

    def sample(
        self, rng: np.random.Generator, sigma: FloatArray, time: FloatArray | None = None
    ) -> FloatArray:
        """Draw noise and shared errors (N) of standard deviation `sigma` (N) of the noise, same shape (..., n)."""
        self._require(sigma.shape[-1])
        columns = np.hstack((self.columns, self.common))
        sizes = rng.standard_normal((*sigma.shape[:-1], columns.shape[1]))
        return np.asarray(super().sample(rng, sigma, time) + sigma * (sizes @ columns.T))

    @property
    def correlation(self) -> tuple[PerSet, ...]:
        """The correlation time, and the size of every column."""
        columns = np.hstack((self.columns, self.common))
        return (*super().correlation, *np.linalg.norm(columns, axis=0).tolist())

    def check(self, free: Collection[str], points: int, time: FloatArray | None) -> None:
        """Refuse columns for other readings, and numbers of the noise that are not given."""
        if free:
            raise InputError(
                f"noise.{min(free)} cannot be fitted beside shared errors, whose sizes are over the noise: state it"
            )
        if self.force is None:
            raise InputError("noise.force is unknown beside shared errors: give its value (N)")
        self._require(points)
        super().check(free, points, time)

    def of_readings(self, kept: NDArray[np.bool_]) -> Self:
        """Return the model for some of the readings, (n,)."""
        return replace(self, columns=self.columns[kept], common=self.common[kept])

    def _require(self, points: int) -> None:
        if not len(self.columns) == len(self.common) == points:
            of = len(self.columns) if len(self.columns) != points else len(self.common)
            raise InputError(f"these shared errors are of a curve with {of} readings; got {points}")

    def _steps(self, time: FloatArray | None) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Rows a, gains M^-1 a, (n, m) each, and s (n,)."""
        rows = super().whiten(self.columns.T, time).T
        before = np.cumsum(rows[:, :, None] * rows[:, None, :], axis=0)
        before = np.concatenate((np.zeros_like(before[:1]), before[:-1])) + np.eye(rows.shape[1])
        gain: FloatArray = np.asarray(np.linalg.solve(before, rows[:, :, None])[..., 0], dtype=np.float64)
        return rows, gain, np.asarray(np.sqrt(1.0 + np.einsum("nm,nm->n", rows, gain)))
