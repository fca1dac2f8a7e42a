"""1 - L of one layer at 80 digits, by the wave reflected at its base, and random materials to try it on."""

from __future__ import annotations

from typing import Any

import mpmath as mp
import numpy as np

import underlay as ul
from underlay.mechanics.body import PlaneConstants


def surface(of: PlaneConstants) -> tuple[Any, Any, Any]:
    """p, sigma and the surface compliance of plane constants, in the working precision."""
    q, c, g, S = (mp.mpf(float(entry)) for entry in of)
    p = mp.sqrt(q * q + c * g)
    sigma = mp.sqrt(S * g - 2 * q + 2 * p)
    return p, sigma, mp.matrix([[sigma / g, (q - p) / g], [(q - p) / g, p * sigma / g]])


def reflected(u: np.ndarray, layer: PlaneConstants, base: PlaneConstants | None) -> np.ndarray:
    """1 - L at 80 digits by reflection at the interface, step 3 of the derivation: no digit of it is shared."""
    with mp.workdps(80):
        J = mp.matrix([[-1, 0], [0, 1]])
        p, sigma, own = surface(layer)
        other = mp.zeros(2) if base is None else surface(base)[2]
        R = (own + J * other * J) ** -1 * J * (own - other)
        d, values = mp.sqrt(sigma * sigma / 4 - p), []
        for one in u:
            x = mp.mpf(float(one))
            ch, sh = mp.cosh(x * d), mp.sinh(x * d) / d
            E = mp.exp(-x * sigma / 2) * mp.matrix(
                [[ch - sigma * sh / 2, p * sh], [-sh, ch + sigma * sh / 2]]
            )
            G = E * R * E
            rest = G[1, 1] - mp.det(R) * mp.exp(-2 * sigma * x)
            values.append(float(mp.re(2 * rest / (1 - G[0, 0] + rest))))
    return np.array(values)


def constants_of_roots(p: float, turn: float, rng: np.random.Generator) -> PlaneConstants:
    """Plane constants of a stable material with 4 p/sigma^2 = `turn`."""
    square = 4.0 * p / turn
    gap = min(0.5 * square, 2.0 * p) * rng.uniform()
    q = p - gap
    return PlaneConstants(q, (p - q) * (p + q), 1.0, square - 2.0 * gap)


def random_material(rng: np.random.Generator) -> ul.TransverselyIsotropic:
    """Any stable one: E' within 100 and G' within 1000 of E, nu' up to its limit."""
    E_axial, nu, G = 100.0 ** rng.uniform(-1, 1), rng.uniform(-0.9, 0.95), 1000.0 ** rng.uniform(-1, 1)
    nu_axial = rng.uniform(-0.9999, 0.9999) * np.sqrt(0.5 * (1.0 - nu) * E_axial)
    return ul.TransverselyIsotropic(1.0, E_axial, nu, nu_axial, G)
