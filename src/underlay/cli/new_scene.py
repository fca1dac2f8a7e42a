"""A starter scene file: values that a curve's file states are filled in; all others are marked as to be given."""

from __future__ import annotations

import textwrap
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

from underlay._text import one_line

if TYPE_CHECKING:
    from underlay.data.curve import Curve

__all__ = ["new_scene", "unread_scene"]

# Times the depth that was pressed: contact lies within the readings, a sample is thinner than this or deep.
_SHAPES = {
    "sphere": "sphere",
    "ball": "sphere",
    "cone": "cone",
    "flat": "flat_punch",
    "cylinder": "flat_punch",
}
# What is written of a file that was not read, and how much of a line.
_LINES, _LETTERS = 6, 90


def unread_scene(file: Path, name: str, reason: str) -> str:
    """Return the text of a starter scene file for a curve file that could not be read, with its first lines.

    Parameters
    ----------
    file : path
        The curve file.
    name : str
        Its path as the scene file names it.
    reason : str
        Why it could not be read.
    """
    return "\n".join(_unread(file, name, reason)) + "\n"


def _unread(file: Path, name: str, reason: str) -> Iterator[str]:
    from underlay.scene.scene_file import PLACE

    seen = list(_seen(file))
    yield f"# Starter scene. Replace every {PLACE}; `underlay keys` lists what else may stand here."
    yield "# The file could not be read as it is:"
    yield from (f"#   {line}" for line in textwrap.wrap(one_line(reason), _LETTERS))
    yield from ["# Its first lines:", *(f"#   {line}" for line in seen)] if seen else ["# It is no text."]
    yield from _sample({}, "mm", "kPa")
    yield "[curve]"
    yield f"file = {_quoted(name)}"
    if seen:
        yield "# By name or by number from 1, with the unit that the instrument's manual says; or a sum."
        yield f'columns = {{ depth = "{PLACE} (um)", force = "{PLACE} (mN)" }}'
    yield ""
    yield "[fit]"
    yield 'layer.E = { min = "1 Pa", max = "10 TPa" }'
    yield f'instrument.contact_depth = {{ min = "{PLACE} um", max = "{PLACE} um" }}'
    yield "instrument.baseline = {}"


def _seen(file: Path) -> Iterator[str]:
    """Yield the first lines of a text file, each made printable; nothing for a binary file."""
    from underlay.data.readers._source import load, unpack
    from underlay.data.readers._text import lines_of
    from underlay.errors import UnderlayError

    try:
        parts, _ = unpack(load(file))
        lines = lines_of(parts[0])
    except (UnderlayError, IndexError):
        return
    yield from (one_line(line.rstrip(), _LETTERS) for line in lines[:_LINES])


def new_scene(curve: Curve, name: str) -> str:
    """Return the text of a starter scene file for a curve; `name` is the path of its file, as the scene names it.

    Every value that the curve's file states is filled in; all others are ``TODO``, which a scene file refuses until
    it is replaced.
    """
    return "\n".join(_lines(curve, name)) + "\n"


def _lines(curve: Curve, name: str) -> Iterator[str]:
    import numpy as np

    from underlay.scene.scene_file import PLACE
    from underlay.units import format_quantity, human_unit

    known = curve.metadata
    extent = max(float(np.ptp(curve.depth)), np.finfo(float).tiny)
    # The largest unit that goes at least once into the depth: `human_unit` takes a tenth of one too.
    length = human_unit(0.1 * extent, "length")[0]
    pressure = human_unit(float(np.ptp(curve.force)) / extent**2, "pressure")[0]
    yield f"# Starter scene. Replace every {PLACE}; `underlay keys` lists what else may stand here."
    yield from _sample(known, length, pressure)
    spring = _number(known, "spring_constant")
    if spring is not None:
        yield f"# The file says a spring constant of {format_quantity(spring, 'stiffness')}; the depth that is"
        yield "# read is clear of its bending. If it were not: [instrument] compliance, its inverse."
        yield ""
    yield "[curve]"
    yield f"file = {_quoted(name)}"
    if known.get("test") not in (None, 1):
        yield f"test = {int(known['test'])}"
    yield ""
    yield "[fit]"
    yield 'layer.E = { min = "1 Pa", max = "10 TPa" }'
    low, high = float(curve.depth.min()) + 0.0, float(curve.depth.max()) + 0.0
    yield (
        f'instrument.contact_depth = {{ min = "{format_quantity(low, "length")}", '
        f'max = "{format_quantity(high, "length")}" }}'
    )
    yield "instrument.baseline = {}"


def _sample(known: Mapping[str, Any], length: str, pressure: str) -> Iterator[str]:
    """Yield the lines of the sections on tip, layer and substrate.

    `known` is the metadata of the curve; `length` and `pressure` are units that suit the size of the test.
    """
    from underlay.scene.scene_file import PLACE

    yield "[indenter]"
    yield from _indenter(known, length)
    yield ""
    yield "[layer]"
    yield f'E = "{PLACE} {pressure}"          # where the fit starts: the size is enough'
    nu = _number(known, "poisson_ratio")
    yield (
        f'nu = "{PLACE}"             # 0.5 if incompressible'
        if nu is None
        else f"nu = {nu:.6g}   # as the file says"
    )
    yield f'thickness = "{PLACE} {length}"   # drop it, and [substrate], for a half-space'
    yield ""
    yield "[substrate]"
    yield 'rigid = true               # or E = "1 GPa" and nu = 0.3'
    yield ""
    yield '# Lying loose on it: bond = "slip" in [layer]. More layers between them, from the top down:'
    yield "# [[substrate.layers]]"
    yield '# E = "20 MPa"'
    yield "# nu = 0.4"
    yield '# thickness = "100 um"'
    yield ""


def _indenter(known: Mapping[str, Any], length: str) -> Iterator[str]:
    from underlay.scene.scene_file import PLACE
    from underlay.units import format_quantity

    said = str(known.get("indenter", "")).casefold()
    shape = next((shape for word, shape in _SHAPES.items() if word in said), None)
    radius = _number(known, "indenter_radius")
    if shape is None and radius is None:
        yield f'shape = "{PLACE}"          # sphere, paraboloid, cone, flat_punch, ...'
        yield f'radius = "{PLACE} {length}"      # half_angle = "35 deg" for a cone'
        return
    yield f'shape = "{shape or "sphere"}"'
    if shape == "cone":
        yield f'half_angle = "{PLACE} deg"'
    elif radius is None:
        yield f'radius = "{PLACE} {length}"'
    else:
        yield f'radius = "{format_quantity(radius, "length")}"   # as the file says'


def _number(known: Mapping[str, Any], key: str) -> float | None:
    import numpy as np

    value = known.get(key)
    usable = isinstance(value, int | float) and not isinstance(value, bool) and bool(np.isfinite(value))
    return float(value) if usable and value is not None and value > 0.0 else None


def _quoted(text: str) -> str:
    """Return `text` as a quoted and escaped TOML string."""
    escaped = "".join(
        f"\\u{ord(letter):04x}" if not letter.isprintable() or letter in '"\\' else letter for letter in text
    )
    return f'"{escaped}"'
