"""What the sampler costs and whether its answers are right, as commands whose results are kept beside them.

    python tests/studies/posterior_recipe.py benchmark --rounds 6   # results/posterior_benchmark.json
    python tests/studies/posterior_recipe.py random --count 60   # results/posterior_random.csv; stop it any time
    python tests/studies/posterior_recipe.py pairs --seeds 1 2 5   # results/posterior_pairs.csv
    python tests/studies/posterior_recipe.py far        # results/posterior_far.csv
    python tests/studies/posterior_recipe.py averaged   # results/posterior_averaged.json

The benchmark is the posterior of E, thickness, E2 and contact point of a layer on an elastic base, 500 points. The
moves of before (`moves()` without the mixture), once, then what is sampled by default (a chain with weighted draws
beside it, which are the answer where the two agree) and weighted draws alone, of a seed a round, in one process.
What counts is the effective sample of the slowest tail per processor second, Kish's of weighted draws, and how far
each quantile is from quadrature (`support/posterior_quadrature.py`, no chain and no draws), in standard deviations.

The random posteriors have two to five free parameters; each is sampled as anybody would, and every 2.5, 50 and
97.5 % quantile compared with quadrature. A row is written as it is made. The quadrature keeps the best 20,000 of
its cells while they are large: with 2,000 it lost a thin wing of seed 16, where the lower quantile of ln h went
from -9.541 to -9.574 (its standard deviation is 0.101), and weighted draws have it at -9.576.

Pairs: the same posteriors with 60 and with 80 % of the steps proposing from the mixture, in turns in one process:
what a posterior costs is told by ratios where a machine is busy.

Averaged: two samples whose noise nobody states, so that noise and misfit are averaged over. What `sample` answers
is compared with 60,000 draws of a mixture half as wide again that is not aimed (`reference_error`, told by the
draws themselves), and with a chain.

Far: what a density costs (us) in batches of 64 near the scene's values, at 512 draws of the prior, whose tables are
not there yet, and at the same again.
"""

import argparse
import csv
import json
import os
import sys
import time
import warnings
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pandas as pd

HERE = Path(__file__).resolve().parent
sys.path[:0] = [str(HERE), str(HERE.parent), str(HERE.parent.parent / "src")]

from sampling_speed import layered  # noqa: E402  # after the path is set

import underlay as ul  # noqa: E402
from support.posterior_quadrature import LEVELS, reference  # noqa: E402
from support.random_posteriors import random_problem  # noqa: E402
from underlay.inference.from_files import problem_from, read_for, weak_bounds  # noqa: E402
from underlay.inference.ridge.importance import weigh  # noqa: E402
from underlay.inference.ridge.march import PriorNormal  # noqa: E402
from underlay.inference.ridge.mixture import WeightedDraws  # noqa: E402
from underlay.inference.sampling import run as moves  # noqa: E402
from underlay.inference.sampling.convergence import tail_size  # noqa: E402
from underlay.inference.sampling.counted import CountedDensity  # noqa: E402
from underlay.inference.sampling.weighted import Ridges  # noqa: E402
from underlay.scene.scene_file import read_scene_file  # noqa: E402

RESULTS = HERE / "results"
# Cells of a quadrature that are kept while they are large: a thin wing is lost among 2,000.
_KEPT = 20_000


def without_mixture(problem, steps):
    """A chain of the moves of before: no ridge is looked for."""
    learn = Ridges.seek

    def only_the_fit(self):
        found = learn(self)
        self.proposal = None
        return found

    Ridges.seek = only_the_fit
    try:
        return ul.sample(problem, max_steps=steps, method="emcee")
    finally:
        Ridges.seek = learn


def worth(posterior, seconds):
    """Effective draws of the slowest tail, and per processor second."""
    if posterior.diagnostics.weighted:
        size = posterior.diagnostics.importance.effective
    else:
        size = min(tail_size(posterior.of(name)) for name in posterior.names)
    return {"processor seconds": round(seconds, 3), "effective": round(size), "per second": size / seconds}


def off(posterior, answer):
    """Distance of every quantile from the reference in standard deviations of the logarithm, or of the number."""
    rows = {}
    for name in posterior.names:
        draws, exact = posterior.of(name).ravel(), answer.quantiles[name]
        if name.startswith(("layer.", "substrate.")):
            draws, exact = np.log(draws), np.log(exact)
        rows[name] = ((np.quantile(draws, LEVELS) - exact) / draws.std()).round(4).tolist()
    return rows


