"""Pictures: each takes ``ax=`` and returns it, shows what it was given, and touches nothing else."""

import itertools
import struct
import xml.etree.ElementTree as ET
from dataclasses import replace
from types import SimpleNamespace

import matplotlib as mpl
import matplotlib.pyplot as plt
import numpy as np
import pandas as pd
import pytest

import underlay as ul
from support.reports import SAMPLES, sample_fit, small_posterior
from underlay.report.plots import style
from underlay.report.plots.map import _squares


@pytest.fixture(autouse=True)
def _closed():
    """Close every figure after a test."""
    yield
    plt.close("all")


@pytest.fixture
def fit():
    return sample_fit("cartilage_on_bone")


@pytest.fixture(scope="module")
def planned():
    scene = ul.Scene(ul.Paraboloid(1e-3), ul.Layer(ul.Isotropic(1e6, 0.5), 1e-3), ul.RIGID)
    return ul.plan(
        scene,
        free=["layer.E", "layer.thickness"],
        noise=ul.Noise(force=1e-3),
        radii=np.geomspace(2e-4, 2e-3, 4),
        depths=np.geomspace(2e-5, 2e-4, 3),
    )


def site_table():
    x, y = np.meshgrid(np.arange(4) * 1e-3, np.arange(3) * 1e-3)
    modulus = 1e6 + 1e8 * x
    modulus[1, 2] = np.nan
    return pd.DataFrame({"x": x.ravel(), "y": y.ravel(), "layer.E": modulus.ravel()})


#: Pictures by name: each draws a fit, a plan or a posterior into axes.
PICTURES = {
    "fit": lambda fit, _plan, _post, *, ax: ul.plots.fit(fit, ax=ax),
    "fit in logarithms": lambda fit, _plan, _post, *, ax: ul.plots.fit_log(fit, ax=ax),
    "scene": lambda fit, _plan, _post, *, ax: ul.plots.scene(fit.scene, depth=3e-4, ax=ax),
    "correlations": lambda fit, _plan, _post, *, ax: ul.plots.correlations(fit, ax=ax),
    "identifiability": lambda fit, _plan, _post, *, ax: ul.plots.identifiability(
        ul.identifiability(fit), ax=ax
    ),
    "profile": lambda fit, _plan, _post, *, ax: ul.plots.profile(ul.profile(fit, "layer.E"), ax=ax),
    "plan": lambda _fit, plan, _post, *, ax: ul.plots.plan(plan, ax=ax),
    "corner": lambda _fit, _plan, post, *, ax: ul.plots.corner(post, ax=ax),
    "predictive": lambda _fit, _plan, post, *, ax: ul.plots.predictive(post, ax=ax),
    "map": lambda *_, ax: ul.plots.map(site_table(), ax=ax),
    "verdicts": lambda *_, ax: ul.plots.verdicts(site_table().assign(verdict="good"), ax=ax),
    "histogram": lambda *_, ax: ul.plots.histogram(site_table(), ax=ax),
}


@pytest.mark.parametrize("name", PICTURES)
def test_every_picture_keeps_to_the_rules(fit, planned, name, tmp_path, monkeypatch):
    shown = fit, planned, small_posterior()[1]
    monkeypatch.setattr(plt, "show", lambda *_, **__: pytest.fail("a picture called plt.show"))
    before = mpl.rcParams.copy()
    _, (left, right) = plt.subplots(1, 2, figsize=(9.0, 4.0), layout="constrained")
    assert PICTURES[name](*shown, ax=left) is left
    assert right.has_data() is False
    plt.close("all")
    own = PICTURES[name](*shown, ax=None)
    width = own.get_figure(root=True).get_figwidth()
    assert style.COLUMN <= width <= style.PAGE or name == "corner"
    data = ul.plots.save(own, tmp_path / f"{name}.png").read_bytes()
    wide, high = struct.unpack(">II", data[16:24])
    assert wide >= 480
    assert high >= 300
    # The backend is chosen by matplotlib itself at the first picture.
    changed = {key for key, value in mpl.rcParams.items() if before[key] != value}
    assert changed <= {"backend"}


