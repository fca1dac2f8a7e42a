"""Whether one value of a parameter is inside an interval, without the whole profile."""

import numpy as np

from underlay.inference.profiling.profile import rises_at_truth
from underlay.inference.profiling.walk import constrained_fit, missed


def delta_chi_square_at(fit, name, value):
    """Rise of chi-square with a parameter held at a value (SI), counted from the better of fit and refit."""
    rise, vector = constrained_fit(fit, name, value)
    return rise - missed(fit, vector)


def p_value_at(fit, name, value, draws=99, seed=0, *, enough=None):
    """p-value of a value (SI): (1 + number of rises at least as large) / (draws + 1) in curves simulated there.

    With `enough` it stops after so many rises at least as large, and returns their share of the curves so far
    (Besag and Clifford 1991, doi:10.1093/biomet/78.2.301): whether the share of all would be above `enough` /
    (`draws` + 1) is then already known.
    """
    here = delta_chi_square_at(fit, name, value)
    worse = made = 0
    for rise in rises_at_truth(fit, name, value, draws, seed):
        made += bool(np.isfinite(rise))
        worse += bool(rise >= here)
        if enough is not None and worse >= enough:
            return worse / made
    return (1 + worse) / (1 + made)
