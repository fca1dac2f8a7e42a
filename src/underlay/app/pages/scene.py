"""Step 2: the test as a form with a drawing to scale, what is fitted, and the scene as text.

The form is made from the scene's declarations (`underlay.app.form`). `FreeTable` has a line for each parameter,
with its bounds and prior. `SceneText` takes the scene file as text, for what the form has no field for.
"""

from __future__ import annotations

from collections.abc import Awaitable, Callable, Sequence
from functools import partial
from typing import Any

from nicegui import ui

from underlay.app.form import (
    ADVANCED,
    BASES,
    NOTES,
    PRESETS,
    Draft,
    Field,
    apart,
    comma_problem,
    draft_from,
    help_of,
    preset,
    problem_with,
)
from underlay.app.pages import parts
from underlay.app.pages.parts import Step, Window
from underlay.errors import UnderlayError
from underlay.report.labels import label, start
from underlay.report.tables import amounts
from underlay.scene.parameters import kind_of
from underlay.scene.scene_file import scene_file_from_text
from underlay.scene.scene_keys import SceneKey, scene_keys
from underlay.units import KINDS, format_quantity, printed, printed_unit

_BOUNDS = ("min", "max")
_OF_PRIOR = {"normal": ("mean", "sd"), "lognormal": ("median", "relative_sd"), "halfnormal": ("sd",)}
# The contact point is held or fitted where the curve is seen.
_ELSEWHERE = ("instrument.contact_depth",)
# Where the bounds of a number lie that is freed without any, as shares of it.
_WIDE = (1e-3, 1e3)
_CHOOSES = ("shape", "model")
# What every test says of a layer.
_OF_A_LAYER = ("E", "nu", "thickness")
# Keys that every sample says.
_SAID = ("title", "rtol")
# What a scene says of its curve that stays when another sample is begun with.
_OF_THE_FILE = ("file", "test", "format", "columns", "flip", "calibration")


def amount(
    words: str,
    stated: str,
    units: Sequence[str],
    wrong: Callable[[str], str],
    put: Callable[[str], Awaitable[None]],
    kind: str,
    assumed: tuple[str, Callable[[], Awaitable[None]]] | None = None,
) -> ui.input:
    """Build the field of a number with the selection of its unit; return the field.

    Parameters
    ----------
    words, stated : str
        Label of the field, and its present text.
    units : sequence of str
        Units to choose from.
    wrong : callable
        Returns what is wrong with a text, as a sentence; empty if it is valid.
    put : callable
        Called with a valid text.
    kind : str
        CSS classes of field and unit.
    assumed : (str, callable), optional
        For a number that the user did not enter: mark of the button that confirms it, and what the button calls.
    """
    many = "," in stated
    number, unit = (stated, "") if many else apart(stated, tuple(units))
    with ui.row(wrap=False).classes(f"amount {kind}") as pair:
        entry = ui.input(words, value=number).classes("number")
        entry.props("outlined dense hide-bottom-space inputmode=decimal debounce=400")
        picked = None
        if any(units) and not many:
            picked = ui.select({each: printed_unit(each) for each in (*units, unit)}, value=unit)
            picked.props(f'outlined dense options-dense aria-label="unit of {words}"').classes("unit")
            picked.props["title"] = help_of("unit")
        if assumed is not None:
            mark, confirm = assumed
            taken = ui.button("assumed", on_click=confirm, color=None).props("flat dense no-caps")
            taken.classes("assumption").mark(mark).props["title"] = NOTES["assumed"]

    async def changed() -> None:
        said = str(entry.value or "").strip()
        text = f"{said} {picked.value}" if said and picked is not None and "," not in said else said
        entry.error = wrong(text) or None
        if not entry.error:
            pair.classes(remove="needed assumed")
            await put(text)

    entry.on_value_change(changed)
    if picked is not None:
        picked.on_value_change(changed)
    return entry


