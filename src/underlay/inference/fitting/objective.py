"""Weighted residuals of a problem with their analytic Jacobian: what a minimiser asks.

The weights are frozen: the noise is that of a current model, and a fit renews it from outside until nothing
changes. (Weights that follow the parameters without the normalisation of the likelihood would pull the
model towards large noise.)
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field

import numpy as np

from underlay._arrays import FloatArray
from underlay.data.noise import NoiseModel
from underlay.errors import InputError
from underlay.inference.model.members import Member
from underlay.inference.problem import Problem

__all__ = ["Minimum", "Objective", "Weights", "weights_at"]

# Scaled coordinates beyond this (a factor of 1e17 from the scene) are refused before a law is asked for.
_FAR = 40.0


@dataclass(frozen=True)
class Minimum:
    """Where a minimiser stopped: scaled vector (k,), whether it met its tolerance, and what it says."""

    vector: FloatArray
    success: bool
    message: str


@dataclass(frozen=True)
class Weights:
    """Noise of every curve, frozen: model and standard deviations (N), one array (n,) each."""

    noises: tuple[NoiseModel, ...]
    sigmas: tuple[FloatArray, ...]


def weights_at(problem: Problem, vector: FloatArray, noises: Sequence[NoiseModel]) -> Weights:
    """Freeze the noise at the model of a scaled vector (k,)."""
    physical = problem.physical(vector)
    sigmas = tuple(
        member.sigma(member.reading(physical) if noise.follows_force else None, noise)
        for member, noise in zip(problem.members, noises, strict=True)
    )
    return Weights(tuple(noises), sigmas)


@dataclass
class Objective:
    """Residuals and Jacobian at full scaled vectors, for frozen weights; counts what it is asked.

    Prior measurements (`Prior.penalty`) follow the points as further residuals, one per informative prior.

    Parameters
    ----------
    problem : Problem
        What is fitted.
    weights : Weights
        Frozen noise.
    evaluations, failures : int
        Models asked, and how many did not exist.
    held : frozenset of int
        Entries of a vector that a minimiser leaves alone.
    """

    problem: Problem
    weights: Weights
    evaluations: int = 0
    failures: int = 0
    held: frozenset[int] = frozenset()
    _largest: float = field(default=1.0, repr=False)
    _last_models: tuple[bytes, list[FloatArray]] = field(default=(b"", []), repr=False)
    _last_columns: dict[bool, tuple[bytes, list[FloatArray]]] = field(default_factory=dict, repr=False)

    def __post_init__(self) -> None:
        noisy = self.problem.noise_entries
        coordinates = self.problem.coordinates
        #: Entries of a vector that a minimiser varies: not the noise's, and not those held.
        self.active = [i for i in range(len(coordinates)) if i not in noisy and i not in self.held]
        self._informative = [i for i, c in enumerate(coordinates) if c.prior.informative and i not in noisy]
        # Where no free parameter moves a ratio, or tables give the derivative in it, no further law is needed.
        self._one_law = not any(
            member.forward.similarity.ratio_slopes(path)
            for member in self.problem.members
            if not member.forward.laws.tabulated
            for path in member.entries
        )

    @property
    def has_measured_priors(self) -> bool:
        """Whether a prior pulls, so that the size of the noise moves the optimum."""
        return bool(self._informative)

    def residuals(self, vector: FloatArray) -> FloatArray:
        """Whitened (model - data) / sigma of all points, then the priors' residuals.

        Where no law exists every residual is the root of the largest sum of squares seen: a minimiser
        steps back.
        """
        if np.abs(vector).max(initial=0.0) > _FAR:
            return self._refused()
        physical = self.problem.physical(vector)
        try:
            models = self._models(physical)
        except InputError:
            return self._refused()
        parts = [
            noise.whiten((model - member.force) / sigma, member.curve.time)
            for model, (member, noise, sigma) in zip(models, self._members(), strict=True)
        ]
        if self._informative:
            parts.append(self._penalties(physical)[0])
        residuals = np.concatenate(parts) if len(parts) > 1 else parts[0]
        # The sum of squares is finite only if every entry is.
        square = float(residuals @ residuals)
        if not np.isfinite(square):
            return self._refused()
        self._largest = max(self._largest, square**0.5)
        return residuals

    def _refused(self) -> FloatArray:
        self.failures += 1
        return np.full(self.problem.n_points + len(self._informative), self._largest)

    def jacobian(self, vector: FloatArray, *, rough: bool = False) -> FloatArray:
        """d residuals / d vector, (n + priors, k); `rough` as in `Forward.jacobian`."""
        physical = self.problem.physical(vector)
        slopes = self.problem.space.slopes(physical)
        parts = []
        for columns, (member, noise, sigma) in zip(
            self._columns(physical, rough=rough), self._members(), strict=True
        ):
            rows = noise.whiten(columns.T * (slopes[:, None] / sigma), member.curve.time)
            parts.append(rows.T)
        if self._informative:
            parts.append(self._penalties(physical)[1] * slopes)
        return np.concatenate(parts) if len(parts) > 1 else parts[0]

    def exists(self, vector: FloatArray) -> bool:
        """Whether there is a contact law at a vector (k,), and beside it for its derivatives."""
        try:
            self.jacobian(vector, rough=True)
        except InputError:
            return False
        return True

    def loss(self, vector: FloatArray) -> float:
        """Minus twice the log-likelihood with the frozen noise, priors' residuals included, at (k,)."""
        residuals = self.residuals(vector)
        normalisation = sum(
            float(noise.log_normalisation(sigma, member.curve.time))
            for member, noise, sigma in self._members()
        )
        return float(residuals @ residuals) - 2.0 * normalisation

    def models(self, vector: FloatArray) -> list[FloatArray]:
        """Instrument's force (N) of every curve at a vector (k,); raises InputError where no law exists."""
        return self._models(self.problem.physical(vector))

    # MINPACK asks for its first point twice and lmfit for its last; the weights may change in between. So the
    # last answers are kept without weights. And nearly every point whose force is asked is then asked for its
    # derivatives, which bring the force along: where they cost no law they are computed at once.

    def _models(self, physical: FloatArray) -> list[FloatArray]:
        key = physical.tobytes()
        if self._last_models[0] != key:
            if self._one_law:
                self._columns(physical, rough=False)
            else:
                self.evaluations += 1
                self._last_models = key, [member.model(physical) for member in self.problem.members]
        return self._last_models[1]

    def _columns(self, physical: FloatArray, *, rough: bool) -> list[FloatArray]:
        key, wanted = physical.tobytes(), rough and not self._one_law
        last, columns = self._last_columns.get(wanted, (b"", []))
        if last != key:
            both = [member.jacobian(physical, rough=wanted) for member in self.problem.members]
            columns = [own for _, own in both]
            self._last_columns[wanted] = key, columns
            if self._last_models[0] != key:
                self.evaluations += 1
                self._last_models = key, [reading.force for reading, _ in both]
        return columns

    def _members(self) -> Iterator[tuple[Member, NoiseModel, FloatArray]]:
        return zip(self.problem.members, self.weights.noises, self.weights.sigmas, strict=True)

    def _penalties(self, physical: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Residuals of the informative priors (p,) and their slopes in SI (p, k)."""
        rows = self._informative
        values, slopes = np.zeros(len(rows)), np.zeros((len(rows), len(physical)))
        for row, index in enumerate(rows):
            values[row], slopes[row, index] = self.problem.coordinates[index].prior.penalty(physical[index])
        return values, slopes
