"""Commands on one curve: `fit`, `demo`, `compare`, `film`, `sample`; and `benchmark`, on curves of known truth."""

from __future__ import annotations

import textwrap
from collections.abc import Iterator
from contextlib import nullcontext
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer
from rich.console import Console

import underlay as ul
from underlay._files import require_writable_folder
from underlay.cli import console
from underlay.cli.console import say, say_parts, say_table, say_warnings, say_written, write_out
from underlay.data.samples import sample as sample_file
from underlay.errors import InputError, gathered_warnings

if TYPE_CHECKING:
    import pandas as pd

    from underlay.inference.compare import Comparison

# Difference of AIC up to which a model is not clearly worse than another (Burnham and Anderson 2002, section 2.6).
_AS_GOOD = 10.0
# Letters on a line of a column's title.
_TITLE = 24
_SAMPLES = (
    ("chiaro_cell_indentation.csv", "chiaro_cell.toml", "A real curve: a cell under an Optics11 Chiaro."),
    ("cartilage_on_bone.csv", "cartilage_on_bone.toml", "Made data: a ball on cartilage on bone."),
)


def fit(
    curve: console.CurveFile,
    scene: console.SceneOption = None,
    solver: console.SolverName = None,
    rtol: console.Rtol = None,
    output: console.OutputFolder = None,
    excel: console.ExcelFile = None,
    details: console.Details = False,
) -> None:
    """Fit a curve with the substrate in the model.

    Example: `underlay fit curve.csv --scene scene.toml --output results`
    """
    from underlay.report.limits import quality_doubts

    scene = console.scene_for(scene, curve, "fit")
    with gathered_warnings() as notes:
        problem = ul.load_problem(curve, scene)
        problem = problem.revised(solver=console.wanted_solver(problem.solver, solver, rtol))
        quality_doubts(problem)
        # Seen on a terminal only: of a draining layer under a sphere a fit may take a minute.
        work = Console(stderr=True).status("fitting; a layer that drains may take a minute")
        with work if any(one.drainage for one in problem.base_scenes) else nullcontext():
            result = ul.fit(problem)
            result.answers  # noqa: B018  they take longest, and are kept
    _show(result, details=details)
    say_warnings(notes if details else [])
    if output is not None:
        from underlay.report.details import write_fit
        from underlay.report.screen import written_line

        say(written_line(write_fit(result, output, curve.stem), output, curve.stem))
    if excel is not None:
        from underlay.report.details import pointwise_of

        by_depth = [found for found in pointwise_of(result) if not isinstance(found, str)]
        say(f"wrote {ul.write_excel(excel, result, *by_depth)}")


def _show(result: ul.Fit, *, details: bool = False) -> None:
    """Print the result of a fit: numbers, verdict, next step, notes; with `details` all that stands behind them."""
    from underlay.report.screen import fit_lines

    say("", *fit_lines(result))
    if details:
        from underlay.report.details import fit_parts, pointwise_of

        say_parts(fit_parts(result, pointwise_of(result)))
    else:
        from underlay.report.tables import notes_of

        say_warnings(notes_of(*result.curves))


def demo(
    output: Annotated[
        Path, typer.Option("--output", "-o", help="Folder for the results; made if absent.")
    ] = Path("underlay-demo"),
) -> None:
    """Fit two sample curves, and write their tables and pictures.

    Example: `underlay demo --output underlay-demo`
    """
    from underlay.report.details import write_fit

    folder, written = require_writable_folder(output), list[Path]()
    for curve, scene, title in _SAMPLES:
        with gathered_warnings():
            result = ul.fit(ul.load_problem(sample_file(curve), sample_file(scene)))
        say(f"\n{title}")
        _show(result)
        written += write_fit(result, folder, Path(curve).stem)
    say("\nThe results are in:", *(f"  {path}" for path in written))
    say(f"\nNext: underlay fit CURVE --scene SCENE.toml (start from {sample_file(_SAMPLES[1][1])})")


