"""Noise of a force reading: one model, used by the generator of curves and by the likelihood.

The reading at point k is F_k + sigma_k z_k, the z_k of unit variance with correlation matrix R: the covariance is V
= D R D, D the diagonal of the standard deviations. A `NoiseModel` defines sigma, how z is whitened, half the
logarithm of det V, and how it is drawn; the log-likelihood of residuals r is

    ``log_normalisation - sum(whiten(r / sigma)^2) / 2``.

`Noise` is the usual model: white, proportional to the force, of the depth, correlated in time. `LowRankNoise` adds
errors that all readings of a curve share. To add a noise model, derive a frozen dataclass from `NoiseModel` with
its numbers as fields. Only `sigma` must be written where the points are independent. The numbers may be floats, or
arrays (sets, 1) with points (sets, n): formulas in numpy's broadcasting serve both.

Noise that is correlated over a time tau is a stationary Gaussian process with correlation exp(-|t - t'| / tau).
Sampled, it is AR(1) with rho_k = exp(-(t_k - t_{k-1}) / tau), on regular and irregular times alike. Its whitening

    e_0 = z_0,   e_k = (z_k - rho_k z_{k-1}) / sqrt(1 - rho_k^2)

is O(n) (`ar1_whiten`).
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Collection, Mapping
from copy import copy
from dataclasses import dataclass, field, replace
from typing import ClassVar, Self

import numpy as np
from numpy.typing import NDArray
from scipy import linalg

from underlay._arrays import FloatArray, PerSet, as_finite, finite, read_only
from underlay.errors import InputError
from underlay.quantities import Part, field_quantities, no_number, quantity
from underlay.units import KINDS


class NoiseModel(Part, ABC):
    """Model of the noise of a force reading; its numbers have paths ``noise.*``, and any of them may be free."""

    parts: ClassVar[tuple[str, ...]] = ("noise",)
    chosen_by: ClassVar[str] = "model"
    #: Name in scene files.
    model: ClassVar[str] = ""

    @abstractmethod
    def sigma(
        self, force: FloatArray, stiffness: FloatArray | None = None, time: FloatArray | None = None
    ) -> FloatArray:
        """Standard deviation (N) of the reading.

        Parameters
        ----------
        force : FloatArray
            Contact force (N), (..., n).
        stiffness : FloatArray, optional
            dP/dw (N/m), (..., n); given where `needs_stiffness`.
        time : FloatArray, optional
            Times (s), (n,), where the curve has them.

        Returns
        -------
        FloatArray
            (..., n), positive. It may be a read-only view.
        """

    def whiten(self, standardised: FloatArray, time: FloatArray | None = None) -> FloatArray:
        """Independent unit-variance residuals (..., n) from residuals over their `sigma`; linear in them."""
        del time
        return standardised

    def log_deviations(self, sigma: FloatArray, time: FloatArray | None = None) -> FloatArray:
        """Logarithm of each point's standard deviation (N) conditional on the points before it, (..., n)."""
        del time
        return np.asarray(np.log(sigma))

    def log_determinant(self, sigma: FloatArray, time: FloatArray | None = None) -> FloatArray:
        """Half the logarithm of the determinant of the covariance, (...): the sum of `log_deviations`."""
        points = sigma.shape[-1]
        if points > 1 and sigma.strides[-1] == 0 and not self.correlation:
            # The broadcast view of pure white noise: all points of a set have one sigma, one logarithm suffices.
            return np.asarray(points * np.log(sigma[..., 0]))
        return np.asarray(self.log_deviations(sigma, time).sum(axis=-1))

    def sample(
        self, rng: np.random.Generator, sigma: FloatArray, time: FloatArray | None = None
    ) -> FloatArray:
        """Draw noise (N) of standard deviation `sigma` (N), same shape (..., n), at `time` (s), (n,)."""
        del time
        return sigma * rng.standard_normal(np.shape(sigma))

    def log_normalisation(self, sigma: FloatArray, time: FloatArray | None = None) -> FloatArray:
        """Logarithm of the Gaussian's normalisation (...): - log_determinant - n log(2 pi) / 2.

        Raises
        ------
        InputError
            If a standard deviation is zero.
        """
        if not (sigma > 0.0).all():
            raise InputError(
                "the noise of some points is zero, so their likelihood is infinite: before contact neither "
                "relative nor depth noise acts; give noise.force too (N)"
            )
        return np.asarray(-self.log_determinant(sigma, time) - 0.5 * sigma.shape[-1] * np.log(2.0 * np.pi))

    # --- what those who use it may ask ------------------------------------------------------------------

    @property
    def follows_force(self) -> bool:
        """Whether `sigma` depends on the model's force, so that a fit must update it."""
        return True

    @property
    def needs_stiffness(self) -> bool:
        """Whether `sigma` depends on the stiffness."""
        return False

    @property
    def correlation(self) -> tuple[PerSet, ...]:
        """Numbers that `whiten` depends on; empty where the points are independent."""
        return ()

    @property
    def size_is_unknown(self) -> bool:
        """Whether its size is neither given nor a parameter: it is then estimated, or integrated out."""
        return False

    def of_size(self, size: float) -> Self:
        """Return the model with its unknown size (N) given; itself where it is known."""
        del size
        return self

    def of_force(self) -> NoiseModel | None:
        """The part of the noise that a generator adds to the force reading; None where there is none."""
        return self

    @property
    def depth_deviation(self) -> float:
        """Standard deviation (m) that a generator adds to the depth reading."""
        return 0.0

    def check(self, free: Collection[str], points: int, time: FloatArray | None) -> None:
        """Raise InputError where a curve of `points` points at `time` (s) cannot have this noise.

        `free` are the names of its free numbers.
        """
        del free
        self.whiten(np.zeros(points), time)

    def of_readings(self, kept: NDArray[np.bool_]) -> Self:
        """Return the model for the readings that a mask (n,) keeps; itself where it has no number per reading."""
        del kept
        return self

    def at(self, numbers: Mapping[str, PerSet]) -> Self:
        """Return the model with some numbers replaced, each a float or an array (sets, 1).

        Numbers of many sets are not checked: a set with impossible ones has a zero likelihood.
        """
        if not numbers:
            return self
        changed = copy(self)
        for name, value in numbers.items():
            object.__setattr__(changed, name, value)
        return changed