def test_saving_writes_each_format_closes_the_figure_and_refuses_others(fit, tmp_path):
    plt.close("all")
    starts = {"png": b"\x89PNG", "pdf": b"%PDF", "svg": b"<?xml"}
    for ending, start in starts.items():
        path = ul.plots.save(ul.plots.fit(fit), tmp_path / f"a.{ending}")
        assert path.read_bytes().startswith(start)
    # Text in a vector picture stays text.
    words = [node.text for node in ET.parse(tmp_path / "a.svg").iter() if node.text]  # noqa: S314  our own
    assert any("Force F (mN)" in text for text in words)
    assert plt.get_fignums() == []
    ax = ul.plots.fit(fit)
    with pytest.raises(ul.InputError, match=r"\.png, \.svg or \.pdf"):
        ul.plots.save(ax, tmp_path / "a.jpg")


def test_fit_shows_the_data_the_fit_and_the_half_space_from_contact_on(fit):
    upper = ul.plots.fit(fit)
    lines = {line.get_label(): line for line in upper.get_lines() if not line.get_label().startswith("_")}
    assert set(lines) == {"measured", "fit", "half-space, best fit"}
    assert {line.get_label() for line in ul.plots.fit_log(fit).get_lines()} >= {"measured", "fit"}
    assert upper.get_ylabel() == "Force F (mN)"
    contact, baseline = (fit.values[f"instrument.{name}"] for name in ("contact_depth", "baseline"))
    x, y = lines["measured"].get_data()
    assert x.max() == pytest.approx((fit.curves[0].depth.max() - contact) / 1e-6)
    assert y.max() == pytest.approx((fit.curves[0].force.max() - baseline) / 1e-3)
    # The half-space's best fit misses the deepest point, which the layer does not.
    assert lines["half-space, best fit"].get_ydata()[-1] < lines["fit"].get_ydata()[-1] - 2.0
    assert any("best fit: 1.11 MPa" in text.get_text() for text in upper.texts)
    strip = upper.get_figure(root=True).axes[1]
    residual = next(line.get_ydata() for line in strip.get_lines() if len(line.get_ydata()) == len(x))
    np.testing.assert_allclose(residual * 1e-3, fit.residuals[0], rtol=1e-12)


def test_a_budget_has_a_bar_for_every_source_and_one_for_all(fit):
    answer = fit.answer("layer.E")
    ax = ul.plots.budget(answer)
    whole = max(answer.high - answer.value, answer.value - answer.low)
    assert ax.patches[-1].get_width() == pytest.approx(whole / 1e3)
    assert ax.get_yticklabels()[-1].get_text() == "combined"
    hatched = [bar for bar in ax.patches if bar.get_hatch()]
    assert len(hatched) >= 3
    with pytest.raises(ul.InputError, match="is not determined"):
        ul.plots.budget(replace(answer, high=np.inf))


@pytest.mark.parametrize(
    "indenter",
    [
        ul.FlatPunch(5e-4),
        ul.Paraboloid(1e-3),
        ul.Sphere(1e-3),
        ul.Cone.berkovich(),
        ul.PowerLaw(3.0, 1e5),
        ul.Profile([0.0, 2e-4, 6e-4, 1e-3], [0.0, 2e-5, 2e-4, 7e-4]),
    ],
    ids=lambda indenter: indenter.shape,
)
@pytest.mark.parametrize("substrate", [None, ul.RIGID, ul.Isotropic(1e5, 0.4)], ids=["none", "rigid", "soft"])
def test_scene_is_drawn_to_scale(indenter, substrate):
    layer = ul.Layer(ul.Isotropic(1e6, 0.45), np.inf if substrate is None else 1e-3)
    test = ul.Scene(indenter, layer, substrate, ul.Instrument(contact_depth=1e-5))
    ax = ul.plots.scene(test, depth=9e-5)
    assert ax.get_aspect() == 1.0
    depth = 9e-5 - 1e-5
    radius = float(test.contact_law(depth).contact_radius(np.array([depth]))[0])
    dots = next(line for line in ax.get_lines() if line.get_marker() == "o")
    unit = {"µm": 1e-6, "mm": 1e-3}[ax.get_xlabel().rpartition("(")[2].rstrip(")")]
    assert dots.get_xdata()[1] * unit == pytest.approx(radius)
    edge = float(indenter.surface(np.array([radius]))[0]) - depth
    assert dots.get_ydata()[1] * unit == pytest.approx(edge, abs=1e-12)


