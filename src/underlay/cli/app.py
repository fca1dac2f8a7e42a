"""The commands by name, and what happens when one of them fails."""

from __future__ import annotations

import sys
from collections.abc import Callable
from typing import Annotated

import typer

from underlay._version import VERSION
from underlay.cli.accuracy import accuracy
from underlay.cli.benchmark import benchmark
from underlay.cli.browser_page import browser_page
from underlay.cli.cite import cite
from underlay.cli.compare import compare
from underlay.cli.console import noted, say, say_error
from underlay.cli.demo import demo
from underlay.cli.effects import effects
from underlay.cli.film import film
from underlay.cli.fit import fit
from underlay.cli.formats import formats
from underlay.cli.identify import identify
from underlay.cli.keys import keys
from underlay.cli.map import map_curves
from underlay.cli.options import without_empty_folders
from underlay.cli.plan import plan
from underlay.cli.population import population
from underlay.cli.report import report
from underlay.cli.sample import sample
from underlay.cli.simulate import simulate
from underlay.errors import UnderlayError

__all__ = ["app", "main"]

#: Exit codes: 0 done, 2 bad input (one clear line), 130 interrupted.
_BAD_INPUT, _INTERRUPTED = 2, 130

app = typer.Typer(
    name="underlay",
    help="Young's modulus of a thin layer on a substrate, from an indentation curve, with its uncertainty.",
    no_args_is_help=True,
    pretty_exceptions_enable=False,
    rich_markup_mode="markdown",
)


def _say_version(asked: bool) -> None:
    if asked:
        say(f"underlay {VERSION}")
        raise typer.Exit


@app.callback()
def _whole(
    version: Annotated[
        bool,
        typer.Option("--version", callback=_say_version, is_eager=True, help="Print the version."),
    ] = False,
) -> None:
    """Take the options that go before any command."""


#: The commands as `--help` groups them: what it is about, and the commands of it by their names.
_GROUPS: dict[str, dict[str, Callable[..., None]]] = {
    "Start": {"demo": demo, "app": browser_page, "formats": formats, "keys": keys},
    "Fit": {"fit": fit, "sample": sample, "compare": compare, "film": film},
    "Many curves": {"map": map_curves, "population": population},
    "Plan a test": {
        "plan": plan,
        "identify": identify,
        "effects": effects,
        "accuracy": accuracy,
        "simulate": simulate,
    },
    "Share": {"report": report, "cite": cite},
    "Measure this program": {"benchmark": benchmark},
}
for group, commands in _GROUPS.items():
    for name, command in commands.items():
        app.command(name, rich_help_panel=group)(command)


def main() -> None:
    """Run the command line; bad input ends with one line and exit code 2, never a traceback."""
    try:
        with noted(), without_empty_folders():
            app()
    except UnderlayError as error:
        say_error(str(error))
        sys.exit(_BAD_INPUT)
    except KeyboardInterrupt:
        say_error("interrupted; what was finished is kept")
        sys.exit(_INTERRUPTED)
