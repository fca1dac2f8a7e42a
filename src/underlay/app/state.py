"""What the server keeps of an open analysis: its folder, the scene as it is written, and two processes."""

from __future__ import annotations

from pathlib import Path

from underlay._files import require_writable_folder
from underlay.app.folder import AnalysisFolder, stem_of
from underlay.app.form import Draft, preset
from underlay.app.security import Doorkeeper
from underlay.app.work import Worker
from underlay.errors import UnderlayError

__all__ = ["Home", "OpenAnalysis"]

_TASKS = "underlay.app.tasks:Analyst"
_BEGINNING = "cartilage_on_bone"


class OpenAnalysis:
    """One analysis that a browser looks at.

    Parameters
    ----------
    folder : AnalysisFolder
        Its files: all there is to it, beside what can be made again.

    Attributes
    ----------
    draft : Draft
        The scene file; `keep` writes it.
    quick, long : Worker
        Processes for what answers at once, and for what takes its time.
    """

    def __init__(self, folder: AnalysisFolder) -> None:
        self.folder = folder
        self.quick = Worker(_TASKS, str(folder.path))
        self.long = Worker(_TASKS, str(folder.path))
        self.window = 0
        try:
            self.draft = Draft.of(folder.scene_text())
        except UnderlayError:
            # Somebody edited it by hand; the file stays as it is until the form is used.
            self.draft = Draft({})
        if not self.draft.table("indenter"):
            self.draft = preset(_BEGINNING)

    def keep(self) -> None:
        """Write the scene file."""
        self.folder.write_scene(self.draft.text())

    @property
    def curve_name(self) -> str:
        """Name of the file that is looked at; empty where there is none."""
        name = Path(self.draft.get("curve", "file")).name
        return name if any(path.name == name for path in self.folder.curve_files()) else ""

    @property
    def stem(self) -> str:
        """Beginning of the names of the results of what is looked at; empty where nothing is."""
        return stem_of(self.curve_name, self.draft.get("curve", "test")) if self.curve_name else ""

    def pick(self, name: str, test: int = 1) -> None:
        """Look at a curve from now on."""
        curve = self.draft.table("curve")
        curve["file"] = f"curves/{self.folder.curve_file(name).name}"
        curve.pop("test", None)
        if test > 1:
            curve["test"] = test
        for end in ("min_depth", "max_depth"):
            curve.pop(end, None)
        self.draft.table("instrument").pop("contact_depth", None)
        self.keep()

    def open_window(self) -> int:
        """Number of the window that holds the analysis from now on; one before it has lost it."""
        self.window += 1
        return self.window

    def close(self) -> None:
        """End the processes."""
        self.quick.close()
        self.long.close()


class Home:
    """What one server keeps.

    Parameters
    ----------
    path : Path
        Folder of the analyses.
    keeper : Doorkeeper
        Who is let in.
    address : str
        Of the page, without a token.
    """

    def __init__(self, path: Path, keeper: Doorkeeper, address: str) -> None:
        self.path, self.keeper, self.address = require_writable_folder(path), keeper, address
        self._open: dict[str, OpenAnalysis] = {}

    def analysis(self, name: str) -> OpenAnalysis:
        """Return the analysis of that name, read from its folder when it is first asked for."""
        if name not in self._open:
            self._open[name] = OpenAnalysis(AnalysisFolder(self.path / name))
        return self._open[name]

    def new_address(self) -> str:
        """Address that opens the page once, for another browser."""
        return f"{self.address}/?token={self.keeper.new_token()}"

    def close(self) -> None:
        """End every process."""
        for analysis in self._open.values():
            analysis.close()
