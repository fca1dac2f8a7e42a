"""Planning of a test: the expected standard error of one parameter over tip radius and depth.

Every cell of the grid is a test that was not done: its Fisher information about the specimen (layer and substrate),
the instrument's own unknowns of that test marginalised. Information adds, so the effect of a second radius added to
a first test is one sum per cell.

Where the scene states how well its inputs are known, every cell also has what a fit of that test would add for
inputs and model: the tip at which noise matters least may be the one at which Poisson's ratio matters most.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import TypeAlias

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from underlay._arrays import ArrayLike, FloatArray, as_finite, positive, read_only
from underlay._given import require_count, require_given
from underlay._threads import one_thread
from underlay.data.curve import MIN_POINTS
from underlay.errors import InputError, ParameterError
from underlay.inference.design.identifiability import SPECIMEN, about_specimen, deviation_of, expected_problem
from underlay.inference.least_squares import fit
from underlay.inference.least_squares.fit_result import Fit
from underlay.inference.least_squares.fitting import quick_fit
from underlay.inference.priors import Given
from underlay.inference.problem import Problem, by_path
from underlay.inference.profiling.profile import profile
from underlay.inference.profiling.profile_result import Interval
from underlay.inference.uncertainty.answer import NORMAL_95
from underlay.inference.uncertainty.budget import sources_of
from underlay.inference.uncertainty.likelihood import Likelihood
from underlay.mechanics.solvers import AnySolver
from underlay.quantities import kind_of
from underlay.scene.noise import NoiseModel
from underlay.scene.parameters import unknown_parameter
from underlay.scene.scene import Scene
from underlay.units import format_quantity

#: A motion: depths since contact (m) and times (s), (n,) each.
Record: TypeAlias = tuple[ArrayLike, ArrayLike]
# Share of the readings before contact: a test that starts in contact cannot determine its contact point.
_APPROACH = 0.25
# Default number of readings of a test.
_POINTS = 200
# Factor on the least error within which tests count as equally good: of these the one with the smallest force is
# recommended.
_AS_GOOD = 1.1
# Relative standard error above which the forecast, which is linear, is not reliable.
_NO_FORECAST = 0.1
# Factor beyond the ends of the grid up to which the nearest test of the grid is used for a first test.
_BEYOND = 2.0


@dataclass(frozen=True)
class Grid:
    """Fisher information about a specimen from every test of a grid of r radii and d depths, in scaled coordinates.

    Parameters
    ----------
    information : FloatArray
        Information about the specimen's s parameters, without priors, (r, d, s, s).
    prior : FloatArray
        Information of the priors, (s, s).
    slopes : FloatArray
        d parameter / d scaled coordinate (SI), (s,).
    peak_force : FloatArray
        Force at the deepest point (N), (r, d); NaN where the test cannot be done.
    refusals : mapping of (int, int) to str
        Why a test of the grid cannot be done.
    """

    information: FloatArray
    prior: FloatArray
    slopes: FloatArray
    peak_force: FloatArray
    refusals: Mapping[tuple[int, int], str]

    @classmethod
    def of(
        cls,
        problem_of: Callable[[float, float], Problem],
        radii: FloatArray,
        depths: FloatArray,
        specimen: Sequence[str],
    ) -> Grid:
        """Compute the information of tests with tips of some radii, indented to some depths.

        Parameters
        ----------
        problem_of : callable
            The problem of a test, from its radius and depth (m).
        radii, depths : FloatArray
            Tip radii and largest depths (m), (r,) and (d,).
        specimen : sequence of str
            Free parameters of layer and substrate.

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
        for i, j in np.ndindex(shape):
            try:
                problem = problem_of(float(radii[i]), float(depths[j]))
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


