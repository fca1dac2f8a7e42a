"""Relaxing fractions of a Prony series, solved for together with the moduli and never negative.

The force is nearly linear in them. While the contact grows, P = E_inf A + sum_k E f_k z_k, with P the force, E the
instantaneous modulus, f_k the relaxing fractions, A the elastic force per modulus and z_k its integrals over the
record: linear in the moduli E_inf = E (1 - sum f) and E f_k, all of which are positive or zero. During unloading
the earlier moment of equal contact radius changes with them, so the force at the solution is computed again.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Self

import numpy as np
from numpy.typing import NDArray

from underlay._arrays import FloatArray
from underlay.inference.least_squares.projection import LinearDirections, Point
from underlay.inference.model.members import Member
from underlay.inference.problem import Problem

# A solution that promises to lower the sum of squares by less than this share of it waits for the next step of
# the search, which moves the fractions too: a model costs as much as a step.
_WORTH = 0.02
# A share this far below zero is zero but for the rounding of the solution.
_ROUNDING = 1e-9
# Least factor on the moduli: below it they stay where they are, as in `projection`.
_LEAST_FACTOR = 0.1


@dataclass(frozen=True)
class _Layer:
    """Fractions of one relaxing layer: entries of the free ones in a vector, and the sum of the fixed ones."""

    entries: list[int]
    fixed: float


@dataclass(frozen=True)
class Fractions:
    """The relaxing fractions among the free parameters, solved for by constrained linear least squares.

    Parameters
    ----------
    problem : Problem
        The problem of which they are parameters.
    layers : list
        The fractions of each relaxing layer.
    directions : LinearDirections
        Directions in which the model is linear: baselines, fractions, and the moduli together where they scale the
        force, in this order.
    """

    problem: Problem
    layers: list[_Layer]
    directions: LinearDirections

    @classmethod
    def of(cls, problem: Problem, free: set[int], linear: LinearDirections) -> Self | None:
        """Find the relaxing fractions among the entries `free` of a parameter vector; None where there are none.

        `linear` are the other directions in which the model is linear, solved for at the same time.
        """
        layers = [_layer_of(member, free) for member in problem.members]
        entries = sorted({entry for layer in layers for entry in layer.entries})
        if not entries:
            return None
        rows = np.insert(
            linear.rows, len(linear.rows) - linear.scales, np.eye(len(problem.coordinates))[entries], 0
        )
        known = LinearDirections(rows, linear.scales, linear.through_force)
        return cls(problem, [layer for layer in layers if layer.entries], known)

    def feasible(self, vector: FloatArray) -> FloatArray:
        """Return the scaled vector (k,) with relaxing fractions that sum to more than 1 reduced in proportion."""
        for layer in self.layers:
            values = self._values(vector, layer)
            if values.sum() > 1.0 - layer.fixed:
                vector = self._placed(vector, layer, values * ((1.0 - layer.fixed) / values.sum()))
        return vector

    def solved(self, point: Point) -> FloatArray | None:
        """Scaled vector (k,) with the fractions and the other linear parameters at their least-squares values.

        None where that is infeasible or promises too little to be worth another evaluation of the model.
        """
        rows = self.directions.rows
        normal, gradient = rows @ point.normal @ rows.T, rows @ point.gradient
        if not (np.diag(normal) > 0.0).all():
            return None
        slope, offset = self._moduli(point.vector)
        step = _least(normal, gradient, slope @ rows.T, offset)
        if step is None or -(2.0 * gradient + normal @ step) @ step < _WORTH * point.square:
            return None
        factor = 1.0 + float(step[-1]) if self.directions.scales else 1.0
        if factor <= _LEAST_FACTOR:
            return None
        along = step[: len(step) - self.directions.scales] @ rows[: len(step) - self.directions.scales]
        vector = point.vector + np.where(self._is_fraction, along / factor, along)
        if self.directions.scales:
            vector = vector + np.log(factor) * rows[-1]
        for layer in self.layers:
            # On a bound but for the rounding of the solution.
            values = self._values(vector, layer)
            if (values < -_ROUNDING).any() or values.sum() > 1.0 - layer.fixed + _ROUNDING:
                return None
            vector = self._placed(vector, layer, np.maximum(values, 0.0))
        return self.feasible(vector)

    @property
    def _is_fraction(self) -> NDArray[np.bool_]:
        mask = np.zeros(len(self.problem.coordinates), dtype=bool)
        mask[[entry for layer in self.layers for entry in layer.entries]] = True
        return mask

    def _moduli(self, vector: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Relaxed and relaxing moduli of every layer, over its E, as a linear function of a step.

        They are `slope` (m, k) times the step (k,) plus `offset` (m,), and must not be negative. A step is that of
        the linear model: for the moduli the relative change of E, for a fraction F (f' - f), with F the factor on E
        and f, f' the fraction before and after.
        """
        scale = np.array([1.0 if c.scale is None else c.scale for c in self.problem.coordinates])
        grows = self.directions.rows[-1] if self.directions.scales else np.zeros(len(scale))
        # The moduli take the same step, which counts once.
        grows = grows / max(float(grows.sum()), 1.0)
        slopes, offsets = [], []
        for layer in self.layers:
            values = self._values(vector, layer)
            rest = 1.0 - layer.fixed - float(values.sum())
            for entry, value in zip(layer.entries, values.tolist(), strict=True):
                slopes.append(value * grows + scale[entry] * np.eye(len(scale))[entry])
                offsets.append(value)
            shares = np.zeros(len(scale))
            shares[layer.entries] = scale[layer.entries]
            slopes.append(rest * grows - shares)
            offsets.append(rest)
        return np.array(slopes), np.array(offsets)

    def _values(self, vector: FloatArray, layer: _Layer) -> FloatArray:
        return np.array([float(self.problem.coordinates[i].physical(vector[i])) for i in layer.entries])

    def _placed(self, vector: FloatArray, layer: _Layer, values: FloatArray) -> FloatArray:
        vector = np.array(vector)
        for entry, value in zip(layer.entries, values.tolist(), strict=True):
            vector[entry] = self.problem.coordinates[entry].scaled(value)
        return vector


