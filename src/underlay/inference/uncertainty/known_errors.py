"""Known errors of a contact law, whose size is only roughly known.

A paraboloid stands for a sphere, a frictionless law for a tip without slip, small strains for finite ones: the
shape of such an error over the depth can be computed, its size is uncertain, and residuals cannot distinguish it
from another thickness. It enters a fit's budget as a column with a prior,

    reading = F(theta) + sum_i amplitude_i column_i(theta) + ...,   amplitude_i ~ N(mean_i, deviation_i^2),

F being the model at the parameters theta (`budget`): the interval of every parameter is widened by the error, and a
mean that is not zero shifts it.

To add one, write a function that returns the error for the scenes that have it, and name it in `KINDS`::

    def _column(test: Pressed) -> FloatArray:
        return 0.05 * test.force * test.law.contact_radius(test.depth) / test.values["indenter.radius"]

    def soft_tip(scene: Scene) -> KnownError | None:
        if scene.indenter.curvature_radius is None:
            return None
        return KnownError("the tip gives way", _column, mean=1.0, deviation=0.5)

A column is the force (N) that the error adds to the law at amplitude one, smooth in depth and zero up to contact.
It is computed from depths, contact radii and forces of the law at the optimum. Where only the magnitude of the
error is known, use mean 0; where theory gives its size, mean 1 and the share by which theories differ. Curves of a
joint fit share the amplitude of an error of the same words.

Friction and finite strain are errors of a law whose scene does not say that they are absent (`left_out`). Real
friction lies between none and full, and the laws without friction and without slip bracket it to 0.03 %: the error
is a share of their difference between 0 and 1, with a normal prior here. Finite strain has a computed shape
(`mechanics/finite_strain`) and a size that depends on the unknown strain energy: 1 +- 0.5. The two do not add: the
further effect of friction in large strains has a computed shape too, and a size between a part subtracted (nu =
0.3) and nearly all of it added (nu = 0.49). A posterior may have these three as parameters (`free_model_error`),
with the same priors.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import chain
from typing import NamedTuple, TypeAlias

import numpy as np

from underlay._arrays import FloatArray
from underlay._given import require_given
from underlay.errors import InputError
from underlay.inference.priors import Normal
from underlay.inference.problem import Problem
from underlay.mechanics.contact_law import ContactLaw
from underlay.mechanics.discrepancy import (
    finite_strain_excess,
    friction_in_large_strains,
    require_measured,
    why_unmeasured,
)
from underlay.mechanics.finite_width import NarrowLaw
from underlay.mechanics.solvers import Exact, Stuck
from underlay.mechanics.stiffening.law import StiffeningLaw
from underlay.scene.discrepancy import BOTH_PATH, FINITE_STRAIN_PATH, FRICTION_PATH, Discrepancy
from underlay.scene.scene import Scene

#: `words` of the errors of friction, finite strain, and both.
FRICTION, FINITE_STRAIN, BOTH = "friction", "finite strain", "friction in large strains"
# Standard deviation of the share of full friction, about a mean of a half. A flat prior between none and full has
# its ends outside every 95 % interval, and both a frictionless tip and one without slip are common: there it covers
# 75 % where this covers 92 (a modulus at 0.3 % noise; 84 to 87 and 90 to 92 with the thickness free), for intervals
# up to 1.4 times as long (tests/studies/results/friction_prior.csv).
_SHARE = 0.35
# Relative tolerance of the laws from which the columns are computed, which are known to a tenth at best.
_RTOL = 1e-4
_PATHS = {FRICTION: FRICTION_PATH, FINITE_STRAIN: FINITE_STRAIN_PATH, BOTH: BOTH_PATH}


class Pressed(NamedTuple):
    """State of a test at given values of its parameters, from which a known error is computed.

    Parameters
    ----------
    values : mapping of str to float
        Every number of the scene (SI), by its path.
    law : ContactLaw
        Contact law at these numbers.
    depth : FloatArray
        Indentation depth w (m), (n,), negative before contact.
    force, stiffness : FloatArray
        Contact force P (N) of the law and dP/dw (N/m), each (n,).
    scene : Scene
        The scene with these values.
    """

    values: Mapping[str, float]
    law: ContactLaw
    depth: FloatArray
    force: FloatArray
    stiffness: FloatArray
    scene: Scene


#: Function from the state of a test to the force (N), (n,), that an error of amplitude one adds.
Column: TypeAlias = Callable[[Pressed], FloatArray]


@dataclass(frozen=True)
class KnownError:
    """An error of the law with a known shape and a prior of its size.

    Parameters
    ----------
    words : str
        What it is, to complete "the intervals allow for ...".
    column : callable
        Force (N) at amplitude one, (n,), of a `Pressed`.
    mean, deviation : float
        Mean and standard deviation of the normal prior of the amplitude; the deviation positive.
    size : str
        How large it is, as people write it; empty where that is no one number.

    Raises
    ------
    InputError
        If the deviation is not positive.
    """

    words: str
    column: Column
    mean: float = 0.0
    deviation: float = 1.0
    size: str = ""

    def __post_init__(self) -> None:
        """Refuse a standard deviation that is not positive."""
        if not self.deviation > 0.0:
            raise InputError(
                f"deviation of {self.words!r} must be positive; got {self.deviation!r}: an error of exactly known "
                "size belongs into the law"
            )


def paraboloid_for_sphere(scene: Scene) -> KnownError | None:
    """Return the error of a paraboloid that stands for a sphere; none for other tips.

    A tip whose shape is higher by df(r) presses, at the same depth and to first order, with a force that is
    lower by its mean under the pressure of a flat punch of the contact radius times the stiffness dP/dw (the
    contact's edge carries no pressure, so its motion counts in second order). A sphere is higher than its
    paraboloid r^2 / (2 R) by r^4 / (8 R^3), R the radius, and under the punch of radius a on a half-space, p ~
    (a^2 - r^2)^(-1/2), the mean of r^4 is 8 a^4 / 15:

        P_sphere - P_paraboloid = - dP/dw a^4 / (15 R^3).

    Under the uniform pressure of a thin compressible layer it is a^4 / (24 R^3), under the parabola of a thin
    incompressible one a^4 / (48 R^3): an amplitude of 0.3 to 1, or 0 where the tip is a paraboloid after all.
    """
    tip = scene.indenter
    if tip.curvature_radius is None or tip.power_law is not tip:
        return None
    return KnownError("a tip that is a sphere, not a paraboloid", _column)


def _column(test: Pressed) -> FloatArray:
    a = test.law.contact_radius(test.depth)
    return -test.stiffness * a**4 / (15.0 * test.values["indenter.radius"] ** 3)


def stiffening_formula(scene: Scene) -> KnownError | None:
    """Return the error of the stiffening factor G's formula, 3 % of G - 1 (one sigma); None without stiffening."""
    if scene.layer.stiffening is None:
        return None
    return _of_law("stiffening formula", "stiffening", "± 6 % of G - 1")


def sides(scene: Scene) -> KnownError | None:
    """Return the error of the spring that represents the free sides of a sample; None without sides."""
    return _of_law("sides", "sides", "± 8 % of their spring") if scene.layer.has_sides else None


def _of_law(words: str, name: str, size: str) -> KnownError:
    """The error that a law of a layer that stiffens or has sides tells itself, by its name there."""

    def column(test: Pressed) -> FloatArray:
        if not isinstance(test.law, StiffeningLaw | NarrowLaw):
            raise InputError(f"the law {test.law.method} has no such error")
        return test.law.known_errors(test.depth)[name]

    return KnownError(words, column, size=size)


#: Every kind of error: a function that returns the error of a scene's law, or None where it has none.
KINDS: Sequence[Callable[[Scene], KnownError | None]] = (
    paraboloid_for_sphere,
    stiffening_formula,
    sides,
)


def known_errors(scenes: Sequence[Scene]) -> tuple[KnownError, ...]:
    """Return the known errors of the laws of these scenes, each once."""
    errors = (kind(scene) for scene in scenes for kind in KINDS)
    found: dict[str, KnownError] = {}
    for error in errors:
        if error is not None:
            found.setdefault(error.words, error)
    return tuple(found.values())


class LeftOut(NamedTuple):
    """Errors of friction and finite strain that the law of a scene leaves out.

    Parameters
    ----------
    errors : tuple of KnownError
        Errors whose shape over the depth can be computed.
    unknown : tuple of str
        In words, errors whose shape cannot be computed, and why.
    declared : tuple of str
        In words, what the scene states about friction and finite strain.
    """

    errors: tuple[KnownError, ...] = ()
    unknown: tuple[str, ...] = ()
    declared: tuple[str, ...] = ()


def left_out(scene: Scene, depth: float) -> LeftOut:
    """Errors of friction and finite strain that the law of a scene leaves out, for depths up to `depth` (m).

    Raises
    ------
    InputError
        If the scene asks for finite strain where its effect was not computed.
    """
    if scene.discrepancy is not None:
        return LeftOut(declared=("the sizes of friction and finite strain",))
    parts = (_friction(scene), _finite_strain(scene, depth), _both(scene, depth))
    return LeftOut._make(tuple(chain(*own)) for own in zip(*parts, strict=True))


def _friction(scene: Scene) -> LeftOut:
    if scene.friction != "unknown":
        return LeftOut(declared=(f'friction = "{scene.friction}"',))
    if not scene.is_elastic:
        return LeftOut(unknown=(f"{FRICTION} beside adhesion or relaxation",))
    return LeftOut((KnownError(FRICTION, _stuck_less_free, mean=0.5, deviation=_SHARE),))


def _stuck_less_free(test: Pressed) -> FloatArray:
    sticks, free = _forces(test)
    return np.asarray(test.force * (np.divide(sticks, free, out=np.ones_like(free), where=free > 0.0) - 1.0))


def _forces(test: Pressed) -> tuple[FloatArray, FloatArray]:
    """Contact forces (N), (n,) each, of a tip without slip and of a frictionless one, both exact at this depth."""
    inside = np.maximum(test.depth, 0.0)
    deepest, elastic = float(inside.max()), test.scene.elastic
    sticks, free = (elastic.contact_law(deepest, solver=own(_RTOL)).force(inside) for own in (Stuck, Exact))
    return sticks, free


def _both(scene: Scene, depth: float) -> LeftOut:
    unknown = scene.friction == "unknown" and scene.finite_strain is not False
    if not (unknown and scene.is_elastic) or why_unmeasured(scene.contact, depth):
        return LeftOut()
    return LeftOut((KnownError(BOTH, _stuck_in_large_strains, mean=0.25, deviation=0.5),))


def _stuck_in_large_strains(test: Pressed) -> FloatArray:
    sticks, free = _forces(test)
    further = friction_in_large_strains(test.scene.contact, sticks, free, test.depth)
    return np.asarray(test.force * further)


def _finite_strain(scene: Scene, depth: float) -> LeftOut:
    if scene.finite_strain is False:
        return LeftOut(declared=("finite_strain = false",))
    if scene.layer.stiffening is not None:
        return LeftOut((_of_law(FINITE_STRAIN, "finite strain", "± 0.8 to 1.4 %"),))
    why = why_unmeasured(scene.contact, depth)
    if not scene.is_elastic:
        why = "measured without adhesion and relaxation"
    if not why:
        return LeftOut((KnownError(FINITE_STRAIN, _excess, mean=1.0, deviation=0.5),))
    if scene.finite_strain:
        require_measured(scene.contact, depth)
    return LeftOut(unknown=(f"{FINITE_STRAIN} is beyond what is known here ({why})",))


def _excess(test: Pressed) -> FloatArray:
    inside = np.maximum(test.depth, 0.0)
    excess = finite_strain_excess(test.scene.contact, inside, test.law.contact_radius(inside))
    return np.asarray(test.force * excess)


def free_model_error(problem: Problem) -> Problem:
    """Make the sizes of friction and finite strain free parameters where the scenes do not state them.

    Parameters
    ----------
    problem : Problem
        A problem in whose scenes friction, finite strain or both are not stated.

    Returns
    -------
    Problem
        The problem, for a posterior, with further parameters, shared by all curves: ``discrepancy.friction``, the
        share of full friction; ``discrepancy.finite_strain``, the effect of finite strain over that of a
        neo-Hookean layer; and ``discrepancy.friction_in_large_strains``, the effect of friction beyond that of
        small strains, over its computed shape. Their priors are those that `Fit.answer` takes for them: Normal(0.5,
        0.35), Normal(1, 0.5) and Normal(0.25, 0.5).

    Raises
    ------
    InputError
        If neither can be made free, with the reasons.

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
    # Only errors that all curves leave unknown become free: one that a single curve states is known for the
    # specimen.
    known = set(_PATHS).intersection(*({error.words for error in part.errors} for part in parts))
    errors = {error.words: error for error in parts[0].errors if error.words in known}
    if not errors:
        why = dict.fromkeys(words for part in parts for words in (*part.unknown, *part.declared))
        raise InputError(f"no size of friction or finite strain can be freed here: {'; '.join(why)}")
    means = {words: errors[words].mean if words in errors else 0.0 for words in _PATHS}
    discrepancy = Discrepancy(means[FRICTION], means[FINITE_STRAIN], means[BOTH])
    scenes = [
        replace(scene, discrepancy=discrepancy, friction="unknown", finite_strain=None)
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
