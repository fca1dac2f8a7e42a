"""Many curves on the page: the map, decisions by hand on single curves, and the population."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Sequence
from dataclasses import asdict, replace
from pathlib import Path

import pandas as pd

from underlay._csv import csv_text
from underlay._door import FileKind, parse_json, read_text, sha256_of, understood
from underlay._files import write_atomic
from underlay.app.folder import (
    BARE,
    AnalysisFolder,
    curves_on_sample,
    keep,
    kept,
    label_columns,
    manifest_text,
    read_labels,
)
from underlay.app.form import Draft
from underlay.app.shown import Gallery, Overview, Progress, Together
from underlay.app.work import Tell
from underlay.errors import InputError
from underlay.inference.batch.decisions import Decision, Decisions, read_decisions, read_map, without_refused
from underlay.inference.batch.fit_many import fit_many
from underlay.inference.batch.model import MapOptions
from underlay.inference.batch.results_table import write_frame
from underlay.inference.population.population import population
from underlay.report import plots
from underlay.report.maps import columns_to_draw, sample_parameters
from underlay.report.page import today
from underlay.report.page_map import MapPage, together_block
from underlay.report.plots.fit import Canvas, canvas
from underlay.report.plots.map import map_unit
from underlay.report.review import Card, review_cards

_KIND = FileKind("the gallery of a map", 1_000_000_000, "fit the curves again")
#: Curves on a page of the gallery.
PER_PAGE = 24
_TOGETHER = "population"


def run_map(folder: AnalysisFolder, tell: Tell) -> Overview:
    """Fit every curve of an analysis and write table, scene and journal among its results.

    With the same files, labels and scene nothing is fitted again, and an interrupted run continues.

    Parameters
    ----------
    folder : AnalysisFolder
        The analysis.
    tell : callable
        Called with a `Progress` during the run.
    """
    text = _scene_of_all(folder)
    of = _fingerprint(folder, text)
    table = folder.results / "map.csv"
    journal = table.with_name("map.csv.journal")
    done = folder.read_result("map.done.txt") == of.encode()
    if done and table.exists():
        return overview(folder)
    if folder.read_result("map.of.txt") != of.encode():
        for old in (table, journal, folder.results / "map.cards.json"):
            old.unlink(missing_ok=True)
    scene = write_atomic(folder.results / "map.scene.toml", text)
    write_atomic(folder.results / "map.of.txt", of)
    options = MapOptions(
        resume=journal.exists(),
        progress=lambda done, total: tell(Progress(done, total, f"{done} of {total} curves")),
    )
    # A run that did not come to its end goes on in a process of its own: a curve that kills that is given up.
    workers = 1 if options.resume else 0
    fit_many(
        curves_on_sample(folder),
        scene,
        manifest=_manifest(folder),
        workers=workers,
        output=table,
        options=options,
    )
    write_atomic(folder.results / "map.done.txt", of)
    return overview(folder)


def overview(folder: AnalysisFolder) -> Overview:
    """Return the summary of the map for the page; an empty one where no map was made."""
    if not (folder.results / "map.csv").is_file():
        return Overview()
    table = judged_table(folder)
    sites = _sites(without_refused(table))
    return Overview(
        # The map stands beside it, to draw on.
        MapPage(table, today()).sheet(drawn=sites[1] is None),
        tuple(name for name in label_columns(folder) if name in table.columns),
        map_is_old(folder),
        folder.read_result("map.of.txt") == folder.read_result("map.done.txt"),
        *sites,
    )


def _sites(table: pd.DataFrame) -> tuple[tuple[tuple[str, float, float], ...], Canvas | None]:
    """Return name, x and y (m) of the curves, and a map of the first parameter on which regions can be drawn.

    Empty and None where curves have no positions or nothing of the sample was fitted.
    """
    columns = columns_to_draw(table)
    if not columns:
        return (), None
    placed = table[table["x"].notna() & table["y"].notna()]
    sites = zip(placed["name"].astype(str), placed["x"].astype(float), placed["y"].astype(float), strict=True)
    drawn, unit = plots.map(placed, columns[0]), map_unit(placed)[1]
    (left, right), (floor, ceiling) = drawn.get_xlim(), drawn.get_ylim()
    return tuple(sites), canvas(drawn, (left * unit, right * unit), (floor * unit, ceiling * unit))


def map_is_old(folder: AnalysisFolder) -> bool:
    """Whether files, labels or scene were changed since the map was fitted; False where there is none."""
    if not (folder.results / "map.csv").is_file():
        return False
    return folder.read_result("map.of.txt") != _fingerprint(folder, _scene_of_all(folder)).encode()


def judged_table(folder: AnalysisFolder) -> pd.DataFrame:
    """Return the table of the map with the decisions by hand applied, and write it as ``judged.csv``.

    Raises
    ------
    InputError
        If no curves were fitted yet.
    """
    path = folder.results / "map.csv"
    if not path.is_file():
        raise InputError("fit all curves first")
    table = _decisions(folder).applied(read_map(path))
    write_frame(folder.results / "judged.csv", table)
    return table


def gallery(folder: AnalysisFolder, page: int) -> Gallery:
    """Return one page (from 0) of the gallery of curves, worst first, with the decisions by hand."""
    if not (folder.results / "map.csv").is_file():
        return Gallery()
    cards, decided = _cards(folder), _decisions(folder).by_curve
    shown = []
    for card in cards[page * PER_PAGE : (page + 1) * PER_PAGE]:
        found = decided.get(card.name)
        shown.append(card if found is None else replace(card, decision=found.word, why=found.reason))
    return Gallery(tuple(shown), -(-len(cards) // PER_PAGE))


def decide(folder: AnalysisFolder, names: Sequence[str], word: str, reason: str) -> None:
    """Store a decision by hand on curves; it is on the disk when this returns.

    Parameters
    ----------
    names : sequence of str
        Names of curves as in the table of the map.
    word : str
        ``"accept"`` or ``"refuse"``; an empty one withdraws a decision.
    reason : str
        Why; a refusal needs one.

    Raises
    ------
    InputError
        If a refusal has no reason, or a curve without a fit is accepted.
    """
    if word == "refuse" and not reason.strip():
        raise InputError("say why it is refused")
    table = read_map(folder.results / "map.csv")
    known = dict(_decisions(folder).by_curve)
    for name in names:
        known.pop(name, None)
        if word:
            known[name] = Decision(word == "accept", reason.strip())
    decisions = Decisions(known)
    # What cannot be carried out is not kept.
    decisions.applied(table)
    write_atomic(folder.decisions, decisions.csv(pd.DataFrame({"curve": table["name"]})))


def show_population(folder: AnalysisFolder, by: str, group: str) -> Together:
    """Estimate the population mean from the curves that were not refused, and store the result.

    Parameters
    ----------
    folder : AnalysisFolder
        The analysis, with a map.
    by : str
        Column that names the unit a curve belongs to, such as the animal; empty for none.
    group : str
        Column of the groups that are compared; empty for none.

    Raises
    ------
    InputError
        If no curves were fitted yet.
    """
    of = _judged(folder)
    table = judged_table(folder)
    result = population(table, [by] if by else [], parameter=_parameter(folder), group=group or None)
    write_atomic(folder.results / "population.csv", csv_text(result.table()))
    together = Together(of, by, group, together_block(result, without_refused(table), group or by))
    keep(folder, _TOGETHER, together)
    return together


def population_before(folder: AnalysisFolder) -> tuple[Together | None, bool]:
    """Return the stored population, if any, and whether map and decisions are unchanged since."""
    before = kept(folder, _TOGETHER, Together)
    return before, before is not None and before.of == _judged(folder)


def _parameter(folder: AnalysisFolder) -> str:
    fitted = sample_parameters(read_map(folder.results / "map.csv"))
    if not fitted:
        raise InputError("nothing of the sample was fitted")
    return fitted[0]


def _decisions(folder: AnalysisFolder) -> Decisions:
    """Return the stored decisions by hand; none where there is no file."""
    if not folder.decisions.exists():
        return Decisions({})
    return read_decisions(folder.decisions)


def _scene_of_all(folder: AnalysisFolder) -> str:
    """Return the scene's text for all curves: without file, depth range and contact point of the selected curve.

    The contact point is fitted for every curve.
    """
    draft = Draft.of(folder.scene_text())
    for key in ("file", "test", "min_depth", "max_depth"):
        draft.table("curve").pop(key, None)
    draft.table("instrument").pop("contact_depth", None)
    draft.free["instrument.contact_depth"] = {}
    return draft.text()


def _manifest(folder: AnalysisFolder) -> Path | None:
    """Return the manifest of the map's curves: with those brought later, without those on the bare substrate."""
    path = folder.path / "manifest.csv"
    rows = read_labels(folder)
    if not path.exists() or all(row and not row.get(BARE) for row in rows.values()):
        return path if path.exists() else None
    kept = {file: row for file, row in rows.items() if not row.get(BARE)}
    text = manifest_text(kept, leave=BARE)
    return write_atomic(folder.result("map.manifest.csv"), text) if text else None


