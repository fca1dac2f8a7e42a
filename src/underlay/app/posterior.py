"""The posterior of the curve that is looked at: with progress, a stop, and a chain that goes on from there."""

from __future__ import annotations

from underlay._csv_text import csv_text
from underlay._files import write_atomic
from underlay.app.folder import AnalysisFolder
from underlay.app.kept import keep
from underlay.app.results import rows_of
from underlay.app.shown import Progress, Sampled
from underlay.app.snapshot import Snapshot
from underlay.app.work import Tell
from underlay.data.curve import Curve
from underlay.inference.from_files import problem_from, weak_bounds
from underlay.inference.sampling.run import sample
from underlay.report import plots
from underlay.report.gathered_warnings import gathered_warnings
from underlay.report.posterior_tables import posterior_table
from underlay.report.spoken import spoken
from underlay.report.words import posterior_summary

__all__ = ["sample_posterior"]

_WALKERS, _EVERY = 64, 10
_OPEN_NOISE = "looking for where to begin; no noise is stated, so it is averaged over, which takes longer"
_UNFINISHED = "Its intervals may be wrong: press Sample again, which goes on from there, or allow more steps."


def sample_posterior(
    folder: AnalysisFolder, tested: Snapshot, curve: Curve, most: int, tell: Tell
) -> Sampled:
    """Sample until the chain has converged, `most` steps are done or a stop was asked for; keep what came of it."""
    file, stem, of = tested.file, tested.stem, tested.of
    chain = folder.result(f"{stem}.chain.h5")
    mark = f"{of} {most}".encode()
    if folder.read_result(f"{stem}.chain.txt") != mark:
        chain.unlink(missing_ok=True)
    write_atomic(folder.result(f"{stem}.chain.txt"), mark)

    def step(done: int, needed: int, effective: float) -> None:
        if done % _EVERY == 0:
            words = f"{done} of about {needed} steps; worth {effective:.0f} independent draws so far"
            tell(Progress(done, needed, words))

    with gathered_warnings() as notes:
        problem = problem_from(file, curve, weak_bounds(file, curve))
        tell(Progress(0, most, _OPEN_NOISE if problem.noise_is_open else "looking for where to begin"))
        posterior = sample(problem, _WALKERS, most, backend=chain, resume=chain.exists(), progress=step)
    pictures = []
    for name, draw in (("corner", plots.corner), ("predictive", plots.predictive)):
        plots.save(draw(posterior), folder.result(f"{stem}.{name}.png"))
        pictures.append(f"{stem}.{name}.png")
    posterior.save(folder.result(f"{stem}.posterior.npz"))
    summary = csv_text(posterior.summary().rename_axis("parameter"))
    write_atomic(folder.result(f"{stem}.posterior.csv"), summary)
    words = posterior_summary(posterior).replace("**", "").split("\n\n")
    # What the sampler warns of is the second sentence already; what to do about it is not.
    unfinished = not posterior.converged
    notes = [note for note in notes if not (unfinished and posterior.diagnostics.reason in note)]
    advice = (_UNFINISHED,) if unfinished else ()
    said = (*words[:2], *advice, *words[2:], *map(spoken, notes))
    sampled = Sampled(of, said, rows_of(posterior_table(posterior)), tuple(pictures))
    keep(folder, stem, sampled)
    return sampled
