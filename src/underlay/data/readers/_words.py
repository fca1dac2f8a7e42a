"""What instruments and people write, as data: the names, words, units and text formats of ``formats.toml``."""

from __future__ import annotations

from collections.abc import Mapping
from importlib.resources import files
from typing import Any

from underlay._door import parse_toml

__all__ = ["SAID", "listed", "words"]

#: The document: ``columns``, ``words``, ``units`` and ``formats``.
SAID: Mapping[str, Any] = parse_toml(files(__package__).joinpath("formats.toml").read_text(encoding="utf-8"))


def listed(text: str) -> tuple[str, ...]:
    """Split a text at commas into its entries, blanks tidied; () of an empty text."""
    return tuple(" ".join(name.split()) for name in text.split(",") if name.strip())


def words(name: str) -> frozenset[str]:
    """Return the set of words that ``formats.toml`` holds under this name in its section ``words``."""
    return frozenset(listed(SAID["words"][name]))
