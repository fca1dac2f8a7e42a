"""Parameter paths, which name every number of a scene, and suggestions for misspelt names.

``layer.E``, ``substrate.nu``, ``indenter.radius``, ``layer.relaxation.times[0]``: the first word is a part of the
scene, the rest leads to a field of it. Fits, scene files, manifests and tables all use these; each number is
declared once (`underlay.quantities`).
"""

from __future__ import annotations

import difflib
from collections.abc import Iterable, Mapping

from underlay.errors import ParameterError
from underlay.mechanics.adhesion import Adhesion
from underlay.mechanics.body import Stack
from underlay.mechanics.indenters import Indenter
from underlay.mechanics.materials import Isotropic, TransverselyIsotropic
from underlay.mechanics.profile import Profile
from underlay.mechanics.stiffening.law import Gent
from underlay.quantities import Part, declared, kind_of
from underlay.scene.instrument import Instrument
from underlay.scene.noise import Noise

__all__ = ["DECLARING", "declared", "fields_meant", "hint", "kind_of", "unknown_parameter"]

# Fields, and names for them from papers and instruments, in lower case without spaces or underscores.
_SYNONYMS: Mapping[str, tuple[str, ...]] = {
    "E": ("modulus", "youngsmodulus", "youngmodulus", "young", "elasticmodulus", "emodulus"),
    "nu": ("poisson", "poissonratio", "poissonsratio", "v"),
    "G_axial": ("shearmodulus",),
    "thickness": ("h", "height", "t"),
    "radius": ("r", "tipradius", "diameter"),
    "half_angle": ("angle", "openingangle"),
    "compliance": ("springconstant", "cantileverstiffness", "framestiffness", "framecompliance"),
    "contact_depth": ("contactpoint", "zero"),
    "baseline": ("offset", "forceoffset"),
    "baseline_slope": ("tilt",),
    "shape": ("type", "geometry"),
    "min": ("lower", "low"),
    "max": ("upper", "high"),
    "sd": ("std", "sigma"),
    "force": ("sigma", "rms", "white"),
    "rtol": ("tolerance", "accuracy"),
    "method": ("law",),
}
# How the number has to be converted for that name, in words.
_CHANGES = {
    "diameter": "half of it",
    "openingangle": "half of it, from the axis",
    "springconstant": "its inverse",
    "cantileverstiffness": "its inverse",
    "framestiffness": "its inverse",
}


def fields_meant(name: str, allowed: Iterable[str]) -> tuple[str, ...]:
    """Names in `allowed` that a mistaken `name` may stand for, best first; empty if it resembles none."""
    fields = tuple(allowed)
    word = _plain(name)
    same = tuple(field for field in fields if _plain(field) == word)
    known = tuple(field for field, names in _SYNONYMS.items() if word in names and field in fields)
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
    change = _CHANGES.get(_plain(name), "")
    return f"; did you mean {meant[0]}{f' ({change})' if change else ''}?"


def _plain(name: str) -> str:
    return "".join(letter for letter in name.casefold() if letter.isalnum())


#: Classes that declare the numbers of a test. The declaration of a path is known once its class is loaded, which
#: importing this module ensures.
DECLARING: tuple[type[Part], ...] = (
    Indenter,
    Profile,
    Isotropic,
    TransverselyIsotropic,
    Stack,
    Adhesion,
    Gent,
    Instrument,
    Noise,
)


def unknown_parameter(path: str, known: Iterable[str]) -> ParameterError:
    """Build the error for a path that a scene does not have, with the nearest valid one."""
    names = sorted(known)
    part, _, field = path.rpartition(".")
    own = {name.rpartition(".")[2]: name for name in names if name.rpartition(".")[0] == part}
    near = [own[meant] for meant in fields_meant(field, own)]
    near = near or difflib.get_close_matches(path, names, n=1, cutoff=0.4)
    hint = f"; did you mean {near[0]!r}?" if near else "."
    return ParameterError(f"this scene has no parameter {path!r}{hint} It has: {', '.join(names)}")
