"""What the law of a fit leaves out, in sentences: friction, finite strain, a paraboloid for a ball."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from underlay.errors import UnderlayError
from underlay.inference.compare import compare
from underlay.mechanics.finite_strain import finite_strain_excess, why_unmeasured
from underlay.mechanics.indenters import Paraboloid
from underlay.report.distinct_scenes import DistinctScene, distinct_scenes
from underlay.report.labels import is_of_the_sample, label, start
from underlay.scene.parameters import kind_of
from underlay.units import format_quantity

if TYPE_CHECKING:
    from underlay.inference.least_squares.fit_result import Fit

__all__ = ["if_it_sticks", "model_limits"]

# Where friction counts: nearly incompressible layers that are not thick against the contact.
_INCOMPRESSIBLE, _WIDE = 0.4, 0.5
# Where a paraboloid for a ball is worse than small strains are: 3 to 17 % (finite elements).
_BALL_NU, _BALL_DEPTH, _BALL_THICKNESS = 0.45, 0.1, 2.0
# Depths at which finite strain is held against the noise, and what is left of a range that is worth proposing.
_LOOKS, _WORTH = 200, 0.25
# Share of the deepest point from which on the rest is not worth leaving out: there it hardly exceeds the noise.
_ENOUGH = 0.9


def model_limits(result: Fit) -> list[str]:
    """Return what the law leaves out of this fit, and what can be done about it; a sentence each."""
    told = result.allowed_for
    sentences = []
    if told.declared:
        sentences.append(f"The scene says {' and '.join(told.declared)}: the intervals believe it.")
    where = " of such a curve" if len(result.curves) > 1 else ""
    sentences += [f"{start(words)}: the intervals do not allow for that{where}." for words in told.unknown]
    tests = [test for test in distinct_scenes(result.scenes, result.curves) if test.deepest > 0.0]
    sentences += [words for test in tests for words in (_ball(test), _range(result, test)) if words]
    sentences += [words for words in (if_it_sticks(result, tests),) if words]
    return list(dict.fromkeys(sentences))


def if_it_sticks(result: Fit, tests: list[DistinctScene]) -> str:
    """Return what the sample's numbers would be with a tip that sticks; empty where that is no matter.

    Examples
    --------
    ``"If the tip sticks in place of sliding, layer modulus is 0.497 MPa."``
    """
    if not any(_feels_friction(result, test) for test in tests):
        return ""
    try:
        stuck = compare(result.problem, ["stuck"]).fits.get("stuck")
    except UnderlayError:
        return ""
    if stuck is None:
        return ""
    numbers = [
        f"{label(name)} is {format_quantity(_moved(result, stuck, name), kind_of(name))}"
        for name in result.names
        if is_of_the_sample(name)
    ]
    return f"If the tip sticks in place of sliding, {' and '.join(numbers)}." if numbers else ""


def _moved(result: Fit, stuck: Fit, name: str) -> float:
    """The stated value of a parameter, moved as sticking moves that of least squares."""
    coordinate = result.problem.coordinates[result.names.index(name)]
    before, after, stated = (
        float(coordinate.scaled(value))
        for value in (result.values[name], stuck.values[name], result.interval(name).value)
    )
    return float(coordinate.physical(np.asarray(stated + after - before)))


def _feels_friction(result: Fit, test: DistinctScene) -> bool:
    scene = test.scene
    if (
        scene.friction != "unknown"
        or scene.discrepancy is not None
        or scene.adhesion is not None
        or scene.memory is not None
    ):
        return False
    if scene.substrate is None or not scene.layer.material.nu > _INCOMPRESSIBLE:
        return False
    law = scene.contact_law(test.deepest, solver=result.solver)
    return float(law.contact_radius(test.deepest)) > _WIDE * scene.layer.thickness


def _ball(test: DistinctScene) -> str:
    """A paraboloid that is probably a ball, where that is the largest error."""
    tip, scene = test.scene.indenter, test.scene
    if not isinstance(tip, Paraboloid) or scene.substrate is None:
        return ""
    thin = scene.layer.thickness <= _BALL_THICKNESS * tip.radius
    if not (scene.layer.material.nu >= _BALL_NU and thin and test.deepest > _BALL_DEPTH * tip.radius):
        return ""
    return (
        f"The tip is declared a paraboloid and pressed {test.deepest / tip.radius:.2g} R deep: if it is a ball, "
        "declare a sphere. On nearly incompressible layers of up to 2 R a paraboloid is off by 3 to 17 % there, a "
        "true sphere in small strains by 1 to 4 %."
    )


def _range(result: Fit, test: DistinctScene) -> str:
    """The depth from which finite strain exceeds the noise, as a range to fit."""
    contact, scene = test.scene.contact, test.scene
    if (
        scene.finite_strain is False
        or scene.discrepancy is not None
        or scene.adhesion is not None
        or scene.memory is not None
    ):
        return ""
    if why_unmeasured(contact, test.deepest):
        return ""
    depth = test.deepest * np.linspace(0.0, 1.0, _LOOKS + 1)[1:]
    law = scene.contact_law(test.deepest, solver=result.solver)
    excess = law.force(depth) * finite_strain_excess(contact, depth, law.contact_radius(depth))
    noise = min(float(np.std(residual)) for residual in result.residuals)
    beyond = np.flatnonzero(np.abs(excess) > noise)
    if not beyond.size or not math.isfinite(noise):
        return ""
    first = float(depth[beyond[0]])
    if not _WORTH * test.deepest <= first < _ENOUGH * test.deepest:
        return ""
    written = format_quantity(first, "length")
    return (
        f"Beyond a depth of {written} into the sample finite strain exceeds the noise: to leave that out, fit the "
        f'curve up to there (fit_to = "{written}" in [curve]).'
    )
