"""Reads the table of a map and a person's decisions on single curves, accepted or refused, with reasons.

Decisions are a small CSV, and columns of the map's table. A curve refused by hand keeps its numbers in the table,
but its ``status`` is no longer that of a fitted curve, so that it is left out of all statistics; ``reason`` says
that it was refused and why. One that is accepted is included although it is doubtful.
"""

from __future__ import annotations

import io
import os
from collections import deque
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from underlay._csv import csv_text, numbered_rows, unguarded
from underlay._door import FileKind, PathLike, printable, read_bytes, read_start, read_text, understood
from underlay._text import names_there, one_line, unguarded_cell
from underlay.errors import InputError
from underlay.inference.batch.results_table import FITTED, LIKELIHOOD, fitted_names, read_parquet
from underlay.inference.uncertainty.answer import NORMAL_95
from underlay.inference.uncertainty.verdict import REJECT

#: Name of the table that a review writes.
DECISIONS = "decisions.csv"
#: Values of the column ``decision``; an empty cell means no decision.
ACCEPT, REFUSE = "accept", "refuse"
#: ``status`` of a curve that a person refused.
REFUSED_BY_HAND = "refused by hand"
_KIND = FileKind("a table of decisions (CSV)", 64_000_000, "it needs the columns curve, decision and reason")
# Largest number of columns, and of characters of a reason, that are read.
_MOST_COLUMNS, _LONGEST = 100, 1000
_CURVE, _DECISION, _REASON = "curve", "decision", "reason"
_TEXTS = ("name", "status", "verdict", "reason")
_NUMBERS = ("x", "y", "reduced_chi_square", "rms", "seconds")
# Bytes, columns and cells that a map's table may have: a million curves with thirty numbers each.
_MAP_TABLE_KIND = FileKind("the table of a map", 1_000_000_000, "make it again with underlay map --resume")
_MAP_TABLE_MOST_COLUMNS, _MOST_CELLS = 1000, 50_000_000
_HEADER = "name,path,x,y,status,verdict,reason"


@dataclass(frozen=True)
class Decision:
    """A person's decision on one curve.

    Parameters
    ----------
    accepted : bool
        Whether the curve is used.
    reason : str
        Why.
    """

    accepted: bool
    reason: str = ""

    @property
    def word(self) -> str:
        """``"accept"`` or ``"refuse"``."""
        return ACCEPT if self.accepted else REFUSE


@dataclass(frozen=True)
class Decisions:
    """Decisions by the name of the curve.

    Parameters
    ----------
    by_curve : mapping of str to Decision
        Only the curves for which a decision was made.

    Examples
    --------
    >>> import pandas as pd
    >>> table = pd.DataFrame({"name": ["a", "b"], "status": "fitted", "verdict": "good", "reason": ""})
    >>> judged = Decisions({"b": Decision(False, "air bubble")}).applied(table)
    >>> list(judged["status"]), judged["reason"][1]
    (['fitted', 'refused by hand'], 'refused by hand: air bubble')
    """

    by_curve: Mapping[str, Decision]

    def applied(self, table: pd.DataFrame) -> pd.DataFrame:
        """Return a map's table with columns ``decision`` and ``decision_reason``, and refused curves marked.

        Refused curves get the status ``"refused by hand"``.

        Raises
        ------
        InputError
            If a curve is not in the table, or one without a fit was accepted.
        """
        known = dict(zip(table["name"], table["status"], strict=True))
        for name, decision in self.by_curve.items():
            if name not in known:
                raise InputError(
                    f"no curve {one_line(name)!r} in this map; it has {names_there(known)}: decisions name "
                    "curves as the column 'name' does"
                )
            if decision.accepted and known[name] != FITTED:
                raise InputError(
                    f"{one_line(name)!r} was accepted, but has no fit: leave its decision empty, or refuse it"
                )
        judged = table.copy()
        for column, told in zip((_DECISION, "decision_reason"), self._told(table["name"]), strict=True):
            judged[column] = pd.Series(told, index=table.index, dtype="str")
        refused = (judged[_DECISION] == REFUSE).to_numpy(dtype=bool)
        judged.loc[refused, "status"] = REFUSED_BY_HAND
        judged.loc[refused, "verdict"] = "refused"
        why = judged.loc[refused, "decision_reason"]
        judged.loc[refused, "reason"] = [
            f"{REFUSED_BY_HAND}: {text}" if text else REFUSED_BY_HAND for text in why
        ]
        return judged

    def _told(self, curves: Iterable[str]) -> tuple[list[str], list[str]]:
        """Words and reasons of the decisions on some curves; empty where there is none."""
        found = [self.by_curve.get(name) for name in curves]
        return ["" if d is None else d.word for d in found], ["" if d is None else d.reason for d in found]

    def csv(self, listed: pd.DataFrame) -> str:
        """Return a CSV for a person to fill in: a row for each row of `listed`, whose column ``curve`` names it."""
        table = listed.copy()
        words, reasons = self._told(table[_CURVE])
        table.insert(1, _DECISION, words)
        table.insert(2, _REASON, reasons)
        return csv_text(table)


