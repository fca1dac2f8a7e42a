"""Comparison of models by their predictions, and the error of a contact law as part of the noise.

`compare_models` gives two results side by side. The first is the expected log-density of left-out points, by
Pareto-smoothed importance sampling (PSIS-LOO; Vehtari, Gelman and Gabry 2017, doi:10.1007/s11222-016-9696-4),
through arviz: it hardly depends on the priors. With correlated noise the contribution of a point is that of its
innovation given the one before. The second is the evidence, the probability of the data with the parameters
integrated over their priors: it says how much more probable a model has become, and a prior ten times as wide costs
it a factor of ten.
"""

from __future__ import annotations

import warnings
from collections.abc import Mapping, Sequence
from dataclasses import fields, replace
from types import ModuleType
from typing import Any

import numpy as np
import pandas as pd
from scipy import special

from underlay._arrays import FloatArray
from underlay._given import require_given
from underlay.data.curve import Curve
from underlay.errors import InputError
from underlay.inference.least_squares.fitting import quick_fit
from underlay.inference.model.members import Member
from underlay.inference.problem import Problem
from underlay.inference.sampling.diagnostics import arviz_library
from underlay.inference.sampling.posterior import LogEvidence, Posterior
from underlay.quantities import field_quantities
from underlay.scene.instrument import ContactDepth
from underlay.scene.noise import LowRankNoise, Noise, NoiseModel
from underlay.scene.scene import Scene

# Relative difference of equal numbers after scaling and back.
_SAME = 1e-9
# Draws of a posterior that are used: enough for a standard error far below the differences between models; the
# weights need some hundred per tail.
_DRAWS = 2000
# Largest tail index with which the estimate converges at a useful rate, and 1 - 1/log10(draws) where that is
# less: Vehtari, Simpson, Gelman, Yao and Gabry (2024), Pareto smoothed importance sampling.
_GOOD_K = 0.7


def difference(problem: Problem, posterior: Posterior) -> str:
    """The first difference between a posterior's problem and another problem, in words; empty if none is known.

    Starting values of the free parameters are not compared.
    """
    if posterior.names != problem.names:
        return f"free are {', '.join(posterior.names)} there and {', '.join(problem.names)} in the problem"
    if posterior.priors != tuple(repr(prior) for prior in problem.priors.values()):
        return "the priors differ"
    if posterior.problem is None:
        # A posterior saved without its problem still has the readings.
        bands = posterior.predictive
        same = len(bands) == len(problem.curves) and all(
            _within(band.depth, band.force, curve) for band, curve in zip(bands, problem.curves, strict=True)
        )
        return "" if same else "the curves differ"
    return _of_problems(problem, posterior.problem)


def _of_problems(ours: Problem, theirs: Problem) -> str:
    if len(ours.curves) != len(theirs.curves) or not all(
        # Readings near a jump of the force are left out for an adhesive contact.
        _within(curve.depth, curve.force, own) and (scene.adheres or len(curve) == len(own))
        for curve, own, scene in zip(theirs.curves, ours.curves, ours.base_scenes, strict=True)
    ):
        return "the curves differ"
    values = ours.values(ours.start)
    place, there = ours.vector(values), theirs.vector(values)
    for mine, other in zip(ours.scenes(place), theirs.scenes(there), strict=True):
        unlike = _of_scenes(mine, other)
        if unlike:
            return unlike
    if ours.solver != theirs.solver:
        return f"the contact law is {theirs.solver!r} there and {ours.solver!r} in the problem"
    unknown = [[member.scale_is_unknown for member in problem.members] for problem in (ours, theirs)]
    noises = zip(ours.noises(place), theirs.noises(there), strict=True)
    if ours.noise_is_open != theirs.noise_is_open or unknown[0] != unknown[1]:
        return "the noise is stated in one of them alone"
    return "" if all(_alike(*pair) for pair in noises) else "the noise differs"


def _within(depth: np.ndarray, force: np.ndarray, curve: Curve) -> bool:
    """Whether all these depths and forces are among the readings of a curve."""
    known = set(zip(curve.depth.tolist(), curve.force.tolist(), strict=True))
    return known.issuperset(zip(depth.tolist(), force.tolist(), strict=True))


