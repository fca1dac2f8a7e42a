"""Docstrings at random, with names and signatures but without code: for a reader who is to say what each means.

``python tests/support/docstring_sample.py 60 --seed 61 > sample.md``
"""

import argparse
import ast
import random

from count_house import PACKAGE, files


def documented(file):
    """Public and private functions and classes of a file that have a docstring: name, signature and text."""
    for node in ast.walk(file.tree):
        if isinstance(node, ast.FunctionDef | ast.ClassDef) and ast.get_docstring(node):
            is_function = isinstance(node, ast.FunctionDef)
            arguments = f"({ast.unparse(node.args)})" if is_function else ""
            returned = f" -> {ast.unparse(node.returns)}" if is_function and node.returns else ""
            yield f"{file.name}: {node.name}{arguments}{returned}", ast.get_docstring(node)


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("count", type=int)
    parser.add_argument("--seed", type=int, required=True)
    asked = parser.parse_args()
    everything = [entry for file in files(PACKAGE) for entry in documented(file)]
    chosen = random.Random(asked.seed).sample(everything, asked.count)  # noqa: S311  no secret
    for number, (name, text) in enumerate(chosen, 1):
        print(f"## {number}. `{name}`\n\n{text}\n")


if __name__ == "__main__":
    main()
