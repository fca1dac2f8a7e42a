"""Every reader on small files of our own: numbers in SI, signs, segments, provenance, and each quirk."""

import hashlib
import io
import unicodedata
from datetime import date

import numpy as np
import openpyxl
import pytest

import underlay as ul
from support import afm_files, microscope_files
from support import instrument_files as files
from support.compound_file import xls
from underlay.data.readers import FORMATS

TIME, DEPTH, FORCE = files.sample_curve(1.0, 1.0)
LABELS = np.repeat(("loading", "hold", "unloading"), (files.RAMP, files.REST, files.BACK))


@pytest.fixture
def put(tmp_path):
    def write(content, name="measured.dat"):
        path = tmp_path / name
        path.write_bytes(content if isinstance(content, bytes) else content.encode())
        return path

    return write


def check(curve, deepest, peak, digits=1e-6):
    """The curve of all files, to the digits that they write."""
    np.testing.assert_allclose(curve.depth, deepest * DEPTH, atol=digits * deepest, rtol=0)
    np.testing.assert_allclose(curve.force, peak * FORCE, atol=digits * peak, rtol=0)
    np.testing.assert_allclose(curve.time, TIME, atol=1e-6)
    # The corner of a motion belongs to either side.
    assert np.count_nonzero(curve.segments() != LABELS) <= 2


# --- the door


def test_every_format_has_a_name_and_a_line_and_they_differ():
    names = [known.name for known in FORMATS]
    assert len(set(names)) == len(names)
    assert {"csv", "optics11", "mach1", "bioindenter", "hysitron", "nanosuite"} <= set(names)
    assert {"fischer", "testxpert", "afm", "excel"} <= set(names)
    assert all(known.description and "\n" not in known.description for known in FORMATS)


@pytest.mark.parametrize("name", sorted({**files.ALL, **afm_files.ALL, **microscope_files.ALL}))
def test_content_alone_tells_the_format(name, put):
    content = {**files.ALL, **afm_files.ALL, **microscope_files.ALL}[name]()
    expected = {"archive": "csv"}.get(name, name.split()[0])
    path = put(content, "whatever.qqq")  # the extension says nothing
    if name in {"hysitron nanodma", "afm ntmdt"}:
        with pytest.raises(ul.InputError):
            ul.read_all(path)
        return
    if name == "nanosuite":
        with pytest.warns(ul.UnderlayWarning, match="1 of 90 points left out"):
            curves = ul.read_all(path)
    else:
        curves = ul.read_all(path)
    assert curves[0].metadata["format"] == expected


def test_provenance_is_in_the_metadata(put):
    content = files.optics11()
    curve = ul.read(put(content))
    assert curve.metadata["sha256"] == hashlib.sha256(content).hexdigest()
    assert curve.metadata["path"].endswith("measured.dat")
    assert curve.metadata["reader"].startswith("underlay ")
    assert curve.metadata["test"] == 1
    assert set(curve.metadata["sign_rules"]) == {"depth", "force", "segment"}


def test_several_tests_are_listed_and_picked(put):
    path = put(files.mach1(3))
    with pytest.raises(
        ul.InputError,
        match=r"holds 3 tests \(1: measured, block 2.*Pick one: test = 1 to test = 3 in the .curve. section",
    ):
        ul.read(path)
    assert ul.read(path, test=2).metadata["block"] == 5
    with pytest.raises(ul.InputError, match="there is no test 4"):
        ul.read(path, test=4)
    assert [curve.metadata["test"] for curve in ul.read_all(path)] == [1, 2, 3]


def test_an_unknown_format_or_file_is_named(put):
    with pytest.raises(ul.InputError, match="no format 'xyz'; there are"):
        ul.read(put(files.delimited()), format="xyz")
    with pytest.raises(ul.FileFormatError, match="in no format that can be read"):
        ul.read(put("Dear diary,\nnothing was measured.\n"))
    with pytest.raises(ul.FileFormatError):
        ul.read(put(files.delimited()), format="mach1")


def test_options_that_cannot_act_are_refused(put):
    with pytest.raises(ul.InputError, match="a column mapping does not apply"):
        ul.read(put(files.optics11()), columns={"depth": "Piezo (nm)"})
    with pytest.raises(ul.InputError, match="holds its calibration"):
        ul.read(put(files.optics11()), calibration={"spring_constant": "0.04 N/m"})
    with pytest.raises(ul.InputError, match="no calibration 'k'"):
        ul.read(put(afm_files.jpk()), calibration={"k": "0.04 N/m"})
    with pytest.raises(ul.InputError, match="must be positive"):
        ul.read(put(afm_files.jpk()), calibration={"spring_constant": "-0.04 N/m"})


# --- plain tables


