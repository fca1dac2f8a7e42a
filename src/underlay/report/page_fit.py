"""The report page of a fit: results on one sheet, all further tables and pictures folded below it."""

from __future__ import annotations

import math
import platform
import re
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
import pandas as pd

from underlay._version import VERSION
from underlay.data.segments import LOADING
from underlay.errors import UnderlayError
from underlay.quantities import path_of
from underlay.report import adhesion_tables, plots, tables
from underlay.report.fit_files import pointwise_sentence, pointwise_table
from underlay.report.labels import label, labelled, start
from underlay.report.limits import DistinctScene, advice, distinct_scenes, quality_doubts, rivals
from underlay.report.methods import listed, methods_paragraph, references, sample_words, tip_words
from underlay.report.page import (
    Detail,
    details,
    document,
    figure,
    number_block,
    table,
    tag,
    verdict_block,
    words,
)
from underlay.report.plots.scene import material_words
from underlay.report.plots.style import Axes, axes, in_words, style
from underlay.report.scene_tables import effects_table, scene_table
from underlay.report.screen import (
    assumed_inputs,
    assumed_words,
    budget_table,
    by_depth_words,
    half_space_fit,
    half_space_words,
    name_of,
    source_words,
    told_names,
    written,
)
from underlay.scene.parameters import kind_of
from underlay.units import format_quantity

if TYPE_CHECKING:
    from underlay.data.curve import Curve
    from underlay.inference.least_squares.fit_result import Fit
    from underlay.inference.pointwise.result import PointwiseModulus
    from underlay.inference.uncertainty.answer import Advice, Answer
    from underlay.mechanics.body import Layer
    from underlay.mechanics.solver import Solver

__all__ = ["FitPage", "drawing", "footer", "headline", "masthead", "sized"]

_INCH = 25.4
# Millimetres: the curve, the drawing of the test, and the two pictures side by side, as on a sheet of A4.
_CURVE, _DRAWING, _HALF, _WIDE = (126.0, 86.0), (54.0, 58.0), (90.0, 68.0), (150.0, 75.0)
# Numbers in the headline, and the share of the variance below which an assumption is no advice.
_NUMBERS, _WORTH = 3, 0.02
# Numbers in the words of a drawing, and lines above the last.
_SHORT = re.compile(r"^.*\n|, (E = |rigid).*$", re.DOTALL)
# Letters above which the first number is set smaller.
_LONG = 15


def sized(millimetres: tuple[float, float], draw: Callable[[Axes], object]) -> Axes:
    """Return axes of the given width and height (mm), with the picture drawn into them."""
    width, height = millimetres
    with style():
        panel = axes(None, width=width / _INCH, height=height / _INCH)
    draw(panel)
    return panel


def drawing(test: DistinctScene, solver: Solver, where: str, assumed: Iterable[str] = ()) -> str:
    """Return the test drawn to scale as an HTML figure; its caption gives the numbers and which are `assumed`.

    `where` says in the caption at which state the test is drawn, e.g. "at the deepest point"; `assumed` holds
    parameter paths that no one measured.
    """
    ax = sized(_DRAWING, lambda panel: plots.scene(test.scene, depth=test.reading, solver=solver, ax=panel))
    size = ax.get_title()
    ax.set_title("")
    ax.set_axis_off()
    for text in ax.texts:
        # The last line is of what is lowest; what stands beside the picture is too wide for it.
        text.set_text(
            "" if text.get_transform() == ax.get_yaxis_transform() else _SHORT.sub("", text.get_text())
        )
    for line in ax.lines:
        line.set_visible(line.get_transform() != ax.get_yaxis_transform())
    scene = test.scene
    layers = [f"{material_words(layer.material)}{_thickness(layer)}" for layer in scene.layers]
    base = [] if scene.base is None else [f"substrate {material_words(scene.base)}"]
    told = [f"to scale {where}", f"layer {'; '.join(layers)}", *base, size]
    told += [f"usual values, not measured: {named}"] if (named := ", ".join(map(label, assumed))) else []
    alt = "Tip, layer and substrate to scale, with the contact radius and the depth."
    caption = "; ".join([test.label, *told] if test.label else told)
    return figure(ax, f"test {test.label}", alt, "The test,", f"{caption}.", kind="side")


