"""What the steps of the page share: elements, the browser window, and a long task with its buttons and progress."""

from __future__ import annotations

import base64
from abc import ABC, abstractmethod
from collections.abc import Awaitable, Callable, Iterable, Sequence
from typing import Any, TypeVar

from nicegui import events, ui

from underlay.app.folder import LARGEST_FILE, AnalysisFolder
from underlay.app.form import help_of
from underlay.app.shown import Progress, Row
from underlay.app.state import OpenAnalysis
from underlay.app.work import Tell, Worker, WorkError
from underlay.errors import UnderlayError

#: What is said where a browser could not send what was dropped.
FOLDER_DROPPED = (
    "The upload failed: a folder cannot be dropped. Drop the files in it, or a ZIP archive of them."
)
_Element = TypeVar("_Element", bound=ui.element)
_Field = TypeVar("_Field", ui.input, ui.select)


def complain(message: str) -> None:
    """Show an error message until it is closed."""
    ui.notify(message, type="negative", timeout=0, close_button="OK", multi_line=True)


def helped(element: _Element, mark: str) -> _Element:
    """Give an element its mark, by which tests find it, and the help text of that name as a tooltip; return it."""
    element.mark(mark).props["title"] = help_of(mark)
    return element


def outlined(element: _Field, mark: str, kind: str = "field", look: str = "") -> _Field:
    """Return an input or a selection with an outline, its mark and its help; `kind` are its CSS classes."""
    return helped(element.props(f"outlined dense {look}").classes(kind), mark)


def button(
    words: str,
    act: Callable[[], Any],
    look: str = "outline",
    *,
    kind: str = "",
    mark: str = "",
    tip: str = "",
) -> ui.button:
    """Return a button; `look` are properties of its element, `kind` its CSS classes, `tip` its tooltip."""
    made = ui.button(words, on_click=act).props(f"no-caps {look}").classes(kind)
    if mark:
        made.mark(mark)
    return made.tooltip(tip) if tip else made


def folded(words: str, *, is_open: bool = False) -> ui.expansion:
    """Return a part of the page that is folded under its words."""
    return ui.expansion(words, value=is_open).props("dense").classes("wide")


def upload(bring: Callable[[events.MultiUploadEventArguments], Awaitable[None]]) -> ui.upload:
    """Return the area that curves are dropped on; `bring` is called with the files."""

    def failed() -> None:
        # It would otherwise take no further file.
        made.reset()
        complain(FOLDER_DROPPED)

    made = ui.upload(
        multiple=True,
        auto_upload=True,
        max_file_size=LARGEST_FILE,
        label="Drop curves here, or press +",
        on_multi_upload=bring,
        on_rejected=lambda: complain(f"A file of more than {LARGEST_FILE // 10**6} MB is not taken."),
    )
    made.props("flat bordered hide-upload-btn").classes("drop")
    return helped(made, "drop").on("failed", failed)


async def add_files(folder: AnalysisFolder, event: events.MultiUploadEventArguments) -> list[str]:
    """Store uploaded files in an analysis; return the names of those taken, and show why others were not."""
    taken = []
    for file in event.files:
        try:
            taken.append(folder.add_curve(file.name, await file.read()).name)
        except UnderlayError as error:
            complain(str(error))
    return taken


def table(rows: Sequence[Row], most: int | None = None) -> ui.table:
    """Return rows of text as a table, which their first column names; of more than `most` with pages."""
    columns = [{"name": key, "label": key, "field": key, "align": "left"} for key in rows[0]]
    made = ui.table(
        columns=columns, rows=[dict(row) for row in rows], row_key=next(iter(rows[0])), pagination=most
    )
    made.props("flat dense wrap-cells").classes("wide")
    return made.props("hide-pagination") if most is None or len(rows) <= most else made


def data_address(picture: bytes) -> str:
    """Return a PNG picture as a ``data:`` URL."""
    return f"data:image/png;base64,{base64.b64encode(picture).decode('ascii')}"


def message_list(texts: Iterable[str], kind: str = "note") -> None:
    """Show sentences one below the other, as text that is never read as markup; `kind` is their CSS class."""
    for text in texts:
        ui.label(text).classes(kind)


def sheet(page: str) -> None:
    """Show a report's HTML, which was made by this package with all text escaped."""
    ui.html(page, sanitize=False).classes("sheet wide").mark("sheet")


_Kept = TypeVar("_Kept")


