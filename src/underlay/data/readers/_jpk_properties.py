"""Headers of JPK archives: Java properties, bounded before they are unpacked, and what they share.

A hundred kilobytes of archive can claim a header of 200 MB, of which every line would become an entry. Headers of
up to 60 kB and a thousand entries were seen; they grow with the channels, not with the points.
"""

from __future__ import annotations

import zipfile
from collections.abc import Mapping
from typing import TypeAlias

from underlay.data.readers._source import read_member
from underlay.errors import FileFormatError

__all__ = ["LONGEST_HEADER", "Shared", "properties", "shared_properties", "with_shared"]

#: Entries ``lcd-info.3.channel...`` of the shared header, by ``lcd-info.3``.
Shared: TypeAlias = Mapping[str, Mapping[str, str]]

#: Most bytes that a header may claim.
LONGEST_HEADER = 4_000_000
_MOST_ENTRIES = 50_000


def properties(archive: zipfile.ZipFile, name: str) -> dict[str, str]:
    """Java properties: ``key=value`` in Latin-1, with escaped colons.

    Raises
    ------
    FileFormatError
        If the member is missing, damaged, or claims more than any header takes.
    """
    found = {}
    for line in read_member(archive, name, LONGEST_HEADER).decode("latin-1").splitlines():
        key, equals, value = line.partition("=")
        if equals and not line.startswith("#"):
            found[key.strip()] = value.strip().replace("\\:", ":")
    return found


def shared_properties(archive: zipfile.ZipFile, name: str) -> Shared:
    """Entries that segments point to, grouped by what these call them."""
    groups: dict[str, dict[str, str]] = {}
    for key, value in properties(archive, name).items():
        parts = key.split(".", 2)
        if len(parts) == 3:
            groups.setdefault(f"{parts[0]}.{parts[1]}", {})[parts[2]] = value
    return groups


def with_shared(header: Mapping[str, str], shared: Shared) -> dict[str, str]:
    """Follow ``channel.X.lcd-info.*=3`` to the entries ``lcd-info.3....`` of the shared properties.

    Raises
    ------
    FileFormatError
        If they add up to more than any header has.
    """
    found = dict(header)
    for key, number in sorted(header.items()):
        if ".*" in key:
            kind = ".".join(key.split(".")[-2:-1])
            head = key.rsplit(".", 2)[0]
            group = shared.get(f"{kind}.{number}", {})
            if len(found) + len(group) > _MOST_ENTRIES:
                raise FileFormatError(f"the header of a segment claims more than {_MOST_ENTRIES} entries")
            found.update({f"{head}.{name}": value for name, value in group.items()})
    return found
