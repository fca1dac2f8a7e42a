"""Tables of a posterior, in units for people."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import pandas as pd

from underlay.inference.sampling.derived import kind_of_quantity
from underlay.inference.uncertainty.answer import NORMAL_95
from underlay.report.labels import label
from underlay.report.screen import interval_text
from underlay.report.tables import facts_table, labelled_table
from underlay.scene.parameters import kind_of
from underlay.units import format_ends, human_unit, interval_digits

if TYPE_CHECKING:
    from underlay.inference.sampling.posterior import Posterior

__all__ = ["posterior_diagnostics_table", "posterior_table", "prior_table"]

# Ends farther apart than this have each a unit of its own.
_ONE_UNIT = 1e-3


def posterior_table(posterior: Posterior) -> pd.DataFrame:
    """Return one row per parameter and derived quantity as text: value, intervals of the draws, convergence.

    The column ``data`` says how much the data narrowed the prior. The value and its interval are those that `fit`
    prints, with the draws' statistical part; of a posterior that was stored without its problem they are median and
    95 % interval of the draws.
    """
    rows = []
    for name, row in posterior.summary(derived=True).iterrows():
        kind = kind_of_quantity(str(name))
        rows.append(
            {
                "parameter": label(str(name)),
                "value (95 % interval)": interval_text(*_stated(posterior, str(name), row), kind),
                "median of the samples (95 %)": interval_text(
                    row["median"], row["hdi95_low"], row["hdi95_high"], kind
                ),
                "68 % interval": _span(row["hdi68_low"], row["hdi68_high"], kind),
                "effective samples": f"{row['ess']:.0f}",
                "R-hat": "" if np.isnan(row["rhat"]) else f"{row['rhat']:.4f}",
                "data": row["informed"],
            }
        )
    return labelled_table(rows)


def _stated(posterior: Posterior, name: str, row: pd.Series) -> tuple[float, float, float]:
    """Return value, low and high end (SI) of `Posterior.answer`; without a problem, those of the draws."""
    if posterior.problem is None:
        return float(row["median"]), float(row["hdi95_low"]), float(row["hdi95_high"])
    known = posterior.answer(name)
    return known.value, known.low, known.high


def _span(low: float, high: float, kind: str) -> str:
    unit, factor = human_unit(min(low, high, key=abs), kind)
    if not abs(low) > _ONE_UNIT * abs(high):
        return " to ".join(format_ends(low, high, kind))
    digits = interval_digits(low, high)
    return f"{low / factor:.{digits}g} to {high / factor:.{digits}g} {unit}".strip()


def prior_table(posterior: Posterior) -> pd.DataFrame:
    """Return 95 % intervals of each parameter before and after the data, and by how much they narrowed (text)."""
    rows = []
    for name, row in posterior.prior_comparison().iterrows():
        kind = kind_of(str(name))
        spans = {
            when: _span(row[f"{key}_low"], row[f"{key}_high"], kind)
            for when, key in (("prior (95 %)", "prior"), ("posterior (95 %)", "posterior"))
        }
        narrowed = f"{100.0 * row['narrowing']:.0f} %"
        rows.append(
            {"parameter": label(str(name)), **spans, "narrowed by": narrowed, "data": row["informed"]}
        )
    return labelled_table(rows)


def posterior_diagnostics_table(posterior: Posterior) -> pd.DataFrame:
    """Return the diagnostics of the sampling, a row each, as text: convergence, effective draws, errors."""
    d = posterior.diagnostics
    judged = {"draws": "weighted, then resampled; a chain begun from them agrees"} if d.weighted else {}
    kept = "of the chain that judges" if d.weighted else f"{d.burn_in} dropped, {_every(d.thin)} kept"
    chain = {
        **judged,
        "steps, walkers": f"{d.steps}, {d.walkers} ({kept})",
        "autocorrelation time": ", ".join(f"{t:.0f}" for t in d.autocorrelation_time) + " steps",
        "R-hat": ", ".join(f"{r:.4f}" for r in d.rhat) or "not asked for",
        "acceptance": f"{100.0 * d.acceptance:.0f} %",
    }
    rows = {
        "converged": "yes" if d.converged else "NO",
        "why it stopped": d.reason,
        **(chain if d.method == "emcee" else {"draws": "weighted, then resampled: no chain"}),
        "effective samples": ", ".join(f"{size:.0f}" for size in d.effective) or "not kept",
        "errors of the 2.5, 50, 97.5 % quantiles": _errors(posterior),
        **_weighted(posterior),
        "evaluations": f"{d.evaluations}, of which {d.failures} failed",
        "model error": f"{d.model_error:.1e} of the force",
        "data in the 95 % band": ", ".join(
            f"{100.0 * band.coverage():.1f} %" for band in posterior.predictive
        ),
        "seed": "not given" if d.seed is None else str(d.seed),
        "time": f"{d.seconds:.1f} s",
    }
    return facts_table(rows)


def _every(thin: int) -> str:
    return "all others" if thin == 1 else f"one in {thin}"


def _errors(posterior: Posterior) -> str:
    """Write the Monte Carlo errors of each parameter's quantiles (2.5, 50, 97.5 %).

    They are in units of its posterior standard deviation.
    """
    told = "; ".join(
        f"{label(name)} {', '.join(f'{error:.2f}' for error in errors)}"
        for name, errors in posterior.diagnostics.quantile_errors.items()
    )
    return f"{told} standard deviations" if told else "not kept"


def _weighted(posterior: Posterior) -> dict[str, str]:
    """Return rows on the importance-sampling check of the posterior, and on the log evidence it gives."""
    found, evidence = posterior.diagnostics.importance, posterior.log_evidence
    if found is None:
        return {"weighted samples": "none"}
    verdict = (
        f"not used: {found.refused}"
        if found.refused
        else f"they disagree: {found.disagreement}"
        if found.disagreement
        else "used"
    )
    return {
        "weighted samples": (
            f"{found.effective:.0f} effective of {found.draws}, Pareto k {found.k_hat:.2f}; {verdict}"
        ),
        "ln(evidence), 95 %": (
            "not known" if evidence is None else f"{evidence.value:.2f} ± {NORMAL_95 * evidence.error:.2f}"
        ),
    }
