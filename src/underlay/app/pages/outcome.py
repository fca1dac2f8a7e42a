"""The result of a fit on the page, as `underlay report` writes it."""

from __future__ import annotations

from collections.abc import Callable

from nicegui import ui

from underlay.app.form import NOTES
from underlay.app.pages import parts
from underlay.app.pages.parts import Window, Working
from underlay.app.shown import Found
from underlay.app.state import said


class Outcome:
    """The button that fits, and the result of the fit.

    Parameters
    ----------
    window : Window
        The browser window it belongs to.
    prepare : callable
        Called before a fit, to complete the scene.
    """

    def __init__(self, window: Window, prepare: Callable[[], None]) -> None:
        self._window, self._prepare = window, prepare
        # A fit, or what it told, is newer than what was found before.
        self._turns, self._fitting = 0, False
        with ui.row().classes("actions") as self._actions:
            self._working = Working(window, "Fit", self._go, mark="fit", heard=self._shown)
        self._old = ui.label(NOTES["old-fit"]).classes("note").mark("old")
        self._old.set_visibility(False)
        self._place = ui.column().classes("wide outcome")

    def allow(self, *, allowed: bool) -> None:
        """Show or hide the button."""
        self._actions.set_visibility(allowed)

    async def show(self) -> None:
        """Show the stored fit of the selected curve, unless a newer one is running."""
        turns = self._turns
        before = await self._window.before(Found)
        if turns != self._turns or self._fitting:
            return
        self._place.clear()
        self._old.set_visibility(False)
        if before is not None:
            self._shown(before[0])
            self._old.set_visibility(before[1])

    def is_old(self) -> None:
        """Show the note that the scene has changed since the shown result."""
        self._old.set_visibility(bool(self._place.default_slot.children))

    async def _go(self) -> None:
        self._prepare()
        self._turns += 1
        self._old.set_visibility(False)
        self._place.clear()
        self._fitting = True
        try:
            found = await self._working.run("fit")
        finally:
            self._fitting = False
        if isinstance(found, Found):
            self._shown(found)

    def _shown(self, found: Found) -> None:
        analysis = self._window.analysis
        if found.stem != analysis.stem:
            return  # another curve was picked since: it has its own place
        # The form may have been changed while this was fitted, and what is shown is of what was fitted.
        self._old.set_visibility(said(found.scene) != said(analysis.folder.scene_text()))
        self._turns += 1
        self._place.clear()
        with self._place:
            parts.sheet(found.sheet)
            parts.message_list(found.notes)
        self._window.kept()
