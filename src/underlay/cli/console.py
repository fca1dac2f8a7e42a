"""Output of the commands: lines, tables on a terminal, files written, warnings."""

from __future__ import annotations

import math
import sys
import warnings
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from typing import TYPE_CHECKING, Any

from rich import box
from rich.console import Console
from rich.markup import escape
from rich.measure import Measurement
from rich.table import Table

from underlay._text import one_line
from underlay.errors import UnderlayWarning

if TYPE_CHECKING:
    from pathlib import Path

    import pandas as pd
    from matplotlib.axes import Axes

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
