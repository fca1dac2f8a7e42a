"""Parameter paths, which name every number of a scene, and suggestions for misspelt names.

``layer.E``, ``substrate.nu``, ``indenter.radius``, ``layer.relaxation.times[0]``: the first word is a part of the
scene, the rest leads to a field of it. Fits, scene files, manifests and tables all use these; each number is
declared once (`underlay.quantities`).
"""

from __future__ import annotations

import difflib
from collections.abc import Iterable
from importlib.resources import files

from underlay._door import parse_toml
from underlay.errors import ParameterError
from underlay.mechanics.adhesion import Adhesion
from underlay.mechanics.body import Stack
from underlay.mechanics.indenters import Indenter
from underlay.mechanics.materials import Isotropic, TransverselyIsotropic
from underlay.mechanics.profile import Profile
from underlay.mechanics.stiffening.law import Gent
from underlay.quantities import declared, kind_of
from underlay.scene.instrument import Instrument
from underlay.scene.noise import Noise

__all__ = ["DECLARING", "declared", "fields_meant", "hint", "kind_of", "unknown_parameter"]

_SYNONYMS = parse_toml((files("underlay.scene") / "synonyms.toml").read_text(encoding="utf-8"))


def fields_meant(name: str, allowed: Iterable[str]) -> tuple[str, ...]:
    """Names in `allowed` that a mistaken `name` may stand for, best first; empty if it resembles none."""
    fields = tuple(allowed)
    word = _plain(name)
    same = tuple(field for field in fields if _plain(field) == word)
    known = tuple(field for field, names in _SYNONYMS["names"].items() if word in names and field in fields)
    by_word = {_plain(field): field for field in fields}
    near = difflib.get_close_matches(word, by_word, n=1)
    return same or known or tuple(by_word[match] for match in near)


def hint(name: str, allowed: Iterable[str]) -> str:
    """Return the clause of an error message that suggests the right name for `name`, or the empty string.

    Examples
    --------
    >>> hint("thicknes", ["E", "nu", "thickness"])
    '; did you mean thickness?'
    >>> hint("spring constant", ["baseline", "compliance"])
    '; did you mean compliance (its inverse)?'
    """
    meant = fields_meant(name, allowed)
    if not meant:
        return ""
    change = _SYNONYMS["changes"].get(_plain(name), "")
    return f"; did you mean {meant[0]}{f' ({change})' if change else ''}?"


def _plain(name: str) -> str:
    return "".join(letter for letter in name.casefold() if letter.isalnum())


#: Classes that declare the numbers of a test. The declaration of a path is known once its class is loaded, which
#: importing this module ensures.
DECLARING = (Indenter, Profile, Isotropic, TransverselyIsotropic, Stack, Adhesion, Gent, Instrument, Noise)


def unknown_parameter(path: str, known: Iterable[str]) -> ParameterError:
    """Build the error for a path that a scene does not have, with the nearest valid one."""
    names = sorted(known)
    part, _, field = path.rpartition(".")
    own = {name.rpartition(".")[2]: name for name in names if name.rpartition(".")[0] == part}
    near = [own[meant] for meant in fields_meant(field, own)]
    near = near or difflib.get_close_matches(path, names, n=1, cutoff=0.4)
    hint = f"; did you mean {near[0]!r}?" if near else "."
    return ParameterError(f"this scene has no parameter {path!r}{hint} It has: {', '.join(names)}")
