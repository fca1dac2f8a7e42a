"""Rows of statistics that a spreadsheet leaves below the readings: a mean is no reading."""

from __future__ import annotations

import re
from collections.abc import Sequence

from underlay._text import names_there

__all__ = ["without_statistics"]

# In small letters, without what ends an abbreviation or goes before the number. Single letters are not here: they
# may be anybody's remark on the last reading.
_WORDS = frozenset(
    (
        *("mean", "average", "avg", "median", "max", "maximum", "min", "minimum", "sum", "total", "count"),
        *("sd", "s.d", "std", "stdev", "st.dev", "std.dev", "std dev", "standard deviation", "variance"),
        *("sem", "s.e.m", "se", "standard error", "std error", "std.error", "cv", "cov", "range"),
        *("mittelwert", "mittel", "standardabweichung", "stabw", "summe", "anzahl", "moyenne", "somme"),
        *("écart type", "écart-type", "ecart type", "ecart-type", "media", "promedio", "mediana", "suma"),
        *("desviación estándar", "desviacion estandar", "deviazione standard", "somma"),
    )
)
# No word for a statistic is longer: who looks for brackets in a cell without end looks for long.
_LONGEST = 60


def without_statistics(rows: Sequence[Sequence[str]]) -> tuple[Sequence[Sequence[str]], tuple[str, ...]]:
    """Rows of cells without those of statistics at the foot, and a note that names what was left out, if any.

    A row of statistics holds a word for one in any of its cells, used or not; blank rows may stand between.
    """
    end = len(rows)
    found: list[str] = []
    for number in range(len(rows), 0, -1):
        cells = [cell.strip().strip('"') for cell in rows[number - 1]]
        word = next((cell for cell in cells if _is_statistic(cell)), None)
        if word is None and any(cells):
            break
        if word is not None:
            found.insert(0, word)
        if found:
            end = number - 1
    if not found:
        return rows, ()
    return rows[:end], (f"not read: rows of statistics at the foot of the table, {names_there(found)}",)


def _is_statistic(cell: str) -> bool:
    """Whether a cell is a word for one, or several of them such as "Mean ± SD"; what stands in brackets aside."""
    if len(cell) > _LONGEST:
        return False
    bare = re.sub(r"[(\[].*?[)\]]", "", cell.lower())
    return all(_plain(part) in _WORDS for part in re.split(r"±|\+/?-|[/&]", bare))


def _plain(words: str) -> str:
    return words.rstrip(" .:=%()").strip()
