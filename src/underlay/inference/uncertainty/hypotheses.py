"""Probabilities of what may disturb a curve: noise, misfit, step, ramp and turn, each of several sizes.

A hypothesis is one combination of them. It is weighed by the restricted likelihood L: with the amplitudes of the
disturbances' columns integrated out under normal priors, the columns J of the contact law's derivatives under a
flat prior, and the standard deviation s of the white noise under 1/s,

    -2 ln L = (n - k) ln S + ln det V + ln det N,

n being the number of rows (averaged readings), k the number of the law's parameters, V the covariance of the noise
in units of s^2, N the normal matrix of the disturbances' and the law's columns, and S the whitened sum of squares
that remains. No test is made and none is selected: all hypotheses with a weight above 0.4 % are kept and averaged.
The prior probability that a kind of disturbance is absent is 0.8 for each kind: at 0.5 intervals of clean curves
are 1.5 times those for white noise alone, at 0.8 1.1 times.

Kennedy and O'Hagan, J. R. Stat. Soc. B 63 (2001), doi:10.1111/1467-9868.00294: a model that is off by a smooth
function of unknown size.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from underlay._arrays import FloatArray
from underlay.inference.uncertainty.columns import FAMILIES, LINE, TURN, Columns
from underlay.inference.uncertainty.noise import NoiseTable, cosines

IntArray = NDArray[np.intp]

_NONE = 0.8  # prior probability, each, of no misfit, no step, no ramp, no turn
_MISFITS = (1.0, 5.0, 25.0, 125.0, 600.0)  # standard deviations of the columns, in those of the white noise
_SHAPES = (1.0, 2.5, 6.0, 15.0, 40.0)  # the same for line and turn, whose size is well determined
_STEPS, _RAMPS = (2.0, 10.0, 50.0), (3.0, 30.0)  # the same of step and ramp
_LARGEST = 0.5  # largest misfit, over the peak force, so that none explains the whole curve
_TRIED = 50.0  # number of frequencies of a line that the data can distinguish
_KEPT, _MOST = 4e-3, 30  # least weight, and largest number, of the hypotheses that are kept
# Least white noise of the rows, over the largest force: a converter of 24 bits has 20 that are not noise. What is
# left of a made curve without noise is the error of the search, smooth in depth.
_FINEST = 1e-6
# Least share of the rows that lie before contact, for a drift of the baseline or a step to correct the value: with
# fewer a sample that relaxes was taken for one that drifts (of 36 ramps without or with a short approach E of three
# was 0.36 to 0.77 MPa for 0.86 to 0.99, with an interval that missed it; of none with a tenth).
_BEFORE = 0.1
_SINGULAR = 1e-6  # singular value, over the largest, below which a direction is undetermined by the data
_HOPELESS = 12.0  # nats below the best, with every second size, up to which a noise is tried with all sizes


@dataclass(frozen=True, eq=False)
class Hypotheses:
    """Combinations of disturbances of one curve, the most probable first; every array has the shape (m,).

    Parameters
    ----------
    weight : FloatArray
        Probability, summing to 1.
    variance : FloatArray
        Variance of the white noise, in units of the rows^2.
    noise : IntArray
        Row of the `NoiseTable`; 0 is white.
    family : IntArray
        Index in `FAMILIES` of its misfit, periodic line or turn; -1 for none of these.
    misfit, step, ramp : FloatArray
        Standard deviations of the amplitudes of the columns of `family`, step and ramp, in units of the white
        noise's standard deviation; 0 for none.
    is_short : ndarray of bool
        Whether the noise is hardly correlated from row to row, as in the `NoiseTable`, and the baseline is seen.
    """

    weight: FloatArray
    variance: FloatArray
    noise: IntArray
    family: IntArray
    misfit: FloatArray
    step: FloatArray
    ramp: FloatArray
    is_short: NDArray[np.bool_]

    @property
    def corrects(self) -> NDArray[np.bool_]:
        """Whether the value is corrected for step, ramp or turn, (m,): not with correlated noise or a misfit."""
        return np.asarray(self.is_short & self.can_be_taken & ((self.family < 0) | (self.family >= TURN)))

    @property
    def can_be_taken(self) -> NDArray[np.bool_]:
        """Whether the hypothesis has a step, a ramp or a turn of the baseline, (m,)."""
        return np.asarray((self.step > 0.0) | (self.ramp > 0.0) | (self.family >= TURN))

    def probability(self, which: NDArray[np.bool_]) -> float:
        """Total probability of the hypotheses that a mask (m,) selects."""
        return float(self.weight[which].sum())

    def sizes(self, columns: Columns, one: int) -> FloatArray:
        """Prior standard deviations of the amplitudes of all columns under hypothesis `one`.

        An array with one entry for each column of `columns.values`, in units of the white noise's standard
        deviation; zero for columns that the hypothesis does not have.
        """
        sizes = np.zeros(columns.values.shape[1])
        sizes[columns.step], sizes[columns.ramp] = self.step[one], self.ramp[one]
        if self.family[one] >= 0:
            sizes[columns.families[self.family[one]]] = self.misfit[one]
        return sizes


def white(columns: Columns, variance: float | None) -> Hypotheses:
    """The single hypothesis of white noise and no disturbance.

    Its variance (units of the rows^2) is the given one, or for None that of the residuals about the linearised law.
    """
    if variance is None:
        basis = _basis(columns)
        variance = _white_left(columns, basis) / (len(basis) - basis.shape[1])
    none, zero = np.zeros(1), np.zeros(1, dtype=np.intp)
    return Hypotheses(np.ones(1), np.array([variance]), zero, zero - 1, none, none, none, zero == 0)


def weigh(
    columns: Columns, table: NoiseTable, growth: FloatArray, top: float, least_variance: float
) -> Hypotheses:
    """Probabilities of all combinations of disturbances of one curve, on its linearised model.

    Parameters
    ----------
    columns : Columns
        Derivatives, disturbances and residual of the curve, n rows each.
    table : NoiseTable
        Spectra of the noises that are tried, for n rows.
    growth : FloatArray
        Relative variance of each row where the noise grows with the stiffness, (n,), of mean 1.
    top : float
        Largest contact force, in units of the rows.
    least_variance : float
        Lower limit of the white noise's variance, in units of the rows^2.
    """
    basis = _basis(columns)
    freedom = len(basis) - basis.shape[1]
    scale = _scale(columns, (_white_left(columns, basis) / freedom) ** 0.5)
    gram, log_det = _projected_grams(columns, table, growth, basis, scale)
    rows = np.arange(len(log_det))
    for choices in (_choices(coarse=True), _choices(coarse=False)):
        squares, own = _by_family(columns, gram[rows], choices)
        squares += freedom * (_FINEST * top / scale) ** 2
        likely = -0.5 * (freedom * np.log(squares) + own + log_det[rows, None])
        likely += table.log_prior[rows, None] + choices.log_prior
        likely += np.where(choices.family >= TURN, np.log(columns.turn_share / (len(FAMILIES) - TURN)), 0.0)
        likely += np.where(choices.misfit * scale > _LARGEST * top, -np.inf, 0.0)
        if choices.is_coarse:
            rows = np.flatnonzero(likely.max(axis=1) > likely.max() - _HOPELESS)
    variance = np.maximum(squares / freedom * scale**2, least_variance)
    told = np.count_nonzero(columns.v == 0.0) >= _BEFORE * len(columns.v)
    weight = np.exp(likely - likely.max()).ravel()
    weight /= weight.sum()
    kept = np.argsort(-weight)[:_MOST]
    kept = kept[weight[kept] > _KEPT]
    noise, choice = np.divmod(kept, likely.shape[1])
    return Hypotheses(
        weight[kept] / weight[kept].sum(),
        variance.ravel()[kept],
        rows[noise],
        choices.family[choice],
        choices.misfit[choice],
        choices.step[choice],
        choices.ramp[choice],
        table.is_short[rows[noise]] & told,
    )


@dataclass(frozen=True, eq=False)
class _Choices:
    """Every combination of a misfit, a step and a ramp, without the noise: arrays (choices,).

    `family` is an index in `FAMILIES` or -1; `misfit`, `step` and `ramp` are standard deviations in units of the
    white noise's; `is_coarse` says that only every second size is tried.
    """

    family: IntArray
    misfit: FloatArray
    step: FloatArray
    ramp: FloatArray
    log_prior: FloatArray
    is_coarse: bool


@lru_cache(maxsize=2)
def _choices(*, coarse: bool) -> _Choices:
    every = [_MISFITS if f < LINE else _SHAPES for f in range(len(FAMILIES))]
    sizes = [own[1::2] if coarse else own for own in every]
    misfits: list[tuple[int, float]] = [(-1, 0.0), *((f, a) for f, own in enumerate(sizes) for a in own)]
    last = slice(1, None, 2) if coarse else slice(None)
    steps, ramps = [0.0, *list(_STEPS)[last]], [0.0, *list(_RAMPS)[last]]
    rows = [(f, a, s, r) for f, a in misfits for s in steps for r in ramps]
    table = np.array(rows)
    family, misfit, step, ramp = (table[:, i] for i in range(4))

    def prior(size: FloatArray, count: int) -> FloatArray:
        return np.log(np.where(size > 0.0, (1.0 - _NONE) / count, _NONE))

    # A turn has the same prior as a step or a ramp, shared by its three places.
    misfit_rows, turn_rows = sum(map(len, sizes[:TURN])), len(sizes[TURN])
    log_prior = np.where(family < TURN, prior(misfit, misfit_rows), prior(misfit, turn_rows))
    log_prior += prior(step, len(_STEPS)) + prior(ramp, len(_RAMPS))
    # The frequency was chosen as the best of many, which is no evidence for it.
    log_prior += np.where(family == LINE, -np.log(_TRIED), 0.0)
    return _Choices(family.astype(np.intp), misfit, step, ramp, log_prior, coarse)


def _basis(columns: Columns) -> FloatArray:
    """Orthonormal basis (n, k) of the law's derivatives, without directions that are collinear on this curve."""
    law = columns.values[:, columns.law]
    norms = np.linalg.norm(law, axis=0)
    u, sizes, _ = np.linalg.svd(law[:, norms > 0.0] / norms[norms > 0.0], full_matrices=False)
    return np.asarray(u[:, sizes > _SINGULAR * sizes[0]])