@pytest.mark.parametrize(
    ("separator", "comma", "encoding"),
    [
        (",", False, "utf-8"),
        (";", True, "utf-8"),
        ("\t", True, "latin-1"),
        ("\t", False, "utf-8-sig"),
        (";", False, "utf-16"),
    ],
)
def test_tables_in_all_dialects(separator, comma, encoding, put):
    curve = ul.read(put(files.delimited(separator, comma=comma, encoding=encoding, end="\r\n")))
    check(curve, 2e-6, 1e-4, 1e-8)
    assert curve.metadata["comments"] == ("a gel on glass",)
    assert curve.metadata["units"]["depth (µm)"] == "µm"


@pytest.mark.parametrize(
    ("text", "depth", "force"),
    [
        ("depth (um),force [mN]\n1,2\n3,4\n", [1e-6, 3e-6], [2e-3, 4e-3]),
        ('"Time, s","depth, um","force, mN"\n0,1,2\n1,3,4\n', [1e-6, 3e-6], [2e-3, 4e-3]),
        ("h,P\nnm,uN\n1,2\n3,4\n", [1e-9, 3e-9], [2e-6, 4e-6]),
        ("h [nm],P\nnm,uN\n1,2\n3,4\n", [1e-9, 3e-9], [2e-6, 4e-6]),
        ("# a gel, 2026\n# depth (um) force (mN)\n1.0 2.0\n3.0 4.0\n", [1e-6, 3e-6], [2e-3, 4e-3]),
        ("h;P\n[nm];[uN]\n1,5;2\n3;4,5\n", [1.5e-9, 3e-9], [2e-6, 4.5e-6]),
        ("depth (um) force (mN)\n1 2\n3 4\n", [1e-6, 3e-6], [2e-3, 4e-3]),
        ("sep=;\ndepth (um);force (mN)\n1;2\n3;4\n", [1e-6, 3e-6], [2e-3, 4e-3]),
        (",depth (um),force (mN),note\n0,1,2,a\n1,3,4,b\n", [1e-6, 3e-6], [2e-3, 4e-3]),
        (
            "made by hand\nindenter radius: 5 um\ndepth / um\tforce / mN\n1\t2\n3\t4\n",
            [1e-6, 3e-6],
            [2e-3, 4e-3],
        ),
        ("Load (gf)\tIndentation (mm)\n1\t0.5\n2\t0.6\n", [0.5e-3, 0.6e-3], [9.80665e-3, 2 * 9.80665e-3]),
    ],
)
def test_headers_and_units_as_people_write_them(text, depth, force, put):
    curve = ul.read(put(text))
    np.testing.assert_allclose(curve.depth, depth, rtol=1e-15)
    np.testing.assert_allclose(curve.force, force, rtol=1e-15)


def test_a_mapping_names_columns_units_and_signs(put):
    path = put("x [um],F1 [N],F2\n1,-2,-5\n2,-3,-6\n")
    curve = ul.read(path, columns={"depth": "x", "force": "-F2 (mN)"})
    np.testing.assert_allclose(curve.force, [5e-3, 6e-3])
    assert curve.metadata["sign_rules"]["force"] == "minus the column 'F2', as asked"
    np.testing.assert_allclose(ul.read(path, columns={"depth": "x [mm]", "force": "F1"}).depth, [1e-3, 2e-3])
    with pytest.raises(ul.FileFormatError, match=r"no column 'F3'; it has 'x \[um\]', 'F1 \[N\]', 'F2'"):
        ul.read(path, columns={"depth": "x", "force": "F3"})
    with pytest.raises(ul.InputError, match="has no 'z'; it takes depth, force, time, segment"):
        ul.read(path, columns={"z": "x"})
    with pytest.raises(ul.InputError, match="must be a name"):
        ul.read(path, columns={"depth": "-"})


@pytest.mark.parametrize(
    ("text", "error", "told"),
    [
        ("x (um),y (N)\n1,2\n", ul.FileFormatError, r"no column for the depth; it has 'x \(um\)', 'y \(N\)'"),
        (
            "depth,force\n1,2\n",
            ul.FileFormatError,
            r"column 'depth': no unit; write it in the header as 'depth \(um\)'",
        ),
        ("depth (um),force (kPa)\n1,2\n", ul.UnitError, "'kPa' is a unit of pressure, but a force is needed"),
        ("depth (um),force (bananas)\n1,2\n", ul.UnitError, "unknown unit 'bananas' for a force"),
        ("1,2\n3,4\n", ul.FileFormatError, "no row of names above its numbers"),
        ("depth (um),force (mN)\n", ul.FileFormatError, "in no format"),
        (
            "depth (um),force (mN)\n1,2\n3\n",
            ul.FileFormatError,
            "row 2 of the table has 1 cells where at least 2",
        ),
        (
            "depth (um),force (mN)\n1,2\n3,four\n",
            ul.FileFormatError,
            "row 2 of the table: 'four' is not a number",
        ),
        ("depth (um),force (mN)\n1,2\n3,1_000\n", ul.FileFormatError, "'1_000' is not a"),
        (
            "depth (um),force (mN)\n1,2\nnan,3\n",
            ul.FileFormatError,
            "row 2 of the table: 'nan' is not a finite number",
        ),
        (
            "depth (um),force (mN)\nnm,mN\n1,2\n",
            ul.FileFormatError,
            r"column 'depth \(um\)': the row below the names says 'nm'",
        ),
        ("depth (um),force (mN)\n1,2\n3,1e400\n", ul.FileFormatError, "'1e400' is not a finite number"),
    ],
)
def test_what_a_table_lacks_is_said(text, error, told, put):
    with pytest.raises(error, match=told):
        ul.read(put(text))


