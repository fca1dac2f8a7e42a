"""Files of tests that went wrong, as instruments write them: levers, converters, units; and tests of several steps.

Each function returns the text or the bytes of one file. The sample is a half-space, if it is one that gives.
"""

import io
import itertools

import numpy as np
import openpyxl

POINTS = 400


def paraboloid_force(depth, radius, E, nu=0.5):
    """Force (N) of a paraboloid of `radius` (m) pressed to `depth` (m) into a half-space: Hertz."""
    return 4.0 / 3.0 * E / (1.0 - nu**2) * np.sqrt(radius) * np.clip(depth, 0.0, None) ** 1.5


def table(*columns, separator="\t", form="{:.6f}", end="\n"):
    lines = (separator.join(form.format(value) for value in row) for row in zip(*columns, strict=True))
    return "".join(f"{line}{end}" for line in lines)


def workbook(*rows, sheets=()):
    """A workbook (.xlsx): rows of its first sheet, and further sheets as (name, rows)."""
    book = openpyxl.Workbook()
    for row in rows:
        book.active.append(list(row))
    for name, others in sheets:
        sheet = book.create_sheet(name)
        for row in others:
            sheet.append(list(row))
    content = io.BytesIO()
    book.save(content)
    return content.getvalue()


# --- a lever on a sample that does not give


def rigid(fault, noise, seed):
    """Travel and bending (m) of a lever on a rigid sample; the sensitivity is `fault` times too large."""
    travel = np.linspace(0.0, 500e-9, POINTS)
    rng = np.random.default_rng(seed)
    return travel, fault * np.clip(travel - 350e-9, 0.0, None) + noise * rng.standard_normal(POINTS)


def nanoscope_on_mica(fault):
    """NanoScope's text export of a tip on mica, way in and way back, adhesion on the way back; k = 0.35 N/m."""
    travel, bending = rigid(fault, 0.15e-9, 1)
    back = np.where((travel > 310e-9) & (travel <= 350e-9), fault * (travel - 350e-9), bending)
    head = ['"\\*Force file list"', '"\\Spring Constant: 0.35"', '"\\@Sens. DeflSens: V 55.0 nm/V"']
    names = "\t".join(f"{name}_{way}" for name in ("Calc_Ramp_nm", "Defl_nm") for way in ("Ex", "Rt"))
    columns = (1e9 * travel, 1e9 * travel[::-1], 1e9 * bending, 1e9 * back[::-1])
    return "\r\n".join([*head, names, table(*columns, end="\r\n")])


def jpk_on_glass(fault):
    """JPK's text export: a height that falls, forces in N, k = 0.04 N/m in the head, times in exponents."""
    travel, bending = rigid(fault, 0.3e-9, 2)
    parts = []
    for segment, way in (("extend", slice(None)), ("retract", slice(None, None, -1))):
        parts.append(
            f"# segment: {segment}\n# columns: measuredHeight vDeflection time\n# sensitivity: 5.1E-8\n"
            "# springConstant: 0.04\n# units: m N s\n#\n"
            + table(
                8e-6 - travel[way],
                0.04 * bending[way],
                1e-3 * np.arange(POINTS),
                separator=" ",
                form="{:.8E}",
            )
        )
    return "# TEXT EXPORT\n#\n" + "\n#\n".join(parts)


def volts_on_steel(fault):
    """A home-made table, decimal commas, detector in volts at 62 nm/V if all were well; no calibration in it."""
    travel, bending = rigid(fault, 0.2e-9, 3)
    lines = table(1e6 * travel, bending / 62e-9, separator=";", form="{:.7f}").replace(".", ",")
    return f"Z-Sensor [µm];Deflection [V]\n{lines}".encode("latin-1")


# --- a detector at its end


def _pressed(E, radius, deepest):
    depth = np.linspace(-0.4, 1.0, POINTS) * deepest
    return depth, paraboloid_force(depth, radius, E)


