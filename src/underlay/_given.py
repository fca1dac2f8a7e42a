"""What a caller hands in where an object of ours is wanted: checked at the door, with the way to make one."""

from __future__ import annotations

from numbers import Real

from underlay.errors import InputError

__all__ = ["require_given", "require_level"]

_MADE_BY = {
    "Curve": "ul.read(file) reads one, ul.Curve(depth, force) makes one",
    "Fit": "ul.fit(problem) makes one",
    "Posterior": "ul.sample(problem) makes one",
    "Problem": "ul.Problem(scene, curve, free) or ul.load_problem(curve_file, scene_file) makes one",
    "Scene": "ul.Scene(indenter, layer, substrate) makes one, ul.load_scene(file) reads one",
}
_LONGEST = 80
# Beyond it the tail of what was drawn or walked is not known.
_HIGHEST_LEVEL = 0.999


def require_given(value: object, name: str, *kinds: type) -> None:
    """Refuse an argument that is of none of the `kinds`.

    Raises
    ------
    InputError
        With what was given, what is wanted, and how to get one.
    """
    if isinstance(value, kinds):
        return
    wanted = " or ".join(f"a {kind.__name__}" for kind in kinds)
    ways = "; ".join(_MADE_BY[kind.__name__] for kind in kinds if kind.__name__ in _MADE_BY)
    given = f"{type(value).__name__} {value!r:.{_LONGEST}}" if value is not None else "None"
    raise InputError(f"{name} must be {wanted}; got {given}{': ' if ways else ''}{ways}")


def require_level(level: object) -> None:
    """Refuse a confidence level that is none.

    Raises
    ------
    InputError
        With what was given and what is allowed.
    """
    if not (isinstance(level, Real) and 0.0 < float(level) <= _HIGHEST_LEVEL):
        raise InputError(f"level must be above 0 and at most {_HIGHEST_LEVEL}; got {level!r:.{_LONGEST}}")
