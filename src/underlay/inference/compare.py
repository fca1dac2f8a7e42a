"""One curve under several contact laws: what each would have reported, and how well it explains the data."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
import pandas as pd

from underlay._given import require_given
from underlay.errors import FitError, InputError, ParameterError
from underlay.inference.least_squares.fit_result import Fit
from underlay.inference.least_squares.fitting import quick_fit
from underlay.inference.problem import Problem
from underlay.mechanics.published import published_names
from underlay.mechanics.solver import Solver
from underlay.mechanics.solvers import AnySolver, Asymptotic, Exact, HalfSpace, Published, as_solver

__all__ = ["Comparison", "compare"]

_DEFAULT = (HalfSpace(), *(Asymptotic(order) for order in range(1, 5)), Exact())
# What a law that does not see the base does not know.
_UNSEEN = ("layer.thickness", "substrate.")


@dataclass(frozen=True, eq=False)
class Comparison:
    """Fits of the same data under several laws.

    Parameters
    ----------
    names : tuple of str
        Free parameters of the problem.
    fits : mapping of label to Fit
        In the order asked, by what the solver is called.
    refused : mapping of label to str
        Why a law could not be fitted.
    dropped : mapping of label to tuple of str
        Free parameters a law does not know, kept at their values in the scene.
    """

    names: tuple[str, ...]
    fits: Mapping[str, Fit]
    refused: Mapping[str, str]
    dropped: Mapping[str, tuple[str, ...]]

    @property
    def best(self) -> str:
        """Label of the solver with the smallest AIC.

        Raises
        ------
        FitError
            If no law could be fitted.
        """
        if not self.fits:
            raise FitError(f"no law could be fitted: {dict(self.refused)}")
        return min(self.fits, key=lambda label: self.fits[label].statistics.aic)

    def to_frame(self) -> pd.DataFrame:
        """One row per solver.

        Returns
        -------
        pandas.DataFrame
            Index ``solver``; every parameter and its standard error (SI, NaN where the law does not know it),
            ``chi-square`` with the noise of the best fit, ``rms residual`` (N), ``AIC`` and ``BIC`` above the
            smallest, ``law error`` (relative) and ``notes``.
        """
        rows = {label: self._row(label) for label in self.fits}
        rows |= {label: {"notes": reason} for label, reason in self.refused.items()}
        frame = pd.DataFrame.from_dict(rows, orient="index")
        frame.index.name = "solver"
        return frame

    def _row(self, label: str) -> dict[str, float | str]:
        found, best = self.fits[label], self.fits[self.best]
        row: dict[str, float | str] = {}
        for name in self.names:
            row[name] = found.values.get(name, np.nan)
            row[f"{name} stderr"] = found.stderr.get(name, np.nan)
        row["chi-square"] = sum(
            float(np.sum(np.square(residual / sigma)))
            for residual, sigma in zip(found.residuals, best.sigmas, strict=True)
        )
        row["rms residual"] = float(np.sqrt(np.mean(np.square(np.concatenate(found.residuals)))))
        row["AIC"] = found.statistics.aic - best.statistics.aic
        row["BIC"] = found.statistics.bic - min(f.statistics.bic for f in self.fits.values())
        row["law error"] = found.statistics.law_error
        row["notes"] = "; ".join(self._notes(label))
        return row

    def _notes(self, label: str) -> list[str]:
        found = self.fits[label]
        notes = [
            warning.message
            for warning in found.warnings
            if warning.code in {"law-range", "law-error", "bound", "not-fixed", "not-converged"}
        ]
        if self.dropped.get(label):
            notes.append(f"does not know {', '.join(self.dropped[label])}")
        return notes


def compare(problem: Problem, solvers: Sequence[AnySolver] | None = None) -> Comparison:
    """Fit the same data under several contact laws.

    Parameters
    ----------
    problem : Problem
        Data, free parameters and noise; its own solver is not used.
    solvers : sequence of Solver or str, optional
        As for `contact_law`, ``"asymptotic:2"`` for an order. By default the half-space, orders 1 to 4, the
        exact law, and every published correction that takes this indenter, layer and substrate.

    Returns
    -------
    Comparison
        A law that cannot be fitted is listed with the reason; the others are not disturbed.

    Raises
    ------
    InputError
        If no solver is named.
    """
    require_given(problem, "problem", Problem)
    candidates = [Published(name) for name in published_names()] if solvers is None else []
    asked = [*_DEFAULT, *candidates] if solvers is None else list(solvers)
    if not asked:
        raise InputError("name at least one solver to compare")
    fits: dict[str, Fit] = {}
    refused: dict[str, str] = {}
    dropped: dict[str, tuple[str, ...]] = {}
    wanted = []
    for given in asked:
        try:
            wanted.append(as_solver(given))
        except InputError as error:
            refused[str(given)] = str(error)
    for label, solver in _labelled(wanted).items():
        try:
            posed, dropped[label] = _posed(problem, solver)
            fits[label] = quick_fit(posed)
        except (InputError, FitError) as error:
            if solver in candidates:
                continue  # a correction for another indenter or base is no candidate here
            refused[label] = str(error)
    return Comparison(problem.names, fits, refused, dropped)


def _labelled(solvers: Sequence[Solver]) -> dict[str, Solver]:
    """Solvers by what they are called, in full where two are called the same."""
    labels = [solver.label for solver in solvers]
    full = [
        repr(solver) if labels.count(label) > 1 else label
        for solver, label in zip(solvers, labels, strict=True)
    ]
    return dict(zip(full, solvers, strict=True))


def _posed(problem: Problem, solver: Solver) -> tuple[Problem, tuple[str, ...]]:
    """The problem under one law, and what that law does not know."""
    unseen = () if solver.sees_base else tuple(path for path in problem.free if path.startswith(_UNSEEN))
    free = {path: given for path, given in problem.free.items() if path not in unseen}
    if not free:
        raise ParameterError(f"{solver.label} knows none of the free parameters {', '.join(problem.free)}")
    return problem.revised(free=free, solver=solver), unseen
