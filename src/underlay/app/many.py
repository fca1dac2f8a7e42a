"""Many curves on the page: the map, decisions by hand on single curves, and the population."""

from __future__ import annotations

import hashlib
import json
import re
from collections.abc import Mapping, Sequence
from dataclasses import asdict, replace
from pathlib import Path

import numpy as np
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
    set_label,
    take_manifest,
    write_labels,
)
from underlay.app.form import Draft
from underlay.app.shown import Gallery, Overview, Progress, Together
from underlay.app.work import Tell
from underlay.data.contact_point import find_contact, thickness_of_heights
from underlay.errors import InputError
from underlay.inference.batch.decisions import Decision, Decisions, read_decisions, read_map, without_refused
from underlay.inference.batch.fit_many import fit_many
from underlay.inference.batch.model import MapOptions
from underlay.inference.batch.results_table import write_frame
from underlay.inference.from_files import read_whole
from underlay.inference.population.population import population
from underlay.report import plots
from underlay.report.excel import excel_bytes
from underlay.report.maps import columns_to_draw, sample_parameters
from underlay.report.page import today
from underlay.report.page_map import MapPage, together_block
from underlay.report.plots.fit import Canvas, canvas
from underlay.report.plots.map import map_unit
from underlay.report.review import Card, review_cards
from underlay.report.tables import span
from underlay.scene.scene_file import SceneFile, read_scene_file
from underlay.units import format_quantity, parse_quantity, printed

_KIND = FileKind("the gallery of a map", 1_000_000_000, "fit the curves again")
#: Curves on a page of the gallery.
PER_PAGE = 24
_TOGETHER = "population"
_THICKNESS = "thickness (m)"
_PLACE = re.compile(r"([xy])\s*[(\[]\s*(\w+)\s*[)\]]")


