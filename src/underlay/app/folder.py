"""An analysis of the browser page: a folder of plain files, which the command line reads as they are.

::

    scene.toml       the test, what is fitted, and the selected curve: for `underlay fit --scene`
    curves/          the files that the user uploaded, unchanged
    decisions.csv    curves that were accepted or refused by hand, with reasons
    results/         results, so that a reopened analysis shows them again

Every file is written whole or not at all. Names of files are made here: no text from the browser is used as a path.
"""

from __future__ import annotations

import json
import re
import time
from collections.abc import Collection, Mapping
from dataclasses import asdict
from pathlib import Path
from typing import Any, TypeVar

import pandas as pd

from underlay._csv import csv_text, numbered_rows
from underlay._door import FileKind, parse_json, read_bytes, read_text, understood
from underlay._files import require_own_folder, write_atomic
from underlay._text import one_line, unguarded_cell
from underlay.errors import InputError, UnderlayError

#: Bounds of what may be brought: bytes of one file, files of one analysis, bytes of all of them.
LARGEST_FILE, MOST_FILES, _MOST_BYTES = 200_000_000, 5_000, 4_000_000_000
#: The files of a curve's results by what made them: what stands in their names behind the curve's.
RESULTS: Mapping[str, tuple[str, ...]] = {
    "found": ("fit", "depth", "time", "drainage", "relaxation", "adhesion", "segments"),
    "sampled": ("corner", "predictive", "posterior"),
    "film": ("film", "film.depths"),
}
_TEXT = FileKind("a file of an analysis", 5_000_000, "start a new analysis")
#: Any file of an analysis.
FILE = FileKind("a file of an analysis", _MOST_BYTES, "start a new analysis")
_NAME = re.compile(r"[a-z0-9][a-z0-9-]{0,60}")
# A name of a file may not lead anywhere, hide itself, or mean something to a shell or a spreadsheet.
_ODD = re.compile(r"[^\w.()+,= -]|^[.=+\s-]+")
# Bytes of a curve's name and of its ending: with what results add, a system takes it.
_LONGEST, _LONGEST_ENDING = 120, 40
#: How the names of these files end; what is taken away leaves them out.
_SHOWN = ".shown.json"
_KIND = FileKind("a result of the page", 5_000_000, "press the button again that made it")
_Shown = TypeVar("_Shown")


class AnalysisFolder:
    """The files of one analysis.

    Parameters
    ----------
    path : Path
        The folder, made if absent.

    Raises
    ------
    FileAccessError
        If it cannot be written.
    """

    def __init__(self, path: Path) -> None:
        self.path = require_own_folder(path)
        self.curves = require_own_folder(path / "curves")
        self.results = require_own_folder(path / "results")

    @property
    def name(self) -> str:
        """Name of the folder, which is also part of the analysis' address in the browser."""
        return self.path.name

    @property
    def scene(self) -> Path:
        """Path of the scene file."""
        return self.path / "scene.toml"

    @property
    def decisions(self) -> Path:
        """Path of the CSV with the curves accepted and refused by hand."""
        return self.path / "decisions.csv"

    def curve_files(self) -> list[Path]:
        """Return the paths of all uploaded files, sorted."""
        return sorted(path for path in self.curves.iterdir() if path.is_file() and path.name[0] != ".")

    def curve_file(self, name: str) -> Path:
        """Return the path of the uploaded file of that name.

        Raises
        ------
        InputError
            If there is none.
        """
        for path in self.curve_files():
            if path.name == name:
                return path
        raise InputError(f"there is no curve {one_line(name, 80)!r} in this analysis")

    def add_curve(self, name: str, content: bytes) -> Path:
        """Store an uploaded file, under its own name where that is free and safe; return its path.

        A file with the same content is not stored twice.

        Raises
        ------
        InputError
            If it is empty or too large, or the analysis holds too many.
        """
        there = self.curve_files()
        if not content:
            raise InputError(f"{one_line(name, 80)} is empty")
        held = sum(path.stat().st_size for path in there)
        if len(content) > LARGEST_FILE or held + len(content) > _MOST_BYTES or len(there) >= MOST_FILES:
            raise InputError(
                f"{one_line(name, 80)}: an analysis takes up to {MOST_FILES} files of {LARGEST_FILE // 10**6} MB, "
                f"{_MOST_BYTES // 10**9} GB in all"
            )
        target = self.curves / safe_name(name)
        number = 2
        while target.exists():
            if read_bytes(target, FILE) == content:
                return target
            target = self.curves / f"{Path(safe_name(name)).stem}-{number}{Path(safe_name(name)).suffix}"
            number += 1
        return write_atomic(target, content)

    def remove_curve(self, name: str) -> None:
        """Delete an uploaded file."""
        self.curve_file(name).unlink()

    def scene_text(self) -> str:
        """Return the text of the scene file; empty where there is none."""
        return read_text(self.scene, _TEXT) if self.scene.exists() else ""

    def write_scene(self, text: str) -> None:
        """Write the scene file."""
        write_atomic(self.scene, text)

    def result(self, name: str) -> Path:
        """Return the path for a result of that file name.

        Raises
        ------
        InputError
            If the name is no plain file name of the folder.
        """
        if name[:1] in ("", ".") or re.search(r"[/\\\0]", name):
            raise InputError(f"a result has a plain name; got {one_line(name, 80)!r}")
        return self.results / name

    def read_result(self, name: str) -> bytes | None:
        """Return the content of a result file; None where there is none."""
        path = self.result(name)
        return read_bytes(path, FILE) if path.is_file() else None

    def result_files(
        self, stem: str, suffixes: Collection[str], made_by: Collection[str] = tuple(RESULTS)
    ) -> list[Path]:
        """Return the result files of a curve, sorted, with one of these suffixes (``".csv"``).

        `made_by` limits them to files of some of the jobs in `RESULTS`: ``"found"`` (fit), ``"sampled"``,
        ``"film"``.
        """
        words = [word for made in made_by for word in RESULTS[made]]
        names = {f"{stem}.{word}{suffix}" for word in words for suffix in suffixes}
        return sorted(path for path in self.results.iterdir() if path.name in names)


