"""Files of the kinds that laboratories hand over, made here: three or more of each kind, as real ones differ."""

import contextlib
import gzip
import io
import itertools
import re
import sys
import warnings
import zipfile

import numpy as np
import openpyxl
import pytest
from scipy.io import savemat

import underlay as ul
from support.instrument_files import saved
from underlay.data.segments import segments_from_motion

# A ball on a half-space: travel, contact and force of one way in.
DEPTH = np.linspace(-1.0, 3.0, 240)
FORCE = 4.0 * np.clip(DEPTH, 0.0, None) ** 1.5
TIME = np.linspace(0.0, 12.0, 240)
STIFFNESS = 0.06


@pytest.fixture
def put(tmp_path):
    def write(content, name="file.txt"):
        path = tmp_path / name
        path.write_bytes(content if isinstance(content, bytes) else content.encode())
        return path

    return write


def rows(*columns, separator="\t", form="{:.6f}"):
    return "\n".join(separator.join(form.format(v) for v in row) for row in zip(*columns, strict=True)) + "\n"


def sheet_of(rows):
    """The bytes of a workbook with one sheet of these rows."""
    book = openpyxl.Workbook()
    for row in rows:
        book.active.append(row)
    return saved(book)


def is_whole(curve, depth=DEPTH * 1e-6, force=FORCE * 1e-9):
    np.testing.assert_allclose(curve.depth, depth, atol=1.1e-12)
    np.testing.assert_allclose(curve.force, force, atol=1.1e-15)


# --- names in comments


@pytest.mark.parametrize(
    ("head", "separator"),
    [
        ("# fields: depth force other", " "),
        ("%Columns\tdepth (um)\tforce (nN)\tother", "\t"),
        ("; columns: depth, force, other", ","),
        ("#Columns: depth;force;other", ";"),
        ("# Names = depth force other", " "),
        ("// header:\tdepth\tforce\tother", "\t"),
        ("# columns:\n# depth force other\n# units: um nN V", " "),
        ("Fields: depth force other", " "),
        ("# depth (um) force (nN) other", " "),
        ("# Column 1: depth (um)\n# Column 2: force (nN)\n# Column 3: other", " "),
        ("% 1. depth (um)\n% 2. force (nN)\n% 3. other (V)", "\t"),
        ("# Spalte #1 = depth [um]\n# Spalte #2 = force [nN]\n# Spalte #3 = other", ";"),
    ],
)
def test_a_label_in_front_of_the_names_is_none(head, separator, put):
    path = put(f"# made\n{head}\n" + rows(DEPTH, FORCE, DEPTH**2, separator=separator))
    columns = {"depth": "depth (um)", "force": "force (nN)"}
    is_whole(ul.read(path, columns=columns))
    if "(um)" in head or "units" in head:
        is_whole(ul.read(path))


@pytest.mark.parametrize(
    "head",
    [
        "# of the measurement: a b depth force smoothed filtered",
        "# sample depth force other and more of it",
        "# depth force",
        "this is depth force other",
    ],
)
def test_names_that_are_not_as_many_as_the_cells_are_refused(head, put):
    path = put(f"{head}\n" + rows(DEPTH, FORCE, DEPTH**2, separator=" "))
    with pytest.raises(ul.InputError):
        ul.read(path, columns={"depth": "depth (um)", "force": "force (nN)"})


# --- tests one below the other


def stacked():
    head = "z_tip (um),F (nN),clock (s)\n"
    one = rows(DEPTH, FORCE, TIME, separator=",")
    back = rows(np.r_[DEPTH, DEPTH[::-1]], np.r_[FORCE, FORCE[::-1]], np.linspace(0, 24, 480), separator=",")
    short = rows(DEPTH, FORCE, separator=",")
    there = rows(np.r_[DEPTH, DEPTH[::-1]], np.r_[FORCE, FORCE[::-1]], separator=",")
    return {
        "blank rows": head + one + "\n" + one + "\n" + one,
        "rows of separators": head + one + ",,\n" + one + ",,\n" + one,
        "names again": (head + one) * 3,
        "titles": head + one + "Test 2,,\n" + one + "Test 3,,\n" + one,
        "clock set back": head + 3 * back,
        "clock goes on": head
        + "".join(rows(DEPTH, FORCE, TIME + 12.05 * k, separator=",") for k in range(3)),
        "depth alone": "z_tip (um),F (nN)\n" + 3 * short,
        "numbers of tests": "z_tip (um),F (nN),Test\n"
        + "".join(rows(DEPTH, FORCE, np.full(240, k), separator=",") for k in (1, 2, 3)),
        "names of samples": "z_tip (um),F (nN),Sample ID\n"
        + "".join(there.replace("\n", f",{name}\n") for name in ("gel a", "gel b", "gel c")),
        "way in and out, blank rows": head + "\n\n".join([back] * 3),
        "other zero": "z_tip (um),F (nN)\n"
        + "\n".join(rows(DEPTH + shift, FORCE, separator=",") for shift in (0.0, 0.5, -0.5)),
    }


@pytest.mark.parametrize("text", stacked().values(), ids=stacked())
def test_tests_one_below_the_other_are_several(text, put):
    columns = {"depth": "z_tip (um)", "force": "F (nN)"}
    curves = ul.read_all(put(text), columns=columns)
    assert len(curves) == 3
    assert len({len(curve) for curve in curves}) == 1
    assert any("3 tests one below the other" in note for note in curves[0].metadata["notes"])
    with pytest.raises(ul.InputError, match="holds 3 tests"):
        ul.read(put(text), columns=columns)


@pytest.mark.parametrize("name", ["test", "Sample ID", "curve no."])
def test_mixed_rows_of_several_tests_are_refused(name, put):
    body = "".join(f"{d:.5f},{f:.5f},{k}\n" for d, f in zip(DEPTH, FORCE, strict=True) for k in (1, 2, 3))
    few = "".join(
        f"{d:.5f},{f:.5f},{k}\n" for k in range(9) for d, f in zip(DEPTH[::60], FORCE[::60], strict=True)
    )
    with pytest.raises(ul.FileFormatError, match="fewer than 8 each"):
        ul.read_all(put(f"depth (um),force (nN),{name}\n{few}"))
    with pytest.raises(ul.FileFormatError, match="rows of several tests are mixed"):
        ul.read_all(put(f"depth (um),force (nN),{name}\n{body}"))


