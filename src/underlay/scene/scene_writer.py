"""Scene -> TOML text that reads back to the same scene, bit for bit."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import fields, is_dataclass
from typing import Any

import numpy as np

from underlay.quantities import field_quantities, numbers_of
from underlay.scene.uncertainties import StatedUncertainties, table_of
from underlay.units import KINDS

__all__ = ["document_text", "scene_text"]


def scene_text(scene: Any) -> str:
    """Return a scene as the text of a scene file; quantities in SI units, to the last bit.

    A section for every part, a key for every number its dataclass declares; what has its default is left out.
    """
    import tomlkit  # noqa: PLC0415  loaded by whoever writes a scene

    document = tomlkit.document()
    # A word or a switch of the whole scene stands before its sections.
    words = [entry for entry in fields(scene) if isinstance(getattr(scene, entry.name), str | bool)]
    for entry in words:
        if getattr(scene, entry.name) != entry.default:
            document[entry.name] = getattr(scene, entry.name)
    for entry in fields(scene):
        part = getattr(scene, entry.name)
        if entry in words:
            continue
        if isinstance(part, StatedUncertainties):
            document[entry.name] = table_of(part, numbers_of(scene))
            continue
        table = {} if part is None else _section(part)
        if table:
            document[entry.name] = table
    return tomlkit.dumps(document)


def document_text(document: Mapping[str, Any]) -> str:
    """Return the text of a scene file that holds these sections, keys and values as they are."""
    import tomlkit  # noqa: PLC0415  as above

    return tomlkit.dumps(document)


def _section(part: Any) -> dict[str, Any]:
    """Which kind a part is, and its numbers."""
    return {**part.choice, **dict(_keys(part))}


def _keys(part: Any) -> Iterator[tuple[str, Any]]:
    known = field_quantities(part)
    for entry in fields(part):
        value = getattr(part, entry.name)
        if entry.metadata.get("inlined"):
            yield from _section(value).items()
        elif isinstance(value, str):
            if value != entry.default:
                yield entry.name, value
        elif is_dataclass(value):
            yield entry.name, _section(value)
        elif isinstance(value, tuple) and value and all(is_dataclass(item) for item in value):
            yield entry.name, [dict(_keys(item)) for item in value]
        elif entry.name in known and (np.ndim(value) or value != entry.default):
            yield entry.name, _value(value, KINDS[known[entry.name].kind].si)


def _value(value: Any, unit: str) -> Any:
    if np.ndim(value):
        return [_text(float(entry), unit) for entry in value]
    return _text(value, unit)


def _text(value: float, unit: str) -> str | float:
    # A shape from outside may hold numpy's floats, which write themselves otherwise.
    number = float(value)
    return f"{number!r} {unit}" if unit else number
