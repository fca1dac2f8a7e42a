"""The gallery of a map: worst curves first, to accept or refuse by hand."""

from __future__ import annotations

from collections.abc import Awaitable, Callable

from nicegui import ui

from underlay.app.pages.step import Window
from underlay.app.shown import Card, Gallery

__all__ = ["GalleryPart"]


class GalleryPart:
    """A page of curves and what is decided of them.

    Parameters
    ----------
    window : Window
        Where it is shown.
    decided : callable
        Called after every decision.
    """

    def __init__(self, window: Window, decided: Callable[[], Awaitable[None]]) -> None:
        self._window, self._decided = window, decided
        self._page = 0
        self._shown = Gallery()
        # Not among the curves: what is asked here outlives a gallery that is drawn again.
        self._asked = ui.element("div")
        self._head = ui.row().classes("actions")
        self._place = ui.element("div").classes("gallery")

    async def show(self) -> None:
        """Show the page again, where something of it changed: a button must not vanish under the hand."""
        gallery: Gallery | None = await self._window.ask(self._window.analysis.quick, "gallery", self._page)
        if gallery == self._shown:
            return
        self._shown = gallery or Gallery()
        self._head.clear()
        self._place.clear()
        if gallery is None or not gallery.pages:
            return
        with self._head:
            ui.label("Curves, worst first").classes("heading")
            ui.label("grey measured, blue fit, dashed contact point; below, what is left over").classes(
                "quiet"
            )
            ui.space()
            if gallery.pages > 1:
                pages = ui.pagination(
                    1, gallery.pages, value=self._page + 1, on_change=lambda event: self._turn(event.value)
                )
                pages.props("max-pages=8").mark("pages")
        with self._place:
            for card in gallery.cards:
                self._card(card)

    def _card(self, card: Card) -> None:
        with ui.element("article").classes(f"card {card.verdict} {card.decision}").mark(f"card-{card.name}"):
            ui.label(card.name).classes("card-name")
            # The picture is made here of numbers alone; names in it are escaped.
            ui.html(card.picture, sanitize=False).classes("card-picture")
            for words in (*card.numbers, f"{card.verdict}; {card.misfit}"):
                ui.label(words).classes("card-words")
            if card.reason:
                with ui.label(card.reason).classes("card-words quiet clipped"):
                    ui.tooltip(card.reason)
            if card.decision:
                ui.label(f"decided: {card.decision} {card.why}".rstrip()).classes("card-words decided").mark(
                    f"decided-{card.name}"
                )
            with ui.row().classes("card-buttons"):
                if card.fitted:
                    self._button("Accept", card, "accept")
                ui.button("Refuse ...", on_click=lambda: self._refuse(card)).props("flat dense no-caps").mark(
                    f"refuse-{card.name}"
                )
                if card.decision:
                    self._button("Undo", card, "")

    def _button(self, words: str, card: Card, word: str) -> None:
        ui.button(words, on_click=lambda: self._decide(card, word, "")).props("flat dense no-caps").mark(
            f"{words.lower()}-{card.name}"
        )

    async def _refuse(self, card: Card) -> None:
        with self._asked, ui.dialog() as dialog, ui.card():
            ui.label(f"Why is {card.name} refused?")
            reason = ui.input("Reason").props("outlined dense autofocus").classes("wide").mark("reason")
            reason.on("keydown.enter", lambda: dialog.submit(reason.value))
            with ui.row():
                ui.button("Refuse", on_click=lambda: dialog.submit(reason.value)).props(
                    "unelevated no-caps"
                ).mark("refuse-now")
                ui.button("Cancel", on_click=dialog.close).props("flat no-caps")
        said = await dialog
        dialog.delete()
        if said is not None:
            await self._decide(card, "refuse", str(said))

    async def _decide(self, card: Card, word: str, reason: str) -> None:
        if not self._window.holds:
            return
        # What is shown as decided is on the disk by then.
        answer = await self._window.try_to(self._window.analysis.quick, "decide", [card.name], word, reason)
        if answer is not None:
            self._window.complain(str(answer))
            return
        await self.show()
        await self._decided()

    async def _turn(self, page: int) -> None:
        self._page = int(page) - 1
        await self.show()
