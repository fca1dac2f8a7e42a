"""Elements of the page that its steps share: buttons, fields, folded parts, tables, uploads, messages."""

from __future__ import annotations

import base64
from collections.abc import Awaitable, Callable, Iterable, Sequence
from typing import Any, TypeVar

from nicegui import events, ui

from underlay.app.folder import LARGEST_FILE, AnalysisFolder
from underlay.app.form import help_of
from underlay.app.shown import Row
from underlay.errors import UnderlayError

#: What is said where a browser could not send what was dropped.
FOLDER_DROPPED = (
    "The upload failed: a folder cannot be dropped. Drop the files in it, or a ZIP archive of them."
)
_Element = TypeVar("_Element", bound=ui.element)
_Field = TypeVar("_Field", ui.input, ui.select)


def complain(message: str) -> None:
    """Show an error message until it is closed."""
    ui.notify(message, type="negative", timeout=0, close_button="OK", multi_line=True)


def helped(element: _Element, mark: str) -> _Element:
    """Give an element its mark, by which tests find it, and the help text of that name as a tooltip; return it."""
    element.mark(mark).props["title"] = help_of(mark)
    return element


def outlined(element: _Field, mark: str, kind: str = "field", look: str = "") -> _Field:
    """Return an input or a selection with an outline, its mark and its help; `kind` are its CSS classes."""
    return helped(element.props(f"outlined dense {look}").classes(kind), mark)


def button(
    words: str,
    act: Callable[[], Any],
    look: str = "outline",
    *,
    kind: str = "",
    mark: str = "",
    tip: str = "",
) -> ui.button:
    """Return a button; `look` are properties of its element, `kind` its CSS classes, `tip` its tooltip."""
    made = ui.button(words, on_click=act).props(f"no-caps {look}").classes(kind)
    if mark:
        made.mark(mark)
    return made.tooltip(tip) if tip else made


def folded(words: str, *, is_open: bool = False) -> ui.expansion:
    """Return a part of the page that is folded under its words."""
    return ui.expansion(words, value=is_open).props("dense").classes("wide")


def upload(bring: Callable[[events.MultiUploadEventArguments], Awaitable[None]]) -> ui.upload:
    """Return the area that curves are dropped on; `bring` is called with the files."""

    def failed() -> None:
        # It would otherwise take no further file.
        made.reset()
        complain(FOLDER_DROPPED)

    made = ui.upload(
        multiple=True,
        auto_upload=True,
        max_file_size=LARGEST_FILE,
        label="Drop curves here, or press +",
        on_multi_upload=bring,
        on_rejected=lambda: complain(f"A file of more than {LARGEST_FILE // 10**6} MB is not taken."),
    )
    made.props("flat bordered hide-upload-btn").classes("drop")
    return helped(made, "drop").on("failed", failed)


async def add_files(folder: AnalysisFolder, event: events.MultiUploadEventArguments) -> list[str]:
    """Store uploaded files in an analysis; return the names of those taken, and show why others were not."""
    taken = []
    for file in event.files:
        try:
            taken.append(folder.add_curve(file.name, await file.read()).name)
        except UnderlayError as error:
            complain(str(error))
    return taken


def table(rows: Sequence[Row], most: int | None = None) -> ui.table:
    """Return rows of text as a table, which their first column names; of more than `most` with pages."""
    columns = [{"name": key, "label": key, "field": key, "align": "left"} for key in rows[0]]
    made = ui.table(
        columns=columns, rows=[dict(row) for row in rows], row_key=next(iter(rows[0])), pagination=most
    )
    made.props("flat dense wrap-cells").classes("wide")
    return made.props("hide-pagination") if most is None or len(rows) <= most else made


def data_address(picture: bytes) -> str:
    """Return a PNG picture as a ``data:`` URL."""
    return f"data:image/png;base64,{base64.b64encode(picture).decode('ascii')}"


def message_list(texts: Iterable[str], kind: str = "note") -> None:
    """Show sentences one below the other, as text that is never read as markup; `kind` is their CSS class."""
    for text in texts:
        ui.label(text).classes(kind)


def sheet(page: str) -> None:
    """Show a report's HTML, which was made by this package with all text escaped."""
    ui.html(page, sanitize=False).classes("sheet wide").mark("sheet")
