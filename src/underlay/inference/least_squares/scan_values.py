"""What a scan tries: contacts, thicknesses and moduli of the base, within the bounds of a problem."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from underlay._arrays import FloatArray
from underlay.inference.least_squares.blocks import Blocks
from underlay.inference.least_squares.scan_curve import BASE_MODULUS, CONTACT, MODULUS, THICKNESS
from underlay.inference.model.coordinates import Coordinate

__all__ = ["tried_base_moduli", "tried_contacts", "tried_thicknesses"]

# Contact radius over thickness: below the first the layer is a half-space, above the last a fit is hopeless.
_RADIUS_RATIOS = (0.06, 4.6)
_SHARES = np.linspace(0.0, 1.0, 9)
_NEAR = 0.25 * _SHARES[1]
# Base over layer.
_MODULUS_RATIOS = np.array([0.02, 0.2, 1.5, 10.0, 100.0])
_CONTACT_STEPS = np.linspace(-0.2, 0.9, 8)


def tried_contacts(free: Mapping[str, Coordinate], blocks: Blocks, known: float) -> FloatArray:
    """Contact depths (m) to try, ascending; `known` alone where it is not free."""
    if CONTACT not in free:
        return np.array([known])
    coordinate = free[CONTACT]
    grid = blocks.depth[0] + _CONTACT_STEPS * blocks.span
    low, high = coordinate.low, coordinate.high
    if high - low < grid[-1] - grid[0]:
        grid = np.linspace(low, high, len(grid))
    inside = grid[(grid >= low) & (grid <= high)]
    # Bounds beside the curve leave none: then the scene's own value is all there is to try.
    return inside if len(inside) > 1 else np.array([coordinate.reference])


def tried_thicknesses(free: Mapping[str, Coordinate], radii: tuple[float, float]) -> FloatArray:
    """Thicknesses (m) to try, ascending; empty where it is not free."""
    if THICKNESS not in free:
        return np.zeros(0)
    coordinate = free[THICKNESS]
    lowest, highest = radii[0] / _RADIUS_RATIOS[1], radii[1] / _RADIUS_RATIOS[0]
    low, high = coordinate.low, coordinate.high
    narrow = low > 0.0 and np.isfinite(high) and high / low < highest / lowest
    first, last = (low, high) if narrow else (lowest, highest)
    grid = first * (last / first) ** _SHARES
    inside = grid[(grid >= low) & (grid <= high)]
    # The scene's own is one more, but not next to one of these, nor where a fit is hopeless: the law of so thin a
    # layer is dear.
    own = coordinate.reference
    near = np.abs(np.log(inside / own)).min(initial=np.inf) < _NEAR * np.log(last / first)
    return _with(inside, own) if not inside.size or (own >= lowest and not near) else inside


def tried_base_moduli(free: Mapping[str, Coordinate], base: Mapping[str, float]) -> FloatArray:
    """Moduli (Pa) of the base to try under the scene's layer, ascending; empty where no ratio is free."""
    if BASE_MODULUS not in base or not {MODULUS, BASE_MODULUS} & free.keys():
        return np.zeros(0)
    (softest, hardest), (lowest, highest) = (
        (free[path].low, free[path].high) if path in free else (base[path], base[path])
        for path in (MODULUS, BASE_MODULUS)
    )
    # No ratio but those that the bounds leave.
    low, high = lowest / hardest, highest / softest if softest > 0.0 else np.inf
    # numpy.clip takes three times as long on so few.
    ratios, own = np.minimum(np.maximum(_MODULUS_RATIOS, low), high), base[BASE_MODULUS] / base[MODULUS]
    # The scene's own is one more where the others do not reach.
    beyond = not ratios[0] <= own <= ratios[-1]
    return base[MODULUS] * (_with(ratios, own) if beyond else _with(ratios))


def _with(values: FloatArray, *own: float) -> FloatArray:
    """Each of the values (n,) and of one's own once, ascending: numpy.unique takes ten times as long on so few."""
    return np.array(sorted({*values.tolist(), *own}))