def ar1_whiten(standardised: FloatArray, time: FloatArray | None, correlation_time: PerSet) -> FloatArray:
    """Turn residuals over their standard deviation into independent ones of unit variance, in O(n).

    Parameters
    ----------
    standardised : FloatArray
        Residual / sigma (dimensionless), (..., n).
    time : FloatArray or None
        Times (s), (n,), increasing.
    correlation_time : float or FloatArray
        tau (s), positive: a number, or one per set, (sets, 1).

    Returns
    -------
    FloatArray
        (..., n).

    Raises
    ------
    InputError
        If a correlation time is set and `time` is missing or does not increase.
    """
    rho, spread = ar1_coefficients(time, correlation_time)
    white = np.empty(np.broadcast_shapes(standardised.shape, (*rho.shape[:-1], 1)))
    white[..., 0] = standardised[..., 0]
    white[..., 1:] = (standardised[..., 1:] - rho * standardised[..., :-1]) / spread
    return white


def ar1_sample(
    rng: np.random.Generator, shape: tuple[int, ...], time: FloatArray | None, correlation_time: float
) -> FloatArray:
    """Draw unit-variance noise (..., n), correlated over `correlation_time` (s) along the last axis.

    Raises
    ------
    InputError
        As `ar1_whiten` does.
    """
    white = rng.standard_normal(shape)
    if not correlation_time:
        return white
    rho, spread = ar1_coefficients(time, correlation_time)
    white[..., 1:] *= spread
    # z_k - rho_k z_{k-1} = innovation_k is a lower bidiagonal system: one banded solve for every row.
    bands = np.ones((2, shape[-1]))
    bands[1, :-1] = -rho
    bands[1, -1] = 0.0
    columns = white.reshape(-1, shape[-1]).T
    return np.asarray(linalg.solve_banded((1, 0), bands, columns).T.reshape(shape))


