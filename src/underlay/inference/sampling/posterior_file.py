"""What the file of a posterior must hold: every entry checked for kind and shape before anything is built.

The file may come from anybody and is shown to people: a number in the place of a name, or a chain of other
parameters than those it lists, must not get further than this.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import MISSING, fields
from typing import Any

import numpy as np

from underlay._arrays import FloatArray
from underlay.inference.ridge.importance import Importance
from underlay.inference.sampling.diagnostics import SamplingDiagnostics
from underlay.inference.sampling.predictive import PREDICTIVE_LEVELS, Predictive

__all__ = ["parts_of"]


def parts_of(about: Mapping[str, Any], arrays: Mapping[str, np.ndarray[Any, Any]]) -> dict[str, Any]:
    """Keywords of a `Posterior`, but for its problem.

    Parameters
    ----------
    about : mapping
        The document of the file.
    arrays : mapping of name to ndarray
        Its arrays.

    Raises
    ------
    KeyError
        If something is missing.
    ValueError
        If something is of another kind or shape.
    """
    names = _texts(about["names"], "names")
    _require(names and len(set(names)) == len(names), "names", "distinct names, one at least")
    chain = _floats(arrays, "chain", (None, None, len(names)))
    _require(chain.size and np.isfinite(chain).all(), "chain", "finite draws, one at least")
    return {
        "names": names,
        "chain": chain,
        "log_posterior": _floats(arrays, "log_posterior", chain.shape[:2]),
        "priors": _texts(about["priors"], "priors", len(names)),
        "prior_quantiles": _floats(arrays, "prior_quantiles", (None, len(names))),
        "derived": {name: _draws(arrays, f"derived/{name}") for name in _texts(about["derived"], "derived")},
        "predictive": tuple(_band(arrays, number) for number in range(_count(about["curves"], "curves"))),
        "diagnostics": _diagnostics(about["diagnostics"]),
        "truth": _numbers_by_name(about["truth"], "truth"),
    }


def _draws(arrays: Mapping[str, np.ndarray[Any, Any]], name: str) -> FloatArray:
    values = _floats(arrays, name, (None, None))
    _require(values.size and np.isfinite(values).all(), name, "finite draws, one at least")
    return values


def _band(arrays: Mapping[str, np.ndarray[Any, Any]], number: int) -> Predictive:
    depth = _floats(arrays, f"predictive/{number}/depth", (None,))
    shapes = {
        "force": depth.shape,
        "model": (len(PREDICTIVE_LEVELS), len(depth)),
        "reading": (len(PREDICTIVE_LEVELS), len(depth)),
    }
    rest = {name: _floats(arrays, f"predictive/{number}/{name}", shape) for name, shape in shapes.items()}
    return Predictive(depth, **rest)


def _diagnostics(entry: Any) -> SamplingDiagnostics:
    """Each entry as its field is declared."""
    return SamplingDiagnostics(**_as_declared(SamplingDiagnostics, entry, "diagnostics"))


def _as_declared(kind: type[SamplingDiagnostics | Importance], entry: Any, name: str) -> dict[str, Any]:
    """Keywords of a record: every entry checked by its field's declaration; one with a default may be missing."""
    table = _table(entry, name)
    return {
        field.name: _AS_DECLARED[str(field.type)](table[field.name], field.name)
        for field in fields(kind)
        if field.name in table or (field.default is MISSING and field.default_factory is MISSING)
    }


def _importance(value: Any, name: str) -> Importance | None:
    return None if value is None else Importance(**_as_declared(Importance, value, name))


def _require(condition: object, name: str, wanted: str) -> None:
    if not condition:
        raise ValueError(f"{name} must be {wanted}")


def _floats(
    arrays: Mapping[str, np.ndarray[Any, Any]], name: str, shape: tuple[int | None, ...]
) -> FloatArray:
    """An array of numbers; None in `shape` stands for any length."""
    array = arrays[name]
    fits = array.ndim == len(shape) and all(
        wanted in (None, found) for wanted, found in zip(shape, array.shape, strict=True)
    )
    _require(array.dtype.kind == "f" and fits, name, f"numbers of shape {shape}")
    return array.astype(np.float64, copy=False)


def _table(value: Any, name: str) -> dict[str, Any]:
    _require(isinstance(value, dict), name, "a table")
    table: dict[str, Any] = value
    return table


def _texts(values: Any, name: str, count: int | None = None) -> tuple[str, ...]:
    are_texts = isinstance(values, list) and all(isinstance(value, str) for value in values)
    _require(are_texts and count in (None, len(values)), name, "a list of texts")
    return tuple(values)


def _text(value: Any, name: str) -> str:
    return _texts([value], name)[0]


def _texts_by_name(value: Any, name: str) -> dict[str, str]:
    return {key: _text(entry, name) for key, entry in _table(value, name).items()}


def _numbers_by_name(value: Any, name: str) -> dict[str, float]:
    return {key: _number(entry, name) for key, entry in _table(value, name).items()}


def _pairs_by_name(value: Any, name: str) -> dict[str, tuple[float, float]]:
    pairs = {key: _numbers(entry, name) for key, entry in _table(value, name).items()}
    _require(all(len(pair) == 2 for pair in pairs.values()), name, "pairs of numbers")
    return {key: (low, high) for key, (low, high) in pairs.items()}


def _tuples_by_name(value: Any, name: str) -> dict[str, tuple[float, ...]]:
    return {key: _numbers(entry, name) for key, entry in _table(value, name).items()}


def _numbers(values: Any, name: str) -> tuple[float, ...]:
    _require(isinstance(values, list), name, "a list of numbers")
    return tuple(_number(value, name) for value in values)


def _number(value: Any, name: str) -> float:
    _require(isinstance(value, int | float) and not isinstance(value, bool), name, "a number")
    return float(value)


def _count(value: Any, name: str) -> int:
    _require(type(value) is int and value >= 0, name, "a whole number")
    return int(value)


def _count_or_none(value: Any, name: str) -> int | None:
    return None if value is None else _count(value, name)


def _truth_value(value: Any, name: str) -> bool:
    _require(isinstance(value, bool), name, "true or false")
    return bool(value)


# How an entry of the diagnostics is checked, by the declaration of its field.
_AS_DECLARED: Mapping[str, Callable[[Any, str], Any]] = {
    "bool": _truth_value,
    "str": _text,
    "int": _count,
    "int | None": _count_or_none,
    "float": _number,
    "tuple[float, ...]": _numbers,
    "Mapping[str, tuple[float, float]]": _pairs_by_name,
    "Mapping[str, str]": _texts_by_name,
    "Mapping[str, float]": _numbers_by_name,
    "Mapping[str, tuple[float, ...]]": _tuples_by_name,
    "Importance | None": _importance,
}