@pytest.mark.parametrize(
    "text",
    [
        "depth (um),force (mN)\n0,5,1,5\n0,75,1,75\n",  # decimal commas between commas
        "depth (nm),force (uN)\n998.5,1\n1,003.5,2\n",  # thousands commas
        '"depth (um)","force (mN)"\n"1",0.5,1.5\n"2",0.75,1.75\n',  # names of rows, as R writes them
        "Time, s  depth (um)  force (mN)\n0 1 2\n1 3 4\n",  # a name with a blank between blanks
    ],
)
def test_more_numbers_than_names_are_refused(text, put):
    with pytest.raises(
        ul.FileFormatError, match=r"row \d of the table has \d cells under 2 names: .* semicolons"
    ):
        ul.read(put(text))


@pytest.mark.parametrize(
    "foot",
    [
        "mean,1.5,2.5,\nSD,0.5,0.5,\n",
        ",,,\nMax.,2,3,\n,,,\n",  # blank rows between, and below
        "2,1.5,2.5,average\n",  # said in a column that is not read
        '2,1.5,2.5,"Mittelwert:"\n',
        "Mean ± SD,1.5,2.5,\nAverage (n=2),1.5,2.5,\nmean+/-sem,1.5,2.5,\n",
    ],
)
def test_statistics_at_the_foot_of_a_table_are_no_readings(foot, put):
    readings = "point,depth (nm),force (uN),remark\n0,1,2,\n1,2,3,at most\n"
    curve = ul.read(put(readings + foot))
    np.testing.assert_allclose(curve.depth, [1e-9, 2e-9])
    assert any("rows of statistics at the foot" in note for note in curve.metadata["notes"])
    plain = ul.read(put(readings))
    np.testing.assert_allclose(plain.depth, curve.depth)
    assert not any("statistics" in note for note in plain.metadata.get("notes", ()))
    # A remark without end is looked at no longer than any other.
    assert len(ul.read(put(readings + f"2,3,4,{'(' * 30_000}\n"))) == 3
    # Above the last reading it is a mark of that reading.
    marked = ul.read(put(readings.replace("0,1,2,", "0,1,2,min")))
    assert len(marked) == 2


@pytest.mark.parametrize("separator", [",", "."])
def test_thousands_are_not_read_as_decimals(separator, put):
    rows = [f"{10 * i}\t{498 + i}\n" for i in range(98, 100)] + [f"1,0{i}0\t{598 + i}\n" for i in range(3)]
    text = "depth (nm)\tforce (uN)\n" + "".join(rows).replace(",", separator)
    with pytest.raises(
        ul.FileFormatError, match=r"column 'depth \(nm\)': the separator of '1.000' may be of"
    ):
        ul.read(put(text))
    decimals = text.replace("990\t", f"990{separator}5\t")
    np.testing.assert_allclose(ul.read(put(decimals)).depth[1:3], [990.5e-9, 1e-9])


def test_notes_and_empty_cells_beyond_the_names_are_passed_over(put):
    curve = ul.read(put("depth (um),force (mN)\n1,2,,\n3,4,touched here\n"))
    np.testing.assert_allclose(curve.force, [2e-3, 4e-3])


def test_cells_without_a_value_are_left_out_aloud(put):
    path = put("depth (um),force (mN)\n1,2\n,3\n4,NA\n5,1.7976931348623157e308\n6,7\n")
    with pytest.warns(ul.UnderlayWarning, match="3 of 5 points left out"):
        curve = ul.read(path)
    np.testing.assert_allclose(curve.depth, [1e-6, 6e-6])
    assert curve.metadata["points_left_out"] == 3
    with pytest.raises(ul.CurveError, match="no point has both"):
        ul.read(put("depth (um),force (mN),time (s)\n1,,0\n2,,1\n"))


def test_rows_left_out_are_named(put):
    path = put("depth (um),force (mN)\n1,2\n,3\n4,\n5,6\n")
    with pytest.warns(ul.UnderlayWarning, match=r"2 of 4 points left out: .*\(rows 2, 3 of the table\)"):
        ul.read(path)


