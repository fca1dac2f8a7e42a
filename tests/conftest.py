"""What tests share: the command line as the shell calls it."""

import os
import sys

import pytest
from hypothesis import HealthCheck, settings

from support.slow_tests import LIST
from underlay.cli.app import main

# Tests start hundreds of processes: where none may keep what it compiled, each compiles the whole package anew.
os.environ.pop("PYTHONDONTWRITEBYTECODE", None)
sys.dont_write_bytecode = False

# A busy machine is no fault of the code: no test of a property depends on the clock.
settings.register_profile("no clock", deadline=None, suppress_health_check=[HealthCheck.too_slow])
settings.load_profile("no clock")


@pytest.hookimpl(tryfirst=True)
def pytest_collection_modifyitems(items):
    """Mark what the fast layer leaves out: the tests of a list that was measured, and those of studies."""
    listed = set(LIST.read_text(encoding="utf-8").split())
    for item in items:
        if item.nodeid.partition("[")[0] in listed or item.get_closest_marker("study"):
            item.add_marker("slow")


@pytest.fixture
def run(capsys, monkeypatch):
    """Call the entry point as the shell would: (exit code, stdout, stderr)."""

    def call(*words):
        monkeypatch.setattr(sys, "argv", ["underlay", *map(str, words)])
        code = 0
        try:
            main()
        except SystemExit as stop:
            code = stop.code or 0
        captured = capsys.readouterr()
        return code, captured.out, captured.err

    return call


@pytest.fixture
def done(run):
    """Call the entry point, which must succeed: its stdout."""

    def call(*words):
        code, out, err = run(*words)
        assert code == 0, err
        return out

    return call


@pytest.fixture
def refused(run):
    """Call the entry point, which must refuse in one line, perhaps with a next step under it: its stderr."""

    def call(*words):
        code, _, err = run(*words)
        first, *steps = err.splitlines()
        assert code == 2, err
        assert first.startswith("underlay: ")
        assert all(step.startswith("Next step: ") for step in steps)
        return err

    return call
