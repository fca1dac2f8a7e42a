"""Fits many curves, e.g. of a whole map, on one or many machines, with a row for each, also for those that fail.

Rows are appended to a journal as they come and gathered into one table (`journal`, `results_table`). The same
worker code (`work`) runs in processes of this machine or under a Dask scheduler (`processes`).
"""

from __future__ import annotations

import hashlib
import os
import time
from collections.abc import Generator, Iterable, Mapping, Sequence
from contextlib import suppress
from dataclasses import replace
from pathlib import Path
from typing import Any

import pandas as pd
from rich.progress import BarColumn, ProgressColumn, Task, TextColumn, TimeRemainingColumn
from rich.text import Text

from underlay._files import require_writable_folder
from underlay.errors import InputError
from underlay.inference.batch.curves import CurvePlace, Curves, list_curves, with_stand_ins
from underlay.inference.batch.decisions import DECISIONS
from underlay.inference.batch.manifest import read_manifest
from underlay.inference.batch.model import (
    BatchModel,
    MapOptions,
    Reporter,
    batch_model,
    scene_file_of,
)
from underlay.inference.batch.processes import through_dask, through_processes
from underlay.inference.batch.results_table import Layout, require_format, to_frame, write_table
from underlay.inference.batch.work import CurveFitter, Rows, file_hash
from underlay.inference.journal import Journal
from underlay.inference.least_squares.provenance import curve_hash
from underlay.inference.priors import Given
from underlay.inference.progress import ProgressLine
from underlay.inference.sampling.derived import ADHESIVE
from underlay.scene.scene import Scene
from underlay.scene.scene_file import SceneFile

# Name of the table where the output is a folder.
_TABLE = "map.csv"
# Curves sent at once: a few thousand readings each make a megabyte, and a worker is done in under a second.
_LARGEST_CHUNK = 64
# Least number of chunks per worker, so that all end at about the same time.
_CHUNKS_PER_WORKER = 8
# Number of curves that justify a further worker process, which takes about a second to start.
_WORTH_A_WORKER = 100
# Interval (s) at which the table is rewritten from the journal, and the largest share of the time for it, one in
# `_SHARE`.
_EVERY = 10.0
_SHARE = 50.0


