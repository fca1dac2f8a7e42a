"""Curves of a made map: a ball on a layer of varying thickness and modulus on a rigid base."""

from __future__ import annotations

import math
import os
import shutil
import sqlite3
import tempfile
import time
from contextlib import closing
from pathlib import Path

import numpy as np

import underlay as ul
from underlay.data.export import curve_csv

SCENE = ul.Scene(ul.Paraboloid(5e-4), ul.Layer(ul.Isotropic(1e6, 0.45), 1.5e-3), ul.RIGID)
FREE = {"layer.E": (1e4, 1e8), "instrument.contact_depth": (-5e-5, 5e-5)}
SOLVER = ul.Auto(1e-4)


def truth(index: int) -> dict[str, float]:
    """Modulus (Pa), thickness (m) and contact depth (m) at site `index`."""
    return {
        "layer.E": 8e5 * (1.0 + 0.3 * math.sin(0.7 * index)),
        "layer.thickness": 1.5e-3 * (1.0 + 0.35 * math.cos(0.3 * index)),
        "instrument.contact_depth": 4e-6 * math.sin(1.3 * index),
    }


def made_curve(index: int, points: int = 300, scene: ul.Scene = SCENE) -> ul.Curve:
    """Noisy curve at site `index`, named ``site-0007.csv``."""
    site = scene.with_values(truth(index))
    depth = np.linspace(-2e-5, 8e-5, points)
    curve = ul.synthesize(site, depth, ul.Noise(force=2e-4), rng=index, solver=SOLVER)
    return curve.with_metadata(name=name(index))


def name(index: int) -> str:
    return f"site-{index:04d}.csv"


def made_manifest(count: int) -> list[dict[str, object]]:
    """Rows with thickness and position, SI."""
    return [
        {
            "file": name(index),
            "layer.thickness": truth(index)["layer.thickness"],
            "x": 1e-3 * (index % 8),
            "y": 1e-3 * (index // 8),
        }
        for index in range(count)
    ]


def write_folder(folder: Path, count: int, points: int = 120) -> Path:
    """Curve files and ``manifest.csv`` (in millimetres) in `folder`."""
    folder.mkdir(parents=True, exist_ok=True)
    for index in range(count):
        (folder / name(index)).write_text(curve_csv(made_curve(index, points)), encoding="utf-8")
    rows = [
        f"{row['file']},{row['layer.thickness'] * 1e3!r},{row['x'] * 1e3!r},{row['y'] * 1e3!r}"
        for row in made_manifest(count)
    ]
    lines = ["file,thickness (mm),x (mm),y (mm)", *rows]
    (folder / "manifest.csv").write_text("\n".join(lines) + "\n", encoding="utf-8")
    return folder


SCENE_TOML = """
[indenter]
shape = "paraboloid"
radius = "0.5 mm"

[layer]
E = "1 MPa"
nu = 0.45
thickness = "1.5 mm"

[substrate]
rigid = true

[solver]
rtol = 1e-4

[fit]
layer.E = { min = "10 kPa", max = "100 MPa" }
instrument.contact_depth = { min = "-50 um", max = "50 um" }
"""


def fit(curves, manifest=None, *, workers=None, scheduler=None, output=None, **options):
    """Fit a made map; `options` are those of `MapOptions`."""
    chosen = ul.MapOptions(solver=SOLVER, **options)
    return ul.fit_many(
        curves, SCENE, FREE, manifest, workers=workers, scheduler=scheduler, output=output, options=chosen
    )


def numbers(table):
    """The table without the one column that differs from run to run."""
    return table.drop(columns="seconds")


def rows_in(journal: Path) -> int:
    """How many rows a journal holds that another process may be writing to: counted in a copy."""
    with tempfile.TemporaryDirectory() as folder:
        copy = Path(folder) / "copy"
        for end in ("", "-wal"):
            beside = journal.with_name(journal.name + end)
            if beside.exists():
                shutil.copy(beside, f"{copy}{end}")
        with closing(sqlite3.connect(copy)) as file:
            try:
                return file.execute("SELECT count(*) FROM row").fetchone()[0]
            except sqlite3.OperationalError:
                return 0


class TrapCurve(ul.Curve):
    """A curve that kills, or keeps, every process but the one that made it."""

    def __init__(self, curve: ul.Curve, deed: str) -> None:
        super().__init__(
            curve.depth, curve.force, metadata={**curve.metadata, "maker": os.getpid(), "deed": deed}
        )

    def __len__(self) -> int:
        if os.getpid() != self.metadata["maker"]:
            if self.metadata["deed"] == "die":
                os._exit(9)
            time.sleep(600.0)
        return super().__len__()


_SLOWED: set[str] = set()


class SlowCurve(ul.Curve):
    """A curve that keeps each process 50 ms, once, whichever it is: a worker unpickles it with its class."""

    def __init__(self, curve: ul.Curve) -> None:
        super().__init__(curve.depth, curve.force, metadata=curve.metadata)

    def __len__(self) -> int:
        if self.metadata["name"] not in _SLOWED:
            _SLOWED.add(self.metadata["name"])
            time.sleep(0.05)
        return super().__len__()
