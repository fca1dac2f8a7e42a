"""HTML reports: their common build (`Page`) and its blocks: headline, drawing, tables, pictures.

Text from files is escaped, never read as markup. A page is one file: pictures are embedded, there is no script, and
nothing is fetched.
"""

from __future__ import annotations

import base64
import html
import math
import platform
import re
from abc import ABC, abstractmethod
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from datetime import UTC, datetime
from importlib import resources
from pathlib import Path
from string import Template
from typing import TYPE_CHECKING, Any

import pandas as pd

from underlay._door import sha256_of
from underlay._text import one_line
from underlay._version import VERSION
from underlay.quantities import path_of
from underlay.report import plots
from underlay.report.details import Content, Heading, Part, Picture
from underlay.report.labels import label, labelled, start
from underlay.report.plots.scene import material_words
from underlay.report.plots.style import drawn, in_words, inline_svg, panel
from underlay.report.screen import WORDS, assumed_inputs, assumed_words, name_of, one_end, written
from underlay.scene.parameters import kind_of
from underlay.units import format_quantity, printed

if TYPE_CHECKING:
    from matplotlib.axes import Axes

    from underlay.data.curve import Curve
    from underlay.inference.citation import Work
    from underlay.inference.uncertainty.answer import Advice, Answer
    from underlay.mechanics.body import Layer
    from underlay.mechanics.solver import Solver
    from underlay.report.limits import DistinctScene

_INCH = 25.4
#: Millimetres: the curve on a sheet of A4, beside the drawing of the test.
CURVE = (126.0, 86.0)
# Millimetres: the drawing of the test, and a picture of its own line.
_DRAWING, _WIDE = (54.0, 58.0), (150.0, 75.0)
# Numbers in the headline, and letters above which the first is set smaller.
_NUMBERS, _LONG = 3, 15
_NEITHER = "by this curve, neither from below nor from above"
# Numbers in the words of a drawing, and lines above the last.
_SHORT = re.compile(r"^.*\n|, (E = |rigid).*$", re.DOTALL)


class Html(str):
    """Content of a page that is HTML already, where other texts are escaped."""

    __slots__ = ()


def words(text: object) -> str:
    """Return a text as one line of escaped HTML, with units in their printed form (um as µm)."""
    return html.escape(printed(one_line(text)))


def tag(name: str, *inner: str, kind: str = "") -> Html:
    """Return the HTML element `name` around pieces of HTML; `kind` is its class attribute."""
    attribute = f' class="{kind}"' if kind else ""
    return Html(f"<{name}{attribute}>{''.join(inner)}</{name}>")


def table(frame: pd.DataFrame) -> str:
    """Return a table of texts as HTML; an index that is not of integers becomes the first column."""
    named = not pd.api.types.is_integer_dtype(frame.index)
    heads = [*(["" if frame.columns.name is None else frame.columns.name] if named else []), *frame.columns]
    rows = [tag("tr", *(f'<th scope="col">{words(head)}</th>' for head in heads))]
    for name, *cells in frame.itertuples():
        first = [f'<th scope="row">{words(name)}</th>'] if named else []
        rows.append(tag("tr", *first, *(tag("td", words(cell)) for cell in cells)))
    return f'<div class="table" tabindex="0">{tag("table", *rows)}</div>'


def figure(
    picture: Picture, size: tuple[float, float] | None = None, kind: str = "", *, as_pixels: bool = False
) -> Html:
    """Return a picture as an HTML figure with its title and caption.

    Parameters
    ----------
    picture : Picture
        What to draw.
    size : (float, float), optional
        Width and height in millimetres; by default those that the picture takes by itself.
    kind : str
        The class attribute.
    as_pixels : bool, default False
        Embed a PNG in place of inline SVG: smaller for thousands of marks.
    """
    ax = picture.draw(ax=None if size is None else _axes(size))
    if as_pixels:
        data = base64.b64encode(drawn(ax)).decode("ascii")
        image = f'<img src="data:image/png;base64,{data}" alt="{html.escape(picture.alt)}">'
    else:
        image = inline_svg(ax, picture.name, picture.alt)
    return _figure(image, picture.title, picture.caption, kind)


def _axes(millimetres: tuple[float, float]) -> Axes:
    """Return axes of the given width and height (mm)."""
    with panel(None, width=millimetres[0] / _INCH, height=millimetres[1] / _INCH) as ax:
        return ax


def _figure(image: str, title: str, caption: str, kind: str) -> Html:
    under = tag("figcaption", f"<b>{words(title)}</b> ", words(caption)) if title or caption else ""
    return tag("figure", image, under, kind=kind)


