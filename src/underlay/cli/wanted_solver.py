"""By which solver a command looks at a scene: from its options, else from the scene file."""

from __future__ import annotations

from typing import TYPE_CHECKING

from underlay.errors import InputError

if TYPE_CHECKING:
    from underlay.mechanics.solver import Solver

__all__ = ["wanted_solver"]


def wanted_solver(stated: Solver, name: str | None, rtol: float | None) -> Solver:
    """Return the solver of the options, else that of the scene file.

    Raises
    ------
    InputError
        If there is none of that name, or it takes no --rtol.
    """
    from underlay.mechanics.solvers import as_solver

    solver = stated if name is None else as_solver(name)
    if rtol is None:
        return solver
    if not solver.tolerance:
        raise InputError(
            f'--rtol does not go with the solver {solver.label}: it goes with "auto" and "exact"'
        )
    return solver.with_tolerance(rtol)
