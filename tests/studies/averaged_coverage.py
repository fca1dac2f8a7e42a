"""How often do 95 % intervals of posteriors hold the truth where nobody states the noise?

    python tests/studies/averaged_coverage.py run [--curves 100] [--first 0]   # goes on where it was stopped
    python tests/studies/averaged_coverage.py summary

Scenes, depths, numbers of readings (here 300 at most) and noise are those of a user's range
(`support/user_scenes.py`). Half of the curves have white noise, half correlated (an AR(1) of half a per cent of the
largest force, its time 3 % of the test's). E and contact are free; of every second curve the thickness too. Every
truth is a draw of its prior, whose range is moved at random about it: four decades of E, a factor 16 of thickness,
and of contact two tenths of the depth. So intervals that allow for no more than they must hold 95 % of them.

Sampled is what `sample` gives where no noise is stated: noise, drift, jump and creeping baseline averaged over. The
control takes the correlated noise for white, of unknown size: it must fail. Rows are kept as they are made.
"""

import argparse
import csv
import sys
import time
import warnings
from pathlib import Path

import numpy as np
import pandas as pd

HERE = Path(__file__).resolve().parents[1]
sys.path[:0] = [str(HERE.parent / "src"), str(HERE)]

import underlay as ul  # noqa: E402  # after the path is set
from support.user_scenes import user_test  # noqa: E402
from support.worlds import Clean, disturbed  # noqa: E402

RESULTS = Path(__file__).resolve().parent / "results"
ROWS, SUMMARY = RESULTS / "averaged_coverage_rows.csv", RESULTS / "averaged_coverage.csv"
CONTACT = "instrument.contact_depth"
#: By the number of the curve: world, and the noise that is stated: none, so that it is averaged over, or white for
#: the control.
CASES = ((("clean", "averaged"),), (("AR(1)", "averaged"), ("AR(1)", "white")))
MOST_READINGS = 300
TOLD = {"averaged": None, "white": ul.Noise()}
FIELDS = (
    *("curve", "kind", "readings", "noise", "world", "taken", "free", "method", "converged", "seconds"),
    *("E_inside", "h_inside", "E_width", "h_width"),
)
MOST_STEPS = 2000


def moved(rng, value, factor):
    """A range of this factor in which the value lies anywhere."""
    low = value * factor ** -rng.uniform()
    return ul.LogUniform(low, low * factor)


def problem_of(curve_number, world, taken):
    """One curve of one world, and what it tells of."""
    rng = np.random.default_rng([curve_number, 2121])
    kind, scene, deepest, points, noise = user_test(rng)
    points = min(points, MOST_READINGS)
    clean = Clean.of(scene, deepest, points)
    low = -0.2 * deepest * rng.uniform()
    free = {
        "layer.E": moved(rng, scene.parameters["layer.E"], 1e4),
        CONTACT: ul.Uniform(low, low + 0.2 * deepest),
    }
    if curve_number % 2:
        free["layer.thickness"] = moved(rng, scene.parameters["layer.thickness"], 16.0)
    curve = disturbed(clean, world, rng, noise)
    problem = ul.Problem(scene, curve, free, noise=TOLD[taken])
    told = {"kind": kind, "readings": points, "noise": round(noise if world == "clean" else 0.005, 4)}
    return problem, scene, told


def row_of(curve_number, world, taken):
    """Whether the intervals of one posterior hold the truth, and how wide they are (ln)."""
    problem, scene, told = problem_of(curve_number, world, taken)
    begin = time.process_time()
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # what did not converge is counted
        posterior = ul.sample(problem, rng=curve_number, max_steps=MOST_STEPS, progress=False)
    row = {"curve": curve_number, **told, "world": world, "taken": taken, "free": " ".join(problem.names)}
    row |= {"method": posterior.diagnostics.method, "converged": posterior.converged}
    row["seconds"] = round(time.process_time() - begin, 2)
    for short, name in (("E", "layer.E"), ("h", "layer.thickness")):
        if name in problem.names:
            low, high = np.quantile(posterior.of(name), (0.025, 0.975))
            row[f"{short}_inside"] = int(low < scene.parameters[name] < high)
            row[f"{short}_width"] = round(float(np.log(high / low)), 4)
    return row


def run(first, curves):
    """Every case of every curve that is not there yet."""
    known = set()
    if ROWS.exists():
        rows = pd.read_csv(ROWS)
        known = set(zip(rows["curve"], rows["world"], rows["taken"], strict=True))
    else:
        ROWS.write_text(",".join(FIELDS) + "\n", encoding="utf-8")
    for number in range(first, first + curves):
        for world, taken in CASES[number // 2 % 2]:
            if (number, world, taken) in known:
                continue
            try:
                row = row_of(number, world, taken)
            except ul.UnderlayError as error:
                row = {"curve": number, "world": world, "taken": taken, "method": type(error).__name__}
            with ROWS.open("a", newline="", encoding="utf-8") as file:
                csv.DictWriter(file, FIELDS).writerow(row)
            sys.stderr.write(f"{row}\n")


def summary():
    """Coverage (%) of every case by what is free, and its median width (ln)."""
    rows = pd.read_csv(ROWS)
    rows["free_h"] = rows["free"].str.contains("thickness")
    lines = []
    for (world, taken, free_h), part in rows.groupby(["world", "taken", "free_h"], sort=False):
        line = {
            "world": world,
            "noise": taken,
            "thickness": "free" if free_h else "known",
            "curves": len(part),
        }
        line["converged"] = int(part["converged"].astype(bool).sum())
        for short in ("E", "h") if free_h else ("E",):
            inside = part[f"{short}_inside"].dropna()
            line[f"{short} covered"] = round(100.0 * inside.mean(), 1)
            line[f"{short} width"] = round(float(part[f"{short}_width"].median()), 4)
        line["median seconds"] = round(float(part["seconds"].median()), 2)
        lines.append(line)
    table = pd.DataFrame(lines).sort_values(["world", "noise", "thickness"])
    table.to_csv(SUMMARY, index=False)
    sys.stdout.write(table.to_string(index=False) + "\n")


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("what", choices=["run", "summary"])
    parser.add_argument("--curves", type=int, default=100)
    parser.add_argument("--first", type=int, default=0)
    arguments = parser.parse_args()
    if arguments.what == "run":
        run(arguments.first, arguments.curves)
    else:
        summary()


if __name__ == "__main__":
    main()
