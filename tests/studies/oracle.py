"""The best coverage that any procedure can have in a disturbed world which keeps clean curves short.

    python tests/studies/oracle.py [--scenes 100] [--world relaxation ...] [--widths 1.4 2 3] [--seed 16]
                                   [--output tests/studies/results/oracle.csv]

The oracle knows what no procedure does: the noise, the law, that there is this one disturbance or none, its exact
shape, and the distribution its size is drawn from in `tests/support/worlds.py` (of a half-space taken for a layer:
the layers and bases that a user's tests with this tip and depth have, `tests/support/user_scenes.py`). Scenes are
those of `intervals.py`: modulus, contact and baseline free.

A disturbance j moves the white fit's ln E by b_j of its standard deviations and leaves a residual r_j (in standard
deviations of the noise); both are found by fitting it without noise. With noise the fit has a further unit normal
deviate and the residual a product x_j = r . r_j of mean r_i . r_j, were it disturbance i, and covariance r_i . r_j.
So with u = ln E - fitted ln E, and against a clean curve's density at the same residual,

    p_clean(u) = phi(u),    p_disturbed(u) = mean_j exp(x_j - r_j . r_j / 2) phi(u + b_j),

and among all sets of u that a procedure may state, those of least clean width for their coverages are
p_disturbed + m p_clean >= l (Neyman and Pearson; m and l so that the mean clean width is as asked, in units of
white noise's, and at least 95 % of clean sets hold the truth). Sets, not intervals, and true sizes among the draws:
the figures are bounds from above. The mean width is what is bounded: a bound on the median alone lets half of the
clean curves be as wide as one likes. "wrong %": disturbed curves that the likelihood ratio finds, at one false
verdict in 200 clean curves. "held or wrong %": that verdict or else such a set.
"""

from __future__ import annotations

import argparse
import sys
from pathlib import Path

import numpy as np
import pandas as pd

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

import underlay as ul
from support.user_scenes import KINDS, user_test
from support.worlds import WORLDS, Clean

# Sizes of a disturbance on one scene, where each costs a law and where not; noises on each; readings of a curve.
_LAYERS, _DRAWS, _NOISES, _READINGS = 40, 150, 12, 300
# Grid of u: step and reach, in standard deviations of the white fit. Further out its own reach is one step.
_STEP, _REACH = 0.25, 400.0
_LEVEL, _FALSE = 0.95, 0.005
_TRIES = 2000


def white_fit(law, x, force, sigma):
    """ln of the factor on the law (with its standard deviation) and the residuals over sigma of the white fit."""
    deepest = float(x.max())
    grid = np.linspace(-0.4, 0.4, 81) * deepest
    rises = law.force(np.maximum(x - grid[:, None], 0.0).ravel()).reshape(len(grid), -1)
    rises -= rises.mean(axis=1, keepdims=True)
    level = force - force.mean()
    gained = (rises @ level) ** 2 / (rises**2).sum(axis=1)
    contact = float(grid[np.argmax(gained)])
    for _ in range(6):
        w = np.maximum(x - contact, 0.0)
        P, S = law.force_and_stiffness(w)
        factor = float((P - P.mean()) @ level / ((P - P.mean()) @ P))
        columns = np.column_stack((factor * P, -factor * S, np.ones_like(P)))
        step, *_ = np.linalg.lstsq(columns, force - factor * P, rcond=None)
        contact += float(np.clip(step[1], -0.05 * deepest, 0.05 * deepest))
    residual = force - columns @ np.linalg.lstsq(columns, force, rcond=None)[0]
    spread = float(np.linalg.inv(columns.T @ columns)[0, 0] ** 0.5 * sigma)
    return np.log(factor), spread, residual / sigma


def layers(kind, scene, depth, rng):
    """Scenes of the same kind and tip that a test to this depth could be of: depth is 0.03 to 0.3 of min(R, h)."""
    R, found = scene.indenter.radius, [scene]
    for _ in range(_TRIES):
        other = KINDS[kind](rng)
        if kind == "soft base":
            # Its tip is drawn with the layer: the layer that has this tip.
            other = other.with_values({"layer.thickness": other.layer.thickness * R / other.indenter.radius})
        end = min(R, other.layer.thickness)
        # The depth is uniform between these: its density falls as 1/end.
        if not 0.03 * end < depth < 0.3 * end or rng.uniform() * end > depth / 0.3:
            continue
        found.append(other.with_values({"indenter.radius": R, "layer.nu": scene.layer.material.nu}))
        if len(found) == _LAYERS:
            break
    return found