def planned_problem(
    scene: Scene,
    radius: float,
    depth: float,
    free: Mapping[str, Given],
    noise: NoiseModel,
    points: int,
    solver: AnySolver,
    record: Record | None = None,
) -> Problem:
    """The problem that a test with a tip of `radius` (m), indented to `depth` (m), would give.

    Without a record a quarter of the `points` readings lies before contact; a record is scaled to the depth.
    """
    if record is None:
        before = -_APPROACH / (1.0 - _APPROACH) * depth
        w, time = np.linspace(before, depth, points), None
    else:
        taken, time = (as_finite(column, "record") for column in record)
        w = depth / positive(taken.max(), "the deepest point of the record", "m") * taken
    tipped = scene.with_values({"indenter.radius": radius})
    path = w + scene.instrument.contact_depth
    return expected_problem(tipped, path, free, noise, time=time, solver=solver)


@dataclass(frozen=True, eq=False)
class Plan:
    """Expected standard error of one parameter for every test of a grid of r radii and d depths.

    Parameters
    ----------
    parameter : str
        The parameter of interest.
    value : float
        Its expected value (SI).
    names : tuple of str
        Parameters of the specimen that are unknown.
    radii, depths : FloatArray
        The grid (m), (r,) and (d,).
    stderr : FloatArray
        Expected standard error (SI), (r, d); infinite where the test does not determine the parameter, NaN where it
        cannot be done.
    peak_force : FloatArray
        Force at the deepest point (N), (r, d).
    refusals : mapping of (int, int) to str
        Why a test of the grid cannot be done.
    scaled_information : FloatArray
        Information about the specimen in scaled coordinates, without priors, (r, d, s, s).
    prior : FloatArray
        Information of the priors about the specimen, (s, s).
    slope : float
        d parameter / d scaled coordinate (SI).
    combined : FloatArray, optional
        Expected standard uncertainty (SI), (r, d), of noise, inputs and model together, where the scene states
        uncertainties of its inputs.
    interval : Interval, optional
        Where the recommended test's standard error is above a tenth of the value, and so no reliable forecast: the
        95 % profile interval of that test's own curve without noise, which may have one end only.
    """

    parameter: str
    value: float
    names: tuple[str, ...]
    radii: FloatArray
    depths: FloatArray
    stderr: FloatArray
    peak_force: FloatArray
    refusals: Mapping[tuple[int, int], str]
    scaled_information: FloatArray
    prior: FloatArray
    slope: float
    combined: FloatArray | None = None
    interval: Interval | None = None

    @property
    def error(self) -> FloatArray:
        """What tests are chosen by (SI), (r, d): `combined` where it is known, else `stderr`."""
        return self.stderr if self.combined is None else self.combined

    @property
    def best(self) -> tuple[float, float]:
        """Radius and depth (m) of the recommended test: the smallest force within 10 % of the least error.

        Raises
        ------
        InputError
            If no test of the grid determines the parameter.
        """
        i, j = self._best_cell()
        return float(self.radii[i]), float(self.depths[j])

    @property
    def is_doubtful(self) -> bool:
        """Whether even the recommended test's standard error exceeds a tenth of the parameter's value."""
        if not np.isfinite(self.stderr).any() or not self.value:
            return False
        return bool(self.stderr[self._best_cell()] > _NO_FORECAST * abs(self.value))

    @property
    def recommendation(self) -> str:
        """The recommended test in words."""
        if not np.isfinite(self.stderr).any():
            return (
                f"no test of this grid determines {self.parameter}: give another parameter a prior, add a second "
                "radius (Plan.second), or widen the grid"
            )
        i, j = self._best_cell()
        half = NORMAL_95 * float(self.stderr[i, j])
        lengths = (format_quantity(float(x), "length", digits=3) for x in (self.radii[i], self.depths[j]))
        force = format_quantity(float(self.peak_force[i, j]), "force", digits=2)
        test = "with a tip radius of {}, indented to {} (force up to {})".format(*lengths, force)
        if self.is_doubtful:
            if self.interval is None:
                least = 100.0 * NORMAL_95 * _NO_FORECAST
                return f"{self.parameter} to no better than ± {least:.2g} % (95 %), {test}"
            return f"the best test of this grid does not determine it: {self.interval}, {test}"
        alone = f"± {self._written(half)}"
        if self.combined is None:
            return f"{self.parameter} to {alone} at 95 %, from the noise alone, {test}"
        whole = self._written(NORMAL_95 * float(self.combined[i, j]))
        return (
            f"{self.parameter} to ± {whole} at 95 %, with the uncertainties of inputs and model ({alone} from the "
            f"noise alone), {test}"
        )

    def _written(self, half: float) -> str:
        """A half width of the parameter (SI) as text, with its share of the value."""
        share = f" ({100.0 * half / abs(self.value):.2g} %)" if self.value else ""
        return f"{format_quantity(half, kind_of(self.parameter), digits=2)}{share}"

    def to_frame(self) -> pd.DataFrame:
        """Standard error (SI), `error`, by radius (rows, m) and depth (columns, m)."""
        return pd.DataFrame(
            self.error,
            index=pd.Index(self.radii, name="radius"),
            columns=pd.Index(self.depths, name="depth"),
        )

    def second(self, radius: float, depth: float) -> Plan:
        """Plan of a second test on the same specimen, to be fitted jointly with a first one.

        Parameters
        ----------
        radius, depth : float
            The first test (m): the nearest one of the grid is used, up to a factor of two beyond its ends.

        Returns
        -------
        Plan
            Its errors are those of both tests together, from the noise alone.

        Raises
        ------
        InputError
            If the first test cannot be done, or lies further beyond the grid.
        """
        i, j = _nearest(self.radii, radius, "radius"), _nearest(self.depths, depth, "depth")
        if (i, j) in self.refusals:
            raise InputError(f"the first test cannot be done: {self.refusals[i, j]}")
        first = self.scaled_information[i, j]
        index = self.names.index(self.parameter)
        joint = self.scaled_information + first
        stderr = _errors(joint + self.prior, index, ~np.isnan(self.stderr)) * self.slope
        return replace(
            self, stderr=read_only(stderr), scaled_information=read_only(joint), combined=None, interval=None
        )

    def _best_cell(self) -> tuple[int, int]:
        usable = np.isfinite(self.error)
        if not usable.any():
            raise InputError(self.recommendation)
        good = usable & (self.error <= _AS_GOOD * self.error[usable].min())
        index = int(np.argmin(np.where(good, self.peak_force, np.inf)))
        i, j = np.unravel_index(index, self.stderr.shape)
        return int(i), int(j)


