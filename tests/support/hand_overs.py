"""Small files of the kinds that laboratories hand over, by the name of their kind, to be damaged."""

import gzip
import io
import struct
import zipfile

import numpy as np
import openpyxl
from scipy.io import savemat

DEPTH = np.linspace(-1.0, 3.0, 40)
FORCE = np.clip(DEPTH, 0.0, None) ** 1.5


def rows(*columns, separator=","):
    return "\n".join(separator.join(f"{v:.5g}" for v in row) for row in zip(*columns, strict=True)) + "\n"


def matlab(*, packed):
    content = io.BytesIO()
    savemat(content, {"depth_um": DEPTH, "force_mN": FORCE, "run": {"t": DEPTH}}, do_compression=packed)
    return content.getvalue()


def tdms():
    """One segment with two channels of doubles, as National Instruments' format says (version 2.0)."""

    def text(value):
        return struct.pack("<I", len(value)) + value.encode()

    def channel(name, unit):
        index = struct.pack("<IIIQ", 20, 10, 1, len(DEPTH))
        return (
            text(f"/'data'/'{name}'")
            + index
            + struct.pack("<I", 1)
            + text("unit_string")
            + struct.pack("<I", 32)
            + text(unit)
        )

    empty = struct.pack("<II", 0xFFFFFFFF, 0)
    about = (
        struct.pack("<I", 4)
        + text("/")
        + empty
        + text("/'data'")
        + empty
        + channel("Indentation", "um")
        + channel("Load", "mN")
    )
    numbers = DEPTH.tobytes() + FORCE.tobytes()
    return (
        b"TDSm" + struct.pack("<IIQQ", 0b1110, 4713, len(about) + len(numbers), len(about)) + about + numbers
    )


def workbook():
    book = openpyxl.Workbook()
    book.active.title = "Results"
    book.active.append(["Test", "E (GPa)"])
    sheet = book.create_sheet("Test 1")
    sheet.append(["Markers", "Depth", "Load"])
    sheet.append([None, "nm", "mN"])
    for number, row in enumerate(zip(map(float, DEPTH), map(float, FORCE), strict=True)):
        sheet.append(["End Of Loading Index" if number == 30 else None, *row])
    content = io.BytesIO()
    book.save(content)
    return content.getvalue()


def archive():
    content = io.BytesIO()
    with zipfile.ZipFile(content, "w") as packed:
        packed.writestr("__MACOSX/._a.csv", b"\0\1")
        packed.writestr("a.csv", "depth (um),force (mN)\n" + rows(DEPTH, FORCE))
        packed.writestr("readme.txt", "hello")
    return content.getvalue()


def kinds():
    """Content by name; the first word is that of the format."""
    plain = "depth_um,force_mN,time_s\n" + rows(DEPTH, FORCE, DEPTH)
    jpk = "".join(
        f"# segment: {segment}\n# columns: vDeflection measuredHeight\n# springConstant: 0.06\n# units: N m\n"
        + rows(1e-9 * FORCE, -1e-6 * DEPTH, separator=" ")
        for segment in ("extend", "retract")
    )
    names = "Calc_Ramp_Ex_nm\tCalc_Ramp_Rt_nm\tDefl_nm_Ex\tDefl_nm_Rt\tDefl_pN_Ex\tDefl_pN_Rt\n"
    wide = "X_a_1_Time_[s]\tY_a_1_Fn_[mN]\tX_a_1_Time_[s]\tY_a_1_Pd_[nm]\n"
    return {
        "csv underscores": plain.encode(),
        "csv stacked": (plain + "\n" + rows(DEPTH, FORCE, DEPTH)).encode(),
        "csv names in a comment": (
            "# columns: depth force\n# units: um mN\n" + rows(DEPTH, FORCE, separator=" ")
        ).encode(),
        "csv jpk": jpk.encode(),
        "csv nanoscope": (
            '"\\Spring Constant: 0.06"\n' + names + rows(*[DEPTH, FORCE] * 3, separator="\t")
        ).encode(),
        "csv wide": (wide + rows(DEPTH, FORCE, DEPTH, FORCE, separator="\t")).encode(),
        "csv igor": (
            "IGOR\nWAVES/D\tSep\tForce\nBEGIN\n" + rows(DEPTH, FORCE, separator=" ") + "END\n"
        ).encode(),
        "csv results above": (
            '"Max (N)"\n1,"2"\n\nTime,Extension,Load\n(s),(mm),(N)\n' + rows(DEPTH, DEPTH, FORCE)
        ).encode(),
        "csv gzip": gzip.compress(plain.encode(), mtime=0),
        "excel markers": workbook(),
        "csv archive": archive(),
        "matlab": matlab(packed=False),
        "matlab packed": matlab(packed=True),
        "tdms": tdms(),
    }
