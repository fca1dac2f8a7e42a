"""Stated uncertainties of the inputs of a test: in scene files, in Python, on the way back, and beside a fit."""

import copy
import pickle
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import underlay as ul

FILE = """
[indenter]
shape = "sphere"
radius = "1 mm"

[layer]
E = "0.4 MPa"
nu = 0.46
thickness = "1.5 mm"

[substrate]
E = "1 GPa"
nu = 0.3

[[substrate.layers]]
E = "20 MPa"
nu = 0.4
thickness = "100 um"

[instrument]
compliance = "1 um/N"
"""
ALL = {
    "indenter.radius": 2e-5,
    "layer.nu": 0.02,
    "layer.thickness": 0.0,
    "substrate.layers[0].E": 2e6,
    "substrate.E": 1e8,
    "instrument.compliance": 1e-7,
    "force": 0.02,
    "depth": 0.01,
    "spring_constant": 0.1,
}


def read(tmp_path, *changes, more=""):
    text = FILE
    for old, new in changes:
        assert old in text
        text = text.replace(old, new, 1)
    path = tmp_path / "scene.toml"
    path.write_text(text + more, encoding="utf-8")
    return ul.load_scene(path)


def bare():
    return ul.Scene(
        ul.Sphere(1e-3),
        ul.Layer(ul.Isotropic(4e5, 0.46), 1.5e-3),
        ul.Stack([ul.Layer(ul.Isotropic(2e7, 0.4), 1e-4)], ul.Isotropic(1e9, 0.3)),
        ul.Instrument(compliance=1e-6),
    )


@pytest.mark.parametrize(
    ("written", "size"),
    [
        ("1 mm +- 0.02 mm", 2e-5),
        ("1 mm ± 20 um", 2e-5),
        ("1 mm +/- 2 %", 2e-5),
        ("1 mm ±2%", 2e-5),
        ("1 mm exact", 0.0),
    ],
)
def test_a_number_says_how_well_it_is_known(tmp_path, written, size):
    scene = read(tmp_path, ('"1 mm"', f'"{written}"'))
    assert scene.indenter.radius == 1e-3
    assert scene.uncertainties == {"indenter.radius": size}
    assert replace(scene, uncertainties=None) == bare()


def test_every_input_may_say_it_beside_itself_or_in_a_table(tmp_path):
    beside = read(
        tmp_path,
        ('"1 mm"', '"1 mm +- 0.02 mm"'),
        ("0.46", '"0.46 +- 0.02"'),
        ('"1.5 mm"', '"1.5 mm exact"'),
        ('"20 MPa"', '"20 MPa ± 10 %"'),
        ('"1 GPa"', '"1 GPa ± 0.1 GPa"'),
        ('"1 um/N"', '"1 um/N ± 10 %"'),
        more='[uncertainties]\nforce = "2 %"\ndepth = 0.01\nspring_constant = "10 %"\n',
    )
    assert dict(beside.uncertainties) == pytest.approx(ALL, rel=1e-15)
    table = """[uncertainties]
    indenter.radius = "0.02 mm"
    layer = { nu = 0.02, thickness = "exact" }
    "substrate.layers[0].E" = "10 %"
    substrate.E = "0.1 GPa"
    instrument.compliance = "0.1 um/N"
    force = "2 %"
    depth = "1 %"
    spring_constant = "10 %"
    """
    assert dict(read(tmp_path, more=table).uncertainties) == pytest.approx(ALL, rel=1e-15)
    assert dict(ul.Scene.with_values(beside, {"layer.E": 1e6}).uncertainties) == dict(beside.uncertainties)


def test_none_and_nothing(tmp_path):
    assert read(tmp_path).uncertainties is None
    path = tmp_path / "scene.toml"
    path.write_text('uncertainties = "none"\n' + FILE, encoding="utf-8")
    scene = ul.load_scene(path)
    assert scene.uncertainties == "none"
    assert ul.load_scene(scene.save(tmp_path / "saved.toml")) == scene
    assert replace(bare(), uncertainties={}).uncertainties is None
    counted = replace(bare(), uncertainties={"layer.E": np.int64(3), "depth": np.float32(0.5)}).uncertainties
    assert counted == {"layer.E": 3.0, "depth": 0.5}


