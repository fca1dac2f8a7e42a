"""A draining layer at the front door: scene, scene file, forces, made curves, refusals."""

import numpy as np
import pytest

import underlay as ul
from underlay.scene.scene_file import scene_from_text
from underlay.scene.scene_writer import scene_text
from underlay.units import format_quantity

WATER = 1e-15


def wet(tip=None, drainage="solid", **beside):
    """A punch on cartilage 1 mm thick."""
    layer = ul.Layer(ul.Biphasic(0.5e6, 0.15, WATER), 1e-3)
    return ul.Scene(tip or ul.FlatPunch(0.5e-3), layer, ul.RIGID, drainage=drainage, **beside)


def fibrous(drainage="porous"):
    """The same with fibres along the surface."""
    material = ul.BiphasicTransverse(2e6, 0.4e6, 0.2, 0.1, 0.2e6, WATER, permeability_ratio=2.0)
    return ul.Scene(ul.FlatPunch(0.5e-3), ul.Layer(material, 1e-3), ul.RIGID, drainage=drainage)


def ramp_and_hold(depth, ramp, end, points=60):
    """Depths and times: points on the ramp, and as many in the hold, in even ratios."""
    time = np.concatenate((np.linspace(0.0, ramp, points), ramp + np.geomspace(ramp / 30.0, end, points)))
    return depth * np.minimum(time / ramp, 1.0), time


def test_ends_are_the_elastic_laws():
    depth, time = ramp_and_hold(5e-5, 1e-4, 1e7)
    for tip in (ul.FlatPunch(0.5e-3), ul.Sphere(5e-3)):
        scene = wet(tip)
        force = scene.force(depth, time)
        soft = scene.elastic.force(depth[-1:])
        stiff = ul.Scene(tip, ul.Layer(scene.layer.material.undrained, 1e-3), ul.RIGID).force(depth[-1:])
        assert force[-1] == pytest.approx(soft[0], rel=2e-5)
        assert force[59] == pytest.approx(stiff[0], rel=1e-2)


@pytest.mark.parametrize("scene", [wet(), wet(ul.Sphere(2e-3), "unknown"), fibrous(), fibrous("solid")])
def test_scene_files_round_trip(scene, tmp_path):
    assert scene_from_text(scene_text(scene)) == scene
    assert ul.load_scene(scene.save(tmp_path / "wet.toml")) == scene


def test_permeability_has_units():
    text = scene_text(wet()).replace('"1e-15 m^4/(N s)"', '"0.001 mm^4/(N s)"')
    assert scene_from_text(text).layer.material.permeability == 1e-15
    with pytest.raises(ul.UnitError, match=r"'m\^2' is not|unknown unit|is a unit of"):
        scene_from_text(text.replace("mm^4/(N s)", "mm"))


def test_keys_are_listed(done):
    out = done("keys")
    assert "permeability" in out
    assert "permeability_ratio" in out
    assert "drainage" in out


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: wet(drainage=None), "drainage must be one of 'solid', 'porous', 'unknown'; got None"),
        (lambda: wet(drainage="wet"), "got 'wet'"),
        (
            lambda: ul.Scene(ul.FlatPunch(1e-3), ul.Layer(ul.Isotropic(1e6, 0.3)), drainage="solid"),
            "is of a layer with a permeability",
        ),
        (lambda: wet(adhesion=ul.JKR(1e-3)), "simulated without adhesion; got JKR"),
        (lambda: wet(friction="stuck"), "stuck"),
        (lambda: wet(ul.Cone(1.0)).force([1e-6], [1.0]), "flat punches, spheres and paraboloids"),
        (
            lambda: ul.Scene(
                ul.FlatPunch(1e-3),
                ul.Layer(ul.Biphasic(1e6, 0.1, WATER), 1e-3),
                ul.Isotropic(1e9, 0.3),
                drainage="solid",
            ),
            "rigid base that lets no water through",
        ),
        (lambda: ul.Biphasic(1e6, 0.5, WATER), "at 0.5 no water moves"),
        (lambda: ul.Biphasic(1e6, 0.1, 0.0), "permeability must be"),
        (
            lambda: ul.BiphasicTransverse(1e6, 1e6, 0.5, 0.5, 0.3e6, WATER),
            r"nu_axial\^2 must be above zero; got 0",
        ),
        (lambda: ul.BiphasicTransverse(1e6, 1e6, 0.2, 0.1, 0.3e6, WATER, 0.0), "permeability_ratio must be"),
        (
            lambda: wet(ul.Sphere(2e-3)).force([0.0, 1.5e-3], [0.0, 1.0]),
            r"a depth of 0\.0015 m in a layer 0\.001 m thick is no small strain",
        ),
        (
            lambda: ul.Scene(
                ul.FlatPunch(1e-3),
                ul.Layer(ul.Biphasic(1e6, 0.1, WATER), relaxation=ul.PowerLawRelaxation(0.2)),
                drainage="solid",
            ),
            "a relaxation without a modulus at once",
        ),
    ],
)
def test_refusals(make, message):
    with pytest.raises(ul.UnderlayError, match=message):
        make()


