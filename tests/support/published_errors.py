"""Measures the error of every published correction against the exact contact problem.

Run ``python tests/support/published_errors.py`` (src and tests on the path) to print the tables that stand in
``corrections.toml`` of `underlay.mechanics.published`, rounded up to two digits.
"""

from __future__ import annotations

import sys
from itertools import pairwise, product

import numpy as np
from scipy.interpolate import CubicSpline

import underlay as ul
from support.fredholm import bonded_kernel, flat_punch, power_law
from underlay.mechanics.published.correction import ELASTIC, LayerContact

# Contact radii a/h at which the exact problem is solved: the answers are smooth between them. The first
# is so small that the factor is 1 + 0.006.
RADII = np.geomspace(0.005, 3.0, 60)
PER_COLUMN = 12


def exact_factor(kernel, kind):
    """P/P_halfspace of the exact problem as a function of the literature's contact size u."""
    if kind == "flat punch":
        size, factor = RADII, flat_punch(kernel, RADII)
    elif kind == "sphere":
        solution = power_law(kernel, RADII, 2.0)  # H = a^2/h is the paraboloid of R = h: w/h = X^2
        size, factor = np.sqrt(solution.depth), solution.factor
    else:
        solution = power_law(kernel, RADII, 1.0)  # H = a is the cone of (pi/2) cot = 1: y = (pi/2) w/h
        size, factor = 0.5 * np.pi * solution.depth, solution.factor
    return CubicSpline(np.append(0.0, size), np.append(1.0, factor))


def contact_of(kind, *, nu=0.5, nu_base=0.5, ratio=np.inf, size=None, thickness=1.0):
    """A contact of unit thickness; `size` is R/h or a/h."""
    tip = {
        "sphere": lambda: ul.Paraboloid(size or 1.0),
        "cone": lambda: ul.Cone(np.arctan(size or 1.0)),
        "flat punch": lambda: ul.FlatPunch(size or 1.0),
    }[kind]()
    base = None if ratio == np.inf else ul.Isotropic(ratio, nu_base)
    return LayerContact(indenter=tip, thickness=thickness, layer=ul.Isotropic(1.0, nu), base=base)


def contact_for(correction, values, size=1.0):
    """The contact of one row of a correction's table."""
    if correction.substrate == ELASTIC:
        ratio, nu, nu_base = values
        return contact_of(correction.indenter, nu=nu, nu_base=nu_base, ratio=ratio, size=size)
    return contact_of(correction.indenter, nu=values[0], size=values[1] if len(values) > 1 else size)


def factor_of(correction, contact, sizes):
    """The published factor at contact sizes u; a flat punch of another a/h is another test."""
    if correction.indenter != "flat punch":
        return correction.factor(contact).value(sizes)
    return np.array([_punch_factor(correction, contact, size) for size in sizes])


def _punch_factor(correction, contact, size):
    punch = LayerContact(
        indenter=ul.FlatPunch(size * contact.thickness),
        thickness=contact.thickness,
        layer=contact.layer,
        base=contact.base,
    )
    anywhere = np.array([1.0])  # a depth: it does not matter for a flat punch
    return float(correction.factor(punch).value(punch.variable(anywhere))[0])


def largest_stated_size(correction, contact):
    """Where Long's ranges of depth end, as a contact size; inf for the others."""
    if correction.name != "long2011":
        return np.inf
    return np.sqrt(contact.radius_ratio * min(0.6, contact.radius_ratio)) * (1.0 + 1e-12)


def remeasure(correction):
    """Largest relative error up to each column, shape of ``correction.measured_error.worst``."""
    table = correction.measured_error
    worst = np.empty_like(table.worst)
    for index in product(*(range(nodes.size) for nodes in table.nodes)):
        values = [float(nodes[i]) for nodes, i in zip(table.nodes, index, strict=True)]
        contact = contact_for(correction, values)
        exact = exact_factor(bonded_kernel(contact.layer, contact.base or ul.RIGID), correction.indenter)
        edges = np.append(0.0, table.variable)
        so_far = 0.0
        for column, (start, end) in enumerate(pairwise(edges)):
            sizes = start + (end - start) * np.arange(1, PER_COLUMN + 1) / PER_COLUMN
            error = np.abs(factor_of(correction, contact, sizes) / exact(sizes) - 1.0)
            so_far = max(so_far, float(error.max()))
            worst[index][column] = so_far if end <= largest_stated_size(correction, contact) else np.inf
    return worst


def rounded_up(fraction):
    """Per cent, rounded up to two digits; identical laws agree to rounding, which is none."""
    percent = 100.0 * fraction
    if not np.isfinite(percent):
        return "inf"
    if percent < 1e-9:
        return "0"
    step = 10.0 ** (np.floor(np.log10(percent)) - 1.0)
    return f"{np.ceil(percent / step * (1.0 - 1e-9)) * step:.6g}"


def main():
    for correction in ul.published_corrections():
        table = correction.measured_error
        worst = remeasure(correction)
        lines = [
            f"# {correction.name} {correction.indenter}",
            " ".join(f"{size:g}" for size in table.variable),
        ]
        for index in product(*(range(nodes.size) for nodes in table.nodes)):
            values = [f"{nodes[i]:g}" for nodes, i in zip(table.nodes, index, strict=True)]
            lines.append(" ".join([*values, *(rounded_up(error) for error in worst[index])]))
        sys.stdout.write("\n".join(lines) + "\n")


if __name__ == "__main__":
    main()