@pytest.mark.parametrize("kind", ["segments", "cycles", "double spaced", "steps"])
def test_segments_and_cycles_of_one_test_are_one(kind, put):
    head, into, out = "depth (um),force (nN),time (s)\n", (DEPTH, FORCE), (DEPTH[::-1], FORCE[::-1])
    if kind == "segments":
        text = head + rows(*into, TIME, separator=",") + "\n" + rows(*out, TIME, separator=",")
    elif kind == "cycles":
        clock = iter(np.arange(6))
        text = head + "".join(
            rows(*way, TIME + 12.05 * next(clock), separator=",") for way in (into, out) * 3
        )
    elif kind == "double spaced":
        text = head + rows(*into, TIME, separator=",").replace("\n", "\n\n")
    else:
        steps = [np.r_[np.linspace(k, k + 1, 40), np.full(40, k + 1.0)] for k in range(4)]
        text = head + "\n".join(
            rows(s, s**1.5, np.arange(80) + 80 * k, separator=",") for k, s in enumerate(steps)
        )
    assert len(ul.read_all(put(text))) == 1


# --- segments


@pytest.mark.parametrize("noise", [0.0, 0.05, 0.3])
@pytest.mark.parametrize("lets_go", [1.0, 0.9, 0.5])
@pytest.mark.parametrize("peaks", [(5, 20, 40), (10, 20, 30, 40), (40, 40, 40, 40)])
def test_every_unloading_of_a_stiff_sample_is_seen(peaks, lets_go, noise):
    depth, force, truth, plastic, at = [], [], [], 0.0, 0.0
    for peak in peaks:
        load = np.linspace(at, peak, 60)
        plastic = 100.0 * np.sqrt(peak)
        first = depth[-1] if depth else 0.0
        depth += [*np.linspace(first, plastic, 60), *np.full(30, plastic)]
        at = (1.0 - lets_go) * peak
        back = np.linspace(peak, at, 60)
        depth += list(plastic - (peak - back) / 1.3)
        force += [*load, *np.full(30, peak), *back]
        truth += [60 * ["loading"], 30 * ["hold"], 60 * ["unloading"]]
    depth, force = np.array(depth), np.array(force)
    depth += noise * np.random.default_rng(3).standard_normal(len(depth))
    labels = segments_from_motion(1e-9 * depth, 0.1 * np.arange(len(depth)), 1e-3 * force)
    found = np.count_nonzero(labels == "unloading")
    assert found == pytest.approx(60 * len(peaks), abs=4 * len(peaks))


@pytest.mark.parametrize("share", [0.3, 0.5, 0.9])
def test_a_ramp_that_the_file_calls_a_hold_is_one(share, put):
    ramp = np.r_[np.linspace(0.0, 18.0, 180), np.full(200, 18.0)]
    force = np.clip(ramp, 0, None) ** 1.5 * np.r_[np.ones(180), np.exp(-np.arange(200) / 100.0)]
    words = np.where(np.arange(380) < share * 180, "loading", "hold")
    text = "depth (um),force (nN),time (s),segment\n" + "\n".join(
        f"{d:.5f},{f:.5f},{0.1 * i:.1f},{w}"
        for i, (d, f, w) in enumerate(zip(ramp, force, words, strict=True))
    )
    curve = ul.read(put(text))
    assert len(curve.loading()) == pytest.approx(180, abs=3)
    assert "the motion decides" in curve.metadata["notes"][0]


@pytest.mark.parametrize(
    "marks",
    [
        ("Load Segment Type", "Hold Segment Type", "Unload From Peak Segment Type"),
        ("Approach", "Hold at peak", "Unload"),
        ("", "End Of Loading Index", "End Of Hold Index"),
    ],
)
def test_the_marks_of_the_instrument_come_first(marks, put):
    """A stiff sample comes back by a hundredth of its way: the motion alone would call that a rest."""
    depth = np.r_[np.linspace(0, 500, 60), np.full(20, 500.0), np.linspace(500, 470, 40)]
    force = np.r_[np.linspace(0, 40, 60), np.full(20, 40.0), np.linspace(40, 0, 40)]
    cells = dict(zip((0, 60, 80), marks, strict=True))
    lines = [
        f"{cells.get(at, '')};{d:.3f};{f:.4f}" for at, (d, f) in enumerate(zip(depth, force, strict=True))
    ]
    curve = ul.read(put("Markers;Depth (nm);Load (mN)\n" + "\n".join(lines)))
    assert (curve.segments() == np.repeat(("loading", "hold", "unloading"), (60, 20, 40))).mean() > 0.98


@pytest.mark.parametrize("pull", [0.1, 0.5, 2.0])
def test_a_meniscus_in_front_of_contact_is_no_baseline(pull):
    x = np.linspace(0.0, 40.0, 800)
    contact, snap = 21.0, 12.0
    force = 3.0 * np.clip(x - contact, 0.0, None) ** 1.5
    force -= np.where((x > snap) & (x < contact), pull * 60.0 * (contact - x) / (contact - snap), 0.0)
    force += 0.2 * np.random.default_rng(1).standard_normal(len(x))
    found = ul.find_contact(ul.Curve(1e-6 * x, 1e-6 * force))
    assert found.depth == pytest.approx(contact * 1e-6, abs=1.0e-6)
    assert abs(found.baseline) < 0.3e-6


# --- levers, converters, and what no sample does


@pytest.mark.parametrize("fault", [1.1, 1.38, 2.0])
@pytest.mark.parametrize("known", [True, False])
def test_a_sensitivity_that_is_too_large_is_named_with_the_ratio(fault, known):
    travel = np.linspace(0.0, 400.0, 400)
    bending = fault * np.clip(travel - 300.0, 0.0, None) + 0.2 * np.random.default_rng(2).standard_normal(400)
    about = {"spring_constant": 0.8} if known else {}
    curve = ul.Curve(1e-9 * (travel - bending), 0.8e-9 * bending, metadata=about)
    verdict = ul.check_quality(curve)
    assert verdict.verdict == "refused"
    told = float(re.search(r"([\d.]+) nm per nm of travel", verdict.reasons[0]).group(1))
    assert told == pytest.approx(fault, abs=0.03)


