"""What a curve says with a face bonded, and with it free to slip, in words."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

from underlay.inference.bonding import compare_bonds
from underlay.report.interval_words import quantity_with_interval
from underlay.report.intervals import estimates
from underlay.report.labels import is_of_the_sample, label
from underlay.scene.faces import has_face
from underlay.scene.parameters import kind_of
from underlay.units import format_quantity

if TYPE_CHECKING:
    from underlay.inference.bonding import BondComparison
    from underlay.inference.least_squares.fit_result import Fit

__all__ = ["bonds_sentences", "bonds_told"]

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