def _thickness(layer: Layer) -> str:
    thick = layer.thickness
    return f", {in_words(thick, 'length', digits=3)} thick" if math.isfinite(thick) else ""


def masthead(day: str, name: str, about: str) -> str:
    """Return the head of a page as HTML: its date, its title, and a line on what was tested."""
    return (
        f"<header><span><b>underlay</b> indentation report</span><span>{words(day)}</span></header>"
        f'<h1>{words(name)}</h1><p class="sub">{words(about)}</p>'
    )


def headline(answers: list[Answer], verdict: Advice, curves: Iterable[Curve] = (), more: str = "") -> str:
    """Return the headline as HTML: up to three numbers with uncertainty, and the verdict with cause and next step.

    `more` is a further sentence under the verdict. Inputs of `curves` that no one measured are named there.
    """
    assumed = assumed_words(assumed_inputs(curves))
    more = f"{more} Assumed: {assumed}.".strip() if assumed else more
    numbers = [_number(known, place, str(verdict.word)) for place, known in enumerate(answers[:_NUMBERS])]
    told = verdict_block(
        verdict.word, labelled(verdict.reason), labelled(verdict.cause), labelled(verdict.next), more
    )
    return tag("section", *numbers, told, kind="head")


def _number(known: Answer, place: int, verdict: str) -> str:
    """Return one number of the headline as HTML, in the form to copy.

    It is grey and without an uncertainty where the model is rejected. `place` is its rank: numbers after the first
    are set smaller.
    """
    title, letter = name_of(known.name)
    second = " second" if place else ""
    if verdict == "reject":
        number, _, unit = format_quantity(known.value, kind_of(path_of(known.name))).partition(" ")
        under, kind = "no uncertainty: the model is rejected", f"grey{second}"
    elif known.is_open:
        number, unit, under, kind = "not determined", "", _one_end(known, letter), f"grey long{second}"
    else:
        one = written(known)
        number, unit, kind = one.number, one.unit, f"{'long' if len(one.number) > _LONG else ''}{second}"
        under = (
            f"{one.level}: statistical {one.reach}{one.statistical}, systematic {one.reach}{one.systematic}"
        )
    return number_block(f"{title} {letter}", number, unit, under, kind)


def _one_end(known: Answer, letter: str) -> str:
    """Write the finite end of a half-open interval: ``"h > 1.1 mm (95 %)"``; a phrase where both ends are open."""
    for sign, end in ((">", known.low), ("<", known.high)):
        if math.isfinite(end):
            limit = format_quantity(end, kind_of(path_of(known.name)))
            return f"{letter} {sign} {limit} ({100.0 * known.level:.3g} %)"
    return "by this curve, neither from below nor from above"


def footer(*facts: str, command: str = "") -> str:
    """Return the foot of a page as HTML: provenance (`facts`), versions, and the command to repeat the result."""
    own = [*facts, f"underlay {VERSION}", f"Python {platform.python_version()}"]
    again = f" · same numbers again: <code>{words(command)}</code>" if command else ""
    return tag("footer", words(" · ".join(fact for fact in own if fact)), again)


