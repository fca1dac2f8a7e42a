"""Commands on a test before it is made: `plan`, `identify`, `effects`, `accuracy`, `simulate`.

A scene alone says neither how deep the tip goes nor how noisy the force is: these come from the options, a measured
curve, the scene file, or else a default, which is printed.
"""

from __future__ import annotations

import json
import shlex
from dataclasses import replace
from functools import cached_property, partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

import underlay as ul
from underlay._files import write_atomic
from underlay.cli import console
from underlay.cli.console import say, say_table, say_warnings, write_out
from underlay.errors import InputError
from underlay.units import format_quantity, parse_quantity

if TYPE_CHECKING:
    from underlay._arrays import FloatArray
    from underlay.scene.noise import NoiseModel
    from underlay.scene.program import SimulatedDepths

# A grid without being asked: a factor of five around the tip at hand, a tenth of the depth up to all of it.
_TIP_FACTOR, _SHALLOWEST, _COUNT = 5.0, 0.1, 8
_MOST = 60

RadiiOption = Annotated[
    str | None, typer.Option(help='Tip radii to consider, "from:to:count", e.g. "0.1 mm:2 mm:8".')
]
DepthsOption = Annotated[str | None, typer.Option(help='Indentations to consider, e.g. "10 um:200 um:8".')]
_NOISE_SHARE = 0.01
# Share of the readings before contact, as `underlay plan` takes it.
_APPROACH, _POINTS = 0.25, 200


class _Test:
    """A test that is to be made, as its scene file and the options describe it.

    Parameters
    ----------
    scene : Path
        The scene file.
    curve, max_depth, solver, rtol
        What the options of these names were given; each goes before what the scene file says.
    """

    def __init__(
        self,
        scene: Path,
        curve: Path | None = None,
        max_depth: str | None = None,
        solver: str | None = None,
        rtol: float | None = None,
    ) -> None:
        from underlay.scene.scene_file import read_scene_file

        file = read_scene_file(scene)
        self.file = replace(file, solver=console.wanted_solver(file.solver, solver, rtol))
        self.scene, self.solver = file.scene, self.file.solver
        self._curve, self._depth = curve or file.curve_path, max_depth

    @cached_property
    def curve(self) -> ul.Curve | None:
        """The curve given by --curve, else the one that the scene file names; None if there is neither."""
        from underlay.inference.from_files import read_for

        return None if self._curve is None else read_for(self.file, self._curve)

    @cached_property
    def deepest(self) -> float:
        """Largest indentation (m), from the contact point.

        It is that of the option ``--max-depth``, else of the curve, else of [simulate], else a default, which is
        printed.
        """
        from underlay.scene.program import default_depth

        contact = self.scene.instrument.contact_depth
        if self._depth is not None:
            depth = parse_quantity(self._depth, "length")
        elif self.curve is not None:
            stated = "instrument.contact_depth" in self.file.stated
            first = contact if stated else ul.find_contact(self.curve, scene=self.scene).depth
            depth = float(self.curve.depth.max()) - first
        elif self.file.simulate is not None:
            depth = self.file.simulate.max_depth - contact
        else:
            depth = default_depth(self.scene)
            told = f"pressed to {format_quantity(depth, 'length')} by default"
            say_warnings(
                [f"{told}; --max-depth, --curve, [simulate] max_depth or [curve] file says otherwise"]
            )
        if not depth > 0.0:
            raise InputError(f"the deepest point since contact must be positive; got {depth:.6g} m")
        self.doubt(depth)
        return depth

    def doubt(self, depth: float) -> None:
        """Warn where an indentation (m) exceeds the layer's thickness."""
        from underlay.mechanics.contact_law import DeeperThanLayer

        doubt = DeeperThanLayer.of(depth, self.scene.layer.thickness)
        say_warnings([] if doubt is None else [str(doubt)])

    @property
    def noise(self) -> NoiseModel:
        """The noise of [noise], else the scatter of the curve, else 1 % of the largest force, with a note."""
        import numpy as np

        from underlay.inference.model.members import scatter
        from underlay.scene.noise import Noise

        if self.file.noise is not None:
            return self.file.noise
        if self.curve is not None and (spread := scatter(self.curve)) > 0.0:
            say_warnings([f"noise {format_quantity(spread, 'force')}, as the curve scatters"])
            return Noise(force=spread)
        ideal = replace(self.scene, instrument=type(self.scene.instrument)())
        force = _NOISE_SHARE * float(ideal.force(np.array([self.deepest]), solver=self.solver)[0])
        told = f"noise {format_quantity(force, 'force')} by default, {_NOISE_SHARE:.0%} of the force"
        say_warnings([f"{told} at the deepest point; [noise] force or --curve says otherwise"])
        return Noise(force=force)

    @property
    def record(self) -> tuple[FloatArray, FloatArray] | None:
        """Depths since contact (m) and times (s) of a sample that remembers, of the curve or [simulate]."""
        if self.scene.memory is None:
            return None
        if self.curve is not None:
            depth, time = self.curve.depth, self.curve.time
        elif self.file.simulate is not None:
            depth, time = self.file.simulate.depth, self.file.simulate.time
        else:
            return None
        return None if time is None else (depth - (depth.max() - self.deepest), time)

    @property
    def depths(self) -> SimulatedDepths:
        """The depth readings of [simulate], else a ramp of 200 points, a quarter of them before contact."""
        from underlay.scene.program import SimulatedDepths

        if self.file.simulate is not None:
            return self.file.simulate
        contact = self.scene.instrument.contact_depth
        before = _APPROACH / (1.0 - _APPROACH) * self.deepest
        return SimulatedDepths(contact + self.deepest, contact - before, _POINTS)


