"""Only the effects a scene calls for: their sizes, and that what is off runs none of its code."""

from dataclasses import replace

import matplotlib.pyplot as plt
import numpy as np
import pytest

import underlay as ul
from support.call_counter import count_calls
from underlay.mechanics import materials
from underlay.mechanics.exact import law as exact
from underlay.mechanics.response import Remembered
from underlay.mechanics.viscoelastic.history import Viscoelastic
from underlay.report import plots
from underlay.scene.effects import effect_sizes
from underlay.scene.instrument import Baseline, Frame

GEL = ul.Isotropic(1e4, 0.45)
DEPTH = 5e-5
EFFECTS = (
    "finite thickness",
    "substrate compliance",
    "anisotropy",
    "true sphere",
    "instrument compliance",
    "baseline",
    "adhesion",
    "friction",
    "finite strain",
    "relaxation",
    "history",
)
PLAIN = ul.Scene(ul.Paraboloid(1e-3), ul.Layer(GEL))
FIBROUS = ul.TransverselyIsotropic(E=2e4, E_axial=1e4, nu=0.3, nu_axial=0.2, G_axial=4e3)
#: Each effect alone, put into the plain scene.
ALONE = {
    "finite thickness": replace(PLAIN, layer=ul.Layer(GEL, 1e-3), substrate=ul.RIGID),
    "substrate compliance": replace(PLAIN, layer=ul.Layer(GEL, 1e-3), substrate=ul.Isotropic(1e5, 0.3)),
    "anisotropy": replace(PLAIN, layer=ul.Layer(FIBROUS)),
    "true sphere": replace(PLAIN, indenter=ul.Sphere(1e-3)),
    "instrument compliance": replace(PLAIN, instrument=ul.Instrument(compliance=1e-2)),
    "baseline": replace(PLAIN, instrument=ul.Instrument(baseline=1e-5, baseline_slope=0.1)),
}


def code_of_each_effect(monkeypatch):
    """Counters at the one place each effect's code must pass through."""
    sphere = ("surface", "abel", "abel_slope", "abel_moments", "halfspace_radius", "halfspace_force")
    return {
        "finite thickness": count_calls(monkeypatch, exact, "known_curve"),
        "anisotropy": count_calls(monkeypatch, materials, "transversely_isotropic_constants"),
        "true sphere": count_calls(monkeypatch, ul.Sphere, *sphere),
        "instrument compliance": count_calls(monkeypatch, Frame, "tip_depth", "share"),
        "baseline": count_calls(monkeypatch, Baseline, "reading"),
        "history": count_calls(monkeypatch, Remembered, "force"),
        "relaxation": count_calls(monkeypatch, Viscoelastic, "prepared", "force"),
    }


@pytest.mark.parametrize("name", [None, *ALONE])
def test_an_effect_that_is_off_runs_none_of_its_code(name, monkeypatch):
    scene = PLAIN if name is None else ALONE[name]
    counters = code_of_each_effect(monkeypatch)
    scene.force(np.linspace(0.0, DEPTH, 20))
    on = {name} | ({"finite thickness"} if name == "substrate compliance" else set())
    for effect, counter in counters.items():
        assert (counter.calls > 0) == (effect in on), effect


def test_a_layer_below_the_tolerance_is_not_simulated():
    scene = ALONE["finite thickness"]
    shallow, deep = 1e-16, DEPTH
    assert not row(scene, "finite thickness", shallow).simulated
    assert row(scene, "finite thickness", shallow).cost_percent == 0.0
    assert row(scene, "finite thickness", deep).simulated
    # The anisotropy of a base that is not felt is not simulated either.
    base = replace(scene, substrate=FIBROUS)
    assert not row(base, "anisotropy", shallow).simulated
    assert row(base, "anisotropy", deep).simulated


def row(scene, name, depth=DEPTH):
    table = scene.effects(depth)
    return table.set_index("effect").loc[name]


@pytest.mark.parametrize("name", ALONE)
def test_each_effect_is_found_alone(name):
    table = ALONE[name].effects(DEPTH).set_index("effect")
    assert tuple(table.index) == EFFECTS
    also = {"substrate compliance": {"finite thickness"}}.get(name, set())
    assert set(table.index[table.simulated]) == {name} | also
    assert np.isfinite(table.size_percent[name])
    assert table.size_percent[name] != 0.0
    assert (table.cost_percent[~table.simulated] == 0.0).all()


def test_sizes_are_those_of_the_laws():
    depth = np.array([DEPTH])
    plain = float(PLAIN.force(depth)[0])
    sizes = {name: row(scene, name).size_percent / 100.0 for name, scene in ALONE.items()}
    layered = ALONE["finite thickness"]
    assert sizes["finite thickness"] == pytest.approx(float(layered.force(depth)[0]) / plain - 1.0, rel=1e-9)
    # To first order in w/R a true sphere is w/(10 R) softer than its paraboloid.
    assert sizes["true sphere"] == pytest.approx(-DEPTH / 1e-2, rel=0.05)
    # A frame of compliance C takes w - C P of the travel w: P falls by 3/2 C P/w, to first order in C.
    soft = replace(PLAIN, instrument=ul.Instrument(compliance=1e-6))
    stiffness = plain / DEPTH
    assert row(soft, "instrument compliance").size_percent / 100.0 == pytest.approx(
        -1.5e-6 * stiffness, rel=1e-5 * 1.5 * stiffness
    )
    assert sizes["baseline"] == pytest.approx((1e-5 + 0.1 * DEPTH) / plain, rel=1e-12)


