"""Build the reference: ``python .reference/build.py [FOLDER]``, by default build/reference.

Public names by pdoc, the guide from pages/*.md, commands, keys of scene files and published corrections from the
code that declares them, the notebooks as tutorials. Any warning, and any link that leads nowhere, ends the build
with an error. Needs the extra `reference`.
"""

from __future__ import annotations

import html
import importlib
import re
import shutil
import sys
import warnings
from collections.abc import Iterator, Mapping, Sequence
from html.parser import HTMLParser
from pathlib import Path
from urllib.parse import unquote, urlsplit

import nbconvert
import nbformat
import pdoc.doc
import pdoc.render
import typer
from markdown_it import MarkdownIt

import underlay as ul
from underlay.cli.app import app
from underlay.scene.scene_keys import TOP, scene_keys

HERE = Path(__file__).resolve().parent
ROOT = HERE.parent
TEMPLATE = """<!doctype html>
<html lang="en"><head><meta charset="utf-8"><meta name="viewport" content="width=device-width, initial-scale=1">
<title>{title} - underlay</title><link rel="stylesheet" href="style.css"></head>
<body><nav><a href="index.html">underlay</a></nav><main>
{body}
</main></body></html>
"""
#: Modules whose public names are documented, each on its page.
MODULES = ("underlay", "underlay.report.plots")


def build(folder: Path) -> None:
    """Write every page, then follow every link."""
    folder = folder.resolve()
    shutil.rmtree(folder, ignore_errors=True)
    folder.mkdir(parents=True)
    shutil.copy(HERE / "style.css", folder)
    pages = {path.stem: path.read_text(encoding="utf-8") for path in sorted((HERE / "pages").glob("*.md"))}
    notebooks = sorted((ROOT / "notebooks").glob("*.ipynb"))
    pages["index"] += "".join(f"- [{title_of(path)}]({path.stem}.md)\n" for path in notebooks)
    pages["keys"] = keys_page()
    pages["commands"] = commands_page()
    pages["corrections"] = corrections_page()
    pages["benchmark"] = (ROOT / "data_samples" / "benchmark" / "README.md").read_text(encoding="utf-8")
    for stem, text in pages.items():
        write(folder / f"{stem}.html", text.splitlines()[0].lstrip("# "), markdown(text))
    for path in notebooks:
        write(folder / f"{path.stem}.html", title_of(path), tutorial(path))
    for name, text in names_pages().items():
        page = folder / f"{name.replace('.', '/')}.html"
        page.parent.mkdir(parents=True, exist_ok=True)
        page.write_text(text, encoding="utf-8")
    broken = list(broken_links(folder))
    if broken:
        sys.exit("links that lead nowhere:\n" + "\n".join(broken))
    print(f"{len(list(folder.rglob('*.html')))} pages in {folder}, every link among them followed")


def write(path: Path, title: str, body: str) -> None:
    """Write one page."""
    path.write_text(TEMPLATE.format(title=html.escape(title), body=body), encoding="utf-8")


def markdown(text: str) -> str:
    """Return Markdown as HTML; links among the pages lead to their HTML."""
    made: str = MarkdownIt("commonmark").enable("table").render(text)
    return re.sub(r'href="([\w./]+)\.md"', r'href="\1.html"', made)


# --- from the code that declares it ----------------------------------------------------------------------


def table(head: Sequence[str], rows: Iterator[Sequence[object]]) -> str:
    """Return a Markdown table."""
    lines = [head, ["---"] * len(head), *rows]
    return "\n".join("| " + " | ".join(cell(value) for value in line) + " |" for line in lines) + "\n"


def cell(value: object) -> str:
    """Return text for a cell: one line, no column of its own, no markup that was not meant."""
    return " ".join(str(value).split()).replace("|", r"\|").replace("<", "&lt;")


def keys_page() -> str:
    """Every key of a scene file, section by section."""
    keys = scene_keys()
    parts = ["# Every key of a scene file\n\nMade from the declarations, as `underlay keys` prints it.\n"]
    for section in dict.fromkeys(key.section for key in keys):
        own = [key for key in keys if key.section == section]
        title = {TOP: "Before any section", "substrate.layers": f"`[[{section}]]`"}.get(
            section, f"`[{section}]`"
        )
        rows = ((f"`{key.key}`", key.takes, key.default or "needed", key.meaning) for key in own)
        parts.append(f"## {title}\n\n{table(('Key', 'Takes', 'Default', 'Meaning'), rows)}")
    return "\n".join(parts)