def compare(
    curve: console.CurveFile, scene: console.SceneOption = None, output: console.OutputFolder = None
) -> None:
    """Fit one curve with every contact model, and with the layer bonded or free to slip on its substrate.

    Example: `underlay compare curve.csv --scene scene.toml --output results`
    """
    from underlay.report.labels import listed
    from underlay.report.limits import bonds_sentences
    from underlay.scene.scene import has_face

    scene = console.scene_for(scene, curve, "compare")
    with gathered_warnings() as notes:
        problem = ul.load_problem(curve, scene)
        laws = ul.compare(problem)
        faces = all(has_face(one) for one in problem.base_scenes)
        bonds = ul.compare_bonds(problem) if faces else None
    say_table(_laws_shown(laws), f"{curve.name} under each contact model, best first")
    if len(laws.alike) > 1:
        told = f"This curve cannot tell {listed(laws.alike)} apart (AIC within 2)"
        say(f"{told}: the exact model comes first, then those nearest to it.")
    if bonds is not None:
        say("Lower face of the layer", *(f"  {sentence}" for sentence in bonds_sentences(bonds)))
    say_warnings([*_on_the_best(laws), *notes])
    files = {f"{curve.stem}.laws.csv": laws.to_frame().reset_index()}
    write_out(output, files | ({} if bonds is None else {f"{curve.stem}.bonds.csv": bonds.to_frame()}))


def _laws_shown(laws: Comparison) -> pd.DataFrame:
    """Return the sample's numbers by contact model, in units for people; the file has all numbers, and errors."""
    import numpy as np
    import pandas as pd

    from underlay.quantities import path_of
    from underlay.report.labels import is_of_the_sample, label
    from underlay.scene.parameters import kind_of
    from underlay.units import human_unit

    frame = laws.to_frame().reindex(list(laws.order)).rename_axis("contact model")
    # A number that says nothing of the law's error is left empty.
    errors = 100.0 * frame["law error"].where(np.isfinite(frame["law error"]))
    shown = pd.DataFrame({"AIC": frame["AIC"].round(1), "model error (%)": errors.round(3)})
    for name in filter(is_of_the_sample, laws.names):
        unit, factor = human_unit(float(frame[name].abs().median()), kind_of(path_of(name)))
        title = f"{label(name)} ({unit})" if unit else label(name)
        shown["\n".join(textwrap.wrap(title, _TITLE))] = frame[name] / factor
    unit, factor = human_unit(float(frame["rms residual"].min()), "force")
    return shown.assign(**{f"residuals, rms ({unit})": frame["rms residual"] / factor})


def _on_the_best(laws: Comparison) -> Iterator[str]:
    """Yield the notes on models that describe the curve about as well as the best, and why others were refused."""
    frame = laws.to_frame()
    for name, notes, above in zip(frame.index, frame["notes"], frame["AIC"], strict=True):
        # A model that was refused has no AIC.
        if notes and not above >= _AS_GOOD:
            yield f"{name}: {notes}"


def film(
    curve: console.CurveFile,
    scene: console.SceneOption = None,
    calibration: Annotated[
        Path | None, typer.Option(help="Test with the same tip on a sample of known modulus, for its area.")
    ] = None,
    known_modulus: Annotated[
        str | None, typer.Option(help='E / (1 - nu^2) of that sample, e.g. "165 GPa" of (001) silicon.')
    ] = None,
    depth_from: Annotated[str, typer.Option("--from", help="Smallest indentation that is fitted.")] = "0 nm",
    depth_to: Annotated[str, typer.Option("--to", help="Largest indentation that is fitted.")] = "1 m",
    output: console.OutputFolder = None,
) -> None:
    """Fit the contact stiffness S(h) of a film that was indented plastically; the scene's indenter is a cone.

    The parameters of layer and substrate that [fit] lists are fitted. Without a calibration the tip is taken as
    perfect.

    Example: `underlay film oxide.xls --scene film.toml --calibration silicon.xls --known-modulus "165 GPa"`
    """
    from underlay.inference.films import fit_film
    from underlay.report.scene_tables import film_notes, film_table
    from underlay.scene.scene_file import read_scene_file

    scene = console.scene_for(scene, curve, "film")
    found = fit_film(read_scene_file(scene), curve, calibration, known_modulus, (depth_from, depth_to))
    say_table(film_table(found), "Film")
    say(*film_notes(found, perfect=calibration is None))
    if output is not None:
        from underlay.report.details import write_film

        say_written(write_film(found, output, curve.stem))