def test_a_baseline_does_not_change_the_other_sizes():
    scene = ALONE["finite thickness"]
    tilted = replace(scene, instrument=ul.Instrument(contact_depth=1e-4, baseline=1.0, baseline_slope=3.0))
    for name in ("finite thickness", "true sphere"):
        assert row(tilted, name).size_percent == pytest.approx(row(scene, name).size_percent, rel=1e-9)


def test_the_paraboloid_says_what_the_sphere_would_change_without_simulating_it():
    found = row(PLAIN, "true sphere")
    assert not found.simulated
    assert found.size_percent == pytest.approx(
        row(ALONE["true sphere"], "true sphere").size_percent, rel=1e-9
    )
    assert np.isnan(row(replace(PLAIN, indenter=ul.Cone(1.2)), "true sphere").size_percent)


def test_an_effect_below_the_tolerance_says_so_and_the_law_is_named():
    scene = replace(ALONE["finite thickness"], substrate=ul.Isotropic(1e9, 0.3))
    table = scene.effects(DEPTH, solver=ul.Auto(1e-2))
    note = table.set_index("effect").loc["substrate compliance", "note"]
    assert "below rtol = 0.01" in note
    assert table.attrs["law"].startswith(("exact: ", "asymptotic: "))


def test_what_cannot_be_compared_is_not_measured_and_says_why():
    # No sphere goes ten times its radius deep, a paraboloid does.
    deep = 1e-2
    found = row(PLAIN, "true sphere", deep)
    assert np.isnan(found.size_percent)
    assert "not measured" in found.note
    assert "indenter's shape" in found.note
    assert "true sphere" not in effect_sizes(PLAIN, np.array([deep / 2, deep]))


@pytest.mark.parametrize("depth", [0.0, -1e-6, np.nan, np.inf])
def test_a_depth_that_is_no_contact_is_refused(depth):
    with pytest.raises(ul.InputError, match="max_depth must be positive"):
        PLAIN.effects(depth)


def test_sizes_along_the_curve_end_where_the_table_stands():
    scene = ALONE["substrate compliance"]
    sizes = effect_sizes(scene, np.array([DEPTH / 10, DEPTH]))
    known = ["finite thickness", "substrate compliance", "true sphere", "friction"]
    assert list(sizes.columns) == ["depth", *known]
    table = scene.effects(DEPTH).set_index("effect")
    for name in known:
        # Laws of 1e-6 that reach as deep are the same; what they make of a tenth of a per cent is not.
        rounding = 2e-4 if name == "friction" else 0.0
        assert 100.0 * sizes[name].iloc[-1] == pytest.approx(table.size_percent[name], rel=1e-5, abs=rounding)
    # The layer is felt in proportion to a/h, so to the root of the depth.
    assert sizes["finite thickness"].iloc[1] / sizes["finite thickness"].iloc[0] > 10.0**0.5


@pytest.mark.parametrize(
    "scene", [ALONE["substrate compliance"], replace(PLAIN, indenter=ul.FlatPunch(1e-4))]
)
def test_the_picture_has_a_line_for_every_known_effect(scene):
    drawn = plots.effects(scene)
    lines = [line for line in drawn.get_lines() if not line.get_label().startswith("_")]
    known = [name for name in EFFECTS if np.isfinite(row(scene, name, 1e-5).size_percent)]
    assert [line.get_label().split(" (")[0] for line in lines] == known
    assert "depth since contact" in drawn.get_xlabel()
    plt.close(drawn.figure)


SCENE_FILE = """
[indenter]
shape = "sphere"
radius = "1 mm"

[layer]
E = "10 kPa"
nu = 0.45
thickness = "1 mm"

[substrate]
rigid = true
"""


def test_the_command_prints_and_writes_the_table(done, tmp_path):
    scene = tmp_path / "gel.toml"
    scene.write_text(SCENE_FILE)
    words = ("--max-depth", "50 um", "--rtol", "1e-3", "--output", tmp_path / "o")
    assert "finite thickness" in done("effects", scene, *words)
    columns = (tmp_path / "o" / "gel.effects.csv").read_text().splitlines()[0]
    assert columns == "effect,size_percent,simulated,cost_percent,E_percent,h_percent,fit_cost_percent,note"
    assert (tmp_path / "o" / "gel.effects.png").read_bytes().startswith(b"\x89PNG")


@pytest.mark.parametrize(
    ("options", "words"),
    [(["--max-depth", "-1 um"], "positive"), (["--max-depth", "1 kPa"], "length")],
)
def test_the_command_refuses_in_one_line(refused, tmp_path, options, words):
    scene = tmp_path / "gel.toml"
    scene.write_text(SCENE_FILE)
    assert words in refused("effects", scene, *options)