sizes = st.one_of(st.just(0.0), st.floats(1e-30, 1e30))
shares = st.floats(0.0, 1.0).filter(lambda share: share == 0.0 or share > 1e-30)


@given(
    st.fixed_dictionaries(
        {},
        optional={
            **dict.fromkeys(
                ("indenter.radius", "layer.nu", "substrate.layers[0].E", "instrument.compliance"), sizes
            ),
            **dict.fromkeys(("force", "depth", "spring_constant"), shares),
        },
    )
)
def test_what_is_saved_reads_back_to_the_last_bit(tmp_path_factory, rows):
    scene = replace(bare(), uncertainties=rows)
    again = ul.load_scene(scene.save(tmp_path_factory.mktemp("scene") / "scene.toml"))
    assert again == scene
    assert dict(again.uncertainties or {}) == rows


def test_they_are_frozen_and_travel_with_the_scene():
    given = {"indenter.radius": 2e-5}
    scene = replace(bare(), uncertainties=given)
    given["indenter.radius"] = 1.0
    assert scene.uncertainties == {"indenter.radius": 2e-5}
    with pytest.raises(TypeError):
        scene.uncertainties["indenter.radius"] = 1.0
    # What a worker of a map is sent.
    assert pickle.loads(pickle.dumps(scene)) == copy.deepcopy(scene) == scene  # noqa: S301  our own
    assert hash(scene) == hash(copy.deepcopy(scene))


def test_another_scene_keeps_the_rows_of_the_numbers_it_has():
    scene = replace(
        bare(), uncertainties={"indenter.radius": 2e-5, "layer.thickness": 1e-5, "substrate.E": 1e8}
    )
    half_space = replace(scene, layer=ul.Layer(scene.layer.material), substrate=None)
    assert half_space.uncertainties == {"indenter.radius": 2e-5}
    assert "thickness" in scene.effects(1e-4).to_string()


@pytest.mark.parametrize(
    ("given", "message"),
    [
        ({"indenter.radus": 1e-5}, r"no parameter 'indenter.radus'; did you mean 'indenter.radius'\?"),
        ({"forse": 0.01}, r"did you mean 'force'\?"),
        ({"layer.E_axial": 1.0}, "no parameter 'layer.E_axial'"),
        (
            {"indenter.radius": -1e-5},
            r"indenter.radius must be zero \(exact\) or more and finite \(m\); got -1e-05",
        ),
        ({"layer.E": np.nan}, r"layer.E must be zero \(exact\) or more and finite \(Pa\); got nan"),
        ({"layer.E": "2 %"}, r"layer.E must be .*; got '2 %'"),
        ({"force": 2.0}, r'force is a share, such as 0.02 or "2 %"; got 2.0'),
        ({"instrument.baseline": 1e-9}, r"instrument.baseline takes none; .* a prior under \[fit\]"),
        ("nothing", "uncertainties must be a mapping such as"),
        (0.02, "uncertainties must be a mapping such as"),
    ],
)
def test_each_mistake_in_python_has_its_line(given, message):
    with pytest.raises(ul.InputError, match=message) as caught:
        replace(bare(), uncertainties=given)
    assert "\n" not in str(caught.value)


def test_a_half_space_has_no_thickness_to_be_unsure_of():
    with pytest.raises(ul.InputError, match=r"layer\.thickness is infinite in this scene"):
        ul.Scene(ul.Sphere(1e-3), ul.Layer(ul.Isotropic(1e6, 0.3)), uncertainties={"layer.thickness": 1e-5})
    with pytest.raises(ul.InputError, match=r"lever\.spring_constant takes none; .* spring_constant"):
        ul.Scene(
            ul.Sphere(1e-3),
            ul.Layer(ul.Isotropic(1e6, 0.3)),
            lever=ul.Lever(0.04),
            uncertainties={"lever.spring_constant": 0.01},
        )