class FreeTable:
    """The list of parameters that may be fitted.

    Parameters
    ----------
    window : Window
        The browser window it belongs to.
    changed : callable
        Called after every change.
    """

    def __init__(self, window: Window, changed: Callable[[], Awaitable[None]]) -> None:
        self._window, self._changed = window, changed
        ui.label("What is fitted").classes("heading")
        self._place = ui.column().classes("wide free")

    def show(self) -> None:
        """List the parameters again."""
        free = self._window.analysis.draft.free
        known = self._numbers()
        usual = [
            path
            for path in known
            if path.endswith((".E", ".thickness", "radius", "nu", "baseline", "baseline_slope", "work"))
        ]
        self._place.clear()
        with self._place:
            for path in [path for path in known if path in usual or path in free]:
                self._line(path, known[path])
            others = [path for path in known if path not in usual and path not in free]
            if others:
                with parts.folded("More numbers"):
                    for path in others:
                        self._line(path, known[path])

    def _numbers(self) -> dict[str, float]:
        """Return the parameters of the scene by path (SI); if it is not valid, those already fitted, as 1."""
        try:
            file = scene_file_from_text(self._window.analysis.draft.text())
            known = {
                path: value for path, value in file.draft.parameters.items() if path not in file.left_out
            }
        except UnderlayError:
            known = dict.fromkeys(self._window.analysis.draft.free, 1.0)
        return {path: value for path, value in known.items() if path not in _ELSEWHERE}

    def _line(self, path: str, value: float) -> None:
        free = self._window.analysis.draft.free
        with ui.row().classes("free-line"):
            ui.checkbox(
                start(label(path)),
                value=path in free,
                on_change=lambda event: self._toggle(path, value, on=bool(event.value)),
            ).props("dense").classes("free-name").mark(f"free-{path}").props["title"] = help_of("free")
            if path not in free:
                ui.label(f"fixed at {printed(amounts([value], kind_of(path))[0])}").classes("quiet")
                return
            entry = free[path]
            names = ["uniform", "loguniform", *_OF_PRIOR]
            for name in (*_BOUNDS, *_OF_PRIOR.get(str(entry.get("prior")), ())):
                self._amount(path, name)
            known = ui.select(
                {"": "bounds only", **{name: name for name in names}},
                value=entry.get("prior", ""),
                on_change=lambda event: self._put(path, "prior", str(event.value)),
            )
            parts.outlined(known, "prior", "prior", 'options-dense aria-label="what is known before"')

    def _amount(self, path: str, name: str) -> None:
        kind = "dimensionless" if name == "relative_sd" else kind_of(path)
        stated = str(self._window.analysis.draft.free[path].get(name, ""))
        words = name.replace("_", " ")
        entry = amount(
            words,
            stated,
            KINDS[kind].units,
            lambda text: comma_problem(text, may_list=False) or problem_with(text, _key_of(kind)),
            lambda text: self._put(path, name, text),
            "small",
        )
        entry.mark(f"{path}.{name}").props["title"] = help_of(name)

    async def _put(self, path: str, name: str, text: str) -> None:
        entry = self._window.analysis.draft.free.setdefault(path, {})
        entry.pop(name, None)
        if name == "prior":
            for other in {key for keys in _OF_PRIOR.values() for key in keys}:
                entry.pop(other, None)
        if text:
            bare = name == "relative_sd" or (name != "prior" and kind_of(path) == "dimensionless")
            entry[name] = float(text) if bare else text
        if name == "prior":
            self.show()
        await self._changed()

    async def _toggle(self, path: str, value: float, *, on: bool) -> None:
        free = self._window.analysis.draft.free
        free.pop(path, None)
        if on:
            free[path] = _wide_bounds(path, value)
        self.show()
        await self._changed()


def _wide_bounds(path: str, value: float) -> dict[str, str | float]:
    """Return bounds a factor of 1000 around a positive number, 0 to 0.5 for nu, none for any other."""
    kind = kind_of(path)
    if path.endswith("nu"):
        return {"min": 0.0, "max": 0.5}
    if path.startswith("instrument.") or not value > 0.0:
        return {}
    low, high = (value * factor for factor in _WIDE)
    if kind == "dimensionless":
        return {"min": low, "max": high}
    return {"min": format_quantity(low, kind), "max": format_quantity(high, kind)}


def _key_of(kind: str) -> SceneKey:
    """Return the declaration of a key for a number of this kind of quantity."""
    return next(key for key in scene_keys() if key.section == "fit")._replace(kind=kind)


