"""What the form of a scene calls its parts, and which keys stand elsewhere on the page."""

from __future__ import annotations

from collections.abc import Mapping

from underlay.scene.scene_keys import TOP

__all__ = ["ADVANCED", "BASES", "ELSEWHERE", "PRESETS"]

#: Samples to begin with: name of the file and what it is called.
PRESETS: Mapping[str, str] = {
    "cartilage_on_bone": "Cartilage on bone",
    "gel_on_glass": "Gel on glass",
    "cell_on_glass": "Cell on glass",
    "film_on_wafer": "Film on a wafer",
}
#: What may lie under the layer, and what that is called.
BASES: Mapping[str, str] = {
    "rigid": "a rigid base",
    "elastic": "an elastic base",
    "none": "nothing: the sample is deep",
}
#: Sections that most tests do without, and what they are called.
ADVANCED: Mapping[str, str] = {
    "curve": "Which part of the curve is fitted",
    TOP: "Title, friction and large strain",
    "layer.relaxation": "A sample that relaxes",
    "adhesion": "A tip that sticks",
    "discrepancy": "What friction and large strain add, as numbers",
    "instrument": "The instrument",
    "lever": "The cantilever",
    "noise": "The noise, where it is known",
    "solver": "The contact law",
}
_FILES, _HANDLES = "step 1, where the file is read", "step 3, the handles of the curve"
#: Keys that the form has no field for, and where the page has them.
ELSEWHERE: Mapping[tuple[str, str], str] = {
    ("substrate", "rigid"): "the choice of what lies under the layer",
    ("curve", "file"): _FILES,
    ("curve", "test"): _FILES,
    ("curve", "format"): _FILES,
    ("curve", "flip"): _FILES,
    ("curve", "columns"): _FILES,
    ("curve", "calibration"): _FILES,
    ("curve", "min_depth"): _HANDLES,
    ("curve", "max_depth"): _HANDLES,
    ("instrument", "contact_depth"): _HANDLES,
}