@pytest.mark.parametrize("share", [0.6, 0.8, 0.95])
def test_a_flat_top_is_a_saturated_detector(share):
    force = np.minimum(FORCE, share * FORCE.max()) + 1e-4 * np.random.default_rng(0).standard_normal(240)
    force = np.where(share * FORCE.max() < FORCE, share * FORCE.max(), force)
    reasons = ul.check_quality(ul.Curve(1e-6 * DEPTH, 1e-9 * force)).reasons
    assert any(reason.startswith("a flat top") for reason in reasons)
    assert not any("flat top" in r for r in ul.check_quality(ul.Curve(1e-6 * DEPTH, 1e-9 * FORCE)).reasons)


@pytest.mark.parametrize("step", [0.05, 0.2, 0.5])
def test_the_scatter_is_not_below_that_of_the_converter(step):
    force = step * np.rint(FORCE / step)
    found = ul.find_contact(ul.Curve(1e-6 * DEPTH, 1e-9 * force))
    assert found.noise >= 1e-9 * step / np.sqrt(12.0) * (1 - 1e-9)


@pytest.mark.parametrize("rise", [0.1, 0.3, 1.0])
def test_a_force_that_rises_while_the_depth_is_held_is_named(rise):
    depth, force = (
        np.r_[DEPTH, np.full(200, 3.0)],
        np.r_[FORCE, FORCE[-1] * (1 + rise * np.linspace(0, 1, 200))],
    )
    curve = ul.Curve(1e-6 * depth, 1e-9 * force, 0.05 * np.arange(440))
    assert any("while the depth is held" in reason for reason in ul.check_quality(curve).reasons)


def test_no_curve_ends_in_an_error_of_another_kind():
    rng = np.random.default_rng(11)
    for number in range(600):
        n = int(rng.integers(8, 90))
        depth = np.cumsum(rng.normal(rng.choice([0.0, 0.3, 1.0]), 1.0, n)) * 1e-8
        force = np.clip(depth - rng.uniform(-1, 1) * 1e-7, 0, None) ** 1.5 * rng.choice([1, -1])
        force = force + rng.standard_normal(n) * rng.choice([0.0, 1e-12, 1e-10])
        force = np.round(force, 10) if number % 7 == 0 else force
        depth = depth - force * rng.choice([0.0, 1.0, 100.0])
        curve = ul.Curve(depth, force, segment=None if number % 2 else ["loading"] * n)
        assert ul.check_quality(curve).verdict in {"good", "doubtful", "refused"}
        try:
            ul.find_contact(curve)
        except ul.UnderlayError as error:
            assert "\n" not in str(error)  # noqa: PT017  each is one line


# --- microscopes' text


def jpk_text(names, fancy, segments):
    """A text export of JPK; what is called smoothed is no channel to read."""
    height, force = 1e-6 * (9.0 - DEPTH) - FORCE * 1e-9 / STIFFNESS, FORCE * 1e-9
    channels = [(TIME, "s") if "time" in name.lower() else (height, "m") for name in names]
    channels = [
        (force, "N") if name == "vDeflection" else (force, "m") if "smooth" in name else channel
        for name, channel in zip(names, channels, strict=True)
    ]
    parts = []
    for number, segment in enumerate(segments):
        way = slice(None, None, -1) if segment == "retract" else slice(None)
        body = [values[way] if segment != "pause" else np.full(240, values[-1]) for values, _ in channels]
        parts.append(
            f"# index: 0\n# segmentIndex: {number}\n# segment: {segment}\n# columns: {' '.join(names)}\n"
            + (f"# fancyNames: {fancy}\n" if fancy else "")
            + f"# springConstant: {STIFFNESS}\n# units: {' '.join(unit for _, unit in channels)}\n#\n"
            + rows(*body, separator=" ", form="{:.9E}")
        )
    return "# TEXT EXPORT\n#\n" + "\n\n#\n".join(parts)


@pytest.mark.parametrize(
    ("names", "fancy", "segments"),
    [
        ("vDeflection strainGaugeHeight time", "", "extend retract"),
        ("height vDeflection", '"Height" "Vertical Deflection"', "extend"),
        ("measuredHeight vDeflection", "", "extend pause retract"),
        (
            "seriesTime smoothedHeight measuredHeight vDeflection",
            '"Series Time" "Height (smoothed)" "Height (measured)" "Vertical Deflection"',
            "extend retract",
        ),
    ],
)
@pytest.mark.parametrize("comma", [False, True])
def test_jpk_text_exports(names, fancy, segments, comma, put):
    text = jpk_text(names.split(), fancy, segments.split())
    curve = ul.read(put(re.sub(r"(\d)\.(\d+E)", r"\1,\2", text) if comma else text))
    words = {"extend": "loading", "retract": "unloading", "pause": "hold"}
    assert list(curve.segment) == list(np.repeat([words[s] for s in segments.split()], 240))
    np.testing.assert_allclose(curve.loading().force, FORCE * 1e-9, rtol=1e-8, atol=1e-17)
    np.testing.assert_allclose(curve.loading().depth, (DEPTH - 9.0) * 1e-6, atol=1e-14)
    assert curve.metadata["spring_constant"] == STIFFNESS


@pytest.mark.parametrize("segments", ["extend retract", "extend pause retract", "pause extend pause"])
def test_a_clock_that_each_segment_sets_back_goes_on(segments, put):
    text = jpk_text(["measuredHeight", "vDeflection"], "", segments.split()).split("\n")
    clock, count = iter([]), 0
    for at, line in enumerate(text):
        if line.startswith("# segment:"):
            clock = iter(TIME)
        elif line.startswith(("# columns:", "# units:")):
            text[at] = f"{line} {'time' if 'columns' in line else 's'}"
        elif line and not line.startswith("#"):
            text[at], count = f"{line} {next(clock):.6f}", count + 1
    curve = ul.read(put("\n".join(text)))
    np.testing.assert_allclose(curve.time, np.arange(count) * TIME[1], atol=1e-5)
    assert any("sets the clock back" in note for note in curve.metadata["notes"])


