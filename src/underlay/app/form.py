"""The form of a scene, made from the declarations that check a scene file.

There is no second list of its keys: this module only names the parts of the form (`ADVANCED`, `BASES`) and the keys
that are elsewhere on the page (`ELSEWHERE`). A `Draft` is a scene file that is being edited: its sections and keys,
with values as text. It knows no physics: `scene_keys` declares what a key may hold, and `read_scene_file` whether
the whole is a valid scene.

A comma may separate numbers or be part of one: `comma_problem` finds ambiguous ones, and `pairs_of` refuses them.
"""

from __future__ import annotations

import re
from collections.abc import Collection, Iterable, Mapping
from dataclasses import dataclass
from pathlib import Path, PurePath
from typing import Any

from underlay._door import FileKind, parse_toml, read_text, understood
from underlay._text import one_line
from underlay.errors import InputError, UnitError
from underlay.report.labels import label, start
from underlay.scene.fit_range import Mark
from underlay.scene.scene_file import entries, scene_file_from_text
from underlay.scene.scene_keys import TOP, SceneKey, scene_keys
from underlay.scene.scene_writer import document_text
from underlay.scene.uncertainties import parted
from underlay.units import KINDS, parse_quantity

_KIND = FileKind("a scene file (TOML)", 1_000_000, "begin with one of the samples")
_FOLDER = Path(__file__).parent / "presets"
_HELP: Mapping[str, Mapping[str, Any]] = parse_toml(read_text(_FOLDER.with_name("help.toml"), _KIND))
#: Samples to begin with, by the names of their files; what may lie under the layer; sections that most tests do
#: without: what each is called.
PRESETS, BASES, ADVANCED = (_HELP[name] for name in ("presets", "bases", "advanced"))
#: Section and name of the keys that the form has no field for, as the page has them elsewhere.
ELSEWHERE = frozenset((section, key) for section, keys in _HELP["elsewhere"].items() for key in keys)
#: What the page says beside its fields and results.
NOTES = _HELP["notes"]
#: Numbers that a file may hold, samples to try, what changes of a scene are called, and what can be taken of a fit.
FACTS, SAMPLES, CHANGES, DOWNLOADS = (_HELP[name] for name in ("facts", "samples", "changes", "downloads"))
_AXIAL = ("E_axial", "nu_axial", "G_axial")
_RATIO = "permeability_ratio"
_INDEX = re.compile(r"\[(\d+)\]$")
_AMOUNT = re.compile(r"\s*([+-]?(?:\d+\.?\d*|\.\d+)(?:[eE][+-]?\d+)?)\s*(\S.*?)?\s*")
# A comma with a digit on each side: of 0.45, of 45 thousand, or between 0 and 45.
_COMMA = re.compile(r"\d*,\d+(?:,\d+)*")
_LIST, _WHOLE = "a list of ", "a whole number"
_ENDS = ("fit_from", "fit_to")
_MISSING = re.compile(r"^scene\.toml: \[([\w.]+)\] needs '(\w+)'$")


@dataclass(frozen=True)
class Field:
    """One line of the form: a key of the scene file with its present value.

    Parameters
    ----------
    section : str
        Section of the scene file, with an index where there are several: ``"substrate.layers[0]"``.
    key : SceneKey
        Declaration of the key.
    text : str
        Its present value as text; empty for none.
    assumed : bool
        Whether the value is a usual one that the user neither entered nor confirmed.
    is_missing : bool
        Whether the scene is incomplete without it.
    """

    section: str
    key: SceneKey
    text: str
    assumed: bool = False
    is_missing: bool = False

    @property
    def path(self) -> str:
        """Path of the parameter, such as ``"layer.E"``."""
        return self.key.name if self.section == TOP else f"{self.section}.{self.key.name}"

    @property
    def label(self) -> str:
        """Name of the field for people, capitalised."""
        words = label(self.path) if self.key.kind else self.key.name
        return start(self.key.name if words == self.path else words).replace("_", " ")

    @property
    def help(self) -> str:
        """Help text of the field: of ``help.toml`` where it has one, else the meaning that the key declares."""
        known, section = _HELP["test"], _INDEX.sub("", self.section)
        own = (f"{section}.{self.key.name}", self.key.name)
        return next((known[name] for name in own if name in known), self.key.meaning)

    @property
    def units(self) -> tuple[str, ...]:
        """Units to choose from; an empty string for a dimensionless number."""
        return KINDS[self.key.kind].units if self.key.kind else ()

    @property
    def required(self) -> bool:
        """Whether the key has no default, so that the section needs it."""
        return not self.key.default


