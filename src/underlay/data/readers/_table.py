"""From a table with labelled columns to a curve: which column is which, in which unit."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from underlay._arrays import FloatArray
from underlay._text import names_there
from underlay.data.curve import Curve
from underlay.data.readers._format import Options, make_curve
from underlay.data.readers._not_readings import (
    begins_again,
    namesakes,
    plain,
    require_readings,
    rivals,
    without_statistics,
)
from underlay.data.readers._source import Source
from underlay.data.readers._text import column_factor, is_number, numbers, split_label, uses_comma
from underlay.data.segments import HOLD, LOADING, UNLOADING
from underlay.data.signs import sign_note
from underlay.errors import FileFormatError, InputError
from underlay.units import kind_of, unit_factor

__all__ = ["ROLES", "find_columns", "table_curve"]

#: What a column can be, and the kind of quantity it holds.
ROLES = {"depth": "length", "force": "force", "time": "time", "segment": ""}

# Names taken for granted, without their accents; others are given by a column mapping. "position" and "z" are
# not here: their direction differs between instruments. English, German, French, Spanish and Italian.
_KNOWN = {
    "depth": (
        *(
            "depth",
            "indentation",
            "indentation depth",
            "penetration",
            "penetration depth",
            "displacement",
            "h",
        ),
        *("eindringtiefe", "tiefe", "eindringung", "verschiebung", "weg", "standardweg"),
        *("enfoncement", "profondeur", "penetration", "deplacement", "allongement"),
        *("profundidad", "penetracion", "desplazamiento", "profondita", "penetrazione", "spostamento"),
    ),
    "force": (
        *("force", "load", "normal force", "fn", "f", "p"),
        *("kraft", "normalkraft", "prufkraft", "standardkraft", "last"),
        *("force normale", "force standard", "charge", "effort"),
        *("fuerza", "fuerza normal", "carga", "forza", "forza normale", "carico"),
    ),
    "time": ("time", "t", "test time", "zeit", "prufzeit", "temps", "temps d'essai", "tiempo", "tempo"),
    "segment": ("segment", "segments"),
}
# 1,000 or 12.500: what separates thousands where nothing else is divided; and a number just below them.
_GROUPED = re.compile(r"[+-]?[1-9]\d{0,2}(?:[.,]\d{3})+")
_PLAIN_HUNDREDS = re.compile(r"[+-]?[1-9]\d\d")
_THREE_DIGITS, _ROUNDING = 100.0, 1e-6
_LABELS = (LOADING, HOLD, UNLOADING)


def find_columns(labels: Sequence[str], mapping: Mapping[str, str] | None) -> dict[str, int]:
    """Index of the column of each role that is there.

    Parameters
    ----------
    labels : sequence of str
        The header, names with or without units.
    mapping : mapping of role to name, optional
        Names with or without a unit, as ``{"depth": "h (nm)", "force": "-Fz"}``; the sign is ignored here.
    """
    names = [plain(split_label(label)[0]) for label in labels]
    whole = [plain(label) for label in labels]
    found: dict[str, int] = {}
    for role in ROLES:
        wanted = (mapping or {}).get(role)
        if wanted is not None:
            text = wanted.strip().removeprefix("-").strip()
            candidates: tuple[str, ...] = (plain(text), plain(split_label(text)[0]))
        else:
            candidates = _KNOWN[role]
        for candidate in candidates:
            if candidate in whole:
                found[role] = whole.index(candidate)
                break
            if candidate in names:
                found[role] = names.index(candidate)
                break
    return found


def table_curve(
    source: Source,
    labels: Sequence[str],
    rows: Sequence[Sequence[str]],
    options: Options,
    *,
    may_use_comma: bool,
    commas_between: bool = False,
    **metadata: Any,
) -> Curve:
    """Make a curve of labelled rows of cells.

    `commas_between` says that commas stand between the cells, as where a decimal is written with a point: a quoted
    ``"1,234"`` may be either there.

    Raises
    ------
    FileFormatError
        If depth or force is not there (names the columns that are), or a cell is not a number.
    UnitError
        If a column has no unit or one of the wrong kind.
    """
    _check_mapping(options.columns)
    columns = find_columns(labels, options.columns)
    _check_present(source, labels, columns, options.columns)
    above, below, rows = _take_unit_row(labels, rows)
    rows, statistics = without_statistics(rows)
    if not rows:
        raise FileFormatError(f"{source.name} names its columns but has no rows of numbers")
    roles = [role for role in ("depth", "force", "time") if role in columns]
    indices = [columns[role] for role in roles]
    comma = may_use_comma and uses_comma(
        [row[index] for row in rows[:200] for index in indices if index < len(row)]
    )
    table = numbers(rows, indices, source.name, comma=comma)
    _require_no_groups(source, labels, rows, indices, table)
    if comma and commas_between:
        _require_decimals(source, labels, rows, indices)
    if not {"depth", "force"} <= (options.columns or {}).keys():
        units = [one or other for one, other in zip(above, below, strict=False)]
        require_readings(source, labels, units, rows, table[:, 0], table[:, 1])
    values: dict[str, FloatArray] = {}
    units_found: dict[str, str] = {}
    signs: dict[str, str] = {}
    for j, role in enumerate(roles):
        mapped = (options.columns or {}).get(role, "")
        label = labels[columns[role]].strip()
        unit = split_label(mapped)[1] or _one_unit(source, label, above[columns[role]], below[columns[role]])
        if not unit:
            raise FileFormatError(_no_unit(source, label, role))
        factor = column_factor(unit, ROLES[role], label, source.name)
        flipped = mapped.strip().startswith("-")
        values[role] = table[:, j] * (-factor if flipped else factor)
        units_found[label] = unit
        signs[role] = f"minus the column {label!r}, as asked" if flipped else f"as written in {label!r}"
    segment, note = _segment(rows, columns.get("segment"))
    others = (
        *rivals(labels, columns, options.columns, _KNOWN),
        *begins_again(values["depth"], values.get("time")),
    )
    curve = make_curve(
        source,
        values["depth"],
        values["force"],
        values.get("time"),
        segment,
        units=units_found,
        sign_rules=signs,
        notes=(*note, *statistics, *namesakes(labels, columns, options.columns), *others),
        **metadata,
    )
    doubt = sign_note(curve)
    return curve.with_metadata(notes=(*curve.metadata["notes"], *doubt)) if doubt else curve


def _check_mapping(mapping: Mapping[str, str] | None) -> None:
    for role, name in (mapping or {}).items():
        if role not in ROLES:
            raise InputError(f"a column mapping has no {role!r}; it takes {', '.join(ROLES)}")
        if not str(name).strip(" -"):
            raise InputError(f"the column for {role!r} must be a name such as 'h (nm)'; got {name!r}")


def _check_present(
    source: Source, labels: Sequence[str], columns: Mapping[str, int], mapping: Mapping[str, str] | None
) -> None:
    for role in ROLES:
        asked = (mapping or {}).get(role)
        if role in columns or (asked is None and role not in {"depth", "force"}):
            continue
        missing = f"no column {asked!r}" if asked is not None else f"no column for the {role}"
        there = names_there(label.strip() for label in labels if label.strip())
        raise FileFormatError(
            f"{source.name} has {missing}; it has {there}. Say which with columns={{{role!r}: 'name (unit)'}}"
        )


def _require_no_groups(
    source: Source,
    labels: Sequence[str],
    rows: Sequence[Sequence[str]],
    indices: Sequence[int],
    table: FloatArray,
) -> None:
    """Refuse a column that counts 998, 999, 1,000: its separator is one of thousands, read as a decimal sign."""
    for j, index in enumerate(indices):
        values = table[:, j]
        whole = values == np.rint(values)
        divided = 1e3 * values[~whole]
        # Nearly every column is passed over here.
        if not divided.size or not (np.abs(values[whole]) >= _THREE_DIGITS).any():
            continue
        if not (np.abs(divided - np.rint(divided)) < _ROUNDING).all():
            continue
        # Whole ones may be grouped as well: 1,000 is read as 1.
        cells = [row[index].strip() for row in rows if index < len(row)]
        groups = [cell for cell in cells if "," in cell or "." in cell]
        if all(map(_GROUPED.fullmatch, groups)) and any(map(_PLAIN_HUNDREDS.fullmatch, cells)):
            raise FileFormatError(
                f"{source.name}, column {labels[index].strip()!r:.80}: {groups[0]!r:.40} beside whole numbers of "
                "three digits looks like thousands and would be read as a decimal; write the numbers without a "
                "separator of thousands"
            )


def _require_decimals(
    source: Source, labels: Sequence[str], rows: Sequence[Sequence[str]], indices: Sequence[int]
) -> None:
    """Refuse a column whose commas may all be of thousands."""
    for index in indices:
        commas = [cell for row in rows if index < len(row) and "," in (cell := row[index].strip())]
        if commas and all(map(_GROUPED.fullmatch, commas)):
            raise FileFormatError(
                f"{source.name}, column {labels[index].strip()!r:.80}: the comma of {commas[0]!r:.40} may be of a "
                "decimal or of thousands; write the numbers with decimal points and without thousands, or "
                "separate the columns by semicolons, where a comma is a decimal's"
            )


def _no_unit(source: Source, label: str, role: str) -> str:
    example = {"depth": "um", "force": "mN", "time": "s"}[role]
    return (
        f"{source.name}, column {label!r}: no unit; write it in the header as '{label} ({example})', or give "
        f"columns={{{role!r}: '{label} ({example})'}}"
    )


def _take_unit_row(
    labels: Sequence[str], rows: Sequence[Sequence[str]]
) -> tuple[list[str], list[str], Sequence[Sequence[str]]]:
    """Units of all columns beside and below their names, and the rows of numbers without a row of units."""
    units = [split_label(label)[1] for label in labels]
    if rows and not any(is_number(cell) for cell in rows[0]):
        below = [cell.strip().strip("()[]").strip() for cell in rows[0]]
        if any(kind_of(unit) is not None for unit in below if unit):
            return units, below + [""] * (len(units) - len(below)), rows[1:]
    return units, [""] * len(units), rows


def _one_unit(source: Source, label: str, above: str, below: str) -> str:
    """The unit of a column, which its name and the row of units below may both say."""
    kind = kind_of(above) if above and below else None
    if kind is not None and kind == kind_of(below) and unit_factor(above, kind) != unit_factor(below, kind):
        raise FileFormatError(
            f"{source.name}, column {label!r:.80}: the row below the names says {below!r:.40}; say which unit is "
            "right in columns"
        )
    return above or below


def _segment(
    rows: Sequence[Sequence[str]], index: int | None
) -> tuple[NDArray[np.str_] | None, tuple[str, ...]]:
    if index is None:
        return None, ()
    cells = [row[index].strip().strip('"').lower() if index < len(row) else "" for row in rows]
    if set(cells) <= set(_LABELS):
        return np.array(cells, dtype="<U9"), ()
    return None, ("the segment column is not used: it holds other words than loading, hold and unloading",)
