"""Every key that a scene file may hold, read off the declarations that check it.

What a key means is the sentence of the docstring, or of the field, that declares it: there is no second list.
"""

from __future__ import annotations

import inspect
import re
import types
from collections.abc import Iterator, Sequence
from typing import Any, Literal, NamedTuple, Union, get_args, get_origin

import numpy as np

from underlay.mechanics.adhesion import Adhesion
from underlay.mechanics.biphasic.material import Biphasic, BiphasicTransverse
from underlay.mechanics.body import BONDS, TIP_DRAINAGES, Spring, Stiffening
from underlay.mechanics.discrepancy import FRICTIONS
from underlay.mechanics.indenters import Indenter, plugged_indenters
from underlay.mechanics.materials import Isotropic, TransverselyIsotropic
from underlay.mechanics.relaxation import RELAXES, Relaxation
from underlay.quantities import Part
from underlay.scene.discrepancy import Discrepancy
from underlay.scene.instrument import Instrument, Lever
from underlay.scene.noise import Noise
from underlay.scene.scene_schema import (
    CurveSection,
    FieldInfo,
    SimulateSection,
    SolverSection,
    ThicknessSection,
    WidthSection,
    free_parameter_schema,
    kind_of_field,
    schema_of,
)
from underlay.scene.scene_sections import EQUIVALENT_CONES
from underlay.units import KINDS

__all__ = ["TOP", "SceneKey", "scene_keys"]

_WORDS = {str: "text", int: "a whole number", float: "a number", bool: "true or false", dict: "a table"}
#: Keys that choose what a section is, rather than being a number of it.
_CHOICES = {
    ("indenter", "shape"): "the tip; what else it needs is listed by shape",
    (
        "layer.relaxation",
        "model",
    ): "how the modulus falls with time; without the section the layer is elastic",
    ("layer.relaxation", "relaxes"): "shear_and_bulk keeps Poisson's ratio; shear alone needs nu = 0.5",
    (
        Stiffening.section,
        "model",
    ): "how the layer stiffens; without the section its law is that of small strains",
    (
        "layer",
        "bond",
    ): "how its lower face holds to what is under it; slip: no friction; unknown: a fit says both; or springs",
    ("substrate.layers", "bond"): "the same of this layer; further layers stand from the top down",
    ("adhesion", "model"): "how tip and surface stick; without the section they do not",
    ("substrate", "rigid"): "true for a base that does not deform, in place of its moduli",
}
#: What the keys are listed under that stand before any section.
TOP = "top of the file"
_BEFORE_SECTIONS = {
    "title": ("text", "none", "what reports call the test"),
    "friction": (
        f"one of {', '.join(FRICTIONS)}",
        FRICTIONS[0],
        "under the tip: unknown friction widens the second interval; stuck is solved exactly",
    ),
    "finite_strain": (
        "true or false",
        "unknown",
        "false says that strains are small; unknown or true widens the second interval where its size is known",
    ),
    "drainage": (
        f"one of {', '.join(TIP_DRAINAGES)}",
        "none",
        "of a layer with a permeability: whether water leaves through the tip; unknown: a fit spans both",
    ),
    "uncertainties": (
        '"none", or a section',
        "sizes that are assumed",
        "how well the inputs are known: [uncertainties]; none takes all for exact",
    ),
}
_BEFORE_WORDS = {"friction": FRICTIONS, "finite_strain": ("true", "false"), "drainage": TIP_DRAINAGES}
#: What a scene file says of how well its inputs are known, at 95 %.
_UNCERTAINTIES = {
    "PATH": (
        'in its unit, "2 %" or exact',
        'of a number of the test; the same may stand beside it: "1 mm +- 0.02 mm", "1 mm ± 2 %", "1 mm exact"',
    ),
    "force": ('a share, "2 %"', "of the scale of the force"),
    "depth": ('a share, "1 %"', "of the scale of the depth"),
    "spring_constant": ('a share, "10 %"', "of the lever's spring constant"),
}
_FIT = {
    "prior": "density of what is known before; bounds alone are a flat one",
    "min": "lower bound",
    "max": "upper bound",
    "mean": "of a normal prior",
    "sd": "standard deviation of a normal or half-normal prior",
    "median": "of a lognormal prior",
    "relative_sd": "of a lognormal prior, as a share of the median",
}