def stem_of(name: str, test: object = None) -> str:
    """Return the common beginning of the names of a curve's result files: its file name and, if given, its test.

    No two curves share one: the suffix of the file is part of it, and uploaded files have no ``~`` in their names.

    Examples
    --------
    >>> stem_of("a.csv"), stem_of("a.txt"), stem_of("a.csv", 2)
    ('a.csv', 'a.txt', 'a.csv~2')
    """
    return f"{name or 'curve'}~{test}" if test else name or "curve"


def safe_name(name: str) -> str:
    """Return a file name without folders, hidden-file dots, or characters special to a shell or a spreadsheet.

    Examples
    --------
    >>> safe_name("../../etc/passwd"), safe_name("my curve (2).csv"), safe_name("=1+1.csv")
    ('passwd', 'my curve (2).csv', '1+1.csv')
    """
    last = re.split(r"[/\\]", name)[-1]
    plain = _ODD.sub(lambda found: "" if found.start() == 0 else "_", last).strip()
    stem, suffix = _cut(Path(plain).stem, _LONGEST), _cut(Path(plain).suffix, _LONGEST_ENDING)
    return f"{stem}{suffix}" if stem.strip("._ ") else f"curve{suffix}"


def _cut(text: str, most: int) -> str:
    """Return the longest beginning of a text that takes at most that many bytes in UTF-8."""
    return text.encode("utf-8", "replace")[:most].decode("utf-8", "ignore")


def analyses(home: Path) -> list[str]:
    """Return the names of the analyses in a folder, the most recently changed first."""
    found = [path for path in home.iterdir() if _NAME.fullmatch(path.name) and (path / "curves").is_dir()]
    return [path.name for path in sorted(found, key=lambda path: path.stat().st_mtime, reverse=True)]


def described(analysis: Path) -> str:
    """Describe an analysis in a line: its first curve, how many more, and the time of its last change."""
    names = sorted(path.name for path in (analysis / "curves").iterdir() if path.is_file())
    more = f" and {len(names) - 1} more" if len(names) > 1 else ""
    when = time.strftime("%d %b at %H:%M", time.localtime(analysis.stat().st_mtime))
    return f"{names[0] if names else 'no curve'}{more}, changed {when}"


def new_analysis(home: Path) -> AnalysisFolder:
    """Make the folder of a new analysis in `home`, named by day and number: ``2026-03-01-1``."""
    day, number = time.strftime("%Y-%m-%d"), 1
    while (home / f"{day}-{number}").exists():
        number += 1
    return AnalysisFolder(home / f"{day}-{number}")


def keep(folder: AnalysisFolder, stem: str, shown: Any) -> None:
    """Write a result that the page shows, a dataclass of plain values, as JSON.

    The file is named by `stem` and the class of `shown`.
    """
    write_atomic(folder.result(_name(stem, type(shown))), json.dumps(asdict(shown), indent=1))