@pytest.mark.parametrize(
    "header",
    [
        "Eindringtiefe [µm];Kraft [mN];Zeit [s]",
        "Weg (µm);Prüfkraft (mN);Prüfzeit (s)",
        "Enfoncement (µm);Force normale (mN);Temps (s)",
        "Déplacement (µm);Charge (mN);Temps d’essai (s)",
        "Profundidad (µm);Fuerza (mN);Tiempo (s)",
        "PROFONDITÀ (µm);Forza (mN);Tempo (s)",
    ],
)
@pytest.mark.parametrize("decomposed", [False, True])
def test_names_in_other_languages(header, decomposed, put):
    header = unicodedata.normalize("NFD" if decomposed else "NFC", header).replace("μ", "µ")
    curve = ul.read(put(f"{header}\n1,5;2,5;0\n3;4;1\n"))
    np.testing.assert_allclose(curve.depth, [1.5e-6, 3e-6])
    np.testing.assert_allclose(curve.force, [2.5e-3, 4e-3])
    np.testing.assert_allclose(curve.time, [0.0, 1.0])


def test_columns_of_the_same_name_are_not_chosen_between_without_a_word(put):
    path = put("depth (um),force (nN),force (uN)\n1,2,5\n3,4,7\n")
    curve = ul.read(path)
    np.testing.assert_allclose(curve.force, [2e-9, 4e-9])
    assert "first column of its name, 'force (nN)'; not read: 'force (uN)'" in curve.metadata["notes"][0]
    assert ul.read(path, columns={"force": "force"}).metadata["notes"]
    chosen = ul.read(path, columns={"force": "-force (uN)"})
    np.testing.assert_allclose(chosen.force, [-5e-6, -7e-6])
    assert not chosen.metadata["notes"]
    beside = ul.read_all(put("depth (um),force (nN),depth (um),force (nN),x\n1,2,1,9,1\n3,4,2,8,2\n"))
    np.testing.assert_allclose([curve.force for curve in beside], [[2e-9, 4e-9], [9e-9, 8e-9]])


def test_a_segment_column_of_our_names_is_used_and_others_are_not(put):
    curve = ul.read(put("depth (um),force (mN),segment\n1,2,loading\n3,4,hold\n"))
    assert list(curve.segment) == ["loading", "hold"]
    curve = ul.read(put("depth (um),force (mN),segment\n1,2,1\n3,4,2\n"))
    assert curve.segment is None
    assert "the segment column is not used" in curve.metadata["notes"][0]


def test_numbers_in_comments_that_mean_something(put):
    curve = ul.read(
        put("# indenter radius: 27.5 um\n# spring constant: 0.019 N/m\ndepth (um),force (mN)\n1,2\n")
    )
    assert curve.metadata["indenter_radius"] == 27.5e-6
    assert curve.metadata["spring_constant"] == 0.019
    with pytest.raises(ul.UnitError, match="indenter radius: 3 kPa"):
        ul.read(put("# indenter radius: 3 kPa\ndepth (um),force (mN)\n1,2\n"))


# --- Optics11


@pytest.mark.parametrize("generation", ["old", "V3.4.4", "V3.5.0", "Chiaro"])
@pytest.mark.parametrize("comma", [False, True])
def test_optics11_of_all_generations(generation, comma, put):
    curve = ul.read(put(files.optics11(generation, comma=comma)))
    check(curve, 2e-6, 4e-8, 3e-5)  # six decimals of uN: 1e-12 N of 4e-8 N
    assert curve.metadata["indenter_radius"] == pytest.approx(25e-6)
    assert curve.metadata["spring_constant"] == 0.05
    assert curve.metadata["instrument_reduced_modulus"] == 1000.0
    assert curve.metadata["position"] == pytest.approx((100e-6, 200e-6, 300e-6))
    assert curve.metadata["name"] in {"gel 4 %", "cell 7"}
    # Cut to zero before contact in all but one generation.
    assert ("software_contact_depth" in curve.metadata) == (generation != "V3.5.0")
    assert curve.metadata["notes"] == ()
    if generation == "V3.4.4" and not comma:
        assert curve.metadata["header"]["SMDuration (s)"] == "0.0"
        assert curve.metadata["header"]["Model"] == "Hertz"


def test_optics11_says_so_when_load_and_deflection_do_not_close(put):
    content = files.optics11("old").replace(b"k (N/m)\t0.050", b"k (N/m)\t0.500")
    assert "check the file's units" in ul.read(put(content)).metadata["notes"][0]


# --- Mach-1


