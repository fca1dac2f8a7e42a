"""Writes a scene as TOML text that reads back to the same scene, bit for bit."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import fields, is_dataclass
from typing import Any

import numpy as np

from underlay.quantities import field_quantities, numbers_of
from underlay.scene.uncertainties import StatedUncertainties, written
from underlay.units import KINDS


def scene_text(scene: Any) -> str:
    """Return a scene as the text of a scene file; quantities in SI units, to the last bit.

    It has a section for every part, and a key for every number that differs from its default.
    """
    document = {name: value for name, value in _keys(scene) if value != {}}
    if isinstance(scene.uncertainties, StatedUncertainties):
        document["uncertainties"] = written(scene.uncertainties, numbers_of(scene))
    # Entries of the whole scene stand before its sections.
    return document_text(dict(sorted(document.items(), key=lambda item: isinstance(item[1], dict))))


def document_text(document: Mapping[str, Any]) -> str:
    """Return the text of a scene file with the given sections, keys and values."""
    import tomlkit  # noqa: PLC0415  loaded by whoever writes a scene

    return tomlkit.dumps(document)


def _section(part: Any) -> dict[str, Any]:
    """The keys of a part: its model or shape, and its numbers."""
    return {**part.choice, **dict(_keys(part))}


def _keys(part: Any) -> Iterator[tuple[str, Any]]:
    known = field_quantities(part)
    for entry in fields(part):
        value = getattr(part, entry.name)
        if entry.metadata.get("inlined"):
            yield from _section(value).items()
        elif isinstance(value, str | bool):
            if value != entry.default:
                yield entry.name, value
        elif is_dataclass(value):
            yield entry.name, _section(value)
        elif isinstance(value, tuple) and value and all(map(is_dataclass, value)):
            yield entry.name, [dict(_keys(item)) for item in value]
        elif entry.name in known and (np.ndim(value) or value != entry.default):
            yield entry.name, _value(value, KINDS[known[entry.name].kind].si)


def _value(value: Any, unit: str) -> Any:
    if np.ndim(value):
        return [_value(entry, unit) for entry in value]
    # A shape from a plug-in may hold numpy floats, whose repr differs.
    number = float(value)
    return f"{number!r} {unit}" if unit else number
