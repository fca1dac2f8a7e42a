"""A gallery of the curves of a map, worst first, to accept or refuse by hand: pages without a script, and a CSV.

The pages hold hundreds of curves, each with fit and residuals, so a picture is a few kilobytes of SVG made here
(`small_picture`) rather than by matplotlib.
"""

from __future__ import annotations

import html
import math
import os
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import pandas as pd

from underlay._arrays import FloatArray
from underlay._files import require_writable_folder, write_atomic
from underlay._text import one_line
from underlay.data.curve import Curve
from underlay.errors import InputError, UnderlayError
from underlay.inference.batch.curves import CurvePlace, Curves, list_curves, read_place
from underlay.inference.batch.decisions import DECISIONS, REFUSED_BY_HAND, Decisions
from underlay.inference.batch.model import MapOptions, scene_file_of
from underlay.inference.batch.results_table import FITTED, fitted_names, standard_errors
from underlay.inference.from_files import within_range
from underlay.mechanics.solver import Solver
from underlay.mechanics.solvers import Auto, as_solver
from underlay.report.labels import label, start
from underlay.report.maps import errors_in_words, sample_parameters
from underlay.report.page import document, tag, words
from underlay.report.plots.style import BEFORE, unit_of
from underlay.report.screen import interval_text
from underlay.scene.parameters import kind_of
from underlay.scene.scene import Scene
from underlay.scene.scene_file import SceneFile
from underlay.units import format_quantity

# Pixels: width, height of the curve, gap, height of the residuals; margins for the words.
_WIDTH, _CURVE, _GAP, _STRIP = 250, 120, 30, 34
_LEFT, _TOP, _BOTTOM = 8, 14, 16
_MOST_POINTS = 160
# A picture of 120 pixels needs no finer law.
_RTOL = 1e-3
# Pieces of a curve over which residuals are averaged, so that noise is small beside misfit.
_PIECES = 20
_ORDER = {"refused": 0, "reject": 1, "check": 2, "good": 3}
_LONGEST_REASON = 600


class Small(NamedTuple):
    """Data of a small picture: one curve with its fit.

    Parameters
    ----------
    depth, force : ndarray (n,)
        Readings (m, N).
    fit : ndarray (n,) or None
        Force of the fit (N).
    contact : float
        Contact point (m); NaN without a fit.
    """

    depth: FloatArray
    force: FloatArray
    fit: FloatArray | None = None
    contact: float = math.nan


