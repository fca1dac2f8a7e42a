"""A starter scene file: what a measured curve says is filled in, the rest is marked and must be."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from underlay.data.curve import Curve

__all__ = ["new_scene"]

# Times the depth that was pressed: contact lies within the readings, a sample is thinner than this or deep.
_SHAPES = {
    "sphere": "sphere",
    "ball": "sphere",
    "cone": "cone",
    "flat": "flat_punch",
    "cylinder": "flat_punch",
}


def new_scene(curve: Curve, name: str) -> str:
    """Return the text of a scene file for a curve that was read from a file of the given name.

    Every number that the file of the curve says stands in it; where it says none stands ``TODO``, which a
    scene file refuses until it is replaced.
    """
    return "\n".join(_lines(curve, name)) + "\n"


def _lines(curve: Curve, name: str) -> Iterator[str]:
    from underlay.scene.scene_file import PLACE
    from underlay.units import format_quantity

    known = curve.metadata
    yield f"# Starter scene. Replace every {PLACE}; `underlay keys` lists what else may stand here."
    yield "[indenter]"
    yield from _indenter(known)
    yield ""
    yield "[layer]"
    yield f'E = "{PLACE} kPa"          # where the fit starts: the size is enough'
    nu = _number(known, "poisson_ratio")
    yield (
        f'nu = "{PLACE}"             # 0.5 if incompressible'
        if nu is None
        else f"nu = {nu:.6g}   # as the file says"
    )
    yield f'thickness = "{PLACE} mm"   # drop it, and [substrate], for a half-space'
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
    yield 'layer.E = { min = "1 Pa", max = "100 GPa" }'
    low, high = float(curve.depth.min()), float(curve.depth.max())
    yield (
        f'instrument.contact_depth = {{ min = "{format_quantity(low, "length")}", '
        f'max = "{format_quantity(high, "length")}" }}'
    )
    yield "instrument.baseline = {}"


def _indenter(known: Mapping[str, Any]) -> Iterator[str]:
    from underlay.scene.scene_file import PLACE
    from underlay.units import format_quantity

    said = str(known.get("indenter", "")).casefold()
    shape = next((shape for word, shape in _SHAPES.items() if word in said), None)
    radius = _number(known, "indenter_radius")
    if shape is None and radius is None:
        yield f'shape = "{PLACE}"          # sphere, paraboloid, cone, flat_punch, ...'
        yield f'radius = "{PLACE} um"      # half_angle = "35 deg" for a cone'
        return
    yield f'shape = "{shape or "sphere"}"'
    if shape == "cone":
        yield f'half_angle = "{PLACE} deg"'
    elif radius is None:
        yield f'radius = "{PLACE} um"'
    else:
        yield f'radius = "{format_quantity(radius, "length")}"   # as the file says'


def _number(known: Mapping[str, Any], key: str) -> float | None:
    import numpy as np

    value = known.get(key)
    usable = isinstance(value, int | float) and not isinstance(value, bool) and bool(np.isfinite(value))
    return float(value) if usable and value is not None and value > 0.0 else None


def _quoted(text: str) -> str:
    """Return `text` as a TOML string: a file's name is data."""
    escaped = "".join(
        f"\\u{ord(letter):04x}" if not letter.isprintable() or letter in '"\\' else letter for letter in text
    )
    return f'"{escaped}"'