def ar1_coefficients(time: FloatArray | None, correlation_time: PerSet) -> tuple[FloatArray, FloatArray]:
    """rho_k and sqrt(1 - rho_k^2) of neighbouring points, each (..., n - 1); raises as `ar1_whiten` does."""
    if time is None:
        raise InputError(
            "a correlation time needs the times of the points (s): give the curve a time column or a "
            "sampling rate, or set noise.correlation_time to 0"
        )
    step = np.diff(time)
    if not (step > 0.0).all():
        raise InputError(
            "a correlation time needs increasing times; they do not increase after index "
            f"{int(np.flatnonzero(~(step > 0.0))[0])}"
        )
    tau = np.asarray(correlation_time, dtype=np.float64)
    if not (tau > 0.0).all():
        raise InputError(f"a correlation time must be positive (s) in every set; got {float(tau.min())!r}")
    lag = step / tau
    # expm1 keeps 1 - rho^2 exact to rounding when the points are much closer than tau.
    return np.exp(-lag), np.sqrt(-np.expm1(-2.0 * lag))


@dataclass(frozen=True)
class Noise(NoiseModel):
    """Noise of a force reading; every part is zero unless given.

    The variances of white noise, of noise proportional to the force and of an uncertain depth add,

        sigma^2 = force^2 + (relative * P)^2 + (depth * dP/dw)^2,

    with P the contact force and w the depth; the last term is the effective variance of an uncertain depth, first
    order in the depth error (Orear 1982, doi:10.1119/1.12972). The readings are independent, or correlated over a
    time constant (`ar1_whiten`).

    Parameters
    ----------
    force : float, optional
        Standard deviation of the white force noise (N). None means unknown: an inference estimates it, a generator
        leaves it out.
    relative : float, default 0
        Standard deviation proportional to the contact force (dimensionless).
    correlation_time : float, default 0
        Time constant tau (s) over which the noise stays correlated; zero means independent points.
    depth : float, default 0
        Standard deviation of the depth reading (m), which acts on the force through the stiffness.

    Raises
    ------
    InputError
        If a number is negative or not finite, or all parts are zero.

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
        """log sigma_k, plus log(1 - rho_k^2) / 2 for every point but the first, (..., n).

        rho_k is the correlation with the point before.
        """
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
            If the size is zero: without scatter the noise cannot be estimated.
        """
        if self.force is None and not size:
            raise InputError(
                "the curve follows the law to the last digit, so the size of its noise cannot be estimated from "
                "it: state noise.force, such as the last digit of the instrument"
            )
        return replace(self, force=size) if self.force is None else self

    def of_force(self) -> Noise | None:
        """The white and proportional parts, for the force reading; the depth noise acts on the depth itself."""
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
        """Raise InputError for white noise that is zero, or unknown beside other parts, and for unordered times."""
        del points
        if (
            self.force is None
            and "force" not in free
            and (self.follows_force or {"relative", "depth"} & set(free))
        ):
            raise InputError(
                "noise.force is unknown beside relative or depth noise: give its value (N), or free it"
            )
        if self.force == 0.0 and "force" not in free:
            raise InputError(
                "noise.force is zero: points before contact, where relative and depth noise vanish, would count "
                "as exact; give the white noise of the force reading (N)"
            )
        if not _is_off(self.correlation_time) or "correlation_time" in free:
            ar1_coefficients(time, self.correlation_time or 1.0)


def _is_off(part: PerSet) -> bool:
    """Whether a part of the noise is zero in every set; fast for single numbers, which a fit checks often."""
    return part == 0.0 if isinstance(part, float) else not np.any(part)


