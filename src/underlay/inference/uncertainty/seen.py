"""What is seen of a curve's disturbances, in plain numbers: a verdict reads these and nothing else."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from underlay._arrays import FloatArray
from underlay.inference.uncertainty.columns import LINE, Columns, smooth_basis
from underlay.inference.uncertainty.hypotheses import Hypotheses
from underlay.inference.uncertainty.noise import NoiseTable, cosines
from underlay.inference.uncertainty.tree import Tangent

__all__ = ["Seen", "seen_in"]

_FOOT = 0.2  # share of the largest depth in which a contact that is made gradually shows
_TOP, _CONTACT = 1.0, 0.1  # depths, over the largest, between which the change of the apparent modulus is


@dataclass(frozen=True)
class Seen:
    """Disturbances of one curve, averaged over its hypotheses.

    Parameters
    ----------
    white : float
        Probability that the noise is white.
    noise : float
        Standard deviation of the white noise of a reading (N).
    growth : float
        Standard deviation of the noise at full depth, over that before contact; 1 where it does not grow.
    misfit : float
        Probability of a misfit.
    misfit_share : float
        Root mean square of the misfit in contact, over that of the contact force.
    change, change_deviation : float
        ln of the apparent modulus at full depth over that at a tenth of it, and its standard deviation.
    foot : float
        Share of the misfit's relative size, squared, in the first fifth of the depth; near 1 where the contact is
        made gradually.
    step, ramp, line, turn : float
        Probability of a step of the force at contact, of a ramp of the baseline, of fringes or vibration,
        of a baseline that turns.
    step_force, ramp_force, turn_force : float
        Sizes (N) of step, ramp and turn as far as they are seen: across contact, and over the record.
    corrected : float
        Probability of the hypotheses in which step, ramp or turn are taken out of the value.
    """

    white: float
    noise: float
    growth: float
    misfit: float
    misfit_share: float
    change: float
    change_deviation: float
    foot: float
    step: float
    ramp: float
    line: float
    turn: float
    step_force: float
    ramp_force: float
    turn_force: float
    corrected: float


def seen_in(
    columns: Columns,
    tangent: Tangent,
    hypotheses: Hypotheses,
    table: NoiseTable,
    growth: FloatArray,
    deviation: float,
    size: int,
) -> Seen:
    """Read the disturbances of one curve off its linearisation.

    Parameters
    ----------
    columns, tangent, hypotheses, table, growth
        As in `CurveState`.
    deviation : float
        Unit of the rows (N).
    size : int
        Readings in a row.
    """
    found = list(_amplitudes(columns, hypotheses, table, growth))
    weight = np.array([w for w, _, _, _ in found])
    profile = _Profile.of(columns, tangent)
    shares, changes, feet = (np.array(part) for part in zip(*(profile.of_one(t) for t in found), strict=True))
    middles, variances = changes[:, 0], changes[:, 1]
    middle = float(weight @ middles)
    steps = np.array([_range(columns.values[:, columns.step] @ b[columns.step]) for _, b, _, _ in found])
    ramps = np.array([2.0 * float(b[columns.ramp.start]) for _, b, _, _ in found])
    turns = np.array([np.ptp(columns.values[:, columns.turn] @ b[columns.turn]) for _, b, _, _ in found])
    return Seen(
        white=hypotheses.probability(hypotheses.noise == 0),
        noise=float(weight @ np.sqrt(hypotheses.variance[: len(found)])) * deviation * size**0.5,
        growth=float((growth[-1] / growth[0]) ** 0.5),
        misfit=hypotheses.probability(hypotheses.misfits),
        misfit_share=float((weight @ shares**2) ** 0.5),
        change=middle,
        change_deviation=float((weight @ (variances + (middles - middle) ** 2)) ** 0.5),
        foot=float(weight @ (feet * shares**2) / max(weight @ shares**2, 1e-300)),
        step=hypotheses.probability(hypotheses.step > 0.0),
        ramp=hypotheses.probability(hypotheses.ramp > 0.0),
        line=hypotheses.probability(hypotheses.family == LINE),
        turn=hypotheses.probability(hypotheses.family > LINE),
        step_force=float(weight @ steps) * deviation,
        ramp_force=float(weight @ ramps) * deviation,
        turn_force=float(weight @ turns) * deviation,
        corrected=hypotheses.probability(hypotheses.corrects),
    )


def _amplitudes(
    columns: Columns, hypotheses: Hypotheses, table: NoiseTable, growth: FloatArray
) -> Iterator[tuple[float, FloatArray, FloatArray, FloatArray]]:
    """Weight, amplitudes of all columns, which act, and the covariance of those, under every hypothesis."""
    coefficients = cosines(columns.values / np.sqrt(growth)[:, None])
    law = np.arange(columns.law.stop)
    acting = law[np.abs(columns.values[:, columns.law]).max(axis=0) > 0.0]
    for one, weight in enumerate(hypotheses.weight):
        sizes = hypotheses.sizes(columns, one)
        active = np.concatenate((acting, np.flatnonzero(sizes)))
        weighted = coefficients / table.spectra[hypotheses.noise[one]][:, None]
        scale = np.linalg.norm(coefficients[:, active], axis=0)
        normal = (coefficients[:, active].T @ weighted[:, active]) / scale / scale[:, None]
        precision = np.zeros(len(active))
        precision[len(acting) :] = 1.0 / (sizes[active[len(acting) :]] * scale[len(acting) :]) ** 2
        inverse = np.linalg.pinv(normal + np.diag(precision), hermitian=True) / scale / scale[:, None]
        found = np.zeros(columns.values.shape[1])
        found[active] = inverse @ (coefficients[:, active].T @ weighted[:, -1])
        yield float(weight), found, active, inverse * hypotheses.variance[one]


@dataclass(frozen=True, eq=False)
class _Profile:
    """Reads the size and the place of a misfit off its amplitudes."""

    columns: Columns
    inside: NDArray[np.intp]
    force: FloatArray
    reads: FloatArray

    @classmethod
    def of(cls, columns: Columns, tangent: Tangent) -> _Profile:
        inside = np.flatnonzero(columns.v > 0.0)
        return cls(columns, inside, tangent.contact, _readers(columns, tangent))

    def of_one(
        self, one: tuple[float, FloatArray, FloatArray, FloatArray]
    ) -> tuple[float, FloatArray, float]:
        """Relative size, (change of ln E, its variance) and share of the first fifth, of one hypothesis."""
        _, amplitudes, active, covariance = one
        misfit = np.zeros(len(self.columns.values))
        for place in self.columns.families[:LINE]:
            misfit += self.columns.values[:, place] @ amplitudes[place]
        own, force = misfit[self.inside], self.force[self.inside]
        share = float(np.linalg.norm(own) / np.linalg.norm(force))
        reader = self.reads[active]
        change = np.array([float(self.reads @ amplitudes), float(reader @ covariance @ reader)])
        relative = np.square(own / np.where(np.abs(force) > 0.02 * np.abs(force).max(), force, np.inf))
        first = self.columns.v[self.inside] ** 2 < _FOOT
        return share, change, float(relative[first].sum() / max(relative.sum(), 1e-300))


def _readers(columns: Columns, tangent: Tangent) -> FloatArray:
    """Coefficients (columns,) with which amplitudes make ln E(full depth) - ln E(a tenth)."""
    order = np.argsort(columns.v, kind="stable")
    v = columns.v[order]
    peak = {"relative": np.abs(tangent.contact).max(), "shift": np.abs(tangent.stiffness).max()}
    found = np.zeros(columns.values.shape[1])
    for sign, depth in ((1.0, _TOP), (-1.0, _CONTACT)):
        force = np.interp(depth**0.5, v, tangent.contact[order])
        stiffness = np.interp(depth**0.5, v, tangent.stiffness[order])
        basis = smooth_basis(np.array([depth**0.5]))[0]
        relative, shift = columns.families[:LINE]
        found[relative] += sign * basis / peak["relative"]
        found[shift] += sign * basis * stiffness / peak["shift"] / force
    return found


def _range(step: FloatArray) -> float:
    return float(step[-1] - step[0])