def kept(folder: AnalysisFolder, stem: str, kind: type[_Shown]) -> _Shown | None:
    """Read the result of this class that `keep` wrote; None where there is none or the file is not valid."""
    path = folder.result(_name(stem, kind))
    if not path.is_file():
        return None
    try:
        with understood(path, _KIND):
            return kind(**parse_json(read_text(path, _KIND)))
    except UnderlayError:
        return None


def is_kept(folder: AnalysisFolder, stem: str, kind: type[object]) -> bool:
    """Whether `keep` wrote a result of this class under this stem."""
    return folder.result(_name(stem, kind)).is_file()


def _name(stem: str, kind: type[object]) -> str:
    return f"{stem}.{kind.__name__.lower()}{_SHOWN}"


# --- labels of the curves, such as animal and group, in a manifest as of `underlay map --manifest`


#: Columns that can be filled in on the page; a manifest that is brought may have others.
LABELS = ("animal", "group", "region")
#: Column of the curves that are on the bare substrate, beside the sample: they give its height and no modulus.
BARE = "bare substrate"
_MANIFEST = FileKind(
    "a manifest (CSV)", 20_000_000, "it needs a row of names with 'file', and a row per curve"
)
_MOST_COLUMNS, _LONGEST_LABEL = 200, 80


def read_labels(folder: AnalysisFolder) -> dict[str, dict[str, str]]:
    """Return the cells of the manifest by file and column; every curve has a row, even without a manifest."""
    rows: dict[str, dict[str, str]] = {path.name: {} for path in folder.curve_files()}
    path = folder.path / "manifest.csv"
    if not path.exists():
        return rows
    with understood(path, _MANIFEST):
        lines = numbered_rows(read_text(path, _MANIFEST), _MOST_COLUMNS, comment="#")
        _, names = next(lines)
        for _, cells in lines:
            row = {name: unguarded_cell(cell) for name, cell in zip(names, cells, strict=True)}
            file = row.pop("file", "")
            if file in rows:
                rows[file] = row
    return rows


def curves_on_sample(folder: AnalysisFolder) -> list[Path]:
    """Return the files of all curves except those marked as being on the bare substrate."""
    rows = read_labels(folder)
    return [path for path in folder.curve_files() if not rows[path.name].get(BARE)]


def label_columns(folder: AnalysisFolder) -> list[str]:
    """Return the columns of the manifest in which some curve has a label."""
    rows = read_labels(folder).values()
    return [
        name
        for name in dict.fromkeys(name for row in rows for name in row)
        if any(row.get(name) for row in rows)
    ]


def set_label(folder: AnalysisFolder, files: list[str], column: str, label: str) -> None:
    """Set a label of curves in one column.

    Where any curve has a label in it, curves without one get their file name as label.

    Raises
    ------
    InputError
        If the column is not one of `LABELS`.
    """
    if column not in LABELS:
        raise InputError(f"labels are {', '.join(LABELS)}; got {column!r}")
    rows = read_labels(folder)
    for file in files:
        if file in rows:
            rows[file][column] = one_line(label.strip(), _LONGEST_LABEL)
    write_labels(folder, rows)


def take_manifest(folder: AnalysisFolder, content: bytes) -> None:
    """Store an uploaded manifest (CSV); `fit_many` checks it against the curves.

    Raises
    ------
    FileFormatError
        If it is no table with the column ``file``.
    """
    with understood("the manifest", _MANIFEST):
        text = content.decode("utf-8-sig")
        _, names = next(numbered_rows(text, _MOST_COLUMNS, comment="#"))
        if "file" not in names:
            raise ValueError(f"it has no column 'file', but {', '.join(names)[:200]}")
    write_atomic(folder.path / "manifest.csv", content)


def write_labels(folder: AnalysisFolder, rows: dict[str, dict[str, str]]) -> None:
    """Write the cells of every curve, by file and column, as a manifest; delete it where all cells are empty."""
    path = folder.path / "manifest.csv"
    if text := manifest_text(rows):
        write_atomic(path, text)
    else:
        path.unlink(missing_ok=True)


def manifest_text(rows: Mapping[str, Mapping[str, str]], *, leave: str = "") -> str:
    """Return a manifest with the cells of curves, by file and column but one to `leave`; empty where all are empty.

    A curve without a label is its own animal, sample or the like; a place or a thickness that is not known stays
    empty.
    """
    columns = dict.fromkeys(name for row in rows.values() for name in row if name != leave)
    used = [name for name in columns if any(row.get(name) for row in rows.values())]
    table = [
        {"file": file, **{name: row.get(name) or (file if name in LABELS else "") for name in used}}
        for file, row in rows.items()
    ]
    return csv_text(pd.DataFrame(table)) if used else ""
