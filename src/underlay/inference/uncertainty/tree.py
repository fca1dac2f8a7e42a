"""The curves of a fit as this room needs them: each one's model, its readings in blocks, its stated noise.

The only file of this room that knows `Problem`, `Member`, `Forward` and `Fit`.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from underlay._arrays import FloatArray
from underlay.data.curve import Curve
from underlay.errors import InputError
from underlay.inference.model.forward_batch import batched_readings
from underlay.inference.model.members import Member
from underlay.inference.problem import Problem
from underlay.inference.uncertainty.blocks import Blocks, resolution
from underlay.scene.parameters import declared

__all__ = ["CurveModel", "Tangent", "bending", "curve_models"]

_CONTACT, _COMPLIANCE, _MODULUS = "instrument.contact_depth", "instrument.compliance", "layer.E"


class Tangent(NamedTuple):
    """Model of one curve at one vector, in units of the deviation of a row.

    Parameters
    ----------
    force, pressing : FloatArray
        Instrument's force and contact force P, (n,) each.
    contact, stiffness : FloatArray
        P and dP/dw (per m), (n,) each, times what a compliance C leaves of their change, 1/(1 + C dP/dw).
    columns : FloatArray
        d force / d scaled vector, (n, k).
    penetration : FloatArray
        Depth of the tip (m), (n,); negative before contact.
    """

    force: FloatArray
    pressing: FloatArray
    contact: FloatArray
    stiffness: FloatArray
    columns: FloatArray
    penetration: FloatArray


@dataclass(frozen=True, eq=False)
class CurveModel:
    """One curve as rows of a least-squares problem: blocks of readings, or readings whitened by a stated noise.

    Parameters
    ----------
    problem : Problem
        The problem whose vectors it is asked at.
    member : Member
        The curve.
    forward : Forward
        Its model, at the depths of the rows or of all readings.
    fold : callable
        Rows (..., n) of readings (..., points); whitening and blocks are linear.
    answers : callable
        Rows (..., n) of what `forward` answers.
    depth, measured : FloatArray
        Rows of the depth (m) and of the force in units of `deviation`, (n,).
    deviation : float
        Standard deviation of a row that least squares assumed (N); 1 where rows are whitened.
    size : int
        Readings in a block.
    least_variance : float
        Variance of a row that the last digit of the readings makes, in units of deviation^2.
    is_open : bool
        Whether nothing is said of the noise.
    size_is_known : bool
        Whether the size of the noise is said: a row has then variance 1.
    """

    problem: Problem
    member: Member
    forward: Any
    fold: Callable[[FloatArray], FloatArray]
    answers: Callable[[FloatArray], FloatArray]
    depth: FloatArray
    measured: FloatArray
    deviation: float
    size: int
    least_variance: float
    is_open: bool
    size_is_known: bool

    def tangent(self, vector: FloatArray) -> Tangent:
        """Model at a scaled vector (k,); raises InputError where no law exists."""
        physical, slopes = self.problem.physical(vector), self.problem.slopes(vector)
        values, entries = self.member.values_at(physical), self.member.entries
        reading, own = self.forward.jacobian(values, tuple(entries), rough=True)
        columns = np.zeros((len(vector), len(self.measured)))
        index = list(entries.values())
        columns[index] = self.answers(own.T * slopes[index, None])
        C = values.get(_COMPLIANCE, 0.0) + self.forward.lever_compliances(values)
        kept = 1.0 / (1.0 + C * reading.stiffness)
        penetration = self.forward.depth - values[_CONTACT] - C * reading.contact
        return Tangent(
            self.answers(reading.force),
            self.answers(reading.contact),
            self.answers(reading.contact * kept),
            self.answers(reading.stiffness * kept),
            columns.T,
            self._plain(penetration),
        )

    def forces(self, vectors: FloatArray) -> tuple[FloatArray, FloatArray, NDArray[np.bool_]]:
        """Contact force and instrument's force, (sets, n), at scaled vectors (sets, k); which exist, (sets,)."""
        values = self.member.values_of(self.problem.physical(vectors))
        found = batched_readings(self.forward, values, len(vectors), stiffness=False)
        return self.answers(found.contact), self.answers(found.force), found.possible

    def rows(self, column: FloatArray) -> FloatArray:
        """Rows (n,) of an additive force (N), (points,), at the curve's readings."""
        return self.fold(np.asarray(column, dtype=np.float64))

    def curve(self, rows: FloatArray) -> Curve:
        """Curve of the rows' depths with other forces, (n,) in units of `deviation`."""
        return Curve(self.depth, rows * self.deviation)

    def _plain(self, values: FloatArray) -> FloatArray:
        """Rows without units of values at the depths of `forward`: blocks are averaged, nothing is whitened."""
        if len(values) == len(self.measured):
            return values
        return self.answers(values) * self.deviation