def test_scene_before_contact_can_be_drawn():
    test = ul.Scene(ul.Sphere(1e-3), ul.Layer(ul.Isotropic(1e6, 0.45), 1e-3), ul.RIGID)
    ax = ul.plots.scene(test, depth=-1e-5)
    assert not [line for line in ax.get_lines() if line.get_marker() == "o"]


def test_a_quantity_over_decades_has_an_axis_in_decades():
    wide = SimpleNamespace(
        names=("layer.E", "layer.thickness"),
        of={
            "layer.E": np.geomspace(1e5, 1e8, 400)[:, None],
            "layer.thickness": np.linspace(1e-3, 2e-3, 400)[:, None],
        }.__getitem__,
        prior_quantiles=np.column_stack([np.geomspace(1e5, 1e8, 101), np.linspace(1e-3, 2e-3, 101)]),
        truth={},
    )
    cells = ul.plots.corner(wide).get_figure().axes[1:]
    scales = [(cell.get_xscale(), cell.get_yscale()) for cell in cells]
    assert scales == [("log", "linear"), ("log", "linear"), ("linear", "linear")]
    # Even in decades, as the prior is: every bar as high as the next.
    heights = cells[0].patches[0].get_data().values
    assert np.ptp(heights[2:-2]) < 0.01


def test_corner_marks_the_truth_and_needs_axes_it_can_divide():
    _, posterior = small_posterior()
    ax = ul.plots.corner(posterior, names=["layer.E", "instrument.contact_depth"])
    cells = ax.get_figure(root=True).axes[1:]
    assert len(cells) == 3
    labels = [cell.get_xlabel() for cell in cells if cell.get_xlabel()]
    assert labels == ["layer modulus\n(MPa)", "contact point\n(µm)"]
    # A longer name is broken, so that it stays within its cell.
    long = ul.plots.corner(posterior, names=["layer.reduced_modulus"])
    assert long.get_figure(root=True).axes[-1].get_xlabel() == "reduced modulus\nof the layer\n(MPa)"
    dashed = [line for line in cells[0].get_lines() if line.get_linestyle() == "--"]
    assert dashed[0].get_xdata()[0] == pytest.approx(1.0)
    by_hand = plt.figure().add_axes((0.1, 0.1, 0.8, 0.8))
    with pytest.raises(ul.InputError, match="divides its axes"):
        ul.plots.corner(posterior, ax=by_hand)


def test_profile_shades_its_own_interval(fit):
    walk = ul.profile(fit, "layer.thickness")
    ax = ul.plots.profile(walk)
    box = ax.patches[0].get_extents().transformed(ax.transData.inverted())
    ends = walk.interval()
    assert (box.x0, box.x1) == pytest.approx((ends.low / 1e-3, ends.high / 1e-3), rel=1e-9)


def test_profile_draws_the_standard_error_by_its_own_width_and_an_open_end_out_of_the_picture(fit):
    walk = ul.profile(fit, "layer.thickness")
    # An optimum beside the profile, known a thousand times as well as the profile says; nothing ends it below.
    name, aside = "layer.thickness", 2.0 * walk.values[-1]
    sharp = replace(fit, values={**fit.values, name: aside}, stderr={**fit.stderr, name: 1e-7})
    kept = walk.delta_chi_square < 1.0
    kept |= np.arange(len(kept)) > walk.best
    open_below = replace(
        walk,
        fit=sharp,
        values=walk.values[kept],
        vectors=walk.vectors[kept],
        delta_chi_square=walk.delta_chi_square[kept],
        ends=("none", walk.ends[1]),
    )
    ax = ul.plots.profile(open_below)
    parabola = next(line for line in ax.get_lines() if line.get_label() == "standard error")
    assert parabola.get_ydata().min() == pytest.approx(0.0, abs=1e-12)
    assert parabola.get_ydata().max() == pytest.approx(ax.get_ylim()[1])
    assert ax.get_xlim()[0] < aside / 1e-3 < ax.get_xlim()[1]
    box = ax.patches[0].get_extents().transformed(ax.transData.inverted())
    assert box.x0 == pytest.approx(ax.get_xlim()[0])


