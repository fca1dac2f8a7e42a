"""Plug-ins of other packages: indenters, solvers and readers, declared as entry points.

A package declares in its pyproject.toml what it adds, under one of three groups::

    [project.entry-points."underlay.indenters"]
    hyperboloid = "my_tips:Hyperboloid"        # a class that derives from Indenter

    [project.entry-points."underlay.solvers"]
    own_law = "my_laws:OwnLaw"                 # a Solver class, or a PublishedCorrection

    [project.entry-points."underlay.readers"]
    my_device = "my_files:FORMAT"              # a Format

and nothing else is needed: once it is installed, scene files, commands and `read` know it. Plug-ins are loaded only
when a name is used that is not this package's own, or when everything is listed. A plug-in that cannot be loaded,
or is not what its group requires, does not affect others: `underlay formats` lists it with the reason, and so does
the message about an unknown name.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import lru_cache
from typing import Any

from underlay._text import one_line

INDENTERS, SOLVERS, READERS = "underlay.indenters", "underlay.solvers", "underlay.readers"
#: All groups of entry points, in the order in which they are listed.
GROUPS = (READERS, INDENTERS, SOLVERS)


@dataclass(frozen=True)
class Plugin:
    """One entry point of another package.

    Parameters
    ----------
    group : str
        One of `GROUPS`.
    name : str
        Name of the entry point.
    package : str
        The package and its version.
    thing : object
        The object that was loaded; None where there is a fault.
    fault : str
        Why it cannot be used; empty where it can.
    """

    group: str
    name: str
    package: str
    thing: Any = None
    fault: str = ""


# Installed packages do not change during a process, and a search takes some 10 ms: the result is cached, as Python
# caches its modules.
@lru_cache(maxsize=len(GROUPS))
def plugins(group: str, fault_of: Callable[[str, Any], str]) -> tuple[Plugin, ...]:
    """Load the plug-ins of a group, each once; sorted by name.

    Parameters
    ----------
    group : str
        One of `GROUPS`.
    fault_of : callable
        Takes the name of an entry point and the loaded object; returns why it does not fit the group, or "".
    """
    from importlib import metadata  # noqa: PLC0415  tens of milliseconds that a plain law does not need

    found = sorted(metadata.entry_points(group=group), key=lambda entry: entry.name)
    return tuple(_loaded(group, entry, fault_of) for entry in found)


def _loaded(group: str, entry: Any, fault_of: Callable[[str, Any], str]) -> Plugin:
    package = f"{entry.dist.name} {entry.dist.version}" if entry.dist is not None else "an unnamed package"
    try:
        thing = entry.load()
        fault = fault_of(entry.name, thing)
    except (Exception, SystemExit) as error:  # noqa: BLE001  code of others: whatever it raises is theirs
        return Plugin(group, entry.name, package, fault=one_line(f"{type(error).__name__}: {error}"))
    return Plugin(group, entry.name, package, None if fault else thing, fault)


def faults(found: tuple[Plugin, ...]) -> str:
    """Text to add to a message, with the plug-ins that could not be used; empty where there are none."""
    said = [f"{entry.name} of {entry.package} ({entry.fault})" for entry in found if entry.fault]
    return f"; not usable: {'; '.join(said)}" if said else ""
