r"""Optics11 Piuma and Chiaro text files, all three generations.

A free-text header and a table ``Time (s)  Load (uN)  Indentation (nm)  Cantilever (nm)  Piezo (nm)
Auxiliary``, tabs between. Header lines end in any mixture of ``\r\n``, ``\n`` and ``\n\r``; some keys are
separated from their value by a blank instead of a tab.

Depth is Piezo - Cantilever, the travel of the tip. The file's own "Indentation" is that less a constant the
software chose, and is cut to zero before the contact it chose; that constant is kept as
``software_contact_depth``. Load is positive in compression as written.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from typing import Any

import numpy as np

from underlay._arrays import FloatArray
from underlay.data.curve import Curve
from underlay.data.readers._format import Format, Options, make_curve, require
from underlay.data.readers._source import Source
from underlay.data.readers._text import column_factor, is_number, lines_of, numbers, split_label, uses_comma
from underlay.data.segments import segments_from_motion

__all__ = ["FORMAT"]

_COLUMNS = {
    "time": "time",
    "load": "force",
    "indentation": "length",
    "cantilever": "length",
    "piezo": "length",
}
_NEEDED = ("time", "load", "cantilever", "piezo")
# "SMDuration (s) 0.0", "Model: Hertz": a blank, not a tab, before the value.
_BLANK_SEPARATED = re.compile(r"(.*?(?:\)|:))\s*(.*)")
# Load = k * cantilever holds to the last digit written (3e-7 uN) in every file seen.
_CLOSURE = 1e-3
# An indentation that is zero at more of the points than this was cut by the software.
_CUT_SHARE = 0.05


def _sniff(source: Source) -> bool:
    head = source.head()
    return "Cantilever (nm)" in head and "Piezo (nm)" in head and "\tLoad (" in head


def _read_all(source: Source, options: Options) -> list[Curve]:
    del options
    lines = lines_of(source)
    start = next((i for i, line in enumerate(lines) if _is_table_header(line)), None)
    if start is None:
        require(condition=False, source=source, message="no table header 'Time (s)  Load (uN) ...' found")
        return []
    header = _header(lines[:start])
    columns = _read_table(source, lines[start], lines[start + 1 :])
    time, load, cantilever, piezo = (columns[name] for name in _NEEDED)
    depth = piezo - cantilever
    finite = np.isfinite(piezo).all() and np.isfinite(time).all()
    known = _known_numbers(header)
    return [
        make_curve(
            source,
            depth,
            load,
            time,
            segments_from_motion(piezo, time) if finite else None,
            name=lines[1].strip() if start > 1 and "\t" not in lines[1] else source.path.stem,
            header=header,
            units={label.strip(): split_label(label)[1] for label in lines[start].split("\t")},
            sign_rules={
                "depth": "Piezo - Cantilever, growing into the sample",
                "force": "Load as written, positive in compression",
                "segment": "from the motion of the piezo",
            },
            notes=_closure_notes(load, cantilever, known.get("spring_constant")),
            bending_taken_off=True,
            **_software_contact(depth, columns.get("indentation")),
            **known,
        )
    ]


def _is_table_header(line: str) -> bool:
    names = {split_label(label)[0].lower() for label in line.split("\t")}
    return set(_NEEDED) <= names


def _header(lines: Sequence[str]) -> dict[str, str]:
    """Key and value of every header line; lines of several pairs give several entries."""
    header: dict[str, str] = {}
    for line in lines:
        parts = [part.strip() for part in line.strip().split("\t")]
        if len(parts) == 1:
            matched = _BLANK_SEPARATED.fullmatch(parts[0])
            parts = [matched.group(1), matched.group(2)] if matched else []
        header.update(
            {key.rstrip(":"): value for key, value in zip(parts[::2], parts[1::2], strict=False) if key}
        )
    return header


def _read_table(source: Source, label_line: str, rows: Sequence[str]) -> dict[str, FloatArray]:
    labels = [split_label(label) for label in label_line.split("\t")]
    names = [name.lower() for name, _ in labels]
    wanted = [name for name in _COLUMNS if name in names]
    indices = [names.index(name) for name in wanted]
    cells = [row.split("\t") for row in rows]
    require(cells, source, "the table has no rows")
    comma = uses_comma([cell for row in cells[:200] for cell in row])
    table = numbers(cells, indices, source.name, comma=comma)
    columns: dict[str, FloatArray] = {}
    for j, name in enumerate(wanted):
        unit = labels[indices[j]][1]
        columns[name] = table[:, j] * column_factor(unit, _COLUMNS[name], name, source.name)
    return columns


def _known_numbers(header: dict[str, str]) -> dict[str, Any]:
    """Numbers of the header that mean something to a fit, in SI."""
    known: dict[str, Any] = {}
    for key, name, factor in (
        ("Tip radius (um)", "indenter_radius", 1e-6),
        ("k (N/m)", "spring_constant", 1.0),
        ("E[eff] (Pa)", "instrument_reduced_modulus", 1.0),
    ):
        value = header.get(key, "")
        if is_number(value):
            known[name] = float(value.replace(",", ".")) * factor
    places = [header.get(f"{axis}-position (um)", "") for axis in "XYZ"]
    if all(is_number(place) for place in places):
        known["position"] = tuple(float(place.replace(",", ".")) * 1e-6 for place in places)
    return known


def _software_contact(depth: FloatArray, indentation: FloatArray | None) -> dict[str, Any]:
    """Depth at which the software set contact, if its indentation is cut to zero before that."""
    if indentation is None:
        return {}
    cut = indentation == 0.0
    # Some versions write Piezo - Cantilever as it is; a zero in it is then a chance.
    if cut.mean() < _CUT_SHARE or cut.all():
        return {}
    pressed = indentation > 0.0
    if not pressed.any():
        return {}
    return {"software_contact_depth": float(np.median((depth - indentation)[pressed]))}


def _closure_notes(load: FloatArray, cantilever: FloatArray, stiffness: float | None) -> list[str]:
    if stiffness is None:
        return ["the header gives no cantilever stiffness: load could not be checked against deflection"]
    gap = np.nanmax(np.abs(load - stiffness * cantilever))
    if gap > _CLOSURE * np.nanmax(np.abs(load)):
        return [f"load differs from stiffness times deflection by up to {gap:.3g} N: check the file's units"]
    return []


FORMAT = Format(
    name="optics11",
    description="Optics11 Piuma and Chiaro text files",
    sniff=_sniff,
    read_all=_read_all,
)
