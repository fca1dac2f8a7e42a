"""What is said and drawn of adhesion: tables, pictures, maps, the ledger, proposals, refusals."""

from dataclasses import replace

import numpy as np
import pandas as pd
import pytest
from matplotlib import pyplot as plt

import underlay as ul
from underlay.inference.adhesive_numbers import adhesive_estimates
from underlay.mechanics.adhesion.jkr import range_limit
from underlay.report import maps, scene_tables
from underlay.report.limits import quality_doubts
from underlay.report.scene_tables import adhesion_frame, adhesion_table, halfspace_of, halfspace_sentence

SCENE = ul.Scene(
    ul.Paraboloid(1e-5),
    ul.Layer(ul.Isotropic(5e3, 0.45), 8e-6),
    ul.RIGID,
    instrument=ul.Instrument(contact_depth=2e-7),
    adhesion=ul.JKR(work=2e-4),
)
BARE = replace(SCENE, adhesion=None)
NOISE = ul.Noise(force=1e-10)
FREE = ["layer.E", "adhesion.work", "instrument.contact_depth"]
DEPTH = np.linspace(1.2e-6, -1e-6, 80)


def made(scene=SCENE, depth=DEPTH, seed=1):
    return ul.synthesize(scene, depth, NOISE, rng=seed)


@pytest.fixture(scope="module")
def fit():
    scene = replace(SCENE, instrument=ul.Instrument(contact_depth=2e-7, compliance=10.0))
    return ul.fit(ul.Problem(scene, made(scene, np.linspace(1.5e-6, -1e-6, 80)), FREE, NOISE), start="given")


# --- tables and maps ----------------------------------------------------------------------------------------


def test_the_table_holds_the_law_s_numbers_with_intervals(fit):
    law = fit.scenes[0].contact_law(0.0)
    told = {entry.name: entry for entry in adhesive_estimates(fit)}
    assert told["adhesion.pull_off_force"].value == pytest.approx(law.pull_off_force, rel=1e-12)
    assert told["adhesion.pull_off_depth"].value == pytest.approx(law.pull_off_depth, rel=1e-12)
    assert told["adhesion.zero_load_radius"].value == pytest.approx(law.zero_load_radius, rel=1e-12)
    # Thick against this contact: the pull-off force goes with the work to a power near one, and hardly with E.
    force = told["adhesion.pull_off_force"]
    work = fit.interval("adhesion.work")
    share = (work.high - work.low) / work.value
    assert (force.high - force.low) / force.value == pytest.approx(share, rel=0.1)
    frame = adhesion_frame(fit)
    assert list(frame["quantity"]) == list(told)
    assert frame.loc[0, "value"] == pytest.approx(law.pull_off_force * 1e9)
    words = adhesion_table(fit).to_string()
    told = ("pull-off force", "pull-off depth", "contact radius without load", "comes off", "first touch")
    assert [word for word in told if word not in words] == []


def test_three_halves_is_held_against_the_layer():
    thin = replace(SCENE, layer=replace(SCENE.layer, thickness=1e-6))
    force = thin.contact_law(0.0).pull_off_force
    read = force / (1.5 * np.pi * 1e-5)
    assert f"{100 * (read / 2e-4 - 1):+.2g} %" in halfspace_sentence(thin, force)
    assert halfspace_sentence(replace(SCENE, adhesion=ul.DMT(2e-4)), 1.0) == ""
    assert halfspace_sentence(replace(SCENE, indenter=ul.Cone(1.0)), 1.0) == ""


