"""Small files of our own, laid out as NanoScope, Nanosurf and Park microscopes write theirs.

All hold the curve of `approach`: a scanner that travels 2 um towards the sample, touching half way, and comes
back with four fifths of the force.
"""

import struct

import numpy as np

from support.afm_files import POINTS, SENSITIVITY, STIFFNESS

#: Volts of one number of the file, and nanometres of one volt on piezo and height sensor.
PER_NUMBER = 2e-4
PIEZO, SENSOR = 20.0, 1000.0
TRAVEL = 2e-6
#: Range of a Nanosurf detector (V).
VOLTS = 20.0


def approach(points=POINTS):
    """Travel (m), growing towards the sample, and force (N) of a way in."""
    travel = np.arange(points) * (TRAVEL / points)
    return travel, 1e-8 * np.clip((travel - 1e-6) / 1e-6, 0.0, None) ** 1.5 + 2e-10


def _stored(way_in, way_out, held=()):
    return np.concatenate((way_in[::-1], way_out, held))


def nanoscope(
    *,
    version=0x08150303,
    hold=0,
    curves=1,
    sensor=False,
    missing=0,
    calibrated=True,
    tap=False,
    points=POINTS,
    stated=2,
    per_number=PER_NUMBER,
    louder=1,
    mark=None,
    **changes,
):
    """NanoScope file: one ramp or a volume of them, with a hold and a height sensor where asked for.

    `missing` points of the way in are marked as not recorded, by `mark` or the least number; `tap` makes PeakForce
    taps of it, whose drive turns at point 30.5. `stated` is what "Bytes/pixel" says of the deflection, `per_number`
    its scale (V), and its numbers are `louder` times as large as that scale makes them.
    """
    width = 4 if version >= 0x09200000 else 2
    integer = {2: "<i2", 4: "<i4"}[width]
    travel, force = approach(points)
    volts = force / STIFFNESS / SENSITIVITY
    raw = np.round(_stored(volts, 0.8 * volts[::-1], np.full(hold, volts[-1])) / per_number) * louder
    raw = raw.astype(integer)
    raw[points - missing : points] = np.iinfo(raw.dtype).min if mark is None else mark
    heights = _stored(travel, travel[::-1], np.full(hold, travel[-1])) * 1e9 / SENSOR
    channels = [("DeflectionError", "Deflection Error", "DeflSens", raw)]
    if sensor:
        channels.append(("ZSensor", "Height Sensor", "ZsensSens", np.round(heights / 1e-4).astype(integer)))
    head, blocks = 4096, b""
    images = ""
    for name, label, sense, numbers in channels:
        content = np.tile(numbers, curves).tobytes()
        scale, said = (per_number, stated) if name == "DeflectionError" else (1e-4, 2)
        images += (
            "\\*Ciao force image list\r\n"
            f"\\Data offset: {head + len(blocks)}\r\n\\Data length: {len(content)}\r\n\\Bytes/pixel: {said}\r\n"
            f"\\Samps/line: {points} {points}\r\n"
            + (f"\\Spring Constant: {STIFFNESS}\r\n" if calibrated else "")
            + f'\\@4:Image Data: S [{name}] "{label}"\r\n'
            f"\\@4:Z scale: V [Sens. {sense}] ({scale:.14f} V/LSB) 2.500000 V\r\n"
            f"\\@4:Ramp size: V [Sens. Zsens] (0.006713867 V/LSB) {TRAVEL * 1e9 / PIEZO:.6f} V\r\n"
        )
        blocks += content
    said = {
        "Operating mode": "Image" if tap else "Force",
        "Scan Size": "2000 nm",
        "X Offset": "100 nm",
        "Y Offset": "-50 nm",
        "Rotate Ang.": "0",
        "PeakForce Capture": "Allow" if tap else "Never",
        "Peak Force Amplitude": "100",
        "Sample Points": str(2 * points),
        "Sync Distance New": "30.5",
        "PFT Freq": "2 KHz",
        "@Sens. DeflSens": f"V {SENSITIVITY * 1e9:.6f} nm/V" if calibrated else "V 1.000000 V/V",
        "@Sens. ZsensSens": f"V {SENSOR:.6f} nm/V",
        **changes,
    }
    text = (
        f"\\*Force file list\r\n\\Version: 0x{version:08X}\r\n\\Date: 01:16:40 PM Tue Apr 23 2013\r\n"
        f"\\Start context: {'FVOL' if tap or curves > 1 else 'FOL'}\r\n"
        "\\*Equipment list\r\n\\Microscope: MultiMode 8\r\n"
        f"\\*Scanner list\r\n\\@Sens. Zsens: V {PIEZO:.6f} nm/V\r\n\\*Ciao scan list\r\n"
        + "".join(f"\\{name}: {value}\r\n" for name, value in said.items())
        + f"\\*Ciao force list\r\n\\Forward vel.: {TRAVEL * 1e9 / PIEZO:.6f}\r\n"
        f"\\Reverse vel.: {2 * TRAVEL * 1e9 / PIEZO:.6f}\r\n\\Trigger mode: Relative\r\n"
        f"\\Hold Samples: {hold}\r\n\\Hold Time: {0.5 if hold else 0}\r\n"
        f"\\force/line: {2 if curves > 1 else 16}\r\n"
        "\\@4:Trig threshold Deflection: V [Sens. DeflSens] (0.0003750000 V/LSB) 0.5000000 V\r\n"
        + images
        + "\\*File list end\r\n\x1a"
    ).encode("latin-1")
    return text.ljust(head, b"\0") + blocks


