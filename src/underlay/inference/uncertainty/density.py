"""The log-density of the scaled vector of parameters, also far from the optimum, from which posteriors are drawn.

    p(theta) = prior(theta) sum_m w_m p_m(theta),    p_m = Student(t(theta); 0, V_m) |H_m|

summed over the hypotheses m of what disturbs the curves, with their weights w_m. t are the moments of the residuals
(`moments`), evaluated by the model itself, not linearised; V_m is their covariance and H_m their derivative. Where
a hypothesis has white noise with or without step, ramp or turn only, the whole sum of squares replaces the moments
without loss.

A disturbance as large as the force must not make a modulus of zero likely: therefore the size of the contact force
enters by its logarithm. With rho = (P, P_0) / (P_0, P_0) the size of the contact force P relative to the force P_0
at the best fit, and F the reading of the model, the density uses

    F* = F - P + P_0 ln rho + P / rho,

which equals F to first order, and is as far from P_0 at a tenth of it as at ten times.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.special import logsumexp

from underlay._arrays import FloatArray
from underlay.inference.problem import Problem
from underlay.inference.uncertainty.moments import CurveMoments
from underlay.inference.uncertainty.tree import CurveModel, Tangent, scales_force

_SINGULAR = 1e-11  # added to the unit diagonal of a scaled matrix, for nearly undetermined directions


class Place(NamedTuple):
    """One curve's model linearised at a vector: residual change F_0 - F* (n,), and d F* / d vector (n, k).

    F* is the reading with the size of the contact force by its logarithm (see the module), F_0 that at the best
    fit.
    """

    fallen: FloatArray
    columns: FloatArray


class Node(NamedTuple):
    """A scaled vector (k,) on a ridge, and the curves linearised there."""

    vector: FloatArray
    places: Sequence[Place]


class Local(NamedTuple):
    """Local expansion of each of the m hypotheses' log-densities at a vector.

    `level` is ln (w_m p_m) there, (m,); `pull` (m, k) and `normal` (m, k, k) are gradient and curvature of half a
    sum of squares, without the prior's.
    """

    level: FloatArray
    pull: FloatArray
    normal: FloatArray


@dataclass(frozen=True, eq=False)
class DensityCurve:
    """One curve of a density.

    `model` computes its forces, `moments` the moments of its residuals; `contact` and `force` are the contact force
    and the reading at the best fit, (n,); `acts` marks the entries of the vector that scale the contact force.
    """

    model: CurveModel
    moments: CurveMoments
    contact: FloatArray
    force: FloatArray
    acts: NDArray[np.bool_]

    @classmethod
    def of(cls, state: Any, vector: FloatArray, bends: FloatArray | None) -> DensityCurve:
        """One curve at the optimum `vector` (k,); `bends` (n, p) are further directions with moments, or None."""
        moments = CurveMoments.of(state.columns, state.hypotheses, state.table, state.growth, bends)
        contact, force, _ = state.model.forces(vector[None])
        return cls(state.model, moments, contact[0], force[0], scales_force(state.model.problem))

    def fallen(self, vectors: FloatArray) -> FloatArray:
        """Changes F_0 - F* (sets, n) of the reading from the best fit, F* as in the module.

        NaN where the vector has no contact law or its contact force is not positive.
        """
        contact, force, possible = self.model.forces(vectors)
        size = contact @ self.contact / (self.contact @ self.contact)
        size = np.where(possible & (size > 0.0), size, np.nan)[:, None]
        return np.asarray(self.force - (force - contact) - self.contact * np.log(size) - contact / size)

    def place(self, tangent: Tangent) -> Place | None:
        """F_0 - F* (n,) and its derivatives at the vector of a `tangent`; None for a force that is not positive."""
        square, contact = float(self.contact @ self.contact), tangent.pressing
        rest = tangent.force - contact
        size = float(contact @ self.contact) / square
        if not size > 0.0:
            return None
        pressing = np.where(self.acts, tangent.columns, 0.0)
        grows = self.contact @ pressing / square
        columns = tangent.columns - pressing + pressing / size
        columns += np.outer(self.contact / size - contact / size**2, grows)
        return Place(self.force - rest - self.contact * np.log(size) - contact / size, columns)


@dataclass(frozen=True, eq=False)
class Density:
    """Log-density of scaled vectors; the module gives the formula.

    Parameters
    ----------
    likelihood : Likelihood
        Curves of a fit and their hypotheses.
    curves : tuple of DensityCurve
        One for each curve.
    kept : ndarray of int
        Entries of the vector that act on some curve.
    height : FloatArray
        Largest value of ln (w_m p_m) of each hypothesis, (m,).
    precision : FloatArray
        Inverse of the moments' covariance V_m, (m, k, k).
    """

    likelihood: Any
    curves: tuple[DensityCurve, ...]
    kept: NDArray[np.intp]
    height: FloatArray
    precision: FloatArray

    @classmethod
    def of(cls, likelihood: Any, bends: Sequence[FloatArray] | None = None) -> Density:
        """Density with moments of the model's derivatives and, per curve, of further directions `bends` (n, p)."""
        vector, kept = likelihood.fit.vector, likelihood.entries
        curves = tuple(
            DensityCurve.of(state, vector, None if bends is None else bends[i])
            for i, state in enumerate(likelihood.states)
        )
        rows = likelihood.combined.rows
        information, covariance = (
            sum(getattr(curve.moments, what)[row] for curve, row in zip(curves, rows, strict=True))
            for what in ("information", "covariance")
        )
        information, covariance = (part[:, kept[:, None], kept] for part in (information, covariance))
        scale = np.sqrt(np.diagonal(covariance, axis1=1, axis2=2))
        outer = scale[:, :, None] * scale[:, None, :]
        scaled = covariance / outer + _SINGULAR * np.eye(len(kept))
        precision = np.linalg.inv(scaled) / outer
        size = np.sqrt(np.abs(np.diagonal(information, axis1=1, axis2=2)))
        slopes = information / size[:, :, None] / size[:, None, :] + _SINGULAR * np.eye(len(kept))
        height = np.log(likelihood.combined.weights)
        height += np.linalg.slogdet(slopes)[1] + 2.0 * np.log(size).sum(axis=1)
        height -= 0.5 * np.linalg.slogdet(scaled)[1] + np.log(scale).sum(axis=1)
        return cls(likelihood, curves, kept, height, precision)

    def log(self, vectors: FloatArray) -> FloatArray:
        """Log-density (sets,) at scaled vectors (sets, k); -inf outside the bounds or without a contact law."""
        problem: Problem = self.likelihood.fit.problem
        if not problem.noise_is_open:
            return problem.log_posterior(vectors)
        found = problem.log_prior(vectors)
        inside = np.flatnonzero(np.isfinite(found))
        if not inside.size:
            return found
        fallen = [curve.fallen(vectors[inside]) for curve in self.curves]
        fine = np.all([np.isfinite(own).all(axis=1) for own in fallen], axis=0)
        found[inside[~fine]] = -np.inf
        if fine.any():
            found[inside[fine]] += logsumexp(self.levels([own[fine] for own in fallen]), axis=1)
        return found

    def levels(self, fallen: Sequence[FloatArray]) -> FloatArray:
        """ln (w_m p_m) of every hypothesis, (sets, m), given each curve's change of the reading, (sets, n)."""
        freedom, k = self.likelihood.freedom, len(self.kept)
        t = self._moments(fallen)
        square = np.einsum("smi,mij,smj->sm", t, self.precision, t, optimize=True)
        whole = self._whole
        if whole.any():
            square[:, whole] = self._rises(fallen[0])[:, whole]
        found = self.height - 0.5 * (freedom + k) * np.log1p(square / freedom)
        for curve, row, own in zip(self.curves, self.likelihood.combined.rows, fallen, strict=True):
            if curve.moments.bends:
                found -= np.where(whole, 0.0, _bend_losses(curve.moments, row, own, freedom))
        return np.asarray(found)

    def local(self, places: Sequence[Place]) -> Local:
        """Local expansion of all hypotheses' densities at a vector, given each curve's linearisation there."""
        fallen = [place.fallen[None] for place in places]
        t = self._moments(fallen)[0]
        turns = np.zeros_like(self.precision)
        pull, normal = np.zeros_like(t), np.zeros_like(self.precision)
        for curve, row, place in zip(self.curves, self.likelihood.combined.rows, places, strict=True):
            own, law = curve.moments, place.columns[:, self.kept]
            turns += np.swapaxes(own.coefficients[row][:, :, self.kept], 1, 2) @ (own.basis.T @ law)
            if own.bends:
                bends = own.basis[:, -own.bends :]
                bent = bends.T @ law
                weighted = own.bend_precision[row] @ bent
                pull += np.einsum("mpk,p->mk", weighted, own.bend_offset + bends.T @ place.fallen)
                normal += bent.T @ weighted
        weighted = self.precision @ turns
        pull += np.einsum("mik,mi->mk", weighted, t)
        normal += np.swapaxes(turns, 1, 2) @ weighted
        for one in np.flatnonzero(self._whole):
            pull[one], normal[one] = self._whole_slopes(int(one), places[0])
        return Local(self.levels(fallen)[0], pull, normal)

    @property
    def _whole(self) -> NDArray[np.bool_]:
        """Mask (m,) of hypotheses for which the whole sum of squares is used: only where the fit has one curve."""
        whole = self.curves[0].moments.is_whole[self.likelihood.combined.rows[0]]
        return np.asarray(whole & (len(self.curves) == 1))

    def _moments(self, fallen: Sequence[FloatArray]) -> FloatArray:
        """Moments t of the residuals, (sets, m, k), of all curves, from each one's change of reading (sets, n)."""
        parts = []
        for curve, row, own in zip(self.curves, self.likelihood.combined.rows, fallen, strict=True):
            moments = curve.moments
            projected = np.tensordot(own @ moments.basis, moments.coefficients[row][:, :, self.kept], (1, 1))
            parts.append(projected + moments.offset[row][:, self.kept])
        return np.asarray(sum(parts))

    def _rises(self, fallen: FloatArray) -> FloatArray:
        """Rise (sets, m) of one curve's sum of squares above its linearised minimum, over the noise's variance."""
        own = self.curves[0].moments
        rows = fallen + own.residual
        information, offset = own.information[:, self.kept[:, None], self.kept], own.offset[:, self.kept]
        solved = (np.linalg.pinv(information, hermitian=True) @ offset[..., None])[..., 0]
        least = _squares(own, own.residual[None])[0] - (offset * solved).sum(axis=1)
        return np.asarray(np.maximum((_squares(own, rows) - least) / own.variance, 0.0))

    def _whole_slopes(self, one: int, place: Place) -> tuple[FloatArray, FloatArray]:
        """Gradient (k,) and curvature (k, k) of half the whole sum of squares of hypothesis `one`."""
        own, law = self.curves[0].moments, place.columns[:, self.kept]
        taken = own.basis @ own.taken[one]
        left = law - taken @ (taken.T @ law)
        return left.T @ (place.fallen + own.residual) / own.variance[one], left.T @ law / own.variance[one]


def _squares(moments: CurveMoments, rows: FloatArray) -> FloatArray:
    """Sums of squares (sets, m) of rows (sets, n) after removal of each hypothesis' step, ramp and turn."""
    taken = np.tensordot(rows @ moments.basis, moments.taken, (1, 1))
    return np.asarray((rows * rows).sum(axis=1)[:, None] - (taken * taken).sum(axis=2))


def _bend_losses(
    moments: CurveMoments, row: NDArray[np.intp], fallen: FloatArray, freedom: float
) -> FloatArray:
    """Loss of log-density (sets, m) by the moments along the directions `bends`, relative to the best fit."""
    precision, p = moments.bend_precision[row], moments.bends
    here = moments.bend_offset + fallen @ moments.basis[:, -p:]
    square = np.einsum("si,mij,sj->sm", here, precision, here, optimize=True)
    before = np.einsum("i,mij,j->m", moments.bend_offset, precision, moments.bend_offset)
    return np.asarray(0.5 * (freedom + p) * (np.log1p(square / freedom) - np.log1p(before / freedom)))
