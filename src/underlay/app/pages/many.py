"""Step 4: all curves: the map, the gallery with decisions by hand, groups and the population.

The gallery shows the worst curves first, to accept or refuse them (`GalleryPart`); labels assign curves to animals
and groups, from which the population mean is estimated (`PopulationPart`); boxes drawn on the map name regions
(`RegionPart`).
"""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Awaitable, Callable

from nicegui import events, ui

from underlay.app.folder import LABELS, curves_on_sample
from underlay.app.form import NOTES
from underlay.app.pages import parts
from underlay.app.pages.parts import Step, Window, Working
from underlay.app.shown import Gallery, Overview, Together
from underlay.report.plots.fit import Canvas
from underlay.report.review import Card

_NONE = "none"


class GalleryPart:
    """A page of the gallery of curves, with buttons to accept or refuse each.

    Parameters
    ----------
    window : Window
        The browser window it belongs to.
    decided : callable
        Called after every decision.
    """

    def __init__(self, window: Window, decided: Callable[[], Awaitable[None]]) -> None:
        self._window, self._decided = window, decided
        self._page = 0
        self._shown = Gallery()
        # Not among the curves: what is asked here outlives a gallery that is drawn again.
        self._asked = ui.element("div")
        self._head = ui.row().classes("actions")
        self._place = ui.element("div").classes("gallery")

    async def show(self) -> None:
        """Show the page of the gallery again, but only if it changed: no button should move while it is pressed."""
        gallery: Gallery | None = await self._window.ask(self._window.analysis.quick, "gallery", self._page)
        if gallery == self._shown:
            return
        self._shown = gallery or Gallery()
        self._head.clear()
        self._place.clear()
        if gallery is None or not gallery.pages:
            return
        with self._head:
            ui.label("Curves, worst first").classes("heading")
            ui.label(NOTES["gallery"]).classes("quiet")
            ui.space()
            if gallery.pages > 1:
                pages = ui.pagination(
                    1, gallery.pages, value=self._page + 1, on_change=lambda event: self._turn(event.value)
                )
                pages.props("max-pages=8").mark("pages")
        with self._place:
            for card in gallery.cards:
                self._card(card)

    def _card(self, card: Card) -> None:
        with ui.element("article").classes(f"card {card.verdict} {card.decision}").mark(f"card-{card.name}"):
            look, mark = 'flat dense align=left title="Opens this curve in step 3"', f"open-{card.name}"
            parts.button(
                card.name, lambda: open_curve(self._window, card.name), look, kind="card-name", mark=mark
            )
            # The picture is made here of numbers alone; names in it are escaped.
            ui.html(card.picture, sanitize=False).classes("card-picture")
            for words in (*card.numbers, f"{card.verdict}; {card.misfit_words}"):
                ui.label(words).classes("card-words")
            if card.reason:
                with ui.label(card.reason).classes("card-words quiet clipped"):
                    ui.tooltip(card.reason)
            if card.decision:
                ui.label(f"decided: {card.decision} {card.why}".rstrip()).classes("card-words decided").mark(
                    f"decided-{card.name}"
                )
            with ui.row().classes("card-buttons"):
                if card.fitted:
                    self._button("Accept", card, "accept")
                parts.button(
                    "Reject ...", lambda: self._refuse(card), "flat dense", mark=f"refuse-{card.name}"
                )
                if card.decision:
                    self._button("Undo", card, "")

    def _button(self, words: str, card: Card, word: str) -> None:
        mark = f"{words.lower()}-{card.name}"
        parts.button(words, lambda: self._decide(card, word, ""), "flat dense", mark=mark)

    async def _refuse(self, card: Card) -> None:
        with self._asked, ui.dialog() as dialog, ui.card():
            ui.label(f"Why is {card.name} rejected?")
            reason = parts.outlined(ui.input("Reason"), "reason", "wide", "autofocus")
            reason.on("keydown.enter", lambda: dialog.submit(reason.value))
            with ui.row():
                parts.button("Reject", lambda: dialog.submit(reason.value), "unelevated", mark="refuse-now")
                parts.button("Cancel", dialog.close, "flat")
        said = await dialog
        dialog.delete()
        if said is not None:
            await self._decide(card, "refuse", str(said))

    async def _decide(self, card: Card, word: str, reason: str) -> None:
        if not self._window.holds:
            return
        # What is shown as decided is on the disk by then.
        answer = await self._window.try_to(self._window.analysis.quick, "decide", [card.name], word, reason)
        if answer is not None:
            self._window.complain(str(answer))
            return
        await self.show()
        await self._decided()

    async def _turn(self, page: int) -> None:
        self._page = int(page) - 1
        await self.show()


