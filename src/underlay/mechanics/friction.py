"""What is known of friction under the tip."""

from __future__ import annotations

from underlay.errors import InputError

__all__ = ["FRICTIONS", "as_friction"]

#: ``"none"``: points slide freely. ``"stuck"``: they stick where they touch. ``"unknown"``: computed without, and
#: what friction could do is said beside a fit. What real friction does lies between the two.
FRICTIONS = ("unknown", "none", "stuck")


def as_friction(given: object) -> str:
    """Return what is said of friction as it is.

    Raises
    ------
    InputError
        If it is none of `FRICTIONS`.
    """
    if isinstance(given, str) and given in FRICTIONS:
        return given
    raise InputError(
        f"friction is one of {', '.join(FRICTIONS)}; got {given!r:.60}. A given coefficient lies between "
        '"none" and "stuck": compute both'
    )
