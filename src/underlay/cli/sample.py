"""`underlay sample`: the posterior of a curve, by Markov chain Monte Carlo."""

from __future__ import annotations

import importlib.util
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from underlay._files import write_atomic
from underlay.cli.console import say, say_table, say_warnings
from underlay.cli.options import (
    CurveFile,
    OutputFolder,
    Rtol,
    SceneOption,
    Seed,
    SolverName,
    ready_folder,
    wanted_solver,
)
from underlay.errors import InputError, installing
from underlay.report.spoken import gathered_warnings

if TYPE_CHECKING:
    from underlay.inference.sampling.posterior import Posterior

__all__ = ["sample"]


def sample(
    curve: CurveFile,
    scene: SceneOption,
    output: OutputFolder = None,
    walkers: Annotated[int, typer.Option(help="Walkers of the ensemble.")] = 64,
    max_steps: Annotated[
        int | None,
        typer.Option(
            help="Most steps; it stops once converged. By default 20,000, or 5 min of processor time."
        ),
    ] = None,
    seed: Seed = 0,
    solver: SolverName = None,
    rtol: Rtol = None,
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
        bool,
        typer.Option("--model-error", help="Sample the sizes of friction and finite strain too."),
    ] = False,
) -> None:
    """Sample the posterior of the free parameters; each needs a prior or bounds in the scene file.

    A baseline and its slope without any are given weak ones, which is said.

    With --output the chain is kept step by step, so that an interrupted run continues with --resume.

    Example: `underlay sample curve.csv --scene scene.toml --output results --max-steps 400`
    """
    from underlay.inference.from_files import problem_from, read_for, weak_bounds
    from underlay.inference.sampling.run import sample as sample_posterior
    from underlay.inference.uncertainty.known_errors import free_model_error
    from underlay.report.posterior_tables import posterior_table, prior_table
    from underlay.scene.scene_file import read_scene_file

    file = read_scene_file(scene)
    part = read_for(file, curve).with_metadata(scene_path=str(file.path))
    weak = weak_bounds(file, part)
    problem = problem_from(file, part, weak)
    if resume and method == "importance":
        raise InputError("--resume continues a chain, and weighted draws are none: leave --method out")
    if output is not None:
        ready_folder(output)
    chain = None if method == "importance" else _chain_file(output, curve.stem, resume=resume)
    with gathered_warnings() as notes:
        problem = problem.revised(solver=wanted_solver(problem.solver, solver, rtol))
        if model_error:
            problem = free_model_error(problem)
        if problem.noise_is_open:
            say(
                "note: no noise is stated, so it is averaged over, and misfit with it. A noise that is known tells "
                "more and is quicker: force in [noise] of the scene file"
            )
        posterior = sample_posterior(
            problem, walkers, max_steps, seed, backend=chain, resume=resume, method=method
        )
    say_table(posterior_table(posterior), f"Posterior of {curve.name}")
    say_table(prior_table(posterior), "What the data told")
    say(posterior.diagnostics.reason)
    if weak:
        notes.append(f"{', '.join(weak)}: sampled within ten spans of the curve, for want of bounds in [fit]")
    say_warnings(notes)
    if output is not None:
        for path in _write(posterior, output, curve.stem):
            say(f"wrote {path}")


def _chain_file(output: Path | None, stem: str, *, resume: bool) -> Path | None:
    if output is None:
        if resume:
            raise InputError("--resume continues the chain of an output folder: name it with --output")
        return None
    if importlib.util.find_spec("h5py") is None and not resume:
        say(f"note: h5py is not installed, so this run cannot be resumed ({installing('uq')})")
        return None
    return output / f"{stem}.chain.h5"


def _write(posterior: Posterior, folder: Path, stem: str) -> list[Path]:
    """Write table, draws and pictures; return the files."""
    from underlay._csv import csv_text
    from underlay.report import plots

    draws = folder / f"{stem}.posterior.npz"
    posterior.save(draws)
    return [
        write_atomic(
            folder / f"{stem}.posterior.csv", csv_text(posterior.summary().rename_axis("parameter"))
        ),
        draws,
        plots.save(plots.corner(posterior), folder / f"{stem}.corner.png"),
        plots.save(plots.predictive(posterior), folder / f"{stem}.predictive.png"),
    ]