class PopulationPart:
    """Fields for the labels of curves, and the population.

    Parameters
    ----------
    window : Window
        The browser window it belongs to.
    place : column
        Where the summary of the population is shown.
    """

    def __init__(self, window: Window, place: ui.column) -> None:
        self._window, self._place = window, place
        ui.label("Groups").classes("heading")
        with parts.folded("What each curve belongs to").mark("whose"):
            self._find = parts.outlined(
                ui.input("Files whose name holds"), "label-files", "wide", "clearable"
            )
            self._found = ui.label().classes("quiet")
            self._find.on_value_change(self._count)
            self._known = ui.column().classes("wide")
            with ui.row().classes("fields"):
                column = ui.select(list(LABELS), value=LABELS[0], label="are of")
                self._column = parts.outlined(column, "label-column", "prior")
                self._label = parts.outlined(ui.input("called"), "label-name")
                parts.button("Set", self._set, mark="label-set")
            manifest = ui.upload(
                label="Or bring a table (CSV: file, animal, group, x, y, thickness, ...)",
                auto_upload=True,
                on_upload=self._manifest,
            )
            parts.helped(manifest, "manifest").props("flat bordered accept=.csv").classes("drop small")
        with ui.column().classes("wide") as self._fitted:
            with ui.row().classes("fields"):
                by = ui.select([_NONE], value=_NONE, label="Curves belong together by")
                self._by = parts.outlined(by, "by")
                self._group = parts.outlined(ui.select([_NONE], value=_NONE, label="Compare"), "group")
            tip = "Mean over animals with its interval, spread between and within them, and a box plot"
            self._ask = parts.button("Mean and spread", self._together, mark="together", tip=tip)

    async def show(self, told: Overview) -> None:
        """Offer the map's columns of labels as units and groups, and show the stored population."""
        self._fitted.set_visibility(bool(told.sheet))
        before = await self._window.try_to(self._window.analysis.quick, "together")
        found, is_new = before if isinstance(before, tuple) else (None, True)
        # Curves of one animal are not independent: with such a label, that is where it begins.
        asked = LABELS[:2] if found is None else (found.by, found.group)
        for select, chosen in zip((self._by, self._group), asked, strict=True):
            value = select.value if select.value != _NONE else chosen
            select.set_options([_NONE, *told.labels], value=value if value in told.labels else _NONE)
        self._count()
        await self._show_labels()
        self._place.clear()
        if found is not None:
            with self._place:
                if not is_new:
                    ui.label(NOTES["old-population"]).classes("note").mark("old-population")
                parts.sheet(found.sheet)

    async def _show_labels(self) -> None:
        """Show for each column of labels how many files have each label."""
        rows = await self._window.try_to(self._window.analysis.quick, "labels")
        self._known.clear()
        if not isinstance(rows, dict):
            return
        with self._known:
            for column in dict.fromkeys(name for row in rows.values() for name in row if name in LABELS):
                counted = Counter(row.get(column, "") for row in rows.values())
                told = ", ".join(f"{label} ({count})" for label, count in sorted(counted.items()) if label)
                if told:
                    ui.label(f"{column}: {told}").classes("quiet").mark(f"known-{column}")

    def _files(self) -> list[str]:
        wanted = (self._find.value or "").casefold()
        return [
            path.name for path in self._window.analysis.folder.curve_files() if wanted in path.name.casefold()
        ]

    def _count(self) -> None:
        self._found.set_text(f"{len(self._files())} files")

    async def _set(self) -> None:
        await self.name(self._files(), str(self._column.value), str(self._label.value or ""))

    async def name(self, files: list[str], column: str, label: str) -> None:
        """Set a label of curves in a column."""
        if self._window.holds:
            answer = await self._window.try_to(self._window.analysis.quick, "set_label", files, column, label)
            await self._tell(answer, f"{len(files)} files are of {column} {label}; fit all curves again")

    async def _manifest(self, event: events.UploadEventArguments) -> None:
        if self._window.holds:
            answer = await self._window.try_to(
                self._window.analysis.quick, "take_manifest", await event.file.read()
            )
            await self._tell(answer, "The manifest is taken; fit all curves again")

    async def _tell(self, refused: object, done: str) -> None:
        if refused is None:
            ui.notify(done)
            await self._show_labels()
        else:
            self._window.complain(str(refused))

    async def _together(self) -> None:
        by, group = (str(select.value).replace(_NONE, "") for select in (self._by, self._group))
        self._ask.props("loading")
        told = await self._window.try_to(self._window.analysis.quick, "population", by, group)
        self._ask.props(remove="loading")
        self._place.clear()
        with self._place:
            if not isinstance(told, Together):
                ui.label(str(told)).classes("bad").mark("population-refused")
                return
            parts.sheet(told.sheet)


