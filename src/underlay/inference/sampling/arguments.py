"""What `sample` is asked for, checked before anything is computed."""

from __future__ import annotations

import os

import numpy as np

from underlay.errors import InputError
from underlay.inference.problem import Problem
from underlay.inference.sampling.convergence import MIN_STEPS

__all__ = ["check_arguments", "is_weighted", "seeded"]


def is_weighted(method: str | None, backend: str | os.PathLike[str] | None) -> bool:
    """Whether weighted draws alone are asked for."""
    if method not in (None, "emcee", "importance"):
        raise InputError(f"unknown method {method!r}; known: 'emcee', 'importance'")
    if method == "importance" and backend is not None:
        raise InputError("weighted draws are no chain and are not kept in a file: leave backend out")
    return method == "importance"


def check_arguments(
    problem: Problem, walkers: int, max_steps: int, backend: str | os.PathLike[str] | None, *, resume: bool
) -> None:
    """Refuse what cannot be sampled.

    Raises
    ------
    InputError
        If a prior is improper, there are too few walkers or steps, or nothing is there to resume.
    """
    improper = [name for name, prior in problem.priors.items() if not prior.proper]
    if improper:
        raise InputError(
            f"the prior of {', '.join(improper)} is improper and cannot be sampled: give finite bounds or a "
            "prior such as LogUniform(low, high) or Normal(mean, sd)"
        )
    # The moves take the covariance of one half of the walkers: p + 1 points span p dimensions, no fewer do.
    least = 2 * (len(problem.names) + 1)
    if walkers < least:
        raise InputError(
            f"{walkers} walkers are too few for {len(problem.names)} parameters: at least {least} are needed, "
            "and 64 serve well"
        )
    if max_steps < MIN_STEPS:
        raise InputError(f"max_steps must be at least {MIN_STEPS}; got {max_steps}")
    if resume and backend is None:
        raise InputError("resume=True needs backend, the file that holds the chain")


def seeded(rng: int | np.random.Generator) -> tuple[int | None, np.random.Generator]:
    """Seed, where one is given, and the generator."""
    if isinstance(rng, np.random.Generator):
        return None, rng
    try:
        return int(rng), np.random.default_rng(rng)
    except (TypeError, ValueError) as error:
        raise InputError(f"rng must be a seed (an integer, 0 or more) or a Generator; got {rng!r}") from error
