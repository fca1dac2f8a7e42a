"""The table of a map: its columns, one row as text, and the whole as CSV, Parquet or DataFrame."""

from __future__ import annotations

import csv
import math
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from importlib import import_module
from itertools import chain, islice, repeat
from pathlib import Path
from typing import IO, Any, BinaryIO

import pandas as pd

from underlay._csv import csv_text
from underlay._files import replacing, write_atomic
from underlay._text import guarded_cell, one_line, unguarded_cell
from underlay.errors import InputError, missing_extra
from underlay.inference.uncertainty.answer import NORMAL_95

#: Values of the column ``status``.
FITTED, FAILED = "fitted", "failed"

#: Columns of the modulus from the instrument's software (Pa), at the same Poisson's ratio, and of ours over it less
#: one (per cent).
INSTRUMENT, DIFFERENCE = "layer.E.instrument", "layer.E.difference_percent"
#: Ending of the column with the likelihood of a parameter in nine numbers, where a standard error would not do.
LIKELIHOOD = "likelihood"

# Types of columns, and the columns before and after those of the parameters.
_TEXT, _NUMBER, _COUNT = "text", "number", "count"
_BEFORE = {
    **dict.fromkeys(("name", "path"), _TEXT),
    **dict.fromkeys(("x", "y"), _NUMBER),
    **dict.fromkeys(("status", "verdict", "reason", "cause"), _TEXT),
}
_AFTER = {
    "law": _TEXT,
    **dict.fromkeys(("reduced_chi_square", "rms"), _NUMBER),
    "warnings": _COUNT,
    "seconds": _NUMBER,
    "sha256": _TEXT,
}
#: Endings of an answer's columns: value, ends of the combined interval and of its two parts (95 %).
_ANSWERED = ("", ".low", ".high", ".stat.low", ".stat.high", ".syst.low", ".syst.high")
_SAMPLED = dict.fromkeys(("converged", "seed"), _COUNT)
_DECIDED = ("decision", "decision_reason")
#: Names that a label cannot have, because columns have them.
RESERVED = frozenset((*_BEFORE, *_AFTER, *_SAMPLED, *_DECIDED))
_SUFFIXES = (".csv", ".parquet")
# Number of rows in memory while a table is written.
_ROWS_AT_A_TIME = 20_000
_STORED = {_TEXT: "str", _NUMBER: "float64", _COUNT: "Int64"}


def fitted_names(columns: Iterable[object]) -> list[str]:
    """Names of the fitted parameters of a table: those with columns of an interval or of a standard error."""
    names = [str(column) for column in columns]
    ends = (".stat.low", ".stderr")
    return list(dict.fromkeys(name.removesuffix(end) for name in names for end in ends if name.endswith(end)))


def standard_errors(table: pd.DataFrame, name: str) -> Any:
    """Standard errors (SI) of a fitted parameter, (rows,), from its error column or its statistical interval."""
    if f"{name}.stderr" in table.columns:
        return table[f"{name}.stderr"].to_numpy(dtype=float)
    low, high = (table[f"{name}.stat.{end}"].to_numpy(dtype=float) for end in ("low", "high"))
    return (high - low) / (2.0 * NORMAL_95)


@dataclass(frozen=True)
class Layout:
    """Columns of a table, in order, with the type of each.

    Parameters
    ----------
    kinds : mapping of str to str
        ``"text"``, ``"number"`` or ``"count"`` by column.
    """

    kinds: Mapping[str, str]

    @classmethod
    def of(
        cls,
        parameters: Sequence[str],
        given: Sequence[str],
        *,
        labels: Sequence[str] = (),
        derived: Sequence[str] = (),
        sampled: bool,
        answers: bool = True,
    ) -> Layout:
        """Lay out the columns of a map. With labels there is also a column for the modulus' likelihood.

        Parameters
        ----------
        parameters : sequence of str
            The fitted ones.
        given : sequence of str
            Paths that the manifest or the files give.
        labels : sequence of str
            Label columns of the manifest, such as animal and group.
        derived : sequence of str
            Quantities computed from the fitted ones.
        sampled, answers : bool
            Whether posteriors are sampled; whether fits give their answers.
        """
        ends = _ANSWERED if sampled or answers else ("", ".stderr")
        known = [path for path in given if path not in parameters] + list(derived)
        kinds = _BEFORE | dict.fromkeys(labels, _TEXT)
        kinds |= dict.fromkeys((f"{path}{end}" for path in parameters for end in ends), _NUMBER)
        kinds |= dict.fromkeys(known, _NUMBER)
        if "layer.E" in parameters:
            kinds |= dict.fromkeys((INSTRUMENT, DIFFERENCE), _NUMBER)
            if labels:
                kinds[f"layer.E.{LIKELIHOOD}"] = _TEXT
        return cls(kinds | _AFTER | (_SAMPLED if sampled else {}))

    @property
    def header(self) -> str:
        """First line of the CSV, without its line end."""
        return ",".join(self.kinds)

    def cells(self, line: str) -> dict[str, str]:
        """Cells of one line of CSV, as text, by column."""
        return dict(zip(self.kinds, next(csv.reader([line])), strict=True))

    def is_row(self, line: str) -> bool:
        """Whether a text is one line of CSV with a cell of the right type for every column."""
        try:
            cells = self.cells(line)
            for name, kind in self.kinds.items():
                _READ[kind](cells[name])
        except (ValueError, csv.Error):
            return False
        return line.splitlines() == [line] and cells["status"] in (FITTED, FAILED)

    def text(self, row: Mapping[str, Any]) -> str:
        """One line of CSV, without its line end; columns that `row` does not have stay empty."""
        return ",".join([_cell(row.get(name)) for name in self.kinds])