def timed(function, *arguments, **options):
    begin = time.process_time()
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # a chain that did not converge is counted, not hidden
        result = function(*arguments, **options)
    return result, time.process_time() - begin


def benchmark(old_steps, rounds):
    ul.sample(layered(), max_steps=100)  # what is loaded once
    answer = reference(layered())
    table = {
        "load before": os.getloadavg()[0],
        "quadrature": vars(answer) | {"quantiles": {n: q.tolist() for n, q in answer.quantiles.items()}},
    }
    kinds = {
        f"moves of before, {old_steps} steps": lambda p, _: without_mixture(p, old_steps),
        "by default": lambda p, seed: ul.sample(p, rng=seed),
        "weighted draws alone": lambda p, seed: ul.sample(p, rng=seed, method="importance"),
    }
    before, *now = kinds
    for seed in range(rounds):
        for name in now if seed else kinds:
            posterior, seconds = timed(kinds[name], layered(), seed)
            row = worth(posterior, seconds)
            row |= {"converged": posterior.converged, "off": off(posterior, answer)}
            row["worst"] = float(np.abs(list(row["off"].values())).max())
            if posterior.log_evidence is not None:
                row["log_evidence"] = list(posterior.log_evidence)
            table.setdefault(name, []).append(row)
    middle = {name: float(np.median([row["per second"] for row in table[name]])) for name in kinds}
    table["effective per second over the moves of before"] = {n: middle[n] / middle[before] for n in now}
    text = json.dumps(table, indent=1) + "\n"
    (RESULTS / "posterior_benchmark.json").write_text(text, encoding="utf-8")
    print(text)  # a command


COLUMNS = (
    "seed", "parameters", "free", "converged", "steps", "seconds", "evaluations", "accepted", "k_hat", "optima",
    "worst", "where", "reference_error", "independent", "log_evidence_off", "log_evidence_error", "reason",
)  # fmt: skip


def one(seed):
    problem = random_problem(seed)
    posterior, seconds = timed(ul.sample, problem)
    answer = reference(problem, _KEPT)
    rows = off(posterior, answer)
    worst = max(rows, key=lambda name: np.abs(rows[name]).max())
    d, told = posterior.diagnostics, posterior.log_evidence
    found = d.importance
    return {
        "seed": seed,
        "parameters": len(problem.names),
        "free": " ".join(problem.names),
        "converged": posterior.converged,
        "steps": d.steps,
        "seconds": round(seconds, 2),
        "evaluations": d.evaluations,
        "accepted": bool(found and found.accepted),
        "k_hat": round(found.k_hat, 2) if found else "",
        "optima": found.optima if found else "",
        "worst": round(float(np.abs(rows[worst]).max()), 3),
        "where": worst,
        "reference_error": round(answer.error, 4),
        "independent": round(d.moves.get("IndependenceMove", float("nan")), 3),
        "log_evidence_off": round(told.value - answer.log_evidence, 3) if told else "",
        "log_evidence_error": round(told.error, 3) if told else "",
        "reason": (found.refused if found else "no mixture") or d.reason,
    }


def random(count, first):
    path = RESULTS / "posterior_random.csv"
    known = set(pd.read_csv(path)["seed"]) if path.exists() else set()
    if not known:
        path.write_text(",".join(COLUMNS) + "\n", encoding="utf-8")
    for seed in range(first, first + count):
        if seed in known:
            continue
        try:
            row = one(seed)
        except (ul.FitError, ul.UnderlayError) as error:
            row = dict.fromkeys(COLUMNS, "") | {"seed": seed, "reason": f"{type(error).__name__}: {error}"}
        with path.open("a", newline="", encoding="utf-8") as file:
            csv.DictWriter(file, COLUMNS).writerow(row)
        print(row, flush=True)  # a command


def pairs(seeds):
    ul.sample(random_problem(0), max_steps=100)  # what is loaded once
    path = RESULTS / "posterior_pairs.csv"
    kept, rows = moves._INDEPENDENT, pd.read_csv(path).to_dict("records") if path.exists() else []
    for seed in seeds:
        row = {"seed": seed}
        for share in (0.6, 0.8):
            moves._INDEPENDENT = share
            posterior, seconds = timed(ul.sample, random_problem(seed))
            row |= {f"seconds_{share}": round(seconds, 2), f"steps_{share}": posterior.diagnostics.steps}
        moves._INDEPENDENT = kept
        rows = [known for known in rows if known["seed"] != seed] + [row]
        pd.DataFrame(rows).to_csv(path, index=False)
        print(row, flush=True)  # a command