def _of_scenes(ours: Scene, theirs: Scene) -> str:
    numbers, others = ours.parameters, theirs.parameters
    if list(numbers) == list(others):
        for path, value in numbers.items():
            if not np.isclose(value, others[path], rtol=_SAME, atol=0.0):
                return f"{path} is {others[path]:.10g} there and {value:.10g} in the problem"
        if theirs.with_values(numbers) == ours:
            return ""
    return "the scenes differ"


def _alike(ours: NoiseModel, theirs: NoiseModel) -> bool:
    if type(ours) is not type(theirs):
        return False
    names = field_quantities(type(ours))
    # A number that is not stated is None, not zero.
    numbers = ([getattr(noise, name) for noise in (ours, theirs)] for name in names)
    arrays = [[getattr(noise, name, 0) for name in ("columns", "common")] for noise in (ours, theirs)]
    return (
        all(
            mine == other if mine is None or other is None else np.isclose(mine, other, rtol=_SAME, atol=0.0)
            for mine, other in numbers
        )
        and all(map(np.array_equal, *arrays))
        # Fields that are not numbers, such as words.
        and theirs.at({name: getattr(ours, name) for name in names}) == ours
    )


def compare_models(models: Mapping[str, tuple[Problem, Posterior]]) -> pd.DataFrame:
    """Rank models of the same data by their expected log-density of left-out points.

    Parameters
    ----------
    models : mapping of str to (Problem, Posterior)
        At least two, of the same curves.

    Returns
    -------
    DataFrame
        Best first: ``elpd_loo``, ``p_loo`` (effective number of parameters), ``elpd_diff`` and its standard error
        ``dse``, ``weight``, ``warning`` (True where a Pareto k above 0.7, a little less with few draws, makes the
        estimate unreliable), ``model_error``, the relative error of the force that the contact law states for
        itself; and, nan where a posterior's evidence is not known, ``log_evidence`` with ``log_evidence_error`` and
        ``probability``, the posterior probability of the model among those with an evidence, for equal prior
        probabilities. Evidences are comparable only where the noise is stated in the same way, if only as
        ``Noise()``.

    Raises
    ------
    InputError
        If there are fewer than two models, their curves differ, or a posterior is that of another problem.
    MissingExtraError
        If arviz is not installed (extra ``uq``).

    Examples
    --------
    A layer on a rigid base, compared with a half-space model of it:

    >>> from underlay import Isotropic, Layer, LogUniform, Noise, Paraboloid, RIGID, Scene, sample, synthesize
    >>> scene = Scene(Paraboloid(1e-3), Layer(Isotropic(1e6, 0.45), 5e-4), RIGID)
    >>> noise = Noise(force=2e-4)
    >>> curve = synthesize(scene, np.linspace(0.0, 5e-5, 40), noise, rng=1)
    >>> models = {}
    >>> for law in ("halfspace", "exact"):
    ...     problem = Problem(scene, curve, {"layer.E": LogUniform(1e4, 1e8)}, noise, solver=law)
    ...     models[law] = problem, sample(problem, walkers=16, rng=0)
    >>> table = compare_models(models)
    >>> list(table.index)
    ['exact', 'halfspace']
    >>> bool(table.loc["halfspace", "elpd_diff"] > 3.0 * table.loc["halfspace", "dse"])
    True
    >>> bool(table.loc["exact", "probability"] > 0.99)
    True
    """
    _require_models(models)
    first = next(iter(models.values()))[0].curves
    for name, (problem, _) in models.items():
        same = len(problem.curves) == len(first) and all(
            np.array_equal(a.depth, b.depth) and np.array_equal(a.force, b.force)
            for a, b in zip(problem.curves, first, strict=True)
        )
        if not same:
            raise InputError(f"model {name!r} was sampled on other curves; compare models of the same data")
    for name, pair in models.items():
        other = difference(*pair)
        if other:
            raise InputError(
                f"the posterior of model {name!r} is not that of its problem: {other}; give each problem with what "
                "ul.sample made of it"
            )
    arviz = arviz_library()
    data = {name: _inference_data(problem, posterior) for name, (problem, posterior) in models.items()}
    with warnings.catch_warnings():
        # The column `warning` replaces arviz's warnings about large Pareto k; pandas' warnings are addressed to
        # arviz.
        warnings.simplefilter("ignore", UserWarning)
        warnings.simplefilter("ignore", DeprecationWarning)
        scores = {name: _score(arviz, entry) for name, entry in data.items()}
        table = pd.DataFrame(arviz.compare(scores))
    posteriors = [models[str(name)][1] for name in table.index]
    table["model_error"] = [posterior.diagnostics.model_error for posterior in posteriors]
    evidences = _evidences([models[str(name)] for name in table.index])
    return table.assign(**evidences)


