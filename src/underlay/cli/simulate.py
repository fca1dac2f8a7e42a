"""`underlay simulate`: a scene in, a curve out, with the noise asked for and the truth beside it."""

from __future__ import annotations

import json
import shlex
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from underlay._files import write_atomic
from underlay.cli.console import say
from underlay.cli.expected import deepest_point, doubt_depth, expected_depths
from underlay.cli.options import ScenePath, Seed, named_quantities
from underlay.errors import InputError

if TYPE_CHECKING:
    from underlay.data.curve import Curve
    from underlay.scene.noise import NoiseModel
    from underlay.scene.scene_file import SceneFile

__all__ = ["simulate"]

NoiseOption = Annotated[
    list[str] | None,
    typer.Option(
        "--noise",
        metavar="NAME=VALUE",
        help='One disturbance; repeat it for more: force="2 uN" (white), relative=0.5% (of the force), '
        'depth="3 nm", correlation_time="20 ms", drift="1 uN/s", quantisation="0.5 uN", outliers=1% with '
        'outlier_sd="20 uN". Goes before what [noise] says under the same name; --noise none drops [noise].',
    ),
]
OffsetOption = Annotated[
    list[str] | None,
    typer.Option(
        "--offset",
        metavar="NAME=VALUE",
        help='One offset of the instrument; repeat it for more: contact_depth="5 um", baseline="10 uN", '
        'baseline_slope="0.2 N/m". Goes before what [instrument] says.',
    ),
]


def simulate(
    scene: ScenePath,
    output: Annotated[Path, typer.Option("--output", "-o", help="CSV to write.")] = Path("simulated.csv"),
    seed: Seed = 0,
    noise: NoiseOption = None,
    offset: OffsetOption = None,
    sampling_rate: Annotated[
        str | None,
        typer.Option("--sampling-rate", help='Points per second, e.g. "100 Hz"; else as [simulate] says.'),
    ] = None,
) -> None:
    """Make a curve from a scene, with the noise that --noise and its [noise] section name, and no other.

    The depths are those of the scene's [simulate] section, else a default that is said. Beside the CSV stands a
    JSON file with the truth.

    Example: `underlay simulate scene.toml --output curve.csv --seed 1`

    Example: `underlay simulate scene.toml --output noisy.csv --noise force="2 uN" --noise relative=0.5%`
    """
    from underlay.data.export import curve_csv
    from underlay.scene.scene_file import read_scene_file

    file = read_scene_file(scene)
    if output.exists() and output.samefile(scene):
        raise InputError(f"--output {output} is the scene file: name the CSV to write")
    if file.simulate is None:
        file = replace(file, simulate=expected_depths(file, deepest_point(file, None)))
    else:
        doubt_depth(file.scene, file.simulate.max_depth - file.scene.instrument.contact_depth)
    curve = _made(file, seed, noise or [], offset or [], sampling_rate)
    command = _command(scene, output, seed, noise or [], offset or [], sampling_rate)
    truth = {"command": command, "seed": seed, "truth": dict(curve.truth or {})}
    say(f"wrote {write_atomic(output, curve_csv(curve, [f'made by: {command}']))}")
    text = json.dumps(truth, indent=2) + "\n"
    say(f"wrote {write_atomic(output.with_suffix('.truth.json'), text)}")


def _made(file: SceneFile, seed: int, noise: list[str], offset: list[str], rate: str | None) -> Curve:
    """The curve of a scene file with what the options change."""
    from underlay._arrays import positive
    from underlay.data.synthetic import Disturbances, synthesize
    from underlay.data.synthetic import simulate as noiseless
    from underlay.scene.instrument import Instrument
    from underlay.scene.noise import Noise
    from underlay.units import parse_quantity

    if file.simulate is None:
        raise InputError(f"{file.path.name} has no [simulate] section")
    given = [text for text in noise if text.strip() != "none"]
    stated = file.noise if len(given) == len(noise) else None
    kind = Noise if stated is None else type(stated)
    of_noise, of_others, of_instrument = _kinds(kind), _kinds(Disturbances), _kinds(Instrument)
    of_instrument.pop("compliance")
    written = {} if stated is None else {name: getattr(stated, name) for name in of_noise}
    numbers = {**written, **named_quantities("--noise", given, {**of_noise, **of_others})}
    offsets = named_quantities("--offset", offset, of_instrument)
    scene = file.scene.with_values({f"instrument.{name}": value for name, value in offsets.items()})
    if numbers.get("outlier_sd") and not numbers.get("outliers"):
        raise InputError("outlier_sd is the size of outliers; say how many too, e.g. --noise outliers=1%")
    others = Disturbances(**{name: numbers[name] for name in of_others if name in numbers})
    model = _noise_model(kind, {name: numbers[name] for name in of_noise if numbers.get(name)})
    clock: dict[str, Any]
    depth, clock = file.simulate.depth, {"time": file.simulate.time}
    if rate is not None:
        hertz = positive(parse_quantity(rate, "frequency"), "--sampling-rate", "Hz")
        if file.simulate.is_timed:
            depth, time = file.simulate.motion.sampled(sampling_rate=hertz)
            clock = {"time": time}
        else:
            clock = {"sampling_rate": hertz}
    if model is None and others == Disturbances() and rate is None:
        return noiseless(scene, depth, **clock, solver=file.solver)
    return synthesize(scene, depth, model, seed, **clock, disturbances=others, solver=file.solver)


def _kinds(declared: type) -> dict[str, str]:
    """Names that an option takes, with the kind of each: the quantities that a class declares."""
    from underlay.quantities import field_quantities

    return {name: known.kind for name, known in field_quantities(declared).items()}


def _noise_model(kind: type[NoiseModel], numbers: Mapping[str, float]) -> NoiseModel | None:
    """The noise model of what is not zero; none of nothing."""
    if not numbers:
        return None
    if set(numbers) == {"correlation_time"}:
        raise InputError(
            'correlation_time says how long a noise lasts; name the noise too, e.g. --noise force="2 uN"'
        )
    return kind(**numbers)


def _command(
    scene: Path, output: Path, seed: int, noise: list[str], offset: list[str], rate: str | None
) -> str:
    words = ["underlay", "simulate", scene.name, "--output", output.name, "--seed", str(seed)]
    words += [word for text in noise for word in ("--noise", text)]
    words += [word for text in offset for word in ("--offset", text)]
    words += ["--sampling-rate", rate] if rate is not None else []
    return shlex.join(words)
