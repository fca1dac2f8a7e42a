"""Continuous stiffness of films: made from the law and found again; and loadings that no elastic law holds for."""

import re

import numpy as np
import pandas as pd
import pytest

import underlay as ul
from support.films import FILM, WORN, made_test, write_films
from underlay.data.export import curve_csv
from underlay.data.withdrawal import imprint_of
from underlay.inference.films import DIAMOND
from underlay.inference.from_files import require_elastic
from underlay.report.scene_tables import film_moduli, film_table


@pytest.mark.parametrize("free", [("layer.E",), ("layer.E", "substrate.E")])
def test_a_made_test_gives_its_moduli_back(free):
    start = FILM.with_values({"layer.E": 50e9, **({"substrate.E": 140e9} if len(free) > 1 else {})})
    found = ul.fit_stiffness(made_test(), start, free=free, area=WORN)
    # The law at 1e-4 and the cubic between its radii; two moduli hang together about ten times as much.
    for path in free:
        assert found.values[path] == pytest.approx(
            FILM.parameters[path], rel=1e-3 if len(free) == 1 else 1e-2
        )
    assert found.scatter < 1e-3
    assert found.scene.parameters["layer.E"] == found.values["layer.E"]
    np.testing.assert_allclose(found.table["layer modulus"], 70e9, rtol=5e-3)


def test_on_a_half_space_it_is_the_formula_of_oliver_and_pharr():
    scene = ul.Scene(ul.Cone.berkovich(), ul.Layer(ul.Isotropic(72e9, 0.17)))
    curve = made_test(scene)
    found = ul.fit_stiffness(curve, scene.with_values({"layer.E": 40e9}), area=WORN)
    S, P = curve.columns["contact_stiffness"], curve.force
    reduced = np.sqrt(np.pi / WORN.area(curve.depth - 0.75 * P / S)) * S / 2.0 / 1.05
    E = (1.0 - 0.17**2) / (1.0 / reduced - 1.0 / DIAMOND)
    np.testing.assert_allclose(found.table["half-space modulus"], E, rtol=1e-9)
    assert found.values["layer.E"] == pytest.approx(72e9, rel=1e-4)


def test_the_interval_is_that_of_a_test_as_a_whole():
    """Twice the scatter is twice the width in the logarithm, whatever the number of depths."""
    widths = []
    for scatter, count in ((0.01, 12), (0.02, 12), (0.01, 24)):
        found = ul.fit_stiffness(made_test(scatter=scatter, count=count), FILM, area=WORN)
        widths.append(np.log(found.high["layer.E"] / found.low["layer.E"]))
    assert widths[1] == pytest.approx(2.0 * widths[0], rel=1e-3)
    assert widths[2] == pytest.approx(widths[0], rel=0.05)
    silent = ul.fit_stiffness(made_test(), FILM, area=WORN)
    assert (silent.low["layer.E"], silent.high["layer.E"]) == (0.0, np.inf)


def test_the_picture_names_its_band_and_the_line_of_the_fit():
    found = ul.fit_stiffness(made_test(scatter=0.01), FILM, area=WORN)
    ax = ul.plots.film(found)
    names = [text.get_text() for text in ax.get_legend().get_texts()]
    # The whole test's interval is a mean over the depths of what the noise of each leaves.
    told = np.log(found.high["layer.E"] / found.values["layer.E"])
    band = 1.96 * (found.table["layer modulus noise"] / found.table["layer modulus"])
    assert band.min() < told < band.max()
    top = ax.collections[0].get_paths()[0].get_extents().y1 * 1e9
    assert top == pytest.approx((found.table["layer modulus"] * np.exp(band)).max(), rel=1e-6)
    assert names == ["half-space formula", "noise, 95 %", "film, base in the model", "fit"]


def test_what_the_area_does_is_said_before_it_is_known():
    curve = made_test()
    found = ul.fit_stiffness(curve, FILM, area=WORN)
    larger = ul.AreaFunction(tuple(1.02 * value for value in WORN.coefficients))
    moved = ul.fit_stiffness(curve, FILM, area=larger).values["layer.E"]
    assert np.log(moved / found.values["layer.E"]) / np.log(1.02) == pytest.approx(
        found.area_sensitivity["layer.E"], rel=0.03
    )
    assert -1.3 < found.area_sensitivity["layer.E"] < -0.5


