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
from underlay.errors import InputError, UnderlayWarning
from underlay.inference.answer_cost import CONTACT, MODULUS, THICKNESS, OwnCurve, timed
from underlay.inference.least_squares import fit
from underlay.inference.priors.densities import LogUniform, Uniform
from underlay.inference.problem import Problem
from underlay.inference.sampling.run import sample
from underlay.mechanics.solvers import Exact
from underlay.scene.scene import Scene

__all__ = ["posterior_cost"]

# Lengths of the chains, and the quantiles that are compared.
_STEPS = (50, 100, 200, 400, 800)
_LEVELS = (0.05, 0.5, 0.95)
_FROM_MEDIAN = 1.6449  # standard deviations to the outer ones, where a posterior is normal
_RTOL = 1e-4  # a fiftieth of the noise
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
        95 % quantiles of modulus and thickness from those of a converged chain, in its standard deviations),
        ``seconds`` and ``ratio`` (to lmfit's fit of Hertz's formula). ``.attrs["reference_error"]`` is half of
        what the two halves of the converged chain differ by, which is its own error: none below it can be told.

    Raises
    ------
    InputError
        If the scene has no layer effect or `max_depth` is not positive.
    """
    if not scene.contact.layered:
        raise InputError("this scene is a half-space: its thickness has no posterior")
    own = OwnCurve.of(scene, max_depth, seed)
    problem = _problem(own, max_depth)
    rows: list[tuple[str, float, float, float]] = []
    with warnings.catch_warnings():
        # Chains that are too short are what is shown.
        warnings.simplefilter("ignore", UnderlayWarning)
        longest = _drawn(problem, rng=seed + 1)
        truth, spread = _quantiles(longest), longest.std(axis=(0, 1))
        first, second = (_quantiles(half) for half in np.array_split(longest, 2))
        found, seconds = timed(lambda: fit(problem))
        normal = [
            [found.values[name] + sign * _FROM_MEDIAN * found.stderr[name] for name in (MODULUS, THICKNESS)]
            for sign in (-1.0, 0.0, 1.0)
        ]
        rows.append(("fit", np.nan, _off(np.array(normal), truth, spread), seconds))
        for count in steps:
            chain, seconds = timed(partial(_drawn, problem, rng=seed, max_steps=count))
            rows.append(("emcee", float(count), _off(_quantiles(chain), truth, spread), seconds))
        for way in _ways_of_sampling():
            chain, seconds = timed(partial(_drawn, problem, rng=seed, method=way))
            rows.append((way, np.nan, _off(_quantiles(chain), truth, spread), seconds))
    table = pd.DataFrame(rows, columns=["way", "steps", "error", "seconds"])
    table["ratio"] = table["seconds"] / own.unit
    table.attrs |= {"unit_seconds": own.unit, "reference_error": 0.5 * _off(first, second, spread)}
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
