"""The posterior as draws, with its diagnostics, answers, tables and file."""

from __future__ import annotations

import os
from collections.abc import Mapping
from dataclasses import asdict, dataclass, field
from functools import cached_property, partial
from typing import TYPE_CHECKING, Any, NamedTuple, Self, cast

import numpy as np
import pandas as pd

from underlay._arrays import FloatArray
from underlay._door import FileKind, printable, understood
from underlay._given import require_level
from underlay.errors import FileFormatError, InputError
from underlay.inference.least_squares.fitting import fit, quick_fit
from underlay.inference.least_squares.provenance import provenance
from underlay.inference.problem import Problem
from underlay.inference.sampling.derived import kind_of_quantity
from underlay.inference.sampling.diagnostics import (
    COMPARISON_COLUMNS,
    Information,
    Predictive,
    SamplingDiagnostics,
    arviz_library,
    compare_with_prior,
    effective_size,
    highest_density_interval,
    quantile_errors,
    rank_normalised_rhat,
)
from underlay.inference.sampling.posterior_file import (
    LARGEST,
    parts_of,
    problem_from_record,
    problem_record,
    read_archive,
    write_archive,
)
from underlay.inference.uncertainty.answer import Advice, Answer, Contribution, Interval, answers_table
from underlay.inference.uncertainty.mixture import weighted_quantiles
from underlay.inference.uncertainty.reading import Reading, widened
from underlay.inference.uncertainty.statement import NOISE, Statement
from underlay.inference.uncertainty.verdict import CHECK, GOOD, REJECT
from underlay.units import KINDS

if TYPE_CHECKING:
    from underlay.inference.least_squares.fit_result import Fit
    from underlay.inference.uncertainty.budget import Source
    from underlay.inference.uncertainty.likelihood import Likelihood

# Note of an answer of a posterior whose problem was not saved.
_ALONE = "the draws alone were kept, without the test they are of"
_FORMAT = "underlay posterior 1"
_KIND = FileKind("a saved posterior", LARGEST, "save it again where it was made")


class LogEvidence(NamedTuple):
    """Natural logarithm of the probability of the data under a model, and its standard error.

    It is the probability density of the readings (per newton for each point), with all parameters integrated over
    their priors: only differences between models of the same data have a meaning. Where the size of the noise is
    not stated it is known up to a factor that all models of the same data share.
    """

    value: float
    error: float


@dataclass(frozen=True, eq=False)
class SampledReading(Reading):
    """Intervals of draws that a sampler made, all of the same weight.

    Parameters
    ----------
    sampled : FloatArray
        Scaled vectors (m, k).
    read : Reading
        The result without a sampler, which says at which ends the data set no limit.
    """

    sampled: FloatArray = field(repr=False)
    read: Reading = field(repr=False)

    def interval(self, index: int, level: float = 0.95) -> tuple[float, float]:
        """Quantiles of the draws, widened to the ridge's edge; infinite where the data set no limit."""
        shares = np.array([0.5 - 0.5 * level, 0.5 + 0.5 * level])
        drawn = weighted_quantiles(self.draws[:, index], self.weights, shares)
        ends = widened(drawn, self.edge(level)[:, index])
        known = self.read.interval(index, level)
        low, high = (a if np.isinf(a) else b for a, b in zip(known, ends, strict=True))
        return low, high

    def edge(self, level: float) -> FloatArray:
        """Scaled vectors (m, k) on the ridge where the likelihood has dropped by the amount of the level."""
        return self.read.edge(level)

    @property
    def draws(self) -> FloatArray:
        """The sampler's draws, scaled vectors (m, k)."""
        return self.sampled

    @cached_property
    def weights(self) -> FloatArray:
        """Equal weights, (m,), that sum to 1."""
        return np.full(len(self.draws), 1.0 / len(self.draws))


@dataclass(frozen=True, eq=False)
class SampledStatement(Statement):
    """Answers and verdict of a fit whose statistical part comes from a sampler's draws, scaled vectors (m, k)."""

    draws: FloatArray = field(repr=False)

    @property
    def own(self) -> Statement:
        """The statement of the fit itself, which has the same systematic sources."""
        return cast(Statement, self.fit.statement)

    @cached_property
    def likelihood(self) -> Likelihood:
        """The likelihood of the fit's curves."""
        return self.own.likelihood

    @cached_property
    def reading(self) -> Reading:
        """Intervals from the sampler's draws."""
        return SampledReading(self.likelihood, self.draws, self.own.reading)

    @cached_property
    def sources(self) -> tuple[Source, ...]:
        """Sources of the systematic part of the intervals, those of the fit."""
        return self.own.sources


