"""What a fit found: headline, verdict, interval, doubts, pictures, effects."""

from __future__ import annotations

from collections.abc import Callable

from nicegui import ui

from underlay.app.pages.step import Window, data_address, message_list
from underlay.app.results import Found

__all__ = ["Outcome", "plain_table"]

_OLD = "The test, the contact point or the range was changed since: press Fit again."


class Outcome:
    """The button that fits, and what came of it.

    Parameters
    ----------
    window : Window
        Where it is shown.
    prepare : callable
        Called before a fit, to complete the scene.
    """

    def __init__(self, window: Window, prepare: Callable[[], None]) -> None:
        self._window, self._prepare = window, prepare
        with ui.row().classes("actions"):
            self._fit = ui.button("Fit", on_click=self._go).props("unelevated no-caps size=lg").mark("fit")
            self._stop = ui.button("Stop", on_click=window.analysis.long.stop).props("outline no-caps")
            self._stop.mark("stop").set_visibility(False)
            self._busy = ui.spinner(size="sm")
            self._busy.set_visibility(False)
        self._old = ui.label(_OLD).classes("note")
        self._old.set_visibility(False)
        self._place = ui.column().classes("wide outcome")

    async def show(self) -> None:
        """Show what was found before."""
        before = await self._window.try_to(self._window.analysis.quick, "found")
        self._place.clear()
        self._old.set_visibility(False)
        if isinstance(before, tuple) and before[0] is not None:
            self._shown(before[0])
            self._old.set_visibility(not before[1])

    def is_old(self) -> None:
        """Say that what is shown is of another test."""
        self._old.set_visibility(bool(self._place.default_slot.children))

    async def _go(self) -> None:
        if not self._window.holds or self._window.analysis.long.is_busy:
            return
        self._prepare()
        self._old.set_visibility(False)
        self._place.clear()
        self._working(on=True)
        found = await self._window.ask(self._window.analysis.long, "fit", heard=self._shown)
        self._working(on=False)
        if isinstance(found, Found):
            self._shown(found)

    def _working(self, *, on: bool) -> None:
        self._fit.set_enabled(not on)
        self._stop.set_visibility(on)
        self._busy.set_visibility(on)

    def _shown(self, found: Found) -> None:
        self._place.clear()
        with self._place:
            ui.label(found.headline).classes("headline").mark("headline")
            good = found.verdict.startswith("Verdict: good")
            ui.label(found.verdict).classes("verdict good" if good else "verdict doubtful").mark("verdict")
            plain_table(found.table)
            with ui.row().classes("columns"):
                with ui.column().classes("main"):
                    for name in found.pictures:
                        content = self._window.analysis.folder.read_result(name)
                        if content is not None:
                            ui.image(data_address(content)).classes("picture").props(f'alt="{_told(name)}"')
                with ui.column().classes("side"):
                    message_list(found.doubts)
                    message_list(found.more, "more")
            if found.effects:
                ui.label("What acts in this test, and how much").classes("heading")
                plain_table(found.effects)


def _told(name: str) -> str:
    return {"fit": "measured, fitted, half-space, residuals"}.get(name.split(".")[-2], name.split(".")[-2])


def plain_table(rows: tuple[dict[str, str], ...]) -> None:
    """Show rows of text."""
    if not rows:
        return
    columns = [{"name": key, "label": key, "field": key, "align": "left"} for key in rows[0]]
    ui.table(columns=columns, rows=[dict(row) for row in rows], row_key=next(iter(rows[0]))).props(
        "flat dense wrap-cells"
    ).classes("wide")
