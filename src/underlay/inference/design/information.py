"""Fisher information of a test in scaled coordinates: what the points say, before or after they are measured.

For Gaussian noise F = J' V^-1 J, with J the derivatives of the force. The information that the noise's own
size carries when it follows the force is of second order in that size and is left out, so the bounds are
a little too wide rather than too narrow.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence

import numpy as np

from underlay._arrays import ArrayLike, FloatArray, as_finite
from underlay._given import require_given
from underlay.data.curve import Curve
from underlay.data.synthetic import simulate
from underlay.errors import InputError
from underlay.inference.least_squares.frozen_noise import freeze
from underlay.inference.least_squares.objective import Objective
from underlay.inference.problem import Given, Problem
from underlay.mechanics.solvers import AnySolver
from underlay.scene.noise_model import NoiseModel
from underlay.scene.scene import Scene

__all__ = [
    "LOST",
    "SPECIMEN",
    "about_specimen",
    "deviation_of",
    "expected_problem",
    "information",
    "marginal",
    "prior_information",
]

#: What the parameters of a specimen begin with; the others are those of one test.
SPECIMEN = ("layer.", "substrate.")

#: Relative to the largest: eigenvalues of an information matrix below this are rounding and the error of the finite
#: differences in it.
LOST = 1e-13


def expected_problem(
    scene: Scene,
    depth: ArrayLike,
    free: Mapping[str, Given] | Iterable[str],
    noise: NoiseModel,
    *,
    duration: float = 1.0,
    time: ArrayLike | None = None,
    solver: AnySolver = "auto",
) -> Problem:
    """Return the problem a test would be, before it is done.

    Parameters
    ----------
    scene : Scene
        The test, with the values it is expected to find.
    depth : array_like (n,)
        Depth readings (m).
    free, solver
        As in `Problem`.
    noise : Noise
        The noise it will have; its size must be given.
    duration : float
        Time the test takes (s), for correlated noise.
    time : array_like (n,), optional
        Times of the readings (s) instead, for a sample that remembers.

    Raises
    ------
    InputError
        If the size of the noise is unknown, or as `Problem`.
    """
    require_given(noise, "noise", NoiseModel)
    if noise.size_is_unknown:
        raise InputError("before a test the noise must be given: Noise(force=...) in newtons")
    readings = as_finite(depth, "depth")
    if readings.ndim != 1:
        raise InputError(f"depth must be a list of numbers, (n,); got shape {readings.shape}")
    clock = np.linspace(0.0, duration, len(readings)) if time is None else time
    curve: Curve = simulate(scene, readings, time=clock, solver=solver)
    return Problem(scene, curve, free, noise, solver=solver)


def information(problem: Problem, vector: FloatArray, noises: Sequence[NoiseModel]) -> FloatArray:
    """Fisher information (k, k) of the points alone at a scaled vector (k,); zero rows for the noise's."""
    objective = Objective(problem, freeze(problem, vector, noises))
    rows = objective.jacobian(vector)[: problem.n_points]
    return rows.T @ rows


def prior_information(problem: Problem, vector: FloatArray) -> FloatArray:
    """Information (k, k) of the priors that are measurements, in scaled coordinates."""
    physical, slopes = problem.physical(vector), problem.slopes(vector)
    diagonal = [
        (coordinate.prior.penalty(float(x))[1] * slope) ** 2
        for coordinate, x, slope in zip(problem.coordinates, physical, slopes, strict=True)
    ]
    return np.diag(np.array(diagonal))


def marginal(matrix: FloatArray, kept: Sequence[int], others: Sequence[int]) -> FloatArray:
    """Information (m, m) about `kept` when `others` are unknown too: the Schur complement."""
    kept, others = list(kept), list(others)
    own = matrix[np.ix_(kept, kept)]
    if not others:
        return own
    cross = matrix[np.ix_(kept, others)]
    inner = matrix[np.ix_(others, others)]
    scale = np.sqrt(np.where(np.diag(inner) > 0.0, np.diag(inner), 1.0))
    inverse = np.linalg.pinv(inner / np.outer(scale, scale), rcond=LOST, hermitian=True)
    scaled = cross / scale
    return np.asarray(own - scaled @ inverse @ scaled.T)


def about_specimen(
    problem: Problem, vector: FloatArray, noises: Sequence[NoiseModel], names: Sequence[str]
) -> tuple[FloatArray, FloatArray]:
    """Information of one test, and of the priors, about the parameters of a specimen, each (s, s).

    What is unknown of the test itself is taken out, with what its own priors say.
    """
    kept = [problem.names.index(name) for name in names]
    others = [i for i in range(len(problem.names)) if i not in kept and i not in problem.noise_entries]
    priors = prior_information(problem, vector)
    own = np.zeros_like(priors)
    own[others, others] = priors[others, others]
    return marginal(information(problem, vector, noises) + own, kept, others), priors[np.ix_(kept, kept)]


def deviation_of(matrix: FloatArray, index: int) -> float:
    """Standard deviation of one entry whose information with the others is (s, s); inf where nothing fixes it."""
    others = [k for k in range(len(matrix)) if k != index]
    own = float(marginal(matrix, [index], others)[0, 0])
    return own**-0.5 if own > LOST * float(matrix[index, index]) else np.inf
