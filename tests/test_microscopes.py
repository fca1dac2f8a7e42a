"""NanoScope, Nanosurf, Park and Asylum readers on small files of our own: numbers, signs, segments, calibration."""

import numpy as np
import pytest

import underlay as ul
from support import afm_files
from support import microscope_files as files
from support.afm_files import POINTS, SENSITIVITY, STIFFNESS

TRAVEL, FORCE = files.approach()
#: One number of a NanoScope file, as force and as travel.
FORCE_STEP = files.PER_NUMBER * SENSITIVITY * STIFFNESS
HEIGHT_STEP = 1e-4 * files.SENSOR * 1e-9


@pytest.fixture
def put(tmp_path):
    def write(content, name="measured.dat"):
        path = tmp_path / name
        path.write_bytes(content)
        return path

    return write


def check(curve, held=0, *, force_step=FORCE_STEP, travel_step=1e-15):
    """A curve of all files: its ways, its hold between them, and the bending off its depth."""
    force = np.concatenate((FORCE, np.full(held, FORCE[-1]), 0.8 * FORCE[::-1]))
    travel = np.concatenate((TRAVEL, np.full(held, TRAVEL[-1]), TRAVEL[::-1]))
    np.testing.assert_allclose(curve.force, force, atol=0.51 * force_step, rtol=0)
    shift = curve.depth[0] + curve.force[0] / STIFFNESS
    np.testing.assert_allclose(
        curve.depth + curve.force / STIFFNESS - shift, travel, atol=1.1 * travel_step, rtol=0
    )
    assert list(curve.segment) == ["loading"] * POINTS + ["hold"] * held + ["unloading"] * POINTS
    assert (np.diff(curve.time) > 0.0).all()
    assert curve.metadata["spring_constant"] == pytest.approx(STIFFNESS)
    assert curve.metadata["sensitivity"] == pytest.approx(SENSITIVITY)
    assert curve.metadata["bending_taken_off"]


# --- NanoScope


def test_nanoscope_ramp(put):
    curve = ul.read(put(files.nanoscope()))
    check(curve)
    assert curve.time[[POINTS - 1, POINTS, -1]] == pytest.approx(
        [0.98, 1.0, 1.49]
    )  # 1 s in, half a second back
    assert curve.metadata["position"] == pytest.approx((100e-9, -50e-9))
    assert curve.metadata["setpoint"] == pytest.approx(0.5 * SENSITIVITY * STIFFNESS)
    assert curve.metadata["header"]["instrument"] == "MultiMode 8"
    assert "ramp of the piezo" in curve.metadata["sign_rules"]["depth"]


@pytest.mark.parametrize("version", [0x09010201, 0x0930A509])
def test_nanoscope_hold_comes_between_the_ways_and_the_sensor_is_taken(version, put):
    curve = ul.read(put(files.nanoscope(version=version, hold=20, sensor=True)))
    check(curve, 20, travel_step=HEIGHT_STEP)
    assert curve.time[POINTS + 19] - curve.time[POINTS] == pytest.approx(0.5 * 19 / 20)
    assert "height sensor" in curve.metadata["sign_rules"]["depth"]


def test_a_height_sensor_that_disagrees_with_the_drive_is_noted(put):
    assert ul.read(put(files.nanoscope(sensor=True))).metadata["notes"] == ()
    twice = ul.read(put(files.nanoscope(sensor=True, **{"@Sens. ZsensSens": "V 2000.0 nm/V"})))
    # 49 of 50 steps of the ramp lie between the first and the last point.
    assert "the height sensor moved 1.96 times as far as the piezo was driven" in twice.metadata["notes"][0]


