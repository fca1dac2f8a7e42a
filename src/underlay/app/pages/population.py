"""Whose the curves are, and what they say together."""

from __future__ import annotations

from collections import Counter

from nicegui import events, ui

from underlay.app.pages.outcome import plain_table
from underlay.app.pages.step import Window, data_address, message_list
from underlay.app.shown import Overview, Together

__all__ = ["PopulationPart"]

_LABELS = ("animal", "group")
_NONE = "none"
_OLD = "Curves were fitted or decided on since: press Mean and spread again."


class PopulationPart:
    """Labels of curves and the population picture.

    Parameters
    ----------
    window : Window
        Where it is shown.
    """

    def __init__(self, window: Window) -> None:
        self._window = window
        ui.label("Groups").classes("heading")
        with ui.expansion("Whose is which curve").props("dense").classes("wide").mark("whose"):
            self._find = (
                ui.input("Files whose name holds")
                .props("outlined dense clearable")
                .classes("wide")
                .mark("label-files")
            )
            self._found = ui.label().classes("quiet")
            self._find.on_value_change(self._count)
            self._known = ui.column().classes("wide")
            with ui.row().classes("fields"):
                self._column = (
                    ui.select(list(_LABELS), value=_LABELS[0], label="are of")
                    .props("outlined dense")
                    .classes("prior")
                )
                self._label = ui.input("called").props("outlined dense").classes("field").mark("label-name")
                ui.button("Set", on_click=self._set).props("outline no-caps").mark("label-set")
            ui.upload(
                label="Or bring a manifest (CSV: file, animal, group, x, y, thickness, ...)",
                auto_upload=True,
                on_upload=self._manifest,
            ).props("flat bordered accept=.csv").classes("drop small").mark("manifest")
        with ui.row().classes("fields"):
            self._by = (
                ui.select([_NONE], value=_NONE, label="Curves belong together by")
                .props("outlined dense")
                .classes("field")
                .mark("by")
            )
            self._group = (
                ui.select([_NONE], value=_NONE, label="Compare")
                .props("outlined dense")
                .classes("field")
                .mark("group")
            )
        ui.button("Mean and spread", on_click=self._together).props("outline no-caps").mark("together")
        self._place = ui.column().classes("wide")

    async def show(self, told: Overview) -> None:
        """Offer the labels that the map has, and show what was found before."""
        before = await self._window.try_to(self._window.analysis.quick, "together")
        found, is_new = before if isinstance(before, tuple) else (None, True)
        # Curves of one animal are not independent: with such a label, that is where it begins.
        asked = _LABELS if found is None else (found.by, found.group)
        for select, chosen in zip((self._by, self._group), asked, strict=True):
            value = select.value if select.value != _NONE else chosen
            select.set_options([_NONE, *told.labels], value=value if value in told.labels else _NONE)
        self._count()
        await self._show_labels()
        self._place.clear()
        if found is not None:
            with self._place:
                if not is_new:
                    ui.label(_OLD).classes("note").mark("old-population")
                self._found_together(found)

    async def _show_labels(self) -> None:
        """Say how many files each label has."""
        rows = await self._window.try_to(self._window.analysis.quick, "labels")
        self._known.clear()
        if not isinstance(rows, dict):
            return
        with self._known:
            for column in dict.fromkeys(name for row in rows.values() for name in row if name in _LABELS):
                counted = Counter(row.get(column, "") for row in rows.values())
                told = ", ".join(f"{label} ({count})" for label, count in sorted(counted.items()) if label)
                if told:
                    ui.label(f"{column}: {told}").classes("quiet").mark(f"known-{column}")

    def _files(self) -> list[str]:
        wanted = (self._find.value or "").casefold()
        return [
            path.name for path in self._window.analysis.folder.curve_files() if wanted in path.name.casefold()
        ]

    def _count(self) -> None:
        self._found.set_text(f"{len(self._files())} files")

    async def _set(self) -> None:
        if self._window.holds:
            files, label = self._files(), str(self._label.value or "")
            answer = await self._window.try_to(
                self._window.analysis.quick, "set_label", files, self._column.value, label
            )
            await self._tell(
                answer, f"{len(files)} files are of {self._column.value} {label}; fit all curves again"
            )

    async def _manifest(self, event: events.UploadEventArguments) -> None:
        if self._window.holds:
            answer = await self._window.try_to(
                self._window.analysis.quick, "take_manifest", await event.file.read()
            )
            await self._tell(answer, "The manifest is taken; fit all curves again")

    async def _tell(self, refused: object, done: str) -> None:
        if refused is None:
            ui.notify(done)
            await self._show_labels()
        else:
            self._window.complain(str(refused))

    async def _together(self) -> None:
        by, group = (str(select.value).replace(_NONE, "") for select in (self._by, self._group))
        told = await self._window.try_to(self._window.analysis.quick, "population", by, group)
        self._place.clear()
        with self._place:
            if not isinstance(told, Together):
                ui.label(str(told)).classes("bad").mark("population-refused")
                return
            self._found_together(told)

    def _found_together(self, told: Together) -> None:
        message_list(told.sentences, "more")
        plain_table(told.groups)
        plain_table(told.ratios)
        content = self._window.analysis.folder.read_result(told.picture) if told.picture else None
        if content is not None:
            ui.image(data_address(content)).classes("picture").props(
                'alt="units of every group and their means"'
            )
