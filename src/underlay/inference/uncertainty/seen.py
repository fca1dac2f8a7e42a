"""Disturbances of one curve in plain numbers (noise, misfit, step, ramp, turn), from which a verdict is made."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from underlay._arrays import FloatArray
from underlay.inference.uncertainty.columns import LINE, Columns, smooth_basis
from underlay.inference.uncertainty.hypotheses import Hypotheses
from underlay.inference.uncertainty.noise import NoiseTable, cosines
from underlay.inference.uncertainty.tree import Tangent

_FOOT = 0.2  # share of the largest depth in which a gradual contact shows
_TOP, _CONTACT = 1.0, 0.1  # depths, over the largest, between which the apparent modulus is compared


@dataclass(frozen=True)
class Seen:
    """Disturbances of one curve, averaged over its hypotheses by their probabilities.

    Parameters
    ----------
    white : float
        Probability that the noise is white.
    noise : float
        Standard deviation of the white noise of a reading (N).
    growth : float
        Standard deviation of the noise at full depth, over that before contact; 1 where it does not grow.
    misfit : float
        Probability of a misfit, smooth in depth, of the contact law.
    misfit_share : float
        Root mean square of the misfit in contact, over that of the contact force.
    change, change_deviation : float
        ln of the apparent modulus at full depth over that at a tenth of it, and its standard deviation.
    foot : float
        Share of the misfit's relative size, squared, in the first fifth of the depth; near 1 where contact is made
        gradually.
    step, ramp, line, turn : float
        Probabilities of a step of the force at contact, of a baseline that drifts linearly in time, of interference
        fringes or vibration, and of a baseline with a kink.
    step_force, ramp_force, turn_force : float
        Estimated sizes (N): of the step across contact, of ramp and turn over the whole record.
    corrected : float
        Probability of the hypotheses under which the fitted value is corrected for step, ramp or turn.
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
    """Estimate the disturbances of one curve from its linearised model.

    Parameters
    ----------
    columns, tangent, hypotheses, table, growth
        As in `CurveState`.
    deviation : float
        Unit of the rows (N).
    size : int
        Number of readings that are averaged in one row.
    """
    weight, amplitudes, profiles = [], [], []
    describe = _profile(columns, tangent)
    for own, found, active, covariance in _amplitudes(columns, hypotheses, table, growth):
        weight.append(own)
        amplitudes.append(found)
        profiles.append(describe(found, active, covariance))
    w, (shares, middles, variances, feet) = np.array(weight), np.array(profiles).T
    middle = float(w @ middles)
    steps = [columns.values[:, columns.step] @ b[columns.step] for b in amplitudes]
    ramps = [2.0 * b[columns.ramp.start] for b in amplitudes]
    turns = [np.ptp(columns.values[:, columns.turn] @ b[columns.turn]) for b in amplitudes]
    return Seen(
        white=hypotheses.probability(hypotheses.noise == 0),
        noise=float(w @ np.sqrt(hypotheses.variance)) * deviation * size**0.5,
        growth=float((growth[-1] / growth[0]) ** 0.5),
        misfit=hypotheses.probability(hypotheses.misfits),
        misfit_share=float((w @ shares**2) ** 0.5),
        change=middle,
        change_deviation=float((w @ (variances + (middles - middle) ** 2)) ** 0.5),
        foot=float(w @ (feet * shares**2) / max(w @ shares**2, 1e-300)),
        step=hypotheses.probability(hypotheses.step > 0.0),
        ramp=hypotheses.probability(hypotheses.ramp > 0.0),
        line=hypotheses.probability(hypotheses.family == LINE),
        turn=hypotheses.probability(hypotheses.family > LINE),
        step_force=float(w @ [own[-1] - own[0] for own in steps]) * deviation,
        ramp_force=float(w @ ramps) * deviation,
        turn_force=float(w @ turns) * deviation,
        corrected=hypotheses.probability(hypotheses.corrects),
    )


def _amplitudes(
    columns: Columns, hypotheses: Hypotheses, table: NoiseTable, growth: FloatArray
) -> Iterator[tuple[float, FloatArray, NDArray[np.intp], FloatArray]]:
    """Estimated amplitudes of all columns under each hypothesis in turn.

    Yields
    ------
    tuple
        Probability of the hypothesis; amplitudes (columns,); indices of the columns that act under it; covariance
        of their amplitudes.
    """
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


def _profile(
    columns: Columns, tangent: Tangent
) -> Callable[[FloatArray, NDArray[np.intp], FloatArray], tuple[float, float, float, float]]:
    """Function that describes size and place of a misfit by what `_amplitudes` yields of one hypothesis.

    It returns the root mean square over that of the contact force, the change of ln E from a tenth of the depth to
    all of it and its variance, and the share of the squared relative misfit in the first fifth of the depth.
    """
    inside = np.flatnonzero(columns.v > 0.0)
    first, force, reads = columns.v[inside] ** 2 < _FOOT, tangent.contact[inside], _readers(columns, tangent)
    is_pressed = np.abs(force) > 0.02 * np.abs(force).max()

    def describe(
        amplitudes: FloatArray, active: NDArray[np.intp], covariance: FloatArray
    ) -> tuple[float, float, float, float]:
        misfit = np.zeros(len(columns.values))
        for place in columns.families[:LINE]:
            misfit += columns.values[:, place] @ amplitudes[place]
        own, reader = misfit[inside], reads[active]
        share = float(np.linalg.norm(own) / np.linalg.norm(force))
        relative = np.square(own / np.where(is_pressed, force, np.inf))
        foot = float(relative[first].sum() / max(relative.sum(), 1e-300))
        return share, float(reads @ amplitudes), float(reader @ covariance @ reader), foot

    return describe


def _readers(columns: Columns, tangent: Tangent) -> FloatArray:
    """Coefficients (columns,) whose product with the amplitudes is ln E(full depth) - ln E(a tenth of it)."""
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
