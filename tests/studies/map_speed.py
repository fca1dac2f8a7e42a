"""How a map grows: two processes against one, and 16,384 curves end to end.

    python tests/studies/map_speed.py [--curves 4000] [--map 16384] [--output FILE]

The times are taken in turns: other work on the machine then touches both sides. Results go to
``results/map_speed.json``. What a curve costs on one core, and nanite beside it: `tests/benchmarks/cost.py`.
"""

from __future__ import annotations

import argparse
import json
import os
import platform
import resource
import statistics
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable
from pathlib import Path

import numpy as np

import underlay as ul
from underlay.data.export import curve_csv

RADIUS, NU = 5e-4, 0.45
SCENE = ul.Scene(ul.Paraboloid(RADIUS), ul.Layer(ul.Isotropic(1e6, NU), 1.5e-3), ul.RIGID)
FREE = {"layer.E": (1e4, 1e8), "instrument.contact_depth": (-5e-5, 5e-5)}
EXACT = {"solver": ul.Exact(1e-4)}
OPTIONS = ul.MapOptions(**EXACT)

SCENE_TOML = """
indenter = { shape = "paraboloid", radius = "0.5 mm" }
layer = { E = "1 MPa", nu = 0.45, thickness = "1.5 mm" }
substrate = { rigid = true }
solver = { name = "exact", rtol = 1e-4 }

[fit]
layer.E = { min = "10 kPa", max = "100 MPa" }
instrument.contact_depth = { min = "-50 um", max = "50 um" }
"""

# Runs a map and says its peak memory: of this process, and of the largest of its workers.
MEASURED = """
import resource, sys, time
sys.path[:0] = {path!r}
from underlay.cli import main
sys.argv = ["underlay", *sys.argv[1:]]
began = time.perf_counter()
try:
    main()
except SystemExit as stop:
    assert not stop.code
seconds = time.perf_counter() - began
# ru_maxrss of this process would be that of its parent before it: the status starts anew with the program.
status = dict(line.split(":", 1) for line in open("/proc/self/status"))
peak = int(status["VmHWM"].split()[0]) / 1024
print("measured", seconds, peak, resource.getrusage(resource.RUSAGE_CHILDREN).ru_maxrss / 1024)
"""


