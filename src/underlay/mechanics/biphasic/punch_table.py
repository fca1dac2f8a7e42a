"""Responses tabulated at Chebyshev points of one or more numbers: a fit's own table, or a shipped one.

The flat punch on isotropic draining layers, tabulated by a/h and nu: all else is exact scaling.

Chebyshev points in eps/(1 + eps), eps = a/h up to 4, and in nu up to 0.48, for each drainage, times 1e-4 to
100 a^2/c. The ends of a response are the elastic laws', never the table's. Error of g, measured at 200 random
points by `measured_error`: see `STATED_ERROR`.

To build it again: ``python -m underlay.mechanics.biphasic.punch_table FILE`` (two minutes).
"""

from __future__ import annotations

import sys
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cache, cached_property
from itertools import product
from pathlib import Path
from typing import Self

import numpy as np

from underlay._arrays import FloatArray, read_only
from underlay.errors import InputError
from underlay.mechanics.biphasic.material import Skeleton
from underlay.mechanics.biphasic.response import Response
from underlay.mechanics.biphasic.transfer import PunchTransfer, relaxation

__all__ = [
    "STATED_ERROR",
    "Axis",
    "IsotropicTable",
    "ResponseTable",
    "build",
    "measured_error",
    "shipped",
]


@dataclass(frozen=True)
class Axis:
    """Chebyshev points of the first kind in one number.

    Parameters
    ----------
    low, high : float
        Ends of the number.
    count : int
        Points.
    """

    low: float
    high: float
    count: int

    @cached_property
    def nodes(self) -> FloatArray:
        """Values of the number, (count,), increasing."""
        x = -np.cos(np.pi * (np.arange(self.count) + 0.5) / self.count)
        return np.asarray(0.5 * (self.low + self.high) + 0.5 * (self.high - self.low) * x)

    @cached_property
    def _inverse(self) -> FloatArray:
        return np.asarray(np.linalg.inv(self._polynomials(self.nodes)))

    def _polynomials(self, value: FloatArray) -> FloatArray:
        x = (2.0 * value - self.low - self.high) / (self.high - self.low)
        return np.asarray(np.polynomial.chebyshev.chebvander(x, self.count - 1), dtype=np.float64)

    def weights(self, value: float) -> FloatArray:
        """Weights of the nodes at a value, (count,).

        Raises
        ------
        InputError
            If it is outside.
        """
        if not self.low <= value <= self.high:
            raise InputError(f"the table is for {self.low:.6g} to {self.high:.6g}; got {value:.6g}")
        return np.asarray(self._polynomials(np.array([value]))[0] @ self._inverse)


@dataclass(frozen=True, eq=False)
class ResponseTable:
    """Normalised falls g(t) over numbers on which they depend smoothly.

    Parameters
    ----------
    axes : tuple of Axis
        One for each number.
    time : FloatArray
        Times, (n,), in a^2/c.
    fall : FloatArray
        g, (*counts, n).
    """

    axes: tuple[Axis, ...]
    time: FloatArray
    fall: FloatArray

    @classmethod
    def solved(cls, axes: Sequence[Axis], response: Callable[..., Response]) -> Self:
        """Solve for the response at every combination of nodes; all must have the same times."""
        found = [response(*map(float, values)) for values in product(*(axis.nodes for axis in axes))]
        counts = [axis.count for axis in axes]
        falls = np.stack([one.fall for one in found]).reshape(*counts, found[0].time.size)
        return cls(tuple(axes), found[0].time, falls)

    def at(self, values: Sequence[float]) -> FloatArray:
        """g, (n,), at one value for each axis.

        Raises
        ------
        InputError
            If one is outside.
        """
        found = self.fall
        for axis, value in zip(self.axes, values, strict=True):
            found = np.tensordot(axis.weights(value), found, axes=1)
        return found

    def covers(self, values: Sequence[float]) -> bool:
        """Whether all values are inside."""
        return all(axis.low <= value <= axis.high for axis, value in zip(self.axes, values, strict=True))


#: Largest error of g anywhere in the table.
STATED_ERROR = 1e-4

_SPAN = (1e-4, 100.0)
_AXES = (Axis(0.0, 0.8, 24), Axis(0.0, 0.48, 11))
_TABULATED = ("solid", "porous")
_FILE = Path(__file__).with_name("isotropic_punch.npz")


def _solved(shape: float, nu: float, drainage: str) -> Response:
    """Response of a/h = shape/(1 - shape)."""
    transfer = PunchTransfer(Skeleton.of_poisson_ratio(nu), shape / (1.0 - shape), drainage)
    return relaxation(transfer, _SPAN)


@dataclass(frozen=True)
class IsotropicTable:
    """Responses of a flat punch by a/h and nu, for one drainage."""

    drainage: str
    table: ResponseTable

    def covers(self, eps: float, nu: float) -> bool:
        """Whether a/h and nu are inside."""
        return self.table.covers((eps / (1.0 + eps), nu))

    def __call__(self, eps: float, nu: float) -> Response:
        """P/(4 theta_d a) after a unit step of depth, times in a^2/c.

        Raises
        ------
        InputError
            If a/h or nu is outside.
        """
        ends = PunchTransfer(Skeleton.of_poisson_ratio(nu), eps, self.drainage)
        fall = self.table.at((eps / (1.0 + eps), nu))
        return Response(ends.undrained, ends.drained, self.table.time, fall, endless=eps == 0.0)


def build(path: Path) -> None:
    """Solve for the table and write it."""
    tables = {
        drainage: ResponseTable.solved(_AXES, lambda shape, nu, by=drainage: _solved(shape, nu, by))
        for drainage in _TABULATED
    }
    falls = {drainage: table.fall for drainage, table in tables.items()}
    np.savez_compressed(path, time=tables["solid"].time, **falls)  # type: ignore[arg-type]  # stubs: allow_pickle


@cache
def shipped(drainage: str) -> IsotropicTable:
    """The table that travels with the library, for a tip that holds the water or lets it through."""
    with np.load(_FILE, allow_pickle=False) as stored:
        table = ResponseTable(_AXES, read_only(stored["time"]), read_only(stored[drainage]))
    return IsotropicTable(drainage, table)


def measured_error(table: IsotropicTable, count: int, seed: int) -> tuple[float, tuple[float, float]]:
    """Largest error of g at random a/h and nu, and where (eps/(1 + eps), nu) it is."""
    rng = np.random.default_rng(seed)
    worst, where = 0.0, (0.0, 0.0)
    for _ in range(count):
        shape, nu = (float(rng.uniform(axis.low, axis.high)) for axis in _AXES)
        exact = _solved(shape, nu, table.drainage)
        error = float(np.abs(table.table.at((shape, nu)) - exact.fall).max())
        if error > worst:
            worst, where = error, (shape, nu)
    return worst, where


if __name__ == "__main__":
    build(Path(sys.argv[1]))