def test_nanoscope_volumes_have_places_and_points_that_were_not_recorded(put):
    path = put(files.nanoscope(curves=4, missing=3))
    curves = ul.read_all(path)
    assert [len(curve) for curve in curves] == [2 * POINTS - 3] * 4
    assert [curve.metadata["test"] for curve in curves] == [1, 2, 3, 4]
    assert curves[0].metadata["notes"] == ("3 of 100 points were not recorded, as the file marks them",)
    np.testing.assert_allclose(curves[0].force[: POINTS - 3], FORCE[3:], atol=0.51 * FORCE_STEP, rtol=0)
    places = np.array([curve.metadata["position"] for curve in curves]) - (100e-9, -50e-9)
    np.testing.assert_allclose(places * 1e9, [(-500, -500), (500, -500), (-500, 500), (500, 500)], atol=1e-6)
    alone = ul.read(path, test=3)
    np.testing.assert_array_equal(alone.depth, curves[2].depth)
    assert alone.metadata == curves[2].metadata
    with pytest.raises(ul.InputError, match="there is no test 5"):
        ul.read(path, test=5)


@pytest.mark.parametrize("mark", [-(2**15), -(2**31)])
def test_nanoscope_points_that_were_not_recorded_are_so_in_wide_files_too(mark, put):
    """Numbers of 16 bits that were widened keep the least of 16 bits."""
    curves = ul.read_all(put(files.nanoscope(version=0x0930A4F8, curves=4, missing=3, mark=mark)))
    assert [len(curve) for curve in curves] == [2 * POINTS - 3] * 4
    np.testing.assert_allclose(curves[0].force[: POINTS - 3], FORCE[3:], atol=0.51 * FORCE_STEP, rtol=0)


def test_peakforce_taps_turn_where_the_file_says(put):
    curve = ul.read(put(files.nanoscope(curves=4, tap=True)), test=2)
    travel = curve.depth + curve.force / STIFFNESS
    turn = 30.5
    np.testing.assert_allclose(
        travel, 100e-9 * np.cos(2.0 * np.pi * (np.arange(len(travel)) - turn) / (2 * POINTS)), atol=1e-15
    )
    # What follows the far end of the drive is the way in of the next tap.
    assert len(travel) == int(turn + POINTS) + 1
    assert list(curve.segment) == ["loading"] * 31 + ["unloading"] * (len(travel) - 31)
    assert curve.time[1] == pytest.approx(0.5e-3 / (2 * POINTS))
    assert "not measured" in curve.metadata["notes"][0]


@pytest.mark.parametrize(
    ("change", "told"),
    [
        (lambda data: data[:-100], "is cut short: a channel claims 200 bytes"),
        (lambda data: data[:1000], "header does not end"),
        (
            lambda data: data.replace(b"[DeflectionError]", b"[Height]"),
            "without a force curve of the deflection",
        ),
        (lambda data: data.replace(b"Samps/line: 50 50", b"Samps/line: 50 40"), "only equal ones are known"),
        (lambda data: data.replace(b"context: FOL", b"context: SCRIPT"), "another kind than ramps.*export"),
        (lambda data: data.replace(b"Data length: 200", b"Data length: 201"), "no whole number of curves"),
        (
            lambda data: data.replace(b"Ramp size", b"Ramp xxxx"),
            "neither a height sensor nor the size of the ramp",
        ),
    ],
)
def test_nanoscope_damage_is_said(change, told, put):
    data = files.nanoscope()
    changed = change(data)
    assert changed != data
    with pytest.raises(ul.FileFormatError, match=told):
        ul.read(put(changed))


def test_nanoscope_numbers_of_32_bits_are_read_on_a_scale_for_32_bits(put):
    step = 6e-9
    curve = ul.read(put(files.nanoscope(version=0x0930A509, hold=20, stated=4, per_number=step)))
    check(curve, 20, force_step=step * SENSITIVITY * STIFFNESS)


@pytest.mark.parametrize("stated", [2, 4])
@pytest.mark.parametrize("louder", [256, 65536])
@pytest.mark.parametrize("curves", [1, 4])
def test_nanoscope_numbers_of_more_bits_than_their_scale_are_refused(louder, stated, curves, put):
    """They are forces 256 or 65536 times too large, and look like curves."""
    data = files.nanoscope(version=0x0920B046, curves=curves, stated=stated, louder=louder)
    told = r"measured.dat: the numbers of .*Deflection Error.* is for 16 bits, up to 32768: .*take the file"
    for read_in in (ul.read_all, lambda path: ul.read(path, test=1)):
        with pytest.raises(ul.FileFormatError, match=told):
            read_in(put(data))


