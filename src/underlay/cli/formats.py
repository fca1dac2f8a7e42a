"""`underlay formats`: the instrument formats that can be read."""

from __future__ import annotations

import pandas as pd

from underlay.cli.console import say_table
from underlay.data.readers import FORMATS

__all__ = ["formats"]


def formats() -> None:
    """List the instrument formats that can be read; files are recognised by their content.

    Example: `underlay formats`
    """
    rows = [
        {
            "format": entry.name,
            "needs": f"underlay[{entry.extra}]" if entry.extra else "",
            "what": entry.description,
        }
        for entry in FORMATS
    ]
    say_table(pd.DataFrame(rows), "Formats")
