"""The drift, the jump and the creep that go with a vector, under one combination: what a law is off by there."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from underlay._arrays import FloatArray

__all__ = ["Misfits"]


@dataclass(frozen=True, eq=False)
class Misfits:
    """Columns that a law may be off by, and how large they are.

    Parameters
    ----------
    columns : sequence of FloatArray
        X of each curve, over its scatter, (n, m).
    sizes : FloatArray
        D of every combination, over the noise, (c, m).
    follows : NDArray
        Which columns are drifts, which follow the force, (m,).
    """

    columns: Sequence[FloatArray]
    sizes: FloatArray
    follows: NDArray[np.bool_]

    def best(
        self, along: FloatArray, chosen: NDArray[np.intp], force: FloatArray, products: FloatArray
    ) -> list[FloatArray]:
        """X u of each curve over its scatter, (sets, n), with u = -D (1 + D G D)^-1 D b the likeliest amplitudes.

        Parameters
        ----------
        along : FloatArray
            b = X'V0^-1 r, r model less data, (sets, m).
        chosen : NDArray
            Number of the combination, (sets,).
        force : FloatArray
            The law's force over that of the fit, (sets,).
        products : FloatArray
            G = X'V0^-1 X of every combination, (c, m, m).
        """
        sizes = self.sizes[chosen] * np.where(self.follows, force[:, None], 1.0)
        inner = np.eye(sizes.shape[1]) + sizes[:, :, None] * products[chosen] * sizes[:, None, :]
        amplitudes = -sizes * np.linalg.solve(inner, (sizes * along)[:, :, None])[:, :, 0]
        return [amplitudes @ own.T for own in self.columns]