def fit_many(
    curves: Curves,
    scene: Scene | SceneFile | str | os.PathLike[str],
    free: Mapping[str, Given] | Iterable[str] | None = None,
    manifest: str | os.PathLike[str] | pd.DataFrame | Sequence[Mapping[str, Any]] | None = None,
    *,
    workers: int | None = None,
    scheduler: str | None = None,
    output: str | os.PathLike[str] | None = None,
    options: MapOptions | None = None,
) -> pd.DataFrame:
    """Fit many curves, each by itself, into one table.

    Parameters
    ----------
    curves : path, or iterable of Curve or path
        A folder with one curve per file, one file that holds many tests, or a list.
    scene : Scene, or path of a scene file
        What they have in common. A scene file also states the free parameters and which part of a curve is used;
        with a `Scene`, files give their loading part and curves in memory are fitted as they are.
    free : mapping of path to prior
        As in `Problem`; by default what the scene file states.
    manifest : path, DataFrame or sequence of mappings, optional
        Numbers of single curves: ``file``, ``name``, ``x``, ``y``, any parameter path, and labels (``animal``,
        ``group``) for a population; see `underlay.inference.batch.manifest`. With labels the table keeps what
        `population` needs.
    workers : int, optional
        Processes, each with one thread. By default as many as there are processors and curves to keep them busy; 0
        fits in this process, for debugging a failure.
    scheduler : str, optional
        Address of a Dask scheduler, such as ``"tcp://10.0.0.1:8786"``, whose workers are used instead (extra
        ``cluster``). Files must have the same path there.
    output : path, optional
        Table to write, ``.csv`` or ``.parquet``, or a folder for ``map.csv``. Next to it a journal
        (``map.csv.journal``) holds every finished row, so that an interruption loses none.
    options : MapOptions, optional
        Further options: noise, solver, sampling, whether the run in `output` is continued, limits of time.

    Returns
    -------
    pandas.DataFrame
        One row per curve, in the order of the curves (SI): ``name``, ``path``, ``x``, ``y``, ``status`` ("fitted"
        or "failed"), ``verdict``, ``reason``, ``cause``, every free parameter with the ends of its combined
        interval and of both parts (``<parameter>.low``, ``.high``, ``.stat.low``, ``.stat.high``, ``.syst.low``,
        ``.syst.high``; without answers ``<parameter>.stderr``), every parameter of the manifest or taken from the
        files, where ``layer.E`` is fitted the modulus that the instrument's own software reports, converted to the
        same Poisson's ratio (``layer.E.instrument``), and by how much ours differs
        (``layer.E.difference_percent``), ``law``, ``reduced_chi_square`` (one where the noise is estimated),
        ``rms`` (N), ``warnings`` (their number), ``seconds``, ``sha256``. A curve that cannot be fitted is a row
        with its reason. All but ``seconds`` is the same whatever the number of workers.

    Raises
    ------
    InputError
        Before any work: curves and manifest do not match, a name is given twice, the model is not possible,
        `output` holds another run.
    FileAccessError
        If the output cannot be written; also during the work, with every finished row kept.
    SchedulerError
        If the scheduler does not answer, or the connection is lost.

    Examples
    --------
    >>> import numpy as np, underlay as ul
    >>> scene = ul.Scene(ul.Paraboloid(1e-3), ul.Layer(ul.Isotropic(1e6, 0.45), 1e-3), ul.RIGID)
    >>> depth = np.linspace(-1e-5, 5e-5, 100)
    >>> curves = [ul.synthesize(scene, depth, ul.Noise(force=1e-4), rng=seed) for seed in range(3)]
    >>> table = ul.fit_many(curves, scene, {"layer.E": (1e4, 1e8)}, workers=0)
    >>> bool((abs(table["layer.E"] / 1e6 - 1.0) < 0.01).all())
    True
    """
    options = options or MapOptions()
    own_files = [Path(entry) for entry in (manifest, scene) if isinstance(entry, str | os.PathLike)]
    if output is not None:
        # With the file that a review writes next to the table.
        own_files += [_table_path(output), _table_path(output).with_name(DECISIONS)]
    listed = list_curves(curves, own_files, options.folders)
    file = scene_file_of(scene)
    model = batch_model(scene if file is None else with_stand_ins(file, listed), free, options)
    if workers is not None and (type(workers) is not int or workers < 0):
        raise InputError(f"workers must be a number of processes, 0 for this one; got {workers!r}")
    places, given, labels = _with_manifest(listed, manifest, model)
    labels = tuple(dict.fromkeys((*options.folders, *labels)))
    from_files = () if file is None else tuple(path for path in file.left_out if path not in given)
    if output is not None:
        # A later run must recognise its curves by their hashes.
        places = [
            place if place.curve is None else replace(place, sha256=curve_hash(place.curve))
            for place in places
        ]
    derived = tuple(f"adhesion.{name}" for name in ADHESIVE) if model.scene.adheres else ()
    layout = Layout.of(
        list(model.free),
        (*given, *from_files),
        labels=labels,
        derived=derived,
        sampled=model.sampling is not None,
        answers=model.answers,
    )
    table = None if output is None else _table_path(output)
    if table is not None:
        require_format(table)
        require_writable_folder(table.parent)
    path = None if table is None else table.with_name(f"{table.name}.journal")
    identity = _identity(model, places, layout)

    def is_row(index: int, text: str) -> bool:
        return index in range(len(places)) and layout.is_row(text)

    with Journal(path, identity, is_row, resume=options.resume) as journal:
        _require_same_files(journal, places, layout)
        todo = [place for place in places if not journal.has(place.index)]
        if todo:
            batches = _through(model, layout, todo, workers, scheduler, options)
            _gather(journal, table, layout, batches, len(places), shown=options.progress)
        if table is not None:
            journal.sync()
            write_table(table, layout, journal.lines())
        return to_frame(layout, journal.lines())


def _require_same_files(journal: Journal, places: Sequence[CurvePlace], layout: Layout) -> None:
    """Raise InputError where the file of a finished curve has changed since its row was written."""
    done = (place for place in places if journal.has(place.index))
    for place, line in zip(done, journal.lines(), strict=True):
        if place.curve is None and layout.cells(line)["sha256"] != (place.sha256 or file_hash(place.path)):
            raise InputError(
                f"{place.path} changed since its row was written: put it back, or choose another output"
            )


