"""Walk along the ridges of a posterior: nodes that each hold a slice of it.

How much processor time a search may take: a law away from the data may cost a thousand times one near them.

Coordinates in which the prior of a problem is a standard normal.

z_i = Phi^-1(F_i(x_i)), with F_i the prior's distribution function cut to what is physically possible. There are
no bounds in z, a parameter that the data ignore is normal, and one that is open to a side ends as softly as the
normal does. The posterior is L(x(z)) N(z; 0, I), whose integral is the evidence.

Newton's method in a plane: the top of a density in it, and its width there.

Only values are known, many at a time. Derivatives are differences over about one standard deviation in a basis
that is whitened again after every step; it begins small and grows, so that no place is asked for that lies far
beyond the posterior, where a density costs most.

Walk along a ridge both ways from its top: nodes that each hold a slice of the posterior.

At a node the slice is the density in the plane across the ridge, its logarithmic mass what the ridge weighs there
per length. A walk ends where that has become negligible, where the prior does, or where the density does; one that
ends otherwise is open, and what is built on it must not be trusted by itself.

A posterior that is a sum: nodes of every part by itself.

Of a narrow and a wide density the sum has the ridge of neither, and a walk along it ends where the narrow one does.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from itertools import combinations
from typing import NamedTuple

import numpy as np
from scipy import special

from underlay._arrays import FloatArray
from underlay.inference.problem import Problem

__all__ = [
    "FARTHEST",
    "Budget",
    "Density",
    "Node",
    "OutOfTimeError",
    "Part",
    "PriorNormal",
    "Ridge",
    "Slice",
    "Target",
    "climb",
    "derivatives",
    "log_normal",
    "march",
    "march_inside",
    "nodes_of",
    "small_basis",
]


class OutOfTimeError(Exception):
    """The processor time that was given is used up; caught where the search began."""


class Budget:
    """Processor seconds from now on.

    Parameters
    ----------
    seconds : float
        Of this process.
    """

    def __init__(self, seconds: float) -> None:
        self._begin, self._seconds = time.process_time(), seconds

    @property
    def used(self) -> float:
        """Seconds used so far."""
        return time.process_time() - self._begin

    @property
    def left(self) -> bool:
        """Whether there is any left."""
        return self.used < self._seconds

    def require(self) -> None:
        """Go on.

        Raises
        ------
        OutOfTimeError
            If the time is used up.
        """
        if not self.left:
            raise OutOfTimeError


#: Farthest z of any parameter: 6e-14 of a prior lies beyond, and the distribution function is 1 to three digits of
#: what is left of it.
FARTHEST = 7.5


_LOG_2PI = float(np.log(2.0 * np.pi))


def log_normal(z: FloatArray) -> FloatArray:
    """Log-density (...) of a standard normal at z (..., p)."""
    return np.asarray(-0.5 * np.square(z).sum(axis=-1) - 0.5 * z.shape[-1] * _LOG_2PI)


class PriorNormal:
    """The way between the scaled vectors of a problem and z.

    Parameters
    ----------
    problem : Problem
        With a proper prior for every parameter.
    """

    def __init__(self, problem: Problem) -> None:
        self._problem = problem
        self._priors = [c.prior.truncated(c.low, c.high) for c in problem.coordinates]
        self.size = len(self._priors)

    def scaled(self, z: FloatArray) -> FloatArray:
        """Scaled vectors (m, p) at z (m, p)."""
        share = special.ndtr(z)
        values = np.column_stack([prior.quantile(share[:, i]) for i, prior in enumerate(self._priors)])
        return self._problem.space.scaled(values)

    def normal(self, vectors: FloatArray) -> FloatArray:
        """Coordinates z (m, p) at scaled vectors (m, p); infinite where the prior ends."""
        values = self._problem.physical(vectors)
        shares = [prior.probability_below(values[:, i]) for i, prior in enumerate(self._priors)]
        return np.asarray(special.ndtri(np.column_stack(shares)))

    def factors(self, vectors: FloatArray, covariances: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Places z (m, p) and lower factors (m, p, p) there of covariances (m, p, p) of scaled vectors (m, p).

        Those that reach beyond the priors are left out.
        """
        reach = np.sqrt(np.diagonal(covariances, axis1=1, axis2=2))
        if not len(vectors):
            return vectors, covariances
        ends = [self.normal(vectors + side * reach) for side in (-1.0, 0.0, 1.0)]
        inside = np.isfinite(ends).all(axis=(0, 2)) & (np.abs(ends) < FARTHEST).all(axis=(0, 2))
        slopes = ((ends[2] - ends[0]) / (2.0 * reach))[inside]
        scaled = slopes[:, :, None] * covariances[inside] * slopes[:, None, :]
        lower: FloatArray = np.asarray(np.linalg.cholesky(scaled), dtype=np.float64)
        return ends[1][inside], lower

    def log_slope(self, vectors: FloatArray, z: FloatArray) -> FloatArray:
        """ln |dz/dq| (m,) at scaled vectors (m, p), whose coordinates are `z`."""
        # The part of a prior beyond what is physically possible is a constant factor, alike everywhere.
        return np.asarray(self._problem.log_prior(vectors) - log_normal(z))


