"""One curve under several contact laws: what each would have reported, and how well it explains the data."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
import pandas as pd

from underlay.errors import FitError, InputError, ParameterError
from underlay.inference.least_squares.fit_result import Fit
from underlay.inference.least_squares.fitting import quick_fit
from underlay.inference.problem import Problem
from underlay.mechanics.published import published_names

__all__ = ["Comparison", "compare"]

_DEFAULT = ("halfspace", *(f"asymptotic:{order}" for order in range(1, 5)), "exact")
# What a half-space law cannot see.
_UNSEEN = ("layer.thickness", "substrate.")


@dataclass(frozen=True, eq=False)
class Comparison:
    """Fits of the same data under several laws.

    Parameters
    ----------
    names : tuple of str
        Free parameters of the problem.
    fits : mapping of method to Fit
        In the order asked.
    refused : mapping of method to str
        Why a law could not be fitted.
    dropped : mapping of method to tuple of str
        Free parameters a law does not know, kept at their values in the scene.
    """

    names: tuple[str, ...]
    fits: Mapping[str, Fit]
    refused: Mapping[str, str]
    dropped: Mapping[str, tuple[str, ...]]

    @property
    def best(self) -> str:
        """Method with the smallest AIC.

        Raises
        ------
        FitError
            If no law could be fitted.
        """
        if not self.fits:
            raise FitError(f"no law could be fitted: {dict(self.refused)}")
        return min(self.fits, key=lambda method: self.fits[method].statistics.aic)

    def to_frame(self) -> pd.DataFrame:
        """One row per method.

        Returns
        -------
        pandas.DataFrame
            Index ``method``; every parameter and its standard error (SI, NaN where the law does not know it),
            ``chi-square`` with the noise of the best fit, ``rms residual`` (N), ``AIC`` and ``BIC`` above the
            smallest, ``law error`` (relative) and ``notes``.
        """
        rows = {method: self._row(method) for method in self.fits}
        rows |= {method: {"notes": reason} for method, reason in self.refused.items()}
        frame = pd.DataFrame.from_dict(rows, orient="index")
        frame.index.name = "method"
        return frame

    def _row(self, method: str) -> dict[str, float | str]:
        found, best = self.fits[method], self.fits[self.best]
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
        row["notes"] = "; ".join(self._notes(method))
        return row

    def _notes(self, method: str) -> list[str]:
        found = self.fits[method]
        notes = [
            warning.message
            for warning in found.warnings
            if warning.code in {"law-range", "law-error", "bound", "not-fixed", "not-converged"}
        ]
        if self.dropped.get(method):
            notes.append(f"does not know {', '.join(self.dropped[method])}")
        return notes


def compare(problem: Problem, methods: Sequence[str] | None = None) -> Comparison:
    """Fit the same data under several contact laws.

    Parameters
    ----------
    problem : Problem
        Data, free parameters and noise; its own method is not used.
    methods : sequence of str, optional
        As for `contact_law`, ``"asymptotic:2"`` for an order. By default the half-space, orders 1 to 4, the
        exact law, and every published correction that takes this indenter, layer and substrate.

    Returns
    -------
    Comparison
        A law that cannot be fitted is listed with the reason; the others are not disturbed.

    Raises
    ------
    InputError
        If no method is named.
    """
    wanted = (*_DEFAULT, *published_names()) if methods is None else tuple(methods)
    if not wanted:
        raise InputError("name at least one method to compare")
    fits: dict[str, Fit] = {}
    refused: dict[str, str] = {}
    dropped: dict[str, tuple[str, ...]] = {}
    for method in wanted:
        try:
            posed, dropped[method] = _posed(problem, method)
            fits[method] = quick_fit(posed)
        except (InputError, FitError) as error:
            if methods is None and method in published_names():
                continue  # a correction for another indenter or base is no candidate here
            refused[method] = str(error)
    return Comparison(problem.names, fits, refused, dropped)


def _posed(problem: Problem, method: str) -> tuple[Problem, tuple[str, ...]]:
    """The problem under one law, and what that law does not know."""
    name, _, order = method.partition(":")
    if order and (name != "asymptotic" or order not in {"0", "1", "2", "3", "4"}):
        raise InputError(
            f"unknown method {method!r}: an order 0 to 4 goes with 'asymptotic', as in 'asymptotic:2'"
        )
    unseen = tuple(path for path in problem.free if path.startswith(_UNSEEN)) if name == "halfspace" else ()
    free = {path: given for path, given in problem.free.items() if path not in unseen}
    if not free:
        raise ParameterError(f"{method} knows none of the free parameters {', '.join(problem.free)}")
    return problem.revised(free=free, method=name, order=int(order) if order else None), unseen
