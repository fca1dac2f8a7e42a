"""The exact contact problem again, in high precision and by another method: Galerkin with spherical Bessel.

f(x) = sum_k c_k P_2k(x) on (0, 1). Since int_0^1 cos(s x) P_2k(x) dx = (-1)^k j_2k(s), projecting

    f(x) = w - H(a x) + (2 eps/pi) int_0^1 K(eps x, eps y) f(y) dy

on P_2k gives c_k/(4k+1) = b_k + (2 eps/pi) sum_l (-1)^(k+l) c_l int_0^inf (1 - L) j_2k(eps u) j_2l(eps u) du,
and the mean of f is c_0. Nothing is shared with the library: the kernel comes from a transfer matrix in
high precision, the wavenumbers from plain panels. Make the stored references (some minutes) with

    cd tests; python -m support.reference_solver
"""

from __future__ import annotations

import json
from itertools import pairwise
from pathlib import Path

import mpmath as mp

import underlay as ul
from support.transfer_matrix import TransferMatrixKernel

DIGITS = 30
STORED = Path(__file__).parents[1] / "data" / "exact_references.json"

# Layer and substrate (None: rigid) by their engineering constants: (E, nu) or (E, E', nu, nu', G').
MATERIALS = {
    "rigid nu=0.5": ((1.0, 0.5), None),
    "rigid nu=0.3": ((1.0, 0.3), None),
    "rigid nu=0.1": ((1.0, 0.1), None),
    "E2/E1=1e3": ((1.0, 0.45), (1e3, 0.3)),
    "E2/E1=10": ((1.0, 0.5), (10.0, 0.3)),
    "E2/E1=0.1": ((1.0, 0.3), (0.1, 0.45)),
    "E2/E1=1e-3": ((1.0, 0.3), (1e-3, 0.5)),
    "transversely isotropic": ((1.0, 0.2, 0.3, 0.1, 0.15), (3.0, 5.0, 0.25, 0.3, 1.0)),
}
RADII = (0.1, 1.0, 4.0)
EXPONENTS = (1.0, 1.5, 2.0, 4.0)


def material(constants):
    """One of the materials."""
    if constants is None:
        return ul.RIGID
    return ul.Isotropic(*constants) if len(constants) == 2 else ul.TransverselyIsotropic(*constants)


def panels(eps, order=30):
    """Gauss-Legendre nodes and weights in u: panels that double from 2^-24 up to a width that eps allows."""
    edges, width = [mp.mpf(0), mp.mpf(2) ** -18], min(mp.mpf(2), 6 / mp.mpf(eps))
    while edges[-1] < 42:
        edges.append(edges[-1] + min(edges[-1], width))
    x, w = zip(*gauss(order), strict=True)
    return [
        (low + (high - low) * (1 + t) / 2, (high - low) * weight / 2)
        for low, high in pairwise(edges)
        for t, weight in zip(x, w, strict=True)
    ]


def gauss(count):
    """Gauss-Legendre rule by Newton's method."""
    rule = []
    for k in range(count):
        x = mp.cos(mp.pi * (k + mp.mpf(3) / 4) / (count + mp.mpf(1) / 2))
        for _ in range(8):
            P, Q = mp.mpf(1), mp.mpf(0)
            for n in range(count):
                P, Q = ((2 * n + 1) * x * P - n * Q) / (n + 1), P
            slope = count * (x * P - Q) / (x * x - 1)
            x -= P / slope
        rule.append((x, 2 / ((1 - x * x) * slope**2)))
    return rule


def even_bessel(count, s):
    """j_0, j_2, ... of s by downward recurrence from far above, normalised with sum (2n+1) j_n^2 = 1."""
    start = 2 * count + int(s) + 60
    above, here, values = mp.mpf(0), mp.mpf(10) ** -60, {}
    for n in range(start, -1, -1):
        values[n] = here
        above, here = here, (2 * n + 1) / s * here - above
    scale = (
        (mp.sin(s) / s) / values[0]
        if abs(mp.sin(s)) > 0.1
        else (mp.sin(s) / s**2 - mp.cos(s) / s) / values[1]
    )
    return [values[2 * k] * scale for k in range(count)]