class Target:
    """ln L(x(z)) + ln N(z; 0, I) as a callable (m, p) -> (m,): -inf where no law exists, or too far out.

    Parameters
    ----------
    coordinates : PriorNormal
        The way to scaled vectors.
    problem : Problem
        Whose posterior it is.
    density : callable
        Log-posterior (m,) of scaled vectors (m, p), never nan, -inf where it fails.
    """

    def __init__(
        self, coordinates: PriorNormal, problem: Problem, density: Callable[[FloatArray], FloatArray]
    ) -> None:
        self.coordinates = coordinates
        self._problem, self._density = problem, density
        self.evaluations = 0

    def __call__(self, z: FloatArray) -> FloatArray:
        """Log-density (m,) at z (m, p)."""
        values = np.full(len(z), -np.inf)
        near = np.flatnonzero((np.abs(z) < FARTHEST).all(axis=1))
        if not near.size:
            return values
        vectors = self.coordinates.scaled(z[near])
        prior = self._problem.log_prior(vectors)
        # Rounding may put the quantile of a bounded prior a hair beyond its end.
        inside = np.isfinite(prior)
        self.evaluations += int(inside.sum())
        if inside.any():
            likelihood = self._density(vectors[inside]) - prior[inside]
            values[near[inside]] = likelihood + log_normal(z[near[inside]])
        return values


Density = Callable[[FloatArray], FloatArray]


_MAX_STEPS = 40


# Steps in a row that gain nothing: a bent density never has the widths that were measured before.
_PATIENCE = 2


# First columns, in standard deviations of the prior, and the longest: a little more than the prior's own.
_FIRST, _LONGEST = 1e-3, 1.2


_GROWTH = 4.0


# Precision of a column by which it is taken to have its length.
_SETTLED = 0.5


# Bend of a column that leaves the support: it becomes half as long.
_LOST = 4.0


_SHARES = 2.0 ** -np.arange(6.0)


class Slice(NamedTuple):
    """The top of a density in a plane.

    Parameters
    ----------
    place : FloatArray
        (p,).
    basis : FloatArray
        (p, m): ``place + basis @ y`` with normal y is the density in the plane, near its top.
    log_density : float
        At the top.
    moved : float
        How far it was from where the search began, in standard deviations.
    """

    place: FloatArray
    basis: FloatArray
    log_density: float
    moved: float

    @property
    def log_mass(self) -> float:
        """Logarithm of the density's integral over the plane, were it normal; but for (2 pi)^(m/2)."""
        if not self.basis.shape[1]:
            return self.log_density
        _, log_volume = np.linalg.slogdet(self.basis.T @ self.basis)
        return self.log_density + 0.5 * float(log_volume)


def small_basis(parameters: int) -> FloatArray:
    """Basis (p, p) to begin with where nothing is known of the widths."""
    return _FIRST * np.eye(parameters)


