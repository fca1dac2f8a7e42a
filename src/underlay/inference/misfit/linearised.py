"""A model about the present fit: derivatives, what drift, jump and ramp would add, residuals, measured priors."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import groupby

import numpy as np

from underlay._arrays import FloatArray
from underlay.inference.misfit.drift import DRIFTS
from underlay.inference.misfit.whitener import Whitener

__all__ = ["JUMPS", "RAMPS", "Linearised", "Part", "jump_columns", "ramp_column"]

# Where the steps of a jump stand, as shares of the largest depth, before contact and a little into it; and the gaps
# over which a force that grows toward contact does so (drag, attraction: no step is felt that far out).
_STEPS, _GAPS = np.array([-0.06, -0.03, -0.01, 0.01, 0.04]), np.array([0.03, 0.1, 0.3])
#: Columns of a force that sets in near contact.
JUMPS = len(_STEPS) + len(_GAPS)
#: Columns of a baseline that creeps.
RAMPS = 1


def jump_columns(depth: FloatArray) -> FloatArray:
    """Z: forces that set in near contact, (n, 8), for depths w (m), (n,), negative before contact.

    Steps about contact, and exponentials of the gap that stay at their largest from contact on.
    """
    share = depth[:, None] / depth.max()
    steps = share > _STEPS
    grown = np.exp(np.minimum(share, 0.0) / _GAPS)
    return np.asarray(np.hstack((steps, grown)) / np.sqrt(JUMPS))


def ramp_column(force: FloatArray, time: FloatArray) -> FloatArray:
    """Return a baseline that creeps by the largest of the forces P (n,) over the times (s), (n,): (n, 1)."""
    passed = (time - time[0]) / (time[-1] - time[0])
    return np.asarray(float(np.abs(force).max()) * passed[:, None])


@dataclass(frozen=True)
class Part:
    """One curve of a model about the present fit.

    Parameters
    ----------
    residuals : FloatArray
        Model minus data over the scatter of the curve, (n,).
    jacobian : FloatArray
        Its derivatives in scaled coordinates and in the amplitudes of known errors, (n, k).
    drift, jump, ramp : FloatArray
        `drift_columns`, `jump_columns` and `ramp_column`, (n, 8), (n, 8), (n, 1), over the scatter.
    time : FloatArray
        Times of the readings (s), (n,), increasing; their numbers where there are none.
    """

    residuals: FloatArray
    jacobian: FloatArray
    drift: FloatArray
    jump: FloatArray
    ramp: FloatArray
    time: FloatArray

    @cached_property
    def columns(self) -> FloatArray:
        """All that is whitened, (n, k + 18): derivatives, drift, jump, ramp, residuals."""
        parts = (self.jacobian, self.drift, self.jump, self.ramp, self.residuals)
        return np.asfortranarray(np.column_stack(parts))


@dataclass(frozen=True)
class Linearised:
    """A model about the present fit: its curves, and the priors that are measurements.

    Parameters
    ----------
    parts : sequence of Part
        The curves. They share sizes and times of noise, drift, jump and ramp, each over its own scatter, and not
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

    @property
    def measured(self) -> int:
        """Number of coordinates and amplitudes with such a prior."""
        return int(np.count_nonzero(self.precision))

    def products(self, noises: Sequence[tuple[float, float] | None]) -> tuple[FloatArray, FloatArray]:
        """Products of all columns under V^-1, (g, m, m) with m = k + 17 curves + 1, and log det V, (g,).

        The columns are the derivatives, drift, jump and ramp of each curve, and the residuals. Noises of one
        correlation time share its work when they stand side by side.
        """
        k, own = len(self.precision), DRIFTS + JUMPS + RAMPS
        products = np.zeros((len(noises), *(k + own * len(self.parts) + 1,) * 2))
        log_determinants = np.zeros(len(noises))
        for number, part in enumerate(self.parts):
            places = np.r_[np.arange(k), k + own * number + np.arange(own), -1]
            for at, (product, log_determinant) in enumerate(_products(part, noises)):
                products[at][np.ix_(places, places)] += product
                log_determinants[at] += log_determinant
        # One on the diagonal, and nothing beside: the algebra keeps its shape, and the shift of these is zero.
        products[:, list(self.held), list(self.held)] += 1.0
        return products, log_determinants


def _products(part: Part, noises: Sequence[tuple[float, float] | None]) -> Sequence[tuple[FloatArray, float]]:
    """Products of one curve's columns and log det V, for every noise."""
    columns = part.columns
    found: list[tuple[FloatArray, float]] = []
    for tau, group in groupby(noises, key=lambda noise: None if noise is None else noise[0]):
        if tau is None:
            found += [(columns.T @ columns, 0.0) for _ in group]
            continue
        whitener = Whitener.of(part.time, tau)
        ahead = whitener.ahead(columns)
        for noise in group:
            solved, log_determinant = whitener.inverse(ahead, noise[1] if noise else 0.0)
            found.append((ahead.T @ solved, log_determinant))
    return found
