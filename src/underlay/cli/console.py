"""What commands share: their output (lines, tables, files written, warnings), their options, the output folder.

Options of the form NAME=VALUE may be repeated: ``--noise force="2 uN" --noise relative=0.5%``. The solver comes
from the options, else from the scene file. What would fail after a computation is checked before it: the output
folder is made first, and removed again if nothing was written; --excel is refused where the file could not be
written.
"""

from __future__ import annotations

import difflib
import math
import shlex
import sys
import warnings
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from contextvars import ContextVar
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer
from rich import box
from rich.console import Console
from rich.markup import escape
from rich.measure import Measurement
from rich.table import Table

from underlay._files import require_writable_folder
from underlay._text import one_line
from underlay.errors import FileAccessError, InputError, UnderlayWarning, UnitError

if TYPE_CHECKING:
    from pathlib import Path

    import pandas as pd
    from matplotlib.axes import Axes

    from underlay.mechanics.solver import Solver
    from underlay.report.details import Part

_FILE_WIDTH = 160
# Letters of a cell from which on a column of words is broken into lines, as the last one is.
_LONG = 40


def say(*texts: str) -> None:
    """Print lines of text; no part of them is interpreted as markup."""
    for text in texts:
        lines = "\n".join(map(one_line, text.split("\n")))
        Console(highlight=False).print(lines, markup=False, soft_wrap=True)


def say_error(text: str, steps: Sequence[str] = ()) -> None:
    """Print an error as one line on standard error, and each of `steps`, a next command, as a further line."""
    told = one_line(" ".join(text.split()))
    for each in (f"underlay: {told}", *(f"Next step: {one_line(step)}" for step in steps)):
        Console(stderr=True, highlight=False).print(each, markup=False, soft_wrap=True)


def say_table(frame: pd.DataFrame, title: str = "") -> None:
    """Print a table: numbers right-aligned, text left-aligned; an index of names becomes the first column."""
    import pandas as pd

    if not pd.api.types.is_integer_dtype(frame.index):
        named = [str(name) for name in (frame.index.name, frame.columns.name) if name is not None]
        frame = frame.rename_axis("".join(named[:1])).reset_index()
    table = Table(
        title=escape(one_line(title)) or None, box=box.SIMPLE_HEAD, title_justify="left", title_style="bold"
    )
    for name, column in frame.items():
        numeric = pd.api.types.is_numeric_dtype(column) and not pd.api.types.is_bool_dtype(column)
        wraps = name == frame.columns[-1] or (
            not numeric and any(len(_cell(cell)) > _LONG for cell in column)
        )
        table.add_column(str(name), justify="right" if numeric else "left", no_wrap=not wraps)
    for row in frame.itertuples(index=False):
        table.add_row(*[_cell(value) for value in row])
    # Without a terminal (a file, a pipe) there is no width to keep to: nothing is cut off.
    console = Console(highlight=False)
    if not console.is_terminal:
        endless = console.options.update(width=sys.maxsize)
        console.width = max(_FILE_WIDTH, Measurement.get(console, endless, table).minimum)
    console.print(table)


def say_parts(parts: Iterable[Part]) -> None:
    """Print what stands behind a result: headings, sentences and tables; pictures are left out."""
    import pandas as pd

    for title, note, content in parts:
        told = [one for one in content if isinstance(one, str | pd.DataFrame)]
        if told:
            say(f"{title}{f' ({note})' if note else ''}")
        for one in told:
            if isinstance(one, str):
                say(one)
            else:
                say_table(one)


def _cell(value: object) -> str:
    if isinstance(value, bool):
        return "yes" if value else "no"
    if isinstance(value, float):
        return "" if math.isnan(value) else f"{value:.4g}"
    return escape(one_line(value))


