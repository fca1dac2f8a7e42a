"""Starts of a fit with one parameter held: the scan of a free fit, at the value that is held.

Where thin and soft competes with thick and stiff, the valley of the optimum can fold back in the parameter
that is held: a step along it then leads up a wall while the other side of the fold explains the data well.
Only a scan finds that side.
"""

from __future__ import annotations

from underlay._arrays import FloatArray
from underlay.data.noise import Noise
from underlay.errors import InputError
from underlay.inference.least_squares.scan import scan
from underlay.inference.problem import Problem

__all__ = ["starts_with_held"]


def starts_with_held(problem: Problem, index: int, vector: FloatArray) -> list[FloatArray]:
    """Starts (k,) of the other parameters with entry `index` held at its value in `vector` (k,).

    The other entries of `vector` are one more point of the scan. Empty where nothing else is free, or no
    point of the scan has a law.
    """
    others = {
        coordinate.name: coordinate.prior
        for i, coordinate in enumerate(problem.coordinates)
        if i != index and i not in problem.noise_entries
    }
    if not others:
        return []
    try:
        held = problem.revised(free=others, scenes=problem.scenes(vector), noise=Noise())
    except InputError:
        # The value cannot be a scene's: a contact beyond the last point, an impossible material.
        return []
    known = problem.values(vector)
    return [problem.vector(known | held.values(start)) for start in scan(held)]
