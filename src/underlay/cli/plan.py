"""`underlay plan`: which tip radius and depth would tell what is wanted."""

from __future__ import annotations

from typing import TYPE_CHECKING, Annotated

import typer

from underlay._files import write_atomic
from underlay.cli.console import say, say_warnings
from underlay.cli.expected import deepest_point, expected_noise, measured_curve
from underlay.cli.options import (
    CurveOption,
    MaxDepth,
    OutputFolder,
    Rtol,
    ScenePath,
    SolverName,
    ready_folder,
    wanted_solver,
)
from underlay.errors import InputError

if TYPE_CHECKING:
    from underlay._arrays import FloatArray
    from underlay.scene.scene_file import SceneFile

__all__ = ["plan"]

# A grid without being asked: a factor of five around the tip at hand, a tenth of the depth up to all of it.
_TIP_FACTOR, _SHALLOWEST, _COUNT = 5.0, 0.1, 8
_MOST = 60

RadiiOption = Annotated[
    str | None, typer.Option(help='Tip radii to consider, "from:to:count", e.g. "0.1 mm:2 mm:8".')
]
DepthsOption = Annotated[str | None, typer.Option(help='Indentations to consider, e.g. "10 um:200 um:8".')]


def plan(
    scene: ScenePath,
    parameter: Annotated[str, typer.Option(help="Parameter that the test is to determine.")] = "layer.E",
    radii: RadiiOption = None,
    depths: DepthsOption = None,
    max_depth: MaxDepth = None,
    curve: CurveOption = None,
    solver: SolverName = None,
    rtol: Rtol = None,
    output: OutputFolder = None,
) -> None:
    """Recommend a tip radius and a depth, by the expected standard error of a parameter.

    The scene file says the specimen as expected, [fit] what will be unknown, [noise] or a curve how well is
    read.

    Example: `underlay plan scene.toml --parameter layer.E --max-depth "200 um"`
    """
    import numpy as np

    from underlay._csv import csv_text
    from underlay.inference.design.planning import plan as plan_tests
    from underlay.inference.from_files import free_of
    from underlay.report import plots
    from underlay.scene.scene_file import read_scene_file

    file = read_scene_file(scene)
    if output is not None:
        ready_folder(output)
    measured = measured_curve(file, curve)
    deepest = deepest_point(file, max_depth, measured)
    free = free_of(file, measured)
    if parameter in file.scene.parameters and parameter not in free:
        free[parameter] = None
        say_warnings([f"{parameter} is planned as unknown too: [fit] does not free it"])
    planned = plan_tests(
        file.scene,
        free=free,
        noise=expected_noise(file, deepest, measured),
        radii=_grid(radii) if radii else _radii_around(file),
        depths=_grid(depths) if depths else np.geomspace(_SHALLOWEST, 1.0, _COUNT) * deepest,
        parameter=parameter,
        solver=wanted_solver(file.solver, solver, rtol),
    )
    say(planned.recommendation)
    if output is not None:
        stem = f"{scene.stem}.plan"
        say(f"wrote {write_atomic(output / f'{stem}.csv', csv_text(planned.to_frame()))}")
        say(f"wrote {plots.save(plots.plan(planned), output / f'{stem}.png')}")


def _radii_around(file: SceneFile) -> FloatArray:
    import numpy as np

    radius = file.scene.parameters.get("indenter.radius")
    if radius is None:
        raise InputError(f"{file.path.name}: the grid varies indenter.radius, which this indenter lacks")
    return np.geomspace(radius / _TIP_FACTOR, radius * _TIP_FACTOR, _COUNT)


def _grid(text: str) -> FloatArray:
    """Read "0.1 mm:2 mm:8" as a geometric grid of lengths (m)."""
    import numpy as np

    from underlay.units import parse_quantity

    parts = text.split(":")
    if len(parts) != 3 or not parts[2].strip().isdigit() or not 2 <= int(parts[2]) <= _MOST:
        raise InputError(
            f'a grid is "from:to:count" with 2 to {_MOST} points, e.g. "0.1 mm:2 mm:8"; got {text!r}'
        )
    low, high = (parse_quantity(part.strip(), "length") for part in parts[:2])
    if not 0.0 < low < high:
        raise InputError(f"a grid runs from a positive length to a larger one; got {text!r}")
    return np.geomspace(low, high, int(parts[2]))
