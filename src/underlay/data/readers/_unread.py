"""Files that are known and not read, of microscopes and of programs that pack, and what to do with them."""

from __future__ import annotations

from underlay.data.readers._source import Source

__all__ = ["way_out"]

# First bytes, what the file is, and what to do. No reader of these is maintained, or none is known to read forces.
_KNOWN = (
    (
        b"\x01\xb0\x93\xff",
        "an NT-MDT file (.mdt)",
        "open it in NT-MDT's Nova or Image Analysis and export the curves as text (.txt), which is read",
    ),
    (
        b"GWYP",
        "a Gwyddion file (.gwy)",
        "export the curves from Gwyddion as text with names and units in the first row",
    ),
    (
        b"WIT_PR06",
        "a WITec project (.wip)",
        "export the curves from WITec's Project as text with names and units in the first row",
    ),
)
_UNPACK = "unpack it, or pack the curves as a ZIP archive (.zip), which is read"
_PACKED = (
    (b"\x1f\x8b", "compressed by gzip (.gz)"),
    (b"BZh", "compressed by bzip2 (.bz2)"),
    (b"\xfd7zXZ\0", "compressed by xz (.xz)"),
    (b"\x28\xb5\x2f\xfd", "compressed by Zstandard (.zst)"),
    (b"7z\xbc\xaf\x27\x1c", "an archive of 7-Zip (.7z)"),
    (b"Rar!\x1a\x07", "an archive of RAR (.rar)"),
)
# A TAR archive has its mark behind the first name.
_TAR_AT, _TAR = 257, b"ustar"
# Asylum's container of whole force maps writes its name behind a check sum and a size.
_ARDF = b"ARDF"


def way_out(source: Source) -> str:
    """What to say of a file that is known but not read, as the end of a sentence; '' of any other.

    Examples
    --------
    >>> from pathlib import Path
    >>> way_out(Source(Path("a.mdt"), bytes([0x01, 0xB0, 0x93, 0xFF, 0]), ""))[:24]
    'an NT-MDT file (.mdt), w'
    """
    for start, what, advice in _KNOWN:
        if source.data.startswith(start):
            return f"{what}, which is not read here: {advice}"
    for start, what in _PACKED:
        if source.data.startswith(start):
            return f"{what}, which is not read here: {_UNPACK}"
    if source.data.startswith(_TAR, _TAR_AT):
        return f"an archive of tar (.tar), which is not read here: {_UNPACK}"
    if source.data[8:12] == _ARDF or source.data.startswith(_ARDF):
        return (
            "an Asylum Research map (.ardf), which is not read here: export its curves from Asylum's Igor program "
            "as .ibw, one a file, which are read"
        )
    return ""
