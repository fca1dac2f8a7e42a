"""Parts of a fit's result: reservations, other optima, and how it was reached."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

from underlay._arrays import FloatArray

__all__ = ["Alternative", "FitStatistics", "FitWarning"]


@dataclass(frozen=True)
class FitWarning:
    """A reservation: `code` for programs, `message` for people."""

    code: str
    message: str

    def __str__(self) -> str:
        return self.message


@dataclass(frozen=True, eq=False)
class Alternative:
    """Another optimum the data hardly reject.

    Parameters
    ----------
    vector : FloatArray
        In scaled coordinates, (k,).
    values : mapping of name to float
        Parameters (SI).
    delta_chi_square : float
        Chi-square above that of the best.
    """

    vector: FloatArray = field(repr=False)
    values: Mapping[str, float]
    delta_chi_square: float


@dataclass(frozen=True)
class FitStatistics:
    """How well and how a fit was reached.

    Parameters
    ----------
    points, parameters : int
        Points fitted; free parameters, estimated noise not counted.
    chi_square, reduced_chi_square : float
        Sum of squares of the whitened residuals, and that over points minus parameters. Where the size of
        the noise was estimated the second is one by construction.
    log_likelihood, aic, bic : float
        At the optimum, estimated sizes of noise counted as parameters.
    evaluations, failures, laws_built : int
        Models computed; those that did not exist; contact laws solved for.
    seconds : float
        Time taken.
    success : bool
        Whether the minimiser met its tolerance.
    stopped : str
        Why it stopped.
    method, robust : str
        Minimiser and loss.
    law_method, law_reason : str
        Contact law at the optimum and why it was taken.
    law_error : float
        Its estimated relative error of the force.
    noise_estimated : bool
        Whether the size of the noise came from the scatter about the fit.
    """

    points: int
    parameters: int
    chi_square: float
    reduced_chi_square: float
    log_likelihood: float
    aic: float
    bic: float
    evaluations: int
    failures: int
    laws_built: int
    seconds: float
    success: bool
    stopped: str
    method: str
    robust: str
    law_method: str
    law_reason: str
    law_error: float
    noise_estimated: bool
