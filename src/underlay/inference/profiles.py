"""Profile likelihood: how far a parameter can go before the data object, all others following it.

For each value of the parameter the others are fitted again; with frozen noise the rise of the weighted sum
of squares is t = S(q) - S_min, and an interval is where t stays below the quantile of chi-square with one
degree of freedom, or of F(1, n - k) where the size of the noise was estimated. Unlike a standard error this
can end at one side and never at the other, and it says so.

Where the curve has two optima (thin and soft, thick and stiff) chi-square is too small: the 95 % intervals of
such curves cover 88 to 91 % (`tests/studies/coverage.py`). `calibrate` takes the threshold from curves drawn
at the ends instead; see `profiling/calibration.py`.

Where the noise was not stated there is no one likelihood to follow: the profile is then made of the ends of the
intervals that `Fit.interval` states, at every level (`headline/averaged_profile.py`).

The profile is walked from the optimum in steps of about half a standard deviation of z = sqrt(t), in which
it is nearly straight, and read between the steps by monotone interpolation. lmfit's `conf_interval` looks
for two crossings and fails where one does not exist.
"""

from __future__ import annotations

from underlay._arrays import FloatArray
from underlay._given import require_given
from underlay._threads import one_thread
from underlay.inference.headline.averaged import averaged_fit
from underlay.inference.headline.averaged_profile import averaged_profile
from underlay.inference.least_squares import fit as least_squares_fit
from underlay.inference.least_squares.fit_result import Fit
from underlay.inference.problem import Problem
from underlay.inference.profiling.calibrated_profile import calibrated
from underlay.inference.profiling.calibration import Calibration, Draws, require_draws
from underlay.inference.profiling.constrained import delta_chi_square_at, index_of
from underlay.inference.profiling.drawing import p_value_at
from underlay.inference.profiling.interval import Interval
from underlay.inference.profiling.noise_profile import noise_profile
from underlay.inference.profiling.profile_result import LikelihoodProfile, interval_threshold
from underlay.inference.profiling.walk import HIGHEST
from underlay.inference.profiling.walked import walked

__all__ = [
    "Calibration",
    "Draws",
    "Interval",
    "LikelihoodProfile",
    "delta_chi_square_at",
    "interval_threshold",
    "p_value_at",
    "profile",
]

# z that a profile is walked to where its threshold is not known beforehand.
_HIGHEST_CALIBRATED = 6.0


@one_thread()
def profile(
    problem: Problem | Fit, name: str, *, calibrate: int = 0, level: float = 0.95, seed: int = 0
) -> LikelihoodProfile:
    """Profile likelihood of one parameter.

    Parameters
    ----------
    problem : Problem or Fit
        What is asked; a problem is fitted first.
    name : str
        The parameter, as in `Problem.names`. One of the noise's, ``"noise.correlation_time"``, is walked
        along its restricted likelihood; the others freeze the noise at the fit.
    calibrate : int, default 0
        How many curves are drawn and fitted at each of two or three places per end, so that the interval
        covers where chi-square does not: 99 are usual, 19 the fewest for 95 %. None by default.
    level : float, default 0.95
        Confidence whose ends are calibrated.
    seed : int, default 0
        Where the chance of the drawn curves comes from: the same seed gives the same interval.

    Returns
    -------
    LikelihoodProfile
        Its `basis` says which threshold was used and why.

    Raises
    ------
    InputError
        If the parameter is not free, there are too few curves for the level, or a parameter of the noise is
        to be calibrated.
    FitError
        If too many of the drawn curves cannot be fitted.
    """
    require_given(problem, "problem", Problem, Fit)
    fit = least_squares_fit(problem) if isinstance(problem, Problem) else problem
    if name in fit.names and name.startswith("noise.") and not calibrate:
        return noise_profile(fit, name)
    index_of(fit, name)
    if calibrate:
        require_draws(calibrate, level, seed)
    else:
        averaged = averaged_fit(fit)
        if averaged is not None:
            return averaged_profile(fit, averaged, name)
    found = _walked(fit, name, _HIGHEST_CALIBRATED if calibrate else HIGHEST)
    return calibrated(found, level, calibrate, seed) if calibrate else found


def _walked(fit: Fit, name: str, highest: float) -> LikelihoodProfile:
    found, better = walked(fit, name, highest)
    if better is not None:
        # The walk met a lower minimum: begin again from there.
        again = _refit(fit, better)
        if again.statistics.chi_square < fit.statistics.chi_square:
            return _walked(again, name, highest)
    return found


def _refit(fit: Fit, vector: FloatArray) -> Fit:
    problem = fit.problem
    moved = problem.revised(scenes=problem.scenes(vector))
    return least_squares_fit(moved, start="given")
