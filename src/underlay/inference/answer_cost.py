"""What accuracy costs, for the answer: how far off modulus and thickness are, against the time of the whole fit.

The curve is the scene's own: made by the exact law to 1e-10, without noise, so that what a fit is off by is the
model's doing and no chance. Its noise is stated all the same, 0.5 % of the largest force, as a measured curve's
would be. Modulus and contact are fitted with the thickness known; then modulus, thickness and contact together.
Times are processor times, from the problem to the result; of several the shortest counts. Their unit is lmfit's
fit of Hertz's formula to the same points.
"""

from __future__ import annotations

import time
import warnings
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import pandas as pd

from underlay._arrays import positive
from underlay._given import require_given
from underlay.data.curve import Curve
from underlay.errors import InputError, UnderlayError, UnderlayWarning
from underlay.inference.least_squares import fit
from underlay.inference.plain_hertz import plain_hertz_fit
from underlay.inference.problem import Problem
from underlay.mechanics.solver import Solver
from underlay.mechanics.solvers import AnySolver, Exact, as_solver
from underlay.scene.accuracy_cost import compared_solvers
from underlay.scene.effect import Effect
from underlay.scene.effects import effects_in
from underlay.scene.noise import Noise
from underlay.scene.scene import Scene

__all__ = ["CONTACT", "MODULUS", "THICKNESS", "OwnCurve", "answer_cost", "effects_on_answers", "timed"]

MODULUS, THICKNESS, CONTACT = "layer.E", "layer.thickness", "instrument.contact_depth"
_TRUTH = Exact(1e-10)
_POINTS = 400
# Readings begin this share of the depth before contact; the noise is this share of the largest force.
_BEFORE, _NOISE = 0.15, 0.005
_ROUNDS = 3
_LONG = 0.3  # s: what takes longer is timed once


@dataclass(frozen=True)
class OwnCurve:
    """What a scene would measure, and what one plain fit of it takes.

    Parameters
    ----------
    scene : Scene
        Without baseline and memory.
    curve : Curve
        Its curve.
    noise : Noise
        What is stated of it.
    unit : float
        Time (s) of lmfit's fit of Hertz's formula.
    """

    scene: Scene
    curve: Curve
    noise: Noise
    unit: float

    @classmethod
    def of(cls, scene: Scene, max_depth: float, seed: int | None = None) -> OwnCurve:
        """Make the curve of `scene` up to `max_depth` (m) since contact, with noise where there is a seed."""
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
    """What a call answers, and the shortest processor time (s) of so many; one that is long is made once."""
    best = np.inf
    for _ in range(rounds):
        start = time.process_time()
        answer = call()
        best = min(best, time.process_time() - start)
        if best > _LONG:
            break
    return answer, best


def answer_cost(
    scene: Scene, max_depth: float, *, solvers: Iterable[AnySolver] | None = None, rounds: int = _ROUNDS
) -> pd.DataFrame:
    """Fit a scene's own curve by every solver: what modulus and thickness are off by, and what the fit takes.

    Parameters
    ----------
    scene : Scene
        The test, with a layer on something.
    max_depth : float
        Deepest point (m) since contact.
    solvers : iterable of Solver or str, optional
        What to compare; by default what `accuracy_cost` does.
    rounds : int, default 3
        How often a fit is timed; the shortest counts.

    Returns
    -------
    pandas.DataFrame
        One row per solver with a law here: ``method``, ``form``, ``order``, ``rtol`` and ``nodes`` (empty) as in
        `accuracy_cost`; ``E_error``, the fitted modulus over the true one, less one, with the thickness known,
        ``seconds`` and ``ratio`` (to lmfit's fit of Hertz's formula); ``E_error_joint``, ``thickness_error``,
        ``joint_seconds`` and ``joint_ratio`` where the thickness is fitted too, NaN where the law does not feel it.
        ``.attrs`` holds ``unit_seconds`` and ``points``.

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
        together = (MODULUS, THICKNESS, CONTACT)
        joint = _answer(own, own.scene, together, solver, rounds) if solver.sees_base else _NOTHING
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
    """Leave each effect of a scene out of the fit: what modulus and thickness are then, and what the fit saves.

    Parameters
    ----------
    scene : Scene
        The test.
    max_depth : float
        Deepest point (m) since contact.
    solver : Solver or str, default "auto"
        Which contact law.

    Returns
    -------
    pandas.DataFrame
        One row per effect: ``effect``; ``E_percent``, what leaving it out does to the fitted modulus, with the
        thickness known; ``h_percent``, what to the thickness fitted beside the modulus; ``fit_cost_percent``, the
        time it adds to the fit of modulus and contact. NaN where there is no such fit, or where it acts in time.
    """
    deepest, wanted = positive(max_depth, "max_depth", "m"), as_solver(solver)
    law = scene.contact_law(deepest, solver=wanted)
    rows = [
        {"effect": effect.name, **_left_out(effect, deepest, wanted)}
        for effect in effects_in(scene, law, wanted)
    ]
    return pd.DataFrame(rows)


def _left_out(effect: Effect, deepest: float, solver: Solver) -> dict[str, float]:
    """The numbers of one row."""
    with_it, without = effect.with_it, effect.without
    nothing = dict.fromkeys(("E_percent", "h_percent", "fit_cost_percent"), np.nan)
    if not (isinstance(with_it, Scene) and isinstance(without, Scene)) or effect.duration is not None:
        return nothing
    try:
        own = OwnCurve.of(with_it, deepest)
    except UnderlayError:
        return nothing
    # A baseline is an effect: it is in the curve, and not in the fit that leaves it out.
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
    """What one fit says over the truth, less one, and its time (s); NaN where there is none."""

    modulus: float = np.nan
    thickness: float = np.nan
    seconds: float = np.nan


_NOTHING = _Answer()


def _answer(own: OwnCurve, model: Scene, free: Sequence[str], solver: Solver, rounds: int) -> _Answer:
    """Fit a curve with a model in the place of its scene."""
    truth = own.scene.parameters
    with warnings.catch_warnings():
        # A correction outside its range, a misfit: that is what is measured here.
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