def saturated_volts():
    """A table of volts that stop at 9.9952 V, the last number of a converter of 12 bits over 20 V."""
    depth, force = _pressed(40e3, 5e-6, 3e-6)
    step = 20.0 / 4096.0
    bending = force / 0.2
    volts = np.minimum(step * np.rint(bending / 60e-9 / step), 2047 * step)
    return "z (um),Deflection (V)\n" + table(1e6 * (depth + bending), volts, separator=",")


def saturated_jpk():
    """JPK's text export, pressed beyond 20 nN, where the photodiode ends on both ways; k = 0.1 N/m."""
    depth, force = _pressed(8e3, 5e-6, 3e-6)
    rng = np.random.default_rng(4)
    said = np.minimum(force + 5e-11 * rng.standard_normal(POINTS), 20e-9)
    parts = []
    for segment, way in (("extend", slice(None)), ("retract", slice(None, None, -1))):
        parts.append(
            f"# segment: {segment}\n# columns: vDeflection height\n# springConstant: 0.1\n# units: N m\n"
            + table(said[way], 9e-6 - (depth + force / 0.1)[way], separator=" ", form="{:.9E}")
        )
    return "\n".join(parts)


def saturated_cell():
    """A testing machine whose load cell ends at 5 N; minutes, a row of units, a remark beside each row."""
    depth, force = _pressed(0.5e6, 6e-3, 2e-3)
    body = table(np.linspace(0.0, 0.5, POINTS), 1e3 * depth, np.minimum(force, 5.0), separator=",")
    return "Time,Extension,Load,Remark\n(min),(mm),(N),\n" + body.replace("\n", ",ok\n")


# --- a coarse converter


def coarse_volts(E):
    """Deflection in steps of 4.883 mV (12 bits over 20 V): 58.6 pN at 60 nm/V and 0.2 N/m; sphere of 5 um."""
    depth, force = _pressed(E, 5e-6, 1.5e-6)
    step = 20.0 / 4096.0
    volts = step * np.rint(force / (0.2 * 60e-9) / step)
    return "z (um);Deflection (V)\n" + table(1e6 * (depth + force / 0.2), volts, separator=";", form="{:.5f}")


def coarse_cell(E):
    """A Mach-1 file whose cell steps by 0.00125 gf, ramp alone; a ball of 1 mm pressed by 60 um."""
    travel = np.linspace(-20.0, 60.0, POINTS) * 1e-6
    grams = paraboloid_force(travel, 1e-3, E) / 9.80665e-3
    step = 0.00125
    text = "<Mach-1 File>\r\n<INFO>\r\nLoad Cell Type:\tSingle-axis\r\n<END INFO>\r\n<Stress Relaxation>\r\n"
    text += (
        "Stage Axis:\tPosition (z)\r\nLoad Cell Axis:\tFz\r\n<DATA>\r\nTime, s\tPosition (z), mm\tFz, gf\r\n"
    )
    body = table(0.01 * np.arange(POINTS), -2.0 + 1e3 * travel, step * np.rint(grams / step), end="\r\n")
    return f"{text}{body}<divider>\r\n<END DATA>\r\n"


def coarse_sheet(E):
    """A workbook that keeps two digits of a force in N; a ball of 6 mm pressed by 1.5 mm."""
    depth, force = _pressed(E, 6e-3, 1.5e-3)
    rows = ([round(float(w), 5), round(float(f), 2)] for w, f in zip(1e3 * depth, force, strict=True))
    return workbook(["Traverse"], ["Weg", "Kraft"], ["mm", "N"], *rows)


# --- what no sample does


def hold_that_rises(rise, kind):
    """A ramp and a hold whose force rises by the share `rise`: drift of a cell, written in three ways."""
    depth = np.r_[np.linspace(-0.2, 1.0, 240), np.full(260, 1.0)]
    force = np.clip(depth, 0.0, None) ** 1.5 * np.r_[np.ones(240), 1.0 + rise * np.linspace(0.0, 1.0, 260)]
    force = force + 2e-4 * np.random.default_rng(7).standard_normal(500)
    time = 0.1 * np.arange(500)
    if kind == "words":
        words = np.repeat(("loading", "hold"), (240, 260))
        lines = table(20.0 * depth, 3.0 * force, time, separator=",").splitlines()
        return "depth (um),force (mN),time (s),segment\n" + "\n".join(
            map(",".join, zip(lines, words, strict=True))
        )
    if kind == "motion":
        return "time[s] weg[mm] kraft[N]\n" + table(time, 0.5 * depth, 2.0 * force, separator=" ")
    return workbook(
        ["Test time", "Indentation depth", "Load"],
        ["s", "nm", "mN"],
        *zip(time.tolist(), (800.0 * depth).tolist(), (0.4 * force).tolist(), strict=True),
    )