@pytest.mark.parametrize("head", [0, 8, 658])
@pytest.mark.parametrize("columns", ["all", "volts", "deflection"])
def test_nanoscope_ascii_side_by_side(head, columns, put):
    bending = FORCE / STIFFNESS
    ramp = 1e3 * DEPTH + bending
    named = {
        "Calc_Ramp_{}_nm": ramp,
        "Defl_nm_{}": bending,
        "Defl_V_{}": bending / 41.0,
        "Defl_pN_{}": 1e3 * FORCE,
    }
    kept = {"all": [0, 1, 3], "volts": [0, 1, 2], "deflection": [0, 1]}[columns]
    pairs = [list(named.items())[k] for k in kept]
    lines = ['"\\?Force file list"'] + [f'"\\Setting {k}: 3.5 nm"' for k in range(max(head - 3, 0))]
    lines += ['"\\Spring Constant: 0.06"', '"\\@Sens. DeflSens: V 41.0 nm/V"']
    names = "\t".join(name.format(way) for name, _ in pairs for way in ("Ex", "Rt"))
    body = [column[:: 1 if way == "Ex" else -1] for _, column in pairs for way in ("Ex", "Rt")]
    text = "\r\n".join([*(lines if head else []), names + "\t", rows(*body).replace("\n", "\t\r\n")])
    curve = ul.read(put(text), calibration=None if head else {"spring_constant": "0.06 N/m"})
    is_whole(curve.loading().select(slice(None)), DEPTH * 1e-6)
    assert len(curve.unloading()) == 240
    assert curve.metadata["spring_constant"] == STIFFNESS


@pytest.mark.parametrize("given", ["0.06 N/m", "0.12 N/m"])
@pytest.mark.parametrize("signal", ["Defl_nm_Ex", "Defl_V_Ex", "Defl_pN_Ex"])
@pytest.mark.parametrize("way", ["Ex", "approach", "Loading"])
def test_one_way_of_a_microscope_alone(signal, given, way, put):
    """A calibration that is given makes the file's own forces anew."""
    bending, times = FORCE / STIFFNESS, float(given.split()[0]) / STIFFNESS
    column = {"n": bending, "V": bending / 41.0, "p": 1e3 * FORCE}[signal[5]]
    head = '"\\Spring Constant: 0.06"\n"\\@Sens. DeflSens: V 41.0 nm/V"\n'
    names = f"Calc_Ramp_Ex_nm\t{signal}".replace("_Ex", f"_{way}")
    path = put(f"{head}{names}\n" + rows(1e3 * DEPTH + bending, column, form="{:.9f}"))
    is_whole(ul.read(path, calibration={"spring_constant": given}), DEPTH * 1e-6, times * FORCE * 1e-9)


@pytest.mark.parametrize("signal", ["Defl_nm", "Defl_V", "Defl_pN"])
def test_a_sensitivity_that_is_given_acts_on_lengths_and_forces_too(signal, put):
    """Where the file says with which one they were made; it is refused where it does not."""
    bending = FORCE / STIFFNESS
    column = {"n": bending, "V": bending / 41.0, "p": 1e3 * FORCE}[signal[5]]
    head = '"\\Spring Constant: 0.06"\n"\\@Sens. DeflSens: V 41.0 nm/V"\n'
    table = f"Calc_Ramp_nm\t{signal}\n" + rows(1e3 * DEPTH + bending, column, form="{:.9f}")
    given = {"sensitivity": "20.5 nm/V", "spring_constant": "0.06 N/m"}
    is_whole(
        ul.read(put(head + table), calibration=given),
        1e-6 * DEPTH + 0.5e-9 * bending,
        0.5e-9 * FORCE,
    )
    if signal != "Defl_V":
        with pytest.raises(ul.InputError, match="does not say with which sensitivity"):
            ul.read(put(table), calibration=given)


def test_volts_of_jpk_take_the_sensitivity_of_the_head(put):
    text = jpk_text(["measuredHeight", "vDeflection"], "", ["extend", "retract"])
    text = text.replace("# units: m N", "# sensitivity: 5.0E-8\n# units: m V")
    curve = ul.read(put(text))
    np.testing.assert_allclose(curve.loading().force, FORCE * 1e-9 * STIFFNESS * 5e-8, rtol=1e-8, atol=1e-25)


@pytest.mark.parametrize("kind", ["table", "several", "igor", "waves", "volts"])
def test_asylum_text(kind, put):
    bending = 1e-9 * FORCE / STIFFNESS
    raw = 1e-6 * DEPTH + bending
    given = {"spring_constant": "0.06 N/m"}
    form = {"form": "{:.9e}"}
    if kind == "table":
        text = "Raw\tDefl\n" + rows(raw, bending, **form)
    elif kind == "several":
        text = "c0001Raw\tc0001Defl\tc0002Raw\tc0002Defl\n" + rows(raw, bending, raw, bending, **form)
    elif kind == "waves":
        blocks = (("Raw", raw), ("Defl", bending))
        text = "IGOR\n" + "".join(f"WAVES/D\t{n}\nBEGIN\n{rows(v, **form)}END\n" for n, v in blocks)
    elif kind == "volts":
        given["sensitivity"] = "50 nm/V"
        text = "ZSnsr (m)\tDeflV (V)\n" + rows(raw, bending / 50e-9, **form)
    else:
        text = (
            "IGOR\nWAVES/D\tRaw\tDefl\nBEGIN\n"
            + rows(raw, bending, **form)
            + 'END\nX SetScale d,0,0,"m",Raw\n'
        )
    curves = ul.read_all(put(text), calibration=given)
    assert len(curves) == (2 if kind == "several" else 1)
    for curve in curves:
        np.testing.assert_allclose(curve.force, 1e-9 * FORCE, rtol=1e-8, atol=1e-18)
        if kind != "volts":
            np.testing.assert_allclose(curve.depth, 1e-6 * DEPTH, atol=1e-14)
    with pytest.raises(ul.InputError, match="calibration"):
        ul.read_all(put(text))


@pytest.mark.parametrize("waves", ["WAVES/D", "WAVES/D;Raw;Defl", "WAVES\t", "WAVES ''"])
def test_igor_text_whose_waves_have_no_names_is_refused_in_words(waves, put):
    text = f"IGOR\n{waves}\nBEGIN\n" + rows(1e-6 * DEPTH, 1e-9 * FORCE, form="{:.9e}") + "END\n"
    with pytest.raises(ul.FileFormatError):
        ul.read(put(text), calibration={"spring_constant": "0.06 N/m"})


# --- wide tables, in text and in workbooks