def climb(
    density: Density,
    start: FloatArray,
    basis: FloatArray,
    tolerance: float = 1e-3,
    max_steps: int = _MAX_STEPS,
) -> Slice | None:
    """Climb from `start` (p,) to the nearest top in the plane that the columns of `basis` (p, m) span.

    Parameters
    ----------
    density : callable
        Log-density (n,) at places (n, p); -inf where there is none.
    start, basis
        Where to begin, and about one standard deviation along each column.
    tolerance : float, default 1e-3
        What may be left to gain, in units of the log-density.
    max_steps : int, default 40
        Most steps.

    Returns
    -------
    Slice or None
        None where the density vanishes at the start.
    """
    place, top, idle = start, -np.inf, 0
    for _ in range(max_steps):
        top, gradient, hessian = derivatives(density, place, basis, lost=_LOST)
        if not np.isfinite(top):
            return None
        if not basis.shape[1]:
            break
        curvature, directions = np.linalg.eigh(-hessian)
        turned = basis @ directions
        longest = np.linalg.norm(turned, axis=0) / _LONGEST
        # A direction the density does not bend in, or bends upwards in, grows until it does or to the prior.
        precision = np.maximum(curvature, np.maximum(longest**2, _GROWTH**-2))
        slope = directions.T @ gradient
        to_gain = 0.5 * float(np.sum(slope**2 / precision))
        candidates = place + _SHARES[:, None] * (turned @ (slope / precision))
        basis = turned / np.sqrt(precision)
        values = density(candidates)
        best = int(np.argmax(values))
        # A basis that still grows has not looked as far as there may be something to gain.
        grows = bool((precision <= 1.01 * _GROWTH**-2).any())
        idle = 0 if grows or values[best] - top > tolerance else idle + 1
        if values[best] > top:
            place, top = candidates[best], float(values[best])
        settled = bool((np.abs(np.log(precision)) < _SETTLED).all())
        if idle >= _PATIENCE or (settled and to_gain < tolerance):
            break
    steps = np.linalg.lstsq(basis, place - start, rcond=None)[0] if basis.shape[1] else np.zeros(1)
    return Slice(place, basis, top, float(np.linalg.norm(steps)))


def derivatives(
    density: Density, place: FloatArray, basis: FloatArray, *, lost: float
) -> tuple[float, FloatArray, FloatArray]:
    """Log-density at a place, its gradient (m,) and Hessian (m, m) in units of the basis' columns.

    A column that leaves the density's support on one side tells nothing of the slope; its bend is taken as `lost`.
    A pair that leaves it tells nothing of the correlation.
    """
    columns = basis.shape[1]
    pairs = list(combinations(range(columns), 2))
    unit = np.eye(columns)
    offsets = np.concatenate([unit, [unit[i] + unit[j] for i, j in pairs]]) if pairs else unit
    steps = offsets @ basis.T
    values = density(np.concatenate([place[None], place + steps, place - steps]))
    top = float(values[0])
    if not np.isfinite(top):
        return top, np.zeros(columns), np.zeros((columns, columns))
    up, down = values[1 : 1 + len(offsets)] - top, values[1 + len(offsets) :] - top
    inside = np.isfinite(up) & np.isfinite(down)
    even = np.where(inside, np.add(up, down, where=inside, out=np.zeros_like(up)), -lost)
    odd = np.subtract(up, down, where=inside, out=np.zeros_like(up))
    hessian = np.diag(even[:columns])
    for pair, (i, j) in enumerate(pairs, start=columns):
        if inside[pair]:
            hessian[i, j] = hessian[j, i] = 0.5 * (even[pair] - even[i] - even[j])
    return top, 0.5 * odd[:columns], hessian


# Steps in standard deviations of the prior.
_LONGEST_STEP = 0.7


# Corrector: what may be left to gain in a slice, and the most steps; one that needs more has gone too far.
_TOLERANCE, _STEPS = 0.3, 10


# A step is halved if the corrector moved, or the mass changed, by more than this; and grows if by less.
_TOO_FAR, _TOO_MUCH = 4.0, 3.0


_NEAR, _LITTLE, _FASTER = 1.5, 1.0, 1.5


_HALVINGS = 6


# Steps over which the direction is taken.
_SECANT = 4


# Mass below the top at which a ridge, and one inside a slice, is dropped; nodes of each.
_DROP, _DROP_INSIDE = 10.0, 8.0


_NODES, _NODES_INSIDE = 160, 40


# Where the prior ends, and a fall within the smallest step that is no slope any more.
_PRIOR_END, _CLIFF = 5.5, 3.5


# A slice is walked in too where its density this far along its longest axis is off a normal's by so much.
_PROBE, _BENT, _OF_INTEREST = 1.5, 2.0, 6.0


@dataclass(frozen=True)
class Node:
    """A place on a ridge.

    Parameters
    ----------
    place : FloatArray
        (p,).
    across : FloatArray
        (p, m): standard deviations of the slice.
    along : FloatArray
        (p, p - m): the length of ridge that the node stands for; of two ridges where it is on a sheet.
    log_weight : float
        Logarithm of the posterior's mass that the node stands for.
    """

    place: FloatArray
    across: FloatArray
    along: FloatArray
    log_weight: float


