"""What is done in a process beside the page: reading, drawing, fitting. Each is a call of the library.

Results are plain values, so that they travel through a pipe: texts, numbers, and the bytes of pictures.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from underlay._door import sha256_of
from underlay.app.folder import AnalysisFolder
from underlay.app.results import Found, fingerprint, found_before, stem_of, tell_found
from underlay.app.work import Tell
from underlay.cli.console import gathered_warnings
from underlay.cli.wording import spoken
from underlay.data.contact_point import find_contact
from underlay.data.curve import Curve
from underlay.data.quality import check_quality
from underlay.data.readers import read_all
from underlay.data.recorded import recorded
from underlay.data.signs import flipped
from underlay.errors import InputError, UnderlayError
from underlay.inference.from_files import chosen_part, problem_from, read_whole
from underlay.inference.held_contact import laws_at_contact
from underlay.inference.least_squares import Fit
from underlay.inference.least_squares import fit as least_squares_fit
from underlay.report import plots
from underlay.report.plots.laws import Canvas, canvas
from underlay.report.plots.style import drawn, unit_for
from underlay.report.reading import format_name, reading_table
from underlay.scene.scene_file import SceneFile, read_scene_file
from underlay.units import format_quantity

__all__ = ["Analyst", "Look", "Reading"]

_READING = ("format", "columns", "calibration")
_CONTACT = "instrument.contact_depth"


@dataclass(frozen=True)
class Reading:
    """How a file was read.

    Parameters
    ----------
    file : str
        Its name.
    format, instrument, vendor : str
        In words; empty where the file says nothing.
    tests : tuple of dict of str to str
        A row per test.
    notes : tuple of str
        What is wrong, or worth knowing.
    refused : str
        Why it could not be read; empty where it could.
    """

    file: str
    format: str = ""
    instrument: str = ""
    vendor: str = ""
    tests: tuple[dict[str, str], ...] = ()
    notes: tuple[str, ...] = ()
    refused: str = ""


@dataclass(frozen=True)
class Look:
    """A curve before its fit.

    Parameters
    ----------
    picture : Canvas
        Of the curve and both laws.
    contact, low, high : float
        Depth readings (m) of the contact and of the ends of what is used.
    moduli : mapping of str to str
        Layer modulus by law, in words.
    quality : str
        Verdict on the curve.
    notes : tuple of str
        What speaks against it, and what a law refused.
    """

    picture: Canvas
    contact: float
    low: float
    high: float
    moduli: dict[str, str] = field(default_factory=dict)
    quality: str = ""
    notes: tuple[str, ...] = ()


class Analyst:
    """The tasks on one analysis; what was read last is remembered.

    Parameters
    ----------
    path : str
        Folder of the analysis.
    """

    def __init__(self, path: str) -> None:
        self._folder = AnalysisFolder(Path(path))
        self._read: tuple[object, Curve] | None = None
        self._fit: tuple[str, Fit] | None = None

    def ready(self, _tell: Tell) -> bool:
        """Say that the process is there, with what it needs loaded."""
        return True

    def read(self, name: str, _tell: Tell) -> Reading:
        """Read a file as the scene says, and say how."""
        path = self._folder.curve_file(name)
        stated = self._stated()
        options = {key: stated[key] for key in _READING if key in stated}
        try:
            with gathered_warnings() as told:
                curves = [flipped(curve, stated.get("flip") or ()) for curve in read_all(path, **options)]
        except UnderlayError as error:
            return Reading(name, refused=spoken(str(error)))
        rows = reading_table(list(enumerate(curves, start=1)))
        notes = [str(note) for curve in curves for note in curve.metadata.get("notes", ())]
        return Reading(
            name,
            format_name(curves[0]),
            recorded(curves[0]),
            _vendor(curves[0]),
            tuple({str(key): str(value) for key, value in row.items()} for row in rows.to_dict("records")),
            _spoken(*notes, *told),
        )

    def segments(self, name: str, test: int, _tell: Tell) -> bytes:
        """Draw the segments of a curve of a file."""
        stated = self._stated()
        options = {key: stated[key] for key in _READING if key in stated}
        curve = read_all(self._folder.curve_file(name), **options)[test - 1]
        return drawn(plots.segments(flipped(curve, stated.get("flip") or ())))

    def scene(self, _tell: Tell) -> bytes:
        """Draw the test to scale, at the depth of the curve or of a default."""
        file = read_scene_file(self._folder.scene)
        return drawn(plots.scene(file.draft, depth=self._deepest(file), solver=file.solver))

    def look(self, contact: float | None, low: float | None, high: float | None, _tell: Tell) -> Look:
        """Draw the curve with both laws at a contact point; where none is given, at the one that is found."""
        file = read_scene_file(self._folder.scene)
        curve = self._curve(file)
        low = float(file.curve.get("min_depth", -np.inf)) if low is None else low
        high = float(file.curve.get("max_depth", np.inf)) if high is None else high
        quality, notes = "", []
        if contact is None:
            quality, notes = _quality(curve, file)
            contact = _first_contact(curve, file)
        unit = unit_for(curve.depth, "length")[1]
        ends = max(low, float(curve.depth.min())), min(high, float(curve.depth.max()))
        try:
            with gathered_warnings() as told:
                held = laws_at_contact(file, curve, contact, low, high)
        except UnderlayError as error:
            used = chosen_part(curve, {**file.curve, "min_depth": low, "max_depth": high})
            bare = canvas(plots.laws(curve, used, {}), unit)
            return Look(bare, contact, *ends, quality=quality, notes=_spoken(*notes, str(error)))
        moduli = {name: format_quantity(value, "pressure") for name, value in held.moduli.items()}
        refused = [f"{name}: {reason}" for name, reason in held.refused.items()]
        lines = {f"{name}, {moduli[name]}": line for name, line in held.lines.items()}
        picture = canvas(plots.laws(curve, held.used, lines), unit)
        return Look(picture, contact, *ends, moduli, quality, _spoken(*notes, *refused, *told))

    def fit(self, tell: Tell) -> Found:
        """Fit the curve as the scene says; what is there already is told on the way."""
        file = read_scene_file(self._folder.scene)
        curve = chosen_part(self._curve(file), file.curve).with_metadata(scene_path=str(file.path))
        with gathered_warnings() as notes:
            problem = problem_from(file, curve)
            result = least_squares_fit(problem)
        self._fit = (fingerprint(file), result)
        return tell_found(self._folder, file, problem, result, notes, tell)

    def found(self, _tell: Tell) -> tuple[Found | None, bool]:
        """What was found on this curve before, and whether the scene is still the same."""
        file = read_scene_file(self._folder.scene)
        before = found_before(self._folder, stem_of(file))
        return before, before is not None and before.of == fingerprint(file)

    def _stated(self) -> dict[str, Any]:
        """What the scene says of how files are read; nothing while it is not complete."""
        if not self._folder.scene.exists():
            return {}
        try:
            return dict(read_scene_file(self._folder.scene).curve)
        except UnderlayError:
            return {}

    def _curve(self, file: SceneFile) -> Curve:
        """The curve that the scene names, read again only if the file or the way of reading changed."""
        if file.curve_path is None:
            raise InputError("bring a file first, and pick the curve to look at")
        path = self._folder.curve_file(file.curve_path.name)
        how = {key: value for key, value in file.curve.items() if not key.endswith("depth")}
        key = (str(path), sha256_of(path), repr(how))
        if self._read is None or self._read[0] != key:
            self._read = (key, read_whole(file, path))
        return self._read[1]

    def _deepest(self, file: SceneFile) -> float:
        from underlay.cli.expected import deepest_point  # noqa: PLC0415  it prints, where there is a terminal

        if file.curve_path is not None:
            try:
                return float(self._curve(file).depth.max())
            except UnderlayError:
                pass
        return deepest_point(file, None) + file.draft.instrument.contact_depth


def _spoken(*messages: str) -> tuple[str, ...]:
    """Each message once, in the words of the page."""
    return tuple(dict.fromkeys(map(spoken, messages)))


def _quality(curve: Curve, file: SceneFile) -> tuple[str, list[str]]:
    quality = check_quality(curve, file.draft)
    return quality.verdict, list(quality.reasons)


def _first_contact(curve: Curve, file: SceneFile) -> float:
    """The contact of the scene where it says one, else what is found on the curve."""
    if _CONTACT in file.stated:
        return file.draft.instrument.contact_depth
    try:
        return find_contact(curve, scene=file.draft).depth
    except UnderlayError:
        return float(np.median(curve.depth))


def _vendor(curve: Curve) -> str:
    """What the instrument itself found, in words."""
    reduced = curve.metadata.get("instrument_reduced_modulus")
    if not isinstance(reduced, int | float) or isinstance(reduced, bool) or not np.isfinite(reduced):
        return ""
    return f"{format_quantity(float(reduced), 'pressure')} (reduced modulus)"
