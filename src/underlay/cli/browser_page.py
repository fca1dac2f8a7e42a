"""`underlay app`: the page in a browser, for people who do not program."""

from __future__ import annotations

import importlib.util
from pathlib import Path
from typing import Annotated

import typer

from underlay.cli.console import say
from underlay.errors import InputError, missing_extra

__all__ = ["browser_page"]


def browser_page(
    folder: Annotated[
        Path, typer.Argument(help="Folder in which the analyses are kept; made if absent.")
    ] = Path("underlay-analyses"),
    port: Annotated[int, typer.Option(help="Port of this machine; 0 takes a free one.")] = 0,
    browser: Annotated[bool, typer.Option(help="Open the page in a browser.")] = True,
) -> None:
    """Open the app in your browser: drop curves, enter the test, fit, export.

    Nothing leaves this machine. Every analysis is a folder of plain files that the other commands read.

    Example: `underlay app`
    """
    if importlib.util.find_spec("nicegui") is None:
        raise missing_extra("the page needs NiceGUI", "app")
    if not 0 <= port <= 65_535:
        raise InputError(f"--port must be from 0 to 65535; got {port}")
    from underlay.app.server import serve

    serve(folder, port, show=browser, tell=_tell)


def _tell(address: str) -> None:
    say("The page is at this address, which opens once; end it with Ctrl-C.")
    say(address)