def _white_left(columns: Columns, basis: FloatArray) -> float:
    """Sum of squares of the residual after its projection on the law's derivatives, `basis`, is subtracted."""
    residual = columns.values[:, columns.residual.start]
    return float(np.square(residual - basis @ (basis.T @ residual)).sum())


def _scale(columns: Columns, left: float) -> float:
    """Noise's standard deviation in units of the rows, by the median second difference of the residual.

    Sizes of disturbances are multiples of it. It is at least a thousandth of `left`, the standard deviation of the
    residual about the linearised law.
    """
    residual = columns.values[:, columns.residual.start]
    second = np.median(np.abs(np.diff(residual, 2))) / (0.6745 * 6.0**0.5)
    return max(float(second), 1e-3 * left, np.finfo(float).tiny)


def _by_family(columns: Columns, gram: FloatArray, choices: _Choices) -> tuple[FloatArray, FloatArray]:
    """Residual sums of squares and ln det N (normal matrix of the disturbances) of every noise and choice.

    Parameters
    ----------
    columns : Columns
        Columns of the curve, which say where each disturbance stands.
    gram : FloatArray
        Gram matrices of disturbances and residual, orthogonal to the law, one for each noise, (noises, m, m).
    choices : _Choices
        Combinations of misfit, step and ramp.

    Returns
    -------
    tuple of FloatArray
        Both (noises, choices).
    """
    squares, log_det = np.empty((2, len(gram), len(choices.misfit)))
    first = columns.step.start
    steps, ramps = columns.step.stop - first, columns.ramp.stop - first
    for family in (-1, *range(len(FAMILIES))):
        which = np.flatnonzero(choices.family == family)
        place = columns.families[family] if family >= 0 else slice(first, first)
        used = np.array([*range(ramps), *range(place.start - first, place.stop - first), gram.shape[1] - 1])
        sizes = np.ones((len(which), len(used)))
        sizes[:, :steps] = choices.step[which, None]
        sizes[:, steps:ramps] = choices.ramp[which, None]
        sizes[:, ramps:-1] = choices.misfit[which, None]
        squares[:, which], log_det[:, which] = _left(gram[:, used[:, None], used], sizes)
    return squares, log_det