@pytest.mark.parametrize(
    ("old", "new", "more", "message"),
    [
        ('"1 mm"', '"1 mm +- 0.02"', "", r"\[indenter\] radius: '0.02' has no unit"),
        ('"1 mm"', '"1 mm +- 0.02 s"', "", r"\[indenter\] radius: 's' is a unit of time"),
        ('"1 mm"', '"1 mm +- -2 %"', "", r"\[indenter\] radius: indenter.radius must be zero \(exact\)"),
        ('"1 mm"', '"1 mm ± "', "", r"\[indenter\] radius: a length must be given"),
        ('"1 mm"', '"1 parsnip ± 2 %"', "", r"\[indenter\] radius.*unknown unit 'parsnip'"),
        ('"1 um/N"', '"0 um/N ± 2 %"', "", r"\[instrument\] compliance: a percentage of zero"),
        (
            "[instrument]",
            '[instrument]\nbaseline = "1 uN ± 2 %"',
            "",
            "instrument.baseline takes none",
        ),
        (
            '"1 mm"',
            '"1 mm ± 2 %"',
            '[uncertainties]\nindenter.radius = "2 %"',
            r"\[indenter\] radius: its uncertainty is stated twice",
        ),
        ("", "", '[uncertainties]\nindenter.radus = "2 %"', r"did you mean 'indenter.radius'\?"),
        ("", "", '[uncertainties]\nforce = "2 N"', r"\[uncertainties\] force: 'N' is a unit of force"),
        ("", "", "[uncertainties]\nlayer.E = 3", r"\[uncertainties\] layer.E: '?3'? has no unit"),
        (
            "\n[indenter]",
            'uncertainties = "all"\n[indenter]',
            "",
            'write uncertainties = "none", or a section',
        ),
        (
            '\n[indenter]\nshape = "sphere"\nradius = "1 mm"',
            'uncertainties = "none"\n[indenter]\nshape = "sphere"\nradius = "1 mm ± 2 %"',
            "",
            r'\[indenter\] radius: an uncertainty beside uncertainties = "none"',
        ),
        (
            'radius = "1 mm"',
            "",
            '[uncertainties]\nindenter.radius = "2 %"',
            "a percentage of a number that the file of the curve says",
        ),
    ],
)
def test_each_mistake_in_a_scene_file_has_its_line(tmp_path, old, new, more, message):
    with pytest.raises(ul.InputError, match=message):
        read(tmp_path, (old, new), more=more)


def test_what_is_fitted_is_stated_as_a_prior():
    scene = ul.Scene(
        ul.Sphere(1e-3),
        ul.Layer(ul.Isotropic(1e6, 0.45), 1e-3),
        ul.RIGID,
        uncertainties={"layer.thickness": 1e-5, "indenter.radius": 0.0},
    )
    curve = ul.synthesize(
        replace(scene, uncertainties=None), np.linspace(0.0, 5e-5, 60), ul.Noise(force=1e-6), 0
    )
    message = "layer.thickness is free and has an uncertainty: state it as a prior of the fit"
    with pytest.raises(ul.InputError, match=message):
        ul.Problem(scene, curve, ["layer.E", "layer.thickness"])
    with pytest.raises(ul.InputError, match=r"indenter\.radius is free and has"):
        ul.Problem(scene, curve, ["layer.E", "indenter.radius"])
    problem = ul.Problem(scene, curve, ["layer.E"])
    assert problem.scenes(problem.start)[0].uncertainties == scene.uncertainties
    assert "indenter.radius" in ul.fit(problem).sensitivity["layer.E"]


def test_they_are_listed_with_the_keys(run):
    code, out, err = run("keys", "uncertainties")
    assert code == 0, err
    assert all(key in out for key in ("PATH", "force", "depth", "spring_constant", "1 mm ± 2 %"))
