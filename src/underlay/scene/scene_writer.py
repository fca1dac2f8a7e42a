"""Scene -> TOML text that reads back to the same scene, bit for bit."""

from __future__ import annotations

from dataclasses import fields
from typing import TYPE_CHECKING, Any

import numpy as np
import tomlkit

from underlay.mechanics.materials import Rigid
from underlay.scene.parameters import kind_of

if TYPE_CHECKING:
    from underlay.scene.scene import Scene

__all__ = ["scene_text"]

_SI = {
    "pressure": "Pa",
    "length": "m",
    "force": "N",
    "stiffness": "N/m",
    "compliance": "m/N",
    "angle": "rad",
    "time": "s",
    "dimensionless": "",
}


def scene_text(scene: Scene) -> str:
    """Return the scene as the text of a scene file; quantities in SI units, to the last bit."""
    document = tomlkit.document()
    document["indenter"] = {"shape": scene.indenter.shape} | _quantities("indenter", scene.indenter)
    document["layer"] = _quantities("layer", scene.layer.material)
    if np.isfinite(scene.layer.thickness):
        document["layer"]["thickness"] = _text(scene.layer.thickness, "length")
    if isinstance(scene.substrate, Rigid):
        document["substrate"] = {"rigid": True}
    elif scene.substrate is not None:
        document["substrate"] = _quantities("substrate", scene.substrate)
    instrument = {
        name: value
        for name, value in _quantities("instrument", scene.instrument).items()
        if getattr(scene.instrument, name)
    }
    if instrument:
        document["instrument"] = instrument
    return tomlkit.dumps(document)


def _quantities(section: str, part: Any) -> dict[str, Any]:
    return {
        field.name: _value(getattr(part, field.name), kind_of(f"{section}.{field.name}"))
        for field in fields(part)
    }


def _value(value: Any, kind: str) -> Any:
    if np.ndim(value):
        return [_text(float(entry), kind) for entry in value]
    return _text(value, kind)


def _text(value: float, kind: str) -> str | float:
    # A shape from outside may hold numpy's floats, which write themselves otherwise.
    unit, number = _SI[kind], float(value)
    return f"{number!r} {unit}" if unit else number
