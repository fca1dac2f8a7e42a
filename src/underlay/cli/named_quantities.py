"""Options that are given as NAME=VALUE, any number of times: ``--noise force="2 uN" --noise relative=0.5%``."""

from __future__ import annotations

import difflib
from collections.abc import Iterable, Mapping

from underlay.errors import InputError, UnitError

__all__ = ["named_quantities"]


def named_quantities(option: str, given: Iterable[str], kinds: Mapping[str, str]) -> dict[str, float]:
    """Read the values of an option that may be repeated.

    Parameters
    ----------
    option : str
        As it is spelled, e.g. ``"--noise"``.
    given : iterable of str
        What was written, each ``NAME=VALUE``.
    kinds : mapping of str to str
        Kind of quantity of each name there is.

    Returns
    -------
    dict of str to float
        Values (SI) by name, in the order given.

    Raises
    ------
    InputError
        If one is not written so, its name is unknown, or it is given twice.
    UnitError
        If a unit is missing, unknown or of another kind.
    """
    from underlay.units import KINDS, parse_quantity

    found: dict[str, float] = {}
    for text in given:
        written, equals, value = text.partition("=")
        name = written.strip().replace("-", "_")
        if name not in kinds:
            near = difflib.get_close_matches(name, kinds, n=1)
            hint = f"; did you mean {near[0]}?" if near else "."
            raise InputError(f"{option} has no {written.strip()!r}{hint} There are {', '.join(kinds)}")
        if not equals or not value.strip():
            example = KINDS[kinds[name]].example
            raise InputError(f"{option} {name} needs a value, e.g. {option} {name}={_quoted(example)}")
        if name in found:
            raise InputError(f"{option} {name} is given twice; give it once")
        try:
            found[name] = parse_quantity(value.strip(), kinds[name])
        except UnitError as error:
            raise UnitError(f"{option} {name}: {error}") from error
    return found


def _quoted(example: str) -> str:
    return f'"{example}"' if " " in example else example
