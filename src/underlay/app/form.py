"""The form of a scene, made from the declarations that check a scene file.

There is no second list of its keys: here stand only what the form calls its parts (`ADVANCED`, `BASES`) and
which keys stand elsewhere on the page (`ELSEWHERE`). A `Draft` is a scene file on its way: sections, keys and
the texts that stand for them. It knows no physics: what may stand where is said by `scene_keys`, and whether
a whole is possible by `read_scene_file`.
"""

from __future__ import annotations

import re
from collections.abc import Collection, Iterable, Mapping
from dataclasses import dataclass
from pathlib import Path, PurePath
from typing import Any

from underlay._door import FileKind, parse_toml, read_text, understood
from underlay._text import one_line
from underlay.app.labels import comma_problem
from underlay.errors import InputError, UnitError
from underlay.report.labels import label, start
from underlay.scene.fit_range import Mark
from underlay.scene.scene_file import entries, scene_file_from_text
from underlay.scene.scene_keys import TOP, SceneKey, scene_keys
from underlay.scene.scene_writer import document_text
from underlay.scene.uncertainties import parted
from underlay.units import KINDS, parse_quantity

__all__ = [
    "ADVANCED",
    "BASES",
    "ELSEWHERE",
    "PRESETS",
    "Draft",
    "Field",
    "apart",
    "draft_from",
    "empty",
    "help_of",
    "in_the_form",
    "preset",
    "problem_with",
]

#: Samples to begin with: name of the file and what it is called.
PRESETS: Mapping[str, str] = {
    "cartilage_on_bone": "Cartilage on bone",
    "gel_on_glass": "Gel on glass",
    "cell_on_glass": "Cell on glass",
    "film_on_wafer": "Film on a wafer",
}
#: What may lie under the layer, and what that is called.
BASES: Mapping[str, str] = {
    "rigid": "a rigid substrate",
    "elastic": "an elastic substrate",
    "none": "none: the sample is deep (half-space)",
}
#: Sections that most tests do without, and what they are called.
ADVANCED: Mapping[str, str] = {
    "curve": "Which part of the curve is fitted",
    TOP: "Title, friction, drainage and large strain",
    "layer.relaxation": "Viscoelastic sample",
    "layer.stiffening": "Strain stiffening",
    "adhesion": "Adhesion",
    "discrepancy": "Size of friction and large strain",
    "instrument": "The instrument",
    "uncertainties": "Uncertainty of force, depth and cantilever",
    "lever": "The cantilever",
    "noise": "Noise level, where it is known",
    "solver": "Contact model",
}
_FILES, _HANDLES, _TEXT = (
    "step 1, where the file is read",
    "step 3, the handles of the curve",
    "the test as text",
)
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
    (TOP, "uncertainties"): _TEXT,
    (TOP, "assumed"): "the mark beside a number that nobody entered",
    ("uncertainties", "PATH"): "beside the number itself: 0.02 mm of 1 mm is 1 mm ± 0.02 mm",
}
_KIND = FileKind("a scene file (TOML)", 1_000_000, "begin with one of the samples")
_FOLDER = Path(__file__).parent / "presets"
_HELP: Mapping[str, Mapping[str, str]] = parse_toml(read_text(_FOLDER.with_name("help.toml"), _KIND))
_CHOSEN_BY = {
    "indenter": "shape",
    "layer.relaxation": "model",
    "layer.stiffening": "model",
    "adhesion": "model",
}
_AXIAL = ("E_axial", "nu_axial", "G_axial")
_RATIO = "permeability_ratio"
_INDEX = re.compile(r"\[(\d+)\]$")
_AMOUNT = re.compile(r"\s*([+-]?(?:\d+\.?\d*|\.\d+)(?:[eE][+-]?\d+)?)\s*(\S.*?)?\s*")
_LIST, _WHOLE = "a list of ", "a whole number"
_ENDS = ("fit_from", "fit_to")
_MISSING = re.compile(r"^scene\.toml: \[([\w.]+)\] needs '(\w+)'$")


