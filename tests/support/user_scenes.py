"""Random tests of a user's range: colloids on gels, balls on cartilage, probes, films on wafers, soft bases."""

from __future__ import annotations

import numpy as np

import underlay as ul


def _colloid(rng):
    radius = rng.uniform(1e-6, 10e-6)
    layer = ul.Layer(ul.Isotropic(_log(rng, 3e2, 3e4), rng.uniform(0.4, 0.5)), rng.uniform(5e-6, 50e-6))
    return ul.Scene(ul.Sphere(radius), layer, ul.RIGID)


def _ball(rng):
    layer = ul.Layer(ul.Isotropic(_log(rng, 2e5, 3e6), rng.uniform(0.2, 0.48)), rng.uniform(1e-3, 3e-3))
    return ul.Scene(ul.Sphere(rng.uniform(0.5e-3, 3e-3)), layer, ul.RIGID)


def _probe(rng):
    layer = ul.Layer(ul.Isotropic(_log(rng, 1e2, 1e5), rng.uniform(0.4, 0.5)), rng.uniform(5e-5, 1e-3))
    return ul.Scene(ul.Sphere(rng.uniform(1e-5, 1e-4)), layer, ul.RIGID)


def _film(rng):
    layer = ul.Layer(ul.Isotropic(_log(rng, 1e6, 3e9), rng.uniform(0.3, 0.45)), rng.uniform(2e-7, 5e-6))
    return ul.Scene(ul.Sphere(rng.uniform(1e-6, 2e-5)), layer, ul.Isotropic(1.6e11, 0.27))


def _soft_base(rng):
    E = _log(rng, 1e3, 1e6)
    layer = ul.Layer(ul.Isotropic(E, rng.uniform(0.3, 0.48)), _log(rng, 1e-5, 1e-3))
    radius = layer.thickness * rng.uniform(0.3, 2.0)
    return ul.Scene(ul.Sphere(radius), layer, ul.Isotropic(E * _log(rng, 0.05, 0.5), 0.45))


KINDS = {"colloid": _colloid, "ball": _ball, "probe": _probe, "film": _film, "soft base": _soft_base}


def _log(rng, low, high):
    return float(np.exp(rng.uniform(np.log(low), np.log(high))))


def user_test(rng):
    """Return the kind, a scene, the depth (m) it is pressed to, the number of points and the relative noise."""
    kind = list(KINDS)[rng.integers(len(KINDS))]
    scene = KINDS[kind](rng)
    radius, thickness = scene.indenter.radius, scene.layer.thickness
    depth = rng.uniform(0.03, 0.3) * min(radius, thickness)
    return kind, scene, depth, int(_log(rng, 100, 2000)), _log(rng, 1e-3, 3e-2)