class _Speed(ProgressColumn):
    """Column of the progress line: curves per second."""

    def render(self, task: Task) -> Text:
        """Write the speed of a task; called by rich."""
        speed = task.finished_speed or task.speed
        return Text("" if speed is None else f"{speed:.3g} curves/s")


def _gather(
    journal: Journal,
    table: Path | None,
    layout: Layout,
    batches: Generator[Rows, None, None],
    total: int,
    *,
    shown: bool | Reporter | None,
) -> None:
    """Append rows to the journal as they come, and write the table from time to time and at any exit."""
    last, pause = time.monotonic(), _EVERY
    try:
        columns = (
            TextColumn("fitting"),
            BarColumn(),
            TextColumn("{task.completed} of {task.total} curves"),
            _Speed(),
            TimeRemainingColumn(),
        )
        with ProgressLine(*columns, shown=shown, total=total, completed=journal.done) as line:
            for rows in batches:
                journal.append(rows)
                line.show(journal.done, total, completed=journal.done)
                now = time.monotonic()
                if table is not None and now - last > pause:
                    journal.sync()
                    write_table(table, layout, journal.lines())
                    last = time.monotonic()
                    pause = max(_EVERY, _SHARE * (last - now))
    except BaseException:
        # Stop the workers first, so that no row is added to what is written now.
        batches.close()
        if table is not None and journal.done:
            # A full disk may have stopped the run: the journal holds every row, and the first error is the one to
            # report.
            with suppress(OSError):
                write_table(table, layout, journal.lines())
        raise


def _through(
    model: BatchModel,
    layout: Layout,
    todo: Sequence[CurvePlace],
    workers: int | None,
    scheduler: str | None,
    options: MapOptions,
) -> Generator[Rows, None, None]:
    """Fit curves under a Dask scheduler, in worker processes or in this process; yield rows as they come."""
    largest = 1 if model.sampling is not None else _LARGEST_CHUNK
    if scheduler is not None:
        return through_dask(model, layout, todo, largest, scheduler, options.timeout)
    if workers == 0:
        return CurveFitter(model, layout).batches(todo)
    if workers is None:
        worth = len(todo) if model.sampling is not None else 1 + len(todo) // _WORTH_A_WORKER
        workers = min(_processors(), worth)
    workers = min(workers, len(todo))
    size = min(largest, -(-len(todo) // (workers * _CHUNKS_PER_WORKER)))
    chunks = [todo[start : start + size] for start in range(0, len(todo), size)]
    return through_processes(model, layout, chunks, workers, options.longest)


def _with_manifest(
    places: list[CurvePlace], manifest: Any, model: BatchModel
) -> tuple[list[CurvePlace], tuple[str, ...], tuple[str, ...]]:
    """Curves with their rows of the manifest, and the parameter paths and labels that it gives."""
    if manifest is None:
        return places, (), ()
    read = read_manifest(manifest, model.scene)
    entries = read.for_curves([place.name for place in places])
    model.check_starts((f"{read.source} ({entry.file})", entry.values) for entry in entries)
    joined = [
        replace(
            place,
            name=entry.name or place.name,
            x=entry.x,
            y=entry.y,
            values=entry.values,
            labels={**place.labels, **entry.labels},
        )
        for place, entry in zip(places, entries, strict=True)
    ]
    return joined, read.paths, read.labels


def _identity(model: BatchModel, places: Sequence[CurvePlace], layout: Layout) -> dict[str, Any]:
    """Identity of a run: SHA-256 hashes of everything that decides its numbers, its columns, number of curves."""
    names, manifest = hashlib.sha256(), hashlib.sha256()
    for place in places:
        names.update(f"{Path(place.path).name}\0{place.sha256}\n".encode("utf-8", "backslashreplace"))
        said = (place.name, place.x, place.y, sorted({**place.values, **place.labels}.items()))
        manifest.update(repr(said).encode("utf-8", "backslashreplace"))
    hashes = {**model.hashes(), "curves": names.hexdigest(), "manifest": manifest.hexdigest()}
    return {"hashes": hashes, "columns": list(layout.kinds), "curves": len(places)}


def _table_path(output: str | os.PathLike[str]) -> Path:
    path = Path(output)
    return path if path.suffix else path / _TABLE


def _processors() -> int:
    try:
        return len(os.sched_getaffinity(0))
    except AttributeError:  # not on every system
        return os.cpu_count() or 1