def _require_models(models: object) -> None:
    if not isinstance(models, Mapping) or len(models) < 2:
        raise InputError("compare at least two models, e.g. {'exact': (problem, posterior), ...}")
    for name, pair in models.items():
        if not (isinstance(pair, Sequence) and [*map(type, pair)] == [Problem, Posterior]):
            raise InputError(f"model {name!r} must be (problem, posterior); got {pair!r:.80}")


def _evidences(models: Sequence[tuple[Problem, Posterior]]) -> dict[str, FloatArray]:
    """Columns of the log-evidences, their errors and the models' posterior probabilities; nan where unknown."""
    evidences = [posterior.log_evidence or LogEvidence(np.nan, np.nan) for _, posterior in models]
    value = np.array([entry.value for entry in evidences])
    # Noise of unknown size has an improper prior: its evidence cannot be compared with those for a stated size.
    unknown = [[member.scale_is_unknown for member in problem.members] for problem, _ in models]
    if any(entry != unknown[0] for entry in unknown):
        value = np.full(len(value), np.nan)
    known = np.isfinite(value)
    probability = np.full(len(value), np.nan)
    if known.any():
        probability[known] = special.softmax(value[known])
    error = np.where(known, [entry.error for entry in evidences], np.nan)
    return {"log_evidence": value, "log_evidence_error": error, "probability": probability}


def pointwise_log_likelihood(problem: Problem, physical: FloatArray) -> FloatArray:
    """Log-density of every point at draws of the parameters.

    Parameters
    ----------
    problem : Problem
        The model.
    physical : FloatArray
        Draws of the parameters (SI), (draws, parameters).

    Returns
    -------
    FloatArray
        Log-densities (draws, points) of the points of all curves. Their sum is the log-likelihood, except where the
        size of the noise was integrated out: there each draw has the size estimated from its own residuals.

    Raises
    ------
    InputError
        If no law exists at a draw.
    """
    each = [_pointwise(member, physical) for member in problem.members]
    white, spread = (np.concatenate(parts, axis=1) for parts in zip(*each, strict=True))
    if problem.common is not None:
        white, more = problem.common.innovations(white)
        spread = spread + more
    return np.asarray(-0.5 * np.square(white) - spread - 0.5 * np.log(2.0 * np.pi))


def with_model_error(problem: Problem, model_error: float) -> Problem:
    """Return the problem with the error of its contact law as an error that all readings share.

    The relative error of a law is a smooth function of depth. With x the contact radius over the largest of all
    curves, 0 at contact, it is taken as

        model_error (u_0 + u_1 cos(pi x) + u_2 sin(pi x)) / sqrt(2),   u ~ N(0, 1),

    of standard deviation `model_error` everywhere, nearly equal at neighbouring depths and independent between both
    ends. It is not reduced by more points, nor by more curves fitted jointly: the curves share the u, since one law
    has the same error in all of them. (A stated term, not an estimate.)

    Parameters
    ----------
    problem : Problem
        What is fitted or sampled with an approximate law; its noise is stated.
    model_error : float
        Relative error of the force (dimensionless), e.g. `Fit.statistics.law_error`,
        ``posterior.diagnostics.model_error`` or the ``error`` of `accuracy_cost`.

    Returns
    -------
    Problem
        The problem with that error in its noise, proportional to the contact force of a quick fit.

    Raises
    ------
    InputError
        If `model_error` is negative, the noise is of another model than `Noise`, or its numbers are not all given.
    FitError
        If nothing can be fitted.

    Examples
    --------
    >>> from underlay import Isotropic, Layer, Noise, Paraboloid, RIGID, Scene, fit, simulate
    >>> scene = Scene(Paraboloid(1e-3), Layer(Isotropic(1e6, 0.45), 1e-3), RIGID)
    >>> curve = simulate(scene, np.linspace(0.0, 1e-5, 50))
    >>> problem = Problem(scene, curve, ["layer.E"], Noise(force=1e-9))
    >>> wider = fit(with_model_error(problem, 0.01))

    E is known to about the error of the law, however little noise there is:

    >>> 0.002 < wider.stderr["layer.E"] / wider.values["layer.E"] < 0.01
    True
    """
    require_given(problem, "problem", Problem)
    if not model_error >= 0.0:
        raise InputError(f"model_error is a share of the force, zero or more; got {model_error!r}")
    # Checked before a fit that may take seconds.
    for member in problem.members:
        _require_stated(member)
    physical = problem.physical(quick_fit(problem).vector)
    spans = [_span(member, physical) for member in problem.members]
    widest = max(float(span.max()) for span in spans)
    return problem.revised(
        noise=[
            _widened(member, physical, model_error, span / widest, is_alone=len(spans) == 1)
            for member, span in zip(problem.members, spans, strict=True)
        ]
    )