@pytest.mark.parametrize(
    "head", ["Time (s),Load (nN),Extension (um)", "Extension,Load\num,nN", "h (um),F (nN),remark"]
)
@pytest.mark.parametrize("separator", [",", "\t", ";"])
def test_the_same_names_side_by_side_are_several_tests(head, separator, put):
    """As testing machines write several specimens; a column without a name may stand between them."""
    columns = {"T": TIME, "L": FORCE, "F": FORCE, "r": TIME}
    one = [columns.get(name[0], DEPTH) for name in head.split("\n")[0].split(",")]
    lines = [separator.join([*line.split(","), "", *line.split(",")]) for line in head.split("\n")]
    body = rows(*one, separator=separator).split("\n")[:-1]
    short = [*body[:200], *[separator * (len(one) - 1)] * 40]
    text = "\n".join([*lines, *(f"{a}{separator}{separator}{b}" for a, b in zip(body, short, strict=True))])
    first, second = ul.read_all(put(text))
    is_whole(first)
    is_whole(second, 1e-6 * DEPTH[:200], 1e-9 * FORCE[:200])


@pytest.mark.parametrize("kind", ["TXT", "xlsx", "names with blanks"])
def test_anton_paar_tests_side_by_side(kind, put):
    names = {"TXT": ("a_1", "a_2"), "xlsx": ("gel 4%_1", "b"), "names with blanks": ("my gel_1", "my gel_2")}[
        kind
    ]
    heads = [
        f"{axis}_{name}_{what}"
        for name in names
        for axis, what in (("X", "Time_[s]"), ("Y", "Fn_[mN]"), ("X", "Time_[s]"), ("Y", "Pd_[nm]"))
    ]
    short = 200
    cells = [
        [*map(float, row), *(map(float, row) if i < short else [None] * 4)]
        for i, row in enumerate(zip(TIME, FORCE, TIME, DEPTH, strict=True))
    ]
    if kind == "xlsx":
        path = put(sheet_of((heads, *cells)), "wide.xlsx")
    else:
        lines = ["\t".join("" if cell is None else f"{cell:.7g}" for cell in row) + "\t" for row in cells]
        path = put("\t".join(heads) + "\t\r\n" + "\r\n".join(lines), "wide.TXT")
    one, other = ul.read_all(path)
    assert [one.metadata["name"], other.metadata["name"]] == list(names)
    assert (len(one), len(other)) == (240, short)
    np.testing.assert_allclose(one.depth, 1e-9 * DEPTH, atol=1e-15)
    np.testing.assert_allclose(other.force, 1e-3 * FORCE[:short], rtol=1e-6)


@pytest.mark.parametrize(
    "head",
    [
        "depth1 (um),force1 (nN),depth2 (um),force2 (nN)",
        "depth (um),force (nN),depth (um).1,force (nN).1",
        "force B (nN),depth B (um),time (s),force A (nN),depth A (um)",
        "depth 1 (um),force 1 (nN),E 1,depth 2 (um),force 2 (nN),E 2",
        ",".join(["depth (um),force (nN)"] * 150),
    ],
)
def test_names_with_a_number_or_a_letter_are_those_of_several_tests(head, put):
    columns = {"d": DEPTH, "f": FORCE, "t": TIME, "E": TIME}
    body = rows(*(columns[name[0]] for name in head.split(",")), separator=",")
    for curve in ul.read_all(put(f"{head}\n{body}")):
        is_whole(curve)
        assert (curve.time is None) == ("time" not in head)
    assert len(ul.read_all(put(f"{head}\n{body}"))) == head.count("force")


@pytest.mark.parametrize(
    "head", ["depth (um),force 1 (nN),force 2 (nN),t", "Depth X (um),Force X (nN),Depth Y (um),Force Y (nN)"]
)
def test_two_cells_or_two_axes_are_not_two_tests(head, put):
    with pytest.raises(ul.FileFormatError, match="has no column for the"):
        ul.read_all(put(f"{head}\n" + rows(DEPTH, FORCE, DEPTH, FORCE, separator=",")))


# --- tables as people write them


@pytest.mark.parametrize("kind", ["text", "blanks", "sheet"])
@pytest.mark.parametrize("rows_below", [("um nN",), ("um nN", "gel1 gel1"), ("(um) (nN)", "a b")])
def test_units_stand_in_a_row_below_the_names_and_remarks_below_them(kind, rows_below, put):
    heads = [row.split() for row in ("depth force", *rows_below)]
    if kind == "sheet":
        path = put(sheet_of((*heads, *zip(DEPTH.tolist(), FORCE.tolist(), strict=True))), "o.xlsx")
    else:
        between = "\t" if kind == "text" else "   "
        path = put("\n".join(map(between.join, heads)) + "\n" + rows(DEPTH, FORCE, separator=between))
    is_whole(ul.read(path))


@pytest.mark.parametrize("sheet", [False, True])
def test_other_units_further_down_are_refused(sheet, put):
    blocks = [["depth", "force"], [], *zip(DEPTH.tolist(), FORCE.tolist(), strict=True)]
    cells = [row or ["um", "nN"] for row in blocks] + [row or ["nm", "nN"] for row in blocks]
    text = "\n".join(",".join(map(str, row)) for row in cells)
    path = put(sheet_of(cells), "two.xlsx") if sheet else put(text)
    with pytest.raises(ul.FileFormatError, match=r"other units further down \('nm', 'nN'\)"):
        ul.read_all(path)


@pytest.mark.parametrize(
    "text",
    [
        '"depth\n(um)","force\n(nN)"\n' + rows(DEPTH, FORCE, separator=","),
        '"depth (nm)","force (pN)"\n' + rows(1e3 * DEPTH, 1e3 * FORCE, separator='","', form="{:,.3f}"),
        "depth (um)\tforce (nN)\n" + rows(DEPTH, FORCE).replace("-", "\u2212"),
        "depth (um):\tforce (nN):\n" + rows(DEPTH, FORCE),
        "Channel 1: depth (um)\nChannel 2: force (nN)\n".replace("Ch", "# Ch") + rows(DEPTH, FORCE),
        "; depth [um]; force [nN]\n" + rows(DEPTH, FORCE, separator=";"),
    ],
    ids=["names over two lines", "thousands", "minus signs", "colons", "channels", "semicolons"],
)
def test_tables_as_spreadsheets_and_plots_write_them(text, put):
    if '","' in text.split("\n")[2]:
        head, *body = text.strip().split("\n")
        text = "\n".join([head, *(f'"{line}"' for line in body)])
    is_whole(ul.read(put(text)))


