"""Every key of a scene file: what values it takes, what it means, how it is checked, and a list of them all.

Most keys are fields of the dataclasses that a section describes (`keys_of`): the meaning of such a key is the
sentence on it in the docstring of its class. One declaration serves the reader of scene files, the list of
`underlay keys` and the form of the page.

Pydantic is not used: its models of four sections took 0.3 of the 1.55 s of processor time of `underlay fit`
(medians of four runs in turns: 1.55 with them, 1.26 without), for what `Key.read` does in ten lines. Its
`TypeAdapter` on one of these dataclasses takes 0.09 s to import and 0.03 s to make, and its messages name neither
the nearest key nor, in the words of a scene file, what a key takes.
"""

from __future__ import annotations

import inspect
import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import MISSING, dataclass, field, fields
from importlib.resources import files
from typing import Any, NamedTuple

import numpy as np

from underlay._arrays import physical_length
from underlay._door import parse_toml
from underlay.errors import InputError
from underlay.mechanics.adhesion import Adhesion
from underlay.mechanics.biphasic.material import Biphasic, BiphasicTransverse
from underlay.mechanics.body import BONDS, TIP_DRAINAGES, Layer, Spring, Stiffening
from underlay.mechanics.discrepancy import FRICTIONS
from underlay.mechanics.indenters import Cone, Indenter, plugged_indenters
from underlay.mechanics.materials import Isotropic, TransverselyIsotropic
from underlay.mechanics.relaxation import RELAXES, Relaxation
from underlay.quantities import Part, Quantity, one_of, quantity_of, takes
from underlay.scene.discrepancy import Discrepancy
from underlay.scene.fit_range import PRESETS, Mark
from underlay.scene.instrument import Instrument, Lever
from underlay.scene.noise import Noise
from underlay.scene.parameters import hint
from underlay.scene.program import SimulatedDepths
from underlay.units import KINDS, parse_quantity

#: Pyramids that are replaced by the cone of the same projected area.
EQUIVALENT_CONES = {"berkovich": Cone.berkovich, "vickers": Cone.vickers}
#: Parts of a curve that can be fitted; and the pattern of one segment of several, by its kind and number from 1.
SEGMENTS = ("all", "loading", "unloading", "equilibrium")
RUN = re.compile(r"(ramp|loading|hold|unloading)\s+([1-9]\d{0,3})")
_OVERRULED = [
    *("indenter.radius", "instrument.compliance", "lever.spring_constant"),
    *("calibration.spring_constant", "calibration.sensitivity", "imprint"),
]
_PRIORS = ("uniform", "loguniform", "normal", "lognormal", "halfnormal", "found")
_OF_ITS_KIND = ("min", "max", "mean", "sd", "median")
#: Heading of the keys that stand before any section.
TOP = "top of the file"
# What keys mean that no docstring describes.
_SAID = parse_toml((files("underlay.scene") / "keys.toml").read_text(encoding="utf-8"))
_AXIAL = " (transversely isotropic)"


def _segment(value: Any) -> str:
    """Check and return the part of a curve that a file selects."""
    if value in SEGMENTS or (isinstance(value, str) and RUN.fullmatch(value)):
        return str(value)
    if value == "hold":
        raise InputError(
            "a hold alone does not show how stiff the sample is: fit 'loading', 'unloading' (of an elastic "
            "sample), 'all', 'equilibrium' (the ends of the holds of a stepwise test), or one of several, 'hold 1'"
        )
    raise InputError(
        f"there is no {str(value)!r:.40}; allowed are {', '.join(map(repr, SEGMENTS))}, and one of several by its "
        "number: 'ramp 2', 'hold 1', 'unloading 3'"
    )


