"""The flat punch on isotropic draining layers, tabulated by a/h and nu: all else is exact scaling.

Chebyshev points (`Axis`) in eps/(1 + eps), eps = a/h up to 4, and in nu up to 0.48, for each drainage, times
1e-4 to 100 a^2/c. The ends of a response are the elastic laws', in a table of their own. Error of the
normalised fall g, measured at 200 random points by `measured_error`: see `STATED_ERROR`. `ResponseTable` also
serves a fit that makes a table of its own.

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
from numpy.typing import NDArray

from underlay._arrays import FloatArray, read_only
from underlay.errors import InputError
from underlay.mechanics.biphasic.elastic_ends import punch_factor
from underlay.mechanics.biphasic.material import Skeleton
from underlay.mechanics.biphasic.response import Response, table_times
from underlay.mechanics.biphasic.transfer import PunchTransfer, relaxation
from underlay.mechanics.body import PlaneConstants

#: Largest error of g anywhere in the table, and of the ends, relative.
STATED_ERROR, STATED_ERROR_OF_ENDS = 1e-4, 1e-9
_SPAN = (1e-4, 100.0)
_TABULATED = ("solid", "porous")


@dataclass(frozen=True)
class Axis:
    """One axis of a table: Chebyshev points of the first kind, for polynomial interpolation in one variable.

    Parameters
    ----------
    low, high : float
        Ends of the interval.
    count : int
        Number of points.
    """

    low: float
    high: float
    count: int

    @cached_property
    def nodes(self) -> FloatArray:
        """Values of the variable at the points, (count,), increasing."""
        x = -np.cos(np.pi * (np.arange(self.count) + 0.5) / self.count)
        return np.asarray(0.5 * (self.low + self.high) + 0.5 * (self.high - self.low) * x)

    @cached_property
    def _inverse(self) -> FloatArray:
        return np.asarray(np.linalg.inv(self._polynomials(self.nodes)))

    def _polynomials(self, value: FloatArray) -> FloatArray:
        x = (2.0 * value - self.low - self.high) / (self.high - self.low)
        return np.asarray(np.polynomial.chebyshev.chebvander(x, self.count - 1), dtype=np.float64)

    def covers(self, value: float | FloatArray) -> NDArray[np.bool_]:
        """Whether values lie inside the interval, in the shape of `value`."""
        return np.asarray((self.low <= value) & (value <= self.high))

    def weights(self, value: FloatArray) -> FloatArray:
        """Interpolation weights of the nodes at values (...,): (..., count).

        Raises
        ------
        InputError
            If one is outside.
        """
        outside = value[~self.covers(value)]
        if outside.size:
            raise InputError(f"the table is for {self.low:.6g} to {self.high:.6g}; got {outside[0]:.6g}")
        return np.asarray(self._polynomials(value) @ self._inverse)


@dataclass(frozen=True, eq=False)
class ResponseTable:
    """Table of arrays (here the normalised fall g(t) of a response) over parameters, read by interpolation.

    Parameters
    ----------
    axes : tuple of Axis
        One for each parameter.
    fall : FloatArray
        g at n times, (*counts, n), counts the numbers of nodes; or any other values, (*counts, ...).
    """

    axes: tuple[Axis, ...]
    fall: FloatArray

    @classmethod
    def solved(cls, axes: Sequence[Axis], fall: Callable[..., FloatArray | float]) -> Self:
        """Make the table by calling `fall` with the parameters at every combination of nodes."""
        found = np.array([fall(*map(float, values)) for values in product(*(axis.nodes for axis in axes))])
        return cls(tuple(axes), found.reshape(*(axis.count for axis in axes), *found.shape[1:]))

    def at(self, values: Sequence[float | FloatArray]) -> FloatArray:
        """Interpolate the table at one value for each axis: (n,); or at many, (sets,) each: (sets, n).

        Raises
        ------
        InputError
            If a value is outside its axis.
        """
        sets = np.broadcast_shapes(*(np.shape(value) for value in values))
        found = self.fall
        for axis, value in zip(self.axes, np.broadcast_arrays(*values), strict=True):
            known = found.reshape(*(sets if found is not self.fall else ()), axis.count, -1)
            # Not by a product of matrices: its last bit depends on how many sets there are.
            found = np.einsum("...a,...an->...n", axis.weights(value), known)
        return found.reshape(sets + self.fall.shape[len(self.axes) :])

    def covers(self, values: Sequence[float | FloatArray]) -> NDArray[np.bool_]:
        """Whether all parameters lie inside the table, (sets,)."""
        inside = [axis.covers(value) for axis, value in zip(self.axes, values, strict=True)]
        return np.asarray(np.logical_and.reduce(np.broadcast_arrays(*inside)))


_AXES = (Axis(0.0, 0.8, 24), Axis(0.0, 0.48, 11))
# Of the ends: a/h as above, A44/A33 from incompressible to nu = 0. What is left is 1e-10, at the widest contact.
_AXES_OF_ENDS = (Axis(0.0, 0.8, 36), Axis(0.0, 0.5, 16))
_FILE = Path(__file__).with_name("isotropic_punch.npz")


def _solved(shape: float, nu: float, drainage: str) -> Response:
    """Response of an isotropic layer under a flat punch, solved for; `shape` is eps/(1 + eps), eps = a/h."""
    transfer = PunchTransfer(Skeleton.of_poisson_ratio(nu), shape / (1.0 - shape), drainage)
    return relaxation(transfer, _SPAN)


def _compliance(shape: float, softness: float) -> float:
    """Dimensionless compliance 4 A44 a w/P of a flat punch on an isotropic elastic layer.

    P force, w depth, a radius; `shape` is eps/(1 + eps), eps = a/h; `softness` is A44/A33, shear over aggregate
    modulus. It is smooth in both, which the force is not, and so is what the table holds.
    """
    constants = PlaneConstants(1.0 - 2.0 * softness, softness, 4.0 * (1.0 - softness), 1.0)
    return 1.0 / (punch_factor(constants, shape / (1.0 - shape)) * float(constants.theta))


@dataclass(frozen=True)
class IsotropicTable:
    """Table of step responses of a flat punch on isotropic layers, by a/h and Poisson's ratio, for one drainage.

    Parameters
    ----------
    drainage : str
        How water leaves at the tip, one of `DRAINAGES`.
    time : FloatArray
        Times, (n,), in a^2/c, a the radius and c the diffusivity.
    table : ResponseTable
        Normalised falls g, by eps/(1 + eps), eps = a/h, and nu.
    compliances : ResponseTable
        Compliances 4 A44 a w/P of elastic layers, by eps/(1 + eps) and A44/A33.
    """

    drainage: str
    time: FloatArray
    table: ResponseTable
    compliances: ResponseTable

    def covers(self, eps: float | FloatArray, nu: float | FloatArray) -> NDArray[np.bool_]:
        """Whether a/h (`eps`) and Poisson's ratio `nu` are inside the table, for each set."""
        return self.table.covers((eps / (1.0 + eps), nu))

    def ends(self, eps: float | FloatArray, nu: float | FloatArray) -> tuple[FloatArray, FloatArray]:
        """Normalised stiffness P/(4 theta_d a w), undrained (just after a step) and drained, for each set.

        P force, w depth, a radius, theta_d half the drained indentation modulus; `eps` = a/h, h the thickness.
        """
        shape, softness = eps / (1.0 + eps), (0.5 - nu) / (1.0 - nu)
        start, end = ((1.0 - nu) / self.compliances.at((shape, share * softness)) for share in (0.0, 1.0))
        return start, end

    def __call__(self, eps: float | FloatArray, nu: float | FloatArray) -> Response:
        """Response of the force to a unit step of depth, P/(4 theta_d a), times in a^2/c; of one set or many.

        P force, a radius, theta_d half the drained indentation modulus, c diffusivity; `eps` = a/h, h thickness.

        Raises
        ------
        InputError
            If a/h (`eps`) or `nu` is outside the table.
        """
        fall = self.table.at((eps / (1.0 + eps), nu))
        start, end = self.ends(eps, nu)
        endless = not np.any(eps)
        if fall.ndim == 1:
            return Response(float(start), float(end), self.time, fall, endless)
        return Response(start[:, None], end[:, None], self.time, fall, endless)


def build(path: Path) -> None:
    """Solve for the tables of all drainages and write them to an .npz file at `path`."""
    tables = {
        drainage: ResponseTable.solved(_AXES, lambda shape, nu, by=drainage: _solved(shape, nu, by).fall)
        for drainage in _TABULATED
    }
    falls = {drainage: table.fall for drainage, table in tables.items()}
    ends = ResponseTable.solved(_AXES_OF_ENDS, _compliance).fall
    np.savez_compressed(path, time=table_times(_SPAN), ends=ends, **falls)  # type: ignore[arg-type]  # stubs: allow_pickle


@cache
def shipped(drainage: str) -> IsotropicTable:
    """Load the table shipped with the package for a `drainage` of "solid" (impervious tip) or "porous"."""
    with np.load(_FILE, allow_pickle=False) as stored:
        time, fall, ends = (read_only(stored[name]) for name in ("time", drainage, "ends"))
    return IsotropicTable(drainage, time, ResponseTable(_AXES, fall), ResponseTable(_AXES_OF_ENDS, ends))


def measured_error(table: IsotropicTable, count: int, seed: int) -> tuple[float, tuple[float, float]]:
    """Largest error of the table's normalised fall at `count` random points, and the point (eps/(1 + eps), nu)."""
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
