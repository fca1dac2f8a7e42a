"""A small run of the fuzzing, and that the stored result of the long one is of this kind and clean."""

import importlib.util
import json
import sys
from pathlib import Path

import pytest

HERE = Path(__file__).resolve().parent
RESULT = HERE / "fuzz_readers_result.json"


@pytest.fixture(scope="module")
def fuzz():
    path = list(sys.path)
    spec = importlib.util.spec_from_file_location("fuzz_readers", HERE / "fuzz_readers.py")
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
    read = sum(count for outcome, count in result["outcomes"].items() if outcome.startswith("read"))
    assert 0.1 < read / result["readings"] < 0.9


def test_every_format_is_among_the_seeds(fuzz):
    from underlay.data.readers import FORMATS  # noqa: PLC0415  beside what it is compared with

    names = {name.split()[0] for name, _ in fuzz.seeds()}
    assert {known.name for known in FORMATS} <= names


def test_the_harness_sees_what_it_looks_for(fuzz, tmp_path, monkeypatch):
    """The control: a reader that leaks another error and opens another file is caught."""

    def bad(path, *_, **__):
        (tmp_path / "other").write_text("touched")
        raise ZeroDivisionError(path)

    monkeypatch.setattr(fuzz, "read_all", bad)
    monkeypatch.setattr(fuzz, "seeds", lambda: [("csv", b"depth (um),force (mN)\n1,2\n")])
    monkeypatch.setattr(fuzz.logging, "disable", lambda _: None)
    monkeypatch.setattr(fuzz.warnings, "simplefilter", lambda _: None)
    with pytest.raises(ZeroDivisionError):  # in the warm-up nothing but our own errors is let through
        fuzz.run_chunk(0, 1, tmp_path)
    calls = []

    def bad_later(path, *_, **__):
        calls.append(path)
        return bad(path) if len(calls) > 1 else None

    monkeypatch.setattr(fuzz, "read_all", bad_later)
    errors = [failure["error"] for failure in fuzz.run_chunk(0, 1, tmp_path)["failures"]]
    assert any("ZeroDivisionError" in error for error in errors)
    assert any("opened" in error and "other" in error for error in errors)


def test_the_stored_result_of_the_long_run_is_clean():
    result = json.loads(RESULT.read_text(encoding="utf-8"))
    assert result["files"] >= 100_000
    assert result["failures"] == []
    assert result["slowest_seconds"] < 2.0
    assert result["largest_memory_growth_mb"] < 500
