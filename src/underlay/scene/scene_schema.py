"""What each section of a scene file may hold: pydantic models, made from the dataclasses they describe."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import MISSING, fields
from typing import Annotated, Any, Literal

import numpy as np
from pydantic import BaseModel, BeforeValidator, ConfigDict, Field, ValidationError, create_model

from underlay.errors import InputError
from underlay.quantities import quantity_of
from underlay.units import parse_quantity

__all__ = [
    "CurveSection",
    "NoiseSection",
    "SimulateSection",
    "SolverSection",
    "check",
    "free_parameter_schema",
    "schema_of",
]

_PRIORS = Literal["uniform", "loguniform", "normal", "lognormal", "halfnormal", "found"]


def _quantity(kind: str) -> BeforeValidator:
    """Validator that turns "1.5 mm" into 1.5e-3, and a list of such into a tuple, for this kind."""

    def parse(value: Any) -> Any:
        if isinstance(value, list):
            return tuple(parse_quantity(entry, kind) for entry in value)
        return parse_quantity(value, kind)

    return BeforeValidator(parse)


def schema_of(kind: type[Any]) -> type[BaseModel]:
    """Pydantic model of a section, from the dataclass it describes and what that declares of its numbers."""
    definitions: dict[str, Any] = {}
    for field in fields(kind):
        if not field.metadata.get("inlined"):
            default = ... if field.default is MISSING else field.default
            definitions[field.name] = (Annotated[Any, _quantity(quantity_of(field).kind)], default)
    return create_model(kind.__name__, __config__=ConfigDict(extra="forbid"), **definitions)


def free_parameter_schema(kind: str) -> type[BaseModel]:
    """Pydantic model of one entry of ``[fit]``, for a parameter of this physical kind."""
    definitions: dict[str, Any] = {
        "prior": (_PRIORS, None),
        "relative_sd": (Annotated[float, _quantity("dimensionless")], None),
    }
    for name in ("min", "max", "mean", "sd", "median"):
        definitions[name] = (Annotated[float, _quantity(kind)], None)
    return create_model("free parameter", __config__=ConfigDict(extra="forbid"), **definitions)


class _Section(BaseModel):
    model_config = ConfigDict(extra="forbid")


class SolverSection(_Section):
    """``[solver]``: which law, how accurate."""

    method: str = "auto"
    rtol: Annotated[float, _quantity("dimensionless")] = 1e-6
    order: int = Field(default=4, ge=0, le=4)
    form: str = "auto"


class NoiseSection(_Section):
    """``[noise]``: what is known of the noise, or is to be made."""

    force: Annotated[float, _quantity("force")] = 0.0
    relative: Annotated[float, _quantity("dimensionless")] = 0.0
    correlation_time: Annotated[float, _quantity("time")] = 0.0
    depth: Annotated[float, _quantity("length")] = 0.0


def _fittable_segment(value: Any) -> Any:
    if value == "hold":
        raise ValueError(
            "a hold cannot be fitted: at one depth the force tells of time, not of depth. Allowed are "
            "'loading', 'unloading' (of an elastic sample), 'all' and 'equilibrium' (the ends of the holds of a "
            "stepwise test)"
        )
    return value


class CurveSection(_Section):
    """``[curve]``: which part of which file.

    ``flip`` turns the sign of the depth, the force or both; an empty list says that both are right as they are.
    ``overrule`` names what is right in the scene where the file of the curve says another number.
    """

    format: str | None = None
    test: int | None = Field(default=None, ge=1)
    segment: Annotated[
        Literal["all", "loading", "unloading", "equilibrium"], BeforeValidator(_fittable_segment)
    ] = "loading"
    flip: list[Literal["depth", "force"]] | None = None
    overrule: list[
        Literal[
            "indenter.radius",
            "instrument.compliance",
            "calibration.spring_constant",
            "calibration.sensitivity",
        ]
    ] = []
    columns: dict[str, str] | None = None
    calibration: dict[str, str] | None = None
    min_depth: Annotated[float, _quantity("length")] = -np.inf
    max_depth: Annotated[float, _quantity("length")] = np.inf


class SimulateSection(_Section):
    """``[simulate]``: depth readings of a made curve."""

    max_depth: Annotated[float, _quantity("length")]
    start: Annotated[float, _quantity("length")] = 0.0
    points: int = Field(default=200, ge=2, le=10_000_000)
    duration: Annotated[float, _quantity("time")] = 1.0


def check(model: type[BaseModel], section: str, table: Mapping[str, Any]) -> dict[str, Any]:
    """Validate a section; keep only the keys the file gives, so that defaults stay with their owners."""
    try:
        return model.model_validate(dict(table)).model_dump(exclude_unset=True)
    except ValidationError as error:
        first = error.errors()[0]
        key = ".".join(str(part) for part in first["loc"])
        allowed = ", ".join(model.model_fields)
        if first["type"] == "extra_forbidden":
            raise InputError(f"[{section}] has no {key!r}; allowed: {allowed}") from error
        if first["type"] == "missing":
            raise InputError(f"[{section}] needs {key!r}") from error
        cause = first.get("ctx", {}).get("error")
        kind = type(cause) if isinstance(cause, InputError) else InputError
        raise kind(f"[{section}] {key}: {first['msg'].removeprefix('Value error, ')}") from error
