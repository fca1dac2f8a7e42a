"""r' V^-1 r of many residuals under several noises at once.

With T = L D L' of `Whitener`, r' V^-1 r is the sum of the squares of e = D^(-1/2) L^-1 W r, and W and L are lower
bidiagonal: e_i = alpha_i r_i + beta_i r_(i-1) + gamma_i e_(i-1). In pieces of a few readings e is a small matrix
times the readings, and what the piece before hands on, so that a few products of matrices and a short recursion
stand in place of one step a reading.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Self

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view
from numpy.typing import NDArray

from underlay._arrays import FloatArray
from underlay.inference.misfit.whitener import Whitener

__all__ = ["WhitenedSquares"]

# Readings of a piece, and residuals taken at once: what is then in use fits a processor's second cache.
_PIECE, _AT_ONCE = 8, 64


@dataclass(frozen=True, eq=False)
class WhitenedSquares:
    """Squares under several noises of one curve.

    Parameters
    ----------
    readings : int
        Of the curve, n.
    products : FloatArray
        (pieces, noises x length, length + 1): e of a piece of its readings and the last before it, were nothing
        handed on.
    handed : FloatArray
        (pieces, noises, length): e of a piece of what the piece before hands on.
    """

    readings: int
    products: FloatArray
    handed: FloatArray

    @classmethod
    def of(cls, noises: Sequence[tuple[Whitener, float] | None], readings: int) -> Self:
        """Prepare noises (their whitener and share g; None: white) of a curve of n readings."""
        pieces = -(-readings // _PIECE)
        rows = [
            np.array([np.ones(readings), np.zeros(readings), np.zeros(readings)])
            if noise is None
            else noise[0].recursion(noise[1])
            for noise in noises
        ]
        # Zeros before the first reading: nothing comes of them, and nothing is handed on.
        padded = np.zeros((3, pieces * _PIECE, len(rows)))
        padded[:, -readings:] = np.moveaxis(np.array(rows), 0, -1)
        alpha, beta, gamma = padded.reshape(3, pieces, _PIECE, len(rows))
        products = np.zeros((pieces, len(rows), _PIECE, _PIECE + 1))
        handed = np.ones((pieces, len(rows), _PIECE))
        for i in range(_PIECE):
            products[:, :, i, i + 1] = alpha[:, i]
            products[:, :, i, i] += beta[:, i]
            if i:
                products[:, :, i] += gamma[:, i, :, None] * products[:, :, i - 1]
            handed[:, :, i] = gamma[:, i] * (handed[:, :, i - 1] if i else 1.0)
        return cls(readings, products.reshape(pieces, -1, _PIECE + 1), handed)

    def part(self, noises: NDArray[np.intp]) -> Self:
        """Those under some of the noises."""
        products = self.products.reshape(len(self.handed), -1, _PIECE, _PIECE + 1)[:, noises]
        return type(self)(
            self.readings, products.reshape(len(self.handed), -1, _PIECE + 1), self.handed[:, noises]
        )

    def __call__(self, residuals: FloatArray) -> FloatArray:
        """Squares (noises, sets) of residuals (n, sets)."""
        sets = residuals.shape[1]
        parts = [self._of(residuals[:, first : first + _AT_ONCE]) for first in range(0, sets, _AT_ONCE)]
        return np.concatenate(parts, axis=1)

    def _of(self, residuals: FloatArray) -> FloatArray:
        pieces, noises, _ = self.handed.shape
        sets = residuals.shape[1]
        padded = np.zeros((pieces * _PIECE + 1, sets))
        padded[-self.readings :] = residuals
        windows = sliding_window_view(padded, _PIECE + 1, axis=0)[::_PIECE].swapaxes(1, 2)
        e = (self.products @ windows).reshape(pieces, noises, _PIECE, sets)
        last = e[:, :, -1].copy()
        for piece in range(1, pieces):
            last[piece] += self.handed[piece, :, -1:] * last[piece - 1]
        e[1:] += self.handed[1:, :, :, None] * last[:-1, :, None]
        return np.asarray(np.einsum("pkls,pkls->ks", e, e))