def test_an_area_function_is_found_on_a_sample_of_known_modulus():
    contact = np.geomspace(30e-9, 1e-6, 40)
    S = 1.05 * 2.0 / np.sqrt(np.pi) * 70e9 * np.sqrt(WORN.area(contact))
    found = ul.AreaFunction.calibrated(contact, S, modulus=70e9)
    np.testing.assert_allclose(found.area(contact), WORN.area(contact), rtol=1e-8)
    assert found.coefficients[0] == pytest.approx(24.5, rel=1e-6)


def test_bad_requests_are_named():
    plain = ul.Curve(np.linspace(0.0, 1e-6, 50), np.linspace(0.0, 1e-3, 50))
    with pytest.raises(ul.CurveError, match="no contact stiffness"):
        ul.fit_stiffness(plain, FILM)
    ball = ul.Scene(ul.Sphere(1e-6), FILM.layer, FILM.substrate)
    with pytest.raises(ul.InputError, match="equivalent cone"):
        ul.fit_stiffness(made_test(), ball)
    with pytest.raises(ul.CurveError, match="only 0 points"):
        ul.fit_stiffness(made_test(), FILM, depths=(1e-6, 2e-6))
    with pytest.raises(ul.ParameterError, match=r"layer\.e"):
        ul.fit_stiffness(made_test(), FILM, free=("layer.e",))
    for coefficients in ((), (0.0,), (24.5, np.nan)):
        with pytest.raises(ul.InputError, match="area function begins"):
            ul.AreaFunction(coefficients)
    with pytest.raises(ul.InputError, match="calibration needs"):
        ul.AreaFunction.calibrated([1e-7, 2e-7], [1.0, 2.0], modulus=1e9)


# --- loadings that are not elastic -----------------------------------------------------------------------------


def imprinted(left, points=80):
    """A cone's loading to 1 um, and a way out that ends at `left` of it."""
    into = np.linspace(0.0, 1e-6, points)
    out = np.linspace(1e-6, left * 1e-6, points)
    back = np.maximum((out - left * 1e-6) / (1e-6 - left * 1e-6), 0.0) ** 1.5
    depth, force = np.concatenate((into, out)), np.concatenate(((into / 1e-6) ** 2, back)) * 1e-2
    return ul.Curve(depth, force, np.arange(2.0 * points), np.repeat(["loading", "unloading"], points))


def test_an_imprint_is_read_from_what_is_left_and_from_how_it_springs_back():
    elastic = imprinted(0.0)
    mirrored = ul.Curve(
        elastic.depth, np.maximum(elastic.depth / 1e-6, 0.0) ** 2, elastic.time, elastic.segment
    )
    assert imprint_of(mirrored).residual == pytest.approx(0.0, abs=0.02)
    assert imprint_of(mirrored).reason == ""
    told = imprint_of(imprinted(0.7))
    # A tenth of the force is left where 0.1^(2/3) of the way out is to go; the way in had it at 0.1^(1/2).
    assert told.residual == pytest.approx(0.7 + 0.3 * 0.1 ** (2.0 / 3.0) - 0.1**0.5, abs=0.02)
    assert told.exponent == pytest.approx(2.0, rel=1e-6)
    assert "the way out lies 45 % of the depth beyond the way in" in told.reason
    plastic = imprint_of(made_test(count=40))
    assert plastic.stiffening > 1.2
    assert "springs back" in plastic.reason
    assert np.isnan(plastic.residual)


def test_an_elastic_test_with_stiffness_speaks_against_nothing():
    scene = ul.Scene(ul.Cone.berkovich(), ul.Layer(ul.Isotropic(70e9, 0.18)))
    depth = np.linspace(1e-8, 1e-6, 60)
    law = scene.contact_law(1e-6)
    curve = ul.Curve(depth, law.force(depth), columns={"contact_stiffness": law.stiffness(depth)})
    told = imprint_of(curve)
    assert told.stiffening == pytest.approx(1.0, rel=1e-6)
    assert told.reason == ""


