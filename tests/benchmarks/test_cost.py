"""The cases of the page of costs, one by one, and the command that writes it.

Run with `python -m pytest tests/benchmarks --benchmark-enable`; `python tests/benchmarks/cost.py` times the same
cases against their units. Nothing here asserts seconds.
"""

import json
import subprocess
import sys
from dataclasses import replace
from functools import partial

import pytest

from benchmarks import cost, cost_models, cost_users


@pytest.mark.parametrize("case", cost_models.CASES, ids=lambda case: case.name)
def test_case(benchmark, case):
    benchmark(case.prepare(cost_models.depths()))


@pytest.mark.parametrize("count", cost_models.COUNTS)
def test_exact_law_held_at_so_many_depths(benchmark, count):
    benchmark(cost_models.held(cost_models.RIGID_BASE, cost_models.ul.Exact(1e-6))(cost_models.depths(count)))


@pytest.fixture
def quick(monkeypatch):
    """Two of the cases, each timed once, and three numbers of depths; `test_case` prepares them all."""
    few = tuple(next(case for case in cost_models.CASES if case.is_fit is fits) for fits in (False, True))
    monkeypatch.setattr(cost_models, "CASES", few)
    monkeypatch.setattr(cost_models, "model_table", partial(cost_models.model_table, few, rounds=1))
    monkeypatch.setattr(cost_models, "fit_table", partial(cost_models.fit_table, few, rounds=1))
    monkeypatch.setattr(
        cost_models, "depth_table", partial(cost_models.depth_table, (10, 100, 1000), rounds=1)
    )
    # Start-up and maps take seconds each: two rows stand for them all.
    users = tuple(case for case in cost_users.CASES if "1000 points" in case.what and "CSV" in case.what)
    monkeypatch.setattr(cost_users, "user_table", partial(cost_users.user_table, users, rounds=1))


@pytest.mark.usefixtures("quick")
def test_the_command_replaces_the_tables_and_nothing_else(tmp_path):
    page = tmp_path / "cost.md"
    page.write_text("# before\n\n<!-- bench:start -->\nold\n<!-- bench:end -->\n\nafter\n", encoding="utf-8")
    cost.main(["--page", str(page), "--output", str(tmp_path / "out")])
    text = page.read_text(encoding="utf-8")
    assert text.startswith("# before\n\n<!-- bench:start -->\n")
    assert text.endswith("\n<!-- bench:end -->\n\nafter\n")
    assert "\nold\n" not in text
    for case in cost_models.CASES:
        assert f"| {case.name} | " in text
    assert "| 1,000 | " in text
    # A header and the unit stand above the cases of each table.
    for name, fits in (("models", False), ("fits", True)):
        cases = [case for case in cost_models.CASES if case.is_fit is fits]
        assert len((tmp_path / "out" / f"cost.{name}.csv").read_text().splitlines()) == len(cases) + 2
    assert (tmp_path / "out" / "cost.depths.csv").is_file()
    assert "| reading a plain CSV of 1000 points | " in text
    assert "| map from CSV, 1000 points | " in text
    said = json.loads((tmp_path / "out" / "cost.machine.json").read_text())
    assert {"machine", "processor", "python", "numpy", "lmfit"} <= said.keys()


def test_a_row_without_its_peer_says_so():
    absent = cost_users.Case("a race", "times", float, needs="no_such_package")
    there = replace(absent, what="a walk", needs="numpy")
    table = cost_users.user_table((absent, there), rounds=3)
    assert cost_users.markdown(table).splitlines()[2:] == [
        "| a race | not measured: no_such_package is not installed |",
        "| a walk | 3 times |",
    ]


def test_a_page_without_a_place_is_refused_before_anything_is_measured(tmp_path):
    page = tmp_path / "page.md"
    page.write_text("no markers", encoding="utf-8")
    done = subprocess.run(
        [sys.executable, cost.__file__, "--page", str(page)], capture_output=True, text=True, check=False
    )
    assert done.returncode == 1
    assert "page.md has no place for the tables" in done.stderr


def test_the_page_has_the_place_and_its_rows_are_the_cases():
    text = cost.PAGE.read_text(encoding="utf-8")
    inside = text.partition(cost.START)[2].partition(cost.END)[0]
    named = (*(case.name for case in cost_models.CASES), *(case.what for case in cost_users.CASES))
    for name in named:
        assert f"| {name} | " in inside, "run: python tests/benchmarks/cost.py"


def test_a_row_of_what_a_user_waits_for_is_measured_from_its_scenes():
    values = cost_users.user_table(
        [case for case in cost_users.CASES if case.what.endswith(("noise stated", "wavenumbers"))], rounds=1
    )
    assert (values["value"] > 0.0).all()