def moved(walk, factor, rise):
    """Return a branch: the walk with its parameter times `factor`, everywhere higher by `rise`."""
    index = walk.fit.names.index(walk.name)
    vectors = walk.vectors.copy()
    vectors[:, index] += np.log(factor)
    values = walk.fit.problem.coordinates[index].physical(vectors[:, index])
    return replace(walk, values=values, vectors=vectors, delta_chi_square=walk.delta_chi_square + rise)


@pytest.mark.parametrize(("factor", "parts"), [(3.0, 2), (1.02, 1)], ids=["apart", "overlapping"])
def test_profile_shades_every_part_of_its_interval(fit, factor, parts):
    walk = ul.profile(fit, "layer.E")
    branch = moved(walk, factor, 1.0)
    both = replace(walk, branches=(branch, moved(walk, 30.0, 40.0)))
    ax = ul.plots.profile(both)
    boxes = [patch.get_extents().transformed(ax.transData.inverted()) for patch in ax.patches]
    z = np.sqrt(walk.threshold(0.95))
    assert len(boxes) == parts
    assert boxes[0].x0 == pytest.approx(walk.interval().low / 1e6, rel=1e-9)
    assert boxes[-1].x1 == pytest.approx(branch.end(z, upper=True)[0] / 1e6, rel=1e-9)
    if parts == 2:
        assert boxes[0].x1 == pytest.approx(walk.interval().high / 1e6, rel=1e-9)
        assert boxes[1].x0 == pytest.approx(branch.end(z, upper=False)[0] / 1e6, rel=1e-9)
    # The branch far above what the picture shows is not drawn, and makes no room for itself.
    lines = [line for line in ax.get_lines() if line.get_label() == "about another optimum"]
    np.testing.assert_allclose(lines[0].get_xdata() * 1e6, branch.values)
    assert len(lines) == 1
    assert ax.get_xlim()[1] < 1.2 * boxes[-1].x1


def test_plan_puts_its_star_on_the_recommendation(planned):
    ax = ul.plots.plan(planned)
    star = next(line for line in ax.get_lines() if line.get_label() == "recommended")
    assert star.get_xdata()[0] * 1e-3 == pytest.approx(planned.best[0])


def test_identifiability_says_its_level_and_is_read_on_its_bar(fit):
    told = ul.identifiability(fit)
    upper = ul.plots.identifiability(told)
    bars = next(ax for ax in upper.get_figure().axes if "95 %" in ax.get_xlabel())
    for one, text, bar in zip(told.combinations, bars.texts, bars.patches, strict=True):
        half = 1.96 * one.relative_sd
        assert text.get_text() == f"± {100.0 * half:.2g} %"
        inside = text.get_position()[0] < bar.get_width()
        assert text.get_color() == ("white" if inside and one.verdict == "fixed" else ul.plots.style.INK)


def test_map_shows_every_site_and_says_what_is_missing():
    table = site_table()
    ax = ul.plots.map(table)
    missing, shown = ax.collections
    assert len(missing.get_paths()) == 1
    assert len(shown.get_paths()) == 11
    np.testing.assert_allclose(shown.get_array() * 1e6, table["layer.E"].dropna())
    with pytest.raises(ul.InputError, match=r"no column 'height'; it has x, y, layer\.E"):
        ul.plots.map(table, "height")
    with pytest.raises(ul.InputError, match="no site of the map"):
        ul.plots.map(table.assign(**{"layer.E": np.nan}))
    alone = _squares(np.array([0.0]), np.array([0.0]))
    assert np.ptp(alone) > 0.0


def test_verdicts_have_a_colour_a_shape_and_a_count_each():
    table = site_table().assign(verdict=["good"] * 9 + ["check"] * 2 + ["refused"])
    ax = ul.plots.verdicts(table)
    words = [text.get_text() for text in ax.get_legend().get_texts()]
    assert words == ["good (9)", "check (2)", "reject (0)", "refused (1)"]
    assert len({line.get_marker() for line in ax.get_lines()}) == 3
    with pytest.raises(ul.InputError, match="'verdict' holds words"):
        ul.plots.map(table, "verdict")


def test_histogram_counts_every_curve_once():
    ax = ul.plots.histogram(site_table())
    assert sum(bar.get_height() for bar in ax.patches) == 11
    few = ul.plots.histogram(site_table().head(3))
    assert all(float(tick).is_integer() for tick in few.get_yticks())
    with pytest.raises(ul.InputError, match="no column 'height'"):
        ul.plots.histogram(site_table(), "height")