def write_out(folder: Path | None, files: Mapping[str, pd.DataFrame | Callable[[], Axes]]) -> None:
    """Write tables and pictures into a folder by `write_all`, and print their paths; nothing without a folder."""
    from underlay.report.details import write_all

    say_written([] if folder is None else write_all(folder, files))


def say_written(paths: Iterable[Path]) -> None:
    """Print the paths of files that were written."""
    say(*(f"wrote {path}" for path in paths))


@contextmanager
def noted() -> Iterator[None]:
    """Print this package's warnings as notes, each once, inside a ``with`` block; other warnings as usual.

    Not those that a command collects by itself to print them after its result.
    """
    said: set[str] = set()

    def show(message: Warning | str, category: type[Warning], *where: Any, **more: Any) -> None:
        if not issubclass(category, UnderlayWarning):
            python_shows(message, category, *where, **more)
        elif str(message) not in said:
            said.add(str(message))
            say_warnings([str(message)])

    with warnings.catch_warnings():
        warnings.simplefilter("always", UnderlayWarning)
        python_shows, warnings.showwarning = warnings.showwarning, show
        yield


def say_warnings(texts: list[str]) -> None:
    """Print each of the warnings once, as a note."""
    say(*(f"note: {text}" for text in dict.fromkeys(texts)))


# --- arguments and options that commands share


CurveFile = Annotated[Path, typer.Argument(help="Measured curve, in any format of `underlay formats`.")]
CurveOption = Annotated[
    Path | None,
    typer.Option(
        "--curve", help="Measured curve that gives depth and noise; else the one named by [curve] file."
    ),
]
SceneOption = Annotated[
    Path | None, typer.Option("--scene", "-s", help="Scene file (TOML): your test as a file. Required.")
]
ScenePath = Annotated[Path, typer.Argument(help="Scene file (TOML).")]
Seed = Annotated[int, typer.Option(help="Seed of the random numbers; the same seed makes the same file.")]
MaxDepth = Annotated[
    str | None,
    typer.Option(
        "--max-depth", help='Maximum indentation, e.g. "100 um"; else that of the curve or of [simulate].'
    ),
]
SolverName = Annotated[
    str | None,
    typer.Option(
        "--solver",
        help="Contact model: auto, exact, asymptotic, halfspace or a published correction; else that of [solver].",
    ),
]
Rtol = Annotated[
    float | None, typer.Option("--rtol", help="Relative error allowed; else that of [solver], else 1e-6.")
]


def scene_for(scene: Path | None, curves: Path, command: str) -> Path:
    """Return the scene file that was given; without one, raise an error that names the next command.

    Parameters
    ----------
    scene : Path or None
        The value of ``--scene``.
    curves : Path
        What is to be fitted: a file, or a folder for the command ``map``.
    command : str
        Name of the command.

    Raises
    ------
    InputError
        If there is none, or a folder was given to a command on one curve.
    FileAccessError
        If the curve is not there.
    """
    if not curves.exists():
        raise FileAccessError(f"cannot open {str(curves)!r}: there is no such file or folder")
    if curves.is_dir() and command != "map":
        error: InputError = InputError(f"{curves} is a folder, and {command} is of one curve")
        named = "" if scene is None else f" --scene {shlex.quote(str(scene))}"
        error.add_note(f"{_words('map', curves)}{named}")
        raise error
    if scene is not None:
        return scene
    inside = sorted(path for path in curves.iterdir() if path.is_file()) if curves.is_dir() else [curves]
    first = inside[0] if inside else curves
    own = first.with_suffix(".toml")
    error = InputError("no scene file is named: tip, sample and substrate of this test")
    error.add_note(
        f"{_words(command, curves)} --scene {shlex.quote(str(own))}"
        if own.exists()
        else f"{_words('formats', first)} --new-scene {shlex.quote(own.name)}"
    )
    raise error


def _words(command: str, path: Path) -> str:
    return f"underlay {command} {shlex.quote(str(path))}"


