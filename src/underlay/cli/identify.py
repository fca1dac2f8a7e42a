"""`underlay identify`: what a test can and cannot tell, before it is made or after."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

from underlay._files import write_atomic
from underlay.cli.console import say
from underlay.cli.expected import deepest_point, expected_depths, expected_noise, measured_curve
from underlay.cli.options import (
    CurveOption,
    OutputFolder,
    Rtol,
    ScenePath,
    SolverName,
    ready_folder,
    wanted_solver,
)
from underlay.report.spoken import spoken

if TYPE_CHECKING:
    from underlay.inference.design.identifiability import Identifiability
    from underlay.scene.scene_file import SceneFile

__all__ = ["identify"]


def identify(
    scene: ScenePath,
    curve: CurveOption = None,
    solver: SolverName = None,
    rtol: Rtol = None,
    output: OutputFolder = None,
) -> None:
    """Show which combinations of the free parameters a test determines, and how well.

    Before a test, the scene file's [simulate] and [noise] sections say what it will be.

    Example: `underlay identify scene.toml --curve curve.csv`
    """
    from underlay._csv import csv_text
    from underlay.inference.design.identifiability import identifiability
    from underlay.inference.from_files import problem_from
    from underlay.report import plots
    from underlay.scene.scene_file import read_scene_file

    file = read_scene_file(scene)
    file = replace(file, solver=wanted_solver(file.solver, solver, rtol))
    if output is not None:
        ready_folder(output)
    measured = measured_curve(file, curve)
    told = _before(file) if measured is None else identifiability(problem_from(file, measured))
    say(spoken(told.report()))
    if output is not None:
        table = csv_text(told.to_frame())
        say(f"wrote {write_atomic(output / f'{scene.stem}.identifiability.csv', table)}")
        picture = plots.identifiability(told)
        say(f"wrote {plots.save(picture, output / f'{scene.stem}.identifiability.png')}")


def _before(file: SceneFile) -> Identifiability:
    from underlay.inference.design.identifiability import identifiability
    from underlay.inference.from_files import free_of

    deepest = deepest_point(file, None)
    depths = expected_depths(file, deepest)
    return identifiability(
        file.scene,
        depth=depths.depth,
        time=depths.time,
        free=free_of(file),
        noise=expected_noise(file, deepest),
        solver=file.solver,
    )
