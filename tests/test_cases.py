"""Made inputs that show faults met with real files, each with its right answer."""

import numpy as np
import pytest

import underlay as ul
from support.real_data import real_file
from underlay.data.readers import read_all
from underlay.inference.batch.curves import list_curves
from underlay.inference.from_files import load_problem

NM, UM = 1e-9, 1e-6


def case(name):
    path = real_file(f"cases/{name}")
    if not path.is_file():
        pytest.skip(f"no {name} among the real data")
    return path


def scene(name, tmp_path, more=""):
    path = tmp_path / "scene.toml"
    path.write_text(case(name).read_text(encoding="utf-8") + more, encoding="utf-8")
    return path


def modulus(curve, scene_file):
    return ul.fit(load_problem(curve, scene_file)).values["layer.E"]


def counts(curve):
    return len(curve.loading()), len(curve.hold()), len(curve.unloading())


def test_jpk_text(tmp_path):
    curve = ul.read(case("jpk_export.txt"))
    assert counts(curve) == (600, 0, 600)
    assert curve.metadata["spring_constant"] == 0.06
    assert curve.depth[0] == pytest.approx(-9.0 * UM - 2.46e-14 / 0.06, rel=1e-9)
    more = "\n[curve]\n"
    path = scene("gel.toml", tmp_path, more)
    text = path.read_text(encoding="utf-8").replace(
        'min = "-0.5 um", max = "4 um"', 'min = "-8.5 um", max = "-5 um"'
    )
    path.write_text(text, encoding="utf-8")
    fitted = ul.fit(load_problem(case("jpk_export.txt"), path))
    assert fitted.values["layer.E"] == pytest.approx(2.0e3, rel=0.02)
    assert fitted.values["instrument.contact_depth"] == pytest.approx(-7.0 * UM, abs=0.02 * UM)


def test_commented_names_do_not_shift():
    path = case("commented_names_shift.txt")
    curve = ul.read(path, "csv", {"depth": "-measuredHeight (m)", "force": "vDeflection (N)"})
    assert curve.depth[0] == -9.0e-6
    assert curve.force[0] == 2.4603067e-14


def test_commented_names_with_tabs(tmp_path):
    curve = ul.read(case("commented_names_tab.txt"))
    assert curve.depth.max() == pytest.approx(3.7 * UM, rel=0.01)
    assert curve.force.max() == pytest.approx(17.7 * NM, rel=0.01)
    assert modulus(case("commented_names_tab.txt"), scene("gel.toml", tmp_path)) == pytest.approx(
        2.0e3, rel=0.02
    )


def test_nanoscope_ascii(tmp_path):
    path = case("nanoscope_ascii.txt")
    curve = ul.read(path)
    assert counts(curve) == (600, 0, 600)
    assert curve.metadata["spring_constant"] == 0.06
    assert modulus(path, scene("gel.toml", tmp_path)) == pytest.approx(2.0e3, rel=0.02)
    bare = tmp_path / "bare.txt"
    lines = path.read_text(encoding="latin-1").splitlines()
    bare.write_text("\n".join(line for line in lines if not line.startswith('"')), encoding="latin-1")
    again = ul.read(bare, calibration={"spring_constant": "0.06 N/m"})
    np.testing.assert_allclose(again.depth, curve.depth, atol=1e-15)
    np.testing.assert_allclose(again.force, curve.force, atol=1e-14)
    said = ul.read(bare, columns={"depth": "Calc_Ramp - Defl_nm", "force": "Defl_nm * 0.06 N/m"})
    np.testing.assert_allclose(said.depth, curve.depth, atol=1e-15)


def test_stacked_tests(tmp_path):
    tests = read_all(case("stacked_soft.csv"))
    assert [len(test) for test in tests] == [300, 300, 300]
    assert "3 tests one below the other" in tests[0].metadata["notes"][0]
    for number in (1, 2, 3):
        path = scene("gel.toml", tmp_path, f"\n[curve]\ntest = {number}\n")
        assert modulus(case("stacked_soft.csv"), path) == pytest.approx(2.0e3, rel=0.03)


