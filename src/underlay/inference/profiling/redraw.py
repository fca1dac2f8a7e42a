"""The same measurement made again in a world where a fitted vector is the truth.

Every curve gets new noise on the model's force, as the likelihood has it (a depth error through the
stiffness), and every prior that is a measurement is measured again: drawn about the vector's value with the
prior's own uncertainty, as the curve is.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from underlay._arrays import FloatArray
from underlay.data.curve import Curve
from underlay.inference.priors.densities import LogNormal, Normal
from underlay.inference.priors.prior import Prior, Truncated
from underlay.inference.problem import Problem
from underlay.scene.noise_model import NoiseModel

__all__ = ["redrawn"]


def redrawn(
    problem: Problem, vector: FloatArray, noises: Sequence[NoiseModel], rng: np.random.Generator
) -> Problem:
    """Return the problem with curves and prior measurements drawn at a scaled vector (k,).

    Parameters
    ----------
    problem : Problem
        What was measured.
    vector : FloatArray
        Truth of the new curves, (k,).
    noises : sequence of Noise
        Noise of every curve, its size known.
    rng : numpy Generator
        Where chance comes from.
    """
    physical = problem.physical(vector)
    tests = []
    for member, noise in zip(problem.members, noises, strict=True):
        reading = member.reading(physical)
        drawn = noise.sample(rng, member.sigma(reading, noise), member.curve.time)
        tests.append(
            (
                member.scene,
                Curve(member.curve.depth, reading.force + drawn, member.curve.time, member.curve.segment),
            )
        )
    free = {
        coordinate.name: _measured_again(coordinate.prior, float(value), rng)
        for coordinate, value in zip(problem.coordinates, physical, strict=True)
    }
    return Problem.joint(
        tests,
        free,
        problem.shared,
        problem.noise,
        solver=problem.solver,
    )


def _measured_again(prior: Prior, value: float, rng: np.random.Generator) -> Prior:
    """Draw the prior's measurement where `value` is true; what is no measurement stays."""
    if isinstance(prior, Normal):
        return replace(prior, mean=value + prior.sd * rng.standard_normal())
    if isinstance(prior, LogNormal):
        return replace(prior, median=value * np.exp(prior.sigma * rng.standard_normal()))
    if isinstance(prior, Truncated):
        return replace(prior, prior=_measured_again(prior.prior, value, rng))
    return prior