@pytest.mark.parametrize("multiaxis", [False, True])
def test_mach1_forces_are_positive_in_compression_in_newtons(multiaxis, put):
    curves = ul.read_all(put(files.mach1(2, multiaxis=multiaxis)))
    _, depth, force = files.relaxation()
    assert [curve.metadata["block"] for curve in curves] == [2, 5]
    for number, curve in enumerate(curves):
        np.testing.assert_allclose(curve.depth, depth, atol=1e-12)
        np.testing.assert_allclose(curve.force, force, atol=6e-10)  # nine decimals of N
        assert curve.metadata["contact_height"] == pytest.approx(-2.9e-3)
        assert curve.metadata["position"] == pytest.approx((number * 1.5e-3, 0.0, -2.9e-3))
        assert curve.metadata["ramp_ends"] == (200,)
    assert ("minus" in curves[0].metadata["sign_rules"]["force"]) == multiaxis


def test_mach1_steps_give_equilibrium_points(put):
    curve = ul.read(put(files.mach1(1, ramps=3)))
    points = curve.equilibrium()
    np.testing.assert_allclose(points.depth, np.arange(1, 4) / 3 * 1e-4, rtol=1e-6)
    expected = 5e-3 * (np.arange(1, 4) / 3) ** 1.5 * 0.5
    np.testing.assert_allclose(points.force, expected, rtol=1e-3)  # 6 s of rest at 0.7 s leave exp(-9)


def test_mach1_search_without_contact_is_noted(put):
    curve = ul.read(put(files.mach1(1, contact=False)))
    assert "search for contact ended without it" in curve.metadata["notes"][0]
    assert curve.metadata["search_reached"] < curve.metadata["search_criterion"]
    assert ul.read(put(files.mach1(1))).metadata["notes"] == ()


