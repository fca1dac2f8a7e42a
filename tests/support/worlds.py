"""Disturbances that real curves carry, on any scene: what a fit with white noise does not expect.

A disturbance is a function of (clean, rng) that returns force to add to a noiseless curve. Sizes are shares of the
largest contact force, so that one function serves any scene.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

import underlay as ul


@dataclass(frozen=True)
class Clean:
    """A noiseless curve: depth since contact and time of every reading, contact force, and the scene."""

    scene: ul.Scene
    depth: np.ndarray
    time: np.ndarray
    force: np.ndarray

    @classmethod
    def of(cls, scene, deepest, points=240, approach=0.4):
        depth = np.linspace(-approach * deepest, deepest, points)
        law = scene.contact_law(deepest)
        return cls(scene, depth, np.linspace(0.0, 1.0, points), law.force(depth))

    @property
    def top(self):
        return float(np.abs(self.force).max())


def nothing(clean, _rng):
    return np.zeros_like(clean.depth)


def ornstein_uhlenbeck(clean, rng, size, tau):
    z = rng.standard_normal(len(clean.time))
    rho = np.exp(-np.diff(clean.time) / tau)
    for i in range(1, len(z)):
        z[i] = rho[i - 1] * z[i - 1] + np.sqrt(1.0 - rho[i - 1] ** 2) * z[i]
    return size * clean.top * z


def correlated(clean, rng):
    return ornstein_uhlenbeck(clean, rng, 0.005, 0.03)


def slow(clean, rng):
    return ornstein_uhlenbeck(clean, rng, 0.006, 0.08)


def walk(clean, rng):
    steps = rng.standard_normal(len(clean.depth))
    return 0.015 * clean.top * np.cumsum(steps) / np.sqrt(len(steps))


def fringes(clean, rng):
    span = np.ptp(clean.depth)
    period = span * rng.uniform(0.06, 0.14) / 0.21
    return 0.01 * clean.top * np.sin(2.0 * np.pi * (clean.depth / period + rng.uniform()))


def slope(clean, rng):
    return 0.03 * rng.standard_normal() * clean.top * (clean.time - clean.time.mean())


def drag(clean, rng):
    size = 0.02 * rng.uniform(0.5, 1.5) * clean.top
    gap = np.maximum(-clean.depth, 0.0)
    return size / (1.0 + gap / (0.05 * clean.depth.max()))


def adhesion(clean, rng):
    size = -0.02 * rng.uniform(0.5, 1.5) * clean.top
    return np.where(clean.depth > -0.033 * clean.depth.max(), size, 0.0)


def stiffening(clean, rng):
    share = np.maximum(clean.depth, 0.0) / clean.depth.max()
    return clean.force * abs(rng.standard_normal()) * 0.15 * share


def relaxation(clean, rng):
    """Lee and Radok: the force of a layer that loses 20 to 60 % of its modulus while it is pressed."""
    share, tau = rng.uniform(0.2, 0.6), np.exp(rng.uniform(np.log(0.05), np.log(2.0)))
    dP = np.diff(clean.force, prepend=clean.force[0])
    lost = np.zeros_like(dP)
    for i in range(1, len(dP)):
        decay = np.exp(-(clean.time[i] - clean.time[i - 1]) / tau)
        lost[i] = decay * lost[i - 1] + decay**0.5 * dP[i]
    return share * (lost - clean.force)


#: Disturbance and the white noise beside it, as a share of the largest force.
WORLDS = {
    "clean": (nothing, 0.003),
    "AR(1)": (correlated, 0.0),
    "AR(1) and white": (slow, 0.003),
    "random walk": (walk, 0.003),
    "fringes": (fringes, 0.003),
    "slope of the baseline": (slope, 0.003),
    "drag step": (drag, 0.003),
    "adhesion": (adhesion, 0.003),
    "stiffening": (stiffening, 0.003),
    "relaxation": (relaxation, 0.003),
    "Hertz on a layer": (nothing, 0.003),
    "paraboloid for a sphere": (nothing, 0.003),
    "noise of the depth": (nothing, 0.003),
}


def assumed(scene, world):
    """Return the scene that a fit in this world takes the test for."""
    if world == "Hertz on a layer":
        return ul.Scene(scene.indenter, replace(scene.layer, thickness=np.inf))
    if world == "paraboloid for a sphere":
        return replace(scene, indenter=ul.Paraboloid(scene.indenter.radius))
    return scene


def disturbed(clean, world, rng, noise=0.003):
    """Curve of a world, with white noise beside the disturbance unless that is a noise itself."""
    disturbance, white = WORLDS[world]
    white = noise if white else 0.0
    depth = clean.depth
    if world == "noise of the depth":
        # The force is ten times as quiet: near contact, where a depth hardly matters, readings are good.
        depth, white = depth + noise * depth.max() * rng.standard_normal(len(depth)), 0.1 * noise
    noise = white * clean.top * rng.standard_normal(len(depth))
    return ul.Curve(depth, clean.force + disturbance(clean, rng) + noise, time=clean.time)


def pink(clean, rng):
    """Noise of equal power in every octave."""
    n = len(clean.depth)
    frequency = np.fft.rfftfreq(n)
    amplitude = np.zeros(len(frequency), complex)
    amplitude[1:] = rng.standard_normal((2, n // 2)).T @ np.array([1.0, 1.0j]) / np.sqrt(frequency[1:])
    own = np.fft.irfft(amplitude, n)
    return 0.006 * clean.top * own / own.std()


def vibration(clean, rng):
    return 0.01 * clean.top * np.sin(2.0 * np.pi * (rng.uniform(15.0, 40.0) * clean.time + rng.uniform()))


def outliers(clean, rng):
    hit = rng.uniform(size=len(clean.depth)) < 0.03
    return 0.03 * clean.top * rng.standard_t(2, len(clean.depth)) * hit


def growing(clean, rng):
    return 0.01 * rng.standard_normal(len(clean.depth)) * np.maximum(clean.force, 0.0)


def kinked(clean, rng):
    """A baseline with two slopes before contact."""
    kink = rng.uniform(-0.35, -0.1) * clean.depth.max()
    return (
        0.02 * rng.standard_normal() * clean.top * np.maximum(clean.depth - kink, 0.0) / np.ptp(clean.depth)
    )


def turning(clean, rng):
    """A thermal ramp that turns on the way."""
    turn = rng.uniform(0.3, 0.7)
    return 0.06 * abs(rng.standard_normal()) * clean.top * np.abs(clean.time - turn)


def soft_touch(clean, rng):
    """A soft film of a few per cent of the depth: contact is made gradually."""
    scale = rng.uniform(0.02, 0.08) * clean.depth.max()
    return -0.6 * clean.force * np.exp(-np.maximum(clean.depth, 0.0) / scale)


#: Further worlds: what is added to the force, and the white noise beside it, over the largest force.
FURTHER = {
    "1/f": (pink, 0.003),
    "vibration": (vibration, 0.003),
    "outliers": (outliers, 0.003),
    "growing": (growing, 0.0005),
    "kinked baseline": (kinked, 0.003),
    "ramp that turns": (turning, 0.003),
    "soft touch": (soft_touch, 0.003),
}
#: Worlds of noise, judged by the truth; and worlds in which the law is wrong, judged by what it makes of the range.
NOISES = (
    "clean", "AR(1)", "AR(1) and white", "random walk", "fringes", "slope of the baseline", "drag step", "adhesion",
    "1/f", "vibration", "outliers", "growing", "quantised", "kinked baseline", "ramp that turns",
)  # fmt: skip
LAW_LIKE = ("stiffening", "relaxation", "bent depth", "bowed depth", "soft touch")


def world_curves(clean, world, rng):
    """A curve of a world, and the same without white noise."""
    depth, white = clean.depth, 0.003 * clean.top * rng.standard_normal(len(clean.depth))
    if world in {"bent depth", "bowed depth"}:
        x = np.clip(depth / depth.max(), -1.0, 1.0)
        shape = np.maximum(x - 0.5, 0.0) if world == "bent depth" else x * (1.0 - x) * (x > 0.0)
        read = depth + 0.02 * rng.choice([-1.0, 1.0]) * depth.max() * shape
        return (ul.Curve(read, clean.force + own, time=clean.time) for own in (white, 0.0))
    if world == "quantised":
        step = 0.02 * clean.top
        rounded = np.round((clean.force + white) / step) * step
        return (ul.Curve(depth, force, time=clean.time) for force in (rounded, clean.force))
    disturbance, size = FURTHER.get(world) or WORLDS[world]
    added = disturbance(clean, rng)
    noise = size * clean.top * rng.standard_normal(len(depth))
    return (ul.Curve(depth, clean.force + added + own, time=clean.time) for own in (noise, 0.0))
