"""The report page of a fit: results on one sheet, all further tables and pictures folded below it."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property, partial
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from underlay.inference.least_squares.fit_result import Fit
from underlay.report import details, page, plots, screen
from underlay.report.details import Part, median_scenes, posterior_parts, predicted
from underlay.report.labels import is_of_the_sample, labelled, listed, start
from underlay.report.limits import DistinctScene, distinct_scenes
from underlay.report.methods import cited_works, methods_paragraph, sample_words, tip_words
from underlay.report.plots.style import in_words

if TYPE_CHECKING:
    from underlay.inference.uncertainty.answer import Answer, PointwiseModulus

# Millimetres: two pictures side by side on a sheet of A4.
_HALF = (90.0, 68.0)
# Share of the variance below which an assumption is no advice.
_WORTH = 0.02


@dataclass
class FitPage(page.Page):
    """The report page of a fit; parameters as `Page`."""

    @cached_property
    def answers(self) -> list[Answer]:
        """Parameters of the sample, each with value, interval and uncertainty budget."""
        return [self.result.answer(name) for name in screen.told_names(self.result)]

    @cached_property
    def by_depth(self) -> list[PointwiseModulus | str]:
        """Modulus at each depth of every curve, or the reason why there is none."""
        return details.pointwise_of(self.result)

    @cached_property
    def half_space(self) -> Fit | None:
        """Best fit of the same curve by the half-space formula; None where it does not apply."""
        return screen.half_space_fit(self.result)

    @cached_property
    def tests(self) -> tuple[DistinctScene, ...]:
        """The different scenes of the fit, each with its curves."""
        return distinct_scenes(self.result.scenes, self.result.curves)

    @property
    def title(self) -> str:
        """Name of the first curve, and the number of further ones."""
        return page.name_of_curves(self.result.curves)

    @property
    def about(self) -> str:
        """Tip and sample, segments, depth, time and points."""
        curve, scene = self.result.curves[0], self.result.scene
        deep = in_words(self.tests[0].deepest, "length", digits=2)
        kinds = [str(kind) for kind in dict.fromkeys(curve.segments())]
        time = "" if curve.time is None else f" in {in_words(float(np.ptp(curve.time)), 'time', digits=2)}"
        points = sum(len(curve) for curve in self.result.curves)
        tested = f"{start(tip_words(scene))}, on {sample_words(scene)}"
        return f"{tested} · {listed(kinds)}, {deep} deep{time} · {points} points"

    def head(self) -> str:
        """Return numbers and verdict as HTML, which can be shown before the pictures are drawn."""
        return page.headline(self.answers, self.result.verdict, self.result.curves, self._narrower())

    def sheet(self, *, opened: bool = False) -> str:
        """Return all of the fit's page below its title as HTML; `opened` shows the folded parts."""
        return self.with_foot(
            self.head(),
            page.tag("section", self._curve(0), self._drawing(self.tests[0]), kind="figs"),
            page.tag("section", self._depths(), self._budget(), kind="pair"),
            self._methods(),
            opened=opened,
        )

    def parts(self) -> Iterator[details.Part]:
        """Yield the further curves and scenes, then what stands behind the numbers."""
        others: list[details.Content] = [self._curve(number) for number in range(1, len(self.result.curves))]
        others += map(self._drawing, self.tests[1:])
        yield details.Part("The other curves", f"{len(self.result.curves) - 1} more", others)
        yield from details.fit_parts(self.result, self.by_depth, self.command)

    def _narrower(self) -> str:
        """Say which assumed input, if stated, would narrow the first number; empty unless the verdict is good."""
        if self.result.verdict != "good" or not self.answers:
            return ""
        rows = [
            row for row in self.answers[0].contributions if row.origin == "assumed" and row.share >= _WORTH
        ]
        if not rows:
            return ""
        known = listed([screen.source_words(row.source) for row in rows[:2]])
        letter = screen.name_of(self.answers[0].name)[1]
        return f"To narrow {letter}: state the uncertainty of {known} (assumed here)."

    def _drawing(self, test: DistinctScene) -> str:
        return page.drawing(
            test, self.result.solver, "at the deepest point", screen.assumed_inputs(self.result.curves)
        )

    def _curve(self, number: int) -> str:
        fit = self.result
        draw = partial(plots.fit, fit, curve=number, half_space=self.half_space)
        beside = "" if self.half_space is None else f" {screen.half_space_words(fit, self.half_space)}."
        return page.figure(details.picture("fit", draw, f"fit {number}", more=beside), page.CURVE)

    def _depths(self) -> str:
        pictures, found = details.pictures_of(self.result), self.by_depth[0]
        for name in ("time", "adhesion"):
            if name in pictures:
                return page.figure(pictures[name]._replace(name=name), _HALF)
        if isinstance(found, str):
            return page.tag("p", page.words(details.pointwise_sentence(found)), kind="none")
        known = self.result.answer("layer.E") if "layer.E" in self.result.names else None
        shown = None if self.result.verdict == "reject" else known
        # Intervals of a rejected model are no judge of whether it is constant.
        trend = "" if shown is None else screen.by_depth_words(found)
        draw = partial(plots.pointwise_modulus, found, answer=shown)
        return page.figure(details.picture("depth", draw, trend=f": {trend}" if trend else ""), _HALF)

    def _budget(self) -> str:
        if self.result.verdict == "reject":
            return page.tag("p", "No uncertainty budget: the model is rejected.", kind="none")
        known = next((known for known in self.answers if not known.is_open), None)
        if known is None:
            return page.tag("p", "No uncertainty budget: no number is determined.", kind="none")
        name, letter = screen.name_of(known.name)
        draw = partial(plots.budget, known)
        return page.figure(details.picture("budget", draw, what=name.lower(), letter=letter), _HALF)

    def _methods(self) -> str:
        if self.result.verdict == "reject":
            reason = f"No modulus is reported, because {labelled(self.result.verdict.reason)}."
            return "<h2>Methods paragraph</h2>" + page.tag("p", page.words(reason), kind="none")
        found = self.by_depth[0]
        text = methods_paragraph(self.result, None if isinstance(found, str) else found, self.half_space)
        return page.methods_block(text, cited_works(self.result.used))

    def origin(self) -> Iterator[str]:
        """Yield the file of each curve, or else its points, with their hashes, and the scene file."""
        for entry in self.result.provenance["curves"]:
            known = entry.get("file_sha256")
            name = Path(entry["path"]).name if entry.get("path") else entry.get("name") or "curve"
            yield f"{name} · SHA-256 {known}" if known else f"{name} · points' SHA-256 {entry['data_sha256']}"
        if scene := self.result.provenance["curves"][0].get("scene_path"):
            yield f"scene {Path(scene).name}"


# --- a posterior


@dataclass
class PosteriorPage(page.Page):
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
        # Thousands of draws: as pixels.
        corner = page.figure(details.picture("corner", partial(plots.corner, post)), as_pixels=True)
        return self.with_foot(
            page.headline(answers, post.verdict, curves),
            page.tag("section", first, self._drawing(), kind="figs"),
            corner,
            opened=opened,
        )

    def _drawing(self) -> str:
        problem = self.result.problem
        if problem is None:
            why = screen.WORDS["posterior"]["missing"].format(missing=self.result.missing)
            return page.tag("p", page.words(why), kind="none")
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
