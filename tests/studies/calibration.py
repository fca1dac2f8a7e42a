"""Simulation-based calibration of the sampler, as a command whose result is kept beside it.

    python tests/studies/calibration.py run --replicas 300   # adds to calibration.csv; stop it any time
    python tests/studies/calibration.py show                 # table and rank plot from calibration.csv
    python tests/studies/calibration.py check                # calibration_check.csv: see below

Replicas are numbered: a run skips those that are there, and `--part 0/3` takes every third, so that several
processes can share the work (each writes a file of its own; `show` reads them all).

The check computes the same posteriors by importance sampling for the two scenes with known noise, on the first 300
curves, where it must agree with the sampler, and on 1200 others, where luck is another.
"""

import argparse
import csv
import sys
import time
from pathlib import Path

import matplotlib as mpl
import matplotlib.pyplot as plt
import numpy as np
import pandas as pd
from scipy import stats

HERE = Path(__file__).resolve().parent
sys.path[:0] = [str(HERE.parent), str(HERE.parent.parent / "src")]

from support.calibration import BINS, DRAWS, cases, levels, replica, uniformity  # noqa: E402  # after the path is set

COLUMNS = ("scene", "replica", "parameter", "rank", "inside90", "converged", "steps", "failures", "seconds")


def run(replicas, part, folder):
    number, of = part
    path = folder / ("calibration.csv" if of == 1 else f"calibration.{number}.csv")
    done = set()
    if path.exists():
        known = pd.read_csv(path)
        done = set(zip(known["scene"], known["replica"], strict=True))
    else:
        path.write_text(",".join(COLUMNS) + "\n")
    for seed in range(number, replicas, of):
        for name, case in cases().items():
            if (name, seed) in done:
                continue
            begin = time.process_time()
            rows, details = replica(case, seed)
            seconds = round(time.process_time() - begin, 2)
            with path.open("a", newline="") as file:
                csv.writer(file).writerows(
                    (name, seed, parameter, row["rank"], int(row["inside90"]), int(details.converged),
                     details.steps, details.failures, seconds)
                    for parameter, row in rows.items()
                )  # fmt: skip


def load(folder):
    files = sorted(folder.glob("calibration*.csv"))
    files = [file for file in files if not file.stem.endswith(("_summary", "_check"))]
    return pd.concat([pd.read_csv(file) for file in files], ignore_index=True)


def table(results):
    """One row per scene and parameter: replicas, chi-squared p of the ranks, coverage of 90 % intervals."""
    rows = []
    for (scene, parameter), group in results.groupby(["scene", "parameter"], sort=False):
        statistic, p_value = uniformity(group["rank"])
        inside = int(group["inside90"].sum())
        low, high = stats.binomtest(inside, len(group)).proportion_ci(0.95, "wilson")
        rows.append(
            {
                "scene": scene,
                "parameter": parameter,
                "replicas": len(group),
                "chi-squared (19)": round(statistic, 1),
                "p": round(p_value, 4),
                "coverage of 90 %": round(100.0 * inside / len(group), 1),
                "its 95 % interval": f"{100 * low:.1f} to {100 * high:.1f}",
                "converged": f"{100 * group['converged'].mean():.0f} %",
                "seconds each": round(group["seconds"].mean(), 1),
            }
        )
    return pd.DataFrame(rows)


def draw(results, path):
    """Histogram of the ranks of every parameter, with the band that 99 % of uniform ones keep."""
    groups = list(results.groupby(["scene", "parameter"], sort=False))
    columns = 4
    figure, axes = plt.subplots(
        -(-len(groups) // columns), columns, figsize=(12.0, 2.2 * -(-len(groups) // columns)), sharex=True
    )
    edges = np.linspace(-0.5, DRAWS + 0.5, BINS + 1)
    for axis, ((scene, parameter), group) in zip(axes.flat, groups, strict=False):
        low, high = stats.binom(len(group), 1.0 / BINS).ppf([0.005, 0.995])
        axis.axhspan(low, high, color="0.85")
        axis.axhline(len(group) / BINS, color="0.6", linewidth=0.8)
        axis.hist(group["rank"], bins=edges, histtype="stepfilled", color="#3b6ea5", alpha=0.8)
        axis.set_title(f"{scene}: {parameter}", fontsize=8)
        axis.tick_params(labelsize=7)
    for axis in axes.flat[len(groups) :]:
        axis.set_visible(False)
    figure.supxlabel(f"rank of the true value among {DRAWS} posterior draws", fontsize=9)
    figure.supylabel("replicas", fontsize=9)
    figure.tight_layout()
    figure.savefig(path, dpi=110)


def show(folder):
    results = load(folder)
    summary = table(results)
    summary.to_csv(folder / "calibration_summary.csv", index=False)
    print(summary.to_string(index=False))  # a command
    inside, count = int(results["inside90"].sum()), len(results)
    print(f"all: {100.0 * inside / count:.1f} % of {count} truths inside their 90 %")  # a command
    draw(results, folder / "calibration.png")


CHECKED = ("rigid base", "elastic base")


def check(folder):
    """Coverage of 90 % intervals by importance sampling, on the study's curves and on others."""
    rows = []
    for name in CHECKED:
        for part, seeds in (("of the study", range(300)), ("others", range(1000, 2200))):
            found = [levels(cases()[name], seed) for seed in seeds]
            smallest = min(size for _, size in found)
            for parameter in found[0][0]:
                below = np.array([entry[parameter] for entry, _ in found])
                inside = int(((below > 0.05) & (below < 0.95)).sum())
                low, high = stats.binomtest(inside, len(below)).proportion_ci(0.95, "wilson")
                rows.append(
                    {
                        "scene": name,
                        "curves": part,
                        "parameter": parameter,
                        "replicas": len(below),
                        "coverage of 90 %": round(100.0 * inside / len(below), 1),
                        "its 95 % interval": f"{100 * low:.1f} to {100 * high:.1f}",
                        "p (Kolmogorov)": round(float(stats.kstest(below, "uniform").pvalue), 4),
                        "smallest effective sample": round(smallest),
                    }
                )
    frame = pd.DataFrame(rows)
    frame.to_csv(folder / "calibration_check.csv", index=False)
    print(frame.to_string(index=False))  # a command


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("what", choices=["run", "show", "check"])
    parser.add_argument("--replicas", type=int, default=300)
    parser.add_argument("--part", default="0/1", help="n/N: every N-th replica from the n-th")
    parser.add_argument("--folder", type=Path, default=HERE / "results")
    arguments = parser.parse_args()
    arguments.folder.mkdir(exist_ok=True)
    if arguments.what == "check":
        check(arguments.folder)
    elif arguments.what == "run":
        number, _, of = arguments.part.partition("/")
        run(arguments.replicas, (int(number), int(of)), arguments.folder)
    else:
        mpl.use("Agg")
        show(arguments.folder)


if __name__ == "__main__":
    main()
