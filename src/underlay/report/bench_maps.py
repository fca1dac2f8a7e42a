"""Maps of the bench: each beside the rigid paraboloid's, in seconds a curve, and beside nanite."""

from __future__ import annotations

import tempfile
from collections.abc import Callable
from importlib import import_module
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from underlay.data.curve import Curve
from underlay.inference.batch.fit_many import fit_many
from underlay.inference.batch.model import MapOptions
from underlay.mechanics.body import RIGID, Base
from underlay.mechanics.indenters import Indenter, Paraboloid, Sphere
from underlay.mechanics.materials import Isotropic
from underlay.mechanics.solvers import Exact
from underlay.report.bench_made import POINTS, THICKNESS, made_curve, made_files, over, scene_of, seconds

__all__ = ["CURVES", "IN_FILES", "LAYERED", "map_of_files", "map_over_nanite", "map_over_rigid"]

#: Of a map in memory, and of one in files: there, what a map costs once (its scene file, its table) must weigh as
#: little as it does in the maps that people make.
CURVES, IN_FILES = 24, 256
_LEVER = 1e3  # N/m
_PAIRS = {"layer.E": (3e4, 3e8), "instrument.contact_depth": (-1e-4, 1e-4)}
_STIFF = Isotropic(3e7, 0.3)

#: What is mapped with a thickness of its own for every curve.
LAYERED = (
    ("base ten times stiffer", Paraboloid(1e-3), _STIFF),
    ("true sphere, rigid base", Sphere(1e-3), RIGID),
    ("true sphere, base ten times stiffer", Sphere(1e-3), _STIFF),
)


def _map(tip: Indenter, base: Base) -> Callable[[], Any]:
    """A map with a thickness of its own for every curve."""
    thickness = THICKNESS * np.linspace(0.7, 1.3, CURVES)
    made = [made_curve(scene_of(tip, base, h), POINTS, seed) for seed, h in enumerate(thickness.tolist())]
    names = [f"{number:03d}" for number in range(CURVES)]
    curves = [
        Curve(curve.depth, curve.force, metadata={"name": name})
        for name, (curve, _) in zip(names, made, strict=True)
    ]
    manifest = pd.DataFrame({"file": names, "layer.thickness": thickness})
    options = MapOptions(noise=made[0][1], solver=Exact(1e-4))
    return lambda: fit_many(curves, scene_of(tip, base), _PAIRS, manifest, workers=0, options=options)


def map_over_rigid(tip: Indenter, base: Base) -> Callable[[int], float]:
    """One of `LAYERED` over the rigid paraboloid's."""

    def measure(rounds: int) -> float:
        return over(_map(Paraboloid(1e-3), RIGID), _map(tip, base), max(2, rounds // 2))

    return measure


def map_of_files(rounds: int) -> float:
    """A map from a folder of CSV, ms a curve."""
    with tempfile.TemporaryDirectory() as name:
        scene, paths = made_files(Path(name), IN_FILES)

        def call() -> object:
            return fit_many(paths[0].parent, scene, workers=0)

        call()
        # The shortest counts, and a clock that wanders does so for seconds on end: more rounds than of a ratio.
        return 1e3 * min(seconds(call) for _ in range(2 * rounds)) / IN_FILES


def map_over_nanite(rounds: int) -> float:
    """Curves a second of a map over those of nanite's plain Hertz fit: both read, prepare and fit one HDF5 file."""
    scene, options = scene_of(Paraboloid(1e-3), RIGID), MapOptions(solver=Exact(1e-4))
    with tempfile.TemporaryDirectory() as name:
        path = Path(name) / "map.h5"
        _exported(path)
        return over(
            lambda: fit_many(path, scene, _PAIRS, workers=0, options=options),
            lambda: _by_nanite(path),
            max(2, rounds // 2),
        )


def _exported(path: Path) -> None:
    """Write a map as afmformats exports it."""
    with import_module("h5py").File(path, "w") as file:
        # Without a version that they know they find no curve in it.
        file.attrs["software"], file.attrs["software version"] = "afmformats", "0.18.0"
        for number in range(IN_FILES):
            made = made_curve(scene_of(Paraboloid(1e-3), RIGID), POINTS, number)[0]
            group = file.create_group(str(number))
            group.attrs["imaging mode"], group.attrs["enum"] = "force-distance", number
            group.attrs["spring constant"] = _LEVER
            group["force"], group["height (measured)"] = made.force, -made.depth - made.force / _LEVER
            group["segment"] = np.zeros(POINTS, dtype=np.uint8)
            group["time"] = 1e-3 * np.arange(POINTS)


def _by_nanite(path: Path) -> None:
    """What nanite's own users do with such a file."""
    group = import_module("nanite.group").load_group(path)
    if len(group) != IN_FILES:
        raise RuntimeError(f"nanite finds {len(group)} of {IN_FILES} curves")
    for test in group:
        test.apply_preprocessing(["compute_tip_position", "correct_force_offset", "correct_tip_offset"])
        start = test.get_initial_fit_parameters(model_key="hertz_para")
        start["R"].value, start["nu"].value = 1e-3, 0.5
        test.fit_model(model_key="hertz_para", params_initial=start)