def test_water_below_is_refused():
    below = ul.Stack([ul.Layer(ul.Biphasic(1e6, 0.1, WATER), 1e-3)])
    with pytest.raises(ul.InputError, match=r"substrate\.layers\[0\] drains"):
        ul.Scene(ul.FlatPunch(1e-3), ul.Layer(ul.Isotropic(1e6, 0.3), 1e-3), below)


def test_made_curves():
    depth, time = ramp_and_hold(5e-5, 20.0, 4000.0)
    scene = wet()
    clean = ul.simulate(scene, depth, time)
    noisy = ul.synthesize(scene, depth, ul.Noise(force=1e-4), rng=3, time=time)
    assert noisy.truth["layer.permeability"] == WATER
    assert np.std(noisy.force - clean.force) == pytest.approx(1e-4, rel=0.3)
    with pytest.raises(ul.InputError, match="needs the times"):
        ul.simulate(scene, depth)


def test_creep_and_relaxation_of_a_punch():
    # A load step creeps from the undrained depth to the drained one.
    time = np.geomspace(1e-3, 1e6, 60)
    scene = wet()
    depth = scene.depth(np.full(60, 0.05), time)
    assert np.all(np.diff(depth) > -1e-5 * depth[-1])
    assert scene.elastic.force(depth[-1:])[0] == pytest.approx(0.05, rel=1e-4)
    with pytest.raises(ul.InputError, match="for a flat punch only"):
        wet(ul.Sphere(2e-3)).depth([0.01, 0.01], [0.0, 1.0])


def test_a_skeleton_that_relaxes_besides():
    depth, time = ramp_and_hold(5e-5, 20.0, 1e6)
    plain = wet()
    layer = ul.Layer(plain.layer.material, 1e-3, relaxation=ul.Prony((0.4,), (100.0,)))
    both = ul.Scene(plain.indenter, layer, ul.RIGID, drainage="solid")
    assert both.force(depth, time)[-1] == pytest.approx(0.6 * plain.force(depth, time)[-1], rel=1e-4)


@pytest.mark.parametrize("tip", [ul.FlatPunch(0.5e-3), ul.Sphere(2e-3)])
def test_a_noisy_record_of_depth_moves_little(tip):
    depth, time = ramp_and_hold(2e-5, 20.0, 600.0, 400)
    noisy = depth + 1e-8 * np.random.default_rng(0).standard_normal(depth.size)
    scene = wet(tip)
    clean, found = scene.force(depth, time), scene.force(noisy, time)
    assert np.abs(found - clean).max() < 6e-3 * clean.max()


def test_permeabilities_are_printed_as_cartilage_laboratories_write_them():
    assert format_quantity(1.036e-15, "permeability", 7.7e-17) == "0.001036 ± 0.000077 mm^4/(N s)"
    assert format_quantity(5e-10, "diffusivity") == "500 um^2/s"
