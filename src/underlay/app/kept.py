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

__all__ = ["SHOWN", "keep", "kept"]

#: How the names of these files end; what is taken away leaves them out.
SHOWN = ".shown.json"

_KIND = FileKind("a result of the page", 5_000_000, "press the button again that made it")
_Shown = TypeVar("_Shown")


def keep(folder: AnalysisFolder, stem: str, shown: Any) -> None:
    """Write what is shown, a dataclass of plain values, among the results of a curve or of all."""
    write_atomic(folder.result(_name(stem, type(shown))), json.dumps(asdict(shown), indent=1))


def kept(folder: AnalysisFolder, stem: str, kind: type[_Shown]) -> _Shown | None:
    """Read what was shown; None where nothing was, or the file is not what was written."""
    path = folder.result(_name(stem, kind))
    if not path.is_file():
        return None
    try:
        with understood(path, _KIND):
            return kind(**parse_json(read_text(path, _KIND)))
    except UnderlayError:
        return None


def _name(stem: str, kind: type[object]) -> str:
    return f"{stem}.{kind.__name__.lower()}{SHOWN}"
