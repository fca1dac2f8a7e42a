"""A scene that was written by hand on the page: taken only if all of it is one, and of a curve of this analysis."""

from __future__ import annotations

from collections.abc import Collection
from pathlib import PurePath

from underlay._text import one_line
from underlay.app.form import Draft
from underlay.errors import InputError
from underlay.scene.scene_file import scene_file_from_text

__all__ = ["draft_from"]


def draft_from(text: str, files: Collection[str]) -> Draft:
    """Return the scene of a text.

    Parameters
    ----------
    text : str
        Of a scene file.
    files : collection of str
        Names of the curves of the analysis; the scene may look at no other file.

    Raises
    ------
    FileFormatError
        If it is not TOML.
    InputError
        If a section, key, unit or value is not allowed, or the curve is none of this analysis.
    """
    named = scene_file_from_text(text).curve.get("file")
    draft = Draft.of(text)
    if named is not None:
        name = PurePath(named).name
        if name not in files:
            raise InputError(f"[curve] file must be one of the files of step 1; got {one_line(named, 80)!r}")
        draft.table("curve")["file"] = f"curves/{name}"
    return draft