def test_maps_have_columns_of_the_pull_off():
    free = ["layer.E", "adhesion.work"]
    table = ul.fit_many(
        [made(depth=DEPTH[::2])], SCENE, free=free, workers=0, options=ul.MapOptions(progress=False)
    )
    assert (table["status"] == "fitted").all()
    for _, row in table.iterrows():
        law = SCENE.with_values({path: row[path] for path in free}).contact_law(0.0)
        assert row["adhesion.pull_off_force"] == pytest.approx(law.pull_off_force, rel=1e-9)
        assert row["adhesion.pull_off_depth"] == pytest.approx(law.pull_off_depth, rel=1e-9)
    # The page of a map shows them beside the fitted ones.
    shown = maps.parameter_table(table).index
    assert list(shown) == ["layer modulus", "work of adhesion", "pull-off force", "pull-off depth"]
    placed = table.assign(x=[0.0], y=[0.0])
    assert {"adhesion.work", "adhesion.pull_off_force"} <= set(maps.columns_to_draw(placed))
    bare = ul.fit_many(
        [made(BARE, DEPTH[::-1])], BARE, free=["layer.E"], workers=0, options=ul.MapOptions(progress=False)
    )
    assert not [column for column in bare if column.startswith("adhesion.")]


def test_a_word_of_a_scene_stands_in_its_table_as_it_is():
    table = scene_tables.scene_table(SCENE)
    assert "separating" in table.to_string()
    assert "1 values" not in table.to_string()


def test_fits_that_leave_out_different_readings_compare():
    """The log-likelihood counts those left out as the mean of the others: AIC does not fall with each of them."""
    law = SCENE.contact_law(3e-6)
    noise = ul.Noise(force=0.01 * law.pull_off_force)
    found = []
    for share in (0.5, 0.01):
        depth = 2e-7 + law.pull_off_depth + 2e-8 * (share + np.arange(90, -45, -1))
        fit = ul.fit(ul.Problem(SCENE, ul.synthesize(SCENE, depth, noise, rng=1), FREE, noise))
        found.append((len(fit.curves[0]), fit.statistics))
    (all_, whole), (fewer, less) = found
    assert fewer == all_ - 1
    assert less.aic == pytest.approx(2.0 * 3 - 2.0 * less.log_likelihood)
    # One reading weighs 2 ln(sigma sqrt(2 pi)) + 1 = -43 here.
    assert abs(less.aic - whole.aic) < 20.0


# --- the picture --------------------------------------------------------------------------------------------


def drawn(ax):
    """Ends of the arrows: where each jump leads, in the units of the axes."""
    return [(note.xyann, note.xy) for note in ax.texts if note.arrowprops is not None or note.arrow_patch]


def test_the_picture_shows_every_jump_where_the_law_has_it(fit):
    ax = ul.plots.adhesion(fit)
    law = fit.scenes[0].contact_law(5e-7)
    arrows = np.array(drawn(ax)) * [1e-6, 1e-9]
    off = {spring: law.pull_off(spring) for spring in (0.0, 10.0, np.inf)}
    starts, ends = arrows[:, 0], arrows[:, 1]
    for number, spring in enumerate(off):
        np.testing.assert_allclose(starts[2 * number], (off[spring].depth, off[spring].force), rtol=1e-5)
    # With the depth given the tip jumps straight up; behind the spring along w + C P; under a load it leaves.
    assert ends[0] == pytest.approx((off[0.0].depth, 0.0))
    assert ends[2] == pytest.approx((off[10.0].depth + 10.0 * off[10.0].force, 0.0), rel=1e-5)
    assert ends[4][1] == pytest.approx(off[np.inf].force, rel=1e-5)
    # And into contact, from depth and force zero.
    for number, spring in enumerate(off):
        first = law.jump_in(spring)
        assert starts[2 * number + 1] == pytest.approx((0.0, 0.0))
        np.testing.assert_allclose(ends[2 * number + 1], (first.depth, first.force), rtol=1e-4, atol=1e-14)
    assert "measured" in [text.get_text() for text in ax.get_legend().get_texts()]
    plt.close(ax.figure)


@pytest.mark.parametrize("adhesion", [ul.JKR(2e-4), ul.DMT(2e-4)])
@pytest.mark.parametrize("tip", [ul.Paraboloid(1e-5), ul.FlatPunch(2e-6)])
def test_pictures_of_scenes(tip, adhesion):
    if isinstance(adhesion, ul.DMT) and isinstance(tip, ul.FlatPunch):
        pytest.skip("DMT is for rounded tips")
    ax = ul.plots.adhesion(replace(SCENE, indenter=tip, adhesion=adhesion))
    assert ax.get_ylim()[0] < 0.0
    plt.close(ax.figure)
    with pytest.raises(ul.InputError, match="nothing sticks"):
        ul.plots.adhesion(BARE)


