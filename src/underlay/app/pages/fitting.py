"""Step 3: the curve with contact point and fit range, both contact models drawn over it; then the fit.

For a curve with measured contact stiffness the fit of a film is offered as well (`FilmPart`).
"""

from __future__ import annotations

import math
import time
from functools import partial

from nicegui import events, ui

from underlay.app.folder import is_kept
from underlay.app.form import NOTES
from underlay.app.pages import parts
from underlay.app.pages.outcome import Outcome
from underlay.app.pages.parts import Step, Window, Working
from underlay.app.shown import Film, Found, Law, Look
from underlay.report.labels import labelled, start
from underlay.report.plots.fit import Canvas
from underlay.report.tables import amounts, span
from underlay.units import printed

_PERFECT = "none: a perfect tip"
_CONTACT = "instrument.contact_depth"
_STEPS = 1000
# Seconds without a movement after which a handle has come to rest: longer than between two presses of a held key.
_REST = 0.4
# Width and height of the picture (pixels).
_SIZE = (936, 507)
# What is held where no handle is near.
_PAN = "pan"
# Seconds between two places of a pointer or a wheel that are told: about what it takes to draw for one. What comes
# faster waits, and a quick hand was half a second ahead of the picture (the study of the page).
_EACH = 0.05
# Where on the picture a pressed pointer is, as a share of its width.
_MOVE = """(event) => { if (!event.buttons) return;
  const box = event.target.getBoundingClientRect();
  emit({at: (event.clientX - box.left) / box.width}); }"""
# Which way a wheel was turned, and where on the picture, as a share of its width.
_WHEEL = """(event) => { event.preventDefault();
  const box = event.currentTarget.getBoundingClientRect();
  emit({up: event.deltaY < 0, at: (event.clientX - box.left) / box.width}); }"""
# A handle is taken from this far (pixels of the picture): a finger covers twice that.
_REACH = 20.0
# Verdicts on a curve, in the words of those on a fit.
_QUALITY = {"doubtful": "check", "refused": "reject"}
#: Of the handles: the contact point, and the ends of the range.
GREEN, GREY = "#009e73", "#404040"


def _sentence(note: str) -> str:
    """Return a note on a curve as a sentence."""
    return f"{printed(start(labelled(note)))}."


def _stroke(law: Law) -> str:
    """Return the SVG attributes of a contact model's line."""
    return f'fill="none" stroke="{law.colour}" stroke-width="2.5" stroke-dasharray="{law.dashes}"'


class FilmPart:
    """Fields and result of the fit of a film, for curves with measured contact stiffness.

    Parameters
    ----------
    window : Window
        The browser window it belongs to.
    """

    def __init__(self, window: Window) -> None:
        self._window = window
        with ui.column().classes("wide") as self._whole:
            ui.label("A film by its contact stiffness").classes("heading")
            ui.label(NOTES["film"]).classes("quiet")
            with ui.row().classes("fields"):
                base = ui.select([_PERFECT], value=_PERFECT, label="Same tip on a known sample")
                self._base = parts.outlined(base, "film-base")
                self._modulus = parts.outlined(
                    ui.input("Its E / (1 - nu^2)", placeholder="165 GPa"), "film-modulus"
                )
                self._low = parts.outlined(ui.input("From depth", placeholder="0 nm"), "film-from")
                self._high = parts.outlined(ui.input("To depth", placeholder="1 m"), "film-to")
            with ui.row().classes("actions"):
                self._working = Working(window, "Fit the stiffness", self._go, mark="film")
            self._place = ui.column().classes("wide")
        self._whole.set_visibility(False)

    async def show(self, *, has_stiffness: bool) -> None:
        """Show the fields, and any stored result, if the curve has a measured stiffness; else hide them."""
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
        """Show the stored result of the selected curve, and whether the scene has changed since."""
        if before := await self._window.before(Film):
            self._shown(*before)

    async def _go(self) -> None:
        base = "" if self._base.value in (None, _PERFECT) else str(self._base.value)
        low, high = (str(entry.value or entry.props["placeholder"]) for entry in (self._low, self._high))
        told = await self._working.run("film", base, str(self._modulus.value or ""), low, high)
        if isinstance(told, Film):
            await self._show_kept()

    def _shown(self, film: Film, is_old: bool) -> None:
        self._place.clear()
        with self._place:
            if is_old:
                ui.label(NOTES["old-film"]).classes("note")
            parts.table(film.table)
            parts.message_list(film.notes, "more")
            content = self._window.analysis.folder.read_result(film.picture)
            if content is not None:
                ui.image(parts.data_address(content)).classes("picture half").props(
                    'alt="contact stiffness and modulus by depth"'
                )


