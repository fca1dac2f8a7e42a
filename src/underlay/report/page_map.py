"""The report page of a map: a summary of its sites on one sheet, tables folded below it."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
import pandas as pd

from underlay._door import sha256_of
from underlay._version import VERSION
from underlay.inference.batch.results_table import FITTED
from underlay.inference.citation import used_by
from underlay.report import maps, plots
from underlay.report.labels import label, start
from underlay.report.methods import cited_works
from underlay.report.page import (
    Detail,
    details,
    document,
    figure,
    number_block,
    pixels,
    table,
    tag,
    verdict_block,
    words,
)
from underlay.report.page_fit import footer, masthead, sized
from underlay.report.plots.style import in_words
from underlay.report.screen import name_of, quartiles
from underlay.scene.parameters import kind_of

if TYPE_CHECKING:
    from underlay.inference.population.result import Population

__all__ = ["MapPage", "together_block"]

# Millimetres: the map, and what stands beside it and below it.
_MAP, _SMALL = (112.0, 78.0), (70.0, 60.0)
# Sites above which a map is sent as pixels; numbers in the headline.
_MANY, _NUMBERS = 2000, 2


@dataclass
class MapPage:
    """The report page of a map.

    Parameters
    ----------
    whole : DataFrame
        What `fit_many` returned.
    day, command : str
        Date on the page, and the command line that repeats the map.
    files : sequence of path
        Files whose SHA-256 the page states.
    """

    whole: pd.DataFrame
    day: str
    command: str = ""
    files: Sequence[Path] = ()

    @cached_property
    def sites(self) -> pd.DataFrame:
        """The map's table, a row per curve, without the curves that a person refused by hand."""
        return maps.without_refused(self.whole)

    @cached_property
    def parameters(self) -> list[str]:
        """Parameters of the sample with a finite value at one site or more."""
        names = maps.sample_parameters(self.sites)
        return [name for name in names if np.isfinite(self.sites[name].to_numpy(dtype=float)).any()]

    @property
    def fitted(self) -> int:
        """How many sites have a fit."""
        return int(np.count_nonzero(self.sites["status"].to_numpy() == FITTED))

    def html(self, *, opened: bool = False) -> str:
        """Return the page as an HTML document; `opened` shows the folded parts."""
        name = self.files[0].name if self.files else "all sites"
        about = f"{len(self.whole)} curves, {self.fitted} fitted"
        head = masthead(self.day, f"A map of indentation tests: {name}", about)
        label = "group" if "group" in self.sites.columns else "animal"
        together = together_block(maps.of_map(self.sites), self.sites, label)
        return document(
            f"{name}: a map of indentation tests", head, self.sheet(together=together, opened=opened)
        )

    def sheet(self, *, together: str = "", opened: bool = False, drawn: bool = True) -> str:
        """Return all of the page below its title as HTML.

        `together` is the HTML of the population (`together_block`), `drawn` adds the map by position, and `opened`
        shows the folded parts.
        """
        numbers = [self._number(name, place) for place, name in enumerate(self.parameters[:_NUMBERS])]
        facts = [f"{path.name} · SHA-256 {sha256_of(path)}" for path in self.files]
        blocks = [
            tag("section", *numbers, self._verdict(), kind="head"),
            tag("section", *self._pictures(drawn=drawn), kind="figs"),
            together,
            self._methods(),
            footer(*facts, command=self.command),
            details(self._details(), opened=opened),
        ]
        return "\n".join(blocks)

    def _number(self, name: str, place: int) -> str:
        middle, half, _, _ = quartiles(self.sites, name)
        number, _, unit = middle.partition(" ")
        title, letter = name_of(name)
        under = f"middle half of the sites: {half}"
        if {f"{name}.low", f"{name}.high"} <= set(self.sites.columns):
            ends = self.sites[[f"{name}.low", f"{name}.high"]].to_numpy(dtype=float)
            width = float(np.nanmedian(0.5 * (ends[:, 1] - ends[:, 0])))
            under = f"{under}; one curve ± {in_words(width, kind_of(name), digits=2)} (95 %)"
        return number_block(f"{title} {letter}, median", number, unit, under, "second" if place else "")

    def _verdict(self) -> str:
        counts = self.sites["verdict"].value_counts()
        told = [f"{counts.get(word, 0)} {word}" for word in ("good", "check", "reject")]
        failed = len(self.sites) - self.fitted
        told += [f"{failed} without a fit"] if failed else []
        good = int(counts.get("good", 0)) == len(self.sites)
        sentences = (maps.errors_in_words(self.sites), maps.decision_words(self.whole))
        more = " ".join(filter(None, sentences))
        return verdict_block(
            "good" if good else "check", f"verdicts of the curves: {', '.join(told)}", more=more
        )

    def _pictures(self, *, drawn: bool) -> Iterator[str]:
        columns = maps.columns_to_draw(self.sites)
        if columns and drawn:
            ax = sized(_MAP, lambda panel: plots.map(self.sites, columns[0], ax=panel))
            alt, title = f"Map of the {label(columns[0])} by position.", "By position."
            caption = "Sites without a fit are grey."
            many = len(self.sites) > _MANY
            yield pixels(ax, alt, title) if many else figure(ax, "map", alt, title, caption)
        if self.parameters:
            ax = sized(_SMALL, lambda panel: plots.histogram(self.sites, self.parameters[0], ax=panel))
            name = label(self.parameters[0])
            yield figure(ax, "histogram", f"Histogram of the {name}.", "All sites.", kind="side")

    def _methods(self) -> str:
        laws = [str(law) for law in self.sites.get("law", []) if isinstance(law, str)]
        cited = cited_works(used_by(laws))
        fitted = self.fitted
        number = len(self.sites)
        first = f"{number} force-indentation curves were fitted one by one (underlay {VERSION} [1])"
        sentences = [f"{first}; {fitted} gave a number."]
        for name in self.parameters:
            middle, half, _, _ = quartiles(self.sites, name)
            sentences.append(f"{start(label(name))}: median {middle}, middle half of the sites {half}.")
        listed = " ".join(f"[{n}] {start(str(work))}." for n, work in enumerate(cited, start=1))
        body = tag("div", tag("p", words(" ".join(sentences))), tag("p", words(listed)), kind="methods")
        return f"<h2>Methods paragraph</h2>{body}"

    def _details(self) -> Iterator[Detail]:
        yield "Numbers of the sample", "", [table(maps.parameter_table(self.sites))]
        yield "More maps", "each number by position, and the verdicts", list(self._more_maps())
        decided = [table(maps.decision_table(self.whole))] if maps.decision_words(self.whole) else []
        yield "Decisions by hand", "", decided
        yield "Curves without a fit", "", [table(maps.failure_table(self.sites))]
        facts = {"to repeat": self.command} if self.command else {}
        files = [str(path) for path in self.files]
        yield "Where this comes from", "", [table(maps.map_provenance_table(self.sites, facts, *files))]

    def _more_maps(self) -> Iterator[str]:
        for name in maps.columns_to_draw(self.sites)[1:]:
            yield pixels(plots.map(self.sites, name), f"Map of the {label(name)}.", start(label(name)))
        if maps.has_positions(self.sites):
            yield pixels(plots.verdicts(self.sites), "Map of the verdicts.", "Verdicts")


