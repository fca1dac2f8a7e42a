"""The scene as text, for what the form has no field for: all that a scene file can say can be said here."""

from __future__ import annotations

from collections.abc import Awaitable, Callable

from nicegui import ui

from underlay.app.pages.step import Window
from underlay.app.scene_text import draft_from
from underlay.errors import UnderlayError

__all__ = ["SceneText"]

_WORDS = (
    'What has no field is written here: springs under a layer, bond = { normal = "1 GPa/m" }, and the prior '
    '"found" of the contact point. The command underlay keys lists every key.'
)


class SceneText:
    """The text of the scene file, to be changed by hand.

    Parameters
    ----------
    window : Window
        Where it is shown.
    changed : callable
        Called when another text was taken.
    """

    def __init__(self, window: Window, changed: Callable[[], Awaitable[None]]) -> None:
        self._window, self._changed = window, changed
        with ui.expansion("The test as text (scene.toml)").props("dense").classes("wide"):
            ui.label(_WORDS).classes("quiet")
            self._text = ui.textarea(value=window.analysis.draft.text())
            self._text.props('outlined autogrow input-class=code-entry aria-label="scene.toml"')
            self._text.classes("wide").mark("scene-text")
            ui.button("Use this text", on_click=self._use).props("outline no-caps").mark("use-text")

    async def _use(self) -> None:
        """Take the text over, or say what is wrong with it and leave the scene as it is."""
        analysis = self._window.analysis
        files = [path.name for path in analysis.folder.curve_files()]
        try:
            draft = draft_from(str(self._text.value or ""), files)
        except UnderlayError as error:
            self._window.complain(str(error))
            return
        if self._window.holds:
            analysis.draft = draft
            if self._window.keep():
                await self._changed()