class HeightPart:
    """Fields for thickness from contact heights, where some curves are on the bare substrate beside the sample.

    Parameters
    ----------
    window : Window
        The browser window it belongs to.
    told : callable
        Called when the thicknesses are in the manifest.
    """

    def __init__(self, window: Window, told: Callable[[], Awaitable[None]]) -> None:
        self._window, self._told = window, told
        with parts.folded("Thickness from contact heights").mark("heights"):
            ui.label(NOTES["heights"]).classes("quiet")
            with ui.row().classes("fields"):
                self._begins = parts.outlined(ui.input("Names on the substrate begin with"), "on-glass")
                parts.button("Set the thickness", self._set, mark="set-heights")
            self._place = ui.column().classes("wide")

    async def _set(self) -> None:
        if not self._window.holds:
            return
        analysis = self._window.analysis
        done = await self._window.ask(analysis.quick, "thickness", str(self._begins.value or ""))
        if done is None:
            return
        self._place.clear()
        with self._place:
            ui.label(str(done)).classes("more").mark("heights-set")
        # Each curve has its own now: there is nothing to fit.
        if analysis.draft.free.pop("layer.thickness", None) is not None:
            self._window.keep()
        await self._told()


class RegionPart:
    """The map of the curves: a click opens a curve, a box drawn around some names them as a region.

    Parameters
    ----------
    window : Window
        The browser window it belongs to.
    named : callable
        Called with the files in a box and the name of the region.
    """

    def __init__(self, window: Window, named: Callable[[list[str], str], Awaitable[None]]) -> None:
        self._window, self._named = window, named
        self._told = Overview()
        self._began = (0.0, 0.0)
        self._inside: list[str] = []
        with ui.column().classes("wide") as self._whole:
            ui.label("Map").classes("heading")
            ui.label("Click a square to open its curve; drag a box to name a region.").classes("quiet")
            self._picture = ui.interactive_image(
                on_mouse=self._draw, events=["pointerdown", "pointermove", "pointerup"]
            )
            self._picture.classes("picture region").mark("regions")
            with ui.row().classes("fields") as self._ask:
                self._words = ui.label().classes("quiet")
                self._name = parts.outlined(ui.input("Name of this region"), "region-name")
                parts.button("Name region", self._set, mark="region-set")

    def show(self, told: Overview) -> None:
        """Show the map where curves have positions, else hide it."""
        self._told, self._inside = told, []
        self._whole.set_visibility(told.plan is not None)
        self._ask.set_visibility(False)
        if told.plan is not None:
            self._picture.set_source(parts.data_address(told.plan.data))
            self._picture.set_content("")

    def _pixels(self, plan: Canvas, x: float, y: float) -> tuple[float, float]:
        across = (x - plan.low) / (plan.high - plan.low)
        up = (y - plan.floor) / (plan.ceiling - plan.floor)
        return plan.left + across * (plan.right - plan.left), plan.bottom - up * (plan.bottom - plan.top)

    async def _draw(self, event: events.MouseEventArguments) -> None:
        """Start, resize or finish a box with the pointer; a box of a few pixels counts as a click."""
        here = (event.image_x, event.image_y)
        if event.type == "pointerdown":
            self._began = here
            return
        (left, right), (top, bottom) = (sorted(ends) for ends in zip(self._began, here, strict=True))
        if event.type == "pointermove" and event.buttons:
            self._picture.set_content(
                f'<rect x="{left:.0f}" y="{top:.0f}" width="{right - left:.0f}" height="{bottom - top:.0f}" '
                'fill="#0b62a4" fill-opacity="0.12" stroke="#0b62a4" stroke-width="2"/>'
            )
        plan = self._told.plan
        if event.type != "pointerup" or plan is None:
            return
        places = {name: self._pixels(plan, x, y) for name, x, y in self._told.sites}
        # A box of a few pixels is a click.
        if max(right - left, bottom - top) < 6.0:
            nearest = min(places, key=lambda name: math.dist(places[name], here))
            open_curve(self._window, nearest)
            return
        self._inside = [name for name, (x, y) in places.items() if left <= x <= right and top <= y <= bottom]
        self._words.set_text(f"{len(self._inside)} curves in this box")
        self._ask.set_visibility(bool(self._inside))

    async def _set(self) -> None:
        await self._named(self._inside, str(self._name.value or ""))


