"""Results that a worker process sends to the page: dataclasses of plain values, which can be pickled.

With them is what the file of a curve says of the instrument (`facts_of`).
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TypeAlias

import numpy as np
import pandas as pd

from underlay.app.form import FACTS
from underlay.data.curve import Curve
from underlay.report.plots.fit import Canvas
from underlay.report.review import Card
from underlay.units import format_quantity, printed

#: A row of a table: texts by column.
Row: TypeAlias = dict[str, str]
_SPANS = ("depth", "force")


@dataclass(frozen=True)
class Reading:
    """How a curve file was read.

    Parameters
    ----------
    file : str
        Its name.
    format, instrument : str
        Names for people; empty where the file says nothing.
    facts : mapping of str to str
        Values of the instrument that the file holds, with units, by name.
    tests : tuple of Row
        A row per test of the file.
    notes : tuple of str
        Warnings and remarks of the reader.
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
    """A contact model's curve and modulus at a given contact point, as drawn over a measured curve.

    Parameters
    ----------
    name, modulus : str
        Name of the model, and the modulus it gives with its unit.
    colour, dashes : str
        SVG stroke and dash pattern of its line.
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
    """A curve before its fit, with the contact models at a trial contact point.

    Parameters
    ----------
    picture : Canvas
        Picture of the curve, over which the models are drawn.
    contact, low, high : float
        Depth readings (m) of the contact point and of the ends of the fit range.
    extent : (float, float)
        Depth readings (m) at the ends of the curve.
    laws : tuple of Law
        The model of the scene, and the half-space.
    quality : str
        Verdict on the curve.
    notes : tuple of str
        What speaks against the curve, and why a model could not be fitted.
    has_stiffness : bool
        Whether its contact stiffness S(h) was measured, which `underlay film` fits.
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
    """Result of a fit.

    Parameters
    ----------
    stem : str
        Beginning of the names of its files.
    of : str
        Fingerprint (SHA-256) of the curve and scene that were fitted.
    scene : str
        Text of that scene file, which repeats the fit.
    values : mapping of str to list of str
        Numbers of each quantity (SI): value, ends, ends of the statistical part.
    sheet : str
        The report of the fit as HTML; numbers and verdict alone until the pictures are drawn.
    notes : tuple of str
        Notes of the file reader.
    """

    stem: str
    of: str
    scene: str
    values: dict[str, list[str]] = field(default_factory=dict)
    sheet: str = ""
    notes: tuple[str, ...] = ()


@dataclass(frozen=True)
class Film:
    """Moduli of a film, fitted to its contact stiffness.

    Parameters
    ----------
    of : str
        Fingerprint (SHA-256) of the curve and scene that were fitted.
    notes : tuple of str
        Sentences on scatter and bias of the moduli.
    table : tuple of Row
        A row per modulus.
    picture : str
        File name of the picture.
    """

    of: str
    notes: tuple[str, ...] = ()
    table: tuple[Row, ...] = ()
    picture: str = ""


@dataclass(frozen=True)
class Progress:
    """How far a long task has come.

    Parameters
    ----------
    done, total : int
        Numbers of curves, or of steps.
    words : str
        The same as a sentence for the page.
    """

    done: int
    total: int
    words: str


@dataclass(frozen=True)
class Overview:
    """Summary of the map of many curves.

    Parameters
    ----------
    sheet : str
        The report of the map as HTML; empty where nothing was fitted.
    labels : tuple of str
        Columns by which curves may be grouped.
    is_old : bool
        Whether files or scene were changed since.
    is_whole : bool
        Whether the run was completed.
    sites : tuple of (str, float, float)
        Name and position (x, y in m) of the curves that have one.
    plan : Canvas, optional
        Map on which regions can be drawn, where there are positions.
    """

    sheet: str = ""
    labels: tuple[str, ...] = ()
    is_old: bool = False
    is_whole: bool = True
    sites: tuple[tuple[str, float, float], ...] = ()
    plan: Canvas | None = None


@dataclass(frozen=True)
class Gallery:
    """One page of the gallery, worst curves first.

    Parameters
    ----------
    cards : tuple of Card
        Its curves.
    pages : int
        Number of pages of the gallery.
    """

    cards: tuple[Card, ...] = ()
    pages: int = 0


@dataclass(frozen=True)
class Together:
    """The population that the curves of a map sample.

    Parameters
    ----------
    of : str
        Fingerprint (SHA-256) of the map and the decisions by hand.
    by, group : str
        Columns of the units (such as animals) and of the compared groups; empty for none.
    sheet : str
        Sentences, pictures and tables as HTML.
    """

    of: str
    by: str = ""
    group: str = ""
    sheet: str = ""


@dataclass(frozen=True)
class Taken:
    """Texts for download that repeat a fit, and whether results are out of date.

    Parameters
    ----------
    scene, script : str
        The scene file as it was fitted, and a Python script that fits it again.
    is_old : bool
        Whether scene or curve were changed since the fit.
    is_map_old : bool
        Whether the curves, their labels or the scene were changed since the map was fitted.
    """

    scene: str
    script: str
    is_old: bool = False
    is_map_old: bool = False


@dataclass(frozen=True)
class Sampled:
    """Result of sampling the posterior.

    Parameters
    ----------
    of : str
        Fingerprint (SHA-256) of the curve and scene that were sampled.
    sheet : str
        The report of the posterior as HTML.
    notes : tuple of str
        What to do where it did not converge, and what was assumed.
    """

    of: str
    sheet: str = ""
    notes: tuple[str, ...] = ()


def each_once(*messages: str) -> tuple[str, ...]:
    """Return the messages without duplicates, in the order of their first occurrence."""
    return tuple(dict.fromkeys(messages))


def facts_of(curve: Curve) -> dict[str, str]:
    """Return the instrument's values that the file of a curve holds (spring constant, ...), as text by name."""
    found = {}
    for key, (words, kind) in FACTS.items():
        value = curve.metadata.get(key)
        if isinstance(value, int | float) and not isinstance(value, bool) and np.isfinite(value):
            found[words] = format_quantity(float(value), kind)
    return found


def printed_rows(table: pd.DataFrame) -> tuple[Row, ...]:
    """Return the rows of a table as text, with the micro sign in the units of depth and force (um as µm)."""
    return tuple(
        {str(key): printed(str(value)) if key in _SPANS else str(value) for key, value in row.items()}
        for row in table.to_dict("records")
    )
