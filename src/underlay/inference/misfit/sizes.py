"""The sizes and times of noise, drift, jump and ramp that are weighed, and how likely each is before the test.

A law is wrong by per cents, and a baseline creeps by per cents of the force, whatever the noise is: in shares of
the noise a loud curve would never allow for either. The interval of an exact law is paid for where the data could
see a drift and see none: there its probability falls by itself. It does
so the faster the larger the drifts are that are looked for, and a large size serves a small drift nearly as well:
one size of 30 % costs clean curves less width than a grid with 10 % in it, and one of 100 % takes fringes for a
drift. The prior probability of the exact law then goes as low as a median width of 1.4 on clean curves allows
(`tests/studies/misfit_priors.py`: other sizes and probabilities on the same curves; `tests/studies/intervals.py`:
coverage of what was chosen).

A thickness, a base or a Poisson's ratio that is fitted is read off the shape of the curve alone, and takes up a
drift without a residual: no curve can then tell which of the two it shows, and the odds begin even. Nor does a
large size lose its weight there by what is seen: it would only widen, and half of the drifts are of 10 %.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import product

import numpy as np

from underlay._arrays import FloatArray
from underlay.inference.misfit.linearised import DRIFTS, JUMPS, RAMPS
from underlay.inference.problem import Problem

__all__ = ["Sizes", "shape_parameters"]


@dataclass(frozen=True)
class Sizes:
    """What is weighed: sizes and times on grids, with their prior probabilities.

    Parameters
    ----------
    times : int
        Correlation times, from two steps of time to three times the record, in equal ratios.
    shares : tuple of float
        Variance of the correlated noise over that of the white.
    drifts : tuple of float
        Size of a drift of the law, as a share of the force.
    jumps : tuple of float
        Size of a jump, over the white noise.
    ramps : tuple of float
        By how much the baseline creeps, as a share of the largest force.
    white, exact, smooth, level : float
        Prior probability that there is no correlated noise, no drift, no jump, no ramp.
    """

    times: int = 5
    shares: tuple[float, ...] = (0.1, 1.0, 10.0, 100.0, 1000.0)
    drifts: tuple[float, ...] = (0.3,)
    jumps: tuple[float, ...] = (1.0, 4.64, 21.5, 100.0)
    ramps: tuple[float, ...] = (0.03,)
    white: float = 0.7
    exact: float = 0.8
    smooth: float = 0.5
    level: float = 0.8

    @classmethod
    def of(cls, problem: Problem) -> Sizes:
        """Sizes for a problem: where a parameter of the shape is fitted, even odds of a drift, and smaller ones."""
        return cls(exact=0.5, drifts=(0.1, 0.3)) if shape_parameters(problem) else cls()

    def noises(self, times: Sequence[FloatArray]) -> list[tuple[float, float] | None]:
        """Correlated noises (tau, g) for curves read at `times` (s), after None for white noise alone."""
        shortest = 2.0 * min(float(np.median(np.diff(time))) for time in times)
        longest = 3.0 * max(float(time[-1] - time[0]) for time in times)
        taus = np.geomspace(shortest, longest, self.times)
        return [None, *((float(tau), share) for tau in taus for share in self.shares)]

    @cached_property
    def amounts(self) -> FloatArray:
        """Sizes of drift, jump and ramp of every combination, (c, 3)."""
        groups = ((0.0, *self.drifts), (0.0, *self.jumps), (0.0, *self.ramps))
        return np.array(list(product(*groups)))

    @staticmethod
    def scales(amounts: FloatArray, variance: FloatArray, parameters: int, curves: int) -> FloatArray:
        """Factors on the columns of `Linearised.products`, residuals left out, (c, m - 1).

        Amounts (c, 3) as in `amounts`; s^2 (c,) is over the scatter squared.
        """
        over = np.column_stack((np.sqrt(variance), np.ones(len(amounts)), np.sqrt(variance)))
        own = np.repeat(amounts / over, (DRIFTS, JUMPS, RAMPS), axis=1)
        return np.hstack((np.ones((len(amounts), parameters)), np.tile(own, (1, curves))))

    def log_prior(self, noises: int) -> FloatArray:
        """Logarithm of the prior probability of every combination, (noises, c)."""
        noise = np.log(_shared(self.white, noises - 1))
        drift = np.log(_shared(self.exact, len(self.drifts)))
        jump = np.log(_shared(self.smooth, len(self.jumps)))
        ramp = np.log(_shared(self.level, len(self.ramps)))
        amounts = drift[:, None, None] + jump[:, None] + ramp
        return np.asarray(noise[:, None] + amounts.ravel())


def shape_parameters(problem: Problem) -> list[str]:
    """Names of the fitted parameters of the specimen or the tip that do more than scale the force."""
    return [
        coordinate.name
        for coordinate in problem.coordinates
        if not coordinate.path.startswith(("discrepancy.", "noise.", "instrument.", "lever."))
        and coordinate.path != "layer.E"
    ]


def _shared(first: float, others: int) -> FloatArray:
    return np.concatenate(([first], np.full(others, (1.0 - first) / max(others, 1))))
