"""Indenters, solvers and readers of other packages: declared as entry points, known by name, errors contained."""

import numpy as np
import pytest

import underlay as ul
from underlay import plugins as found
from underlay.mechanics.solvers import solver_named, solver_record
from underlay.scene.scene_keys import scene_keys

GOOD = """
from dataclasses import dataclass, replace
from typing import ClassVar
import numpy as np
import underlay as ul
from underlay.data.readers._format import make_curve
from underlay.mechanics.indenters import Paraboloid


@dataclass(frozen=True)
class Rounded(Paraboloid):
    shape: ClassVar[str] = "rounded_tip"


@dataclass(frozen=True)
class TwiceHertz(ul.Solver):
    factor: float = 2.0

    def build(self, contact, max_depth):
        return ul.HalfSpace().build(replace(contact, theta=self.factor * contact.theta), max_depth)


def look(source):
    return source.data.startswith(b"my device")


def take(source, options):
    rows = np.loadtxt(source.data.decode().splitlines()[1:])
    return [make_curve(source, rows[:, 0], rows[:, 1])]


FORMAT = ul.Format("my_device", "files of my device", look, take)
"""

BAD = """
import underlay as ul
from underlay.mechanics.indenters import Sphere


class Ball(Sphere):
    shape = "sphere"


def look(source):
    if source.data.startswith(b"trap"):
        raise RuntimeError("no trap\\nis sprung twice")
    return source.data.startswith(b"broken device")


def take(source, options):
    return {}["nothing"]


BROKEN = ul.Format("broken_device", "files of a broken device", look, take)
TAKEN = ul.Format("csv", "a name that is taken", look, take)
NUMBER = 7
"""


PACKAGES = {
    "helpful": (
        GOOD,
        {
            "indenters": {"rounded": ":Rounded"},
            "solvers": {"twice_hertz": ":TwiceHertz"},
            "readers": {"my_device": ":FORMAT"},
        },
    ),
    "harmful": (
        BAD,
        {
            "indenters": {"ball": ":Ball", "number": ":NUMBER"},
            "solvers": {"exact": ":Ball", "gone": ":NotThere", "number": ":NUMBER"},
            "readers": {"broken": ":BROKEN", "taken": ":TAKEN", "missing": "_of_nowhere:FORMAT"},
        },
    ),
}


@pytest.fixture(scope="module", autouse=True)
def _installed(tmp_path_factory):
    """Two packages that are installed, as far as Python can tell: a module and its metadata on the path."""
    folder = tmp_path_factory.mktemp("site")
    for name, (module, entries) in PACKAGES.items():
        (folder / f"{name}_plug.py").write_text(module, encoding="utf-8")
        about = folder / f"{name}-1.2.dist-info"
        about.mkdir()
        (about / "METADATA").write_text(f"Metadata-Version: 2.1\nName: {name}\nVersion: 1.2\n")
        lines = []
        for group, given in entries.items():
            lines += [f"[underlay.{group}]", *(f"{key} = {name}_plug{what}" for key, what in given.items())]
        (about / "entry_points.txt").write_text("\n".join(lines) + "\n", encoding="utf-8")
    with pytest.MonkeyPatch.context() as patch:
        patch.syspath_prepend(str(folder))
        found.plugins.cache_clear()
        yield
    found.plugins.cache_clear()


SCENE = """
[indenter]
shape = "rounded_tip"
radius = "1 mm"

[layer]
E = "1 MPa"
nu = 0.5

[solver]
name = "twice_hertz"

[fit]
layer.E = { min = "1 kPa", max = "1 GPa" }
"""


def test_a_file_of_a_package_is_read_and_fitted_by_its_names(done, tmp_path):
    depth = np.linspace(0.0, 1e-5, 60)
    force = ul.Scene(ul.Paraboloid(1e-3), ul.Layer(ul.Isotropic(2e6, 0.5))).force(depth)
    force = force + 1e-6 * np.random.default_rng(1).standard_normal(60)
    rows = "\n".join(f"{w:.9e} {P:.9e}" for w, P in zip(depth, force, strict=True))
    (tmp_path / "test.mine").write_text(f"my device\n{rows}\n", encoding="utf-8")
    (tmp_path / "scene.toml").write_text(SCENE, encoding="utf-8")
    words = ("--scene", tmp_path / "scene.toml", "--output", tmp_path / "out", "--details")
    out = done("fit", tmp_path / "test.mine", *words)
    assert "TwiceHertz" in out or "half-space" in out
    assert ul.read(tmp_path / "test.mine").metadata["format"] == "my_device"
    fit = ul.fit(ul.load_problem(tmp_path / "test.mine", tmp_path / "scene.toml"))
    # A law twice as stiff needs half the modulus.
    assert fit.values["layer.E"] == pytest.approx(1e6, rel=1e-3)


def test_what_packages_add_is_listed(done):
    out = done("formats")
    for name in ("rounded", "twice_hertz", "my_device", "helpful 1.2"):
        assert name in out
    assert any("rounded_tip" in key.takes for key in scene_keys())
    assert any(key.key == "radius (rounded_tip)" for key in scene_keys())


def test_a_plugged_solver_is_kept_in_files_by_its_name():
    solver = solver_named("twice_hertz", factor=3.0)
    assert solver_record(solver) == {"name": "twice_hertz", "factor": 3.0}
    with pytest.raises(ul.InputError, match="has no speed; it has factor"):
        solver_named("twice_hertz", speed=3.0)


def test_the_faults_of_a_package_are_its_own(done):
    out = done("formats")
    said = " ".join(out.split())
    for fault in (
        "another indenter is called 'sphere'",
        "it is no class that derives from Indenter",
        "a solver of underlay has that name",
        "AttributeError",
        "it is neither a class that derives from Solver nor a PublishedCorrection",
        "another format is called 'csv'",
        "ModuleNotFoundError",
    ):
        assert fault in said, fault
    assert ul.Indenter.kinds()["sphere"] is ul.Sphere
    assert solver_named("exact") == ul.Exact()


def test_a_name_that_is_not_known_tells_of_the_plug_ins_that_failed():
    with pytest.raises(ul.InputError, match=r"no solver is called 'gone'.*not usable.*gone of harmful 1\.2"):
        solver_named("gone")


def test_a_reader_that_fails_costs_no_other_file(tmp_path):
    plain = tmp_path / "plain.csv"
    plain.write_text("depth (um),force (mN)\n0,0\n1,1\n2,3\n", encoding="utf-8")
    assert len(ul.read(plain)) == 3
    (tmp_path / "broken.dat").write_bytes(b"broken device\n")
    with pytest.raises(
        ul.FileFormatError, match=r"broken\.dat: the reader broken_device of harmful 1\.2 failed: KeyE"
    ):
        ul.read(tmp_path / "broken.dat")
    trap = tmp_path / "trap.csv"
    trap.write_bytes(b"trap\n")
    with (
        pytest.warns(ul.UnderlayWarning, match="failed to look at it .RuntimeError: no trap.*is sprung"),
        pytest.raises(ul.FileFormatError),
    ):
        ul.read(trap)


def test_no_plug_in_is_loaded_before_it_is_asked_for():
    found.plugins.cache_clear()
    # A law of the house and a tip by its class need no other package.
    ul.contact_law(ul.Sphere(1e-3), ul.Layer(ul.Isotropic(1e6, 0.4)), max_depth=1e-5, solver="halfspace")
    assert found.plugins.cache_info().misses == 0
