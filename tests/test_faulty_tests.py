"""Files of tests that went wrong, and of several steps, through the front door: what is read, said and fitted."""

import datetime as dt
import re
import tomllib

import numpy as np
import pandas as pd
import pytest

import underlay as ul
from support import faulty_tests as made
from support.compound_file import xls


@pytest.fixture
def put(tmp_path):
    def write(content, name="test.txt"):
        path = tmp_path / name
        path.write_bytes(content if isinstance(content, bytes) else content.encode())
        return path

    return write


def scene_text(radius, E="1 kPa", nu=0.5, curve="", thickness=""):
    return (
        f'indenter = {{ shape = "paraboloid", radius = "{radius}" }}\n'
        f'layer = {{ E = "{E}", nu = {nu}{thickness} }}\n'
        'fit.layer.E = { min = "1 Pa", max = "1 TPa" }\n'
        f"fit.instrument.contact_depth = {{}}\nfit.instrument.baseline = {{}}\n[curve]\n{curve}\n"
    )


# --- a lever that bends more than it travels, and a detector at its end


@pytest.mark.parametrize("fault", [1.12, 1.22, 1.6])
@pytest.mark.parametrize(
    ("file", "options"),
    [
        (made.nanoscope_on_mica, {}),
        (made.jpk_on_glass, {}),
        (made.volts_on_steel, {"calibration": {"spring_constant": "2 N/m", "sensitivity": "62 nm/V"}}),
    ],
)
def test_bending_beyond_the_travel_names_the_sensitivity_and_the_ratio(file, options, fault, put):
    curve = ul.read(put(file(fault)), **options)
    with pytest.raises(ul.CurveError, match="sensitivity") as error:
        ul.find_contact(curve)
    assert "\n" not in str(error.value)
    quality = ul.check_quality(curve)
    assert quality.verdict == "refused"
    told = re.search(r"([\d.]+) nm per nm of travel", quality.reasons[0])
    assert float(told[1]) == pytest.approx(fault, abs=0.03)


@pytest.mark.parametrize(
    ("file", "low", "high"),
    [(made.nanoscope_on_mica, "10 nm", "400 nm"), (made.jpk_on_glass, "-8.1 um", "-7.4 um")],
)
def test_a_fit_of_such_a_lever_ends_in_one_line(file, low, high, put, run, tmp_path):
    bounds = f'contact_depth = {{ min = "{low}", max = "{high}" }}'
    text = scene_text("20 nm", "1 GPa", 0.3).replace("contact_depth = {}", bounds)
    (tmp_path / "scene.toml").write_text(text, encoding="utf-8")
    code, _, err = run("fit", put(file(1.4)), "--scene", tmp_path / "scene.toml")
    assert code == 2
    assert "sensitivity" in err
    assert err.count("\n") == 1


def of_a_lever(fault, stiff, put):
    """A table of height sensor and deflection, way in alone: a tip of 20 nm on a sample of `stiff` Pa, 0.06 N/m."""
    depth = np.r_[np.linspace(-0.3e-6, 0.0, 300, endpoint=False), np.linspace(0.0, 1e-7, 20_001)]
    bending = made.paraboloid_force(depth, 20e-9, stiff) / 0.06
    kept = bending < 0.3e-6
    travel = np.linspace(-0.3e-6, (depth + bending)[kept][-1], 600)
    seen = fault * np.interp(travel, depth + bending, bending)
    seen = seen + 0.15e-9 * np.random.default_rng(5).standard_normal(600)
    text = made.table(1e9 * travel, 1e9 * seen, separator=",", form="{:.4f}")
    return put(f"# spring constant: 0.06 N/m\nz sensor (nm),Deflection (nm)\n{text}")


@pytest.mark.parametrize(("fault", "stiff"), [(1.1, 70e9), (1.1, 1e9), (1.4, 1e9), (1.4, 3e6)])
@pytest.mark.parametrize("bounds", ["", 'min = "-200 nm", max = "1 um"'])
def test_a_lever_that_bends_too_far_is_named_by_a_fit_with_a_free_contact_point(
    fault, stiff, bounds, put, tmp_path
):
    text = scene_text("20 nm", f"{stiff} Pa").replace("contact_depth = {}", f"contact_depth = {{ {bounds} }}")
    (tmp_path / "scene.toml").write_text(text, encoding="utf-8")
    with pytest.raises(ul.CurveError, match=r"\d nm per nm of travel.*sensitivity"):
        ul.load_problem(of_a_lever(fault, stiff, put), tmp_path / "scene.toml")


