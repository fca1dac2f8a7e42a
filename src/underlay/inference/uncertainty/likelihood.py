"""The likelihood of a problem's curves, and what is computed from it: intervals, draws, disturbances.

    y = F(theta) + misfit + step + ramp + turn + noise

The readings y are the model F at the parameters theta and everything that may disturb it. The value is that of
least squares (`moments`); its uncertainty is averaged over the possible disturbances (`hypotheses`). Where the
force is linear enough in the free parameters, which is checked, the result has a closed form; else it is drawn by
importance sampling along the ridge of the likelihood (`ridge`).
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from underlay._arrays import FloatArray
from underlay.data.curve import Curve
from underlay.errors import InputError
from underlay.inference.uncertainty.reading import DrawnReading, LinearReading, Reading
from underlay.inference.uncertainty.tree import (
    bending,
    curve_models,
    has_common_errors,
    held,
    straight,
    tangents,
)
from underlay.inference.uncertainty.weighed import CurveState, Weighed, least_norm

if TYPE_CHECKING:
    from underlay.inference.uncertainty.density import Density
    from underlay.inference.uncertainty.ridge import Ridges

# Largest relative error of a Gauss-Newton step from two standard deviations off for the closed form: in contact
# point or stiffening, in which the force is nearly linear, and in the other numbers.
_BENT, _CURVED = 0.35, 0.05


@dataclass(frozen=True, eq=False)
class Likelihood(Weighed):
    """The likelihood of a fit's curves in the free parameters, about the optimum.

    Parameters
    ----------
    fit : Fit
        The fit: its vector is the value; its problem states the free parameters and what is known of the noise.
    states : tuple of CurveState
        One for each curve.
    """

    @classmethod
    def of(cls, fit: Any) -> Likelihood:
        """Likelihood of a fit, with the probabilities of what disturbs each of its curves."""
        return cls(fit, tuple(CurveState.of(model, fit.vector) for model in curve_models(fit)))

    @cached_property
    def is_straight(self) -> bool:
        """Whether the force is linear enough for the closed form, as far as two standard deviations either way."""
        problem = self.fit.problem
        if has_common_errors(problem):
            return True
        if held(self.fit).any():
            return False
        curved = ~straight(problem)
        # Nothing is linear over a factor of e, and far beyond it numbers overflow.
        if (2.0 * self.mixture.deviations[curved & problem.space.logarithmic] > 1.0).any():
            return False
        return self._bend(curved, chord=True) < _CURVED and self._bend(bending(problem)) < _BENT

    def read(self, rng: int | np.random.Generator = 0, draws: int | None = None) -> Reading:
        """Compute intervals and draws of the parameters.

        Parameters
        ----------
        rng : int or numpy Generator, default 0
            Seed or generator: the same one gives the same draws.
        draws : int, optional
            Approximate number of draws.

        Returns
        -------
        Reading
            In closed form where the force is linear enough, else from importance sampling.
        """
        wanted = {} if draws is None else {"count": draws}
        if self.is_straight:
            return LinearReading(self, self.mixture, np.random.default_rng(rng), **wanted)
        from underlay.inference.uncertainty.ridge import draw  # noqa: PLC0415  the closed form serves most curves

        return DrawnReading(self, draw(self._ridges, np.random.default_rng(rng), **wanted))

    def log_density(self, vectors: FloatArray) -> FloatArray:
        """Log-posterior (sets,) of scaled vectors (sets, k), as emcee uses it; -inf where it is impossible."""
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
        """Synthetic curves at the averaged depths of the measured ones, with noise and disturbances drawn anew."""
        return [state.model.curve(state.disturbed(rng)) for state in self.states]

    def _bend(self, entries: NDArray[np.bool_], *, chord: bool = False) -> float:
        """Nonlinearity of the force in the entries of a mask (k,): relative error of a Gauss-Newton step.

        The step starts two standard deviations from the optimum in each of them; the largest error counts. With
        `chord` it takes the derivatives at the optimum, which errs by as much to leading order and needs no others.
        """
        mixture, worst = self.mixture, 0.0
        for i in np.flatnonzero(entries):
            C = np.einsum("m,mij->ij", mixture.weights, mixture.covariances)
            if not C[i, i] > 0.0:
                continue
            away = 2.0 * C[i] / C[i, i] ** 0.5
            for sign in (-1.0, 1.0):
                worst = max(worst, self._missed(sign * away, int(i), chord=chord))
        return worst

    def _missed(self, away: FloatArray, i: int, *, chord: bool) -> float:
        """Relative distance of entry `i` from the optimum after a Gauss-Newton step from the offset `away` (k,)."""
        k, there = len(away), self.fit.vector + away
        pull, normal = np.zeros(k), np.diag(self.priors)
        asked = self._chords(there) if chord else self._tangents(there)
        if asked is None:
            return np.inf
        for state, (force, columns) in zip(self.states, asked, strict=True):
            pull += columns.T @ (state.tangent.force - force)
            normal = normal + columns.T @ columns
        kept = np.flatnonzero(self.determined)
        step = np.zeros(k)
        step[kept] = least_norm(normal[kept[:, None], kept], pull[kept])
        return float(abs(away[i] + step[i]) / abs(away[i]))

    def _tangents(self, there: FloatArray) -> list[tuple[FloatArray, FloatArray]] | None:
        found = tangents([state.model for state in self.states], there)
        return None if found is None else [(own.force, own.columns) for own in found]

    def _chords(self, there: FloatArray) -> list[tuple[FloatArray, FloatArray]] | None:
        """Force (n,) of each curve at a scaled vector, with the derivatives (n, k) at the optimum.

        None without a contact law, and beyond bounds, of which the closed form knows nothing.
        """
        low, high = self.fit.problem.bounds.T
        if not ((low <= there) & (there <= high)).all():
            return None
        found = []
        for state in self.states:
            try:
                _, forces, possible = state.model.forces(there[None])
            except InputError:
                return None
            if not possible[0]:
                return None
            found.append((forces[0], state.tangent.columns))
        return found
