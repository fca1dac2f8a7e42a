"""What every test of a grid of tips and depths would tell of a specimen."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from underlay._arrays import FloatArray
from underlay.errors import InputError, ParameterError
from underlay.inference.design.information import about_specimen, expected_problem
from underlay.inference.problem import Given
from underlay.mechanics.solvers import AnySolver
from underlay.scene.noise_model import NoiseModel
from underlay.scene.scene import Scene

__all__ = ["Grid", "readings"]

# Share of the readings before contact: a test that starts in contact cannot tell its contact point.
_APPROACH = 0.25


@dataclass(frozen=True)
class Grid:
    """Information of every test of a grid, in scaled coordinates.

    Parameters
    ----------
    information : FloatArray
        About the specimen, priors not counted, (r, d, s, s).
    prior : FloatArray
        Of the priors, (s, s).
    slopes : FloatArray
        d parameter / d scaled coordinate (SI), (s,).
    peak_force : FloatArray
        Force at the deepest point (N), (r, d); NaN where the test cannot be done.
    refusals : mapping of (int, int) to str
        Why it cannot.
    """

    information: FloatArray
    prior: FloatArray
    slopes: FloatArray
    peak_force: FloatArray
    refusals: Mapping[tuple[int, int], str]

    @classmethod
    def of(
        cls,
        scene: Scene,
        free: Mapping[str, Given],
        noise: NoiseModel,
        radii: FloatArray,
        depths: FloatArray,
        specimen: Sequence[str],
        points: int,
        solver: AnySolver,
    ) -> Grid:
        """Tell what tests with tips (m), (r,), to depths (m), (d,), would say.

        Raises
        ------
        ParameterError
            As `Problem`.
        InputError
            If none of the tests can be done.
        """
        shape, size = (len(radii), len(depths)), len(specimen)
        information, peak_force = np.zeros((*shape, size, size)), np.full(shape, np.nan)
        prior, slopes = np.zeros((size, size)), np.zeros(size)
        refusals: dict[tuple[int, int], str] = {}
        for (i, j), _ in np.ndenumerate(peak_force):
            tipped = scene.with_values({"indenter.radius": float(radii[i])})
            try:
                problem = expected_problem(
                    tipped, readings(scene, float(depths[j]), points), free, noise, solver=solver
                )
                start = problem.start
                information[i, j], prior = about_specimen(problem, start, problem.noises(start), specimen)
            except ParameterError:
                raise
            except InputError as error:
                refusals[i, j] = str(error)
                continue
            peak_force[i, j] = float(problem.curves[0].force.max())
            slopes = problem.slopes(start)[[problem.names.index(name) for name in specimen]]
        if len(refusals) == peak_force.size:
            raise InputError(f"no test of this grid can be done: {next(iter(refusals.values()))}")
        return cls(information, prior, slopes, peak_force, refusals)


def readings(scene: Scene, depth: float, points: int) -> FloatArray:
    """Depth readings (m), (points,), of a test to a depth (m) that begins before contact."""
    before = -_APPROACH / (1.0 - _APPROACH) * depth
    return np.asarray(np.linspace(before, depth, points) + scene.instrument.contact_depth)
