"""What a table holds beside the columns that are read of it, and that it holds several tests, as notes."""

from __future__ import annotations

import unicodedata
from collections.abc import Mapping, Sequence

import numpy as np

from underlay._arrays import FloatArray
from underlay._text import names_there
from underlay.data.readers._text import split_label

__all__ = ["begins_again", "namesakes", "plain", "rivals"]

# A depth that goes on does not leap by this share of its range between two readings.
_LEAP = 0.3


def plain(name: str) -> str:
    """Name in small letters without accents, however these are coded."""
    if name.isascii():
        return name.strip().lower()
    letters = unicodedata.normalize("NFKD", name.strip().lower())
    return "".join(letter for letter in letters if not unicodedata.combining(letter)).replace("’", "'")


def namesakes(
    labels: Sequence[str], columns: Mapping[str, int], mapping: Mapping[str, str] | None
) -> tuple[str, ...]:
    """Notes of columns that share the name of the one that is read, the first: another unit, or another test."""
    names = [plain(split_label(label)[0]) for label in labels]
    notes = []
    for role, index in columns.items():
        label = labels[index].strip()
        others = [labels[i].strip() for i, name in enumerate(names) if name == names[index] and i != index]
        chosen = plain((mapping or {}).get(role, "").strip().removeprefix("-")) == plain(label)
        if others and (label in others or not chosen):
            told = ", ".join(map(repr, others))
            notes.append(
                f"the {role} is read from the first column of its name, {label!r}; not read: {told}. Choose by "
                "the whole name in columns, or split a file that holds several tests side by side"
            )
    return tuple(notes)


def rivals(
    labels: Sequence[str],
    columns: Mapping[str, int],
    mapping: Mapping[str, str] | None,
    known: Mapping[str, Sequence[str]],
) -> tuple[str, ...]:
    """Notes of columns of another name that would be read as well, were the one that is read not there."""
    names = [plain(split_label(label)[0]) for label in labels]
    notes = []
    for role, index in columns.items():
        if role in (mapping or {}) or not known.get(role):
            continue
        others = [
            labels[i].strip() for i, name in enumerate(names) if name in known[role] and name != names[index]
        ]
        if others:
            notes.append(
                f"the {role} is read from {labels[index].strip()!r:.80}; not read: {names_there(others)}, which "
                "may be one too. Say which in columns"
            )
    return tuple(notes)


def begins_again(depth: FloatArray, time: FloatArray | None) -> tuple[str, ...]:
    """Note that time and depth both begin again: tests one below the other. With every segment time alone does."""
    if time is None:
        return ()
    there = depth[np.isfinite(depth)]
    back = np.flatnonzero(time[1:] < time[:-1]) + 1
    if not there.size or not back.size:
        return ()
    rows = back[np.abs(depth[back] - depth[back - 1]) > _LEAP * np.ptp(there)]
    if not rows.size:
        return ()
    note = (
        f"time and depth begin again in row {rows[0] + 1} of the table: the file looks like {rows.size + 1} tests "
        "one below the other, read as one; split it into one file a test"
    )
    return (note,)
