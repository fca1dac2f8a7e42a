"""Settle on all points: search below a place, again while what is learnt of the noise changes the weights."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np
from scipy.linalg import lapack

from underlay._arrays import FloatArray
from underlay.errors import InputError
from underlay.inference.least_squares.engine import FINE, GiveUp, Minimum, minimise
from underlay.inference.least_squares.frozen_noise import freeze
from underlay.inference.least_squares.last_word import LastWord, Minimiser
from underlay.inference.least_squares.noise_estimate import first_noises, renew
from underlay.inference.least_squares.objective import Objective
from underlay.inference.problem import Problem

__all__ = ["Optimum", "confirmed", "settle"]

_MAX_ROUNDS = 12
# Of a thin and stiff layer on a known soft base E h^3 alone acts, and far along that valley a law costs up to a
# second. With 1000 points z changes by less than one on a factor of twenty where a fit leaves it.
_KNOWN_BASE = replace(FINE, endless=5e-4, walled=5e-4)
# There a step that gains less than this of the sum of squares, over the variance, is the last of a search that
# swings. Of 700 fits (samples that relax or stiffen, fringes, drags; modulus and thickness free) one ends higher
# for it by more than 0.005 of the variance, by 0.08, and two end lower by 1. They take 5 to 18 % fewer models, the
# longest 20 to 40 %.
_SWINGING = 0.05


@dataclass(frozen=True)
class Optimum:
    """Where a fit ended.

    Parameters
    ----------
    objective : Objective
        With the noise that is known there.
    vector : FloatArray
        Scaled, (k,).
    success : bool
        Whether the search met its tolerance.
    message : str
        Why it stopped.
    minimiser : Minimiser, optional
        lmfit's, where it had the last word.
    lmfit : MinimizerResult, optional
        What that says.
    """

    objective: Objective
    vector: FloatArray
    success: bool
    message: str
    minimiser: Minimiser | None = None
    lmfit: Any = None

    @property
    def loss_function(self) -> str | None:
        """Name of the robust loss; None for squares."""
        return None if self.minimiser is None else self.minimiser.loss

    @cached_property
    def jacobian(self) -> FloatArray:
        """Derivatives of the residuals there, (n + priors, k)."""
        return self.objective.jacobian(self.vector)

    @cached_property
    def triangle(self) -> FloatArray:
        """R of the QR of these, (k, k): of the same singular values and directions, with a row for each column."""
        jacobian = self.jacobian
        count = jacobian.shape[1]
        # As numpy.linalg.qr has it, without the calls.
        return np.asarray(lapack.dgeqrf(jacobian)[0][:count] * np.tri(count).T)

    @cached_property
    def loss(self) -> float:
        """Minus twice the log-likelihood."""
        return self.objective.loss(self.vector)


def settle(
    problem: Problem,
    vector: FloatArray,
    robust: Minimiser | None = None,
    *,
    steps: int | None = None,
    give_up: GiveUp | None = None,
) -> Optimum | None:
    """Fit all points from a scaled start (k,), by the engine or by lmfit with a robust loss.

    None if there is no contact law at the start, or `give_up` said so. The engine makes at most so many `steps`, if
    that is said.
    """
    try:
        objective = Objective(problem, freeze(problem, vector, first_noises(problem, vector)))
    except InputError:
        return None
    if not objective.exists(vector):
        return None
    found = _searched(objective, vector, robust, steps, give_up)
    for _ in range(_MAX_ROUNDS):
        if found is None:
            return None
        renewal = renew(objective, found.vector, robust=robust is not None)
        objective.noise = renewal.noise
        if renewal.vector is not found.vector:
            found = replace(found, vector=renewal.vector)
        if renewal.settled:
            break
        found = _searched(objective, found.vector, robust, steps)
    return found


def _searched(
    objective: Objective,
    start: FloatArray,
    robust: Minimiser | None,
    steps: int | None,
    give_up: GiveUp | None = None,
) -> Optimum | None:
    if not objective.active:
        return Optimum(objective, start, success=True, message="nothing to vary.")
    if robust is not None:
        return _by_lmfit(objective, robust, robust(objective, start))
    search = FINE
    if objective.bases is None:
        search = replace(_KNOWN_BASE, swinging=_SWINGING / objective.points)
    if steps is not None:
        search = replace(search, steps=steps)
    found: Minimum | None = minimise(objective, start, search, give_up)
    if found is None:
        # At the start itself there is a law.
        return (
            None
            if give_up
            else Optimum(objective, start, success=False, message="no contact law beside the start")
        )
    # The last step was not asked for its law, and may lead to where there is none.
    known = objective.follows(found.vector, found.point.square) or objective.exists(found.vector)
    vector = found.vector if known else found.point.vector
    return Optimum(objective, vector, found.success, found.message)


def confirmed(optimum: Optimum, lmfit: Minimiser) -> Optimum:
    """The same optimum in the words of lmfit, begun there; lmfit's own where that is better."""
    if not optimum.objective.active:
        return replace(optimum, minimiser=lmfit)
    return _by_lmfit(optimum.objective, lmfit, lmfit(optimum.objective, optimum.vector))


def _by_lmfit(objective: Objective, lmfit: Minimiser, said: LastWord) -> Optimum:
    return Optimum(objective, said.vector, said.success, said.message, lmfit, said.result)
