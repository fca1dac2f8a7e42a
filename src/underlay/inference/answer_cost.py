"""Cost of accuracy, for fits and posteriors: errors of fitted numbers against processor time.

For a fit (`answer_cost`) it is the error of modulus and thickness, against the time of the whole fit. The curve is
simulated from the scene itself by the exact law to 1e-10, without noise, so that the error is that of the model
alone. A noise is stated all the same, 0.5 % of the largest force, as for a measured curve. Modulus and contact are
fitted with the thickness known; then modulus, thickness and contact together. For the posterior (`posterior_cost`)
it is the error of its quantiles against the time of the sampling, for one curve.

Times are processor times, from the problem to the result; the shortest of several is used. Their unit is the time
of a fit of Hertz's formula to the same points by lmfit (`plain_hertz_fit`).
"""

from __future__ import annotations

import time
import warnings
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, replace
from functools import partial
from typing import Any

import lmfit
import numpy as np
import pandas as pd

from underlay._arrays import FloatArray, positive
from underlay._given import require_given
from underlay.data.curve import Curve
from underlay.errors import FitError, InputError, UnderlayError, UnderlayWarning
from underlay.inference.least_squares import fit
from underlay.inference.priors import LogUniform, Uniform
from underlay.inference.problem import Problem
from underlay.inference.sampling.run import sample
from underlay.mechanics.solver import Solver
from underlay.mechanics.solvers import AnySolver, Exact, as_solver
from underlay.scene.accuracy_cost import compared_solvers
from underlay.scene.effects import Effect, effects_in
from underlay.scene.noise import Noise
from underlay.scene.scene import Scene

#: Paths of the parameters that are fitted.
MODULUS, THICKNESS, CONTACT = "layer.E", "layer.thickness", "instrument.contact_depth"
# The law that simulates a scene's own curve, and the number of its readings.
_TRUTH = Exact(1e-10)
_POINTS = 400
# Readings begin this share of the depth before contact; the noise is this share of the largest force.
_BEFORE, _NOISE = 0.15, 0.005
# Number of times that a fit is timed, and the time (s) beyond which it is timed once.
_ROUNDS = 3
_LONG = 0.3
# Lengths of the chains that are compared, and probabilities of the compared quantiles.
_STEPS = (50, 100, 200, 400)
_LEVELS = (0.05, 0.5, 0.95)
_FROM_MEDIAN = 1.6449  # standard deviations to the outer quantiles, where a posterior is normal
_RTOL = 1e-4  # relative tolerance of the law of a posterior: a fiftieth of the noise
# Number of runs whose means are the reference for all others.
_REFERENCES = 4
# Factor between the scene's values and the bounds of the priors.
_WIDE = 30.0


def answer_cost(
    scene: Scene, max_depth: float, *, solvers: Iterable[AnySolver] | None = None, rounds: int = _ROUNDS
) -> pd.DataFrame:
    """Fit a scene's simulated curve by every solver: errors of modulus and thickness, and the time of the fit.

    Parameters
    ----------
    scene : Scene
        The test, with a layer on a base.
    max_depth : float
        Largest indentation depth (m).
    solvers : iterable of Solver or str, optional
        What to compare; by default what `accuracy_cost` does.
    rounds : int, default 3
        How often a fit is timed; the shortest time is used.

    Returns
    -------
    pandas.DataFrame
        One row per solver with a law here: ``method``, ``form``, ``order``, ``rtol`` and ``nodes`` (empty) as in
        `accuracy_cost`; ``E_error``, the fitted modulus over the true one, less one, with the thickness known,
        ``seconds`` and ``ratio`` (to lmfit's fit of Hertz's formula); ``E_error_joint``, ``thickness_error``,
        ``joint_seconds`` and ``joint_ratio`` where the thickness is fitted too, NaN where the law does not depend
        on it. ``.attrs`` holds ``unit_seconds`` and ``points``.

    Raises
    ------
    InputError
        If the scene has no layer effect or `max_depth` is not positive.
    RangeError
        If the exact law cannot reach `max_depth`.
    """
    require_given(scene, "scene", Scene)
    if not scene.contact.layered:
        raise InputError("this scene is a half-space: every solver gives the same modulus")
    own = OwnCurve.of(scene, max_depth)
    rows = []
    for solver in map(as_solver, compared_solvers() if solvers is None else solvers):
        alone = _answer(own, own.scene, (MODULUS, CONTACT), solver, rounds)
        if np.isnan(alone.modulus):
            continue
        jointly_free = (MODULUS, THICKNESS, CONTACT)
        joint = _answer(own, own.scene, jointly_free, solver, rounds) if solver.sees_base else _NOTHING
        asked = solver.numbers
        rows.append(
            {
                "method": solver.name,
                "form": asked.get("form", ""),
                "order": asked.get("order"),
                "rtol": solver.tolerance or None,
                "nodes": None,
                "E_error": alone.modulus,
                "seconds": alone.seconds,
                "ratio": alone.seconds / own.unit,
                "E_error_joint": joint.modulus,
                "thickness_error": joint.thickness,
                "joint_seconds": joint.seconds,
                "joint_ratio": joint.seconds / own.unit,
            }
        )
    table = pd.DataFrame(rows)
    table.attrs |= {"unit_seconds": own.unit, "points": len(own.curve)}
    return table


