"""Which parameters a test determines, before or after it is done, by the Fisher information.

For Gaussian noise the information is F = J' V^-1 J in scaled coordinates, with J the derivatives of the force and V
the covariance of the noise. The information that the noise's own size carries when it follows the force is of
second order in that size and is left out, so the bounds are a little too wide rather than too narrow.

Moduli, lengths and other positive quantities enter by their logarithm, so an eigenvector of their information is a
product of powers: a direction with a large eigenvalue is a combination such as E h^-0.8 that the data determine,
one with a small eigenvalue a combination that they do not. The quantities of the instrument and ratios such as
Poisson's are unknown too, but each is reported by itself.

After a test the numbers that are reported are the statistical parts of the fit's own answers, which allow for what
its curve shows besides noise.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np
import pandas as pd

from underlay._arrays import ArrayLike, FloatArray, as_finite, read_only
from underlay._given import require_given
from underlay._threads import one_thread
from underlay.data.curve import Curve
from underlay.data.synthetic import simulate
from underlay.errors import InputError
from underlay.inference.least_squares import fit
from underlay.inference.least_squares.fit_result import Fit
from underlay.inference.least_squares.judge import times_told_by
from underlay.inference.least_squares.models import freeze
from underlay.inference.least_squares.objective import Objective
from underlay.inference.priors import Given
from underlay.inference.problem import Problem
from underlay.inference.uncertainty.answer import NORMAL_95, Interval
from underlay.mechanics.solvers import AnySolver
from underlay.quantities import kind_of, path_of
from underlay.scene.noise import NoiseModel
from underlay.scene.scene import Scene
from underlay.units import format_quantity

#: First words of the paths of a specimen's parameters; all others belong to one test.
SPECIMEN = ("layer.", "substrate.")
#: Eigenvalue of an information matrix, over the largest, below which it is due to rounding and the error of the
#: finite differences.
LOST = 1e-13
#: Relative standard deviations up to which a quantity counts as determined, and beyond which it does not.
FIXED, OPEN = 0.1, 1.0
_SMALL_POWER = 0.05  # powers below this are left out of the text


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
    """Return the problem that a planned test would give, with a simulated curve.

    Parameters
    ----------
    scene : Scene
        The test, with the expected values of its parameters.
    depth : array_like (n,)
        Depth readings (m).
    free, solver
        As in `Problem`.
    noise : Noise
        The noise it will have; its size must be given.
    duration : float
        Time the test takes (s), for correlated noise.
    time : array_like (n,), optional
        Times of the readings (s) instead, for a time-dependent sample.

    Raises
    ------
    InputError
        If the size of the noise is unknown, or as `Problem`.
    """
    require_given(noise, "noise", NoiseModel)
    if noise.size_is_unknown:
        raise InputError("before a test the noise must be given: the standard deviation of its force")
    readings = as_finite(depth, "depth")
    if readings.ndim != 1:
        raise InputError(f"depth must be a list of numbers, (n,); got shape {readings.shape}")
    clock = np.linspace(0.0, duration, len(readings)) if time is None else time
    curve: Curve = simulate(scene, readings, time=clock, solver=solver)
    return Problem(scene, curve, free, noise, solver=solver)


def information(problem: Problem, vector: FloatArray, noises: Sequence[NoiseModel]) -> FloatArray:
    """Fisher information (k, k) of the readings without the priors; rows of noise parameters are zero.

    Parameters
    ----------
    problem : Problem
        The test.
    vector : FloatArray
        Scaled vector at which it is evaluated, (k,).
    noises : sequence of NoiseModel
        Noise of every curve, its size known.
    """
    objective = Objective(problem, freeze(problem, vector, noises))
    rows = objective.jacobian(vector)[: problem.n_points]
    return rows.T @ rows


def prior_information(problem: Problem, vector: FloatArray) -> FloatArray:
    """Information (k, k) of the informative priors, in scaled coordinates; diagonal."""
    physical, slopes = problem.physical(vector), problem.slopes(vector)
    diagonal = [
        (coordinate.prior.penalty(float(x))[1] * slope) ** 2
        for coordinate, x, slope in zip(problem.coordinates, physical, slopes, strict=True)
    ]
    return np.diag(np.array(diagonal))


def marginal(matrix: FloatArray, kept: Sequence[int], others: Sequence[int]) -> FloatArray:
    """Information (m, m) about the entries `kept` when `others` are unknown too: the Schur complement.

    Parameters
    ----------
    matrix : FloatArray
        Information about all entries, (k, k).
    kept, others : sequence of int
        Indices of the m entries of interest, and of the nuisance parameters.
    """
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

    The unknowns of the test itself are marginalised, with their own priors.

    Parameters
    ----------
    problem, vector, noises
        As in `information`.
    names : sequence of str
        The parameters of the specimen, s of them.
    """
    kept = [problem.names.index(name) for name in names]
    others = [i for i in range(len(problem.names)) if i not in kept and i not in problem.noise_entries]
    priors = prior_information(problem, vector)
    own = np.zeros_like(priors)
    own[others, others] = priors[others, others]
    return marginal(information(problem, vector, noises) + own, kept, others), priors[np.ix_(kept, kept)]