def test_a_byte_too_many_in_a_nanoscope_header_is_refused(put):
    """It shifts all numbers; in four bytes they are 256 times too large, as in a public file."""
    data = files.nanoscope(version=0x0920B046)
    with pytest.raises(
        ul.FileFormatError, match=r"is for 16 bits.*an edit of the header, shifts the numbers"
    ):
        ul.read(put(data.replace(b"\x1a", b"\x1a\0", 1)))


def test_a_nanoscope_height_of_more_bits_than_its_scale_is_refused(put):
    data = files.nanoscope(version=0x0920B046, sensor=True)
    end = 4 * 2 * POINTS
    heights = (np.frombuffer(data[-end:], "<i4") * 65536).astype("<i4").tobytes()
    with pytest.raises(ul.FileFormatError, match=r"numbers of .*Height Sensor.* is for 16 bits"):
        ul.read(put(data[:-end] + heights))


def test_a_deflection_far_above_the_trigger_that_should_have_ended_it_is_refused(put):
    """Small numbers, 256 times too large, still have few enough bits."""
    data = files.nanoscope(version=0x0920B046, per_number=200 * files.PER_NUMBER, louder=256)
    told = r"rises by .* V on the way in, .* times the relative trigger of 0\.5 V that should have ended it"
    with pytest.raises(ul.FileFormatError, match=told):
        ul.read(put(data))
    # A trigger that is off ends nothing: the same ramp is read.
    assert ul.read(put(data.replace(b"mode: Relative", b"mode: Off     "))).metadata["spring_constant"]


def test_a_capture_that_turns_elsewhere_is_refused(put):
    with pytest.raises(ul.FileFormatError, match="turns at point 70 of 100"):
        ul.read_all(put(files.nanoscope(curves=4, tap=True, **{"Sync Distance New": "70"})))


# --- Nanosurf


@pytest.mark.parametrize(("bits", "step"), [(32, 1e-18), (16, 1e-5 / 2**16)])
@pytest.mark.parametrize("unit", ["N", "m", "V"])
def test_nanosurf_curves(bits, step, unit, put):
    curves = ul.read_all(put(files.nid(bits=bits, unit=unit)))
    check(
        curves[0], force_step=files.VOLTS * STIFFNESS * SENSITIVITY / 2.0**bits, travel_step=max(step, 1e-14)
    )
    # The second stopped five points early; its padding is no data.
    assert [len(curves[1].loading()), len(curves[1].unloading())] == [POINTS - 5, POINTS]
    assert curves[0].time[[0, POINTS - 1, POINTS]] == pytest.approx([0.0, 0.98, 1.0])
    assert curves[0].metadata["header"]["instrument"] == "FlexAFM"


def test_nanosurf_pauses_come_between_the_ways(put):
    curve = ul.read(put(files.nid(curves=1, pause=20)))
    check(curve, 20, force_step=files.VOLTS * STIFFNESS * SENSITIVITY / 2.0**32, travel_step=1e-14)
    assert curve.time[POINTS + 20] - curve.time[POINTS] == pytest.approx(2.0)


@pytest.mark.parametrize(
    ("change", "told"),
    [
        (lambda data: data[:-10], "is cut short: .DataSet-1:7. claims 400 bytes"),
        (lambda data: data.replace(b"#!", b"##"), "its header does not end"),
        (lambda data: data.replace(b"Spec forward", b"Scan forward"), "without a force curve"),
        (lambda data: data.replace(b"SaveBits=32", b"SaveBits=12"), "no numbers of 16 or 32 bits"),
        (
            lambda data: data.replace(b"Points=50", b"Points=fifty", 1),
            "no whole number for 'Points'.*says 'fifty'",
        ),
        (lambda data: data.replace(b"Dim2Unit=m", b"Dim2Unit=s"), "no position of the scanner"),
        (lambda data: data.replace(b"Dim2Unit=N", b"Dim2Unit=A"), "a deflection in 'A'"),
        (
            lambda data: data.replace(b"Dim2Min=", b"Dim2Min=nan", 1),
            "no number for 'Dim2Min'.*says 'nan-?[0-9.e-]+'",
        ),
    ],
)
def test_nanosurf_damage_is_said(change, told, put):
    data = files.nid()
    changed = change(data)
    assert changed != data
    with pytest.raises(ul.FileFormatError, match=told):
        ul.read_all(put(changed))


