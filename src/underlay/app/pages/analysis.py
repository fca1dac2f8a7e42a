"""One analysis: a head, and the steps from left to right."""

from __future__ import annotations

from nicegui import ui

from underlay.app.pages.files import FilesStep
from underlay.app.pages.fitting import FitStep
from underlay.app.pages.many import ManyStep
from underlay.app.pages.scene import SceneStep
from underlay.app.pages.step import Step, Window
from underlay.app.pages.takeaway import TakeAwayStep
from underlay.app.state import Home, OpenAnalysis

__all__ = ["AnalysisPage"]


class AnalysisPage:
    """The page of an analysis in one window.

    Parameters
    ----------
    home : Home
        The server it belongs to.
    analysis : OpenAnalysis
        What is shown.
    """

    def __init__(self, home: Home, analysis: OpenAnalysis) -> None:
        self._home = home
        self.window = Window(analysis)
        kinds: tuple[type[Step], ...] = (FilesStep, SceneStep, FitStep, ManyStep, TakeAwayStep)
        self._steps = [kind(self.window) for kind in kinds]

    async def build(self) -> None:
        """Build the whole page and show the step that is next."""
        self._head()
        first = self._steps[0 if not self.window.analysis.curve_name else 2]
        with ui.tabs().classes("steps") as tabs:
            for number, step in enumerate(self._steps, start=1):
                ui.tab(step.title, label=f"{number}  {step.title}").mark(f"step-{number}")
        self.window.go = tabs.set_value
        with ui.tab_panels(tabs, value=first.title, animated=False).classes("panels"):
            for step in self._steps:
                with ui.tab_panel(step.title).classes("panel"):
                    step.build()
        # Only now: the first step is shown once, below, and not for being chosen above as well.
        tabs.on_value_change(lambda event: self._show(str(event.value)))
        await ui.context.client.connected()
        await first.show()

    async def _show(self, title: str) -> None:
        for step in self._steps:
            if step.title == title:
                await step.show()

    def _head(self) -> None:
        with ui.header(elevated=False).classes("head"):
            ui.link("underlay", "/").classes("name")
            ui.label(self.window.analysis.folder.name).classes("quiet")
            ui.space()
            ui.button("Another browser", on_click=self._another).props("flat no-caps dense").mark("another")

    async def _another(self) -> None:
        with ui.dialog() as dialog, ui.card():
            ui.label("This address opens the page once, in another browser on this machine:")
            ui.input(value=self._home.new_address()).props("readonly outlined dense").classes("wide")
            ui.button("Close", on_click=dialog.close).props("flat no-caps")
        await dialog
        dialog.delete()
