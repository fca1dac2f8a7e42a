"""The microscopes' readers on public files, against other programs' output and the files' own numbers.

Numbers of another program were taken once, with NSFopen 2.2.4, pyfmreader 0.1.3 and pspylib 0.1.2, at the points
first, a third, two thirds and last (`thirds`).
"""

import numpy as np
import pytest

import underlay as ul
from support.public_files import public_file


def thirds(values):
    return values[[0, len(values) // 3, 2 * len(values) // 3, -1]]


def bending(curve):
    return curve.force / curve.metadata["spring_constant"]


def travel(curve):
    return curve.depth + bending(curve)


# --- Bruker NanoScope


def test_nanoscope_deflection_is_pyfmreaders():
    """It takes the last point of the way out off: differences from the first are compared (m)."""
    curve = ul.read(public_file("20200904_Egel4-Z1.0_00025.spm"))
    expected = np.array(
        [7.919133750000002e-09, 1.1452443750000002e-08, 1.8991541250000002e-08, 4.2923553750000004e-08]
    )
    found = thirds(bending(curve.loading()))
    np.testing.assert_allclose(found - found[0], expected - expected[0], atol=1e-20)
    np.testing.assert_allclose(np.ptp(travel(curve)), 2.997070495620996e-06, rtol=1e-12)


def test_nanoscope_with_a_height_sensor_is_pyfmreaders_in_the_deflection():
    """The height is not: pyfmreader knows the drive of the piezo only, 2.33 um."""
    curve = ul.read(public_file("cr00000.000"))
    expected = np.array([5.4434066399999994e-09, 1.164980124e-08, 5.0596350840000004e-08, 1.4446664568e-07])
    found = thirds(bending(curve.loading()))
    np.testing.assert_allclose(found - found[0], expected - expected[0], atol=1e-20)
    back = bending(curve.unloading())[::-1]
    np.testing.assert_allclose(back[-1] - back[0], 1.4520685788000002e-07, rtol=1e-12)
    assert curve.metadata["spring_constant"] == 0.042804
    assert "moved 1.35 times as far as the piezo was driven" in curve.metadata["notes"][0]


@pytest.mark.parametrize(
    ("name", "within"),
    [("Force.spm", 0.03), ("FV.spm", 0.03), ("ForceHold.spm", 0.05)],
)
def test_nanoscope_deflection_reaches_the_files_own_trigger(name, within):
    """Relative to the baseline of the same curve, whose noise is 1 to 5 % of these small triggers.

    In ForceHoldSweep.spm the baseline drifts by a tenth of the trigger: it tells nothing.
    """
    curve = ul.read(public_file(name), test=1)
    way_in = curve.loading().force
    rise = way_in[-1] - np.median(way_in[: len(way_in) // 5])
    assert rise == pytest.approx(curve.metadata["setpoint"], rel=within)


def test_nanoscope_hold_lasts_as_long_as_the_file_says():
    curve = ul.read(public_file("ForceHold.spm"))
    assert [len(part) for part in (curve.loading(), curve.hold(), curve.unloading())] == [4096, 260, 4096]
    hold = curve.hold()
    assert np.ptp(hold.time) == pytest.approx(0.1, rel=0.01)
    # Ramps of 500 nm in 0.49 s; the sensor sees 514 nm.
    assert np.ptp(travel(curve.loading())) == pytest.approx(500e-9, rel=0.04)
    # The ways join at the hold: no step but noise.
    assert abs(hold.force[0] - curve.loading().force[-1]) < 0.05 * np.ptp(curve.force)
    assert abs(hold.force[-1] - curve.unloading().force[0]) < 0.05 * np.ptp(curve.force)


def test_nanoscope_volume():
    path = public_file("FV.spm")
    curves = [ul.read(path, test=number) for number in (1, 32, 33, 1024)]
    assert curves[0].metadata["notes"] == ("10 of 2048 points were not recorded, as the file marks them",)
    places = np.array([curve.metadata["position"] for curve in curves])
    # 32 by 32 over the scan: the first row ends where the scan does, the second begins beside the first.
    pitch = np.hypot(*(places[2] - places[0]))
    np.testing.assert_allclose(np.hypot(*(places[1] - places[0])), 31 * pitch, rtol=1e-9)
    np.testing.assert_allclose(np.hypot(*(places[3] - places[0])), 31 * np.sqrt(2.0) * pitch, rtol=1e-9)


def test_peakforce_taps_press_hardest_where_the_drive_turns():
    """Of five taps across the capture, all within a point and a half of the file's sync distance, 88.3."""
    path = public_file("PeakForce.pfc")
    for number in (1, 16_000, 32_000, 48_000, 65_536):
        tap = ul.read(path, test=number)
        assert abs(int(np.argmax(tap.force)) - 88.325) < 1.5
        assert np.ptp(travel(tap)) == pytest.approx(140e-9, rel=1e-3)  # twice the amplitude
    with pytest.raises(
        ul.FileFormatError, match="holds 65536 curves; up to 20000 are read at once: pick one"
    ):
        ul.read_all(path)


@pytest.mark.parametrize(
    ("name", "told"), [("Image.spm", "an image"), ("Script.spm", "another kind than ramps")]
)
def test_nanoscope_files_of_another_kind_are_called_so(name, told):
    with pytest.raises(ul.FileFormatError, match=told):
        ul.read_all(public_file(name))


def test_a_nanoscope_volume_whose_header_has_a_byte_too_many_is_refused():
    """One entry of it reads "(\\Data length V/LSB)" where a number of one byte less was: 4 uN for 4 nN."""
    with pytest.raises(
        ul.FileFormatError, match=r"numbers of .*Deflection Error.* for 16 bits.*power of two too large"
    ):
        ul.read(public_file("20200903_Egel2.0_00023.spm"), test=1)


# --- Nanosurf


def test_nanosurf_map_is_nsfopens():
    curves = ul.read_all(public_file("spectroscopy.nid"))
    assert len(curves) == 100
    first = curves[0]
    way_in, way_out = first.loading(), first.unloading()
    np.testing.assert_array_equal(
        thirds(way_in.force),
        [-5.270044375212667e-10, -5.540584493429762e-10, -4.1428680438565705e-10, 2.733964226432145e-07],
    )
    # To the last bits: the bending is taken off and put back.
    np.testing.assert_allclose(
        thirds(travel(way_in)),
        [-2.4028351604938504e-06, -1.9991191551089286e-06, -1.594087954610587e-06, -1.1899872086942204e-06],
        rtol=1e-14,
    )
    # NSFopen leaves the way out along its axis.
    np.testing.assert_array_equal(
        thirds(way_out.force[::-1]),
        [-8.34981137885745e-11, -1.6556491609666165e-10, -2.0805187709636735e-10, 2.738480014153754e-07],
    )
    assert first.time[-1] == pytest.approx(2.0, rel=1e-3)  # a second each way
    assert len(curves[1].loading()) == 980  # stopped early


def test_nanosurf_calibration_is_the_files_own_ratio_of_full_scales():
    curve = ul.read_all(public_file("spectroscopy.nid"))[0]
    # In0: 1.99075 uN, In5: 730.723 nm, In15: 10 V at full scale.
    assert curve.metadata["spring_constant"] == pytest.approx(1.99075e-6 / 7.30723e-7, rel=1e-5)
    assert curve.metadata["sensitivity"] == pytest.approx(73.0723e-9, rel=1e-12)


def test_nanosurf_pauses_are_nsfopens():
    second = ul.read_all(public_file("spec.nid"))[1]
    assert [len(part) for part in (second.loading(), second.hold(), second.unloading())] == [
        42165,
        2000,
        5000,
    ]
    np.testing.assert_array_equal(
        thirds(second.hold().force),
        [9.201659157769772e-09, 2.0707815866377214e-08, 2.450623273809444e-08, 1.1670940509755194e-08],
    )
    np.testing.assert_array_equal(
        thirds(second.unloading().force[::-1]),
        [1.6759057501237695e-09, 7.809342250600796e-10, -1.2502610109374007e-09, 1.1905448130499624e-08],
    )
    # 60 um in 60 s, as the file says: 1 um/s on the way in.
    way_in = second.loading()
    assert np.ptp(travel(way_in)) / np.ptp(way_in.time) == pytest.approx(1e-6, rel=0.02)


def test_nanosurf_files_of_another_kind_are_called_so():
    with pytest.raises(ul.FileFormatError, match="images and spectra are not read"):
        ul.read_all(public_file("thermal.nid"))


# --- Park


def test_park_curves_are_pspylibs():
    """The third place; single precision."""
    curves = ul.read_all(public_file("ForceCurve_009.tiff"))
    assert len(curves) == 7
    third = curves[2]
    half = len(third.loading())
    force = np.array([-0.9252625107765198, 0.9252625107765198]) * 1e-9
    np.testing.assert_allclose(third.force[[0, 20]], force, rtol=1e-6)
    assert third.force[[half - 1, half]] == pytest.approx(
        [1521.3629150390625e-9, 1516.5052490234375e-9], rel=1e-6
    )
    height = -np.array([-0.3634767234325409, -0.4884766936302185, -0.6245142817497253]) * 1e-6
    np.testing.assert_allclose(travel(third)[[0, 20, half - 1]], height, rtol=1e-6)
    np.testing.assert_allclose(third.time[[0, 20]], [120e-6, 6.26692], rtol=1e-6)
    assert third.metadata["spring_constant"] == 42.0
    assert "the file's force is 1.083 times" in third.metadata["notes"][0]


def test_park_curves_move_as_fast_as_the_file_says():
    """0.02 um/s both ways, from the positions and the time stamps."""
    for curve in ul.read_all(public_file("ForceCurve_009.tiff")):
        for part in (curve.loading(), curve.unloading()):
            assert np.ptp(travel(part)) / np.ptp(part.time) == pytest.approx(0.02e-6, rel=0.01)
        assert travel(curve)[0] < travel(curve.loading())[-1]


def test_a_park_image_is_called_one():
    with pytest.raises(ul.FileFormatError, match="an image; save the spectroscopy"):
        ul.read_all(public_file("Park_20210916_034.tiff"))


# --- Asylum


@pytest.mark.parametrize(
    ("name", "stiffness", "sensitivity", "trigger", "points"),
    [
        ("fmt-igor-fd_SiN_FD_plot.ibw", 1.1841, 44.99e-9, 10e-9, 2016),
        ("fmt-igor-fd_U3_3_p10004.ibw", 0.31451, 203.64e-9, 180e-9, 10097),
    ],
)
def test_asylum_metadata_close_with_the_numbers(name, stiffness, sensitivity, trigger, points):
    """The lever's rise is the trigger of the note within half a per cent, noise included."""
    curve = ul.read(public_file(name))
    assert len(curve) == points
    assert curve.metadata["spring_constant"] == stiffness
    assert curve.metadata["sensitivity"] == pytest.approx(sensitivity)
    assert curve.metadata["setpoint"] == trigger
    way_in = curve.loading().force
    assert way_in.max() - way_in[:100].mean() == pytest.approx(trigger, rel=5e-3)
    # 2000 points a second, as the note says and the wave's own step.
    assert np.diff(curve.time) == pytest.approx(np.full(points - 1, 5e-4))
    assert np.ptp(curve.time) == pytest.approx((points - 1) / 2000)


@pytest.mark.parametrize("name", ["fmt-igor-fd_SiN_FD_plot.ibw", "fmt-igor-fd_U3_3_p10004.ibw"])
def test_asylum_numbers_are_afmformats(name):
    afmformats = pytest.importorskip("afmformats")
    path = public_file(name)
    other, curve = afmformats.load_data(path)[0], ul.read(path)
    np.testing.assert_allclose(curve.force, other["force"], rtol=3e-7)  # it keeps single precision
    np.testing.assert_allclose(travel(curve), -other["height (measured)"], rtol=3e-7)


def test_an_asylum_image_is_called_one():
    with pytest.raises(ul.FileFormatError, match="no force curve: an image"):
        ul.read_all(public_file("AR_20211011.ibw"))


# --- what is not read


def test_an_ntmdt_file_says_how_to_export_it():
    with pytest.raises(ul.FileFormatError, match=r"NT-MDT file \(.mdt\), which is not read here"):
        ul.read_all(public_file("GaAs_map.mdt"))
