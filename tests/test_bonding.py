"""Bonded or free to slip: one curve under both, in Python, on the command line and on the page."""

from dataclasses import replace

import numpy as np
import pytest

import underlay as ul
from underlay.report.limits import bonds_sentences

GEL = ul.Scene(ul.Paraboloid(1e-3), ul.Layer(ul.Isotropic(2e3, 0.5), 0.3e-3, bond="slip"), ul.RIGID)
HALF_SPACE = ul.Scene(GEL.indenter, ul.Layer(GEL.layer.material))
FREE = {"layer.E": ul.LogUniform(1e1, 1e6)}


def posed(scene, noise=0.002, depth=6e-5, **changes):
    """A problem on a curve of the scene, whose own bond may then be forgotten."""
    depths = np.linspace(0.0, depth, 60)
    force = float(scene.force(depth))
    curve = ul.synthesize(scene, depths, ul.Noise(force=noise * force), rng=1)
    return ul.Problem(replace(scene, **changes), curve, free=FREE, noise=ul.Noise(force=noise * force))


@pytest.fixture(scope="module")
def told():
    return ul.compare_bonds(posed(GEL, layer=replace(GEL.layer, bond="bonded")))


def test_the_face_that_made_the_curve_is_found(told):
    bonded, slipping = (told.fits[name] for name in ("bonded", "slipping"))
    assert told.difference < -10.0
    assert abs(slipping.values["layer.E"] - 2e3) < 4.0 * slipping.stderr["layer.E"]
    # Bonded the layer is stiffer: the same force asks for a smaller modulus.
    assert bonded.values["layer.E"] < 0.85 * slipping.values["layer.E"]


def test_each_fit_is_that_of_its_own_scene(told):
    for name, bond in (("bonded", "bonded"), ("slipping", "slip")):
        scene = replace(GEL, layer=replace(GEL.layer, bond=bond))
        alone = ul.fit(told.fits[name].problem.revised(scenes=[scene]))
        assert told.fits[name].values["layer.E"] == pytest.approx(alone.values["layer.E"], rel=1e-9)


def test_both_values_stand_in_one_sentence(told):
    first, second = bonds_sentences(told)
    assert first.startswith("bonded: layer modulus ")
    assert "; slipping: layer modulus " in first
    assert first.endswith("(95 % intervals).")
    assert "favour the slipping face" in second
    frame = told.to_frame()
    assert frame["face"].tolist() == ["bonded", "slipping"]
    assert ((frame["low"] < frame["value"]) & (frame["value"] < frame["high"])).all()
    assert frame["AIC"].min() == 0.0


def test_a_shallow_curve_does_not_tell_and_says_so():
    problem = posed(GEL, noise=0.05, depth=3e-6)
    told = ul.compare_bonds(problem)
    assert "do not show which" in bonds_sentences(told)[1]
    values = {name: fit.values["layer.E"] for name, fit in told.fits.items()}
    assert values["bonded"] < values["slipping"]


def test_the_fit_at_hand_is_not_made_again():
    fit = ul.fit(posed(GEL))
    told = ul.compare_bonds(fit)
    assert told.fits["slipping"] is fit
    assert told.fits["bonded"] is not fit


def test_a_deeper_face():
    stack = ul.Stack([ul.Layer(ul.Isotropic(2e5, 0.49), 1e-4)], ul.RIGID)
    scene = ul.Scene(GEL.indenter, replace(GEL.layer, bond="bonded"), stack)
    told = ul.compare_bonds(posed(scene), face="substrate.layers[0]")
    assert told.fits["slipping"].problem.base_scenes[0].substrate.layers[0].bond == "slip"
    assert told.fits["slipping"].problem.base_scenes[0].layer.bond == "bonded"


@pytest.mark.parametrize(
    ("scene", "face", "message"),
    [
        (GEL, "substrate.layers[0]", "such faces here: layer"),
        (GEL, "base", "no layer 'base'"),
        (HALF_SPACE, "layer", "such faces here: none"),
    ],
)
def test_a_face_that_is_not_there_is_refused(scene, face, message):
    with pytest.raises(ul.InputError, match=message):
        ul.compare_bonds(posed(scene), face)


# --- a bond that nobody knows ----------------------------------------------------------------------------

UNKNOWN = replace(GEL, layer=replace(GEL.layer, bond="unknown"))


@pytest.fixture(scope="module")
def unknown():
    """A slipping gel, of which the scene says that its bond is unknown."""
    return ul.fit(posed(GEL, layer=UNKNOWN.layer))


def test_an_unknown_bond_is_computed_as_bonded_and_its_file_says_unknown(tmp_path):
    depth = np.linspace(-1e-5, 6e-5, 5)
    bonded = replace(GEL, layer=replace(GEL.layer, bond="bonded"))
    assert UNKNOWN.force(depth).tolist() == bonded.force(depth).tolist()
    assert ul.load_scene(UNKNOWN.save(tmp_path / "gel.toml")) == UNKNOWN
    row = UNKNOWN.effects(6e-5).set_index("effect").loc["bond of the layer"]
    assert row["size_percent"] == pytest.approx(100.0 * (GEL.force(6e-5) / bonded.force(6e-5) - 1.0))
    assert not row["simulated"]


def test_the_command_prints_both(done, tmp_path):
    problem = posed(GEL)
    curve = problem.curves[0]
    table = np.column_stack([curve.depth * 1e6, curve.force * 1e6])
    np.savetxt(tmp_path / "gel.csv", table, delimiter=",", header="depth (um),force (uN)", comments="")
    GEL.save(tmp_path / "gel.toml")
    with (tmp_path / "gel.toml").open("a", encoding="utf-8") as file:
        file.write('\n[fit]\nlayer.E = { min = "10 Pa", max = "1 MPa" }\n')
    words = ("--scene", tmp_path / "gel.toml", "--output", tmp_path)
    out = done("compare", tmp_path / "gel.csv", *words)
    assert "bonded: layer modulus" in out
    assert "; slipping: layer modulus" in out
    bonds = (tmp_path / "gel.bonds.csv").read_text(encoding="utf-8")
    assert bonds.startswith("face,parameter,value,low,high")
    assert "exact" in (tmp_path / "gel.laws.csv").read_text(encoding="utf-8")
