"""Files that mean harm, or are none: one line of ours, at once, and nothing else touched."""

import io
import os
import struct
import sys
import time
import zipfile

import h5py
import numpy as np
import pytest

import underlay as ul
from support import afm_files
from support import instrument_files as files
from underlay.data.readers import FORMATS, curves_of_jpk_map, read_from_map
from underlay.data.readers._source import MAX_BYTES


@pytest.fixture
def put(tmp_path):
    def write(content, name="x.dat"):
        path = tmp_path / name
        path.write_bytes(content)
        return path

    return write


@pytest.mark.parametrize("name", [known.name for known in FORMATS])
@pytest.mark.parametrize(
    "content",
    [
        b"\0" * 100,
        bytes(range(256)) * 8,
        b"\xff\xfe\x00",
        b"\xff\xfe" + b"\xd8\x00" * 9,
        b"\n\n\n",
        b" ",
        b"{",
        b"PK\x03\x04",
    ],
    ids=[
        "nul",
        "binary",
        "half a letter",
        "half a pair",
        "blank lines",
        "a blank",
        "a brace",
        "half an archive",
    ],
)
def test_rubbish_is_refused_by_every_reader(name, content, put):
    with pytest.raises(ul.UnderlayError):
        ul.read_all(put(content), format=name)
    with pytest.raises(ul.UnderlayError):
        ul.read_all(put(content))


def test_what_is_no_file(tmp_path):
    with pytest.raises(ul.FileAccessError, match="No such file"):
        ul.read(tmp_path / "nowhere.csv")
    with pytest.raises(ul.FileAccessError, match="it is a directory"):
        ul.read(tmp_path)
    with pytest.raises(ul.FileAccessError, match="cannot open"):
        ul.read("a\0b")
    with pytest.raises(ul.FileAccessError, match="cannot open"):
        ul.read(None)
    (tmp_path / "empty").write_bytes(b"")
    with pytest.raises(ul.FileFormatError, match="is empty"):
        ul.read(tmp_path / "empty")


@pytest.mark.skipif(not hasattr(os, "mkfifo"), reason="no named pipes on this system")
def test_a_pipe_is_not_waited_for(tmp_path):
    pipe = tmp_path / "pipe"
    os.mkfifo(pipe)
    began = time.perf_counter()
    with pytest.raises(ul.FileAccessError, match="pipe or device"):
        ul.read(pipe)
    assert time.perf_counter() - began < 1.0


@pytest.mark.skipif(not os.path.exists("/dev/zero"), reason="no such device on this system")  # noqa: PTH110
def test_a_device_without_end_is_refused():
    with pytest.raises(ul.FileAccessError, match="pipe or device"):
        ul.read("/dev/zero")


@pytest.mark.skipif(os.name != "posix" or os.geteuid() == 0, reason="the superuser may read everything")
def test_a_file_that_may_not_be_read(put):
    path = put(files.delimited())
    path.chmod(0)
    with pytest.raises(ul.FileAccessError, match="Permission denied"):
        ul.read(path)


def test_a_file_too_large_is_not_taken_in(tmp_path):
    path = tmp_path / "large.csv"
    with path.open("wb") as stream:
        stream.truncate(2 * 2**30)  # 2 GB that take no room on the disk
    began = time.process_time()
    with pytest.raises(ul.FileFormatError, match="more than the 256 MB"):
        ul.read(path)
    assert time.process_time() - began < 0.5


def test_archives(put):
    with pytest.raises(ul.FileFormatError, match="is an empty archive"):
        ul.read(put(files.zipped({})))
    curves = ul.read_all(
        put(files.zipped({"a/1.csv": files.delimited(), "../../2.txt": files.optics11("old")}))
    )
    assert [curve.metadata["format"] for curve in curves] == ["csv", "optics11"]
    assert curves[1].metadata["member"] == "../../2.txt"


