"""What is fitted: a line for each number of the test, with its bounds and what is known of it before."""

from __future__ import annotations

from collections.abc import Awaitable, Callable

from nicegui import ui

from underlay.app.form import apart, problem_with
from underlay.app.pages.step import Window
from underlay.app.typed import comma_problem
from underlay.errors import UnderlayError
from underlay.report.amounts import amounts
from underlay.report.labels import label, start
from underlay.scene.parameters import kind_of
from underlay.scene.scene_file import scene_file_from_text
from underlay.scene.scene_keys import SceneKey, scene_keys
from underlay.units import KINDS, format_quantity, printed, printed_unit

__all__ = ["FreeTable"]

_BOUNDS = ("min", "max")
_OF_PRIOR = {"normal": ("mean", "sd"), "lognormal": ("median", "relative_sd"), "halfnormal": ("sd",)}
# The contact point is held or fitted where the curve is seen.
_ELSEWHERE = ("instrument.contact_depth",)
# Where the bounds of a number lie that is freed without any, as shares of it.
_WIDE = (1e-3, 1e3)


class FreeTable:
    """The numbers of the test that may be fitted.

    Parameters
    ----------
    window : Window
        Where it is shown.
    changed : callable
        Called after every change.
    """

    def __init__(self, window: Window, changed: Callable[[], Awaitable[None]]) -> None:
        self._window, self._changed = window, changed
        ui.label("What is fitted").classes("heading")
        self._place = ui.column().classes("wide free")

    def show(self) -> None:
        """List the numbers again."""
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
                with ui.expansion("More numbers").props("dense").classes("wide"):
                    for path in others:
                        self._line(path, known[path])

    def _numbers(self) -> dict[str, float]:
        """Numbers of the scene by path; of one that is not complete, what is fitted already."""
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
            ).props("dense").classes("free-name").mark(f"free-{path}")
            if path not in free:
                ui.label(f"held at {printed(amounts([value], kind_of(path))[0])}").classes("quiet")
                return
            entry = free[path]
            names = ["uniform", "loguniform", *_OF_PRIOR]
            for name in (*_BOUNDS, *_OF_PRIOR.get(str(entry.get("prior")), ())):
                self._amount(path, name)
            ui.select(
                {"": "bounds only", **{name: name for name in names}},
                value=entry.get("prior", ""),
                on_change=lambda event: self._put(path, "prior", str(event.value)),
            ).props('outlined dense options-dense aria-label="what is known before"').classes("prior")

    def _amount(self, path: str, name: str) -> None:
        kind = "dimensionless" if name == "relative_sd" else kind_of(path)
        units = KINDS[kind].units
        stated = str(self._window.analysis.draft.free[path].get(name, ""))
        number, unit = apart(stated, units)
        with ui.row(wrap=False).classes("amount small"):
            entry = ui.input(name.replace("_", " "), value=number).props(
                "outlined dense hide-bottom-space inputmode=decimal debounce=500"
            )
            entry.classes("number").mark(f"{path}.{name}")
            picked = None
            if any(units):
                picked = ui.select({each: printed_unit(each) for each in (*units, unit)}, value=unit)
                picked.props(f'outlined dense options-dense aria-label="unit of {name}"').classes("unit")

        async def changed() -> None:
            said = str(entry.value or "").strip()
            text = f"{said} {picked.value}" if said and picked is not None else said
            wrong = comma_problem(said, may_list=False) or problem_with(text, _key_of(kind))
            entry.error = wrong or None
            if not wrong:
                await self._put(path, name, text)

        entry.on_value_change(changed)
        if picked is not None:
            picked.on_value_change(changed)

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
    """Bounds far from a number that is positive by nature; none for others."""
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
    """A declaration of a number of this kind."""
    return next(key for key in scene_keys() if key.section == "fit")._replace(kind=kind)