# --- Park


@pytest.mark.parametrize("dead", [False, True])
def test_park_curves(dead, put):
    curves = ul.read_all(put(files.park(dead=dead)))
    assert len(curves) == 2
    # Single precision: half of 1.2e-7 of 3 um, in a point and in the first.
    check(curves[1], force_step=1e-14, travel_step=4e-13)
    assert curves[1].metadata["position"] == pytest.approx((2e-6, 2e-6))
    assert (
        curves[0].metadata["sign_rules"]["depth"].startswith("minus Z Scan" if dead else "minus Z Detector")
    )
    assert curves[0].metadata["notes"] == ()
    assert curves[0].metadata["header"]["software version"] == "Park Systems SmartScan"


def test_park_says_where_its_two_calibrations_differ(put):
    path = put(files.park(curves=1, ratio=1.1))
    curve = ul.read(path)
    assert curve.force.max() == pytest.approx(1.1 * FORCE.max(), rel=1e-5)
    assert (
        "1.100 times what its spring constant (0.04 N/m) and sensitivity (60 nm/V)"
        in curve.metadata["notes"][0]
    )
    given = ul.read(path, calibration={"sensitivity": "60 nm/V"})
    assert given.force.max() == pytest.approx(FORCE.max(), rel=1e-5)
    assert given.metadata["notes"] == ()


@pytest.mark.parametrize(
    ("change", "told"),
    [
        (lambda data: data[:-10], "is cut short: tag 50439"),
        (lambda data: data[:60], "cut short"),
        (
            lambda data: data.replace(b"\x06\xc5\x07\x00", b"\x00\xc5\x07\x00"),
            "an image; save the spectroscopy",
        ),
        (lambda data: data.replace("Z ".encode("utf-16-le"), "Q ".encode("utf-16-le")), "has no height"),
    ],
)
def test_park_damage_is_said(change, told, put):
    data = files.park()
    changed = change(data)
    assert changed != data
    with pytest.raises(ul.FileFormatError, match=told):
        ul.read_all(put(changed))


# --- Asylum


def test_asylum_waves_have_time_segments_and_a_setpoint(put):
    curve = ul.read(put(afm_files.igor()))
    assert curve.metadata["setpoint"] == 1e-8
    assert curve.metadata["header"] == {
        "instrument": "MFP3D",
        "software version": "1",
        "date": "2020-01-01",
        "time": "12:00:00",
        "imaging mode": "Contact",
    }
    assert list(curve.segment) == ["loading"] * len(curve)


def test_an_image_of_asylum_is_called_one(put):
    data = bytearray(afm_files.igor())
    data[132:148] = (
        (10).to_bytes(4, "little") + (5).to_bytes(4, "little") + (3).to_bytes(4, "little") + bytes(4)
    )
    with pytest.raises(ul.FileFormatError, match=r"no force curve: an image|damaged"):
        ul.read(put(bytes(data)))


# --- calibration


MAKERS = {
    "nanoscope": files.nanoscope,
    "nanosurf": lambda: files.nid(curves=1),
    "park": lambda: files.park(curves=1),
    "asylum": afm_files.igor,
    "jpk": afm_files.jpk,
}