@pytest.mark.parametrize("member", ["header.properties", "segments/0/segment-header.properties"])
def test_a_jpk_header_without_measure_is_refused_before_it_is_unpacked(member, put):
    """A few kilobytes of archive: 60 MB of header, of which every line would be an entry."""
    content = files.unzipped(afm_files.jpk())
    content[member] += b"\na=b" * 15_000_000
    packed = files.zipped(content)
    assert len(packed) < 100_000
    path = put(packed)
    of_a_map = {name if name == "header.properties" else f"index/0/{name}": content[name] for name in content}
    (place,) = curves_of_jpk_map(put(files.zipped(of_a_map), "map.dat"))
    began = time.process_time()
    with pytest.raises(ul.FileFormatError, match=f"{member}' claims 60 MB unpacked; at most 4 MB"):
        ul.read(path)
    with pytest.raises(ul.FileFormatError, match=f"{member}' claims 60 MB unpacked; at most 4 MB of one"):
        read_from_map(place)
    assert time.process_time() - began < 0.1


def test_jpk_headers_that_multiply_what_they_share_are_refused(put):
    """Each of 300 entries asks for all 300 that are shared."""
    content = files.unzipped(afm_files.jpk(shared=True))
    name = "segments/0/segment-header.properties"
    content[name] += b"".join(b"\nx%d.lcd-info.*=77" % i for i in range(300))
    content["shared-data/header.properties"] += b"".join(b"\nlcd-info.77.a%d=1" % i for i in range(300))
    with pytest.raises(ul.FileFormatError, match="more than 50000 entries"):
        ul.read(put(files.zipped(content)))


def test_a_member_without_a_name(put):
    nameless = files.zipped({"x": files.delimited()}).replace(b"x", b"")
    with pytest.raises(ul.FileFormatError):
        ul.read(put(nameless))
    data = bytearray(files.zipped({"x": files.delimited()}))
    central = data.rindex(b"PK\x01\x02")
    struct.pack_into("<HH", data, central + 28, 0, 1)  # the name becomes an extra field of one byte
    with pytest.raises(ul.FileFormatError):
        ul.read(put(bytes(data)))


def test_members_of_an_archive_are_never_written(put, tmp_path, monkeypatch):
    folder = tmp_path / "here"
    folder.mkdir()
    monkeypatch.chdir(folder)
    ul.read_all(put(files.zipped({"../escaped.csv": files.delimited(), "/escaped.csv": files.delimited()})))
    assert sorted(path.name for path in tmp_path.rglob("*")) == ["here", "x.dat"]


