"""An executed notebook as one HTML page: pictures inside, no script, nothing fetched."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any

from underlay.report.notebook import report_library

__all__ = ["html_page"]

_TEMPLATES = Path(__file__).parent / "templates"
# What words and tables are made of. Anything else in them is shown as text, not acted on.
_WORDS = ("h1", "h2", "h3", "h4", "p", "br", "hr", "strong", "em", "code", "pre", "sub", "sup")
_BLOCKS = ("ul", "ol", "li", "blockquote", "div", "span", "table", "thead", "tbody", "tr", "th", "td")
_ATTRIBUTES = {"*": ["id"], "th": ["scope"]}
# pandas writes one before each table; the page has its own.
_TABLE_STYLE = re.compile(r"<style scoped>.*?</style>", re.DOTALL)


def html_page(notebook: Any) -> str:
    """Return the page of an executed notebook.

    Raises
    ------
    MissingExtraError
        If the extra ``report`` is not installed.
    """
    exporter = report_library("nbconvert").HTMLExporter(
        template_name="page",
        extra_template_basedirs=[str(_TEMPLATES)],
        exclude_anchor_links=True,
    )
    exporter.register_filter("safe_html", _safe_html)
    style = (_TEMPLATES / "page" / "page.css").read_text(encoding="utf-8")
    body, _ = exporter.from_notebook_node(notebook, resources={"page_style": style})
    return str(body)


def _safe_html(text: str) -> str:
    """Return markup with what a report does not need shown as text: names of files and notes are in it."""
    cleaned = report_library("bleach").clean(
        _TABLE_STYLE.sub("", text), tags={*_WORDS, *_BLOCKS}, attributes=_ATTRIBUTES
    )
    return str(cleaned)
