"""Mistakes that people make in scene files, and what each is told; keys and starters that avoid them."""

import re
import shutil
import tomllib
from pathlib import Path

import numpy as np
import pytest

import underlay as ul
from underlay.cli.start import starter_scene
from underlay.mechanics.exact.batch import ExactBatch
from underlay.mechanics.kernel import LayerKernel
from underlay.mechanics.kernel.kernel import u_rule
from underlay.scene.scene_file import read_scene_file
from underlay.scene.scene_keys import TOP, scene_keys

SAMPLES = Path(__file__).resolve().parents[1] / "data_samples"
SCENE = """
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
compliance = "0 m/N"

[fit]
layer.E = { min = "1 kPa", max = "100 MPa" }

[noise]
force = "1 uN"
"""


def write(tmp_path, text):
    path = tmp_path / "scene.toml"
    path.write_text(text, encoding="utf-8")
    return path


@pytest.mark.parametrize(
    ("old", "new", "error", "message"),
    [
        ('thickness = "1.5 mm"', "", ul.InputError, "a layer on a substrate needs its thickness"),
        ("thickness =", "thicknes =", ul.InputError, r"did you mean thickness\? allowed: E, nu, thickness"),
        ("E = ", "youngs_modulus = ", ul.InputError, r"\[layer\] has no 'youngs_modulus'; did you mean E\?"),
        ("nu = 0.45", "poisson_ratio = 0.45", ul.InputError, r"did you mean nu\?"),
        ('radius = "0.5 mm"', 'diameter = "1 mm"', ul.InputError, r"did you mean radius \(half of it\)\?"),
        ('radius = "0.5 mm"', 'R = "1 mm"', ul.InputError, r"did you mean radius\?"),
        ("compliance =", "spring_constant =", ul.InputError, r"did you mean compliance \(its inverse\)\?"),
        ("rigid = true", "Rigid = true", ul.InputError, r"did you mean rigid\?"),
        ('min = "1 kPa"', "min = []", ul.InputError, r"min: must be pressure, .*got \[\]"),
        ("[noise]", "[nose]", ul.InputError, r"unknown section \[nose\]; did you mean noise\?"),
        ("layer.E =", "layer.modulus =", ul.ParameterError, r"did you mean 'layer\.E'\?"),
        ("layer.E =", "layer.poisson =", ul.ParameterError, r"did you mean 'layer\.nu'\?"),
        ("layer.E =", "E =", ul.ParameterError, r"E: say of which part of the scene; write layer\.E = \{"),
        ("layer.E =", "modulus =", ul.ParameterError, r"write layer\.E = \{"),
        (
            "[fit]\n",
            '[fit]\nfree = ["layer.E", "layer.nu"]\n',
            ul.InputError,
            r"a line of its own.*write layer\.E = \{ min = \.\.\., max = \.\.\. \}; layer\.nu = \{",
        ),
        ("layer.E =", "radius =", ul.ParameterError, r"write indenter\.radius = \{"),
        ('"1.5 mm"', '"1,5 mm"', ul.UnitError, r"thickness: write the number with a point: '1\.5 mm'"),
        ('"0.4 MPa"', '"0.4 Mpa"', ul.UnitError, r"unknown unit 'Mpa' for a pressure; did you mean MPa\?"),
        ('"0.4 MPa"', "nan", ul.UnitError, r"\[layer\] E: a pressure must be finite"),
        ('"0.4 MPa"', '"nan MPa"', ul.UnitError, r"\[layer\] E: a pressure must be given as '0\.4 MPa'"),
        ("nu = 0.45", "nu = nan", ul.UnitError, r"\[layer\] nu: .* must be finite"),
        ('shape = "sphere"\n', "", ul.InputError, r"\[indenter\] needs 'shape'"),
        ('shape = "sphere"', 'shape = "spheer"', ul.InputError, r"not known; did you mean sphere\?"),
        ('"sphere"', '"berkovich"', ul.InputError, "shape berkovich needs nothing else; remove radius"),
    ],
)
def test_each_mistake_is_told_what_was_meant(tmp_path, old, new, error, message):
    assert old in SCENE
    with pytest.raises(error, match=message):
        read_scene_file(write(tmp_path, SCENE.replace(old, new, 1)))