@dataclass(frozen=True)
class LowRankNoise(Noise):
    """`Noise` and errors that the readings of one curve share: known shapes, unknown sizes.

    The reading at point k is F_k + sigma_k (z_k + sum_j C_kj u_j), with z as in `Noise` and u_j ~ N(0, 1): the
    covariance is D (R + C C') D, D the diagonal of sigma and R the correlation of z. An error that is smooth along
    a curve does not average out with the number of points. Whitening is that of z, followed by recursive least
    squares in O(n m^2): each point less its prediction from the points before it,

        e_k = (y_k - a_k' M_k^-1 b_k) / s_k,   M_k = 1 + sum_{i<k} a_i a_i',   b_k = sum_{i<k} a_i y_i,
        s_k^2 = 1 + a_k' M_k^-1 a_k,

    with y the whitened readings and a_k the rows of the whitened columns.

    Parameters
    ----------
    force, relative, correlation_time, depth
        As in `Noise`; numbers that are given, not fitted.
    columns : FloatArray
        C: what each error of size one adds to the readings, over the standard deviation of their noise, (n, m); the
        sizes are normal with standard deviation one.
    common : FloatArray
        Such columns, (n, q), of errors that have one size in all curves of a problem. `whiten` and `log_deviations`
        are those of the curve where these sizes are known; the curves' common part is in `CommonErrors`.

    Raises
    ------
    InputError
        As `Noise` does, or if the columns are not of shape (n, m) and finite.

    Examples
    --------
    An unknown offset of standard deviation 2 uN, with white noise of 1 uN:

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
        # Without columns of one kind the other gives the number of readings.
        points = max(len(self.columns), len(self.common))
        for name in ("columns", "common"):
            if not getattr(self, name).size:
                object.__setattr__(self, name, read_only(np.zeros((points, 0))))

    def whiten(self, standardised: FloatArray, time: FloatArray | None = None) -> FloatArray:
        """Independent unit-variance residuals (..., n) from `standardised` ones; see the class."""
        self._require(standardised.shape[-1])
        rows, gain, spread = self._steps(time)
        own = super().whiten(standardised, time)
        so_far = np.zeros((*own.shape, rows.shape[1]))
        np.cumsum(own[..., :-1, None] * rows[:-1], axis=-2, out=so_far[..., 1:, :])
        return np.asarray((own - np.einsum("...nm,nm->...n", so_far, gain)) / spread)

    def log_deviations(self, sigma: FloatArray, time: FloatArray | None = None) -> FloatArray:
        """Logarithm of each point's standard deviation (N) conditional on the points before it, (..., n)."""
        return np.asarray(super().log_deviations(sigma, time) + np.log(self._steps(time)[2]))

    def sample(
        self, rng: np.random.Generator, sigma: FloatArray, time: FloatArray | None = None
    ) -> FloatArray:
        """Draw noise and shared errors (N), (..., n), for noise of standard deviation `sigma` (N), same shape."""
        self._require(sigma.shape[-1])
        columns = np.hstack((self.columns, self.common))
        sizes = rng.standard_normal((*sigma.shape[:-1], columns.shape[1]))
        return np.asarray(super().sample(rng, sigma, time) + sigma * (sizes @ columns.T))

    @property
    def correlation(self) -> tuple[PerSet, ...]:
        """Numbers that `whiten` depends on: the correlation time, and the norm of every column."""
        columns = np.hstack((self.columns, self.common))
        return (*super().correlation, *np.linalg.norm(columns, axis=0).tolist())

    def check(self, free: Collection[str], points: int, time: FloatArray | None) -> None:
        """Raise InputError for columns of another number of readings, and for free or unknown noise numbers."""
        if free:
            raise InputError(
                f"noise.{min(free)} cannot be fitted beside shared errors, whose sizes are over the noise: state it"
            )
        if self.force is None:
            raise InputError("noise.force is unknown beside shared errors: give its value (N)")
        self._require(points)
        super().check(free, points, time)

    def of_readings(self, kept: NDArray[np.bool_]) -> Self:
        """Return the model for the readings that a mask (n,) keeps."""
        return replace(self, columns=self.columns[kept], common=self.common[kept])

    def _require(self, points: int) -> None:
        if not len(self.columns) == len(self.common) == points:
            of = len(self.columns) if len(self.columns) != points else len(self.common)
            raise InputError(f"these shared errors are of a curve with {of} readings; got {points}")

    def _steps(self, time: FloatArray | None) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Rows a of the whitened columns, gains M^-1 a, (n, m) each, and s (n,); symbols as in the class."""
        rows = super().whiten(self.columns.T, time).T
        before = np.cumsum(rows[:, :, None] * rows[:, None, :], axis=0)
        before = np.concatenate((np.zeros_like(before[:1]), before[:-1])) + np.eye(rows.shape[1])
        gain: FloatArray = np.asarray(np.linalg.solve(before, rows[:, :, None])[..., 0], dtype=np.float64)
        return rows, gain, np.asarray(np.sqrt(1.0 + np.einsum("nm,nm->n", rows, gain)))
