"""Make data_samples/chiaro_cell_indentation.csv from the published Optics11 file.

Run as ``python tests/support/chiaro_sample.py FILE > data_samples/chiaro_cell_indentation.csv``, where FILE
is tests/data/fmt-chiaro-txt_AEBP1_Indentation_002.zip of the source distribution of afmformats 0.18.7.
"""

import sys
from pathlib import Path

import underlay as ul

STEP = 5

HEADER = """\
# Indentation of a cell with an Optics11 Chiaro nanoindenter: approach, loading and retract.
# source: afmformats 0.18.7, tests/data/fmt-chiaro-txt_AEBP1_Indentation_002.zip
# source url: https://github.com/AFM-analysis/afmformats
# source sha256: {sha256}
# licence: MIT, Copyright (c) 2019 Paul Müller (full text in LICENSES/afmformats-MIT.txt)
# changes: every {step}th row from the first is kept and nothing is averaged; depth = Piezo - Cantilever of
#   the file, in nm; force = Load of the file, in nN; segment = the
#   motion of the Piezo column; the other columns are left out
# indenter: sphere
# indenter radius: 27.5 um
# spring constant: 0.019 N/m
# instrument reduced modulus: 156.009 Pa
#   which is the instrument's own result, E[eff] = E/(1-nu^2) by Hertz's formula
# signs: depth grows into the sample, force is positive in compression
# zero of depth: the instrument's, not contact; contact is near 73080 nm
time (s),depth (nm),force (nN),segment
"""


def sample_text(curve: ul.Curve) -> str:
    """Text of the sample made from the curve of the published file."""
    kept = curve.select(slice(None, None, STEP))
    rows = (
        f"{time:.3f},{depth * 1e9:.2f},{force * 1e9:.3f},{segment}"
        for time, depth, force, segment in zip(
            kept.time, kept.depth, kept.force, kept.segments(), strict=True
        )
    )
    return HEADER.format(sha256=curve.metadata["sha256"], step=STEP) + "\n".join(rows) + "\n"


if __name__ == "__main__":
    sys.stdout.reconfigure(encoding="utf-8", newline="\n")
    sys.stdout.write(sample_text(ul.read(Path(sys.argv[1]))))