def _fingerprint(folder: AnalysisFolder, scene: str) -> str:
    """Return the SHA-256 of everything that determines the map: scene, labels and curves."""
    manifest = _manifest(folder)
    parts = [scene, "" if manifest is None else sha256_of(manifest)]
    parts += [f"{path.name} {sha256_of(path)}" for path in folder.curve_files()]
    return hashlib.sha256("\n".join(parts).encode()).hexdigest()


def _judged(folder: AnalysisFolder) -> str:
    """Return the SHA-256 of the map and of the decisions by hand."""
    files = (folder.results / "map.csv", folder.decisions)
    parts = [sha256_of(path) if path.is_file() else "" for path in files]
    return hashlib.sha256("\n".join(parts).encode()).hexdigest()


def _cards(folder: AnalysisFolder) -> list[Card]:
    """Return the gallery's entries for all curves, worst first; stored once made, until the map changes."""
    path = folder.results / "map.cards.json"
    of = folder.read_result("map.of.txt") or b""
    if path.is_file():
        with understood(path, _KIND):
            kept = parse_json(read_text(path, _KIND))
            if kept["of"] == of.decode():
                return [Card(**card) for card in kept["cards"]]
    table = read_map(folder.results / "map.csv")
    cards = review_cards(table, curves_on_sample(folder), folder.results / "map.scene.toml")
    write_atomic(path, json.dumps({"of": of.decode(), "cards": [asdict(card) for card in cards]}))
    return cards