def deviation_of(matrix: FloatArray, index: int) -> float:
    """Standard deviation of one entry, given the information (s, s) of all; inf where it is not determined."""
    others = [k for k in range(len(matrix)) if k != index]
    own = float(marginal(matrix, [index], others)[0, 0])
    return own**-0.5 if own > LOST * float(matrix[index, index]) else np.inf


@dataclass(frozen=True)
class Combination:
    """A product of powers of parameters, and how well the data determine it.

    Parameters
    ----------
    powers : mapping of name to float
        Exponents; the largest is one.
    relative_sd : float
        Standard deviation of the logarithm of the product: infinite where it is not determined.
    """

    powers: Mapping[str, float]
    relative_sd: float

    @property
    def verdict(self) -> str:
        """``"fixed"`` (to 10 %), ``"weakly fixed"`` (to a factor e) or ``"not fixed"``."""
        if self.relative_sd <= FIXED:
            return "fixed"
        return "weakly fixed" if self.relative_sd <= OPEN else "not fixed"

    @property
    def formula(self) -> str:
        """The product, e.g. ``"layer.E * layer.thickness^-0.8"``."""
        parts = []
        for name, power in sorted(self.powers.items(), key=lambda item: -abs(item[1])):
            if abs(power) >= _SMALL_POWER:
                parts.append(name if abs(power - 1.0) < 5e-3 else f"{name}^{power:.2g}")
        return " * ".join(parts)

    def __str__(self) -> str:
        if self.verdict == "not fixed":
            return f"not determined: {self.formula}"
        half = NORMAL_95 * self.relative_sd
        if self.verdict == "fixed":
            return f"well determined, ± {100.0 * half:.2g} %: {self.formula}"
        return f"weakly determined, to a factor of {np.exp(half):.2g}: {self.formula}"


