"""Scenes, curves and problems that the tests of the inference share."""

import numpy as np

import underlay as ul

#: Of the largest force.
NOISE = 0.01


def layer_on(base, *, thickness=5e-4, E=1e6, nu=0.45, indenter=None, **instrument):
    """A layer under a paraboloid of 1 mm, in contact at 10 um."""
    return ul.Scene(
        indenter or ul.Paraboloid(1e-3),
        ul.Layer(ul.Isotropic(E, nu), thickness),
        base,
        ul.Instrument(**{"contact_depth": 1e-5} | instrument),
    )


def measured(scene, *, points=300, depth=1.5e-4, level=NOISE, rng=0, first=-3e-5, **noise):
    """A curve of `scene` with white noise of `level` times its largest force, or other noise."""
    readings = np.linspace(first, depth, points)
    peak = float(np.ptp(scene.force(readings)))
    return ul.synthesize(
        scene,
        readings,
        time=np.linspace(0.0, 1.0, points),
        noise=ul.Noise(force=level * peak, **noise),
        rng=rng,
    )


def exact_curve(scene, *, points=100, depth=1.5e-4, first=-3e-5):
    """The curve of `scene` without noise."""
    readings = np.linspace(first, depth, points)
    return ul.Curve(readings, scene.force(readings), time=np.linspace(0.0, 1.0, points))


def problem(scene, free, curve=None, **options):
    """A problem whose curve was made from its own scene; its noise is stated to be white, of unknown size."""
    options = {"noise": ul.Noise()} | options
    return ul.Problem(scene, measured(scene) if curve is None else curve, free, **options)


def ambiguous(**options):
    """A problem of two optima: a thin, soft layer mimics a thick, stiff one within a rise of 11.6."""
    scene = layer_on(ul.RIGID)
    curve = measured(scene, points=200, depth=2e-4, first=-5e-5, level=0.005, rng=3)
    return problem(scene, ["layer.E", "layer.thickness", "instrument.contact_depth"], curve, **options)
