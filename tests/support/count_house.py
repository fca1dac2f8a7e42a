"""Counts the house: code lines, files and numbers of every room, and what the ratchet of `test_house` holds.

``python tests/support/count_house.py`` prints the table; with ``--write`` it lowers the figures in `house.json` to
what they are now (they never rise).

A code line carries a token that is no comment or docstring. A number is a numeric constant in the value of an
assignment at module level.
"""

import ast
import io
import json
import sys
import tokenize
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
PACKAGE = ROOT / "src" / "underlay"
FIGURES = Path(__file__).with_name("house.json")
BLANK = {
    tokenize.COMMENT,
    tokenize.NL,
    tokenize.NEWLINE,
    tokenize.INDENT,
    tokenize.DEDENT,
    tokenize.ENDMARKER,
}
TIPS = {"FlatPunch", "Paraboloid", "Sphere", "Cone", "PowerLaw", "Profile", "Indenter"}
#: Effects: their folder or module, and the words by which another file names them.
EFFECTS = {
    "adhesion": (
        ("mechanics/adhesion", "inference/least_squares/adhesive"),
        ("JKR", "DMT", "Maugis", "adhesion"),
    ),
    "relaxation": (
        ("mechanics/viscoelastic", "mechanics/relaxation"),
        ("Prony", "PowerLawRelaxation", "relaxation"),
    ),
    "stuck": (("mechanics/stuck",), ("Stuck", "stuck")),
    "stacks": (
        ("mechanics/kernel/bodies", "mechanics/kernel/recursion"),
        ("Stack", "StackKernel", "stacked"),
    ),
}


@dataclass(frozen=True)
class File:
    """One Python file: its name relative to the package or the tests, and its text."""

    name: str
    text: str

    @cached_property
    def tree(self):
        return ast.parse(self.text)

    @cached_property
    def code_lines(self):
        docstrings = set()
        for node in ast.walk(self.tree):
            body = getattr(node, "body", None)
            holds = isinstance(node, ast.Module | ast.ClassDef | ast.FunctionDef) and body
            if holds and isinstance(body[0], ast.Expr) and isinstance(body[0].value, ast.Constant):
                docstrings.update(range(body[0].lineno, body[0].end_lineno + 1))
        lines = set()
        for token in tokenize.generate_tokens(io.StringIO(self.text).readline):
            if token.type not in BLANK:
                lines.update(range(token.start[0], token.end[0] + 1))
        return len(lines - docstrings)

    @cached_property
    def numbers(self):
        values = [
            node.value
            for node in self.tree.body
            if isinstance(node, ast.Assign | ast.AnnAssign) and node.value is not None
        ]
        return sum(
            isinstance(part, ast.Constant) and type(part.value) in {int, float}
            for value in values
            for part in ast.walk(value)
        )

    @cached_property
    def imports(self):
        """Modules of the package that this file imports from, dotted, wherever the import stands."""
        found = set()
        for node in ast.walk(self.tree):
            if isinstance(node, ast.Import):
                found |= {alias.name for alias in node.names}
            elif isinstance(node, ast.ImportFrom) and node.module:
                found |= {node.module, *(f"{node.module}.{alias.name}" for alias in node.names)}
        return {name for name in found if name.startswith("underlay.")}

    @cached_property
    def words(self):
        """Names, attributes and names that are imported: what this file says."""
        return {node.id for node in ast.walk(self.tree) if isinstance(node, ast.Name)} | {
            node.attr for node in ast.walk(self.tree) if isinstance(node, ast.Attribute)
        }


def files(folder):
    """Every Python file below a folder."""
    return [
        File(path.relative_to(folder).as_posix().removesuffix(".py"), path.read_text(encoding="utf-8"))
        for path in sorted(folder.rglob("*.py"))
    ]


def room_of(name):
    """The room of a file of the package."""
    first, _, rest = name.partition("/")
    if not rest:
        return "base"
    if first == "data" and rest.startswith("readers/"):
        return "data/readers"
    inner = rest.partition("/")
    return f"inference/{inner[0]}" if first == "inference" and inner[2] else first


def importers(package):
    """How many modules import each module of the package."""
    names = {"underlay." + file.name.replace("/", ".") for file in package}
    counts = dict.fromkeys(names, 0)
    for file in package:
        for name in file.imports & names - {"underlay." + file.name.replace("/", ".")}:
            counts[name] += 1
    return counts


def asks_for_tips(file):
    """How often a file tests whether something is a tip of one kind."""
    found = 0
    for node in ast.walk(file.tree):
        if isinstance(node, ast.Call) and isinstance(node.func, ast.Name) and node.func.id == "isinstance":
            kinds = {part.id for part in ast.walk(node.args[1]) if isinstance(part, ast.Name)}
            found += bool(kinds & TIPS)
    return found


def names_an_effect(file, homes, words):
    """Whether a file outside an effect's home imports it or says a name of it."""
    if file.name.startswith(homes):
        return False
    dotted = tuple("underlay." + home.replace("/", ".") for home in homes)
    return any(name.startswith(dotted) for name in file.imports) or bool(file.words & set(words))


def figures():
    """What the ratchet holds: each may only fall."""
    package, tests = files(PACKAGE), files(ROOT / "tests")
    public = {"underlay", "underlay.cli", "underlay.cli.app"}
    own = [file for file in package if not file.name.endswith("__init__")]
    counts = importers(own)
    found = {
        "code lines": sum(file.code_lines for file in package),
        "modules": len(package),
        "modules with one importer": sum(count == 1 for count in counts.values()),
        "numbers at module level": sum(file.numbers for file in package),
        "tests for kinds of tips outside indenters": sum(
            asks_for_tips(file) for file in package if file.name != "mechanics/indenters"
        ),
        "test files that import inner modules": sum(bool(file.imports - public) for file in tests),
        "code lines of tests": sum(file.code_lines for file in tests),
    }
    for effect, (homes, words) in EFFECTS.items():
        found[f"files that name {effect}"] = sum(names_an_effect(file, homes, words) for file in package)
    return found


def table():
    """Rows of the table of rooms: room, code lines, files, numbers."""
    rooms = {}
    for file in files(PACKAGE):
        row = rooms.setdefault(room_of(file.name), [0, 0, 0])
        for at, value in enumerate((file.code_lines, 1, file.numbers)):
            row[at] += value
    rows = sorted(rooms.items())
    total = [sum(column) for column in zip(*(row for _, row in rows), strict=True)]
    return [*rows, ("sum", total)]


def main():
    for room, (lines, count, numbers) in table():
        print(f"{room:<28}{lines:>7} lines {count:>5} files {numbers:>6} numbers")
    found = figures()
    for name, value in found.items():
        print(f"{name:<44}{value:>7}")
    if "--write" in sys.argv:
        known = json.loads(FIGURES.read_text(encoding="utf-8")) if FIGURES.exists() else found
        lowest = {name: min(value, known.get(name, value)) for name, value in found.items()}
        FIGURES.write_text(json.dumps(lowest, indent=2) + "\n", encoding="utf-8")


if __name__ == "__main__":
    main()