class Window:
    """A browser window on an analysis; only the window opened last may change the analysis.

    Parameters
    ----------
    analysis : OpenAnalysis
        The analysis it shows.

    Attributes
    ----------
    go : callable
        Shows the step of a given title.
    kept : callable
        Called after the scene was written.
    """

    complain = staticmethod(complain)

    def __init__(self, analysis: OpenAnalysis) -> None:
        self.analysis = analysis
        self._number = analysis.open_window()
        self.go: Callable[[str], Any] = lambda _title: None
        self.kept: Callable[[], None] = lambda: None

    @property
    def holds(self) -> bool:
        """Whether this is the window opened last, which may change the analysis; shows a message if not."""
        if self.analysis.window == self._number:
            return True
        self.complain("This analysis was opened in another window. Reload the page to go on here.")
        return False

    async def ask(self, worker: Worker, task: str, *arguments: Any, heard: Tell | None = None) -> Any:
        """Run a task in a worker process and return its result; if it fails, show the message and return None."""
        try:
            return await worker.call(task, *arguments, heard=heard)
        except WorkError as error:
            self.complain(str(error))
            return None

    async def try_to(self, worker: Worker, task: str, *arguments: Any) -> Any:
        """Run a task in a worker process and return its result; if it fails, return the message."""
        try:
            return await worker.call(task, *arguments)
        except WorkError as error:
            return str(error)

    async def before(self, kind: type[_Kept]) -> tuple[_Kept, bool] | None:
        """Return the selected curve's stored result of a class, and whether the scene has changed since.

        None where there is none.
        """
        told = await self.try_to(self.analysis.quick, "before", kind)
        return (told[0], not told[1]) if isinstance(told, tuple) and told[0] is not None else None

    def keep(self, *, by_hand: bool = True) -> bool:
        """Write the scene file if this window may change the analysis, and return whether it was written.

        A change `by_hand` can be undone.
        """
        if not self.holds:
            return False
        try:
            self.analysis.keep(by_hand=by_hand)
        except UnderlayError as error:
            self.complain(str(error))
            return False
        self.kept()
        return True


class Step(ABC):
    """One step of an analysis: a tab of the page.

    Parameters
    ----------
    window : Window
        The browser window it belongs to.
    """

    title = help = ""

    def __init__(self, window: Window) -> None:
        self.window = window

    @property
    def analysis(self) -> OpenAnalysis:
        """The analysis that the window shows."""
        return self.window.analysis

    @property
    def state(self) -> str:
        """State of the step in a word or two, shown after its title."""
        return ""

    @abstractmethod
    def build(self) -> None:
        """Build the fixed elements of the step, once."""

    @abstractmethod
    async def show(self) -> None:
        """Update the contents of the step."""


class Working:
    """The start and stop buttons and the progress bar of a long task.

    Parameters
    ----------
    window : Window
        The browser window they belong to.
    words : str
        Text of the start button.
    begin : callable
        Called when the start button is pressed.
    mark : str
        Mark by which tests find the start button; that of the stop button is ``stop-`` and this.
    heard : callable, optional
        Called with intermediate results of the task, other than progress.
    """

    def __init__(
        self,
        window: Window,
        words: str,
        begin: Callable[[], Awaitable[None]],
        *,
        mark: str,
        heard: Callable[[Any], None] | None = None,
    ) -> None:
        self._window, self._heard = window, heard
        self._asked, self._allowed = False, True
        self._go = button(words, begin, "unelevated size=lg", mark=mark)
        tip = "Ends it with what is there by then; pressed again, at once"
        self._stop = button("Stop", self._halt, mark=f"stop-{mark}", tip=tip)
        self._bar = ui.linear_progress(0.0, show_value=False).props("instant-feedback").classes("bar")
        self._words = ui.label().classes("quiet").mark(f"progress-{mark}")
        self._working(on=False)

    async def run(self, task: str, *arguments: Any) -> Any:
        """Run a task in the process for long tasks, one at a time, and return its result; None where it fails."""
        if not self._window.holds:
            return None
        long = self._window.analysis.long
        if long.is_busy:
            self._window.complain("One thing at a time: something else is still being worked on.")
            return None
        self._working(on=True)
        try:
            return await self._window.ask(long, task, *arguments, heard=self._told)
        finally:
            self._working(on=False)

    def _told(self, value: Any) -> None:
        if not isinstance(value, Progress):
            if self._heard is not None:
                self._heard(value)
            return
        if self._asked:
            return
        self._bar.props(remove="indeterminate")
        self._bar.set_value(value.done / max(value.total, 1))
        self._words.set_text(value.words)

    def _halt(self) -> None:
        """Ask the task to stop with the results so far; pressed again, or without progress, kill it."""
        long = self._window.analysis.long
        if self._asked or self._bar.props.get("indeterminate"):
            long.stop()
            return
        long.ask_to_stop()
        self._asked = True
        self._stop.set_text("Stop at once")
        self._words.set_text("stopping, with what is there ...")

    def allow(self, *, allowed: bool) -> None:
        """Enable or disable the start button."""
        self._allowed = allowed
        self._go.set_enabled(allowed)

    def _working(self, *, on: bool) -> None:
        self._go.set_enabled(self._allowed and not on)
        for element in (self._stop, self._bar, self._words):
            element.set_visibility(on)
        self._words.set_text("")
        self._stop.set_text("Stop")
        self._asked = False
        self._bar.props("indeterminate")
