"""What a sampler hands back: the posterior as draws, with everything needed to judge it.

arviz, the one place it is imported: for the export of a posterior and for comparisons.

What a sampler hands back: the posterior as draws, with everything needed to judge and to use them.
"""

from __future__ import annotations

import os
import warnings
from collections.abc import Mapping
from dataclasses import asdict, dataclass
from types import ModuleType
from typing import Any, Self

import numpy as np
import pandas as pd

from underlay._arrays import FloatArray
from underlay._door import FileKind, printable, understood
from underlay.errors import FileFormatError, InputError, missing_extra
from underlay.inference.least_squares.provenance import provenance
from underlay.inference.problem import Problem
from underlay.inference.problem_record import problem_from_record, problem_record
from underlay.inference.ridge.importance import LogEvidence
from underlay.inference.sampling.convergence import (
    effective_size,
    highest_density_interval,
    median_error,
    rank_normalised_rhat,
)
from underlay.inference.sampling.diagnostics import (
    INFORMED_COLUMNS,
    Information,
    Predictive,
    SamplingDiagnostics,
    compare_with_prior,
)
from underlay.inference.sampling.posterior_file import LARGEST, parts_of, read_archive, write_archive

__all__ = ["Posterior", "arviz_library"]


def arviz_library() -> ModuleType:
    """Import arviz.

    Raises
    ------
    MissingExtraError
        If it is not installed.
    """
    try:
        return _imported()
    except FileNotFoundError:
        # arviz notes in the user's cache on which day it last warned. Where two processes import it at the same
        # moment, the one that comes second finds its draft of that note gone; by then the note is in its place.
        return _imported()


def _imported() -> ModuleType:
    try:
        with warnings.catch_warnings():
            # arviz announces its next major version at import, which is not the caller's concern.
            warnings.simplefilter("ignore", FutureWarning)
            import arviz  # noqa: PLC0415  # an optional extra
    except ImportError as error:
        raise missing_extra("this needs arviz", "uq") from error
    module: ModuleType = arviz
    return module


_FORMAT = "underlay posterior 1"


_KIND = FileKind("a saved posterior", LARGEST, "save it again where it was made")


@dataclass(frozen=True, eq=False)
class Posterior:
    """Draws from the posterior of a `Problem`, in SI.

    Parameters
    ----------
    names : tuple of str
        The free parameters.
    chain : FloatArray
        (draws, walkers, parameters), burnt in and thinned, SI.
    log_posterior : FloatArray
        (draws, walkers): log-density in the scaled coordinates in which it was sampled.
    priors : tuple of str
        The prior of each parameter, in words.
    prior_quantiles : FloatArray
        (levels, parameters): prior quantiles (SI) at the middles of equal shares.
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

    def __post_init__(self) -> None:
        for array in (self.chain, self.log_posterior, self.prior_quantiles, *self.derived.values()):
            array.flags.writeable = False

    def __repr__(self) -> str:
        state = "converged" if self.converged else "NOT converged"
        return f"<Posterior of {', '.join(self.names)}: {self.chain[..., 0].size} draws, {state}>"

    @property
    def converged(self) -> bool:
        """Whether the stop rule was met."""
        return self.diagnostics.converged

    @property
    def log_evidence(self) -> LogEvidence | None:
        """Natural logarithm of the probability of the data with its error; None where it is not known.

        From weighted draws of a mixture along the ridges of the posterior, where they were accepted and do not
        differ from the chain; ``diagnostics.importance`` says why they were not.
        """
        found = self.diagnostics.importance
        if found is None or not found.stands:
            return None
        return LogEvidence(found.log_evidence, found.log_evidence_error)

    @property
    def provenance(self) -> dict[str, Any]:
        """Versions of what computed, and names, files and hashes of the curves as far as they are known."""
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

    def inside(self, level: float) -> float:
        """Share of the draws that a printed interval of this level holds: the probability that the fit's is given.

        It is the level, but where intervals of a half-space whose law is given up leave out less (`Fit.interval`).
        """
        return 1.0 - self.diagnostics.left_out * (1.0 - level)

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
            ``median``; ``hdi68_low`` ... ``hdi95_high``, the shortest intervals with 68 % and 95 % (`inside` of
            these, of the draws); ``ess``,
            effective sample size; ``rhat``; ``mcse``, Monte Carlo error of the median; ``informed``, whether
            the data changed what was known before.
        """
        information = self.prior_comparison()["informed"]
        worth = min(self.diagnostics.effective) if self.diagnostics.weighted else np.inf
        levels = self.inside(0.68), self.inside(0.95)
        rows = {name: _row(self.of(name), levels, str(information[name]), worth) for name in self.names}
        if derived:
            rows |= {name: _row(values, levels, "derived", worth) for name, values in self.derived.items()}
        return pd.DataFrame.from_dict(rows, orient="index")

    def prior_comparison(self) -> pd.DataFrame:
        """Prior against posterior, one row per parameter: medians, 95 % intervals, and what the data told.

        ``narrowing`` is the share of the prior's 68 % width that the data removed, ``distance`` the largest
        difference of the two distribution functions, and ``informed`` the verdict in words; see
        `compare_with_prior`.
        """
        rows: dict[str, Information] = {
            name: compare_with_prior(self.of(name), self.prior_quantiles[:, index], self.inside(0.95))
            for index, name in enumerate(self.names)
        }
        table = pd.DataFrame.from_dict(
            {name: row._asdict() for name, row in rows.items()}, orient="index", columns=INFORMED_COLUMNS
        )
        table.insert(0, "prior", list(self.priors))
        return table

    def to_inference_data(self, log_likelihood: FloatArray | None = None) -> Any:
        """Return the draws as an arviz ``InferenceData``, one chain per walker.

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
        return arviz_library().from_dict(**groups)

    def save(self, path: str | os.PathLike[str]) -> None:
        """Write everything to a compressed ``.npz`` file without pickles, the problem too.

        A problem that has no words for a part of it, such as a prior of your own class, is left out, and the
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


def _row(values: FloatArray, levels: tuple[float, float], informed: str, worth: float) -> dict[str, Any]:
    size = effective_size(values)
    # Draws that are there several times tell no more than the weighted ones they come from.
    repeats = max(1.0, size / worth)
    low68, high68 = highest_density_interval(values, levels[0])
    low95, high95 = highest_density_interval(values, levels[1])
    return {
        "median": float(np.median(values)),
        "hdi68_low": low68,
        "hdi68_high": high68,
        "hdi95_low": low95,
        "hdi95_high": high95,
        "ess": size / repeats,
        "rhat": rank_normalised_rhat(values),
        "mcse": median_error(values) * repeats**0.5,
        "informed": informed,
    }