@dataclass(frozen=True)
class Key:
    """What one key of a section takes.

    Parameters
    ----------
    takes : Quantity, tuple, list, range or type
        The allowed values: a number with its unit; one of these words; a list of some of them; a whole number;
        `Mark`; text, a switch, a table of texts.
    default : object
        Its value where a file leaves it out; an ellipsis where it must be given.
    several : bool
        Whether its value is a list of numbers.
    """

    takes: Any
    default: Any = ...
    several: bool = False

    def read(self, value: Any) -> Any:
        """Check a value from a file and return it; numbers in SI.

        Raises
        ------
        InputError
            If the key does not take such a value.
        """
        if isinstance(self.takes, Quantity) and (self.several or not isinstance(value, list)):
            return _amount(value, self.takes)
        if self.takes is Mark:
            return str(Mark.parse(value))
        if self.takes == SEGMENTS:
            return _segment(value)
        if isinstance(self.takes, Quantity) or not self._allows(value):
            raise InputError(f"must be {self._asked}; got {value!r:.60}")
        return value

    def _allows(self, value: Any) -> bool:
        match self.takes:
            case tuple():
                return value in self.takes
            case list():
                return isinstance(value, list) and all(entry in self.takes for entry in value)
            case range():
                return type(value) is int and value in self.takes
        return isinstance(value, self.takes) and all(
            isinstance(entry, str) or type(entry) is int
            for entry in (value.values() if isinstance(value, dict) else ())
        )

    @property
    def text(self) -> str:
        """The values that the key takes, in words for people."""
        match self.takes:
            case Quantity(kind="dimensionless"):
                return f"a number, {KINDS['dimensionless'].example}"
            case Quantity():
                return f'{self.takes.kind}, "{KINDS[self.takes.kind].example}"'
            case tuple():
                return f"one of {', '.join(self.takes)}"
            case list():
                return f"a list of {', '.join(self.takes)}"
            case range():
                return "a whole number"
        return {bool: "true or false", dict: "a table"}.get(self.takes, "text")

    @property
    def _asked(self) -> str:
        """The values that the key takes, in the words of the message about a wrong value."""
        match self.takes:
            case range():
                return f"{self.text} from {self.takes[0]:,} to {self.takes[-1]:,}"
            case tuple() | list():
                return f"{self.text.partition(' of ')[0]} of {', '.join(map(repr, self.takes))}"
        return self.text

    def listed(self, section: str, name: str, meaning: str = "") -> SceneKey:
        """The key as a row of the list of all keys; `meaning`: by its docstring, else as ``keys.toml`` says."""
        meaning = meaning or _SAID["meanings"][f"{section}.{name}"]
        kind = self.takes.kind if isinstance(self.takes, Quantity) else ""
        words = self.takes if isinstance(self.takes, tuple) else ()
        return SceneKey(section, name, self.text, _shown(self.default), meaning, kind, words)


def _amount(value: Any, known: Quantity) -> Any:
    """Read a quantity such as "1.5 mm" as 1.5e-3, and a list as a tuple; lengths below 1e-18 m are refused."""
    if isinstance(value, list):
        return tuple(_amount(entry, known) for entry in value)
    number = parse_quantity(value, known.kind)
    return physical_length(number, "a size") if known.is_scale and known.kind == "length" else number


def _shown(default: Any) -> str:
    if default is ...:
        return ""
    if default is None or (isinstance(default, float) and not np.isfinite(default)):
        return "none"
    return f"{default:g}" if isinstance(default, float) else str(default)


def keys_of(kind: type[Any]) -> dict[str, Key]:
    """The keys of a section by name, from the fields of the dataclass that it describes."""
    return {
        entry.name: Key(
            _takes_of(entry), ... if entry.default is MISSING else entry.default, several=_is_of_many(entry)
        )
        for entry in fields(kind)
        if not entry.metadata.get("inlined")
    }


def _is_of_many(entry: Any) -> bool:
    """Whether a field of a dataclass holds several numbers."""
    return any(word in str(entry.type) for word in ("tuple", "Array", "Sequence"))


def _takes_of(entry: Any) -> Any:
    for own in ("words", "takes"):
        if own in entry.metadata:
            return entry.metadata[own]
    return str if entry.type in (str, "str", "str | None") else quantity_of(entry)


def read_table(
    section: str, keys: Mapping[str, Key], table: Mapping[str, Any], *, besides: tuple[str, ...] = ()
) -> dict[str, Any]:
    """Check a section; return only the keys the file gives, so that defaults remain those of the dataclasses.

    `besides` are keys of the section that other code reads; error messages name them too.

    Raises
    ------
    InputError
        With the section and the key.
    """
    # An unknown key is reported first: it is often a required one, misspelt.
    for name in table:
        if name not in keys:
            allowed = [*keys, *besides]
            meant = hint(name, allowed) or ";"
            raise InputError(f"[{section}] has no {name!r}{meant} allowed: {', '.join(allowed)}")
    for name, key in keys.items():
        if key.default is ... and name not in table:
            raise InputError(f"[{section}] needs {name!r}")
    found = {}
    for name, value in table.items():
        try:
            found[name] = keys[name].read(value)
        except InputError as error:
            raise type(error)(f"[{section}] {name}: {error}") from error
    return found


# --- sections that are no part of a scene --------------------------------------------------------------------


