"""Addresses of the page: the list of analyses, and a page for each with its five steps."""

from __future__ import annotations

from functools import partial
from pathlib import Path

from nicegui import events, ui

from underlay._door import FileKind, read_text
from underlay.app.folder import AnalysisFolder, analyses, described, new_analysis
from underlay.app.form import SAMPLES
from underlay.app.pages import parts
from underlay.app.pages.files import FilesStep
from underlay.app.pages.fitting import FitStep
from underlay.app.pages.many import ManyStep
from underlay.app.pages.parts import Step, Window
from underlay.app.pages.scene import SceneStep
from underlay.app.pages.takeaway import TakeAwayStep
from underlay.app.state import Home, OpenAnalysis, with_sample
from underlay.report.page import style_of

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


class AnalysisPage:
    """The page of an analysis in one browser window.

    Parameters
    ----------
    home : Home
        State of the server.
    analysis : OpenAnalysis
        The analysis to show.
    """

    def __init__(self, home: Home, analysis: OpenAnalysis) -> None:
        self._home = home
        self.window = Window(analysis)
        kinds: tuple[type[Step], ...] = (FilesStep, SceneStep, FitStep, ManyStep, TakeAwayStep)
        self._steps = [kind(self.window) for kind in kinds]

    async def build(self) -> None:
        """Build the whole page, and show the first step that is not complete."""
        self._head()
        analysis = self.window.analysis
        first = self._steps[0 if not analysis.curve_name else 1 if analysis.lacks else 2]
        with ui.tabs().classes("steps") as self._tabs:
            names = [
                ui.tab(step.title).mark(f"step-{number}").tooltip(step.help)
                for number, step in enumerate(self._steps, start=1)
            ]
        self._names = dict(zip(self._steps, names, strict=True))
        self.window.go = self._tabs.set_value
        with ui.tab_panels(self._tabs, value=first.title, animated=False).classes("panels"):
            for step in self._steps:
                with ui.tab_panel(step.title).classes("panel"):
                    step.build()
        # Only now: the first step is shown once, below, and not for being chosen above as well.
        self._tabs.on_value_change(lambda event: self._show(str(event.value)))
        self.window.kept = self._kept
        self._kept()
        await ui.context.client.connected()
        await first.show()

    async def _show(self, title: str) -> None:
        for step in self._steps:
            if step.title == title:
                await step.show()
        self._kept()

    def _head(self) -> None:
        with ui.header(elevated=False).classes("top"):
            ui.link("underlay", "/").classes("name").tooltip("All analyses")
            ui.label(self.window.analysis.folder.name).classes("quiet")
            self._back = [
                parts.button("", partial(self._step, back=back), f"flat dense icon={icon}", mark=icon)
                for back, icon in ((True, "undo"), (False, "redo"))
            ]
            ui.space()
            tip = "Gives an address that opens this page in another browser of this machine"
            parts.button("Another browser", self._another, "flat dense", mark="another", tip=tip)

    def _kept(self) -> None:
        """Update the state of each step in its title, and on the buttons what undo and redo would change."""
        for number, (step, name) in enumerate(self._names.items(), start=1):
            name.props["label"] = f"{number}  {step.title}   {step.state}".rstrip()
            name.update()
        for one, verb, what in zip(self._back, ("Undo", "Redo"), self.window.analysis.undone, strict=True):
            one.set_text(f"{verb}: {what}" if what else verb)
            one.set_enabled(bool(what))

    async def _step(self, *, back: bool) -> None:
        if self.window.holds:
            self.window.analysis.step(back=back)
            self._kept()
            await self._show(str(self._tabs.value))

    async def _another(self) -> None:
        with ui.dialog() as dialog, ui.card():
            ui.label("This address opens the page once, in another browser on this machine:")
            parts.outlined(ui.input(value=self._home.new_address()), "address", "wide", "readonly")
            parts.button("Close", dialog.close, "flat")
        await dialog
        dialog.delete()


def add_pages(home: Home) -> None:
    """Register the start page and the page of an analysis with the server."""
    own = read_text(Path(__file__).parent / "page.css", _CSS)
    # What a report looks like on paper, within its place on the page.
    style = f"{style_of('colours')}{own}.sheet {{{style_of('sheet')}}}"

    @ui.page("/", response_timeout=_PATIENCE)
    def start() -> None:
        ui.add_css(style)
        ui.colors(**COLOURS)
        StartPage(home)

    @ui.page("/analysis/{name}", response_timeout=_PATIENCE)
    async def analysis(name: str) -> None:
        ui.add_css(style)
        ui.colors(**COLOURS)
        if name not in analyses(home.path):
            ui.label("There is no such analysis here.")
            ui.link("See those that there are", "/")
            return
        await AnalysisPage(home, home.analysis(name)).build()


class StartPage:
    """The start page: begin an analysis from files or sample data, or open a recent one.

    Parameters
    ----------
    home : Home
        State of the server.
    """

    def __init__(self, home: Home) -> None:
        self._home = home
        with ui.row().classes("columns start"):
            with ui.column().classes("main"):
                ui.label("underlay").classes("name")
                ui.label("Young's modulus of a thin layer on a substrate, from indentation curves.")
                parts.upload(self._bring).mark("drop-new")
                ui.label("They are copied; your files are not changed.").classes("quiet")
                parts.button("New analysis", lambda: self._go(self._new()), mark="new")
                ui.label("Or try it with sample data").classes("heading")
                with ui.row().classes("actions"):
                    for scene, (words, about, *_) in SAMPLES.items():
                        show, mark = partial(self._show_sample, scene), f"sample-{scene}"
                        parts.button(
                            f"{words}\n{about}", show, "outline align=left", kind="sample", mark=mark
                        )
                ui.label("They come with their test filled in; all but the cell are simulated.").classes(
                    "quiet"
                )
            with ui.column().classes("side"):
                self._known()

    def _known(self) -> None:
        known = analyses(self._home.path)
        ui.label("Recent analyses" if known else "No analysis yet").classes("heading")
        for name in known:
            with ui.row().classes("fact"):
                ui.link(name, f"/analysis/{name}").mark(f"open-{name}")
                ui.label(described(self._home.path / name)).classes("quiet")
        ui.label(f"Everything is kept in {self._home.path.resolve()}; nothing leaves this machine.").classes(
            "quiet"
        )

    def _new(self) -> AnalysisFolder:
        return new_analysis(self._home.path)

    def _go(self, folder: AnalysisFolder) -> None:
        ui.navigate.to(f"/analysis/{folder.name}")

    def _show_sample(self, scene: str) -> None:
        folder = self._new()
        with_sample(folder, scene)
        self._go(folder)

    async def _bring(self, event: events.MultiUploadEventArguments) -> None:
        folder = self._new()
        if names := await parts.add_files(folder, event):
            self._home.analysis(folder.name).pick(names[0])
            self._go(folder)
