"""Tables as people save, pack and code them: read right, or refused with what to do, never as something else."""

import bz2
import gzip
import io
import lzma
import tarfile
import zipfile

import numpy as np
import pytest

from underlay.data.readers import read
from underlay.errors import FileFormatError

POINTS = 60
DEPTH = np.linspace(0.0, 10.0, POINTS)  # um
FORCE = 0.3 * (DEPTH / 10.0) ** 1.5  # mN
TABLE = "depth (um),force (mN)\n" + "".join(
    f"{depth:.4f},{force:.5f}\n" for depth, force in zip(DEPTH, FORCE, strict=True)
)


@pytest.fixture
def put(tmp_path):
    def write(content, name="curve.csv"):
        path = tmp_path / name
        path.write_bytes(content if isinstance(content, bytes) else content.encode())
        return path

    return write


def is_whole(curve):
    np.testing.assert_allclose(curve.depth, DEPTH * 1e-6, atol=1e-10, rtol=0)
    np.testing.assert_allclose(curve.force, FORCE * 1e-3, atol=1e-8, rtol=0)


def tarred():
    content = io.BytesIO()
    with tarfile.open(fileobj=content, mode="w") as archive:
        entry = tarfile.TarInfo("curve.csv")
        entry.size = len(TABLE)
        archive.addfile(entry, io.BytesIO(TABLE.encode()))
    return content.getvalue()


@pytest.mark.parametrize(
    ("packed", "told"),
    [
        (gzip.compress(TABLE.encode()), r"compressed by gzip \(.gz\)"),
        (bz2.compress(TABLE.encode()), r"compressed by bzip2 \(.bz2\)"),
        (lzma.compress(TABLE.encode()), r"compressed by xz \(.xz\)"),
        (b"\x28\xb5\x2f\xfd" + bytes(60), r"compressed by Zstandard \(.zst\)"),
        (b"7z\xbc\xaf\x27\x1c" + bytes(60), r"an archive of 7-Zip \(.7z\)"),
        (b"Rar!\x1a\x07\x01" + bytes(60), r"an archive of RAR \(.rar\)"),
        (tarred(), r"an archive of tar \(.tar\)"),
    ],
    ids=["gz", "bz2", "xz", "zst", "7z", "rar", "tar"],
)
@pytest.mark.parametrize("in_zip", [False, True])
def test_a_packed_curve_says_how_to_unpack_it(packed, told, in_zip, put):
    if in_zip:
        content = io.BytesIO()
        with zipfile.ZipFile(content, "w") as archive:
            archive.writestr("curve.csv.packed", packed)
        packed = content.getvalue()
    with pytest.raises(FileFormatError, match=rf"{told}, which is not read here: unpack it, or pack .*\.zip"):
        read(put(packed))


@pytest.mark.parametrize("order", ["le", "be"])
@pytest.mark.parametrize("unit", ["um", "µm", "\u03bcm"])
@pytest.mark.parametrize("in_zip", [False, True])
def test_utf_16_without_its_mark_is_read(order, unit, in_zip, put):
    coded = TABLE.replace("um", unit).encode(f"utf-16-{order}")
    if in_zip:
        content = io.BytesIO()
        with zipfile.ZipFile(content, "w") as archive:
            archive.writestr("curve.csv", coded)
        coded = content.getvalue()
    is_whole(read(put(coded)))
