"""State of the page's server: the open analyses, each with its folder, its scene and two worker processes.

A task works on a `Snapshot`, scene and curve at one moment: its results belong to these, even if the form is
changed meanwhile.
"""

from __future__ import annotations

import hashlib
import json
import time
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from underlay._door import FileKind, parse_toml, read_bytes, read_text, sha256_of
from underlay._files import require_writable_folder
from underlay.app.folder import AnalysisFolder, stem_of, take_manifest
from underlay.app.form import CHANGES, SAMPLES, Draft, empty, in_the_form
from underlay.app.security import Doorkeeper
from underlay.app.work import Worker
from underlay.data.samples import sample, samples
from underlay.errors import InputError, UnderlayError
from underlay.report.labels import label
from underlay.scene.scene_file import SceneFile, scene_file_from_text
from underlay.scene.uncertainties import leaves

_NOTHING = "bring a file first, and pick the curve to look at"
# Changes that are remembered; seconds within which changes of one number are one.
_MOST_UNDONE, _AT_ONCE = 50, 2.0
_TASKS = "underlay.app.tasks:Analyst"
_KIND = FileKind("a sample", 5_000_000, "install underlay again")
# What is of one curve only: keys of its scene, and the contact point among what is fitted.
_HANDLES = (("curve", "min_depth"), ("curve", "max_depth"), ("instrument", "contact_depth"))
_CONTACT, _BOUNDS = "instrument.contact_depth", "bounds of the contact point"


@dataclass(frozen=True)
class Snapshot:
    """A scene and its selected curve at one moment.

    Parameters
    ----------
    file : SceneFile
        The scene file, with its curve in the folder of the analysis.
    text : str
        Its text.
    of : str
        Fingerprint (SHA-256) of curve and scene, independent of comments and the order of keys.
    """

    file: SceneFile
    text: str
    of: str

    @classmethod
    def now(cls, folder: AnalysisFolder) -> Snapshot:
        """Return the present scene and curve of an analysis."""
        text = folder.scene_text()
        if not text:
            raise InputError(_NOTHING)
        return cls.from_text(folder, text)

    @classmethod
    def from_text(cls, folder: AnalysisFolder, text: str) -> Snapshot:
        """Return the scene of a text, with its curve as it is in the analysis now.

        Raises
        ------
        FileFormatError, InputError
            If the text is not that of a scene file.
        FileAccessError
            If its curve is gone.
        """
        file = replace(scene_file_from_text(text), path=folder.scene)
        scene = hashlib.sha256(said(text).encode()).hexdigest()
        curve = "" if file.curve_path is None else sha256_of(file.curve_path)
        return cls(file, text, hashlib.sha256(f"{scene}{curve}".encode()).hexdigest())

    @property
    def stem(self) -> str:
        """Beginning of the names of its result files."""
        return stem_of("" if self.file.curve_path is None else self.curve_name, self.file.curve.get("test"))

    @property
    def curve_name(self) -> str:
        """File name of the selected curve.

        Raises
        ------
        InputError
            If there is none.
        """
        if self.file.curve_path is None:
            raise InputError(_NOTHING)
        return self.file.curve_path.name


def said(text: str) -> str:
    """Return the content of a scene file in a normal form: without comments, keys sorted; for comparison."""
    try:
        return json.dumps(parse_toml(text), sort_keys=True, default=str)
    except ValueError:
        return text  # no TOML: it says what it is


def changed(before: str, after: str) -> str:
    """Name what differs between two texts of a scene file; ``"the test"`` for several changes, empty for none.

    Examples
    --------
    >>> changed('layer.thickness = "1 mm"', 'layer.thickness = "2 mm"')
    'layer thickness'
    """
    first, second = (dict(leaves(parse_toml(text))) for text in (before, after))
    paths = [path for path in {**first, **second} if first.get(path) != second.get(path)]
    # What was entered is no assumption any more: that is the same change.
    paths = [path for path in paths if path != "assumed"] or paths
    words = {
        next((said for begin, said in CHANGES.items() if path.startswith(begin)), label(path))
        for path in paths
    }
    return "the test" if len(words) > 1 else "".join(words)