def test_commas_that_come_after_many_zeros_are_of_decimals(put):
    body = "".join(f"{at - 301};0\n" for at in range(300)) + rows(DEPTH, FORCE, separator=";")
    curve = ul.read(put("Weg (um);Kraft (nN)\n" + body.replace(".", ",")))
    is_whole(curve.select(slice(300, None)))


def test_a_last_row_that_is_cut_short_does_not_cost_the_time(put):
    text = "depth (um),force (nN),time (s)\n" + rows(DEPTH, FORCE, TIME, separator=",")
    with pytest.raises(ul.FileFormatError, match="may be cut short"):
        ul.read(put(text + "3.1,20.9"))


@pytest.mark.parametrize("said", ["0.06 N/m", "60 pN/nm", "60 mN/m", "0.06"])
@pytest.mark.parametrize("name", ["Spring constant", "springConstant", "\\Spring Constant"])
def test_the_unit_of_a_spring_constant_counts(said, name, put):
    bending = 1e-3 * FORCE / STIFFNESS
    text = f"# {name}: {said}\nz sensor (um);Deflection (um)\n"
    text = text if said != "0.06" or name != "Spring constant" else text.replace("0.06", "0.06 N/m")
    is_whole(ul.read(put(text + rows(DEPTH + bending, bending, separator=";", form="{:.9f}"))))


@pytest.mark.parametrize(
    ("head", "factor"),
    [
        ("depth_um,force_nN", 1.0),
        ("depth/um,force/nN", 1.0),
        ("Depth in um,Force in nN", 1.0),
        ("depth: um,load: nN", 1.0),
        ("depth-um,load-nN", 1.0),
        ("w {um},P {nN}", 1.0),
        ("delta <um>,F <nN>", 1.0),
        ("Standardweg,Kraft\num,nN", 1.0),
        ("Extension,Load\n(micron),(nN)", 1.0),
        ("Displacement (Microns),Load (NanoNewtons)", 1.0),
        ("Stroke [um],F [nN]", 1.0),
        ("Position (um),Force (nN)", 1.0),
        ("Displacement um,Force nN", 1.0),
        ("h (um),P (nN)", 1.0),
        ("Axial Displacement (um),Axial Force (nN)", 1.0),
        ("Position(z) (um),Fz (nN)", 1.0),
        ("Deformation (um),Normal Load (nN)", 1.0),
        ("profundidade (um),força (nN)", 1.0),
        ("深度 (um),载荷 (nN)", 1.0),
        ("depth (um),weight_g,force (g)", 9.80665e6),
        ("depth (um),force in lbs", 4.4482216152605e9),
        ("depth (um),Load_kg", 9.80665e9),
        ("depth (um),Force (Newtons)", 1e9),
    ],
)
def test_units_and_names_as_people_write_them(head, factor, put):
    columns = [DEPTH, *[FORCE] * (head.split("\n")[0].count(","))]
    curve = ul.read(put(head + "\n" + rows(*columns, separator=",")))
    np.testing.assert_allclose(curve.depth, 1e-6 * DEPTH, atol=1.1e-12)
    np.testing.assert_allclose(curve.force, 1e-9 * factor * FORCE, rtol=1e-6, atol=1e-15 * factor)


@pytest.mark.parametrize(
    ("head", "row"),
    [
        ("depth (um)|force (nN)|time (s)", "{}|{}|{}"),
        ("# depth (um) | force (nN) | time (s)", "{} | {} | {}"),
        ("| depth (um) | force (nN) | time (s) |\n|---|:---:|---|", "| {} | {} | {} |"),
        ("Tiefe|Kraft|Zeit\num|nN|s", "{}|{}|{}"),
    ],
)
@pytest.mark.parametrize("comma", [False, True])
def test_bars_between_the_cells(head, row, comma, put):
    body = "\n".join(
        row.format(f"{d:.6f}", f"{f:.6f}", f"{t:.6f}") for d, f, t in zip(DEPTH, FORCE, TIME, strict=True)
    )
    curve = ul.read(put(f"{head}\n{body.replace('.', ',') if comma else body}\n"))
    is_whole(curve)
    np.testing.assert_allclose(curve.time, TIME, atol=1e-6)


@pytest.mark.parametrize(
    ("head", "depth"),
    [
        ("d (um),F (nN),other", 0),
        ("t (s),d (um),force (nN)", 1),
        ("F (nN),d_um,note", 1),
        ("d,F\num,nN", 0),
        ("d (um),h (um),F (nN)", 1),
        ("d (um),Extension (um),Load (nN)", 1),
        ("d (um),measuredHeight (um),F (nN)", 1),
        ("D (um),F (nN)", None),
        ("d (um),weight of it,other (nN)", None),
        ("d (V),F (nN)", None),
        ("d (um),d (um),F (nN)", None),
    ],
)
def test_d_is_a_depth_where_a_force_stands_beside_it_and_no_other_depth(head, depth, put):
    names = head.split("\n")[0].split(",")
    is_force = [name.startswith(("F", "Load", "force")) for name in names]
    columns = [FORCE if one else DEPTH if at == depth else TIME - 6.0 for at, one in enumerate(is_force)]
    if depth is not None and "Height" in names[depth]:
        columns[depth] = -DEPTH
    path = put(head + "\n" + rows(*columns, separator=","))
    if depth is None:
        with pytest.raises(ul.InputError, match="column"):
            ul.read(path)
    else:
        is_whole(ul.read(path))


@pytest.mark.parametrize("head", ["Height (um)", "Separation (um)", "measuredHeight_um"])
def test_a_height_falls_towards_the_sample(head, put):
    curve = ul.read(put(f"{head},Force (nN)\n" + rows(5.0 - DEPTH, FORCE, separator=",")))
    np.testing.assert_allclose(curve.depth, 1e-6 * (DEPTH - 5.0), atol=1.1e-12)


@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_a_position_that_grows_either_way_goes_in(sign, put):
    curve = ul.read(put("z (um),F (nN)\n" + rows(sign * DEPTH, FORCE, separator=",")))
    np.testing.assert_allclose(np.ptp(curve.depth), 4e-6, rtol=1e-6)
    assert curve.depth[-1] > curve.depth[0]
    assert any("turned" in note for note in curve.metadata["notes"]) == (sign < 0)