def plan(
    scene: console.ScenePath,
    parameter: Annotated[str, typer.Option(help="Parameter that the test is to determine.")] = "layer.E",
    radii: RadiiOption = None,
    depths: DepthsOption = None,
    max_depth: console.MaxDepth = None,
    curve: console.CurveOption = None,
    solver: console.SolverName = None,
    rtol: console.Rtol = None,
    output: console.OutputFolder = None,
) -> None:
    """Recommend a tip radius and a depth, by the expected standard error of a parameter.

    The scene file describes the expected specimen, its [fit] section what will be unknown, and [noise] or a
    measured curve the noise of the force.

    Example: `underlay plan scene.toml --parameter layer.E --max-depth "200 um"`
    """
    import numpy as np

    from underlay.inference.from_files import free_of
    from underlay.report.labels import labelled

    test = _Test(scene, curve, max_depth, solver, rtol)
    deepest, free = test.deepest, free_of(test.file, test.curve)
    if parameter in test.scene.parameters and parameter not in free:
        free[parameter] = None
        say_warnings([f"{parameter} is planned as unknown too: [fit] does not free it"])
    radius = test.scene.parameters.get("indenter.radius")
    if radii is not None:
        tips = _grid(radii)
    elif radius is not None:
        tips = np.geomspace(radius / _TIP_FACTOR, radius * _TIP_FACTOR, _COUNT)
    else:
        raise InputError(f"{scene.name}: the grid varies indenter.radius, which this indenter lacks")
    planned = ul.plan(
        test.scene,
        free=free,
        noise=test.noise,
        radii=tips,
        depths=np.geomspace(_SHALLOWEST, 1.0, _COUNT) * deepest if depths is None else _grid(depths),
        parameter=parameter,
        solver=test.solver,
        record=test.record,
    )
    say(labelled(planned.recommendation))
    stem = f"{scene.stem}.plan"
    write_out(output, {f"{stem}.csv": planned.to_frame(), f"{stem}.png": lambda: ul.plots.plan(planned)})


def _grid(text: str) -> FloatArray:
    """Read "0.1 mm:2 mm:8" as a geometric grid of lengths (m)."""
    import numpy as np

    parts = text.split(":")
    if len(parts) != 3 or not parts[2].strip().isdigit() or not 2 <= int(parts[2]) <= _MOST:
        raise InputError(
            f'a grid is "from:to:count" with 2 to {_MOST} points, e.g. "0.1 mm:2 mm:8"; got {text!r}'
        )
    low, high = (parse_quantity(part.strip(), "length") for part in parts[:2])
    if not 0.0 < low < high:
        raise InputError(f"a grid runs from a positive length to a larger one; got {text!r}")
    return np.geomspace(low, high, int(parts[2]))


