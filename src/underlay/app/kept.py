"""What was found, kept as plain files, so that a reopened analysis shows it again."""

from __future__ import annotations

import json
from dataclasses import asdict
from typing import Any, TypeVar

from underlay._documents import parse_json
from underlay._door import FileKind, read_text, understood
from underlay._files import write_atomic
from underlay.app.folder import AnalysisFolder
from underlay.errors import UnderlayError

__all__ = ["keep", "kept"]

_KIND = FileKind("a result of the page", 5_000_000, "press the button again that made it")
_Shown = TypeVar("_Shown")


def keep(folder: AnalysisFolder, name: str, shown: Any) -> None:
    """Write what is shown, a dataclass of plain values, among the results."""
    write_atomic(folder.result(name), json.dumps(asdict(shown), indent=1))


def kept(folder: AnalysisFolder, name: str, kind: type[_Shown]) -> _Shown | None:
    """Read what was shown; None where nothing was, or the file is not what was written."""
    path = folder.result(name)
    if not path.is_file():
        return None
    try:
        with understood(path, _KIND):
            return kind(**parse_json(read_text(path, _KIND)))
    except UnderlayError:
        return None
