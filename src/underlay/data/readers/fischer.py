"""Fischer indenters (Picodentor, HM2000, Fischerscope): text exports of one application.

A summary, then for each indentation a block: the application's name and time, ``Block : 1   Value : 1``,
``x= ... y= ...``, results with a decimal point, a row ``F  h  t``, and rows with a decimal comma: force in
mN, depth in um, time in s. The units stand nowhere in the file; they are fixed for this export.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from typing import Any

from underlay.data.curve import Curve
from underlay.data.readers._format import Format, Options, make_curve, require
from underlay.data.readers._source import Source
from underlay.data.readers._text import is_number, lines_of, numbers
from underlay.units import unit_factor

__all__ = ["FORMAT"]

_BLOCK = re.compile(r"^Block\s*:\s*(\d{1,9})\s+Value\s*:\s*(\d{1,9})\s*$", re.MULTILINE)
_PLACE = re.compile(r"^x=\s*([-+\d.,]+)\s+y=\s*([-+\d.,]+)")
_COLUMNS = (("force", "mN"), ("length", "um"), ("time", "s"))


def _sniff(source: Source) -> bool:
    head = source.head(262_144)
    # The longer words first: they are looked for in long steps.
    is_block = "Block" in head and ("Name of the application" in head or "HM" in head)
    return is_block and _BLOCK.search(head) is not None


def _read_all(source: Source, options: Options) -> list[Curve]:
    del options
    lines = lines_of(source)
    starts = [i for i, line in enumerate(lines) if _BLOCK.match(line.strip())]
    require(starts, source, "no line 'Block : 1   Value : 1'")
    return [
        _curve(source, lines[start:end]) for start, end in zip(starts, [*starts[1:], len(lines)], strict=True)
    ]


def _curve(source: Source, lines: Sequence[str]) -> Curve:
    matched = _BLOCK.match(lines[0].strip())
    block, value = (int(number) for number in matched.groups()) if matched else (0, 0)
    header: dict[str, str] = {}
    known: dict[str, Any] = {}
    rows: list[list[str]] = []
    for line in lines[1:]:
        cells = line.split("\t")
        place = _PLACE.match(line)
        if len(cells) == 3 and all(map(is_number, cells)):
            rows.append(cells)
        elif place and all(map(is_number, place.groups())):
            # The unit of the stage is mm in every file seen.
            known["position"] = tuple(float(text.replace(",", ".")) * 1e-3 for text in place.groups())
        elif len(cells) >= 3:
            header[f"{cells[0].strip()} {cells[1].strip()}"] = " ".join(cell.strip() for cell in cells[2:])
    name = f"{source.path.stem}, block {block}, value {value}"
    require(rows, source, f"block {block}, value {value} has no rows of numbers")
    # Whole numbers lose their comma ("1" beside "0,7"), so each cell is read with either sign.
    table = numbers(rows, (0, 1, 2), name, comma=True)
    force, depth, time = (table[:, j] * unit_factor(unit, kind) for j, (kind, unit) in enumerate(_COLUMNS))
    return make_curve(
        source,
        depth,
        force,
        time,
        name=name,
        block=block,
        header=header,
        units={"F": "mN", "h": "um", "t": "s"},
        sign_rules={
            "depth": "h as written, growing into the sample",
            "force": "F as written, positive in compression",
            "segment": "from the motion",
        },
        **known,
    )


FORMAT = Format(
    name="fischer",
    description="Fischer (Picodentor, HM2000) text exports",
    sniff=_sniff,
    read_all=_read_all,
)
