"""Small inverse problems with known answers, for the tests of the sampler."""

import numpy as np

import underlay as ul

WHITE = 2e-5


def halfspace_scene():
    instrument = ul.Instrument(contact_depth=2e-6, baseline=1e-5)
    return ul.Scene(ul.Paraboloid(1e-3), ul.Layer(ul.Isotropic(1e6, 0.45)), instrument=instrument)


def halfspace_curve(points=40, seed=1, noise=WHITE):
    depth = np.linspace(-1e-5, 5e-5, points)
    return ul.synthesize(halfspace_scene(), depth, ul.Noise(force=noise), seed, sampling_rate=100.0)


def baseline_problem(noise=WHITE):
    """One linear parameter, known white noise, normal prior: the posterior is normal and known."""
    prior = ul.Normal(0.0, 1e-5)
    return ul.Problem(
        halfspace_scene(), halfspace_curve(), {"instrument.baseline": prior}, ul.Noise(force=noise)
    )


def baseline_answer(noise=WHITE):
    """Mean and standard deviation (N) of the posterior of `baseline_problem`."""
    curve = halfspace_curve()
    contact = halfspace_scene().with_values({"instrument.baseline": 0.0}).force(curve.depth)
    precision = 1e10 + len(curve) / noise**2
    return np.sum(curve.force - contact) / noise**2 / precision, precision**-0.5


def halfspace_problem(curve=None, noise=None):
    """E and contact point of a half-space."""
    free = {"layer.E": ul.LogUniform(1e4, 1e8), "instrument.contact_depth": ul.Uniform(-1e-5, 1e-5)}
    return ul.Problem(halfspace_scene(), curve or halfspace_curve(), free, noise or ul.Noise(force=WHITE))


def barely_touched_problem():
    """A thick layer on a rigid base at a/h = 0.05, its thickness known to 5 % from a needle."""
    thickness, radius = 1e-3, 1e-3
    depth = np.linspace(0.0, (0.05 * thickness) ** 2 / radius, 60)
    scene = ul.Scene(ul.Paraboloid(radius), ul.Layer(ul.Isotropic(1e6, 0.5), thickness), ul.RIGID)
    noise = ul.Noise(force=0.01 * float(scene.force(depth)[-1]))
    curve = ul.synthesize(scene, depth, noise, 3)
    free = {"layer.E": ul.LogUniform(1e4, 1e8), "layer.thickness": ul.Normal(thickness, 0.05 * thickness)}
    return ul.Problem(scene, curve, free, noise, solver=ul.Auto(1e-4))
