"""Tables of a posterior, in units for people."""

from __future__ import annotations

from typing import TYPE_CHECKING

import pandas as pd

from underlay.inference.sampling.derived import kind_of_quantity
from underlay.report.labels import label
from underlay.report.tables import facts_table, labelled_table
from underlay.report.words import quantity_with_interval
from underlay.scene.parameters import kind_of
from underlay.units import format_quantity

if TYPE_CHECKING:
    from underlay.inference.sampling.posterior import Posterior

__all__ = ["posterior_diagnostics_table", "posterior_table", "prior_table"]


def posterior_table(posterior: Posterior) -> pd.DataFrame:
    """Return one row per parameter and derived quantity: median, intervals, what the data told; as text."""
    rows = []
    for name, row in posterior.summary(derived=True).iterrows():
        kind = kind_of_quantity(str(name))
        rows.append(
            {
                "parameter": label(str(name)),
                "median (95 % interval)": quantity_with_interval(
                    row["median"], row["hdi95_low"], row["hdi95_high"], kind
                ),
                "68 % interval": _span(row["hdi68_low"], row["hdi68_high"], kind),
                "effective draws": f"{row['ess']:.0f}",
                "R-hat": f"{row['rhat']:.4f}",
                "data": row["informed"],
            }
        )
    return labelled_table(rows)


def _span(low: float, high: float, kind: str) -> str:
    return f"{format_quantity(low, kind)} to {format_quantity(high, kind)}"


def prior_table(posterior: Posterior) -> pd.DataFrame:
    """Return each parameter before and after the test, and what the data told, as text."""
    rows = []
    for name, row in posterior.prior_comparison().iterrows():
        kind = kind_of(str(name))
        spans = {
            when: _span(row[f"{key}_low"], row[f"{key}_high"], kind)
            for when, key in (("before (95 %)", "prior"), ("after (95 %)", "posterior"))
        }
        narrowed = f"{100.0 * row['narrowing']:.0f} %"
        rows.append(
            {"parameter": label(str(name)), **spans, "narrowed by": narrowed, "data": row["informed"]}
        )
    return labelled_table(rows)


def posterior_diagnostics_table(posterior: Posterior) -> pd.DataFrame:
    """Return how the sampling went, as text."""
    d = posterior.diagnostics
    rows = {
        "converged": "yes" if d.converged else "NO",
        "why it stopped": d.reason,
        "steps, walkers": f"{d.steps}, {d.walkers} ({d.burn_in} dropped, every {d.thin}th kept)",
        "autocorrelation time": ", ".join(f"{t:.0f}" for t in d.autocorrelation_time) + " steps",
        "R-hat": ", ".join(f"{r:.4f}" for r in d.rhat),
        "acceptance": f"{100.0 * d.acceptance:.0f} %",
        "evaluations": f"{d.evaluations}, of which {d.failures} failed",
        "model error": f"{d.model_error:.1e} of the force",
        "data in the 95 % band": ", ".join(
            f"{100.0 * band.coverage():.1f} %" for band in posterior.predictive
        ),
        "seed": "not given" if d.seed is None else str(d.seed),
        "time": f"{d.seconds:.1f} s",
    }
    return facts_table(rows)