def together_block(found: Population | str, curves: pd.DataFrame, label: str) -> str:
    """Return the summary of the population as HTML: means and verdict, pictures and tables.

    Parameters
    ----------
    found : Population or str
        The population, or a sentence on why there is none.
    curves : DataFrame
        The map; where it has the column `label`, a box plot by it is added.
    label : str
        Column by which the curves are grouped.
    """
    if isinstance(found, str):
        return f"<h2>All sites together</h2>{tag('p', words(found))}"
    title, letter = name_of(found.parameter)
    numbers = []
    for called, mean, of in maps.means_in_words(found):
        number, _, unit = mean.rpartition(" ")
        title_of = f"{title} {letter}, {called or 'mean'}"
        numbers.append(number_block(title_of, number, unit, f"geometric mean of {of}; 95 %", "second"))
    verdict = maps.population_verdict(found)
    more = f"{maps.shared_error_words(found)}." if found.shared_error else ""
    told = verdict_block(verdict.word, verdict.reason, verdict.cause, verdict.next, more)
    drawn = []
    if found.by:
        alt = "Curves, animals and the population with its interval, group by group."
        drawn.append(figure(plots.population(found), "population", alt, "Population."))
    if label in curves.columns:
        ax = plots.boxes(curves, label, found.parameter)
        drawn.append(
            figure(ax, "boxes", f"Box plot of every {label}, with its curves.", f"Curves by {label}.")
        )
    frames = [table(frame) for frame in maps.population_tables(found)]
    said = [tag("p", words(text)) for text in found.sentences()]
    return "".join(
        (tag("section", *numbers, told, kind="head"), tag("section", *drawn, kind="pair"), *frames, *said)
    )