class SceneText:
    """The scene file as text, for editing.

    Parameters
    ----------
    window : Window
        The browser window it belongs to.
    changed : callable
        Called when an edited text was accepted.
    """

    def __init__(self, window: Window, changed: Callable[[], Awaitable[None]]) -> None:
        self._window, self._changed = window, changed
        with parts.folded("More: the test as text"):
            ui.label(NOTES["text"]).classes("quiet")
            self._text = parts.helped(ui.textarea(value=window.analysis.draft.text()), "scene-text").classes(
                "wide"
            )
            self._text.props('outlined autogrow input-class=code-entry aria-label="the test as text"')
            parts.button("Use this text", self._use, mark="use-text")

    async def _use(self) -> None:
        """Use the edited text as the scene, or report what is wrong and leave the scene unchanged."""
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


class SceneStep(Step):
    """The step with the form of the scene."""

    title = "Test"
    help = "Say what was tested: tip, layer, what lies under it, and what is fitted"

    @property
    def state(self) -> str:
        """How many numbers are still needed, or are assumed, as text; empty for none."""
        draft = self.analysis.draft
        if self.analysis.lacks:
            return f"{len(draft.missing)} needed" if draft.missing else "not complete"
        return f"{len(draft.assumptions)} assumed" if draft.assumptions else ""

    def build(self) -> None:
        """Build the buttons for prepared tests, and empty columns for form and drawing."""
        with ui.row().classes("columns"):
            with ui.column().classes("side wider"):
                with ui.row().classes("presets"):
                    ui.label("Begin with").classes("quiet")
                    for name, words in PRESETS.items():
                        begin, tip = (
                            partial(self._begin, name),
                            "Fills in usual numbers, which count as assumed",
                        )
                        parts.button(words, begin, "outline dense", mark=f"preset-{name}", tip=tip)
                self._form = ui.column().classes("wide form")
            with ui.column().classes("main"):
                self._drawing = ui.column().classes("wide")
                # Not made again with every drawing: who stands on it with the keyboard stays there.
                self._next = parts.button(
                    "Next: the fit", lambda: self.window.go("Fit"), "unelevated", mark="to-fit"
                )
                self._next.set_visibility(False)
                self._free = FreeTable(self.window, self._changed)

    async def show(self) -> None:
        """Build the form of the present scene, and draw it."""
        draft, self._lacks = self.analysis.draft, bool(self.analysis.lacks)
        self._form.clear()
        with self._form:
            self._section("indenter", "The tip")
            self._section("layer", "The layer")
            self._between(draft)
            with ui.row().classes("section-head"):
                ui.label("Substrate").classes("heading")
                base = ui.select(
                    dict(BASES), value=draft.base, on_change=lambda event: self._rebase(event.value)
                )
                parts.outlined(base, "base", look="aria-label='what lies under the layer'")
            if draft.base == "elastic":
                self._fields("substrate")
                self._axial("substrate")
            for section, words in ADVANCED.items():
                # Open where something stands in it that not every sample says.
                is_open = any(field.text for field in draft.fields(section) if field.key.name not in _SAID)
                with parts.folded(words, is_open=is_open):
                    self._fields(section)
            SceneText(self.window, self.show)
        await self._draw()
        self._free.show()

    def _section(self, section: str, words: str) -> None:
        ui.label(words).classes("heading")
        self._fields(section)
        if section != "indenter":
            self._axial(section)

    def _between(self, draft: Draft) -> None:
        for number, section in enumerate(draft.between, start=2):
            with ui.row().classes("section-head"):
                ui.label(f"Layer {number}").classes("heading")
                parts.button("Remove", partial(self._relayer, section), "flat dense")
            self._fields(section)
            self._axial(section)
        if draft.base != "none":
            parts.button("Add a layer under it", lambda: self._relayer(None), "flat dense", mark="add-layer")

    def _axial(self, section: str) -> None:
        axial = ui.checkbox(
            "stiffer along than across (transversely isotropic)",
            value="E_axial" in self.analysis.draft.peek(section),
            on_change=lambda event: self._make_axial(section, axial=bool(event.value)),
        )
        parts.helped(axial.props("dense"), "axial")

    def _fields(self, section: str) -> None:
        """Build the fields of a section; for a layer the less common ones are folded."""
        fields = self.analysis.draft.fields(section)
        usual = [field for field in fields if not self._is_layer(section) or field.key.name in _OF_A_LAYER]
        more = [field for field in fields if field not in usual]
        self._row(usual)
        if more:
            is_open = any(field.text for field in more)
            with parts.folded("Lower face, edges, drainage", is_open=is_open):
                self._row(more)

    def _is_layer(self, section: str) -> bool:
        return section == "layer" or section.startswith("substrate.layers")

    def _row(self, fields: Sequence[Field]) -> None:
        with ui.row().classes("fields"):
            for field in fields:
                if field.key.words:
                    self._choice(field)
                else:
                    self._amount(field)

    def _choice(self, field: Field) -> None:
        words = list(field.key.words)
        value = field.text or field.key.default or None
        if value not in words:
            words = [*words, value] if value else words
        picked = ui.select(words, label=field.label, value=value, clearable=not field.required)
        picked.props("outlined dense").classes("field").mark(_mark(field))
        picked.props["title"] = field.help
        picked.on_value_change(lambda event: self._put(field.section, field.key, str(event.value or "")))

    def _amount(self, field: Field) -> None:
        missing = field.is_missing and self._lacks
        kind = f"{'assumed' if field.assumed else ''} {'needed' if missing else ''}"
        entry = amount(
            field.label,
            field.text,
            field.units,
            lambda text: problem_with(text, field.key),
            lambda text: self._put(field.section, field.key, text),
            kind if field.key.kind else "wide",
            (f"assumed-{field.path}", lambda: self._confirm(field.path)) if field.assumed else None,
        )
        entry.props["placeholder"] = "needed" if missing else "" if field.required else field.key.default
        entry.mark(_mark(field)).props["title"] = field.help
        if not field.key.kind:
            # Of words there is no example in a unit: what may stand there is said under it.
            entry.props["hint"] = field.help

    async def _confirm(self, path: str) -> None:
        self.analysis.draft.confirm(path)
        if self.window.keep():
            await self.show()

    async def _begin(self, name: str) -> None:
        """Replace the scene by a prepared test; the selected curve and how it is read are kept."""
        before = self.analysis.draft.peek("curve")
        kept: dict[str, Any] = {key: before[key] for key in _OF_THE_FILE if key in before}
        self.analysis.draft = preset(name)
        self.analysis.draft.table("curve").update(kept)
        if self.window.keep():
            await self.show()

    async def _put(self, section: str, key: SceneKey, text: str) -> None:
        self.analysis.draft.put(section, key, text)
        if key.name in _CHOOSES:
            await self._reshape(lambda: _drop_others(self.analysis.draft, section))
        else:
            await self._changed()

    async def _reshape(self, change: Callable[[], None]) -> None:
        change()
        if self.window.keep():
            await self.show()

    async def _rebase(self, base: str) -> None:
        await self._reshape(lambda: self.analysis.draft.choose_base(base))

    async def _relayer(self, section: str | None) -> None:
        draft = self.analysis.draft
        await self._reshape(draft.add_layer if section is None else lambda: draft.remove_layer(section))

    async def _make_axial(self, section: str, *, axial: bool) -> None:
        await self._reshape(lambda: self.analysis.draft.set_axial(section, axial=axial))

    async def _changed(self) -> None:
        if self.window.keep():
            await self._draw()

    async def _draw(self) -> None:
        """Draw the scene, or say what is missing."""
        missing = self.analysis.draft.missing
        if missing and self.analysis.lacks:
            drawn: object = f"Needed: {', '.join(missing)}. Enter them, and the test is drawn here to scale."
        else:
            drawn = await self.window.try_to(self.analysis.quick, "scene")
        self._drawing.clear()
        self._next.set_visibility(isinstance(drawn, bytes))
        with self._drawing:
            if isinstance(drawn, bytes):
                ui.image(parts.data_address(drawn)).classes("drawing").props('alt="the test, drawn to scale"')
            else:
                ui.label(str(drawn)).classes("bad").mark("scene-problem")


def _drop_others(draft: Draft, section: str) -> None:
    """Remove the keys of a section that do not belong to the chosen shape or model."""
    table = draft.table(section)
    known = {field.key.name for field in draft.fields(section)}
    for name in [name for name in table if name not in known and not isinstance(table[name], dict)]:
        del table[name]
    if not table.get("model") and section != "indenter":
        table.clear()


def _mark(field: Field) -> str:
    return f"{field.section}.{field.key.name}".replace(" ", "-")
