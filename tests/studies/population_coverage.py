"""How often intervals of a population cover: ``python tests/studies/population_coverage.py --output result.csv``.

Every cell is a kind of study (animals, spreads, open curves, unequal numbers), simulated many times with fresh
numbers. Per cell: coverage of the mean by the levels' interval, by the animals' means (Student's t), and by two
controls that must fail, all sites taken for independent and open curves dropped; and the median length of the
first over that of the second.
"""

import argparse
import csv
import math
import sys
import time
from pathlib import Path

import numpy as np

HERE = Path(__file__).resolve().parents[1]
sys.path[:0] = [str(HERE.parent / "src"), str(HERE)]

from support.populations import made_study, table_of  # noqa: E402
from underlay import population  # noqa: E402

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
)
FIELDS = (
    *("animals", "sites", "between", "within", "open_share", "unequal", "studies"),
    *("levels", "animal_means", "sites_independent", "open_dropped", "length_ratio", "seconds_per_study"),
)


def covers(group):
    return group.low < 1.0 < group.high


def one_cell(cell, studies, seed):
    animals, sites, between, within, openness, unequal = cell
    rng = np.random.default_rng([seed, *(int(1000 * number) for number in cell)])
    hits = dict.fromkeys(("levels", "animal_means", "sites_independent", "open_dropped"), 0)
    ratios, open_curves, curves_made, spent = [], 0, 0, 0.0
    for _ in range(studies):
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
        spent += time.process_time() - began
        hits["levels"] += covers(group)
        hits["animal_means"] += group.plain[1] < 1.0 < group.plain[2]
        hits["sites_independent"] += covers(population(table, by=[]).groups[""])
        is_open = np.array([curve.is_open for curve in curves])
        open_curves, curves_made = open_curves + int(is_open.sum()), curves_made + len(curves)
        closed = table[~is_open]
        hits["open_dropped"] += len(closed) > 1 and covers(population(closed).groups[""])
        ratios.append(math.log(group.high / group.low) / math.log(group.plain[2] / group.plain[1]))
    shares = {name: f"{100.0 * count / studies:.1f}" for name, count in hits.items()}
    return {
        **dict(zip(FIELDS, (animals, sites, between, within), strict=False)),
        "open_share": f"{open_curves / curves_made:.2f}",
        "unequal": unequal,
        "studies": studies,
        **shares,
        "length_ratio": f"{np.median(ratios):.2f}",
        "seconds_per_study": f"{spent / studies:.3f}",
    }


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--studies", type=int, default=500, help="simulated studies per cell")
    parser.add_argument("--open-studies", type=int, default=100, help="the same, for cells with open curves")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--output", type=Path, required=True)
    arguments = parser.parse_args()
    with arguments.output.open("w", newline="", encoding="utf-8") as file:
        writer = csv.DictWriter(file, FIELDS)
        writer.writeheader()
        for cell in CELLS:
            studies = arguments.open_studies if cell[4] else arguments.studies
            row = one_cell(cell, studies, arguments.seed)
            writer.writerow(row)
            file.flush()
            sys.stderr.write(f"{row}\n")


if __name__ == "__main__":
    main()