# --- is JKR allowed here? -----------------------------------------------------------------------------------


@pytest.mark.parametrize("thickness", [np.inf, 8e-6, 1e-6])
def test_the_range_that_jkr_stands_for_is_what_maugis_says(thickness):
    layer = ul.Layer(ul.Isotropic(5e3, 0.5), thickness)
    scene = replace(SCENE, layer=layer, substrate=None if thickness == np.inf else ul.RIGID)
    law = scene.contact_law(0.0)
    radius = law.zero_load_radius
    elastic = float(law.branch.relation.at(np.array([radius])).force[0])
    limit = range_limit(scene.contact, 2e-4, radius, elastic, 0.05)
    found = ul.Maugis(2e-4, limit.separation).state(scene.contact, radius)
    assert found.outer / radius - 1.0 == pytest.approx(limit.ring, rel=1e-5)
    assert abs(found.force) / elastic == pytest.approx(0.05, rel=5e-3)
    # The control: a tenth of the range errs by much less.
    less = ul.Maugis(2e-4, 0.1 * limit.separation).state(scene.contact, radius)
    assert abs(less.force) / elastic < 0.02


def test_a_thin_layer_needs_a_narrower_ring():
    rings = []
    for thickness in (1e-4, 8e-6, 2e-6, 5e-7):
        thin = replace(SCENE, layer=ul.Layer(ul.Isotropic(5e3, 0.5), thickness))
        note = thin.adhesion.about_range(thin.contact, ul.Exact())
        rings.append(float(note.split("(c - a)/a = ")[1].split(" at ")[0]))
    assert rings == sorted(rings, reverse=True)
    assert rings[0] == pytest.approx(0.054, abs=1e-3)
    assert rings[-1] < 0.75 * rings[0]


def test_the_ledger_answers_whether_jkr_is_allowed():
    row = SCENE.effects(3e-7).set_index("effect").loc["range of attraction"]
    assert row["note"] == SCENE.adhesion.about_range(SCENE.contact, ul.Exact())
    assert not row["simulated"]


def test_an_attraction_that_never_lets_go_is_named():
    scene = ul.Scene(ul.Paraboloid(1.0), ul.Layer(ul.Isotropic(1.5, 0.5)), adhesion=ul.Maugis(1.0, 3.0))
    with pytest.raises(ul.RangeError, match="DMT"):
        scene.contact_law(0.0)


# --- proposals and refusals ---------------------------------------------------------------------------------


def test_a_dip_is_a_proposal():
    """On the way out of a whole curve; and not where the scene has adhesion already."""
    cycle = replace(SCENE, adhesion=ul.JKR(2e-4, branch="cycle"))
    way = np.concatenate((np.linspace(-1e-6, 1.2e-6, 80), DEPTH))
    curve = ul.Curve(way, made(cycle, way).force, np.arange(160.0))
    said = " ".join(ul.check_quality(curve, BARE).reasons)
    assert "the tip adheres" in said
    assert "from the unloading" in said
    assert "the tip adheres" not in " ".join(ul.check_quality(curve, SCENE).reasons)
    flat = made(BARE, way)
    quiet = ul.Curve(way, flat.force, np.arange(160.0))
    assert "the tip adheres" not in " ".join(ul.check_quality(quiet, BARE).reasons)