def commands_page() -> str:
    """Every command with its arguments and options."""
    parts = ["# Every command\n"]
    for name, command in sorted(typer.main.get_command(app).commands.items()):
        rows = (
            (f"`{' '.join(option.opts) or option.name}`", getattr(option, "help", None) or "")
            for option in command.params
            if option.name != "help"
        )
        parts.append(
            f"## underlay {name}\n\n{command.help}\n\n{table(('Argument or option', 'Meaning'), rows)}"
        )
    return "\n".join(parts)


def corrections_page() -> str:
    """The published corrections with their sources."""
    rows = (
        (f"`{c.name}`", c.indenter, c.substrate, c.equation, c.source, f"doi:{c.doi}" if c.doi else "")
        for c in ul.published_corrections()
    )
    head = ("Name", "Tip", "Base", "Formula", "Source", "DOI")
    return f"# Published corrections\n\nBy name wherever a solver is taken.\n\n{table(head, rows)}"


def names_pages() -> Mapping[str, str]:
    """Pages of the public names, by pdoc."""
    pdoc.render.configure(
        docformat="numpy", search=False, show_source=False, template_directory=HERE / "pdoc"
    )
    loaded = {name: importlib.import_module(name) for name in MODULES}
    for module in loaded.values():
        # Names that are loaded when they are asked for are asked for.
        vars(module).update({public: getattr(module, public) for public in module.__all__})
    modules = {name: pdoc.doc.Module(module) for name, module in loaded.items()}
    return {
        name: without_inherited(pdoc.render.html_module(module, modules)) for name, module in modules.items()
    }


def without_inherited(page: str) -> str:
    """Return a page of pdoc's in which a name that a class inherits is a word: it has no place to lead to."""
    there = set(re.findall(r'id="([^"]+)"', page))
    return re.sub(
        r'<a href="#([^"]+)">(.*?)</a>', lambda link: link[0] if link[1] in there else link[2], page
    )


# --- tutorials -------------------------------------------------------------------------------------------


def title_of(path: Path) -> str:
    """Heading of a notebook."""
    first = nbformat.read(path, as_version=4).cells[0].source.splitlines()[0]
    return str(first).lstrip("# ")


def tutorial(path: Path) -> str:
    """Return a notebook as HTML, with its stored outputs."""
    made: str
    made, _ = nbconvert.HTMLExporter(template_name="basic", exclude_anchor_links=True).from_filename(
        str(path)
    )
    return made


# --- links -----------------------------------------------------------------------------------------------


class Links(HTMLParser):
    """What a page links to, and the anchors it has."""

    def __init__(self) -> None:
        super().__init__()
        self.targets: list[str] = []
        self.anchors: set[str] = set()

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        """Note links and anchors."""
        del tag
        for name, value in attrs:
            if name in ("href", "src") and value is not None:
                self.targets.append(value)
            elif name in ("id", "name") and value:
                self.anchors.add(value)


def broken_links(folder: Path) -> Iterator[str]:
    """Say of every link within the site that leads nowhere where it stands; addresses of others are not asked."""
    pages = {}
    for path in sorted(folder.rglob("*.html")):
        pages[path] = Links()
        pages[path].feed(path.read_text(encoding="utf-8"))
    for path, page in pages.items():
        for target in page.targets:
            parts = urlsplit(target)
            if parts.scheme or parts.netloc:
                continue
            aim = (path.parent / unquote(parts.path)).resolve() if parts.path else path
            anchor = unquote(parts.fragment)
            if not aim.is_file() or (anchor and aim in pages and anchor not in pages[aim].anchors):
                yield f"{path.relative_to(folder)}: {target}"


if __name__ == "__main__":
    warnings.simplefilter("error")
    build(Path(sys.argv[1]) if len(sys.argv) > 1 else ROOT / "build" / "reference")
