"""The known errors of a scene's law: every kind there is, asked in turn."""

from __future__ import annotations

from collections.abc import Callable, Sequence

from underlay.inference.misfit.known_error import KnownError
from underlay.inference.misfit.paraboloid_for_sphere import paraboloid_for_sphere
from underlay.scene.scene import Scene

__all__ = ["KINDS", "known_errors"]

#: Say of a scene which error its law has, or that it has none of this kind.
KINDS: Sequence[Callable[[Scene], KnownError | None]] = (paraboloid_for_sphere,)


def known_errors(scenes: Sequence[Scene]) -> tuple[KnownError, ...]:
    """Return the errors that the laws of these scenes have, each once."""
    found: dict[str, KnownError] = {}
    for scene in scenes:
        for kind in KINDS:
            error = kind(scene)
            if error is not None:
                found.setdefault(error.words, error)
    return tuple(found.values())
