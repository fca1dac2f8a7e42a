"""Calibrate the two ends of a walked profile.

Curves are drawn at the end that chi-square gives, then at the end that follows from them, and so on until
the end stays; then at the bottom of a basin beyond it that chi-square rejects and its own curves may not.
Between these centres the root of the threshold is linear in the scaled parameter, beyond them constant.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from underlay.inference.profiling.calibration import Calibration, Draws
from underlay.inference.profiling.drawing import draw_delta_chi_squares
from underlay.inference.profiling.profile_result import LikelihoodProfile

__all__ = ["calibrated"]

_MOST_CENTRES = 5  # of one end; one or two are usual
# Of the half-width of the interval: closer to a centre than this, the threshold there serves. It changes by a
# few tenths of its size over a half-width, its own chance with a hundred curves is a tenth.
_CLOSE = 0.1


def calibrated(walked: LikelihoodProfile, level: float, draws: int, seed: int) -> LikelihoodProfile:
    """Return the profile with thresholds from curves drawn at the ends of its interval.

    Parameters
    ----------
    walked : LikelihoodProfile
        Without calibration.
    level : float
        Confidence of the interval.
    draws, seed : int
        Curves per centre, and where their chance comes from.

    Raises
    ------
    InputError, FitError
        As `draw_delta_chi_squares`, or if there are too few curves for the level.
    """
    result = replace(walked, calibration=Calibration(level, draws, seed))
    for upper in (False, True):
        result = _with_end(result, level, draws, seed, upper=upper)
    return result


def _with_end(
    profile: LikelihoodProfile, level: float, draws: int, seed: int, *, upper: bool
) -> LikelihoodProfile:
    centres: tuple[Draws, ...] = ()
    for _ in range(_MOST_CENTRES):
        value = _next_place(profile, centres, level, upper=upper)
        if value is None:
            break
        centres = (*centres, draw_delta_chi_squares(profile.fit, profile.name, value, draws, seed))
        calibration = profile.calibration or Calibration(level, draws, seed)
        profile = replace(profile, calibration=calibration.with_side(centres, upper=upper))
    return profile


def _next_place(
    profile: LikelihoodProfile, centres: Sequence[Draws], level: float, *, upper: bool
) -> float | None:
    """Where the threshold is needed and not known yet (SI); None if nowhere."""
    value, reason = profile.end_of_hull(level, upper=upper)
    # Where the data set no end there is no place to draw at; the side stays open.
    if reason != "data":
        return None
    scaled = profile.fit.problem.coordinates[profile.index].scaled
    known = sorted(scaled(centre.value) for centre in centres)
    near = _CLOSE * abs(scaled(value) - float(profile.fit.vector[profile.index]))
    if not known or not known[0] - near <= scaled(value) <= known[-1] + near:
        return value
    for bottom in profile.bottoms_beyond(value, upper=upper):
        if min(abs(scaled(bottom) - place) for place in known) > near:
            return bottom
    return None
