"""What laws leave out as parameters of a problem, with the priors of the interval with model error."""

from __future__ import annotations

from dataclasses import replace

from underlay._given import require_given
from underlay.errors import InputError
from underlay.inference.misfit.left_out import BOTH, FINITE_STRAIN, FRICTION, left_out
from underlay.inference.priors import Normal
from underlay.inference.problem import Problem
from underlay.scene.discrepancy import BOTH_PATH, FINITE_STRAIN_PATH, FRICTION_PATH, Discrepancy

__all__ = ["free_model_error"]

_PATHS = {FRICTION: FRICTION_PATH, FINITE_STRAIN: FINITE_STRAIN_PATH, BOTH: BOTH_PATH}


def free_model_error(problem: Problem) -> Problem:
    """Free the sizes of friction and finite strain, as far as the scenes leave them unknown: for a posterior.

    Parameters
    ----------
    problem : Problem
        Its scenes say nothing, or not everything, of friction and finite strain.

    Returns
    -------
    Problem
        The same with ``discrepancy.friction``, the share of full friction, ``discrepancy.finite_strain``, over
        that of a neo-Hookean layer, and ``discrepancy.friction_in_large_strains``, what friction adds to finite
        strain alone, over a measured shape, as parameters, shared by all curves, with the priors of
        ``fit.interval(name, model_error=True)``: Normal(0.5, 0.35), Normal(1, 0.5) and Normal(0.25, 0.5).

    Raises
    ------
    InputError
        If nothing is unknown that could be freed, with the reasons.

    Examples
    --------
    >>> import numpy as np, underlay as ul
    >>> ball = ul.Scene(ul.Sphere(1e-3), ul.Layer(ul.Isotropic(1e6, 0.49), 1e-3), ul.RIGID)
    >>> curve = ul.simulate(ball, np.linspace(0.0, 1e-4, 50))
    >>> problem = ul.Problem(ball, curve, {"layer.E": ul.LogUniform(1e5, 1e7)}, ul.Noise(force=1e-4))
    >>> ul.free_model_error(problem).names
    ('layer.E', 'discrepancy.friction', 'discrepancy.finite_strain', 'discrepancy.friction_in_large_strains')
    """
    require_given(problem, "problem", Problem)
    parts = [
        left_out(scene, max(float(curve.depth.max()) - scene.instrument.contact_depth, 0.0))
        for scene, curve in zip(problem.base_scenes, problem.curves, strict=True)
    ]
    # What is unknown of one curve alone is not known of the specimen: only what all have is freed.
    known = set(_PATHS).intersection(*({error.words for error in part.errors} for part in parts))
    errors = {error.words: error for error in parts[0].errors if error.words in known}
    if not errors:
        why = dict.fromkeys(words for part in parts for words in (*part.unknown, *part.declared))
        raise InputError(f"no size of friction or finite strain can be freed here: {'; '.join(why)}")
    means = {words: errors[words].mean if words in errors else 0.0 for words in _PATHS}
    told = Discrepancy(means[FRICTION], means[FINITE_STRAIN], means[BOTH])
    scenes = [
        replace(scene, discrepancy=told, friction="unknown", finite_strain=None)
        for scene in problem.base_scenes
    ]
    priors = {_PATHS[words]: Normal(error.mean, error.deviation) for words, error in errors.items()}
    return Problem.joint(
        list(zip(scenes, problem.curves, strict=True)),
        {**problem.free, **priors},
        [*problem.shared, *(priors if len(scenes) > 1 else ())],
        problem.noise,
        solver=problem.solver,
    )
