"""What was found on one curve, as the page shows it: words, tables, pictures; kept as plain files."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Iterator
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from underlay._csv_text import csv_text
from underlay._documents import parse_json
from underlay._door import FileKind, read_text, sha256_of, understood
from underlay._files import write_atomic
from underlay.app.folder import AnalysisFolder
from underlay.app.work import Tell
from underlay.cli.fit import quality_doubts, reservations, write_fit
from underlay.cli.wording import spoken
from underlay.errors import UnderlayError
from underlay.inference.least_squares import Fit
from underlay.inference.problem import Problem
from underlay.report import plots
from underlay.report.model_limits import model_limits
from underlay.report.open_ends import advice, rivals
from underlay.report.tables import interval_table
from underlay.report.words import headline, stands_on, verdict_sentence
from underlay.scene.effects import effects_table
from underlay.scene.scene_file import SceneFile

__all__ = ["Found", "fingerprint", "found_before", "stem_of", "tell_found"]

_KIND = FileKind("a result of the page", 5_000_000, "press Fit again")


@dataclass(frozen=True)
class Found:
    """What is shown of a fit.

    Parameters
    ----------
    stem : str
        Beginning of the names of its files.
    of : str
        Fingerprint of the curve and scene that were fitted.
    headline, verdict : str
        In words.
    more : tuple of str
        Other optima, what it stands on, what the law leaves out, the second test that would tell.
    doubts : tuple of str
        Warnings of the reader, the fit and the laws.
    table : tuple of dict of str to str
        A row per fitted number.
    effects : tuple of dict of str to str
        A row per effect.
    values : mapping of str to str
        Every fitted number (SI) to its last bit.
    pictures : tuple of str
        Names of the files.
    """

    stem: str
    of: str
    headline: str = ""
    verdict: str = ""
    more: tuple[str, ...] = ()
    doubts: tuple[str, ...] = ()
    table: tuple[dict[str, str], ...] = ()
    effects: tuple[dict[str, str], ...] = ()
    values: dict[str, str] = field(default_factory=dict)
    pictures: tuple[str, ...] = ()


def stem_of(file: SceneFile) -> str:
    """Beginning of the names of the results of the curve that a scene looks at."""
    path, test = file.curve_path, file.curve.get("test")
    name = "curve" if path is None else path.stem
    return name if test is None else f"{name}-{test}"


def fingerprint(file: SceneFile) -> str:
    """SHA-256 of the scene file and the curve it looks at: a result is of this pair."""
    curve = "" if file.curve_path is None else sha256_of(file.curve_path)
    return hashlib.sha256(f"{sha256_of(file.path)}{curve}".encode()).hexdigest()


def tell_found(
    folder: AnalysisFolder, file: SceneFile, problem: Problem, result: Fit, notes: list[str], tell: Tell
) -> Found:
    """Put a fit into words, tables and pictures; tell what is there already, keep it at the end."""
    stem = stem_of(file)
    parts: dict[str, Any] = {"stem": stem, "of": fingerprint(file)}
    for more in _parts(folder, file, problem, result, notes):
        parts |= more
        tell(Found(**parts))
    found = Found(**parts)
    write_atomic(folder.result(f"{stem}.shown.json"), json.dumps(asdict(found), indent=1))
    return found


def _parts(
    folder: AnalysisFolder, file: SceneFile, problem: Problem, result: Fit, notes: list[str]
) -> Iterator[dict[str, Any]]:
    """The parts of `Found`, quickest first."""
    yield {
        "headline": spoken(headline(result)),
        "verdict": spoken(verdict_sentence(result)),
        "values": {name: repr(float(value)) for name, value in result.values.items()},
        "table": _rows(interval_table(result).rename_axis("parameter").reset_index()),
    }
    doubts = [*quality_doubts(problem), *reservations(result, notes)]
    yield {"doubts": tuple(dict.fromkeys(map(spoken, doubts)))}
    written = write_fit(result, folder.results, stem_of(file))
    yield {"pictures": tuple(path.name for path in written if path.suffix == ".png")}
    told = [*rivals(result), stands_on(result), *model_limits(result), *advice(result)]
    yield {"more": tuple(spoken(sentence) for sentence in told if sentence)}
    try:
        scene = result.scenes[0]
        deepest = float(np.max(result.curves[0].depth)) - scene.instrument.contact_depth
        effects = effects_table(scene, deepest, result.solver)
        write_atomic(folder.result(f"{stem_of(file)}.effects.csv"), csv_text(effects))
        plots.save(
            plots.effects(scene, deepest, result.solver), folder.result(f"{stem_of(file)}.effects.png")
        )
    except UnderlayError:
        # A scene that the ledger has no rows for: the fit stands without it.
        return
    yield {"effects": _rows(effects)}


def found_before(folder: AnalysisFolder, stem: str) -> Found | None:
    """Return what was found before; None where nothing was, or the file is not what was written."""
    path = folder.result(f"{stem}.shown.json")
    if not path.is_file():
        return None
    try:
        with understood(path, _KIND):
            return Found(**parse_json(read_text(path, _KIND)))
    except UnderlayError:
        return None


def _rows(frame: Any) -> tuple[dict[str, str], ...]:
    return tuple({str(key): _cell(value) for key, value in row.items()} for row in frame.to_dict("records"))


def _cell(value: object) -> str:
    if isinstance(value, bool | np.bool_):
        return "yes" if value else "no"
    if isinstance(value, float):
        return "" if np.isnan(value) else f"{value:.4g}"
    return str(value)


def pictures_of(folder: AnalysisFolder, stem: str) -> list[Path]:
    """Every picture of a result."""
    return sorted(folder.results.glob(f"{stem}.*.png"))
