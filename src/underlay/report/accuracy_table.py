"""The table of `accuracy_cost` for people: one line per method, times in units of the formula."""

from __future__ import annotations

from typing import Any

import pandas as pd

__all__ = ["accuracy_summary", "answer_summary", "method_label"]


def accuracy_summary(table: pd.DataFrame) -> pd.DataFrame:
    """Return the result of `accuracy_cost` in the columns people read, closest method first.

    Returns
    -------
    pandas.DataFrame
        ``law``, ``error`` (largest relative error of the force), ``cold (us)``, ``cold (x)`` and ``held (x)``
        (time over that of the explicit formula), ``best`` (nothing is both closer and faster, from cold).
    """
    answered = table[table["error"].notna()]
    return pd.DataFrame(
        {
            "law": [method_label(row) for _, row in answered.iterrows()],
            "error": answered["error"].to_numpy(),
            "cold (us)": 1e6 * answered["cold_seconds"].to_numpy(),
            "cold (x)": answered["cold_ratio"].to_numpy(),
            "held (x)": answered["held_ratio"].to_numpy(),
            "best": answered["pareto"].to_numpy(),
        }
    )


def answer_summary(table: pd.DataFrame) -> pd.DataFrame:
    """Return the result of `answer_cost` in the columns people read, closest modulus first.

    Returns
    -------
    pandas.DataFrame
        ``law``; ``E (%)``, the error of the modulus with the thickness known, and ``fit (x)``, its time over that
        of lmfit's Hertz fit; ``E, free h (%)``, ``h (%)`` and ``fit, free h (x)``, the thickness fitted too.
    """
    ordered = table.sort_values("E_error", key=abs, ignore_index=True)
    return pd.DataFrame(
        {
            "law": [method_label(row) for _, row in ordered.iterrows()],
            "E (%)": 100.0 * ordered["E_error"],
            "fit (x)": ordered["ratio"],
            "E, free h (%)": 100.0 * ordered["E_error_joint"],
            "h (%)": 100.0 * ordered["thickness_error"],
            "fit, free h (x)": ordered["joint_ratio"],
        }
    )


def method_label(row: pd.Series[Any]) -> str:
    """Name of a method with what distinguishes it: ``"explicit 4"``, ``"exact 1e-06 (4 nodes)"``."""
    method, form, order, rtol, nodes = (row[key] for key in ("method", "form", "order", "rtol", "nodes"))
    if form:
        return f"{form} {order:.0f}"
    if pd.isna(rtol):
        return str(method)
    return f"{method} {rtol:.0e}" + (f" ({nodes:.0f} nodes)" if pd.notna(nodes) else "")
