"""What the bench is made of: scenes, curves and files, and how two calls are timed beside each other."""

from __future__ import annotations

import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

from underlay.data.curve import Curve
from underlay.data.export import curve_csv
from underlay.data.synthetic import synthesize
from underlay.mechanics.body import RIGID, Base, Layer
from underlay.mechanics.indenters import Indenter, Paraboloid
from underlay.mechanics.materials import Isotropic
from underlay.mechanics.solvers import Exact
from underlay.scene.noise import Noise
from underlay.scene.scene import Scene

__all__ = ["POINTS", "THICKNESS", "made_curve", "made_files", "over", "scene_of", "seconds"]

#: Of a curve of a map, and the thickness (m) of its layer.
POINTS, THICKNESS = 1000, 1e-3
_SCENE_FILE = """
indenter = { shape = "paraboloid", radius = "1 mm" }
layer = { E = "3 MPa", nu = 0.5, thickness = "1 mm" }
substrate = { rigid = true }
solver = { name = "exact", rtol = 1e-4 }

[fit]
layer.E = { min = "30 kPa", max = "300 MPa" }
instrument.contact_depth = { min = "-100 um", max = "100 um" }
"""


def seconds(call: Callable[[], Any]) -> float:
    """Processor time (s) of a call."""
    began = time.process_time()
    call()
    return time.process_time() - began


def over(unit: Callable[[], Any], call: Callable[[], Any], rounds: int) -> float:
    """Median ratio of two calls made in turns, after a round that does not count."""
    unit(), call()
    return float(np.median([seconds(call) / seconds(unit) for _ in range(rounds)]))


def scene_of(tip: Indenter, base: Base, thickness: float = THICKNESS) -> Scene:
    """A layer of 3 MPa under a tip."""
    return Scene(tip, Layer(Isotropic(3e6, 0.5), thickness), base)


def made_curve(scene: Scene, points: int, seed: int = 0) -> tuple[Curve, Noise]:
    """A curve of so many points, a/h up to 0.8, and its noise."""
    depth = np.linspace(-5e-5, 3.6e-4, points)
    noise = Noise(force=0.005 * float(scene.force(depth[-1], solver=Exact(1e-4))))
    return synthesize(scene, depth, noise=noise, rng=seed), noise


def made_files(folder: Path, count: int) -> tuple[Path, list[Path]]:
    """A scene file and so many curves as CSV."""
    scene = folder / "scene.toml"
    scene.write_text(_SCENE_FILE, encoding="utf-8")
    curves = folder / "curves"
    curves.mkdir()
    paths = [curves / f"{number:03d}.csv" for number in range(count)]
    for seed, path in enumerate(paths):
        made = made_curve(scene_of(Paraboloid(1e-3), RIGID), POINTS, seed)[0]
        path.write_text(curve_csv(made), encoding="utf-8")
    return scene, paths
