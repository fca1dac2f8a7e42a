"""Public files of microscopes that are not ours to ship, and where each can be had.

The folder named by UNDERLAY_PUBLIC_FILES is searched through; tests that need a file are skipped without it.
"""

import os
from pathlib import Path

import pytest

#: Where the files were had: a public repository of the given name, or a package of the Python index.
SOURCES = {
    "Force.spm": "package nanoscope 1.2.300 (Apache-2.0), Example Nanoscope Files",
    "ForceHold.spm": "package nanoscope 1.2.300",
    "ForceHoldSweep.spm": "package nanoscope 1.2.300",
    "FV.spm": "package nanoscope 1.2.300",
    "Image.spm": "package nanoscope 1.2.300",
    "Script.spm": "package nanoscope 1.2.300",
    "PeakForce.pfc": "package nanoscope 1.2.300",
    "20200904_Egel4-Z1.0_00025.spm": "jlopezalo/PyFMReader (MIT), tests/testfiles",
    "20200903_Egel2.0_00023.spm": "jlopezalo/PyFMReader, tests/testfiles",
    "cr00000.000": "yogi-boi/tutorial_pyfmrheo_gren_draft, test_files",
    "spectroscopy.nid": "package NSFopen 2.2.4 (MIT), NSFopen/example/Force_Spectroscopy",
    "spec.nid": "package NSFopen 1.1.18 (MIT), NSFopen/example",
    "thermal.nid": "package NSFopen 2.2.4, NSFopen/example/Spring_Constant",
    "ForceCurve_009.tiff": "thomasgredig/nanoAFMr (GPL-3), inst/extdata",
    "Park_20210916_034.tiff": "thomasgredig/nanoAFMr, inst/extdata",
    "AR_20211011.ibw": "thomasgredig/nanoAFMr, inst/extdata",
    "fmt-igor-fd_SiN_FD_plot.ibw": "AFM-analysis/afmformats (MIT), tests/data",
    "fmt-igor-fd_U3_3_p10004.ibw": "AFM-analysis/afmformats, tests/data",
    "GaAs_map.mdt": "pycroscopy/SciFiReaders (MIT), SciFiReaders/readers/microscopy/spm/afm/mdt_reader",
}


def public_folder():
    """Folder of the public files; skips the test that asks where there is none."""
    named = os.environ.get("UNDERLAY_PUBLIC_FILES")
    if not named or not Path(named).is_dir():
        pytest.skip("no folder of public files: set UNDERLAY_PUBLIC_FILES to it")
    return Path(named)


def public_file(name):
    """Path of a public file; skips the test that asks where it is not there."""
    found = sorted(public_folder().rglob(name))
    if not found:
        pytest.skip(f"{name} is not in the folder of public files; it is in {SOURCES[name]}")
    return found[0]