class Draft:
    """A scene file that is being edited: its values may be incomplete or wrong.

    Parameters
    ----------
    document : mapping
        Sections and keys as TOML reads them.
    """

    def __init__(self, document: Mapping[str, Any]) -> None:
        self.document: dict[str, Any] = dict(document)
        self.document["fit"] = _flat(self.document.get("fit", {}))
        if not isinstance(assumed := self.document.get("assumed", []), list):
            raise InputError("assumed must be a list of numbers of the test")
        self.document["assumed"] = list(map(str, assumed))

    @classmethod
    def of(cls, text: str) -> Draft:
        """Make a draft from the text of a scene file.

        Raises
        ------
        FileFormatError
            If it is not TOML.
        """
        with understood("the scene", _KIND):
            return cls(parse_toml(text))

    def text(self) -> str:
        """Return the scene file as TOML text."""
        # A key before all sections: TOML has no other place for it.
        whole = {"assumed": [], **self.document} | {"assumed": self.assumed}
        return document_text({key: value for key, value in whole.items() if value not in ({}, [])})

    def table(self, section: str) -> dict[str, Any]:
        """Return the keys of a section, made if absent; section `TOP` holds the keys above all sections."""
        table = self.document
        for part in () if section == TOP else section.split("."):
            index, name = _INDEX.search(part), _INDEX.sub("", part)
            inner: Any = table.get(name)
            if not isinstance(inner, dict | list):
                inner = table[name] = [] if index else {}
            table = inner[int(index[1])] if index else inner
        return table

    def get(self, section: str, key: str) -> str:
        """Return the value at a key as text; empty for none."""
        value = self.peek(section).get(key, "")
        if isinstance(value, bool):
            return "true" if value else "false"
        return ", ".join(map(str, value)) if isinstance(value, list) else str(value)

    def put(self, section: str, key: SceneKey, text: str) -> None:
        """Set a key from text and mark it as entered by the user; an empty text removes the key."""
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
        """Remove a key, and its section where it is nested and now empty.

        An empty section ``[layer.relaxation]``, for example, would be invalid.
        """
        table = self.peek(section)
        table.pop(name, None)
        above, _, last = section.rpartition(".")
        if above and not table:
            self.peek(above).pop(last, None)

    def fields(self, section: str) -> list[Field]:
        """Return the lines of the form for a section.

        Of keys that depend on a choice, such as the shape of the tip, only those of the present choice are
        included.
        """
        declared = [key for key in scene_keys() if key.section == _INDEX.sub("", section)]
        variant = self.get(section, "shape" if section == "indenter" else "model")
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
        """Key of `BASES` for what lies under the layer: ``"rigid"``, ``"elastic"`` or ``"none"``."""
        if "substrate" not in self.document:
            return "none"
        return "rigid" if self.peek("substrate").get("rigid") else "elastic"

    def choose_base(self, base: str) -> None:
        """Change what lies under the layer; intermediate layers are kept, except for ``"none"``."""
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
        """Sections of the layers between the top layer and the base."""
        layers = self.peek("substrate").get("layers") or []
        return [f"substrate.layers[{number}]" for number in range(len(layers))]

    def add_layer(self) -> None:
        """Add a layer directly over the base, with values copied from the top layer and marked as assumed."""
        usual = {"E": "1 MPa", "nu": 0.45, "thickness": "1 mm"}
        above = self.peek("layer")
        layer = {name: above.get(name, value) for name, value in usual.items()}
        self.table("substrate").setdefault("layers", []).append(layer)
        self._assume([*self.assumed, *(f"{self.between[-1]}.{name}" for name in usual)])

    def remove_layer(self, section: str) -> None:
        """Remove the intermediate layer of that section."""
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
        """Make the material of a section transversely isotropic (`axial`), or isotropic again."""
        table = self.table(section)
        for name in (*_AXIAL, _RATIO):
            table.pop(name, None)
        if axial:
            stiffness = table.get("E", "1 MPa")
            table |= {"E_axial": stiffness, "nu_axial": table.get("nu", 0.3), "G_axial": stiffness}
            self._assume([*self.assumed, *(f"{section}.{name}" for name in _AXIAL)])

    @property
    def free(self) -> dict[str, dict[str, Any]]:
        """Fitted parameters by path, each with its bounds and prior as texts."""
        free: dict[str, dict[str, Any]] = self.document["fit"]
        return free

    def peek(self, section: str) -> dict[str, Any]:
        """Return the keys of a section without making it; empty where there is no such section."""
        table: Any = self.document
        for part in () if section == TOP else section.split("."):
            index, name = _INDEX.search(part), _INDEX.sub("", part)
            table = table.get(name, {}) if isinstance(table, dict) else {}
            if index:
                table = table[int(index[1])] if isinstance(table, list) else {}
        return table if isinstance(table, dict) else {}

    @property
    def assumed(self) -> list[str]:
        """Paths of the values that the user neither entered nor confirmed."""
        there = [(path, *path.rpartition(".")) for path in self.document.get("assumed", [])]
        return [path for path, section, _, name in there if self.get(section, name)]

    @property
    def assumptions(self) -> list[str]:
        """Assumed values that are held fixed in the fit; a fitted parameter only starts at its value."""
        return [path for path in self.assumed if path not in self.free]

    @property
    def missing(self) -> list[str]:
        """Names for people of the values without which the scene is incomplete."""
        fields = [field for section in ("indenter", "layer") for field in self.fields(section)]
        return [label(field.path) for field in fields if field.is_missing]

    def confirm(self, path: str) -> None:
        """Mark the value at a path as the user's own, no longer assumed."""
        self._assume(known for known in self.assumed if known != path)

    def _assume(self, paths: Iterable[str]) -> None:
        self.document["assumed"] = list(dict.fromkeys(paths))

    def _is_missing(self, section: str, key: SceneKey) -> bool:
        """Whether a required number of indenter or layer has no value.

        The curve's file may still state the tip's radius. The layer's thickness is required unless there is no
        base.
        """
        if section not in ("indenter", "layer") or not key.kind or self.get(section, key.name):
            return False
        return not key.default or (section == "layer" and key.name == "thickness" and self.base != "none")

    def _is_axial(self, section: str, key: SceneKey) -> bool:
        table = self.peek(section)
        if key.name == _RATIO:
            return {"E_axial", "permeability"} <= table.keys()
        return key.name in _AXIAL and key.name in table


