"""The examples in docstrings run, and every public name has one line that says what it is."""

import doctest
import gc
import importlib.util
import inspect
import pkgutil
import subprocess
import sys
from pathlib import Path

import pytest

import underlay

MODULES = sorted(
    module.name
    for module in pkgutil.walk_packages(underlay.__path__, "underlay.")
    if not module.name.endswith("__main__")
)


def shows_examples(name):
    source = importlib.util.find_spec(name).origin
    return ">>>" in Path(source).read_text(encoding="utf-8")


# No other module is imported here: `app.preloaded` freezes the collector of the process that imports it.
WITH_EXAMPLES = [name for name in MODULES if shows_examples(name)]


@pytest.mark.parametrize("name", WITH_EXAMPLES)
def test_examples_run(name):
    module = importlib.import_module(name)
    found = doctest.testmod(module, optionflags=doctest.NORMALIZE_WHITESPACE | doctest.ELLIPSIS)
    assert found.failed == 0


def test_some_examples_were_found():
    finder = doctest.DocTestFinder()
    modules = [importlib.import_module(name) for name in WITH_EXAMPLES]
    assert sum(len(test.examples) for module in modules for test in finder.find(module)) > 20


def test_looking_for_examples_freezes_no_memory():
    """Objects that are frozen are seen by no collection: other tests of this process look for theirs."""
    asked = [sys.executable, "-c", "import gc; print(gc.get_freeze_count())"]
    # Python 3.12 begins with some that are.
    begun = int(subprocess.run(asked, capture_output=True, text=True, check=True).stdout)
    assert gc.get_freeze_count() == begun


@pytest.mark.parametrize("name", underlay.__all__)
def test_public_names_say_what_they_are(name):
    thing = getattr(underlay, name)
    text = inspect.getdoc(thing if inspect.isroutine(thing) or inspect.isclass(thing) else type(thing))
    assert text
    assert text.splitlines()[0].strip()
