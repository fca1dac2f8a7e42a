"""Random cases of the mechanics against references of their own: how many are outside the stated error.

    python tests/studies/torture.py [--cases 2000] [--seed 45] [--kinds kernel force ...]
                                    [--output tests/studies/results/torture.json]

- kernel: 1 - L of a layer of any roots against 80 digits by another formula; 1e-13 of the larger of 1 and |1 - L|;
- slices: the kernel of a layer against that of a stack of its slices, transversely isotropic; 1e-12 likewise;
- force: the exact law against one solution of twice the nodes at one radius; the law's error estimate;
- stuck: a tip that sticks, at a relative error of 1e-5, against 1e-8; both error estimates;
- slope: stiffness against a fourth-order difference of the force, at 1e-8, in both; 1e-6;
- scaling: all lengths times one number, all moduli times another; 1e-12;
- permutation: depths in another order; equal but for rounding, 1e-14.

Refusals count as refused. The stored counts are those that `tests/test_kernel.py` and its neighbours rest on.
"""

from __future__ import annotations

import argparse
import json
import sys
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

import underlay as ul
from support.reflected_kernel import constants_of_roots, random_material, reflected
from underlay.errors import UnderlayError
from underlay.mechanics.exact.contact_problem import weights_over_depth
from underlay.mechanics.exact.nodes import Resolution, even_rule
from underlay.mechanics.exact.punch_solution import PunchSolution, proved_resolution
from underlay.mechanics.kernel import LayerKernel

Random = np.random.Generator


def kernel(rng: Random) -> float:
    """Error over what is allowed."""
    layer = constants_of_roots(10.0 ** rng.uniform(-2, 2), 10.0 ** rng.uniform(-4, 7), rng)
    base, soft = constants_of_roots(1.0, 10.0 ** rng.uniform(-2, 2), rng), 10.0 ** rng.uniform(-8, 4)
    body = None if rng.random() < 0.3 else base._replace(c=base.c / soft, g=base.g * soft, S=base.S / soft)
    u = 10.0 ** rng.uniform(-5, 1, 5) / np.sqrt(layer.p)
    exact = reflected(u, layer, body)
    error = np.abs(LayerKernel(layer, body).values(u) - exact) / np.maximum(1.0, np.abs(exact))
    return float(error.max()) / 1e-13


def slices(rng: Random) -> float:
    """Error over what is allowed."""
    layer, base = random_material(rng), ul.RIGID if rng.random() < 0.3 else random_material(rng)
    cuts = rng.dirichlet(np.ones(3))
    u = 10.0 ** rng.uniform(-6, 1, 20) / np.sqrt(layer.plane_constants.p)
    whole = ul.SubstrateKernel(layer, base).one_minus_L(u)
    cut = ul.StackKernel(tuple(ul.Layer(layer, float(t)) for t in cuts), base).one_minus_L(cuts[0] * u)
    return float((np.abs(cut - whole) / np.maximum(1.0, np.abs(whole))).max()) / 1e-12


def _case(rng: Random, widest: float) -> tuple[ul.Indenter, ul.Layer, ul.Base, float]:
    """A tip, a layer of thickness 1 and a base, and a depth that makes a/h about 0.1 to `widest`."""
    tips = (ul.Paraboloid(0.5), ul.Cone(1.1), ul.Sphere(60.0), ul.PowerLaw(float(rng.uniform(1.0, 4.0)), 1.0))
    tip = tips[rng.integers(4)]
    layer = ul.Layer(ul.Isotropic(1.0, float(rng.choice([0.0, 0.3, 0.45, 0.5, rng.uniform(-0.5, 0.5)]))), 1.0)
    soft = ul.Isotropic(10.0 ** rng.uniform(-1.5, 3), rng.uniform(0.0, 0.5))
    base = ul.RIGID if rng.random() < 0.4 else soft
    radius = 0.1 * (10.0 * widest) ** rng.random()
    return tip, layer, base, 0.8 * float(tip.abel(np.array([radius]))[0])


def force(rng: Random) -> float:
    """Error over what is allowed."""
    tip, layer, base, depth = _case(rng, 12.0)
    law = ul.contact_law(tip, layer, base, max_depth=depth, solver=ul.Exact(10.0 ** rng.uniform(-9, -3)))
    at = float(rng.uniform(0.1, 1.0)) * depth
    body, radius = ul.Contact.of(tip, layer, base).kernel, float(law.contact_radius(at))
    fine = proved_resolution(body, radius, 1e-11).finer()
    weights = _weights(tip, fine, radius)
    punch = PunchSolution.solve(body, np.array([radius]), fine)
    w, P = (float(one[0]) * float(tip.abel(np.array(radius))) for one in punch.depth_and_force(weights))
    # The radius of the law has its error, the force on it at one depth a second-order one.
    said = law.force(w) if w <= law.max_depth else law.force(at) + law.stiffness(at) * (w - at)
    return abs(float(said) / (4.0 * layer.material.theta * radius * P) - 1.0) / law.error_estimate


