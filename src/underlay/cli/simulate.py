"""`underlay simulate`: a scene in, a curve out, with the noise asked for and the truth beside it."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Annotated

import typer

from underlay._files import write_atomic
from underlay.cli.console import say
from underlay.cli.options import ScenePath, Seed
from underlay.data.curve_csv import curve_csv
from underlay.data.noise import Noise
from underlay.data.synthetic import simulate as noiseless
from underlay.data.synthetic import synthesize
from underlay.errors import InputError
from underlay.scene.scene_file import read_scene_file

__all__ = ["simulate"]


def simulate(
    scene: ScenePath,
    output: Annotated[Path, typer.Option("--output", "-o", help="CSV to write.")] = Path("simulated.csv"),
    seed: Seed = 0,
) -> None:
    """Make a curve from a scene, with the noise its [noise] section names.

    The depths are those of the scene's [simulate] section. Beside the CSV stands a JSON file with the truth.

    Example: `underlay simulate scene.toml --output curve.csv --seed 1`
    """
    file = read_scene_file(scene)
    if file.simulate is None:
        raise InputError(
            f"{scene.name} has no [simulate] section; add one, e.g. max_depth = '100 um' and points = 200"
        )
    depth, clock = file.simulate.depth, file.simulate.time
    if file.noise:
        curve = synthesize(file.scene, depth, Noise(**file.noise), seed, time=clock, **file.solver)
    else:
        curve = noiseless(file.scene, depth, time=clock, **file.solver)
    command = f"underlay simulate {scene.name} --output {output.name} --seed {seed}"
    truth = {"command": command, "seed": seed, "truth": dict(curve.truth or {})}
    say(f"wrote {write_atomic(output, curve_csv(curve, [f'made by: {command}']))}")
    text = json.dumps(truth, indent=2) + "\n"
    say(f"wrote {write_atomic(output.with_suffix('.truth.json'), text)}")
