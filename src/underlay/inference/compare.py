"""Comparison of one curve under several models: contact laws, lower face bonded or slipping, fixed contact.

`compare` gives the parameters under each contact law, and how well it fits the data; `compare_bonds` does so for a
layer's lower face bonded and free to slip; `laws_at_contact` is a quick estimate before a fit.
"""

from __future__ import annotations

import warnings
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
import pandas as pd

from underlay._arrays import FloatArray
from underlay._given import require_given
from underlay.data.curve import Curve
from underlay.errors import FitError, InputError, ParameterError, UnderlayWarning
from underlay.inference.from_files import chosen_part, problem_from
from underlay.inference.least_squares.fit_result import Fit
from underlay.inference.least_squares.fitting import fit, quick_fit
from underlay.inference.problem import Problem
from underlay.mechanics.published.law import is_made_for, published_names
from underlay.mechanics.solver import Solver
from underlay.mechanics.solvers import AnySolver, Asymptotic, Exact, HalfSpace, Published, as_solver
from underlay.quantities import declared
from underlay.scene.scene import bond_of, faces, has_face, with_bond
from underlay.scene.scene_file import SceneFile

# Laws that are compared by default, besides published corrections.
_DEFAULT = (HalfSpace(), *(Asymptotic(order) for order in range(1, 5)), Exact())
# First words of the paths of parameters that a half-space does not have.
_UNSEEN = ("layer.thickness", "substrate.")
# Names of the bonds, and the corresponding values of a layer's `bond`.
_BONDS = {"bonded": "bonded", "slipping": "slip"}
_CONTACT, _MODULUS = "instrument.contact_depth", "layer.E"
# Number of points of a drawn line, and of the depths at which the force of a law is checked.
_POINTS = 300
# Difference of AIC up to which a curve does not tell two laws apart (Burnham and Anderson 2002, section 2.6).
_ALIKE = 2.0


@dataclass(frozen=True, eq=False)
class Comparison:
    """Fits of the same data under several laws.

    Parameters
    ----------
    names : tuple of str
        Free parameters of the problem.
    fits : mapping of label to Fit
        Fits by the name of the solver, in the given order.
    refused : mapping of label to str
        Why a law could not be fitted.
    dropped : mapping of label to tuple of str
        Free parameters that a law does not have, kept at their values in the scene.
    """

    names: tuple[str, ...]
    fits: Mapping[str, Fit]
    refused: Mapping[str, str]
    dropped: Mapping[str, tuple[str, ...]]

    @property
    def best(self) -> str:
        """Label of the first solver of `order`.

        Raises
        ------
        FitError
            If no law could be fitted.
        """
        if not self.fits:
            raise FitError(f"no law could be fitted: {dict(self.refused)}")
        return self.order[0]

    @property
    def order(self) -> tuple[str, ...]:
        """Labels of the fits, best first: those of `alike` by their errors, then the others by AIC."""
        others = [label for label in self.fits if label not in self.alike]
        return (*self.alike, *sorted(others, key=lambda label: round(self.fits[label].statistics.aic, 6)))

    @cached_property
    def alike(self) -> tuple[str, ...]:
        """Labels of the laws that the data do not tell from the one of least AIC, itself included.

        Their AIC is within 2 of the least. The data prefer none of them, so theory does: the exact law is first,
        then come the others by their error.
        """
        by_aic = {label: found.statistics.aic for label, found in self.fits.items()}
        least = min(by_aic.values(), default=0.0)
        alike = [label for label, aic in by_aic.items() if aic <= least + _ALIKE]
        exact = {label: isinstance(self.fits[label].solver, Exact) for label in alike}
        # Laws that are one and the same, such as two orders of a series whose second term is zero, stay as given.
        return tuple(sorted(alike, key=lambda label: (not exact[label], float(f"{self.errors[label]:.6g}"))))

    @cached_property
    def errors(self) -> Mapping[str, float]:
        """Largest relative error of each law's force between contact and the deepest reading.

        It is measured against the exact law, at the numbers of the fit whose law states the smallest error. Where
        one of the two laws is not for these numbers, it is the error that the law states.
        """
        if not self.fits:
            return {}
        trusted = min(self.fits.values(), key=lambda found: found.statistics.law_error)
        return {label: _error(trusted, found) for label, found in self.fits.items()}

    def to_frame(self) -> pd.DataFrame:
        """One row per solver.

        Returns
        -------
        pandas.DataFrame
            Index ``solver``; every parameter and its standard error (SI, NaN where the law does not have it),
            ``chi-square`` with the noise of the best fit, ``rms residual`` (N), ``AIC`` and ``BIC`` above the
            smallest, ``law error`` (of `errors`) and ``notes``.
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
        row["AIC"] = found.statistics.aic - min(f.statistics.aic for f in self.fits.values())
        row["BIC"] = found.statistics.bic - min(f.statistics.bic for f in self.fits.values())
        row["law error"] = self.errors[label]
        row["notes"] = "; ".join(self._notes(label))
        return row

    def _notes(self, label: str) -> list[str]:
        found = self.fits[label]
        notes = [
            warning.message
            for warning in found.warnings
            if warning.code in {"law-range", "bound", "not-fixed", "not-converged"}
        ]
        if self.dropped.get(label):
            notes.append(f"does not know {', '.join(self.dropped[label])}")
        return notes


def _error(trusted: Fit, fit: Fit) -> float:
    """Largest relative error of the force of a fit's law, against the exact law at the numbers of another fit."""
    errors = []
    for scene, curve in zip(trusted.scenes, trusted.curves, strict=True):
        deepest = float(scene.instrument.chain.travel(curve.depth).max())
        depth = deepest * np.arange(1, _POINTS + 1) / _POINTS
        try:
            with warnings.catch_warnings():
                # That a law is used outside its range is said by its fit.
                warnings.simplefilter("ignore", UnderlayWarning)
                exact, law = (scene.contact_law(deepest, solver=one) for one in (Exact(), fit.solver))
        except InputError:
            return fit.statistics.law_error
        off = np.abs(law.force(depth) / exact.force(depth) - 1.0).max()
        errors.append(float(off) + exact.error_estimate)
    return max(errors)


