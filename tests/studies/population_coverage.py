"""How often intervals of a population cover, and how long 10,000 curves take, as commands whose results are kept.

    python tests/studies/population_coverage.py cover --output result.csv   # goes on where it was stopped
    python tests/studies/population_coverage.py joint --output result.csv   # tests what `cover` has stored
    python tests/studies/population_coverage.py prior --output result.csv   # the same
    python tests/studies/population_coverage.py speed --output result.json

Every cell is a kind of study (animals, spreads, open curves, unequal numbers), simulated many times with fresh
numbers. Per cell: coverage of the mean by the levels' interval, by the animals' means (Student's t, the one to go
by below six animals), and by two controls that must fail, all sites taken for independent and open curves dropped;
and the median length of the first over that of the second. Studies are numbered and kept fifty at a time: a run
goes on where the last stopped.
The rows of 2000 studies were asked again, with fresh chance, since 500 had left them outside 93 to 97 %:
``cover --cells 2 4 5 7 --seed 2 --studies 2000``.

The interval of the animals' means is never shorter than what the errors of the curves and the scatter within
animals leave, so it covers more than 95 % where animals differ by little more than that: `joint` names such cells.

`joint` asks of all cells together whether their coverage is 95 % but for chance (sum of squared deviations, each in
its standard error, chi-square), then without those whose own p is below 0.05 over the number of cells, which it
names (`results/population_joint.json`).

`prior` asks whether another scale of the prior on the spread between animals would cover three of them better:
the same studies with every scale, over true spreads.

The speed is that of 30 groups of five animals with 67 sites each, with all curves closed and with almost half of
them measuring a compliance, so that many are skewed and about a seventh is open to one side.
"""

import argparse
import csv
import json
import math
import os
import sys
import time
from pathlib import Path

import numpy as np
import pandas as pd
from scipy import stats

HERE = Path(__file__).resolve().parents[1]
sys.path[:0] = [str(HERE.parent / "src"), str(HERE)]

from support.populations import made_study, table_of  # noqa: E402
from underlay import population  # noqa: E402
from underlay.inference.population.levels import GroupModel  # noqa: E402
from underlay.inference.population.messages import SpreadPrior  # noqa: E402

#: animals, sites, between, within, openness, unequal numbers.
CELLS = (
    (3, 10, 0.1, 0.2, 0.0, False),
    (3, 10, 0.3, 0.2, 0.0, False),
    (3, 10, 0.6, 0.3, 0.0, False),
    (5, 20, 0.3, 0.2, 0.0, False),
    (5, 10, 0.1, 0.5, 0.0, False),
    (5, 10, 0.3, 0.2, 0.0, True),
    (10, 10, 0.3, 0.2, 0.0, False),
    (10, 10, 0.6, 0.2, 0.0, True),
    (3, 8, 0.2, 0.3, 0.55, False),
    (5, 8, 0.2, 0.3, 0.55, False),
    (3, 8, 0.2, 0.3, 0.32, False),
    (5, 8, 0.2, 0.3, 0.32, False),
    (10, 8, 0.2, 0.3, 0.32, False),
)
CONTROLS = ("levels", "animal_means", "sites_independent", "open_dropped")
AT_A_TIME = 50
#: True spreads between three animals, and scales of the prior.
SPREADS, SCALES = (0.1, 0.2, 0.3, 0.45, 0.6), (0.1, 0.2, 0.3, 0.5)
ENDS = np.array([0.025, 0.975])
#: Groups of the speed, and the share of curves that measure a compliance, of which 43 % are open.
GROUPS, OF_COMPLIANCE = 30, 0.46
FIELDS = (
    *("animals", "sites", "between", "within", "openness", "open_share", "unequal", "studies"),
    *(*CONTROLS, "length_ratio", "seconds_per_study"),
)


def covers(found):
    """Whether an interval of a mean, found with its two ends, holds the true one."""
    return found[1] < 1.0 < found[2]


