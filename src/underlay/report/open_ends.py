"""What a result leaves open, in sentences: other optima, and the second test that would tell."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

from underlay.errors import UnderlayError
from underlay.inference.design.second_test import remedy
from underlay.inference.profiles import interval_threshold
from underlay.report.intervals import estimates
from underlay.report.labels import is_of_the_sample, label, start
from underlay.scene.parameters import kind_of
from underlay.units import format_quantity

if TYPE_CHECKING:
    from underlay.inference.least_squares.fit_result import Alternative, Fit

__all__ = ["advice", "rival_name", "rivals"]

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
