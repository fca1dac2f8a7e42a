"""What is loaded, and when: nobody waits for a library that he does not use."""

import os
import subprocess
import sys

import pytest

import underlay as ul

HEAVY = {
    "dask",
    "emcee",
    "lmfit",
    "matplotlib",
    "pandas",
    "pint",
    "pydantic",
    "scipy",
    "scipy.stats",
    "tomlkit",
}


def loaded_after(code):
    """Heavy modules that a fresh interpreter holds after `code`."""
    done = subprocess.run(
        [sys.executable, "-c", f"{code}\nimport sys; print(*sys.modules)"],
        env=os.environ | {"PYTHONPATH": os.pathsep.join(sys.path)},
        capture_output=True,
        text=True,
        check=True,
    )
    return HEAVY & set(done.stdout.splitlines()[-1].split())


LAW = """
import underlay as ul
ul.contact_law(ul.Sphere(1e-3), ul.Layer(ul.Isotropic(1e6, 0.4), 1e-3), ul.RIGID, max_depth=1e-5)
"""


@pytest.mark.parametrize(
    ("code", "allowed"),
    [("import underlay", set()), ("import underlay.mechanics", set()), (LAW, {"scipy"})],
)
def test_what_is_loaded(code, allowed):
    assert loaded_after(code) <= allowed


@pytest.mark.parametrize("name", ul.__all__)
def test_every_public_name_can_be_had(name):
    assert getattr(ul, name) is not None
    assert name in dir(ul)


def test_report_is_the_function_whatever_was_loaded_before():
    code = "import underlay.report.plots, underlay as ul\nassert ul.report.__module__ == 'underlay.report.render'"
    assert loaded_after(code) >= {"matplotlib"}


def test_an_unknown_name_is_an_attribute_error():
    with pytest.raises(AttributeError, match="fitt"):
        ul.fitt  # noqa: B018
