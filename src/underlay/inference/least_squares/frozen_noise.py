"""The noise of a problem at one model: what weighs the residuals while a search runs."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from underlay._arrays import FloatArray
from underlay.inference.problem import Problem
from underlay.scene.noise_model import NoiseModel

__all__ = ["FrozenNoise", "freeze"]


@dataclass(frozen=True)
class FrozenNoise:
    """Noise of every curve, frozen: model and standard deviations (N), one array (n,) each."""

    models: tuple[NoiseModel, ...]
    sigmas: tuple[FloatArray, ...]


def freeze(problem: Problem, vector: FloatArray, noises: Sequence[NoiseModel]) -> FrozenNoise:
    """Freeze the noise at the model of a scaled vector (k,)."""
    sigmas = tuple(
        member.sigma(member.reading(problem.physical(vector)) if noise.follows_force else None, noise)
        for member, noise in zip(problem.members, noises, strict=True)
    )
    return FrozenNoise(tuple(noises), sigmas)
