"""Curves with neighbouring points taken together: what a start is found with, and searched from.

A step on blocks costs a fraction of what it costs on all points, and their averages lose little of what the
points tell.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from underlay._arrays import FloatArray
from underlay.data.curve import Curve
from underlay.inference.least_squares.frozen_noise import FrozenNoise
from underlay.inference.least_squares.objective import Objective
from underlay.inference.model.forward import Forward
from underlay.inference.model.jacobian_batch import goes_together
from underlay.inference.model.laws import LawStore
from underlay.inference.problem import Problem
from underlay.scene.noise import Noise

__all__ = ["Blocks", "blocked_forward", "blocked_objective", "power_law_objective"]

_RTOL = 1e-3
_BLOCKS = 32
# Blocks from the middle of a parabola to its ends.
_AWAY = 3


@dataclass(frozen=True)
class Blocks:
    """A curve with neighbouring points taken together: depth (m), force (N), each (m,).

    And of averages how the depths of a block scatter, their variance (m^2), (m,).
    """

    depth: FloatArray
    force: FloatArray
    variance: FloatArray | None = None

    @property
    def span(self) -> float:
        """From the first depth to the last (m): they are in order."""
        return float(self.depth[-1] - self.depth[0])

    @classmethod
    def of(cls, curve: Curve, count: int, *, averages: bool = False) -> Blocks:
        """Take neighbouring depths together in `count` blocks: medians, so that no outlier decides, or averages."""
        order = np.argsort(curve.depth, kind="stable")
        count = min(count, len(order))
        size, longer = divmod(len(order), count)
        end = longer * (size + 1)

        def in_blocks(values: FloatArray, middle: Callable[[FloatArray], FloatArray]) -> FloatArray:
            """The first blocks have the points left over."""
            first, others = values[:end].reshape(longer, size + 1), values[end:].reshape(-1, size)
            return np.concatenate((middle(first), middle(others)))

        depth, force = curve.depth[order], curve.force[order]
        if not averages:
            return cls(in_blocks(depth, _middles), in_blocks(force, _medians))
        mean = in_blocks(depth, _means)
        return cls(mean, in_blocks(force, _means), in_blocks(depth * depth, _means) - mean * mean)

    def straightened(self) -> Blocks:
        """The same without what curvature adds to an average: f(mean w) = mean f - f'' var(w)/2.

        f'' is that of the parabola through a block and two some blocks away: through its neighbours it would
        bring a tenth of a block's scatter along.
        """
        w, f, away = self.depth, self.force, _AWAY
        if self.variance is None or len(w) <= 2 * away or not (np.diff(w) > 0.0).all():
            return self
        slope = (f[away:] - f[:-away]) / (w[away:] - w[:-away])
        half_curvature = (slope[away:] - slope[:-away]) / (w[2 * away :] - w[: -2 * away])
        return replace(self, force=f - self.variance * np.pad(half_curvature, away, mode="edge"))


def blocked_objective(
    problem: Problem, *, robust: bool, forwards: Sequence[Forward] | None = None
) -> Objective:
    """Take the curves in blocks: averages, whose optimum is nearly that of all points, or robust medians.

    The noise is the scatter of the points about a smooth curve; `forwards` may stand for the curves' models.
    """
    members, noises, sigmas = [], [], []
    own = forwards or [member.forward for member in problem.members]
    for member, forward in zip(problem.members, own, strict=True):
        blocks = Blocks.of(member.curve, _BLOCKS, averages=not robust)
        if not robust:
            blocks = blocks.straightened()
        coarse = blocked_forward(forward, blocks, _RTOL)
        members.append(replace(member, curve=Curve(blocks.depth, blocks.force), forward=coarse))
        sigma = member.scatter * (len(blocks.force) / len(member.force)) ** 0.5
        noises.append(Noise(force=sigma))
        sigmas.append(np.full(len(blocks.force), sigma))
    return Objective(problem, FrozenNoise(tuple(noises), tuple(sigmas)), members=tuple(members))


def power_law_objective(problem: Problem, *, robust: bool) -> Objective | None:
    """The same by the laws of paraboloids; None where a curve has no use for them, or a tip's size is free."""
    forwards = [
        forward
        for member in problem.members
        if (forward := member.by_power_law) is not None
        and not any(path.startswith("indenter.") for path in member.entries)
        and goes_together(forward, member.base, tuple(member.entries))
    ]
    if len(forwards) < len(problem.members):
        return None
    return blocked_objective(problem, robust=robust, forwards=forwards)


def blocked_forward(
    forward: Forward, blocks: Blocks, rtol: float, tried: Sequence[str] | None = None
) -> Forward:
    """A curve's model at the depths of its blocks, with coarse laws of its own.

    For a grid of values of what is `tried` they are laws far apart, in which nothing else varies.
    """
    laws = forward.laws if tried is None else forward.laws.varying(tried)
    laws = replace(
        laws,
        solver=laws.solver.with_tolerance(rtol),
        store=LawStore(),
        rough=True,
        scattered=tried is not None,
    )
    return forward.moved(blocks.depth, blocks.force, laws)


def _means(rows: FloatArray) -> FloatArray:
    return np.asarray(rows.sum(axis=1) / rows.shape[1])


def _medians(rows: FloatArray) -> FloatArray:
    # numpy.median takes five times as long on so few numbers.
    return _middles(np.sort(rows, axis=1))


def _middles(ordered: FloatArray) -> FloatArray:
    """Medians of rows in order."""
    middle = ordered.shape[1] // 2
    return ordered[:, middle] if ordered.shape[1] % 2 else 0.5 * (ordered[:, middle - 1] + ordered[:, middle])
