"""Whether a posterior is that of a problem: what they differ in, in words."""

from __future__ import annotations

import numpy as np

from underlay.data.curve import Curve
from underlay.inference.problem import Problem
from underlay.inference.sampling.posterior import Posterior
from underlay.quantities import field_quantities
from underlay.scene.noise_model import NoiseModel
from underlay.scene.scene import Scene

__all__ = ["difference"]

# Numbers that differ by no more are the same one, scaled and back.
_SAME = 1e-9


def difference(problem: Problem, posterior: Posterior) -> str:
    """What a posterior's own problem differs in; empty where nothing is known to differ.

    Where free parameters start does not count, nor does a likelihood that averages over noise nobody stated.
    """
    if posterior.names != problem.names:
        return f"free are {', '.join(posterior.names)} there and {', '.join(problem.names)} in the problem"
    if posterior.priors != tuple(repr(prior) for prior in problem.priors.values()):
        return "the priors differ"
    if posterior.problem is None:
        # Saved without its problem, it still has the readings.
        bands = posterior.predictive
        same = len(bands) == len(problem.curves) and all(
            _within(band.depth, band.force, curve) for band, curve in zip(bands, problem.curves, strict=True)
        )
        return "" if same else "the curves differ"
    return _of_problems(problem, posterior.problem)


def _of_problems(ours: Problem, theirs: Problem) -> str:
    if len(ours.curves) != len(theirs.curves) or not all(
        # Readings beside a jump of the force are left out where a tip sticks.
        _within(curve.depth, curve.force, own) and (scene.adhesion is not None or len(curve) == len(own))
        for curve, own, scene in zip(theirs.curves, ours.curves, ours.base_scenes, strict=True)
    ):
        return "the curves differ"
    values = ours.values(ours.start)
    place, there = ours.vector(values), theirs.vector(values)
    for mine, other in zip(ours.scenes(place), theirs.scenes(there), strict=True):
        told = _of_scenes(mine, other)
        if told:
            return told
    if ours.solver != theirs.solver:
        return f"the contact law is {theirs.solver!r} there and {ours.solver!r} in the problem"
    unknown = [[member.scale_is_unknown for member in problem.members] for problem in (ours, theirs)]
    noises = zip(ours.noises(place), theirs.noises(there), strict=True)
    if ours.noise_is_open != theirs.noise_is_open or unknown[0] != unknown[1]:
        return "the noise is stated in one of them alone"
    return "" if all(_alike(*pair) for pair in noises) else "the noise differs"


def _within(depth: np.ndarray, force: np.ndarray, curve: Curve) -> bool:
    """Whether these readings are among those of a curve."""
    known = set(zip(curve.depth.tolist(), curve.force.tolist(), strict=True))
    return known.issuperset(zip(depth.tolist(), force.tolist(), strict=True))


def _of_scenes(ours: Scene, theirs: Scene) -> str:
    numbers, others = ours.parameters, theirs.parameters
    if list(numbers) == list(others):
        for path, value in numbers.items():
            if not np.isclose(value, others[path], rtol=_SAME, atol=0.0):
                return f"{path} is {others[path]:.10g} there and {value:.10g} in the problem"
        if theirs.with_values(numbers) == ours:
            return ""
    return "the scenes differ"


def _alike(ours: NoiseModel, theirs: NoiseModel) -> bool:
    if type(ours) is not type(theirs):
        return False
    names = field_quantities(type(ours))
    # A number that is not stated is none at all.
    numbers = ([getattr(noise, name) for noise in (ours, theirs)] for name in names)
    arrays = [[getattr(noise, name, 0) for name in ("columns", "common")] for noise in (ours, theirs)]
    return (
        all(
            mine == other if mine is None or other is None else np.isclose(mine, other, rtol=_SAME, atol=0.0)
            for mine, other in numbers
        )
        and all(map(np.array_equal, *arrays))
        # What is no number, such as a word.
        and theirs.at({name: getattr(ours, name) for name in names}) == ours
    )
