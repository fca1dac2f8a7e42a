"""How often the intervals of a draining layer's numbers hold the truth, and the shipped tables' errors.

The tests are ramp and hold, noise 1 % of the peak, h known, on layers of 1 mm: a flat punch (a/h = 0.5) and a
sphere on an isotropic layer, whose E, nu and k are free, with the size of the noise stated and not (intervals then
allow for noise of other kinds, which is not there); two flat punches (a/h = 0.25 and 1) on a transversely
isotropic one, whose E, E_axial and k are. Each isotropic test has a control that must fail: a record whose noise
is alike for 30 s, fitted as white noise of its size. What nobody knows is a row of the budget in further tests:
whether the tip lets water through (solid and porous ones, fitted as unknown), and G_axial under one punch
(a/h = 1), off by its assumed size, 20 % to 95 %: normal, and at both ends of that. All other inputs are exact; at
the ends, where an exact budget of that row alone holds the truth in half of all tests or little more, also with
every input of its assumed size.

::

    python tests/studies/biphasic.py coverage    # goes on with tests/studies/results/biphasic_coverage.csv
    python tests/studies/biphasic.py tables
"""

import sys
import time as clock
from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
import pandas as pd

sys.path[:0] = [str(Path(__file__).resolve().parents[2] / "src"), str(Path(__file__).resolve().parents[1])]

import underlay as ul  # noqa: E402  after the path
from support.draining_tables import punch_error, tip_error  # noqa: E402
from underlay.mechanics.biphasic.tables import shipped_punch, shipped_tip  # noqa: E402

RESULTS = Path(__file__).with_name("results") / "biphasic_coverage.csv"
FREE = {"layer.E": None, "layer.nu": ul.Uniform(0.0, 0.48), "layer.permeability": None}
START = {"layer.E": 2e5, "layer.nu": 0.3, "layer.permeability": 3e-16}
FIBROUS = dict.fromkeys(("layer.E", "layer.E_axial", "layer.permeability"))
START_OF_FIBROUS = {"layer.E": 1.5e6, "layer.E_axial": 0.5e6, "layer.permeability": 7e-16}
EXACT = dict.fromkeys(("force", "depth", "indenter.radius", "layer.thickness"), 0.0)
EXACT_OF_FIBROUS = EXACT | dict.fromkeys(("layer.nu", "layer.nu_axial", "layer.permeability_ratio"), 0.0)
ISOTROPIC = ul.Biphasic(0.5e6, 0.2, 1e-15)
# Radius (of a punch, or a sphere), depth and duration of the ramp, end of the record; the points of each.
PUNCH, SPHERE = (ul.FlatPunch(0.5e-3), 5e-5, 20.0, 2000.0), (ul.Sphere(2e-3), 4e-5, 20.0, 700.0)
SMALL, WIDE = (ul.FlatPunch(0.25e-3), 2e-5, 2.0, 1500.0), (ul.FlatPunch(1e-3), 2e-5, 5.0, 4000.0)
RAMP_POINTS, HOLD_POINTS = 40, 160
# Of the control's noise (s); fits of a block.
ALIKE, BLOCK = 30.0, 20


def exact(rng):
    """The shear modulus, as it is entered."""
    del rng
    return 0.2e6


def at_an_end(rng):
    """The shear modulus, 20 % above or below what is entered: at one end of its assumed 95 %."""
    return 0.2e6 * (1.2 if rng.uniform() < 0.5 else 0.8)


@dataclass(frozen=True)
class Cell:
    """Curves of `tests`, how the tip is and what is said of it, and how many fits."""

    fits: int
    tests: tuple
    material: ul.Biphasic | ul.BiphasicTransverse = ISOTROPIC
    tip: str = "solid"
    said: str = "solid"
    inputs: str | dict | None = "none"
    alike: bool = False
    stated: bool = False
    G_axial: Callable = exact

    @property
    def fibrous(self):
        return isinstance(self.material, ul.BiphasicTransverse)

    def scene(self, tip, material):
        layer = ul.Layer(material, 1e-3)
        return ul.Scene(tip, layer, ul.RIGID, drainage=self.said, uncertainties=self.inputs)

    def fit(self, seed):
        """The fit of one set of curves."""
        rng = np.random.default_rng(seed)
        own = replace(self.material, G_axial=self.G_axial(rng)) if self.fibrous else self.material
        posed = []
        for tip, depth, ramp, end in self.tests:
            time = np.linspace(0.0, ramp, RAMP_POINTS)
            time = np.concatenate((time, ramp + np.geomspace(ramp / RAMP_POINTS, end, HOLD_POINTS)))
            record = depth * np.minimum(time / ramp, 1.0)
            true = replace(self.scene(tip, own), drainage=self.tip)
            size = 0.01 * float(true.force(record, time).max())
            noise = ul.Noise(force=size, correlation_time=ALIKE if self.alike else 0.0)
            curve = ul.synthesize(true, record, noise, rng=rng, time=time)
            start = START_OF_FIBROUS if self.fibrous else START
            posed.append((self.scene(tip, self.material).with_values(start), curve))
        if len(posed) > 1:
            return ul.fit(ul.Problem.joint(posed, FIBROUS, shared=list(FIBROUS)))
        told = {"noise": ul.Noise(force=size)} if self.stated else {}
        return ul.fit(ul.Problem(*posed[0], FIBROUS if self.fibrous else FREE, **told))


