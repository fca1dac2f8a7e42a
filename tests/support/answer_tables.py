"""Tables of the pages on how sure an answer is, from stored results of `tests/studies/answers.py` and others."""

from __future__ import annotations

import re
from pathlib import Path

import pandas as pd

RESULTS = Path(__file__).resolve().parents[1] / "studies" / "results"
PAGES = Path(__file__).resolve().parents[2] / ".reference" / "pages"
HOLDERS = {"uncertainty.md": ("worlds", "scenes", "verdicts", "hard")}
_NAMES = {"layer.E": "E", "layer.thickness": "h", "substrate.E": "E of the substrate"}


def stored(name: str) -> pd.DataFrame:
    """A table of results."""
    return pd.read_csv(RESULTS / f"answers_{name}.csv")


def markdown(head: list[str], rows: list[list[str]]) -> str:
    """A table whose first column is text."""
    lines = [head, ["---"] + ["---:"] * (len(head) - 1), *rows]
    return "\n".join(f"| {' | '.join(line)} |" for line in lines)


def worlds() -> str:
    """One row a world: coverage and width of E alone, then with the thickness free."""
    alone, both = stored("worlds_E").set_index("kind"), stored("worlds_E_h")
    modulus = both[both["parameter"] == "layer.E"].set_index("kind")
    head = [
        "95 % of",
        f"E ({alone['curves'].iloc[0]} curves)",
        "control",
        "width",
        f"E, h free ({modulus['curves'].iloc[0]})",
        "control",
    ]
    return markdown(
        head,
        [
            [
                kind,
                f"{row['covered %']:g} %",
                f"{row['white covered %']:g} %",
                f"{row['width, median']:g}",
                f"{modulus.loc[kind, 'covered %']:g} %",
                f"{modulus.loc[kind, 'white covered %']:g} %",
            ]
            for kind, row in alone.iterrows()
        ],
    )


def scenes() -> str:
    """One row a parameter and what is free with it."""
    rows = []
    for free in ("E", "E_h", "E_E2", "E_h_E2"):
        beside = ", ".join(free.replace("E2", "E of the substrate").split("_"))
        for _, row in stored(f"scenes_{free}").iterrows():
            rows.append(
                [
                    f"{_NAMES[row['parameter']]}; free: {beside}",
                    f"{row['curves']}",
                    f"{row['covered %']:g} %",
                    f"{row['white covered %']:g} %",
                    f"{row['width, median']:g}",
                    f"{row['open']}",
                    f"{row['ms, median']:g} ({row['ms, 90 %']:g})",
                ]
            )
    return markdown(["95 % of", "curves", "hold", "control", "width", "open", "ms (90 %)"], rows)


def verdicts() -> str:
    """How many of clean and of correlated curves are not called good."""
    rows = [
        [row["kind"], f"{row['curves']}", f"{row['not good']}", f"{row['for a misfit']}"]
        for _, row in stored("verdicts").iterrows()
    ]
    return markdown(["simulated curves", "curves", "not good", "for a misfit"], rows)


def hard() -> str:
    """How many of hard curves come out as they should."""
    rows = [
        [row["kind"], f"{row['curves']}", f"{row['as it should']}"] for _, row in stored("hard").iterrows()
    ]
    return markdown(["hard curves", "curves", "as they should"], rows)


_TABLES = {"worlds": worlds, "scenes": scenes, "verdicts": verdicts, "hard": hard}


def filled(page: str) -> str:
    """The text of a page with its tables."""
    text = (PAGES / page).read_text(encoding="utf-8")
    for name in HOLDERS[page]:
        begin, end = f"<!-- answers:{name} -->", f"<!-- /answers:{name} -->"
        held = re.compile(f"{re.escape(begin)}.*?{re.escape(end)}", re.DOTALL)
        text = held.sub(f"{begin}\n{_TABLES[name]()}\n{end}", text)
    return text


def write() -> None:
    """Fill every page."""
    for page in HOLDERS:
        (PAGES / page).write_text(filled(page), encoding="utf-8")