def test_strip_in_axes_placed_by_hand_keeps_their_box(fit):
    ax = plt.figure().add_axes((0.2, 0.2, 0.6, 0.7))
    upper = ul.plots.fit(fit, ax=ax)
    boxes = [each.get_position() for each in upper.get_figure(root=True).axes]
    assert min(box.y0 for box in boxes) == pytest.approx(0.2)
    assert max(box.y1 for box in boxes) == pytest.approx(0.2 + 0.7, abs=0.05)
    assert boxes[1].y1 < boxes[0].y0


def test_segments_are_told_apart_by_colour_and_mark():
    curve = ul.read(SAMPLES / "chiaro_cell_indentation.csv")
    upper = ul.plots.segments(curve)
    drawn = {line.get_label(): line for line in upper.get_lines()}
    assert set(drawn) == {"loading", "unloading"}
    assert len({(line.get_color(), line.get_marker()) for line in drawn.values()}) == 2
    assert sum(len(line.get_xdata()) for line in drawn.values()) == len(curve)
    assert "depth" in upper.get_ylabel()


def test_a_stack_is_drawn_with_its_layers_named_beside_it():
    layers = [ul.Layer(ul.Isotropic(3e4 * (k + 2), 0.4), 1e-6 * (k % 3 + 0.3)) for k in range(5)]
    layers[2] = replace(layers[2], bond="slip")
    test = ul.Scene(ul.Sphere(10e-6), ul.Layer(ul.Isotropic(3e4, 0.35), 1e-6), ul.Stack(layers, ul.RIGID))
    ax = ul.plots.scene(test, depth=6e-7)
    beside = [text for text in ax.texts if text.get_position()[0] > 1.0]
    assert len(beside) == 7
    assert beside[-1].get_text() == "rigid"
    assert "free to slip" in beside[3].get_text()
    # From the top down, and no line of words on another.
    ax.figure.canvas.draw()
    boxes = [text.get_window_extent() for text in beside]
    assert all(upper.y0 >= lower.y1 - 1.0 for upper, lower in itertools.pairwise(boxes))
    faces = [line for line in ax.lines if line.get_linestyle() == "--"]
    assert [line.get_ydata()[0] for line in faces] == [pytest.approx(-4.9)]
    assert "contact radius" in ax.get_title()


def chiaro_fit():
    """A fit of a long approach: 73 of 85 um lie before contact."""
    return ul.fit(ul.load_problem(SAMPLES / "chiaro_cell_indentation.csv", SAMPLES / "chiaro_cell.toml"))


def test_a_fit_is_drawn_about_its_contact_and_whole_where_asked():
    fit = chiaro_fit()
    contact, deepest = fit.values["instrument.contact_depth"] * 1e6, fit.curves[0].depth.max() * 1e6
    low, high = ul.plots.fit(fit).get_xlim()
    assert -0.5 * (deepest - contact) < low < 0.0
    # Less than the travel: the lever bends.
    assert 0.7 * (deepest - contact) < high < deepest - contact
    assert ul.plots.fit(fit, whole=True).get_xlim()[0] < 1.0 - contact


def test_logarithms_show_the_slopes_of_a_ball_and_a_cone():
    scene = ul.Scene(ul.Cone(1.2), ul.Layer(ul.Isotropic(1e6, 0.45)))
    curve = ul.simulate(scene, np.linspace(0.0, 1e-4, 200))
    fit = ul.fit(ul.Problem(scene, curve, {"layer.E": (1e4, 1e8)}, noise=ul.Noise(force=1e-6)))
    ax = ul.plots.fit_log(fit)
    lines = {line.get_label(): line for line in ax.get_lines()}
    assert ax.get_xscale() == ax.get_yscale() == "log"
    for label, slope in (("fit", 2.0), ("slope 1.5", 1.5), ("slope 2", 2.0)):
        x, y = lines[label].get_data()
        assert np.polyfit(np.log(x), np.log(y), 1)[0] == pytest.approx(slope, rel=1e-6)
    assert "µ" in ul.plots.fit_log(chiaro_fit()).get_xlabel()
