"""One likelihood of a problem's curves, and what is read from it: intervals, draws, what is seen.

    y = F(theta) + misfit + step + ramp + turn + noise

The readings y are the model F at the parameters theta and all that may disturb it. The value is least squares'
(`moments`); how sure it is averages over everything that may disturb a curve (`hypotheses`). A reading in
closed form serves where the force is straight in what is free, which is checked; else draws along the ridge
(`ridge`).
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np

from underlay._arrays import FloatArray
from underlay.data.curve import Curve
from underlay.errors import InputError
from underlay.inference.uncertainty.reading import DrawnReading, LinearReading, Reading
from underlay.inference.uncertainty.tree import bending, curve_models, has_common_errors, held, straight
from underlay.inference.uncertainty.weighed import CurveState, Weighed, least_norm

if TYPE_CHECKING:
    from underlay.inference.uncertainty.density import Density
    from underlay.inference.uncertainty.ridge import Ridges

__all__ = ["Likelihood"]

# How far from straight the force may be in contact and stiffening for the closed form, over two deviations.
_BENT = 0.35


@dataclass(frozen=True, eq=False)
class Likelihood(Weighed):
    """The likelihood of a fit's curves in what is free, about its optimum.

    Parameters
    ----------
    fit : Fit
        The fit: its vector is the value; its problem says what is free, and what is known of the noise.
    states : tuple of CurveState
        One for each curve.
    """

    @classmethod
    def of(cls, fit: Any) -> Likelihood:
        """Weigh what disturbs each curve of a fit."""
        return cls(fit, tuple(CurveState.of(model, fit.vector) for model in curve_models(fit)))

    @cached_property
    def is_straight(self) -> bool:
        """Whether the closed form serves: nothing free bends the force by more than a third of its own doubt."""
        problem = self.fit.problem
        if has_common_errors(problem):
            return True
        if held(self.fit).any() or not straight(problem).all():
            return False
        return self._bend() < _BENT

    def read(self, rng: int | np.random.Generator = 0, draws: int | None = None) -> Reading:
        """Read intervals and draws from the likelihood.

        Parameters
        ----------
        rng : int or numpy Generator, default 0
            Seed or generator: the same one gives the same draws.
        draws : int, optional
            About how many draws.
        """
        wanted = {} if draws is None else {"count": draws}
        if self.is_straight:
            return LinearReading(self, self.mixture, np.random.default_rng(rng), **wanted)
        from underlay.inference.uncertainty.ridge import draw  # noqa: PLC0415  the closed form serves most curves

        return DrawnReading(self, draw(self._ridges, np.random.default_rng(rng), **wanted))

    def log_density(self, vectors: FloatArray) -> FloatArray:
        """Log-density (sets,) of scaled vectors (sets, k), priors and all: for emcee; -inf where there is none."""
        return self._density.log(np.atleast_2d(vectors))

    @cached_property
    def _density(self) -> Density:
        from underlay.inference.uncertainty.density import Density  # noqa: PLC0415  the closed form serves most curves

        return Density.of(self) if self.is_straight else self._ridges.density

    @cached_property
    def _ridges(self) -> Ridges:
        from underlay.inference.uncertainty.ridge import Ridges  # noqa: PLC0415  the closed form serves most curves

        return Ridges.of(self)

    def simulate(self, rng: np.random.Generator) -> list[Curve]:
        """Replicas of the curves, at the depths of their rows, with all that may disturb them drawn anew."""
        return [state.model.curve(state.disturbed(rng)) for state in self.states]

    def _bend(self) -> float:
        """How far a step back from two standard deviations of contact, or of stiffening, misses, over these."""
        mixture, problem = self.mixture, self.fit.problem
        worst = 0.0
        for i in np.flatnonzero(bending(problem)):
            C = np.einsum("m,mij->ij", mixture.weights, mixture.covariances)
            if not C[i, i] > 0.0:
                continue
            away = 2.0 * C[i] / C[i, i] ** 0.5
            for sign in (-1.0, 1.0):
                worst = max(worst, self._missed(sign * away, int(i)))
        return worst

    def _missed(self, away: FloatArray, i: int) -> float:
        """Distance of entry `i` from the optimum after a Gauss-Newton step from `away` (k,) of it, over its own."""
        k = len(away)
        pull, normal = np.zeros(k), np.diag(self.priors)
        for state in self.states:
            try:
                there = state.model.tangent(self.fit.vector + away)
            except InputError:
                return np.inf
            pull += there.columns.T @ (state.tangent.force - there.force)
            normal = normal + there.columns.T @ there.columns
        kept = np.flatnonzero(self.determined)
        step = np.zeros(k)
        step[kept] = least_norm(normal[kept[:, None], kept], pull[kept])
        return float(abs(away[i] + step[i]) / abs(away[i]))
