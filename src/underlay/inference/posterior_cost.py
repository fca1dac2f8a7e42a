"""What a posterior costs: the error of its quantiles against the time of the sampling, for one curve."""

from __future__ import annotations

import inspect
import warnings
from collections.abc import Iterable
from functools import partial
from typing import Any

import numpy as np
import pandas as pd

from underlay._arrays import FloatArray
from underlay._given import require_given
from underlay.errors import FitError, InputError, UnderlayWarning
from underlay.inference.answer_cost import CONTACT, MODULUS, THICKNESS, OwnCurve, timed
from underlay.inference.least_squares import fit
from underlay.inference.priors.densities import LogUniform, Uniform
from underlay.inference.problem import Problem
from underlay.inference.sampling.run import sample
from underlay.mechanics.solvers import Exact
from underlay.scene.scene import Scene

__all__ = ["posterior_cost"]

# Lengths of the chains, and the quantiles that are compared.
_STEPS = (50, 100, 200, 400)
_LEVELS = (0.05, 0.5, 0.95)
_FROM_MEDIAN = 1.6449  # standard deviations to the outer ones, where a posterior is normal
_RTOL = 1e-4  # a fiftieth of the noise
# Runs whose means all are compared with.
_REFERENCES = 4
# Priors reach this factor to either side of the scene's values.
_WIDE = 30.0
#: Ways to draw a posterior beside walkers by their steps: names that `sample` may know as its `method`.
_FURTHER_WAYS = ("importance", "ridge")


def posterior_cost(
    scene: Scene, max_depth: float, *, steps: Iterable[int] = _STEPS, seed: int = 0
) -> pd.DataFrame:
    """Sample modulus, thickness and contact of a scene's own noisy curve in several ways.

    Parameters
    ----------
    scene : Scene
        The test, with a layer on something.
    max_depth : float
        Deepest point (m) since contact.
    steps : iterable of int
        Lengths of the chains of walkers that are compared.
    seed : int, default 0
        Of the curve's noise and of the walkers.

    Returns
    -------
    pandas.DataFrame
        One row per way: ``way`` (``"fit"``, the normal of the least-squares fit; ``"emcee"``, by its steps; and
        every further `method` that `sample` knows), ``steps``, ``error`` (largest difference of the 5, 50 and
        95 % quantiles of modulus and thickness from the means of four other runs, in standard deviations),
        ``seconds`` and ``ratio`` (to lmfit's fit of Hertz's formula). ``.attrs["reference_error"]`` is the largest
        standard error of those means, by how the four differ: no error below it can be told.

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
        # Chains that are too short are what is shown.
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
        for way in _ways_of_sampling():
            chain, seconds = timed(partial(_drawn, problem, rng=seed, method=way))
            rows.append((way, np.nan, _off(_quantiles(chain), truth, spread), seconds))
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
    """Runs that share nothing but the problem: weighted draws, or converged chains where these are not accepted."""
    seeds = range(seed + 1, seed + 1 + _REFERENCES)
    try:
        return [_drawn(problem, rng=one, method="importance") for one in seeds]
    except FitError:
        return [_drawn(problem, rng=one, method="emcee") for one in seeds]


def _drawn(problem: Problem, **asked: Any) -> FloatArray:
    """Modulus and thickness (SI) of a chain, (draws, walkers, 2)."""
    posterior = sample(problem, progress=False, **asked)
    which = [posterior.names.index(name) for name in (MODULUS, THICKNESS)]
    return posterior.chain[..., which]


def _ways_of_sampling() -> list[str]:
    """Those of the further ways that this version of `sample` knows."""
    known = inspect.signature(sample).parameters.get("method")
    told = "" if known is None else str(sample.__doc__)
    return [way for way in _FURTHER_WAYS if f'"{way}"' in told]


def _quantiles(chain: FloatArray) -> FloatArray:
    """(levels, parameters)."""
    return np.quantile(chain.reshape(-1, chain.shape[-1]), _LEVELS, axis=0)


def _off(quantiles: FloatArray, truth: FloatArray, spread: FloatArray) -> float:
    return float((np.abs(quantiles - truth) / spread).max())