def test_a_decimal_comma_that_is_no_number_stays_what_it_was(tmp_path):
    with pytest.raises(ul.UnitError, match="unknown unit ',5,2 mm'"):
        read_scene_file(write(tmp_path, SCENE.replace('"1.5 mm"', '"1,5,2 mm"')))


@pytest.mark.parametrize(
    ("name", "cone"), [("berkovich", ul.Cone.berkovich()), ("vickers", ul.Cone.vickers())]
)
def test_pyramids_are_their_equivalent_cones_and_that_is_said(done, tmp_path, name, cone):
    path = write(tmp_path, SCENE.replace('shape = "sphere"\nradius = "0.5 mm"', f'shape = "{name}"'))
    with pytest.warns(
        ul.UnderlayWarning, match=f"{name} tip is taken as the cone of the same projected area"
    ):
        assert ul.load_scene(path).indenter == cone
    out = done("effects", path, "--max-depth", "10 um")
    assert out.count("taken as the cone") == 1


def test_a_layer_on_a_substrate_has_a_thickness_in_python_too():
    with pytest.raises(ul.InputError, match=r"needs its thickness: give layer\.thickness"):
        ul.Scene(ul.Sphere(1e-3), ul.Layer(ul.Isotropic(1e6, 0.45)), ul.RIGID)
    half_space = ul.Scene(ul.Sphere(1e-3), ul.Layer(ul.Isotropic(1e6, 0.45)))
    assert half_space.contact_law(1e-5).method == "halfspace"


def test_bounds_of_the_contact_without_a_start_take_the_data_s(tmp_path):
    text = (SAMPLES / "cartilage_on_bone.toml").read_text(encoding="utf-8")
    # Contact of the sample is at 14 um; zero, the default, is outside these bounds.
    path = write(tmp_path, text.replace('min = "-30 um"', 'min = "5 um"'))
    problem = ul.load_problem(SAMPLES / "cartilage_on_bone.csv", path)
    assert 5e-6 < problem.base_scenes[0].instrument.contact_depth < 3e-5
    # A start that is stated stays, and is refused where it is outside the bounds.
    path.write_text(path.read_text() + '\n[instrument]\ncontact_depth = "0 um"\n', encoding="utf-8")
    with pytest.raises(ul.InputError, match="outside its bounds"):
        ul.load_problem(SAMPLES / "cartilage_on_bone.csv", path)


# --- keys and starters ------------------------------------------------------------------------------------


def test_every_key_that_a_scene_file_may_hold_is_listed(done, refused, tmp_path):
    listed = {(entry.section, entry.key.split(" (")[0]) for entry in scene_keys()}
    for name in SAMPLES.glob("*.toml"):
        for section, table in tomllib.loads(name.read_text(encoding="utf-8")).items():
            for key, value in table.items() if section not in ("fit", "title") else ():
                # A section within a section, [layer.relaxation], has keys of its own.
                inner = [(f"{section}.{key}", word) for word in value] if isinstance(value, dict) else ()
                assert set(inner or [(section, key)]) <= listed
    assert {(TOP, key) for key in ("title", "friction", "finite_strain")} <= listed
    assert all(entry.meaning and entry.takes for entry in scene_keys())
    kinds = {entry.key: entry.takes for entry in scene_keys() if entry.section == "simulate"}
    assert kinds["start"].startswith("length")
    assert kinds["duration"].startswith("time")
    out = done("keys", "--output", tmp_path)
    sections = {entry.section for entry in scene_keys()} - {TOP}
    assert [section for section in sections if f"[{section}]" not in out] == []
    assert (tmp_path / "scene_keys.csv").exists()
    out = done("keys", "layer")
    assert "[layer]" in out
    assert "[noise]" not in out
    assert "bond" in out
    assert "one of bonded, slip, unknown, or { normal, shear" in out
    out = done("keys", "substrate.layers")
    assert "[[substrate.layers]]" in out
    assert "thickness" in out
    assert "it has indenter, layer" in refused("keys", "lair")