def drawing(test: DistinctScene, solver: Solver, where: str, assumed: Iterable[str] = ()) -> Html:
    """Return the test drawn to scale as an HTML figure; its caption gives the numbers and which are `assumed`.

    `where` says in the caption at which state the test is drawn, e.g. "at the deepest point"; `assumed` holds
    parameter paths that no one measured.
    """
    ax = plots.scene(test.scene, depth=test.reading, solver=solver, ax=_axes(_DRAWING))
    size = ax.get_title()
    ax.set_title("")
    ax.set_axis_off()
    for text in ax.texts:
        # The last line is of what is lowest; what stands beside the picture is too wide for it.
        text.set_text(
            "" if text.get_transform() == ax.get_yaxis_transform() else _SHORT.sub("", text.get_text())
        )
    for line in ax.lines:
        line.set_visible(line.get_transform() != ax.get_yaxis_transform())
    scene = test.scene
    layers = [f"{material_words(layer.material)}{_thickness(layer)}" for layer in scene.layers]
    base = [] if scene.base is None else [f"substrate {material_words(scene.base)}"]
    told = [f"to scale {where}", f"layer {'; '.join(layers)}", *base, size]
    told += [f"usual values, not measured: {named}"] if (named := ", ".join(map(label, assumed))) else []
    alt = "Tip, layer and substrate to scale, with the contact radius and the depth."
    caption = "; ".join([test.label, *told] if test.label else told)
    return _figure(inline_svg(ax, f"test {test.label}", alt), "The test,", f"{caption}.", "side")


def _thickness(layer: Layer) -> str:
    thick = layer.thickness
    return f", {in_words(thick, 'length', digits=3)} thick" if math.isfinite(thick) else ""


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


def verdict_block(verdict: Advice, more: str = "") -> str:
    """Return a verdict as HTML, with its likely cause and next step where it has them, and one further sentence.

    Its word sets colour and symbol.
    """
    word, reason = str(verdict.word), _sentence(verdict.reason)
    shape = WORDS["verdicts"].get(word, "")
    lines = [tag("p", f'<i aria-hidden="true">{shape}</i> ', f"<b>{words(word.capitalize())}.</b> {reason}")]
    pairs = [("Likely cause", verdict.cause), ("Next step", verdict.next)]
    cells = "".join(f"<dt>{name}</dt><dd>{_sentence(text)}</dd>" for name, text in pairs if text)
    lines += [tag("dl", cells)] if cells else []
    lines += [tag("p", words(more))] if more else []
    return tag("div", *lines, kind=f"verdict {word if shape else 'check'}")


def _sentence(text: str) -> str:
    return f"{words(start(labelled(text)))}."


def headline(answers: list[Answer], verdict: Advice, curves: Iterable[Curve] = (), more: str = "") -> str:
    """Return the headline as HTML: up to three numbers with uncertainty, and the verdict with cause and next step.

    `more` is a further sentence under the verdict. Inputs of `curves` that no one measured are named there.
    """
    assumed = assumed_words(assumed_inputs(curves))
    more = f"{more} Assumed: {assumed}.".strip() if assumed else more
    numbers = [_number(known, place, str(verdict.word)) for place, known in enumerate(answers[:_NUMBERS])]
    return tag("section", *numbers, verdict_block(verdict, more), kind="head")


def _number(known: Answer, place: int, verdict: str) -> str:
    """Return one number of the headline as HTML, in the form to copy.

    It is grey and without an uncertainty where the model is rejected. `place` is its rank: numbers after the first
    are set smaller.
    """
    title, letter = name_of(known.name)
    second = " second" if place else ""
    if verdict == "reject":
        number, _, unit = format_quantity(known.value, kind_of(path_of(known.name))).partition(" ")
        under, kind = "no uncertainty: the model is rejected", f"grey{second}"
    elif known.is_open:
        end = one_end(known.low, known.high, kind_of(path_of(known.name)))
        under = f"{letter} {end} ({100.0 * known.level:.3g} %)" if end else _NEITHER
        number, unit, kind = "not determined", "", f"grey long{second}"
    else:
        one = written(known)
        number, unit, kind = one.number, one.unit, f"{'long' if len(one.number) > _LONG else ''}{second}"
        under = (
            f"{one.level}: statistical {one.reach}{one.statistical}, systematic {one.reach}{one.systematic}"
        )
    return number_block(f"{title} {letter}", number, unit, under, kind)


