"""Noise of a force reading: one model, shared by the generator of curves and by the likelihood.

The reading at point k is F_k + sigma_k z_k, the z_k of unit variance with correlations of their own: the
covariance is V = D R D, D the standard deviations. A `NoiseModel` says sigma, how z is whitened, half the
logarithm of det V, and how it is drawn; the log-likelihood of residuals r is

    ``log_normalisation - sum(whiten(r / sigma)^2) / 2``.

To add a noise model: a frozen dataclass that derives from `NoiseModel`, its numbers declared in its fields. Only
`sigma` must be written where the points are independent. The numbers may be floats, or arrays (sets, 1) beside
points (sets, n): formulas in numpy's broadcasting serve both.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Collection, Mapping
from copy import copy
from typing import ClassVar, Self

import numpy as np
from numpy.typing import NDArray

from underlay._arrays import FloatArray, PerSet
from underlay.errors import InputError
from underlay.quantities import Part

__all__ = ["NoiseModel"]


class NoiseModel(Part, ABC):
    """What disturbs a force reading; its numbers stand under ``noise.``, and any of them may be free."""

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
        """Logarithm of the standard deviation (N) of each point given those before it, (..., n)."""
        del time
        return np.asarray(np.log(sigma))

    def log_determinant(self, sigma: FloatArray, time: FloatArray | None = None) -> FloatArray:
        """Half the logarithm of the determinant of the covariance, (...): the sum of `log_deviations`."""
        points = sigma.shape[-1]
        if points > 1 and sigma.strides[-1] == 0 and not self.correlation:
            # The broadcast view of white noise alone: all points of a set have one sigma, one logarithm serves.
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
        """Whether `sigma` depends on the model's force, so that a fit renews it."""
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
        """What a generator draws on the force reading; None where nothing acts there."""
        return self

    @property
    def depth_deviation(self) -> float:
        """Standard deviation (m) that a generator adds to the depth reading."""
        return 0.0

    def check(self, free: Collection[str], points: int, time: FloatArray | None) -> None:
        """Refuse, by InputError, what no curve of so many points at `time` can have; `free` are its numbers."""
        del free
        self.whiten(np.zeros(points), time)

    def of_readings(self, kept: NDArray[np.bool_]) -> Self:
        """Return the model for some of a curve's readings, (n,); itself where it does not know their number."""
        del kept
        return self

    def at(self, numbers: Mapping[str, PerSet]) -> Self:
        """Return the model with some numbers replaced, each a float or an array (sets, 1).

        Numbers of many sets are not checked: where a set has impossible ones its likelihood says so.
        """
        if not numbers:
            return self
        changed = copy(self)
        for name, value in numbers.items():
            object.__setattr__(changed, name, value)
        return changed
