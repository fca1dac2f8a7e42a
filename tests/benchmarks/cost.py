"""Measure speed: models, fits, start-up, reading, maps and stacks, each against its unit.

    python tests/benchmarks/cost.py [--page .reference/pages/cost.md] [--output FOLDER]

The tables of the page, between its markers, are replaced; with a folder they are written there as CSV, with what
they were measured with. `python -m pytest tests/benchmarks --benchmark-enable` times the same cases one by one. How
right they are is measured by `underlay benchmark`.
"""

import argparse
import json
import sys
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
sys.path[:0] = [str(ROOT / "tests"), str(ROOT / "src")]

from benchmarks import cost_models, cost_users  # noqa: E402  # after the path is set

PAGE = ROOT / ".reference" / "pages" / "cost.md"
START, END = "<!-- bench:start -->", "<!-- bench:end -->"


def parts(page):
    """What stands before and after the tables of a page."""
    before, start, rest = page.read_text(encoding="utf-8").partition(START)
    _, end, after = rest.partition(END)
    if not (start and end):
        raise SystemExit(f"{page.name} has no place for the tables: put {START} and {END} in it")
    return before, after


def main(words):
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--page", type=Path, default=PAGE)
    parser.add_argument("--output", type=Path)
    asked = parser.parse_args(words)
    before, after = parts(asked.page)
    tables = {
        "models": cost_models.model_table(),
        "depths": cost_models.depth_table(),
        "fits": cost_models.fit_table(),
        "users": cost_users.user_table(),
    }
    text = f"{cost_models.markdown(*list(tables.values())[:3])}\n\n{cost_users.markdown(tables['users'])}"
    print(text)
    asked.page.write_text(f"{before}{START}\n{text}\n{END}{after}", encoding="utf-8")
    if asked.output is not None:
        asked.output.mkdir(parents=True, exist_ok=True)
        for name, table in tables.items():
            table.to_csv(asked.output / f"cost.{name}.csv", index=False)
        (asked.output / "cost.machine.json").write_text(json.dumps(cost_users.machine(), indent=2))


if __name__ == "__main__":
    main(sys.argv[1:])