def power_cosine(exponent, s):
    """int_0^1 x^exponent cos(s x) dx."""
    half = (exponent + 1) / 2
    return mp.hyp1f2(half, mp.mpf(1) / 2, half + 1, -s * s / 4) / (exponent + 1)


def weighted_kernel(layer, substrate, eps, order=30):
    """Pairs u, (1 - L(u)) du for all contact radii up to `eps`."""
    with mp.workdps(DIGITS):
        kernel = TransferMatrixKernel(material(layer), material(substrate))
        return [(u, weight * (1 - kernel.L(u))) for u, weight in panels(eps, order)]


def solve(weighted, eps, exponents, count):
    """Dimensionless answers at a/h = eps: kappa_inf, and per exponent w/H(a) and P/(4 theta a H(a)).

    For H = x^lambda the solution is x^lambda plus a smooth part, whose right-hand side is K x^lambda.
    """
    with mp.workdps(DIGITS):
        eps = mp.mpf(eps)
        powers = [mp.mpf(exponent) for exponent in exponents]
        gram = mp.zeros(count, count)
        sides = mp.zeros(count, 1 + len(powers))
        sides[0, 0] = 1
        edge = [mp.mpf(0)] * count
        edge_of_power = [mp.mpf(0)] * len(powers)
        for u, value in weighted:
            strength = value * 2 * eps / mp.pi
            signed = [(-1) ** k * value for k, value in enumerate(even_bessel(count, eps * u))]
            waves = [power_cosine(power, eps * u) for power in powers]
            at_edge = strength * mp.cos(eps * u)
            for k in range(count):
                part = strength * signed[k]
                edge[k] += at_edge * signed[k]
                for m, wave in enumerate(waves):
                    sides[k, 1 + m] += part * wave
                for other in range(k + 1):
                    gram[k, other] += part * signed[other]
            for m, wave in enumerate(waves):
                edge_of_power[m] += at_edge * wave
        system = mp.zeros(count, count)
        for k in range(count):
            for other in range(count):
                system[k, other] = -gram[max(k, other), min(k, other)]
            system[k, k] += 1 / mp.mpf(4 * k + 1)
        inverse = system**-1
        punch = inverse * sides[:, 0]
        punch_edge = 1 + sum(punch[k] * edge[k] for k in range(count))
        answers = {"kappa_inf": punch[0]}
        for m, power in enumerate(powers):
            smooth = inverse * sides[:, 1 + m]
            depth = (1 + edge_of_power[m] + sum(smooth[k] * edge[k] for k in range(count))) / punch_edge
            answers[f"lambda={float(power)}"] = (depth, depth * punch[0] - 1 / (power + 1) - smooth[0])
        return answers


def main():
    """Solve every case and store twenty digits; two numbers of functions must agree on them."""
    rows = []
    for name, (layer, substrate) in MATERIALS.items():
        weighted = weighted_kernel(layer, substrate, max(RADII))
        for eps in RADII:
            count = 16 + int(6 * eps)
            coarse, fine = (solve(weighted, eps, EXPONENTS, n) for n in (count, count + 4))
            row = {"materials": name, "eps": eps}
            for key, value in fine.items():
                pairs = (
                    zip(value, coarse[key], strict=True)
                    if isinstance(value, tuple)
                    else [(value, coarse[key])]
                )
                digits = []
                for here, there in pairs:
                    if abs(here - there) > abs(here) * mp.mpf(10) ** -20:
                        raise ArithmeticError(f"{name}, a/h = {eps}: {key} has not converged")
                    digits.append(mp.nstr(here, 20))
                row[key] = digits if isinstance(value, tuple) else digits[0]
            rows.append(row)
            print(name, eps, row["kappa_inf"], row["lambda=2.0"], flush=True)
    STORED.write_text(json.dumps(rows, indent=1) + "\n", encoding="utf-8")


if __name__ == "__main__":
    main()
