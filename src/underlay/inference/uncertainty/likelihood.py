"""One likelihood of a problem's curves, and what is read from it: intervals, draws, what is seen.

    y = F(theta) + misfit + step + ramp + noise

The value is least squares' (`moments`); how sure it is averages over everything that may disturb a curve
(`hypotheses`). A reading in closed form serves where the force is straight in what is free, which is checked; else
draws along the ridge (`ridge`).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from underlay._arrays import FloatArray
from underlay.data.curve import Curve
from underlay.errors import InputError
from underlay.inference.uncertainty.columns import Columns
from underlay.inference.uncertainty.hypotheses import Hypotheses, weigh, white
from underlay.inference.uncertainty.linear import Combined, Mixture, combine, linear_mixture
from underlay.inference.uncertainty.moments import CurveMoments
from underlay.inference.uncertainty.noise import NoiseTable, from_cosines, growth, noise_table, white_table
from underlay.inference.uncertainty.reading import DrawnReading, LinearReading, Reading
from underlay.inference.uncertainty.seen import Seen, seen_in
from underlay.inference.uncertainty.tree import (
    CurveModel,
    Tangent,
    curve_models,
    has_common_errors,
    held,
    noise_entries,
    prior_precision,
    straight,
)

if TYPE_CHECKING:
    from underlay.inference.uncertainty.density import Density
    from underlay.inference.uncertainty.ridge import Ridges

__all__ = ["Likelihood"]

_KNOWN = 1e9  # degrees of freedom of a noise whose size is stated
_BENT = 0.35  # of two standard deviations: how far from straight the force may be in the contact


@dataclass(frozen=True, eq=False)
class CurveState:
    """One curve at least squares: its model, tangent, columns and hypotheses."""

    model: CurveModel
    tangent: Tangent
    columns: Columns
    table: NoiseTable
    growth: FloatArray
    hypotheses: Hypotheses

    @classmethod
    def of(cls, model: CurveModel, vector: FloatArray) -> CurveState:
        """Weigh what disturbs a curve at the optimum `vector` (k,)."""
        tangent = model.tangent(vector)
        columns, n = Columns.of(tangent, model.measured), len(model.measured)
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
        """Moments on this linearisation."""
        return CurveMoments.of(self.columns, self.hypotheses, self.table, self.growth)

    @cached_property
    def seen(self) -> Seen:
        """What is seen of the curve."""
        model = self.model
        return seen_in(
            self.columns, self.tangent, self.hypotheses, self.table, self.growth, model.deviation, model.size
        )

    def disturbed(self, rng: np.random.Generator) -> FloatArray:
        """Rows (n,) of the model with a draw of everything that may disturb it."""
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
class Likelihood:
    """Everything that a fit's curves say of what is free, about its optimum.

    Parameters
    ----------
    fit : Fit
        Its vector is the value; its problem says what is free, and what is known of the noise.
    states : tuple of CurveState
        One a curve.
    """

    fit: Any
    states: Sequence[CurveState]

    @classmethod
    def of(cls, fit: Any) -> Likelihood:
        """Weigh what disturbs each curve of a fit."""
        return cls(fit, tuple(CurveState.of(model, fit.vector) for model in curve_models(fit)))

    @property
    def seen(self) -> tuple[Seen, ...]:
        """What is seen of each curve."""
        return tuple(state.seen for state in self.states)

    @cached_property
    def combined(self) -> Combined:
        """Hypotheses of all curves together."""
        return combine([state.hypotheses for state in self.states])

    @cached_property
    def freedom(self) -> float:
        """Degrees of freedom that the size of the noise is known with."""
        if all(state.model.size_is_known for state in self.states):
            return _KNOWN
        rows = sum(len(state.model.measured) for state in self.states)
        return float(max(rows - len(self.fit.vector), 1))

    @cached_property
    def mixture(self) -> Mixture:
        """Distribution of the scaled vector where the force is straight in it."""
        moments = [state.moments for state in self.states]
        free = self.determined & ~held(self.fit)
        found = linear_mixture(moments, self.combined, self.fit.vector, free, self.freedom, self.priors)
        entries = noise_entries(self.fit.problem)
        found.covariances[:, entries[:, None], entries] = self.fit.scaled_covariance[
            entries[:, None], entries
        ]
        return found

    @cached_property
    def is_straight(self) -> bool:
        """Whether the closed form serves: nothing free bends the force by more than a third of its own doubt."""
        problem = self.fit.problem
        if held(self.fit).any() or not straight(problem).all() or has_common_errors(problem):
            return False
        return self._bend() < _BENT

    def read(self, rng: int | np.random.Generator = 0) -> Reading:
        """Intervals and draws; the same for the same `rng`."""
        if self.is_straight:
            return LinearReading(self, self.mixture, np.random.default_rng(rng))
        from underlay.inference.uncertainty.ridge import draw  # noqa: PLC0415  the closed form serves most curves

        return DrawnReading(self, draw(self._ridges, np.random.default_rng(rng)))

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

    def moved(self, columns: Sequence[FloatArray]) -> FloatArray:
        """Shift (k,) of the scaled vector that additive forces (N), one (points,) a curve, make, to first order."""
        pulls, normal = np.zeros(len(self.fit.vector)), np.zeros((len(self.fit.vector),) * 2)
        for state, column in zip(self.states, columns, strict=True):
            law = state.columns.values[:, state.columns.law]
            pulls += law.T @ state.model.rows(column)
            normal += law.T @ law
        kept = np.flatnonzero(self.determined & ~held(self.fit))
        found = np.zeros(len(pulls))
        found[kept] = _solved(normal[kept[:, None], kept] + np.diag(self.priors[kept]), pulls[kept])
        return found

    def sized(
        self, columns: Sequence[Sequence[FloatArray]], deviations: FloatArray
    ) -> tuple[FloatArray, FloatArray]:
        """Sizes of additive forces that the curves tell beside the law: means (m,) and covariance (m, m).

        Parameters
        ----------
        columns : sequence of sequence of FloatArray
            Of each curve the forces (N) at size one, m arrays (points,).
        deviations : FloatArray
            Of the normal priors of the sizes about zero, (m,).
        """
        kept = np.flatnonzero(self.determined & ~held(self.fit))
        blocks, residuals = [], []
        for state, own in zip(self.states, columns, strict=True):
            law = state.columns.values[:, state.columns.law][:, kept]
            blocks.append(np.column_stack((law, *(state.model.rows(column) for column in own))))
            residuals.append(state.columns.values[:, state.columns.residual][:, 0])
        A, r = np.concatenate(blocks), np.concatenate(residuals)
        prior = np.concatenate((self.priors[kept], deviations**-2.0))
        normal, pull = A.T @ A, A.T @ r
        left = r - A @ np.linalg.solve(normal + np.diag(prior), pull)
        # What neither law nor these explain makes all less sure.
        variance = max(float(left @ left) / max(len(r) - len(pull), 1), 1.0)
        covariance = np.linalg.inv(normal / variance + np.diag(prior))
        mean = covariance @ (pull / variance)
        return mean[len(kept) :], covariance[len(kept) :, len(kept) :]

    def simulate(self, rng: np.random.Generator) -> list[Curve]:
        """Replicas of the curves, at the depths of their rows, with all that may disturb them drawn anew."""
        return [state.model.curve(state.disturbed(rng)) for state in self.states]

    @cached_property
    def priors(self) -> FloatArray:
        """Curvature (k,) of the log-density of the priors that say something."""
        return prior_precision(self.fit.problem)

    @cached_property
    def determined(self) -> NDArray[np.bool_]:
        """Entries that act on some curve, (k,)."""
        acts = [np.abs(own.columns.values[:, own.columns.law]).max(axis=0) > 0.0 for own in self.states]
        return np.asarray(np.any(acts, axis=0))

    @property
    def entries(self) -> NDArray[np.intp]:
        """The same as numbers."""
        return np.flatnonzero(self.determined)

    def _bend(self) -> float:
        """How far a step back from two standard deviations of the contact misses, in these."""
        mixture, problem = self.mixture, self.fit.problem
        worst = 0.0
        for i in np.flatnonzero([c.path == "instrument.contact_depth" for c in problem.coordinates]):
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
        step[kept] = _solved(normal[kept[:, None], kept], pull[kept])
        return float(abs(away[i] + step[i]) / abs(away[i]))


def _solved(matrix: FloatArray, right: FloatArray) -> FloatArray:
    """Least-norm solution (k,): two numbers that act alike share what they must do."""
    return np.asarray(np.linalg.pinv(matrix, hermitian=True) @ right)