class SceneKey(NamedTuple):
    """One key: its section, name, what it takes, its default (empty if it must be given) and its meaning.

    The name says in brackets of which variant of the section it is, where there are several: ``radius (sphere)``.
    `kind` is the kind of quantity it takes, if any, and `words` are those it must be one of.
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
        """The shape, model or material it is of; empty where the section has one only."""
        return self.key.partition(" (")[2].removesuffix(")")


def scene_keys() -> list[SceneKey]:
    """Return every key there is, section by section."""
    return list(_all())


def _all() -> Iterator[SceneKey]:
    for key, (takes, default, meaning) in _BEFORE_SECTIONS.items():
        words = _BEFORE_WORDS.get(key, ())
        yield SceneKey(TOP, key, takes, default, meaning, words=tuple(words))
    shapes = _own(Indenter)
    yield _choice("indenter", "shape", sorted([*shapes, *EQUIVALENT_CONES]))
    for name, shape in sorted(shapes.items()):
        yield from _of_class(shape, "indenter", f" ({name})")
    yield from _of_layer("layer")
    yield from _of_class(Biphasic, "layer", "", seen=("E", "nu"))
    yield from _of_class(
        BiphasicTransverse,
        "layer",
        " (transversely isotropic)",
        seen=(*_names(TransverselyIsotropic), "permeability"),
    )
    models = _own(Relaxation)
    section = "layer.relaxation"
    yield _choice(section, "model", sorted(models))
    for name, relaxation in sorted(models.items()):
        yield from _of_class(relaxation, section, f" ({name})", seen=("relaxes",))
    yield _choice(section, "relaxes", RELAXES, RELAXES[0])
    stiff = _own(Stiffening)
    yield _choice(Stiffening.section, "model", sorted(stiff))
    for name, kind in sorted(stiff.items()):
        yield from _of_class(kind, Stiffening.section, f" ({name})")
    yield from _of_model(WidthSection.model_fields, "layer")
    yield from _of_layer("substrate.layers")
    yield SceneKey("substrate", "rigid", "true or false", "false", _CHOICES["substrate", "rigid"])
    yield from _of_class(Isotropic, "substrate", "")
    yield from _of_class(TransverselyIsotropic, "substrate", " (transversely isotropic)", seen=("E", "nu"))
    yield from _of_class(Instrument, "instrument", "")
    yield from _of_class(Lever, "lever", "")
    yield from _of_class(Discrepancy, "discrepancy", "")
    sticky = _own(Adhesion)
    yield _choice("adhesion", "model", sorted(sticky))
    for name, adhesion in sorted(sticky.items()):
        yield from _of_class(adhesion, "adhesion", f" ({name})")
    for key, (takes, meaning) in _UNCERTAINTIES.items():
        yield SceneKey("uncertainties", key, takes, "assumed", meaning)
    yield from _of_class(Noise, "noise", "")
    for name, field in free_parameter_schema("dimensionless").model_fields.items():
        own = name in ("prior", "relative_sd")
        takes = _takes(field) if own else "a quantity of the parameter's kind"
        yield SceneKey("fit", f"PARAMETER.{name}", takes, "none", _FIT[name])
    for section, model in (
        ("solver", SolverSection),
        ("curve", CurveSection),
        ("simulate", SimulateSection),
    ):
        yield from _of_model(model.model_fields, section)


def _of_layer(section: str) -> Iterator[SceneKey]:
    yield from _of_class(Isotropic, section, "")
    yield from _of_class(TransverselyIsotropic, section, " (transversely isotropic)", seen=("E", "nu"))
    yield from _of_model(ThicknessSection.model_fields, section)
    takes = f"one of {', '.join(BONDS)}, or {{ {', '.join(schema_of(Spring).model_fields)} }}"
    yield SceneKey(section, "bond", takes, BONDS[0], _CHOICES[section, "bond"], words=BONDS)


def _names(kind: type[Any]) -> tuple[str, ...]:
    return tuple(schema_of(kind).model_fields)


def _choice(section: str, key: str, words: Sequence[str], default: str = "") -> SceneKey:
    meaning = _CHOICES[section, key]
    return SceneKey(section, key, f"one of {', '.join(words)}", default, meaning, words=tuple(words))


def _own(family: type[Part]) -> dict[str, type[Part]]:
    """Every kind of a part that is of this package or a plug-in, by name."""
    added = [entry.thing for entry in plugged_indenters()]
    return {
        name: kind
        for name, kind in family.kinds().items()
        if kind.__module__.startswith("underlay.") or kind in added
    }


def _of_class(kind: type[Any], section: str, remark: str, seen: tuple[str, ...] = ()) -> Iterator[SceneKey]:
    said = _described(kind)
    for name, field in schema_of(kind).model_fields.items():
        if name not in seen:
            meaning = said.get(name, _first_sentence(kind))
            yield _key(section, f"{name}{remark}", field, meaning)


def _of_model(fields: dict[str, FieldInfo], section: str) -> Iterator[SceneKey]:
    for name, field in fields.items():
        yield _key(section, name, field, field.description or "")


def _key(section: str, key: str, field: FieldInfo, meaning: str) -> SceneKey:
    kinds = _members(field.annotation)
    words = get_args(kinds[0]) if get_origin(kinds[0]) is Literal else ()
    return SceneKey(
        section, key, _takes(field), _default(field), meaning, kind_of_field(field) or "", tuple(words)
    )


def _takes(field: FieldInfo) -> str:
    kind = kind_of_field(field)
    if kind is not None:
        example = KINDS[kind].example
        return f"a number, {example}" if kind == "dimensionless" else f'{kind}, "{example}"'
    kinds = _members(field.annotation)
    if get_origin(kinds[0]) is list:
        return f"a list of {', '.join(get_args(get_args(kinds[0])[0]))}"
    if get_origin(kinds[0]) is Literal:
        return f"one of {', '.join(get_args(kinds[0]))}"
    return _WORDS.get(get_origin(kinds[0]) or kinds[0], "text")


def _members(annotation: Any) -> list[Any]:
    if get_origin(annotation) in (Union, types.UnionType):
        return [member for member in get_args(annotation) if member is not type(None)]
    return [annotation]


def _default(field: FieldInfo) -> str:
    if field.is_required():
        return ""
    value = field.default
    if value is None or (isinstance(value, float) and not np.isfinite(value)):
        return "none"
    return f"{value:g}" if isinstance(value, float) else str(value)


def _described(kind: type[Any]) -> dict[str, str]:
    """First sentence of what a numpydoc docstring says of each parameter."""
    found = re.search(r"\nParameters\n-+\n(.*?)(?:\n\n\S|\Z)", inspect.getdoc(kind) or "", re.DOTALL)
    if found is None:
        return {}
    said: dict[str, str] = {}
    for names, text in re.findall(r"^(\S[^:\n]*) :[^\n]*\n((?:[ ]{4}.*\n?)+)", found.group(1), re.MULTILINE):
        words = " ".join(text.split())
        for name in names.split(","):
            said[name.strip()] = words
    return said


def _first_sentence(kind: type[Any]) -> str:
    return " ".join((inspect.getdoc(kind) or "").split("\n\n")[0].split())