class FitStep(Step):
    """The curve with handles for contact point and fit range, and the fit."""

    title = "Fit"
    help = "Set contact point and range on the curve, fit it, and see the number with its uncertainty"

    @property
    def state(self) -> str:
        """The word "fitted" if the selected curve has a stored fit, else empty."""
        stem = self.analysis.stem
        return "fitted" if stem and is_kept(self.analysis.folder, stem, Found) else ""

    def __init__(self, window: Window) -> None:
        super().__init__(window)
        self._look: Look | None = None
        self._contact, self._range = 0.0, (0.0, 0.0)
        # What of the curve is seen, and where it was when it was taken to be moved: pixel and ends.
        self._view: tuple[float, float] | None = None
        self._taken = (0.0, 0.0, 0.0)
        self._held: str = ""
        self._is_dragged = False
        self._laws: tuple[Law, ...] = ()
        # Whether laws are being worked out, and what is to be done after that.
        self._looking = self._again = self._redraw = False
        self._moved = 0.0

    def build(self) -> None:
        """Build picture, sliders and button, and empty columns for results."""
        self._empty = ui.column()
        with ui.row().classes("columns") as self._whole:
            with ui.column().classes("main"):
                with ui.row().classes("actions"):
                    for words, turn, mark in (("Previous", -1, "previous"), ("Next", 1, "next")):
                        tip = f"{words} curve of this analysis"
                        parts.button(words, partial(self._turn, turn), "flat dense", mark=mark, tip=tip)
                    self._place = ui.label().classes("quiet").mark("place")
                    ui.space()
                    for icon, words, factor in (
                        ("zoom_in", "Zoom in", 0.5),
                        ("zoom_out", "Zoom out", 2.0),
                        ("zoom_out_map", "Whole curve", 0.0),
                    ):
                        look = f'flat dense icon={icon} aria-label="{words}"'
                        parts.button("", partial(self._zoom, factor), look, mark=icon, tip=words)
                # The curve lies behind: with every move only what is over it is sent again.
                self._paper = ui.element("div").classes("picture paper")
                with self._paper:
                    self._picture = ui.interactive_image(
                        size=_SIZE,
                        on_mouse=self._drag,
                        # Pointers are mice, fingers and pens.
                        events=["pointerdown", "pointerup", "pointerleave", "pointercancel"],
                        # Numbers and colours of this module.
                        sanitize=False,
                    )
                self._picture.classes("handle").mark("curve")
                self._picture.on("pointermove", self._dragged, js_handler=_MOVE, throttle=_EACH)
                self._picture.on("wheel", self._wheel, js_handler=_WHEEL, throttle=_EACH)
                self._picture.on("dblclick", lambda: self._zoom(0.0))
                ui.label(NOTES["handles"]).classes("quiet")
                with ui.row().classes("slide"):
                    ui.label("Contact").classes("slide-name")
                    self._contact_slide = ui.slider(min=0, max=_STEPS, step=1, on_change=self._slid)
                    parts.helped(self._contact_slide, "contact").props(
                        'color=accent aria-label="contact point"'
                    )
                    self._contact_words = ui.label().classes("slide-value").mark("contact-words")
                with ui.row().classes("slide"):
                    ui.label("Fit range").classes("slide-name")
                    self._range_slide = ui.range(min=0, max=_STEPS, step=1, on_change=self._slid)
                    parts.helped(self._range_slide, "range").props('color=grey-9 aria-label="fit range"')
                    self._range_words = ui.label().classes("slide-value")
            with ui.column().classes("side"):
                ui.label("Modulus at this contact point").classes("heading")
                self._moduli = ui.column().classes("wide")
                self._fitted = ui.switch("find the contact point in the fit", on_change=self._hold)
                parts.helped(self._fitted, "fit-contact")
                self._notes = ui.column().classes("wide")
        # The axis counts from the contact point: it is drawn again when that has come to rest.
        self._rest = ui.timer(_REST, self._rested, active=False)
        self._outcome = Outcome(self.window, self._fill_in)
        self._film = FilmPart(self.window)

    async def show(self) -> None:
        """Show the selected curve with contact point and range of the scene, and its stored fit."""
        there = bool(self.analysis.curve_name) and not self.analysis.lacks
        self._whole.set_visibility(there)
        self._outcome.allow(allowed=there)
        self._empty.clear()
        if not there:
            self._show_way()
        self._forget()
        if there:
            names = [path.name for path in self.analysis.folder.curve_files()]
            at = names.index(self.analysis.curve_name)
            self._place.set_text(f"{names[at]}, {at + 1} of {len(names)}")
            self._moduli.clear()
            await self._take(None, None, None)
            self._fill_in()
            await self._outcome.show()
        await self._film.show(has_stiffness=there and self._look is not None and self._look.has_stiffness)

    def _forget(self) -> None:
        self._look = self._view = None

    def _show_way(self) -> None:
        """Say what is missing for a fit, with a button to the step where it is entered."""
        missing = self.analysis.draft.missing
        what = f"Needed: {', '.join(missing)}." if missing else self.analysis.lacks
        says, step, words = (
            (f"The test is not complete. {what}", "Test", "Complete the test")
            if self.analysis.curve_name
            else ("No curve yet.", "Curves", "Bring a curve")
        )
        with self._empty:
            ui.label(says).classes("heading").mark("way")
            ui.label("The curve with its contact point and fit range will appear here, and then its modulus.")
            parts.button(words, lambda: self.window.go(step), "unelevated")

    async def _turn(self, turn: int) -> None:
        """Select the next (1) or previous (-1) curve, in a cycle."""
        names = [path.name for path in self.analysis.folder.curve_files()]
        if self.window.holds and names:
            self.analysis.pick(names[(names.index(self.analysis.curve_name) + turn) % len(names)])
            self.window.kept()
            await self.show()

    async def _wheel(self, event: events.GenericEventArguments) -> None:
        picture = self._known().picture
        at = event.args["at"] * picture.width
        await self._zoom(0.8 if event.args["up"] else 1.25, self._depth(at))

    async def _zoom(self, factor: float, about: float | None = None) -> None:
        """Scale the visible depth range by a factor about a depth reading (m), by default contact; 0 shows all."""
        if self._look is None:
            return
        low, high = self._view or self._look.extent
        about = self._contact if about is None else about
        self._show_from(about - factor * (about - low), about + factor * (high - about), whole=not factor)
        await self._follow(redraw=True)

    def _show_from(self, low: float, high: float, *, whole: bool = False) -> None:
        """Set the visible range (depth readings, m), within the ends of the curve."""
        first, last = self._known().extent
        span = min(max(high - low, 10.0 * (last - first) / _STEPS), last - first)
        low = min(max(low, first), last - span)
        self._view = None if whole or span >= last - first else (low, low + span)

    async def _take(self, contact: float | None, low: float | None, high: float | None) -> None:
        look = await self.window.try_to(self.analysis.quick, "look", contact, low, high, self._view)
        if not isinstance(look, Look):
            self._say([str(look)], "bad")
            return
        first = self._look is None
        self._look = look
        # A text of styles is cut at semicolons, and the address has one.
        self._paper.style["background-image"] = f"url({parts.data_address(look.picture.data)})"
        if first:
            self._contact, self._range = look.contact, (look.low, look.high)
            self._set_slides()
            quality = f"Quality of the curve: {_QUALITY.get(look.quality, look.quality)}."
            self._say([quality, *map(_sentence, look.notes)], "note" if look.notes else "more")
        self._show_laws(look.laws, [] if first else look.notes)

    async def _hold_laws(self) -> None:
        """Compute and show both contact models for the present handles, without drawing the curve again."""
        told = await self.window.try_to(self.analysis.quick, "laws", self._contact, *self._range)
        if self._look is None:
            return  # another curve was opened meanwhile
        if isinstance(told, tuple):
            self._show_laws(*told)
        else:
            self._say([str(told)], "bad")

    def _show_laws(self, laws: tuple[Law, ...], notes: object) -> None:
        self._laws = laws
        self._overlay()
        self._moduli.clear()
        with self._moduli:
            for law in laws:
                with ui.row().classes("fact"):
                    mark = f'<svg width="30" height="10"><line x2="30" y1="5" y2="5" {_stroke(law)}/></svg>'
                    ui.html(mark, sanitize=False)
                    ui.label(law.name).classes("quiet")
                    ui.label(law.modulus).classes("number-shown").mark(
                        f"modulus-{law.name.replace(' ', '-')}"
                    )
        if notes and not laws:
            self._say(notes, "bad")

    def _say(self, texts: object, kind: str) -> None:
        self._notes.clear()
        with self._notes:
            parts.message_list(
                [str(text) for text in texts] if isinstance(texts, list | tuple) else [str(texts)], kind
            )

    def _set_slides(self) -> None:
        self._contact_slide.set_value(self._step(self._contact))
        self._range_slide.set_value({"min": self._step(self._range[0]), "max": self._step(self._range[1])})

    def _step(self, depth: float) -> int:
        look = self._known()
        low, high = look.extent
        share = (depth - low) / (high - low)
        return round(_STEPS * min(max(share, 0.0), 1.0))

    def _known(self) -> Look:
        if self._look is None:
            raise RuntimeError("nothing is shown yet")
        return self._look

    async def _slid(self) -> None:
        """Take contact point and range from the sliders, unless these were moved by the program."""
        if self._look is None:
            return
        low, high = self._look.extent

        def depth(step: float) -> float:
            return low + (high - low) * step / _STEPS

        changed = False
        if self._contact_slide.value != self._step(self._contact):
            self._contact, changed = depth(self._contact_slide.value), True
        ends = self._range_slide.value
        if (ends["min"], ends["max"]) != tuple(self._step(end) for end in self._range):
            self._range, changed = (depth(ends["min"]), depth(ends["max"])), True
        if changed:
            self._overlay()
            # Kept before it is drawn: another step that is opened meanwhile knows of it.
            self._write()
            await self._follow()

    async def _drag(self, event: events.MouseEventArguments) -> None:
        """Take the handle nearest to where the pointer is pressed, or the visible range; let go of it."""
        if self._look is None:
            return
        if event.type == "pointerdown":
            self._held, self._is_dragged = self._nearest(event.image_x), False
            self._taken = (event.image_x, self._look.picture.low, self._look.picture.high)
        elif held := self._held:
            if self._is_dragged and event.type != "pointercancel":
                self._pull(event.image_x)
            self._held = ""
            if held != _PAN:
                self._set_slides()
                self._write()
            await self._follow(redraw=held == _PAN)

    async def _dragged(self, event: events.GenericEventArguments) -> None:
        """Move what is held to where the pointer is."""
        if self._look is not None and self._held:
            self._is_dragged = True
            self._pull(event.args["at"] * self._look.picture.width)
            await self._follow(redraw=self._held == _PAN)

    def _pull(self, x: float) -> None:
        """Move the handle that is held to a pixel, or the visible range with it."""
        picture = self._known().picture
        if self._held == _PAN:
            began, low, high = self._taken
            moved = (began - x) * (high - low) / (picture.right - picture.left)
            self._show_from(low + moved, high + moved)
        else:
            self._move(min(max(self._depth(x), picture.low), picture.high))

    def _nearest(self, x: float) -> str:
        places = {"contact": self._contact, "low": self._range[0], "high": self._range[1]}
        name = min(places, key=lambda name: abs(self._pixel(places[name]) - x))
        return name if abs(self._pixel(places[name]) - x) < _REACH else _PAN

    def _move(self, depth: float) -> None:
        if self._held == "contact":
            self._contact = depth
        elif self._held == "low":
            self._range = (min(depth, self._range[1]), self._range[1])
        else:
            self._range = (self._range[0], max(depth, self._range[0]))
        self._overlay()

    async def _follow(self, *, redraw: bool = False) -> None:
        """Update the contact models for the present handles.

        While they are computed, intermediate positions are skipped. With `redraw` the curve is drawn again too.
        """
        self._redraw = self._redraw or redraw
        if not redraw:
            self._moved = time.monotonic()
            self._rest.activate()
        if self._looking:
            self._again = True
            return
        self._looking = self._again = True
        try:
            while self._again:
                self._again = False
                if self._redraw:
                    self._redraw = False
                    await self._take(self._contact, *self._range)
                else:
                    await self._hold_laws()
        finally:
            self._looking = False

    async def _rested(self) -> None:
        """Draw the curve again once the handles have not been moved for a moment."""
        if not self._held and time.monotonic() - self._moved >= _REST:
            self._rest.deactivate()
            await self._follow(redraw=True)

    def _depth(self, pixel: float) -> float:
        picture = self._known().picture
        share = (pixel - picture.left) / (picture.right - picture.left)
        return picture.low + share * (picture.high - picture.low)

    def _pixel(self, depth: float) -> float:
        picture = self._known().picture
        return picture.left + (depth - picture.low) / (picture.high - picture.low) * (
            picture.right - picture.left
        )

    def _overlay(self) -> None:
        """Draw handles and contact models over the curve, and write the positions of the handles."""
        picture = self._known().picture
        top, bottom = picture.top, picture.bottom
        low, high, contact = (self._pixel(depth) for depth in (*self._range, self._contact))
        shade = "".join(
            f'<rect x="{min(a, b):.1f}" y="{top}" width="{abs(b - a):.1f}" height="{bottom - top}" fill="#000" '
            'fill-opacity="0.06"/>'
            for a, b in ((picture.left, max(low, picture.left)), (min(high, picture.right), picture.right))
        )
        handles = "".join(
            f'<g class="{name}"><line x1="{x:.1f}" x2="{x:.1f}" y1="{top}" y2="{bottom}" stroke="{colour}" '
            f'stroke-width="{width}" stroke-dasharray="{dash}"/>'
            f'<rect x="{x - 5:.1f}" y="{bottom - 26}" width="10" height="26" rx="4" fill="{colour}"/></g>'
            for name, x, colour, width, dash in (
                ("low", low, GREY, 1.5, "4 4"),
                ("high", high, GREY, 1.5, "4 4"),
                ("contact", contact, GREEN, 2, "none"),
            )
            if picture.left - 1.0 <= x <= picture.right + 1.0
        )
        self._picture.set_content(self._lines(picture) + shade + handles)
        # As on the axis: from the contact point; the contact point itself as the file reads.
        (at, *_) = (printed(text) for text in amounts([self._contact, *self._known().extent], "length"))
        self._contact_words.set_text(at)
        low, high = (end - self._contact for end in self._range)
        self._range_words.set_text(printed(span(low, high, "length")))

    def _lines(self, picture: Canvas) -> str:
        """Return the contact models' lines as SVG, clipped to the axes."""
        wide, high = picture.right - picture.left, picture.bottom - picture.top
        across, up = wide / (picture.high - picture.low), high / (picture.ceiling - picture.floor)
        drawn = ""
        for law in self._laws:
            points = " ".join(
                f"{(depth - picture.low) * across:.1f},{(picture.ceiling - force) * up:.1f}"
                for depth, force in law.line
            )
            drawn += f'<polyline points="{points}" {_stroke(law)}/>'
        place = f'x="{picture.left:.1f}" y="{picture.top:.1f}" width="{wide:.1f}" height="{high:.1f}"'
        return f"<svg {place}>{drawn}</svg>"

    def _write(self) -> None:
        """Write contact point and fit range into the scene file."""
        draft, (begin, end_) = self.analysis.draft, self._known().extent
        draft.table("instrument")["contact_depth"] = f"{self._contact!r} m"
        margin = (end_ - begin) / _STEPS
        for key, end, edge in (("min_depth", self._range[0], begin), ("max_depth", self._range[1], end_)):
            draft.table("curve").pop(key, None)
            if math.isfinite(end) and abs(end - edge) > margin:
                draft.table("curve")[key] = f"{end!r} m"
        self.window.keep()
        self._outcome.is_old()

    def _fill_in(self) -> None:
        """Let the contact point be fitted within the ends of the curve, unless the scene says otherwise."""
        draft = self.analysis.draft
        if (
            self._look is not None
            and not draft.free.get(_CONTACT)
            and not draft.get("instrument", "contact_depth")
        ):
            self._free_contact(by_hand=False)
        self._fitted.set_value(_CONTACT in draft.free)

    def _free_contact(self, *, by_hand: bool = True) -> None:
        low, high = self._known().extent
        self.analysis.draft.free[_CONTACT] = {"min": f"{low!r} m", "max": f"{high!r} m"}
        self.window.keep(by_hand=by_hand)

    def _hold(self) -> None:
        draft = self.analysis.draft
        if self._look is None or self._fitted.value == (_CONTACT in draft.free):
            return
        if self._fitted.value:
            self._free_contact()
        else:
            del draft.free[_CONTACT]
            self._write()