class MapTasks:
    """The tasks of a worker process on all curves of an analysis: the map, decisions, labels, and the population.

    Parameters
    ----------
    path : str
        Folder of the analysis.
    """

    def __init__(self, path: str) -> None:
        self._folder = AnalysisFolder(Path(path))

    def fit_all(self, tell: Tell) -> Overview:
        """Fit every curve of an analysis and write table, scene and journal among its results.

        With the same files, labels and scene nothing is fitted again, and an interrupted run continues.

        Parameters
        ----------
        tell : callable
            Called with a `Progress` during the run.
        """
        folder = self._folder
        text = _scene_of_all(folder)
        of = _fingerprint(folder, text)
        table = folder.results / "map.csv"
        journal = table.with_name("map.csv.journal")
        done = folder.read_result("map.done.txt") == of.encode()
        if done and table.exists():
            return self.overview(tell)
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
        return self.overview(tell)

    def overview(self, _tell: Tell) -> Overview:
        """Return the summary of the map for the page; an empty one where no map was made."""
        folder = self._folder
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

    def gallery(self, page: int, _tell: Tell) -> Gallery:
        """Return one page (from 0) of the gallery of curves, worst first, with the decisions by hand."""
        folder = self._folder
        if not (folder.results / "map.csv").is_file():
            return Gallery()
        cards, decided = _cards(folder), _decisions(folder).by_curve
        shown = []
        for card in cards[page * PER_PAGE : (page + 1) * PER_PAGE]:
            found = decided.get(card.name)
            shown.append(card if found is None else replace(card, decision=found.word, why=found.reason))
        return Gallery(tuple(shown), -(-len(cards) // PER_PAGE))

    def decide(self, names: Sequence[str], word: str, reason: str, _tell: Tell) -> None:
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
        table = read_map(self._folder.results / "map.csv")
        known = dict(_decisions(self._folder).by_curve)
        for name in names:
            known.pop(name, None)
            if word:
                known[name] = Decision(word == "accept", reason.strip())
        decisions = Decisions(known)
        # What cannot be carried out is not kept.
        decisions.applied(table)
        write_atomic(self._folder.decisions, decisions.csv(pd.DataFrame({"curve": table["name"]})))

    def population(self, by: str, group: str, _tell: Tell) -> Together:
        """Estimate the population mean from the curves that were not refused, and store the result.

        Parameters
        ----------
        by : str
            Column that names the unit a curve belongs to, such as the animal; empty for none.
        group : str
            Column of the groups that are compared; empty for none.

        Raises
        ------
        InputError
            If no curves were fitted yet.
        """
        folder = self._folder
        of, table = _judged(folder), judged_table(folder)
        fitted = sample_parameters(read_map(folder.results / "map.csv"))
        if not fitted:
            raise InputError("nothing of the sample was fitted")
        result = population(table, [by] if by else [], parameter=fitted[0], group=group or None)
        write_atomic(folder.results / "population.csv", csv_text(result.table()))
        together = Together(of, by, group, together_block(result, without_refused(table), group or by))
        keep(folder, _TOGETHER, together)
        return together

    def together(self, _tell: Tell) -> tuple[Together | None, bool]:
        """Return the stored population, if any, and whether map and decisions are unchanged since."""
        before = kept(self._folder, _TOGETHER, Together)
        return before, before is not None and before.of == _judged(self._folder)

    def excel_of_all(self, _tell: Tell) -> bytes:
        """Return the Excel file of the map, with the decisions by hand and the scene that was fitted."""
        scene = (self._folder.read_result("map.scene.toml") or b"").decode()
        return excel_bytes(judged_table(self._folder), settings={"scene": scene[:30_000]})

    def labels(self, _tell: Tell) -> dict[str, dict[str, str]]:
        """Return the labels of every curve, by file and column."""
        return read_labels(self._folder)

    def set_label(self, files: list[str], column: str, label: str, _tell: Tell) -> None:
        """Set a label of curves in a column such as animal or group."""
        set_label(self._folder, files, column, label)

    def take_manifest(self, content: bytes, _tell: Tell) -> None:
        """Store an uploaded manifest (CSV) with labels of the curves."""
        take_manifest(self._folder, content)

    def thickness(self, begins: str, _tell: Tell) -> str:
        """Write the layer thickness under every curve into the manifest, from contacts with the bare substrate.

        The surface of the substrate is a plane through the contacts of at least three curves on it, if all curves
        have positions (of labels or files) and these are not on a line; otherwise it is taken as level. The stated
        error includes the contact points alone. The contact of curves on the sample is found by the scene's model.

        Parameters
        ----------
        begins : str
            Beginning of the names of the curves on the bare substrate.

        Returns
        -------
        str
            A sentence on the thicknesses found, for the page.

        Raises
        ------
        InputError
            If no curve has such a name, or all have, or the sample would be below the substrate.
        CurveError
            If a curve shows no contact.
        """
        folder, file = self._folder, read_scene_file(self._folder.scene)
        rows = read_labels(folder)
        names = list(rows)
        bare = np.array([bool(begins) and name.casefold().startswith(begins.casefold()) for name in names])
        if not bare.any() or bare.all():
            raise InputError(
                f"{bare.sum()} of {len(rows)} curves have a name that begins with {begins[:40]!r}: some must be on "
                "the bare substrate, and some on the sample"
            )
        found = [
            _contact(folder, file, name, rows[name], on_sample=not alone)
            for name, alone in zip(names, bare, strict=True)
        ]
        height, error = (np.array([contact[part] for contact in found]) for part in (0, 1))
        known = thickness_of_heights(height, error, bare, [contact[2] for contact in found])
        if (known.thickness[~bare] <= 0.0).any():
            deepest = names[int(np.argmin(np.where(bare, np.inf, known.thickness)))]
            raise InputError(
                f"{deepest} meets the sample deeper than the bare substrate: do all curves count depth from one "
                "zero?"
            )
        for name, alone, value in zip(names, bare, known.thickness, strict=True):
            kept = {key: cell for key, cell in rows[name].items() if "thickness" not in key}
            rows[name] = kept | {
                BARE: "yes" if alone else "",
                _THICKNESS: "0" if alone else repr(float(value)),
            }
        write_labels(folder, rows)
        own = known.thickness[~bare]
        width = format_quantity(float(f"{2.0 * np.median(known.error[~bare]):.2g}"), "length")
        how = "tilted" if known.is_tilted else "level"
        of_all = span(own.min(), own.max(), "length")
        return printed(
            f"Thickness under {len(own)} curves: {of_all}, each ± {width} by the contact points (95 %). The "
            f"{bare.sum()} curves on the bare substrate, taken as {how}, are left out of the map."
        )


def _contact(
    folder: AnalysisFolder, file: SceneFile, name: str, row: Mapping[str, str], *, on_sample: bool
) -> tuple[float, float, tuple[float, ...]]:
    """Return the height of a contact, its standard uncertainty, and its position (x, y), all in m.

    The height is the depth reading from the zero that all curves share. The position comes from the labels, else
    from the file; it is empty where neither has one.
    """
    curve = read_whole(file, folder.curve_file(name))
    found = find_contact(curve, scene=file.draft if on_sample else None)
    labels = {
        place[1]: parse_quantity(f"{cell} {place[2]}", "length")
        for header, cell in row.items()
        if cell and (place := _PLACE.fullmatch(header))
    }
    own = curve.metadata.get("position")
    position = tuple(own[:2]) if isinstance(own, tuple) else ()
    # What a reader took off the axis so that it begins at zero.
    taken = float(curve.metadata.get("contact_height", 0.0))
    return (
        taken + found.depth,
        found.uncertainty,
        (labels["x"], labels["y"]) if len(labels) == 2 else position,
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