@dataclass(frozen=True)
class Field:
    """One line of the form.

    Parameters
    ----------
    section : str
        With its index, where there are several: ``"substrate.layers[0]"``.
    key : SceneKey
        Its declaration.
    text : str
        What stands there now; empty for nothing.
    assumed : bool
        Whether it is a usual number that nobody touched or confirmed.
    is_missing : bool
        Whether the test is not complete without it.
    """

    section: str
    key: SceneKey
    text: str
    assumed: bool = False
    is_missing: bool = False

    @property
    def path(self) -> str:
        """By which the rest of the program knows it."""
        return self.key.name if self.section == TOP else f"{self.section}.{self.key.name}"

    @property
    def label(self) -> str:
        """What it is called."""
        words = label(self.path) if self.key.kind else self.key.name
        return start(self.key.name if words == self.path else words).replace("_", " ")

    @property
    def help(self) -> str:
        """What it is, for whom the mouse rests on it; of a tip from outside what that declares."""
        known, section = _HELP["test"], _INDEX.sub("", self.section)
        own = (f"{section}.{self.key.name}", self.key.name)
        return next((known[name] for name in own if name in known), self.key.meaning)

    @property
    def units(self) -> tuple[str, ...]:
        """Units that may be picked; one empty text for a bare number."""
        return KINDS[self.key.kind].units if self.key.kind else ()

    @property
    def required(self) -> bool:
        """Whether the section needs it."""
        return not self.key.default