def some_studies(cell, numbers, seed):
    """Counts of intervals that hold the mean, and what else is summed, over studies of these numbers."""
    animals, sites, between, within, openness, unequal = cell
    sums = dict.fromkeys((*CONTROLS, "open", "curves", "seconds"), 0.0)
    ratios = []
    for number in numbers:
        rng = np.random.default_rng([seed, number, *(int(1000 * part) for part in cell)])
        curves, labels = made_study(
            rng, animals=animals, sites=sites, between=between, within=within, openness=openness
        )
        if unequal:
            kept = [
                i
                for i, (name,) in enumerate(labels)
                if i % sites < 2 + int(name[1:]) * (sites - 2) // animals
            ]
            curves, labels = [curves[i] for i in kept], [labels[i] for i in kept]
        table = table_of(curves, labels)
        began = time.process_time()
        group = population(table).groups[""]
        sums["seconds"] += time.process_time() - began
        sums["levels"] += covers(group.modelled)
        sums["animal_means"] += covers(group.plain)
        sums["sites_independent"] += covers(population(table, by=[]).groups[""].modelled)
        is_open = np.array([curve.is_open for curve in curves])
        sums["open"] += is_open.sum()
        sums["curves"] += len(curves)
        closed = table[~is_open]
        sums["open_dropped"] += len(closed) > 1 and covers(population(closed).groups[""].modelled)
        ratios.append(
            math.log(group.modelled[2] / group.modelled[1]) / math.log(group.plain[2] / group.plain[1])
        )
    return sums, float(np.median(ratios))


def merged(row, cell, count, sums, ratio):
    """A stored row, or none, with `count` more studies."""
    before = int(row["studies"]) if row else 0
    total = before + count

    def mean(name, fresh, digits):
        return f"{(before * float(row[name] if row else 0.0) + count * fresh) / total:.{digits}f}"

    return {
        **dict(zip(FIELDS, cell[:4], strict=False)),
        "openness": cell[4],
        "open_share": mean("open_share", sums["open"] / sums["curves"], 3),
        "unequal": cell[5],
        "studies": total,
        **{name: mean(name, 100.0 * sums[name] / count, 2) for name in CONTROLS},
        "length_ratio": mean("length_ratio", ratio, 3),
        "seconds_per_study": mean("seconds_per_study", sums["seconds"] / count, 3),
    }


def cover(path, studies, seed, cells):
    """Every cell up to so many studies."""
    rows = {}
    if path.exists():
        with path.open(newline="", encoding="utf-8") as file:
            rows = {kind(row): row for row in csv.DictReader(file)}
    for cell in cells:
        while (done := int(rows.get(cell, {"studies": 0})["studies"])) < studies:
            numbers = range(done, min(done + AT_A_TIME, studies))
            rows[cell] = merged(rows.get(cell), cell, len(numbers), *some_studies(cell, numbers, seed))
            with path.open("w", newline="", encoding="utf-8") as file:
                writer = csv.DictWriter(file, FIELDS)
                writer.writeheader()
                writer.writerows(rows.values())
            sys.stderr.write(f"{rows[cell]}\n")


def joint(path):
    """Whether all cells cover 95 % but for chance, by the levels and by the animals' means."""
    table, answer = pd.read_csv(path), {}
    for interval in CONTROLS[:2]:
        counts = np.round(table[interval] * table["studies"] / 100.0).astype(int)
        z = (table[interval] - 95.0) / np.sqrt(95.0 * 5.0 / table["studies"])
        own = np.array(
            [
                stats.binomtest(count, studies, 0.95).pvalue
                for count, studies in zip(counts, table["studies"], strict=True)
            ]
        )
        alike = own >= 0.05 / len(table)
        answer[interval] = {
            "all cells": {"cells": len(table), "p": float(stats.chi2.sf(np.square(z).sum(), len(table)))},
            "without those beyond chance": {
                "cells": int(alike.sum()),
                "p": float(stats.chi2.sf(np.square(z[alike]).sum(), alike.sum())),
                "covered": round(100.0 * counts[alike].sum() / table["studies"][alike].sum(), 2),
            },
            "beyond chance": [
                {
                    **table.loc[row, list(FIELDS[:5])].to_dict(),
                    "covered": table.loc[row, interval],
                    "p": own[row],
                }
                for row in np.flatnonzero(~alike)
            ],
        }
    text = json.dumps(answer, indent=1) + "\n"
    path.with_name("population_joint.json").write_text(text, encoding="utf-8")
    sys.stderr.write(text)


