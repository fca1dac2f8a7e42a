"""Where the published instrument files lie that are too large or not ours to keep in the tree.

The folder ``shared/data`` beside the repository, or the one named by UNDERLAY_REAL_DATA. Tests that need it
are skipped where it is absent; small files of our own with the same layouts are tested everywhere.
"""

import os
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]


def real_data():
    """Folder of the real files, or None."""
    named = os.environ.get("UNDERLAY_REAL_DATA")
    candidates = [Path(named)] if named else [ROOT / "../shared/data", ROOT / "../../shared/data"]
    return next((folder.resolve() for folder in candidates if folder.is_dir()), None)


def real_file(name):
    """Path of a real file; skips the test that asks where there is none."""
    folder = real_data()
    if folder is None:
        pytest.skip("no folder of real instrument files: set UNDERLAY_REAL_DATA to it")
    return folder / name


MACH1 = "mach1/Hayes_data_3locations_thinned.txt"
NO_CONTACT = "mach1/Hayes_data_no_contact_thinned.txt"
CHIARO = "afm/fmt-chiaro-txt_AEBP1_Indentation_002.zip"
JPK = "afm/fmt-jpk-fd_spot3-0192.jpk-force"
JPK_CREEP = "afm/fmt-jpk-cc_pr14-polymergel-2021.06.30.jpk-force"
WORKSHOP = "afm/fmt-afm-workshop-fd_single_2021-10-22_14.16.csv"
NTMDT = "afm/fmt-ntmdt-txt-fd_2015_01_17_gel4-0,1_mQ_adh_6B_Curve_DFL_Height_51.txt"
HLD = "hysitron/experiment_a.hld"
LC = "hysitron/RobinSteel0000LC.txt"