def compare(problem: Problem, solvers: Sequence[AnySolver] | None = None) -> Comparison:
    """Fit the same data under several contact laws.

    Parameters
    ----------
    problem : Problem
        Data, free parameters and noise; its own solver is not used.
    solvers : sequence of Solver or str, optional
        As for `contact_law`, ``"asymptotic:2"`` for an order. By default the half-space, orders 1 to 4, the exact
        law, and every published correction that is made for this kind of indenter and substrate.

    Returns
    -------
    Comparison
        A law that cannot be fitted is listed with the reason, and does not stop the others.

    Raises
    ------
    InputError
        If no solver is named.
    """
    require_given(problem, "problem", Problem)
    contacts = [scene.contact for scene in problem.base_scenes]
    published = [name for name in published_names() if all(is_made_for(name, one) for one in contacts)]
    asked = [*_DEFAULT, *map(Published, published)] if solvers is None else list(solvers)
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
            refused[label] = str(error)
    return Comparison(problem.names, fits, refused, dropped)


def _labelled(solvers: Sequence[Solver]) -> dict[str, Solver]:
    """Solvers by their labels, in full where two have the same label."""
    labels = [solver.label for solver in solvers]
    full = [
        repr(solver) if labels.count(label) > 1 else label
        for solver, label in zip(solvers, labels, strict=True)
    ]
    return dict(zip(full, solvers, strict=True))


def _posed(problem: Problem, solver: Solver) -> tuple[Problem, tuple[str, ...]]:
    """The problem under one law, and the free parameters that the law does not have."""
    unseen = () if solver.sees_base else tuple(path for path in problem.free if path.startswith(_UNSEEN))
    free = {path: given for path, given in problem.free.items() if path not in unseen}
    if not free:
        raise ParameterError(f"{solver.label} knows none of the free parameters {', '.join(problem.free)}")
    return problem.revised(free=free, solver=solver), unseen


@dataclass(frozen=True, eq=False)
class BondComparison:
    """Fits of the same data with one face bonded, and free to slip.

    Parameters
    ----------
    face : str
        The layer whose lower face it is: ``"layer"``, ``"substrate.layers[0]"``, ...
    names : tuple of str
        Free parameters.
    fits : mapping of str to Fit
        ``"bonded"`` and ``"slipping"``, those that could be fitted.
    refused : mapping of str to str
        Why one could not be fitted, by the same names.
    """

    face: str
    names: tuple[str, ...]
    fits: Mapping[str, Fit]
    refused: Mapping[str, str]

    @property
    def difference(self) -> float:
        """AIC of the slipping face less that of the bonded one: negative where the data favour slip.

        NaN where one could not be fitted.
        """
        if self.refused:
            return np.nan
        slipping, bonded = (self.fits[name].statistics.aic for name in ("slipping", "bonded"))
        return slipping - bonded

    def to_frame(self, level: float = 0.95) -> pd.DataFrame:
        """One row per bond and parameter.

        Returns
        -------
        pandas.DataFrame
            ``face`` ("bonded" or "slipping"), ``parameter``, ``value``, ``low`` and ``high`` of its interval (SI;
            infinite where the data set no limit), ``rms residual`` (N) and ``AIC`` above the smaller.
        """
        least = min((found.statistics.aic for found in self.fits.values()), default=0.0)
        rows = []
        for bond, found in self.fits.items():
            rms = float(np.sqrt(np.mean(np.square(np.concatenate(found.residuals)))))
            for name in self.names:
                known = found.interval(name, level)
                row = {"face": bond, "parameter": name, "value": known.value}
                row |= {"low": known.low, "high": known.high}
                rows.append(row | {"rms residual": rms, "AIC": found.statistics.aic - least})
        return pd.DataFrame(rows)