def test_what_a_mac_puts_into_archives_is_left_out():
    curves = read_all(case("zip_macos.zip"))
    assert len(curves) == 2
    assert "__MACOSX/run/._c1.csv" in curves[0].metadata["notes"][0]


def test_curves_of_an_archive_have_the_names_of_its_files():
    assert [place.name for place in list_curves(case("zip_macos.zip"))] == [
        "zip_macos.zip/run/c1.csv",
        "zip_macos.zip/run/c2.csv",
    ]


def test_cycles_of_a_stiff_sample():
    curve = ul.read(case("kla_cycles.xlsx"))
    labels = curve.segments()
    assert np.count_nonzero(labels == "unloading") == 180
    last = np.flatnonzero(labels == "unloading")[-60:]
    assert abs(int(last[0]) - 420) <= 1
    start = slice(int(last[0]), int(last[0]) + 10)
    assert np.polyfit(curve.depth[start], curve.force[start], 1)[0] == pytest.approx(1.3e6, rel=0.1)


def test_results_of_a_workbook_are_no_test():
    curves = read_all(case("nanosuite_results.xls"))
    assert [curve.metadata["sheet"] for curve in curves] == ["Test 002", "Test 001"]
    for curve in curves:
        assert len(curve) == 100
        assert counts(curve)[:2] == (60, 10)
        assert curve.force.max() == pytest.approx(10e-3)
        assert curve.depth.max() == pytest.approx(300 * NM)


def test_tests_side_by_side():
    one, other = read_all(case("anton_paar_wide.TXT"))
    assert (one.metadata["name"], other.metadata["name"]) == ("gelA_1", "gelA_2")
    assert (len(one), len(other)) == (320, 260)
    assert one.force.max() == pytest.approx(30e-3, rel=0.01)
    assert other.force.max() == pytest.approx(24e-3, rel=0.01)
    assert one.depth.max() == pytest.approx(608 * NM, rel=0.01)
    assert other.depth.max() == pytest.approx(524 * NM, rel=0.01)


def test_a_lever_that_bends_more_than_it_travels_is_named(tmp_path):
    curve = ul.read(case("crash_a.csv"))
    with pytest.raises(ul.CurveError, match=r"1\.3\d nm per nm of travel.*sensitivity"):
        ul.find_contact(curve)
    verdict = ul.check_quality(curve)
    assert verdict.verdict == "refused"
    assert "sensitivity" in verdict.reasons[0]
    with pytest.raises(ul.InputError):
        modulus(case("crash_a.csv"), scene("mica.toml", tmp_path))


@pytest.mark.parametrize(
    ("name", "columns"),
    [
        ("underscore.csv", ""),
        ("mts_testsuite.txt", 'columns = { depth = "Axial Displacement", force = "Axial Force" }'),
        ("instron_bluehill.csv", 'columns = { depth = "Compressive extension", force = "Compressive load" }'),
    ],
)
@pytest.mark.parametrize("said", [True, False])
def test_tables_of_testing_machines(name, columns, said, tmp_path):
    path = scene("tissue.toml", tmp_path, f"\n[curve]\n{columns if said else ''}\n")
    assert modulus(case(name), path) == pytest.approx(0.5e6, rel=0.02)


def test_tables_without_names():
    curves = read_all(case("headerless.zip"), columns={"time": "1 (s)", "depth": "2 (nm)", "force": "3 (mN)"})
    assert len(curves) == 3
    assert curves[0].depth.max() == pytest.approx(398 * NM)
    assert curves[0].time is not None
    with pytest.raises(ul.FileFormatError, match=r'by number with units: columns = \{ depth = "2 \(nm\)"'):
        read_all(case("headerless.zip"))
