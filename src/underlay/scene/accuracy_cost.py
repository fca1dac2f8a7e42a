"""Cost of accuracy: one scene under every solver, its error against its time.

The error is the largest relative difference from the exact contact problem solved to 1e-12, over the depths of the
curve. Times are processor times in this process: "cold" from the materials to the forces, and "held" for the forces
of a law that is already built, at the same depths. All candidates are timed in turns, and of many rounds the
shortest time is used.
"""

from __future__ import annotations

import time
import warnings
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from functools import partial

import numpy as np
import pandas as pd

from underlay._arrays import ArrayLike, FloatArray, as_finite
from underlay._given import require_given
from underlay.errors import InputError, RangeError, UnderlayWarning
from underlay.mechanics.asymptotic import blunt
from underlay.mechanics.contact_law import ContactLaw
from underlay.mechanics.indenters import PowerLawShape, abel_factor
from underlay.mechanics.published.law import published_names
from underlay.mechanics.solver import Solver
from underlay.mechanics.solvers import AnySolver, Asymptotic, Auto, Exact, HalfSpace, Published, as_solver
from underlay.scene.scene import Scene

# The law relative to which errors are measured.
_REFERENCE = Exact(1e-12)
# Tolerances at which the exact law, and `Auto`, are compared.
_EXACT_RTOLS = (1e-1, 1e-2, 1e-3, 1e-4, 1e-6, 1e-8, 1e-10)
_AUTO_RTOLS = (1e-2, 1e-4, 1e-6)
# Number of timing rounds, and of depths of a curve for which only the largest depth is given.
_ROUNDS = 15
_POINTS = 1000


@dataclass
class _Trial:
    """One solver in the comparison: its law, or why there is none, and its times (s), cold and held."""

    solver: Solver
    law: ContactLaw | None = None
    note: str = ""
    cold: float = np.inf
    held: float = np.inf


def accuracy_cost(
    scene: Scene, depth: ArrayLike, *, solvers: Iterable[AnySolver] | None = None, rounds: int = _ROUNDS
) -> pd.DataFrame:
    """Compute one curve by every solver, with the error and the time of each.

    Parameters
    ----------
    scene : Scene
        The test; only its contact is used, not its instrument.
    depth : float or array_like, shape (n,)
        Depths (m) since contact, positive; a single number stands for 1000 depths up to it.
    solvers : iterable of Solver or str, optional
        What to compare; by default the half-space, every order and form of the asymptotic law, the exact law and
        ``Auto`` at several tolerances, and the published corrections for this tip and base.
    rounds : int, default 15
        How often each is timed; the shortest is reported.

    Returns
    -------
    pandas.DataFrame
        One row per solver, sorted by error: ``method``, ``form``, ``order``, ``rtol`` (the solver's tolerance),
        ``nodes`` (of the exact law), ``error``, ``error_radius``, ``error_stiffness`` (largest relative error of
        force, contact radius and stiffness; NaN where the solver does not apply), ``error_estimate`` (the law's
        own), ``cold_seconds``, ``held_seconds``, ``cold_ratio``, ``held_ratio`` (to the explicit formula),
        ``pareto`` (no other solver is both more accurate and faster from cold), ``pareto_held``, ``note``.
        ``.attrs`` holds ``unit_seconds``, ``points`` and ``a_over_h``.

    Raises
    ------
    InputError
        If the scene has no layer effect, or a depth is not positive.
    RangeError
        If the exact law cannot reach the deepest point.
    """
    require_given(scene, "scene", Scene)
    depths = _depths(depth)
    if not scene.contact.layered:
        raise InputError("this scene is a half-space: every solver is the same formula and costs the same")
    deepest = float(depths.max())
    reference = scene.contact_law(deepest, solver=_REFERENCE)
    trials = [_Trial(as_solver(given)) for given in (compared_solvers() if solvers is None else solvers)]
    for trial in trials:
        _build(trial, scene, deepest)
    # A correction for another tip or base does not apply to this scene.
    trials = [trial for trial in trials if trial.law is not None or trial.note]
    formula = explicit_formula(scene)
    unit = _time_in_turns(trials, scene, depths, formula, rounds)
    table = pd.DataFrame([_row(trial, reference, depths, unit) for trial in trials])
    table["pareto"] = _pareto(table["error"], table["cold_ratio"])
    table["pareto_held"] = _pareto(table["error"], table["held_ratio"])
    table = table.sort_values("error", ignore_index=True)
    table.attrs |= {
        "unit_seconds": unit,
        "points": depths.size,
        "a_over_h": float(reference.contact_radius(deepest)) / scene.layer.thickness,
    }
    return table


