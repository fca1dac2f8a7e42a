"""Lists the curves of a map: of a folder, a list of files, one file of many tests, or in memory."""

from __future__ import annotations

import os
from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path

from underlay.data.curve import Curve
from underlay.data.readers import (
    KeptOpen,
    MapCurve,
    curves_of_map,
    kept_open,
    read,
    read_all,
    read_from_map,
)
from underlay.errors import FileAccessError, InputError, UnderlayError
from underlay.inference.file_facts import settle
from underlay.inference.from_files import chosen_part, read_for, read_whole, turned
from underlay.scene.scene_file import SceneFile

#: Type of what `list_curves` accepts.
Curves = str | os.PathLike[str] | Iterable[Curve | str | os.PathLike[str]]

# Endings of files that are not curves.
_NOT_CURVES = frozenset(
    {
        *(".toml", ".md", ".png", ".svg", ".pdf", ".html", ".parquet", ".ipynb", ".py"),
        # Of the journal of a map or a chain, and of SQLite's companion files, while it is open or after a kill.
        *(f"{kind}{end}" for kind in (".journal", ".chain") for end in ("", "-wal", "-shm", "-journal")),
    }
)
# Largest number of names that a message lists.
_LISTED = 3
# Number of a map's first curves whose files are read for what a scene file leaves to them.
_LOOKED_AT = 5


@dataclass(frozen=True, eq=False)
class CurvePlace:
    """One curve to be fitted.

    Parameters
    ----------
    index : int
        Row of the table.
    name : str
        Its name in the table, distinct from all others.
    path : str
        Its file, or the empty string for a curve in memory.
    curve : Curve or None
        The curve in memory; for None it is read from the file where it is fitted.
    of_map : MapCurve or None
        Which curve of the file, where the file is a map.
    x, y : float or None
        Position (m).
    values : mapping
        Numbers of its own scene (SI), by path.
    sha256 : str
        Hash of a curve in memory, or of its file, where it is known already.
    labels : mapping
        Labels for a population, by column: animal, group and the like.
    """

    index: int
    name: str
    path: str = ""
    curve: Curve | None = None
    x: float | None = None
    y: float | None = None
    values: Mapping[str, float] = field(default_factory=dict)
    sha256: str = ""
    of_map: MapCurve | None = None
    labels: Mapping[str, str] = field(default_factory=dict)


def list_curves(
    curves: Curves, leave_out: Iterable[Path] = (), folders: Sequence[str] = ()
) -> list[CurvePlace]:
    """List curves in the order of their names (a folder) or as given; no curve of a folder is read yet.

    Parameters
    ----------
    curves : path, or iterable of Curve or path
        A folder (its files, hidden ones and folders left out), one file that may hold many tests, or several.
    leave_out : iterable of Path
        Files of the folder that are no curves, such as the manifest.
    folders : sequence of str
        Names of the labels that the nested folders stand for, outermost first, e.g. ``["group", "animal"]``.

    Raises
    ------
    InputError
        If there is none, or two have the same name.
    FileAccessError
        If a folder or file is not there.
    """
    if isinstance(curves, str | os.PathLike):
        places = _of_path(Path(curves), {path.resolve() for path in leave_out}, folders)
    elif folders:
        raise InputError(
            "folders label the curves of one folder; these are a list: give labels in a manifest"
        )
    elif isinstance(curves, Curve):
        places = _of_several([curves])
    else:
        places = _of_several(curves)
    if not places:
        where = str(curves) if isinstance(curves, os.PathLike) else repr(curves)
        raise InputError(f"no curve in {where:.200}: give a folder with curve files, files, or curves")
    twice = [name for name, count in Counter(place.name for place in places).items() if count > 1]
    if twice:
        raise InputError(
            f"{len(twice)} names are given twice ({', '.join(map(repr, twice[:_LISTED]))}): the rows of the "
            "table could not be told apart; give each curve a name of its own"
        )
    return places


def read_place(place: CurvePlace, file: SceneFile | None, kept: KeptOpen | None = None) -> Curve:
    """Read the part of a curve that is fitted, with the reading options of the scene file, if there is one.

    Parameters
    ----------
    place : CurvePlace
        The curve.
    file : SceneFile or None
        States how curves are read and which part is used.
    kept : KeptOpen, optional
        Holds the file of a map open from one of its curves to the next.

    Raises
    ------
    FileAccessError, FileFormatError, CurveError
        If it cannot be read, or has no such part.
    """
    if place.curve is not None:
        return place.curve if file is None else chosen_part(turned(place.curve, file.curve), file.curve)
    of_map = place.of_map if place.of_map is None or kept is None else kept_open(place.of_map, kept)
    if file is not None:
        return read_for(file, of_map or place.path)
    whole = read(place.path) if of_map is None else read_from_map(of_map)
    return chosen_part(turned(whole, {}), {})