@one_thread()
def plan(
    scene: Scene,
    *,
    free: Mapping[str, Given] | Iterable[str],
    noise: NoiseModel,
    radii: ArrayLike,
    depths: ArrayLike,
    parameter: str = "layer.E",
    points: int = _POINTS,
    solver: AnySolver = "auto",
    record: Record | None = None,
) -> Plan:
    """Expected standard error of a parameter over tip radius and depth of the test.

    Parameters
    ----------
    scene : Scene
        The specimen as it is expected to be; its indenter must have a radius.
    free : mapping of path to prior
        The parameters that will be unknown, as in `Problem`.
    noise : Noise
        Noise of the force reading; its size must be given.
    radii, depths : array_like
        Tip radii and largest depths to consider (m), increasing.
    parameter : str
        The parameter of interest, one of the free ones of layer or substrate.
    points : int
        Readings per test, a quarter of them before contact.
    solver : Solver or str, default "auto"
        Which contact law; see `contact_law`.
    record : (array_like, array_like), optional
        Depths since contact (m) and times (s), (n,) each, of the motion of every test, scaled to its own depth;
        instead of `points`. A viscoelastic or poroelastic sample needs a ramp and a hold.

    Raises
    ------
    ParameterError
        If the parameter is not one of the free ones of the specimen, or the indenter has no radius.
    InputError
        If the noise is unknown, radii or depths are not positive and increasing, or a sample that remembers is
        given without a record.
    """
    require_given(scene, "scene", Scene)
    require_given(noise, "noise", NoiseModel)
    require_count(points, "points", MIN_POINTS)
    wanted = by_path(free)
    specimen = tuple(path for path in wanted if path.startswith(SPECIMEN))
    if parameter not in specimen:
        raise ParameterError(
            f"{parameter!r} must be a free parameter of layer or substrate; free are "
            f"{', '.join(wanted) or 'none'}"
        )
    if parameter not in scene.parameters:
        raise unknown_parameter(parameter, scene.parameters)
    if "indenter.radius" not in scene.parameters:
        raise ParameterError(f"the grid varies indenter.radius, which {scene.indenter!r} does not have")
    tips, ends = _positive(radii, "radii"), _positive(depths, "depths")
    if scene.memory is not None and record is None:
        raise InputError(
            "a sample that remembers is planned with the motion of the test: its depths and times, as record or of "
            "a curve, or motion in [simulate]"
        )

    def problem_of(radius: float, depth: float) -> Problem:
        return planned_problem(scene, radius, depth, wanted, noise, points, solver, record)

    grid = Grid.of(problem_of, tips, ends, specimen)
    slope = grid.slopes[specimen.index(parameter)]
    errors = _errors(grid.information + grid.prior, specimen.index(parameter), ~np.isnan(grid.peak_force))
    combined = None
    if isinstance(scene.uncertainties, Mapping):
        shifts = np.full(errors.shape, np.nan)
        for i, j in zip(*np.nonzero(np.isfinite(errors)), strict=True):
            shifts[i, j] = _systematic(problem_of(float(tips[i]), float(ends[j])), parameter)
        combined = read_only(np.where(np.isinf(errors), np.inf, np.hypot(errors, shifts)) * slope)
    planned = Plan(
        parameter=parameter,
        value=scene.parameters[parameter],
        names=specimen,
        radii=read_only(tips),
        depths=read_only(ends),
        stderr=read_only(errors * slope),
        peak_force=read_only(grid.peak_force),
        refusals=grid.refusals,
        scaled_information=read_only(grid.information),
        prior=read_only(grid.prior),
        slope=slope,
        combined=combined,
    )
    if not planned.is_doubtful:
        return planned
    found = fit(problem_of(*planned.best), start="given")
    return replace(planned, interval=profile(found, parameter).interval())


