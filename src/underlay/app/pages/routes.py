"""Addresses of the page: the list of analyses, and one page for each.

One analysis: a head, and the steps from left to right.
"""

from __future__ import annotations

from pathlib import Path

from nicegui import ui

from underlay._door import FileKind, read_text
from underlay.app.folder import analyses, new_analysis
from underlay.app.pages.files import FilesStep
from underlay.app.pages.fitting import FitStep
from underlay.app.pages.many import ManyStep
from underlay.app.pages.scene import SceneStep
from underlay.app.pages.step import Step, Window
from underlay.app.pages.takeaway import TakeAwayStep
from underlay.app.state import Home, OpenAnalysis

__all__ = ["COLOURS", "AnalysisPage", "add_pages"]


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


#: What buttons, sliders and messages are painted with.
COLOURS = {
    "primary": "#0072b2",
    "secondary": "#5a5a5a",
    "accent": "#009e73",
    "negative": "#b3400a",
    "warning": "#b3400a",
}


# For a page to be built (s): what is too late is not shown at all, and a busy machine is slow.
_PATIENCE = 60.0


_CSS = FileKind("the style of the page", 1_000_000, "install underlay again")


def add_pages(home: Home) -> None:
    """Add the pages of a server."""
    style = read_text(Path(__file__).parent / "page.css", _CSS)

    @ui.page("/", response_timeout=_PATIENCE)
    def start() -> None:
        ui.add_css(style)
        ui.colors(**COLOURS)
        _list(home)

    @ui.page("/analysis/{name}", response_timeout=_PATIENCE)
    async def analysis(name: str) -> None:
        ui.add_css(style)
        ui.colors(**COLOURS)
        if name not in analyses(home.path):
            ui.label("There is no such analysis here.")
            ui.link("See those that there are", "/")
            return
        await AnalysisPage(home, home.analysis(name)).build()


def _list(home: Home) -> None:
    """Analyses that were begun, and the way to a new one."""

    def begin() -> None:
        ui.navigate.to(f"/analysis/{new_analysis(home.path).name}")

    with ui.column().classes("start"):
        ui.label("underlay").classes("name")
        ui.label(
            "The stiffness of a thin layer from an indentation curve, with what lies under it in the model."
        )
        ui.button("New analysis", on_click=begin).mark("new").props("unelevated no-caps")
        known = analyses(home.path)
        if known:
            ui.label("Go on with").classes("heading")
            for name in known:
                ui.link(name, f"/analysis/{name}").mark(f"open-{name}")
        ui.label(f"Everything is kept in {home.path.resolve()}; nothing leaves this machine.").classes(
            "quiet"
        )