@pytest.mark.parametrize("stiff", [3e6, 1e9])
def test_the_travel_of_a_lever_is_not_compared_with_the_radius(stiff, put, tmp_path):
    """The lever bends by 15 radii and the tip goes in by 4, or by a tenth of one."""
    (tmp_path / "scene.toml").write_text(scene_text("20 nm", f"{stiff} Pa"), encoding="utf-8")
    found = ul.fit(ul.load_problem(of_a_lever(1.0, stiff, put), tmp_path / "scene.toml"))
    assert found.values["layer.E"] == pytest.approx(stiff, rel=0.03)


@pytest.mark.parametrize(
    ("file", "options", "top"),
    [
        (
            made.saturated_volts,
            {"calibration": {"spring_constant": "0.2 N/m", "sensitivity": "60 nm/V"}},
            2047 * 20.0 / 4096.0 * 60e-9 * 0.2,
        ),
        (made.saturated_jpk, {}, 20e-9),
        (made.saturated_cell, {}, 5.0),
    ],
)
def test_a_flat_top_is_named_as_a_saturated_detector(file, options, top, put):
    curve = ul.read(put(file()), **options)
    assert curve.force.max() == pytest.approx(top, rel=1e-4)
    reasons = ul.check_quality(curve).reasons
    assert any(reason.startswith("a flat top") and "saturated detector" in reason for reason in reasons)


# --- a coarse converter


@pytest.mark.parametrize(
    ("file", "name", "options", "step", "radius", "E"),
    [
        (
            made.coarse_volts,
            "v.csv",
            'calibration = { spring_constant = "0.2 N/m", sensitivity = "60 nm/V" }',
            20.0 / 4096.0 * 60e-9 * 0.2,
            "5 um",
            3e3,
        ),
        (made.coarse_cell, "m.txt", "", 0.00125 * 9.80665e-3, "1 mm", 5e3),
        (made.coarse_sheet, "s.xlsx", "", 0.01, "6 mm", 20e3),
    ],
)
def test_the_scatter_of_a_coarse_converter_is_its_step_over_the_root_of_twelve(
    file, name, options, step, radius, E, put, tmp_path
):
    scene = tmp_path / "scene.toml"
    scene.write_text(scene_text(radius, curve=options), encoding="utf-8")
    path = put(file(E), name)
    problem = ul.load_problem(path, scene)
    # The volts are written to 1e-5 V, 0.2 % of a step.
    assert ul.find_contact(problem.curves[0]).noise >= step / np.sqrt(12.0) * (1.0 - 2e-3)
    answer = ul.fit(problem).answer("layer.E")
    assert answer.low < E < answer.high
    assert answer.value == pytest.approx(E, rel=0.05)


# --- what no sample does


@pytest.mark.parametrize("kind", ["words", "motion", "sheet"])
@pytest.mark.parametrize("rise", [0.08, 0.4])
def test_a_force_that_rises_in_a_hold_is_named_with_its_share(kind, rise, put):
    reasons = ul.check_quality(ul.read(put(made.hold_that_rises(rise, kind)))).reasons
    (told,) = (reason for reason in reasons if "while the depth is held" in reason)
    assert float(re.search(r"\((\d+) % of its peak\)", told)[1]) == pytest.approx(95.0 * rise, abs=2.0)
    assert not any(
        "while the depth is held" in reason
        for reason in ul.check_quality(ul.read(put(made.hold_that_rises(-rise, kind)))).reasons
    )


@pytest.mark.parametrize(
    ("said", "times", "asked"),
    [
        ({"unit": "pN"}, 1e-3, "nN"),
        ({"unit": "nN", "stiffness": 60.0}, 1000.0, "pN"),
    ],
)
def test_a_force_or_a_lever_off_by_a_thousand_is_asked_about_in_one_line(said, times, asked, put, tmp_path):
    """Each is read as it is written: a force times 1000, or forces of a lever that is 1000 times too stiff."""
    scene = tmp_path / "scene.toml"
    scene.write_text(scene_text("5 um"), encoding="utf-8")
    path = put(made.small_ball(**said))
    (note,) = (n for n in ul.load_problem(path, scene).curves[0].metadata["notes"] if "you began with" in n)
    assert f"is the force in {asked}" in note
    assert "spring constant and the radius" in note
    told = float(re.search(r"about ([\d.e-]+) times", note)[1])
    # The gel has twice the modulus that the scene begins with.
    assert told == pytest.approx(2.0 * times, rel=0.5)
    sound = ul.load_problem(put(made.small_ball()), scene)
    assert not any("you began with" in n for n in sound.curves[0].metadata["notes"])


