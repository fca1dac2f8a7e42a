"""`underlay bench`: what the forward models and the fits cost, and the README's table of it."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Annotated

import typer

from underlay._door import FileKind, read_text
from underlay._files import write_atomic
from underlay.cli.console import say, say_table
from underlay.cli.options import OutputFolder, ready_folder
from underlay.errors import FileFormatError

__all__ = ["bench"]

_README = FileKind("a Markdown file", 10_000_000, "name the one with the table")

_START, _END = "<!-- bench:start -->", "<!-- bench:end -->"


def bench(
    readme: Annotated[
        Path | None,
        typer.Option(
            "--readme", help=f"Markdown file whose table, between {_START} and {_END}, is replaced."
        ),
    ] = None,
    output: OutputFolder = None,
) -> None:
    """Measure speed: models, fits, start-up, reading, maps and stacks, each against its unit.

    How right they are is measured by `underlay benchmark`.

    Example: `underlay bench --output results`
    """
    from underlay._csv import csv_text
    from underlay.report.bench import bench_markdown, bench_table, depth_table, fit_table
    from underlay.report.bench_users import machine, user_table

    page = None if readme is None else _read(readme)
    if output is not None:
        ready_folder(output)
    table, curve, fits, users = bench_table(), depth_table(), fit_table(), user_table()
    say_table(table, "Times in units of the explicit formula, 1000 depths")
    say_table(curve, "Against the number of depths")
    say_table(fits, "Times in units of lmfit's fit of Hertz's formula, 1000 points")
    say_table(users, "What a user waits for")
    if output is not None:
        say(f"wrote {write_atomic(output / 'bench.csv', csv_text(table))}")
        say(f"wrote {write_atomic(output / 'bench.depths.csv', csv_text(curve))}")
        say(f"wrote {write_atomic(output / 'bench.fits.csv', csv_text(fits))}")
        say(f"wrote {write_atomic(output / 'bench.users.csv', csv_text(users))}")
        say(f"wrote {write_atomic(output / 'bench.machine.json', json.dumps(machine(), indent=2))}")
    if readme is not None and page is not None:
        before, after = page
        text = f"{before}{_START}\n{bench_markdown(table, curve, fits, users)}\n{_END}{after}"
        say(f"wrote {write_atomic(readme, text)}")


def _read(readme: Path) -> tuple[str, str]:
    """Return what stands before and after the table."""
    text = read_text(readme, _README)
    before, start, rest = text.partition(_START)
    _, end, after = rest.partition(_END)
    if not (start and end):
        raise FileFormatError(f"{readme.name} has no place for the table: put {_START} and {_END} in it")
    return before, after
