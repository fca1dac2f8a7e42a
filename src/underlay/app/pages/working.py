"""A long task: the button that begins it, how far it is, and the button that stops it."""

from __future__ import annotations

from collections.abc import Awaitable, Callable
from typing import Any

from nicegui import ui

from underlay.app.pages.step import Window
from underlay.app.shown import Progress

__all__ = ["Working"]


class Working:
    """The buttons of a long task.

    Parameters
    ----------
    window : Window
        Where they are shown.
    words : str
        On the button.
    begin : callable
        Called when it is pressed.
    mark : str
        By which a test finds the button; the one that stops has ``stop-`` before it.
    heard : callable, optional
        Given what the task tells that is no progress.
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
        self._asked = False
        self._go = ui.button(words, on_click=begin).props("unelevated no-caps size=lg").mark(mark)
        self._stop = ui.button("Stop", on_click=self._halt).props("outline no-caps").mark(f"stop-{mark}")
        self._bar = ui.linear_progress(0.0, show_value=False).props("instant-feedback").classes("bar")
        self._words = ui.label().classes("quiet").mark(f"progress-{mark}")
        self._working(on=False)

    async def run(self, task: str, *arguments: Any) -> Any:
        """Do a task of the long kind, one at a time; None where it could not be done."""
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
        """Ask for an end, with what there is by then; asked again, or where nothing is told, end it at once."""
        long = self._window.analysis.long
        if self._asked or self._bar.props.get("indeterminate"):
            long.stop()
            return
        long.ask_to_stop()
        self._asked = True
        self._stop.set_text("Stop at once")
        self._words.set_text("stopping, with what is there ...")

    def _working(self, *, on: bool) -> None:
        self._go.set_enabled(not on)
        for element in (self._stop, self._bar, self._words):
            element.set_visibility(on)
        self._words.set_text("")
        self._stop.set_text("Stop")
        self._asked = False
        self._bar.props("indeterminate")