def test_a_listed_key_is_one_that_is_accepted(tmp_path):
    # What the list says of [solver], [noise] and [curve], a scene file takes.
    values = {
        "name": '"exact"',
        "form": '"auto"',
        "order": "4",
        "test": "1",
        "step": "1",
        "segment": '"all"',
        "file": '"a"',
        "flip": '["force"]',
        "overrule": '["indenter.radius"]',
        "preset": '"bioindenter"',
        "fit_from": '"2 um"',
        "fit_to": '"98 % of force"',
    }
    for section in ("solver", "noise", "curve"):
        for entry in scene_keys():
            if entry.section == section and "a table" not in entry.takes and entry.key != "format":
                example = re.search(r'"[^"]+"|0\.45', entry.takes)
                value = values.get(entry.key) or example.group(0)
                # The numbers of a solver go with its name.
                name = {"order": "asymptotic", "form": "asymptotic", "rtol": "exact"}.get(entry.key)
                named = f'name = "{name}"\n' if name else ""
                text = f"{SCENE.partition('[noise]')[0]}\n[{section}]\n{named}{entry.key} = {value}\n"
                read_scene_file(write(tmp_path, text))


def test_formats_shows_the_signs_that_the_scene_turns(done, tmp_path):
    lines = [f"{0.1 * i:.3f},{-0.01 * i:.4f}" for i in range(30)]
    (tmp_path / "c.csv").write_text("\n".join(["depth (um),force (uN)", *lines]) + "\n", encoding="utf-8")
    scene = write(tmp_path, SCENE.split("[noise]", maxsplit=1)[0] + '\n[curve]\nflip = ["force"]\n')
    assert "-290 to 0 nN" in done("formats", tmp_path / "c.csv")
    assert "0 to 290 nN" in done("formats", tmp_path / "c.csv", "--scene", scene)


def test_a_starter_holds_what_the_file_knows_and_is_refused_until_filled_in(done, refused, tmp_path):
    shutil.copy(SAMPLES / "chiaro_cell_indentation.csv", tmp_path / "cell.csv")
    scene = tmp_path / "new.toml"
    assert "replace every TODO" in done("formats", tmp_path / "cell.csv", "--new-scene", scene)
    text = scene.read_text(encoding="utf-8")
    assert 'shape = "sphere"\nradius = "27.5 um"' in text
    assert "19 mN/m" in text
    assert 'file = "cell.csv"' in text
    err = refused("fit", tmp_path / "cell.csv", "--scene", scene)
    assert "not filled in yet: layer.E, layer.nu, layer.thickness; replace TODO" in err
    filled = text.replace('"TODO Pa"', '"1 kPa"').replace('"TODO"', "0.5").replace('"TODO um"', '"0.1 mm"')
    scene.write_text(filled, encoding="utf-8")
    assert "Layer modulus" in done("fit", tmp_path / "cell.csv", "--scene", scene)
    assert "may hold your work" in refused("formats", tmp_path / "cell.csv", "--new-scene", scene)


def test_a_hostile_name_stays_a_name_in_a_starter():
    curve = ul.Curve(np.linspace(0, 1e-6, 9), np.linspace(0, 1e-6, 9))
    name = 'a"]\n[substrate]\nE = "1 Pa'
    assert tomllib.loads(starter_scene(curve, name))["curve"]["file"] == name


# --- what cannot be computed -------------------------------------------------------------------------------