class OpenAnalysis:
    """One analysis that is open in a browser.

    Parameters
    ----------
    folder : AnalysisFolder
        Its files, which hold all of its state that cannot be computed again.

    Attributes
    ----------
    draft : Draft
        The scene file as edited; `keep` writes it.
    quick, long : Worker
        Processes for tasks that answer at once, and for those that take long.
    """

    def __init__(self, folder: AnalysisFolder) -> None:
        self.folder = folder
        self.quick = Worker(_TASKS, str(folder.path))
        self.long = Worker(_TASKS, str(folder.path))
        self.window = 0
        self._handles: dict[str, dict[str, Any]] = {}
        self._past: list[tuple[str, str]] = []
        self._future: list[tuple[str, str]] = []
        self._changed = 0.0
        try:
            self.draft = Draft.of(folder.scene_text())
        except UnderlayError:
            # Somebody edited it by hand; the file stays as it is until the form is used.
            self.draft = Draft({})
        if not self.draft.table("indenter"):
            self.draft = empty()

    def keep(self, *, by_hand: bool = True) -> None:
        """Write the scene file; a change `by_hand` can be undone."""
        before, text = self.folder.scene_text(), self.draft.text()
        what = changed(before, text) if before and by_hand else ""
        if what:
            now = time.monotonic()
            # A handle that is dragged, a number that is typed: one change.
            if not (self._past and self._past[-1][0] == what and now - self._changed < _AT_ONCE):
                self._past = [*self._past[1 - _MOST_UNDONE :], (what, before)]
            self._changed, self._future = now, []
        self.folder.write_scene(text)

    def step(self, *, back: bool) -> None:
        """Undo the last change of the scene (`back`), or redo the one undone last."""
        source, target = (self._past, self._future) if back else (self._future, self._past)
        what, text = source.pop()
        target.append((what, self.folder.scene_text()))
        self.draft = Draft.of(text)
        self.folder.write_scene(text)

    @property
    def undone(self) -> tuple[str, str]:
        """Names of the changes that undo and redo would make; empty for none."""
        last = [steps[-1][0] if steps else "" for steps in (self._past, self._future)]
        return last[0], last[1]

    @property
    def lacks(self) -> str:
        """What the scene still needs, or what is wrong with it, as a sentence; empty where it is valid."""
        try:
            scene_file_from_text(self.draft.text())
        except UnderlayError as error:
            return in_the_form(str(error))
        return ""

    @property
    def curve_name(self) -> str:
        """File name of the selected curve; empty where there is none."""
        name = Path(self.draft.get("curve", "file")).name
        return name if any(path.name == name for path in self.folder.curve_files()) else ""

    @property
    def stem(self) -> str:
        """Beginning of the names of the selected curve's result files; empty where no curve is selected."""
        return stem_of(self.curve_name, self.draft.get("curve", "test")) if self.curve_name else ""

    def pick(self, name: str, test: int = 1) -> None:
        """Select a curve (test from 1), and restore its own depth range and contact point, if it has any."""
        path = self.folder.curve_file(name)
        before, curve = self.stem, self.draft.table("curve")
        curve["file"] = f"curves/{path.name}"
        curve.pop("test", None)
        if test > 1:
            curve["test"] = test
        if self.stem != before:
            taken = self._take_handles()
            if before:
                self._handles[before] = taken
            self._put_handles(self._handles.get(self.stem, {_BOUNDS: {}}))
        self.keep(by_hand=False)

    def remove(self, name: str) -> None:
        """Delete a curve file with its depth range and contact point; if it was selected, select another."""
        looked_at = self.curve_name == name
        self.folder.remove_curve(name)
        # Every test of the file goes with it: the stem of the first is its name, of others that and a number.
        self._handles = {stem: said for stem, said in self._handles.items() if stem.split("~")[0] != name}
        if not looked_at:
            return
        self._take_handles()
        for key in ("file", "test"):
            self.draft.table("curve").pop(key, None)
        left = self.folder.curve_files()
        if left:
            self.pick(left[0].name)
        else:
            self.keep(by_hand=False)

    def _take_handles(self) -> dict[str, Any]:
        """Remove depth range and contact point, which belong to one curve, from the scene and return them."""
        handles = {}
        for section, key in _HANDLES:
            if key in self.draft.peek(section):
                handles[f"{section}.{key}"] = self.draft.table(section).pop(key)
        handles[_BOUNDS] = self.draft.free.pop(_CONTACT, None)
        return handles

    def _put_handles(self, handles: dict[str, Any]) -> None:
        for section, key in _HANDLES:
            if f"{section}.{key}" in handles:
                self.draft.table(section)[key] = handles[f"{section}.{key}"]
        if handles.get(_BOUNDS) is not None:
            # Without bounds until the curve is seen, which has them: see step 3.
            self.draft.free[_CONTACT] = handles[_BOUNDS]

    def open_window(self) -> int:
        """Return the number of a newly opened window, which replaces any earlier window on the analysis."""
        self.window += 1
        return self.window

    def close(self) -> None:
        """End the worker processes."""
        self.quick.close()
        self.long.close()


class Home:
    """State of one server: its analyses and its access control.

    Parameters
    ----------
    path : Path
        Folder of the analyses.
    keeper : Doorkeeper
        Tokens and cookies of those admitted.
    address : str
        Address of the page, without a token.
    """

    def __init__(self, path: Path, keeper: Doorkeeper, address: str) -> None:
        self.path, self.keeper, self.address = require_writable_folder(path), keeper, address
        self._open: dict[str, OpenAnalysis] = {}

    def analysis(self, name: str) -> OpenAnalysis:
        """Return the analysis of that name; it is read from its folder when first asked for."""
        if name not in self._open:
            self._open[name] = OpenAnalysis(AnalysisFolder(self.path / name))
        return self._open[name]

    def new_address(self) -> str:
        """Return an address with a new one-time token, for another browser."""
        return f"{self.address}/?token={self.keeper.new_token()}"

    def close(self) -> None:
        """End all worker processes."""
        for analysis in self._open.values():
            analysis.close()


def with_sample(folder: AnalysisFolder, scene: str) -> None:
    """Copy the curves, scene and manifest of an example (key of `SAMPLES`) into an analysis."""
    paths = samples(*SAMPLES[scene][2:])
    brought = [folder.add_curve(path.name, read_bytes(path, _KIND)).name for path in paths]
    draft = Draft.of(read_text(sample(scene), _KIND))
    draft.table("curve")["file"] = f"curves/{brought[0]}"
    folder.write_scene(draft.text())
    # The sample of a map says whose each curve is.
    manifest = sample(scene).with_name("manifest.csv")
    if manifest.exists():
        take_manifest(folder, read_bytes(manifest, _KIND))