def averaged(seeds):
    """Answers of two samples as they are asked for, then by chains."""
    table = {"load before": os.getloadavg()[0]}
    path = RESULTS / "posterior_averaged.json"
    for asked in [*[(None, seed) for seed in range(seeds)], ("emcee", 0)]:
        for name in ("gel_on_glass", "cartilage_on_bone"):
            folder = HERE.parents[1] / "data_samples"
            file = read_scene_file(folder / f"{name}.toml")
            curve = read_for(file, folder / f"{name}.csv")
            problem = problem_from(file, curve, weak_bounds(file, curve))
            if name not in table:
                long = long_run(problem)
                table[name] = {
                    "reference": problem.physical(long.quantiles()).T.tolist(),
                    "reference_error": float(long.quantile_errors().max()),
                    "reference_log_evidence": long.log_evidence,
                    "rows": [],
                }
            table[name]["rows"].append(averaged_row(problem, table[name]["reference"], *asked))
            path.write_text(json.dumps(table, indent=1) + "\n", encoding="utf-8")
            print(name, table[name]["rows"][-1], flush=True)  # a command


def averaged_row(problem, quantiles, method, seed):
    """One answer against quantiles (parameters, levels)."""
    posterior, seconds = timed(ul.sample, problem, rng=seed, method=method, progress=False)
    exact = SimpleNamespace(quantiles=dict(zip(problem.names, np.array(quantiles), strict=True)))
    rows = off(posterior, exact)
    return {
        "asked": method or "what is best",
        "answered by": posterior.diagnostics.method,
        "converged": posterior.converged,
        "processor seconds": round(seconds, 2),
        "evaluations": posterior.diagnostics.evaluations,
        "off": rows,
        "worst": float(np.abs(list(rows.values())).max()),
        "log_evidence": posterior.log_evidence,
        "reason": posterior.diagnostics.reason,
    }


def long_run(problem):
    """Weighted draws of a mixture of another seed, half as wide again."""
    posed = ul.marginalised(problem)
    ridges = Ridges(posed, CountedDensity(posed), np.random.default_rng(99))
    ridges.seek()
    mixture, rng = ridges.mixture.widened(1.5), np.random.default_rng(98)
    return WeightedDraws.joined(
        [weigh(ridges.target, ridges.coordinates, mixture, 20_000, rng) for _ in range(3)]
    )


def far(count):
    rows = []
    for seed in range(count):
        problem = random_problem(seed)
        density, coordinates = CountedDensity(problem), PriorNormal(problem)
        rng = np.random.default_rng(seed)
        places = {
            "near": problem.start + 1e-3 * rng.standard_normal((512, coordinates.size)),
            "over the prior": coordinates.scaled(rng.standard_normal((512, coordinates.size))),
        }
        places["over the prior again"] = places["over the prior"]
        density.peek(places["near"][:64])
        row = {"seed": seed, "free": " ".join(problem.names)}
        for name, vectors in places.items():
            begin = time.process_time()
            for part in np.split(vectors, 8):
                density.peek(part)
            row[name] = round((time.process_time() - begin) / 512.0 * 1e6, 1)
        rows.append(row)
    pd.DataFrame(rows).to_csv(RESULTS / "posterior_far.csv", index=False)
    print(pd.DataFrame(rows).to_string())  # a command


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("what", choices=["benchmark", "random", "pairs", "far", "averaged"])
    parser.add_argument("--count", type=int, default=60)
    parser.add_argument("--first", type=int, default=0)
    parser.add_argument("--seeds", type=int, nargs="*", default=range(60))
    parser.add_argument("--old-steps", type=int, default=6000)
    parser.add_argument("--rounds", type=int, default=1)
    arguments = parser.parse_args()
    if arguments.what == "benchmark":
        benchmark(arguments.old_steps, arguments.rounds)
    elif arguments.what == "pairs":
        pairs(arguments.seeds)
    elif arguments.what == "far":
        far(arguments.count)
    elif arguments.what == "averaged":
        averaged(arguments.rounds + 2)
    else:
        random(arguments.count, arguments.first)


if __name__ == "__main__":
    main()
