"""Table of physical effects in a scene: how large each is, whether it is simulated, and its computing time.

Size and cost compare the force with the effect to the force without it (`effect_rules`).
"""

from __future__ import annotations

import time
from collections.abc import Iterable

import numpy as np
import pandas as pd

from underlay._arrays import FloatArray, positive
from underlay.errors import InputError
from underlay.mechanics.contact_law import ContactLaw
from underlay.mechanics.solver import Solver
from underlay.mechanics.solvers import AnySolver, as_solver
from underlay.scene.effect_rules import Effect, EffectRule, Simulated, effects_of, range_asked

# Columns of the table.
_COLUMNS = ("effect", "size_percent", "simulated", "cost_percent", "note")
# Number of depths of the curves on which the cost of an effect is timed, from cold, with and without it in turns.
_COST_POINTS = 200
# Number of timing rounds; the shortest processor time is used.
_COST_ROUNDS = 25
# Time (s) beyond which a curve is timed once.
_LONG = 0.2
# Relative size below which an effect is rounding.
_ROUNDING = 1e3 * np.finfo(float).eps


def effects_table(
    scene: Simulated, max_depth: float, solver: AnySolver = "auto", further: Iterable[EffectRule] = ()
) -> pd.DataFrame:
    """List every effect of `scene` at tip depth `max_depth` (m), with its size and cost.

    Parameters
    ----------
    scene : Scene
        The test.
    max_depth : float
        Deepest point (m) since contact, positive.
    solver : Solver or str, default "auto"
        Which contact law; see `contact_law`. An effect below its tolerance is marked.
    further : iterable of callable
        Effects of your own: each takes the scene and its law and returns an `Effect`.

    Returns
    -------
    pandas.DataFrame
        One row per effect: ``effect``; ``size_percent``, the change of the force at the deepest point by the
        effect, in per cent of the force without it (NaN where the scene does not determine it); ``simulated``
        (bool), whether its code runs for this scene; ``cost_percent``, the time it adds to a curve of 200 depths
        from cold, in per cent of the curve without it; ``note``. Size and cost are NaN too where the scene without
        the effect has no law to that depth. The law that is used and its reason are in ``.attrs["law"]``.

    Raises
    ------
    InputError
        If `max_depth` is not positive.
    RangeError
        If no law reaches `max_depth`.
    """
    wanted = as_solver(solver)
    deepest = positive(max_depth, "max_depth", "m")
    law = scene.contact_law(deepest, solver=wanted)
    found = (*effects_in(scene, law, wanted), *(rule(scene, law) for rule in further))
    table = pd.DataFrame([_row(effect, deepest, wanted) for effect in found])
    table.attrs["law"] = f"{law.method}: {law.reason}"
    return table


def effects_in(scene: Simulated, law: ContactLaw, solver: Solver) -> list[Effect]:
    """All effects of a scene, and a row on the range of attraction that a solver implies.

    Parameters
    ----------
    scene : Scene
        The test.
    law : ContactLaw
        Law that simulates its contact.
    solver : Solver
        What built that law.
    """
    return [*effects_of(scene, law), *range_asked(scene, solver)]


def effect_sizes(scene: Simulated, depth: FloatArray, solver: AnySolver = "auto") -> pd.DataFrame:
    """Size of every effect against depth, for the effects that can be computed over the whole range.

    Parameters
    ----------
    scene : Scene
        The test.
    depth : ndarray, shape (n,)
        Depths (m) since contact, positive and increasing.
    solver : Solver or str, default "auto"
        Which contact law; see `contact_law`.

    Returns
    -------
    pandas.DataFrame
        ``depth`` (m) and one column per effect: the relative change of the force by it.
    """
    wanted = as_solver(solver)
    law = scene.contact_law(float(depth[-1]), solver=wanted)
    known = {}
    for effect in effects_of(scene, law):
        try:
            size = _size(effect, depth, wanted)
        except InputError:
            continue  # the scene without the effect has no law to this depth: no size along the curve
        if np.isfinite(size).all():
            known[effect.name] = size
    return pd.DataFrame({"depth": depth, **known})


def _row(effect: Effect, deepest: float, solver: Solver) -> dict[str, object]:
    note = effect.note if effect.note_at is None else effect.note_at(deepest)
    row = {"effect": effect.name, "simulated": effect.simulated, "note": note}
    try:
        size = float(_size(effect, np.array([deepest]), solver)[0])
        cost = _added_cost(effect, deepest, solver) if effect.simulated else 0.0
    except InputError as error:
        size, cost, row["note"] = np.nan, np.nan, f"not measured: {error}"
    if effect.simulated and abs(size) < solver.tolerance:
        row["note"] = f"{effect.note}; below rtol = {solver.tolerance:g} here"
    numbers = {"size_percent": 100.0 * size, "cost_percent": cost}
    return {key: (row | numbers)[key] for key in _COLUMNS}


def _size(effect: Effect, depth: FloatArray, solver: Solver) -> FloatArray:
    """Relative change of the force by an effect at tip depths (m), (n,); NaN where unknown."""
    if effect.excess is not None:
        return effect.excess(depth)
    if effect.with_it is None or effect.without is None:
        return np.full(depth.shape, np.nan)
    if effect.duration is not None:
        along, clock = _ramp(effect, float(depth.max()))
        sizes = effect.with_it.force(along, clock, solver=solver)[1:]
        sizes = sizes / effect.without.force(along, solver=solver)[1:] - 1.0
        return np.interp(depth, along[1:] - along[0], sizes)
    readings = depth + effect.with_it.instrument.contact_depth
    with_it = effect.with_it.force(readings, solver=solver)
    change = np.asarray(with_it / effect.without.force(readings, solver=solver) - 1.0)
    # Two laws of one contact may agree to rounding: friction has no effect on an incompressible half-space.
    return np.where(np.abs(change) > _ROUNDING, change, 0.0)


def _added_cost(effect: Effect, deepest: float, solver: Solver) -> float:
    """Computing time that an effect adds to a curve, in per cent of the time without it."""
    if effect.with_it is None or effect.without is None:
        return 0.0
    depth, clock = _ramp(effect, deepest)
    with_it = without = np.inf
    for _ in range(_COST_ROUNDS):
        start = time.process_time()
        effect.with_it.force(depth, clock, solver=solver)
        middle = time.process_time()
        effect.without.force(depth, solver=solver)
        with_it = min(with_it, middle - start)
        without = min(without, time.process_time() - middle)
        if with_it > _LONG:
            break
    return 100.0 * (with_it / without - 1.0)


def _ramp(effect: Effect, deepest: float) -> tuple[FloatArray, FloatArray | None]:
    """Depth readings (m) from contact to `deepest` (m), and their times (s) for an effect that depends on time."""
    first = 0.0 if effect.with_it is None else effect.with_it.instrument.contact_depth
    depth = np.linspace(0.0, deepest, _COST_POINTS) + first
    clock = None if effect.duration is None else np.linspace(0.0, effect.duration, _COST_POINTS)
    return depth, clock