class Draft:
    """A scene file on its way: sections, keys, and texts that need not be complete or right yet.

    Parameters
    ----------
    document : mapping
        As TOML reads it.
    """

    def __init__(self, document: Mapping[str, Any]) -> None:
        self.document: dict[str, Any] = dict(document)
        self.document["fit"] = _flat(self.document.get("fit", {}))
        self.document["assumed"] = list(map(str, _parts_of(self.document.get("assumed", []))))

    @classmethod
    def of(cls, text: str) -> Draft:
        """Read the text of a scene file.

        Raises
        ------
        FileFormatError
            If it is not TOML.
        """
        with understood("the scene", _KIND):
            return cls(parse_toml(text))

    def text(self) -> str:
        """Text of the scene file."""
        # A key before all sections: TOML has no other place for it.
        whole = {"assumed": [], **self.document} | {"assumed": self.assumed}
        return document_text({key: value for key, value in whole.items() if value not in ({}, [])})

    def table(self, section: str) -> dict[str, Any]:
        """The keys of a section, made if absent; those before any section under `TOP`."""
        table = self.document
        for part in () if section == TOP else section.split("."):
            index, name = _INDEX.search(part), _INDEX.sub("", part)
            inner: Any = table.get(name)
            if not isinstance(inner, dict | list):
                inner = table[name] = [] if index else {}
            table = inner[int(index[1])] if index else inner
        return table

    def get(self, section: str, key: str) -> str:
        """What stands at a key, as text; empty for nothing."""
        value = self.peek(section).get(key, "")
        if isinstance(value, bool):
            return "true" if value else "false"
        return ", ".join(map(str, value)) if isinstance(value, list) else str(value)

    def put(self, section: str, key: SceneKey, text: str) -> None:
        """Write a text at a key, which is nobody's assumption from then on; an empty one removes the key."""
        self.confirm(key.name if section == TOP else f"{section}.{key.name}")
        if not text.strip():
            self._take_out(section, key.name)
            return
        table = self.table(section)
        if key.takes == "true or false":
            table[key.name] = text == "true"
        elif key.takes == _WHOLE and text.strip().lstrip("+-").isdecimal():
            table[key.name] = int(text)
        elif key.takes.startswith(_LIST) or ("," in text and key.kind):
            table[key.name] = [_value(part, key.kind) for part in _parts(text)]
        else:
            table[key.name] = _value(text.strip(), key.kind)

    def _take_out(self, section: str, name: str) -> None:
        """Remove a key, and an inner section of which nothing is left: an empty one would be no relaxation."""
        table = self.peek(section)
        table.pop(name, None)
        above, _, last = section.rpartition(".")
        if above and not table:
            self.peek(above).pop(last, None)

    def fields(self, section: str) -> list[Field]:
        """The lines of a section, of the variant that it has now."""
        declared = [key for key in scene_keys() if key.section == _INDEX.sub("", section)]
        chosen_by = _CHOSEN_BY.get(section)
        variant = self.get(section, chosen_by) if chosen_by else ""
        return [
            Field(
                section,
                key,
                self.get(section, key.name),
                assumed=f"{section}.{key.name}" in self.assumptions,
                is_missing=self._is_missing(section, key),
            )
            for key in declared
            if (not key.variant or key.variant == variant or self._is_axial(section, key))
            and (section, key.name) not in ELSEWHERE
        ]

    @property
    def base(self) -> str:
        """Which of the bases lies under the layer."""
        if "substrate" not in self.document:
            return "none"
        return "rigid" if self.peek("substrate").get("rigid") else "elastic"

    def choose_base(self, base: str) -> None:
        """Put another base under the layer; layers between stay unless there is none."""
        between = self.peek("substrate").get("layers")
        self.document.pop("substrate", None)
        if base == "none":
            self.peek("layer").pop("thickness", None)
            return
        self.document["substrate"] = {"rigid": True} if base == "rigid" else {"E": "1 GPa", "nu": 0.3}
        self._assume([*self.assumed, *(["substrate.E", "substrate.nu"] if base == "elastic" else [])])
        if between:
            self.document["substrate"]["layers"] = between

    @property
    def between(self) -> list[str]:
        """Sections of the layers between the one on top and the base."""
        layers = self.peek("substrate").get("layers") or []
        return [f"substrate.layers[{number}]" for number in range(len(layers))]

    def add_layer(self) -> None:
        """Put one more layer over the base."""
        above = self.peek("layer")
        self.table("substrate").setdefault("layers", []).append(
            {
                "E": above.get("E", "1 MPa"),
                "nu": above.get("nu", 0.45),
                "thickness": above.get("thickness", "1 mm"),
            }
        )
        self._assume([*self.assumed, *(f"{self.between[-1]}.{name}" for name in ("E", "nu", "thickness"))])

    def remove_layer(self, section: str) -> None:
        """Take a layer out."""
        there, assumed = self.between, self.assumed
        left = [name for name in there if name != section]
        self.table("substrate")["layers"] = [self.peek(name) for name in left]
        # Those under it have another place from now on.
        places = dict(zip(left, there, strict=False))
        parts = [(path, *path.rpartition(".")) for path in assumed]
        self._assume(
            f"{places[part]}.{name}" if part in places else path
            for path, part, _, name in parts
            if part != section
        )
        if not left:
            self.table("substrate").pop("layers")

    def set_axial(self, section: str, *, axial: bool) -> None:
        """Make a material transversely isotropic, or isotropic again."""
        table = self.table(section)
        for name in (*_AXIAL, _RATIO):
            table.pop(name, None)
        if axial:
            stiffness = table.get("E", "1 MPa")
            table |= {"E_axial": stiffness, "nu_axial": table.get("nu", 0.3), "G_axial": stiffness}
            self._assume([*self.assumed, *(f"{section}.{name}" for name in _AXIAL)])

    @property
    def free(self) -> dict[str, dict[str, Any]]:
        """What is fitted, by path, with its bounds and prior as texts."""
        free: dict[str, dict[str, Any]] = self.document["fit"]
        return free

    def peek(self, section: str) -> dict[str, Any]:
        """The keys of a section as they are; none where there is no such section."""
        table: Any = self.document
        for part in () if section == TOP else section.split("."):
            index, name = _INDEX.search(part), _INDEX.sub("", part)
            table = table.get(name, {}) if isinstance(table, dict) else {}
            if index:
                table = table[int(index[1])] if isinstance(table, list) else {}
        return table if isinstance(table, dict) else {}

    @property
    def assumed(self) -> list[str]:
        """Paths of numbers that stand in the test and nobody entered or confirmed."""
        there = [(path, *path.rpartition(".")) for path in self.document.get("assumed", [])]
        return [path for path, section, _, name in there if self.get(section, name)]

    @property
    def assumptions(self) -> list[str]:
        """Those of them that the fit takes as they stand: what is fitted only starts there."""
        return [path for path in self.assumed if path not in self.free]

    @property
    def missing(self) -> list[str]:
        """What the test is not complete without, in words."""
        fields = [field for section in ("indenter", "layer") for field in self.fields(section)]
        return [label(field.path) for field in fields if field.is_missing]

    def confirm(self, path: str) -> None:
        """Take a number for the user's own."""
        self._assume(known for known in self.assumed if known != path)

    def _assume(self, paths: Iterable[str]) -> None:
        self.document["assumed"] = list(dict.fromkeys(paths))

    def _is_missing(self, section: str, key: SceneKey) -> bool:
        """Whether nothing stands where something must; the file of a curve may know the tip."""
        needed = not key.default or (section == "layer" and key.name == "thickness" and self.base != "none")
        return (
            needed and bool(key.kind) and not self.get(section, key.name) and section in ("indenter", "layer")
        )

    def _is_axial(self, section: str, key: SceneKey) -> bool:
        table = self.peek(section)
        if key.name == _RATIO:
            return {"E_axial", "permeability"} <= table.keys()
        return key.name in _AXIAL and key.name in table


