"""A model about the present fit: derivatives, what drift, jump and ramp would add, residuals, measured priors."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from underlay._arrays import FloatArray
from underlay.inference.misfit.drift import DRIFTS, FADING, drift_shares
from underlay.inference.misfit.shapes import Shapes, acting_columns, jump_columns, ramp_column
from underlay.inference.misfit.whitener import Whitener

__all__ = ["Linearised", "Part"]

_FIRST = np.arange(DRIFTS) < 2


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
    in_force : FloatArray
        Derivatives of the contact force in the same, over the scatter, (n, k): those of the readings, and zero
        where a coordinate does not move it.
    standing : Shapes or None
        What acts of drift, jump and ramp, jump and ramp over the scatter, where these do not move with the fit.
    """

    residuals: FloatArray
    jacobian: FloatArray
    force: FloatArray
    depth: FloatArray
    time: FloatArray
    in_force: FloatArray
    standing: Shapes | None = None

    @cached_property
    def shares(self) -> FloatArray:
        """`drift_shares`, (n, 10)."""
        return drift_shares(self.depth, self.time)

    @cached_property
    def drift(self) -> FloatArray:
        """Phi, the `shares` times the contact force, over the scatter, (n, 10)."""
        return np.asarray(self.force[:, None] * self.shares)

    @cached_property
    def grown(self) -> FloatArray:
        """P s and P w / (2 w_max), the first columns of `drift`, (n, 2)."""
        return np.asarray(self.force[:, None] * drift_shares(self.depth, self.time, _FIRST))

    @cached_property
    def jump(self) -> FloatArray:
        """`jump_columns`, (n, 8)."""
        return jump_columns(self.depth)

    @cached_property
    def ramp(self) -> FloatArray:
        """`ramp_column` over the scatter, (n, 1)."""
        return ramp_column(self.force, self.time)

    def shapes(self, amounts: FloatArray) -> Shapes:
        """What acts of drift, jump and ramp: what has `amounts` (10 + 2,)."""
        if self.standing is not None:
            return self.standing
        wanted = amounts[:DRIFTS] > 0.0
        # What relaxes costs most of them: where it is wanted the rest comes along, and all are asked again.
        shares = (
            self.shares[:, wanted] if wanted[FADING].any() else drift_shares(self.depth, self.time, wanted)
        )
        return Shapes.of(shares, amounts[DRIFTS:] > 0.0, self.jump, self.ramp)

    def columns(self, amounts: FloatArray, misfits: FloatArray | None = None) -> FloatArray:
        """What is whitened, (n, m): drift, jump, ramp that have `amounts` (10 + 2,), derivatives, residuals.

        With `misfits`, those of each of the former, the derivatives are of what these add as well: drifts follow
        the force.
        """
        drift, fixed = self.shapes(amounts)
        slopes = self.jacobian
        if misfits is not None:
            slopes = slopes + (drift @ misfits[: drift.shape[1]])[:, None] * self.in_force
        columns = (self.force[:, None] * drift, fixed, slopes, self.residuals[:, None])
        return np.asfortranarray(np.hstack(columns))


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
        self,
        noises: Sequence[tuple[float, float] | None],
        amounts: FloatArray,
        misfits: FloatArray | None = None,
    ) -> tuple[FloatArray, FloatArray]:
        """Products of columns under V^-1, (g, m, m), and log det V, (g,).

        The columns are drift, jump and ramp of each curve, those alone that have a size in `amounts` (10 + 2,),
        then the derivatives and the residuals. With `misfits`, those of the columns before the derivatives, these
        are of what the misfits add as well.
        """
        k, curves = len(self.precision), len(self.parts)
        acting = len(acting_columns(amounts, curves))
        own = acting // curves
        given = [None] * curves if misfits is None else np.split(misfits, curves)
        if curves == 1:
            products, log_determinants = _products(self.parts[0], noises, amounts, given[0])
        else:
            products = np.zeros((len(noises), *(acting + k + 1,) * 2))
            log_determinants = np.zeros(len(noises))
            for number, part in enumerate(self.parts):
                places = np.concatenate((own * number + np.arange(own), acting + np.arange(k + 1)))
                found, each = _products(part, noises, amounts, given[number])
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
    part: Part,
    noises: Sequence[tuple[float, float] | None],
    amounts: FloatArray,
    misfits: FloatArray | None,
) -> tuple[FloatArray, FloatArray]:
    """Products of one curve's columns (g, m, m) and log det V (g,), for every noise."""
    columns = part.columns(amounts, misfits)
    products, pivots = np.empty((len(noises), *(columns.shape[1],) * 2)), np.ones((len(noises), len(columns)))
    log_determinants = np.zeros(len(noises))
    shares: dict[float, list[tuple[int, float]]] = {}
    for at, noise in enumerate(noises):
        if noise is None:
            products[at] = columns.T @ columns
        else:
            shares.setdefault(noise[0], []).append((at, noise[1]))
    whiteners = Whitener.several(part.time, list(shares)) if shares else []
    for whitener, own in zip(whiteners, shares.values(), strict=True):
        ahead = whitener.ahead(columns)
        for at, share in own:
            solved, pivots[at] = whitener.inverse(ahead, share)
            log_determinants[at] = whitener.log_determinant
            np.matmul(ahead.T, solved, out=products[at])
    return products, log_determinants + np.log(pivots).sum(axis=1)
