"""The likelihood of a problem's curves, and what is computed from it: intervals, draws, disturbances.

    y = F(theta) + misfit + step + ramp + turn + noise

The readings y are the model F at the parameters theta and everything that may disturb it. The value is that of
least squares (`moments`); its uncertainty is averaged over the possible disturbances (`hypotheses`). Where the
force is linear enough in the free parameters, which is checked, the result has a closed form; else it is drawn by
importance sampling along the ridge of the likelihood (`ridge`).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from underlay._arrays import FloatArray
from underlay.errors import InputError
from underlay.inference.model.coordinates import FAR
from underlay.inference.uncertainty.columns import Columns
from underlay.inference.uncertainty.hypotheses import Hypotheses, weigh, white
from underlay.inference.uncertainty.mixture import Combined, Mixture, combine, linear_mixture
from underlay.inference.uncertainty.moments import CurveMoments
from underlay.inference.uncertainty.noise import NoiseTable, growth, noise_table, white_table
from underlay.inference.uncertainty.reading import DrawnReading, LinearReading, Reading
from underlay.inference.uncertainty.seen import Seen, seen_in
from underlay.inference.uncertainty.tree import (
    CurveModel,
    Tangent,
    bending,
    held,
    noise_entries,
    prior_precision,
    scales_force,
    straight,
    tangents,
)

if TYPE_CHECKING:
    from underlay.inference.least_squares.fit_result import Fit
    from underlay.inference.uncertainty.density import Density
    from underlay.inference.uncertainty.ridge import Ridges

_KNOWN = 1e9  # degrees of freedom for a noise of stated size
# Largest relative error of a Gauss-Newton step from two standard deviations off for the closed form: in contact
# point or stiffening, in which the force is nearly linear, and in the other numbers.
_BENT, _CURVED = 0.35, 0.05


@dataclass(frozen=True, eq=False)
class CurveState:
    """One curve at the least-squares optimum: its model, linearisation, columns of disturbances and hypotheses.

    `table` holds the noises that are tried, and `growth` (n,) the relative variances of the rows where the noise
    grows with stiffness.
    """

    model: CurveModel
    tangent: Tangent
    columns: Columns
    table: NoiseTable
    growth: FloatArray
    hypotheses: Hypotheses

    @classmethod
    def of(cls, model: CurveModel, vector: FloatArray) -> CurveState:
        """Compute the probabilities of what disturbs a curve at the optimum `vector` (k,)."""
        tangent = model.tangent(vector)
        columns = Columns.of(tangent, model.measured, ~scales_force(model.problem))
        n = len(model.measured)
        if not model.is_open:
            own = white(columns, 1.0 if model.size_is_known else None)
            return cls(model, tangent, columns, white_table(n), np.ones(n), own)
        table, grown = noise_table(n), np.ones(n)
        if model.least_variance == 0.0:
            grown = growth(columns.values[:, -1], tangent.stiffness)
        top = float(np.abs(tangent.contact).max())
        own = weigh(columns, table, grown, top, model.least_variance)
        return cls(model, tangent, columns, table, grown, own)

    @cached_property
    def moments(self) -> CurveMoments:
        """Moments of the residuals under each hypothesis, for this linearisation."""
        return CurveMoments.of(self.columns, self.hypotheses, self.table, self.growth)

    @cached_property
    def seen(self) -> Seen:
        """Estimated disturbances of the curve in plain numbers."""
        contact, deviation = self.tangent.contact, self.model.deviation
        return seen_in(self.columns, contact, self.hypotheses, self.table, self.growth, deviation)


@dataclass(frozen=True, eq=False)
class Likelihood:
    """The likelihood of a fit's curves in the free parameters, about the optimum.

    Parameters
    ----------
    fit : Fit
        The fit: its vector is the value; its problem states the free parameters and what is known of the noise.
    states : sequence of CurveState
        One for each curve.
    """

    fit: Fit
    states: Sequence[CurveState]

    @classmethod
    def of(cls, fit: Fit) -> Likelihood:
        """Likelihood of a fit, with the probabilities of what disturbs each of its curves."""
        models = (CurveModel.of(fit, i) for i in range(len(fit.problem.members)))
        return cls(fit, [CurveState.of(model, fit.vector) for model in models])

    @property
    def seen(self) -> tuple[Seen, ...]:
        """Estimated disturbances of each curve (noise, misfit, step, ramp, turn)."""
        return tuple(state.seen for state in self.states)

    @cached_property
    def combined(self) -> Combined:
        """Joint hypotheses on the disturbances of all curves, with their probabilities."""
        return combine([state.hypotheses for state in self.states])

    @cached_property
    def freedom(self) -> float:
        """Degrees of freedom of the noise's variance; 1e9 where its size is stated."""
        if all(state.model.size_is_known for state in self.states):
            return _KNOWN
        rows = sum(len(state.model.measured) for state in self.states)
        return float(max(rows - len(self.fit.vector), 1))

    @cached_property
    def mixture(self) -> Mixture:
        """Distribution of the scaled vector if the force is linear in it."""
        if self.fit.problem.common is not None:
            # The moments of single curves do not contain errors that the curves share; the fit's own covariance
            # does.
            vector, covariance = np.asarray(self.fit.vector), np.asarray(self.fit.scaled_covariance)
            return Mixture(np.ones(1), vector[None], covariance[None], self.freedom)
        moments = [state.moments for state in self.states]
        free = self.determined & ~held(self.fit)
        found = linear_mixture(
            moments, self.combined, self.fit.vector, free, self.freedom, self.priors, self._beyond_tangents
        )
        entries = noise_entries(self.fit.problem)
        found.covariances[:, entries[:, None], entries] = self.fit.scaled_covariance[
            entries[:, None], entries
        ]
        return found

    def _beyond_tangents(self, step: FloatArray) -> list[FloatArray]:
        """Force (n,) of each curve less its linearisation, for a step (k,) from the optimum."""
        there = self.fit.vector + step
        low, high = self.fit.problem.bounds.T
        inside = ((low <= there) & (there <= high) & (np.abs(there) <= FAR)).all()
        asked = tangents([state.model for state in self.states], there) if inside else None
        if asked is None:
            # Beyond bounds, or where no contact law exists, the correction stays one of the first order.
            return [np.zeros(len(state.tangent.force)) for state in self.states]
        return [
            own.force - state.tangent.force - state.columns.values[:, state.columns.law] @ step
            for own, state in zip(asked, self.states, strict=True)
        ]

    def moved(self, columns: Sequence[FloatArray]) -> FloatArray:
        """Shift (k,) of the scaled vector, to first order, by added forces (N), one array (points,) a curve."""
        pulls, normal = np.zeros(len(self.fit.vector)), np.zeros((len(self.fit.vector),) * 2)
        for state, column in zip(self.states, columns, strict=True):
            law = state.columns.values[:, state.columns.law]
            pulls += law.T @ state.model.fold(np.asarray(column, dtype=np.float64))
            normal += law.T @ law
        return _least_norm(normal + np.diag(self.priors), pulls, self.determined & ~held(self.fit))

    @cached_property
    def priors(self) -> FloatArray:
        """Curvature (k,) of the log-density of the informative priors; zero for flat ones."""
        return prior_precision(self.fit.problem)

    @cached_property
    def determined(self) -> NDArray[np.bool_]:
        """Mask (k,) of the entries of the scaled vector that act on some curve."""
        acts = [np.abs(own.columns.values[:, own.columns.law]).max(axis=0) > 0.0 for own in self.states]
        return np.asarray(np.any(acts, axis=0))

    @property
    def entries(self) -> NDArray[np.intp]:
        """Indices of the entries of the scaled vector that act on some curve."""
        return np.flatnonzero(self.determined)

    @cached_property
    def is_straight(self) -> bool:
        """Whether the force is linear enough for the closed form, as far as two standard deviations either way."""
        problem = self.fit.problem
        if problem.common is not None:
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
        if chord:
            asked = self._chords(there)
        else:
            found = tangents([state.model for state in self.states], there)
            asked = None if found is None else [(own.force, own.columns) for own in found]
        if asked is None:
            return np.inf
        for state, (force, columns) in zip(self.states, asked, strict=True):
            pull += columns.T @ (state.tangent.force - force)
            normal = normal + columns.T @ columns
        step = _least_norm(normal, pull, self.determined)
        return float(abs(away[i] + step[i]) / abs(away[i]))

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


def _least_norm(matrix: FloatArray, right: FloatArray, which: NDArray[np.bool_]) -> FloatArray:
    """Least-norm solution (k,) of a symmetric system that may be singular, in the entries of a mask (k,).

    Parameters with the same effect then share it equally.
    """
    kept, found = np.flatnonzero(which), np.zeros(len(right))
    found[kept] = np.linalg.pinv(matrix[kept[:, None], kept], hermitian=True) @ right[kept]
    return found
