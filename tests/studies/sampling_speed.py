"""What a sampling costs: the exact law against bare emcee on plain Hertz, in one run on one core.

    python tests/studies/sampling_speed.py

64 walkers, 500 points, four free parameters each. Ours: E, thickness, E2 and contact of a layer on an elastic
base, exact law at rtol 1e-4, `ul.sample` with its moves, checks and bookkeeping. Bare: E, contact, baseline
and slope of Hertz's formula, vectorised over the walkers, emcee's default move. The two take turns, processor
time is counted, and the median of the ratios is printed with the effective samples each yields per second.
"""

import multiprocessing
import sys
import time
import warnings
from pathlib import Path

import emcee
import numpy as np

HERE = Path(__file__).resolve().parent
sys.path[:0] = [str(HERE.parent.parent / "src")]

from underlay.data.noise import Noise  # noqa: E402  # after the path is set
from underlay.data.synthetic import synthesize  # noqa: E402
from underlay.inference.priors import LogUniform, Uniform  # noqa: E402
from underlay.inference.problem import Problem  # noqa: E402
from underlay.inference.sampling.convergence import autocorrelation_time  # noqa: E402
from underlay.inference.sampling.run import sample  # noqa: E402
from underlay.mechanics.accuracy import Accuracy  # noqa: E402
from underlay.mechanics.indenters import Paraboloid  # noqa: E402
from underlay.mechanics.materials import Isotropic, Layer  # noqa: E402
from underlay.scene.scene import Scene  # noqa: E402

WALKERS, STEPS, POINTS, ROUNDS = 64, 2000, 500, 1
ACCURACY = Accuracy(1e-4)


def layered():
    scene = Scene(Paraboloid(1e-3), Layer(Isotropic(1e6, 0.5), 5e-4), Isotropic(1e7, 0.4))
    depth = np.linspace(-1e-5, 1e-4, POINTS)
    noise = Noise(force=0.01 * float(scene.force(1e-4, accuracy=ACCURACY)))
    curve = synthesize(scene, depth, noise, 1, accuracy=ACCURACY)
    free = {
        "layer.E": LogUniform(1e4, 1e8),
        "layer.thickness": LogUniform(1e-4, 5e-3),
        "substrate.E": LogUniform(1e5, 1e9),
        "instrument.contact_depth": Uniform(-1e-5, 1e-5),
    }
    return Problem(scene, curve, free, noise, accuracy=ACCURACY)


def ours(steps=STEPS):
    begin = time.process_time()
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # so few steps have not converged, and this is not asked here
        posterior = sample(layered(), walkers=WALKERS, max_steps=steps)
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
    slowest = max(autocorrelation_time(chain[..., i]) for i in range(4))
    return time_per_step, WALKERS / (slowest * time_per_step)


def side_by_side():
    """Posteriors per second of two processes over that of one, on the wall clock."""
    begin = time.perf_counter()
    ours()
    alone = time.perf_counter() - begin
    with multiprocessing.get_context("spawn").Pool(2) as pool:
        pool.map(warm, range(2))
        begin = time.perf_counter()
        pool.map(ours, [STEPS, STEPS])
        both = time.perf_counter() - begin
    return 2.0 * alone / both


def warm(_):
    return WALKERS


def main():
    ours(20)
    bare(20)
    rounds = [(ours(), bare()) for _ in range(ROUNDS)]
    ratio = np.median([mine[0] / theirs[0] for mine, theirs in rounds])
    mine, theirs = np.median([a for a, _ in rounds], axis=0), np.median([b for _, b in rounds], axis=0)
    print(
        f"per step: exact law {1e3 * mine[0]:.2f} ms, bare Hertz {1e3 * theirs[0]:.2f} ms, ratio {ratio:.2f}"
    )
    print(f"effective samples per second: exact law {mine[1]:.0f}, bare Hertz {theirs[1]:.0f}")
    if "--pair" in sys.argv:
        print(f"two processes over one, wall clock: {side_by_side():.2f}")


if __name__ == "__main__":
    main()
