"""How little can a fit of modulus, thickness and contact on an elastic base cost with its search of starts?

    python tests/studies/fit_floor.py [--rounds 201] [--output tests/studies/fit_floor.json]

The curve of `benchmarks/cost_models.py`, fitted by the barest numpy that does the same work: the same grid of
thicknesses, ratios and contacts, the same tables, three starts in lock-step on 32 blocks, all points, standard
errors. It knows this one scene alone: no bounds, priors, offsets, other laws, checks or warnings. The unit is
lmfit's fit of Hertz's formula to the same points.
"""

from __future__ import annotations

import argparse
import json
import sys
import time
from pathlib import Path

import numpy as np

import underlay as ul
from underlay.mechanics.body import isotropic_constants
from underlay.mechanics.exact.curve_family import (
    Cell,
    IsotropicPair,
    curve_family,
    range_number,
    ratio_number,
)
from underlay.mechanics.exact.master_curve import Factor, polynomial
from underlay.mechanics.exact.table_laws import side_by_side

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

from benchmarks import cost_models  # after the path is set

BASE = ul.Isotropic(3e7, 0.3)
FREE = ("layer.E", "layer.thickness", "instrument.contact_depth")
CONTACTS, RATIOS = np.linspace(-0.2, 0.9, 12), np.array([0.02, 0.2, 1.5, 10.0, 100.0])
SHARES, RADII = np.linspace(0.0, 1.0, 9), (4.6, 0.06)
LOOSE, FINE = 1e-3, 1e-6
REACH = np.array([2.5, 0.6, 0.6])
PAIR, RADIUS = IsotropicPair(0.5, 0.3), 1e-3
THETA = float(isotropic_constants(1.0, 0.5).theta)
REFERENCE = ul.Contact.of(ul.Paraboloid(RADIUS), ul.Layer(ul.Isotropic(3e6, 0.5), 1e-3), BASE)


class Tables:
    """Tables of the laws, one per cell, ready to be stacked: factors of the force, of its slope, and d/d ln k."""

    def __init__(self):
        self.kept = {}

    def of(self, log_ratio, varpi, rtol):
        """Coefficients (sets, 3, rows, 4), and lengths and rates (sets, 1) of the stretched variable."""
        found = [self._one(k, v, rtol) for k, v in zip(log_ratio.tolist(), varpi.tolist(), strict=True)]
        rows = max(one[0].shape[1] for one in found)
        tables = np.zeros((len(found), 3, rows, 4))
        for into, (table, *_) in zip(tables, found, strict=True):
            into[:, : table.shape[1]] = table
        return tables, np.array([[one[1]] for one in found]), np.array([[one[2]] for one in found])

    def _one(self, log_ratio, varpi, rtol):
        ratio = ratio_number(np.exp(log_ratio))
        key = ratio, range_number(varpi), rtol
        if key not in self.kept:
            family = curve_family(Cell(2.0, PAIR, *key))
            own = family.coefficients[:, 0]
            both = np.stack((own[:, Factor.FORCE], own[:, Factor.RADIUS] + own[:, Factor.STIFFNESS]), axis=1)
            low, high = family.cell.log_ratios
            self.kept[key] = both, family.stretch, 0.5 * (low + high), 2.0 / (high - low)
        both, stretch, middle, scale = self.kept[key]
        powers = ((log_ratio - middle) * scale) ** np.arange(len(both))
        weights = np.zeros((2, len(both)))
        weights[0] = powers
        weights[1, 1:] = np.arange(1, len(both)) * powers[:-1] * scale
        value, slope = (weights @ both.reshape(len(both), -1)).reshape(2, *both.shape[1:])
        return np.stack((value[0], value[1], slope[0])), stretch.length, stretch.rate


TABLES = Tables()


def model(depth, vectors, rtol):
    """Forces (s, n) and derivatives (s, 3, n) in ln E, ln h and the contact at vectors (s, 3) of these."""
    modulus, thickness = np.exp(vectors[:, :2].T)
    w = np.maximum(depth - vectors[:, 2:], 0.0)
    radius = np.sqrt(w * RADIUS)
    varpi = radius / thickness[:, None]
    table, lengths, rates = TABLES.of(np.log(BASE.E) - vectors[:, 0], varpi[:, -1], rtol)
    z = np.log1p(rates * varpi) * (2.0 / lengths) - 1.0
    values = polynomial(table, z[:, None])
    np.exp(values[:, :2], out=values[:, :2])
    scale = (4.0 * THETA * modulus)[:, None] * radius
    force, stiffness = 2.0 / 3.0 * scale * w * values[:, 0], scale * values[:, 1]
    columns = np.empty((len(vectors), 3, depth.size))
    columns[:, 0] = force * (1.0 - values[:, 2])
    columns[:, 1] = 3.0 * force - 2.0 * w * stiffness
    columns[:, 2] = -stiffness
    return force, columns


