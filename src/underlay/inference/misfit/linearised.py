"""A model about the present fit: derivatives, what drift, jump and ramp would add, residuals, measured priors."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from underlay._arrays import FloatArray
from underlay.inference.misfit.drift import DRIFTS, drift_columns
from underlay.inference.misfit.whitener import Whitener

__all__ = ["JUMPS", "RAMPS", "Linearised", "Part", "acting_columns", "jump_columns", "ramp_column"]

# Where the steps of a jump stand, as shares of the largest depth, before contact and a little into it; and the gaps
# over which a force that grows toward contact does so (drag, attraction: no step is felt that far out).
_STEPS, _GAPS = np.array([-0.06, -0.03, -0.01, 0.01, 0.04]), np.array([0.03, 0.1, 0.3])
#: Columns of a force that sets in near contact.
JUMPS = len(_STEPS) + len(_GAPS)
#: Columns of a baseline that creeps.
RAMPS = 1
_WIDTHS = np.array([1] * DRIFTS + [JUMPS, RAMPS])


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
    force : FloatArray
        Contact force over the scatter, (n,).
    depth : FloatArray
        Indentation depths (m), (n,), negative before contact.
    time : FloatArray
        Times of the readings (s), (n,), increasing; their numbers where there are none.
    """

    residuals: FloatArray
    jacobian: FloatArray
    force: FloatArray
    depth: FloatArray
    time: FloatArray

    @cached_property
    def drift(self) -> FloatArray:
        """`drift_columns` over the scatter, (n, 10)."""
        return drift_columns(self.force, self.depth, self.time)

    @cached_property
    def jump(self) -> FloatArray:
        """`jump_columns`, (n, 8)."""
        return jump_columns(self.depth)

    @cached_property
    def ramp(self) -> FloatArray:
        """`ramp_column` over the scatter, (n, 1)."""
        return ramp_column(self.force, self.time)

    def columns(self, amounts: FloatArray) -> FloatArray:
        """What is whitened, (n, m): drift, jump, ramp that have `amounts` (10 + 2,), derivatives, residuals."""
        drift, (jump, ramp) = np.split(amounts > 0.0, [DRIFTS])
        found = [drift_columns(self.force, self.depth, self.time, drift)]
        if jump:
            found.append(self.jump)
        if ramp:
            found.append(self.ramp)
        return np.asfortranarray(np.hstack((*found, self.jacobian, self.residuals[:, None])))


def acting_columns(amounts: FloatArray, curves: int) -> NDArray[np.intp]:
    """Which of the `amounts` (10 + 2,) is that of each column of drift, jump, ramp of all curves that has one."""
    acting = np.flatnonzero(amounts > 0.0)
    return np.tile(np.repeat(acting, _WIDTHS[acting]), curves)


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

    def products(
        self, noises: Sequence[tuple[float, float] | None], amounts: FloatArray
    ) -> tuple[FloatArray, FloatArray]:
        """Products of columns under V^-1, (g, m, m), and log det V, (g,).

        The columns are drift, jump and ramp of each curve, those alone that have a size in `amounts` (10 + 2,),
        then the derivatives and the residuals. Noises of one correlation time share its work when they stand side
        by side.
        """
        k, curves = len(self.precision), len(self.parts)
        acting = len(acting_columns(amounts, curves))
        own = acting // curves
        if curves == 1:
            products, log_determinants = _products(self.parts[0], noises, amounts)
        else:
            products = np.zeros((len(noises), *(acting + k + 1,) * 2))
            log_determinants = np.zeros(len(noises))
            for number, part in enumerate(self.parts):
                places = np.concatenate((own * number + np.arange(own), acting + np.arange(k + 1)))
                found, each = _products(part, noises, amounts)
                products[:, places[:, None], places] += found
                log_determinants += each
        # One on the diagonal, and nothing beside: the algebra keeps its shape, and the shift of these is zero.
        held = acting + np.array(self.held, dtype=np.intp)
        products[:, held, held] += 1.0
        return products, log_determinants

    def bordered(self, products: FloatArray, scale: FloatArray, variance: FloatArray) -> FloatArray:
        """N with c and r'r beside it, (c, m, m), for sizes (c, m - k - 1) of the misfits' columns and s^2 (c,).

        What is measured besides weighs s^2 against the readings.
        """
        every, s2 = np.ones(products.shape[:2]), variance[:, None]
        every[:, : scale.shape[1]] = scale
        found = products * every[:, :, None]
        found *= every[:, None, :]
        inner, known = np.arange(scale.shape[1]), np.arange(scale.shape[1], found.shape[-1] - 1)
        found[:, inner, inner] += 1.0
        if self.measured:
            found[:, known, known] += s2 * self.precision
            found[:, known, -1] += s2 * self.pull
            found[:, -1, known] += s2 * self.pull
            found[:, -1, -1] += variance * self.offset
        return found


def _products(
    part: Part, noises: Sequence[tuple[float, float] | None], amounts: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Products of one curve's columns (g, m, m) and log det V (g,), for every noise."""
    columns = part.columns(amounts)
    products, log_determinants = np.empty((len(noises), *(columns.shape[1],) * 2)), np.zeros(len(noises))
    tau, whitener, ahead = None, None, columns
    for at, noise in enumerate(noises):
        if noise is None:
            products[at] = columns.T @ columns
            continue
        if whitener is None or noise[0] != tau:
            tau, whitener = noise[0], Whitener.of(part.time, noise[0])
            ahead = whitener.ahead(columns)
        solved, log_determinants[at] = whitener.inverse(ahead, noise[1])
        np.matmul(ahead.T, solved, out=products[at])
    return products, log_determinants
