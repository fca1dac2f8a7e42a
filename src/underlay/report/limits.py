"""Sentences on what a result leaves undetermined, and on what speaks against it.

Undetermined are: which of several optima holds (`rivals`), parameters that only a second test would fix (`advice`),
and whether a face is bonded or free to slip (`bonds_sentences`). Against a result speak doubts about its curve
(`quality_doubts`). `distinct_scenes`
groups the curves of a joint fit, so that a report draws and lists each scene once.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

from underlay.data.curve import Curve
from underlay.data.quality import check_quality
from underlay.errors import UnderlayError
from underlay.inference.design.second_test import second_test
from underlay.inference.profiling.profile_result import interval_threshold
from underlay.report.labels import is_of_the_sample, label, listed, start
from underlay.report.screen import answer_text
from underlay.scene.parameters import kind_of
from underlay.scene.scene import Scene
from underlay.units import format_quantity

if TYPE_CHECKING:
    from underlay.inference.compare import BondComparison
    from underlay.inference.least_squares.fit_result import Fit
    from underlay.inference.problem import Problem

_LEVEL = 0.95
_ORDINALS = ("second", "third", "fourth", "fifth", "sixth", "seventh")
# Differences of AIC that count for little, and for much (Burnham and Anderson 2002).
_LITTLE, _MUCH = 2.0, 10.0


@dataclass(frozen=True)
class DistinctScene:
    """One of the different scenes of a joint fit, with the curves that were measured on it.

    Parameters
    ----------
    scene : Scene
        The scene, with the instrument of the curve that went deepest.
    curves : tuple of int
        Numbers of the curves, from 1.
    reading : float
        Largest depth reading (m) of that curve.
    label : str
        ``"curve 2"``, ``"curves 1 and 3"``; empty if all curves have the same scene.
    """

    scene: Scene
    curves: tuple[int, ...]
    reading: float
    label: str

    @property
    def deepest(self) -> float:
        """Largest indentation of the deepest curve, from its contact point (m); zero where it never touched."""
        return max(self.reading - self.scene.instrument.contact_depth, 0.0)


def distinct_scenes(scenes: Sequence[Scene], curves: Sequence[Curve]) -> tuple[DistinctScene, ...]:
    """Group curves whose scenes agree in all but contact point and baseline of the instrument.

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
        name = f"curve{'s' if len(numbers) > 1 else ''} {listed([str(number) for number in numbers])}"
        label = name if len(groups) > 1 else ""
        found.append(DistinctScene(scenes[deepest], numbers, float(curves[deepest].depth.max()), label))
    return tuple(found)


def rivals(result: Fit) -> list[str]:
    """Return one sentence per other optimum that explains the data, or nearly does; most often none.

    Examples
    --------
    ``"A second optimum explains these data as well: layer modulus 0.3311 MPa, layer thickness 0.2276 mm;
    chi-square higher by 3.6. The intervals reach over it too; a posterior shows how far they can be trusted."``
    """
    sentences = []
    for place, other in enumerate(result.alternatives):
        shown = [path for path in other.values if is_of_the_sample(path)] or list(other.values)
        numbers = ", ".join(
            f"{label(path)} {format_quantity(other.values[path], kind_of(path))}" for path in shown
        )
        nearly = "" if other.delta_chi_square <= interval_threshold(result, _LEVEL) else "nearly "
        inside = all(other.values[path] in result.interval(path, _LEVEL) for path in shown)
        reach = "reach over it too" if inside else "stop short of it"
        # With two optima intervals from chi-square hold the truth less often than they say.
        sentences.append(
            f"A {rival_name(place)} optimum explains these data {nearly}as well: {numbers}; chi-square higher by "
            f"{other.delta_chi_square:.2g}. The intervals {reach}; a posterior shows how far they can "
            "be trusted."
        )
    return sentences


def advice(result: Fit) -> list[str]:
    """Return a sentence for each parameter of the sample with an open interval: which second tip would fix it.

    Examples
    --------
    ``"Layer thickness: a second test with a 0.5 mm sphere, pressed as deep (force up to 3.7 mN) and fitted
    jointly, would fix it to 4.3 % if it is 1.2 mm or less, but not if it is 2 mm."``
    """
    sentences = []
    for name in filter(is_of_the_sample, result.names):
        if not result.interval(name, part="statistical").is_open:
            continue
        try:
            found = second_test(result, name)
        except UnderlayError:
            # A fit of several curves, a tip without a radius: nothing to advise.
            continue
        sentences.append(f"{start(label(name))}: {found.sentence}.")
    return sentences


def rival_name(place: int) -> str:
    """Return the ordinal of an entry of `Fit.alternatives` (from 0) among all optima: ``"second"`` for entry 0."""
    return _ORDINALS[place] if place < len(_ORDINALS) else f"{place + 2}th"


def bonds_sentences(told: BondComparison) -> list[str]:
    """Return two sentences: the fit for each bond (bonded, slipping), and which of them the data support by AIC.

    Examples
    --------
    ``"bonded: layer modulus 1.20 ± 0.10 kPa; slipping: layer modulus 1.62 ± 0.14 kPa."``
    """
    parts = []
    for bond, fit in told.fits.items():
        numbers = [
            f"{label(name)} {answer_text(fit.answer(name), parts=False)}"
            for name in fit.names
            if is_of_the_sample(name)
        ]
        parts.append(f"{bond}: {', '.join(numbers)}")
    parts += [f"{bond}: no fit, {reason}" for bond, reason in told.refused.items()]
    return [f"{'; '.join(parts)} (95 % intervals).", _spoken_for(told.difference)]


def _spoken_for(difference: float) -> str:
    if math.isnan(difference):
        return "The two cannot be compared."
    size = abs(difference)
    if size < _LITTLE:
        return (
            "The data do not show which it is: unless the face is known, allow for both values "
            f"(AIC differs by {size:.1f})."
        )
    better = "slipping" if difference < 0.0 else "bonded"
    strength = "favour" if size >= _MUCH else "slightly favour"
    return (
        f"The data {strength} the {better} face (AIC lower by {size:.0f}), if nothing else is wrong with the "
        "model."
    )


def quality_doubts(problem: Problem, *, require: bool = True) -> list[str]:
    """Return the reasons to doubt each curve that `check_quality` finds before a fit, each once.

    Raises
    ------
    CurveError
        If `require` is true and a curve shows no contact; the message says why.
    """
    doubts: list[str] = []
    for curve, scene in zip(problem.curves, problem.base_scenes, strict=True):
        quality = check_quality(curve, scene)
        if require:
            quality.require()
        doubts += quality.reasons
    return list(dict.fromkeys(doubts))
