"""Small AFM files of our own: JPK archives, HDF5 as afmformats lays it out, and an Igor binary wave."""

import io
import struct
import zipfile

import h5py
import numpy as np

STIFFNESS = 0.04
SENSITIVITY = 6e-8
POINTS = 50


def approach(points=POINTS):
    """Height (m), falling, and force (N) of an approach."""
    height = np.linspace(5e-6, 3e-6, points)
    return height, 1e-8 * np.clip((4e-6 - height) / 1e-6, 0.0, None) ** 1.5 + 2e-10


def jpk(
    styles=("extend", "retract"),
    *,
    pause="constant-force-pause",
    calibrated=True,
    claimed=None,
    shared=False,
    floats=False,
):
    """JPK archive: properties and big-endian integers; `shared` moves the scalings, as newer files do.

    A pause in front of the first extend rests high above the sample. `floats` writes channels as float-data.
    """
    stream = io.BytesIO()
    with zipfile.ZipFile(stream, "w", zipfile.ZIP_DEFLATED) as archive:
        archive.writestr(
            "header.properties",
            "#Thu Mar 31 17:51:15 CEST 2016\nforce-scan-series.header.position.x=1.0E-5\n"
            "force-scan-series.header.position.y=-2.0E-5\nforce-scan-series.header.position-index=0\n"
            "force-scan-series.description.source-software=4.0.43\n",
        )
        archive.writestr("segments/", b"")
        if shared:
            archive.writestr("shared-data/header.properties", _vdeflection("lcd-info.0", calibrated))
        for number, style in enumerate(styles):
            _segment(
                archive,
                number,
                style,
                first="extend" not in styles[:number],
                pause=pause,
                calibrated=calibrated,
                claimed=claimed,
                shared=shared,
                floats=floats,
            )
    return stream.getvalue()


def jpk_map(count):
    """JPK map: a folder a curve, each a little stiffer than the one before, with a picture nobody reads."""
    stream = io.BytesIO()
    with zipfile.ZipFile(stream, "w", zipfile.ZIP_DEFLATED) as archive:
        archive.writestr("header.properties", "#Thu Mar 31 17:51:15 CEST 2016\ntype=force-scan-map\n")
        archive.writestr("shared-data/header.properties", _vdeflection("lcd-info.0", calibrated=True))
        archive.writestr("data-image.jpk-qi-image", np.random.default_rng(1).bytes(50_000))
        archive.writestr("index/", b"")
        for index in range(count):
            folder = f"index/{index}/"
            archive.writestr(folder, b"")
            archive.writestr(
                f"{folder}header.properties",
                f"force-scan-series.header.position.x={index}.0E-6\n"
                "force-scan-series.header.position.y=0.0\n"
                f"force-scan-series.header.position-index={index}\n",
            )
            for number, style in enumerate(("extend", "retract")):
                _segment(
                    archive,
                    number,
                    style,
                    first=False,
                    pause="",
                    calibrated=True,
                    claimed=None,
                    shared=True,
                    floats=False,
                    inside=folder,
                    stiffer=1.0 + 0.1 * index,
                )
    return stream.getvalue()


