"""Building blocks of HTML reports: text, tables, pictures; text from files is escaped, never read as markup.

A page is one file: pictures are embedded, there is no script, and nothing is fetched.
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
    """Return a text as one line of escaped HTML, with units in their printed form (um as µm)."""
    return html.escape(printed(one_line(text)))


def tag(name: str, *inner: str, kind: str = "") -> str:
    """Return the HTML element `name` around pieces of HTML; `kind` is its class attribute."""
    attribute = f' class="{kind}"' if kind else ""
    return f"<{name}{attribute}>{''.join(inner)}</{name}>"


def table(frame: pd.DataFrame) -> str:
    """Return a table of texts as HTML; an index that is not of integers becomes the first column."""
    named = not pd.api.types.is_integer_dtype(frame.index)
    heads = [*(["" if frame.columns.name is None else frame.columns.name] if named else []), *frame.columns]
    rows = [tag("tr", *(f'<th scope="col">{words(head)}</th>' for head in heads))]
    for name, *cells in frame.itertuples():
        first = [f'<th scope="row">{words(name)}</th>'] if named else []
        rows.append(tag("tr", *first, *(tag("td", words(cell)) for cell in cells)))
    return f'<div class="table" tabindex="0">{tag("table", *rows)}</div>'


def figure(ax: Axes, name: str, alt: str, title: str = "", caption: str = "", kind: str = "") -> str:
    """Return axes as an HTML figure with inline SVG, its title and caption.

    `name` makes the SVG's ids unique on the page, `alt` is the text for screen readers, `kind` the class attribute.
    """
    under = tag("figcaption", f"<b>{words(title)}</b> ", words(caption)) if title or caption else ""
    return tag("figure", inline_svg(ax, name, alt), under, kind=kind)


def pixels(ax: Axes, alt: str, title: str = "") -> str:
    """Return axes as an HTML figure with an embedded PNG: smaller than SVG for thousands of marks.

    `alt` is the text for screen readers.
    """
    data = base64.b64encode(drawn(ax)).decode("ascii")
    image = f'<img src="data:image/png;base64,{data}" alt="{html.escape(alt)}">'
    return tag("figure", image, tag("figcaption", words(title)) if title else "")


def number_block(title: str, number: str, unit: str, under: str, kind: str = "") -> str:
    """Return one number of the headline as HTML: `title` above it, `under` (its uncertainty) below.

    `kind` adds classes, such as ``"grey"`` for a number that is not to be used.
    """
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
        ``"good"``, ``"check"`` or ``"reject"``: sets colour and symbol.
    reason, cause, step, more : str
        The reason; then the likely cause, the next step and one further sentence, each left out where empty.
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
    """Return the parts that are folded below the page as HTML; parts without blocks are left out.

    `opened` shows them unfolded, as for print.
    """
    state = " open" if opened else ""
    folded = [
        f"<details{state}><summary>{words(title)} <span>{words(note)}</span></summary>{''.join(blocks)}</details>"
        for title, note, blocks in parts
        if blocks
    ]
    return tag("section", *folded, kind="details printed" if opened else "details")


def style_of(*parts: str) -> str:
    """Return the CSS of a page, put together from its files by name.

    The files are ``colours``, ``frame`` (a sheet of paper) and ``sheet`` (what is on it).
    """
    folder = resources.files("underlay.report") / "templates" / "page"
    return "".join((folder / f"{part}.css").read_text(encoding="utf-8") for part in parts)


def today() -> str:
    """Return today's date (UTC) as ISO text, for the head of a page."""
    return datetime.now(UTC).date().isoformat()


def document(title: str, *blocks: str) -> str:
    """Return a complete HTML document with `title` and the given blocks of HTML as its body."""
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
