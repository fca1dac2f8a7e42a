"""What the steps of the page share: the window they are in, and small pieces of it."""

from __future__ import annotations

import base64
from abc import ABC, abstractmethod
from collections.abc import Callable, Iterable
from typing import Any

from nicegui import ui

from underlay.app.state import OpenAnalysis
from underlay.app.work import Tell, Worker, WorkError
from underlay.errors import UnderlayError

__all__ = ["Step", "Window", "data_address", "message_list"]


class Window:
    """A browser's window on an analysis; the one that was opened last holds it.

    Parameters
    ----------
    analysis : OpenAnalysis
        What is shown.

    Attributes
    ----------
    go : callable
        Shows the step of a title.
    """

    def __init__(self, analysis: OpenAnalysis) -> None:
        self.analysis = analysis
        self._number = analysis.open_window()
        self.go: Callable[[str], Any] = lambda _title: None

    @property
    def holds(self) -> bool:
        """Whether no other window took the analysis since; says so where one did."""
        if self.analysis.window == self._number:
            return True
        self.complain("This analysis was opened in another window. Reload the page to go on here.")
        return False

    def complain(self, message: str) -> None:
        """Say what is wrong, until it is read."""
        ui.notify(message, type="negative", timeout=0, close_button="OK", multi_line=True)

    async def ask(self, worker: Worker, task: str, *arguments: Any, heard: Tell | None = None) -> Any:
        """Have a process do something; None, and a message, where it could not."""
        try:
            return await worker.call(task, *arguments, heard=heard)
        except WorkError as error:
            self.complain(str(error))
            return None

    async def try_to(self, worker: Worker, task: str, *arguments: Any) -> Any:
        """Have a process do something; where it could not, why, as a text."""
        try:
            return await worker.call(task, *arguments)
        except WorkError as error:
            return str(error)

    def keep(self) -> bool:
        """Write the scene file, if this window still holds the analysis."""
        if not self.holds:
            return False
        try:
            self.analysis.keep()
        except UnderlayError as error:
            self.complain(str(error))
            return False
        return True


class Step(ABC):
    """One step of an analysis.

    Parameters
    ----------
    window : Window
        Where it is shown.
    """

    title = ""

    def __init__(self, window: Window) -> None:
        self.window = window

    @property
    def analysis(self) -> OpenAnalysis:
        """What is shown."""
        return self.window.analysis

    @abstractmethod
    def build(self) -> None:
        """Build what does not change."""

    @abstractmethod
    async def show(self) -> None:
        """Bring what is shown up to date."""


def data_address(picture: bytes) -> str:
    """Return a picture as an address of itself."""
    return f"data:image/png;base64,{base64.b64encode(picture).decode('ascii')}"


def message_list(texts: Iterable[str], kind: str = "note") -> None:
    """Show sentences one under the other; their words are text, never markup."""
    for text in texts:
        ui.label(text).classes(kind)
