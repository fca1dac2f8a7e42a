"""What a fit found: headline, verdict, interval, doubts, pictures, effects."""

from __future__ import annotations

from collections.abc import Callable, Iterable

from nicegui import ui

from underlay.app.pages.step import Window, Working, data_address, message_list
from underlay.app.shown import Found, Row
from underlay.app.state import said

__all__ = ["Outcome", "plain_table", "plain_words"]

_OLD = "The test, the contact point or the range was changed since: press Fit again."
_TOLD = {
    "fit": "measured, fitted, half-space of the same modulus, and residuals",
    "depths": "modulus at each depth by itself",
    "segments": "segments of the whole curve",
    "time": "force against time",
}


class Outcome:
    """What came of a fit.

    Parameters
    ----------
    window : Window
        Where it is shown.
    prepare : callable
        Called before a fit, to complete the scene.
    """

    def __init__(self, window: Window, prepare: Callable[[], None]) -> None:
        self._window, self._prepare = window, prepare
        self._turns = 0
        with ui.row().classes("actions"):
            self._working = Working(window, "Fit", self._go, mark="fit", heard=self._shown)
        self._old = ui.label(_OLD).classes("note").mark("old")
        self._old.set_visibility(False)
        self._place = ui.column().classes("wide outcome")

    async def show(self) -> None:
        """Show what was found before."""
        turns = self._turns
        before = await self._window.try_to(self._window.analysis.quick, "before", Found)
        if turns != self._turns:
            return  # a fit began or told something meanwhile: that is newer
        self._place.clear()
        self._old.set_visibility(False)
        if isinstance(before, tuple) and before[0] is not None:
            self._shown(before[0])
            self._old.set_visibility(not before[1])

    def is_old(self) -> None:
        """Say that what is shown is of another test."""
        self._old.set_visibility(bool(self._place.default_slot.children))

    async def _go(self) -> None:
        self._prepare()
        self._turns += 1
        self._old.set_visibility(False)
        self._place.clear()
        found = await self._working.run("fit")
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
            ui.label(found.headline).classes("headline").mark("headline")
            good = found.verdict.startswith("Verdict: good")
            ui.label(found.verdict).classes("verdict good" if good else "verdict doubtful").mark("verdict")
            plain_table(found.table)
            with ui.row().classes("columns"):
                with ui.element("div").classes("main pictures"):
                    for name in found.pictures:
                        self._picture(name)
                with ui.column().classes("side"):
                    message_list(found.doubts)
                    message_list(found.more, "more")
                    message_list([found.depths] if found.depths else [], "more")
            if found.effects:
                ui.label("What acts in this test, and how much").classes("heading")
                plain_table(found.effects)

    def _picture(self, name: str) -> None:
        content = self._window.analysis.folder.read_result(name)
        what = name.split(".")[-2]
        if content is not None:
            with ui.element("figure"):
                ui.image(data_address(content)).props(f'alt="{_TOLD.get(what, what)}"')
                ui.label(_TOLD.get(what, what)).classes("quiet")


def plain_table(rows: tuple[Row, ...]) -> None:
    """Show rows of text."""
    if not rows:
        return
    columns = [{"name": key, "label": key, "field": key, "align": "left"} for key in rows[0]]
    table = ui.table(columns=columns, rows=[dict(row) for row in rows], row_key=next(iter(rows[0])))
    table.props("flat dense wrap-cells hide-pagination").classes("wide")


def plain_words(place: ui.column, texts: Iterable[str], kind: str = "bad") -> None:
    """Show sentences in place of what was there."""
    place.clear()
    with place:
        message_list(texts, kind)
