"""Small instrument files of our own, written after the layouts of real ones with all their quirks.

Each function returns the bytes of one file. The curve in them is the same everywhere: a ramp of depth, a
rest and a way back, with a force that a ball on a half-space would give.
"""

import io
import zipfile

import numpy as np
import openpyxl

from support.compound_file import xls

#: Points of the ramp, the rest and the way back.
RAMP, REST, BACK = 40, 20, 30


def sample_curve(deepest=2e-6, peak=1e-4):
    """Time (s), depth (m) and force (N) of the curve that all the files hold."""
    into = np.linspace(-0.25, 1.0, RAMP)
    depth = deepest * np.concatenate((into, np.ones(REST), np.linspace(1.0, -0.2, BACK + 1)[1:]))
    force = peak * np.clip(depth / deepest, 0.0, None) ** 1.5
    force[RAMP : RAMP + REST] *= np.linspace(1.0, 0.8, REST)
    force[RAMP + REST :] *= 0.8
    return np.arange(RAMP + REST + BACK) * 0.1, depth, force


def rows(columns, pattern, separator="\t", end="\r\n"):
    return "".join(
        separator.join(pattern % value for value in row) + end for row in zip(*columns, strict=True)
    )


# --- Optics11


def optics11(generation="V3.5.0", *, comma=False):
    """Piuma of one of the three generations, or Chiaro, with their mixed line ends."""
    time, depth, force = sample_curve(2e-6, 4e-8)
    cantilever = force / 0.05  # k = 0.05 N/m
    piezo = depth + cantilever
    indentation = np.clip(depth, 0.0, None)
    if generation == "V3.5.0":
        indentation = depth  # this one neither shifts nor cuts
    head = {
        "old": (
            "Date\t27/02/2020\tTime\t10:31\tStatus\tOK\r\ngel 4 %\r\n"
            "Scan (#)\t1\tX (#)\t2\tY (#)\t3\tIndentation (#)\t1\r\n\r\n"
            "X-position (um)\t100.0\r\nY-position (um)\t200.0\r\nZ-position (um)\t300.0\r\n"
            "Z surface (um)\t300.0\r\nPiezo position (nm) (Measured)\t0.0\r\n\r\n"
            "k (N/m)\t0.050\r\nTip radius (um)\t25.000\r\nCalibration factor\t2.0\r\n"
            "Auto find surface\tON\r\n\r\n"
            "Piezo Indentation Sweep Settings (Relative to surface):\r\n"
            "D[Z1] (nm)\t2000.000\tt[1] (s)\t4.000\r\nD[Z2] (nm)\t2000.000\tt[2] (s)\t2.000\r\n\r\n"
            "P[max] (uN)\t0.040\r\nE[eff] (Pa)\t1000.0\r\nE[v=0.50] (Pa)\t750.0\r\n\r\n"
        ),
        "V3.4.4": (
            "Date\t27/02/2022\tTime\t10:31:02\tStatus\tOK\r\ngel 4 %\r\n"
            "Scan (#)\t1\tX (#)\t2\tY (#)\t3\tIndentation (#)\t1\n\rX-position (um)\t100.0\r\n"
            "Y-position (um)\t200.0\r\nZ-position (um)\t300.0\r\n\r\n"
            "k (N/m)\t0.050\r\nTip radius (um)\t25.000\r\n"
            "SMDuration (s) 0.0\r\n\r\nDevice:\tPiuma\r\nSoftware version: V3.4.4\r\n\r\n"
            "Control mode: Displacement\nMeasurement: Indentation\r\n\r\nProfile:\r\n"
            "D[Z1] (nm)\t2000.000\tt[1] (s)\t4.000\r\nModel: Hertz\nE[eff] (Pa)\t1000.0\r\n"
            "E[v=0.500] (Pa)\t750.000\nComment: \r\n\r\n"
        ),
        "V3.5.0": (
            "Date\t27/02/2023\tTime\t10:31:02\tStatus\tOK\r\ngel 4 %\r\n"
            "Scan (#)\t1\tX (#)\t2\tY (#)\t3\tIndentation (#)\t1\n\rX-position (um)\t100.0\r\n"
            "Y-position (um)\t200.0\r\nZ-position (um)\t300.0\r\n"
            "k (N/m)\t0.050\r\nTip radius (um)\t25.000\r\n"
            "Software version: V3.5.0\r\nStep absolute start times (s)\t0.062,1.072,2.074\r\n"
            "Step absolute end times (s) 1.071,2.073,3.0\r\nModel: Hertz\nE[eff] (Pa)\t1000.0\r\n\r\n"
        ),
        "Chiaro": (
            "Date\t27/02/2023\tTime\t10:31:02\tStatus\tOK\r\ncell 7\r\n"
            "Scan (#)\t1\tX (#)\t2\tY (#)\t3\tIndentation (#)\t1\n\rX-position (um)\t100.0\r\n"
            "Y-position (um)\t200.0\r\nZ-position (um)\t300.0\r\n"
            "k (N/m)\t0.050\r\nTip radius (um)\t25.000\r\n"
            "Device:\tChiaro\r\nSoftware version: V3.5.0\r\nControl mode: Peak Load Poking\nProfile:\r\n"
            "Max load (µN)\t0.050\r\nPiezo speed  (µm/s)\t7.000\n\nStep absolute start times (s)\t\r\n"
            "Step absolute end times (s) \r\nModel: Hertz\r\nE[eff] (Pa)\t1000.0\r\n\r\n"
        ),
    }[generation]
    table = "Time (s)\tLoad (uN)\tIndentation (nm)\tCantilever (nm)\tPiezo (nm)\tAuxiliary\r\n" + rows(
        (time, force * 1e6, indentation * 1e9, cantilever * 1e9, piezo * 1e9, 0.0 * time), "%.6f"
    )
    text = head + table
    if comma:
        text = text.replace(".", ",")
    return text.encode("latin-1")


