"""Step 1: upload curve files, and see how each was read."""

from __future__ import annotations

from collections.abc import Awaitable, Callable
from functools import partial
from typing import Any

from nicegui import events, ui

from underlay.app.form import comma_problem, pairs_of
from underlay.app.pages import parts
from underlay.app.pages.parts import Step
from underlay.app.shown import Reading
from underlay.data.readers import all_formats
from underlay.errors import InputError

# Names listed at once; with more than a few there is a field to find one, and a table turns pages.
_LISTED, _FEW = 100, 8
_AUTO = "as its content says"
_CALIBRATION = {"spring_constant": "Spring constant", "sensitivity": "Deflection sensitivity"}


class FilesStep(Step):
    """The curve files of an analysis, and how they are read."""

    title = "Curves"
    help = "Bring curve files, and see how each was read"

    @property
    def state(self) -> str:
        """Number of files, as text; empty for none."""
        return str(len(self.analysis.folder.curve_files()) or "")

    def build(self) -> None:
        """Build the upload area, the list of uploaded files, and an empty column for the selected one."""
        with ui.row().classes("columns"):
            with ui.column().classes("side"):
                self._upload = parts.upload(self._bring)
                self._find = parts.outlined(ui.input("Find"), "find", "wide", "clearable")
                self._find.on_value_change(self._show_list)
                self._list = ui.column().classes("wide")
            self._reading = ui.column().classes("main")

    async def show(self) -> None:
        """List the files again, and show the selected one."""
        self._show_list()
        await self._show_reading()

    async def _bring(self, event: events.MultiUploadEventArguments) -> None:
        self._upload.reset()
        if not self.window.holds:
            return
        brought = await parts.add_files(self.analysis.folder, event)
        if brought and not self.analysis.curve_name:
            self.analysis.pick(brought[0])
        self.window.kept()
        await self.show()

    def _show_list(self) -> None:
        names = [path.name for path in self.analysis.folder.curve_files()]
        wanted = (self._find.value or "").casefold()
        self._find.set_visibility(len(names) > _FEW)
        shown = [name for name in names if wanted in name.casefold()]
        self._list.clear()
        with self._list:
            if not names:
                with parts.folded("Files that can be read"):
                    for entry in all_formats():
                        ui.label(entry.description).classes("quiet")
            else:
                with ui.list().props("dense separator").classes("files"):
                    for name in shown[:_LISTED]:
                        self._entry(name)
            if len(shown) > _LISTED:
                ui.label(f"and {len(shown) - _LISTED} more").classes("quiet")

    def _entry(self, name: str) -> None:
        with ui.item(on_click=lambda: self._pick(name)).mark(f"file-{name}") as item:
            item.props(add="active" if name == self.analysis.curve_name else "")
            ui.item_section(name)
            with ui.item_section().props("side"):
                ui.button(icon="close").props("flat dense round size=sm aria-label=remove").on(
                    "click.stop", lambda: self._remove(name)
                ).props('title="Takes the curve out of this analysis; your own file stays"')

    async def _pick(self, name: str, test: int = 1) -> None:
        if self.window.holds:
            self.analysis.pick(name, test)
            await self.show()

    async def _remove(self, name: str) -> None:
        if self.window.holds:
            self.analysis.remove(name)
            self.window.kept()
            await self.show()

    async def _show_reading(self) -> None:
        name, place = self.analysis.curve_name, self._reading
        place.clear()
        with place:
            ui.label(f"Reading {name} ..." if name else "No curve yet").classes("heading")
            if not name:
                ui.label("Force against indentation will appear here. Drop one curve or many at the left.")
                return
        told: Reading | None = await self.window.ask(self.analysis.quick, "read", name)
        place.clear()
        with place:
            ui.label(name).classes("heading")
            if told is None:
                return
            self._picture = ui.column().classes("wide")
            if told.refused:
                ui.label(told.refused).classes("bad").mark("refused")
            else:
                self._told(told)
            self._how(told)
            if not told.refused:
                parts.button("Next: the test", lambda: self.window.go("Test"), "unelevated")
        if not told.refused:
            pictures = await self.window.ask(self.analysis.quick, "curve", name, self._test)
            if pictures is not None and name == self.analysis.curve_name:
                self._drawn(*pictures)

    def _drawn(self, force: bytes, time: bytes) -> None:
        """Show two pictures (PNG): force against indentation and, folded below, both against time by segment."""
        with self._picture:
            ui.image(parts.data_address(force)).classes("picture").props('alt="force against indentation"')
            with parts.folded("Against time, with its segments"):
                ui.image(parts.data_address(time)).classes("picture").props(
                    'alt="depth and force against time"'
                )

    @property
    def _test(self) -> int:
        return int(self.analysis.draft.get("curve", "test") or 1)

    def _told(self, told: Reading) -> None:
        for words, value in {"Format": told.format, "Recorded": told.instrument, **told.facts}.items():
            if value:
                with ui.row().classes("fact"):
                    ui.label(words).classes("quiet")
                    ui.label(value)
        tests = parts.table(told.tests, most=_FEW).mark("tests")
        if len(told.tests) > 1:
            tests.set_selection("single")
            tests.selected = [dict(row) for row in told.tests if row["test"] == str(self._test)]
            tests.on_select(self._pick_test)
        parts.message_list(told.notes)

    async def _pick_test(self, event: Any) -> None:
        if event.selection:
            await self._pick(self.analysis.curve_name, int(event.selection[0]["test"]))

    def _how(self, told: Reading) -> None:
        """Build the fields on how the file is read: format, calibration, signs and columns.

        They are kept in the scene file, for files that do not state them.
        """
        draft = self.analysis.draft
        known = draft.peek("curve")
        with parts.folded("Read it differently", is_open=bool(told.refused)):
            with ui.row().classes("fields"):
                names = [_AUTO, *(entry.name for entry in all_formats())]
                named = ui.select(names, label="Format", value=draft.get("curve", "format") or _AUTO)
                parts.outlined(named, "format").on_value_change(
                    lambda event: self._read_as("format", None if event.value == _AUTO else event.value)
                )
                for key, words in _CALIBRATION.items():
                    value = str((known.get("calibration") or {}).get(key, ""))
                    entry = ui.input(words, value=value, placeholder=told.facts.get(words, "as in the file"))
                    self._on_change(parts.outlined(entry, f"read-{key}"), partial(self._calibrate, key))
                turned = known.get("flip") or []
                for column in ("depth", "force"):
                    turn = ui.checkbox(
                        f"turn the sign of the {column}",
                        value=column in turned,
                        on_change=lambda event, column=column: self._turn(column, turned=bool(event.value)),
                    )
                    parts.helped(turn, f"turn-{column}")
            there = known.get("columns") or {}
            stated = ", ".join(f"{name} = {value}" for name, value in there.items())
            columns = ui.input("Columns", value=stated, placeholder="depth = h (nm), force = -Fz (mN)")
            self._on_change(parts.outlined(columns, "read-columns", "wide"), partial(self._pair, "columns"))

    def _on_change(self, entry: ui.input, act: Callable[[str], Awaitable[None]]) -> None:
        """Call `act` with the text of a field once it has been entered."""
        entry.on("change", lambda: act(str(entry.value or "").strip()))

    async def _calibrate(self, key: str, text: str) -> None:
        known = dict(self.analysis.draft.peek("curve").get("calibration") or {})
        known.pop(key, None)
        if wrong := comma_problem(text, may_list=False):
            self.window.complain(wrong)
            return
        await self._read_as("calibration", known | ({key: text} if text else {}))

    async def _pair(self, key: str, text: str) -> None:
        """Set a key of ``[curve]`` from name and value pairs, or report what is wrong and leave it unchanged."""
        try:
            pairs = pairs_of(text)
        except InputError as error:
            self.window.complain(str(error))
            return
        await self._read_as(key, pairs)

    async def _read_as(self, key: str, value: Any) -> None:
        table = self.analysis.draft.table("curve")
        table.pop(key, None)
        if value:
            table[key] = value
        if self.window.keep():
            await self.show()

    async def _turn(self, column: str, *, turned: bool) -> None:
        before = [name for name in self.analysis.draft.peek("curve").get("flip") or [] if name != column]
        await self._read_as("flip", [*before, column] if turned else before)