@dataclass
class FitPage:
    """The report page of a fit.

    Parameters
    ----------
    fit : Fit
        The result to show.
    day : str
        Date on the page.
    command : str
        Command line that repeats the fit; empty where there is none.
    """

    fit: Fit
    day: str
    command: str = ""

    @cached_property
    def answers(self) -> list[Answer]:
        """Parameters of the sample, each with value, interval and uncertainty budget."""
        return [self.fit.answer(name) for name in told_names(self.fit)]

    @cached_property
    def by_depth(self) -> list[PointwiseModulus | str]:
        """Modulus at each depth of every curve, or the reason why there is none."""
        found: list[PointwiseModulus | str] = []
        for curve in range(len(self.fit.curves)):
            try:
                found.append(self.fit.modulus_by_depth(curve))
            except UnderlayError as error:
                found.append(str(error))
        return found

    @cached_property
    def half_space(self) -> Fit | None:
        """Best fit of the same curve by the half-space formula; None where it does not apply."""
        return half_space_fit(self.fit)

    @cached_property
    def tests(self) -> tuple[DistinctScene, ...]:
        """The different scenes of the fit, each with its curves."""
        return distinct_scenes(self.fit.scenes, self.fit.curves)

    @property
    def name(self) -> str:
        """Title of the page: the name of the first curve, and the number of further ones."""
        more = len(self.fit.curves) - 1
        name = str(self.fit.curves[0].metadata.get("name") or "one curve")
        return f"{name} and {more} more" if more else name

    def html(self, *, opened: bool = False) -> str:
        """Return the page as an HTML document; `opened` shows the folded parts."""
        head = masthead(self.day, self.name, self._about())
        return document(f"{self.name}: indentation report", head, self.sheet(opened=opened))

    def head(self) -> str:
        """Return numbers and verdict as HTML, which can be shown before the pictures are drawn."""
        return headline(self.answers, self.fit.verdict, self.fit.curves, self._narrower())

    def sheet(self, *, opened: bool = False) -> str:
        """Return all of the fit's page below its title as HTML; `opened` shows the folded parts."""
        side = drawing(
            self.tests[0], self.fit.solver, "at the deepest point", assumed_inputs(self.fit.curves)
        )
        blocks = [
            self.head(),
            tag("section", self._curve(0), side, kind="figs"),
            tag("section", self._depths(), self._budget(), kind="pair"),
            self._methods(),
            footer(*self._origin(), command=self.command),
            details(self._details(), opened=opened),
        ]
        return "\n".join(blocks)

    # --- the sheet -------------------------------------------------------------------------------------------
    def _about(self) -> str:
        curve, scene = self.fit.curves[0], self.fit.scene
        deep = in_words(self.tests[0].deepest, "length", digits=2)
        kinds = [str(kind) for kind in dict.fromkeys(curve.segments())]
        time = "" if curve.time is None else f" in {in_words(float(np.ptp(curve.time)), 'time', digits=2)}"
        points = sum(len(curve) for curve in self.fit.curves)
        tested = f"{start(tip_words(scene))}, on {sample_words(scene)}"
        return f"{tested} · {listed(kinds)}, {deep} deep{time} · {points} points"

    def _narrower(self) -> str:
        """Say which assumed input, if stated, would narrow the first number; empty unless the verdict is good."""
        if self.fit.verdict != "good" or not self.answers:
            return ""
        rows = [
            row for row in self.answers[0].contributions if row.origin == "assumed" and row.share >= _WORTH
        ]
        if not rows:
            return ""
        known = listed([source_words(row.source) for row in rows[:2]])
        return (
            f"To narrow {name_of(self.answers[0].name)[1]}: state the uncertainty of {known} (assumed here)."
        )

    def _curve(self, number: int) -> str:
        fit = self.fit
        ax = sized(_CURVE, lambda panel: plots.fit(fit, curve=number, half_space=self.half_space, ax=panel))
        caption = "Indentation is counted from the fitted contact point. Below: residuals."
        if self.half_space is not None:
            caption = f"{caption} {half_space_words(fit, self.half_space)}."
        alt = "Force against indentation with the fit, and the residuals below."
        return figure(ax, f"fit {number}", alt, "Curve and fit.", caption)

    def _depths(self) -> str:
        found = self.by_depth[0]
        if self.fit.scene.memory is not None:
            ax = sized(_HALF, lambda panel: plots.fit_in_time(self.fit, ax=panel))
            alt = "Force against time with the fit, and the residuals below."
            return figure(ax, "time", alt, "In time.", "Loading, hold and unloading are fitted together.")
        if self.fit.scene.adhesion is not None:
            ax = sized(_HALF, lambda panel: plots.adhesion(self.fit, ax=panel))
            alt = "States of a contact that adheres, jumps into contact and off, and the measured points."
            return figure(
                ax, "states", alt, "Adhesion.", "Every contact that balances, and where the tip jumps."
            )
        if isinstance(found, str):
            return tag("p", words(pointwise_sentence(found)), kind="none")
        known = self.fit.answer("layer.E") if "layer.E" in self.fit.names else None
        shown = None if self.fit.verdict == "reject" else known
        ax = sized(_HALF, lambda panel: plots.pointwise_modulus(found, answer=shown, ax=panel))
        # Intervals of a rejected model are no judge of whether it is constant.
        trend = "" if shown is None else by_depth_words(found)
        caption = f"Modulus read from the force at each depth{': ' if trend else ''}{trend}."
        return figure(ax, "depth", "Modulus against depth, and the half-space's.", "E by depth.", caption)

    def _budget(self) -> str:
        if self.fit.verdict == "reject":
            return tag("p", "No uncertainty budget: the model is rejected.", kind="none")
        known = next((known for known in self.answers if not known.is_open), None)
        if known is None:
            return tag("p", "No uncertainty budget: no number is determined.", kind="none")
        ax = sized(_HALF, lambda panel: plots.budget(known, ax=panel))
        name, letter = name_of(known.name)
        caption = (
            "What each source alone does, at 95 %, the larger side. Hatched: usual sizes; enter your own."
        )
        alt = f"Bars: what each source does to the {name.lower()}."
        return figure(ax, "budget", alt, f"Uncertainty budget of {letter}.", caption)

    def _methods(self) -> str:
        heading = "<h2>Methods paragraph</h2>"
        if self.fit.verdict == "reject":
            reason = labelled(self.fit.verdict.reason)
            return heading + tag("p", words(f"No modulus is reported, because {reason}."), kind="none")
        found = self.by_depth[0]
        text = methods_paragraph(self.fit, None if isinstance(found, str) else found, self.half_space)
        cited = " ".join(
            f"[{n}] {start(str(entry))}." for n, entry in enumerate(references(self.fit), start=1)
        )
        return heading + tag("div", tag("p", words(text)), tag("p", words(cited)), kind="methods")

    def _origin(self) -> Iterator[str]:
        for entry in self.fit.provenance["curves"]:
            known = entry.get("file_sha256")
            name = Path(entry["path"]).name if entry.get("path") else entry.get("name") or "curve"
            yield f"{name} · SHA-256 {known}" if known else f"{name} · points' SHA-256 {entry['data_sha256']}"
        if scene := self.fit.provenance["curves"][0].get("scene_path"):
            yield f"scene {Path(scene).name}"

    # --- what is folded behind it ------------------------------------------------------------------------------
    def _details(self) -> Iterator[Detail]:
        yield self._parameters()
        if self.fit.verdict != "reject":
            budgets = [(known.name, budget_table(known)) for known in self.answers]
            blocks = [_headed(start(label(name)), table(frame)) for name, frame in budgets if len(frame)]
            yield "Uncertainty budgets", "every source, its size and its origin", blocks
        yield from self._more_curves()
        yield from self._more_depths()
        yield self._effects()
        yield self._quality()
        yield "The test in numbers", "", [table(scene_table(*self.fit.scenes))]
        yield from self._adhesion()
        yield from self._relaxation()
        yield from self._segments()
        files = {"to repeat": self.command} if self.command else {}
        yield (
            "Where this comes from",
            "files, hashes, versions",
            [table(tables.provenance_table(self.fit, files))],
        )

    def _parameters(self) -> Detail:
        fit = self.fit
        sentences = [*rivals(fit), *advice(fit)]
        sentences += [
            f"{start(label(first))} and {label(second)} are known only together (correlation {value:+.3f})."
            for first, second, value in tables.known_together(fit)
        ]
        blocks = [table(tables.interval_table(fit))] if fit.verdict != "reject" else []
        blocks += [tag("p", words(text)) for text in sentences]
        pairs = tables.correlated_pairs(fit)
        if len(pairs):
            blocks.append(table(pairs.assign(correlation=[f"{x:+.3f}" for x in pairs["correlation"]])))
        note = f"{len(fit.names)} fitted" + (
            f", {len(pairs)} strongly correlated pairs" if len(pairs) else ""
        )
        return "Parameters and correlations", note, blocks

    def _more_curves(self) -> Iterator[Detail]:
        blocks = [self._curve(number) for number in range(1, len(self.fit.curves))]
        assumed = assumed_inputs(self.fit.curves)
        blocks += [drawing(test, self.fit.solver, "at the deepest point", assumed) for test in self.tests[1:]]
        yield "The other curves", f"{len(self.fit.curves) - 1} more", blocks

    def _more_depths(self) -> Iterator[Detail]:
        blocks = []
        for number, found in enumerate(self.by_depth):
            which = f"Curve {number + 1}" if len(self.by_depth) > 1 else ""
            inner = [tag("p", words(pointwise_sentence(found)))]
            inner += [] if isinstance(found, str) else [table(pointwise_table(found))]
            blocks.append(_headed(which, *inner))
        yield "E by depth as a table", "from the force and from its slope", blocks

    def _effects(self) -> Detail:
        blocks = [
            _headed(start(test.label), table(_effects_of(test, self.fit.solver))) for test in self.tests
        ]
        return "Effects that were considered", "what leaving each one out would change", blocks

    def _quality(self) -> Detail:
        fit = self.fit
        also = [tag("p", words(f"Also {labelled(str(other))}.")) for other in fit.verdict.others]
        doubts = len(quality_doubts(fit.problem, require=False)) + len(fit.warnings)
        blocks = [*also, table(tables.diagnostics_table(fit)), table(tables.reservations_table(fit))]
        return "Quality of the fit", f"{doubts or 'no'} reservation{'' if doubts == 1 else 's'}", blocks

    def _adhesion(self) -> Iterator[Detail]:
        blocks = []
        for number, scene in enumerate(self.fit.scenes):
            if scene.adhesion is not None:
                ax = sized(_WIDE, lambda panel, n=number: plots.adhesion(self.fit, curve=n, ax=panel))  # type: ignore[misc]
                blocks.append(
                    figure(ax, f"adhesion {number}", "States of a contact that adheres.", "Adhesion.")
                )
                blocks.append(table(adhesion_tables.adhesion_table(self.fit, number)))
                blocks.append(tag("p", words(adhesion_tables.halfspace_of(self.fit, number))))
        yield "Adhesion", "pull-off, jumps, and the half-space's formula", blocks

    def _relaxation(self) -> Iterator[Detail]:
        blocks = []
        for number, scene in enumerate(self.fit.scenes):
            if scene.layer.relaxation is not None:
                ax = sized(_WIDE, lambda panel, n=number: plots.relaxation(self.fit, curve=n, ax=panel))  # type: ignore[misc]
                alt = "Modulus of the layer against time after a sudden strain."
                blocks.append(figure(ax, f"relaxation {number}", alt, "Relaxation."))
            if scene.layer.material.drains:
                ax = sized(_WIDE, lambda panel, n=number: plots.drainage(self.fit, curve=n, ax=panel))  # type: ignore[misc]
                alt = "Force that is left to fall in the hold against the root of time, measured and fitted."
                blocks.append(figure(ax, f"drainage {number}", alt, "Drainage."))
        yield "Relaxation", "modulus, or what is left of the force, against time", blocks

    def _segments(self) -> Iterator[Detail]:
        blocks = []
        for number, curve in enumerate(self.fit.curves):
            whole = tables.beyond_loading(curve)
            if whole is not None:
                ax = sized(_WIDE, lambda panel, c=whole: plots.segments(c, ax=panel))  # type: ignore[misc]
                alt = "Depth and force against time, loading, hold and unloading apart."
                blocks.append(figure(ax, f"segments {number}", alt, "The whole measurement."))
        yield "The whole measurement", f"the fit uses a part of it ({LOADING} by default)", blocks


def _effects_of(test: DistinctScene, solver: Solver) -> pd.DataFrame:
    """Return the table of effects at the deepest point without computing times, which differ from run to run."""
    return effects_table(test.scene, test.deepest, solver).drop(columns="adds to the time")


def _headed(heading: str, *blocks: str) -> str:
    return (tag("h3", words(heading)) if heading else "") + "".join(blocks)
