"""What a fit stands on: how far its values move with the numbers that were taken as known.

About the optimum the fitted scaled vector q answers a change of an input x as  dq = -(J'J)^-1 J'g dx,  J the
derivatives of the whitened residuals in q, priors included, and g those in x: the implicit function theorem on
J'r = 0, curvature times residual left out, as in Gauss and Newton. No residual shows a wrong input.
"""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np

from underlay._arrays import FloatArray
from underlay.errors import UnderlayError
from underlay.inference.least_squares.fit_result import Fit
from underlay.inference.least_squares.models import freeze
from underlay.inference.least_squares.objective import Objective
from underlay.inference.problem import Problem

__all__ = ["FORCE", "sensitivity"]

#: The scale of the force: a cantilever's stiffness k, or a load cell's gain.
FORCE = "force scale"
_PARTS = ("indenter.", "layer.", "substrate.", "instrument.compliance", "adhesion.", "history.")


def sensitivity(fit: Fit) -> dict[str, dict[str, float]]:
    """d ln(value) / d ln(input) of every fitted parameter that is positive by nature.

    Returns
    -------
    dict of dict of float
        By parameter, then by the path of the input; `FORCE` is the scale of all forces. Inputs that are zero or
        infinite are left out, as are fits in which no parameter is positive by nature.
    """
    shown = [
        i
        for i, coordinate in enumerate(fit.problem.coordinates)
        if coordinate.scale is None
        and i not in fit.problem.noise_entries
        and coordinate.name not in {*fit.no_error_bars, *fit.bounds_hit}
    ]
    rows: dict[str, dict[str, float]] = {fit.names[i]: {} for i in shown}
    if not rows:
        return rows
    objective = Objective(fit.problem, freeze(fit.problem, fit.vector, fit.noises))
    held = {*fit.no_error_bars, *fit.bounds_hit}
    free = [i for i in objective.active if fit.names[i] not in held]
    jacobian = objective.jacobian(fit.vector, rough=True)
    answer = np.zeros((len(fit.names), len(jacobian)))
    answer[free] = -np.linalg.pinv(jacobian[:, free])
    moved = {name: answer @ column for name, column in _input_columns(fit).items()}
    moved[FORCE] = answer @ _force_column(fit, len(jacobian))
    return {fit.names[i]: {name: float(shift[i]) for name, shift in moved.items()} for i in shown}


def _force_column(fit: Fit, rows: int) -> FloatArray:
    """d residuals / d ln(all forces): minus the measured force, whitened."""
    parts = [
        -noise.whiten(member.force / sigma, member.curve.time)
        for member, noise, sigma in zip(fit.problem.members, fit.noises, fit.sigmas, strict=True)
    ]
    common = fit.problem.common
    column = np.concatenate(parts if common is None else common.whitened(parts))
    return np.concatenate((column, np.zeros(rows - len(column))))


def _input_columns(fit: Fit) -> dict[str, FloatArray]:
    """d residuals / d ln(input) at the optimum, (n + p,), by path."""
    columns: dict[str, FloatArray] = {}
    # Here an input is freed on purpose, however well it is known.
    scenes = [replace(scene, uncertainties=None) for scene in fit.scenes]
    for path in _inputs(fit):
        try:
            problem = fit.problem.revised(
                free={**fit.problem.free, path: None}, scenes=scenes, noise=fit.noises
            )
            columns[path] = _column(problem, fit, path)
        except UnderlayError:
            # It cannot act in this scene, or its neighbours are no scene: there is nothing to say of it.
            continue
    return columns


def _inputs(fit: Fit) -> list[str]:
    """Paths of the numbers taken as known, the same for all curves."""
    free = {coordinate.path for coordinate in fit.problem.coordinates}
    return [
        path
        for path, value in fit.scene.parameters.items()
        if path.startswith(_PARTS) and path not in free and value != 0.0 and math.isfinite(value)
    ]


def _column(problem: Problem, fit: Fit, path: str) -> FloatArray:
    """Sum over the curves: the same input, wrong by the same share, in all of them."""
    vector = problem.start
    objective = Objective(problem, freeze(problem, vector, fit.noises))
    jacobian = objective.jacobian(vector, rough=True)
    total = np.zeros(len(jacobian))
    for i, coordinate in enumerate(problem.coordinates):
        if coordinate.path == path:
            per_log = coordinate.reference / problem.slopes(vector)[i]
            total += jacobian[:, i] * per_log
    return total