def named_quantities(option: str, given: Iterable[str], kinds: Mapping[str, str]) -> dict[str, float]:
    """Parse the values of a repeatable option of the form NAME=VALUE.

    Parameters
    ----------
    option : str
        Its spelling, e.g. ``"--noise"``.
    given : iterable of str
        Its values, each ``NAME=VALUE``.
    kinds : mapping of str to str
        Allowed names, each with its kind of quantity.

    Returns
    -------
    dict of str to float
        Values (SI) by name, in the order given.

    Raises
    ------
    InputError
        If a value has another form, its name is unknown, or it is given twice.
    UnitError
        If a unit is missing, unknown or of another kind.
    """
    from underlay.units import KINDS, parse_quantity

    found: dict[str, float] = {}
    for text in given:
        written, equals, value = text.partition("=")
        name = written.strip().replace("-", "_")
        if name not in kinds:
            near = difflib.get_close_matches(name, kinds, n=1)
            hint = f"; did you mean {near[0]}?" if near else "."
            raise InputError(f"{option} has no {written.strip()!r}{hint} There are {', '.join(kinds)}")
        if not equals or not value.strip():
            example = KINDS[kinds[name]].example
            raise InputError(f"{option} {name} needs a value, e.g. {option} {name}={_quoted(example)}")
        if name in found:
            raise InputError(f"{option} {name} is given twice; give it once")
        try:
            found[name] = parse_quantity(value.strip(), kinds[name])
        except UnitError as error:
            raise UnitError(f"{option} {name}: {error}") from error
    return found


def _quoted(example: str) -> str:
    return f'"{example}"' if " " in example else example


def wanted_solver(stated: Solver, name: str | None, rtol: float | None) -> Solver:
    """Return the solver of that name, else the one the scene file states, with relative tolerance `rtol` if given.

    Raises
    ------
    InputError
        If there is none of that name, or it has no tolerance to set.
    """
    from underlay.mechanics.solvers import as_solver

    solver = stated if name is None else as_solver(name)
    if rtol is None:
        return solver
    if not solver.tolerance:
        raise InputError(
            f'--rtol does not go with the solver {solver.label}: it goes with "auto" and "exact"'
        )
    return solver.with_tolerance(rtol)


# Folders that the command at hand has made, innermost first.
_made: ContextVar[list[Path] | None] = ContextVar("made", default=None)


def _ready_folder(path: Path | None) -> Path | None:
    """Make the output folder of the option ``--output``, so that a command that cannot write fails at the start.

    Raises
    ------
    FileAccessError
        As `require_writable_folder`.
    """
    if path is None:
        return None
    missing = [folder for folder in (path, *path.parents) if not folder.exists()]
    folder = require_writable_folder(path)
    made = _made.get()
    if made is not None:
        made.extend(missing)
    return folder


@contextmanager
def without_empty_folders() -> Iterator[None]:
    """Remove, after a ``with`` block, folders that `_ready_folder` made and that are empty, as after an error."""
    token = _made.set([])
    try:
        yield
    finally:
        for folder in _made.get() or []:
            # Only an empty folder can be removed so.
            with suppress(OSError):
                folder.rmdir()
        _made.reset(token)


def _excel_path(path: Path | None) -> Path | None:
    """Check before the computation that the Excel file can be written after it; see `excel_path` for the errors."""
    if path is None:
        return None
    from underlay.report.excel import excel_path

    return excel_path(path)


OutputFolder = Annotated[
    Path | None,
    typer.Option(
        "--output", "-o", callback=_ready_folder, help="Folder for tables, JSON and pictures; made if absent."
    ),
]


ExcelFile = Annotated[
    Path | None,
    typer.Option(
        "--excel",
        callback=_excel_path,
        help="Excel file to write (.xlsx): results, settings, curves, each a sheet.",
    ),
]


Details = Annotated[bool, typer.Option("--details", help="Print all that stands behind the numbers.")]
