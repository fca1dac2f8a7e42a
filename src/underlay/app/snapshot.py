"""The test at one moment: what a task began with is what its results are of, whatever the form says since."""

from __future__ import annotations

import hashlib
import json
from dataclasses import dataclass, replace

from underlay._documents import parse_toml
from underlay._door import sha256_of
from underlay.app.folder import AnalysisFolder, stem_of
from underlay.errors import InputError
from underlay.scene.scene_file import SceneFile, scene_file_from_text

__all__ = ["Snapshot", "said"]


_NOTHING = "bring a file first, and pick the curve to look at"


@dataclass(frozen=True)
class Snapshot:
    """A scene and the curve that it looks at, as they were when this was made.

    Parameters
    ----------
    file : SceneFile
        All that the scene says; its curve stands in the analysis.
    text : str
        Of the scene file.
    of : str
        Fingerprint of what the text says, in whatever order, and of the curve.
    """

    file: SceneFile
    text: str
    of: str

    @classmethod
    def now(cls, folder: AnalysisFolder) -> Snapshot:
        """The test as the form and the files say it now; the scene file is read once."""
        text = folder.scene_text()
        if not text:
            raise InputError(_NOTHING)
        return cls.from_text(folder, text)

    @classmethod
    def from_text(cls, folder: AnalysisFolder, text: str) -> Snapshot:
        """The test of a text, with the curve of the analysis as it is now.

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
        """Beginning of the names of its results."""
        return stem_of("" if self.file.curve_path is None else self.curve_name, self.file.curve.get("test"))

    @property
    def curve_name(self) -> str:
        """Name of the file that is looked at.

        Raises
        ------
        InputError
            If there is none.
        """
        if self.file.curve_path is None:
            raise InputError(_NOTHING)
        return self.file.curve_path.name


def said(text: str) -> str:
    """What the text of a scene file says: the same for the same keys in another order, or with other comments."""
    try:
        return json.dumps(parse_toml(text), sort_keys=True, default=str)
    except ValueError:
        return text  # no TOML: it says what it is
