"""What a page is made of: words, tables and pictures as HTML that shows everything that was read as text.

A page is one file: pictures inside, no script, nothing fetched.
"""

from __future__ import annotations

import base64
import html
from collections.abc import Iterable
from datetime import UTC, datetime
from importlib import resources

import pandas as pd

from underlay._text import one_line
from underlay.report.plots.style import Axes, drawn, inline_svg
from underlay.units import printed

__all__ = [
    "Detail",
    "details",
    "document",
    "figure",
    "number_block",
    "pixels",
    "style_of",
    "table",
    "tag",
    "today",
    "verdict_block",
    "words",
]

# Nothing runs and nothing is fetched, whatever a name or a file holds.
_POLICY = "default-src 'none'; img-src data:; style-src 'unsafe-inline'; base-uri 'none'; form-action 'none'"
_SHAPES = {
    "good": "\N{BLACK CIRCLE}",
    "check": "\N{BLACK SQUARE}",
    "reject": "\N{BLACK UP-POINTING TRIANGLE}",
}

#: One folded part below the page: its title, what it holds in a few words, and its blocks of HTML.
Detail = tuple[str, str, list[str]]


def words(text: object) -> str:
    """Return any words as one line of HTML that shows them as they are, units as they are printed."""
    return html.escape(printed(one_line(text)))


def tag(name: str, *inner: str, kind: str = "") -> str:
    """Return an element around pieces of HTML; `kind` is its class."""
    attribute = f' class="{kind}"' if kind else ""
    return f"<{name}{attribute}>{''.join(inner)}</{name}>"


def table(frame: pd.DataFrame) -> str:
    """Return a table of texts as HTML; an index of names is its first column."""
    named = not pd.api.types.is_integer_dtype(frame.index)
    heads = [*(["" if frame.columns.name is None else frame.columns.name] if named else []), *frame.columns]
    rows = [tag("tr", *(f'<th scope="col">{words(head)}</th>' for head in heads))]
    for name, *cells in frame.itertuples():
        first = [f'<th scope="row">{words(name)}</th>'] if named else []
        rows.append(tag("tr", *first, *(tag("td", words(cell)) for cell in cells)))
    return f'<div class="table" tabindex="0">{tag("table", *rows)}</div>'


def figure(ax: Axes, name: str, alt: str, title: str = "", caption: str = "", kind: str = "") -> str:
    """Return a picture with its caption; `name` tells it from others of the page, `alt` is what a reader hears."""
    under = tag("figcaption", f"<b>{words(title)}</b> ", words(caption)) if title or caption else ""
    return tag("figure", inline_svg(ax, name, alt), under, kind=kind)


def pixels(ax: Axes, alt: str, title: str = "") -> str:
    """Return a picture of thousands of marks, which as lines would be heavy."""
    data = base64.b64encode(drawn(ax)).decode("ascii")
    image = f'<img src="data:image/png;base64,{data}" alt="{html.escape(alt)}">'
    return tag("figure", image, tag("figcaption", words(title)) if title else "")


def number_block(title: str, number: str, unit: str, under: str, kind: str = "") -> str:
    """Return a number of the headline as HTML: its name above it, both parts of its uncertainty below."""
    value = tag("div", words(number), f" <small>{words(unit)}</small>", kind="v")
    return tag(
        "div",
        tag("div", words(title), kind="q"),
        value,
        tag("div", words(under), kind="p"),
        kind=f"num {kind}",
    )


def verdict_block(word: str, reason: str, cause: str = "", step: str = "", more: str = "") -> str:
    """Return a verdict as HTML.

    Parameters
    ----------
    word : str
        ``"good"``, ``"check"`` or ``"reject"``: gives colour and shape.
    reason, cause, step, more : str
        Why; the likely cause, the next step and one further sentence, each left out where empty.
    """
    shape = f'<i aria-hidden="true">{_SHAPES.get(word, "")}</i> '
    clause = reason[:1].upper() + reason[1:]
    lines = [tag("p", shape, f"<b>{words(word.capitalize())}.</b> {words(clause)}.")]
    pairs = [(name, text) for name, text in (("Likely cause", cause), ("Next step", step)) if text]
    cells = "".join(f"<dt>{name}</dt><dd>{words(text[:1].upper() + text[1:])}.</dd>" for name, text in pairs)
    lines += [tag("dl", cells)] if cells else []
    lines += [tag("p", words(more))] if more else []
    return tag("div", *lines, kind=f"verdict {word if word in _SHAPES else 'check'}")


def details(parts: Iterable[Detail], *, opened: bool = False) -> str:
    """Return what is folded behind the page as HTML; parts without a block are left out."""
    state = " open" if opened else ""
    folded = [
        f"<details{state}><summary>{words(title)} <span>{words(note)}</span></summary>{''.join(blocks)}</details>"
        for title, note, blocks in parts
        if blocks
    ]
    return tag("section", *folded, kind="details printed" if opened else "details")


def style_of(*parts: str) -> str:
    """Return the style of a page: its ``colours``, the ``frame`` of a sheet of paper, the ``sheet`` itself."""
    folder = resources.files("underlay.report") / "templates" / "page"
    return "".join((folder / f"{part}.css").read_text(encoding="utf-8") for part in parts)


def today() -> str:
    """Return the day that a page is made."""
    return datetime.now(UTC).date().isoformat()


def document(title: str, *blocks: str) -> str:
    """Return the whole page."""
    style = style_of("colours", "frame", "sheet")
    return (
        '<!DOCTYPE html>\n<html lang="en">\n<head>\n<meta charset="utf-8">\n'
        '<meta name="viewport" content="width=device-width, initial-scale=1">\n'
        '<meta name="color-scheme" content="light">\n<meta name="generator" content="underlay">\n'
        f'<meta http-equiv="Content-Security-Policy" content="{_POLICY}">\n'
        f"<title>{words(title)}</title>\n<style>\n{style}</style>\n</head>\n<body>\n"
        + "\n".join(blocks)
        + "\n</body>\n</html>\n"
    )