class Sites:
    """Made sites: thickness, modulus and contact depth of each, and its noisy force."""

    def __init__(self, count: int, points: int) -> None:
        rng = np.random.default_rng(1)
        self.thickness = 1.5e-3 * rng.uniform(0.7, 1.3, count)
        self.modulus = 1e6 * 10.0 ** rng.uniform(-0.3, 0.3, count)
        self.contact = rng.uniform(-5e-6, 5e-6, count)
        self.depth = np.linspace(-2e-5, 8e-5, points)
        self._law: ul.ContactLaw = SCENE.contact_law(1e-3, **EXACT)

    def force(self, index: int) -> np.ndarray:
        """Force (N) of a site, by the similarity of paraboloids: P(w; h) = h^3 F(w / h^2)."""
        w = np.maximum(self.depth - self.contact[index], 0.0)
        s = self.thickness[index] / SCENE.layer.thickness
        force = s**3 * (self.modulus[index] / 1e6) * self._law.force(w / s**2)
        return force + np.random.default_rng(index).normal(0.0, 0.005 * force[-1], len(force))

    def curve(self, index: int) -> ul.Curve:
        """Curve of a site."""
        return ul.Curve(self.depth, self.force(index), metadata={"name": f"site-{index:05d}.csv"})

    def manifest(self, start: int, stop: int) -> list[dict[str, object]]:
        """Rows of a manifest (SI)."""
        side = int(np.ceil(np.sqrt(len(self.thickness))))
        return [
            {
                "file": f"site-{k:05d}.csv",
                "layer.thickness": float(self.thickness[k]),
                "x": 1e-4 * (k % side),
                "y": 1e-4 * (k // side),
            }
            for k in range(start, stop)
        ]


def fit_slice(
    sites: Sites, curves: list[ul.Curve], start: int, stop: int, workers: int
) -> tuple[float, float]:
    """Seconds and processor seconds of this process for some curves; every one must be fitted."""
    manifest = sites.manifest(start, stop)
    began, began_cpu = time.perf_counter(), time.process_time()
    table = ul.fit_many(curves[start:stop], SCENE, FREE, manifest, workers=workers, options=OPTIONS)
    took = time.perf_counter() - began, time.process_time() - began_cpu
    assert (table["status"] == "fitted").all()
    # The truth is found: nobody times a fit that fails.
    assert np.median(np.abs(table["layer.E"] / sites.modulus[start:stop] - 1.0)) < 0.01
    return took


def processor_seconds() -> float:
    """Processor seconds of this process and of its workers that have ended."""
    usages = [resource.getrusage(who) for who in (resource.RUSAGE_SELF, resource.RUSAGE_CHILDREN)]
    return sum(usage.ru_utime + usage.ru_stime for usage in usages)


def two_against_one(count: int, points: int, rounds: int) -> dict[str, object]:
    """Two processes against one, in turns."""
    sites = Sites(count, points)
    curves = [sites.curve(k) for k in range(count)]
    pairs, processor = [], {1: np.inf, 2: np.inf}
    for _ in range(rounds):
        walls = []
        for workers in (1, 2):
            before = processor_seconds()
            walls.append(fit_slice(sites, curves, 0, count, workers=workers)[0])
            processor[workers] = min(processor[workers], processor_seconds() - before)
        pairs.append(walls)
    return {
        "curves": count,
        "points": points,
        "processors": len(os.sched_getaffinity(0)),
        "one process (s, best)": min(one for one, _ in pairs),
        "two processes (s, best)": min(two for _, two in pairs),
        # What two processes do more than one in all; the wall times also know what else the machine did.
        "one process (processor s, best)": processor[1],
        "two processes (processor s, best)": processor[2],
        "ratio (best against best)": min(one for one, _ in pairs) / min(two for _, two in pairs),
        "ratio (median of rounds)": statistics.median(one / two for one, two in pairs),
    }


def end_to_end(count: int, points: int) -> dict[str, object]:
    """A folder of files to table and picture, by the command: seconds and peak memory."""
    sites = Sites(count, points)
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        (folder / "curves").mkdir()
        for k in range(count):
            (folder / "curves" / f"site-{k:05d}.csv").write_text(curve_csv(sites.curve(k)), encoding="utf-8")
        (folder / "scene.toml").write_text(SCENE_TOML, encoding="utf-8")
        rows = [
            f"{row['file']},{1e3 * row['layer.thickness']!r},{1e3 * row['x']:.4f},{1e3 * row['y']:.4f}"
            for row in sites.manifest(0, count)
        ]
        manifest = folder / "manifest.csv"
        manifest.write_text("\n".join(["file,thickness (mm),x (mm),y (mm)", *rows]) + "\n", encoding="utf-8")
        words = ["map", "curves", "--scene", "scene.toml", "--manifest", "manifest.csv", "--output", "out"]
        done = subprocess.run(
            [sys.executable, "-c", MEASURED.format(path=sys.path), *words],
            cwd=folder,
            check=True,
            capture_output=True,
            text=True,
        )
        seconds, parent, worker = map(float, done.stdout.rpartition("measured")[2].split())
        assert (folder / "out" / "map.png").stat().st_size > 0
        assert len((folder / "out" / "map.csv").read_text(encoding="utf-8").splitlines()) == count + 1
    return {
        "curves": count,
        "points": points,
        "seconds": seconds,
        "curves per second": count / seconds,
        "peak memory of the command (MB)": parent,
        "peak memory of its largest worker (MB)": worker,
    }


def main() -> None:
    """Measure and write."""
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0] if __doc__ else None)
    parser.add_argument("--curves", type=int, default=4000)
    parser.add_argument("--points", type=int, default=1000)
    parser.add_argument("--map", type=int, default=16_384, help="curves of the map; 0 leaves it out")
    parser.add_argument("--output", type=Path, default=Path(__file__).parent / "results" / "map_speed.json")
    given = parser.parse_args()
    parts: dict[str, Callable[[], dict[str, object]]] = {
        "two processes against one": lambda: two_against_one(given.curves, given.points, 3),
        "map of an eighth": lambda: end_to_end(given.map // 8, 500),
        "map": lambda: end_to_end(given.map, 500),
    }
    results: dict[str, object] = {
        "machine": f"{platform.machine()}, {os.cpu_count()} processors, Python {platform.python_version()}",
    }
    for name, measure in parts.items():
        if name.startswith("map") and not given.map:
            continue
        # How busy the machine was with other work: wall times and the two processes suffer from it.
        results[name] = {"load before": os.getloadavg()[0], **measure()}
        text = json.dumps(results, indent=2) + "\n"
        given.output.write_text(text, encoding="utf-8")
    sys.stdout.write(text)


if __name__ == "__main__":
    main()
