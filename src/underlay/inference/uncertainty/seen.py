"""Disturbances of one curve in plain numbers (misfit, step, ramp, turn), from which a verdict is made."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from underlay._arrays import FloatArray
from underlay.inference.uncertainty.columns import LINE, Columns
from underlay.inference.uncertainty.hypotheses import Hypotheses
from underlay.inference.uncertainty.noise import NoiseTable, cosines

_FOOT = 0.2  # share of the largest depth in which a gradual contact shows


@dataclass(frozen=True)
class Seen:
    """Disturbances of one curve, averaged over its hypotheses by their probabilities.

    Parameters
    ----------
    white : float
        Probability that the noise is white.
    foot : float
        Share of the misfit's relative size, squared, in the first fifth of the depth; near 1 where contact is made
        gradually.
    step, ramp, turn : float
        Probabilities of a step of the force at contact, of a baseline that drifts linearly in time, and of a
        baseline with a kink.
    step_force, ramp_force, turn_force : float
        Estimated sizes (N): of the step across contact, of ramp and turn over the whole record.
    """

    white: float
    foot: float
    step: float
    ramp: float
    turn: float
    step_force: float
    ramp_force: float
    turn_force: float


def seen_in(
    columns: Columns,
    contact: FloatArray,
    hypotheses: Hypotheses,
    table: NoiseTable,
    growth: FloatArray,
    deviation: float,
) -> Seen:
    """Estimate the disturbances of one curve from its linearised model.

    Parameters
    ----------
    columns, hypotheses, table, growth
        As in `CurveState`.
    contact : FloatArray
        Contact force in units of the rows, (n,), as in `Tangent`.
    deviation : float
        Unit of the rows (N).
    """
    found = _amplitudes(columns, hypotheses, table, growth)
    inside = np.flatnonzero(columns.v > 0.0)
    first, force = columns.v[inside] ** 2 < _FOOT, contact[inside]
    pressed = np.where(np.abs(force) > 0.02 * np.abs(force).max(), force, np.inf)
    shares, feet = [], []
    for amplitudes in found:
        misfit = np.zeros(len(columns.values))
        for place in columns.families[:LINE]:
            misfit += columns.values[:, place] @ amplitudes[place]
        shares.append(np.linalg.norm(misfit[inside]) / np.linalg.norm(force))
        relative = np.square(misfit[inside] / pressed)
        feet.append(relative[first].sum() / max(relative.sum(), 1e-300))
    weight, squares = hypotheses.weight, np.square(shares)
    steps = [columns.values[:, columns.step] @ b[columns.step] for b in found]
    ramps = [2.0 * b[columns.ramp.start] for b in found]
    turns = [np.ptp(columns.values[:, columns.turn] @ b[columns.turn]) for b in found]
    return Seen(
        white=hypotheses.probability(hypotheses.noise == 0),
        foot=float(weight @ (feet * squares) / max(weight @ squares, 1e-300)),
        step=hypotheses.probability(hypotheses.step > 0.0),
        ramp=hypotheses.probability(hypotheses.ramp > 0.0),
        turn=hypotheses.probability(hypotheses.family > LINE),
        step_force=float(weight @ [own[-1] - own[0] for own in steps]) * deviation,
        ramp_force=float(weight @ ramps) * deviation,
        turn_force=float(weight @ turns) * deviation,
    )


def _amplitudes(
    columns: Columns, hypotheses: Hypotheses, table: NoiseTable, growth: FloatArray
) -> list[FloatArray]:
    """Estimated amplitudes (columns,) of all columns under each hypothesis."""
    coefficients = cosines(columns.values / np.sqrt(growth)[:, None])
    law = np.arange(columns.law.stop)
    acting = law[np.abs(columns.values[:, columns.law]).max(axis=0) > 0.0]
    every = []
    for one, noise in enumerate(hypotheses.noise):
        sizes = hypotheses.sizes(columns, one)
        active = np.concatenate((acting, np.flatnonzero(sizes)))
        weighted = coefficients / table.spectra[noise][:, None]
        scale = np.linalg.norm(coefficients[:, active], axis=0)
        normal = (coefficients[:, active].T @ weighted[:, active]) / scale / scale[:, None]
        precision = np.zeros(len(active))
        precision[len(acting) :] = 1.0 / (sizes[active[len(acting) :]] * scale[len(acting) :]) ** 2
        inverse = np.linalg.pinv(normal + np.diag(precision), hermitian=True) / scale / scale[:, None]
        found = np.zeros(columns.values.shape[1])
        found[active] = inverse @ (coefficients[:, active].T @ weighted[:, -1])
        every.append(found)
    return every
