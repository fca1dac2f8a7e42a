"""The evidence of every combination of noise, drift, jump and ramp: the algebra of `competition.py`.

What is weighed is a grid whose members share most of their algebra. Under one noise the coordinates are solved for
once; the columns of the jump are turned to axes on which they are independent, so that each of its sizes costs a
product; what is left of the drift, the ramp and the residuals is a small matrix for each kind of drift.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from underlay._arrays import FloatArray
from underlay.inference.misfit.drift import DRIFTS
from underlay.inference.misfit.linearised import Linearised, acting_columns
from underlay.inference.misfit.sizes import Sizes

__all__ = ["Evidence", "Weighed"]


class Weighed(NamedTuple):
    """Log evidence (c,), shifts (c, k) and covariances (c, k, k) of the coordinates, and s^2 (c,)."""

    log_evidence: FloatArray
    shift: FloatArray
    covariance: FloatArray
    variance: FloatArray


@dataclass(frozen=True)
class Evidence:
    """The algebra of one linearised model under some noises.

    Parameters
    ----------
    model : Linearised
        The model.
    sizes : Sizes
        What is weighed.
    products : FloatArray
        Of the columns that have a size, as of `Linearised.products`, (g, m, m).
    log_determinants : FloatArray
        log det V, (g,).
    """

    model: Linearised
    sizes: Sizes
    products: FloatArray
    log_determinants: FloatArray

    @classmethod
    def of(cls, model: Linearised, sizes: Sizes, noises: list[tuple[float, float] | None]) -> Evidence:
        """Prepare some noises."""
        return cls(model, sizes, *model.products(noises, sizes.largest))

    @property
    def freedom(self) -> int:
        """n - k, and one for each prior that is a measurement."""
        return self.model.readings - len(self.model.precision) + self.model.measured

    def roughly(self, log_prior: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Log evidence and S of all combinations, (g, c), with s^2 of their noise: what is light is seen here."""
        noises, largest = len(self.products), self.sizes.largest
        start = self._bordered(slice(None), np.tile(largest, (noises, 1)), np.ones(noises))
        variance = np.linalg.cholesky(start)[:, -1, -1] ** 2 / self.freedom
        first = slice(-1 - len(self.model.precision), -1)
        bordered = self.model.with_priors(self.products, variance)
        reduced = _eliminated(bordered, first)
        log_kept = np.linalg.slogdet(bordered[:, first, first])[1]
        left, log_jump = self._without_jumps(reduced)
        found = [self._of_a_kind(left, kind, variance) for kind in self._kinds]
        square = np.stack([own for own, _ in found], axis=1).reshape(noises, -1)
        log_normal = np.stack([own + log_jump for _, own in found], axis=1).reshape(noises, -1)
        evidence = self._evidence(square, self.log_determinants[:, None], log_kept[:, None] + log_normal)
        return log_prior + evidence, square

    @cached_property
    def _kinds(self) -> list[FloatArray]:
        """Amounts of every kind of drift at its largest jump and ramp, (10 + 2,)."""
        return [np.array((*kind, *self.sizes.largest[DRIFTS:])) for kind in self.sizes.kinds]

    def _columns(self, amounts: FloatArray) -> NDArray[np.intp]:
        """Places of columns that have a size in `amounts` (10 + 2,) among those in the products."""
        every = acting_columns(self.sizes.largest, len(self.model.parts))
        return np.flatnonzero(np.isin(every, acting_columns(amounts, len(self.model.parts))))

    def _without_jumps(self, reduced: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Products (g, jumps, 1, m, m) with the jump solved for at each of its sizes, and log det of its N.

        The columns keep their places; those of the jump say nothing any more.
        """
        jump = self._columns(np.eye(DRIFTS + 2)[DRIFTS])
        curvature, axes = np.linalg.eigh(reduced[:, jump[:, None], jump])
        turned = np.swapaxes(axes, 1, 2) @ reduced[:, jump]
        square = np.square((0.0, *self.sizes.jumps))[:, None]
        grown = 1.0 + square * curvature[:, None]
        taken = np.swapaxes(turned, 1, 2)[:, None] @ ((square / grown)[..., None] * turned[:, None])
        left = reduced[:, None] - taken
        return left[:, :, None], np.log(grown).sum(axis=-1)[:, :, None]

    def _of_a_kind(
        self, left: FloatArray, kind: FloatArray, variance: FloatArray
    ) -> tuple[FloatArray, FloatArray]:
        """S and log det N, each (g, jumps, ramps), of one kind of drift."""
        ramps = np.array((0.0, *self.sizes.ramps))
        amounts = np.tile(np.where(np.arange(len(kind)) == DRIFTS, 0.0, kind), (len(ramps), 1))
        used = self._columns(amounts[-1])
        amounts[:, -1] = ramps
        own = acting_columns(amounts[-1], len(self.model.parts))
        scale = np.ones((len(variance), 1, len(ramps), len(used) + 1))
        scale[..., :-1] = self.sizes.scales(amounts, np.ones(len(ramps)), len(self.model.parts))[:, own]
        # Drift and ramp are shares of the force: over s they go with the noise.
        scale[..., :-1] /= np.sqrt(variance)[:, None, None, None]
        used = np.append(used, left.shape[-1] - 1)
        bordered = left[..., used[:, None], used] * (scale[..., :, None] * scale[..., None, :])
        inner = np.arange(len(used) - 1)
        bordered[..., inner, inner] += 1.0
        root = np.diagonal(np.linalg.cholesky(bordered), axis1=-2, axis2=-1)
        return root[..., -1] ** 2, 2.0 * np.log(root[..., :-1]).sum(axis=-1)

    def closely(
        self, noise: NDArray[np.intp], column: NDArray[np.intp], variance: FloatArray, log_prior: FloatArray
    ) -> Weighed:
        """What some combinations say, (c,), each with its own s^2."""
        k, count = len(self.model.precision), len(noise)
        found = Weighed(np.empty(count), np.empty((count, k)), np.empty((count, k, k)), np.empty(count))
        for rows, used in self._alike(column):
            amounts = self.sizes.amounts[column[rows]]
            root = np.linalg.cholesky(self._bordered(noise[rows], amounts, variance[rows], used))
            # The last pivot is r'r - c'N^-1 c without the cancellation.
            diagonal = np.diagonal(root, axis1=-2, axis2=-1)
            square = diagonal[:, -1] ** 2
            found.variance[rows] = square / self.freedom
            log_normal = 2.0 * np.log(diagonal[:, :-1]).sum(axis=-1)
            found.log_evidence[rows] = log_prior[rows] + self._evidence(
                square, self.log_determinants[noise[rows]], log_normal
            )
            # The coordinates are the last columns but one: their part of the factor is that of what is left.
            inverse = np.linalg.inv(root[:, -1 - k : -1, -1 - k : -1])
            found.shift[rows] = -(root[:, -1:, -1 - k : -1] @ inverse)[:, 0]
            own = found.variance[rows, None, None]
            found.covariance[rows] = own * (np.swapaxes(inverse, 1, 2) @ inverse)
        return found

    def misfits(self, noise: int, column: int, variance: float) -> FloatArray:
        """Best drift, jump and ramp of every curve under one combination, (19 curves,)."""
        amounts, s2, curves = self.sizes.amounts[[column]], np.array([variance]), len(self.model.parts)
        (bordered,) = self._bordered(np.array([noise]), amounts, s2)
        shift = -np.linalg.solve(bordered[:-1, :-1], bordered[:-1, -1])
        scale = self.sizes.scales(amounts, s2, curves)[0]
        acting = acting_columns(self.sizes.largest, curves)
        found = np.zeros(len(scale))
        found[acting] = shift[: len(acting)] * scale[acting]
        return found

    def _alike(self, column: NDArray[np.intp]) -> Iterator[tuple[NDArray[np.intp], NDArray[np.intp]]]:
        """Rows with one kind of drift, and the places of the columns that act there."""
        each = len(self.sizes.amounts) // len(self._kinds)
        known = np.arange(self.products.shape[-1])[-1 - len(self.model.precision) :]
        for number, kind in enumerate(self._kinds):
            rows = np.flatnonzero(column // each == number)
            if rows.size:
                yield rows, np.concatenate((self._columns(kind), known))

    def _evidence(
        self, square: FloatArray, log_determinant: FloatArray, log_normal: FloatArray
    ) -> FloatArray:
        variance, degrees = square / self.freedom, self.model.readings - len(self.model.precision)
        total = degrees * np.log(variance) + self.freedom + log_determinant + log_normal
        return np.asarray(-0.5 * total)

    def _bordered(
        self,
        noise: NDArray[np.intp] | slice,
        amounts: FloatArray,
        variance: FloatArray,
        used: NDArray[np.intp] | None = None,
    ) -> FloatArray:
        """N with c and r'r beside it, (c, m, m), for noises, amounts (c, 10 + 2) and s^2 (c,), of `used` columns."""
        acting = acting_columns(self.sizes.largest, len(self.model.parts))
        scale = self.sizes.scales(amounts, variance, len(self.model.parts))[:, acting]
        products = self.products[noise]
        if used is not None:
            products = products[:, used[:, None], used]
            scale = scale[:, used[: -1 - len(self.model.precision)]]
        return self.model.bordered(products, scale, variance)


def _eliminated(products: FloatArray, first: slice) -> FloatArray:
    """Products (g, m, m) with some of the columns solved for; these say nothing any more."""
    cross = products[:, first]
    return np.asarray(products - np.swapaxes(cross, 1, 2) @ np.linalg.solve(products[:, first, first], cross))