@dataclass(frozen=True)
class Ridge:
    """A ridge that was walked.

    Parameters
    ----------
    slices : tuple of Slice
        In order, each across the ridge.
    tangents : tuple of FloatArray
        (p,) each: unit vectors along it.
    gaps : tuple of float
        Lengths of it that the slices stand for.
    open_end : str
        Why an end is open; empty where none is.
    """

    slices: tuple[Slice, ...]
    tangents: tuple[FloatArray, ...]
    gaps: tuple[float, ...]
    open_end: str

    @property
    def nodes(self) -> tuple[Node, ...]:
        """One node a slice."""
        return tuple(_node(*entry) for entry in zip(self.slices, self.tangents, self.gaps, strict=True))


@dataclass(frozen=True)
class _Walk:
    """Rules of one walk: how deep below the top it goes, and how many nodes it may have."""

    drop: float
    most: int


def march(density: Density, top: Slice, *, inside: bool = False) -> Ridge:
    """Walk the ridge of a density from its top, whose basis (p, m) spans what may vary.

    Parameters
    ----------
    density : callable
        Log-density (n,) at places (n, p), in coordinates in which the prior is a standard normal.
    top : Slice
        From `climb`.
    inside : bool, default False
        Whether it is a walk inside a slice, which is shorter.
    """
    walk = _Walk(_DROP_INSIDE, _NODES_INSIDE) if inside else _Walk(_DROP, _NODES)
    axes, widths, _ = np.linalg.svd(top.basis, full_matrices=False)
    first = climb(density, top.place, axes[:, 1:] * widths[1:], _TOLERANCE)
    if first is None:
        return Ridge((), (), (), "the density vanishes at its top")
    back, end_back = _one_way(density, first, -axes[:, 0], widths[0], walk)
    ahead, end_ahead = _one_way(density, first, axes[:, 0], widths[0], walk)
    slices = [*back[::-1], first, *ahead]
    return Ridge(
        tuple(slices), _tangents(slices, axes[:, 0]), _gaps(slices, widths[0]), end_back or end_ahead
    )


def march_inside(density: Density, ridge: Ridge) -> tuple[tuple[Node, ...], str]:
    """Nodes of a sheet, if a ridge's slices are bent: those of a walk inside every slice that counts.

    Also why an end is open. Without a bent slice the ridge's own nodes.
    """
    nodes = ridge.nodes
    best = max(node.log_weight for node in nodes)
    counts = [node.log_weight > best - _OF_INTEREST for node in nodes]
    walked = [entry for entry, matters in zip(ridge.slices, counts, strict=True) if matters]
    if not any(entry.basis.shape[1] > 1 and _is_bent(density, entry) for entry in walked):
        return nodes, ridge.open_end
    sheet: list[Node] = []
    open_end = ridge.open_end
    rows = zip(nodes, counts, ridge.slices, ridge.tangents, ridge.gaps, strict=True)
    for node, matters, entry, tangent, gap in rows:
        if not matters:
            sheet.append(node)
            continue
        across = march(density, entry, inside=True)
        open_end = open_end or across.open_end
        sheet += [
            replace(
                part,
                along=np.column_stack([part.along, gap * tangent]),
                log_weight=part.log_weight + float(np.log(gap)),
            )
            for part in across.nodes
        ]
    return tuple(sheet), open_end


def _one_way(
    density: Density, here: Slice, tangent: FloatArray, width: float, walk: _Walk
) -> tuple[list[Slice], str]:
    """Slices from `here` on, without it, and why the end is open."""
    step = min(width, _LONGEST_STEP)
    smallest = step * 2.0**-_HALVINGS
    best = here.log_mass
    found: list[Slice] = []
    while len(found) < walk.most // 2:
        ahead = here.place + step * tangent
        across = here.basis - np.outer(tangent, tangent @ here.basis)
        after = climb(density, ahead, across, _TOLERANCE, _STEPS)
        last = step <= smallest
        if after is None or _turned_back(after, here, found):
            if last:
                return found, ""
            step = max(0.5 * step, smallest)
            continue
        change = after.log_mass - here.log_mass
        if (after.moved > _TOO_FAR or abs(change) > _TOO_MUCH) and not last:
            step = max(0.5 * step, smallest)
            continue
        if last and change < -_CLIFF:
            return found, "the ridge ends in a cliff"
        # What the corrector leaves in a stiff direction may be as long as a short step; several steps outweigh it.
        way = after.place - (found[-_SECANT] if len(found) >= _SECANT else here).place
        tangent, here = way / np.linalg.norm(way), after
        best = max(best, here.log_mass)
        if here.log_mass < best - walk.drop:
            return found, ""
        found.append(here)
        if np.linalg.norm(here.place) > _PRIOR_END:
            return found, ""
        if after.moved < _NEAR and abs(change) < _LITTLE:
            step = min(_FASTER * step, _LONGEST_STEP)
    return found, "the ridge goes on after the most nodes"


