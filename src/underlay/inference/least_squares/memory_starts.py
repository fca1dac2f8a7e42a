"""Starting points from the curve itself, for samples with a memory that is not linear in one elastic force.

Such are layers that drain: their model of time (`WholeHistory`) estimates its numbers from the readings.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import NamedTuple

import numpy as np

from underlay._arrays import FloatArray
from underlay.errors import InputError
from underlay.inference.model.members import Member
from underlay.inference.problem import Problem
from underlay.mechanics.response import WholeHistory, checked_times


class Start(NamedTuple):
    """A point to search from: scaled vector (k,), and its misfit divided by that of the best start."""

    vector: FloatArray
    misfit: float


def memory_starts(problem: Problem, count: int) -> list[Start]:
    """At most `count` starts, best first, from values that each sample's memory estimates from its curve.

    Each start takes such values for one curve (`history.starts`) and the first of them for the others; a curve
    whose memory gives none keeps the values of its scene.
    """
    read_off = [_read_off(member, problem) for member in problem.members]
    own = problem.start
    for member, values in zip(problem.members, read_off, strict=True):
        own = _with_values(problem, member, values[0], own) if values else own
    vectors = [
        _with_values(problem, member, each, own)
        for member, values in zip(problem.members, read_off, strict=True)
        for each in values
    ] or [own]
    ranked = sorted(((_misfit(problem, vector), tuple(vector)) for vector in vectors), key=lambda one: one[0])
    best = ranked[0][0]
    return [
        Start(np.array(vector), misfit / best if best > 0.0 else 1.0)
        for misfit, vector in dict.fromkeys(ranked[:count])
    ]


def _read_off(member: Member, problem: Problem) -> list[Mapping[str, float]]:
    """Parameter values (SI) by path that the memory of one curve estimates from its readings, best first."""
    history = member.forward.history
    if not isinstance(history, WholeHistory):
        return []
    bounds = {
        path: (problem.coordinates[entry].low, problem.coordinates[entry].high)
        for path, entry in member.entries.items()
    }
    depth = member.curve.depth - member.scene.instrument.contact_depth
    return list(history.starts(bounds, depth, member.force, checked_times(member.curve.time, depth)))


def _with_values(
    problem: Problem, member: Member, values: Mapping[str, float], vector: FloatArray
) -> FloatArray:
    """Scaled vector (k,) with the parameters of one curve set to `values` (SI, by path), within their bounds."""
    found = np.array(vector)
    for path, entry in member.entries.items():
        if path in values:
            coordinate = problem.coordinates[entry]
            found[entry] = coordinate.scaled(min(max(values[path], coordinate.low), coordinate.high))
    return found


def _misfit(problem: Problem, vector: FloatArray) -> float:
    """Sum of squared residuals over the squared scatter of every curve; inf where there is no law."""
    physical = problem.physical(vector)
    try:
        return sum(
            float(np.square(member.model(physical) - member.force).sum()) / member.scatter**2
            for member in problem.members
        )
    except InputError:
        return np.inf
