"""The corrections there are, and the one that fits a name and a test."""

from __future__ import annotations

from difflib import get_close_matches

from underlay.errors import InputError
from underlay.mechanics.indenters import Indenter
from underlay.mechanics.published import (
    clifford2009,
    dimitriadis2002,
    doss2019,
    gao1992,
    garcia2018,
    gavara2012,
    hay2011,
    hayes1972,
    hermanowicz2021,
    long2011,
    managuli2018,
)
from underlay.mechanics.published.correction import PublishedCorrection
from underlay.mechanics.published.layer_contact import KINDS, kind_of

__all__ = ["fitting_correction", "published_corrections", "published_names"]

_CORRECTIONS = (
    dimitriadis2002.BONDED,
    dimitriadis2002.UNBONDED,
    garcia2018.SPHERE,
    garcia2018.CONE,
    garcia2018.PUNCH,
    gavara2012.CONE,
    managuli2018.CONE,
    long2011.SPHERE,
    hermanowicz2021.SPHERE,
    hayes1972.PUNCH,
    clifford2009.SPHERE,
    doss2019.SPHERE,
    gao1992.PUNCH,
    hay2011.PUNCH,
)
_NAMES = tuple(dict.fromkeys(correction.name for correction in _CORRECTIONS))


def published_corrections() -> tuple[PublishedCorrection, ...]:
    """Every published correction the library knows, with its source, range and assumptions.

    Examples
    --------
    >>> [c.indenter for c in published_corrections() if c.name == "garcia2018"]
    ['sphere', 'cone', 'flat punch']
    """
    return _CORRECTIONS


def published_names() -> tuple[str, ...]:
    """List the names of the corrections, each once."""
    return _NAMES


def fitting_correction(name: str | PublishedCorrection, indenter: Indenter) -> PublishedCorrection:
    """Find the correction called `name` for this kind of indenter, or check one that was handed in.

    Raises
    ------
    InputError
        If there is no such name, or it holds for other indenters.
    """
    known = (name,) if isinstance(name, PublishedCorrection) else _CORRECTIONS
    name = name.name if isinstance(name, PublishedCorrection) else name
    named = {c.indenter: c for c in known if c.name == name}
    if not named:
        near = get_close_matches(name, published_names(), n=1)
        hint = f" Did you mean {near[0]!r}?" if near else ""
        raise InputError(
            f"no published correction is called {name!r}.{hint} Known: {', '.join(published_names())}"
        )
    kind = kind_of(indenter)
    if kind not in named:
        shapes = " or ".join(shape.__name__ for needed in named for shape in KINDS[needed])
        raise InputError(
            f"{name} needs a {' or a '.join(named)} ({shapes}); got {indenter!r}. "
            'the solver "exact" takes every shape'
        )
    return named[kind]
