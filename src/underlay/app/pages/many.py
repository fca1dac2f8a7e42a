"""Step 4: all curves. The map, the gallery with what is decided by hand, groups and the population."""

from __future__ import annotations

from nicegui import ui

from underlay.app.pages.gallery import GalleryPart
from underlay.app.pages.outcome import plain_table, plain_words
from underlay.app.pages.population import PopulationPart
from underlay.app.pages.step import Step, data_address, message_list
from underlay.app.pages.working import Working
from underlay.app.shown import Overview

__all__ = ["ManyStep"]

_CUT = "This run did not come to its end; what it finished is kept. Press Fit all curves to go on."
_OLD = "Files, labels or the test were changed since: fit all curves again. What was decided is kept."


class ManyStep(Step):
    """All curves of an analysis."""

    title = "Many curves"

    def build(self) -> None:
        """Build the button, and room for what is found."""
        with ui.row().classes("actions"):
            self._working = Working(self.window, "Fit all curves", self._go, mark="fit-all")
            self._count = ui.label().classes("quiet")
        self._old = ui.label(_OLD).classes("note")
        with ui.row().classes("columns"):
            self._overview = ui.column().classes("main")
            with ui.column().classes("side wider"):
                self._population = PopulationPart(self.window)
        self._gallery = GalleryPart(self.window, self._decided)

    async def show(self) -> None:
        """Show what was found before."""
        count = len(self.analysis.folder.curve_files())
        self._count.set_text(
            f"{count} file{'' if count == 1 else 's'}, each by itself, with the test of step 2"
        )
        told = await self.window.try_to(self.analysis.quick, "overview")
        if isinstance(told, Overview):
            await self._shown(told)
        else:
            plain_words(self._overview, [str(told)])

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

    def _words(self, told: Overview) -> None:
        self._old.set_text(_OLD if told.is_old else _CUT)
        self._old.set_visibility((told.is_old or not told.is_whole) and bool(told.sentences))
        self._overview.clear()
        with self._overview:
            if not told.sentences:
                ui.label("Nothing is fitted yet.").classes("quiet")
                return
            ui.label(told.sentences[0]).classes("headline").mark("map-headline")
            message_list(told.sentences[1:], "quiet")
            plain_table(told.table)
            plain_table(told.verdicts)
            plain_table(told.failures)
            for name in told.pictures:
                content = self.analysis.folder.read_result(name)
                if content is not None:
                    ui.image(data_address(content)).classes("picture").props('alt="map and histogram"')
