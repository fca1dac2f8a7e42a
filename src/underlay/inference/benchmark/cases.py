"""The cases of the benchmark: a curve, the scene that a user is told, and the truth that he is not."""

from __future__ import annotations

import csv
from collections.abc import Collection
from dataclasses import dataclass
from pathlib import Path

from underlay._door import FileKind, read_text
from underlay.data.samples import sample
from underlay.errors import InputError

__all__ = ["Case", "benchmark_cases", "rows_of"]

_TABLE = FileKind("a table of the benchmark", 1_000_000, "install underlay again")


@dataclass(frozen=True)
class Case:
    """One curve of the benchmark.

    Parameters
    ----------
    kind : str
        What a simple formula leaves out: ``"elastic"`` (nothing), ``"stuck"``, ``"finite_strain"``, ...
    noise : str
        The world it was made in: ``"white"``, ``"proportional"``, ``"correlated"``, ``"depth"``, ``"drifting"``.
    curve, scene : Path
        Readings in SI, and what is known of the test.
    modulus : float
        The truth (Pa): Young's modulus of the layer, at once where it relaxes.
    """

    kind: str
    noise: str
    curve: Path
    scene: Path
    modulus: float


def benchmark_cases(kinds: Collection[str] = ()) -> tuple[Case, ...]:
    """Return the curves of some kinds of sample; of all where none is named.

    Raises
    ------
    InputError
        If there is no such kind.
    FileAccessError
        If the installation lacks the benchmark.
    """
    rows = rows_of("truth.csv")
    known = list(dict.fromkeys(row["kind"] for row in rows))
    for kind in kinds:
        if kind not in known:
            raise InputError(f"the benchmark has no kind {kind!r}; it has {', '.join(known)}")
    return tuple(
        Case(
            row["kind"],
            row["noise"],
            sample(f"benchmark/{row['curve']}"),
            sample(f"benchmark/{row['kind']}.toml"),
            float(row["E (Pa)"]),
        )
        for row in rows
        if row["kind"] in (kinds or known)
    )


def rows_of(name: str) -> list[dict[str, str]]:
    """Rows of a table of the benchmark, without the comments above its header."""
    lines = read_text(sample(f"benchmark/{name}"), _TABLE).splitlines()
    return list(csv.DictReader(line for line in lines if not line.startswith("#")))