def with_stand_ins(file: SceneFile, places: Sequence[CurvePlace]) -> SceneFile:
    """Return the scene file with the numbers it leaves to the curve files taken from one of the first curves.

    With them the model of a map is checked once, before any work; each curve's own file replaces them later.

    Raises
    ------
    InputError
        If none of the first curves that can be read states them.
    """
    if not file.left_out:
        return file
    reason = ""
    for place in places[:_LOOKED_AT]:
        try:
            curve = place.curve if place.curve is not None else read_whole(file, place.of_map or place.path)
            values = settle(
                file.draft, curve, left_out=file.left_out, overrule=file.curve.get("overrule", ())
            )
        except UnderlayError as error:
            reason = reason or str(error)
            continue
        return replace(file, draft=file.draft.with_values(values.values))
    raise InputError(
        f"{file.path.name} leaves out {file.left_out[0]}, which none of the first curves says ({reason}): give it"
    )


def _of_path(path: Path, leave_out: set[Path], folders: Sequence[str]) -> list[CurvePlace]:
    if folders:
        return _of_folders(path, leave_out, folders)
    if path.is_dir():
        try:
            names = sorted(entry.name for entry in os.scandir(path) if entry.is_file())
        except OSError as error:
            raise FileAccessError(f"cannot list the folder {path}: {error.strerror or error}") from error
        folder = path.resolve()
        others = {other.name for other in leave_out if other.parent == folder}
        files = [
            name
            for name in names
            if not name.startswith(".")
            and os.path.splitext(name)[1].lower() not in _NOT_CURVES  # noqa: PTH122  no Path for each of a map
            and name not in others
        ]
        return [
            CurvePlace(index, name, os.path.join(folder, name))  # noqa: PTH118  as above
            for index, name in enumerate(files)
        ]
    if not path.exists():
        raise FileAccessError(f"there is no folder or file {path}")
    file = str(path.resolve())
    if len(listed := curves_of_map(path)) > 1:
        return [
            CurvePlace(of.number - 1, f"{path.name}#{of.number}", file, sha256=of.sha256, of_map=of)
            for of in listed
        ]
    tests = read_all(path)
    if len(tests) == 1:
        return [CurvePlace(0, path.name, file)]
    # Of an archive, the names of its files.
    members = [str(test.metadata.get("member") or "") for test in tests]
    names = [
        f"{path.name}/{member}" if member and members.count(member) == 1 else f"{path.name}#{number}"
        for number, member in enumerate(members, start=1)
    ]
    return [
        CurvePlace(number, name, file, test)
        for number, (name, test) in enumerate(zip(names, tests, strict=True))
    ]


def _of_folders(path: Path, leave_out: set[Path], folders: Sequence[str]) -> list[CurvePlace]:
    """Curves of nested folders, with the folders' names as labels."""
    if not path.is_dir():
        raise InputError(f"{path} is no folder: there are no folders in it to stand for {', '.join(folders)}")
    places: list[CurvePlace] = []
    for inner in sorted(entry for entry in path.iterdir() if entry.is_dir() and entry.name[0] != "."):
        for place in _of_path(inner, leave_out, folders[1:]):
            labels = {folders[0]: inner.name, **place.labels}
            places.append(replace(place, index=len(places), name=f"{inner.name}/{place.name}", labels=labels))
    return places


def _of_several(curves: object) -> list[CurvePlace]:
    """Curves from an iterable of curves and paths; an empty list for anything else."""
    places = []
    for index, entry in enumerate(curves if isinstance(curves, Iterable) else ()):
        if isinstance(entry, Curve):
            name = str(entry.metadata.get("name") or f"curve {index}")
            places.append(CurvePlace(index, name, str(entry.metadata.get("path") or ""), entry))
        elif isinstance(entry, str | os.PathLike):
            path = Path(entry)
            if not path.is_file():
                raise FileAccessError(f"curve {index}: there is no file {path}")
            places.append(CurvePlace(index, path.name, str(path.resolve())))
        else:
            raise InputError(f"curve {index} must be a Curve or the path of one; got {entry!r:.100}")
    return places
