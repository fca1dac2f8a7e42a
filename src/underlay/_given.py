"""Checks of a caller's arguments, with messages that say what is wanted and how to get it."""

from __future__ import annotations

import math
from collections.abc import Collection, Mapping
from numbers import Integral, Real

from underlay.errors import InputError

_MADE_BY = {
    "Curve": "ul.read(file) reads one, ul.Curve(depth, force) makes one",
    "Fit": "ul.fit(problem) makes one",
    "NoiseModel": "ul.Noise(force=2e-6) makes one, of 2 uN",
    "Posterior": "ul.sample(problem) makes one",
    "Problem": "ul.Problem(scene, curve, free) or ul.load_problem(curve_file, scene_file) makes one",
    "Scene": "ul.Scene(indenter, layer, substrate) makes one, ul.load_scene(file) reads one",
}
_LONGEST = 80
# Beyond this level the tails of draws and profiles are not known.
_HIGHEST_LEVEL = 0.999


def require_given(value: object, name: str, *kinds: type) -> None:
    """Raise InputError for an argument that is an instance of none of the `kinds`.

    Raises
    ------
    InputError
        With what was given, what is wanted, and how to get one.
    """
    if isinstance(value, kinds):
        return
    wanted = " or ".join(f"a {kind.__name__}" for kind in kinds)
    hints = "; ".join(_MADE_BY[kind.__name__] for kind in kinds if kind.__name__ in _MADE_BY)
    given = f"{type(value).__name__} {value!r:.{_LONGEST}}" if value is not None else "None"
    raise InputError(f"{name} must be {wanted}; got {given}{': ' if hints else ''}{hints}")


def require_level(level: object) -> None:
    """Raise InputError unless `level` is a confidence level above 0 and at most 0.999.

    Raises
    ------
    InputError
        With what was given and what is allowed.
    """
    if not (isinstance(level, Real) and 0.0 < float(level) <= _HIGHEST_LEVEL):
        raise InputError(f"level must be above 0 and at most {_HIGHEST_LEVEL}; got {level!r:.{_LONGEST}}")


def require_count(count: object, name: str, least: int) -> None:
    """Raise InputError unless `count` is a whole number of at least `least`.

    Raises
    ------
    InputError
        With what was given and what is allowed.
    """
    if isinstance(count, bool) or not (isinstance(count, Integral) and int(count) >= least):
        raise InputError(f"{name} must be a whole number, {least} or more; got {count!r:.{_LONGEST}}")


def require_share(share: object, name: str, *, what: str, zero: bool = False, one: bool = False) -> None:
    """Raise InputError unless `share` is a number between 0 and 1; `zero` and `one` allow the ends.

    Raises
    ------
    InputError
        With what was given and what is allowed; `name` and `what` are for the message.
    """
    number = float(share) if isinstance(share, Real) else math.nan
    if (number > 0.0 or (zero and number == 0.0)) and (number < 1.0 or (one and number == 1.0)):
        return
    allowed = f"{'0 or more' if zero else 'above 0'} and {'at most' if one else 'below'} 1"
    raise InputError(f"{name} is {what}, {allowed}; got {share!r:.{_LONGEST}}")


def columns_given(columns: object, name: str, example: str) -> tuple[str, ...]:
    """Return names of columns as a tuple, given as a list or as a single name.

    Raises
    ------
    InputError
        If they are not different names.
    """
    given = (columns,) if isinstance(columns, str) else columns
    if isinstance(given, Collection) and not isinstance(given, Mapping):
        names = [column for column in given if isinstance(column, str) and column]
        if len(set(names)) == len(given):
            return tuple(names)
    raise InputError(
        f"{name} must be different names of columns, such as {example}; got {columns!r:.{_LONGEST}}"
    )
