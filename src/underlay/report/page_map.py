"""The report page of a map: a summary of its sites on one sheet, tables folded below it."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property, partial
from typing import TYPE_CHECKING

import numpy as np
import pandas as pd

from underlay.inference.batch.decisions import not_rejected, without_refused
from underlay.inference.batch.results_table import FITTED
from underlay.inference.citation import used_by
from underlay.inference.uncertainty.answer import Advice
from underlay.report import maps, page, plots
from underlay.report.details import Part, picture
from underlay.report.labels import label, start
from underlay.report.methods import citation_words, cited_works
from underlay.report.screen import counted_words, name_of, site_numbers, verdict_counts

if TYPE_CHECKING:
    from underlay.inference.population.result import Population

# Millimetres: the map, and what stands beside it and below it.
_MAP, _SMALL = (112.0, 78.0), (70.0, 60.0)
# Sites above which a map is sent as pixels; numbers in the headline.
_MANY, _NUMBERS = 2000, 2


@dataclass
class MapPage(page.Page):
    """The report page of a map, of what `fit_many` returned; parameters as `Page`."""

    @cached_property
    def sites(self) -> pd.DataFrame:
        """The map's table, a row per curve, without the curves that a person refused by hand."""
        return without_refused(self.result)

    @cached_property
    def trusted(self) -> pd.DataFrame:
        """The rows of `sites` that the numbers on the page are made of: those whose model is not rejected."""
        return not_rejected(self.sites)

    @cached_property
    def parameters(self) -> list[str]:
        """Parameters of the sample with a finite value at one site or more."""
        return maps.known_parameters(self.trusted if len(self.trusted) else self.sites)

    @property
    def fitted(self) -> int:
        """How many sites have a fit."""
        return int(np.count_nonzero(self.sites["status"].to_numpy() == FITTED))

    @property
    def title(self) -> str:
        """Name of the map's file."""
        return f"A map of indentation tests: {self.files[0].name if self.files else 'all sites'}"

    @property
    def about(self) -> str:
        """Numbers of curves and fits."""
        return f"{len(self.result)} curves, {self.fitted} fitted"

    def sheet(self, *, opened: bool = False, together: str | None = None, drawn: bool = True) -> str:
        """Return all of the page below its title as HTML.

        `together` is the HTML of the population, by default that of the map's own animals (`together_block`);
        `drawn` adds the map by position, and `opened` shows the folded parts.
        """
        if together is None:
            by = "group" if "group" in self.sites.columns else "animal"
            together = together_block(maps.of_map(self.sites), self.sites, by)
        numbers = [self._number(name, place) for place, name in enumerate(self.parameters[:_NUMBERS])]
        return self.with_foot(
            page.tag("section", *numbers, self._verdict(), kind="head"),
            page.tag("section", *self._pictures(drawn=drawn), kind="figs"),
            together,
            self._methods(),
            opened=opened,
        )

    def _number(self, name: str, place: int) -> str:
        title, letter = name_of(name)
        if not len(self.trusted):
            return page.number_block(f"{title} {letter}", "none", "", counted_words(self.sites), "second")
        sites = site_numbers(self.trusted, name)
        number, _, unit = sites.median.partition(" ")
        each = f"; one curve {sites.each}" if sites.each else ""
        under = f"middle half of the sites: {sites.half}, {counted_words(self.sites)}{each}"
        return page.number_block(f"{title} {letter}, median", number, unit, under, "second" if place else "")

    def _verdict(self) -> str:
        good = bool((self.sites["verdict"] == "good").all())
        sentences = (maps.errors_in_words(self.sites), maps.decision_words(self.result))
        told = Advice("good" if good else "check", f"verdicts of the curves: {verdict_counts(self.sites)}")
        return page.verdict_block(told, " ".join(filter(None, sentences)))

    def _pictures(self, *, drawn: bool) -> Iterator[str]:
        columns = maps.columns_to_draw(self.sites)
        if columns and drawn:
            shown = picture("map", partial(plots.map, self.sites, columns[0]), what=label(columns[0]))
            yield page.figure(shown, _MAP, as_pixels=len(self.sites) > _MANY)
        if self.parameters:
            draw = partial(plots.histogram, self.sites, self.parameters[0])
            yield page.figure(picture("histogram", draw, what=label(self.parameters[0])), _SMALL, "side")

    def _methods(self) -> str:
        laws = [str(law) for law in self.sites.get("law", []) if isinstance(law, str)]
        works = cited_works(used_by(laws))
        first = f"{len(self.sites)} force-indentation curves were fitted one by one ({citation_words(works)})"
        sentences = [f"{first}; {self.fitted} gave a number."]
        for name in self.parameters if len(self.trusted) else ():
            sites = site_numbers(self.trusted, name)
            sentences.append(
                f"{start(label(name))}: median {sites.median}, middle half of the sites {sites.half} "
                f"({counted_words(self.sites)})."
            )
        return page.methods_block(" ".join(sentences), works)

    def parts(self) -> Iterator[Part]:
        """Yield the numbers, further maps, decisions by hand, failures and provenance."""
        yield Part("Numbers of the sample", "", [maps.parameter_table(self.trusted)])
        yield Part("More maps", "each number by position, and the verdicts", list(self._more_maps()))
        decided = [maps.decision_table(self.result)] if maps.decision_words(self.result) else []
        yield Part("Decisions by hand", "", decided)
        yield Part("Curves without a fit", "", [maps.failure_table(self.sites)])
        origin = maps.map_provenance_table(self.sites, self.facts, *map(str, self.files))
        yield Part("Where this comes from", "", [origin])

    def _more_maps(self) -> Iterator[str]:
        for name in maps.columns_to_draw(self.sites)[1:]:
            draw = partial(plots.map, self.sites, name)
            shown = picture("further_map", draw, name, what=label(name), title=start(label(name)))
            yield page.figure(shown, as_pixels=True)
        if maps.has_positions(self.sites):
            draw = partial(plots.verdicts, self.sites)
            yield page.figure(picture("verdicts", draw), as_pixels=True)


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
        return f"<h2>All sites together</h2>{page.tag('p', page.words(found))}"
    title, letter = name_of(found.parameter)
    numbers = []
    for called, mean, of in maps.means_in_words(found):
        number, _, unit = mean.rpartition(" ")
        title_of = f"{title} {letter}, {called or 'mean'}"
        numbers.append(page.number_block(title_of, number, unit, f"geometric mean of {of}; 95 %", "second"))
    more = f"{maps.shared_error_words(found)}." if found.shared_error else ""
    told = page.verdict_block(maps.population_verdict(found), more)
    drawn = []
    if found.by:
        drawn.append(page.figure(picture("population", partial(plots.population, found))))
    if label in curves.columns:
        draw = partial(plots.boxes, curves, label, found.parameter)
        drawn.append(page.figure(picture("boxes", draw, label=label)))
    frames = [page.table(frame) for frame in maps.population_tables(found)]
    said = [page.tag("p", page.words(text)) for text in found.sentences()]
    return "".join(
        (
            page.tag("section", *numbers, told, kind="head"),
            page.tag("section", *drawn, kind="pair"),
            *frames,
            *said,
        )
    )
