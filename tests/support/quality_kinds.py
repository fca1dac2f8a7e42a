"""Kinds of curves that a laboratory sorts by hand: good ones, and what went wrong with the others.

A kind is a function of (clean, rng) that returns a curve; sizes are shares of the largest contact force or depth.
"""

from __future__ import annotations

import numpy as np

import underlay as ul
from support.worlds import Clean

NOISE = 0.005


def _noisy(clean, force, rng, depth=None):
    noise = NOISE * clean.top * rng.standard_normal(len(force))
    return ul.Curve(clean.depth if depth is None else depth, force + noise, time=clean.time)


def good(clean, rng):
    return _noisy(clean, clean.force, rng)


def double_contact(clean, rng):
    """A second asperity touches when the first is a third to two thirds in."""
    law = clean.scene.contact_law(float(clean.depth.max()))
    second = clean.depth - rng.uniform(0.3, 0.65) * clean.depth.max()
    return _noisy(clean, clean.force + law.force(second), rng)


def slip(clean, rng):
    """The force falls by 5 to 20 % of its peak at once, somewhere in the deeper two thirds."""
    at = rng.uniform(0.35, 0.9) * clean.depth.max()
    lost = rng.uniform(0.05, 0.2) * clean.top
    return _noisy(clean, clean.force - np.where(clean.depth > at, lost, 0.0), rng)


def drift(clean, rng):
    """The baseline creeps by 10 to 30 % of the peak."""
    size = rng.choice([-1.0, 1.0]) * rng.uniform(0.1, 0.3)
    return _noisy(clean, clean.force + size * clean.top * clean.time, rng)


def random_walk(clean, rng):
    """The baseline walks, by 3 to 6 % of the peak over the record."""
    steps = rng.standard_normal(len(clean.depth)) / np.sqrt(len(clean.depth))
    return _noisy(clean, clean.force + rng.uniform(0.03, 0.06) * clean.top * np.cumsum(steps), rng)


def jump_in(clean, rng):
    """The tip is pulled in with 5 to 15 % of the peak a little before contact."""
    pull = rng.uniform(0.05, 0.15) * clean.top
    return _noisy(clean, clean.force - np.where(clean.depth > -0.03 * clean.depth.max(), pull, 0.0), rng)


def begins_in_contact(clean, rng):
    """No approach: the record begins at a tenth to a third of the depth."""
    kept = clean.depth > rng.uniform(0.1, 0.35) * clean.depth.max()
    noise = NOISE * clean.top * rng.standard_normal(int(kept.sum()))
    return ul.Curve(clean.depth[kept], clean.force[kept] + noise, time=clean.time[kept])


def pure_noise(clean, rng):
    return _noisy(clean, np.zeros_like(clean.force), rng)


KINDS = {
    "good": good,
    "double contact": double_contact,
    "slip": slip,
    "drift": drift,
    "random walk": random_walk,
    "jump in": jump_in,
    "begins in contact": begins_in_contact,
    "pure noise": pure_noise,
}


def example(kind, scene, depth, points, rng):
    """Return a curve of a kind."""
    return KINDS[kind](Clean.of(scene, depth, points), rng)
