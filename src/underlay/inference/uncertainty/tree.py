"""The curves of a fit as the likelihood needs them: model, averaged or whitened readings, stated noise.

Averages of successive readings: fewer rows, with no loss for a force that is smooth in depth.

No block contains the point of contact: averaged across it, a reading is off by 1e-3 of the peak force, which
matters where the noise is small. Near contact none is wider than 3 % of the largest depth.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from underlay._arrays import FloatArray
from underlay.errors import InputError
from underlay.inference.model.forward_batch import batched_readings
from underlay.inference.model.members import Member
from underlay.inference.problem import Problem
from underlay.quantities import declared

if TYPE_CHECKING:
    from underlay.inference.least_squares.fit_result import Fit

_MOST, _MOST_FINE = 400, 1200  # largest number of blocks of a curve; of a curve that is fast near contact
# Largest width of a block near contact, and the distance that counts as near: shares of the largest depth.
_WIDEST, _NEAR = 0.03, 0.2
_APPROACH = 2.0  # depth before contact that is kept, in largest indentation depths
_WHOLE = 0.1  # distance of steps from whole multiples of the resolution: at random a quarter
_REPEATS = 0.2  # share of equal successive readings from which readings are taken as rounded


class NothingDrawnError(RuntimeError):
    """No draw has a density: where the likelihood leads there is no contact law, or it is out of bounds."""


@dataclass(frozen=True)
class Blocks:
    """Division of a curve into `count` blocks of `size` successive readings, from reading `start` on."""

    start: int
    size: int
    count: int

    @classmethod
    def of(cls, depth: FloatArray, contact: float) -> Blocks:
        """Blocks for readings at `depth` (m), (points,), in order of time; `contact` (m) is the contact point."""
        deepest = float(depth.max()) - contact
        entering = int(np.argmax(depth >= contact)) if deepest > 0.0 else 0
        first = int(np.argmax(depth >= contact - _APPROACH * deepest)) if deepest > 0.0 else 0
        size = _size(depth[first:], contact, deepest)
        start = first + (entering - first) % size
        return cls(start, size, (len(depth) - start) // size)

    def means(self, values: FloatArray) -> FloatArray:
        """Averages over each block, (..., count), of values at the readings, (..., points)."""
        used = values[..., self.start : self.start + self.size * self.count]
        return np.asarray(used.reshape(*used.shape[:-1], self.count, self.size).mean(axis=-1))


def _size(depth: FloatArray, contact: float, deepest: float) -> int:
    most = -(-len(depth) // _MOST)
    near = np.abs(depth - contact) < _NEAR * deepest
    steps = np.abs(np.diff(depth))[near[1:] | near[:-1]]
    if not steps.size or not steps.max() > 0.0:
        return most
    fine = int(min(_WIDEST * deepest / steps.max(), most))
    return max(fine, -(-len(depth) // _MOST_FINE), 1)


def resolution(force: FloatArray) -> float:
    """Step (N) to which the readings are rounded; zero where hardly any successive readings are equal.

    Zero too where the others are no whole multiples of a step: a curve without noise is level before contact. It
    looks at successive readings, which a slow converter repeats, where `data.foot.converter_noise` asks that every
    level of a curve is a multiple: on two real files of an optical probe and one of a microscope these differ.
    """
    steps = np.abs(np.diff(force))
    moved = steps > 1e-9 * float(np.ptp(force))
    if moved.mean() > 1.0 - _REPEATS or not moved.any():
        return 0.0
    step = float(np.quantile(steps[moved], 0.05))
    multiples = steps[moved] / step
    return step if float(np.median(np.abs(multiples - np.rint(multiples)))) < _WHOLE else 0.0


_CONTACT, _COMPLIANCE, _MODULUS = "instrument.contact_depth", "instrument.compliance", "layer.E"


class Tangent(NamedTuple):
    """Model of one curve and its derivatives at one vector; forces in units of the standard deviation of a row.

    Parameters
    ----------
    force, pressing : FloatArray
        Instrument's force and contact force P, (n,) each.
    contact, stiffness : FloatArray
        P and dP/dw (per m), (n,) each, times 1/(1 + C dP/dw), the share of a change that a compliance C in series
        lets the instrument read.
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
    """One curve as rows of a least-squares problem: block averages, or all readings whitened by a stated noise.

    Parameters
    ----------
    problem : Problem
        The problem, which converts scaled vectors to physical values.
    member : Member
        The curve.
    forward : Forward
        Its model, at the depths of the rows or of all readings.
    fold : callable
        Rows (..., n) of readings (..., points); whitening and averaging are linear.
    answers : callable
        Rows (..., n) of values that `forward` returns.
    measured : FloatArray
        Rows of the force in units of `deviation`, (n,).
    deviation : float
        Standard deviation of a row that least squares assumed (N); 1 where rows are whitened.
    least_variance : float
        Variance of a row due to rounding of the readings, in units of deviation^2.
    is_open : bool
        Whether no noise was stated.
    size_is_known : bool
        Whether the size of the noise was stated: a row has then variance 1.
    """

    problem: Problem
    member: Member
    forward: Any
    fold: Callable[[FloatArray], FloatArray]
    answers: Callable[[FloatArray], FloatArray]
    measured: FloatArray
    deviation: float
    least_variance: float
    is_open: bool
    size_is_known: bool

    @classmethod
    def of(cls, fit: Fit, i: int) -> CurveModel:
        """Model of curve `i` of a fit: block averages where no noise was stated, else whitened readings."""
        problem, member, noise = fit.problem, fit.problem.members[i], fit.noises[i]
        curve, forward, sigma = member.curve, member.forward, fit.sigmas[i]

        def whitened(values: FloatArray) -> FloatArray:
            return np.asarray(noise.whiten(values / sigma, curve.time))

        if not problem.noise_is_open:
            force, known = whitened(curve.force), not member.scale_is_unknown
            return cls(problem, member, forward, whitened, whitened, force, 1.0, 0.0, False, known)
        contact = member.values_at(problem.physical(fit.vector))[_CONTACT]
        blocks = Blocks.of(curve.depth, contact)
        depth, deviation = blocks.means(curve.depth), float(sigma[0]) / blocks.size**0.5

        def averaged(values: FloatArray) -> FloatArray:
            return np.asarray(blocks.means(values) / deviation)

        def at_blocks(values: FloatArray) -> FloatArray:
            return np.asarray(values / deviation)

        answers = averaged
        # A time-dependent or adhesive law is evaluated at every reading and the forces are averaged; else the law
        # is evaluated at the averaged depths.
        if member.scene.is_elastic:
            forward, answers = forward.moved(depth, blocks.means(curve.force)), at_blocks
        # The error of rounding is the same for successive readings: it does not average out within a block.
        least, force = (resolution(curve.force) / deviation) ** 2 / 12.0, averaged(curve.force)
        return cls(problem, member, forward, averaged, answers, force, deviation, least, True, False)

    def tangent(self, vector: FloatArray) -> Tangent:
        """Model and derivatives at a scaled vector (k,); raises InputError where no contact law exists."""
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
        """Contact force, instrument's force, (sets, n) each, and whether a law exists, at vectors (sets, k)."""
        values = self.member.values_of(self.problem.physical(vectors))
        found = batched_readings(self.forward, values, len(vectors), stiffness=False)
        return self.answers(found.contact), self.answers(found.force), found.possible

    def _plain(self, values: FloatArray) -> FloatArray:
        """Block averages, in their own units and not whitened, of values at the depths of `forward`."""
        if len(values) == len(self.measured):
            return values
        return self.answers(values) * self.deviation