def explicit_formula(scene: Scene) -> Callable[[FloatArray], FloatArray]:
    """Return the explicit force, equation (5.9) of Argatov and Sabina, in plain numpy: its time is the unit.

    The result maps depths (m), (n,), to forces (N). A shape that is no power law takes the formula of a paraboloid
    one thickness in radius, which takes the same time.
    """
    tip = scene.indenter
    exponent, coefficient = (
        (tip.exponent, tip.coefficient)
        if isinstance(tip, PowerLawShape)
        else (2.0, 0.5 / scene.layer.thickness)
    )
    a_0, a_1 = scene.contact.kernel.coefficients(2) if scene.contact.layered else (0.0, 0.0)
    c_1, c_2, c_3, c_4 = (float(c) for c in blunt.force_coefficients(exponent, float(a_0), float(a_1)))
    scale = float(
        scene.layer.material.theta * coefficient ** (-1.0 / exponent) * blunt.force_factor(exponent)
    )
    to_varpi = (coefficient * float(abel_factor(exponent))) ** (-1.0 / exponent) / scene.layer.thickness

    def force(depth: FloatArray) -> FloatArray:
        root = np.sqrt(depth) if exponent == 2.0 else depth ** (1.0 / exponent)
        v = root * to_varpi
        factor = 1.0 + c_1 * v + c_2 * v * v + c_3 * v * v * v + c_4 * v * v * v * v
        return np.asarray(scale * depth * root * factor)

    return force


def _depths(depth: ArrayLike) -> FloatArray:
    given = as_finite(depth, "depth")
    if not (given > 0.0).all():
        raise InputError(f"accuracy_cost needs positive depths since contact; got {given.min():.6g} m")
    return np.linspace(0.0, float(given), _POINTS + 1)[1:] if given.ndim == 0 else given.ravel()


def compared_solvers() -> list[Solver]:
    """Solvers that are compared by default."""
    return [
        HalfSpace(),
        *(
            Asymptotic(order, form)
            for form in ("explicit", "parametric", "compliance")
            for order in (1, 2, 3, 4)
        ),
        *(Exact(rtol) for rtol in _EXACT_RTOLS),
        *(Auto(rtol) for rtol in _AUTO_RTOLS),
        *(Published(name) for name in published_names()),
    ]


def _build(trial: _Trial, scene: Scene, deepest: float) -> None:
    """Build the law of a trial, or note why it has none; nothing of both where it is for another tip or base."""
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always", UnderlayWarning)
        try:
            trial.law = scene.contact_law(deepest, solver=trial.solver)
        except RangeError as error:
            trial.note = str(error)
        except InputError:
            return
    trial.note = trial.note or "; ".join(str(entry.message) for entry in caught)


def _time_in_turns(
    trials: list[_Trial],
    scene: Scene,
    depths: FloatArray,
    formula: Callable[[FloatArray], FloatArray],
    rounds: int,
) -> float:
    """Time all trials in turns and store the shortest times (s) in them; returns the shortest of `formula`."""
    deepest = float(depths.max())
    unit = np.inf
    with warnings.catch_warnings():
        # The warnings were collected when the laws were built.
        warnings.simplefilter("ignore", UnderlayWarning)
        for _ in range(rounds):
            unit = min(unit, _seconds(lambda: formula(depths)))
            for trial in trials:
                if (law := trial.law) is not None:
                    trial.cold = min(trial.cold, _seconds(_cold(trial.solver, scene, deepest, depths)))
                    trial.held = min(trial.held, _seconds(partial(law.force, depths)))
    return unit


def _cold(solver: Solver, scene: Scene, deepest: float, depths: FloatArray) -> Callable[[], FloatArray]:
    return lambda: scene.contact_law(deepest, solver=solver).force(depths)


def _seconds(call: Callable[[], object]) -> float:
    start = time.process_time()
    call()
    return time.process_time() - start


def _row(trial: _Trial, reference: ContactLaw, depths: FloatArray, unit: float) -> dict[str, object]:
    solver, law = trial.solver, trial.law
    asked = solver.numbers
    cold, held = (np.nan, np.nan) if law is None else (trial.cold, trial.held)
    return {
        "method": solver.name,
        "form": asked.get("form", ""),
        "order": asked.get("order"),
        "rtol": solver.tolerance or None,
        "nodes": None if law is None else law.nodes,
        "error": _error(law, reference, depths, ContactLaw.force),
        "error_radius": _error(law, reference, depths, ContactLaw.contact_radius),
        "error_stiffness": _error(law, reference, depths, ContactLaw.stiffness),
        "error_estimate": np.nan if law is None else law.error_estimate,
        "cold_seconds": cold,
        "held_seconds": held,
        "cold_ratio": cold / unit,
        "held_ratio": held / unit,
        "note": trial.note or (law.reason if law is not None else ""),
    }


def _error(
    law: ContactLaw | None,
    reference: ContactLaw,
    depths: FloatArray,
    quantity: Callable[[ContactLaw, FloatArray], FloatArray],
) -> float:
    """Largest relative error of a quantity of a law over the depths; NaN where the law does not reach them."""
    if law is None:
        return np.nan
    try:
        found = quantity(law, depths)
    except RangeError:
        return np.nan
    return float(np.abs(found / quantity(reference, depths) - 1.0).max())


def _pareto(error: pd.Series[float], cost: pd.Series[float]) -> pd.Series[bool]:
    """Whether no other row has both a smaller error and a smaller cost."""
    by_cost = error[cost[error.notna()].sort_values().index]
    least_before = by_cost.cummin().shift(fill_value=np.inf)
    return (by_cost < least_before).reindex(error.index, fill_value=False)
