"""What each section of a scene file may hold, checked by pydantic; most from the dataclasses they describe."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import MISSING, fields
from functools import partial
from typing import Annotated, Any, Literal, get_args, get_origin

import numpy as np
from pydantic import BaseModel, BeforeValidator, ConfigDict, Field, ValidationError
from pydantic.fields import FieldInfo
from pydantic_core import SchemaValidator, core_schema

from underlay._arrays import physical_length
from underlay.errors import InputError
from underlay.quantities import quantity_of
from underlay.scene.fit_range import Mark
from underlay.scene.parameters import hint
from underlay.units import parse_quantity

__all__ = [
    "CurveSection",
    "Declared",
    "FieldInfo",
    "SimulateSection",
    "SolverSection",
    "check",
    "free_parameter_schema",
    "kind_of_field",
    "schema_of",
]

_PRIORS = Literal["uniform", "loguniform", "normal", "lognormal", "halfnormal", "found"]


def _quantity(kind: str) -> BeforeValidator:
    """Validator that turns "1.5 mm" into 1.5e-3, and a list of such into a tuple, for this kind."""
    return BeforeValidator(partial(_parse, kind))


def _size(kind: str) -> BeforeValidator:
    """Validator of what has a size: as `_quantity`, but no length that nothing has."""
    return BeforeValidator(partial(_parse, kind, is_size=True))


def _parse(kind: str, value: Any, *, is_size: bool = False) -> Any:
    if isinstance(value, list):
        return tuple(_parse(kind, entry, is_size=is_size) for entry in value)
    number = parse_quantity(value, kind)
    return physical_length(number, "a size") if is_size and kind == "length" else number


def kind_of_field(field: FieldInfo) -> str | None:
    """Kind of quantity that a field of a section takes, or None if it takes none."""
    for entry in field.metadata:
        if isinstance(entry, BeforeValidator) and isinstance(entry.func, partial):
            return str(entry.func.args[0])
    return None


class Declared:
    """A section whose fields are declared elsewhere: pydantic's checks without a class, which takes 2 ms to make.

    Parameters
    ----------
    fields : mapping of str to (annotation, default)
        What `pydantic.create_model` takes: of words, or of a number that a `BeforeValidator` makes.
    """

    def __init__(self, fields: Mapping[str, tuple[Any, Any]]) -> None:
        self.model_fields = {
            name: FieldInfo.from_annotated_attribute(annotation, default)
            for name, (annotation, default) in fields.items()
        }

    def checked(self, table: Mapping[str, Any]) -> dict[str, Any]:
        """What a table holds, validated; raises pydantic's ValidationError."""
        declared = {
            name: core_schema.typed_dict_field(_core(field), required=field.is_required())
            for name, field in self.model_fields.items()
        }
        schema = core_schema.typed_dict_schema(declared, extra_behavior="forbid")
        validated: dict[str, Any] = SchemaValidator(schema).validate_python(dict(table))
        return validated


def _core(field: FieldInfo) -> core_schema.CoreSchema:
    """The check of one field."""
    if get_origin(field.annotation) is Literal:
        return core_schema.literal_schema(list(get_args(field.annotation)))
    plain = core_schema.float_schema() if field.annotation is float else core_schema.any_schema()
    (validator,) = (entry for entry in field.metadata if isinstance(entry, BeforeValidator))
    return core_schema.no_info_before_validator_function(validator.func, plain)  # type: ignore[arg-type]


def schema_of(kind: type[Any]) -> Declared:
    """Schema of a section, from the dataclass it describes and what that declares of its numbers."""
    definitions: dict[str, Any] = {}
    for field in fields(kind):
        default = ... if field.default is MISSING else field.default
        if "words" in field.metadata:
            definitions[field.name] = (Literal[field.metadata["words"]], default)
        elif not field.metadata.get("inlined"):
            declared = quantity_of(field)
            validator = _size if declared.is_scale else _quantity
            definitions[field.name] = (Annotated[Any, validator(declared.kind)], default)
    return Declared(definitions)


def free_parameter_schema(kind: str) -> Declared:
    """Schema of one entry of ``[fit]``, for a parameter of this physical kind."""
    definitions: dict[str, Any] = {
        "prior": (_PRIORS, None),
        "relative_sd": (Annotated[float, _quantity("dimensionless")], None),
    }
    for name in ("min", "max", "mean", "sd", "median"):
        definitions[name] = (Annotated[float, _quantity(kind)], None)
    return Declared(definitions)


class _Section(BaseModel):
    model_config = ConfigDict(extra="forbid")

    @classmethod
    def checked(cls, table: Mapping[str, Any]) -> dict[str, Any]:
        """What a table holds, validated; raises pydantic's ValidationError."""
        return cls.model_validate(dict(table)).model_dump(exclude_unset=True)


class ThicknessSection(_Section):
    """``thickness`` of the layer."""

    thickness: Annotated[float, _size("length")] = Field(
        description="of the layer; left out, with no [substrate], for a half-space"
    )


class WidthSection(_Section):
    """Sides of the layer."""

    half_width: Annotated[float | None, _size("length")] = Field(
        default=None, description="of a sample with free sides, about the tip; without it, it has none"
    )
    shape: Literal["plug", "block"] = Field(
        default="plug", description="whether such a sample is round or square"
    )


