"""How the curves of a group nest: sites of animals, curves of sites."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from underlay.inference.population.messages import IntArray

__all__ = ["Units"]


@dataclass(frozen=True)
class Units:
    """How the curves of a group nest: per level, outermost first, which unit each unit below belongs to.

    Parameters
    ----------
    names : tuple of tuple of str
        Names of the units of each level, outermost first.
    parents : tuple of ndarray of int
        For each level, whose unit each unit of the level below it is; those of the innermost level hold curves.
    """

    names: tuple[tuple[tuple[str, ...], ...], ...]
    parents: tuple[IntArray, ...]

    @classmethod
    def of(cls, labels: Sequence[tuple[str, ...]]) -> tuple[Units, IntArray]:
        """Units of curves with these labels, and the order in which their units come one after the other."""
        order = np.array(sorted(range(len(labels)), key=lambda i: labels[i]), dtype=int)
        below: list[tuple[str, ...]] = [labels[i] for i in order]
        names, parents = [], []
        for depth in range(len(labels[0]), 0, -1):
            heads = [label[:depth] for label in below]
            distinct = list(dict.fromkeys(heads))
            place = {head: number for number, head in enumerate(distinct)}
            parents.append(np.array([place[head] for head in heads], dtype=int))
            names.append(tuple(distinct))
            below = distinct
        return cls(tuple(names[::-1]), tuple(parents[::-1])), order

    def freedoms(self, curves: int) -> list[int]:
        """Of each level below the outermost, curves last: how many members are beyond the first of their unit."""
        counts = [*(len(names) for names in self.names), curves]
        return [below - above for above, below in pairwise(counts)]