def help_of(name: str) -> str:
    """Return the help text of a field of the page by its name, for fields that are no key of the scene file."""
    return str(_HELP["page"].get(name) or _HELP["test"][name])


def draft_from(text: str, files: Collection[str]) -> Draft:
    """Return the draft of a scene file's text, with its curve looked up among the analysis' own files.

    Parameters
    ----------
    text : str
        Text of a scene file.
    files : collection of str
        Names of the curve files of the analysis; the scene may name no other.

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
    """Return the draft of a new analysis, without the values that only the user knows: radius, thickness, nu.

    The layer's modulus is only the starting value of the fit.
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
    """Return the draft of one of the prepared tests (`PRESETS`), by the name of its file in ``presets``."""
    return Draft.of(read_text(_FOLDER / f"{name}.toml", _KIND))


def apart(text: str, units: tuple[str, ...]) -> tuple[str, str]:
    """Split a text into number and unit; where it has no unit, the middle one of `units` is returned.

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
    """Return what is wrong with the text entered for a key, in one sentence; empty if it is valid."""
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
        known = set(_parts(text)) <= set(allowed)
        return "" if known else f"any of {', '.join(allowed)}, with commas between"
    return f"one of {', '.join(key.words)}" if key.words and text not in key.words and "{" not in text else ""


def comma_problem(text: str, *, may_list: bool = True) -> str:
    """Return what is wrong with the commas in a number, or a list of numbers; empty if nothing is.

    Without `may_list`, any comma is wrong.

    Examples
    --------
    >>> comma_problem("0,45 MPa")
    "write numbers with a point, such as 0.45, and thousands without a comma; got '0,45'"
    >>> comma_problem("0.4, 0.3"), comma_problem("0.4,")
    ('', '')
    """
    found = _COMMA.search(text)
    if found is None and (may_list or "," not in text):
        return ""
    got = text.strip() if found is None else found[0]
    words = f"write numbers with a point, such as 0.45, and thousands without a comma; got {got[:40]!r}"
    listed = found is not None and may_list and "," in text.replace(found[0], "", 1)
    return f"{words}; where several numbers stand, put a space behind each comma" if listed else words


def pairs_of(text: str) -> dict[str, str]:
    """Parse name and value pairs from a text such as ``"depth = h (nm), force = F (mN)"``.

    Raises
    ------
    InputError
        If a part has no ``=``, or a number contains a comma.
    """
    wrong = comma_problem(text)
    if wrong:
        raise InputError(wrong)
    pairs = {}
    for part in filter(None, map(str.strip, text.split(","))):
        name, equals, value = (piece.strip() for piece in part.partition("="))
        if not (name and equals and value):
            raise InputError(
                f"write name = value, with commas between; got {part[:60]!r} (what holds a comma itself can be "
                "written in the test as text, step 2)"
            )
        pairs[name] = value
    return pairs


def in_the_form(message: str) -> str:
    """Rewrite a message about a scene file for users of the form; any other message is returned as it is.

    Examples
    --------
    >>> in_the_form("scene.toml: [layer] needs 'nu'")
    "The test misses Poisson's ratio of the layer: enter it in step 2."
    """
    if missing := _MISSING.match(message):
        return f"The test misses {label(f'{missing[1]}.{missing[2]}')}: enter it in step 2."
    return message


def _parts(text: str) -> list[str]:
    """Split a text at its commas; ``"0.4,"`` is a list of one."""
    return [part.strip() for part in text.split(",") if part.strip()]


def _value(text: str, kind: str) -> Any:
    """Return a dimensionless number as a float, as a file writes it without quotes; any other value as text."""
    found = _AMOUNT.fullmatch(text)
    return float(found[1]) if kind == "dimensionless" and found is not None and not found[2] else text


def _flat(fit: Any) -> dict[str, dict[str, Any]]:
    """Return the entries of the section ``[fit]`` by full path, however the file nests them."""
    if not isinstance(fit, Mapping):
        raise InputError("[fit] must be a section")
    return {path: dict(entry) for path, entry in entries(fit)}