@dataclass(frozen=True)
class SolverSection:
    """``[solver]``: the contact law and its accuracy.

    Parameters
    ----------
    name : str
        Auto, exact, asymptotic, halfspace or the name of a published correction.
    rtol : float
        Relative error allowed in force, contact radius and stiffness.
    order : int
        Order of the asymptotic law, 0 to 4.
    form : str
        Form of the asymptotic law: explicit, parametric, compliance or auto.
    """

    name: str = "auto"
    rtol: float = 1e-6
    order: int = field(default=4, metadata=takes(range(5)))
    form: str = "auto"


@dataclass(frozen=True)
class CurveSection:
    """``[curve]``: which part of which curve file is used.

    Parameters
    ----------
    file : str
        The measured curve, relative to the scene file; depths and noise are taken from it.
    format : str
        Name of the format, where the content does not tell; see underlay formats.
    test : int
        Which test of a file of several, from 1.
    from_time : float
        First reading that is used, by the clock of the file.
    to_time : float
        Last reading that is used.
    step : int
        Which step of a stepwise test: a ramp and the hold after it, from 1.
    segment : str
        Which part is used; or one of several, by its number: "ramp 2".
    flip : list of str
        Columns whose sign is reversed: ["force"]; [] says that both signs are right.
    overrule : list of str
        Numbers for which the scene takes precedence where the file of the curve gives another.
    preset : str
        Fit range of an instrument's own software: bioindenter, 10 to 98 % of the force.
    fit_from : Mark
        Where the fit begins: "10 % of force", "5 % of depth", "0.1 radius", "2 um".
    fit_to : Mark
        Where it ends: "98 % of force", "10 % of thickness"; depths count from contact.
    columns : dict of str to str
        Of a plain table: { depth = "h (nm)", force = "-Fz (mN)" }; by number, { depth = "2 (nm)" }; or a sum, {
        depth = "ramp - deflection" }.
    calibration : dict of str to str
        Calibration that an AFM file lacks, or its uncertainty: { spring_constant = "0.04 N/m ± 10 %", sensitivity =
        "± 3 %" }.
    min_depth : float
        Shallowest reading that is used.
    max_depth : float
        Deepest reading that is used.
    """

    file: str | None = None
    format: str | None = None
    test: int | None = field(default=None, metadata=takes(range(1, 10**9)))
    from_time: float = -np.inf
    to_time: float = np.inf
    step: int | None = field(default=None, metadata=takes(range(1, 10**9)))
    segment: str = field(default="loading", metadata=one_of(*SEGMENTS))
    flip: list[str] | None = field(default=None, metadata=takes(["depth", "force"]))
    overrule: list[str] | None = field(default=None, metadata=takes(_OVERRULED))
    preset: str | None = field(default=None, metadata=one_of(*PRESETS))
    fit_from: Mark | None = field(default=None, metadata=takes(Mark))
    fit_to: Mark | None = field(default=None, metadata=takes(Mark))
    columns: dict[str, str] | None = field(default=None, metadata=takes(dict))
    calibration: dict[str, str] | None = field(default=None, metadata=takes(dict))
    min_depth: float = -np.inf
    max_depth: float = np.inf


def fit_keys(kind: str) -> dict[str, Key]:
    """The keys of one entry of ``[fit]``, for a parameter of the given physical kind."""
    return {
        "prior": Key(_PRIORS, None),
        "relative_sd": Key(Quantity("dimensionless"), None),
        **{name: Key(Quantity(kind), None) for name in _OF_ITS_KIND},
    }


# --- the list of them all -----------------------------------------------------------------------------------


class SceneKey(NamedTuple):
    """One key in the list: its section, name, what it takes, its default (empty if required) and its meaning.

    The name has in brackets the variant of the section that it belongs to, where there are several: ``radius
    (sphere)``. `kind` is the kind of quantity it takes, if any, and `words` are the allowed words, if any.
    """

    section: str
    key: str
    takes: str
    default: str
    meaning: str
    kind: str = ""
    words: tuple[str, ...] = ()

    @property
    def name(self) -> str:
        """The key as a file writes it."""
        return self.key.partition(" (")[0]

    @property
    def variant(self) -> str:
        """The shape, model or material that the key belongs to; empty where the section has one only."""
        return self.key.partition(" (")[2].removesuffix(")")


def scene_keys() -> list[SceneKey]:
    """Return every key of scene files, section by section."""
    return list(_all())