def straight(problem: Problem) -> NDArray[np.bool_]:
    """Mask (k,) of entries in which the force may be taken as linear: modulus, baseline, noise and others."""
    own = [
        c.path == _MODULUS
        or c.path.startswith("noise.")
        or (c.path.startswith("instrument.") and declared(c.path).linear)
        for c in problem.coordinates
    ]
    return np.asarray(bending(problem) | own)


def bending(problem: Problem) -> NDArray[np.bool_]:
    """Mask (k,) of entries in which the force is nearly linear: its curvature is checked for each curve."""
    return np.array([declared(c.path).nearly_linear for c in problem.coordinates])


def scales_force(problem: Problem) -> NDArray[np.bool_]:
    """Mask (k,) of the entries that act on the contact force: all but those of the instrument's baseline."""
    return np.array([not c.path.startswith("instrument.baseline") for c in problem.coordinates])


def held(fit: Fit) -> NDArray[np.bool_]:
    """Mask (k,) of the entries of a fit's vector that lie on a bound."""
    return np.array([name in fit.bounds_hit for name in fit.names])


def noise_entries(problem: Problem) -> NDArray[np.intp]:
    """Indices of the entries of a vector that are parameters of the noise."""
    return np.array(sorted(problem.noise_entries), dtype=np.intp)


def tangents(models: Sequence[CurveModel], vector: FloatArray) -> list[Tangent] | None:
    """Linearisations of all curves at a vector (k,); None where a contact law does not exist."""
    try:
        return [model.tangent(vector) for model in models]
    except InputError:
        return None


def prior_precision(problem: Problem) -> FloatArray:
    """Curvature (k,) that informative priors add to the negative log-density; zero for flat ones."""
    found = np.zeros(len(problem.coordinates))
    for i, coordinate in enumerate(problem.coordinates):
        if coordinate.prior.informative:
            low, high = (coordinate.scaled(x) for x in coordinate.prior.quantile(np.array([0.16, 0.84])))
            found[i] = (2.0 / (high - low)) ** 2
    return found