def test_a_unit_that_makes_a_lever_bend_a_thousand_times_too_far_is_named(put):
    quality = ul.check_quality(ul.read(put(made.small_ball("uN"))))
    assert quality.verdict == "refused"
    assert re.search(
        "bend more than it travels.*spring constant or the unit of the force", quality.reasons[0]
    )


@pytest.mark.parametrize("deflection", ["nm", "V", "with force"])
@pytest.mark.parametrize("sides", [1, 2])
def test_a_travel_that_falls_towards_the_sample_is_turned_before_the_bending_is_taken_off(
    deflection, sides, put
):
    depth = np.linspace(-1.0e-6, 2.0e-6, made.POINTS)
    force = made.paraboloid_force(depth, 5e-6, 2e3)
    bending = force / 0.06
    channels = {"z ({}um)": -1e6 * (depth + bending)}
    channels |= (
        {"Deflection ({}V)": bending / 50e-9} if deflection == "V" else {"Deflection ({}nm)": 1e9 * bending}
    )
    channels |= {"Force ({}nN)": 1e9 * force} if deflection == "with force" else {}
    ways = {1: {"": 1}, 2: {" extend": 1, " retract": -1}}[sides]
    names = [name.replace(" (", f"{way} (").format("") for way in ways for name in channels]
    columns = [column[::turn] for turn in ways.values() for column in channels.values()]
    given = {"spring_constant": "0.06 N/m", **({"sensitivity": "50 nm/V"} if deflection == "V" else {})}
    path = put(",".join(names) + "\n" + made.table(*columns, separator=",", form="{:.7f}"))
    curve = ul.read(path, calibration=None if deflection == "with force" else given)
    np.testing.assert_allclose(curve.loading().force, force, atol=1e-14)
    np.testing.assert_allclose(curve.loading().depth, depth, atol=1e-12)
    assert any("turned" in note for note in curve.metadata["notes"])


def test_a_radius_off_by_a_thousand_is_refused_with_both_sizes(put, tmp_path):
    scene = tmp_path / "scene.toml"
    scene.write_text(scene_text("5 nm"), encoding="utf-8")
    with pytest.raises(ul.CurveError, match=r"pressed 1\.9\d+ um beyond contact .* 5 nm in radius") as error:
        ul.load_problem(put(made.small_ball()), scene)
    assert "\n" not in str(error.value)


@pytest.mark.parametrize("begun", [0.4, 1.0, 2.5])
def test_a_radius_a_thousand_times_too_large_is_asked_about(begun, put, tmp_path):
    """It makes the modulus 32 times too small, and the depth 0.0004 radii."""
    scene = tmp_path / "scene.toml"
    scene.write_text(scene_text("5 mm", f"{2.0 * begun} kPa"), encoding="utf-8")
    (note,) = ul.load_problem(put(made.small_ball()), scene).curves[0].metadata["notes"][-1:]
    assert "you began with" in note
    assert "is the radius 5 um" in note or "the radius in the units" in note


@pytest.mark.parametrize("times", [1e-3, 1e3])
def test_a_spring_constant_off_by_a_thousand_is_asked_about(times, put, tmp_path):
    depth = np.linspace(-1.0e-6, 2.0e-6, made.POINTS)
    bending = made.paraboloid_force(depth, 5e-6, 2e3) / 0.06
    path = put("z (nm),Deflection (nm)\n" + made.table(1e9 * (depth + bending), 1e9 * bending, separator=","))
    scene = tmp_path / "scene.toml"
    told = f'calibration = {{ spring_constant = "{0.06 * times} N/m" }}'
    scene.write_text(scene_text("5 um", "4 kPa", curve=told), encoding="utf-8")
    assert any("spring constant" in n for n in ul.load_problem(path, scene).curves[0].metadata["notes"])


# --- a starter for every file


def filled(text, **values):
    """A starter with its places filled in, one after the other; fails where one is left."""
    for place, value in values.items():
        assert place in text
        text = text.replace(place, value)
    assert "TODO" not in re.sub(r"#.*", "", text)
    return text