# --- Mach-1

_INFO = (
    "<INFO>\r\nDate:\tThu, Oct 05, 2023\r\nTime:\t13:49:11.130\r\nLoad Cell Type:\t{cell}\r\n<END INFO>\r\n"
)
_FIND = (
    "<Find Contact>\r\nStage Axis:\tPosition (z)\r\nLoad Cell Axis:\tFz\r\nDirection:\tPositive\r\n"
    "Contact Criteria, {unit}:\t{criterion}\r\n"
)


def mach1(tests=1, *, multiaxis=False, contact=True, ramps=1):
    """Find Contact and Stress Relaxation blocks, single-axis (gf) or multi-axis (N, compression negative)."""
    unit, per_newton, sign = ("N", 1.0, -1.0) if multiaxis else ("gf", 1.0 / 9.80665e-3, 1.0)
    info = _INFO.format(cell="Multi-axis" if multiaxis else "Single-axis")
    text = "<Mach-1 File>\r\n"
    names = f"Time, s\tPosition (z), mm\tPosition (x), mm\tFz, {unit}\r\n"
    for test in range(tests):
        criterion = 0.01 if not multiaxis else 1e-4
        reached = criterion * (1.2 if contact else 0.3)
        time = np.arange(12) * 0.1
        search = np.linspace(0.0, reached, 12) * sign
        text += info + _FIND.format(unit=unit, criterion=criterion) + "<DATA>\r\n" + names
        text += rows((time, -3.0 + 0.01 * time, 0.0 * time, search), "%.6f") + "<END DATA>\r\n"
        text += info + "<Stress Relaxation>\r\nStage Axis:\tPosition (z)\r\nLoad Cell Axis:\tFz\r\n"
        text += f"Amplitude, mm:\t0.1000\r\nNumber of Ramp:\t{ramps}\r\n<DATA>\r\n" + names
        time, z, newton = relaxation(ramps)
        force = (newton if contact else 1e-6 * np.sin(37.0 * time)) * per_newton * sign
        table = rows((time, -2.9 + z * 1e3, np.full_like(time, test * 1.5), force), "%.9f")
        lines = table.splitlines(keepends=True)
        step = len(lines) // ramps
        text += "".join("".join(lines[i * step : (i + 1) * step]) + "<divider>\r\n" for i in range(ramps))
        text += "<END DATA>\r\n"
        text += info + "<Zero Load>\r\nFunction without controls\r\n<DATA>\r\n" + names
        text += (
            rows((np.arange(3) * 0.01, np.full(3, -3.5), np.zeros(3), np.zeros(3)), "%.6f") + "<END DATA>\r\n"
        )
    return text.encode("ascii")