@pytest.mark.parametrize(
    "above",
    [
        '"Results Table 1"\n,"Maximum Load (N)","Modulus (MPa)"\n1,"18.2","0.5"\n2,"18.1","0.4"\n\n',
        "Specimen,A1\nOperator,somebody\nRate,0.1,mm/min\n\n",
        "test 1 of 3\n2026-01-02 10:00\n\n1,2,3\n4,5,6\n\n",
    ],
)
def test_what_stands_above_the_readings_is_passed_over(above, put):
    text = (
        above + "Time,Extension,Load,Note\n(s),(mm),(N),\n" + rows(TIME, DEPTH, FORCE, DEPTH, separator=",")
    )
    curve = ul.read(put(text))
    np.testing.assert_allclose(curve.depth, 1e-3 * DEPTH, atol=1e-9)
    assert curve.time is not None


@pytest.mark.parametrize(
    "head", ["depth (um),force (nN),time (bananas)", "depth (um),force (nN),time", "depth (um),force (nN),t"]
)
@pytest.mark.parametrize("cell", ["{:.3f}", "8:00:{:04.1f} AM", "n{:.0f}"])
def test_a_column_that_nobody_asked_for_never_refuses_a_file(head, cell, put):
    lines = [f"{d:.6f},{f:.6f},{cell.format(t)}" for d, f, t in zip(DEPTH, FORCE, TIME, strict=True)]
    if cell.startswith("n"):
        lines = [line.rsplit(",", 1)[0] + ",on" for line in lines]
    curve = ul.read(put(head + "\n" + "\n".join(lines)))
    is_whole(curve)
    assert any("the time is left out" in note for note in curve.metadata["notes"])


@pytest.mark.parametrize(
    "columns",
    [
        {"depth": "2 (um)", "force": "3 (nN)"},
        {"depth": "2 um", "force": "3 nN", "time": "1 s"},
        {"depth": "#2 [um]", "force": "column 3 (nN)"},
        {"depth": "-(0 um - #2 (um))", "force": "#3 (nN)"},
    ],
)
@pytest.mark.parametrize("separator", ["\t", " ", ",", ";"])
def test_columns_by_number(columns, separator, put):
    is_whole(ul.read(put(rows(TIME, DEPTH, FORCE, separator=separator)), columns=columns))


def test_a_number_without_a_unit_asks_for_it(put):
    with pytest.raises(ul.InputError, match=r'columns = \{ depth = "2 \(um\)" \}'):
        ul.read(put(rows(TIME, DEPTH, FORCE)), columns={"depth": 2, "force": 3})


@pytest.mark.parametrize(
    ("depth", "force"),
    [
        ("ramp - deflection", "deflection * 0.06 N/m"),
        ("ramp - volts * 41 nm/V", "volts * 41 nm/V * 0.06 N/m"),
        ("ramp (um) - (volts * 41 nm/V)", "0.06 N/m * (deflection)"),
        ("-(volts*41 nm/V - ramp)", "force / 2 * 2"),
        ("ramp - force / 0.06 N/m", "force"),
    ],
)
def test_columns_as_sums_and_products(depth, force, put):
    bending = FORCE / STIFFNESS * 1e-3
    text = "ramp (um),deflection (um),volts (V),force (nN)\n" + rows(
        DEPTH + bending, bending, 1e3 * bending / 41.0, FORCE, separator=",", form="{:.9f}"
    )
    curve = ul.read(put(text), columns={"depth": depth, "force": force})
    np.testing.assert_allclose(curve.depth, 1e-6 * DEPTH, atol=1e-13)
    np.testing.assert_allclose(curve.force, 1e-9 * FORCE, atol=1e-16)


@pytest.mark.parametrize(
    ("depth", "told"),
    [
        ("ramp + volts", "cannot be added"),
        ("ramp * 3 N/m", "a length is needed"),
        ("ramp - (deflection", "bracket"),
        ("ramp - 3 bananas", "unit"),
        ("ramp / 0", "divides by zero"),
        ("__import__('os').system('true') + ramp", "no column"),
        ("(" * 300 + "ramp", "no column"),
        ("ramp ** 9", "not understood|no column"),
    ],
)
def test_a_sum_that_makes_no_length_is_refused_in_words(depth, told, put):
    path = put(
        "ramp (um),deflection (um),volts (V),force (nN)\n" + rows(DEPTH, DEPTH, DEPTH, FORCE, separator=",")
    )
    with pytest.raises(ul.InputError, match=told) as error:
        ul.read(path, columns={"depth": depth, "force": "force"})
    assert "\n" not in str(error.value)


# --- archives, workbooks, compressed and binary files


BESIDE = "__MACOSX/._a.csv .DS_Store README.txt photo.png notes.md b/Thumbs.db odd.dat bad.csv"


@pytest.mark.parametrize("member", BESIDE.split())
def test_a_bad_member_never_refuses_the_others(member, put):
    good = "depth (um),force (nN)\n" + rows(DEPTH, FORCE, separator=",")
    content = io.BytesIO()
    with zipfile.ZipFile(content, "w") as archive:
        archive.writestr(
            member, b"depth (um),force (nN)\n1,oops\n2,3\n4,5\n" if member == "bad.csv" else b"\0\1\2 hello"
        )
        archive.writestr("run/a.csv", good)
    (curve,) = ul.read_all(put(content.getvalue(), "all.zip"))
    is_whole(curve)
    assert member in str(curve.metadata["notes"])


def test_a_bad_sheet_never_refuses_the_others(put):
    book = openpyxl.Workbook()
    book.active.title = "Results"
    for row in (["Test", "depth (um)", "force (nN)"], [1, "bad", 2.0], [2, 3.0, 4.0], [3, 3.0, 4.0]):
        book.active.append(row)
    sheet = book.create_sheet("curve")
    sheet.append(["depth (um)", "force (nN)"])
    for row in zip(map(float, DEPTH), map(float, FORCE), strict=True):
        sheet.append(row)
    (curve,) = ul.read_all(put(saved(book), "book.xlsx"))
    is_whole(curve)


