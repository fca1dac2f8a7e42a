"""Addresses of the page: the list of analyses, and one page for each."""

from __future__ import annotations

from pathlib import Path

from nicegui import ui

from underlay._door import FileKind, read_text
from underlay.app.folder import analyses, new_analysis
from underlay.app.pages.analysis import AnalysisPage
from underlay.app.state import Home

__all__ = ["COLOURS", "add_pages"]

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