TOML = """
[indenter]
shape = "{shape}"
{size}

[layer]
E = "70 GPa"
nu = 0.18

[curve]
{more}

[fit]
layer.E = {{ min = "1 MPa", max = "500 GPa" }}
"""


def test_an_elastic_fit_of_an_imprint_is_refused_with_the_reason(tmp_path):
    curve, scene = tmp_path / "imprint.csv", tmp_path / "scene.toml"
    curve.write_text(curve_csv(imprinted(0.7)), encoding="utf-8")
    cone = {"shape": "cone", "size": 'half_angle = "70.3 deg"'}
    scene.write_text(TOML.format(**cone, more=""), encoding="utf-8")
    with pytest.raises(
        ul.CurveError, match=r"elastoplastic, .* \d+ % of the depth.*exponent of the loading 2\.00"
    ):
        ul.load_problem(curve, scene)
    row = ul.fit_many([curve], scene, workers=0).iloc[0]
    assert row["status"] == "failed"
    assert "elastoplastic" in row["reason"]
    scene.write_text(TOML.format(**cone, more='overrule = ["imprint"]'), encoding="utf-8")
    assert len(ul.load_problem(curve, scene).curves[0]) == 80
    # A ball leaves nothing on the same words: soft samples come back late, and that is no plasticity.
    scene.write_text(TOML.format(shape="sphere", size='radius = "10 um"', more=""), encoding="utf-8")
    assert len(ul.load_problem(curve, scene).curves[0]) == 80


def test_a_layer_that_relaxes_may_come_back_late():
    curve = imprinted(0.7).with_metadata(imprint="30 % are left")
    relaxing = ul.Scene(
        ul.Cone.berkovich(), ul.Layer(ul.Isotropic(1e6, 0.4), relaxation=ul.Prony((0.5,), (1.0,)))
    )
    require_elastic(relaxing, curve)
    with pytest.raises(ul.CurveError, match="elastoplastic"):
        require_elastic(relaxing.elastic, curve)


def test_a_thickness_is_told_as_a_length():
    start = FILM.with_values({"layer.thickness": 1.2 * FILM.layer.thickness})
    found = ul.fit_stiffness(made_test(), start, free=("layer.E", "layer.thickness"), area=WORN)
    told = film_table(found).set_index("parameter")["value"]
    assert re.fullmatch(r"[\d.]+ [un]m", told["layer.thickness"])
    assert re.fullmatch("[un]m", film_moduli(found).set_index("parameter")["unit"]["layer.thickness"])


def test_the_command_calibrates_the_tip_and_fits_the_film(done, refused, tmp_path):
    film, base, scene = write_films(tmp_path)
    known = f"{160.0 / (1.0 - 0.22**2):.6f} GPa"
    words = ("film", film, "--scene", scene, "--calibration", base)
    out = done(*words, "--known-modulus", known, "-o", tmp_path / "out")
    assert re.search(r"layer\.E\s+(70|69\.9\d?|70\.\d+) GPa", out)
    assert "perfect cone" not in out
    assert (tmp_path / "out" / "oxide.film.png").read_bytes().startswith(b"\x89PNG")
    # The table says what the screen says, with the units.
    moduli = pd.read_csv(tmp_path / "out" / "oxide.film.csv").set_index("parameter").loc["layer.E"]
    assert moduli["unit"] == "GPa"
    assert moduli["value"] == pytest.approx(70.0, rel=1e-3)
    assert moduli["low"] <= moduli["value"] <= moduli["high"]
    depths = pd.read_csv(tmp_path / "out" / "oxide.film.depths.csv")
    assert {"depth (m)", "stiffness (N/m)", "layer modulus (Pa)", "a/h"} <= set(depths)
    assert len(depths) == moduli["depths"]
    assert depths["depth (m)"].max() == pytest.approx(moduli["fitted to (m)"])
    assert '--calibration needs --known-modulus, such as "165 GPa"' in refused(*words)
