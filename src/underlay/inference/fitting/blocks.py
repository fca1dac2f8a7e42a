"""A curve with neighbouring points taken together: what a start is found with."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from underlay._arrays import FloatArray
from underlay.data.curve import Curve

__all__ = ["Blocks"]


@dataclass(frozen=True)
class Blocks:
    """A curve with neighbouring points taken together: depth (m), force (N), each (m,)."""

    depth: FloatArray
    force: FloatArray

    @classmethod
    def of(cls, curve: Curve, count: int, *, averages: bool = False) -> Blocks:
        """Take neighbouring depths together in `count` blocks: medians, so that no outlier decides, or averages."""
        order = np.argsort(curve.depth, kind="stable")
        count = min(count, len(order))
        size, longer = divmod(len(order), count)
        end = longer * (size + 1)
        middle = _means if averages else _medians

        def in_blocks(values: FloatArray) -> FloatArray:
            """The first blocks have the points left over."""
            first, others = values[:end].reshape(longer, size + 1), values[end:].reshape(-1, size)
            return np.concatenate((middle(first), middle(others)))

        return cls(in_blocks(curve.depth[order]), in_blocks(curve.force[order]))


def _means(rows: FloatArray) -> FloatArray:
    return np.asarray(rows.sum(axis=1) / rows.shape[1])


def _medians(rows: FloatArray) -> FloatArray:
    # numpy.median takes five times as long on so few numbers.
    ordered, middle = np.sort(rows, axis=1), rows.shape[1] // 2
    return ordered[:, middle] if rows.shape[1] % 2 else 0.5 * (ordered[:, middle - 1] + ordered[:, middle])
