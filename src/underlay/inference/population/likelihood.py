"""The likelihood of one curve in nine numbers, which is all that a population needs of it.

A value with its standard error is no likelihood: where a thickness is free, more than half of a map's rows end on a
bound with an error that is the conditional one. So a curve keeps seven places x = ln E where the signed root z of
its log-likelihood, ln L = -z^2/2, is -3, -2, ..., 3, and the two roots at which it levels off, where it does (a
likelihood that stays below z = 3 upwards is open: the curve sets no upper bound).
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise

import numpy as np
from scipy import special, stats

from underlay._arrays import FloatArray
from underlay.errors import InputError
from underlay.inference.sampling.posterior import Posterior
from underlay.inference.uncertainty.answer import Answer

#: Signed roots at which the places are kept.
ROOTS = np.arange(-3.0, 4.0)
_ROOTS = tuple(ROOTS.tolist())
_MIDDLE = 3
# Distance (in standard errors) from the places of a normal density up to which a likelihood counts as normal.
_NORMAL = 0.05
# Largest root that is distinguished: beyond three the likelihood is extrapolated.
_FURTHEST = 30.0
# Number of places at which the density of draws is computed.
_DRAWS_ON_A_GRID = 512
_NEAREST = 0.02  # confidence of an interval narrow enough to give the median


@dataclass(frozen=True)
class CurveLikelihood:
    """Likelihood of one positive parameter, as a function of its logarithm.

    Parameters
    ----------
    places : tuple of float
        ln of the parameter (SI) where the signed root z, with ln L = -z^2/2, is -3 to 3, seven numbers; -inf or inf
        where it never is.
    below, above : float
        Roots z at which it levels off downwards (negative) and upwards (positive); -inf and inf where it does not.
    """

    places: tuple[float, ...]
    below: float = -math.inf
    above: float = math.inf

    def __post_init__(self) -> None:
        # Without arrays, for speed: a map has ten thousand of these.
        places = self.places
        if len(places) != len(ROOTS) or any(map(math.isnan, places)) or not math.isfinite(places[_MIDDLE]):
            raise InputError(f"a likelihood has seven places and a finite middle; got {self.places!r:.200}")
        inside = filter(math.isfinite, places)
        if any(b <= a for a, b in pairwise(inside)) or any(b < a for a, b in pairwise(places)):
            raise InputError(f"places of a likelihood increase; got {self.places!r:.200}")
        if not (self.below <= 0.0 <= self.above):
            raise InputError(
                f"it levels off at a root below and one above zero; got {self.below}, {self.above}"
            )

    @classmethod
    def normal(cls, value: float, error: float) -> CurveLikelihood:
        """A likelihood that is normal in the logarithm, from a value (SI) and its standard error."""
        if not (value > 0.0 and error > 0.0 and math.isfinite(value) and math.isfinite(error)):
            raise InputError(f"a value and its error must be positive numbers; got {value!r} and {error!r}")
        middle, spread = math.log(value), error / value
        return cls(tuple(middle + spread * root for root in _ROOTS))

    @classmethod
    def of_answers(cls, answer: Callable[[str, float], Answer], name: str) -> CurveLikelihood:
        """Likelihood from the ends of a number's statistical intervals at one, two and three standard deviations.

        The middle is that of the narrowest interval, the median: the least-squares value may lie at a bound,
        outside the intervals. Where even that is open the curve says nothing on that side, and the likelihood is
        flat there.
        """
        nearest = answer(name, _NEAREST).statistical
        ends = [math.log(end) for end in (nearest.low, nearest.high) if 0.0 < end < math.inf]
        middle = sum(ends) / len(ends) if ends else math.log(nearest.value)
        parts = [answer(name, float(2.0 * special.ndtr(z) - 1.0)).statistical for z in (1.0, 2.0, 3.0)]
        below = [math.log(part.low) if 0.0 < part.low < math.inf else -math.inf for part in parts]
        above = [math.log(part.high) if math.isfinite(part.high) else math.inf for part in parts]
        levels = [-_level(below), _level(above)]
        return cls((*below[::-1], middle, *above), levels[0], levels[1])

    @classmethod
    def of_posterior(cls, posterior: Posterior, name: str) -> CurveLikelihood:
        """Likelihood from draws, their prior divided out, for a flat prior in the logarithm."""
        if posterior.problem is None or name not in posterior.names:
            raise InputError(
                f"the likelihood of {name} needs a posterior in which it is free and whose prior is known; this "
                f"one has {', '.join(posterior.names)}{': ' + posterior.missing if posterior.missing else ''}"
            )
        coordinate = posterior.problem.coordinates[posterior.names.index(name)]
        values = np.asarray(posterior.of(name), dtype=np.float64).ravel()
        prior = posterior.problem.priors[name]
        log_weight = -(np.log(values) + prior.log_density(values))
        weights = np.exp(log_weight - log_weight.max())
        x = np.log(values)
        at = np.linspace(x.min(), x.max(), _DRAWS_ON_A_GRID)
        log_density = stats.gaussian_kde(x, weights=weights).logpdf(at)
        bounds = np.log([max(coordinate.low, np.finfo(float).tiny), coordinate.high])
        return _of_grid(at, log_density, tuple(bounds.tolist()))

    @cached_property
    def is_normal(self) -> bool:
        """Whether the seven places are equally spaced, as for a normal density."""
        places, middle = self.places, self.middle
        if not all(map(math.isfinite, places)):
            return False
        error = (places[-1] - places[0]) / 6.0
        return all(
            abs(place - middle - error * root) <= _NORMAL * error
            for place, root in zip(places, _ROOTS, strict=True)
        )

    @property
    def middle(self) -> float:
        """Ln of the parameter at which the likelihood is largest."""
        return self.places[_MIDDLE]

    @cached_property
    def error(self) -> float:
        """Standard error of ln: the distance between the outermost finite places over that of their z.

        inf where only the middle is finite.
        """
        finite = [pair for pair in zip(self.places, _ROOTS, strict=True) if math.isfinite(pair[0])]
        (first, lowest), (last, highest) = finite[0], finite[-1]
        return (last - first) / (highest - lowest) if highest > lowest else math.inf

    @property
    def is_open(self) -> bool:
        """Whether it levels off before z = 2 on a side, so that there is no 95 % bound there."""
        return self.below > -2.0 or self.above < 2.0

    def log_at(self, x: FloatArray) -> FloatArray:
        """Log-likelihood at ln of the parameter, any shape; zero at its largest."""
        finite = np.isfinite(self.places)
        inside, roots = np.array(self.places)[finite], ROOTS[finite]
        z = np.interp(x, inside, roots)
        z = np.where(x < inside[0], -_outside(inside[0] - x, -roots[::-1], -inside[::-1], -self.below), z)
        z = np.where(x > inside[-1], _outside(x - inside[-1], roots, inside, self.above), z)
        result: FloatArray = -0.5 * np.clip(z, -_FURTHEST, _FURTHEST) ** 2
        return result

    def as_text(self) -> str:
        """The places and both levels, nine numbers, as text, exact to the last bit; `from_text` reads them."""
        return " ".join(repr(float(number)) for number in (*self.places, self.below, self.above))

    @classmethod
    def from_text(cls, text: str) -> CurveLikelihood:
        """Read what `as_text` wrote.

        Raises
        ------
        InputError
            If it is no such text.
        """
        try:
            numbers = [float(word) for word in text.split()]
        except ValueError:
            numbers = []
        if len(numbers) != len(ROOTS) + 2:
            raise InputError(f"a likelihood is nine numbers; got {text!r:.100}")
        return cls(tuple(numbers[:-2]), numbers[-2], numbers[-1])


def _level(ends: Sequence[float]) -> float:
    """Root z at which a side levels off, from its three interval ends: the number of finite ones; inf for all."""
    known = sum(map(math.isfinite, ends))
    return math.inf if known == len(ends) else float(known)


def _outside(beyond: FloatArray, roots: FloatArray, places: FloatArray, level: float) -> FloatArray:
    """Root z at a distance `beyond` the last place: continued linearly, or exponentially towards `level`."""
    slope = (roots[-1] - roots[-2]) / (places[-1] - places[-2]) if len(roots) > 1 else 0.0
    left = level - roots[-1]
    if math.isinf(left):
        # Only a middle, with no levelling off, is not the result of a profile.
        return np.asarray(roots[-1] + slope * np.maximum(beyond, 0.0), dtype=np.float64)
    if left <= 0.0 or slope == 0.0:
        return np.full(np.shape(beyond), roots[-1])
    return np.asarray(level - left * np.exp(-slope * np.maximum(beyond, 0.0) / left), dtype=np.float64)


def _of_grid(x: FloatArray, log_density: FloatArray, bounds: tuple[float, float]) -> CurveLikelihood:
    """Likelihood from a log-density at x (n,); it levels off on a side that ends at a bound of the prior."""
    best = int(np.argmax(log_density))
    drop = np.sqrt(np.maximum(2.0 * (log_density[best] - log_density), 0.0))
    places, levels = [x[best]] * len(ROOTS), [-math.inf, math.inf]
    spacing = (x[-1] - x[0]) / 50.0
    for upper in (False, True):
        sign = 1 if upper else -1
        outwards = slice(best, None) if upper else slice(best, None, -1)
        there, z = x[outwards], np.maximum.accumulate(drop[outwards])
        at_bound = abs(there[-1] - bounds[int(upper)]) < spacing
        for step in (1, 2, 3):
            if z[-1] > step:
                places[_MIDDLE + sign * step] = float(np.interp(step, z, there))
            else:
                places[_MIDDLE + sign * step] = sign * math.inf
        if at_bound and z[-1] <= ROOTS[-1]:
            # At a bound the kernel density is halved within the width of its kernel: the level is taken a little
            # inside.
            inside = np.abs(there - there[-1]) >= spacing
            levels[int(upper)] = sign * float(z[inside][-1]) if inside.any() else 0.0
            for step in (1, 2, 3):
                if abs(levels[int(upper)]) <= step:
                    places[_MIDDLE + sign * step] = sign * math.inf
    return CurveLikelihood(tuple(float(place) for place in places), levels[0], levels[1])
