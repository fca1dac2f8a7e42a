"""Priors from the words and numbers of a scene file."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from underlay.errors import InputError
from underlay.inference.priors.densities import HalfNormal, LogNormal, LogUniform, Normal, Uniform
from underlay.inference.priors.prior import Given

__all__ = ["prior_from_numbers"]


def prior_from_numbers(name: str | None, low: float, high: float, numbers: Mapping[str, float]) -> Given:
    """Make what `Problem` takes for one free parameter from the words of a scene file.

    Parameters
    ----------
    name : str or None
        ``"uniform"``, ``"loguniform"``, ``"normal"`` (mean; sd or relative_sd), ``"lognormal"`` (median;
        relative_sd, the deviation of ln x), ``"halfnormal"`` (sd), or None: bounds only.
    low, high : float
        Bounds (SI), infinite where there are none; they truncate the prior.
    numbers : mapping
        mean, sd, median, relative_sd.

    Returns
    -------
    Prior, tuple of float, or None
        None where nothing at all is said.

    Raises
    ------
    InputError
        If the name is unknown or a number is missing.
    """
    if name is None:
        return None if (low, high) == (-np.inf, np.inf) else (low, high)
    given = dict(numbers)

    def take(key: str) -> float:
        if key not in given:
            raise InputError(f"prior {name!r} needs {key!r}; given: {', '.join(sorted(given)) or 'nothing'}")
        return given[key]

    if name == "uniform":
        return Uniform(low, high)
    if name == "loguniform":
        return LogUniform(low, high)
    if name == "normal":
        mean = take("mean")
        sd = given["sd"] if "sd" in given else take("relative_sd") * abs(mean)
        return Normal(mean, sd).truncated(low, high)
    if name == "lognormal":
        return LogNormal(take("median"), take("relative_sd")).truncated(low, high)
    if name == "halfnormal":
        return HalfNormal(take("sd")).truncated(low, high)
    raise InputError(
        f"unknown prior {name!r}; known: uniform, loguniform, normal, lognormal, halfnormal, or none"
    )
