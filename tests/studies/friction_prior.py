"""How often the interval of a modulus holds the truth, by what is taken for known of friction before the test.

    python tests/studies/friction_prior.py    # -> results/friction_prior.csv, a minute

A ball on a layer of nu = 0.49 bonded to a rigid base, contact radius up to 0.85 thicknesses, noise of 0.3 % and of
3 %; E, contact point and baseline free, with and without the thickness. The model about the truth is linear in
them and in the share of full friction, which is 0, a half or 1. Two priors of that share: flat between none and
full, integrated over as it is, and the normal one of `misfit/left_out.py`; 400 draws of the noise each.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pandas as pd
from scipy import special

import underlay as ul
from underlay.inference.uncertainty import known_errors as left_out
from underlay.inference.misfit.blocked import Blocked

RESULTS = Path(__file__).parent / "results"
BALL = ul.Scene(ul.Sphere(1e-3), ul.Layer(ul.Isotropic(1e6, 0.49), 5e-4), ul.RIGID, finite_strain=False)
DEPTH = np.linspace(-5e-5, 1.2e-4, 200)
DRAWS, LEVELS = 400, (0.025, 0.975)
SHARES = np.linspace(0.0, 1.0, 401)


def main():
    rows = []
    for noise in (0.003, 0.03):
        for free in (["layer.E"], ["layer.E", "layer.thickness"]):
            jacobian, column = linear_model([*free, "instrument.contact_depth", "instrument.baseline"], noise)
            for share in (0.0, 0.5, 1.0):
                row = {"noise": noise, "free": " ".join(free), "true share": share}
                rows.append(row | compared(jacobian, column, share))
    table = pd.DataFrame(rows)
    table.to_csv(RESULTS / "friction_prior.csv", index=False, float_format="%.4g")
    print(table.to_string())


def linear_model(free, noise):
    """Derivatives of the readings and the friction column, both over the noise."""
    sigma = noise * float(BALL.force(DEPTH[-1]))
    curve = ul.synthesize(BALL, DEPTH, ul.Noise(force=sigma), rng=1)
    problem = ul.Problem(BALL, curve, dict.fromkeys(free), noise=ul.Noise(force=sigma))
    (friction,) = left_out.left_out(BALL, DEPTH[-1]).errors
    blocked = Blocked.of(problem, problem.start, errors=(friction,))
    (part,) = blocked.linearised(problem.start).parts
    scale = blocked.curves[0].member.scatter / sigma
    return scale * part.jacobian[:, : len(free)], scale * part.jacobian[:, -1]


def compared(jacobian, column, share):
    """Coverage of ln E and its mean width under both priors."""
    rng, k = np.random.default_rng(0), jacobian.shape[1]
    data = share * column + rng.standard_normal((DRAWS, len(column)))
    # The share and ln E by least squares, without a prior.
    both = np.column_stack((jacobian, column))
    covariance = np.linalg.inv(both.T @ both)
    found = data @ both @ covariance
    modulus, amplitude = found[:, 0], found[:, k]
    spread = covariance[k, k]
    slope = covariance[0, k] / spread
    rest = np.sqrt(covariance[0, 0] - slope * covariance[0, k])
    # Normal prior: two normal distributions of the share, multiplied.
    sd = left_out._SHARE
    weight = 1.0 / spread + 1.0 / sd**2
    mean = (amplitude / spread + 0.5 / sd**2) / weight
    middle, wide = modulus + slope * (mean - amplitude), np.sqrt(rest**2 + slope**2 / weight)
    ends = middle[:, None] + wide * special.ndtri(LEVELS)
    # Flat prior: the same between none and full, and nothing beyond.
    density = np.exp(-0.5 * (SHARES - amplitude[:, None]) ** 2 / spread)
    density /= density.sum(axis=1, keepdims=True)
    centres = modulus[:, None] + slope * (SHARES - amplitude[:, None])
    flat = np.array([quantiles(c, d, rest) for c, d in zip(centres, density, strict=True)])
    return {
        f"{word} {name}": value
        for name, q in (("normal", ends), ("flat", flat))
        for word, value in (
            ("covers", float(((q[:, 0] <= 0.0) & (q[:, 1] >= 0.0)).mean())),
            ("width", float((q[:, 1] - q[:, 0]).mean())),
        )
    }


def quantiles(centres, weights, deviation):
    """Quantiles of a mixture of normal distributions of one deviation, by interpolation."""
    reach = 4.5 * deviation
    places = np.linspace(centres.min() - reach, centres.max() + reach, 800)
    below = special.ndtr((places[:, None] - centres) / deviation) @ weights
    return np.interp(LEVELS, below, places)


if __name__ == "__main__":
    main()
