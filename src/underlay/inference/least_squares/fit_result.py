"""The result of a fit: values, uncertainties, how they were found, and warnings."""

from __future__ import annotations

import math
import os
from collections.abc import Callable, Mapping
from dataclasses import asdict, dataclass, field
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from underlay._arrays import FloatArray
from underlay.data.curve import Curve
from underlay.data.export import write_json
from underlay.errors import InputError
from underlay.inference.citation import of_fit, used_by
from underlay.inference.least_squares.diagnostics import ResidualDiagnostics, diagnose
from underlay.inference.least_squares.models import freeze
from underlay.inference.least_squares.objective import Objective
from underlay.inference.least_squares.provenance import InstrumentModulus, instrument_moduli, provenance
from underlay.inference.least_squares.settle import METHODS, Minimiser
from underlay.inference.problem import Problem
from underlay.inference.uncertainty.answer import (
    Advice,
    Answer,
    Follows,
    Interval,
    PointwiseModulus,
    answers_table,
)
from underlay.mechanics.solver import Solver
from underlay.quantities import field_quantities, kind_of
from underlay.scene.noise import NoiseModel
from underlay.scene.scene import Scene
from underlay.units import format_quantity


@dataclass(frozen=True)
class FitWarning:
    """A warning about a fit: `code` for programs, `message` for people."""

    code: str
    message: str

    def __str__(self) -> str:
        return self.message


@dataclass(frozen=True, eq=False)
class Alternative:
    """Another local optimum, which the data do not clearly reject.

    Parameters
    ----------
    vector : FloatArray
        Scaled parameters, (k,).
    values : mapping of name to float
        Parameters (SI).
    delta_chi_square : float
        Its chi-square less that of the best optimum.
    """

    vector: FloatArray = field(repr=False)
    values: Mapping[str, float]
    delta_chi_square: float