@pytest.mark.parametrize(
    ("head", "columns", "told"),
    [
        ("", 'depth = "1 (um)", force = "2 (nN)"', "no row of names"),
        ("channel A;channel B\n", 'depth = "channel A (um)", force = "channel B (nN)"', "channel A"),
        ("Tiefe;Kraft\n", 'depth = "Tiefe (um)", force = "Kraft (nN)"', "no unit"),
    ],
)
def test_a_starter_of_an_unread_table_leads_to_its_modulus(head, columns, told, put, run, tmp_path):
    depth = np.linspace(-1.0, 2.0, made.POINTS)
    force = 1e9 * made.paraboloid_force(1e-6 * depth, 5e-6, 2e3)
    force = force + 0.01 * np.random.default_rng(1).standard_normal(made.POINTS)
    path, scene = put(head + made.table(depth, force, separator=";"), "table.dat"), tmp_path / "scene.toml"
    code, out, err = run("formats", path, "--new-scene", scene)
    assert code == 0, err
    assert "could not be read as it is" in out
    text = scene.read_text(encoding="utf-8")
    assert told in text
    assert (head.split("\n")[0] or f"{depth[0]:.6f};{force[0]:.6f}") in text
    assert "TODO" in tomllib.loads(text)["layer"]["thickness"]
    text = filled(
        re.sub(r"(?s)\[substrate\].*?(?=\[curve\])", "", re.sub(r"thickness = .*\n", "", text)),
        **{
            'shape = "TODO"': 'shape = "paraboloid"',
            '"TODO mm"': '"5 um"',
            '"TODO kPa"': '"1 kPa"',
            'nu = "TODO"': "nu = 0.5",
            'depth = "TODO (um)", force = "TODO (mN)"': columns,
            'min = "TODO um", max = "TODO um"': 'min = "-1 um", max = "1 um"',
        },
    )
    scene.write_text(text, encoding="utf-8")
    assert ul.fit(ul.load_problem(path, scene)).values["layer.E"] == pytest.approx(2e3, rel=0.02)


@pytest.mark.parametrize(
    ("content", "told"),
    [
        (b"\x01\xb0\x93\xff" + bytes(range(256)) * 4, "NT-MDT file"),
        (b"\x89HDF\r\n\x1a\n" + bytes(900), "HDF5"),
        (bytes(range(256)) * 9, "It is no text"),
        (b"Dear diary,\nnothing.\n", "Dear diary,"),
    ],
)
def test_a_starter_of_a_file_without_a_table_says_what_it_is(content, told, put, run, tmp_path):
    scene = tmp_path / "scene.toml"
    code, _, err = run("formats", put(content, "map.bin"), "--new-scene", scene)
    assert code == 0, err
    text = scene.read_text(encoding="utf-8")
    assert told in text
    assert tomllib.loads(text)["layer"]["thickness"] == "TODO mm"
    assert run("fit", tmp_path / "map.bin", "--scene", scene)[0] == 2


@pytest.mark.parametrize(
    ("head", "scale", "length", "pressure"),
    [
        ("depth (nm),force (uN)", (100.0, 900.0), "nm", "GPa"),
        ("depth (um),force (nN)", (3.0, 2.0), "um", "kPa"),
        ("depth (mm),force (N)", (2.0, 5.0), "mm", "MPa"),
    ],
)
def test_a_starter_is_in_the_sizes_of_its_file(head, scale, length, pressure, put, run, tmp_path):
    depth = np.linspace(-0.2, 1.0, 200)
    body = made.table(scale[0] * depth, scale[1] * np.clip(depth, 0.0, None) ** 1.5, separator=",")
    scene = tmp_path / "scene.toml"
    code, _, err = run("formats", put(f"{head}\n{body}", "c.csv"), "--new-scene", scene)
    assert code == 0, err
    found = tomllib.loads(scene.read_text(encoding="utf-8"))
    assert found["layer"]["thickness"] == f"TODO {length}"
    assert found["indenter"]["radius"] == f"TODO {length}"
    assert found["layer"]["E"] == f"TODO {pressure}"


# --- manifests, windows and steps