STIFF = ul.BiphasicTransverse(2e6, 0.4e6, 0.2, 0.1, 0.2e6, 1e-15)
UNKNOWN = {"said": "unknown", "inputs": EXACT}
ASSUMED = {"material": STIFF, "inputs": EXACT_OF_FIBROUS}
CELLS = {
    "punch": Cell(500, (PUNCH,)),
    "sphere": Cell(500, (SPHERE,)),
    "punch, noise stated": Cell(500, (PUNCH,), stated=True),
    "sphere, noise stated": Cell(500, (SPHERE,), stated=True),
    "punch, correlated noise as white": Cell(40, (PUNCH,), alike=True, stated=True),
    "sphere, correlated noise as white": Cell(40, (SPHERE,), alike=True, stated=True),
    "solid punch, drainage unknown": Cell(200, (PUNCH,), **UNKNOWN),
    "porous punch, drainage unknown": Cell(200, (PUNCH,), tip="porous", **UNKNOWN),
    "two punches, transversely isotropic": Cell(200, (SMALL, WIDE), STIFF),
    "one punch, G_axial as assumed": Cell(
        100, (WIDE,), G_axial=lambda rng: rng.normal(0.2e6, 0.02e6), **ASSUMED
    ),
    "one punch, G_axial 20 % off": Cell(40, (WIDE,), G_axial=at_an_end, **ASSUMED),
    "one punch, G_axial 20 % off, every input as assumed": Cell(
        100, (WIDE,), STIFF, inputs=None, G_axial=at_an_end
    ),
}


def main():
    """All cells, a row each; in turn by blocks of seeds, kept after every one, and going on from what is kept."""
    kept = pd.read_csv(RESULTS, comment="#", index_col="test") if RESULTS.exists() else pd.DataFrame()
    found = {name: {"fits": 0, "seconds": 0.0} for name in CELLS}
    found |= {name: row.dropna().to_dict() for name, row in kept.iterrows()}
    while any(found[name]["fits"] < cell.fits for name, cell in CELLS.items()):
        for name, cell in CELLS.items():
            row, begun, first = found[name], clock.process_time(), int(found[name]["fits"])
            for seed in range(first, min(first + BLOCK, cell.fits)):
                fit = cell.fit(seed)
                for path in fit.names:
                    answer, truth = fit.answer(path), getattr(cell.material, path.removeprefix("layer."))
                    row[path] = row.get(path, 0) + (answer.low <= truth <= answer.high)
                row["fits"] += 1
            row["seconds"] += clock.process_time() - begun
            keep(found)


def keep(found):
    """Write the rows that there are."""
    table = pd.DataFrame.from_dict(found, orient="index").rename_axis("test").round({"seconds": 1})
    columns = ["fits", *dict.fromkeys((*FREE, *FIBROUS))]
    table = table.reindex(columns=[*columns, "seconds"])
    table = table[table["fits"] > 0].astype(dict.fromkeys(columns, "Int64"))
    told = "# python tests/studies/biphasic.py coverage\n# intervals that hold the truth\n"
    RESULTS.write_text(told + table.to_csv(lineterminator="\n"))


def tables():
    """Largest errors of both tables: 200 points of the punch's, 30 of the sphere's."""
    for drainage in ("solid", "porous"):
        print("punch", drainage, punch_error(shipped_punch(drainage), 200, seed=1))
        print("tip", drainage, tip_error(shipped_tip(drainage), 30, seed=1))


if __name__ == "__main__":
    tables() if sys.argv[1] == "tables" else main()
