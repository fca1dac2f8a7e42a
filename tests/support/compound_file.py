"""A minimal .xls: BIFF8 records in a compound file, as the readers of workbooks expect them.

Only what is needed to write sheets of numbers and texts; layouts after Microsoft's published [MS-XLS] and
[MS-CFB].
"""

import struct
from datetime import date

SECTOR = 512
FREE = 0xFFFFFFFF
END_OF_CHAIN = 0xFFFFFFFE
FAT_SECTOR = 0xFFFFFFFD
# Streams below this size go to another table; padding avoids it.
SMALLEST_STREAM = 4096


def _record(kind, body=b""):
    return struct.pack("<HH", kind, len(body)) + body


def _bof(kind):
    return _record(0x0809, struct.pack("<HHHHII", 0x0600, kind, 0x0DBB, 0x07CC, 0, 6))


def _text(text, width):
    return struct.pack("<H" if width == 2 else "<B", len(text)) + b"\x01" + text.encode("utf-16-le")


def _sheet(rows):
    cells = [_bof(0x0010)]
    for r, row in enumerate(rows):
        for c, value in enumerate(row):
            if value is None or value == "":
                continue
            place = struct.pack("<HHH", r, c, 0)
            if isinstance(value, str):
                cells.append(_record(0x0204, place + _text(value, 2)))
            elif isinstance(value, bytes):
                cells.append(_record(0x0205, place + value + b"\1"))
            elif isinstance(value, date):
                days = value.toordinal() - date(1899, 12, 30).toordinal()
                cells.append(_record(0x0203, struct.pack("<HHHd", r, c, 1, days)))
            else:
                cells.append(_record(0x0203, place + struct.pack("<d", value)))
    cells.append(_record(0x000A))
    return b"".join(cells)


def biff8(sheets):
    """Workbook stream of {name: rows}, rows of texts, numbers, dates, error codes (bytes) and None."""
    bodies = {name: _sheet(rows) for name, rows in sheets.items()}
    end = _record(0x000A)
    # Two ways to show a number: as it is, and as a date (format 14 of those that are built in).
    head = _bof(0x0005) + b"".join(_record(0x00E0, struct.pack("<HH16x", 0, way)) for way in (0, 14))
    names = {name: _text(name, 1) for name in sheets}
    at = len(head) + sum(4 + 6 + len(text) for text in names.values()) + len(end)
    entries = b""
    for name, text in names.items():
        entries += _record(0x0085, struct.pack("<IBB", at, 0, 0) + text)
        at += len(bodies[name])
    return head + entries + end + b"".join(bodies.values())


def compound(stream, name="Workbook"):
    """Compound file with one stream."""
    stream = stream.ljust(max(SMALLEST_STREAM, -(-len(stream) // SECTOR) * SECTOR), b"\0")
    sectors = len(stream) // SECTOR
    # Sector 0: allocation table; 1: directory; then the stream. One table sector maps 128 sectors.
    tables = -(-(sectors + 2) // 127)
    chain = [FAT_SECTOR] * tables + [END_OF_CHAIN]
    first = tables + 1
    chain += [first + i + 1 for i in range(sectors - 1)] + [END_OF_CHAIN]
    chain += [FREE] * (tables * 128 - len(chain))
    header = struct.pack(
        "<8s16sHHHHH6xIIIIIIIIII",
        b"\xd0\xcf\x11\xe0\xa1\xb1\x1a\xe1",
        b"\0" * 16,
        0x3E,
        3,
        0xFFFE,
        9,
        6,
        0,
        tables,
        tables,
        0,
        SMALLEST_STREAM,
        END_OF_CHAIN,
        0,
        END_OF_CHAIN,
        0,
        0,
    )[:76]
    header += struct.pack("<109I", *(list(range(tables)) + [FREE] * (109 - tables)))
    directory = _entry("Root Entry", 5, END_OF_CHAIN, 0, child=1) + _entry(name, 2, first, len(stream))
    directory = directory.ljust(SECTOR, b"\0")
    return header + struct.pack(f"<{len(chain)}I", *chain) + directory + stream


def _entry(name, kind, start, size, child=FREE):
    text = (name + "\0").encode("utf-16-le")
    return struct.pack(
        "<64sHBBIII16sIQQIQ", text, len(text), kind, 1, FREE, FREE, child, b"\0" * 16, 0, 0, 0, start, size
    )


def xls(sheets):
    """Bytes of an .xls workbook of {name: rows}."""
    return compound(biff8(sheets))
