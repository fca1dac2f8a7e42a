"""Declarations of the numbers of a test: kind, bounds, scale, and effect on the force.

A number is declared where it lives, in its dataclass::

    @dataclass(frozen=True)
    class Hyperboloid(Indenter):
        half_angle: float = field(metadata=quantity("angle", "half-angle of the {part}", bounds=(0.0, 0.5 * np.pi)))

and nowhere else: scene files, priors, scaled coordinates, tables, plots and messages read it from there, through
its path. A path begins with the part of the test (`Part.parts`) and ends with the field; a field that holds several
numbers has each under its index: ``layer.E``, ``substrate.layers[0].E``, ``layer.relaxation.times[1]``. The *name*
of a parameter in a joint problem may add the number of its curve in brackets, ``layer.E[1]``.

The kind of a number that is not declared follows from the last word of its field's name (``tip_radius`` is a
length); it is dimensionless for other words.
"""

from __future__ import annotations

import re
from collections.abc import Container, Iterator, Mapping
from dataclasses import Field, dataclass, fields, is_dataclass, replace
from typing import Any, ClassVar, Literal, NamedTuple, Self, TypeVar

import numpy as np

from underlay.errors import InputError, ParameterError

Whole = TypeVar("Whole")

_ANY = (-np.inf, np.inf)
_POSITIVE = (0.0, np.inf)
_INDEX = re.compile(r"\[(\d{1,6})\]")
_LAST_INDEX = re.compile(r"^(?P<rest>.+)\[(?P<number>\d{1,6})\]$")


@dataclass(frozen=True)
class Quantity:
    """Declaration of one number of a test.

    Parameters
    ----------
    kind : str
        Physical kind, one of `underlay.units.KINDS`: it gives the unit.
    label : str
        Its name in a sentence; ``{part}`` stands for the part it belongs to.
    symbol : str
        Its letter in a formula (TeX).
    bounds : (float, float)
        Open interval of the physically possible values (SI).
    natural_scale : float
        Size (SI) of a noticeable change, where neither the curve nor a prior gives one.
    linear : bool
        Whether the force reading is linear in it.
    nearly_linear : bool
        Whether the force is so nearly linear in it that intervals may use a linear model, after a check for each
        curve.
    from_zero : bool
        Whether zero means that an effect is absent: near zero its interval has an upper end only.
    power : float
        Power of it with which its effect on the force grows from zero, for searches; 0 if not known.
    scales : {"force", "length"} or None
        Whether it is a scale of the force (a modulus) or of the lengths of the contact (a thickness, a radius).
    many : bool
        Whether the field holds several such numbers.
    """

    kind: str
    label: str = ""
    symbol: str = ""
    bounds: tuple[float, float] = _ANY
    natural_scale: float = 0.1
    linear: bool = False
    scales: Literal["force", "length"] | None = None
    many: bool = False
    nearly_linear: bool = False
    from_zero: bool = False
    power: float = 0.0

    @property
    def is_scale(self) -> bool:
        """Whether it is positive by nature, without an upper bound, so that it is treated by its logarithm."""
        return self.bounds == _POSITIVE


def quantity(kind: str, label: str = "", **said: Any) -> Mapping[str, Any]:
    """Metadata that declares a dataclass field as a number of the test; `said` are arguments of `Quantity`."""
    return {"quantity": Quantity(kind, label, **said)}


def inlined() -> Mapping[str, Any]:
    """Metadata of a field whose numbers have the path of its owner: ``layer.E`` for the layer material's E."""
    return {"inlined": True}


def one_of(*words: str) -> dict[str, Any]:
    """Metadata of a field whose value is one of these words."""
    return {"words": words}


def takes(what: Any) -> Mapping[str, Any]:
    """Metadata of a field's allowed values: a list of words, a range of whole numbers, or a type."""
    return {"takes": what}


def no_number() -> dict[str, Any]:
    """Metadata of a field that is not a number itself: a word, or further parts."""
    return {"no number": True}


