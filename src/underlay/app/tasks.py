"""The tasks of a worker process beside the page: reading, drawing, fitting. Each calls the library.

Results are plain values (text, numbers, bytes of pictures), so that they can be sent between processes.
"""

from __future__ import annotations

from dataclasses import replace
from typing import Any, TypeVar

import numpy as np

from underlay._door import read_bytes, sha256_of
from underlay._files import write_atomic
from underlay.app import results
from underlay.app.folder import (
    FILE,
    keep,
    kept,
)
from underlay.app.many import MapTasks, map_is_old
from underlay.app.shown import (
    Film,
    Found,
    Law,
    Look,
    Reading,
    Sampled,
    Taken,
    each_once,
    facts_of,
    printed_rows,
)
from underlay.app.state import Snapshot
from underlay.app.work import Tell
from underlay.data.contact_point import find_contact
from underlay.data.curve import Curve, recorded
from underlay.data.quality import check_quality
from underlay.data.segments import LOADING
from underlay.errors import InputError, UnderlayError, gathered_warnings
from underlay.inference.compare import laws_at_contact
from underlay.inference.file_facts import settle
from underlay.inference.films import fit_film
from underlay.inference.from_files import chosen_part, problem_from, read_for, read_whole
from underlay.inference.least_squares import fit as least_squares_fit
from underlay.inference.least_squares.fit_result import Fit
from underlay.inference.problem import Problem
from underlay.report import plots
from underlay.report.details import pointwise_of, write_film
from underlay.report.excel import excel_bytes
from underlay.report.labels import label
from underlay.report.limits import quality_doubts
from underlay.report.plots.fit import LAW_STROKES, canvas, force_ends
from underlay.report.plots.style import drawn
from underlay.report.render import report
from underlay.report.scene_tables import film_notes, film_table
from underlay.report.tables import curves_as_read, format_name, notes_of, reading_table
from underlay.scene.program import default_depth
from underlay.scene.scene_file import SceneFile, read_scene_file
from underlay.units import format_quantity, printed

_CONTACT = "instrument.contact_depth"
_Of = TypeVar("_Of", Film, Found, Sampled)


