"""Calibrate the two ends of a walked profile.

Curves are drawn at the end that chi-square gives, then at the end that follows from them, and once more if
that one is elsewhere again. Between these centres the root of the threshold is linear in the scaled
parameter, beyond them constant.
"""

from __future__ import annotations

from dataclasses import replace

from underlay.inference.profiling.calibration import Calibration, Draws, draw_rises
from underlay.inference.profiling.profile_result import Profile

__all__ = ["calibrated"]

_MOST_CENTRES = 3
# Of the half-width of the interval: closer to a centre than this, the threshold there serves. It changes by a
# few tenths of its size over a half-width, its own chance with a hundred curves is a tenth.
_CLOSE = 0.1


def calibrated(walked: Profile, level: float, draws: int, seed: int) -> Profile:
    """Return the profile with thresholds from curves drawn at the ends of its interval.

    Parameters
    ----------
    walked : Profile
        Without calibration.
    level : float
        Confidence of the interval.
    draws, seed : int
        Curves per centre, and where their chance comes from.

    Raises
    ------
    InputError, FitError
        As `draw_rises`, or if there are too few curves for the level.
    """
    result = replace(walked, calibration=Calibration(level, draws, seed))
    for upper in (False, True):
        result = _with_end(result, level, draws, seed, upper=upper)
    return result


def _with_end(profile: Profile, level: float, draws: int, seed: int, *, upper: bool) -> Profile:
    fit = profile.fit
    coordinate = fit.problem.coordinates[profile.index]
    middle = float(fit.vector[profile.index])
    centres: list[Draws] = []
    for _ in range(_MOST_CENTRES):
        value, reason = profile.end(level, upper=upper)
        # Where the data set no end there is no place to draw at; the side stays open.
        if reason != "data":
            break
        q = coordinate.scaled(value)
        known = sorted(coordinate.scaled(centre.value) for centre in centres)
        near = _CLOSE * abs(q - middle)
        if known and known[0] - near <= q <= known[-1] + near:
            break
        centres.append(draw_rises(fit, profile.name, value, draws, seed))
        calibration = profile.calibration or Calibration(level, draws, seed)
        profile = replace(profile, calibration=calibration.with_side(tuple(centres), upper=upper))
    return profile