def disturbances(world, test, rng):
    """Shifts b (j,) in standard deviations, residuals r (j, n), and the scene's own place among them."""
    kind, scene, depth, points, noise = test
    thin = max(1, points // _READINGS)
    clean = Clean.of(scene, depth, points // thin)
    sigma = noise * clean.top / thin**0.5
    if world == "Hertz on a layer":
        bare = ul.Scene(scene.indenter, ul.Layer(scene.layer.material, np.inf))
        curves = []
        for other in layers(kind, scene, depth, rng):
            try:
                own = Clean.of(other, depth, points // thin)
            except ul.UnderlayError:
                # Wider than a law is known for.
                continue
            scale = clean.top / own.top
            curves.append(
                (own.force * scale, np.log(scale * other.layer.material.E / scene.layer.material.E))
            )
    else:
        bare = scene
        curves = [(clean.force + WORLDS[world][0](clean, rng), 0.0) for _ in range(_DRAWS)]
    law = bare.contact_law(min(1.45 * depth, 0.9 * scene.indenter.radius))
    fits = [(white_fit(law, clean.depth, force, sigma), log_E) for force, log_E in curves]
    shift = np.array([(ln - log_E) / spread for (ln, spread, _), log_E in fits])
    return shift, np.array([residual for (_, _, residual), _ in fits])


def densities(shift, residuals, truths, rng):
    """p_disturbed (c, u) of noisy curves whose truths are draws (c,), -1: clean; log likelihood ratios (c,)."""
    products = residuals @ residuals.T
    values, vectors = np.linalg.eigh(products)
    root = vectors * np.sqrt(np.maximum(values, 0.0))
    x = rng.standard_normal((len(truths), len(root))) @ root.T
    x += np.where(truths[:, None] < 0, 0.0, products[truths])
    log = x - 0.5 * np.diagonal(products)
    top = log.max(axis=1, keepdims=True)
    ratio = top[:, 0] + np.log(np.exp(log - top).mean(axis=1))
    u = places()
    kernel = np.exp(-0.5 * (u + np.clip(shift, -_REACH, _REACH)[:, None]) ** 2) / np.sqrt(2.0 * np.pi)
    return np.exp(np.minimum(log, 80.0)) @ kernel / len(shift), ratio


def places():
    """Grid of u."""
    return np.arange(-_REACH - 5.0, _REACH + 5.0, _STEP)


def gathered(world, args):
    """Densities of clean and disturbed curves (c, u), their likelihood ratios, and where the truth of each is."""
    found = {"clean": [], "disturbed": []}
    for number in range(args.scenes):
        rng = np.random.default_rng([args.seed, number])
        test = user_test(rng)
        try:
            shift, residuals = disturbances(world, test, rng)
        except (ul.UnderlayError, np.linalg.LinAlgError) as error:
            print(f"{world} {number}: {error}")
            continue
        truths = rng.integers(len(shift), size=_NOISES)
        if world == "Hertz on a layer":
            truths[:] = 0
        for name, own in (("clean", np.full(_NOISES, -1)), ("disturbed", truths)):
            density, ratio = densities(shift, residuals, own, rng)
            moved = np.where(own < 0, 0.0, np.clip(shift, -_REACH, _REACH)[own])
            found[name].append((density.astype(np.float32), ratio, moved))
    return {name: [np.concatenate(part) for part in zip(*rows, strict=True)] for name, rows in found.items()}


def held(sets, moved):
    """Probability that each set (c, u) holds the truth, which is a unit normal deviate about -moved (c,)."""
    u = places()
    return np.array(
        [
            np.exp(-0.5 * (u[own] + b) ** 2).sum() * _STEP / np.sqrt(2.0 * np.pi)
            for own, b in zip(sets, moved, strict=True)
        ]
    )


def best(found, width):
    """Coverage of disturbed curves, and of those without a verdict or with one, at a mean clean width."""
    (pc, ratio_c, moved_c), (pd_, ratio_d, moved_d) = found["clean"], found["disturbed"]
    phi = (np.exp(-0.5 * places() ** 2) / np.sqrt(2.0 * np.pi)).astype(np.float32)
    unit = 2.0 * 1.959964

    def sets(m, level):
        return pc + m * phi >= level, pd_ + m * phi >= level

    def level_for(m):
        low, high = -60.0, 3.0
        for _ in range(30):
            middle = 0.5 * (low + high)
            wide = sets(m, np.exp(middle))[0].sum(axis=1).mean() * _STEP / unit
            low, high = (middle, high) if wide > width else (low, middle)
        return np.exp(high)

    low, high = -20.0, 20.0
    for _ in range(12):
        middle = 0.5 * (low + high)
        clean, _ = sets(np.exp(middle), level_for(np.exp(middle)))
        enough = held(clean, moved_c).mean() >= _LEVEL
        low, high = (low, middle) if enough else (middle, high)
    clean, disturbed = sets(np.exp(high), level_for(np.exp(high)))
    coverage = held(disturbed, moved_d)
    wrong = ratio_d > np.quantile(ratio_c, 1.0 - _FALSE)
    return {
        "clean held %": 100.0 * held(clean, moved_c).mean(),
        "clean width": clean.sum(axis=1).mean() * _STEP / unit,
        "held %": 100.0 * coverage.mean(),
        "wrong %": 100.0 * wrong.mean(),
        "held or wrong %": 100.0 * np.where(wrong, 1.0, coverage).mean(),
    }


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--scenes", type=int, default=100)
    parser.add_argument("--seed", type=int, default=16)
    parser.add_argument("--world", nargs="+", default=["relaxation", "Hertz on a layer", "fringes"])
    parser.add_argument("--widths", nargs="+", type=float, default=[1.4, 2.0, 4.0])
    parser.add_argument("--output", type=Path, default=None)
    args = parser.parse_args()
    lines = []
    for world in args.world:
        found = gathered(world, args)
        for width in args.widths:
            line = {
                "world": world,
                "seed": args.seed,
                "scenes": len(found["clean"][1]) // _NOISES,
                "width": width,
            }
            lines.append(line | {name: round(float(value), 2) for name, value in best(found, width).items()})
            print(lines[-1], flush=True)
    if args.output is not None:
        pd.DataFrame(lines).to_csv(args.output, index=False)


if __name__ == "__main__":
    main()
