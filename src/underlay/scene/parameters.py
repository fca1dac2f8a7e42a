"""Parameter paths: one name for every number of a scene.

``layer.E``, ``substrate.nu``, ``indenter.radius``, ``layer.relaxation.times[0]``: the first word is a part of the
scene, the rest leads to a field of it. Fits, scene files, manifests and tables all use these; what is behind each
of them is declared once (`underlay.quantities`).
"""

from __future__ import annotations

import difflib
from collections.abc import Iterable

from underlay.errors import ParameterError
from underlay.mechanics.adhesion import Adhesion
from underlay.mechanics.indenters import Indenter
from underlay.mechanics.materials import Isotropic, TransverselyIsotropic
from underlay.mechanics.profile import Profile
from underlay.mechanics.stack import Stack
from underlay.quantities import Part, declared, kind_of
from underlay.scene.field_names import fields_meant
from underlay.scene.instrument import Instrument
from underlay.scene.noise import Noise

__all__ = ["DECLARING", "declared", "kind_of", "unknown_parameter"]

#: Parts that declare the numbers of a test. A path is understood where these are loaded, so whoever asks what one
#: is asks here.
DECLARING: tuple[type[Part], ...] = (
    Indenter,
    Profile,
    Isotropic,
    TransverselyIsotropic,
    Stack,
    Adhesion,
    Instrument,
    Noise,
)


def unknown_parameter(path: str, known: Iterable[str]) -> ParameterError:
    """Build the error for a path that does not exist: names the nearest valid one."""
    names = sorted(known)
    part, _, field = path.rpartition(".")
    own = {name.rpartition(".")[2]: name for name in names if name.rpartition(".")[0] == part}
    near = [own[meant] for meant in fields_meant(field, own)]
    near = near or difflib.get_close_matches(path, names, n=1, cutoff=0.4)
    hint = f"; did you mean {near[0]!r}?" if near else "."
    return ParameterError(f"this scene has no parameter {path!r}{hint} It has: {', '.join(names)}")