def effects_on_answers(scene: Scene, max_depth: float, solver: AnySolver = "auto") -> pd.DataFrame:
    """Leave each effect of a scene out of the fit: changes of modulus and thickness, and time saved.

    Parameters
    ----------
    scene : Scene
        The test.
    max_depth : float
        Largest indentation depth (m).
    solver : Solver or str, default "auto"
        Which contact law.

    Returns
    -------
    pandas.DataFrame
        One row per effect: ``effect``; ``E_percent``, the change of the fitted modulus when it is left out, with
        the thickness known; ``h_percent``, that of the thickness fitted together with the modulus;
        ``fit_cost_percent``, the time it adds to the fit of modulus and contact. NaN where there is no such fit, or
        the effect depends on time.
    """
    deepest, wanted = positive(max_depth, "max_depth", "m"), as_solver(solver)
    law = scene.contact_law(deepest, solver=wanted)
    rows = [
        {"effect": effect.name, **_left_out(effect, deepest, wanted)}
        for effect in effects_in(scene, law, wanted)
    ]
    return pd.DataFrame(rows)


def _left_out(effect: Effect, deepest: float, solver: Solver) -> dict[str, float]:
    """Cells of one row of `effects_on_answers`, by column."""
    with_it, without = effect.with_it, effect.without
    nothing = dict.fromkeys(("E_percent", "h_percent", "fit_cost_percent"), np.nan)
    if not (isinstance(with_it, Scene) and isinstance(without, Scene)) or effect.duration is not None:
        return nothing
    try:
        own = OwnCurve.of(with_it, deepest)
    except UnderlayError:
        return nothing
    # A baseline is an effect: the curve has it, and the fit that leaves it out does not.
    force = with_it.force(own.curve.depth, solver=solver)
    own = replace(own, scene=with_it, curve=Curve(own.curve.depth, force))
    full = _answer(own, with_it, (MODULUS, CONTACT), solver, _ROUNDS)
    less = _answer(own, without, (MODULUS, CONTACT), solver, _ROUNDS)
    joint = (
        _answer(own, without, (MODULUS, THICKNESS, CONTACT), solver, 1)
        if without.contact.layered
        else _NOTHING
    )
    return {
        "E_percent": 100.0 * less.modulus,
        "h_percent": 100.0 * joint.thickness,
        "fit_cost_percent": 100.0 * (full.seconds / less.seconds - 1.0),
    }


@dataclass(frozen=True)
class _Answer:
    """Relative errors of modulus and thickness of one fit, and its time (s); NaN where there is none."""

    modulus: float = np.nan
    thickness: float = np.nan
    seconds: float = np.nan


_NOTHING = _Answer()  # result for a fit that cannot be made


def _answer(own: OwnCurve, model: Scene, free: Sequence[str], solver: Solver, rounds: int) -> _Answer:
    """Fit the simulated curve of a scene with another model, `model`, and return errors and time."""
    truth = own.scene.parameters
    with warnings.catch_warnings():
        # A correction outside its range, or a misfit, is what is measured here.
        warnings.simplefilter("ignore", UnderlayWarning)
        try:
            found, seconds = timed(
                lambda: fit(Problem(model, own.curve, free, noise=own.noise, solver=solver)), rounds
            )
        except UnderlayError:
            return _NOTHING
    values: dict[str, float] = found.values
    thickness = values[THICKNESS] / truth[THICKNESS] - 1.0 if THICKNESS in free else np.nan
    return _Answer(values[MODULUS] / truth[MODULUS] - 1.0, thickness, seconds)