def sample(
    curve: console.CurveFile,
    scene: console.SceneOption = None,
    output: console.OutputFolder = None,
    walkers: Annotated[int, typer.Option(help="Walkers of the ensemble.")] = 64,
    max_steps: Annotated[
        int | None,
        typer.Option(
            help="Most steps; it stops once converged. By default 20,000, or 5 min of processor time."
        ),
    ] = None,
    seed: console.Seed = 0,
    solver: console.SolverName = None,
    rtol: console.Rtol = None,
    resume: Annotated[
        bool, typer.Option("--resume", help="Continue the chain in the output folder where it stopped.")
    ] = False,
    method: Annotated[
        str | None,
        typer.Option(
            help="emcee for a long chain, importance for weighted draws alone. Without it weighted draws that a "
            "short chain judges; where the two differ the chain goes on and is the answer."
        ),
    ] = None,
    model_error: Annotated[
        bool, typer.Option("--model-error", help="Sample the sizes of friction and finite strain too.")
    ] = False,
    details: console.Details = False,
) -> None:
    """Sample the posterior of the free parameters; each needs a prior or bounds in the scene file.

    A baseline and its slope get wide bounds where they have none, with a note.

    With --output the chain is stored step by step, so that an interrupted run continues with --resume.

    Example: `underlay sample curve.csv --scene scene.toml --output results --max-steps 400`
    """
    from underlay.inference.from_files import problem_from, read_for
    from underlay.report.screen import posterior_lines
    from underlay.scene.scene_file import read_scene_file

    file = read_scene_file(console.scene_for(scene, curve, "sample"))
    part = read_for(file, curve).with_metadata(scene_path=str(file.path))
    problem = problem_from(file, part)
    if resume and method == "importance":
        raise InputError("--resume continues a chain, and weighted draws are none: leave --method out")
    chain = None if method == "importance" else _chain_file(output, curve.stem, resume=resume)
    with gathered_warnings() as notes:
        problem = problem.revised(solver=console.wanted_solver(problem.solver, solver, rtol))
        if model_error:
            problem = ul.free_model_error(problem)
        if problem.noise_is_open:
            say(
                "note: the noise of the force is not given: it is sampled too. It is quicker where you know it: "
                "force in [noise] of the scene file"
            )
        posterior = ul.sample(problem, walkers, max_steps, seed, backend=chain, resume=resume, method=method)
    say("", *posterior_lines(posterior))
    if details:
        from underlay.report.details import posterior_parts

        say_parts(posterior_parts(posterior, {}))
    say_warnings(notes)
    if output is not None:
        from underlay.report.details import write_posterior

        say_written(write_posterior(posterior, output, curve.stem))


def _chain_file(output: Path | None, stem: str, *, resume: bool) -> Path | None:
    if output is None:
        if resume:
            raise InputError("--resume continues the chain of an output folder: name it with --output")
        return None
    return output / f"{stem}.chain"


def benchmark(
    solver: Annotated[
        str | None,
        typer.Option("--solver", help="Score one elastic contact model: exact, halfspace, garcia2018, ..."),
    ] = None,
    program: Annotated[
        str | None,
        typer.Option(
            "--program",
            help="Score another program: its command line, with {curve} for the CSV (SI), {scene} for the scene "
            "file, {answer} for the file that takes the modulus in Pa (else its last printed word), and numbers of "
            "the scene such as {indenter.radius} and {layer.nu}.",
        ),
    ] = None,
    kind: Annotated[
        list[str] | None,
        typer.Option("--kind", help="Kind of sample, e.g. elastic; repeat it for more; all by default."),
    ] = None,
    output: console.OutputFolder = None,
) -> None:
    """Score the accuracy of a fit, a contact model or another program on the open benchmark.

    Thirty synthetic curves with known truth: six kinds of sample, each with five kinds of noise. Without --solver
    and --program the whole model of each scene is fitted. A contact model is also compared with the exact contact
    problem and with finite elements.

    Example: `underlay benchmark --kind elastic`

    Example: `underlay benchmark --solver garcia2018 --kind elastic --output results`
    """
    from underlay.inference.benchmark import Program, against_finite_elements, against_references

    if solver is not None and program is not None:
        raise InputError("--solver and --program do not go together: score one after the other")
    other = None if program is None else Program(program)
    with Console(stderr=True).status("") as line:  # seen on a terminal only
        scores = ul.benchmark(
            solver,
            estimate=other,
            kinds=kind or (),
            progress=lambda case: line.update(f"{case.kind}, {case.noise} noise"),
        )
    say_table(
        scores.summary(), f"{scores.label if program is None else program}: error of the layer's modulus"
    )
    refused = scores.table[scores.table["reason"] != ""]
    reasons = (
        f"no estimate: {kind}: {reason}"
        for kind, reason in zip(refused["kind"], refused["reason"], strict=True)
    )
    say(*dict.fromkeys(reasons))
    tables = {"benchmark.csv": scores.to_frame()}
    if program is None:
        law = solver or "auto"
        tables["benchmark.references.csv"] = against_references(law)
        tables["benchmark.finite_elements.csv"] = against_finite_elements(law)
        say_table(tables["benchmark.references.csv"], f"{law}: force against the exact contact problem")
        say_table(tables["benchmark.finite_elements.csv"], f"{law}: force against finite elements")
    write_out(output, tables)
