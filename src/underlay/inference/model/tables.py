"""What of a body varies, where that is one ratio alone: laws are then read off tables (`curve_family`)."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import TypeVar

import numpy as np

from underlay._arrays import FloatArray
from underlay.inference.model.similarity import Similarity
from underlay.mechanics.contact import IsotropicLayer
from underlay.mechanics.exact.curve_family import IsotropicPair, RigidBase
from underlay.mechanics.kernel import Family, Kernel
from underlay.scene.instrument import Instrument
from underlay.scene.scene import Scene

__all__ = ["OneRatio", "one_ratio", "tip_ratio"]

Number = TypeVar("Number", float, FloatArray)


@dataclass(frozen=True)
class OneRatio:
    """One ratio, and the bodies that differ in it.

    Parameters
    ----------
    family : Family or None
        The bodies; None where there is one alone.
    path, over : str
        The number and that which it is divided by.
    """

    family: Family | None
    path: str = ""
    over: str = ""

    def of(self, values: Mapping[str, Number]) -> Number | float:
        """Value of the ratio."""
        return values[self.path] / values[self.over] if self.path else np.inf

    def slope(self, path: str) -> float:
        """d ln(ratio)/d ln(number at `path`)."""
        return float(path == self.path) - float(path == self.over)


@dataclass(frozen=True)
class _OneUnknown:
    """The bodies of a scene of which one modulus or thickness is not known.

    Parameters
    ----------
    scene : Scene
        With a ratio of one.
    path : str
        The number.
    unit : float
        Its value at a ratio of one (SI).
    """

    scene: Scene
    path: str
    unit: float

    def kernel(self, ratio: float) -> Kernel:
        """Kernel at one ratio."""
        return self.scene.with_values({self.path: ratio * self.unit}).contact.kernel


def one_ratio(similarity: Similarity, body: IsotropicLayer | None, free: Sequence[str]) -> OneRatio | None:
    """Find the one ratio that the free parameters move; None where they move more, or a Poisson's ratio.

    `body` is the reference's, where it is an isotropic layer.
    """
    if similarity.exponent is None or set(similarity.direct).intersection(free):
        return None
    if body is not None:
        if body.base is None:
            return OneRatio(None)
        return OneRatio(IsotropicPair(body.layer.nu, body.base.nu), "substrate.E", "layer.E")
    over = dict.fromkeys(similarity.moduli[1:], "layer.E") | dict.fromkeys(
        similarity.lengths, "layer.thickness"
    )
    if similarity.moduli[1:]:
        over["layer.E"] = similarity.moduli[1]
    if similarity.lengths:
        over["layer.thickness"] = similarity.lengths[0]
    moving = [path for path in over if path in free]
    if len(moving) != 1 or "layer.E_axial" in similarity.values:
        return None
    path = moving[0]
    unit = similarity.values[over[path]]
    # Whatever the numbers that a fit starts from and stands at: one table for one known rest.
    known = similarity.scene.with_values({path: unit})
    bodies = Scene(known.indenter, known.layer, known.substrate, instrument=Instrument())
    return OneRatio(_OneUnknown(bodies, path, unit), path, over[path])


def tip_ratio(similarity: Similarity, body: IsotropicLayer | None, free: Sequence[str]) -> OneRatio | None:
    """Find the bodies under a tip that is no power law; None where tables are not for what varies.

    `body` as in `one_ratio`.
    """
    if similarity.exponent is not None or body is None or not similarity.moduli:
        return None
    moving = set(similarity.direct).intersection(free)
    if moving - {"layer.thickness"}:
        return None
    if body.base is None:
        return OneRatio(RigidBase(body.layer.nu))
    return OneRatio(IsotropicPair(body.layer.nu, body.base.nu), "substrate.E", "layer.E")