@pytest.mark.parametrize("members", [1, 10])
def test_an_archive_that_claims_to_unpack_to_too_much(members, put):
    bomb = bytearray(files.zipped({f"{i}.csv": files.delimited() for i in range(members)}))
    at = 0
    for _ in range(members):
        at = bomb.index(b"PK\x01\x02", at) + 24
        struct.pack_into("<I", bomb, at, 2_000_000_000 // members)
    with pytest.raises(ul.FileFormatError, match=f"at most 400000 and {MAX_BYTES // 1_000_000} MB"):
        ul.read(put(bytes(bomb)))


def test_a_member_larger_than_it_claims(put):
    data = bytearray(files.zipped({"x.csv": files.delimited() * 50}))
    size = len(files.delimited()) * 50
    for at in (22, data.rindex(b"PK\x01\x02") + 24):
        assert struct.unpack_from("<I", data, at)[0] == size
        struct.pack_into("<I", data, at, 10)
    with pytest.raises(ul.FileFormatError, match=r"damaged|larger than it claims"):
        ul.read(put(bytes(data)))


def test_an_encrypted_member(put):
    data = bytearray(files.zipped({"x.csv": files.delimited()}))
    for at in (6, data.rindex(b"PK\x01\x02") + 8):
        data[at] |= 1
    with pytest.raises(ul.FileFormatError, match="is damaged"):
        ul.read(put(bytes(data)))


def workbook(sheet, **more):
    """The workbook of the tests with the XML of its data sheet replaced."""
    stream = io.BytesIO()
    with (
        zipfile.ZipFile(io.BytesIO(files.excel())) as archive,
        zipfile.ZipFile(stream, "w", zipfile.ZIP_DEFLATED) as out,
    ):
        for name in archive.namelist():
            out.writestr(name, sheet if name == "xl/worksheets/sheet2.xml" else archive.read(name))
        for name, content in more.items():
            out.writestr(name, content)
    return stream.getvalue()


MAIN = 'xmlns="http://schemas.openxmlformats.org/spreadsheetml/2006/main"'


def sheet_of(rows, before="", entities=""):
    return f"{entities}<worksheet {MAIN}>{before}<sheetData>{rows}</sheetData></worksheet>"


LAUGHS = "".join(f'<!ENTITY {chr(98 + i)} "{f"&{chr(97 + i)};" * 10}">' for i in range(9))
SHEETS = {
    "claimed size": sheet_of("", before='<dimension ref="A1:XFD1048576"/>'),
    "last row": sheet_of('<row r="999999999"><c r="A999999999"><v>1</v></c></row>'),
    "last column": sheet_of('<row r="1"><c r="ZZZ1"><v>1</v></c></row>'),
    "billion laughs": sheet_of(
        "<row><c><v>&j;</v></c></row>", entities=f'<!DOCTYPE l [<!ENTITY a "aaaaaaaaaa">{LAUGHS}]>'
    ),
    "outer entity": sheet_of(
        '<row><c t="str"><v>&x;</v></c></row>',
        entities='<!DOCTYPE l [<!ENTITY x SYSTEM "file:///etc/passwd">]>',
    ),
    "cut": "<worksheet",
}


@pytest.mark.parametrize("sheet", SHEETS.values(), ids=SHEETS)
def test_workbooks_that_claim_or_refer_too_much(sheet, put):
    began = time.process_time()
    with pytest.raises(ul.FileFormatError):
        ul.read_all(put(workbook(sheet)))
    assert time.process_time() - began < 2.0


@pytest.mark.parametrize("link", ["soft", "external", "virtual", "outside", "huge"])
def test_hdf5_that_leads_out_of_the_file(link, put, tmp_path):
    other = tmp_path / "other.h5"
    with h5py.File(other, "w") as file:
        file["force"] = np.ones(10)
    path = put(afm_files.hdf5())
    with h5py.File(path, "a") as file:
        group = file["0"]
        del group["force"]
        if link == "soft":
            group["force"] = h5py.SoftLink("/1/force")
        elif link == "external":
            group["force"] = h5py.ExternalLink(str(other), "force")
        elif link == "virtual":
            layout = h5py.VirtualLayout(shape=(100,), dtype=float)
            layout[:10] = h5py.VirtualSource(str(other), "force", shape=(10,))
            group.create_virtual_dataset("force", layout)
        elif link == "outside":
            group.create_dataset("force", shape=(10,), dtype=float, external=[(str(other), 0, 80)])
        else:
            group.create_dataset("force", shape=(10**9,), dtype=float, chunks=(1000,))  # never written
    with pytest.raises(ul.FileFormatError, match=r"not followed|claims more than"):
        ul.read_all(path)


@pytest.mark.parametrize(
    ("content", "module"),
    [
        (files.excel, "openpyxl"),
        (files.nanosuite, "xlrd"),
        (afm_files.hdf5, "h5py"),
        (afm_files.igor, "igor2.binarywave"),
    ],
)
def test_a_missing_extra_is_named(content, module, put, monkeypatch):
    path = put(content())
    monkeypatch.setitem(sys.modules, module, None)
    with pytest.raises(ul.MissingExtraError, match=r"pip install '\.\[afm\]'"):
        ul.read_all(path)


@pytest.mark.parametrize("content", [afm_files.jpk, afm_files.tab, files.workshop])
def test_microscopes_text_and_jpk_need_no_extra(content, put, monkeypatch):
    monkeypatch.setitem(sys.modules, "afmformats", None)
    monkeypatch.setitem(sys.modules, "h5py", None)
    assert len(ul.read(put(content()))) >= 2 * afm_files.POINTS


@pytest.mark.parametrize(
    "content",
    [
        ("depth" + "1" * 4000 + " (um),force (mN)\n1,2\n3,4\n").encode(),
        (",".join(f"name {n}" + "x" * 90 for n in range(400)) + "\n" + ",".join("1" * 400) + "\n").encode(),
        ("force-distance curve\n# BEGIN METADATA\n# END METADATA\n# " + "\t".join(["x" * 999] * 99)).encode(),
    ],
)
def test_what_a_file_holds_is_listed_in_a_few_words(put, content):
    with pytest.raises(ul.UnderlayError) as caught:
        ul.read(put(content, "x.csv"))
    assert len(str(caught.value)) < 1500