def nid(*, curves=2, pause=0, bits=32, unit="N", calibrated=True):
    """Nanosurf file: `curves` curves, of which the second stops five points early, with a pause where asked for."""
    travel, force = approach()
    groups = [("Spec forward", force, travel), ("Spec backward", 0.8 * force, travel)]
    if pause:
        groups.append(("Spec fwd pause", np.full(pause, force[-1]), np.full(pause, travel[-1])))
    full = {"N": VOLTS * STIFFNESS * SENSITIVITY, "m": VOLTS * SENSITIVITY, "V": VOLTS}[unit]
    per_force = full / (VOLTS * STIFFNESS * SENSITIVITY)
    text = f"[DataSet]\r\nVersion=2\r\nGroupCount={len(groups)}\r\n"
    sections, blocks = "", b""
    for group, (name, forces, travels) in enumerate(groups):
        text += f"Gr{group}-Name={name}\r\nGr{group}-Count=8\r\nGr{group}-Ch0=DataSet-{group}:0\r\n"
        text += f"Gr{group}-Ch7=DataSet-{group}:7\r\n"
        for channel, label, of, values, extent in (
            (0, "Deflection", unit, forces * per_force, full),
            (7, "Z-Axis Sensor", "m", travels, 1e-5),
        ):
            count = len(values)
            sections += (
                f"[DataSet-{group}:{channel}]\r\nVersion=3\r\nPoints={count}\r\nLines={curves}\r\nFrame={name}\r\n"
                f"Dim2Name={label}\r\nDim2Unit={of}\r\nDim2Range={extent!r}\r\nDim2Min={-extent / 2!r}\r\n"
                f"SaveBits={bits}\r\nSaveSign=Signed\r\nSaveOrder=Intel\r\n"
            )
            raw = np.round(values / extent * 2.0**bits).astype("<i4" if bits == 32 else "<i2")
            lines = [raw.copy() for _ in range(curves)]
            for line in range(curves):
                short = 5 if line == 1 and name == "Spec forward" else 0
                lines[line][count - short :] = 0
                if not name.endswith("pause"):
                    sections += f"LineDim{line}Points={count - short}\r\n"
            blocks += b"".join(line.tobytes() for line in lines)
    text += "\r\n[DataSet-Info]\r\nDate=10-12-2020\r\nHead type=FlexAFM\r\nSoftware ver.=3.10.0.20\r\n"
    if calibrated:
        text += (
            "[DataSet\\Calibration\\Scanhead]\r\n"
            f"In5=5,TipSignalDC,Deflection,m,{SENSITIVITY * 10!r},0\r\nIn15=15,TipSignalDC1,Deflection,V,10,0\r\n"
            f"[DataSet\\Calibration\\Cantilever]\r\nProp0=D[{STIFFNESS}]*[N/m]\r\n"
        )
    text += (
        "[DataSet\\Parameters\\Spectroscopy]\r\nFwModTime=D[1]*[s]\r\nBwModTime=D[0.5]*[s]\r\n"
        f"FwModDatapoints=L[{POINTS}]*[]\r\nBwModDatapoints=L[{POINTS}]*[]\r\n"
        f"FwPauseTime=D[2]*[s]\r\nFwPauseDatapoints=L[{pause}]*[]\r\n"
    )
    return (text + sections).encode("latin-1") + b"#!" + blocks