@pytest.mark.parametrize("make", MAKERS.values(), ids=MAKERS)
def test_a_calibration_that_is_given_acts_on_the_volts(make, put):
    """F = k s V and depth = travel - s V, whatever the file's own numbers are; those stand beside."""
    path = put(make())
    own = ul.read(path)
    given = ul.read(path, calibration={"spring_constant": "0.08 N/m", "sensitivity": "90 nm/V"})
    np.testing.assert_allclose(given.force, 3.0 * own.force, rtol=1e-6)
    bending = own.force / STIFFNESS
    np.testing.assert_allclose(given.depth + 1.5 * bending, own.depth + bending, atol=2e-13)
    assert given.metadata["spring_constant"] == 0.08
    assert given.metadata["sensitivity"] == pytest.approx(90e-9)
    assert given.metadata["file_spring_constant"] == pytest.approx(STIFFNESS)
    assert given.metadata["file_sensitivity"] == pytest.approx(SENSITIVITY)
    stiffer = ul.read(path, calibration={"spring_constant": "0.08 N/m"})
    np.testing.assert_allclose(stiffer.force, 2.0 * own.force, rtol=1e-6)
    np.testing.assert_allclose(stiffer.depth, own.depth, atol=2e-13)  # the bending is s V still


UNCALIBRATED = {
    "nanoscope": lambda: files.nanoscope(calibrated=False),
    "nanosurf": lambda: files.nid(curves=1, unit="V", calibrated=False),
    "park": lambda: files.park(curves=1, calibrated=False, force=False),
}


@pytest.mark.parametrize("make", UNCALIBRATED.values(), ids=UNCALIBRATED)
def test_files_without_a_calibration_ask_for_it(make, put):
    path = put(make())
    with pytest.raises(ul.InputError, match=r"calibration; give calibration = \{ spring_constant"):
        ul.read(path)
    curve = ul.read(path, calibration={"spring_constant": "0.04 N/m", "sensitivity": "60 nm/V"})
    np.testing.assert_allclose(curve.loading().force, FORCE, atol=0.51 * FORCE_STEP)
    assert "file_sensitivity" not in curve.metadata


def test_how_well_a_calibration_is_known_is_kept(put):
    path = put(files.nanoscope())
    known = ul.read(path, calibration={"spring_constant": "0.04 N/m ± 10 %", "sensitivity": "+- 3 %"})
    assert known.metadata["spring_constant_uncertainty"] == pytest.approx(0.10)
    assert known.metadata["sensitivity_uncertainty"] == pytest.approx(0.03)
    assert known.metadata["sensitivity"] == pytest.approx(SENSITIVITY)
    assert "file_sensitivity" not in known.metadata
    for wrong, told in (
        ({"spring_constant": "± 0.01 N/m"}, "without a number its uncertainty is in per cent"),
        ({"spring_constant": "0.04 N/m ± 100 %"}, "better than a factor of two"),
        ({"spring_constant": "0.04 N/m ± 3 nm"}, "length"),
        ({"spring_constant": "0.04 N/m ± "}, "got ''"),
    ):
        with pytest.raises(ul.InputError, match=told):
            ul.read(path, calibration=wrong)


# --- what is known and not read


@pytest.mark.parametrize(
    ("content", "told"),
    [
        (
            b"\x01\xb0\x93\xff" + bytes(100),
            r"an NT-MDT file \(.mdt\), which is not read here: open it in NT-MDT's",
        ),
        (b"GWYP" + bytes(100), "a Gwyddion file.*export the curves"),
        (bytes(8) + b"ARDF" + bytes(100), "as .ibw, one a file, which are read"),
    ],
)
def test_what_is_not_read_says_how_to_export_it(content, told, put):
    with pytest.raises(ul.FileFormatError, match=told):
        ul.read(put(content))


def test_a_file_of_nanosurf_studio_says_how_to_export_it(tmp_path):
    h5py = pytest.importorskip("h5py")
    with h5py.File(tmp_path / "x.nhf", "w") as file:
        file.attrs["nsf_file_version_major"] = 2
        file.create_group("measurement_0")
    with pytest.raises(
        ul.FileFormatError, match=r"Nanosurf Studio file \(.nhf\), which is not read here: export"
    ):
        ul.read(tmp_path / "x.nhf")
