"""The sizes and times of noise, drift, jump and ramp that are weighed, and how likely each is before the test.

A law is wrong by per cents, and a baseline creeps by per cents of the force, whatever the noise is: in shares of
the noise a loud curve would never allow for either. The interval of an exact law is paid for where the data could
see a drift and see none: there its probability falls by itself. It does so the faster the larger the drifts are
that are looked for and the more shapes they may have, and a large size serves a small drift nearly as well. The
prior probability of the exact law then goes as low as a median width of 1.4 on clean curves allows
(`tests/studies/misfit_priors.py`: other kinds and probabilities on the same curves; `tests/studies/intervals.py`:
coverage of what was chosen). Who takes a specimen for a half-space is wrong more often: no layer is one. At 0.57
Hertz fits of layers hold in 90.5 % of 600 for a clean width of 1.45; at 0.65 it was 1.39, and 89.8 % held.

A thickness, a base or a Poisson's ratio that is fitted is read off the shape of the curve alone, and takes up a
drift without a residual: no curve can then tell which of the two it shows, and what is widest must weigh enough to
set the ends. With even odds and drifts of 10 and 30 % alone 80 curves of samples that relax held modulus and
thickness in 80 and 81 %; with these 200 others hold them in 93.5 and 95.5 %, for clean intervals a quarter wider.
A relaxation is told by the time as well, and a work of adhesion by the pull-off: there the odds begin even, and
larger drifts would only move the modulus (by 20 % on two of ten curves of `underlay benchmark`).
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import product

import numpy as np

from underlay._arrays import FloatArray
from underlay.inference.misfit.drift import BENT, DRIFTS, FAR_BASE, NEAR_BASE, RELAXING, SMOOTH
from underlay.inference.problem import Problem
from underlay.scene.scene import Scene

__all__ = ["Sizes", "over_noise", "shape_parameters"]

# What intervals leave out where what is taken for granted is given up (`Sizes.least_out`).
_LEAST_OUT = 0.03
# What more than the shape of the curve tells.
_TOLD_OTHERWISE = ("layer.relaxation.", "adhesion.")


@dataclass(frozen=True)
class Sizes:
    """What is weighed: sizes and times on grids, with their prior probabilities.

    Parameters
    ----------
    times : int
        Correlation times, from two steps of time to three times the record, in equal ratios.
    shares : tuple of float
        Variance of the correlated noise over that of the white.
    drifts : tuple of tuple of float
        Kinds of drift of the law: sizes of its columns, as shares of the force.
    jumps : tuple of float
        Size of a jump, over the white noise.
    ramps : tuple of float
        By how much the baseline creeps, as a share of the largest force.
    white, exact, smooth, level : float
        Prior probability that there is no correlated noise, no drift, no jump, no ramp.
    least_out : float
        What intervals leave out at least where what is taken for granted is given up (`Averaged.left_out`), as a
        share of what they were asked to. Drifts stand for a base under what was taken for a half-space, but none is
        one: of their 95 % intervals three in four hold (`tests/studies/half_space.py`).
    has_free_shape : bool
        Whether something is fitted that the shape of the curve alone tells: a thickness takes up any disturbance.
    """

    times: int = 5
    shares: tuple[float, ...] = (0.1, 1.0, 10.0, 100.0, 1000.0)
    drifts: tuple[tuple[float, ...], ...] = (BENT, RELAXING)
    jumps: tuple[float, ...] = (1.0, 4.64, 21.5, 100.0)
    ramps: tuple[float, ...] = (0.03,)
    white: float = 0.7
    exact: float = 0.75
    smooth: float = 0.5
    level: float = 0.8
    least_out: float = 1.0
    has_free_shape: bool = False

    @classmethod
    def of(cls, problem: Problem) -> Sizes:
        """Sizes for a problem: its scenes say what a drift may be, its fitted shape how likely one is."""
        if shape := shape_parameters(problem):
            drifts = tuple(tuple(times * size for size in SMOOTH) for times in (1.0 / 3.0, 1.0, 2.0))
            if all(name.startswith(_TOLD_OTHERWISE) for name in shape):
                return cls(exact=0.5, drifts=drifts[:2])
            return cls(exact=0.3, drifts=drifts, least_out=_LEAST_OUT, has_free_shape=True)
        if all(_is_half_space(scene) for scene in problem.base_scenes):
            return cls(exact=0.57, drifts=(BENT, FAR_BASE, NEAR_BASE), least_out=_LEAST_OUT)
        return cls()

    def noises(self, times: Sequence[FloatArray]) -> list[tuple[float, float] | None]:
        """Correlated noises (tau, g) for curves read at `times` (s), after None for white noise alone."""
        shortest = 2.0 * min(float(np.median(np.diff(time))) for time in times)
        longest = 3.0 * max(float(time[-1] - time[0]) for time in times)
        ratio = (longest / shortest) ** (1.0 / (self.times - 1))
        taus = [shortest * ratio**number for number in range(self.times)]
        return [None, *product(taus, self.shares)]

    @cached_property
    def in_haste(self) -> Sizes:
        """The same with four correlated noises and no creep: which noise it is, and about where the optimum is.

        White noise alone does not tell: what follows a periodic noise is then a drift, and the intervals of 200
        curves with interference fringes held in 87 % for 97 (`tests/studies/intervals.py`).
        """
        return replace(self, times=2, shares=self.shares[1::2], ramps=())

    @cached_property
    def sparse(self) -> Sizes:
        """The same with nine correlated noises: enough where the likeliest noise is white.

        Against 81 of them the ends of an interval are off by less than 0.3 % of its length in the median of such
        curves. Where the noise is correlated the grid must be finer: 16 leave the ends off by 2.7 %, 25 by 1.4 %.
        """
        return replace(self, times=3, shares=self.shares[::2])

    @property
    def kinds(self) -> tuple[tuple[float, ...], ...]:
        """Sizes of the columns of every kind of drift, none first."""
        return ((0.0,) * DRIFTS, *self.drifts)

    @cached_property
    def amounts(self) -> FloatArray:
        """Sizes of the columns of the drift, of jump and of ramp, of every combination, (c, 10 + 2)."""
        groups = (self.kinds, (0.0, *self.jumps), (0.0, *self.ramps))
        return np.array([(*drift, jump, ramp) for drift, jump, ramp in product(*groups)])

    @cached_property
    def largest(self) -> FloatArray:
        """The largest of each, (10 + 2,)."""
        return np.asarray(self.amounts.max(axis=0))

    def log_prior(self, noises: int) -> FloatArray:
        """Logarithm of the prior probability of every combination, (noises, c)."""
        noise = np.log(_shared(self.white, noises - 1))
        drift = np.log(_shared(self.exact, len(self.drifts)))
        jump = np.log(_shared(self.smooth, len(self.jumps)))
        ramp = np.log(_shared(self.level, len(self.ramps)))
        amounts = drift[:, None, None] + jump[:, None] + ramp
        return np.asarray(noise[:, None] + amounts.ravel())


def over_noise(amounts: FloatArray, variance: FloatArray) -> FloatArray:
    """Amounts (c, 10 + 2) of `Sizes.amounts`, over the noise as jumps are; s^2 (c,) over the scatter squared."""
    own = amounts / np.sqrt(variance)[:, None]
    own[:, DRIFTS] = amounts[:, DRIFTS]
    return np.asarray(own)


def _is_half_space(scene: Scene) -> bool:
    return math.isinf(scene.layer.thickness)


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
