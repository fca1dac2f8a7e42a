"""The force of one motion at many sets of parameters at once: each set has its own contact point and relaxation.

The motions of the sets differ by where their contact begins alone, so most turn at the same point: those go
together, through the constructions that serve one set.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray

from underlay._arrays import FloatArray
from underlay.mechanics.relaxation import ModesOfSets
from underlay.mechanics.viscoelastic.equal_radius import equal_radius
from underlay.mechanics.viscoelastic.history import RIPPLES, SUDDEN, led_in, turns
from underlay.mechanics.viscoelastic.loading import Loading
from underlay.mechanics.viscoelastic.memory import Memory
from underlay.mechanics.viscoelastic.unloading import Unloading

__all__ = ["ElasticOfSets", "forces_of_sets"]

#: Elastic forces (N), (rows, q), of the sets `rows` at depths (m), (rows, q).
ElasticOfSets: TypeAlias = Callable[[NDArray[np.intp], FloatArray], FloatArray]


def forces_of_sets(
    modes: ModesOfSets, elastic: ElasticOfSets, depth: FloatArray, time: FloatArray
) -> tuple[FloatArray, NDArray[np.bool_]]:
    """Forces (N), (sets, n), and for which sets a closed construction holds; the rows of the others are zero.

    Parameters
    ----------
    modes : ModesOfSets
        Of the relaxations, which have a finite modulus at once.
    elastic : callable
        Their elastic forces.
    depth : FloatArray
        Depths since contact (m), (sets, n), negative before it.
    time : FloatArray
        Times (s), (n,), increasing.
    """
    force, known = np.zeros(depth.shape), np.asarray((depth <= 0.0).all(axis=1))
    begun = depth[:, 0] > 0.0
    for ripple in RIPPLES:
        turn, allowed, grows = turns(depth, ripple)
        ready = grows & ~known
        for group in {(int(turn[row]), bool(begun[row])) for row in np.flatnonzero(ready)}:
            rows = np.flatnonzero(ready & (turn == group[0]) & (begun == group[1]))
            found, closed = _by_turn(modes.of(rows), elastic, rows, depth[rows], time, *group, allowed[rows])
            force[rows[closed]], known[rows[closed]] = found[closed], True
    return force, known


def _by_turn(
    modes: ModesOfSets,
    elastic: ElasticOfSets,
    rows: NDArray[np.intp],
    depth: FloatArray,
    time: FloatArray,
    turn: int,
    begun: bool,
    allowed: FloatArray,
) -> tuple[FloatArray, NDArray[np.bool_]]:
    """Forces of sets that turn at one point, (rows, n), and for which of them the contact shrinks from there on."""

    def asked(w: FloatArray) -> FloatArray:
        return elastic(rows, w)

    if turn == len(time) - 1:
        return Loading(depth, Memory.of(modes, time))(asked), np.ones(len(rows), dtype=bool)
    if begun:
        # The contact shrinks back through the radii of the sudden step, which must have a time.
        depth, time = led_in(depth, time, SUDDEN)
        turn += 1
    memory = Memory.of(modes, time)
    way = np.concatenate((np.maximum(depth[:, : turn + 1], 0.0), depth[:, turn + 1 :]), axis=1)
    found = equal_radius(way, memory, turn)
    force = Unloading(depth, turn, memory, found)(asked)
    return force[:, int(begun) :], found.regrowth <= allowed
