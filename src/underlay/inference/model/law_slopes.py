"""Derivatives of a contact law's force in the numbers of a scene, at fixed depth of the tip.

A number changes the two factors of a `Similarity`, and through its ratios of moduli and lengths the law of the
reference. Where no law gives its derivative in a ratio itself, that is a difference of two laws, taken where both
exist.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, TypeAlias

import numpy as np

from underlay._arrays import FloatArray
from underlay.errors import InputError
from underlay.inference.model.laws import LawSource
from underlay.inference.model.similarity import Similarity
from underlay.mechanics.contact_law import ContactLaw
from underlay.mechanics.exact.table_laws import in_size
from underlay.quantities import kind_of

#: (steps, weights) of a difference quotient.
Stencil: TypeAlias = tuple[tuple[float, ...], tuple[float, ...]]
#: Forward and backward differences of first order: one further law.
ROUGH_STENCILS: tuple[Stencil, ...] = (((0.0, 1.0), (-1.0, 1.0)), ((0.0, -1.0), (1.0, -1.0)))
#: Central, backward and forward differences of second order: two further laws.
STENCILS: tuple[Stencil, ...] = (
    ((-1.0, 1.0), (-0.5, 0.5)),
    ((0.0, -1.0, -2.0), (1.5, -2.0, 0.5)),
    ((0.0, 1.0, 2.0), (-1.5, 2.0, -0.5)),
)
# Step of differences of laws in ln k and in Poisson's ratio: central, so the truncation is 1e-7 to 1e-6 of the
# derivative, and a law's own error of 1e-6 enters with 1e-3.
_RATIO_STEP = 1e-3


def first_possible(force: Callable[[float], FloatArray], stencils: Sequence[Stencil]) -> FloatArray:
    """Difference quotient by the first stencil whose points are all physically possible.

    At nu = 0.5 and at the incompressible limit of an anisotropic material only one side exists.

    Parameters
    ----------
    force : callable
        Force (N), (n,), at a number of steps from the current value.
    stencils : sequence of Stencil
        Difference formulas, best first.

    Returns
    -------
    FloatArray
        Change of the force per step (N), (n,).
    """
    problem: InputError | None = None
    for steps, weights in stencils:
        try:
            forces = [force(step) for step in steps]
        except InputError as error:
            problem = error
            continue
        return np.asarray(sum(weight * value for weight, value in zip(weights, forces, strict=True)))
    raise InputError(f"the law has no neighbours to differentiate with: {problem}") from problem


def force_scale(similarity: Similarity, path: str, values: Mapping[str, float]) -> float | None:
    """d ln P / dp where the parameter p at `path` only multiplies the force P; None where it does more."""
    log_b, log_c = similarity.factor_slopes(path, values)
    if log_b or similarity.ratio_slopes(path, values):
        return None
    return log_c / values[path]


def slope_by_factors(
    similarity: Similarity, path: str, values: Mapping[str, Any], w: FloatArray, P: FloatArray, S: FloatArray
) -> FloatArray:
    """Derivative dP/d ln p (N) of the force P in the parameter p at `path`, through the factors of similarity only.

    The ratios of moduli and lengths stay fixed, and so does the depth.

    Parameters
    ----------
    similarity : Similarity
        Gives the two factors.
    path : str
        The parameter.
    values : mapping of path to float or FloatArray
        Every number of the scene (SI), (sets,) where it varies.
    w, P, S : FloatArray
        Depths (m), force (N) and stiffness dP/dw (N/m) there, each (n,) or (sets, n).
    """
    # Numbers, or arrays where those of `values` are.
    factors: tuple[Any, Any] = similarity.factor_slopes(path, values)
    log_b, log_c = factors
    if isinstance(log_b, np.ndarray):
        column = (-1, *(1,) * (P.ndim - 1))
        log_b, log_c = np.reshape(log_b, column), np.reshape(log_c, column)
    elif not log_b:
        return np.asarray(log_c * P)
    total = w * S
    total *= log_b
    total += log_c * P
    return np.asarray(total)


@dataclass(frozen=True)
class LawSlopes:
    """Derivatives of one contact law, at one set of numbers and some depths.

    Parameters
    ----------
    similarity : Similarity
        Gives the factors and ratios of the numbers in `values`.
    laws : LawSource
        Source of laws at other ratios.
    values : mapping of str to float
        Every number of the scene (SI), by path.
    law : ContactLaw
        The law at these numbers.
    deepest : float
        Depth (m) that laws must reach.
    w, P, S : FloatArray
        Depths (m), and force (N) and stiffness dP/dw (N/m) there, each (n,).
    in_ratios : FloatArray
        Derivatives that the law gives itself, (numbers, n): see `ContactLaw.with_slopes`.
    rough : bool
        Whether a ratio's derivative is taken from one further law instead of two.
    """

    similarity: Similarity
    laws: LawSource
    values: Mapping[str, float]
    law: ContactLaw
    deepest: float
    w: FloatArray
    P: FloatArray
    S: FloatArray
    in_ratios: FloatArray
    rough: bool
    _columns: dict[str, FloatArray] = field(default_factory=dict, init=False)
    _differenced: set[str] = field(default_factory=set, init=False)

    @property
    def are_rough(self) -> bool:
        """Whether any derivative computed so far is a less exact one, from a one-sided difference of laws."""
        return self.rough and bool(self._differenced)

    def of(self, path: str) -> FloatArray:
        """Derivative dP/dp (n,) of the force in the parameter at `path` (SI), at fixed depths.

        It has a part from the two factors of similarity, and one from the ratios that the parameter changes.
        """
        value = self.values[path]
        derivative = np.zeros_like(self.P)
        if any(self.similarity.factor_slopes(path, self.values)):  # a number that may be zero is in no factor
            derivative = slope_by_factors(self.similarity, path, self.values, self.w, self.P, self.S) / value
        if self.laws.table is not None and len(self.in_ratios) and (slope := self.laws.table.slope(path)):
            return np.asarray(derivative + self.in_ratios[0] * (slope / value))
        for ratio, slope in self.similarity.ratio_slopes(path, self.values).items():
            if ratio not in self._columns:
                known = self._known(ratio)
                self._columns[ratio] = self._difference(ratio) if known is None else known
            in_log = ratio not in self.similarity.direct
            derivative = derivative + self._columns[ratio] * (slope / value if in_log else slope)
        return derivative

    def _known(self, ratio: str) -> FloatArray | None:
        """Derivative of the force in a ratio where the law gives it itself; None otherwise.

        dP/d ln k (N) of a ratio k of moduli or lengths, dP/dk of a number that is taken as it is.
        """
        if ratio == "adhesion.work":
            in_log, is_direct = self.law.work_slope(self.w), ratio in self.similarity.direct
            return in_log / self.values[ratio] if is_direct and in_log is not None else in_log
        if not len(self.in_ratios):
            return None
        if ratio in self.laws.slope_ratios:
            return np.asarray(self.in_ratios[self.laws.slope_ratios.index(ratio)])
        if self.laws.tips is None:
            return None
        in_thickness = self.in_ratios[
            1
        ]  # as tables tell it; a law that is solved for beside them in the same order
        if ratio == "layer.thickness":
            return np.asarray(in_thickness / self.values[ratio])
        # One length makes the tip: its ratio is the tip's size.
        alone = self.similarity.lengths == (ratio,)
        return in_size(self.w, self.P, self.S, in_thickness) if alone else None

    def stencils(self, path: str) -> tuple[Stencil, ...]:
        """Stencils of the difference of laws that gives the derivative in the number at a path."""
        self._differenced.add(path)
        return ROUGH_STENCILS if self.rough else STENCILS

    def _difference(self, ratio: str) -> FloatArray:
        """Derivative of the force in a ratio, at fixed depth and factors, from the difference of laws.

        dP/d ln k (N) of a ratio k of moduli or lengths, dP/dk of a number that is taken as it is.
        """
        b, c = self.similarity.factors(self.values)
        reduced = dict(zip(self.similarity.ratio_paths, self.similarity.reduced(self.values), strict=True))
        k = reduced[ratio]
        in_log = ratio not in self.similarity.direct
        finer = self.laws.for_differences
        size = _RATIO_STEP
        if ratio.startswith("indenter.") or kind_of(ratio) != "dimensionless":
            size *= abs(k)

        def force(steps: float) -> FloatArray:
            value = k * np.exp(steps * _RATIO_STEP) if in_log else k + steps * size
            law = finer.law(tuple((reduced | {ratio: value}).values()), b * self.deepest)
            return law.force(b * self.w)

        difference = first_possible(force, self.stencils(ratio))
        return np.asarray(difference * (c / (_RATIO_STEP if in_log else size)))