def in_blocks(values, count, middle):
    """Middles of neighbouring values in `count` blocks."""
    size, longer = divmod(values.size, count)
    end = longer * (size + 1)
    parts = (values[:end].reshape(longer, -1), values[end:].reshape(-1, size))
    return np.concatenate([middle(part, axis=1) for part in parts if part.size])


def scan(depth, force):
    """Vectors (s, 3) of the best place of the grid, and of places thinner and thicker."""
    depth, force = (in_blocks(values, 16, np.median) for values in (depth, force))
    radius = np.sqrt(np.ptp(depth) * RADIUS)
    lowest, highest = radius / RADII[0], radius / RADII[1]
    thicknesses = lowest * (highest / lowest) ** SHARES
    contacts = depth[0] + CONTACTS * np.ptp(depth)
    # Of the reference: P(w) = c P_ref(b w).
    stretch = REFERENCE.thickness / thicknesses
    b, c = (stretch**2)[:, None, None], (stretch**-3)[:, None, None]
    if not LAWS:
        deepest = float(b.max() * (depth[-1] - contacts[0]))
        LAWS.append(side_by_side(REFERENCE, PAIR, RATIOS.tolist(), deepest, 1e-2))

    def tried(contact):
        """Misfit and factor on the modulus (r, c) at contacts (1, 1, c) or (ratios, thicknesses, 1)."""
        w = b * (depth - contact[..., None])
        shapes = LAWS[0](w.reshape(len(w), -1)).reshape(5, *w.shape[1:]) * c
        power, along = np.einsum("ktcm,ktcm->ktc", shapes, shapes), shapes @ force
        factor = np.divide(along, power, out=np.zeros_like(power), where=power > 0.0)
        misfit = force @ force - factor * along
        return misfit.reshape(-1, misfit.shape[2]), factor

    misfit, _ = tried(contacts[None, None])
    best = np.clip(misfit.argmin(axis=1), 1, len(contacts) - 2)
    before, here, after = (np.take_along_axis(misfit, best[:, None] + i, 1)[:, 0] for i in (-1, 0, 1))
    contact = contacts[best] + 0.5 * (contacts[1] - contacts[0]) * (before - after) / (
        before - 2 * here + after
    )
    misfit, factor = tried(contact.reshape(5, -1, 1))
    misfit, contact, log_modulus = (
        values.reshape(5, -1).T for values in (misfit, contact, np.log(np.maximum(factor, 1e-12) * 3e6))
    )
    # Between which ratios the base has its modulus.
    beyond = np.log(RATIOS) + log_modulus - np.log(BASE.E)
    above = np.clip((beyond > 0.0).argmax(axis=1), 1, 4)
    rows = np.arange(len(thicknesses))
    share = np.clip(beyond[rows, above - 1] / (beyond[rows, above - 1] - beyond[rows, above]), 0.0, 1.0)
    misfit, contact, log_modulus = (
        (1.0 - share) * values[rows, above - 1] + share * values[rows, above]
        for values in (misfit, contact, log_modulus)
    )
    logs, best = np.log(thicknesses), int(misfit.argmin())
    chosen = sorted({int(np.abs(logs - logs[best] - side).argmin()) for side in (-1.0, 0.0, 1.0)})
    return np.stack((log_modulus, logs, contact), axis=1)[chosen]


#: The laws of the grid, gathered once.
LAWS = []


