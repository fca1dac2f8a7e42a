"""Parameter paths: one name for every number of a scene.

``layer.E``, ``substrate.nu``, ``indenter.radius``, ``instrument.contact_depth``: the part before the dot
is a part of the scene, the rest a field of it. Fits, scene files, manifests and tables all use these.
"""

from __future__ import annotations

import difflib
from collections.abc import Iterable, Mapping
from dataclasses import fields, is_dataclass, replace
from typing import TYPE_CHECKING, Any

from underlay.errors import ParameterError
from underlay.mechanics.materials import Layer
from underlay.scene.field_names import fields_meant

if TYPE_CHECKING:
    from underlay.scene.scene import Scene

__all__ = ["kind_of", "parameter_values", "replace_values", "unknown_parameter"]

#: What each number is, for units at the border and for scaling in a fit.
_KINDS = {
    "E": "pressure",
    "E_axial": "pressure",
    "G_axial": "pressure",
    "nu": "dimensionless",
    "nu_axial": "dimensionless",
    "thickness": "length",
    "radius": "length",
    "r": "length",
    "height": "length",
    "half_angle": "angle",
    "exponent": "dimensionless",
    "coefficient": "dimensionless",
    "contact_depth": "length",
    "baseline": "force",
    "baseline_slope": "stiffness",
    "compliance": "compliance",
    "force": "force",
    "relative": "dimensionless",
    "correlation_time": "time",
    "depth": "length",
}


def kind_of(path: str) -> str:
    """Physical kind of a parameter, e.g. ``"pressure"`` for ``"layer.E"``.

    The field's name says it, else its last word does (``tip_radius`` is a length); any other number is
    dimensionless.
    """
    name = path.rpartition(".")[2]
    return _KINDS.get(name) or _KINDS.get(name.rpartition("_")[2], "dimensionless")


def parameter_values(scene: Scene) -> dict[str, float]:
    """Every number of the scene by its path, SI."""
    values: dict[str, float] = {}
    for name in ("indenter", "layer", "substrate", "instrument"):
        part = getattr(scene, name)
        if isinstance(part, Layer):
            values.update(_numbers(name, part.material))
            values[f"{name}.thickness"] = part.thickness
        elif is_dataclass(part):
            values.update(_numbers(name, part))
    return values


def _numbers(name: str, part: Any) -> dict[str, float]:
    return {
        f"{name}.{field.name}": getattr(part, field.name)
        for field in fields(part)
        if isinstance(getattr(part, field.name), float)
    }


def replace_values(scene: Scene, values: Mapping[str, float]) -> Scene:
    """Return the scene with the numbers at the given paths replaced (SI).

    Raises
    ------
    ParameterError
        If a path is not one of the scene's.
    """
    known = parameter_values(scene)
    by_part: dict[str, dict[str, float]] = {}
    for path, value in values.items():
        if path not in known:
            raise unknown_parameter(path, known)
        part, _, field = path.partition(".")
        by_part.setdefault(part, {})[field] = float(value)
    changed: dict[str, Any] = {}
    for part, numbers in by_part.items():
        old = getattr(scene, part)
        if isinstance(old, Layer):
            thickness = numbers.pop("thickness", old.thickness)
            material: Any = old.material
            material = replace(material, **numbers) if numbers else material
            changed[part] = Layer(material, thickness)
        else:
            changed[part] = replace(old, **numbers)
    return replace(scene, **changed)


def unknown_parameter(path: str, known: Iterable[str]) -> ParameterError:
    """Build the error for a path that does not exist: names the nearest valid one."""
    names = sorted(known)
    part, _, field = path.rpartition(".")
    own = {name.rpartition(".")[2]: name for name in names if name.rpartition(".")[0] == part}
    near = [own[meant] for meant in fields_meant(field, own)]
    near = near or difflib.get_close_matches(path, names, n=1, cutoff=0.4)
    hint = f"; did you mean {near[0]!r}?" if near else ""
    return ParameterError(f"this scene has no parameter {path!r}{hint} It has: {', '.join(names)}")