def methods_block(text: str, works: Iterable[Work]) -> Html:
    """Return a paragraph for the methods section of a paper as HTML, with its references."""
    cited = " ".join(f"[{n}] {start(str(work))}." for n, work in enumerate(works, start=1))
    return Html(
        "<h2>Methods paragraph</h2>"
        + tag("div", tag("p", words(text)), tag("p", words(cited)), kind="methods")
    )


def name_of_curves(curves: Sequence[Curve]) -> str:
    """Return the name of the first curve, and the number of further ones: ``"site-1 and 2 more"``."""
    name = str(curves[0].metadata.get("name") or "one curve")
    return f"{name} and {len(curves) - 1} more" if len(curves) > 1 else name


def details(parts: Iterable[Part], *, opened: bool = False) -> str:
    """Return the parts that are folded below the page as HTML; parts without content are left out.

    `opened` shows them unfolded, as for print.
    """
    state = " open" if opened else ""
    folded = [
        f"<details{state}><summary>{words(title)} <span>{words(note)}</span></summary>"
        f"{''.join(map(_content, content))}</details>"
        for title, note, content in parts
        if content
    ]
    return tag("section", *folded, kind="details printed" if opened else "details")


def _content(one: Content) -> str:
    if isinstance(one, pd.DataFrame):
        return table(one)
    if isinstance(one, Picture):
        return figure(one, _WIDE)
    if isinstance(one, Html):
        return one
    return tag("h3" if isinstance(one, Heading) else "p", words(one))


def style_of(*parts: str) -> str:
    """Return the CSS of a page, put together from its files by name.

    The files are ``colours``, ``frame`` (a sheet of paper) and ``sheet`` (what is on it).
    """
    return "".join(_of_page(f"{part}.css") for part in parts)


def _of_page(name: str) -> str:
    return (resources.files("underlay.report") / "templates" / "page" / name).read_text(encoding="utf-8")


def today() -> str:
    """Return today's date (UTC) as ISO text, for the head of a page."""
    return datetime.now(UTC).date().isoformat()


def document(title: str, *blocks: str, styles: Sequence[str] = ("colours", "frame", "sheet")) -> str:
    """Return a complete HTML document: its title, the blocks of HTML in its body, and its styles as `style_of`."""
    # Nothing runs and nothing is fetched, whatever a name or a file holds: the page says so to the browser.
    parts = {"title": words(title), "style": style_of(*styles), "blocks": "\n".join(blocks)}
    return Template(_of_page("page.html")).substitute(parts)


@dataclass
class Page(ABC):
    """The report page of a result: a head, a sheet of A4, and what is folded below it.

    Parameters
    ----------
    result : Fit, DataFrame or Posterior
        The result to show.
    day : str
        Date on the page.
    command : str
        Command line that repeats the result; empty where there is none.
    files : sequence of path
        Files whose SHA-256 the page states.
    """

    result: Any
    day: str
    command: str = ""
    files: Sequence[Path] = ()

    @property
    @abstractmethod
    def title(self) -> str:
        """What the page is of."""

    @property
    @abstractmethod
    def about(self) -> str:
        """A line on what was tested."""

    @abstractmethod
    def sheet(self, *, opened: bool = False) -> str:
        """Return all of the page below its title as HTML; `opened` shows the folded parts."""

    @abstractmethod
    def parts(self) -> Iterable[Part]:
        """Return what is folded below the sheet."""

    def origin(self) -> Iterable[str]:
        """Return what the foot of the page says of where the result came from: the hashes of `files`."""
        return [f"{path.name} · SHA-256 {sha256_of(path)}" for path in self.files]

    @property
    def facts(self) -> dict[str, str]:
        """What the table of the provenance says of the command."""
        return {"to repeat": self.command} if self.command else {}

    def html(self, *, opened: bool = False) -> str:
        """Return the page as an HTML document; `opened` shows the folded parts."""
        head = (
            f"<header><span><b>underlay</b> indentation report</span><span>{words(self.day)}</span></header>"
            f'<h1>{words(self.title)}</h1><p class="sub">{words(self.about)}</p>'
        )
        return document(f"{self.title} · indentation report", head, self.sheet(opened=opened))

    def with_foot(self, *blocks: str, opened: bool) -> str:
        """Return the blocks of a sheet as HTML with the foot of the page and the folded parts below them.

        The foot states the provenance, the versions, and the command that repeats the result.
        """
        facts = [*self.origin(), f"underlay {VERSION}", f"Python {platform.python_version()}"]
        again = f" · same numbers again: <code>{words(self.command)}</code>" if self.command else ""
        foot = tag("footer", words(" · ".join(facts)), again)
        return "\n".join([*blocks, foot, details(self.parts(), opened=opened)])