class Part:
    """A part of a test that holds numbers: an indenter, a material, a noise model.

    `parts` are the first words that paths of its numbers may have. Classes that derive from it, wherever they are
    defined, are found by `declared`. Where a part may be of several kinds, `chosen_by` is the key of a scene file
    that names the kind, and the attribute of the concrete class that holds this name.
    """

    parts: ClassVar[tuple[str, ...]] = ()
    #: Key of a scene file that names the kind of the part, and attribute that holds the name.
    chosen_by: ClassVar[str] = ""

    @classmethod
    def kinds(cls) -> dict[str, type[Self]]:
        """Every concrete subclass, wherever it was defined, by its name in scene files.

        Of two with the same name the first that was defined is used.
        """
        found: dict[str, type[Self]] = {}
        for child in cls.__subclasses__():
            name = getattr(child, cls.chosen_by)
            found = child.kinds() | ({name: child} if name else {}) | found
        return found

    @property
    def choice(self) -> dict[str, Any]:
        """The key and value by which a scene file names the kind of this part; empty where there is one kind only.

        Raises
        ------
        InputError
            If its class has no name.
        """
        if not self.chosen_by:
            return {}
        name = getattr(self, self.chosen_by)
        if not name:
            kind = type(self).__name__
            raise InputError(f"{kind} has no name in scene files: give its class a `{self.chosen_by}`")
        return {self.chosen_by: name}


def field_quantities(part: Any) -> dict[str, Quantity]:
    """Declaration of every number among the fields of a dataclass or one of its instances, by field name.

    Fields of other types (materials, words) are left out; of an instance, also those that hold no number.
    """
    return {
        entry.name: quantity_of(entry)
        for entry in (fields(part) if is_dataclass(part) else ())
        if "quantity" in entry.metadata or _is_number(entry, part)
    }


def quantity_of(entry: Field[Any]) -> Quantity:
    """Declaration of a field, or one derived from the last word of its name."""
    declaration = entry.metadata.get("quantity")
    return declaration if isinstance(declaration, Quantity) else _by_word(entry.name)


def _is_number(entry: Field[Any], part: Any) -> bool:
    """Whether an undeclared field is a number: by its value in an instance, by its annotation in a class."""
    if isinstance(part, type):
        return entry.type in (float, "float")
    return isinstance(getattr(part, entry.name), float)


_LENGTH = Quantity("length", bounds=_POSITIVE, scales="length")
#: Declaration of an undeclared number by the last word of its field's name.
_WORDS: Mapping[str, Quantity] = {
    "radius": _LENGTH,
    "thickness": _LENGTH,
    "length": _LENGTH,
    "width": _LENGTH,
    "height": Quantity("length"),
    "depth": Quantity("length"),
    "angle": Quantity("angle"),
    "time": Quantity("time", bounds=_POSITIVE),
    "modulus": Quantity("pressure", bounds=_POSITIVE, scales="force"),
    "force": Quantity("force"),
    "stiffness": Quantity("stiffness"),
    "compliance": Quantity("compliance", bounds=_POSITIVE),
    "permeability": Quantity("permeability", bounds=_POSITIVE),
    "diffusivity": Quantity("diffusivity", bounds=_POSITIVE),
}
_UNKNOWN = Quantity("dimensionless")


def _by_word(name: str) -> Quantity:
    return _WORDS.get(name.rpartition("_")[2], _UNKNOWN)


def declared(name: str) -> Quantity:
    """Declaration of a parameter from its path or name alone, without a scene.

    Where two kinds of one part have a field of this name (the exponent of a shape, say), that of the class defined
    first is returned; `Scene.quantities` has the right one.
    """
    words = _INDEX.sub("", name).split(".")
    for kind in _kinds(words[0]):
        known = field_quantities(kind).get(words[-1])
        if known is not None:
            return known
    return _by_word(words[-1])


def _kinds(part: str) -> Iterator[type[Part]]:
    """Every dataclass whose numbers may have paths with this first word."""
    waiting = Part.__subclasses__()
    while waiting:
        kind = waiting.pop(0)
        waiting += kind.__subclasses__()
        if part in kind.parts and hasattr(kind, "__dataclass_fields__"):
            yield kind