def small_picture(curve: Small, alt: str) -> str:
    """Return one curve, with fit and residuals where it has a fit, as an SVG element.

    `alt` is the text for screen readers and must be escaped already.
    """
    shown = np.isfinite(curve.depth) & np.isfinite(curve.force)
    deepest = float(curve.depth[shown].max(initial=0.0))
    if math.isfinite(curve.contact):
        shown &= curve.depth >= curve.contact - BEFORE * (deepest - curve.contact)
    if not shown.any():
        return f'<svg role="img" aria-label="{alt}: no points" width="{_WIDTH}" height="20"></svg>'
    index = np.flatnonzero(shown)[:: max(1, int(np.count_nonzero(shown)) // _MOST_POINTS)]
    depth, force = curve.depth[index], curve.force[index]
    lines = [force] if curve.fit is None else [force, curve.fit[index]]
    low, span = float(np.min(lines)), float(np.ptp(lines)) or 1.0
    x = _LEFT + (_WIDTH - 2 * _LEFT) * (depth - depth.min()) / (float(np.ptp(depth)) or 1.0)
    y = _TOP + _CURVE - _CURVE * (np.array(lines) - low) / span
    right, bottom = _WIDTH - _LEFT, _TOP + _CURVE
    length, metre = unit_of(float(np.ptp(depth)), "length")
    load, newton = unit_of(float(np.abs(force).max()), "force")
    parts = [
        f'<path class="axis" d="M{_LEFT} {_TOP}V{bottom}H{right}"/>',
        _word(_LEFT + 3, _TOP - 3, f"{float(force.max()) / newton:.3g} {load}"),
        _word(_LEFT, bottom + 11, f"{float(depth.min()) / metre:.3g}"),
        _word(right, bottom + 11, f"{float(depth.max()) / metre:.3g} {length}", end=True),
        _dots(x, y[0]),
    ]
    height = bottom + _BOTTOM
    if curve.fit is not None:
        order = np.argsort(depth, kind="stable")
        points = "L".join(f"{a:.1f} {b:.1f}" for a, b in zip(x[order], y[1][order], strict=True))
        residual = force - curve.fit[index]
        largest = float(np.abs(residual).max()) or 1.0
        middle = bottom + _GAP + _STRIP / 2.0
        unit, newton = unit_of(largest, "force")
        parts += [
            f'<path class="fit" d="M{points}"/>',
            f'<path class="fit" d="M{_LEFT} {middle:.0f}H{right}"/>',
            _dots(x, middle - 0.5 * _STRIP * residual / largest),
            _word(_LEFT, middle - _STRIP / 2.0 - 2, f"residual, up to {largest / newton:.2g} {unit}"),
        ]
        height += _GAP + _STRIP - _BOTTOM + 8
        if math.isfinite(curve.contact):
            at = float(np.interp(curve.contact, [depth.min(), depth.max()], [_LEFT, right]))
            parts.append(f'<path class="contact" d="M{at:.1f} {_TOP}V{bottom}"/>')
    return (
        f'<svg role="img" aria-label="{alt}" viewBox="0 0 {_WIDTH} {height}" width="{_WIDTH}" height="{height}">'
        f"{''.join(parts)}</svg>"
    )


def _word(x: float, y: float, text: str, *, end: bool = False) -> str:
    anchor = ' text-anchor="end"' if end else ""
    return f'<text x="{x:.0f}" y="{y:.0f}"{anchor}>{text}</text>'


def _dots(x: FloatArray, y: FloatArray) -> str:
    dots = "".join(f"M{a:.1f} {b:.1f}h0" for a, b in zip(x, y, strict=True))
    return f'<path class="dots" d="{dots}"/>'


@dataclass(frozen=True)
class Card:
    """One curve of the gallery: its verdict, its numbers as text and its picture.

    Parameters
    ----------
    name, verdict, reason : str
        As in the table of the map.
    numbers : tuple of str
        Fitted parameters as text.
    misfit : float or None
        Root mean square of the residuals, averaged over pieces of the curve, relative to the range of the force;
        None without a fit.
    picture : str
        SVG element.
    fitted : bool
        Whether there is a fit to accept.
    decision, why : str
        ``"accept"``, ``"refuse"`` or empty, and the reason.
    """

    name: str
    verdict: str
    reason: str
    numbers: tuple[str, ...]
    misfit: float | None
    picture: str
    fitted: bool
    decision: str = ""
    why: str = ""

    @property
    def badness(self) -> tuple[int, float]:
        """Key that sorts the gallery worst first: rank of the verdict, then minus the misfit."""
        return _ORDER.get(self.verdict, 1), -(math.inf if self.misfit is None else self.misfit)

    @property
    def misfit_words(self) -> str:
        """Size of the misfit as text."""
        return "no fit" if self.misfit is None else f"misfit {100.0 * self.misfit:.2g} % of the force"


def write_review(
    table: pd.DataFrame,
    curves: Curves,
    scene: Scene | SceneFile | str | os.PathLike[str],
    folder: str | os.PathLike[str],
    *,
    options: MapOptions | None = None,
    decisions: Decisions | None = None,
    leave_out: Sequence[Path] = (),
    per_page: int = 60,
) -> list[Path]:
    """Write a gallery of the curves of a map, worst first, and a CSV to enter decisions on them.

    Parameters
    ----------
    table : DataFrame
        What `fit_many` returned.
    curves, scene, options
        The arguments that `fit_many` had. Of the options only solver and folders matter.
    folder : path
        Where ``review.html`` (and ``review-2.html``, ... as needed) and ``decisions.csv`` are written. The
        pages open offline and hold no script. `read_decisions` reads the CSV back.
    decisions : Decisions, optional
        Earlier decisions, which are shown and written into the CSV.
    leave_out : sequence of Path
        Files of the folder that are no curves, such as the manifest.
    per_page : int, default 60
        Curves on a page.

    Returns
    -------
    list of Path
        The pages in order, then the CSV.

    Raises
    ------
    InputError
        If the curves are not those of the table.
    FileAccessError
        If the folder cannot be written.
    """
    target = require_writable_folder(folder)
    known = decisions or Decisions({})
    own = [*leave_out, target / DECISIONS]
    cards = review_cards(table, curves, scene, options=options, decisions=known, leave_out=own)
    pages = [
        write_atomic(target / _page_name(number), text)
        for number, text in enumerate(_pages(cards, max(1, per_page), errors_in_words(table)), start=1)
    ]
    listed = pd.DataFrame(
        {
            "curve": [card.name for card in cards],
            "verdict": [card.verdict for card in cards],
            "misfit (% of the force)": [
                math.nan if card.misfit is None else round(100.0 * card.misfit, 3) for card in cards
            ],
            "number in the gallery": np.arange(1, len(cards) + 1),
        }
    )
    return [*pages, write_atomic(target / DECISIONS, known.csv(listed))]


def review_cards(
    table: pd.DataFrame,
    curves: Curves,
    scene: Scene | SceneFile | str | os.PathLike[str],
    *,
    options: MapOptions | None = None,
    decisions: Decisions | None = None,
    leave_out: Sequence[Path] = (),
) -> list[Card]:
    """Return the gallery's entries, one per curve, worst first; parameters as in `write_review`.

    Raises
    ------
    InputError
        If the curves are not those of the table.
    """
    told = options or MapOptions()
    file = scene_file_of(scene)
    places = list_curves(curves, leave_out, told.folders)
    if len(places) != len(table):
        raise InputError(
            f"the table has {len(table)} rows, but there are {len(places)} curves: give the same ones"
        )
    base = file.draft if file is not None else scene
    if not isinstance(base, Scene):
        raise InputError(f"scene must be a Scene or the path of a scene file; got {scene!r:.100}")
    of_scene = Auto() if file is None else file.solver
    wanted = of_scene if told.solver is None else as_solver(told.solver)
    cards = [
        _card(row, place, file, base, wanted.with_tolerance(_RTOL), decisions or Decisions({}))
        for row, place in zip(table.to_dict("records"), places, strict=True)
    ]
    return sorted(cards, key=lambda card: card.badness)


def _card(
    row: Mapping[Any, Any],
    place: CurvePlace,
    file: SceneFile | None,
    base: Scene,
    solver: Solver,
    decisions: Decisions,
) -> Card:
    name, verdict = str(row["name"]), str(row["verdict"])
    reason = one_line(row["reason"] if isinstance(row["reason"], str) else "", _LONGEST_REASON)
    drawn, misfit = Small(np.zeros(0), np.zeros(0)), None
    try:
        curve = read_place(place, file)
        drawn = Small(curve.depth, curve.force)
        if row["status"] in (FITTED, REFUSED_BY_HAND):
            drawn, misfit = _fitted(row, curve, base, solver, file)
    except UnderlayError as error:
        reason = reason or one_line(error, _LONGEST_REASON)
    decided = decisions.by_curve.get(name)
    by_hand = ("", "") if decided is None else (decided.word, decided.reason)
    return Card(
        name,
        verdict,
        reason,
        tuple(_numbers(row)),
        misfit,
        small_picture(drawn, html.escape(f"{one_line(name, 80)}: force against depth")),
        row["status"] == FITTED,
        *by_hand,
    )


def _fitted(
    row: Mapping[Any, Any], curve: Curve, base: Scene, solver: Solver, file: SceneFile | None
) -> tuple[Small, float]:
    """Return depth, force and fit of a curve to draw, and its misfit relative to the range of the force.

    The misfit is the root mean square, over 20 pieces of the curve, of the mean residual of a piece.
    """
    values = {
        path: float(row[path])
        for path in base.parameters
        if isinstance(row.get(path), float) and math.isfinite(row[path])
    }
    scene = base.with_values(values)
    curve = curve if file is None else within_range(file, scene, curve)
    force = scene.force(curve.depth, curve.time if scene.memory is not None else None, solver=solver)
    residual = curve.force - force
    pieces: list[FloatArray] = np.array_split(residual, min(_PIECES, len(residual)))
    misfit = math.sqrt(float(np.mean([float(piece.mean()) ** 2 for piece in pieces])))
    contact = scene.instrument.contact_depth
    return Small(curve.depth, curve.force, force, contact), misfit / (float(np.ptp(curve.force)) or 1.0)


def _numbers(row: Mapping[Any, Any]) -> Iterator[str]:
    for name in sample_parameters(pd.DataFrame(columns=list(row))):
        value, low, high = (row.get(f"{name}{end}", math.nan) for end in ("", ".low", ".high"))
        if not (isinstance(value, float) and math.isfinite(value)):
            continue
        if math.isfinite(low) and math.isfinite(high):
            text = interval_text(value, low, high, kind_of(name))
        else:
            known = name in fitted_names(row)
            error = float(standard_errors(pd.DataFrame([row]), name)[0]) if known else None
            text = format_quantity(value, kind_of(name), error)
        yield f"{start(label(name))} {text}"


def _page_name(number: int) -> str:
    return "review.html" if number == 1 else f"review-{number}.html"


def _pages(cards: Sequence[Card], per_page: int, errors: str) -> Iterator[str]:
    groups = [cards[first : first + per_page] for first in range(0, len(cards), per_page)]
    counts = {word: sum(card.verdict == word for card in cards) for word in _ORDER}
    told = ", ".join(f"{count} {word}" for word, count in counts.items())
    links = " ".join(f'<a href="{_page_name(n)}">{n}</a>' for n in range(1, len(groups) + 1))
    for number, group in enumerate(groups, start=1):
        first = 1 + (number - 1) * per_page
        yield document(
            f"Curves to look at, page {number}",
            f"<h1>{len(cards)} curves, worst first: {told}</h1>",
            f"<p>Write <b>accept</b> or <b>refuse</b>, and why, beside a curve's name in <b>{DECISIONS}</b>, "
            "whose rows are in this order; then run the same <code>underlay map</code> again with "
            f"<code>--resume --decisions</code> and the path of that file. Grey: measured; blue: fit; dashed: "
            f"contact point; below: residuals. {words(errors)}</p>",
            f"<nav>Page {number} of {len(groups)}: {links}</nav>",
            tag("div", *(_article(card, first + n) for n, card in enumerate(group)), kind="grid"),
            styles=("review",),
        )


def _article(card: Card, number: int) -> str:
    parts = [tag("p", words(line)) for line in (*card.numbers, f"{card.verdict}; {card.misfit_words}")]
    if card.reason:
        parts.append(tag("p", words(card.reason), kind="why"))
    if card.decision:
        decided = f"decided: {card.decision}: {card.why}".rstrip(": ")
        parts.append(tag("p", tag("b", words(decided))))
    head = tag("h2", words(f"{number}. {one_line(card.name, 120)}"))
    return tag(
        "article", head, card.picture, *parts, kind=card.verdict if card.verdict in _ORDER else "check"
    )