def descend(depth, force, sigma, vectors, rtol, settled, span):
    """Levenberg and Marquardt's search below several places in lock-step; the best vectors, squares, J'J."""
    scale = np.array([1.0, 1.0, span])
    low, high = (vectors + side * REACH * scale for side in (-1.0, 1.0))
    damping, count = np.full(len(vectors), 1e-6), 0
    best, least, ventured = vectors, np.full(len(vectors), np.inf), np.zeros(len(vectors), dtype=bool)
    while True:
        said, columns = model(depth, vectors, rtol)
        count += 1
        residuals = (said - force) / sigma
        columns *= scale[:, None] / sigma
        square = np.einsum("sn,sn->s", residuals, residuals)
        own_gradient, own_normal = (
            (columns @ residuals[:, :, None])[:, :, 0],
            columns @ columns.swapaxes(1, 2),
        )
        lower = square < least
        if count == 1:
            gradient, normal = own_gradient, own_normal
        up = ~lower & ~ventured & (square < 100.0 * least)
        moved = lower | up
        best, least = np.where(lower[:, None], vectors, best), np.where(lower, square, least)
        vectors = np.where(moved[:, None], vectors, best)
        gradient = np.where(moved[:, None], own_gradient, gradient)
        normal = np.where(moved[:, None, None], own_normal, normal)
        damping, ventured = np.where(lower, 0.1 * damping, np.where(up, damping, 10.0 * damping)), up
        norms = np.sqrt(normal.diagonal(axis1=1, axis2=2))
        scaled = normal / (norms[:, :, None] * norms[:, None]) + damping[:, None, None] * np.eye(3)
        step = -np.linalg.solve(scaled, (gradient / norms)[:, :, None])[:, :, 0] / norms
        gain = -np.einsum("sk,sk->s", step, gradient)
        vectors = np.minimum(np.maximum(vectors + step * scale, low), high)
        if (least[least.argmin()] * settled >= gain[least.argmin()] and not up[least.argmin()]) or count > 12:
            return vectors, least, normal


def bare_fit(depth, force, sigma):
    """Values of E, h and the contact, and their standard errors."""
    span = float(np.ptp(depth))
    starts = scan(depth, force)
    w, f, squared = (in_blocks(values, 32, np.mean) for values in (depth, force, depth * depth))
    slope = (f[3:] - f[:-3]) / (w[3:] - w[:-3])
    bend = (slope[3:] - slope[:-3]) / (w[6:] - w[:-6])
    f = f - (squared - w * w) * np.pad(bend, 3, mode="edge")
    found, square, _ = descend(w, f, sigma * (32 / force.size) ** 0.5, starts, LOOSE, 3e-3, span)
    best = found[square.argmin()][None]
    vector, _, normal = descend(depth, force, sigma, best, FINE, 2e-7, span)
    values = vector[0].copy()
    values[:2] = np.exp(values[:2])
    errors = np.sqrt(np.linalg.inv(normal[0]).diagonal()) * np.array([values[0], values[1], span])
    return values, errors


def timed(call):
    """Processor time (s)."""
    start = time.process_time()
    call()
    return time.process_time() - start


def main():
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--rounds", type=int, default=201)
    parser.add_argument("--output", type=Path, default=Path(__file__).with_suffix(".json"))
    arguments = parser.parse_args()
    depth = np.linspace(1.8e-6, 1.8e-3, 1000)
    scene, curve, noise = cost_models.measured(ul.Scene(ul.Paraboloid(RADIUS), cost_models.GEL, BASE), depth)
    start = cost_models.started(scene, FREE)
    calls = {
        "unit": cost_models.hertz_fit(BASE)(depth),
        "fit": lambda: ul.fit(
            ul.Problem(start, curve, FREE, noise=ul.Noise(force=noise.force), solver="exact")
        ),
        "bare": lambda: bare_fit(curve.depth, curve.force, noise.force),
    }
    there = calls["fit"]()
    values, errors = calls["bare"]()
    off = max(abs(values[i] - there.values[path]) / there.stderr[path] for i, path in enumerate(FREE))
    wide = max(abs(errors[i] / there.stderr[path] - 1.0) for i, path in enumerate(FREE))
    times = np.array([[timed(call) for call in calls.values()] for _ in range(arguments.rounds)])[1:]
    study = {
        "bare numpy, in Hertz fits": round(float(np.median(times[:, 2] / times[:, 0])), 3),
        "fit, in Hertz fits": round(float(np.median(times[:, 1] / times[:, 0])), 3),
        "bare numpy (ms)": round(1e3 * float(np.median(times[:, 2])), 3),
        "largest difference of the values, in standard errors": float(f"{off:.2g}"),
        "largest difference of the standard errors, as a share": float(f"{wide:.2g}"),
        "rounds": arguments.rounds,
    }
    arguments.output.write_text(json.dumps(study, indent=2) + "\n")
    print(json.dumps(study, indent=2))


if __name__ == "__main__":
    main()
