"""Posterior predictive bands: where the model, and a new reading, lie once the data are known."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from underlay._arrays import FloatArray
from underlay.inference.misfit.blocked import clock_of
from underlay.inference.misfit.marginal import MarginalLikelihood
from underlay.inference.model.batch_readings import Readings
from underlay.inference.model.members import Member
from underlay.inference.problem import Problem
from underlay.scene.noise_model import NoiseModel

__all__ = ["PREDICTIVE_LEVELS", "Predictive", "predictive_bands"]

#: Probabilities of the rows of a predictive band: 95 % and 68 % limits and the median.
PREDICTIVE_LEVELS = (0.025, 0.16, 0.5, 0.84, 0.975)


@dataclass(frozen=True, eq=False)
class Predictive:
    """Posterior predictive band of one curve.

    Parameters
    ----------
    depth, force : FloatArray
        The data (m, N), (n,).
    model : FloatArray
        (5, n): force of the model (N) at `PREDICTIVE_LEVELS`. Where nobody stated the noise it is that of the law
        with the drift, the jump and the creeping baseline that go with each draw.
    reading : FloatArray
        (5, n): the same of a new reading, noise included.
    """

    depth: FloatArray
    force: FloatArray
    model: FloatArray
    reading: FloatArray

    def coverage(self) -> float:
        """Share of the data inside the 95 % band of a new reading."""
        return float(np.mean((self.force >= self.reading[0]) & (self.force <= self.reading[-1])))


def predictive_bands(
    problem: Problem, physical: FloatArray, rng: np.random.Generator
) -> tuple[Predictive, ...]:
    """One band per curve from draws (draws, parameters), SI; draws without a law are left out."""
    readings = [member.readings(physical) for member in problem.members]
    possible = np.logical_and.reduce([own.possible for own in readings])
    off = _misfits(problem, physical[possible], rng)
    return tuple(
        _band(member, physical[possible], own, possible, misfit, rng)
        for member, own, misfit in zip(problem.members, readings, off, strict=True)
    )


def _misfits(
    problem: Problem, physical: FloatArray, rng: np.random.Generator
) -> Sequence[FloatArray | float]:
    """What the law of each curve is off by at its readings (N), (draws, n); zero where the noise was stated."""
    likelihood = problem.likelihood
    if not isinstance(likelihood, MarginalLikelihood):
        return [0.0] * len(problem.members)
    found = []
    for curve, at_blocks in zip(likelihood.blocked.curves, likelihood.misfit(physical, rng), strict=True):
        clock = clock_of(curve.member.curve)
        found.append(np.array([np.interp(clock, curve.time, own) for own in at_blocks]))
    return found


def _band(
    member: Member,
    physical: FloatArray,
    readings: Readings,
    possible: NDArray[np.bool_],
    misfit: FloatArray | float,
    rng: np.random.Generator,
) -> Predictive:
    contact, stiffness = readings.contact[possible], readings.stiffness[possible]
    force = readings.force[possible] + misfit
    noise = member.noise_of(physical)
    sigma = noise.sigma(contact, stiffness, member.curve.time)
    if member.scale_is_unknown:
        sigma = sigma * _scale_draws(member, noise, force, sigma, rng)[:, None]
    # One normal draw per point and posterior draw: the band is that of single readings, so the correlation
    # between neighbouring points does not enter.
    reading = force + sigma * rng.standard_normal(force.shape)
    return Predictive(
        depth=member.curve.depth,
        force=member.force,
        model=np.quantile(force, PREDICTIVE_LEVELS, axis=0),
        reading=np.quantile(reading, PREDICTIVE_LEVELS, axis=0),
    )


def _scale_draws(
    member: Member,
    noise: NoiseModel,
    force: FloatArray,
    sigma: FloatArray,
    rng: np.random.Generator,
) -> FloatArray:
    """Noise over `sigma`, (draws,), where its size was integrated out: sigma^2 is S / chi-squared(n)."""
    whitened = noise.whiten((member.force - force) / sigma, member.curve.time)
    square = np.einsum("dn,dn->d", whitened, whitened)
    return np.asarray(np.sqrt(square / rng.chisquare(whitened.shape[-1], size=len(square))))
