"""Whether a fit is to be believed: by the weights of what its residuals may be, not by a test."""

from __future__ import annotations

import math
from collections.abc import Callable

from underlay.inference.least_squares.fit_result import Fit, StatedInterval, Verdict
from underlay.inference.misfit.averaging import Averaged
from underlay.inference.misfit.sizes import shape_parameters
from underlay.units import format_quantity

__all__ = ["DOUBTFUL", "GOOD", "MODEL_WRONG", "verdict"]

GOOD, DOUBTFUL, MODEL_WRONG = "good", "doubtful", "model wrong"

# Probabilities of an exact law and of no jump below which they are given up.
_EXACT, _SMOOTH = 0.01, 0.1
# Probability of a drift from which on what is read off the shape of the curve is in doubt, and the drift named.
_POSSIBLE, _NAMED = 0.05, 0.05
# Probability of white noise on a level baseline below which these are given up (a line and a slow noise share the
# evidence of either), and the share of the force from which on such a curve is one to be looked at: of 25 random
# walks by 3 to 6 % of the force 2 stay below it, of 25 curves with white noise none is above.
_STEADY, _LARGE = 0.1, 0.01
# Times by which the noise deep in contact is louder than before contact from which on it is said.
_LOUDER = 2.0
# Logarithm of the largest factor by which a drift is said to move a parameter.
_FACTOR = 2.0
# Half of an interval of ln E that fixes nothing.
_WIDE = 0.5
# Warnings of the fit that make its numbers doubtful. Correlated residuals do not where they are averaged over.
_DOUBTS = ("not-converged", "bound", "law-range", "too-deep", "file", "over-whitened", "prior")


def verdict(
    fit: Fit, averaged: Averaged | None, interval: Callable[[str], StatedInterval], *, strays: bool = False
) -> Verdict:
    """Verdict of a fit, with the reasons; `interval` gives that of a parameter, which may be a walk.

    `strays` says that averaging over noise and misfit left the least-squares values.
    """
    wrong, doubts = ([], []) if averaged is None else _of_the_residuals(fit, averaged)
    if averaged is None and fit.problem.noise_is_open and fit.statistics.robust == "none":
        doubts.append("what the residuals are could not be weighed: the interval is that of white noise")
    if strays:
        doubts.append(
            "correlated noise or misfit would move the values by more than its own interval: these are the "
            "least-squares values, with the interval of correlated residuals"
        )
    doubts += [] if averaged is None or wrong else _of_the_shape(fit, averaged)
    doubts += _of_the_intervals(fit, interval)
    counted = _DOUBTS if averaged is not None else (*_DOUBTS, "correlated-residuals")
    if fit.alternatives:
        doubts.append("other values explain the data as well, or nearly")
    doubts += [warning.message for warning in fit.warnings if warning.code in counted]
    word = MODEL_WRONG if wrong else DOUBTFUL if doubts else GOOD
    return Verdict(word, (*wrong, *doubts))


def _of_the_residuals(fit: Fit, averaged: Averaged) -> tuple[list[str], list[str]]:
    """What is wrong, and what is to be looked at, by the weights."""
    law, contact = _of_the_law(averaged), _of_the_contact(averaged)
    readings = [*_of_the_baseline(averaged), *_of_the_noise(averaged)]
    if any(scene.adhesion is not None for scene in fit.problem.base_scenes):
        # A law of adhesion says itself which force there is at contact: another one is its error.
        return [*law, *contact], readings
    return law, [*contact, *readings]


def _of_the_law(averaged: Averaged) -> list[str]:
    if averaged.exact_law >= _EXACT:
        return []
    change = max(averaged.drifts, key=abs)
    size = f"{100.0 * change:+.2g} % from contact to full depth"
    return [f"the apparent modulus changes by {size}; E is that at contact"]


def _of_the_shape(fit: Fit, averaged: Averaged) -> list[str]:
    """What a drift that the data cannot exclude would do to a parameter that it looks like."""
    if 1.0 - averaged.exact_law < _POSSIBLE:
        return []
    reasons = []
    for name in shape_parameters(fit.problem):
        index = fit.names.index(name)
        if fit.problem.coordinates[index].scale is None and index not in averaged.blocked.held:
            reasons.append(
                f"{name} is read off the shape of the curve: a law {100.0 * _NAMED:g} % stiffer at full depth, "
                f"which these data do not exclude, would move it by {_in_words(averaged.moved_by(index, _NAMED))}"
            )
    return reasons


def _in_words(moved: float) -> str:
    """A change of a logarithm, to first order: beyond a factor of 7 the first order says nothing but that."""
    if abs(moved) > _FACTOR:
        return f"a factor of {math.exp(_FACTOR):.0f} or more"
    return f"{100.0 * math.expm1(moved):+.2g} %"


def _of_the_contact(averaged: Averaged) -> list[str]:
    if averaged.no_jump >= _SMOOTH:
        return []
    return [f"a force of {format_quantity(max(averaged.jumps, key=abs), 'force')} at contact"]


def _of_the_baseline(averaged: Averaged) -> list[str]:
    if averaged.steady >= _STEADY:
        return []
    reasons = []
    creep, wander = max(averaged.creeps, key=abs), max(averaged.wanders)
    if abs(creep) > _LARGE:
        reasons.append(f"the baseline creeps by {100.0 * creep:+.2g} % of the largest force over the record")
    if wander > _LARGE:
        reasons.append(
            f"the noise wanders by {100.0 * wander:.2g} % of the range of the force over the record"
        )
    return reasons


def _of_the_noise(averaged: Averaged) -> list[str]:
    louder = averaged.louder
    if louder <= _LOUDER:
        return []
    size = f"the noise is {louder:.2g} times as loud deep in contact as before it"
    advice = (
        ": free noise.force, and with it noise.depth or noise.relative"
        if averaged.competition.white >= _STEADY
        else "; it also hangs together, and freed it would be taken for independent: look at the residuals"
    )
    return [f"{size}, and the interval takes it for even{advice}"]


def _of_the_intervals(fit: Fit, interval: Callable[[str], StatedInterval]) -> list[str]:
    reasons = []
    for coordinate in fit.problem.coordinates:
        if coordinate.scale is not None or coordinate.name.startswith(("noise.", "instrument.", "lever.")):
            continue
        known = interval(coordinate.name)
        if known.is_open:
            reasons.append(f"{coordinate.name} is not fixed: the data leave it open")
        elif 0.5 * math.log(known.high / known.low) > _WIDE:
            reasons.append(
                f"{coordinate.name} is not fixed: its ends are a factor of {known.high / known.low:.2g} apart"
            )
    return reasons
