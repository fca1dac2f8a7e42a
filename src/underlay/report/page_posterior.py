"""The report page of a posterior: numbers and pictures on one sheet, tables folded below it."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from functools import partial

from underlay.inference.sampling.posterior import Posterior
from underlay.report import page, plots
from underlay.report.details import Part, Picture, median_scenes, posterior_parts, predicted
from underlay.report.labels import is_of_the_sample
from underlay.report.limits import distinct_scenes
from underlay.report.methods import sample_words, tip_words

_BLUE = "Blue: the draws, with the regions that hold 68 and 95 %. Orange: what was known before the test."
_MISSING = (
    "The test is not shown: this posterior does not hold its scene ({missing}). With the curve and the scene file "
    "that were sampled it can be: underlay report POSTERIOR.npz CURVE --scene SCENE.toml."
)


@dataclass
class PosteriorPage(page.Page[Posterior]):
    """The report page of a posterior; parameters as `Page`."""

    @property
    def title(self) -> str:
        """Name of the first curve, or of the file of the posterior, and the number of further curves."""
        problem = self.result.problem
        if problem is not None:
            return f"{page.name_of_curves(problem.curves)}: posterior"
        return f"{self.files[0].name if self.files else 'one curve'}: posterior"

    @property
    def about(self) -> str:
        """Tip and sample, as far as they are known, and the number of draws."""
        problem, draws = self.result.problem, f"{len(self.result.samples)} draws"
        if problem is None:
            return draws
        scene = problem.base_scenes[0]
        return f"{tip_words(scene)}, on {sample_words(scene)} · {draws}"

    def sheet(self, *, opened: bool = False) -> str:
        """Return all of the posterior's page below its title as HTML; `opened` shows the folded parts."""
        post = self.result
        answers = [post.answer(name) for name in post.names if is_of_the_sample(name)]
        curves = () if post.problem is None else post.problem.curves
        first = page.figure(predicted(post, 0), page.CURVE) if post.predictive else ""
        alt = "Corner plot: the distribution of every parameter and of every pair."
        # Thousands of draws: as pixels.
        return self.with_foot(
            page.headline(answers, post.verdict, curves),
            page.tag("section", first, self._drawing(), kind="figs"),
            page.figure(
                Picture(
                    "corner", partial(plots.corner, post), alt, "Parameter by parameter, pair by pair.", _BLUE
                ),
                as_pixels=True,
            ),
            opened=opened,
        )

    def _drawing(self) -> str:
        problem = self.result.problem
        if problem is None:
            return page.tag("p", page.words(_MISSING.format(missing=self.result.missing)), kind="none")
        tests = distinct_scenes(median_scenes(self.result), problem.curves)
        return page.tag("div", *(page.drawing(test, problem.solver, "at the median") for test in tests))

    def origin(self) -> Iterator[str]:
        """Yield the files with their hashes, and each curve with that of its points."""
        yield from super().origin()
        for entry in self.result.provenance["curves"]:
            yield f"{entry.get('name') or 'curve'} · points' SHA-256 {entry['data_sha256']}"

    def parts(self) -> Iterator[Part]:
        """Return what stands behind the numbers, as `posterior_parts`."""
        return posterior_parts(self.result, self.facts, *map(str, self.files))
