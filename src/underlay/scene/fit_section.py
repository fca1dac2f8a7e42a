"""The [fit] section of a scene file: what is fitted, and what is known of it before."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from underlay.errors import InputError, ParameterError
from underlay.quantities import field_quantities
from underlay.scene.field_names import fields_meant
from underlay.scene.noise_model import NoiseModel
from underlay.scene.parameters import kind_of, unknown_parameter
from underlay.scene.scene import Scene
from underlay.scene.scene_schema import check, free_parameter_schema

__all__ = ["FreeParameter", "free_parameters"]


@dataclass(frozen=True)
class FreeParameter:
    """What a scene file says of one fitted parameter; numbers in SI.

    Parameters
    ----------
    path : str
        E.g. ``"layer.E"``.
    prior : str or None
        ``"uniform"``, ``"loguniform"``, ``"normal"``, ``"lognormal"``, ``"halfnormal"``, or None when only
        bounds are given.
    low, high : float
        Bounds; infinite where the file gives none.
    numbers : mapping
        What the prior needs besides: mean, sd, median, relative_sd.
    """

    path: str
    prior: str | None
    low: float
    high: float
    numbers: Mapping[str, float]


def free_parameters(table: Mapping[str, Any], scene: Scene, noise: NoiseModel) -> list[FreeParameter]:
    """Read the ``[fit]`` section of a scene file: what of the scene and its noise is fitted.

    Raises
    ------
    InputError
        If a path is not one of the scene or its noise, or what is said of it is not allowed.
    """
    known = [*scene.parameters, *(f"noise.{name}" for name in field_quantities(type(noise)))]
    free = []
    for path, entry in _flatten(table, known):
        if path not in known:
            raise unknown_parameter(path, known)
        numbers = check(free_parameter_schema(kind_of(path)), f"fit] [{path}", entry)
        low, high = numbers.pop("min", -np.inf), numbers.pop("max", np.inf)
        if not low < high:
            raise InputError(f"[fit] {path}: min must be below max")
        free.append(FreeParameter(path, numbers.pop("prior", None), low, high, numbers))
    return free


def _flatten(table: Mapping[str, Any], known: Sequence[str]) -> list[tuple[str, Mapping[str, Any]]]:
    """Turn ``layer.E = {...}`` (a nested table) and ``"layer.E" = {...}`` into (path, entry) pairs."""
    pairs: list[tuple[str, Mapping[str, Any]]] = []
    for name, entry in table.items():
        if not isinstance(entry, Mapping):
            raise InputError(f"[fit] {name}: write {name} = {{ min = ..., max = ... }}")
        is_part = any(path.startswith(f"{name}.") for path in known) or (
            bool(entry) and all(isinstance(inner, Mapping) for inner in entry.values())
        )
        if "." not in name and not is_part:
            raise _without_part(name, known)
        if "." in name:
            pairs.append((name, entry))
            continue
        for field, inner in entry.items():
            if not isinstance(inner, Mapping):
                raise InputError(f"[fit] {name}.{field}: write {name}.{field} = {{ min = ..., max = ... }}")
            pairs.append((f"{name}.{field}", inner))
    return pairs


def _without_part(name: str, known: Sequence[str]) -> ParameterError:
    """Build the error for a name that does not say of which part of the scene it is."""
    fields = {path.rpartition(".")[2] for path in known}
    meant = fields_meant(name, sorted(fields))
    paths = [path for path in known if meant and path.rpartition(".")[2] == meant[0]]
    if not paths:
        return unknown_parameter(name, known)
    written = " or ".join(f"{path} = {{ min = ..., max = ... }}" for path in paths)
    return ParameterError(f"[fit] {name}: say of which part of the scene; write {written}")