def _weights(tip: ul.Indenter, nodes: Resolution, radius: float) -> np.ndarray:
    return weights_over_depth(tip, tip.power_law, even_rule(nodes.radial), np.array([radius]))


def stuck(rng: Random) -> float:
    """Error over what is allowed."""
    tip, layer, base, depth = _case(rng, 12.0)
    rough, fine = (
        ul.contact_law(tip, layer, base, max_depth=depth, solver=ul.Stuck(rtol)) for rtol in (1e-5, 1e-8)
    )
    w = np.linspace(0.05, 1.0, 15) * depth
    error = np.abs(rough.force(w) / fine.force(w) - 1.0).max()
    return float(error) / (rough.error_estimate + fine.error_estimate)


def slope(rng: Random) -> float:
    """Error over what is allowed."""
    tip, layer, base, depth = _case(rng, 10.0)
    solver = ul.Stuck(1e-8) if rng.random() < 0.3 else ul.Exact(1e-8)
    law = ul.contact_law(tip, layer, base, max_depth=depth, solver=solver)
    if getattr(getattr(law, "curve", None), "jumps", ()):
        return 0.0
    w, step = np.linspace(0.1, 0.9, 9) * depth, 1e-3 * depth
    at = [law.force(w + k * step) for k in (-2, -1, 1, 2)]
    found = (at[0] - 8.0 * at[1] + 8.0 * at[2] - at[3]) / (12.0 * step)
    return float(np.abs(found / law.stiffness(w) - 1.0).max()) / 1e-6


def scaling(rng: Random) -> float:
    """Error over what is allowed."""
    _, layer, base, _ = _case(rng, 5.0)
    long, stiff = 10.0 ** rng.uniform(-9, 3), 10.0 ** rng.uniform(-6, 12)
    depth, radius = 10.0 ** rng.uniform(-3, 0.5), 10.0 ** rng.uniform(-1, 1)

    def body(of: ul.Base) -> ul.Base:
        return of if of is ul.RIGID else replace(of, E=stiff * of.E)

    own = ul.contact_law(ul.Paraboloid(radius), layer, base, max_depth=depth, solver=ul.Exact(1e-6))
    other = ul.contact_law(
        ul.Paraboloid(long * radius),
        ul.Layer(body(layer.material), long),
        body(base),
        max_depth=long * depth,
        solver=ul.Exact(1e-6),
    )
    w = np.linspace(0.05, 0.999, 9) * depth
    return float(np.abs(other.force(long * w) / (own.force(w) * long * long * stiff) - 1.0).max()) / 1e-12


def permutation(rng: Random) -> float:
    """Error over what is allowed."""
    tip, layer, base, depth = _case(rng, 5.0)
    law = ul.contact_law(tip, layer, base, max_depth=depth, solver=ul.Exact(1e-6))
    w, order = rng.uniform(-0.1, 1.0, 50) * depth, rng.permutation(50)
    straight, turned = law.force(w)[order], law.force(w[order])
    return float((np.abs(straight - turned) / np.abs(straight).max()).max()) / 1e-14


KINDS: dict[str, Callable[[Random], float]] = {
    one.__name__: one for one in (kernel, slices, force, stuck, slope, scaling, permutation)
}


def main() -> None:
    """Run the kinds, print and store the counts."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--cases", type=int, default=2000)
    parser.add_argument("--seed", type=int, default=45)
    parser.add_argument("--kinds", nargs="+", choices=KINDS, default=list(KINDS))
    parser.add_argument("--output", type=Path, default=Path(__file__).parent / "results" / "torture.json")
    asked = parser.parse_args()
    counts = json.loads(asked.output.read_text(encoding="utf-8")) if asked.output.exists() else {}
    for kind in asked.kinds:
        shares, refused = [], 0
        for number in range(asked.cases):
            try:
                shares.append((KINDS[kind](np.random.default_rng([asked.seed, number])), number))
            except UnderlayError:
                refused += 1
        worst, case = max(shares)
        counts[kind] = {
            "cases": asked.cases,
            "refused": refused,
            "outside": sum(not share <= 1.0 for share, _ in shares),
            "worst": float(f"{worst:.3g}"),
            "worst_case": case,
        }
        print(kind, counts[kind], flush=True)
        asked.output.write_text(json.dumps(counts, indent=2) + "\n", encoding="utf-8")


if __name__ == "__main__":
    main()