def _projected_grams(
    columns: Columns, table: NoiseTable, growth: FloatArray, basis: FloatArray, scale: float
) -> tuple[FloatArray, FloatArray]:
    """Gram matrices of disturbances and residual, whitened by each noise and made orthogonal to the law.

    Returns
    -------
    tuple of FloatArray
        The matrices (noises, m, m), and (noises,) the terms ln det V + ln det N_law of -2 ln L that do not depend
        on the disturbances' sizes.
    """
    others = columns.values[:, columns.step.start :].copy()
    others[:, -1] /= scale
    gram = grams(cosines(np.hstack((basis, others)) / np.sqrt(growth)[:, None]), 1.0 / table.spectra)
    k = basis.shape[1]
    lower = np.linalg.cholesky(gram[:, :k, :k])
    across = np.linalg.solve(lower, gram[:, :k, k:])
    log_det = np.log(table.spectra).sum(axis=1) + np.log(growth).sum()
    log_det += 2.0 * np.log(np.diagonal(lower, axis1=1, axis2=2)).sum(axis=1)
    return gram[:, k:, k:] - np.swapaxes(across, 1, 2) @ across, log_det


def grams(coefficients: FloatArray, weights: FloatArray) -> FloatArray:
    """Gram matrices (sets, m, m) of columns (n, m), each with its own weights of the rows, (sets, n)."""
    i, j = np.triu_indices(coefficients.shape[1])
    products = weights @ (coefficients[:, i] * coefficients[:, j])
    gram = np.empty((len(weights), coefficients.shape[1], coefficients.shape[1]))
    gram[:, i, j] = products
    gram[:, j, i] = products
    return gram


def _left(gram: FloatArray, sizes: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Residual sum of squares and ln det of the normal matrix, for disturbances of given prior sizes.

    The last column of `gram` (noises, m, m) is the residual; `sizes` is (choices, m), and both results are (noises,
    choices). The squared last pivot of the Cholesky factor is the residual sum of squares, so no system is solved.
    """
    normal = gram[:, None] * (sizes[:, :, None] * sizes[:, None, :])
    diagonal = np.arange(sizes.shape[1])
    normal[:, :, diagonal[:-1], diagonal[:-1]] += 1.0
    pivots = np.diagonal(np.linalg.cholesky(normal), axis1=2, axis2=3)
    return pivots[..., -1] ** 2, 2.0 * np.log(pivots[..., :-1]).sum(axis=-1)