def _cell(value: Any) -> str:
    if value is None:
        return ""
    if isinstance(value, float):
        return repr(float(value)) if not math.isnan(value) else ""
    if isinstance(value, str):
        if not value or value.isalnum():
            return value
        # One row is one line, whatever a message or a file name contains, and no cell is a formula.
        text = guarded_cell(one_line(" ".join(value.split()) if not value.isprintable() else value))
        return '"' + text.replace('"', '""') + '"' if any(mark in text for mark in ',"') else text
    return str(int(value))


def require_format(path: Path) -> None:
    """Raise an error for a table's path whose format could not be written.

    Raises
    ------
    InputError
        If the ending is neither .csv nor .parquet.
    MissingExtraError
        If it is .parquet and pyarrow is not installed.
    """
    if path.suffix.lower() not in _SUFFIXES:
        raise InputError(f"a table ends in {' or '.join(_SUFFIXES)}; got {path.name!r}")
    if path.suffix.lower() == ".parquet":
        _pyarrow()


def to_frame(layout: Layout, lines: Iterable[str]) -> pd.DataFrame:
    """Return CSV lines as a DataFrame, with every float exact to the last bit."""
    rows = list(csv.reader(lines))
    columns = zip(*rows, strict=True) if rows else repeat(())
    return pd.DataFrame(
        {
            name: _column(cells, kind)
            for (name, kind), cells in zip(layout.kinds.items(), columns, strict=False)
        }
    )


def _number(cell: str) -> float:
    # Python's own conversion is exact; that of a table reader may not be.
    return float(cell) if cell else math.nan


def _count(cell: str) -> int | None:
    return int(cell) if cell else None


#: How a cell of each type is read.
_READ: Mapping[str, Callable[[str], str | float | None]] = {
    _TEXT: unguarded_cell,
    _NUMBER: _number,
    _COUNT: _count,
}


def _column(cells: Sequence[str], kind: str) -> Any:
    # Not a Series: a DataFrame of these compares the index of each.
    dtype: Any = _STORED[kind]
    return pd.array([_READ[kind](cell) for cell in cells], dtype=dtype)


def write_table(path: Path, layout: Layout, lines: Iterable[str]) -> Path:
    """Write CSV lines to a CSV or Parquet file, atomically, without holding them all in memory.

    Raises
    ------
    FileAccessError
        If the file cannot be written; an older one stays as it was.
    """
    with replacing(path) as file:
        if path.suffix.lower() == ".parquet":
            _write_parquet(file, layout, lines)
        else:
            file.writelines(f"{line}\n".encode() for line in chain((layout.header,), lines))
    return path


def write_frame(path: Path, table: pd.DataFrame) -> Path:
    """Write a table that was changed after its run to a CSV or Parquet file, atomically.

    Raises
    ------
    FileAccessError
        If the file cannot be written; an older one stays as it was.
    """
    if path.suffix.lower() == ".parquet":
        arrow, parquet = _pyarrow()
        with replacing(path) as file:
            parquet.write_table(arrow.Table.from_pandas(table, preserve_index=False), file)
        return path
    return write_atomic(path, csv_text(table))


def _write_parquet(file: BinaryIO, layout: Layout, lines: Iterable[str]) -> None:
    arrow, parquet = _pyarrow()
    types = {_TEXT: arrow.string(), _NUMBER: arrow.float64(), _COUNT: arrow.int64()}
    schema = arrow.schema([(name, types[kind]) for name, kind in layout.kinds.items()])
    with parquet.ParquetWriter(file, schema) as writer:
        rest = iter(lines)
        while group := list(islice(rest, _ROWS_AT_A_TIME)):
            frame = to_frame(layout, group)
            writer.write_table(arrow.Table.from_pandas(frame, schema=schema, preserve_index=False))


def read_parquet(content: IO[bytes], most_cells: int) -> pd.DataFrame:
    """Read a table in Parquet that declares at most `most_cells` cells.

    Raises
    ------
    MissingExtraError
        If pyarrow is not installed.
    ValueError
        If it declares more; pyarrow has errors of its own for a damaged file.
    """
    _, parquet = _pyarrow()
    file = parquet.ParquetFile(content)
    cells = file.metadata.num_rows * file.metadata.num_columns
    if not 0 <= cells <= most_cells:
        raise ValueError(f"it claims {cells} cells")
    frame: pd.DataFrame = file.read().to_pandas()
    return frame


def _pyarrow() -> tuple[Any, Any]:
    try:
        return import_module("pyarrow"), import_module("pyarrow.parquet")
    except ImportError as error:
        raise missing_extra("a Parquet table needs pyarrow", "cluster", "write a .csv") from error
