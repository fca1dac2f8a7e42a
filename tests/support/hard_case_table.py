"""A table of hard cases, printed by pytest -s: what was asked, the worst error, the digits that hold."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from math import inf, log10


@dataclass(frozen=True)
class Row:
    """One hard case: its worst errors, and the bound one of them must keep."""

    case: str
    absolute: float
    relative: float
    bound: str
    worst: float
    limit: float

    @property
    def digits(self) -> float:
        """Decimal digits of the error that is bounded."""
        return inf if self.worst == 0.0 else -log10(self.worst)


@dataclass
class HardCaseTable:
    """Rows of one area, printed as they come in."""

    title: str
    write: Callable[[str], object] = print
    rows: list[Row] = field(default_factory=list)

    def add(self, row: Row) -> None:
        if not self.rows:
            self.write(f"\n\n{self.title}")
            self.write(f"{'case':<58} {'absolute':>9} {'relative':>9} {'bound':>14} {'digits':>7}")
        self.rows.append(row)
        bound = f"{row.bound} {row.limit:.0e}"
        self.write(f"{row.case:<58} {row.absolute:9.1e} {row.relative:9.1e} {bound:>14} {row.digits:7.1f}")
