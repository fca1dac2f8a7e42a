"""How deep, and by which solver, a command looks at a scene: from its options, else from the scene file."""

from __future__ import annotations

from underlay.errors import InputError
from underlay.mechanics.solver import Solver
from underlay.mechanics.solvers import as_solver
from underlay.scene.scene_file import SceneFile
from underlay.units import parse_quantity

__all__ = ["deepest_point", "wanted_solver"]


def deepest_point(file: SceneFile, option: str | None) -> float:
    """Deepest point since contact (m).

    Raises
    ------
    InputError
        If neither the option nor a [simulate] section says it, or it is not positive.
    """
    if option is not None:
        depth = parse_quantity(option, "length")
    elif file.simulate is not None:
        depth = file.simulate.max_depth - file.scene.instrument.contact_depth
    else:
        raise InputError('say how deep with --max-depth, e.g. --max-depth "100 um"')
    if not depth > 0.0:
        raise InputError(f"the deepest point since contact must be positive; got {depth:.6g} m")
    return depth


def wanted_solver(stated: Solver, name: str | None, rtol: float | None) -> Solver:
    """Return the solver of the options, else that of the scene file.

    Raises
    ------
    InputError
        If there is none of that name, or it takes no --rtol.
    """
    solver = stated if name is None else as_solver(name)
    if rtol is None:
        return solver
    if not solver.tolerance:
        raise InputError(
            f'--rtol does not go with the solver {solver.label}: it goes with "auto" and "exact"'
        )
    return solver.with_tolerance(rtol)
