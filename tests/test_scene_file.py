"""Scene files: units, what is fitted, one clear message for each mistake, and the way back."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import underlay as ul
from underlay.scene.scene_file import read_scene_file

GOOD = """
[indenter]
shape = "sphere"
radius = "0.5 mm"

[layer]
E = "0.4 MPa"
nu = 0.45
thickness = "1.5 mm"

[substrate]
rigid = true

[instrument]
contact_depth = "2 um"

[fit]
layer.E = { min = "1 kPa", max = "100 MPa" }
"layer.thickness" = { prior = "normal", mean = "1.5 mm", sd = "0.1 mm" }
instrument.baseline = {}

[solver]
rtol = 1e-4

[noise]
force = "1 uN"

[simulate]
max_depth = "50 um"
points = 11
"""


def write(tmp_path, text):
    path = tmp_path / "scene.toml"
    path.write_text(text, encoding="utf-8")
    return path


def test_reads_units_and_what_is_fitted(tmp_path):
    file = read_scene_file(write(tmp_path, GOOD))
    assert file.scene == ul.Scene(
        ul.Sphere(0.5e-3),
        ul.Layer(ul.Isotropic(0.4e6, 0.45), 1.5e-3),
        ul.RIGID,
        ul.Instrument(contact_depth=2e-6),
    )
    modulus, thickness, baseline = file.free
    assert (modulus.path, modulus.low, modulus.high, modulus.prior) == ("layer.E", 1e3, 1e8, None)
    assert (thickness.prior, dict(thickness.numbers)) == ("normal", {"mean": 1.5e-3, "sd": 1e-4})
    assert (baseline.path, baseline.low, baseline.high) == ("instrument.baseline", -np.inf, np.inf)
    assert file.solver == ul.Auto(1e-4)
    assert file.noise == ul.Noise(force=1e-6)
    assert file.simulate.depth == pytest.approx(np.linspace(0, 5e-5, 11))


@pytest.mark.parametrize(
    ("old", "new", "error", "message"),
    [
        ('radius = "0.5 mm"', 'radius = "0.5 parsnip"', ul.UnitError, r"\[indenter\] radius.*unknown unit"),
        ('radius = "0.5 mm"', "radius = 0.5", ul.UnitError, r"\[indenter\] radius.*has no unit"),
        ('E = "0.4 MPa"', 'E = "0.4 mm"', ul.UnitError, r"\[layer\] E.*length.*pressure"),
        ('E = "0.4 MPa"', 'E = "-0.4 MPa"', ul.InputError, "must be positive"),
        ("nu = 0.45", "nu = 0.6", ul.InputError, r"in \(-1, 0.5\]"),
        ("nu = 0.45", "", ul.InputError, r"\[layer\] needs 'nu'"),
        ("nu = 0.45", "nu = 0.45\nred = 1", ul.InputError, r"\[layer\] has no 'red'; allowed: E, nu"),
        ('shape = "sphere"', 'shape = "cube"', ul.InputError, "'cube' is not known; allowed: berkovich"),
        ("rigid = true", "rigid = 'very'", ul.InputError, "true or false"),
        ("rigid = true", "rigid = true\nE = '1 Pa'", ul.InputError, "needs nothing else"),
        ("[substrate]\nrigid = true", "", ul.InputError, "needs a substrate"),
        ("[layer]", "[lair]", ul.InputError, r"section \[lair\]; did you mean layer\? allowed: indenter"),
        ("layer.E = {", "layer.D = {", ul.ParameterError, "no parameter 'layer.D'"),
        ("layer.E = {", "substrate.E = {", ul.ParameterError, "no parameter 'substrate.E'"),
        ('min = "1 kPa"', 'min = "1 GPa"', ul.InputError, "min must be below max"),
        ('prior = "normal"', 'prior = "flat"', ul.InputError, "prior"),
        ("baseline = {}", "baseline = 3", ul.InputError, r"write instrument.baseline = \{"),
        ("points = 11", "points = 1", ul.InputError, r"\[simulate\] points"),
        ('max_depth = "50 um"', 'max_depth = "-50 um"', ul.InputError, "start must be below"),
        ("rtol = 1e-4", "rtol = 4.0", ul.InputError, "rtol must be between"),
        ("[solver]", "[solver", ul.FileFormatError, "is not a scene file"),
    ],
)
def test_each_mistake_has_its_message(tmp_path, old, new, error, message):
    assert old in GOOD
    with pytest.raises(error, match=message):
        read_scene_file(write(tmp_path, GOOD.replace(old, new, 1)))


RELAXING = """
[indenter]
shape = "sphere"
radius = "0.5 mm"

