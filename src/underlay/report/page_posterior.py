"""The report page of a posterior: numbers and pictures on one sheet, tables folded below it."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from underlay._door import sha256_of
from underlay.report import plots, posterior_tables, tables
from underlay.report.labels import is_of_the_sample, label
from underlay.report.limits import distinct_scenes
from underlay.report.methods import listed, sample_words, tip_words
from underlay.report.page import Detail, details, document, figure, pixels, table, tag, words
from underlay.report.page_fit import drawing, footer, headline, masthead, sized
from underlay.report.scene_tables import scene_table

if TYPE_CHECKING:
    from underlay.inference.sampling.posterior import Posterior
    from underlay.scene.scene import Scene

__all__ = ["PosteriorPage"]

# Millimetres: the curve with its bands.
_CURVE = (126.0, 86.0)
_MISSING = (
    "The test is not shown: this posterior does not hold its scene ({missing}). With the curve and the scene file "
    "that were sampled it can be: underlay report POSTERIOR.npz CURVE --scene SCENE.toml."
)


@dataclass
class PosteriorPage:
    """The report page of a posterior.

    Parameters
    ----------
    posterior : Posterior
        The result to show.
    day, command : str
        Date on the page, and the command line that repeats the sampling.
    files : sequence of path
        Files whose SHA-256 the page states.
    """

    posterior: Posterior
    day: str
    command: str = ""
    files: Sequence[Path] = ()

    def html(self, *, opened: bool = False) -> str:
        """Return the page as an HTML document; `opened` shows the folded parts."""
        head = masthead(self.day, f"{self._name()}: posterior", self._about())
        return document(f"{self._name()}: posterior of an indentation test", head, self.sheet(opened=opened))

    def sheet(self, *, opened: bool = False) -> str:
        """Return all of the posterior's page below its title as HTML; `opened` shows the folded parts."""
        post = self.posterior
        answers = [post.answer(name) for name in post.names if is_of_the_sample(name)]
        facts = [f"{path.name} · SHA-256 {sha256_of(path)}" for path in self.files]
        blocks = [
            headline(answers, post.verdict, () if post.problem is None else post.problem.curves),
            tag("section", self._predicted(0), self._drawing(), kind="figs"),
            self._corner(),
            footer(*facts, *self._origin(), command=self.command),
            details(self._details(), opened=opened),
        ]
        return "\n".join(blocks)

    def _name(self) -> str:
        problem = self.posterior.problem
        if problem is None:
            return self.files[0].name if self.files else "one curve"
        more = len(problem.curves) - 1
        name = str(problem.curves[0].metadata.get("name") or "one curve")
        return f"{name} and {more} more" if more else name

    def _about(self) -> str:
        problem, draws = self.posterior.problem, f"{len(self.posterior.samples)} draws"
        if problem is None:
            return draws
        scene = problem.base_scenes[0]
        return f"{tip_words(scene)}, on {sample_words(scene)} · {draws}"

    def _predicted(self, number: int) -> str:
        if number >= len(self.posterior.predictive):
            return ""
        ax = sized(_CURVE, lambda panel: plots.predictive(self.posterior, curve=number, ax=panel))
        caption = "Where the model and a new reading lie with 95 % probability. Below: less the median."
        alt = "Measured force against depth with bands of the model and of new readings."
        return figure(ax, f"predicted {number}", alt, "Data and prediction.", caption)

    def _scenes(self) -> tuple[Scene, ...]:
        problem = self.posterior.problem
        if problem is None:
            return ()
        return problem.scenes(problem.vector(dict(self.posterior.samples.median())))

    def _drawing(self) -> str:
        problem = self.posterior.problem
        if problem is None:
            return tag("p", words(_MISSING.format(missing=self.posterior.missing)), kind="none")
        tests = distinct_scenes(self._scenes(), problem.curves)
        return tag("div", *(drawing(test, problem.solver, "at the median") for test in tests))

    def _corner(self) -> str:
        caption = (
            "Blue: the draws, with the regions that hold 68 and 95 %. Orange: what was known before the test."
        )
        alt = "Corner plot: the distribution of every parameter and of every pair."
        # Thousands of draws: as pixels.
        return pixels(plots.corner(self.posterior), alt, f"Parameter by parameter, pair by pair. {caption}")

    def _origin(self) -> Iterator[str]:
        for entry in self.posterior.provenance["curves"]:
            yield f"{entry.get('name') or 'curve'} · points' SHA-256 {entry['data_sha256']}"

    def _details(self) -> Iterator[Detail]:
        post = self.posterior
        names = listed([label(name) for name in post.names])
        yield "Parameters", names, [table(posterior_tables.posterior_table(post))]
        more = [self._predicted(number) for number in range(1, len(post.predictive))]
        yield "The other curves", "", more
        yield (
            "What the data add",
            "each parameter before and after the test",
            [table(posterior_tables.prior_table(post))],
        )
        yield "Diagnostics of the sampling", "", [table(posterior_tables.posterior_diagnostics_table(post))]
        scenes = self._scenes()
        yield "The test in numbers", "", [table(scene_table(*scenes))] if scenes else []
        facts = {"to repeat": self.command} if self.command else {}
        files = [str(path) for path in self.files]
        yield "Where this comes from", "", [table(tables.provenance_table(post, facts, *files))]