def identify(
    scene: console.ScenePath,
    curve: console.CurveOption = None,
    solver: console.SolverName = None,
    rtol: console.Rtol = None,
    output: console.OutputFolder = None,
) -> None:
    """Show which combinations of the free parameters a test determines, and how well.

    Before a test, the scene file's [simulate] and [noise] sections say what it will be.

    Example: `underlay identify scene.toml --curve curve.csv`
    """
    from underlay.inference.from_files import free_of, problem_from
    from underlay.report.labels import labelled

    test = _Test(scene, curve, None, solver, rtol)
    if test.curve is not None:
        told = ul.identifiability(problem_from(test.file, test.curve))
    else:
        steps = test.depths
        told = ul.identifiability(
            test.scene,
            depth=steps.depth,
            time=steps.time,
            free=free_of(test.file),
            noise=test.noise,
            solver=test.solver,
        )
    say(labelled(told.report()))
    stem = f"{scene.stem}.identifiability"
    write_out(output, {f"{stem}.csv": told.to_frame(), f"{stem}.png": lambda: ul.plots.identifiability(told)})


def effects(
    scene: console.ScenePath,
    max_depth: console.MaxDepth = None,
    curve: console.CurveOption = None,
    solver: console.SolverName = None,
    rtol: console.Rtol = None,
    output: console.OutputFolder = None,
) -> None:
    """List the effects that matter for a scene: size, change of a fit without it, cost.

    Example: `underlay effects scene.toml --max-depth "100 um" --output results`
    """
    from underlay.scene.effects import effects_table

    test = _Test(scene, curve, max_depth, solver, rtol)
    told = (test.scene, test.deepest, test.solver)
    table = effects_table(*told)
    on_fits = ul.effects_on_answers(*told).drop(columns="effect")
    law, notes = table.attrs["law"], table.pop("note")
    table = table.join(on_fits).assign(note=notes)
    say_table(table, f"Effects of {scene.name} at {format_quantity(test.deepest, 'length')}")
    say("E and h: what leaving an effect out of a fit does to modulus and thickness (%)")
    say(f"law: {law}")
    stem = f"{scene.stem}.effects"
    write_out(output, {f"{stem}.csv": table, f"{stem}.png": partial(ul.plots.effects, *told)})


def accuracy(
    scene: console.ScenePath,
    max_depth: console.MaxDepth = None,
    curve: console.CurveOption = None,
    output: console.OutputFolder = None,
    quick: Annotated[
        bool, typer.Option("--quick", help="The force alone; fits and sampling take some ten seconds.")
    ] = False,
) -> None:
    """Compare error and time of every contact model for a scene: of the force, the modulus and the posterior.

    Example: `underlay accuracy scene.toml --max-depth "100 um" --output results`
    """
    from underlay.report.tables import accuracy_summary, answer_summary
    from underlay.scene.accuracy_cost import accuracy_cost

    test = _Test(scene, curve, max_depth)
    told, deepest = test.scene, test.deepest
    table = accuracy_cost(told, deepest)
    facts = table.attrs
    say_table(
        accuracy_summary(table),
        f"{scene.name}, {facts['points']} depths to {format_quantity(deepest, 'length')}, "
        f"a/h = {facts['a_over_h']:.2g}; (x): times the {1e6 * facts['unit_seconds']:.0f} us of the formula",
    )
    tables = {"accuracy": table}
    if not quick:
        answers = tables["answers"] = ul.answer_cost(told, deepest)
        unit = f"(x): times the {1e3 * answers.attrs['unit_seconds']:.1f} ms of lmfit's Hertz fit"
        say_table(
            answer_summary(answers),
            f"Fits of the scene's own curve, {answers.attrs['points']} points; {unit}",
        )
        posterior = tables["posterior"] = ul.posterior_cost(told, deepest)
        floor = posterior.attrs["reference_error"]
        say_table(posterior, f"Error of posterior quantiles (sd); the reference itself is off by {floor:.2g}")
    title = f"{scene.stem}, a/h = {facts['a_over_h']:.2g}"
    files: dict[str, Any] = {f"{scene.stem}.{name}.csv": found for name, found in tables.items()}
    files[f"{scene.stem}.accuracy.png"] = lambda: ul.plots.what_accuracy_costs(
        *tables.values(), title=title
    ).axes[0]
    write_out(output, files)


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
    scene: console.ScenePath,
    output: Annotated[Path, typer.Option("--output", "-o", help="CSV to write.")] = Path("simulated.csv"),
    seed: console.Seed = 0,
    noise: NoiseOption = None,
    offset: OffsetOption = None,
    sampling_rate: Annotated[
        str | None,
        typer.Option("--sampling-rate", help='Points per second, e.g. "100 Hz"; else as [simulate] says.'),
    ] = None,
) -> None:
    """Make a curve from a scene, with the noise that --noise and its [noise] section name, and no other.

    The depths are those of the scene's [simulate] section, else a default that is printed. The true parameters are
    written to a JSON file beside the CSV.

    Example: `underlay simulate scene.toml --output curve.csv --seed 1`

    Example: `underlay simulate scene.toml --output noisy.csv --noise force="2 uN" --noise relative=0.5%`
    """
    from underlay.data.export import curve_csv

    test = _Test(scene)
    if output.exists() and output.samefile(scene):
        raise InputError(f"--output {output} is the scene file: name the CSV to write")
    if test.file.simulate is not None:
        test.doubt(test.file.simulate.max_depth - test.scene.instrument.contact_depth)
    curve = _made(test, seed, noise or [], offset or [], sampling_rate)
    command = _command(scene, output, seed, noise or [], offset or [], sampling_rate)
    truth = {"command": command, "seed": seed, "truth": dict(curve.truth or {})}
    say(f"wrote {write_atomic(output, curve_csv(curve, [f'made by: {command}']))}")
    text = json.dumps(truth, indent=2) + "\n"
    say(f"wrote {write_atomic(output.with_suffix('.truth.json'), text)}")


