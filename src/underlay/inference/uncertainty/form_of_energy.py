"""How far the form of a layer's strain energy shifts a fit: its size is held at several, the others fitted again.

Where stiffening is strong the shift does not grow with the size. So sizes are searched on both sides of zero, from
the tangent at one beside, until the curves no longer allow one; between them the shift and the misfit are
interpolated. Sizes of one round are searched together.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING

import numpy as np
from scipy.interpolate import PchipInterpolator

from underlay._arrays import FloatArray
from underlay.errors import FitError
from underlay.inference.least_squares.engine import FINE, LONGEST, Minimum, descend
from underlay.inference.least_squares.models import freeze
from underlay.inference.least_squares.objective import Objective
from underlay.inference.least_squares.settle import first_noises
from underlay.inference.model.on_law import FORM
from underlay.inference.priors import Uniform
from underlay.inference.uncertainty.answer import NORMAL_95
from underlay.mechanics.stiffening.factors import FORM_SPREAD

if TYPE_CHECKING:
    from underlay.inference.least_squares.fit_result import Fit

# Sizes at which curves are fitted again: the first, each next one twice the last, and the farthest; and how many
# places are looked at between. Ogden's exponents -16 and 20 are at two deviations, where the formula leaves E up to
# 6 % off; a tenth more makes 4 % (tests/studies/stiffening_coverage.py, --misfits).
_STEP, _FARTHEST, _LOOKS = 0.55 * FORM_SPREAD, 2.2 * FORM_SPREAD, 81
# What fits with the size of Ogden's energy leave of forces without noise at worst, rms over the largest (the same
# study): so small a misfit is no evidence against a size.
_MISFIT = 5.3e-4
# The search at each size: its last step leads from within a fifth of a standard error of what is looked for.
_SEARCH = replace(FINE, least=0.04)


def shifts_by_form(fit: Fit, begun: Fit, largest: Sequence[float]) -> FloatArray:
    """Shifts (places, k) of a fit's scaled vector by the sizes of the form that the curves allow.

    Within the range of sizes only the curves weigh them: with a prior's weight intervals held E of Ogden's layers
    of exponents -16 and 20 in 35 to 65 % of fits.

    Parameters
    ----------
    fit : Fit
        The fit, in which the form is that of its scenes.
    begun : Fit
        Fit from which the search begins, in which further numbers may have been free.
    largest : sequence of float
        Largest contact force (N) of each curve.

    Raises
    ------
    FitError
        If there is no contact law where it begins.
    """
    free = {**fit.problem.free, FORM: Uniform(-1.01 * _FARTHEST, 1.01 * _FARTHEST)}
    problem = fit.problem.revised(free=free, scenes=begun.scenes, noise=fit.noises)
    held = [i for i, coordinate in enumerate(problem.coordinates) if coordinate.path == FORM]
    noise = freeze(problem, problem.start, first_noises(problem, problem.start))
    usual = (
        float(np.sum((_MISFIT * force / sigma) ** 2))
        for force, sigma in zip(largest, noise.sigmas, strict=True)
    )
    # Of a misfit of m deviations and noise along it 97.5 % are below m + 1.96.
    allowed = math.sqrt(sum(usual)) + NORMAL_95
    found = _Sizes(Objective(problem, noise, held=frozenset(held)), held, allowed)
    found.search()
    sizes = sorted(found.best)
    values = [problem.values(found.best[size].vector) for size in sizes]
    vectors = np.array([fit.problem.vector({name: own[name] for name in fit.names}) for own in values])
    at = np.linspace(sizes[0], sizes[-1], _LOOKS)
    rises = PchipInterpolator(sizes, [found.rise(size) for size in sizes])(at)
    return np.asarray(PchipInterpolator(sizes, vectors)(at)[rises <= allowed] - fit.vector)


@dataclass(frozen=True, eq=False)
class _Sizes:
    """Best fits with the form held, by its size.

    Parameters
    ----------
    objective : Objective
        Residuals with the form held.
    held : list of int
        Its entries, one for each curve that has its own.
    allowed : float
        Rise of the misfit, in deviations, up to which the curves allow a size.
    """

    objective: Objective
    held: list[int]
    allowed: float
    best: dict[float, Minimum] = field(default_factory=dict)

    def search(self) -> None:
        """Fit at zero, at sizes farther and farther out, and once between the last allowed and one far beyond."""
        self._fit({0.0: 0.0})
        if not self.best:
            raise FitError("no contact law where the search for the form of the energy begins")
        wanted = {sign * factor * _STEP: 0.0 for sign in (-1.0, 1.0) for factor in (1.0, 2.0)}
        while wanted:
            self._fit(wanted)
            tried = set(wanted)
            wanted = dict(
                pair
                for sign in (-1.0, 1.0)
                if (pair := self._next(sign)) is not None and pair[0] not in tried
            )

    def rise(self, size: float) -> float:
        """Deviations by which the best at a size fits worse than the best of all."""
        return math.sqrt(self.best[size].point.square - min(one.point.square for one in self.best.values()))

    def _next(self, sign: float) -> tuple[float, float] | None:
        """Next size to one side, and the one to begin beside; None where no more is wanted."""
        inside = 0.0
        for size in sorted((size for size in self.best if sign * size > 0.0), key=abs):
            if self.rise(size) > self.allowed:
                gap = abs(size - inside)
                wide = gap >= max(_STEP, 0.5 * abs(size)) and self.rise(size) > 2.0 * self.allowed
                return (0.5 * (inside + size), inside) if wide else None
            inside = size
        return (2.0 * inside, inside) if 0.0 < abs(inside) <= 0.5 * _FARTHEST else None

    def _fit(self, wanted: dict[float, float]) -> None:
        """Fit at sizes, each begun beside another; those without a contact law there are left out."""
        for share in (1.0, 0.0):
            # Where the tangent leads to no contact law the search begins where it does.
            left = [(size, self.best.get(beside)) for size, beside in wanted.items() if size not in self.best]
            if not left:
                return
            starts = np.array([self._start(size, beside, share) for size, beside in left])
            low, high = (np.tile(end, (len(starts), 1)) for end in self.objective.problem.bounds.T)
            begin = self.objective.places(np.clip(starts, low, high), low, high)
            known = np.isfinite(begin.square)
            ends = descend(self.objective, begin[known], low[known], high[known], _SEARCH)
            sizes = [size for (size, _), is_known in zip(left, known.tolist(), strict=True) if is_known]
            self.best.update({size: end for size, end in zip(sizes, ends, strict=True) if end is not None})

    def _start(self, size: float, beside: Minimum | None, share: float) -> FloatArray:
        """Scaled vector (k,) at a size, by a share of the step on the tangent at the best fit beside."""
        problem, others = self.objective.problem, self.objective.active
        start = (problem.start if beside is None else beside.vector).copy()
        change = np.array([problem.coordinates[i].scaled(size) for i in self.held]) - start[self.held]
        step = np.zeros((1, len(start)))
        if beside is not None and share:
            normal = beside.point.normal
            pull = normal[np.ix_(others, self.held)] @ change
            step[0, others] = -share * np.linalg.pinv(normal[np.ix_(others, others)], hermitian=True) @ pull
            for course in self.objective.courses:
                step = course.changes(start[None], step, LONGEST)
        start[self.held] += change
        return np.asarray(start + step[0])
