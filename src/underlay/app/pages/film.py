"""A film by its contact stiffness: for curves of a test with continuous stiffness."""

from __future__ import annotations

from nicegui import ui

from underlay.app.pages.outcome import plain_table
from underlay.app.pages.step import Window, data_address, message_list
from underlay.app.pages.working import Working
from underlay.app.shown import Film

__all__ = ["FilmPart"]

_WORDS = (
    "This curve says its contact stiffness S(h). An imprint that stayed cannot be fitted as an elastic curve; its "
    "stiffness can: with a cone as the tip (such as berkovich, step 2), and what is fitted of layer and base."
)
_PERFECT = "none: a perfect tip"
_OLD = "The test was changed since: fit the stiffness again."


class FilmPart:
    """Fields and outcome of the fit of a film.

    Parameters
    ----------
    window : Window
        Where it is shown.
    """

    def __init__(self, window: Window) -> None:
        self._window = window
        with ui.column().classes("wide") as self._whole:
            ui.label("A film by its contact stiffness").classes("heading")
            ui.label(_WORDS).classes("quiet")
            with ui.row().classes("fields"):
                self._base = ui.select([_PERFECT], value=_PERFECT, label="Same tip on a known sample")
                self._base.props("outlined dense").classes("field").mark("film-base")
                self._modulus = self._entry("Its E / (1 - nu^2)", "165 GPa", "film-modulus")
                self._low = self._entry("From depth", "0 nm", "film-from")
                self._high = self._entry("To depth", "1 m", "film-to")
            with ui.row().classes("actions"):
                self._working = Working(window, "Fit the stiffness", self._go, mark="film")
            self._place = ui.column().classes("wide")
        self._whole.set_visibility(False)

    def _entry(self, words: str, example: str, mark: str) -> ui.input:
        entry = ui.input(words, placeholder=example)
        return entry.props("outlined dense").classes("field").mark(mark)

    async def show(self, *, has_stiffness: bool) -> None:
        """Offer it for curves that have a stiffness, with what was found before."""
        self._whole.set_visibility(has_stiffness)
        self._place.clear()
        if not has_stiffness:
            return
        analysis = self._window.analysis
        others = [path.name for path in analysis.folder.curve_files() if path.name != analysis.curve_name]
        kept = self._base.value if self._base.value in others else _PERFECT
        self._base.set_options([_PERFECT, *others], value=kept)
        await self._show_kept()

    async def _show_kept(self) -> None:
        """Show what was found of the curve that is looked at, and whether the test is still the same."""
        before = await self._window.try_to(self._window.analysis.quick, "before", Film)
        if isinstance(before, tuple) and before[0] is not None:
            self._shown(before[0], is_old=not before[1])

    async def _go(self) -> None:
        base = "" if self._base.value in (None, _PERFECT) else str(self._base.value)
        low, high = (str(entry.value or entry.props["placeholder"]) for entry in (self._low, self._high))
        told = await self._working.run("film", base, str(self._modulus.value or ""), low, high)
        if isinstance(told, Film):
            await self._show_kept()

    def _shown(self, film: Film, *, is_old: bool) -> None:
        self._place.clear()
        with self._place:
            if is_old:
                ui.label(_OLD).classes("note")
            plain_table(film.table)
            message_list(film.notes, "more")
            content = self._window.analysis.folder.read_result(film.picture)
            if content is not None:
                ui.image(data_address(content)).classes("picture half").props(
                    'alt="contact stiffness and modulus by depth"'
                )
