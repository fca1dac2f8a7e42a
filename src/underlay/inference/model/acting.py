"""Which numbers of a scene can change a curve: a parameter that cannot act cannot be fitted."""

from __future__ import annotations

from collections.abc import Collection

import numpy as np

from underlay.errors import ParameterError
from underlay.mechanics.solver import Solver
from underlay.scene.lever import SPRING_CONSTANT_RATIO
from underlay.scene.parameters import unknown_parameter
from underlay.scene.scene import Scene

__all__ = ["require_acting"]


def require_acting(
    path: str, scene: Scene, free: Collection[str], solver: Solver, noise: Collection[str]
) -> None:
    """Refuse a path the scene does not have, or that cannot change the curve.

    Parameters
    ----------
    path : str
        The parameter.
    scene : Scene
        The test.
    free : collection of str
        Every free path, `path` included.
    solver : Solver
        What builds the law.
    noise : collection of str
        Paths of the numbers of its noise model.

    Raises
    ------
    ParameterError
        With what to do instead.
    """
    known = scene.parameters
    part = path.partition(".")[0]
    numberless = not any(name.startswith("substrate.") for name in known)
    if part == "substrate" and scene.substrate is not None and numberless:
        raise ParameterError(
            f"{path} cannot act: the substrate is RIGID; declare a material as substrate to fit its constants"
        )
    if part == "substrate" and scene.substrate is None:
        raise ParameterError(f"{path} cannot act: the scene has no substrate")
    if path not in known and path not in noise:
        raise unknown_parameter(path, (*known, *noise))
    if path == "lever.spring_constant":
        raise ParameterError(
            f"{path} cannot act: it is the one that made the curve; free {SPRING_CONSTANT_RATIO} with a prior such "
            'as { prior = "lognormal", median = 1.0, sigma = 0.1 } for one that is known to 10 %'
        )
    if part != "substrate" and path != "layer.thickness":
        return
    if not np.isfinite(scene.layer.thickness):
        raise ParameterError(
            f"{path} cannot act: the layer is a half-space (infinite thickness); give it a thickness and a "
            "substrate, or leave the parameter out"
        )
    if not solver.sees_base:
        raise ParameterError(
            f"{path} cannot act: laws by {solver.name} depend on what the indenter touches alone; use another "
            "solver or leave it out"
        )
    if path == "layer.thickness" and scene.substrate == scene.layer.material:
        materials = [p for p in free if p.startswith(("layer.", "substrate.")) and p != path]
        if not materials:
            raise ParameterError(
                "layer.thickness cannot act: layer and substrate are the same material, and no constant of "
                "either is free"
            )