def kind_of(name: str) -> str:
    """Physical kind of a parameter by its path or name, e.g. ``"pressure"`` for ``"layer.E[1]"``."""
    return declared(name).kind


def path_of(name: str) -> str:
    """Path of a parameter, without the number of a curve: ``"layer.E"`` for ``"layer.E[1]"``."""
    return _apart(name)[0]


def curve_of(name: str) -> int | None:
    """Number of the curve in a parameter's name, or None: 1 for ``"layer.E[1]"``."""
    return _apart(name)[1]


def _apart(name: str) -> tuple[str, int | None]:
    """Path and curve number of a name; the last index is the curve's, unless it is the field's only index."""
    match = _LAST_INDEX.match(name)
    if match is None or (declared(name).many and not match["rest"].endswith("]")):
        return name, None
    return match["rest"], int(match["number"])


# --- the numbers of a scene, by their paths --------------------------------------------------------------


class Number(NamedTuple):
    """A number of a scene: its value (SI) and its declaration."""

    value: float
    quantity: Quantity


def numbers_of(whole: Any, prefix: str = "") -> dict[str, Number]:
    """Every number of a scene, or of one part whose path is `prefix`, by its path."""
    return dict(_walk(whole, prefix))


def _walk(part: Any, prefix: str) -> Iterator[tuple[str, Number]]:
    for entry in fields(part):
        value, path = getattr(part, entry.name), _path(prefix, entry)
        if isinstance(value, float):
            yield path, Number(value, quantity_of(entry))
        elif is_dataclass(value):
            yield from _walk(value, path)
        elif isinstance(value, tuple):
            for index, item in enumerate(value):
                if is_dataclass(item):
                    yield from _walk(item, f"{path}[{index}]")
                elif "quantity" in entry.metadata:
                    yield f"{path}[{index}]", Number(float(item), quantity_of(entry))
        elif isinstance(value, int) and "quantity" in entry.metadata:
            yield path, Number(float(value), quantity_of(entry))


def _path(prefix: str, entry: Field[Any]) -> str:
    if entry.metadata.get("inlined"):
        return prefix
    return f"{prefix}.{entry.name}" if prefix else entry.name


def replace_values(
    whole: Whole, values: Mapping[str, float], prefix: str = "", known: Container[str] | None = None
) -> Whole:
    """Return the scene, or the part whose path is `prefix`, with the numbers at the given paths replaced (SI).

    `known` are all its paths, if the caller has them: to find them takes as long as to replace the numbers.

    Raises
    ------
    ParameterError
        If a path is not one of the scene's.
    """
    paths = numbers_of(whole, prefix) if known is None else known
    for path in values:
        if path not in paths:
            there = ", ".join(sorted(numbers_of(whole, prefix)))
            raise ParameterError(f"there is no number {path!r} here, but {there}")
    touched = {path[:end] for path in values for end, sign in enumerate(path) if sign in ".["} | values.keys()
    numbers = {path: float(value) for path, value in values.items()}
    changed: Whole = _replaced(whole, prefix, numbers, touched)
    return changed


def _replaced(part: Any, prefix: str, values: Mapping[str, float], touched: Container[str]) -> Any:
    """Return the part with the numbers in `values` replaced; itself where none of them is its own.

    `touched` are the paths of all parts on the way to these numbers.
    """
    changed = {}
    # Not `fields`, which takes longer: attributes that are not fields have no path in `touched`.
    for name, entry in part.__dataclass_fields__.items():
        path = _path(prefix, entry)
        if path and path not in touched:
            continue
        new = old = getattr(part, name)
        if path in values:
            new = values[path]
        elif is_dataclass(old):
            new = _replaced(old, path, values, touched)
        elif isinstance(old, tuple):
            items = (
                _replaced(item, f"{path}[{index}]", values, touched)
                if is_dataclass(item)
                else values.get(f"{path}[{index}]", item)
                for index, item in enumerate(old)
            )
            new = tuple(items)
        if new is not old and new != old:
            changed[name] = new
    return replace(part, **changed) if changed else part
