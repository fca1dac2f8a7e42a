"""Readers that other packages add, with their failures contained."""

from __future__ import annotations

import warnings
from collections.abc import Sequence
from dataclasses import replace
from typing import Any

from underlay._text import one_line
from underlay.data.curve import Curve
from underlay.data.readers._format import Format, Options
from underlay.data.readers._source import Source
from underlay.errors import FileFormatError, UnderlayError, UnderlayWarning
from underlay.plugins import READERS, Plugin, plugins

__all__ = ["added_formats", "plugged_readers"]


def plugged_readers(known: Sequence[Format]) -> tuple[Plugin, ...]:
    """Load the readers that other packages add, beside those that are `known`; see `underlay.plugins`."""
    taken = {entry.name for entry in known}
    judged = []
    for plugin in plugins(READERS, _fault):
        name = "" if plugin.fault else plugin.thing.name
        judged.append(
            replace(plugin, thing=None, fault=f"another format is called {name!r}")
            if name in taken
            else plugin
        )
        taken |= {name} - {""}
    return tuple(judged)


def added_formats(known: Sequence[Format]) -> tuple[Format, ...]:
    """The usable ones: an error in one of them names the package, and costs no other reader its file."""
    return tuple(_contained(entry) for entry in plugged_readers(known) if not entry.fault)


def _fault(name: str, thing: object) -> str:
    del name
    return "" if isinstance(thing, Format) else "it is no Format"


def _contained(plugin: Plugin) -> Format:
    own: Format = plugin.thing
    whose = f"reader {own.name} of {plugin.package}"

    def sniff(source: Source) -> bool:
        try:
            return bool(own.sniff(source))
        except Exception as error:  # noqa: BLE001  code of others: whatever it raises is theirs
            said = one_line(f"{type(error).__name__}: {error}")
            warnings.warn(
                f"{source.name}: the {whose} failed to look at it ({said}) and is passed over",
                UnderlayWarning,
                stacklevel=2,
            )
            return False

    def read_all(source: Source, options: Options) -> list[Curve]:
        try:
            curves: list[Any] = list(own.read_all(source, options))
        except UnderlayError:
            raise
        except Exception as error:
            said = one_line(f"{type(error).__name__}: {error}")
            raise FileFormatError(f"{source.name}: the {whose} failed: {said}") from error
        for curve in curves:
            if not isinstance(curve, Curve):
                raise FileFormatError(f"{source.name}: the {whose} gave {curve!r:.60} in place of a curve")
        return curves

    return replace(own, sniff=sniff, read_all=read_all)
