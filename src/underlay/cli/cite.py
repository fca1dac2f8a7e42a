"""`underlay cite`: what an analysis stands on, as a list and as BibTeX."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from underlay._files import write_atomic
from underlay.cli.console import say, say_table
from underlay.cli.options import OutputFolder, ready_folder

__all__ = ["cite"]


def cite(
    result: Annotated[
        Path, typer.Argument(help="A .fit.json, a .posterior.npz or the table of a map.", metavar="RESULT")
    ],
    output: OutputFolder = None,
) -> None:
    """List what to cite of an analysis: the paper, the contact model, the sampler, programs that read files.

    DOIs are given where a source confirms them. With --output the list is written as BibTeX.

    Example: `underlay cite curve.fit.json --output results`
    """
    import pandas as pd

    from underlay.inference.citation import bibtex
    from underlay.inference.cited import cited

    if output is not None:
        ready_folder(output)
    found = cited(result)
    say_table(
        pd.DataFrame([{"for": why, "cite": str(work)} for work, why in found]),
        f"What {result.name} stands on",
    )
    if output is not None:
        stem = result.name.partition(".")[0]
        say(f"wrote {write_atomic(output / f'{stem}.bib', bibtex(work for work, _ in found))}")
