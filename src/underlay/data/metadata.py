"""An immutable mapping for what is known about a curve: where it came from and what was done to it."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from typing import Any, final

import numpy as np

from underlay.errors import InputError

__all__ = ["Metadata"]


@final
class Metadata(Mapping[str, Any]):
    """A read-only mapping of names to plain values.

    Values are text, numbers, booleans, None, tuples of these and further `Metadata`; lists become tuples
    and mappings become `Metadata`. It can be pickled (curves travel to worker processes) and written as
    JSON through `to_dict`.

    Parameters
    ----------
    values : mapping, optional
        What to hold.

    Raises
    ------
    InputError
        If a value is not plain.

    Examples
    --------
    >>> Metadata({"reader": "csv"}).updated(test=2)
    Metadata({'reader': 'csv', 'test': 2})
    """

    __slots__ = ("_values",)

    def __init__(self, values: Mapping[str, Any] | None = None) -> None:
        self._values = {str(key): _plain(str(key), value) for key, value in (values or {}).items()}

    def __getitem__(self, key: str) -> Any:
        return self._values[key]

    def __iter__(self) -> Iterator[str]:
        return iter(self._values)

    def __len__(self) -> int:
        return len(self._values)

    def __repr__(self) -> str:
        return f"Metadata({self.to_dict()!r})"

    def updated(self, /, **values: Any) -> Metadata:
        """Return a copy with some entries added or replaced."""
        added = Metadata(values)
        added._values = {**self._values, **added._values}  # what is held here is plain already
        return added

    def to_dict(self) -> dict[str, Any]:
        """Return nested plain dictionaries and lists, ready for JSON."""
        return {key: _thaw(value) for key, value in self._values.items()}


# `isinstance` takes a tuple of types twice as fast as their union, and every value of every curve comes here.
_AS_THEY_ARE = (str, bool, int, float, Metadata)


def _plain(key: str, value: Any) -> Any:
    if value is None or isinstance(value, _AS_THEY_ARE):
        return value
    if isinstance(value, np.generic):
        return _plain(key, value.item())
    if isinstance(value, Mapping):
        return Metadata(value)
    if isinstance(value, np.ndarray):
        return _plain(key, value.tolist())
    if isinstance(value, Sequence) and not isinstance(value, bytes | bytearray):
        return tuple(_plain(key, item) for item in value)
    raise InputError(
        f"metadata {key!r} must be text, a number or a tuple or mapping of these; got {value!r:.80}"
    )


def _thaw(value: Any) -> Any:
    if isinstance(value, Metadata):
        return value.to_dict()
    if isinstance(value, tuple):
        return [_thaw(item) for item in value]
    return value