def _all() -> Iterator[SceneKey]:
    yield Key(str, None).listed(TOP, "title")
    yield Key(tuple(FRICTIONS), FRICTIONS[0]).listed(TOP, "friction")
    yield Key(bool, "unknown").listed(TOP, "finite_strain")._replace(words=("true", "false"))
    yield Key(tuple(TIP_DRAINAGES), "none").listed(TOP, "drainage")
    known = Key(str, "sizes that are assumed").listed(TOP, "uncertainties")
    yield known._replace(takes='"none", or a section')
    yield Key(str, None).listed(TOP, "assumed")._replace(takes="a list of paths")
    yield from _family(Indenter, "indenter", words=sorted((*_own(Indenter), *EQUIVALENT_CONES)))
    yield from _of_layer("layer")
    for key in _of_class(Biphasic, "layer", seen=("E", "nu")):
        yield key._replace(default="none")
    yield from _of_class(
        BiphasicTransverse, "layer", _AXIAL, (*keys_of(TransverselyIsotropic), "permeability")
    )
    yield from _family(Relaxation, "layer.relaxation", seen=("relaxes",))
    yield Key(RELAXES, RELAXES[0]).listed("layer.relaxation", "relaxes")
    yield from _family(Stiffening, Stiffening.section)
    for name in ("half_width", "shape"):
        yield keys_of(Layer)[name].listed("layer", name)
    yield from _of_layer("substrate.layers")
    yield Key(bool, "false").listed("substrate", "rigid")
    yield from _of_material("substrate")
    yield from _of_class(Instrument, "instrument")
    yield from _of_class(Lever, "lever")
    yield from _of_class(Discrepancy, "discrepancy")
    yield from _family(Adhesion, "adhesion")
    for name, (what, meaning) in _SAID["uncertainties"].items():
        yield SceneKey("uncertainties", name, what, "assumed", meaning)
    yield from _of_class(Noise, "noise")
    for name, entry in fit_keys("dimensionless").items():
        row = entry.listed("fit", f"PARAMETER.{name}")._replace(kind="", words=())
        yield row._replace(takes="a quantity of the parameter's kind") if name in _OF_ITS_KIND else row
    yield from _of_class(SolverSection, "solver")
    yield from _of_class(CurveSection, "curve")
    yield from _of_class(SimulatedDepths, "simulate")


def _of_layer(section: str) -> Iterator[SceneKey]:
    yield from _of_material(section)
    yield keys_of(Layer)["thickness"].listed(section, "thickness")
    row = Key(BONDS, BONDS[0]).listed(section, "bond")
    yield row._replace(takes=f"{row.takes}, or {{ {', '.join(keys_of(Spring))} }}")


def _of_material(section: str) -> Iterator[SceneKey]:
    yield from _of_class(Isotropic, section)
    yield from _of_class(TransverselyIsotropic, section, _AXIAL, seen=("E", "nu"))


def _family(
    family: type[Part], section: str, seen: tuple[str, ...] = (), words: Sequence[str] = ()
) -> Iterator[SceneKey]:
    """The key that chooses one class of a family, and the keys of each class."""
    kinds = sorted(_own(family).items())
    yield Key(tuple(words or [name for name, _ in kinds])).listed(section, family.chosen_by)
    for name, kind in kinds:
        yield from _of_class(kind, section, f" ({name})", seen)


def _own(family: type[Part]) -> dict[str, type[Part]]:
    """Every class of a family from this package or a plug-in, by its name in scene files."""
    added = [entry.thing for entry in plugged_indenters()]
    return {
        name: kind
        for name, kind in family.kinds().items()
        if kind.__module__.startswith("underlay.") or kind in added
    }


def _of_class(
    kind: type[Any], section: str, remark: str = "", seen: tuple[str, ...] = ()
) -> Iterator[SceneKey]:
    said = _described(kind)
    for name, key in keys_of(kind).items():
        if name not in seen:
            yield key.listed(section, f"{name}{remark}", said.get(name, _first_sentence(kind)))


def _described(kind: type[Any]) -> dict[str, str]:
    """Descriptions of the parameters of a class, by name, from its numpydoc docstring."""
    found = re.search(r"\nParameters\n-+\n(.*?)(?:\n\n\S|\Z)", inspect.getdoc(kind) or "", re.DOTALL)
    said: dict[str, str] = {}
    entries = re.findall(r"^(\S[^:\n]*) :[^\n]*\n((?:[ ]{4}.*\n?)+)", found[1] if found else "", re.MULTILINE)
    for names, text in entries:
        said |= dict.fromkeys(map(str.strip, names.split(",")), " ".join(text.split()))
    return said


def _first_sentence(kind: type[Any]) -> str:
    return " ".join((inspect.getdoc(kind) or "").split("\n\n")[0].split())
