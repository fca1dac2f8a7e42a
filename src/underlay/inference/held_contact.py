"""What two laws make of a curve while its contact point is held: the quick look before a fit."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from underlay._arrays import FloatArray
from underlay.data.curve import Curve
from underlay.inference.compare import compare
from underlay.inference.from_files import chosen_part, problem_from
from underlay.inference.least_squares.fit_result import Fit
from underlay.mechanics.solver import Solver
from underlay.mechanics.solvers import HalfSpace
from underlay.quantities import declared
from underlay.scene.scene_file import SceneFile

__all__ = ["HeldLaws", "laws_at_contact"]

_CONTACT, _MODULUS = "instrument.contact_depth", "layer.E"
_POINTS = 300


@dataclass(frozen=True, eq=False)
class HeldLaws:
    """The scene's law and that of a half-space, at one contact point.

    Parameters
    ----------
    used : Curve
        The points they are fitted to.
    moduli : mapping of str to float
        Layer modulus (Pa) by law: ``"layer and base"`` where there is a base, ``"half-space"``.
    lines : mapping of str to (depth, force)
        Readings (m, N) of each law over the whole curve.
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
    """Fit the modulus, and what the force is linear in, with everything else held as the scene file says.

    Parameters
    ----------
    file : SceneFile
        The test.
    curve : Curve
        As it was read, with every segment.
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
    # The points within the fit range of the scene file, where it says one.
    held_laws = HeldLaws(problem.curves[0], {}, {}, {})
    for name, solver in names.items():
        found = compare(problem, [solver])
        for fit in found.fits.values():
            held_laws.moduli[name] = fit.scene.parameters[_MODULUS]
            held_laws.lines[name] = _line(fit, depth)
        for reason in found.refused.values():
            held_laws.refused[name] = reason
    return held_laws


def _line(fit: Fit, depth: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Force of a fit at even depths; at the points themselves where it depends on what came before them."""
    if fit.scene.memory is None and fit.scene.adhesion is None:
        return depth, fit.scene.force(depth, solver=fit.solver)
    return fit.curves[0].depth, fit.curves[0].force - fit.residuals[0]