def _turned_back(after: Slice, here: Slice, found: Sequence[Slice]) -> bool:
    """Whether a step led nearer to what lies well behind than it is long."""
    step = np.linalg.norm(after.place - here.place)
    return any(np.linalg.norm(after.place - old.place) < step for old in found[:-_SECANT])


def _tangents(slices: list[Slice], alone: FloatArray) -> tuple[FloatArray, ...]:
    """Unit vectors (p,) along the ridge at each slice; `alone` where there is one slice only."""
    if len(slices) == 1:
        return (alone,)
    places = np.array([entry.place for entry in slices])
    chords = np.gradient(places, axis=0)
    return tuple(chords / np.linalg.norm(chords, axis=1, keepdims=True))


def _gaps(slices: list[Slice], alone: float) -> tuple[float, ...]:
    """Length of the ridge that each slice stands for."""
    if len(slices) == 1:
        return (alone,)
    places = np.array([entry.place for entry in slices])
    between = np.linalg.norm(np.diff(places, axis=0), axis=1)
    return tuple(0.5 * (np.append(between, between[-1]) + np.insert(between, 0, between[0])))


def _node(entry: Slice, tangent: FloatArray, gap: float) -> Node:
    return Node(entry.place, entry.basis, (gap * tangent)[:, None], entry.log_mass + float(np.log(gap)))


def _is_bent(density: Density, entry: Slice) -> bool:
    """Whether a slice is far from normal along its longest axis."""
    axes, widths, _ = np.linalg.svd(entry.basis, full_matrices=False)
    step = _PROBE * widths[0] * axes[:, 0]
    values = density(np.array([entry.place + step, entry.place - step]))
    return bool((np.abs(values - entry.log_density + 0.5 * _PROBE**2) > _BENT).any())


# A part that weighs less than this share is taken for normal: it does not pay to walk it.
_WALKED = 5e-3


# Otherwise it is so where at this many standard deviations its density is off a normal's by less than this.
_PARTS_PROBE, _PARTS_BENT = 2.0, 0.7


@dataclass(frozen=True, eq=False)
class Part:
    """One of the densities that a posterior is a sum of.

    Parameters
    ----------
    log_density : callable
        Its logarithm (n,) at places (n, p), where the prior is a standard normal.
    place, factor : FloatArray
        The normal distribution that it looks like about its top: middle (p,), factor of the covariance (p, p).
    """

    log_density: Density
    place: FloatArray
    factor: FloatArray

    def as_normal(self) -> tuple[Node, bool]:
        """One node for all of it, and whether it looks otherwise along its axes."""
        axes, widths, _ = np.linalg.svd(self.factor)
        steps = _PARTS_PROBE * np.concatenate([axes.T * widths[:, None], -axes.T * widths[:, None]])
        values = self.log_density(self.place + np.concatenate([np.zeros((1, len(widths))), steps]))
        mass = float(values[0] + np.log(widths).sum() + 0.5 * np.log(2.0 * np.pi))
        is_bent = bool((np.abs(values[1:] - values[0] + 0.5 * _PARTS_PROBE**2) > _PARTS_BENT).any())
        return Node(self.place, self.factor, np.zeros((len(widths), 0)), mass), is_bent


def nodes_of(parts: Sequence[Part], budget: Budget) -> tuple[list[Node], str]:
    """Nodes of all parts, along its ridge where one is bent; and why these are not all, empty where they are."""
    normal = [(part, *part.as_normal()) for part in parts]
    normal = [entry for entry in normal if np.isfinite(entry[1].log_weight)]
    if not normal:
        return [], ""
    total = special.logsumexp([node.log_weight for _, node, _ in normal])
    nodes: list[Node] = []
    for part, node, is_bent in normal:
        try:
            walked = _walked(part, budget) if is_bent and node.log_weight > total + np.log(_WALKED) else ()
        except OutOfTimeError:
            return nodes + [node for _, node, _ in normal], "the processor time for walking was used up"
        nodes += walked or (node,)
    return nodes, ""


def _walked(part: Part, budget: Budget) -> tuple[Node, ...]:
    """Nodes along the ridge of a part; none where it has no density at its middle."""

    def density(z: FloatArray) -> FloatArray:
        budget.require()
        return part.log_density(z)

    top = climb(density, part.place, small_basis(len(part.place)))
    return () if top is None else march(density, top).nodes