@dataclass(frozen=True, eq=False)
class Posterior:
    """Draws from the posterior of a `Problem`, in SI.

    Parameters
    ----------
    names : tuple of str
        The free parameters.
    chain : FloatArray
        Draws (SI), without burn-in and thinned, (draws, walkers, parameters).
    log_posterior : FloatArray
        Log-density in the scaled coordinates in which it was sampled, (draws, walkers).
    priors : tuple of str
        The prior of each parameter as text.
    prior_quantiles : FloatArray
        Prior quantiles (SI) at the probabilities `prior_levels`, (levels, parameters).
    derived : mapping of str to FloatArray
        Derived quantities (SI), each (draws, walkers) over evenly chosen draws.
    predictive : tuple of Predictive
        One band per curve.
    diagnostics : SamplingDiagnostics
        How the sampling went.
    truth : mapping of str to float
        True values of the parameters, where the curve is synthetic.
    problem : Problem, optional
        What was sampled: scenes, curves, priors, noise.
    missing : str
        Why there is no problem; empty where there is one.
    fit : Fit, optional
        The fit that gives the values of answers; where it is missing, it is made at the first answer.
    """

    names: tuple[str, ...]
    chain: FloatArray
    log_posterior: FloatArray
    priors: tuple[str, ...]
    prior_quantiles: FloatArray
    derived: Mapping[str, FloatArray]
    predictive: tuple[Predictive, ...]
    diagnostics: SamplingDiagnostics
    truth: Mapping[str, float]
    problem: Problem | None = None
    missing: str = ""
    fit: Fit | None = field(default=None, repr=False)

    def __post_init__(self) -> None:
        for array in (self.chain, self.log_posterior, self.prior_quantiles, *self.derived.values()):
            array.flags.writeable = False

    def __repr__(self) -> str:
        state = "converged" if self.converged else "NOT converged"
        return f"<Posterior of {', '.join(self.names)}: {self.chain[..., 0].size} draws, {state}>"

    @property
    def converged(self) -> bool:
        """Whether the chain has converged, or the weighted draws can be trusted."""
        return self.diagnostics.converged

    @property
    def log_evidence(self) -> LogEvidence | None:
        """Natural logarithm of the probability of the data with its error; None where it is not known.

        From weighted draws, where they are trusted and no chain differs from them. Where no noise was stated there
        is none: the likelihood is then that of the fit's moments, which are not the same data for different models.
        """
        found = self.diagnostics.importance
        if found is None or not found.stands or found.log_evidence is None:
            return None
        return LogEvidence(found.log_evidence, found.log_evidence_error or 0.0)

    @cached_property
    def statement(self) -> SampledStatement:
        """Answers and verdict of the fit, with the statistical part from these draws.

        Raises
        ------
        InputError
            If the problem was not kept.
        """
        if self.problem is None:
            raise InputError(
                f"an answer needs the problem that was sampled, and there is none: {self.missing}"
            )
        flat = self.chain.reshape(-1, len(self.names))
        scaled = [
            np.log(x / c.reference) if c.scale is None else (x - c.reference) / c.scale
            for x, c in zip(flat.T, self.problem.coordinates, strict=True)
        ]
        own = fit(self.problem) if self.fit is None else self.fit
        return SampledStatement(own, partial(quick_fit, start="given"), np.column_stack(scaled))

    def answer(self, name: str, level: float = 0.95) -> Answer:
        """Return the answer of one quantity, as `Fit.answer` does.

        The value and the systematic part are the fit's; the statistical part is that of these draws. Where the
        problem was not kept the draws are all there is: their median, and no systematic part, as a note says.

        Parameters
        ----------
        name : str
            One of `names`, or a quantity computed from them.
        level : float, default 0.95
            Confidence of its intervals.

        Raises
        ------
        InputError
            If there is no quantity of that name, or the level is not between 0 and 0.999.
        """
        return self._of_draws(name, level) if self.problem is None else self.statement.answer(name, level)

    def _of_draws(self, name: str, level: float) -> Answer:
        """Answer of a quantity from the draws only, without a systematic part."""
        require_level(level)
        shares = [0.5 - 0.5 * level, 0.5, 0.5 + 0.5 * level]
        low, value, high = np.quantile(self.of(name), shares).tolist()
        scatter, none = (Interval(name, level, value, *ends) for ends in ((low, high), (value, value)))
        row = Contribution(NOISE, "", "seen", value - low, high - value, 1.0)
        unit = KINDS[kind_of_quantity(name)].si
        return Answer(
            name, value, low, high, level, unit, scatter, none, (row,), (f"{_ALONE}: {self.missing}",)
        )

    @property
    def answers(self) -> pd.DataFrame:
        """Table of all answers, one a row: value, combined, statistical and systematic ends (SI), and the unit."""
        return answers_table(self.answer(name) for name in (*self.names, *self.derived))

    @cached_property
    def verdict(self) -> Advice:
        """Whether the result can be used, as `Fit.verdict`; ``check`` where a chain has not converged."""
        if self.problem is None:
            return Advice(CHECK, _ALONE, self.missing, "sample the curve again")
        own = self.statement.verdict
        if self.converged or own == REJECT:
            return own
        cause, step = "the chain is too short for its correlation", "sample longer (max_steps)"
        return Advice(
            CHECK,
            "the draws have not converged",
            cause,
            step,
            others=() if own == GOOD else (own, *own.others),
        )

    @property
    def provenance(self) -> dict[str, Any]:
        """Versions of the software, and names, files and hashes of the curves as far as they are known."""
        curves = provenance(self.problem.curves)["curves"] if self.problem is not None else []
        return {"versions": dict(self.diagnostics.versions), "curves": curves}

    @property
    def samples(self) -> pd.DataFrame:
        """All draws (SI), one row each and one column per parameter."""
        return pd.DataFrame(self.chain.reshape(-1, len(self.names)), columns=list(self.names))

    @property
    def derived_samples(self) -> pd.DataFrame:
        """Draws of the derived quantities (SI), one column each."""
        return pd.DataFrame({name: values.ravel() for name, values in self.derived.items()})

    def of(self, name: str) -> FloatArray:
        """Draws of one parameter or derived quantity, (draws, walkers), SI.

        Raises
        ------
        InputError
            If there is none of that name.
        """
        if name in self.names:
            return self.chain[..., self.names.index(name)]
        if name in self.derived:
            return self.derived[name]
        raise InputError(f"no {name!r} here; there are {', '.join((*self.names, *self.derived))}")

    def summary(self, *, derived: bool = False) -> pd.DataFrame:
        """Table of the posterior, one row per parameter (SI).

        Parameters
        ----------
        derived : bool, default False
            Add a row for each derived quantity.

        Returns
        -------
        DataFrame
            ``median``; ``hdi68_low`` ... ``hdi95_high``, the shortest intervals with 68 % and 95 % of the draws;
            ``ess``, effective sample size; ``rhat``, nan for weighted draws and without ArviZ; ``mcse``, Monte
            Carlo error of the median; ``informed``, whether the data changed the prior, in words.
        """
        information = self.prior_comparison()["informed"]
        rows = {name: self._row(self.of(name), str(information[name])) for name in self.names}
        if derived:
            rows |= {name: self._row(values, "derived") for name, values in self.derived.items()}
        return pd.DataFrame.from_dict(rows, orient="index")

    def prior_comparison(self) -> pd.DataFrame:
        """Prior against posterior, one row per parameter: medians, 95 % intervals, and how they differ.

        ``narrowing`` is the share of the prior's 68 % width that the data removed, ``distance`` the largest
        difference of the two distribution functions, and ``informed`` the verdict in words; see
        `compare_with_prior`.
        """
        rows: dict[str, Information] = {
            name: compare_with_prior(self.of(name), self.prior_quantiles[:, i], self._worth(self.of(name)))
            for i, name in enumerate(self.names)
        }
        table = pd.DataFrame.from_dict(
            {name: row._asdict() for name, row in rows.items()}, orient="index", columns=COMPARISON_COLUMNS
        )
        table.insert(0, "prior", list(self.priors))
        return table

    def _worth(self, values: FloatArray) -> float:
        """Effective number of independent draws of one quantity (draws, walkers)."""
        known = self.diagnostics
        return min(known.effective) if known.weighted else effective_size(values)

    def _row(self, values: FloatArray, verdict: str) -> dict[str, Any]:
        worth = self._worth(values)
        flat = values.reshape(-1, 1)
        even = np.full(len(flat), 1.0 / len(flat))
        error = quantile_errors(flat, even, np.full((3, 1), 0.5 / worth**0.5))[1, 0]
        low68, high68 = highest_density_interval(values, 0.68)
        low95, high95 = highest_density_interval(values, 0.95)
        return {
            "median": float(np.median(values)),
            "hdi68_low": low68,
            "hdi68_high": high68,
            "hdi95_low": low95,
            "hdi95_high": high95,
            "ess": worth,
            "rhat": np.nan if self.diagnostics.weighted else rank_normalised_rhat(values),
            "mcse": float(error * values.std()),
            "informed": verdict,
        }

    def to_inference_data(self, log_likelihood: FloatArray | None = None) -> Any:
        """Return the draws as an arviz ``InferenceData`` (1.x: a ``DataTree``), one chain per walker.

        Groups ``posterior`` (parameters and, where they have as many draws, derived quantities), ``prior``
        and ``sample_stats`` (``lp``); with `log_likelihood` (draws, walkers, points), of the points, that too.
        ``to_netcdf`` of the result writes a file others can read.

        Raises
        ------
        MissingExtraError
            If arviz is not installed (extra ``uq``).
        """
        parameters = {name: self.of(name).T for name in self.names}
        whole = {name: values.T for name, values in self.derived.items()}
        draws = self.chain.shape[0]
        parameters |= {name: values for name, values in whole.items() if values.shape[1] == draws}
        groups: dict[str, Any] = {
            "posterior": parameters,
            "sample_stats": {"lp": self.log_posterior.T},
            "prior": {name: self.prior_quantiles[None, :, i] for i, name in enumerate(self.names)},
        }
        if log_likelihood is not None:
            groups["log_likelihood"] = {"force": np.moveaxis(log_likelihood, 0, 1)}
        arviz = arviz_library()
        # Version 1 takes the groups as one mapping and gives xarray's tree.
        return arviz.from_dict(**groups) if hasattr(arviz, "InferenceData") else arviz.from_dict(groups)

    def save(self, path: str | os.PathLike[str]) -> None:
        """Write everything to a compressed ``.npz`` file without pickles, the problem too.

        A problem with a part that cannot be stored as data, such as a prior of your own class, is left out, and the
        file says why.

        Raises
        ------
        FileAccessError
            If the file cannot be written.
        """
        arrays: dict[str, Any] = {
            "chain": self.chain,
            "log_posterior": self.log_posterior,
            "prior_quantiles": self.prior_quantiles,
        }
        arrays |= {f"derived/{name}": values for name, values in self.derived.items()}
        for number, band in enumerate(self.predictive):
            arrays |= {f"predictive/{number}/{key}": value for key, value in vars(band).items()}
        about = {
            "format": _FORMAT,
            "names": self.names,
            "priors": self.priors,
            "truth": dict(self.truth),
            "derived": list(self.derived),
            "curves": len(self.predictive),
            "diagnostics": asdict(self.diagnostics),
        }
        if self.problem is not None:
            try:
                about["problem"], kept = problem_record(self.problem)
                arrays |= {f"problem/{name}": array for name, array in kept.items()}
            except InputError as error:
                about["missing"] = str(error)
        elif self.missing:
            about["missing"] = self.missing
        write_archive(path, about, arrays)

    @classmethod
    def load(cls, path: str | os.PathLike[str]) -> Self:
        """Read what `save` wrote.

        A file that lacks the problem, as older ones do, gives a posterior without it; `missing` says why.

        Raises
        ------
        FileAccessError
            If the file cannot be read.
        FileFormatError
            If it is not a saved posterior, or damaged.
        """
        about, arrays = read_archive(path, _FORMAT, _KIND)
        with understood(path, _KIND):
            parts = parts_of(about, arrays)
            problem, missing = _problem_of(about, arrays, printable(path))
        return cls(**parts, problem=problem, missing=missing)


def _problem_of(about: Mapping[str, Any], arrays: Mapping[str, Any], path: str) -> tuple[Problem | None, str]:
    """The problem of a saved posterior, or why there is none."""
    if "problem" not in about:
        why = about.get("missing", "it was saved by a version of underlay that kept the draws alone")
        return None, str(why)
    kept = {
        name.removeprefix("problem/"): array for name, array in arrays.items() if name.startswith("problem/")
    }
    try:
        return problem_from_record(about["problem"], kept), ""
    except FileFormatError as error:
        raise FileFormatError(f"{path} is damaged: {error}; {_KIND.advice}") from error
    except InputError as error:
        return None, f"it cannot be stated here: {error}"
