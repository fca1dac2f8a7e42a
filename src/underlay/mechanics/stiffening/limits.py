"""Where the stiffening factors hold, and what is refused: each limit is the end of what was measured.

The ranges are those of the finite elements of the design study of stiffening layers, its sections 1 and 6.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy import optimize

from underlay._arrays import PerSet
from underlay.errors import InputError, RangeError
from underlay.mechanics.body import Base, Body, Layer, Rigid
from underlay.mechanics.indenters import Cone, FlatPunch, Indenter, Paraboloid, PowerLaw, Sphere
from underlay.mechanics.materials import Isotropic
from underlay.mechanics.stiffening.factors import Medium, Place, crowding, gent

_LEAST_NU, _LEAST_THICKNESS = 0.3, 0.5
# The finite elements of incompressible layers are of nu = 0.4995; sliding ones were made for nothing else.
_INCOMPRESSIBLE = 0.4995
_MOST_DEPTH_IN_RADII, _MOST_DEPTH_IN_THICKNESS, _MOST_WIDTH = 0.6, 0.3, 1.3
_MOST_CROWDING, _MOST_STIFFENING = 0.6, 3.0
#: z = w/h up to which, on a layer, the form of the energy covers Ogden's (53 of 56 fits; 8 of 24 at 0.2 and
#: 0.25).
FORM_KNOWN_TO = 0.1
# A depth read off a curve may exceed the end of the range by rounding.
_ROUNDING = 1.0 + 1e-9
# Share of a refused depth from which on the largest is looked for: z, t and X end at depths 1e6 times smaller
# only of layers that are refused as too thin, G of s above 1e5.
_SHALLOWEST = 1e-6
# What a test may not have beside it, and why.
_BESIDE = {
    "friction": 'tips without friction: take friction = "none" or leave out stiffening',
    "adhesion": "tips without adhesion (the contact radius is not known): leave out one of them",
    "history": "samples without a history: leave out one of them",
    "small strains": "large strains: leave out finite_strain = false, or stiffening",
    "discrepancy": "laws without a discrepancy: its own is layer.stiffening.form; leave out one of them",
}


def require_known(
    indenter: Indenter,
    layer: Layer,
    base: Body | None,
    beside: Mapping[str, bool],
) -> Medium:
    """Check that stiffening is known for a test and return the `Medium` (Poisson's ratio and base) of its layer.

    `beside` says which other effects the test has: keys "friction", "adhesion", "history", "small strains" and
    "discrepancy", True where present; each is refused.

    Raises
    ------
    InputError
        With the number that is beyond, the end of what is known, and what to do.
    """
    bounded = base is not None and bool(np.isfinite(layer.thickness))
    _require_sphere(indenter, layered=bounded)
    material = layer.material
    if not isinstance(material, Isotropic):
        raise _refusal(f"isotropic layers; here {type(material).__name__}")
    if bounded and not isinstance(base, Rigid):
        what = "layers on a rigid base or a half-space"
        below = "an elastic base" if isinstance(base, Base) else "further layers under it"
        raise _refusal(f"{what}; here {below}: take the base as rigid if it is 100 times stiffer, or h = inf")
    if layer.relaxation is not None:
        raise _refusal("layers that do not relax: leave out relaxation or stiffening")
    for part, words in _BESIDE.items():
        if beside.get(part):
            raise _refusal(words)
    sliding = bounded and layer.bond == "slip"
    if bounded and layer.bond not in {"bonded", "slip", "unknown"}:
        raise _refusal("a bonded or a sliding base; here springs")
    _require_nu(material.nu, sliding=sliding)
    if bounded and isinstance(indenter, Sphere) and layer.thickness < _LEAST_THICKNESS * indenter.radius:
        raise _refusal(
            f"layers from {_LEAST_THICKNESS:g} R thick; here h = {layer.thickness / indenter.radius:.3g} R"
        )
    return Medium(material.nu, sliding)


def _refusal(words: str) -> InputError:
    return InputError(f"stiffening (layer.stiffening) is known for {words}")


def _require_nu(nu: float, *, sliding: bool) -> None:
    if nu < _LEAST_NU:
        raise _refusal(f"nu from {_LEAST_NU:g} to 0.5; here {nu:g}")
    if sliding and nu < _INCOMPRESSIBLE:
        raise _refusal(f"a sliding base at nu = 0.5 only; here {nu:g}: take nu = 0.5, or a bonded base")


def _require_sphere(indenter: Indenter, *, layered: bool) -> None:
    if isinstance(indenter, Sphere):
        return
    if isinstance(indenter, Paraboloid):
        radius = f"{indenter.radius:.6g}"
        raise _refusal(
            f'true spheres; a paraboloid is one below w = 0.1 R: take shape = "sphere" (Sphere({radius}))'
        )
    pointed = isinstance(indenter, Cone) or (isinstance(indenter, PowerLaw) and indenter.exponent == 1.0)
    if pointed and not layered:
        raise InputError(
            "a cone or pyramid on a half-space cannot tell stiffening: the strain under it is the same at every "
            "depth, so that the force is only multiplied, and E and 1/Jm cannot be told apart; take a sphere, or "
            "leave out layer.stiffening"
        )
    name = "a flat punch" if isinstance(indenter, FlatPunch) else type(indenter).__name__
    raise _refusal(f"true spheres; {name} was not measured")


class Reach(NamedTuple):
    """A quantity that limits the depth (such as "w/h"): its name, its value, and the end of its known range."""

    name: str
    value: float
    end: float

    @property
    def share(self) -> float:
        """Value over the end of its known range; above 1 the factors are not known."""
        return self.value / self.end


def largest_by_depth(radius: PerSet, thickness: PerSet) -> PerSet:
    """Largest depth (m) by the limits on w/R and w/h alone: 0.6 of the radius or 0.3 of the thickness."""
    return np.minimum(_MOST_DEPTH_IN_RADII * radius, _MOST_DEPTH_IN_THICKNESS * thickness)


def require_reach(
    place_at: Callable[[float], Place], depth: float, medium: Medium, inverse_limit: float
) -> None:
    """Refuse a depth (m) at which the factors are not known; the error gives the largest depth that works.

    Parameters
    ----------
    place_at : callable
        Gives the `Place` (of one point) of a depth (m); its t and alpha are used only up to `largest_by_depth`.
    depth : float
        Largest depth wanted (m).
    medium, inverse_limit
        As of `gent`.

    Raises
    ------
    RangeError
        With the quantity, its value and its end, and the largest depth that works.
    """
    reach = _farthest(place_at(depth), medium, inverse_limit)
    if reach.share <= _ROUNDING:
        return

    def over(share: float) -> float:
        return _farthest(place_at(share * depth), medium, inverse_limit).share - 1.0

    if over(_SHALLOWEST) > 0.0:
        raise RangeError(
            f"stiffening (layer.stiffening) is known up to {reach.name} = {reach.end:g}; a height_spread so large "
            "is beyond it at any depth"
        )
    largest = depth * float(optimize.brentq(over, _SHALLOWEST, 1.0))
    raise RangeError(
        f"stiffening (layer.stiffening) is known up to {reach.name} = {reach.end:g}; a depth of {depth:.6g} m "
        f"gives {reach.value:.4g}: use the curve up to {largest:.6g} m ([curve] max_depth)",
        max_depth=largest,
    )


def within_reach(place: Place, medium: Medium, inverse_limit: PerSet) -> NDArray[np.bool_]:
    """Mask, (sets, 1), of parameter sets whose deepest `place`, (sets, 1), is in the factors' known range."""
    ends = (_MOST_DEPTH_IN_RADII, _MOST_DEPTH_IN_THICKNESS, _MOST_WIDTH)
    inside = [number <= end * _ROUNDING for number, end in zip(place[:3], ends, strict=True)]
    locked = crowding(np.minimum(place.z, _MOST_DEPTH_IN_THICKNESS), inverse_limit, medium)
    known = np.logical_and.reduce([*inside, locked <= _MOST_CROWDING])
    factor, _ = gent(place, medium, np.where(known, inverse_limit, 0.0))
    return np.asarray(known & (factor.value <= _MOST_STIFFENING))


def _farthest(place: Place, medium: Medium, inverse_limit: float) -> Reach:
    """Return the quantity that is farthest into, or beyond, its range.

    a/h, X and G are evaluated only if w/R and w/h are within theirs.
    """
    y, z = float(place.y[0]), float(place.z[0])
    plain = [
        Reach("w/R", y, _MOST_DEPTH_IN_RADII),
        Reach("w/h", z, _MOST_DEPTH_IN_THICKNESS),
    ]
    worst = max(plain, key=_share)
    if worst.share > _ROUNDING:
        return worst
    locked = Reach("X (1 is locked)", float(crowding(place.z, inverse_limit, medium)[0]), _MOST_CROWDING)
    worst = max(worst, locked, Reach("a/h", float(place.t[0]), _MOST_WIDTH), key=_share)
    if locked.share > 1.0:
        return worst
    stiffening = float(gent(place, medium, inverse_limit)[0].value[0])
    return max(worst, Reach("G", stiffening, _MOST_STIFFENING), key=_share)


def _share(reach: Reach) -> float:
    return reach.share