@dataclass(frozen=True, eq=False)
class Identifiability:
    """How well a test determines each free parameter and their combinations.

    Parameters
    ----------
    names : tuple of str
        Free parameters (without those of the noise).
    values : mapping
        Values (SI) at which the information is evaluated.
    fisher : FloatArray
        Information of the data alone in scaled coordinates, (k, k).
    covariance : FloatArray
        Scaled covariance with the priors, (k, k); infinite variances of parameters that are not determined.
    stderr, stderr_data_only : mapping
        Expected standard errors (SI) with and without the priors.
    relative : mapping
        Standard error over value for positive quantities; over the range of the curve for the others.
    combinations : tuple of Combination
        From best to worst determined, by the data alone.
    times_told : tuple of (float, float)
        Shortest and longest relaxation time (s) that the record of each relaxing layer can resolve.
    intervals : mapping of name to Interval
        Statistical part of the fit's answers at 95 %, of a test that was made; empty before a test.
    """

    names: tuple[str, ...]
    values: Mapping[str, float]
    fisher: FloatArray
    covariance: FloatArray
    stderr: Mapping[str, float]
    stderr_data_only: Mapping[str, float]
    relative: Mapping[str, float]
    combinations: tuple[Combination, ...]
    times_told: tuple[tuple[float, float], ...] = ()
    intervals: Mapping[str, Interval] = field(default_factory=dict)

    @property
    def correlations(self) -> pd.DataFrame:
        """Correlation matrix; NaN for parameters that are not determined."""
        deviation = np.sqrt(np.diag(self.covariance))
        finite = np.where(np.isfinite(deviation), deviation, 1.0)
        matrix = self.covariance / np.outer(finite, finite)
        open_ones = ~np.isfinite(deviation)
        matrix[open_ones, :] = np.nan
        matrix[:, open_ones] = np.nan
        return pd.DataFrame(matrix, index=list(self.names), columns=list(self.names))

    def to_frame(self) -> pd.DataFrame:
        """One row per parameter: value, standard errors with and without priors (SI), relative error."""
        return pd.DataFrame(
            {
                "value": [self.values[name] for name in self.names],
                "stderr": [self.stderr[name] for name in self.names],
                "stderr, data only": [self.stderr_data_only[name] for name in self.names],
                "relative": [self.relative[name] for name in self.names],
            },
            index=pd.Index(self.names, name="parameter"),
        )

    def report(self) -> str:
        """Text with the combinations and parameters that the test determines, and their 95 % half widths.

        Of an interval that is lopsided it is the longer arm.
        """
        lines = [str(combination) for combination in self.combinations]
        lines += [
            f"relaxation times from {format_quantity(low, 'time')} to {format_quantity(high, 'time')} can be "
            "determined: the record is sampled so finely, and lasts so long"
            for low, high in dict.fromkeys(self.times_told)
        ]
        for name in self.names:
            error, bare = self.stderr[name], self.stderr_data_only[name]
            value, half = self.values[name], NORMAL_95 * error
            if name in self.intervals:
                value, half = self.intervals[name].value, _longer_arm(self.intervals[name])
            if not np.isfinite(half):
                lines.append(f"{name}: not determined by these data")
                continue
            known = format_quantity(value, kind_of(path_of(name)), half)
            text = f"{name}: {known} (95 %) is what this test can tell"
            if bare > 3.0 * error:
                text += ", by its prior; the data alone determine it less well"
            lines.append(text)
        counted = "the statistical part of a fit" if self.intervals else "for noise and priors alone"
        return "\n".join([*lines, f"± is at 95 %, {counted}: errors of inputs and model come on top"])


@one_thread()
def identifiability(
    test: Problem | Fit | Scene,
    *,
    depth: ArrayLike | None = None,
    time: ArrayLike | None = None,
    free: Mapping[str, Given] | Iterable[str] | None = None,
    noise: NoiseModel | None = None,
    solver: AnySolver = "auto",
) -> Identifiability:
    """Compute how well a test determines its free parameters, before or after it is done.

    Parameters
    ----------
    test : Problem, Fit or Scene
        A problem is fitted first and evaluated at its optimum; a scene is evaluated before any measurement and
        needs `depth`, `free` and `noise`.
    depth : array_like (n,), optional
        Depth readings the test will have (m).
    time : array_like (n,), optional
        Their times (s), for a time-dependent sample; `Program` makes both.
    free, noise, solver
        As in `Problem`, for a scene.

    Raises
    ------
    InputError
        If a scene comes without depth, free or noise; or as `Problem`.

    Examples
    --------
    >>> from underlay import Isotropic, Layer, Noise, Paraboloid, RIGID, Scene
    >>> scene = Scene(Paraboloid(1e-3), Layer(Isotropic(1e6, 0.5), 1e-3), RIGID)
    >>> told = identifiability(scene, depth=np.linspace(0.0, 1e-4, 100), free=["layer.E"],
    ...                        noise=Noise(force=1e-3))
    >>> told.combinations[0].verdict
    'fixed'
    """
    require_given(test, "test", Scene, Problem, Fit)
    if isinstance(test, Scene):
        if depth is None or free is None or noise is None:
            raise InputError(
                "before a test, depth, free and noise are needed: what it will be, and read how well"
            )
        if test.memory is not None and time is None:
            raise InputError(
                "before a test of a sample that remembers, its times (s) are needed too: pass time"
            )
        problem = expected_problem(test, depth, free, noise, time=time, solver=solver)
        return judge(problem, problem.start, problem.noises(problem.start))
    fitted = test if isinstance(test, Fit) else fit(test)
    told = judge(fitted.problem, fitted.vector, fitted.noises)
    intervals = {name: fitted.answer(name).statistical for name in told.names}
    known = tuple(_as_fitted(fitted, one, intervals) for one in told.combinations)
    return replace(told, intervals=intervals, combinations=known)


