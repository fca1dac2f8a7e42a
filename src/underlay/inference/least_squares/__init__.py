"""Least squares: compile, scan, descend, settle, judge; `fitting.py` is the way in and shows all five."""

from underlay.inference.least_squares.fit_result import Fit, FitStatistics, FitWarning
from underlay.inference.least_squares.fitting import fit

__all__ = ["Fit", "FitStatistics", "FitWarning", "fit"]