def _require_stated(member: Member) -> None:
    if not isinstance(member.noise, Noise):
        raise InputError(
            f"a model's error is added to a Noise; {type(member.noise).__name__} has its own ways to hold one"
        )
    if member.noise_entries or member.scale_is_unknown:
        raise InputError("a model's error stands beside a noise that is known: state noise.force (N)")


def _span(member: Member, physical: FloatArray) -> FloatArray:
    """Root of depth times tip radius, (n,): proportional to the contact radius of each reading."""
    values = member.values_at(physical)
    travel = np.maximum(member.curve.depth - values[ContactDepth.path], 0.0)
    return np.maximum(np.sqrt(travel * values.get("indenter.radius", 1.0)), np.finfo(float).tiny)


def _widened(
    member: Member, physical: FloatArray, model_error: float, span: FloatArray, *, is_alone: bool
) -> LowRankNoise:
    """The noise of one curve with its law's error; `span` (n,) is the contact radius over the largest of all.

    `is_alone` says that the problem has one curve, whose error is shared with no other.
    """
    reading, noise = member.reading(physical), member.noise
    sigma = member.sigma(reading, noise)
    along = np.pi * span
    shapes = np.column_stack((np.ones_like(along), np.cos(along), np.sin(along))) / np.sqrt(2.0)
    columns = model_error * (reading.contact / sigma)[:, None] * shapes
    given = {entry.name: getattr(noise, entry.name) for entry in fields(Noise)}
    none = np.zeros((len(columns), 0))
    own, common = (noise.columns, noise.common) if isinstance(noise, LowRankNoise) else (none, none)
    if is_alone:
        return LowRankNoise(**given, columns=np.hstack((own, columns)), common=common)
    return LowRankNoise(**given, columns=own, common=np.hstack((common, columns)))


def _score(arviz: ModuleType, data: Any) -> Any:
    """PSIS-LOO score of one model by arviz, with `warning` set by the points that depend on the parameters.

    A point before contact has the same density at every draw: its weights are equal whatever the tail, for which
    arviz gives a k of infinity.
    """
    score = arviz.loo(data, pointwise=True, scale="log")
    density = data.log_likelihood["force"].to_numpy()
    tells = np.ptp(density, axis=(0, 1)) > 0.0
    draws = density.shape[0] * density.shape[1]
    largest = min(1.0 - 1.0 / np.log10(draws), _GOOD_K)
    score["warning"] = bool((score.pareto_k.to_numpy()[tells] > largest).any())
    return score


def _inference_data(problem: Problem, posterior: Posterior) -> Any:
    steps = -(-posterior.chain[..., 0].size // _DRAWS)
    few = replace(
        posterior, chain=posterior.chain[::steps], log_posterior=posterior.log_posterior[::steps], derived={}
    )
    flat = few.chain.reshape(-1, few.chain.shape[-1])
    pointwise = pointwise_log_likelihood(problem, flat)
    return few.to_inference_data(pointwise.reshape(*few.chain.shape[:2], -1))


def _pointwise(member: Member, physical: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Whitened residuals of a curve at draws, and the logarithms of their deviations (N), (draws, points) each."""
    noise, time = member.noise_of(physical), member.curve.time
    contact, stiffness, force, possible = member.readings(physical, stiffness=noise.needs_stiffness)
    if not possible.all():
        raise InputError("no contact law exists at some draws; they cannot be compared")
    sigma = noise.sigma(contact, stiffness, time)
    white = noise.whiten((member.force - force) / sigma, time)
    if member.scale_is_unknown:
        size = np.sqrt(np.mean(np.square(white), axis=-1, keepdims=True))
        white, sigma = white / size, sigma * size
    return white, np.broadcast_to(noise.log_deviations(sigma, time), white.shape)