def help_of(name: str) -> str:
    """Return what a field of the page is, which is none of a test's, by its mark."""
    return _HELP["page"].get(name) or _HELP["test"][name]


def draft_from(text: str, files: Collection[str]) -> Draft:
    """Return the scene of a text.

    Parameters
    ----------
    text : str
        Of a scene file.
    files : collection of str
        Names of the curves of the analysis; the scene may look at no other file.

    Raises
    ------
    FileFormatError
        If it is not TOML.
    InputError
        If a section, key, unit or value is not allowed, or the curve is none of this analysis.
    """
    named = scene_file_from_text(text).curve.get("file")
    draft = Draft.of(text)
    if named is not None:
        name = PurePath(named).name
        if name not in files:
            raise InputError(f"[curve] file must be one of the files of step 1; got {one_line(named, 80)!r}")
        draft.table("curve")["file"] = f"curves/{name}"
    return draft


def empty() -> Draft:
    """Return the form as it begins: what only the user knows, radius, thickness and Poisson's ratio, is not there.

    The layer's modulus is where a search starts, which the data then decide.
    """
    return Draft(
        {
            "assumed": ["layer.E"],
            "indenter": {"shape": "sphere"},
            "layer": {"E": "1 MPa"},
            "substrate": {"rigid": True},
            "fit": {"layer.E": {"min": "0.1 Pa", "max": "1 TPa"}, "instrument.baseline": {}},
            "solver": {"rtol": 1e-5},
        }
    )


def preset(name: str) -> Draft:
    """Return one of the tests to begin with, by the name of its file in ``presets``."""
    return Draft.of(read_text(_FOLDER / f"{name}.toml", _KIND))


def apart(text: str, units: tuple[str, ...]) -> tuple[str, str]:
    """Return the number and the unit of a text; the middle one of `units` where it has none.

    Examples
    --------
    >>> apart("1.5 mm", ("nm", "um", "mm", "m")), apart("", ("nm", "um", "mm"))
    (('1.5', 'mm'), ('', 'um'))
    """
    found = _AMOUNT.fullmatch(text)
    middle = units[len(units) // 2] if units else ""
    if found is None or not any(units):
        return text.strip(), middle
    return found[1], found[2] or middle


def problem_with(text: str, key: SceneKey) -> str:
    """Return what is wrong with a text for a key, in one sentence; empty if nothing is."""
    if not text.strip():
        return ""
    if wrong := comma_problem(text) if key.kind or key.name in _ENDS else "":
        return wrong
    if key.takes == _WHOLE and not text.strip().lstrip("+-").isdecimal():
        return f"a whole number, such as {key.default or 4}; got {text.strip()[:40]!r}"
    try:
        for part in _parts(text):
            if key.kind:
                parse_quantity(_value(parted(part)[0], key.kind), key.kind)
            if key.name in _ENDS:
                Mark.parse(part)
    except (UnitError, InputError) as error:
        return str(error)
    if key.takes.startswith(_LIST):
        allowed = key.takes.removeprefix(_LIST).split(", ")
        return (
            "" if set(_parts(text)) <= set(allowed) else f"any of {', '.join(allowed)}, with commas between"
        )
    return f"one of {', '.join(key.words)}" if key.words and text not in key.words and "{" not in text else ""


def in_the_form(message: str) -> str:
    """Return a message about a scene file in the words of the form.

    Examples
    --------
    >>> in_the_form("scene.toml: [layer] needs 'nu'")
    "The test misses Poisson's ratio of the layer: enter it in step 2."
    """
    missing = _MISSING.match(message)
    return (
        f"The test misses {label(f'{missing[1]}.{missing[2]}')}: enter it in step 2." if missing else message
    )


def _parts(text: str) -> list[str]:
    """What stands between commas; ``"0.4,"`` is a list of one."""
    return [part.strip() for part in text.split(",") if part.strip()]


def _value(text: str, kind: str) -> Any:
    """A bare number for a dimensionless quantity, which a file writes without quotes."""
    found = _AMOUNT.fullmatch(text)
    return float(found[1]) if kind == "dimensionless" and found is not None and not found[2] else text


def _parts_of(assumed: Any) -> list[Any]:
    if not isinstance(assumed, list):
        raise InputError("assumed must be a list of numbers of the test")
    return assumed


def _flat(fit: Any) -> dict[str, dict[str, Any]]:
    """What is fitted by whole paths, however the file nests them."""
    if not isinstance(fit, Mapping):
        raise InputError("[fit] must be a section")
    return {path: dict(entry) for path, entry in entries(fit)}