def open_curve(window: Window, name: str) -> None:
    """Select a curve and go to the step of the fit."""
    if window.holds and any(path.name == name for path in window.analysis.folder.curve_files()):
        window.analysis.pick(name)
        window.go("Fit")


class ManyStep(Step):
    """The step on all curves of an analysis."""

    title = "Map"
    help = "Fit every curve by itself, look at each, and compare animals, groups and regions"

    @property
    def state(self) -> str:
        """The word "fitted" if there is a map, else empty."""
        return "fitted" if (self.analysis.folder.results / "map.csv").is_file() else ""

    def build(self) -> None:
        """Build the button, and empty columns for map, population and gallery."""
        with ui.row().classes("actions"):
            self._working = Working(self.window, "Fit all curves", self._go, mark="fit-all")
            self._count = ui.label().classes("quiet")
        self._old = ui.label(NOTES["old-map"]).classes("note")
        self._overview = ui.column().classes("wide")
        place = ui.column().classes("wide")
        with ui.row().classes("columns"):
            with ui.column().classes("main") as self._map:
                self._regions = RegionPart(self.window, self._named)
            with ui.column().classes("side wider"):
                self._population = PopulationPart(self.window, place)
                HeightPart(self.window, self.show)
        # Below both: pictures and tables need the width.
        place.move(target_index=-1)
        self._gallery = GalleryPart(self.window, self._decided)

    async def show(self) -> None:
        """Show the stored map, and what is needed to fit it."""
        folder, lacks = self.analysis.folder, self.analysis.lacks
        count = len(curves_on_sample(folder))
        beside = len(folder.curve_files()) - count
        self._working.allow(allowed=count > 0 and not lacks)
        missing = self.analysis.draft.missing
        first = f"needed in step 2: {', '.join(missing)}" if missing else "complete the test first (step 2)"
        said = "each by itself, with the test of step 2" if not lacks else first
        said = f"{said}; {beside} on the bare substrate are left out" if beside else said
        self._count.set_text(
            f"{count} curve{'' if count == 1 else 's'}, {said}"
            if count
            else "No curve yet: bring some first."
        )
        told = await self.window.try_to(self.analysis.quick, "overview")
        if isinstance(told, Overview):
            await self._shown(told)
        else:
            self._overview.clear()
            with self._overview:
                parts.message_list([str(told)], "bad")

    async def _go(self) -> None:
        told = await self._working.run("fit_all")
        if not self.analysis.long.is_busy:
            # What it was started for is done: its memory goes back before the gallery takes its own.
            self.analysis.long.stop()
        if isinstance(told, Overview):
            await self._shown(told)
        else:
            await self.show()

    async def _decided(self) -> None:
        told = await self.window.ask(self.analysis.quick, "overview")
        if isinstance(told, Overview):
            self._words(told)
            await self._population.show(told)

    async def _shown(self, told: Overview) -> None:
        self._words(told)
        await self._population.show(told)
        await self._gallery.show()
        self.window.kept()

    async def _named(self, files: list[str], label: str) -> None:
        await self._population.name(files, "region", label)

    def _words(self, told: Overview) -> None:
        self._old.set_text(NOTES["old-map" if told.is_old else "cut-map"])
        self._old.set_visibility((told.is_old or not told.is_whole) and bool(told.sheet))
        self._map.set_visibility(told.plan is not None)
        self._regions.show(told)
        self._overview.clear()
        with self._overview:
            if told.sheet:
                parts.sheet(told.sheet)
            else:
                ui.label("Median, map and every curve will appear here.").classes("quiet")
