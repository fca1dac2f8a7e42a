"""What a format is, and how a reader hands over what it read."""

from __future__ import annotations

import warnings
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from underlay._arrays import FloatArray
from underlay.data.curve import Curve
from underlay.data.readers._source import Source
from underlay.errors import CurveError, FileFormatError, UnderlayWarning

__all__ = ["Format", "Options", "make_curve"]

# Rows left out that are named.
_LISTED = 5


@dataclass(frozen=True)
class Options:
    """What a caller adds to a file.

    Parameters
    ----------
    columns : mapping, optional
        For tables: which column is ``depth``, ``force``, ``time`` or ``segment``.
    calibration : mapping
        SI numbers that a file may lack, by kind: ``stiffness`` of the cantilever (N/m), ``sensitivity`` (m/V)
        or ``current sensitivity`` (m/A) of its detector.
    """

    columns: Mapping[str, str] | None = None
    calibration: Mapping[str, float] = field(default_factory=dict)


@dataclass(frozen=True)
class Format:
    """One instrument format.

    Parameters
    ----------
    name : str
        What ``read(..., format=)`` takes.
    description : str
        One line for people.
    sniff : callable
        Whether the content of a file is of this format; looks at content only.
    read_all : callable
        All curves in a file of this format.
    read_one : callable, optional
        One curve by its number, counted from 1, where that takes less than reading all.
    extra : str
        The optional extra that the format needs; empty if none.
    takes_columns : bool
        Whether a column mapping means something.
    takes_calibration : bool
        Whether a calibration means something.
    """

    name: str
    description: str
    sniff: Callable[[Source], bool]
    read_all: Callable[[Source, Options], list[Curve]]
    read_one: Callable[[Source, Options, int], Curve] | None = None
    extra: str = ""
    takes_columns: bool = False
    takes_calibration: bool = False


def make_curve(
    source: Source,
    depth: FloatArray,
    force: FloatArray,
    time: FloatArray | None = None,
    segment: NDArray[np.str_] | None = None,
    *,
    columns: Mapping[str, FloatArray] | None = None,
    **metadata: Any,
) -> Curve:
    """Make a curve of SI columns, leaving out points without a value and saying so.

    Parameters
    ----------
    depth, force, time, segment : ndarray (n,)
        NaN marks an empty cell or a sentinel.
    columns : mapping of str to ndarray (n,), optional
        Further columns of the curve; a NaN in one of these leaves no point out.
    **metadata
        What the reader knows of the curve.

    Raises
    ------
    CurveError
        If no point is left.
    """
    valid = np.isfinite(depth) & np.isfinite(force)
    if time is not None:
        valid &= np.isfinite(time)
    left_out = int(np.count_nonzero(~valid))
    if left_out == len(valid):
        raise CurveError(f"{source.name}: no point has both a depth and a force")
    notes = tuple(metadata.pop("notes", ()))
    if left_out:
        rows = ", ".join(str(row) for row in np.flatnonzero(~valid)[:_LISTED] + 1)
        more = ", ..." if left_out > _LISTED else ""
        note = (
            f"{left_out} of {len(valid)} points left out: empty cell, NaN or sentinel value "
            f"(row{'s' if left_out > 1 else ''} {rows}{more} of the table)"
        )
        warnings.warn(f"{source.name}: {note}", UnderlayWarning, stacklevel=2)
        notes = (*notes, note)
    chosen = valid if left_out else slice(None)
    return Curve(
        _kept(depth, chosen),
        _kept(force, chosen),
        None if time is None else _kept(time, chosen),
        segment if segment is None else segment[chosen],
        {**metadata, "notes": notes, "points_left_out": left_out},
        columns={name: _kept(values, chosen) for name, values in (columns or {}).items()},
    )


def _kept(values: FloatArray, chosen: NDArray[np.bool_] | slice) -> FloatArray:
    """Copy the chosen values, once: what is read-only a curve takes as it is."""
    kept = values[chosen].copy() if isinstance(chosen, slice) else values[chosen]
    kept.flags.writeable = False
    return kept


def require(condition: object, source: Source, message: str) -> None:
    """Refuse a file whose content is not what the format promises."""
    if not condition:
        raise FileFormatError(f"{source.name}: {message}")