def _made(test: _Test, seed: int, noise: list[str], offset: list[str], rate: str | None) -> ul.Curve:
    """Make the curve of a scene file, with noise, instrument offsets and sampling rate of the options."""
    from underlay._arrays import positive
    from underlay.quantities import field_quantities
    from underlay.scene.instrument import Instrument
    from underlay.scene.noise import Noise

    file, steps = test.file, test.depths
    given = [text for text in noise if text.strip() != "none"]
    stated = file.noise if len(given) == len(noise) else None
    kind = Noise if stated is None else type(stated)
    # The names that an option takes, each with its kind of quantity, as dataclasses declare them.
    of_noise, of_others, of_instrument = (
        {name: known.kind for name, known in field_quantities(declared).items()}
        for declared in (kind, ul.Disturbances, Instrument)
    )
    of_instrument.pop("compliance")
    written = {} if stated is None else {name: getattr(stated, name) for name in of_noise}
    numbers = {**written, **console.named_quantities("--noise", given, {**of_noise, **of_others})}
    offsets = console.named_quantities("--offset", offset, of_instrument)
    scene = file.scene.with_values({f"instrument.{name}": value for name, value in offsets.items()})
    if numbers.get("outlier_sd") and not numbers.get("outliers"):
        raise InputError("outlier_sd is the size of outliers; say how many too, e.g. --noise outliers=1%")
    others = ul.Disturbances(**{name: numbers[name] for name in of_others if name in numbers})
    sizes = {name: numbers[name] for name in of_noise if numbers.get(name)}
    if set(sizes) == {"correlation_time"}:
        raise InputError(
            'correlation_time says how long a noise lasts; name the noise too, e.g. --noise force="2 uN"'
        )
    model = kind(**sizes) if sizes else None
    depth, clock = steps.depth, dict[str, Any](time=steps.time)
    if rate is not None:
        hertz = positive(parse_quantity(rate, "frequency"), "--sampling-rate", "Hz")
        if steps.is_timed:
            depth, time = steps.motion.sampled(sampling_rate=hertz)
            clock = {"time": time}
        else:
            clock = {"sampling_rate": hertz}
    if model is None and others == ul.Disturbances() and rate is None:
        return ul.simulate(scene, depth, **clock, solver=file.solver)
    return ul.synthesize(scene, depth, model, seed, **clock, disturbances=others, solver=file.solver)


def _command(
    scene: Path, output: Path, seed: int, noise: list[str], offset: list[str], rate: str | None
) -> str:
    words = ["underlay", "simulate", scene.name, "--output", output.name, "--seed", str(seed)]
    words += [word for text in noise for word in ("--noise", text)]
    words += [word for text in offset for word in ("--offset", text)]
    words += ["--sampling-rate", rate] if rate is not None else []
    return shlex.join(words)