def curve_models(fit: Any) -> list[CurveModel]:
    """Models of the curves of a `Fit`, one each."""
    make = _open if fit.problem.noise_is_open else _stated
    return [make(fit, i) for i in range(len(fit.problem.members))]


def straight(problem: Problem) -> NDArray[np.bool_]:
    """Mask (k,) of the entries in which the force may be straight: the modulus, and what is read beside it."""
    own = [
        c.path == _MODULUS
        or c.path.startswith("noise.")
        or (c.path.startswith("instrument.") and declared(c.path).linear)
        for c in problem.coordinates
    ]
    return np.asarray(bending(problem) | own)


def bending(problem: Problem) -> NDArray[np.bool_]:
    """Mask (k,) of the entries in which the force is straight or nearly so: how far is asked of the curve."""
    return np.array([declared(c.path).nearly_linear for c in problem.coordinates])


def scales_force(problem: Problem) -> NDArray[np.bool_]:
    """Mask (k,) of the entries that act on the contact force, and not on what is read beside it."""
    return np.array([not c.path.startswith("instrument.baseline") for c in problem.coordinates])


def held(fit: Any) -> NDArray[np.bool_]:
    """Mask (k,) of the entries of a vector that lie on a bound."""
    return np.array([name in fit.bounds_hit for name in fit.names])


def _open(fit: Any, i: int) -> CurveModel:
    """Blocks; a sample that remembers or adheres is asked at every reading, and its answers are averaged."""
    problem, member = fit.problem, fit.problem.members[i]
    curve = member.curve
    contact = member.values_at(problem.physical(fit.vector))[_CONTACT]
    blocks = Blocks.of(curve.depth, contact)
    depth = blocks.means(curve.depth)
    deviation = float(fit.sigmas[i][0]) / blocks.size**0.5

    def fold(values: FloatArray) -> FloatArray:
        return np.asarray(blocks.means(values) / deviation)

    def at_blocks(values: FloatArray) -> FloatArray:
        return np.asarray(values / deviation)

    forward, answers = member.forward, fold
    if forward.history is None and member.scene.adhesion is None:
        forward, answers = forward.moved(depth, blocks.means(curve.force)), at_blocks
    # What rounding adds is alike in neighbours: it does not average out within a block.
    least = (resolution(curve.force) / deviation) ** 2 / 12.0
    force, size = fold(curve.force), blocks.size
    return CurveModel(
        problem, member, forward, fold, answers, depth, force, deviation, size, least, True, False
    )


def _stated(fit: Any, i: int) -> CurveModel:
    """All readings, whitened by the noise that was stated."""
    problem, member, noise = fit.problem, fit.problem.members[i], fit.noises[i]
    sigma, time, depth = fit.sigmas[i], member.curve.time, member.curve.depth

    def fold(values: FloatArray) -> FloatArray:
        return np.asarray(noise.whiten(values / sigma, time))

    force = fold(member.curve.force)
    known = not member.scale_is_unknown
    return CurveModel(problem, member, member.forward, fold, fold, depth, force, 1.0, 1, 0.0, False, known)


def has_common_errors(problem: Problem) -> bool:
    """Whether curves share errors that rows of one curve do not know."""
    return problem.common is not None


def noise_entries(problem: Problem) -> NDArray[np.intp]:
    """Entries of a vector that are numbers of the noise."""
    return np.array(sorted(problem.noise_entries), dtype=np.intp)


def log_posterior(problem: Problem, vectors: FloatArray) -> FloatArray:
    """Log-density (sets,) of scaled vectors (sets, k) where the noise is stated."""
    return problem.log_posterior(vectors)


def log_prior(problem: Problem, vectors: FloatArray) -> FloatArray:
    """Log-density (sets,) of scaled vectors (sets, k) before the test; -inf outside the bounds."""
    return problem.log_prior(vectors)


def tangents(models: Sequence[CurveModel], vector: FloatArray) -> list[Tangent] | None:
    """Tangents of all curves at a vector (k,); None where a law does not exist."""
    try:
        return [model.tangent(vector) for model in models]
    except InputError:
        return None


def prior_precision(problem: Problem) -> FloatArray:
    """What priors that say something add to the curvature of the log-density, (k,); zero for flat ones."""
    found = np.zeros(len(problem.coordinates))
    for i, coordinate in enumerate(problem.coordinates):
        if coordinate.prior.informative:
            low, high = (coordinate.scaled(x) for x in coordinate.prior.quantile(np.array([0.16, 0.84])))
            found[i] = (2.0 / (high - low)) ** 2
    return found
