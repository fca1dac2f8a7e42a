"""The text of a Nanosurf .nid file: sections of ``key=value``."""

from __future__ import annotations

import math
import re
from collections.abc import Mapping

from underlay.data.readers._source import MAX_BYTES, Source
from underlay.errors import FileFormatError

__all__ = ["NidHeader"]

# "D[2.72436]*[N/m]"
_PROPERTY = re.compile(r"\w\[([^\]]*)\]\*\[([^\]]*)\]")
_COUNT = re.compile(r"\d{1,9}")


class NidHeader:
    """Entries by section and key.

    Parameters
    ----------
    source : Source
        The file, for messages.
    text : str
        What stands before the numbers.
    """

    def __init__(self, source: Source, text: str) -> None:
        self.source = source
        self._sections: dict[str, dict[str, str]] = {}
        entries: dict[str, str] = {}
        for line in text.splitlines():
            if line.startswith("[") and line.endswith("]"):
                entries = self._sections.setdefault(line[1:-1], {})
            elif "=" in line:
                key, _, value = line.partition("=")
                entries.setdefault(key, value.strip())

    def __getitem__(self, section: str) -> Mapping[str, str]:
        return self._sections.get(section, {})

    def count(self, section: str, key: str, most: int = MAX_BYTES) -> int:
        """Return a whole number up to `most` that must be there.

        Raises
        ------
        FileFormatError
            If it is not.
        """
        text = self[section].get(key, "")
        if not _COUNT.fullmatch(text) or int(text) > most:
            raise FileFormatError(
                f"{self.source.name}: no number up to {most} for {key!r} in [{section!s:.60}]; it says {text!r:.40}"
            )
        return int(text)

    def number(self, section: str, key: str) -> float:
        """Return a finite number that must be there.

        Raises
        ------
        FileFormatError
            If it is not.
        """
        value = _finite(self[section].get(key, ""))
        if value is None:
            raise FileFormatError(
                f"{self.source.name}: {self[section].get(key, '')!r:.40} for {key!r} in [{section!s:.60}]"
            )
        return value

    def number_if_there(self, section: str, key: str) -> float | None:
        """Return a finite number, bare or as ``D[2.7]*[N/m]``; None where there is none."""
        text = self[section].get(key, "")
        found = _PROPERTY.fullmatch(text)
        return _finite(found[1] if found else text)


def _finite(text: str) -> float | None:
    try:
        value = float(text)
    except ValueError:
        return None
    return value if math.isfinite(value) else None
