"""Step 5: downloads, and the posterior."""

from __future__ import annotations

from functools import partial

from nicegui import ui

from underlay.app.folder import is_kept
from underlay.app.form import DOWNLOADS, NOTES
from underlay.app.pages import parts
from underlay.app.pages.parts import Step, Working
from underlay.app.shown import Found, Sampled, Taken

_STEPS = {2_000: "quick look", 20_000: "for a paper", 100_000: "hard cases"}


class TakeAwayStep(Step):
    """The step with downloads and the posterior."""

    title = "Export"
    help = "The report page, spreadsheets, pictures, the posterior, and what repeats the fit"

    def build(self) -> None:
        """Build the buttons, and empty columns for scene, script and posterior."""
        with ui.row().classes("columns"):
            with ui.column().classes("side wider"):
                ui.label("This fit").classes("heading")
                self._none = ui.label("Not fitted yet: fit this curve in step 3.").classes("quiet")
                self._of_fit = [
                    self._offer(words, task, ending).mark(f"take-{task}")
                    for task, (words, ending) in DOWNLOADS.items()
                ]
                self._pictures = ui.column().classes("wide")
                ui.label("All curves").classes("heading")
                self._no_map = ui.label("Not fitted yet: fit all curves in step 4.").classes("quiet")
                self._old_map = ui.label(NOTES["old-map-taken"]).classes("note").mark("old-map")
                self._of_map = self._offer("Spreadsheet of all (Excel)", "excel_of_all", "all.xlsx")
                self._of_map.mark("take-all")
                ui.label("Posterior").classes("heading")
                ui.label(NOTES["posterior"]).classes("quiet")
                self._most = ui.select(
                    {most: f"at most {most} steps ({words})" for most, words in _STEPS.items()},
                    value=20_000,
                    label="How long",
                )
                parts.outlined(self._most, "most", "wide")
                self._working = Working(self.window, "Sample", self._sample, mark="sample")
            with ui.column().classes("main"):
                self._posterior = ui.column().classes("wide")
                self._old = ui.label(NOTES["old-fit-taken"]).classes("note").mark("old-fit")
                with parts.folded("For programmers: the test as a file, and Python that fits it"):
                    self._scene = ui.code("", language="toml").classes("wide code").mark("fitted-scene")
                    self._script = ui.code("", language="python").classes("wide code").mark("script")

    async def show(self) -> None:
        """Show scene and script for download, and the stored posterior."""
        await self._show_posterior()
        folder, stem = self.analysis.folder, self.analysis.stem
        is_fitted = bool(stem) and is_kept(folder, stem, Found)
        is_mapped = (folder.results / "map.csv").is_file()
        self._none.set_visibility(not is_fitted)
        self._no_map.set_visibility(not is_mapped)
        for offer in self._of_fit:
            offer.set_enabled(is_fitted)
        self._of_map.set_enabled(is_mapped)
        self._working.allow(allowed=bool(stem) and not self.analysis.lacks)
        told = await self.window.try_to(self.analysis.quick, "taken")
        is_told = isinstance(told, Taken)
        self._old.set_visibility(is_told and told.is_old)
        self._old_map.set_visibility(is_told and told.is_map_old)
        self._scene.set_content(told.scene if is_told else folder.scene_text())
        self._script.set_content(told.script if is_told else str(told))
        self._pictures.clear()
        with self._pictures:
            for path in folder.result_files(stem, (".png",)):
                words = f"Picture: {path.name.removeprefix(f'{stem}.')}"
                parts.button(words, partial(self._give, path.name), "flat dense align=left")

    def _offer(self, words: str, task: str, ending: str) -> ui.button:
        offer = parts.button(words, lambda: self._take(offer, task, ending), "outline align=left")
        return offer

    async def _take(self, offer: ui.button, task: str, ending: str) -> None:
        offer.props("loading")
        try:
            content = await self.window.ask(self.analysis.long, task)
        finally:
            offer.props(remove="loading")
        if isinstance(content, bytes):
            ui.download.content(content, f"{self.analysis.stem or 'underlay'}.{ending}")

    def _give(self, name: str) -> None:
        content = self.analysis.folder.read_result(name)
        if content is not None:
            ui.download.content(content, name)

    async def _sample(self) -> None:
        self._posterior.clear()
        await self._working.run("sample", int(self._most.value))
        await self.show()

    async def _show_posterior(self) -> None:
        """Show the stored posterior of the selected curve."""
        before = await self.window.before(Sampled)
        self._posterior.clear()
        if before is None:
            return
        told, is_old = before
        with self._posterior:
            ui.label("Posterior").classes("heading")
            if is_old:
                ui.label(NOTES["old-posterior"]).classes("note").mark("old-posterior")
            parts.sheet(told.sheet)
            parts.message_list(told.notes)