def kind(row):
    """Which cell a stored row is of."""
    numbers = [float(row[name]) for name in ("between", "within", "openness")]
    return (int(row["animals"]), int(row["sites"]), *numbers, row["unequal"] == "True")


def some_scales(spread, scales, numbers, seed):
    """Counts of intervals that hold the mean, and lengths in ln, for every scale and for the animals' means."""
    counts, lengths = dict.fromkeys((*scales, "t"), 0), {scale: [] for scale in (*scales, "t")}
    for number in numbers:
        rng = np.random.default_rng([seed, number, int(1000 * spread)])
        curves, labels = made_study(rng, animals=3, sites=8, between=spread, within=0.3)
        plain = population(table_of(curves, labels)).groups[""].plain
        ends = {
            scale: GroupModel(curves, labels, between=SpreadPrior(scale, 1.0)).mean.quantile(ENDS)
            for scale in scales
        }
        for scale, (low, high) in (ends | {"t": np.log(plain[1:])}).items():
            counts[scale] += low < 0.0 < high
            lengths[scale].append(high - low)
    return counts, {scale: float(np.median(each)) for scale, each in lengths.items()}


def prior(path, studies, seed):
    """Three animals: every true spread with every scale of the half-Cauchy prior."""
    rows = []
    if path.exists():
        with path.open(newline="", encoding="utf-8") as file:
            rows = list(csv.DictReader(file))
    for spread in SPREADS:
        if any(float(row["between"]) == spread for row in rows):
            continue
        counts, lengths = some_scales(spread, SCALES, range(studies), seed)
        rows += [
            {
                "between": spread,
                "interval": scale if scale == "t" else f"scale {scale}",
                "studies": studies,
                "covers": f"{100.0 * count / studies:.1f}",
                "length": f"{lengths[scale]:.3f}",
            }
            for scale, count in counts.items()
        ]
        with path.open("w", newline="", encoding="utf-8") as file:
            writer = csv.DictWriter(file, rows[0])
            writer.writeheader()
            writer.writerows(rows)
        sys.stderr.write(f"{rows[-len(counts) :]}\n")


def table_of_groups(seed, share):
    """The table of a map of `GROUPS` groups, in which a share of the curves measures a compliance."""
    rng, tables = np.random.default_rng(seed), []
    for number in range(GROUPS):
        closed, compliant = (
            made_study(rng, animals=5, sites=67, between=0.2, within=0.3, openness=openness)
            for openness in (0.0, 0.4)
        )
        which = rng.random(len(closed[0])) < share
        curves = [two if it else one for one, two, it in zip(closed[0], compliant[0], which, strict=True)]
        tables.append(table_of(curves, closed[1], group=f"group {number}"))
    return pd.concat(tables, ignore_index=True)


def speed(path, seed):
    """Processor and wall time of one call for 10,050 curves, closed and not."""
    rows = []
    for share in (0.0, OF_COMPLIANCE):
        table = table_of_groups(seed, share)
        began, wall = time.process_time(), time.perf_counter()
        found = population(table, group="group")
        rows.append(
            {
                "curves": len(table),
                "groups": len(found.groups),
                "tabulated": int((table["layer.E.likelihood"] != "").sum()),
                "open": sum(one.open_curves for one in found.groups.values()),
                "processor seconds": round(time.process_time() - began, 2),
                "wall seconds": round(time.perf_counter() - wall, 2),
                "load": os.getloadavg()[0],
            }
        )
        sys.stderr.write(f"{rows[-1]}\n")
    path.write_text(json.dumps(rows, indent=1) + "\n", encoding="utf-8")


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("what", choices=["cover", "joint", "prior", "speed"])
    parser.add_argument("--studies", type=int, default=500, help="simulated studies per cell")
    parser.add_argument("--cells", type=int, nargs="*", default=range(len(CELLS)), help="their numbers")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--output", type=Path, required=True)
    arguments = parser.parse_args()
    if arguments.what == "speed":
        speed(arguments.output, arguments.seed)
    elif arguments.what == "joint":
        joint(arguments.output)
    elif arguments.what == "prior":
        prior(arguments.output, arguments.studies, arguments.seed)
    else:
        cover(
            arguments.output, arguments.studies, arguments.seed, [CELLS[number] for number in arguments.cells]
        )


if __name__ == "__main__":
    main()
