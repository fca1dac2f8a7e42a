"""A small run of the fuzzing, and that the stored result of the long one is of this kind and clean."""

import importlib.util
import json
import sys
from pathlib import Path

import pytest

import underlay as ul
from support import file_kinds

HERE = Path(__file__).resolve().parent
RESULT = HERE / "fuzz_files_result.json"
KINDS = {"curve", "scene", "manifest", "fit record", "posterior", "chain", "map", "journal"}


@pytest.fixture(scope="module")
def fuzz():
    path = list(sys.path)
    spec = importlib.util.spec_from_file_location("fuzz_files", HERE / "fuzz_files.py")
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    sys.path[:] = path
    return module


def test_hundreds_of_damaged_files_raise_only_our_errors(fuzz):
    result = fuzz.run(300, first=5_000_000)  # other files than those of the long run
    assert result["failures"] == []
    assert result["slowest_seconds"] < fuzz.SECONDS
    assert result["largest_memory_growth_mb"] < fuzz.MEGABYTES
    # Some are refused and some still read; a fuzzing that only hits the door tests little.
    through = ("read", "judged", "fitted")
    read = sum(count for outcome, count in result["outcomes"].items() if outcome.endswith(through))
    assert 0.1 < read / result["files"] < 0.9


def test_every_kind_and_every_format_is_among_the_seeds(tmp_path):
    from underlay.data.readers import FORMATS  # noqa: PLC0415  beside what it is compared with

    seeds = file_kinds.seeds(tmp_path)
    assert {seed.kind for seed in seeds} == KINDS
    names = {seed.name.split()[0] for seed in seeds if seed.kind == "curve"}
    assert {known.name for known in FORMATS} <= names


def test_the_harness_sees_what_it_looks_for(fuzz, tmp_path):
    """The control: a reader that leaks another error, opens another file and talks too much is caught."""

    def bad(_):
        (tmp_path / "other").write_text("touched")
        raise ZeroDivisionError

    def talkative(_):
        raise ul.UnderlayError("x" * 5000)

    tally = fuzz.Tally(fuzz.Watch())
    for number, read in enumerate((bad, talkative)):
        seed = file_kinds.Seed("curve", "made", ".dat", b"1", read)
        tally.add(number, seed, fuzz.put(tmp_path, seed, seed.content))
    fuzz.faulthandler.cancel_dump_traceback_later()
    errors = [failure["error"] for failure in tally.result()["failures"]]
    assert any("ZeroDivisionError" in error for error in errors)
    assert any("opened" in error and "other" in error for error in errors)
    assert any("5000 characters" in error for error in errors)


def test_the_stored_result_of_the_long_run_is_clean():
    result = json.loads(RESULT.read_text(encoding="utf-8"))
    assert {outcome.split(":")[0] for outcome in result["outcomes"]} == KINDS
    assert result["command"].startswith("python tests/fuzz_files.py")
    assert result["files"] >= 100_000
    assert result["outcomes"]["curve: fitted"] >= 20_000  # past parsing, quality and contact
    assert result["failures"] == []
    assert result["slowest_seconds"] < 5.0
    assert result["largest_memory_growth_mb"] < 500
