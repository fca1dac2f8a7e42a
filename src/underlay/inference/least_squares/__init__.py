"""Least-squares fits: `fitting.py` holds the entry point and shows the steps of a fit."""

from underlay.inference.least_squares.fit_result import Fit, FitStatistics, FitWarning
from underlay.inference.least_squares.fitting import fit

__all__ = ["Fit", "FitStatistics", "FitWarning", "fit"]
