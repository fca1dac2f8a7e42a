r"""The header of a NanoScope file: sections of lines ``\name: value``, and the scales that they write."""

from __future__ import annotations

import math
import re
from collections.abc import Mapping
from dataclasses import dataclass
from typing import NamedTuple

from underlay.data.readers._source import Source
from underlay.errors import FileFormatError

__all__ = ["Header", "Scale", "Section", "read_header"]

_END = b"\\*File list end"
# Headers of 35 to 80 kB were seen.
_LONGEST_HEADER = 1_000_000
_LONGEST_COUNT = 12
_NUMBER = r"[-+]?\d+(?:\.\d*)?(?:[eE][-+]?\d+)?"
# "V [Sens. DeflSens] (0.0003750000 V/LSB) 2.500000 V", "V 21.90000 nm/V"
_SCALE = re.compile(rf"V\s+(?:\[([^\]]*)\]\s*)?\(\s*({_NUMBER})\s*([^/\s]*)/LSB\)\s*({_NUMBER})?")
_SENSITIVITY = re.compile(rf"V\s+({_NUMBER})\s*(?:([^/\s]+)/V)?")
_PLAIN = re.compile(rf"({_NUMBER})\s*(\S*)")
_METRES = {"m": 1.0, "um": 1e-6, "~m": 1e-6, "µm": 1e-6, "nm": 1e-9, "pm": 1e-12}
_VOLTS = {"V": 1.0, "mV": 1e-3, "uV": 1e-6, "~V": 1e-6}


class Scale(NamedTuple):
    """A quantity in volts: volts per number of the file, the value itself, and the sensitivity it names."""

    per_number: float
    volts: float
    sensitivity: str


@dataclass(frozen=True)
class Section:
    """One section of the header."""

    title: str
    entries: Mapping[str, str]

    def text(self, *names: str) -> str:
        """Value of the first of these entries that is there; else ''."""
        return next((self.entries[name] for name in names if name in self.entries), "")

    def number(self, *names: str) -> float | None:
        """Return the finite number that such an entry begins with; None where there is none."""
        found = _PLAIN.match(self.text(*names))
        value = math.inf if found is None else float(found[1])
        return value if math.isfinite(value) else None

    def length(self, name: str) -> float:
        """Return a length (m); zero where it is not written."""
        value, found = self.number(name), _PLAIN.match(self.text(name))
        return 0.0 if value is None or found is None else value * _METRES.get(found[2], 1e-9)

    def scale(self, *names: str) -> Scale | None:
        """Return a quantity in volts; None where the entry is none."""
        found = _SCALE.match(self.text(*names))
        if found is None or found[3] not in _VOLTS:
            return None
        volt = _VOLTS[found[3]]
        per_number, value = float(found[2]) * volt, float(found[4] or "nan") * volt
        if not math.isfinite(per_number) or math.isinf(value):
            return None
        return Scale(per_number, value, found[1] or "")


@dataclass(frozen=True)
class Header:
    """All sections of a file."""

    source: Source
    sections: tuple[Section, ...]

    def section(self, title: str) -> Section:
        """Return the first section of this title, or an empty one."""
        return next((section for section in self.sections if section.title == title), Section(title, {}))

    @property
    def images(self) -> list[Section]:
        """The channels of force curves."""
        return [section for section in self.sections if section.title == "Ciao force image list"]

    @property
    def version(self) -> int:
        """Version of the program that wrote the file, 0x09200000 for 9.20; zero where it is not written."""
        try:
            return int(self.section("Force file list").text("Version"), 16)
        except ValueError:
            return 0

    def sensitivity(self, name: str) -> float | None:
        """Metres per volt, by the name of the sensitivity; None where that is no length."""
        for section in self.sections:
            found = _SENSITIVITY.match(section.text(f"@{name}"))
            if found:
                # Where no unit was written in a file that was seen, the number was of nanometres.
                metres = float(found[1]) * _METRES.get(found[2] or "nm", math.nan)
                return metres if math.isfinite(metres) else None
        return None

    def count(self, section: Section, name: str) -> int:
        """Return a whole number that must be there.

        Raises
        ------
        FileFormatError
            If it is not.
        """
        text = section.text(name)
        if not text.isdecimal() or len(text) > _LONGEST_COUNT:
            raise FileFormatError(f"{self.source.name}: no number for {name!r}; it says {text!r:.40}")
        return int(text)


def read_header(source: Source) -> Header:
    """Take the header of a file apart.

    Raises
    ------
    FileFormatError
        If it does not end.
    """
    end = source.data.find(_END, 0, _LONGEST_HEADER)
    if end < 0:
        raise FileFormatError(f"{source.name} is a NanoScope file whose header does not end: it is cut short")
    sections: list[Section] = []
    entries: dict[str, str] = {}
    for line in re.split(r"[\r\n]+", source.data[:end].decode("latin-1")):
        if line[1:2] == "*":
            entries = {}
            sections.append(Section(line[2:].strip(), entries))
        else:
            # The names of scaled quantities hold a colon themselves: "@4:Z scale".
            name, _, value = line[1:].partition(": ")
            entries.setdefault(name.strip(": "), value.strip())
    return Header(source, tuple(sections))