def _layer_of(member: Member, free: set[int]) -> _Layer:
    """Relaxing fractions of a curve's layer; no free ones where some are held fixed by the search.

    `free` are the entries of a parameter vector that may be solved for.
    """
    paths = [path for path in member.base if ".relaxation.fractions[" in path]
    held = [path for path in paths if member.entries.get(path) not in free]
    if any(path in member.entries for path in held):
        # One of them has a measured prior or is held by a search: the force is not linear in the others alone.
        return _Layer([], 0.0)
    entries = [member.entries[path] for path in paths if path not in held]
    return _Layer(entries, sum(member.base[path] for path in held))


def _least(
    normal: FloatArray, gradient: FloatArray, slope: FloatArray, offset: FloatArray
) -> FloatArray | None:
    """Minimise s'Ns / 2 + g's over steps s (p,) with slope s + offset >= 0, by an active-set method.

    Parameters
    ----------
    normal, gradient : FloatArray
        N, (p, p), and g, (p,).
    slope, offset : FloatArray
        The m linear constraints, (m, p) and (m,).

    Returns
    -------
    FloatArray or None
        The step s; None where the iteration does not end or the active constraints are not independent.
    """
    active: list[int] = []
    p = len(gradient)
    for _ in range(3 * len(offset) + 1):
        rows, corner = slope[active], np.zeros((len(active), len(active)))
        system = np.block([[normal, -rows.T], [rows, corner]])
        try:
            solution = np.linalg.solve(system, np.concatenate((-gradient, -offset[active])))
        except np.linalg.LinAlgError:
            return None
        step, pressed = solution[:p], solution[p:]
        if active and pressed.min() < 0.0:
            active.pop(int(np.argmin(pressed)))
            continue
        left = slope @ step + offset
        left[active] = 0.0
        if left.min() >= -_ROUNDING:
            return np.asarray(step)
        active.append(int(np.argmin(left)))
    return None