def compare_bonds(given: Problem | Fit, face: str = "layer") -> BondComparison:
    """Fit the same data with a layer bonded to what is under it, and free to slip on it.

    A gel that lies loose in a dish carries up to 40 % less force at equal depth than one that sticks to it: where
    the bond is not known, both moduli should be reported.

    Parameters
    ----------
    given : Problem or Fit
        Data, free parameters, noise and solver. A fit is reused for its own bond.
    face : str, default "layer"
        The layer whose lower face it is: ``"layer"`` for the one on top, ``"substrate.layers[0]"`` for the next.

    Returns
    -------
    BondComparison
        A bond that cannot be fitted is listed with the reason.

    Raises
    ------
    InputError
        If there is no such face.
    """
    require_given(given, "given", Problem, Fit)
    problem = given.problem if isinstance(given, Fit) else given
    for scene in problem.base_scenes:
        if not has_face(scene, face):
            known = ", ".join(faces(scene)) or "none"
            raise InputError(f"no layer {face!r} with something under it; such faces here: {known}")
    fits: dict[str, Fit] = {}
    refused: dict[str, str] = {}
    for name, bond in _BONDS.items():
        scenes = [with_bond(scene, face, bond) for scene in problem.base_scenes]
        try:
            # An unknown bond is computed as bonded: the given fit is reused.
            if isinstance(given, Fit) and all(bond_of(scene, face) == bond for scene in problem.base_scenes):
                fits[name] = given
            else:
                fits[name] = fit(problem.revised(scenes=scenes))
        except (InputError, FitError) as error:
            refused[name] = str(error)
    return BondComparison(face, problem.names, fits, refused)


@dataclass(frozen=True, eq=False)
class HeldLaws:
    """Fits of the scene's law and of a half-space with the contact point fixed.

    Parameters
    ----------
    used : Curve
        The points they are fitted to.
    moduli : mapping of str to float
        Layer modulus (Pa) by law: ``"layer and base"`` where there is a base, ``"half-space"``.
    lines : mapping of str to (depth, force)
        Model readings (m, N) of each law over the whole curve.
    refused : mapping of str to str
        Why a law could not be fitted.
    """

    used: Curve
    moduli: dict[str, float]
    lines: dict[str, tuple[FloatArray, FloatArray]]
    refused: dict[str, str]


def laws_at_contact(
    file: SceneFile, curve: Curve, contact: float, low: float = -np.inf, high: float = np.inf
) -> HeldLaws:
    """Fit the modulus, and parameters in which the force is linear, with everything else as in the scene file.

    Parameters
    ----------
    file : SceneFile
        The test.
    curve : Curve
        The curve as it was read, with every segment.
    contact : float
        Depth reading of the contact (m).
    low, high : float
        Depth readings (m) between which points are used.

    Raises
    ------
    CurveError, InputError
        If no points are left, or the scene and the curve do not fit together.
    """
    used = chosen_part(curve, {**file.curve, "min_depth": low, "max_depth": high})
    held = replace(
        file,
        draft=file.draft.with_values({_CONTACT: contact}),
        free=tuple(entry for entry in file.free if entry.path == _MODULUS or declared(entry.path).linear),
        stated=file.stated | {_CONTACT},
    )
    problem = problem_from(held, used)
    names: dict[str, Solver] = {"half-space": HalfSpace()}
    if problem.base_scenes[0].substrate is not None:
        names = {"layer and base": problem.solver, **names}
    depth = np.linspace(float(curve.depth.min()), float(curve.depth.max()), _POINTS)
    # The points within the fit range of the scene file, if it states one.
    held_laws = HeldLaws(problem.curves[0], {}, {}, {})
    for name, solver in names.items():
        found = compare(problem, [solver])
        for own in found.fits.values():
            held_laws.moduli[name] = own.scene.parameters[_MODULUS]
            held_laws.lines[name] = _line(own, depth)
        for reason in found.refused.values():
            held_laws.refused[name] = reason
    return held_laws


def _line(fit: Fit, depth: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Depths and forces of a fit's model: at even depths, or at the readings for a law with history."""
    if fit.scene.is_elastic:
        return depth, fit.scene.force(depth, solver=fit.solver)
    return fit.curves[0].depth, fit.curves[0].force - fit.residuals[0]