@pytest.mark.parametrize("kind", ["title", "dates", "old"])
def test_a_map_with_its_manifest_in_a_workbook(kind, put, run, tmp_path):
    """Three curves of 2 kPa under three radii; further columns, empty rows and other sheets stand beside them."""
    radii, files = (5.0, 6.0, 8.0), []
    for number, radius in enumerate(radii):
        depth = np.linspace(-1.0, 2.0, 150)
        force = 1e9 * made.paraboloid_force(1e-6 * depth, 1e-6 * radius, 2e3)
        force = force + 0.01 * np.random.default_rng(number).standard_normal(150)
        name = f"gel {number}.csv"
        put("depth (um),force (nN)\n" + made.table(depth, force, separator=","), name)
        files.append(name)
    if kind == "title":
        rows = zip(files, radii, ["wet", None, "wet"], strict=True)
        book = made.workbook(["Gels of May"], [], ["file", "radius (um)", "state"], *rows, [None, None, None])
    elif kind == "dates":
        days = [dt.date(2026, 5, day) for day in (1, 2, 3)]
        rows = zip(days, files, [f"{radius / 1e3} mm" for radius in radii], strict=True)
        other = ("notes", [["nothing", 1], ["to read", 2]])
        book = made.workbook(["state", "file", "radius"], *rows, sheets=[other])
    else:
        rows = [list(row) for row in zip(files, radii, ["a", "b", "c"], strict=True)]
        book = xls({"Sheet1": [["file", "radius (um)", "state"], *rows]})
    manifest = put(book, "gels.xls" if kind == "old" else "gels.xlsx")
    folder = tmp_path / "curves"
    folder.mkdir()
    for name in files:
        (tmp_path / name).rename(folder / name)
    (tmp_path / "scene.toml").write_text(scene_text("5 um"), encoding="utf-8")
    words = ("--scene", tmp_path / "scene.toml", "--manifest", manifest, "--workers", 0)
    code, _, err = run("map", folder, *words, "--output", tmp_path / "out")
    assert code == 0, err
    table = pd.read_csv(tmp_path / "out" / "map.csv")
    np.testing.assert_allclose(table["layer.E"], 2e3, rtol=0.02)
    assert "state" in table.columns


STEPWISE = {
    "mach1": (made.steps_of_mach1, "steps.txt"),
    "minutes": (made.steps_in_minutes, "steps.csv"),
    "sheet": (made.steps_of_a_sheet, "steps.xlsx"),
}


@pytest.mark.parametrize("count", [1, 3, 5])
@pytest.mark.parametrize("kind", STEPWISE)
def test_equilibrium_of_few_steps(kind, count, put, tmp_path):
    file, name = STEPWISE[kind]
    scene = tmp_path / "scene.toml"
    text = scene_text("1 mm", curve='segment = "equilibrium"')
    text = "\n".join(
        line for line in text.splitlines() if "contact_depth" not in line and "baseline" not in line
    )
    scene.write_text(text, encoding="utf-8")
    problem = ul.load_problem(put(file(20e3, count), name), scene)
    assert problem.n_points == count
    answer = ul.fit(problem).answer("layer.E")
    assert answer.value == pytest.approx(20e3, rel=0.01)
    assert answer.low < 20e3 < answer.high


@pytest.mark.parametrize("kind", STEPWISE)
@pytest.mark.parametrize(
    ("choice", "points", "deepest"),
    [
        ('segment = "ramp 2"', 50, 2.0 / 3.0),
        ('step = 2\nsegment = "all"', 300, 2.0 / 3.0),
        ('from_time = "60 s"\nto_time = "119.9 s"\nsegment = "all"', 300, 2.0 / 3.0),
    ],
)
def test_a_step_is_chosen_in_the_scene(kind, choice, points, deepest, put, tmp_path):
    file, name = STEPWISE[kind]
    scene = tmp_path / "scene.toml"
    text = scene_text("1 mm", curve=choice)
    text = "\n".join(
        line for line in text.splitlines() if "contact_depth" not in line and "baseline" not in line
    )
    scene.write_text(text, encoding="utf-8")
    (curve,) = ul.load_problem(put(file(20e3, 3), name), scene).curves
    assert len(curve) == pytest.approx(points, abs=4)
    assert np.ptp(curve.depth) < 8e-5
    assert curve.depth.max() == pytest.approx(deepest * 8e-5, rel=0.03)


@pytest.mark.parametrize("kind", STEPWISE)
def test_a_hold_alone_is_refused_as_one(kind, put, tmp_path):
    file, name = STEPWISE[kind]
    scene = tmp_path / "scene.toml"
    scene.write_text(scene_text("1 mm", curve='segment = "hold 3"'), encoding="utf-8")
    with pytest.raises(ul.CurveError, match="a hold alone"):
        ul.load_problem(put(file(20e3, 3), name), scene)


@pytest.mark.parametrize("choice", ['segment = "ramp 9"', 'segment = "hold 9"', "step = 9"])
@pytest.mark.parametrize("kind", STEPWISE)
def test_a_step_that_is_not_there_is_refused_with_what_is(kind, choice, put, tmp_path):
    file, name = STEPWISE[kind]
    scene = tmp_path / "scene.toml"
    scene.write_text(scene_text("1 mm", curve=choice), encoding="utf-8")
    with pytest.raises(ul.CurveError, match=r"has no (ramp|hold|step) 9\b.*\b3\b"):
        ul.load_problem(put(file(20e3, 3), name), scene)
