"""`underlay identify`: what a test can and cannot tell, before it is made or after."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from underlay._files import require_writable_folder, write_atomic
from underlay.cli.console import say
from underlay.cli.options import OutputFolder, ScenePath
from underlay.data.noise import Noise
from underlay.errors import InputError
from underlay.inference.from_files import free_of, problem_from, read_for
from underlay.inference.identifiability import Identifiability, identifiability
from underlay.report import plots
from underlay.report.csv_text import csv_text
from underlay.scene.scene_file import SceneFile, read_scene_file

__all__ = ["identify"]


def identify(
    scene: ScenePath,
    curve: Annotated[
        Path | None, typer.Option("--curve", help="A measured curve: judge that instead of the plan.")
    ] = None,
    output: OutputFolder = None,
) -> None:
    """Say which combinations of the free parameters a test fixes, and how well.

    Before a test, the scene file's [simulate] and [noise] sections say what it will be.

    Example: `underlay identify scene.toml --curve curve.csv`
    """
    file = read_scene_file(scene)
    if output is not None:
        require_writable_folder(output)
    told = identifiability(problem_from(file, read_for(file, curve))) if curve else _before(file)
    say(told.report())
    if output is not None:
        table = csv_text(told.to_frame())
        say(f"wrote {write_atomic(output / f'{scene.stem}.identifiability.csv', table)}")
        picture = plots.identifiability(told)
        say(f"wrote {plots.save(picture, output / f'{scene.stem}.identifiability.png')}")


def _before(file: SceneFile) -> Identifiability:
    if file.simulate is None or not file.noise:
        raise InputError(
            f"{file.path.name}: before a test, [simulate] must say its depths and [noise] how well it reads; "
            "or judge a measured curve with --curve"
        )
    return identifiability(
        file.scene, depth=file.simulate.depth, free=free_of(file), noise=Noise(**file.noise)
    )