def test_a_fit_of_the_way_in_alone_still_sees_the_dip_of_the_way_out(tmp_path):
    """A scene without adhesion fits the way in of a file; what the rest of the file shows is said all the same."""
    cycle = replace(SCENE, adhesion=ul.JKR(2e-4, branch="cycle"))
    way = np.concatenate((np.linspace(-1e-6, 1.2e-6, 80), DEPTH))
    options = ul.MapOptions(progress=False, quality=True)
    for scene, sticks in ((cycle, True), (BARE, False)):
        file = tmp_path / f"{sticks}.csv"
        columns = np.column_stack((way, made(scene, way).force, np.arange(way.size)))
        np.savetxt(file, columns, delimiter=",", header="depth (m),force (N),time (s)", comments="")
        stated = BARE.save(tmp_path / "scene.toml")
        stated.write_text(stated.read_text() + '\n[fit]\nlayer.E = { min = "10 Pa", max = "10 MPa" }\n')
        problem = ul.load_problem(file, stated)
        assert set(problem.curves[0].segments()) == {"loading"}
        said = " ".join(quality_doubts(problem))
        assert ("from the unloading" in said) == sticks
        table = ul.fit_many([file], stated, workers=0, options=options)
        assert ("from the unloading" in table["reason"].iloc[0]) == sticks


def test_wide_contacts_are_refused_with_the_bound():
    thin = replace(SCENE, layer=replace(SCENE.layer, thickness=1e-7))
    with pytest.raises(ul.RangeError, match=r"20 thicknesses.*no more than") as error:
        replace(thin, adhesion=ul.JKR(1.0)).contact_law(0.0)
    most = float(str(error.value).rsplit("no more than ", 1)[1].split()[0])
    assert replace(thin, adhesion=ul.JKR(0.999 * most)).contact_law(0.0).zero_load_radius < 20 * 1e-7
    with pytest.raises(ul.RangeError):
        replace(thin, adhesion=ul.JKR(1.01 * most)).contact_law(0.0)
    with pytest.raises(ul.RangeError, match="20 thicknesses") as error:
        thin.contact_law(1e-6)
    assert thin.contact_law(0.999 * error.value.max_depth).max_depth > 0.0


def test_a_fit_through_works_too_large_survives():
    """Trial works far beyond the table's end are no contact, not a crash."""
    thin = replace(SCENE, layer=replace(SCENE.layer, thickness=5e-7))
    problem = ul.Problem(thin, made(thin), ["layer.E", "adhesion.work"], NOISE)
    vectors = np.array([[0.0, 0.0], [0.0, 40.0], [-20.0, 0.0]])
    values = problem.log_likelihood(vectors)
    assert np.isfinite(values[0])
    assert (values[1:] == -np.inf).all()


def test_relaxation_beside_adhesion_is_refused():
    layer = ul.Layer(SCENE.layer.material, 8e-6, relaxation=ul.Prony((0.3,), (1.0,)))
    with pytest.raises(ul.InputError, match="adhesion"):
        replace(SCENE, layer=layer)


def test_a_table_of_a_fit_without_adhesion_is_empty():
    found = ul.fit(ul.Problem(BARE, made(BARE, DEPTH[::-1]), ["layer.E"], NOISE))
    assert adhesive_estimates(found) == []
    assert adhesion_frame(found).equals(pd.DataFrame([]))


def test_where_no_noise_is_stated_the_table_agrees_with_the_parameters():
    """The pull-off force of this thick layer goes with the work alone: it has the interval of that."""
    rng = np.random.default_rng(4)
    curve = made(SCENE, np.linspace(1.2e-6, -1e-6, 160))
    hung = np.convolve(rng.normal(size=199), np.ones(40) / 40**0.5, "valid") * 3e-10
    problem = ul.Problem(SCENE, replace(curve, force=curve.force + hung), FREE)
    found = ul.fit(problem, start="given")
    work, force = found.interval("adhesion.work"), adhesive_estimates(found)[0]
    factor = 1.5 * np.pi * 1e-5
    assert [force.low, force.value, force.high] == pytest.approx(
        [factor * end for end in (work.low, work.value, work.high)], rel=0.03
    )
    assert work.high - work.low > 5.0 * found.stderr["adhesion.work"]
    assert f"{work.value * 1e3:.4g} mJ/m^2 found on this layer" in halfspace_of(found)