@dataclass(frozen=True)
class FitStatistics:
    """Statistics of a fit: how well it describes the data, and how it was reached.

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
        Estimated relative error of the law's force.
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


@dataclass(frozen=True, eq=False)
class Fit:
    """Least-squares result.

    Parameters
    ----------
    problem : Problem
        What was fitted: as given, but without readings beside a jump of the force that were left out (a warning
        says so).
    vector : FloatArray
        Optimum in scaled parameters, (k,).
    values, stderr : mapping of name to float
        Parameters and standard errors (SI). An error is infinite where the data do not fix the parameter or it lies
        on a bound; `no_error_bars` says which.
    scaled_covariance : FloatArray
        Covariance of the scaled parameters, (k, k); rows of parameters without error bars are zero.
    covariance : FloatArray
        Covariance in SI, (k, k), with the same rows zero.
    no_error_bars : mapping of name to str
        Why a parameter has no error bar.
    bounds_hit : mapping of name to str
        Bound on which a parameter lies, in words.
    noises : tuple of Noise
        Noise of every curve at the optimum.
    residuals : tuple of FloatArray
        Data minus model (N), one array (n,) per curve.
    whitened : tuple of FloatArray
        Residuals in standard deviations, model minus data, (n,) each: independent where the noise is as assumed.
    statistics : FitStatistics
        Goodness of the fit, and how it was reached.
    warnings : tuple of FitWarning
        Warnings about the result.
    alternatives : tuple of Alternative
        Other optima within a rise of 11.6 in chi-square (99.9 %), as far as the starts found them.
    state : callable
        Function that makes the answers and the verdict from this fit, called when they are first read.
    """

    problem: Problem = field(repr=False)
    vector: FloatArray = field(repr=False)
    values: Mapping[str, float]
    stderr: Mapping[str, float]
    scaled_covariance: FloatArray = field(repr=False)
    covariance: FloatArray = field(repr=False)
    no_error_bars: Mapping[str, str]
    bounds_hit: Mapping[str, str]
    noises: tuple[NoiseModel, ...]
    residuals: tuple[FloatArray, ...] = field(repr=False)
    whitened: tuple[FloatArray, ...] = field(repr=False)
    statistics: FitStatistics = field(repr=False)
    warnings: tuple[FitWarning, ...]
    state: Callable[[Fit], Any] = field(repr=False)
    alternatives: tuple[Alternative, ...] = ()
    _lmfit: Any = field(default=None, repr=False)

    @cached_property
    def lmfit(self) -> Any:
        """lmfit's `MinimizerResult` in scaled parameters, its names with ``_`` for dots and brackets.

        Values are logarithms of ratios to the scene's own numbers, or shares of the curve's ranges; see
        `Problem.vector`. Where this program's own search converged, lmfit is run when this is first read, from the
        optimum.
        """
        if self._lmfit is not None:
            return self._lmfit
        objective = Objective(self.problem, freeze(self.problem, self.vector, self.noises))
        method = self.statistics.method
        return Minimiser(method if method in METHODS else METHODS[0])(objective, self.vector)[1]

    @cached_property
    def statement(self) -> Any:
        """Likelihood, answers and verdict of the fit (`Statement`), made when first read."""
        return self.state(self)

    def answer(self, name: str, level: float = 0.95) -> Answer:
        """Return the answer for one quantity: its value, its interval and the parts of its uncertainty.

        All tables, pages and files print this number. Its value is the one with which the model describes the
        fitted range (least squares). The statistical part of the uncertainty comes from noise and misfit that the
        curve shows, the systematic part from inputs and from effects that the model neglects; `Answer.budget` lists
        them. It is computed when first read, and kept.

        Parameters
        ----------
        name : str
            One of `names`, or a quantity that follows from them, such as those of `derived`.
        level : float, default 0.95
            Confidence of its intervals.

        Returns
        -------
        Answer
            The ends of its interval are infinite where the data do not bound the quantity.

        Raises
        ------
        InputError
            If the name is not fitted and does not follow, or the level is not between 0 and 0.999.
        """
        found: Answer = self.statement.answer(name, level)
        return found

    @property
    def answers(self) -> pd.DataFrame:
        """Table of all answers, one row per quantity.

        Columns are the value, its intervals (combined, statistical and systematic, SI) and the unit.
        """
        return answers_table(self.answer(name) for name in (*self.names, *self.derived))

    def interval(self, name: str, level: float = 0.95, *, part: str = "combined") -> Interval:
        """Return one interval of a quantity: combined, or its statistical or systematic part; see `answer`.

        Parameters
        ----------
        name : str
            As in `answer`.
        level : float, default 0.95
            Confidence.
        part : {"combined", "statistical", "systematic"}
            Which uncertainty the interval covers.

        Raises
        ------
        InputError
            As `answer` does, or if there is no such part.
        """
        known = self.answer(name, level)
        parts = {"combined": known.interval, "statistical": known.statistical, "systematic": known.systematic}
        if part not in parts:
            raise InputError(f"unknown part {part!r:.60}; known: {', '.join(parts)}")
        return parts[part]

    def modulus_by_depth(self, curve: int = 0, points: int = 30, level: float = 0.95) -> PointwiseModulus:
        """Return the layer's Young's modulus at each depth of one curve, from its force and from its local slope.

        The modulus that a half-space formula would give is returned too. See `pointwise_modulus` for parameters and
        errors.
        """
        found: PointwiseModulus = self.statement.modulus_by_depth(curve, points, level)
        return found

    def refit(self, problem: Problem) -> Fit:
        """Fit another problem by least squares, starting from the values of that problem's scenes."""
        found: Fit = self.statement.refit(problem)
        return found

    def band(self, of: Follows, level: float = 0.95) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Pointwise confidence band of positive quantities that follow from the parameters.

        Parameters
        ----------
        of : callable
            Function from parameters (draws, k), SI, in the order of `names`, to n quantities (draws, n).
        level : float, default 0.95
            Confidence, point by point, above 0 and at most 0.999; under the noise that `interval` assumes, to first
            order.

        Returns
        -------
        tuple of FloatArray
            Lower ends, middles and upper ends, each (n,).

        Raises
        ------
        InputError
            If `level` is none, or `of` gives no such quantities.
        """
        low, middle, high = self.statement.band(of, level)
        return low, middle, high

    @property
    def verdict(self) -> Advice:
        """Verdict on the fit: ``"good"``, ``"check"`` or ``"reject"``, with reason, likely cause and next step."""
        found: Advice = self.statement.verdict
        return found

    @property
    def sensitivity(self) -> Mapping[str, Mapping[str, float]]:
        """d ln(value) / d ln(input), by fitted parameter and then by number of the scene taken as known."""
        found: Mapping[str, Mapping[str, float]] = self.statement.sensitivity
        return found

    @cached_property
    def diagnostics(self) -> tuple[ResidualDiagnostics, ...]:
        """Scatter and autocorrelation of the residuals, one per curve."""
        return tuple(diagnose(own, force) for own, force in zip(self.whitened, self.residuals, strict=True))

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the fitted parameters, in the order of all vectors."""
        return self.problem.names

    @cached_property
    def derived(self) -> tuple[str, ...]:
        """Names of quantities that follow from the fitted parameters and are printed with them.

        The moduli of a layer that relaxes or drains, or the factor by which a layer that stiffens does so at the
        deepest point. `interval` takes these names too.
        """
        members = self.problem.members
        stiff = [i for i, member in enumerate(members) if member.scene.layer.stiffening is not None]
        if stiff:
            return tuple(f"layer.stiffening_factor{f'[{i}]' if len(members) > 1 else ''}" for i in stiff)
        if all(member.scene.memory is None for member in members):
            return ()
        # Not loaded for a sample that does not relax.
        from underlay.inference.sampling.derived import of_memory, relaxed_moduli  # noqa: PLC0415  see above

        flat = self.problem.physical(self.vector)[None]
        return (*relaxed_moduli(self.problem, flat), *of_memory(self.problem, flat))

    @property
    def scenes(self) -> tuple[Scene, ...]:
        """The fitted scene of every curve."""
        return self.problem.scenes(self.vector)

    @property
    def scene(self) -> Scene:
        """The fitted scene of the first curve."""
        return self.scenes[0]

    @property
    def curves(self) -> tuple[Curve, ...]:
        """The curves that were fitted."""
        return self.problem.curves

    @property
    def solver(self) -> Solver:
        """Solver that computed the contact laws."""
        return self.problem.solver

    @property
    def instrument_moduli(self) -> dict[str, InstrumentModulus]:
        """Modulus found by the instrument's own software, by name of the fitted ``layer.E`` that it compares with.

        Empty where the curves' files give none.
        """
        return instrument_moduli(self.problem, self.scenes, self.curves)

    @property
    def provenance(self) -> dict[str, Any]:
        """Versions of this program and its libraries, and names, files and hashes of the curves."""
        return provenance(self.curves)

    @property
    def law_reason(self) -> str:
        """Name of the contact law at the optimum, and why the solver chose it."""
        return f"{self.statistics.law_method}: {self.statistics.law_reason}"

    @property
    def sigmas(self) -> tuple[FloatArray, ...]:
        """Standard deviation of the noise (N), one array (n,) per curve, at the optimum."""
        physical = self.problem.physical(self.vector)
        return tuple(
            member.sigma(member.reading(physical), noise)
            for member, noise in zip(self.problem.members, self.noises, strict=True)
        )

    @property
    def correlations(self) -> pd.DataFrame:
        """Correlation matrix of the parameters that have error bars."""
        kept = [i for i, name in enumerate(self.names) if name not in self.no_error_bars]
        names = [self.names[i] for i in kept]
        covariance = self.scaled_covariance[np.ix_(kept, kept)]
        deviation = np.sqrt(np.diag(covariance))
        return pd.DataFrame(covariance / np.outer(deviation, deviation), index=names, columns=names)

    def report(self) -> str:
        """The result as text: values, errors, correlations, statistics, warnings."""
        lines = ["parameter                     value and standard error"]
        for name, value in self.values.items():
            error = self.stderr[name]
            kind = kind_of(name)
            text = format_quantity(value, kind, error if math.isfinite(error) else None)
            reason = self.no_error_bars.get(name) or self.bounds_hit.get(name, "")
            lines.append(f"{name:<28}  {text}{f'  ({reason})' if reason else ''}")
        strong = self._strong_correlations()
        if strong:
            lines.append(f"correlations above 0.9: {'; '.join(strong)}")
        s = self.statistics
        noise = "estimated from the scatter" if s.noise_estimated else "given or fitted"
        chi_square = f"chi-square {s.chi_square:.6g} (reduced {s.reduced_chi_square:.4g}), "
        if s.noise_estimated:
            chi_square = ""  # n - k and 1 by construction
        lines += [
            (f"points {s.points}, {chi_square}noise {noise}, AIC {s.aic:.6g}, BIC {s.bic:.6g}"),
            f"law {self.law_reason} (estimated relative error {s.law_error:.1e})",
            f"{s.method}: {s.stopped} {s.evaluations} evaluations, {s.seconds * 1e3:.1f} ms",
        ]
        lines += [
            f"{name}: the instrument found {format_quantity(own.youngs, 'pressure')} (reduced "
            f"{format_quantity(own.reduced, 'pressure')}, nu {own.nu:g}); ours {100.0 * own.difference:+.3g} %"
            for name, own in self.instrument_moduli.items()
        ]
        lines += [f"warning: {warning.message}" for warning in self.warnings]
        return "\n".join(lines)

    @property
    def used(self) -> dict[str, str]:
        """Keys of the works to cite, each with what it was used for; see `underlay cite`."""
        formats = [str(curve.metadata.get("format", "")) for curve in self.curves]
        robust, open_ = self.statistics.robust != "none", self.problem.noise_is_open
        return used_by([self.statistics.law_method], self.scenes, formats) | of_fit(
            robust=robust, averaged=open_
        )

    def _strong_correlations(self) -> list[str]:
        frame = self.correlations
        matrix, names = frame.to_numpy(), list(frame.columns)
        return [
            f"{names[j]} and {names[i]} {matrix[i, j]:+.3f}"
            for i in range(len(names))
            for j in range(i)
            if abs(matrix[i, j]) > 0.9
        ]

    def to_json(self, path: str | os.PathLike[str]) -> Path:
        """Write the result as JSON, atomically; SI units, null in place of numbers that are not finite.

        Raises
        ------
        FileAccessError
            If the file cannot be written.
        """
        document = {
            "values": dict(self.values),
            "stderr": dict(self.stderr),
            "answers": {name: self.answer(name).as_dict() for name in (*self.names, *self.derived)},
            "verdict": asdict(self.verdict),
            "sensitivity": {name: dict(row) for name, row in self.sensitivity.items()},
            "names": list(self.names),
            "covariance": self.covariance.tolist(),
            "no_error_bars": dict(self.no_error_bars),
            "bounds_hit": dict(self.bounds_hit),
            "noise": [
                {name: getattr(noise, name) for name in field_quantities(noise)} for noise in self.noises
            ],
            "statistics": asdict(self.statistics),
            "diagnostics": [asdict(entry) for entry in self.diagnostics],
            "warnings": [asdict(warning) for warning in self.warnings],
            "alternatives": [
                {"values": dict(a.values), "delta_chi_square": a.delta_chi_square} for a in self.alternatives
            ],
            "scenes": [scene.parameters for scene in self.scenes],
            "instrument_moduli": {name: asdict(stated) for name, stated in self.instrument_moduli.items()},
            "provenance": self.provenance,
            "used": self.used,
        }
        return write_json(document, path)