[layer]
E = "0.4 MPa"
nu = 0.5
thickness = "1.5 mm"
relaxation = { model = "power_law", exponent = 0.2, time = "1 s" }

[substrate]
rigid = true

[[substrate.layers]]
E = "20 MPa"
nu = 0.4
thickness = "100 um"
bond = { normal = "1 GPa/m", shear = "0 Pa/m" }

[fit]
"""


@pytest.mark.parametrize(
    ("written", "paths"),
    [
        ("layer.relaxation.exponent = { min = 0.05 }", ["layer.relaxation.exponent"]),
        ('"layer.relaxation.exponent" = {}', ["layer.relaxation.exponent"]),
        ('layer."relaxation.exponent" = {}', ["layer.relaxation.exponent"]),
        ("layer = { E = {}, relaxation = { exponent = {} } }", ["layer.E", "layer.relaxation.exponent"]),
        ("[fit.layer.relaxation]\nexponent = {}", ["layer.relaxation.exponent"]),
        ('substrate."layers[0]".bond.normal = {}', ["substrate.layers[0].bond.normal"]),
        ('layer.E = {}\n"layer.relaxation" = { exponent = {} }', ["layer.E", "layer.relaxation.exponent"]),
        ("layer = {}", []),
    ],
)
def test_fitted_numbers_may_be_nested_at_any_depth(tmp_path, written, paths):
    file = read_scene_file(write(tmp_path, RELAXING + written))
    assert [free.path for free in file.free] == paths


@pytest.mark.parametrize(
    ("written", "message"),
    [
        ("layer.relaxation.exponent = 0.2", r"write layer\.relaxation\.exponent = \{ min"),
        ("layer.relaxation.exponnt = {}", r"did you mean 'layer\.relaxation\.exponent'\?"),
        ("layer.relaxation.exponent = { mim = 1 }", r"\[fit\] \[layer\.relaxation\.exponent\] has no 'mim'"),
        ("exponent = {}", r"say of which part of the scene; write layer\.relaxation\.exponent"),
        ("layer = 3", r"write layer = \{"),
    ],
)
def test_a_mistake_in_nested_keys_is_named_by_its_whole_path(tmp_path, written, message):
    with pytest.raises(ul.InputError, match=message):
        read_scene_file(write(tmp_path, RELAXING + written))


@pytest.mark.parametrize(
    ("section", "written", "message"),
    [
        (
            "curve",
            "segment = 'back'",
            r"\[curve\] segment: there is no 'back'; allowed are 'all', .*'ramp 2'",
        ),
        ("curve", "segment = 'hold'", r"\[curve\] segment: a hold cannot be fitted"),
        ("curve", "flip = 'force'", r"\[curve\] flip: must be a list of 'depth', 'force'; got 'force'"),
        ("curve", "flip = ['time']", r"\[curve\] flip: must be a list of 'depth', 'force'"),
        ("curve", "test = 0", r"\[curve\] test: must be a whole number from 1"),
        ("curve", "test = true", r"\[curve\] test: must be a whole number"),
        ("curve", "columns = { depth = 3.5 }", r"\[curve\] columns: must be a table"),
        ("curve", "file = 3", r"\[curve\] file: must be text; got 3"),
        ("simulate", "points = 20", r"\[simulate\] needs 'max_depth'"),
        ("simulate", "max_depth = '1 um'\npoints = 2.5", r"points: must be a whole number from 2 to"),
        ("adhesion", "model = 'jkr'\nwork = '-1 J/m^2'", r"\[adhesion\] .*got -1\.0"),
        ("adhesion", "model = 'jkr'\nwork = '1 J/m^2'\nbranch = 'up'", r"branch: must be one of"),
        ("lever", "spring_constant = '0 N/m'", r"\[lever\] lever spring_constant must be positive"),
    ],
)
def test_every_section_says_what_it_takes(tmp_path, section, written, message):
    text = GOOD.partition("[simulate]")[0] + f"[{section}]\n{written}\n"
    with pytest.raises(ul.InputError, match=message):
        read_scene_file(write(tmp_path, text))


def test_files_that_are_not_scenes(tmp_path):
    with pytest.raises(ul.FileAccessError, match="No such file"):
        ul.load_scene(tmp_path / "none.toml")
    with pytest.raises(ul.FileAccessError, match="is a directory"):
        ul.load_scene(tmp_path)
    (tmp_path / "binary.toml").write_bytes(b"\xff\xfe\x00\x01")
    with pytest.raises(ul.FileFormatError, match="is not a scene file"):
        ul.load_scene(tmp_path / "binary.toml")
    (tmp_path / "huge.toml").write_bytes(b"#" * 1_000_001)
    with pytest.raises(ul.FileFormatError, match="holds more than the 1 MB"):
        ul.load_scene(tmp_path / "huge.toml")


def offsets(largest):
    """Numbers on either side of zero that a file may hold: nothing is smaller than 1e-60 and not zero."""
    return st.one_of(st.just(0.0), st.floats(1e-60, largest), st.floats(-largest, -1e-60))


materials = st.builds(ul.Isotropic, st.floats(1e-3, 1e12), st.floats(-0.9, 0.5))
scenes = st.builds(
    ul.Scene,
    st.one_of(
        st.builds(ul.Sphere, st.floats(1e-9, 1.0)),
        st.builds(ul.Cone, st.floats(0.01, 1.5)),
        st.builds(ul.PowerLaw, st.floats(1.0, 9.0), st.floats(1e-3, 1e6)),
        st.builds(ul.FlatPunch, st.floats(1e-9, 1.0)),
    ),
    st.builds(ul.Layer, materials, st.floats(1e-9, 1.0)),
    st.one_of(
        st.just(ul.RIGID),
        materials,
        st.just(ul.TransverselyIsotropic(E=1e6, E_axial=2e6, nu=0.3, nu_axial=0.2, G_axial=3e5)),
    ),
    st.builds(ul.Instrument, offsets(1e-3), offsets(1.0), st.just(0.0), offsets(1.0).map(abs)),
)


@given(scenes)
def test_a_saved_scene_reads_back_to_the_last_bit(tmp_path_factory, scene):
    path = scene.save(tmp_path_factory.mktemp("scene") / "scene.toml")
    assert ul.load_scene(path) == scene


def test_saving_where_nothing_can_be_written(tmp_path):
    scene = ul.Scene(ul.Sphere(1e-3), ul.Layer(ul.Isotropic(1e6, 0.3)))
    with pytest.raises(ul.FileAccessError, match="cannot write"):
        scene.save(tmp_path / "absent" / "scene.toml")
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize(
    ("solver", "expected"),
    [
        ('name = "exact"\nrtol = 1e-8', ul.Exact(1e-8)),
        ('name = "asymptotic"\norder = 2\nform = "compliance"', ul.Asymptotic(2, "compliance")),
        ('name = "garcia2018"', ul.Published("garcia2018")),
        ("", ul.Auto()),
    ],
)
def test_solvers_by_name(tmp_path, solver, expected):
    path = tmp_path / "scene.toml"
    path.write_text(
        f'[indenter]\nshape = "cone"\nhalf_angle = "70 deg"\n[layer]\nE = "1 kPa"\nnu = 0.5\n[solver]\n{solver}\n'
    )
    assert read_scene_file(path).solver == expected


@pytest.mark.parametrize(
    ("solver", "message"),
    [
        ('method = "exact"', r'\[solver\] method is now name: write name = "exact"'),
        ("accuracy = 1e-4", r"\[solver\] accuracy is now rtol: write rtol = 0.0001"),
        ('name = "exat"', r"\[solver\] no solver is called 'exat'. Did you mean 'exact'"),
        ("order = 2", r"\[solver\] the solver 'auto' has no order; it has rtol"),
        ('name = "halfspace"\nrtol = 1e-3', r"\[solver\] the solver 'halfspace' has no rtol"),
    ],
)
def test_old_and_wrong_solver_keys_say_what_to_write(tmp_path, solver, message):
    path = tmp_path / "scene.toml"
    path.write_text(
        f'[indenter]\nshape = "cone"\nhalf_angle = "70 deg"\n[layer]\nE = "1 kPa"\nnu = 0.5\n[solver]\n{solver}\n'
    )
    with pytest.raises(ul.InputError, match=message):
        read_scene_file(path)
