"""The problem whose posterior allows for what its fit allows for."""

from __future__ import annotations

from underlay._given import require_given
from underlay.errors import FitError, InputError
from underlay.inference.headline.averaged import averaged_fit
from underlay.inference.least_squares.fitting import quick_fit
from underlay.inference.misfit.marginal import MarginalLikelihood
from underlay.inference.problem import Problem

__all__ = ["marginalised"]


def marginalised(problem: Problem) -> Problem:
    """Return the problem with noise and misfit averaged over in its likelihood.

    `sample` does this itself; a sampler of one's own takes `log_posterior` of what this returns. Correlated noise,
    a law that drifts with depth (where nothing of the shape is free also a layer that relaxes, or a base under a
    half-space), a force at contact and a baseline that creeps take part by their weights, on blocks of the curves,
    as they do in the intervals of `fit`.

    Parameters
    ----------
    problem : Problem
        What is sampled.

    Returns
    -------
    Problem
        The same where its noise is stated, is itself fitted, or leaves nothing to average (a curve without noise).

    Examples
    --------
    >>> import numpy as np
    >>> from underlay import Isotropic, Layer, LogUniform, Noise, Paraboloid, RIGID, Scene, synthesize
    >>> scene = Scene(Paraboloid(1e-3), Layer(Isotropic(1e6, 0.45), 1e-3), RIGID)
    >>> curve = synthesize(scene, np.linspace(-1e-5, 5e-5, 100), Noise(force=2e-4), rng=1)
    >>> problem = Problem(scene, curve, {"layer.E": LogUniform(1e4, 1e8)})
    >>> marginalised(problem).likelihood is None
    False
    >>> stated = problem.revised(noise=Noise())
    >>> marginalised(stated) is stated
    True
    """
    require_given(problem, "problem", Problem)
    if not problem.noise_is_open or problem.likelihood is not None:
        return problem
    try:
        averaged = averaged_fit(quick_fit(problem))
        return problem if averaged is None else problem.with_likelihood(MarginalLikelihood.of(averaged))
    except (FitError, InputError):
        # No optimum with a law about which anything could be averaged: the sampler itself says what is wrong.
        return problem