class Analyst(MapTasks):
    """The tasks on one analysis; the curve read last and the last fit are kept in memory.

    Every public method is a task. Its last argument is a function to send intermediate results to the page.

    Parameters
    ----------
    path : str
        Folder of the analysis.
    """

    def __init__(self, path: str) -> None:
        super().__init__(path)
        self._read: tuple[object, Curve] | None = None
        self._said: tuple[str, SceneFile] | None = None
        self._fit: tuple[str, Fit] | None = None

    def read(self, name: str, _tell: Tell) -> Reading:
        """Read a curve file with the options of the scene, and report on it."""
        path = self._folder.curve_file(name)
        try:
            with gathered_warnings() as told:
                curves = curves_as_read(path, self._stated())
        except UnderlayError as error:
            return Reading(name, refused=str(error))
        rows = reading_table(list(enumerate(curves, start=1)))
        return Reading(
            name,
            format_name(curves[0]),
            recorded(curves[0]),
            facts_of(curves[0]),
            printed_rows(rows),
            each_once(*notes_of(*curves), *told),
        )

    def curve(self, name: str, test: int, _tell: Tell) -> tuple[bytes, bytes]:
        """Draw a curve (test from 1) as PNG: force against indentation, and its segments against time."""
        whole = curves_as_read(self._folder.curve_file(name), self._stated())[test - 1]
        try:
            contact = find_contact(whole).depth
        except UnderlayError:
            # Without a contact readings are all there is to draw against.
            contact = 0.0
        force = plots.laws(whole, whole.select(whole.segments() == LOADING), {}, contact=contact)
        return drawn(force), drawn(plots.segments(whole))

    def scene(self, _tell: Tell) -> bytes:
        """Draw the test to scale as PNG, at the largest depth of the curve or at a default."""
        file = self._test()
        curve = self._readable(file)
        if curve is not None:
            if file.left_out:
                # The tip that the file of the curve says; a stand-in is never drawn.
                told = settle(file.draft, curve, left_out=file.left_out).values
                file = replace(file, draft=file.draft.with_values(told), left_out=())
            file = replace(file, draft=file.draft.with_values({_CONTACT: _first_contact(curve, file)}))
        return drawn(plots.scene(file.scene, depth=self._deepest(file), solver=file.solver))

    def look(
        self,
        contact: float | None,
        low: float | None,
        high: float | None,
        view: tuple[float, float] | None,
        _tell: Tell,
    ) -> Look:
        """Draw the curve with the models of scene and half-space at a contact point, by default the detected one.

        `contact`, `low` and `high` (contact point, fit range) and the ends of `view` are depth readings (m).
        """
        file = self._test()
        curve = self._curve(file)
        low = float(file.curve.get("min_depth", -np.inf)) if low is None else low
        high = float(file.curve.get("max_depth", np.inf)) if high is None else high
        quality, notes = "", list[str]()
        if contact is None:
            found = check_quality(curve, file.draft)
            quality, notes = found.verdict, list(found.reasons)
            contact = _first_contact(curve, file)
        extent = float(curve.depth.min()), float(curve.depth.max())
        ends = view or extent
        laws, said, used = self._laws(file, contact, low, high)
        up = force_ends(curve, *ends)
        return Look(
            canvas(plots.laws(curve, used, {}, contact=contact, view=ends), ends, up),
            contact,
            max(low, extent[0]),
            min(high, extent[1]),
            extent,
            laws,
            quality,
            each_once(*notes, *said),
            "contact_stiffness" in curve.columns,
        )

    def laws(self, contact: float, low: float, high: float, _tell: Tell) -> tuple[tuple[Law, ...], list[str]]:
        """Return the models of scene and half-space at a contact point, and warnings, while a handle is dragged.

        `contact`, `low` and `high` (contact point, fit range) are depth readings (m).
        """
        return self._laws(self._test(), contact, low, high)[:2]

    def _laws(
        self, file: SceneFile, contact: float, low: float, high: float
    ) -> tuple[tuple[Law, ...], list[str], Curve]:
        """Return the models of scene and half-space, their warnings, and the points they are fitted to."""
        curve = self._curve(file)
        try:
            with gathered_warnings() as told:
                held = laws_at_contact(file, curve, contact, low, high)
        except UnderlayError as error:
            used = chosen_part(curve, {**file.curve, "min_depth": low, "max_depth": high})
            return (), [str(error)], used
        laws = [
            Law(
                _said(name),
                printed(format_quantity(held.moduli[name], "pressure")),
                colour,
                "none" if stroke == "-" else "9 5",
                tuple(zip(*(readings.tolist() for readings in line), strict=True)),
            )
            for (name, line), (colour, stroke) in zip(held.lines.items(), LAW_STROKES, strict=False)
        ]
        refused = [f"{name}: {reason}" for name, reason in held.refused.items()]
        return tuple(laws), [*refused, *told], held.used

    def fit(self, tell: Tell) -> Found:
        """Fit the selected curve as the scene says; `tell` gets the numbers before the pictures are drawn."""
        tested = Snapshot.now(self._folder)
        with gathered_warnings():
            problem = self._problem(tested)
            quality_doubts(problem)
            result = least_squares_fit(problem)
        self._fit = (tested.of, result)
        return results.tell_found(self._folder, tested, result, tell)

    def before(self, kind: type[_Of], _tell: Tell) -> tuple[_Of | None, bool]:
        """Return the selected curve's stored result of this class, if any, and whether the scene is unchanged."""
        tested = Snapshot.now(self._folder)
        found = kept(self._folder, tested.stem, kind)
        return found, found is not None and found.of == tested.of

    def film(self, base: str, modulus: str, low: str, high: str, _tell: Tell) -> Film:
        """Fit the moduli of a film to the contact stiffness of the selected curve.

        Parameters
        ----------
        base : str
            File of a test on a sample of known modulus with the same tip; empty for a perfect tip.
        modulus : str
            E / (1 - nu^2) of that sample, with its unit.
        low, high : str
            Shallowest and deepest depth that are fitted, with units.

        Raises
        ------
        CurveError, InputError
            As `underlay film`.
        """
        folder, tested = self._folder, Snapshot.now(self._folder)
        curve = folder.curve_file(tested.curve_name)
        if base and not modulus.strip():
            raise InputError('the known sample needs its modulus, such as "165 GPa" for (001) silicon')
        calibration = folder.curve_file(base) if base else None
        found = fit_film(tested.file, curve, calibration, modulus or None, (low, high))
        write_film(found, folder.results, tested.stem)
        # Parameters are called by their names for people.
        rows = (
            film_table(found).assign(parameter=lambda table: table["parameter"].map(label)).to_dict("records")
        )
        table = tuple({str(key): str(value) for key, value in row.items()} for row in rows)
        notes = tuple(film_notes(found, perfect=not base))
        film = Film(tested.of, notes, table, f"{tested.stem}.film.png")
        keep(folder, tested.stem, film)
        return film

    def sample(self, most: int, tell: Tell) -> Sampled:
        """Sample the posterior of the selected curve, with at most `most` steps."""
        tested = Snapshot.now(self._folder)
        return results.sample_posterior(self._folder, tested, self._part(tested), most, tell)

    def taken(self, _tell: Tell) -> Taken:
        """Return scene and script for download: of the stored fit, or of the present scene where there is none."""
        now = Snapshot.now(self._folder)
        found = kept(self._folder, now.stem, Found)
        is_map_old = map_is_old(self._folder)
        if found is None:
            return Taken(now.text, results.script(now.curve_name, {}), is_map_old=is_map_old)
        script = results.script(now.curve_name, found.values)
        return Taken(found.scene, script, found.of != now.of, is_map_old)

    def archive(self, _tell: Tell) -> bytes:
        """Return the analysis as a ZIP archive of files that repeat it."""
        return results.analysis_archive(self._folder, *self._of_fit())

    def excel(self, _tell: Tell) -> bytes:
        """Return the Excel file of the fit."""
        result = self._fitted(self._of_fit()[1])
        return excel_bytes(result, *(found for found in pointwise_of(result) if not isinstance(found, str)))

    def report(self, _tell: Tell) -> bytes:
        """Return the report of the fit as HTML."""
        tested = self._of_fit()[1]
        page = report(self._fitted(tested), self._folder.results / f"{tested.stem}.report.html")
        return read_bytes(page, FILE)

    def _of_fit(self) -> tuple[Found, Snapshot]:
        """Return the stored fit of the selected curve, and the scene and curve that were fitted.

        Raises
        ------
        InputError
            If there is none, or the curve's file has changed since.
        """
        now = Snapshot.now(self._folder)
        found = kept(self._folder, now.stem, Found)
        if found is None:
            raise InputError("press Fit first: what is taken away is of a fit")
        tested = Snapshot.from_text(self._folder, found.scene)
        if tested.of != found.of:
            raise InputError(f"{now.curve_name} is not the file that was fitted: press Fit again")
        return found, tested

    def _fitted(self, tested: Snapshot) -> Fit:
        """Return the fit of a snapshot; it is fitted again unless it is the one in memory."""
        if self._fit is None or self._fit[0] != tested.of:
            self._fit = (tested.of, least_squares_fit(self._problem(tested)))
        return self._fit[1]

    def _problem(self, tested: Snapshot) -> Problem:
        # What is read again for a picture is read as it was fitted, not as the form says by then.
        scene = write_atomic(self._folder.result(f"{tested.stem}.scene.toml"), tested.text)
        return problem_from(tested.file, self._part(tested).with_metadata(scene_path=str(scene)))

    def _part(self, tested: Snapshot) -> Curve:
        """Return the part of the curve that is fitted, chosen as every command chooses it."""
        return read_for(tested.file, self._folder.curve_file(tested.curve_name))

    def _stated(self) -> dict[str, Any]:
        """Return the section ``[curve]`` of the scene file; empty while the scene is not valid."""
        if not self._folder.scene.exists():
            return {}
        try:
            return dict(self._test().curve)
        except UnderlayError:
            return {}

    def _test(self) -> SceneFile:
        """Return the scene file, interpreted again only if its text changed."""
        text = self._folder.scene_text()
        if self._said is None or self._said[0] != text:
            self._said = (text, read_scene_file(self._folder.scene))
        return self._said[1]

    def _curve(self, file: SceneFile) -> Curve:
        """Return the curve that the scene names; it is read again only if file or reading options changed."""
        if file.curve_path is None:
            raise InputError("bring a file first, and pick the curve to look at")
        path = self._folder.curve_file(file.curve_path.name)
        how = {key: value for key, value in file.curve.items() if not key.endswith("depth")}
        key = (str(path), sha256_of(path), repr(how))
        if self._read is None or self._read[0] != key:
            self._read = (key, read_whole(file, path))
        return self._read[1]

    def _readable(self, file: SceneFile) -> Curve | None:
        """Return the curve that the scene names; None where there is none, or it cannot be read."""
        if file.curve_path is None:
            return None
        try:
            return self._curve(file)
        except UnderlayError:
            return None

    def _deepest(self, file: SceneFile) -> float:
        """Return the depth reading (m) at which a test is drawn.

        It is the largest of the curve, else that of ``[simulate]``, else a default for the scene.
        """
        curve = self._readable(file)
        if curve is not None:
            return float(curve.depth.max())
        if file.simulate is not None:
            return file.simulate.max_depth
        return default_depth(file.scene) + file.draft.instrument.contact_depth


def _said(model: str) -> str:
    """Return the name for people of a contact model."""
    return "layer on substrate" if model == "layer and base" else model


def _first_contact(curve: Curve, file: SceneFile) -> float:
    """Return the contact point (depth reading, m) that the scene states, else the one detected on the curve."""
    if _CONTACT in file.stated:
        return file.draft.instrument.contact_depth
    try:
        return find_contact(curve, scene=file.draft).depth
    except UnderlayError:
        return float(np.median(curve.depth))