@pytest.mark.parametrize(
    ("change", "told"),
    [
        (lambda text: text[: len(text) // 2], "cut short"),
        (lambda text: text.replace(b"Fz, gf", b"Fy, gf"), "no column 'Fz'; it has"),
        (lambda text: text.replace(b"Fz, gf", b"Fz, mm"), "unit of length, but a force"),
        (lambda _: b"<Mach-1 File>\r\n", "no block with a test"),
    ],
)
def test_mach1_damage_is_said(change, told, put):
    with pytest.raises(ul.InputError, match=told):
        ul.read(put(change(files.mach1(1))))


# --- Bioindenter, Hysitron, Fischer


@pytest.mark.parametrize("profile", [False, True])
def test_bioindenter_segments_come_from_the_protocol(profile, put):
    curve = ul.read(put(files.bioindenter(profile=profile)))
    check(curve, 20e-6, 1e-3, 6e-5)  # five digits
    assert list(curve.segment) == list(LABELS)
    assert curve.metadata["instrument_reduced_modulus"] == pytest.approx(830.29e3)
    assert curve.metadata["header"]["Fn contact"] == "25.00 µN"


@pytest.mark.parametrize("trimmed", [False, True])
@pytest.mark.parametrize("micro", ["µ", "u"])
def test_hysitron_hld(trimmed, micro, put):
    curve = ul.read(put(files.hld(trimmed=trimmed, micro=micro)))
    check(curve, 100e-9, 1e-3, 1e-6)
    assert list(curve.segment) == list(LABELS)
    assert curve.metadata["drift_rate"] == pytest.approx(0.05e-9)
    assert curve.metadata["machine_compliance"] == pytest.approx(0.5e-6)
    unlisted = ul.read(put(files.hld(listed=False)))
    assert unlisted.segment is None
    check(unlisted, 100e-9, 1e-3, 1e-6)


def test_hysitron_text(put):
    check(ul.read(put(files.load_control_text())), 100e-9, 1e-3, 1e-6)
    with pytest.raises(ul.FileFormatError, match="nanoDMA export: it holds dynamic moduli"):
        ul.read(put(files.nanodma()))


@pytest.mark.parametrize("make", [files.hld, files.load_control_text])
def test_hysitron_claims_more_than_there_is(make, put):
    with pytest.raises(ul.FileFormatError, match="claims 2000000000 points but 90 rows follow"):
        ul.read(put(make(claimed=2_000_000_000)))


def test_fischer_blocks(put):
    curves = ul.read_all(put(files.fischer(2)))
    assert [curve.metadata["name"] for curve in curves] == [f"measured, block 1, value {i}" for i in (1, 2)]
    for curve in curves:
        check(curve, 0.5e-6, 0.3, 1e-8)
        assert curve.metadata["header"]["EIT/(1-vs^2) [GPa]"] == "83.7"
        assert curve.metadata["position"] == pytest.approx((44.65e-3, 6.01e-3))


# --- workbooks


def test_nanosuite_tests_by_name_whatever_the_order(put):
    with pytest.warns(ul.UnderlayWarning, match="1 of 90 points left out"):
        curves = ul.read_all(put(files.nanosuite()))
    assert [curve.metadata["sheet"] for curve in curves] == ["Test 001", "Test 002"]
    check(curves[0], 1e-6, 1e-2, 1e-12)
    assert list(curves[0].segment) == list(LABELS)
    assert len(curves[1]) == 89


@pytest.mark.parametrize("language", ["fr", "de", "en", "xx"])
@pytest.mark.parametrize("turned", [False, True])
def test_testxpert_in_every_language(language, turned, put):
    if language == "xx":  # no known name: by the order of the units, if the format is given
        curve = ul.read(put(files.zwick(language, turned=turned)), format="testxpert")
    else:
        curve = ul.read(put(files.zwick(language, turned=turned)))
    check(curve, 1e-3, 10.0, 1e-12)
    assert curve.metadata["initial_gap"] == pytest.approx(12.25e-3)


def test_nanosuite_averages_hold_the_curve_its_scatter_and_the_stiffness(put):
    curve = ul.read(put(files.nanosuite_average()))
    check(curve, 1e-6, 1e-2, 1e-12)
    assert list(curve.segment) == list(LABELS)
    assert "average of tests" in curve.metadata["name"]
    assert "scatter about it by 0.2 mN in force" in curve.metadata["notes"][0]
    depth, force = files.sample_curve(1e-6, 1e-2)[1:]
    np.testing.assert_allclose(curve.columns["depth_scatter"], 2e-3 * np.abs(depth), rtol=1e-12)
    np.testing.assert_allclose(curve.columns["force_scatter"], np.full_like(force, 2e-4), rtol=1e-12)
    stiffness = curve.columns["contact_stiffness"]
    assert np.isnan(stiffness[0])  # the sentinel of a value that is not there leaves no point out
    np.testing.assert_allclose(stiffness[1:], np.full(len(force) - 1, 4e4))
    np.testing.assert_allclose(curve.columns["contact_stiffness_scatter"][1:], np.full(len(force) - 1, 400.0))
    # A column keeps to its points, and is in the table.
    loading = curve.loading()
    np.testing.assert_array_equal(
        loading.columns["depth_scatter"], curve.columns["depth_scatter"][: len(loading)]
    )
    assert list(loading.to_frame()["force_scatter"]) == list(loading.columns["force_scatter"])


def test_nanosuite_keeps_the_rows_whose_last_cells_are_empty(put):
    names = [
        "",
        "Displacement Into Surface",
        "Load On Sample",
        "Time On Sample",
        "Harmonic Contact Stiffness",
    ]
    rows = [["Load Segment Type", 0.0, 0.0, 0.0, 4e4], ["", 5.0, 1.0, 1.0, 4e4]]
    # Nothing oscillates on the way back.
    rows += [["Unload From Peak Segment Type", 4.0, 0.6, 2.0], ["", 3.0, 0.2, 3.0], ["END"]]
    curve = ul.read(put(xls({"Test 001": [names, ["", "nm", "mN", "s", "N/m"], *rows]})))
    np.testing.assert_allclose(curve.depth, [0.0, 5e-9, 4e-9, 3e-9])
    assert list(curve.segment) == ["loading", "loading", "unloading", "unloading"]
    np.testing.assert_array_equal(curve.columns["contact_stiffness"], [4e4, 4e4, np.nan, np.nan])


def test_testxpert_keeps_the_rows_whose_last_cells_are_empty(put):
    book = openpyxl.load_workbook(io.BytesIO(files.zwick("en")))
    sheet = book["Ep. 1"]
    for row in range(30, sheet.max_row + 1):
        sheet.cell(row, 4).value = None  # the gap between the tools
    assert len(ul.read(put(files.saved(book)))) == len(TIME)


@pytest.mark.parametrize("language", ["fr", "de", "en"])
def test_testxpert_tables_of_results_are_no_tests(language, put):
    curves = ul.read_all(put(files.zwick(language, specimens=2)), format="testxpert")
    assert [curve.metadata["sheet"] for curve in curves] == ["Ep. 1", "Ep. 2"]


def test_testxpert_specimens(put):
    assert len(ul.read_all(put(files.zwick(specimens=3)))) == 3


def test_excel_tables(put):
    check(ul.read(put(files.excel())), 2e-6, 1e-4, 1e-12)
    assert len(ul.read_all(put(files.excel(2)))) == 2
    path = put(files.excel(labels=("x", "y", "t")))
    with pytest.raises(
        ul.FileFormatError, match=r"no sheet with columns for depth and force; the first table has 'x'"
    ):
        ul.read(path)
    check(ul.read(path, columns={"depth": "x (um)", "force": "y (mN)", "time": "t (s)"}), 2e-6, 1e-4, 1e-12)


@pytest.mark.parametrize(
    ("cell", "told"),
    [
        (b"\x07", "'#DIV/0!' is not a number"),
        (date(2026, 5, 1), "'date 46143' is not a number"),  # 1.5, as some spreadsheets take it
    ],
)
def test_errors_and_dates_of_xls_are_no_numbers(cell, told, put):
    rows = [["depth (um)", "force (mN)"], [1.0, 2.0], [cell, 3.0], [4.0, 5.0]]
    with pytest.raises(ul.FileFormatError, match=f"row 2 of the table: {told}"):
        ul.read(put(xls({"test": rows})))
    with pytest.warns(ul.UnderlayWarning, match="1 of 3 points left out"):
        assert len(ul.read(put(xls({"test": [*rows[:2], [b"\x2a", 3.0], rows[3]]})))) == 2


# --- AFM


@pytest.mark.parametrize("member", [False, True], ids=["file", "in a zip"])
@pytest.mark.parametrize(
    "keywords",
    [
        {},
        {"shared": True},
        {"styles": ("extend", "pause", "retract")},
        {"styles": ("extend", "pause", "retract"), "pause": "constant-height-pause"},
        {"styles": ("extend", "pause", "pause", "pause", "retract"), "shared": True},
        {"styles": ("pause", "extend", "pause", "retract")},
        {"styles": ("pause", "extend", "retract"), "floats": True},
        {"styles": ("extend",)},
    ],
)
def test_jpk_depth_is_that_of_the_tip_and_segments_say_what_they_are(keywords, member, put):
    content = afm_files.jpk(**keywords)
    curve = ul.read(put(files.zipped({"spot.jpk-force": content}) if member else content))
    height, force = afm_files.approach()
    loading = curve.loading()
    # The integers hold 1e-6 V of deflection and 1e-14 m of height; single floats six digits of either.
    fine = afm_files.STIFFNESS * afm_files.SENSITIVITY * 1e-6
    single = 1e-7 if keywords.get("floats") else 0.0
    np.testing.assert_allclose(loading.force, force, atol=fine + single * force.max())
    tip = -(height + force / afm_files.STIFFNESS)
    np.testing.assert_allclose(loading.depth, tip, atol=1e-13 + single * np.abs(tip).max())
    styles = keywords.get("styles", ("extend", "retract"))
    assert len(curve.hold()) == afm_files.POINTS * styles.count("pause")
    assert len(curve.unloading()) == afm_files.POINTS * styles.count("retract")
    words = {"extend": "loading", "pause": "hold", "retract": "unloading"}
    assert list(curve.segment) == list(np.repeat([words[style] for style in styles], afm_files.POINTS))
    assert curve.metadata["spring_constant"] == pytest.approx(afm_files.STIFFNESS)
    assert (np.diff(curve.time) > 0).all()
    assert curve.metadata["position"] == (1e-5, -2e-5)
    assert curve.metadata["notes"] == ()


def test_jpk_without_a_calibration_asks_for_it(put):
    path = put(afm_files.jpk(calibrated=False))
    with pytest.raises(
        ul.InputError, match=r"does not hold its calibration; give calibration = \{ spring_constant"
    ):
        ul.read(path)


def test_jpk_circles_and_claims_are_refused_before_they_cost_anything(put):
    with pytest.raises(ul.FileFormatError, match="claims 2000000000 points and 200 bytes are there"):
        ul.read(put(afm_files.jpk(claimed=2_000_000_000)))
    with pytest.raises(ul.FileFormatError, match=r"the points of segments/0/.*'1e9'"):
        ul.read(put(afm_files.jpk(claimed="1e9")))
    circle = {
        "segments/0/segment-header.properties": (
            b"nominal.base-calibration-slot=volts",
            b"nominal.base-calibration-slot=nominal",
        )
    }
    with pytest.raises(ul.FileFormatError, match="lead in a circle"):
        ul.read(put(files.changed_archive(afm_files.jpk(), circle)))


def test_hdf5_of_afmformats(put):
    curves = ul.read_all(put(afm_files.hdf5(3)))
    assert len(curves) == 3
    height, force = afm_files.approach()
    np.testing.assert_allclose(curves[1].loading().depth, -(height + force / afm_files.STIFFNESS), rtol=1e-12)


def test_tab_of_afmformats(put):
    curve = ul.read(put(afm_files.tab()))
    height, force = afm_files.approach()
    np.testing.assert_array_equal(curve.loading().depth, -(height + force / afm_files.STIFFNESS))
    np.testing.assert_array_equal(curve.unloading().force, force[::-1])
    assert curve.metadata["spring_constant"] == afm_files.STIFFNESS
    # Older versions wrote whether a row is of the second segment.
    old = afm_files.tab().replace(b"\t0\n", b"\tFalse\n").replace(b"\t1\n", b"\tTrue\n")
    np.testing.assert_array_equal(ul.read(put(old)).segment, curve.segment)
    paused = ul.read(put(afm_files.tab(("pause", "extend", "pause", "retract"))))
    assert list(paused.segment) == list(np.repeat(("hold", "loading", "hold", "unloading"), afm_files.POINTS))
    with pytest.raises(ul.FileFormatError, match="no column 'force' or no height; it has 'strain'"):
        ul.read(put(afm_files.tab().replace(b"# force\theight (measured)\tsegment", b"# strain\tb\tc")))


def test_igor_waves(put):
    curve = ul.read(put(afm_files.igor()))
    height, force = afm_files.approach()
    np.testing.assert_allclose(curve.force, force, rtol=1e-12)
    np.testing.assert_allclose(curve.depth, -(height + force / afm_files.STIFFNESS), rtol=1e-12)
    content = bytearray(afm_files.igor())
    content[132:136] = (0x7FFFFFFF).to_bytes(4, "little")  # times 3 columns
    with pytest.raises(ul.FileFormatError, match="claims 6442450941"):
        ul.read(put(bytes(content)))


def test_afm_workshop_side_by_side_and_its_missing_stiffness(put):
    path = put(files.workshop())
    bare = ul.read(path)
    assert "still holds the bending of the cantilever" in bare.metadata["notes"][0]
    assert len(bare.loading()) == len(bare.unloading()) == 60
    assert (np.diff(bare.loading().depth) > 0).all()
    given = ul.read(path, calibration={"spring_constant": "0.1 N/m"})
    np.testing.assert_allclose(bare.depth - given.depth, given.force / 0.1, atol=1e-15)


def test_afm_workshop_keeps_its_own_calibration_beside_the_one_given(put):
    header = "Light Lever Gain, mV/nm:\t20.0\r\nForce Constant, nN/nm:\t0.08\r\n"
    path = put(files.workshop(header, "T-B(V)"))
    own = ul.read(path)
    assert own.metadata["sensitivity"] == pytest.approx(50e-9, rel=1e-12)  # 20 mV/nm is 50 nm/V
    assert np.ptp(own.loading().force) == pytest.approx(2.0 * 50e-9 * 0.08, rel=1e-3)
    given = ul.read(path, calibration={"spring_constant": "0.1 N/m", "sensitivity": "60 nm/V"})
    assert given.metadata["spring_constant"] == 0.1
    assert given.metadata["file_spring_constant"] == 0.08
    assert given.metadata["file_sensitivity"] == pytest.approx(50e-9, rel=1e-12)
    unset = header.replace("20.0", "1").replace("0.08", "1")
    given = ul.read(
        put(files.workshop(unset, "T-B(V)")),
        calibration={"spring_constant": "0.1 N/m", "sensitivity": "60 nm/V"},
    )
    assert "file_sensitivity" not in given.metadata  # 1 stands for "not set"
    with pytest.raises(ul.InputError, match="holds forces, not volts"):
        ul.read(put(files.workshop()), calibration={"sensitivity": "60 nm/V"})
    # Version 4 of the program names itself in place of the format.
    later = files.workshop(unset, "T-B(V)").replace(b"File Format:\t3", b"Software Version:\t4.0.0.62")
    with pytest.raises(ul.InputError, match="does not hold its calibration"):
        ul.read(put(later))


def test_ntmdt_takes_a_current_sensitivity(put):
    path = put(files.ntmdt())
    with pytest.raises(ul.InputError, match=r'"60 nm/nA"'):
        ul.read(path)
    with pytest.raises(ul.InputError, match=r'"60 nm/nA"'):  # per volt would be wrong by 1e9
        ul.read(path, calibration={"spring_constant": "0.04 N/m", "sensitivity": "60 nm/V"})
    curve = ul.read(path, calibration={"spring_constant": "0.04 N/m", "sensitivity": "60 nm/nA"})
    assert np.ptp(curve.force) == pytest.approx(1.5 * 60e-9 * 0.04, rel=0.03)  # 1.5 nA of signal
    assert curve.loading().depth[-1] > curve.loading().depth[0]


def test_a_table_of_good_cells_is_converted_in_one_go(tmp_path, monkeypatch):
    """A plain table is read without a look at every cell; one missing cell costs nothing but its point."""
    path = tmp_path / "curve.csv"
    rows = [f"{0.1 * i},{0.01 * i * i}" for i in range(40)]
    path.write_text("depth (um),force (mN)\n" + "\n".join(rows))
    with monkeypatch.context() as patch:
        patch.setattr("underlay.data.readers._text._number", None)
        plain = ul.read(path)
    path.write_text("depth (um),force (mN)\n" + "\n".join([*rows, "4.0,"]))
    with pytest.warns(ul.UnderlayWarning, match="1 of 41 points left out"):
        careful = ul.read(path)
    np.testing.assert_array_equal(careful.depth, plain.depth)
    np.testing.assert_array_equal(careful.force, plain.force)


def test_a_table_of_afmformats_without_its_first_mark_is_refused(put):
    text = "# BEGIN METADATA of another kind\n# END METADATA\n# force\theight (measured)\n1\t2\n"
    with pytest.raises(ul.FileFormatError, match="no line '# BEGIN METADATA'"):
        ul.read(put(text.encode()), format="afm")