def read_decisions(path: str | os.PathLike[str]) -> Decisions:
    """Read the decisions that a person wrote into the CSV of a review.

    Parameters
    ----------
    path : path
        A table, with commas or semicolons, with the columns ``curve``, ``decision`` (accept, refuse or empty) and
        ``reason``, which a refusal needs; other columns are ignored.

    Raises
    ------
    FileAccessError, FileFormatError
        If it cannot be read, or is no such table.
    InputError
        If a decision is another word, a refusal has no reason, or two rows contradict each other on one curve; the
        message names the line.
    """
    text = read_text(path, _KIND)
    with understood(path, _KIND):
        rows = list(_rows(text))
    found: dict[str, Decision] = {}
    for line, curve, word, reason in rows:
        where = f"{printable(path)}, line {line} ({one_line(curve, 80)})"
        if not word:
            continue
        if word not in (ACCEPT, REFUSE):
            raise InputError(
                f"{where}: decision must be {ACCEPT}, {REFUSE} or empty; got {one_line(word, 80)!r}"
            )
        if word == REFUSE and not reason:
            raise InputError(f"{where}: say in the column 'reason' why it is refused")
        decision = Decision(word == ACCEPT, reason)
        if found.setdefault(curve, decision) != decision:
            raise InputError(f"{where}: decided twice, and differently")
    return Decisions(found)


def _rows(text: str) -> Iterator[tuple[int, str, str, str]]:
    """Line number, curve, decision and reason of every row of the CSV."""
    first = text.split("\n", 1)[0]
    # Half of Europe's spreadsheets write semicolons.
    separator = ";" if first.count(";") > first.count(",") else ","
    lines = numbered_rows(text, _MOST_COLUMNS, separator)
    _, header = next(lines)
    names = [name.strip().lower() for name in header]
    missing = [name for name in (_CURVE, _DECISION, _REASON) if name not in names]
    if missing:
        raise ValueError(f"it has no column {missing[0]!r}; it has {names_there(header)}")
    places = [names.index(name) for name in (_CURVE, _DECISION, _REASON)]
    for line, cells in lines:
        curve, word, reason = (unguarded_cell(cells[place]) for place in places)
        if curve.strip():
            yield line, curve, word.strip().lower(), one_line(" ".join(reason.split()), _LONGEST)


def not_rejected(table: pd.DataFrame) -> pd.DataFrame:
    """Rows of a map's table with a fit whose model is not rejected, or which a person accepted all the same."""
    trusted = table["verdict"] != REJECT
    if _DECISION in table.columns:
        trusted |= table[_DECISION] == ACCEPT
    return table[(table["status"] == FITTED) & trusted]


def without_refused(table: pd.DataFrame) -> pd.DataFrame:
    """Return a map's table with the numbers of curves refused by hand set to nan, for pictures."""
    refused = (table["status"] == REFUSED_BY_HAND).to_numpy(dtype=bool)
    if not refused.any():
        return table
    kept = table.copy()
    numbers = [
        name for name in table.columns if "." in str(name) and pd.api.types.is_float_dtype(table[name])
    ]
    kept.loc[refused, numbers] = np.nan
    return kept


# Floats are read exactly: from pandas 3.1 on by default, where the option is deprecated.
_TO_THE_BIT: Mapping[str, Any] = (
    {"float_precision": "round_trip"} if tuple(map(int, pd.__version__.split(".")[:2])) < (3, 1) else {}
)


def is_map(path: PathLike) -> bool:
    """Whether a file is the table of a map: Parquet, or a CSV that begins with the map's header."""
    if Path(path).suffix.lower() == ".parquet":
        return True
    return read_start(path, len(_HEADER)) == _HEADER.encode()


def shared_error_of(table: pd.DataFrame) -> float | None:
    """Relative standard error of the modulus that all curves of a map share; None without its columns.

    It comes from uncertain inputs and the model, which shift all curves of one test in the same direction, so that
    it does not average out. The median over the fitted curves.
    """
    low, high = "layer.E.syst.low", "layer.E.syst.high"
    if not {low, high} <= set(table.columns):
        return None
    fitted = table.loc[table["status"] == FITTED, [low, high]].astype(float).dropna()
    fitted = fitted[fitted[low] > 0.0]
    if fitted.empty:
        return None
    return float(np.median(0.5 * np.log(fitted[high] / fitted[low])) / NORMAL_95)


def read_map(path: PathLike) -> pd.DataFrame:
    """Read the table of a map, CSV or Parquet.

    Raises
    ------
    FileAccessError
        If it cannot be read.
    FileFormatError
        If it is not such a table.
    MissingExtraError
        If it is Parquet and pyarrow is not installed.
    """
    content = io.BytesIO(read_bytes(path, _MAP_TABLE_KIND))
    with understood(path, _MAP_TABLE_KIND):
        if Path(path).suffix.lower() == ".parquet":
            table = read_parquet(content, _MOST_CELLS)
        else:
            text = content.getvalue().decode("utf-8-sig")
            deque(numbered_rows(text, _MAP_TABLE_MOST_COLUMNS), maxlen=0)
            table = unguarded(
                pd.read_csv(
                    io.StringIO(text),
                    index_col=False,
                    dtype=dict.fromkeys(_TEXTS, "str"),
                    **_TO_THE_BIT,
                )
            )
        missing = [name for name in _TEXTS if name not in table.columns]
        if missing:
            raise ValueError(f"it has no column {missing[0]!r}")
        if not table["verdict"].notna().any():
            raise ValueError("it has no row with a verdict")
        names = [str(name) for name in table.columns]
        fitted = fitted_names(names)
        ends = (
            (name, f"{name}.stderr" if f"{name}.stderr" in names else f"{name}.stat.high") for name in fitted
        )
        absent = [column for pair in ends for column in pair if column not in names]
        if absent:
            raise ValueError(f"it has no column {absent[0]!r} for its error")
        # A parameter path has a dot, a label has none.
        paths = [name for name in names if "." in name and not name.endswith(f".{LIKELIHOOD}")]
        numbers = {*paths, *fitted, *_NUMBERS} & set(names)
        return table.astype(dict.fromkeys(sorted(numbers), "float64"))
