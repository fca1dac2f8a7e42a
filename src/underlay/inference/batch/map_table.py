"""The table of a map, read again from its file."""

from __future__ import annotations

import io
from collections import deque
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import pandas as pd

from underlay._csv import numbered_rows
from underlay._csv_text import unguarded
from underlay._door import FileKind, PathLike, read_bytes, read_start, understood
from underlay.inference.batch.results_table import FITTED, LIKELIHOOD, SHARED, read_parquet

__all__ = ["is_map", "read_map", "shared_error_of"]

_ERROR = ".stderr"
_TEXTS = ("name", "status", "verdict", "reason")
_NUMBERS = ("x", "y", "reduced_chi_square", "rms", "seconds")
# A million curves with thirty numbers each.
_KIND = FileKind("the table of a map", 1_000_000_000, "make it again with underlay map --resume")
_MOST_COLUMNS, _MOST_CELLS = 1000, 50_000_000
# Numbers come back to the bit: from pandas 3.1 on by themselves, and to ask for it is deprecated there.
_TO_THE_BIT: Mapping[str, Any] = (
    {"float_precision": "round_trip"} if tuple(map(int, pd.__version__.split(".")[:2])) < (3, 1) else {}
)
_HEADER = "name,path,x,y,status,verdict,reason"


def is_map(path: PathLike) -> bool:
    """Whether a file is the table of a map: Parquet, or a CSV with its header."""
    if Path(path).suffix.lower() == ".parquet":
        return True
    return read_start(path, len(_HEADER)) == _HEADER.encode()


def shared_error_of(table: pd.DataFrame) -> float | None:
    """Relative error of the modulus that the curves of a map share (median); None where the table has none."""
    if SHARED not in table.columns:
        return None
    shares = table.loc[table["status"] == FITTED, SHARED].astype(float).dropna()
    return float(shares.median()) if len(shares) else None


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
    content = io.BytesIO(read_bytes(path, _KIND))
    with understood(path, _KIND):
        if Path(path).suffix.lower() == ".parquet":
            table = read_parquet(content, _MOST_CELLS)
        else:
            text = content.getvalue().decode("utf-8-sig")
            deque(numbered_rows(text, _MOST_COLUMNS), maxlen=0)
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
        fitted = [name.removesuffix(_ERROR) for name in names if name.endswith(_ERROR)]
        absent = [name for name in fitted if name not in names]
        if absent:
            raise ValueError(f"it has no column {absent[0]!r} for its error")
        # A path has a dot, a label has none.
        paths = [name for name in names if "." in name and not name.endswith(f".{LIKELIHOOD}")]
        numbers = {*paths, *fitted, *_NUMBERS} & set(names)
        return table.astype(dict.fromkeys(sorted(numbers), "float64"))