def park(*, curves=2, dead=False, calibrated=True, force=True, ratio=1.0):
    """Park file: curves whose ways are padded, a sensor that may be dead, and a force `ratio` times k s V."""
    travel, load = approach()
    padded = POINTS + 7

    def ways(values, back):
        return np.concatenate((np.pad(values, (0, 7), mode="edge"), np.pad(back, (0, 7), mode="edge")))

    volts = ways(load, 0.8 * load[::-1]) / (STIFFNESS * SENSITIVITY)
    height = -ways(travel, travel[::-1]) * 1e6
    time = ways(np.arange(POINTS), np.arange(POINTS) + POINTS) * 1e4
    channels = [("Vertical (A-B)", "V", volts)]
    if force:
        channels.append(("Force", "nN", volts * STIFFNESS * SENSITIVITY * 1e9 * ratio))
    channels += [
        ("Z Scan", "um", height),
        ("Z Detector", "um", np.full_like(height, -9.8) if dead else height - 1.0),
        ("Time Stamp", "usec", time),
    ]
    header = b""
    for name, unit, _ in channels:
        header += struct.pack("<64s16sdii", name.encode("utf-16-le"), unit.encode("utf-16-le"), 1.0, 0, 1)
    header = header.ljust(8 * 96, b"\0") + struct.pack("<4i", len(channels), 0, 2 * padded, curves)
    header = header.ljust(976, b"\0")
    header += struct.pack("<2d", STIFFNESS, 1e-6 / SENSITIVITY) if calibrated else bytes(16)
    header = header.ljust(1108, b"\0") + struct.pack("<i", 2)
    header = header.ljust(1208, b"\0")
    header += np.array([(1.0 + number, 2.0, 0.0) for number in range(curves)], dtype="<f4").tobytes()
    values = np.array([[column for *_, column in channels]] * curves, dtype="<f4").tobytes()
    tags = [
        (305, 2, b"Park Systems SmartScan\0"),
        (306, 2, b"2022:11:30 15:26:47\0"),
        (50432, 4, struct.pack("<I", 235082497)),
        (50435, 7, b"\2" + bytes(579)),
        (50438, 7, header),
        (50439, 1, values),
    ]
    directory, place, contents = struct.pack("<H", len(tags)), 8 + 2 + 12 * len(tags) + 4, b""
    for tag, kind, content in tags:
        items = len(content) // (4 if kind == 4 else 1)
        inline = content.ljust(4, b"\0") if len(content) <= 4 else struct.pack("<I", place + len(contents))
        directory += struct.pack("<HHI", tag, kind, items) + inline
        contents += b"" if len(content) <= 4 else content
    return b"II*\0" + struct.pack("<I", 8) + directory + bytes(4) + contents


#: Files that the fuzzing starts from as well.
ALL = {
    "nanoscope": nanoscope,
    "nanoscope hold": lambda: nanoscope(version=0x0930A509, hold=20, sensor=True),
    "nanoscope volume": lambda: nanoscope(curves=4, missing=3),
    "nanoscope taps": lambda: nanoscope(curves=4, tap=True),
    "nanosurf": nid,
    "nanosurf pause": lambda: nid(pause=20, bits=16, unit="V"),
    "park": park,
}