def _segment(
    archive,
    number,
    style,
    *,
    first,
    pause,
    calibrated,
    claimed,
    shared,
    floats,
    inside="",
    stiffer=1.0,
):
    height, force = approach()
    force = stiffer * force
    if style == "retract":
        height, force = height[::-1], 0.8 * force[::-1]
    elif style == "pause":
        at = 0 if first else -1
        height, force = np.full(POINTS, height[at]), np.full(POINTS, force[at])
    folder = f"{inside}segments/{number}/"
    settings = pause if style == "pause" else "z-extend-force"
    deflection = (
        "channel.vDeflection.lcd-info.*=0\n" if shared else _vdeflection("channel.vDeflection", calibrated)
    )
    encoder = _floats if floats else _encoder
    if floats:
        deflection = "".join(line for line in deflection.splitlines(keepends=True) if "encoder" not in line)
        deflection += _floats("channel.vDeflection")
    archive.writestr(folder, b"")
    archive.writestr(
        folder + "segment-header.properties",
        "#Thu Mar 31 17:51:15 CEST 2016\nforce-segment-header.approach-id=a\n"
        "force-segment-header.duration=1.0\n"
        f"force-segment-header.num-points={POINTS if claimed is None else claimed}\n"
        "force-segment-header.time-stamp=2016-03-31 17\\:51\\:14.543 +0200\n"
        f"force-segment-header.settings.style={style}\nforce-segment-header.settings.feedback-mode.name=contact\n"
        f"force-segment-header.settings.segment-settings.type={settings}\n"
        "force-segment-header.settings.segment-settings.duration=1.0\n"
        "force-segment-header.settings.segment-settings.z-start=2.0E-6\n"
        "force-segment-header.settings.segment-settings.z-end=0.0\n"
        + deflection
        + encoder("channel.measuredHeight", "signedinteger", 1e-14)
        + "channel.measuredHeight.conversion-set.conversions.base=volts\n"
        + "channel.height.conversion-set.conversions.base=volts\n"
        + _conversion("channel.measuredHeight", "nominal", "volts", 1.0, "m")
        + encoder("channel.height", "signedinteger", 1e-14)
        + _conversion("channel.height", "nominal", "volts", 1.0, "m")
        + _conversion("channel.height", "calibrated", "nominal", 1.0, "m"),
    )
    volts = force / STIFFNESS / SENSITIVITY
    for name, values, step in (
        ("vDeflection", volts, 1e-6),
        ("measuredHeight", height, 1e-14),
        ("height", height, 1e-14),
    ):
        content = values.astype(">f4") if floats else np.round(values / step).astype(">i4")
        archive.writestr(folder + f"channels/{name}.dat", content.tobytes())


def _vdeflection(prefix, calibrated):
    text = _encoder(prefix, "signedinteger", 1e-6, "V") + f"{prefix}.conversion-set.conversions.base=volts\n"
    if calibrated:
        text += _conversion(prefix, "distance", "volts", SENSITIVITY, "m")
        text += _conversion(prefix, "force", "distance", STIFFNESS, "N")
    return text


def _floats(prefix, *_):
    return f"{prefix}.data.type=float-data\n{prefix}.data.file.format=raw\n"


def _encoder(prefix, kind, multiplier, unit="m"):
    # The older files say "data.encoder", the newer ones "encoder".
    head = f"{prefix}.encoder" if prefix.startswith("lcd") else f"{prefix}.data.encoder"
    return (
        f"{head}.type={kind}\n{head}.scaling.type=linear\n{head}.scaling.offset=0.0\n"
        f"{head}.scaling.multiplier={multiplier}\n{head}.scaling.unit.unit={unit}\n"
    )


def _conversion(prefix, slot, base, multiplier, unit):
    head = f"{prefix}.conversion-set.conversion.{slot}"
    return (
        f"{head}.name={slot}\n{head}.defined=true\n{head}.base-calibration-slot={base}\n{head}.calibration-slot={slot}\n"
        f"{head}.scaling.type=linear\n{head}.scaling.offset=0.0\n{head}.scaling.multiplier={multiplier}\n"
        f"{head}.scaling.unit.type=metric-unit\n{head}.scaling.unit.unit={unit}\n"
    )


def hdf5(curves=2):
    """HDF5 as afmformats exports it."""
    stream = io.BytesIO()
    height, force = approach()
    with h5py.File(stream, "w") as file:
        file.attrs["software"] = "afmformats"
        file.attrs["software version"] = "0.18.7"
        for number in range(curves):
            group = file.create_group(str(number))
            group.attrs["imaging mode"] = "force-distance"
            group.attrs["spring constant"] = STIFFNESS
            group.attrs["enum"] = number
            group["force"] = np.concatenate((force, 0.8 * force[::-1]))
            group["height (measured)"] = np.concatenate((height, height[::-1]))
            group["segment"] = np.repeat(np.array((0, 1), dtype=np.uint8), POINTS)
    return stream.getvalue()