def posterior_cost(
    scene: Scene, max_depth: float, *, steps: Iterable[int] = _STEPS, seed: int = 0
) -> pd.DataFrame:
    """Sample modulus, thickness and contact of a scene's own noisy curve by several methods.

    Parameters
    ----------
    scene : Scene
        The test, with a layer on a base.
    max_depth : float
        Largest indentation depth (m).
    steps : iterable of int
        Lengths of the chains of walkers that are compared.
    seed : int, default 0
        Seed of the curve's noise and of the walkers.

    Returns
    -------
    pandas.DataFrame
        One row per method: ``way`` (``"fit"``, the normal of the least-squares fit; ``"emcee"``, by its steps; and
        every further `method` that `sample` offers), ``steps``, ``error`` (largest difference of the 5, 50 and 95 %
        quantiles of modulus and thickness from the means of four other runs, in standard deviations), ``seconds``
        and ``ratio`` (to lmfit's fit of Hertz's formula). ``.attrs["reference_error"]`` is the largest standard
        error of those means, from the scatter of the four: smaller errors cannot be resolved.

    Raises
    ------
    InputError
        If the scene has no layer effect or `max_depth` is not positive.
    """
    require_given(scene, "scene", Scene)
    if not scene.contact.layered:
        raise InputError("this scene is a half-space: its thickness has no posterior")
    own = OwnCurve.of(scene, max_depth, seed)
    problem = _problem(own, max_depth)
    rows: list[tuple[str, float, float, float]] = []
    with warnings.catch_warnings():
        # Chains that are too short are part of the comparison.
        warnings.simplefilter("ignore", UnderlayWarning)
        references = _references(problem, seed)
        known = np.array([_quantiles(draws) for draws in references])
        truth = known.mean(axis=0)
        spread = np.mean([draws.std(axis=(0, 1)) for draws in references], axis=0)
        uncertain = known.std(axis=0, ddof=1) / np.sqrt(len(known))
        found, seconds = timed(lambda: fit(problem))
        normal = [
            [found.values[name] + sign * _FROM_MEDIAN * found.stderr[name] for name in (MODULUS, THICKNESS)]
            for sign in (-1.0, 0.0, 1.0)
        ]
        rows.append(("fit", np.nan, _off(np.array(normal), truth, spread), seconds))
        for count in steps:
            chain, seconds = timed(partial(_drawn, problem, rng=seed, max_steps=count, method="emcee"))
            rows.append(("emcee", float(count), _off(_quantiles(chain), truth, spread), seconds))
        chain, seconds = timed(partial(_drawn, problem, rng=seed, method="importance"))
        rows.append(("importance", np.nan, _off(_quantiles(chain), truth, spread), seconds))
    table = pd.DataFrame(rows, columns=["way", "steps", "error", "seconds"])
    table["ratio"] = table["seconds"] / own.unit
    table.attrs |= {"unit_seconds": own.unit, "reference_error": float((uncertain / spread).max())}
    return table


def _problem(own: OwnCurve, max_depth: float) -> Problem:
    known = own.scene.parameters
    room = 0.1 * max_depth
    free = {
        MODULUS: LogUniform(known[MODULUS] / _WIDE, known[MODULUS] * _WIDE),
        THICKNESS: LogUniform(known[THICKNESS] / _WIDE, known[THICKNESS] * _WIDE),
        CONTACT: Uniform(known[CONTACT] - room, known[CONTACT] + room),
    }
    return Problem(own.scene, own.curve, free, noise=own.noise, solver=Exact(_RTOL))


def _references(problem: Problem, seed: int) -> list[FloatArray]:
    """Modulus and thickness of four independent runs: weighted draws, or converged chains if those are refused."""
    seeds = range(seed + 1, seed + 1 + _REFERENCES)
    try:
        return [_drawn(problem, rng=one, method="importance") for one in seeds]
    except FitError:
        return [_drawn(problem, rng=one, method="emcee") for one in seeds]


