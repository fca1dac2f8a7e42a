"""The curves of a fit with the probabilities of what may disturb each, at the least-squares optimum."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from underlay._arrays import FloatArray
from underlay.inference.model.coordinates import FAR
from underlay.inference.uncertainty.columns import Columns
from underlay.inference.uncertainty.hypotheses import Hypotheses, weigh, white
from underlay.inference.uncertainty.linear import Combined, Mixture, combine, linear_mixture
from underlay.inference.uncertainty.moments import CurveMoments
from underlay.inference.uncertainty.noise import NoiseTable, from_cosines, growth, noise_table, white_table
from underlay.inference.uncertainty.seen import Seen, seen_in
from underlay.inference.uncertainty.tree import (
    CurveModel,
    Tangent,
    has_common_errors,
    held,
    noise_entries,
    prior_precision,
    scales_force,
    tangents,
)

_KNOWN = 1e9  # degrees of freedom for a noise of stated size


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
        model = self.model
        return seen_in(
            self.columns, self.tangent, self.hypotheses, self.table, self.growth, model.deviation, model.size
        )

    def disturbed(self, rng: np.random.Generator) -> FloatArray:
        """Simulated rows (n,): the model with noise and disturbances drawn from the hypotheses."""
        own = self.hypotheses
        one = int(rng.choice(len(own.weight), p=own.weight))
        n = len(self.model.measured)
        coefficients = rng.standard_normal((n, 1)) * np.sqrt(self.table.spectra[own.noise[one]])[:, None]
        noise = from_cosines(coefficients)[:, 0] * np.sqrt(self.growth)
        sizes = own.sizes(self.columns, one)
        amplitudes = sizes * rng.standard_normal(len(sizes))
        disturbance = own.variance[one] ** 0.5 * (noise + self.columns.values @ amplitudes)
        return np.asarray(self.tangent.force + disturbance)


@dataclass(frozen=True, eq=False)
class Weighed:
    """Curves of a fit about its optimum, with the probabilities of what may disturb them.

    Parameters
    ----------
    fit : Fit
        The fit: its vector is the value; its problem states the free parameters and what is known of the noise.
    states : tuple of CurveState
        One for each curve.
    """

    fit: Any
    states: Sequence[CurveState]

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
        if has_common_errors(self.fit.problem):
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
            pulls += law.T @ state.model.rows(column)
            normal += law.T @ law
        kept = np.flatnonzero(self.determined & ~held(self.fit))
        found = np.zeros(len(pulls))
        found[kept] = least_norm(normal[kept[:, None], kept] + np.diag(self.priors[kept]), pulls[kept])
        return found

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


def least_norm(matrix: FloatArray, right: FloatArray) -> FloatArray:
    """Least-norm solution (k,) of a symmetric system that may be singular.

    Parameters with the same effect then share it equally.
    """
    return np.asarray(np.linalg.pinv(matrix, hermitian=True) @ right)