def tab(styles=("extend", "retract")):
    """Table of afmformats: metadata as JSON behind "#", names behind "#", SI numbers, segments numbered."""
    height, force = approach()
    extended = 0
    text = '# afmformats 0.18.7\n#\n# BEGIN METADATA\n# {\n#   "enum": 0,\n'
    text += f'#   "imaging mode": "force-distance",\n#   "spring constant": {STIFFNESS}\n' + "# }\n"
    text += "# END METADATA\n#\n# force\theight (measured)\tsegment\n"
    for number, style in enumerate(styles):
        points = {"extend": range(POINTS), "retract": range(POINTS)[::-1]}.get(style, [-extended] * POINTS)
        extended += style == "extend"
        text += "".join(f"{float(force[i])!r}\t{float(height[i])!r}\t{number}\n" for i in points)
    return text.encode()


def igor():
    """Igor binary wave, version 5, little-endian, with the note that an Asylum microscope writes."""
    height, force = approach()
    columns = {"Raw": -height, "Defl": force / STIFFNESS, "ZSnsr": -height}
    note = "\r".join(
        f"{key}: {value}"
        for key, value in {
            "First": "line",
            "ImagingMode": "Contact",
            "NumPtsPerSec": 1000.0,
            "InvOLS": SENSITIVITY,
            "TriggerChannel": "Force",
            "TriggerPoint": 1e-8,
            "SpringConstant": STIFFNESS,
            "InputTime": 1.0,
            "ApproachVelocity": 1e-6,
            "RetractVelocity": 1e-6,
            "MicroscopeModel": "MFP3D",
            "Version": "1",
            "Date": "2020-01-01",
            "Time": "12:00:00",
        }.items()
    ).encode("latin-1")
    labels = b"".join(name.encode().ljust(32, b"\0") for name in ("", *columns))
    values = np.array(list(columns.values()), dtype="<f8").tobytes()
    header = struct.pack("<III", 0, 0, 0) + struct.pack("<ihh6sh", POINTS * 3, 4, 0, b"\0" * 6, 1)
    header += b"wave".ljust(32, b"\0") + struct.pack("<iI4i", 0, 0, POINTS, 3, 0, 0)
    header += struct.pack("<8d", *([1.0] * 4 + [0.0] * 4)) + b"\0" * 4 + b"\0" * 16
    header += struct.pack("<hh2d", 0, 0, 0.0, 0.0)
    header = header.ljust(320, b"\0")
    start = struct.pack(
        "<hiiii4i4i3i",
        0,
        len(header) + len(values),
        0,
        len(note),
        0,
        *(0,) * 4,
        *(0, len(labels), 0, 0),
        0,
        0,
        0,
    )
    body = struct.pack("<h", 5) + start + header + values + note + labels
    return body[:2] + struct.pack("<h", _checksum(body[:384])) + body[4:]


def _checksum(header):
    """Value that makes the 16-bit words of the header add up to zero."""
    cleared = header[:2] + b"\0\0" + header[4:]
    total = sum(struct.unpack(f"<{len(cleared) // 2}h", cleared)) & 0xFFFF
    value = (-total) & 0xFFFF
    return value - 0x10000 if value >= 0x8000 else value


#: AFM files that the fuzzing starts from as well.
ALL = {
    "afm jpk": jpk,
    "afm jpk creep": lambda: jpk(("extend", "pause", "retract"), shared=True),
    "afm jpk floats": lambda: jpk(("pause", "extend", "pause", "retract"), floats=True),
    "afm hdf5": hdf5,
    "afm tab": tab,
    "asylum ibw": igor,
}