def relaxation(ramps=1, deepest=1e-4, peak=5e-3):
    """Time, depth and force of ramps with a rest after each; the force relaxes to half."""
    ramp, rest = 60, 140
    time = np.arange(ramps * (ramp + rest)) * 0.05
    depth = np.concatenate(
        [
            deepest / ramps * np.concatenate((i + np.linspace(0.0, 1.0, ramp), np.full(rest, i + 1.0)))
            for i in range(ramps)
        ]
    )
    since = np.concatenate([np.concatenate((np.zeros(ramp), np.arange(rest) * 0.05)) for _ in range(ramps)])
    return time, depth, peak * (depth / deepest) ** 1.5 * (0.5 + 0.5 * np.exp(-since / 0.7))


# --- Bioindenter


def bioindenter(*, profile=False):
    """Protocol "+ Advanced" or a user's profile; Windows text with three-digit exponents.

    The automatic protocol writes its setting "Linear loading" as a line of its own and numbers load, pause,
    unload from 1. A user's profile numbers the approach 0 and its listed steps from 1.
    """
    time, depth, force = sample_curve(20e-6, 1e-3)
    if profile:  # the approach, before contact, is the first tenth of the ramp
        ids = np.repeat((0, 1, 2, 3), (RAMP // 10, RAMP - RAMP // 10, REST, BACK))
    else:
        ids = np.repeat((1, 2, 3), (RAMP, REST, BACK))
    protocol = (
        "\t+ User defined profile\r\n\tLinear load 20.00  µN ; 100.00 µN/min\r\n\tPause in load 2 s\r\n"
        "\tLinear depth 20.00  µm ; 500.00 µm/min\r\n"
        if profile
        else "\t+ Advanced\r\nAcquisition rate :\t10.0 \tHz\r\nLinear loading\r\nMax load :\t1000.00 \tµN\r\n"
        "Loading rate :\t2000.00 \tµN/min\r\nUnloading rate :\t2000.00 \tµN/min\r\nPause :\t2.0 s\r\n"
    )
    text = (
        "Indentation\r\n" + protocol + "\t+ TTX - UNHT Bio S/N: 01 settings\r\nFn contact :\t25.00 \tµN\r\n"
        "Date :\t6/9/2026\r\nTime :\t8:00:16 AM\r\nAnalysis n # 1\r\nMethod\tHertz\r\nEHz=\t755.57 \tkPa\r\n"
        "ErHz=\t830.29 kPa\r\n!!! Indenter not calibrated !!!\r\n\r\nMeasured values\r\n"
        "Time (s)\tPd (µm)\tFn (µN)\tFnRef (µN)\tSegmentID\r\n\r\n"
    )
    for t, d, f, i in zip(time, depth * 1e6, force * 1e6, ids, strict=True):
        cells = [_three_digits(value) for value in (t, d, f, 0.0)]
        text += "\t".join(cells) + f"\t{i}\r\n"
    return text.encode("latin-1")


def _three_digits(value):
    mantissa, exponent = f"{value:.4E}".split("E")
    return f"{mantissa}E{exponent[0]}{int(exponent[1:]):03d}"


# --- Hysitron


def hld(*, claimed=None, micro="µ", trimmed=False, listed=True):
    """A .hld with its sections of approach and drift, unless trimmed."""
    time, depth, force = sample_curve(100e-9, 1e-3)
    ends = (RAMP * 0.1 - 0.05, (RAMP + REST) * 0.1 - 0.05, 100.0)
    segments = "".join(
        f"Segment Time: 1 s\r\nSegment Number: {i}\r\nSegment Type: 0 LINEAR\r\n"
        f"Segment Begin Time: {begin:.3f} s\r\n"
        f"Segment End Time: {end:.3f} s\r\nSegment Begin Demand: {low} µN\r\n"
        f"Segment End Demand: {high} µN\r\n"
        f"Segment Points: 10\r\n"
        for i, (begin, end, low, high) in enumerate(
            zip((0.0, *ends[:-1]), ends, (0, 1000, 1000), (1000, 1000, 0), strict=True)
        )
    )
    text = "Test Type: Indentation\r\nMachine Comp: 0.5 nm/mN\r\nDrift Rate: 0.05 nm/s\r\n"
    if listed:
        text += "Number of Segments: 3\r\n" + segments
    if not trimmed:
        text += "Sample Approach Data Points: 2\r\nTime_s\tMotorDisp_mm\tPiezo Extension_nm\r\n"
        text += "0.0\t0.1\t5.0\r\n0.1\t0.2\t6.0\r\n"
        text += "Drift Measurement Data Points: 1\r\nTime_s\tDisp_nm\r\n0.0\t0.3\r\n"
    text += f"Test Data Points: {len(time) if claimed is None else claimed}\r\n"
    text += f"Time_s\tDisp_nm\tForce_{micro}N\tLoadCell_nm\tDisp_V\tForce_V\r\n"
    text += rows((time, depth * 1e9, force * 1e6, depth, depth, force), "%.6f")
    return text.encode("latin-1")


def load_control_text(*, claimed=None):
    """Text export with an empty line after the first row, as some files have."""
    time, depth, force = sample_curve(100e-9, 1e-3)
    lines = rows((depth * 1e9, force * 1e6, time, depth, force), "%.6f", end="\n").splitlines(keepends=True)
    text = f"Mon Apr 29 10:41:06 2019\n\nNumber of Points = {len(time) if claimed is None else claimed}\n"
    text += "Depth (nm)\tLoad (µN)\tTime (s)\tDepth (V)\tLoad (V)\n" + lines[0] + "\n" + "".join(lines[1:])
    return text.encode("latin-1")


def nanodma():
    return (
        b"nanoDMA Text Export Version 1.00\r\n\r\n"
        b" Test Time (s)\t Hardness (GPa)\t\r\n1.0e-005\t2.0e-005\t\r\n"
    )


# --- Fischer


def fischer(tests=2):
    """Decimal comma in the rows, point in the results, mixed line ends, whole numbers without a comma."""
    time, depth, force = sample_curve(0.5e-6, 0.3)
    text = "FS1.hap\tName of the application\r\n\tApplication comment\r\n"
    text += "F = ESP n 300.000mN/120s/37s\n1\tNumber of block\n"
    text += "3928,59\t44,652\t6,01398\tHM\tx\ty\n3677,88\tX.\tStatistics of block\n"
    text += "---\tn<LSL\tStatistics of block\r\n"
    for value in range(1, tests + 1):
        text += f"FS1.hap   26.05.2020  15:17:54\nBlock : 1   Value : {value}\r\nx=    44.65  y=     6.01\n"
        text += "EIT/(1-vs^2)\t[GPa]\t     83.7\nHIT\t[N/mm²]\t   8553.6\r\n \nF\th\tt\n"
        for f, d, t in zip(force * 1e3, depth * 1e6, time, strict=True):
            text += "\t".join(f"{number:.9g}".replace(".", ",") for number in (f, d, t)) + "\n"
    return text.encode("latin-1")


# --- workbooks


def nanosuite():
    """Two tests in different orders of columns, a failed value, averages, and a junk sheet."""
    time, depth, force = sample_curve(1e-6, 1e-2)
    markers = {
        0: "Load Segment Type",
        RAMP: "Hold Segment Type",
        RAMP + REST: "Unload From Peak Segment Type",
    }

    def sheet(order, spoil):
        columns = {
            "Displacement Into Surface": ("nm", depth * 1e9),
            "Load On Sample": ("mN", force * 1e3),
            "Time On Sample": ("s", time),
            "Harmonic Contact Stiffness": ("N/m", np.full_like(time, 1.7976931348623157e308)),
        }
        table = [["Segment", *order], ["", *(columns[name][0] for name in order)]]
        table += [[markers.get(i), *(float(columns[name][1][i]) for name in order)] for i in range(len(time))]
        if spoil:
            table[7][1 + order.index("Load On Sample")] = 1.7976931348623157e308
        table.append(["END"])
        return table

    names = ["Displacement Into Surface", "Load On Sample", "Time On Sample", "Harmonic Contact Stiffness"]
    averages = [
        ["", "Load On Sample", "STANDARD DEVIATION (Load On Sample)"],
        ["", "mN", "mN"],
        ["", 1.0, 0.1],
    ]
    return xls(
        {
            "Sample": averages,
            "Test 001": sheet(names, spoil=False),
            "Test 002": sheet(names[::-1], spoil=True),
            "Analyst Project": [["nothing"], ["here"]],
        }
    )


def nanosuite_average():
    """The average of several tests: every column with its STANDARD DEVIATION, stiffness S = 4e4 N/m."""
    time, depth, force = sample_curve(1e-6, 1e-2)
    none = 1.7976931348623157e308
    stiffness = np.where(np.arange(len(time)) == 0, none, 4e4)
    columns = {
        "Displacement Into Surface": ("nm", depth * 1e9, np.abs(depth) * 2e-3 * 1e9),
        "Load On Sample": ("mN", force * 1e3, np.full_like(force, 0.2)),
        "Harmonic Contact Stiffness": ("N/m", stiffness, np.where(stiffness == none, none, 400.0)),
        "Time On Sample": ("s", time, np.full_like(time, 0.1)),
        "Hardness": ("GPa", np.full_like(time, 3.0), np.full_like(time, 0.1)),
    }
    table = [[""], [""]]
    for name, (unit, _, _) in columns.items():
        table[0] += [name, f"STANDARD DEVIATION ({name})"]
        table[1] += [unit, unit]
    markers = {
        0: "Load Segment Type",
        RAMP: "Hold Segment Type",
        RAMP + REST: "Unload From Peak Segment Type",
    }
    for i in range(len(time)):
        cells = [float(values[i]) for _, *pair in columns.values() for values in pair]
        table.append([markers.get(i), *cells])
    return xls({"Sample": table, "Analyst Project": [["DO NOT DELETE THIS WORKSHEET"]]})


ZWICK = {
    "fr": (
        "Paramètres",
        "Résultats",
        "Statistiques",
        ("Temps d'essai", "Force standard", "Allongement", "Ecartement entre outils"),
    ),
    "de": (
        "Parameter",
        "Ergebnisse",
        "Statistik",
        ("Prüfzeit", "Standardkraft", "Standardweg", "Werkzeugabstand"),
    ),
    "en": (
        "Parameters",
        "Results",
        "Statistics",
        ("Test time", "Standard force", "Standard travel", "Tool separation"),
    ),
    "xx": ("Parameter", "Results", "Other", ("a", "b", "c", "d")),
}


def zwick(language="fr", *, turned=False, specimens=1):
    """Sheets of parameters and results, one per specimen; compression positive, gap plus travel constant.

    The tables of results carry units of force and length too; their first column names the specimens.
    """
    time, depth, force = sample_curve(1e-3, 10.0)
    book = openpyxl.Workbook()
    parameters, results, statistics, names = ZWICK[language]
    book.active.title = parameters
    for title in (results, statistics):
        sheet = book.create_sheet(title)
        sheet.append([None, "Specimen", "Fmax", "dL(Fmax)"])
        sheet.append([None, None, "N", "mm"])
        for number in range(1, specimens + 1):
            sheet.append([f"Ep. {number}", f"Ep. {number}", 10.0, 1.0])
    for number in range(1, specimens + 1):
        sheet = book.create_sheet(f"Ep. {number}")
        sheet.append([f"Specimen {number}"] * 4)
        sheet.append(list(names))
        sheet.append(["s", "N", "mm", "mm"])
        for t, f, d in zip(time, force, depth * 1e3, strict=True):
            sheet.append([float(t), float(f), float(-d if turned else d), float(12.0 - d)])
    return saved(book)


def excel(sheets=1, *, labels=("depth (um)", "force (mN)", "time (s)")):
    time, depth, force = sample_curve()
    book = openpyxl.Workbook()
    book.active.append(["notes only"])
    for number in range(sheets):
        sheet = book.create_sheet(f"run {number}")
        sheet.append(["a title"])
        sheet.append(list(labels))
        for row in zip(depth * 1e6, force * 1e3, time, strict=True):
            sheet.append([float(value) for value in row])
    return saved(book)


def saved(book):
    stream = io.BytesIO()
    book.save(stream)
    return stream.getvalue()


# --- AFM


def workshop(header="", force="Force(nN)"):
    """AFM Workshop: approach and retract side by side; `header` has further lines, `force` may be T-B(V)."""
    z = np.linspace(4000.0, 5000.0, 60)
    pressed = 2.0 * np.clip((z - 4500.0) / 500.0, 0.0, None) ** 1.5 + 0.05
    text = "Force-Distance Curve\r\nFile Format:\t3\r\n\r\n"
    text += "Date:\t22 October 2020\r\nTime:\t14:16:20\r\nMode:\tSingle\r\n"
    text += "Point:\t1\r\nX, um:\t0.500000\r\nY, um:\t0.500000\r\n\r\n"
    text = text.removesuffix("\r\n") + header + "\r\n"
    text += f"Extend Z-Sense(nm),Extend {force},Retract Z-Sense(nm),Retract {force}\r\n"
    return (text + rows((z, pressed, z[::-1], 0.8 * pressed[::-1]), "%.4f", ",")).encode("ascii")


def ntmdt():
    """NT-MDT: three columns with decimal commas, deepest first, and no header at all."""
    height = np.linspace(-2000.0, 0.0, 60)
    signal = 1.5 * np.clip(-(height + 1000.0) / 1000.0, 0.0, None) ** 1.5 - 1.0 + 0.01 * np.sin(height)
    return rows((height, signal, signal - 0.01), "%.4f").replace(".", ",").encode("ascii")


# --- plain tables


def delimited(separator=",", *, comma=False, end="\n", encoding="utf-8"):
    time, depth, force = sample_curve()
    text = "# a gel on glass" + end + separator.join(("depth (µm)", "force [mN]", "Time / s")) + end
    table = rows((depth * 1e6, force * 1e3, time), "%.9f", separator, end)
    return (text + (table.replace(".", ",") if comma else table)).encode(encoding)


def zipped(files):
    """Archive of {name: bytes}."""
    stream = io.BytesIO()
    with zipfile.ZipFile(stream, "w", zipfile.ZIP_DEFLATED) as archive:
        for name, content in files.items():
            archive.writestr(name, content)
    return stream.getvalue()


def unzipped(content):
    """{name: bytes} of an archive."""
    with zipfile.ZipFile(io.BytesIO(content)) as archive:
        return {name: archive.read(name) for name in archive.namelist()}


def changed_archive(content, changes):
    """Archive with {member: (old, new)} replaced."""
    members = unzipped(content)
    return zipped(
        {
            name: data.replace(*changes.get(name, (b"", b""))) if name in changes else data
            for name, data in members.items()
        }
    )


#: One file of every kind, by name; what the fuzzing starts from.
ALL = {
    "optics11 old": lambda: optics11("old"),
    "optics11 V3.4.4": lambda: optics11("V3.4.4"),
    "optics11 V3.5.0": lambda: optics11("V3.5.0"),
    "optics11 Chiaro": lambda: optics11("Chiaro"),
    "mach1": lambda: mach1(2),
    "mach1 multi-axis": lambda: mach1(1, multiaxis=True, ramps=3),
    "bioindenter": bioindenter,
    "bioindenter profile": lambda: bioindenter(profile=True),
    "hysitron hld": hld,
    "hysitron text": load_control_text,
    "hysitron nanodma": nanodma,
    "fischer": fischer,
    "nanosuite": nanosuite,
    "nanosuite average": nanosuite_average,
    "testxpert": zwick,
    "excel": excel,
    "csv workshop": workshop,
    "afm ntmdt": ntmdt,
    "csv": delimited,
    "csv semicolon": lambda: delimited(";", comma=True, end="\r\n"),
    "csv utf-16": lambda: delimited("\t", encoding="utf-16"),
    "archive": lambda: zipped({"a.csv": delimited(), "../b.txt": optics11("old")}),
}