def _drawn(problem: Problem, **asked: Any) -> FloatArray:
    """Draws of modulus and thickness (SI) by `sample` with the given options, (draws, walkers, 2)."""
    posterior = sample(problem, progress=False, **asked)
    which = [posterior.names.index(name) for name in (MODULUS, THICKNESS)]
    return posterior.chain[..., which]


def _quantiles(chain: FloatArray) -> FloatArray:
    """Quantiles of draws (..., parameters) at the probabilities that are compared, (levels, parameters)."""
    return np.quantile(chain.reshape(-1, chain.shape[-1]), _LEVELS, axis=0)


def _off(quantiles: FloatArray, truth: FloatArray, spread: FloatArray) -> float:
    return float((np.abs(quantiles - truth) / spread).max())


@dataclass(frozen=True)
class OwnCurve:
    """The simulated curve of a scene, with the time of a plain fit of Hertz's formula to it.

    Parameters
    ----------
    scene : Scene
        The scene, without baseline and memory.
    curve : Curve
        Its simulated curve.
    noise : Noise
        The noise that is stated in fits.
    unit : float
        Time (s) of lmfit's fit of Hertz's formula.
    """

    scene: Scene
    curve: Curve
    noise: Noise
    unit: float

    @classmethod
    def of(cls, scene: Scene, max_depth: float, seed: int | None = None) -> OwnCurve:
        """Simulate the curve of `scene` to the depth `max_depth` (m), with noise where there is a seed."""
        deepest = positive(max_depth, "max_depth", "m")
        bare = replace(scene.elastic.instrument, baseline=0.0, baseline_slope=0.0)
        scene = replace(scene.elastic, instrument=bare)
        depth = np.linspace(-_BEFORE, 1.0, _POINTS) * deepest + bare.contact_depth
        force = scene.force(depth, solver=_TRUTH)
        noise = Noise(force=_NOISE * float(np.abs(force).max()))
        if seed is not None:
            force = force + np.random.default_rng(seed).normal(0.0, _NOISE * float(force.max()), force.size)
        radius = float(scene.indenter.halfspace_radius(np.array(deepest))) ** 2 / deepest
        E = 3.0 * scene.parameters[MODULUS]
        unit = timed(lambda: plain_hertz_fit(depth, force, radius, 0.5, E=E), 5)[1]
        return cls(scene, Curve(depth, force), noise, unit)


def timed(call: Callable[[], Any], rounds: int = 1) -> tuple[Any, float]:
    """Result of a call, and the shortest processor time (s) of several calls; a long call is made once."""
    best = np.inf
    for _ in range(rounds):
        start = time.process_time()
        answer = call()
        best = min(best, time.process_time() - start)
        if best > _LONG:
            break
    return answer, best


def plain_hertz_fit(
    depth: FloatArray, force: FloatArray, radius: float, nu: float, *, E: float, contact_depth: float = 0.0
) -> dict[str, float]:
    """Fit modulus, contact depth and baseline with lmfit's defaults: leastsq, its own numeric derivatives.

    P = 4 E sqrt(R) w^(3/2) / (3 (1 - nu^2)) for a paraboloid on a half-space (Hertz 1882,
    doi:10.1515/crll.1882.92.156).

    Parameters
    ----------
    depth, force : FloatArray
        Readings (m, N), (n,).
    radius : float
        Radius of the tip (m).
    nu : float
        Poisson's ratio.
    E, contact_depth : float
        Where the fit starts (Pa, m); the baseline starts at zero.

    Returns
    -------
    dict
        ``E`` (Pa), ``contact_depth`` (m), ``baseline`` (N).
    """
    scale = 4.0 / 3.0 * radius**0.5 / (1.0 - nu * nu)

    def residual(current: Any) -> FloatArray:
        w = np.maximum(depth - current["contact_depth"].value, 0.0)
        model: FloatArray = scale * current["E"].value * w**1.5 + current["baseline"].value
        return model - force

    start = lmfit.Parameters()
    start.add("E", value=E, min=0.0)
    start.add("contact_depth", value=contact_depth)
    start.add("baseline", value=0.0)
    result = lmfit.minimize(residual, start)
    return {name: float(entry.value) for name, entry in result.params.items()}