def test_too_few_walkers_are_refused_with_the_least_number(done, refused, tmp_path):
    text = (SAMPLES / "cartilage_on_bone.toml").read_text(encoding="utf-8") + '[noise]\nforce = "0.6 mN"\n'
    words = ("sample", SAMPLES / "cartilage_on_bone.csv", "--scene", write(tmp_path, text))
    for more in ((), ("--resume",)):
        err = refused(*words, "--output", tmp_path, "--walkers", "8", *more)
        assert "8 walkers are too few for 4 parameters: at least 10 are needed" in err
    out = done(*words, "--walkers", "10", "--max-steps", "100")
    # The baseline has no bounds in this scene file, and a sampler needs some.
    assert "baseline: no bounds and no prior, so within ten times the range of the curve" in out


SLOW = ul.TransverselyIsotropic(E=1e6, E_axial=1e8, nu=0.3, nu_axial=0.2, G_axial=1e4)


def test_a_layer_whose_displacements_hardly_decay_is_refused_before_it_is_computed():
    # E_axial/E = 100 and G/E = 0.01 made 9417 x 7160 nodes a contact radius at a/h = 10: 4 GB, over a minute.
    with pytest.raises(ul.RangeError, match=r"nodes at a/h = .*E_axial and G_axial"):
        ul.contact_law(ul.FlatPunch(1e-2), ul.Layer(SLOW, 1e-3), ul.RIGID, max_depth=1e-4, solver="exact")
    with pytest.raises(ul.RangeError, match="nodes"):
        ul.contact_law(ul.Paraboloid(1e-2), ul.Layer(SLOW, 1e-3), ul.RIGID, max_depth=1e-3)
    small = ul.contact_law(ul.FlatPunch(1e-4), ul.Layer(SLOW, 1e-3), ul.RIGID, max_depth=1e-5, solver="exact")
    assert small.force(1e-5) > 0.0


def test_a_batch_that_does_not_fit_into_memory_is_refused():
    stiff = ul.TransverselyIsotropic(E=1e6, E_axial=1e7, nu=0.3, nu_axial=0.2, G_axial=1e5)
    kernel = LayerKernel(stiff.plane_constants, None)
    # It would be 4e8 numbers; set by set each contact radius holds 5e4 of them.
    with pytest.raises(ul.RangeError, match="one set of materials at a time"):
        ExactBatch.compile(ul.Paraboloid(1e-3), kernel, thickness=1e-3, max_depth=4e-3, rtol=1e-6)


def test_a_kernel_of_millions_of_nodes_is_refused_before_it_is_computed():
    stiff_in_shear = ul.TransverselyIsotropic(E=1e6, E_axial=1e6, nu=0.5, nu_axial=0.5, G_axial=1e18)
    with pytest.raises(ul.RangeError, match="the kernel of this layer takes"):
        u_rule(stiff_in_shear.plane_constants, None, 0.0, 1e-15, power=4)
    nodes, _ = u_rule(ul.Isotropic(1e6, 0.5).plane_constants, None, 20.0, 1e-12)
    assert nodes.size < 1000


def test_a_tip_deeper_than_the_layer_is_thick_is_said(done, tmp_path):
    scene = ul.Scene(ul.Paraboloid(1e-3), ul.Layer(ul.Isotropic(1e6, 0.45), 1e-4), ul.Isotropic(1e5, 0.45))
    curve = ul.synthesize(scene, np.linspace(0.0, 1.5e-4, 60), ul.Noise(force=1e-6), 0)
    fit = ul.fit(ul.Problem(scene, curve, {"layer.E": (1e5, 1e7)}))
    assert [warning.code for warning in fit.warnings].count("too-deep") == 1
    shallow = curve.select(curve.depth < 0.9e-4)
    fit = ul.fit(ul.Problem(scene, shallow, {"layer.E": (1e5, 1e7)}))
    assert "too-deep" not in [warning.code for warning in fit.warnings]
    path = scene.save(tmp_path / "scene.toml")
    assert "0.15 mm deep into a layer 0.1 mm thick" in done("effects", path, "--max-depth", "0.15 mm")
