"""A model about the present fit: derivatives, what a drift and a jump would add, residuals, measured priors."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from underlay._arrays import FloatArray
from underlay.inference.misfit.whitener import Whitener

__all__ = ["DRIFTS", "JUMPS", "Linearised", "Part", "drift_columns", "jump_columns"]

#: Columns of a drift, in half powers of the depth.
DRIFTS = 3
#: Where the steps of a jump stand, as shares of the largest depth: before contact and a little into it.
_STEPS = np.array([-0.15, -0.1, -0.06, -0.03, -0.01, 0.01, 0.04, 0.08])
JUMPS = len(_STEPS)


def drift_columns(force: FloatArray, depth: FloatArray) -> FloatArray:
    """Phi: smooth relative errors of the law that vanish at contact, (n, 3), over the largest force.

    Parameters
    ----------
    force, depth : FloatArray
        Contact force P (N) and indentation depth w (m), (n,); zero before contact.
    """
    share = np.sqrt(np.maximum(depth, 0.0) / depth.max())[:, None]
    order = np.arange(1, DRIFTS + 1)
    return np.asarray((force / np.abs(force).max())[:, None] * share**order / order)


def jump_columns(depth: FloatArray) -> FloatArray:
    """Z: steps of the force about contact, (n, 8), for depths w (m), (n,), negative before contact."""
    steps = depth[:, None] > _STEPS * depth.max()
    return np.asarray(steps.astype(float) / np.sqrt(JUMPS))


@dataclass(frozen=True)
class Part:
    """One curve of a model about the present fit.

    Parameters
    ----------
    residuals : FloatArray
        Model minus data over the scatter of the curve, (n,).
    jacobian : FloatArray
        Its derivatives in scaled coordinates and in the amplitudes of known errors, (n, k).
    drift, jump : FloatArray
        `drift_columns` and `jump_columns`, (n, 3) and (n, 8).
    time : FloatArray
        Times of the readings (s), (n,), increasing; their numbers where there are none.
    """

    residuals: FloatArray
    jacobian: FloatArray
    drift: FloatArray
    jump: FloatArray
    time: FloatArray

    @cached_property
    def columns(self) -> FloatArray:
        """All that is whitened, (n, k + 12): derivatives, drift, jump, residuals."""
        return np.asfortranarray(np.column_stack((self.jacobian, self.drift, self.jump, self.residuals)))


@dataclass(frozen=True)
class Linearised:
    """A model about the present fit: its curves, and the priors that are measurements.

    Parameters
    ----------
    parts : sequence of Part
        The curves. They share sizes and times of noise, drift and jump, each over its own scatter, and not
        what these happen to be.
    precision, pull : FloatArray
        Of the priors: 1 / sd^2 and (value - mean) / sd^2 of every coordinate and amplitude, (k,); zero where
        there is none.
    held : tuple of int
        Entries that stay where they are; their derivatives are zero.
    """

    parts: Sequence[Part]
    precision: FloatArray
    pull: FloatArray
    held: tuple[int, ...] = ()

    @property
    def readings(self) -> int:
        """Number of readings n of all curves."""
        return sum(len(part.residuals) for part in self.parts)

    @property
    def offset(self) -> float:
        """Sum of squares of the priors at the present fit."""
        acting = self.precision > 0.0
        return float(np.sum(np.square(self.pull[acting]) / self.precision[acting]))

    def gram(self, noise: tuple[float, float] | None) -> tuple[FloatArray, float]:
        """Products of all whitened columns, (m, m) with m = k + 11 curves + 1, and log det V.

        The columns are the derivatives, drift and jump of each curve, and the residuals.
        """
        k, own = len(self.precision), self.parts[0].columns.shape[1] - len(self.precision) - 1
        gram = np.zeros((k + own * len(self.parts) + 1,) * 2)
        log_determinant = 0.0
        for number, part in enumerate(self.parts):
            columns = part.columns
            if noise is not None:
                whitener = Whitener.of(part.time, *noise)
                columns = whitener.whiten(columns)
                log_determinant += whitener.log_determinant
            places = np.r_[np.arange(k), k + own * number + np.arange(own), -1]
            gram[np.ix_(places, places)] += columns.T @ columns
        # One on the diagonal, and nothing beside: the algebra keeps its shape, and the shift of these is zero.
        gram[list(self.held), list(self.held)] += 1.0
        return gram, log_determinant
