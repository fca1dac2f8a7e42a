"""Models of curves and their derivatives as searches need them, the noise that weighs them, robust losses.

Models are computed at one parameter vector, and kept, or at several together. The noise is frozen while a search
runs (`FrozenNoise`). Robust losses are those of `scipy.optimize.least_squares`, functions of the square z = r^2 of
a whitened residual r: what a minimiser lowers in place of the sum of squares, and its effect on standard errors.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from underlay._arrays import FloatArray
from underlay.errors import InputError
from underlay.inference.model.forward_batch import batched_jacobians, can_batch_jacobians
from underlay.inference.model.members import Member
from underlay.inference.problem import Problem
from underlay.mechanics.response import WholeHistory
from underlay.scene.noise import NoiseModel


@dataclass(frozen=True)
class FrozenNoise:
    """Noise of every curve, fixed during a search: its model and standard deviations (N), one array (n,) each."""

    models: tuple[NoiseModel, ...]
    sigmas: tuple[FloatArray, ...]


def freeze(problem: Problem, vector: FloatArray, noises: Sequence[NoiseModel]) -> FrozenNoise:
    """Fix the noise of every curve at the standard deviations that it has at a scaled vector (k,)."""
    sigmas = tuple(
        member.sigma(member.reading(problem.physical(vector)) if noise.follows_force else None, noise)
        for member, noise in zip(problem.members, noises, strict=True)
    )
    return FrozenNoise(tuple(noises), sigmas)


class Loss(NamedTuple):
    """One robust loss; its three parts are functions of z (n,), the squares of whitened residuals r.

    Parameters
    ----------
    rho : callable
        rho(z), whose sum is minimised.
    weight : callable
        rho'(z), the weight of a residual.
    slope : callable
        d(r rho'(r^2))/dr.
    """

    rho: Callable[[FloatArray], FloatArray]
    weight: Callable[[FloatArray], FloatArray]
    slope: Callable[[FloatArray], FloatArray]


#: The loss of least squares.
SQUARES = Loss(lambda z: z, np.ones_like, np.ones_like)


#: Robust losses by the name that `scipy.optimize.least_squares` gives them.
LOSSES = {
    "soft_l1": Loss(
        lambda z: 2.0 * (np.sqrt(1.0 + z) - 1.0), lambda z: (1.0 + z) ** -0.5, lambda z: (1.0 + z) ** -1.5
    ),
    "huber": Loss(
        lambda z: np.where(z <= 1.0, z, 2.0 * np.sqrt(z) - 1.0),
        lambda z: 1.0 / np.sqrt(np.maximum(z, 1.0)),
        lambda z: np.where(z <= 1.0, 1.0, 0.0),
    ),
    "cauchy": Loss(np.log1p, lambda z: 1.0 / (1.0 + z), lambda z: (1.0 - z) / (1.0 + z) ** 2),
    "arctan": Loss(
        np.arctan, lambda z: 1.0 / (1.0 + z * z), lambda z: (1.0 - 3.0 * z * z) / (1.0 + z * z) ** 2
    ),
}


def robust_inflation(residuals: FloatArray, loss: str | None) -> float:
    """Factor on the covariance of an M-estimator, E[psi^2] / E[psi']^2 over its residuals.

    Huber (1981), Robust Statistics, eq. 7.6.8 (doi:10.1002/0471725250), with psi(r) = r rho'(r^2); one for least
    squares.
    """
    if loss is None:
        return 1.0
    z, known = residuals * residuals, LOSSES[loss]
    return float(np.mean(z * known.weight(z) ** 2) / np.mean(known.slope(z)) ** 2)


def with_values(
    problem: Problem, member: Member, values: Mapping[str, float], vector: FloatArray
) -> FloatArray:
    """Scaled vector (k,) with the parameters of one curve set to `values` (SI, by path), within their bounds."""
    found = np.array(vector)
    for path, entry in member.entries.items():
        if path in values:
            coordinate = problem.coordinates[entry]
            found[entry] = coordinate.scaled(min(max(values[path], coordinate.low), coordinate.high))
    return found


def misfit_of(problem: Problem, vector: FloatArray) -> float:
    """Sum of squared residuals over the squared scatter of every curve; inf where there is no law."""
    physical = problem.physical(vector)
    try:
        return sum(
            float(np.square(member.model(physical) - member.force).sum()) / member.scatter**2
            for member in problem.members
        )
    except InputError:
        return np.inf


class Models:
    """Forces of the curves and their derivatives at parameters in SI, (k,) or (s, k); `count` counts evaluations.

    MINPACK asks for its first point twice and lmfit for its last; the noise may change in between. So the last
    results are kept, without weights. And nearly every point whose force is needed then needs its derivatives,
    which bring the force along: where they cost no further law they are computed at once.

    Parameters
    ----------
    members : sequence of Member
        The curves.
    """

    def __init__(self, members: Sequence[Member]) -> None:
        self.members, self.count = members, 0
        self._last_models: tuple[bytes, list[FloatArray]] = (b"", [])
        self._last_columns: dict[bool, tuple[bytes, list[FloatArray]]] = {}
        self._followed = b"", b""
        # Where no free parameter moves a ratio, or tables give the derivative in it, no further law is needed.
        self._one_law = not any(isinstance(member.forward.history, WholeHistory) for member in members)
        self._one_law &= not any(
            member.forward.similarity.ratio_slopes(path, member.base)
            for member in members
            if not member.forward.laws.know_slopes
            for path in member.entries
        )

    @cached_property
    def in_batches(self) -> bool:
        """Whether computing several parameter vectors together is less work than one by one."""
        return self._one_law and all(
            not member.forward.laws.is_solved
            and can_batch_jacobians(member.forward, member.base, tuple(member.entries))
            for member in self.members
        )

    def models(self, physical: FloatArray) -> list[FloatArray]:
        """Force readings (N), (n,), that the models of all curves predict at parameters (k,), SI.

        Raises InputError where no contact law exists.
        """
        key = physical.tobytes()
        if self._last_models[0] != key:
            if self._one_law:
                self.columns(physical, rough=True)
            else:
                self.count += 1
                self._last_models = key, [member.model(physical) for member in self.members]
        return self._last_models[1]

    def columns(self, physical: FloatArray, *, rough: bool) -> list[FloatArray]:
        """Derivatives of every curve's force in the parameters it depends on (SI), (n, own).

        `rough` allows less exact ones, as in `Forward.jacobian`. Raises InputError where no law exists.
        """
        key = physical.tobytes()
        for is_rough in (False, True) if rough else (False,):
            last, columns = self._last_columns.get(is_rough, (b"", []))
            if last == key:
                return columns
        both = [
            member.forward.jacobian(member.values_at(physical), tuple(member.entries), rough=rough)
            for member in self.members
        ]
        columns = [own for _, own in both]
        # Without tables a derivative is a difference of laws. Less exact ones are kept for callers that accept
        # them.
        self._last_columns[any(reading.is_rough for reading, _ in both)] = key, columns
        if self._last_models[0] != key:
            self.count += 1
            self._last_models = key, [reading.force for reading, _ in both]
        return columns

    def follow(self, physical: FloatArray, near: Callable[[FloatArray, list[FloatArray]], bool]) -> bool:
        """Extrapolate the models linearly from the last vector to another, (k,), if that is accurate enough.

        Returns whether it was; the extrapolated models are then kept as those of that vector. `near` takes the step
        (k,) and the derivatives, (n, own) each, in SI, and returns whether the step is small enough.
        """
        key, columns = self._last_columns.get(False, (b"", []))
        if not key or key in (self._followed[0], physical.tobytes()) or key != self._last_models[0]:
            return False
        step = physical - np.frombuffer(key)
        if not near(step, columns):
            return False
        changes = [
            own @ step[list(member.entries.values())]
            for own, member in zip(columns, self.members, strict=True)
        ]
        there = physical.tobytes()
        models = [model + change for model, change in zip(self._last_models[1], changes, strict=True)]
        self._last_models, self._last_columns[False] = (there, models), (there, columns)
        self._followed = there, key
        return True

    def asked_for(self, physical: FloatArray) -> FloatArray:
        """Parameters (k,) at which the laws behind the models of a vector (k,) were built.

        The vector itself, or the one that its models were extrapolated from (`follow`).
        """
        there, key = self._followed
        return np.frombuffer(key) if physical.tobytes() == there else physical

    def several(
        self, physical: FloatArray, possible: NDArray[np.bool_]
    ) -> tuple[list[FloatArray], list[FloatArray]]:
        """Derivatives in the parameters of each curve, (s, own, n), and its forces, (s, n), at vectors (s, k), SI.

        Rows without a law are zero, and set to False in `possible` (s,).
        """
        if len(physical) == 1 and possible[0]:
            try:
                own = self.columns(physical[0], rough=True)
                return [part.T[None] for part in own], [part[None] for part in self.models(physical[0])]
            except InputError:
                possible[0] = False
        batch = self._batch(physical) if len(physical) > 1 and self.in_batches else None
        if batch is not None:
            columns, models, known = batch
            missing = possible & ~known
            self.count += int(np.count_nonzero(possible & known))
        else:
            shapes = [(len(physical), len(one.entries), len(one.force)) for one in self.members]
            columns, models = (
                [np.zeros(shape) for shape in shapes],
                [np.zeros(shape[::2]) for shape in shapes],
            )
            missing = possible.copy()
        for row in np.flatnonzero(missing).tolist():
            own, forces = self.several(physical[row : row + 1], possible[row : row + 1])
            for into, each in zip((*columns, *models), (*own, *forces), strict=True):
                into[row] = each[0]
        return columns, models

    def _batch(
        self, physical: FloatArray
    ) -> tuple[list[FloatArray], list[FloatArray], NDArray[np.bool_]] | None:
        """Derivatives and forces of all rows at once, and which rows (s,) have a law.

        None where some curve cannot be computed at several vectors together.
        """
        known = []
        for member in self.members:
            values = member.values_of(physical)
            found = batched_jacobians(member.forward, values, len(physical), tuple(member.entries))
            if found is None:
                return None
            known.append(found)
        possible = np.all([each.possible for each in known], axis=0)
        return [each.columns for each in known], [each.force for each in known], np.asarray(possible)
