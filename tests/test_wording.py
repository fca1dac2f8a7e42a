"""What the library says, in every place: no message has an argument of Python in it."""

import ast
import re
from pathlib import Path

import underlay

PACKAGE = Path(underlay.__file__).parent
#: Builders of messages: errors, and the warnings of a fit or of the library.
BUILDERS = re.compile(r"\w*(Error|Warning)$|^warn$|^_refusal$")
#: An argument given by name, a call, or a name of the library: what no scene file and no flag is written with.
PYTHON = re.compile(
    r"\b[a-z_]\w*=(?=[\w'\"{(.])|\b(?:ul\.)?[a-z_]\w*\((?:[a-z_.]+(?:, ?[\w=.]+)*)?\)|\bRIGID\b|=\{"
)
#: Wherever these are, the command line does not come: arguments that only Python can give.
PYTHON_ONLY = {
    "inference/design/second_test.py",
    "report/problem_source.py",
    "report/render.py",
    "mechanics/profile.py",
}
#: Written so on the command line too.
FLAGS = re.compile(r"--[a-z-]+ [a-z_]+=\S+|--noise \w+=")
#: Formulas and functions of mathematics.
MATHEMATICS = re.compile(r"\b(sqrt|ln|exp|cos|tan|atan|log|int|max|min)\([^)]*\)")


def text_of(node):
    if isinstance(node, ast.Constant) and isinstance(node.value, str):
        return node.value
    if isinstance(node, ast.JoinedStr):
        return "".join(part.value if isinstance(part, ast.Constant) else "X" for part in node.values)
    if isinstance(node, ast.BinOp):
        return (text_of(node.left) or "") + (text_of(node.right) or "")
    return None


def messages():
    """(file, text) of every string handed to an error or a warning, and of every `_beyond`."""
    for path in sorted(PACKAGE.rglob("*.py")):
        name = path.relative_to(PACKAGE).as_posix()
        if name in PYTHON_ONLY:
            continue
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
            found = []
            if isinstance(node, ast.Call):
                called = node.func.id if isinstance(node.func, ast.Name) else getattr(node.func, "attr", "")
                if BUILDERS.match(called):
                    found = [text_of(argument) for argument in node.args]
            elif isinstance(node, ast.FunctionDef) and node.name == "_beyond":
                found = [text_of(inner) for inner in ast.walk(node) if not isinstance(inner, ast.Expr)]
            for text in found:
                if text and " " in text:
                    yield f"{name}:{node.lineno}", text


def test_no_python_reaches_the_command_line():
    found = list(messages())
    said = [(place, MATHEMATICS.sub("", FLAGS.sub("", text))) for place, text in found]
    assert not [(place, text) for place, text in said if PYTHON.search(text)]
    assert len(found) > 500  # the search finds them


def test_the_words_of_python_are_found():
    for text in (
        "use method='exact'",
        "pass resume=True to go on",
        "see plan()",
        "is RIGID",
        "columns={'a': 1}",
    ):
        assert PYTHON.search(text), text
