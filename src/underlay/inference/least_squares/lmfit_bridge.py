"""lmfit's part in a fit: it confirms an optimum by a minimiser that its users know, and minimises robust losses."""

from __future__ import annotations

import re
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from underlay._arrays import FloatArray
from underlay.inference.least_squares.models import LOSSES, SQUARES
from underlay.inference.least_squares.objective import Objective
from underlay.inference.least_squares.projection import acting

#: lmfit's minimisers that a fit may name: Levenberg-Marquardt (MINPACK), trust region.
METHODS = ("leastsq", "least_squares")
# Relative tolerance of a step and of the sum of squares: lmfit's own (1.5e-8) lets a fit stop where two unit
# systems differ in the sixth digit.
_TOLERANCE = 1e-8
# Evaluations at most: from an optimum three are usual, from a robust start ten; a valley without an end takes
# hundreds.
_MOST_EVALUATIONS = 300
# What lmfit allows in no name.
_UNNAMEABLE = re.compile(r"\W+")


@dataclass(frozen=True)
class LmfitOptimum:
    """Optimum found by lmfit: scaled vector (k,), and its `MinimizerResult`, whose values are scaled parameters."""

    vector: FloatArray
    result: Any

    @property
    def success(self) -> bool:
        """Whether lmfit met its tolerance."""
        return bool(self.result.success)

    @property
    def message(self) -> str:
        """Why lmfit stopped."""
        return str(self.result.message)


@dataclass(frozen=True)
class Minimiser:
    """One of lmfit's minimisers, with the loss function that it minimises.

    Parameters
    ----------
    method : {"leastsq", "least_squares"}
        Levenberg-Marquardt (MINPACK) or trust region.
    loss : str, optional
        One of `LOSSES`, for which the method must be ``"least_squares"``; by default the sum of squares.
    """

    method: str = "leastsq"
    loss: str | None = None

    def __call__(self, objective: Objective, start: FloatArray) -> LmfitOptimum:
        """Minimise the weighted sum of squares, or its robust loss, from a scaled vector (k,)."""
        # The engine alone needs no lmfit, and it takes a second to load.
        import lmfit  # noqa: PLC0415

        active = objective.active
        names = [_UNNAMEABLE.sub("_", objective.problem.names[i]).strip("_") for i in active]
        low, high = objective.problem.bounds.T
        parameters: Any = [
            lmfit.Parameter(name, value=float(start[i]), min=float(low[i]), max=float(high[i]))
            for name, i in zip(names, active, strict=True)
        ]
        if self.method == "least_squares":
            # leastsq takes the list as it is and spares itself a copy.
            parameters, named = lmfit.Parameters(), parameters
            parameters.add_many(*named)

        def vector(current: Any) -> FloatArray:
            full: FloatArray = np.array(start)
            full[active] = [current[name].value for name in names]
            return full

        def jacobian(current: Any) -> FloatArray:
            columns = objective.jacobian(vector(current), rough=True)[:, active]
            # The minimiser leaves an entry whose column is zero where it is.
            return np.where(acting(np.linalg.norm(columns, axis=0)), columns, 0.0)

        options: dict[str, Any] = {"ftol": _TOLERANCE, "xtol": _TOLERANCE, "gtol": 0.0}
        if self.method == "least_squares":
            options |= {"gtol": None, "loss": self.loss or "linear"}
        lowest = _Lowest((LOSSES[self.loss] if self.loss else SQUARES).rho, start)

        def residuals(current: Any) -> FloatArray:
            there = vector(current)
            return lowest.remembered(there, objective.residuals(there))

        minimiser = lmfit.Minimizer(residuals, parameters, max_nfev=_MOST_EVALUATIONS)
        result = minimiser.minimize(method=self.method, Dfun=jacobian, **options)
        if result.aborted:
            # What lmfit then says is the place asked last, not the best; and of leastsq it is memory that MINPACK
            # has given back, which may hold any numbers by now.
            for name, i in zip(names, active, strict=True):
                result.params[name].value = float(lowest.vector[i])
            result.residual = lowest.residuals
            result._calculate_statistics()  # noqa: SLF001  there is no public way to tell it the residuals
        return LmfitOptimum(vector(result.params), result)


@dataclass
class _Lowest:
    """The lowest point that a search has evaluated.

    It holds the scaled vector (k,), the residuals (n,), and the sum of their loss `rho`.
    """

    rho: Callable[[FloatArray], FloatArray]
    vector: FloatArray
    residuals: FloatArray = field(default_factory=lambda: np.zeros(0))
    loss: float = np.inf

    def remembered(self, vector: FloatArray, residuals: FloatArray) -> FloatArray:
        """Return the residuals, and remember them if they are the lowest so far."""
        loss = float(self.rho(residuals * residuals).sum())
        if loss < self.loss:
            # A copy: a minimiser may write into what it is given.
            self.vector, self.residuals, self.loss = vector, residuals.copy(), loss
        return residuals
