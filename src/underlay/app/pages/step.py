"""What the steps of the page are made of: the browser window, and a long task with its buttons and progress."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Awaitable, Callable
from typing import Any, TypeVar

from nicegui import ui

from underlay.app.pages import parts
from underlay.app.shown import Progress
from underlay.app.state import OpenAnalysis
from underlay.app.work import Tell, Worker, WorkError
from underlay.errors import UnderlayError

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

    complain = staticmethod(parts.complain)

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
        self._go = parts.button(words, begin, "unelevated size=lg", mark=mark)
        tip = "Ends it with what is there by then; pressed again, at once"
        self._stop = parts.button("Stop", self._halt, mark=f"stop-{mark}", tip=tip)
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
