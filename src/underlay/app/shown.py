"""What the page shows of work that was done in another process: plain values, which travel through a pipe.

Beside them stands what is said of a curve before anything is fitted to it: how it was read, how good it is
(`quality_of`), and what its file says of the instrument (`facts_of`).
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TypeAlias

import numpy as np
import pandas as pd

from underlay.data.curve import Curve
from underlay.data.quality import check_quality
from underlay.report.plots.fit import Canvas
from underlay.scene.scene_file import SceneFile
from underlay.units import format_quantity, printed

__all__ = [
    "Card",
    "Film",
    "Found",
    "Gallery",
    "Law",
    "Look",
    "Overview",
    "Progress",
    "Reading",
    "Row",
    "Sampled",
    "Taken",
    "Together",
    "each_once",
    "facts_of",
    "printed_rows",
    "quality_of",
]

#: A row of a table: texts by column.
Row: TypeAlias = dict[str, str]
_SPANS = ("depth", "force")
#: Numbers that a file of a curve may hold: key, what it is called, kind.
_FACTS = (
    ("spring_constant", "Spring constant", "stiffness"),
    ("sensitivity", "Deflection sensitivity", "sensitivity"),
    ("indenter_radius", "Tip radius", "length"),
    ("instrument_reduced_modulus", "The instrument's own reduced modulus", "pressure"),
)


@dataclass(frozen=True)
class Reading:
    """How a file was read.

    Parameters
    ----------
    file : str
        Its name.
    format, instrument : str
        In words; empty where the file says nothing.
    facts : mapping of str to str
        Numbers of the instrument that the file holds, by their names.
    tests : tuple of Row
        A row per test.
    notes : tuple of str
        What is wrong, or worth knowing.
    refused : str
        Why it could not be read; empty where it could.
    """

    file: str
    format: str = ""
    instrument: str = ""
    facts: dict[str, str] = field(default_factory=dict)
    tests: tuple[Row, ...] = ()
    notes: tuple[str, ...] = ()
    refused: str = ""


@dataclass(frozen=True)
class Law:
    """What a contact law makes of a curve whose contact point is held.

    Parameters
    ----------
    name, modulus : str
        In words.
    colour, dashes : str
        Of its line, as SVG has them.
    line : tuple of (float, float)
        Depth and force readings (m, N).
    """

    name: str
    modulus: str
    colour: str
    dashes: str
    line: tuple[tuple[float, float], ...]


@dataclass(frozen=True)
class Look:
    """A curve before its fit.

    Parameters
    ----------
    picture : Canvas
        Of the curve, over which laws are drawn.
    contact, low, high : float
        Depth readings (m) of the contact and of the ends of what is used.
    extent : (float, float)
        Depth readings (m) at the ends of the curve.
    laws : tuple of Law
        Of the scene, and of a half-space.
    quality : str
        Verdict on the curve.
    notes : tuple of str
        What speaks against it, and what a law refused.
    has_stiffness : bool
        Whether its contact stiffness S(h) was measured, so that `underlay film` has something to fit.
    """

    picture: Canvas
    contact: float
    low: float
    high: float
    extent: tuple[float, float]
    laws: tuple[Law, ...] = ()
    quality: str = ""
    notes: tuple[str, ...] = ()
    has_stiffness: bool = False


@dataclass(frozen=True)
class Found:
    """What came of a fit.

    Parameters
    ----------
    stem : str
        Beginning of the names of its files.
    of : str
        Fingerprint of the curve and scene that it is of.
    scene : str
        Text of that scene file, which repeats it.
    values : mapping of str to list of str
        What is printed of each quantity (SI): value, ends, ends of the statistical part.
    sheet : str
        The page of the fit as HTML; its numbers and verdict alone until the pictures are drawn.
    notes : tuple of str
        What the reader of the file has to say.
    """

    stem: str
    of: str
    scene: str
    values: dict[str, list[str]] = field(default_factory=dict)
    sheet: str = ""
    notes: tuple[str, ...] = ()


@dataclass(frozen=True)
class Film:
    """What the contact stiffness says of a film.

    Parameters
    ----------
    of : str
        Fingerprint of the curve and scene that it is of.
    notes : tuple of str
        In words.
    table : tuple of Row
        A row per modulus.
    picture : str
        Name of a file.
    """

    of: str
    notes: tuple[str, ...] = ()
    table: tuple[Row, ...] = ()
    picture: str = ""


@dataclass(frozen=True)
class Progress:
    """How far a long task is.

    Parameters
    ----------
    done, total : int
        Curves, or steps.
    words : str
        Both in words, as the page shows them.
    """

    done: int
    total: int
    words: str


@dataclass(frozen=True)
class Overview:
    """What was found on many curves.

    Parameters
    ----------
    sheet : str
        The page of the map as HTML; empty where nothing was fitted.
    labels : tuple of str
        Columns by which curves may be grouped.
    is_old : bool
        Whether files or scene were changed since.
    is_whole : bool
        Whether the run came to its end.
    sites : tuple of (str, float, float)
        Names of the curves that have a position, and where they lie (m).
    plan : Canvas, optional
        The map to draw regions on, where there are positions.
    """

    sheet: str = ""
    labels: tuple[str, ...] = ()
    is_old: bool = False
    is_whole: bool = True
    sites: tuple[tuple[str, float, float], ...] = ()
    plan: Canvas | None = None


@dataclass(frozen=True)
class Card:
    """One curve of the gallery.

    Parameters
    ----------
    name, verdict, reason : str
        As in the table of the map.
    numbers : tuple of str
        What was found, in words.
    misfit : str
        In words.
    picture : str
        SVG element, made here.
    fitted : bool
        Whether there is a fit to accept.
    decision, why : str
        "accept", "refuse" or nothing, and the reason.
    """

    name: str
    verdict: str
    reason: str
    numbers: tuple[str, ...]
    misfit: str
    picture: str
    fitted: bool
    decision: str = ""
    why: str = ""


@dataclass(frozen=True)
class Gallery:
    """One page of the gallery, worst curves first.

    Parameters
    ----------
    cards : tuple of Card
        Its curves.
    pages : int
        How many pages there are.
    """

    cards: tuple[Card, ...] = ()
    pages: int = 0


@dataclass(frozen=True)
class Together:
    """What many curves show of a population.

    Parameters
    ----------
    of : str
        Fingerprint of the map and of what was decided by hand.
    by, group : str
        Labels by which curves belong together, and what is compared; empty for none.
    sheet : str
        Sentences, pictures and tables as HTML.
    """

    of: str
    by: str = ""
    group: str = ""
    sheet: str = ""


@dataclass(frozen=True)
class Taken:
    """What is taken away of a fit.

    Parameters
    ----------
    scene, script : str
        Texts: the test as it was fitted, and Python that fits it again.
    is_old : bool
        Whether test or curve were changed since.
    is_map_old : bool
        Whether the curves, their labels or the test were changed since all were fitted.
    """

    scene: str
    script: str
    is_old: bool = False
    is_map_old: bool = False


@dataclass(frozen=True)
class Sampled:
    """A posterior.

    Parameters
    ----------
    of : str
        Fingerprint of the curve and scene that it is of.
    sheet : str
        The page of the posterior as HTML.
    notes : tuple of str
        What to do where it did not converge, and what was assumed.
    """

    of: str
    sheet: str = ""
    notes: tuple[str, ...] = ()


def each_once(*messages: str) -> tuple[str, ...]:
    """Each message once, in the order of their first."""
    return tuple(dict.fromkeys(messages))


def quality_of(curve: Curve, file: SceneFile) -> tuple[str, list[str]]:
    """Return the verdict on a curve before its fit, and the sentences that speak against it."""
    quality = check_quality(curve, file.draft)
    return quality.verdict, list(quality.reasons)


def facts_of(curve: Curve) -> dict[str, str]:
    """What the file of a curve says of the instrument, in words."""
    found = {}
    for key, words, kind in _FACTS:
        value = curve.metadata.get(key)
        if isinstance(value, int | float) and not isinstance(value, bool) and np.isfinite(value):
            found[words] = format_quantity(float(value), kind)
    return found


def printed_rows(table: pd.DataFrame) -> tuple[Row, ...]:
    """Rows for a page: spans with their units as printed, what a file calls its tests as it does."""
    return tuple(
        {str(key): printed(str(value)) if key in _SPANS else str(value) for key, value in row.items()}
        for row in table.to_dict("records")
    )