@pytest.mark.parametrize("parts", [1, 2, 3])
def test_text_in_gzip(parts, put):
    text = ("depth (um),force (nN)\n" + rows(DEPTH, FORCE, separator=",")).encode()
    cuts = np.linspace(0, len(text), parts + 1).astype(int)
    packed = b"".join(gzip.compress(text[a:b]) for a, b in itertools.pairwise(cuts))
    is_whole(ul.read(put(packed, "c.csv.gz")))
    with pytest.raises(ul.FileFormatError, match=r"cut short|damaged"):
        ul.read(put(packed[: len(packed) // 2], "cut.csv.gz"))


def test_gzip_that_unpacks_without_end_is_refused(put):
    with pytest.raises(ul.FileFormatError, match="unpacks to more than"):
        ul.read(put(gzip.compress(bytes(300_000_000), 9), "bomb.csv.gz"))


@pytest.mark.parametrize("packed", [True, False])
@pytest.mark.parametrize("kind", ["named", "structure", "matrix"])
def test_matlab(kind, packed, tmp_path):
    content, columns = {
        "named": ({"depth_um": DEPTH, "force_nN": FORCE, "who": "me"}, None),
        "structure": (
            {"run": {"z": DEPTH, "F": FORCE, "n": 3}},
            {"depth": "run.z (um)", "force": "run.F (nN)"},
        ),
        "matrix": ({"M": np.column_stack((TIME, DEPTH, FORCE))}, {"depth": "M 2 (um)", "force": "M 3 (nN)"}),
    }[kind]
    savemat(tmp_path / "a.mat", content, do_compression=packed)
    is_whole(ul.read(tmp_path / "a.mat", columns=columns))
    data = bytearray((tmp_path / "a.mat").read_bytes())
    for at in range(128, len(data), 7):
        damaged = bytes([*data[:at], data[at] ^ 0xFF, *data[at + 1 :]])
        (tmp_path / "b.mat").write_bytes(damaged)
        with warnings.catch_warnings(), contextlib.suppress(ul.UnderlayError):
            warnings.simplefilter("ignore")
            ul.read(tmp_path / "b.mat", columns=columns)
        if at > 3000:
            break


@pytest.mark.parametrize(
    ("names", "columns"),
    [
        (("Indentation|um", "Load (nN)|", "Time (s)|"), None),
        (("depth_um|", "force_nN|", "t|s"), None),
        (("Piezo|um", "cell 1|", "clock|"), {"depth": "Piezo", "force": "cell 1 (nN)", "time": "clock (s)"}),
    ],
)
def test_tdms(names, columns, tmp_path):
    nptdms = pytest.importorskip("nptdms")
    with nptdms.TdmsWriter(tmp_path / "a.tdms") as writer:
        told = [name.split("|") for name in names]
        writer.write_segment(
            [
                nptdms.ChannelObject("data", name, values, properties={"unit_string": unit} if unit else {})
                for (name, unit), values in zip(told, (DEPTH, FORCE, TIME), strict=True)
            ]
        )
    is_whole(ul.read(tmp_path / "a.tdms", columns=columns))


def test_tdms_without_its_package_is_known_by_name(put, monkeypatch):
    monkeypatch.setitem(sys.modules, "nptdms", None)
    told = r"TDMS file, as Optics11 writes.*npTDMS.*export the curve as text"
    with pytest.raises(ul.MissingExtraError, match=told):
        ul.read(put(b"TDSm" + bytes(40)))


@pytest.mark.parametrize(
    "name", ["test 1/data/depth", "Data/Test 001/Load On Sample", "curve0/segment0/force"]
)
def test_hdf5_of_other_programs_is_known_with_a_way_out(name, tmp_path):
    h5py = pytest.importorskip("h5py")
    with h5py.File(tmp_path / "a.hdf5", "w") as file:
        file[name] = DEPTH
    with pytest.raises(
        ul.FileFormatError, match=rf"layout not known here \(it holds '{name.split('/')[0]}'.*Export"
    ):
        ul.read(tmp_path / "a.hdf5")


def test_matlab_of_version_7_3_is_known(put):
    with pytest.raises(ul.FileFormatError, match=r"MATLAB file of version 7\.3.*save it"):
        ul.read(put(b"MATLAB 7.3 MAT-file, Platform: GLNXA64" + bytes(600), "a.mat"))


# --- parts of a curve, and manifests


@pytest.mark.parametrize("thickness", ["", ', thickness = "40 um"'])
@pytest.mark.parametrize("steps", [1, 2, 3, 4, 5])
def test_equilibrium_of_few_steps_is_fitted(steps, thickness, tmp_path, put):
    depth = np.concatenate([np.r_[np.linspace(k, k + 1, 40), np.full(200, k + 1.0)] for k in range(steps)])
    layer = ul.Layer(ul.Isotropic(1e5, 0.45), 4e-5) if thickness else ul.Layer(ul.Isotropic(1e5, 0.45))
    scene = ul.Scene(ul.Paraboloid(5e-5), layer, *([ul.RIGID] if thickness else []))
    force = np.asarray(scene.force(1e-6 * depth)) * (
        1.0 + 2e-3 * np.random.default_rng(steps).standard_normal(len(depth))
    )
    text = "depth (um),force (uN),time (s)\n" + rows(
        depth, 1e6 * force, np.arange(len(depth)), separator=",", form="{:.9f}"
    )
    path = tmp_path / "scene.toml"
    path.write_text(
        'indenter = { shape = "paraboloid", radius = "50 um" }\n'
        f'layer = {{ E = "50 kPa", nu = 0.45{thickness} }}\n'
        f"{'substrate.rigid = true' if thickness else ''}\n"
        'fit.layer.E = { min = "1 kPa", max = "10 MPa" }\n[curve]\nsegment = "equilibrium"\n'
    )
    problem = ul.load_problem(put(text, "steps.csv"), path)
    assert problem.n_points == steps
    found = ul.fit(problem)
    assert found.values["layer.E"] == pytest.approx(1e5, rel=2e-3)
    stated = found.answer("layer.E")
    assert 0.8e5 < stated.low < 1e5 < stated.high < 1.2e5


def test_one_hold_takes_one_number():
    curve = ul.Curve([*np.linspace(0, 1e-6, 40), *[1e-6] * 200], [*np.linspace(0, 1e-6, 40), *[1e-6] * 200])
    scene = ul.Scene(ul.Paraboloid(5e-5), ul.Layer(ul.Isotropic(1e5, 0.45), 4e-5), ul.RIGID)
    with pytest.raises(ul.InputError, match="free fewer"):
        ul.Problem(scene, curve.equilibrium(), ["layer.E", "layer.thickness"])
    assert "one hold alone" in str(ul.check_quality(curve.equilibrium(), scene).reasons)
