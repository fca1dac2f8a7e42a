"""What a result leaves open, and what the law of a fit leaves out, in sentences.

The distinct scenes behind the curves of a result: what a report draws and lists once each.

What the law of a fit leaves out, in sentences: friction, finite strain, a paraboloid for a ball.

What a result leaves open, in sentences: other optima, and the second test that would tell.

What a curve says with a face bonded, and with it free to slip, in words.

What speaks against a result: its curve, its fit and its laws.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from underlay.data.curve import Curve
from underlay.data.quality import check_quality
from underlay.errors import UnderlayError
from underlay.inference.compare import compare, compare_bonds
from underlay.inference.design.second_test import remedy
from underlay.inference.profiles import interval_threshold
from underlay.mechanics.discrepancy import finite_strain_excess, why_unmeasured
from underlay.mechanics.indenters import Paraboloid
from underlay.report.intervals import estimates, quantity_with_interval, standing
from underlay.report.labels import is_of_the_sample, label, start
from underlay.scene.parameters import kind_of
from underlay.scene.scene import Scene, has_face
from underlay.units import format_quantity

if TYPE_CHECKING:
    from underlay.inference.compare import BondComparison
    from underlay.inference.least_squares.fit_result import Alternative, Fit
    from underlay.inference.problem import Problem

__all__ = [
    "DistinctScene",
    "advice",
    "bonds_sentences",
    "bonds_told",
    "distinct_scenes",
    "if_it_sticks",
    "model_limits",
    "quality_doubts",
    "reservations",
    "rival_name",
    "rivals",
]


@dataclass(frozen=True)
class DistinctScene:
    """A scene and the curves that were measured on it.

    Parameters
    ----------
    scene : Scene
        With the instrument of the curve that went deepest.
    curves : tuple of int
        Numbers of the curves, from 1.
    reading : float
        Deepest depth reading (m) of that curve.
    label : str
        ``"curve 2"``, ``"curves 1 and 3"``; empty where there is no other scene.
    """

    scene: Scene
    curves: tuple[int, ...]
    reading: float
    label: str

    @property
    def deepest(self) -> float:
        """How deep the tip went since contact (m); zero where it never touched."""
        return max(self.reading - self.scene.instrument.contact_depth, 0.0)


def distinct_scenes(scenes: Sequence[Scene], curves: Sequence[Curve]) -> tuple[DistinctScene, ...]:
    """Group curves by indenter, layer, substrate and compliance; contact point and baseline may differ.

    Parameters
    ----------
    scenes, curves : sequence
        One scene per curve.

    Returns
    -------
    tuple of DistinctScene
        In the order of their first curves.
    """
    groups: list[tuple[Scene, list[int]]] = []
    for number, scene in enumerate(scenes):
        level = replace(
            scene, instrument=replace(scene.instrument, contact_depth=0.0, baseline=0.0, baseline_slope=0.0)
        )
        members = next((members for known, members in groups if known == level), None)
        if members is None:
            groups.append((level, [number]))
        else:
            members.append(number)
    found = []
    for _, members in groups:
        deepest = max(
            members, key=lambda i: float(curves[i].depth.max()) - scenes[i].instrument.contact_depth
        )
        numbers = tuple(number + 1 for number in members)
        label = _label(numbers) if len(groups) > 1 else ""
        found.append(DistinctScene(scenes[deepest], numbers, float(curves[deepest].depth.max()), label))
    return tuple(found)


def _label(numbers: tuple[int, ...]) -> str:
    if len(numbers) == 1:
        return f"curve {numbers[0]}"
    return f"curves {', '.join(map(str, numbers[:-1]))} and {numbers[-1]}"


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


_LEVEL = 0.95


_ORDINALS = ("second", "third", "fourth", "fifth", "sixth", "seventh")


def rivals(result: Fit) -> list[str]:
    """Return one sentence per other optimum that explains the data, or nearly does; most often none.

    Examples
    --------
    ``"A second optimum explains these data as well: layer modulus 0.3311 MPa, layer thickness 0.2276 mm;
    chi-square higher by 3.6. The intervals above reach over it too; ul.profile(fit, name, calibrate=99) says
    how far they can be trusted."``
    """
    return [
        _rival_sentence(result, other, rival_name(place)) for place, other in enumerate(result.alternatives)
    ]


def advice(result: Fit) -> list[str]:
    """Return one sentence per parameter of the sample that stays open: which second tip would fix it.

    Examples
    --------
    ``"Layer thickness: a second test with a 0.5 mm sphere, pressed as deep (force up to 3.7 mN) and fitted
    jointly, would fix it to 4.3 % if it is 1.2 mm or less, but not if it is 2 mm."``
    """
    sentences = []
    for entry in estimates(result):
        is_open = entry.not_fixed or math.isinf(entry.low) or math.isinf(entry.high)
        if not is_open or not is_of_the_sample(entry.name):
            continue
        try:
            found = remedy(result, entry.name)
        except UnderlayError:
            # A fit of several curves, a tip without a radius: nothing to advise.
            continue
        sentences.append(f"{start(label(entry.name))}: {found.sentence}.")
    return sentences


def rival_name(place: int) -> str:
    """Return what the optimum at this place of `Fit.alternatives` is called: ``"second"``."""
    return _ORDINALS[place] if place < len(_ORDINALS) else f"{place + 2}th"


def _rival_sentence(result: Fit, other: Alternative, name: str) -> str:
    shown = [path for path in other.values if is_of_the_sample(path)] or list(other.values)
    numbers = ", ".join(
        f"{label(path)} {format_quantity(other.values[path], kind_of(path))}" for path in shown
    )
    nearly = "" if other.delta_chi_square <= interval_threshold(result, _LEVEL) else "nearly "
    inside = all(other.values[path] in result.interval(path, _LEVEL) for path in shown)
    reach = "reach over it too" if inside else "stop short of it"
    # With two optima intervals from chi-square hold the truth less often than they say.
    return (
        f"A {name} optimum explains these data {nearly}as well: {numbers}; chi-square higher by "
        f"{other.delta_chi_square:.2g}. The intervals above {reach}; ul.profile(fit, name, calibrate=99) says how "
        "far they can be trusted."
    )


# Differences of AIC that count for little, and for much (Burnham and Anderson 2002).
_LITTLE, _MUCH = 2.0, 10.0


def bonds_sentences(told: BondComparison) -> list[str]:
    """Return what each bond gives, and which the data speak for.

    Examples
    --------
    ``"bonded: layer modulus 1.20 kPa (1.10 to 1.30), slipping: layer modulus 1.62 kPa (1.48 to 1.77)."``
    """
    parts = []
    for bond, fit in told.fits.items():
        numbers = [
            f"{label(entry.name)} "
            + (
                f"{format_quantity(entry.value, kind_of(entry.path))}, not fixed"
                if entry.not_fixed
                else quantity_with_interval(entry.value, entry.low, entry.high, kind_of(entry.path))
            )
            for entry in estimates(fit)
            if is_of_the_sample(entry.name)
        ]
        parts.append(f"{bond}: {'; '.join(numbers)}")
    parts += [f"{bond}: no fit, {reason}" for bond, reason in told.refused.items()]
    return [f"{', '.join(parts)} (95 % intervals).", _spoken_for(told.difference)]


def bonds_told(fit: Fit) -> list[str]:
    """Return the same of the face under the layer of a fit; nothing where nothing is under it."""
    if not all(has_face(scene) for scene in fit.problem.base_scenes):
        return []
    if not any(is_of_the_sample(name) for name in fit.names):
        return []
    return bonds_sentences(compare_bonds(fit))


def _spoken_for(difference: float) -> str:
    if math.isnan(difference):
        return "The two cannot be compared."
    size = abs(difference)
    if size < _LITTLE:
        return (
            "The data do not tell which it is: whoever does not know the face must allow for both values "
            f"(AIC differs by {size:.1f})."
        )
    better = "slipping" if difference < 0.0 else "bonded"
    strength = "speak for" if size >= _MUCH else "lean towards"
    return (
        f"The data {strength} the {better} face (AIC lower by {size:.1f}), if nothing else is wrong with the "
        "model."
    )


def quality_doubts(problem: Problem) -> list[str]:
    """Return what speaks against each curve before it is fitted.

    Raises
    ------
    CurveError
        If a curve shows no contact, with the reason.
    """
    doubts: list[str] = []
    for curve, scene in zip(problem.curves, problem.base_scenes, strict=True):
        quality = check_quality(curve, scene)
        quality.require()
        doubts += quality.reasons
    return doubts


def reservations(result: Fit, notes: Iterable[str]) -> list[str]:
    """Return what the reader, the fit and the laws have to say, in that order.

    A second optimum is not among it: it stands beside the headline.
    """
    reader = [str(note) for curve in result.curves for note in curve.metadata.get("notes", ())]

    fitted = [str(warning) for warning in standing(result) if warning.code != "second-optimum"]
    return [*reader, *fitted, *notes]