def _longer_arm(interval: Interval) -> float:
    return max(interval.value - interval.low, interval.high - interval.value)


def _as_fitted(fit: Fit, one: Combination, intervals: Mapping[str, Interval]) -> Combination:
    """A combination with the standard deviation that the draws of a fit give it, where that is the larger one.

    That of the information is smaller where the curve shows more than noise, and larger where a prior helped.
    """
    powers = {name: power for name, power in one.powers.items() if abs(power) >= _SMALL_POWER}
    entries, exponents = [fit.names.index(name) for name in powers], list(powers.values())
    if any(intervals[name].is_open for name in powers):
        return one
    if len(powers) == 1:
        known = intervals[next(iter(powers))]
        spread = _longer_arm(known) / known.value
    else:
        low, _, high = fit.band(lambda drawn: np.prod(drawn[:, entries] ** exponents, axis=1)[:, None])
        spread = 0.5 * float(np.log(high[0] / low[0]))
    return replace(one, relative_sd=max(one.relative_sd, spread / NORMAL_95))


def judge(problem: Problem, vector: FloatArray, noises: tuple[NoiseModel, ...]) -> Identifiability:
    """Identifiability of a problem at a scaled vector (k,) with the noise of every curve."""
    kept = [i for i, c in enumerate(problem.coordinates) if not c.path.startswith("noise.")]
    coordinates = [problem.coordinates[i] for i in kept]
    fisher = information(problem, vector, noises)[np.ix_(kept, kept)]
    priors = prior_information(problem, vector)[np.ix_(kept, kept)]
    covariance, bare = _covariance(fisher + priors), _covariance(fisher)
    slopes = np.abs(problem.slopes(vector)[kept])
    names = tuple(coordinate.name for coordinate in coordinates)
    deviation, deviation_bare = np.sqrt(np.diag(covariance)), np.sqrt(np.diag(bare))
    values = problem.values(vector)
    scales = [i for i, coordinate in enumerate(coordinates) if coordinate.scale is None]
    others = [i for i in range(len(kept)) if i not in scales]
    return Identifiability(
        names=names,
        values={name: values[name] for name in names},
        fisher=read_only(fisher),
        covariance=read_only(covariance),
        stderr=dict(zip(names, (deviation * slopes).tolist(), strict=True)),
        stderr_data_only=dict(zip(names, (deviation_bare * slopes).tolist(), strict=True)),
        relative=dict(zip(names, deviation.tolist(), strict=True)),
        combinations=_combinations(marginal(fisher, scales, others), [names[i] for i in scales]),
        times_told=tuple(times_told_by(problem)),
    )


def _combinations(matrix: FloatArray, names: list[str]) -> tuple[Combination, ...]:
    if not names:
        return ()
    values, vectors = np.linalg.eigh(matrix)
    found = []
    for value, vector in zip(values[::-1], vectors.T[::-1], strict=True):
        lead = vector[np.argmax(np.abs(vector))]
        sd = 1.0 / np.sqrt(value) / abs(lead) if value > LOST * values[-1] else np.inf
        found.append(Combination(dict(zip(names, (vector / lead).tolist(), strict=True)), float(sd)))
    return tuple(found)


def _covariance(matrix: FloatArray) -> FloatArray:
    """Inverse of an information matrix, with infinite variance for entries of undetermined directions."""
    scale = np.sqrt(np.where(np.diag(matrix) > 0.0, np.diag(matrix), 1.0))
    values, vectors = np.linalg.eigh(matrix / np.outer(scale, scale))
    lost = values <= LOST * values[-1]
    inverse = (vectors[:, ~lost] / values[~lost]) @ vectors[:, ~lost].T
    covariance = np.asarray(inverse / np.outer(scale, scale))
    part = np.square(vectors[:, lost]).sum(axis=1)
    for i in np.flatnonzero(part > 1e-4):
        covariance[i, i] = np.inf
    return covariance
