"""Execute the notebooks and keep their outputs: ``python tests/support/notebooks.py [NAME...]``."""

import sys
from pathlib import Path

import nbformat

from underlay.report.notebook import execute

FOLDER = Path(__file__).resolve().parents[2] / "notebooks"


def notebooks():
    """Every notebook of the project."""
    return sorted(FOLDER.glob("*.ipynb"))


def executed(path):
    """Run a notebook where it stands and return it with its outputs."""
    return execute(nbformat.read(path, as_version=4), path.parent)


def main(names):
    for path in notebooks():
        if not names or path.name in names or path.stem in names:
            notebook = executed(path)
            for cell in notebook.cells:
                # When a cell ran is of no interest, and differs each time.
                cell.metadata.pop("execution", None)
            nbformat.write(notebook, path)
            sys.stdout.write(f"executed {path.name}\n")


if __name__ == "__main__":
    main(set(sys.argv[1:]))
