"""The second interval: from the noise and with what the law leaves out, friction and finite strain.

What is left out is a column with a prior (`misfit/left_out.py`), averaged over as noise and misfit are. A column
that moves no parameter by a tenth of its standard error is not carried along: then both intervals are one.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from underlay.errors import InputError
from underlay.inference.headline.averaged import averaged_interval
from underlay.inference.headline.derived import derived_interval
from underlay.inference.least_squares.fit_result import AllowedFor, Fit, StatedInterval
from underlay.inference.misfit.averaging import Averaged, average
from underlay.inference.misfit.blocked import Blocked
from underlay.inference.misfit.sizes import Sizes
from underlay.inference.uncertainty.known_errors import KnownError, LeftOut, left_out
from underlay.scene.scene import Scene

__all__ = ["Widened", "widened", "wider_interval"]

# Of a standard error: what moves every parameter by less is not carried along.
_NEGLIGIBLE = 0.1
_DEVIATIONS = 2.0


@dataclass(frozen=True)
class Widened:
    """A fit with what its law leaves out.

    Parameters
    ----------
    averaged : Averaged or None
        The fit averaged over that too; None where nothing acts.
    allowed_for : AllowedFor
        In words.
    """

    averaged: Averaged | None
    allowed_for: AllowedFor


def widened(fit: Fit) -> Widened:
    """Allow for what the laws of a fit leave out."""
    parts = _parts(fit)
    errors = {error.words: error for part in parts for error in part.errors}
    held = frozenset(
        {i for i, name in enumerate(fit.names) if name in fit.no_error_bars or name in fit.bounds_hit}
        | set(fit.problem.noise_entries)
    )
    acting: list[KnownError] = []
    negligible: list[KnownError] = []
    unknown = [words for part in parts for words in part.unknown]
    declared = [words for part in parts for words in part.declared]
    if len(held) == len(fit.names) or fit.statistics.robust != "none":
        said = (*_told(errors.values()), *unknown)
        return Widened(None, AllowedFor(unknown=_once(said), declared=_once(declared)))
    for error in errors.values():
        try:
            (acting if _acts(fit, held, error) else negligible).append(error)
        except InputError as reason:
            unknown.append(f"{error.words} is beyond what is known here ({reason})")
    found = _averaged(fit, held, acting) if acting else None
    if acting and found is None:
        unknown += _told(acting)
        acting = []
    return Widened(
        found,
        AllowedFor(
            _once(_told(acting)),
            _once([words for words in _told(negligible) if words not in _told(acting)]),
            _once(unknown),
            _once(declared),
        ),
    )


def wider_interval(
    fit: Fit, found: Averaged, from_noise: StatedInterval, name: str, level: float
) -> StatedInterval:
    """Interval of a parameter, or what follows, with what the law leaves out: never narrower than `from_noise`."""
    try:
        wide = (averaged_interval if name in fit.names else _of_what_follows)(fit, found, name, level)
    except InputError:
        return from_noise
    low, high = min(wide.low, from_noise.low), max(wide.high, from_noise.high)
    return StatedInterval(name, level, wide.value, low, high, "with model error")


def _of_what_follows(fit: Fit, found: Averaged, name: str, level: float) -> StatedInterval:
    return derived_interval(
        fit, found, name, level, known=lambda parameter: averaged_interval(fit, found, parameter, level)
    )


def _parts(fit: Fit) -> list[LeftOut]:
    """What the laws leave out: known where the fitted scene or the one as it was posed lies in its range.

    A thickness that finite strain makes too small, or a contact that it moves, may leave the range that the true
    one is in.
    """
    parts = []
    for fitted, posed, curve in zip(fit.scenes, fit.problem.base_scenes, fit.curves, strict=True):
        told = [
            left_out(scene, max(float(curve.depth.max()) - scene.instrument.contact_depth, 0.0))
            for scene in (_unasked(fitted), posed)
        ]
        parts.append(min(told, key=lambda part: len(part.unknown)))
    return parts


def _unasked(scene: Scene) -> Scene:
    """The scene without a demand for finite strain, which only the posed one can be held to."""
    return replace(scene, finite_strain=None) if scene.finite_strain else scene


def _acts(fit: Fit, held: frozenset[int], error: KnownError) -> bool:
    """Whether an error moves a parameter by a tenth of its standard error, anywhere its prior allows."""
    k = len(fit.names)
    model = Blocked.of(fit.problem, fit.vector, held, (error,)).linearised(fit.vector)
    columns = np.concatenate([part.jacobian for part in model.parts])
    free = [i for i in range(k) if i not in held]
    shift = np.linalg.pinv(columns[:, free]) @ columns[:, -1]
    deviation = np.sqrt(np.diagonal(fit.scaled_covariance)[free])
    largest = abs(error.mean) + _DEVIATIONS * error.deviation
    return bool((np.abs(shift) * largest > _NEGLIGIBLE * deviation).any())


def _averaged(fit: Fit, held: frozenset[int], errors: Sequence[KnownError]) -> Averaged | None:
    others = [other.vector for other in fit.alternatives]
    try:
        return average(fit.problem, fit.vector, others, held, _sizes(fit), errors)
    except (InputError, np.linalg.LinAlgError):
        # No law beside the optimum: the interval from the noise is what there is.
        return None


def _sizes(fit: Fit) -> Sizes:
    """What else is weighed: all that the interval from the noise weighs, and at the same odds."""
    if fit.problem.noise_is_open:
        return Sizes.of(fit.problem)
    stated = Sizes(drifts=(), jumps=(), ramps=(), exact=1.0, smooth=1.0, level=1.0)
    if any(member.noise.correlation for member in fit.problem.members):
        return stated
    return replace(stated, shares=(), white=1.0)


def _told(errors: Iterable[KnownError]) -> list[str]:
    """What people are told of errors."""
    return [words for error in errors for words in error.told or (error.words,)]


def _once(words: Sequence[str]) -> tuple[str, ...]:
    return tuple(dict.fromkeys(words))