class SolverSection(_Section):
    """``[solver]``: which law, how accurate."""

    name: str = Field(
        default="auto", description="auto, exact, asymptotic, halfspace or the name of a published correction"
    )
    rtol: Annotated[float, _quantity("dimensionless")] = Field(
        default=1e-6, description="relative error allowed in force, contact radius and stiffness"
    )
    order: int = Field(default=4, ge=0, le=4, description="order of the asymptotic law, 0 to 4")
    form: str = Field(
        default="auto", description="form of the asymptotic law: explicit, parametric, compliance or auto"
    )


def _fittable_segment(value: Any) -> Any:
    if value == "hold":
        raise ValueError(
            "a hold cannot be fitted: at one depth the force tells of time, not of depth. Allowed are "
            "'loading', 'unloading' (of an elastic sample), 'all' and 'equilibrium' (the ends of the holds of a "
            "stepwise test)"
        )
    return value


def _end_of_range(value: Any) -> str:
    """Refuse what is no end of a fit range; return it as it is written back."""
    return str(Mark.parse(value))


class CurveSection(_Section):
    """``[curve]``: which part of which file.

    ``flip`` turns the sign of the depth, the force or both; an empty list says that both are right as they are.
    ``overrule`` names what is right in the scene where the file of the curve says another number.
    """

    file: str | None = Field(
        default=None, description="the measured curve, beside the scene file: it says depth and noise"
    )
    format: str | None = Field(
        default=None, description="name of the format, where the content does not tell; see underlay formats"
    )
    test: int | None = Field(default=None, ge=1, description="which test of a file of several, from 1")
    segment: Annotated[
        Literal["all", "loading", "unloading", "equilibrium"], BeforeValidator(_fittable_segment)
    ] = Field(default="loading", description="which part is used")
    flip: list[Literal["depth", "force"]] | None = Field(
        default=None, description='whose sign is turned: ["force"]; [] says that both are right'
    )
    overrule: list[
        Literal[
            "indenter.radius",
            "instrument.compliance",
            "lever.spring_constant",
            "calibration.spring_constant",
            "calibration.sensitivity",
            "imprint",
        ]
    ] = Field(default=[], description="what is right here where the file of the curve says another number")
    preset: Literal["bioindenter"] | None = Field(
        default=None,
        description="fit range of an instrument's own software: bioindenter, 10 to 98 % of the force",
    )
    fit_from: Annotated[str | None, BeforeValidator(_end_of_range)] = Field(
        default=None,
        description='where the fit begins: "10 % of force", "5 % of depth", "0.1 radius", "2 um"',
    )
    fit_to: Annotated[str | None, BeforeValidator(_end_of_range)] = Field(
        default=None,
        description='where it ends: "98 % of force", "10 % of thickness"; depths count from contact',
    )
    columns: dict[str, str] | None = Field(
        default=None, description='of a plain table: { depth = "h (nm)", force = "-Fz (mN)" }'
    )
    calibration: dict[str, str] | None = Field(
        default=None,
        description='what an AFM file lacks, or how well it is known: { spring_constant = "0.04 N/m ± 10 %", '
        'sensitivity = "± 3 %" }',
    )
    min_depth: Annotated[float, _quantity("length")] = Field(
        default=-np.inf, description="shallowest reading that is used"
    )
    max_depth: Annotated[float, _quantity("length")] = Field(
        default=np.inf, description="deepest reading that is used"
    )


class SimulateSection(_Section):
    """``[simulate]``: depth readings of a made curve."""

    max_depth: Annotated[float, _quantity("length")] = Field(description="deepest reading")
    start: Annotated[float, _quantity("length")] = Field(default=0.0, description="first reading")
    points: int = Field(default=200, ge=2, le=10_000_000, description="number of readings")
    duration: Annotated[float, _quantity("time")] = Field(
        default=1.0, description="from first to last; a rate goes before it"
    )
    program: Literal["ramp", "triangle", "steps"] = Field(
        default="ramp", description="in; in and out; or in by equal steps"
    )
    rate: Annotated[float | None, _quantity("speed")] = Field(
        default=None, description="of every ramp, in place of the duration"
    )
    hold: Annotated[float, _quantity("time")] = Field(
        default=0.0, description="rest at the end of every way in"
    )
    steps: int = Field(default=1, ge=1, le=1000, description='how many, for program = "steps"')


def check(
    model: type[_Section] | Declared, section: str, table: Mapping[str, Any], *, besides: tuple[str, ...] = ()
) -> dict[str, Any]:
    """Validate a section; keep only the keys the file gives, so that defaults stay with their owners.

    `besides` are keys of the section that something else reads: messages name them too.
    """
    try:
        return model.checked(table)
    except ValidationError as error:
        # A key that is not known comes first: it is often the one that is missing, misspelt.
        first = min(error.errors(), key=lambda found: found["type"] != "extra_forbidden")
        key = ".".join(str(part) for part in first["loc"])
        allowed = [*model.model_fields, *besides]
        if first["type"] == "extra_forbidden":
            meant = hint(key, allowed)
            raise InputError(
                f"[{section}] has no {key!r}{meant or ';'} allowed: {', '.join(allowed)}"
            ) from error
        if first["type"] == "missing":
            raise InputError(f"[{section}] needs {key!r}") from error
        cause = first.get("ctx", {}).get("error")
        kind = type(cause) if isinstance(cause, InputError) else InputError
        raise kind(f"[{section}] {key}: {first['msg'].removeprefix('Value error, ')}") from error
