"""The application with its commands by name, and the error message where one of them fails."""

from __future__ import annotations

import sys
from collections.abc import Callable
from typing import Annotated

import typer

from underlay._version import VERSION
from underlay.cli.console import noted, say, say_error, without_empty_folders
from underlay.cli.design import accuracy, effects, identify, plan, simulate
from underlay.cli.fit import benchmark, compare, demo, film, fit, sample
from underlay.cli.maps import map_curves, population
from underlay.cli.report import cite, report
from underlay.cli.start import browser_page, formats, keys
from underlay.errors import UnderlayError

#: Exit codes: 0 done, 2 bad input (one clear line), 130 interrupted.
_BAD_INPUT, _INTERRUPTED = 2, 130

app = typer.Typer(
    name="underlay",
    help="Young's modulus of a thin layer on a substrate, from an indentation curve, with its uncertainty.",
    no_args_is_help=True,
    pretty_exceptions_enable=False,
    rich_markup_mode="markdown",
)
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


def _say_version(asked: bool) -> None:
    if asked:
        say(f"underlay {VERSION}")
        raise typer.Exit


@app.callback()
def _whole(
    version: Annotated[
        bool, typer.Option("--version", callback=_say_version, is_eager=True, help="Print the version.")
    ] = False,
) -> None:
    """Declare the options that precede any command."""


for group, commands in _GROUPS.items():
    for name, command in commands.items():
        app.command(name, rich_help_panel=group)(command)


def main() -> None:
    """Run the command line; invalid input ends with a one-line message and exit code 2, never a traceback."""
    try:
        with noted(), without_empty_folders():
            app()
    except UnderlayError as error:
        say_error(str(error), getattr(error, "__notes__", ()))
        sys.exit(_BAD_INPUT)
    except KeyboardInterrupt:
        say_error("interrupted; what was finished is kept")
        sys.exit(_INTERRUPTED)
