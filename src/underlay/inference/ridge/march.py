"""Walk along a ridge both ways from its top: nodes that each hold a slice of the posterior.

At a node the slice is the density in the plane across the ridge, its logarithmic mass what the ridge weighs there
per length. A walk ends where that has become negligible, where the prior does, or where the density does; one that
ends otherwise is open, and what is built on it must not be trusted by itself.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from underlay._arrays import FloatArray
from underlay.inference.ridge.climb import Density, Slice, climb

__all__ = ["Node", "Ridge", "march", "march_inside"]


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
