"""What a sampling costs: the exact law against bare emcee on plain Hertz, in one run on one core.

    python tests/studies/sampling_speed.py

64 walkers, 500 points, four free parameters each. Ours: E, thickness, E2 and contact of a layer on an elastic
base, exact law at rtol 1e-4, `ul.sample` with its moves, checks and bookkeeping. Bare: E, contact, baseline
and slope of Hertz's formula, vectorised over the walkers, emcee's default move. The two take turns, processor
time is counted, and the median of the ratios is kept with the effective samples each yields per second; then
two processes against one on the wall clock.
"""

import argparse
import json
import multiprocessing
import os
import platform
import sys
import time
import warnings
from pathlib import Path

import emcee
import numpy as np

HERE = Path(__file__).resolve().parent
sys.path[:0] = [str(HERE.parent.parent / "src")]

import underlay as ul  # noqa: E402
from underlay.inference.sampling.diagnostics import autocorrelation_times  # noqa: E402

WALKERS, STEPS, POINTS, ROUNDS = 64, 2000, 500, 3
SOLVER = ul.Auto(1e-4)


def layered():
    scene = ul.Scene(ul.Paraboloid(1e-3), ul.Layer(ul.Isotropic(1e6, 0.5), 5e-4), ul.Isotropic(1e7, 0.4))
    depth = np.linspace(-1e-5, 1e-4, POINTS)
    noise = ul.Noise(force=0.01 * float(scene.force(1e-4, solver=SOLVER)))
    curve = ul.synthesize(scene, depth, noise, 1, solver=SOLVER)
    free = {
        "layer.E": ul.LogUniform(1e4, 1e8),
        "layer.thickness": ul.LogUniform(1e-4, 5e-3),
        "substrate.E": ul.LogUniform(1e5, 1e9),
        "instrument.contact_depth": ul.Uniform(-1e-5, 1e-5),
    }
    return ul.Problem(scene, curve, free, noise, solver=SOLVER)


def ours(steps=STEPS):
    begin = time.process_time()
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # so few steps have not converged, and this is not asked here
        posterior = ul.sample(layered(), walkers=WALKERS, max_steps=steps)
    seconds = time.process_time() - begin
    details = posterior.diagnostics
    time_per_step = seconds / details.steps
    return time_per_step, 1.0 / (max(details.autocorrelation_time) * time_per_step / WALKERS)


def bare(steps=STEPS):
    rng = np.random.default_rng(0)
    depth = np.linspace(-0.1, 1.0, POINTS)
    data = np.maximum(depth, 0.0) ** 1.5 + 0.01 * rng.standard_normal(POINTS)

    def log_density(q):
        w = np.maximum(depth - 0.1 * q[:, 1, None], 0.0)
        model = np.exp(q[:, 0, None]) * w**1.5 + 0.1 * q[:, 2, None] + 0.1 * q[:, 3, None] * depth
        return np.where(
            np.abs(q).max(axis=1) < 5.0, -0.5 * (((data - model) / 0.01) ** 2).sum(axis=1), -np.inf
        )

    begin = time.process_time()
    sampler = emcee.EnsembleSampler(WALKERS, 4, log_density, vectorize=True)
    sampler.run_mcmc(0.01 * rng.standard_normal((WALKERS, 4)), steps)
    time_per_step = (time.process_time() - begin) / steps
    chain = sampler.get_chain(discard=steps // 4)
    slowest = max(autocorrelation_times(chain))
    return time_per_step, WALKERS / (slowest * time_per_step)


def side_by_side():
    """Steps per second of two processes over those of one, on the wall clock."""
    rounds = []
    with multiprocessing.get_context("spawn").Pool(2) as pool:
        pool.map(warm, range(2), chunksize=1)
        for _ in range(ROUNDS):
            begin = time.perf_counter()
            pool.apply(ours, (STEPS,))
            alone = time.perf_counter() - begin
            begin = time.perf_counter()
            pool.map(ours, [STEPS, STEPS], chunksize=1)
            rounds.append(2.0 * alone / (time.perf_counter() - begin))
    return float(np.median(rounds))


def warm(_):
    return ours(20)


def one_core():
    """Times per step and effective samples per second of both, medians of rounds that take turns."""
    ours(20)
    bare(20)
    rounds = [(ours(), bare()) for _ in range(ROUNDS)]
    mine, theirs = (np.median([pair[i] for pair in rounds], axis=0) for i in (0, 1))
    return {
        "exact law, ms per step": 1e3 * mine[0],
        "bare emcee on Hertz, ms per step": 1e3 * theirs[0],
        "ratio of times per step": float(np.median([mine[0] / theirs[0] for mine, theirs in rounds])),
        "exact law, effective samples per second": mine[1],
        "bare emcee on Hertz, effective samples per second": theirs[1],
    }


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--output", type=Path, default=HERE / "results" / "sampling_speed.json")
    arguments = parser.parse_args()
    results = {
        "machine": f"{platform.machine()}, {os.cpu_count()} processors, Python {platform.python_version()}",
        "walkers": WALKERS,
        "steps": STEPS,
        "points": POINTS,
        "load before": os.getloadavg()[0],
        **one_core(),
        # Other work on the machine spoils this one: it is a ratio of wall times.
        "two processes, steps per second over one": side_by_side(),
    }
    text = json.dumps(results, indent=2) + "\n"
    arguments.output.write_text(text, encoding="utf-8")
    sys.stdout.write(text)


if __name__ == "__main__":
    main()