def _systematic(problem: Problem, parameter: str) -> float:
    """Standard deviation of the scaled parameter by uncertain inputs and the model, as a fit of the test has it."""

    def refit(changed: Problem) -> Fit:
        return quick_fit(changed, start="given")

    found = refit(problem)
    index = found.names.index(parameter)
    sources = sources_of(found, Likelihood.of(found).moved, refit)
    moves = [np.abs(source.moves[..., index]).max(axis=1) for source in sources]
    return float(np.linalg.norm(np.concatenate([np.zeros(1), *moves]))) / NORMAL_95


def _errors(matrices: FloatArray, index: int, possible: NDArray[np.bool_]) -> FloatArray:
    """Standard error of entry `index` in scaled coordinates, (r, d), from information matrices (r, d, s, s)."""
    errors = np.full(matrices.shape[:2], np.nan)
    for i, j in zip(*np.nonzero(possible), strict=True):
        errors[i, j] = deviation_of(matrices[i, j], index)
    return errors


def _nearest(grid: FloatArray, length: float, name: str) -> int:
    """Index of the length (m) in an increasing grid that is nearest in ratio to the first test's.

    Raises InputError where the length lies more than a factor of two beyond the grid; `name` is for the message.
    """
    asked = positive(length, f"the {name} of the first test", "m")
    if not grid[0] / _BEYOND <= asked <= grid[-1] * _BEYOND:
        ends = " to ".join(format_quantity(float(end), "length") for end in (grid[0], grid[-1]))
        raise InputError(
            f"the {name} of the first test, {format_quantity(asked, 'length')}, lies far outside the grid of this "
            f"plan, {ends}: plan with a grid that holds it (lengths are in m)"
        )
    return int(np.argmin(np.abs(np.log(grid / asked))))


def _positive(values: ArrayLike, name: str) -> FloatArray:
    array = np.atleast_1d(as_finite([] if values is None else values, name))
    if array.ndim != 1 or not array.size or not (array > 0.0).all() or (np.diff(array) <= 0.0).any():
        raise InputError(
            f"{name} must be positive lengths (m), one row of them, increasing; got {values!r:.80}"
        )
    return array