def small_ball(unit="nN", stiffness=0.06):
    """JPK's text export of a gel of 2 kPa under a sphere of 5 um; `unit` and k are what the head says they are."""
    depth = np.linspace(-1.0e-6, 2.0e-6, POINTS)
    force = paraboloid_force(depth, 5e-6, 2e3) + 1e-11 * np.random.default_rng(5).standard_normal(POINTS)
    written = force * 1e9 * stiffness / 0.06
    height = 9e-6 - depth - force / 0.06
    return f"# columns: height vDeflection\n# springConstant: {stiffness}\n# units: m {unit}\n" + table(
        height, written, separator=" ", form="{:.8E}"
    )


# --- tests of several steps


def steps(E, radius, count, deepest):
    """Depth (m), force (N), time (s) of ramps and holds of a sample that relaxes by a third; E is at rest."""
    ramp, hold = 50, 250
    ends = np.linspace(0.0, deepest, count + 1)
    depth = np.concatenate(
        [np.r_[np.linspace(low, high, ramp), np.full(hold, high)] for low, high in itertools.pairwise(ends)]
    )
    since = np.tile(np.r_[np.zeros(ramp), 0.2 * np.arange(hold)], count)
    force = paraboloid_force(depth, radius, E) * (1.0 + 0.5 * np.exp(-since / 3.0))
    noise = 5e-4 * force.max() * np.random.default_rng(count).standard_normal(len(depth))
    return depth, force + noise, 0.2 * np.arange(len(depth))


def steps_of_mach1(E, count):
    """Mach-1, a ball of 1 mm, ``count`` ramps with a divider after each, single-axis cell in gf."""
    depth, force, time = steps(E, 1e-3, count, 8e-5)
    lines = table(time, -2.0 + 1e3 * depth, force / 9.80665e-3, end="\r\n").splitlines(keepends=True)
    size = len(lines) // count
    text = "<Mach-1 File>\r\n<INFO>\r\nLoad Cell Type:\tSingle-axis\r\n<END INFO>\r\n<Stress Relaxation>\r\n"
    text += (
        "Stage Axis:\tPosition (z)\r\nLoad Cell Axis:\tFz\r\n<DATA>\r\nTime, s\tPosition (z), mm\tFz, gf\r\n"
    )
    body = "".join("".join(lines[at : at + size]) + "<divider>\r\n" for at in range(0, len(lines), size))
    return f"{text}{body}<END DATA>\r\n"


def steps_in_minutes(E, count):
    """A table with the time in minutes, lengths in mm, forces in mN, and blank rows between the steps."""
    depth, force, time = steps(E, 1e-3, count, 8e-5)
    lines = table(time / 60.0, 1e3 * depth, 1e3 * force, separator=";", form="{:.8f}").splitlines(
        keepends=True
    )
    size = len(lines) // count
    body = "\n".join("".join(lines[at : at + size]) for at in range(0, len(lines), size))
    return f"Zeit (min);Weg (mm);Kraft (mN)\n{body}"


def steps_of_a_sheet(E, count):
    """A workbook with a title, a row of units and a word for the segment in every row."""
    depth, force, time = steps(E, 1e-3, count, 8e-5)
    words = np.tile(np.repeat(("loading", "hold"), (50, 250)), count).tolist()
    columns = (time.tolist(), (1e6 * depth).tolist(), (1e3 * force).tolist(), words)
    return workbook(
        ["Stepwise relaxation"],
        [],
        ["t", "w", "F", "segment"],
        ["s", "um", "mN"],
        *zip(*columns, strict=True),
    )
