"""How far a published formula is from the exact contact problem: tables measured once, and read here.

Each table stands beside its formula. Its numbers are the largest |P/P_exact - 1|, in per cent, met between
zero and the value of the contact size at the head of the column, rounded up to two digits. They were
measured with a Nystrom solution of the Fredholm equation of the contact; the tests measure them again.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import product
from typing import Self

import numpy as np

from underlay._arrays import FloatArray, read_only
from underlay.mechanics.published.layer_contact import LayerContact
from underlay.mechanics.published.quantities import Quantity

__all__ = ["MeasuredError"]


@dataclass(frozen=True, eq=False)
class MeasuredError:
    """Largest relative error of the force up to a contact size, for given materials.

    Parameters
    ----------
    parameters : tuple of Quantity
        What the rows are measured at.
    nodes : tuple of ndarray
        Measured values of each parameter, increasing.
    variable : ndarray, shape (columns,)
        Contact sizes u, increasing.
    worst : ndarray, shape (len(nodes[0]), ..., columns)
        Largest relative error between u = 0 and the column's u; inf where the formula makes no claim.
    """

    parameters: tuple[Quantity, ...]
    nodes: tuple[FloatArray, ...]
    variable: FloatArray
    worst: FloatArray

    @classmethod
    def from_table(cls, parameters: tuple[Quantity, ...], table: str) -> Self:
        """Read a table: a head line of contact sizes, then lines of parameters and errors in per cent."""
        head, *lines = table.strip().splitlines()
        rows = np.array([[float(word) for word in line.split()] for line in lines])
        count = len(parameters)
        nodes = tuple(read_only(np.unique(rows[:, axis])) for axis in range(count))
        variable = np.array([float(word) for word in head.split()])
        worst = np.full((*(node.size for node in nodes), variable.size), np.nan)
        for row in rows:
            index = tuple(int(np.searchsorted(nodes[axis], row[axis])) for axis in range(count))
            worst[index] = 0.01 * row[count:]
        return cls(parameters, nodes, read_only(variable), read_only(worst))

    def up_to(self, contact: LayerContact, max_depth: float) -> float:
        """Estimated relative error of the force up to `max_depth` (m), inf outside what was measured.

        Between measured materials the worse of the neighbours holds; between measured contact sizes the
        error is interpolated, from zero at zero.
        """
        variable = contact.size_at(max_depth)
        if variable > self.variable[-1]:
            return np.inf
        around = []
        for quantity, nodes in zip(self.parameters, self.nodes, strict=True):
            value = quantity.of(contact, max_depth)
            if not nodes[0] <= value <= nodes[-1]:
                return np.inf
            below = int(np.searchsorted(nodes, value, side="right")) - 1
            around.append((below,) if nodes[below] == value else (below, below + 1))
        # A column that holds inf may only be reached by its own interval: 0 * inf would be NaN.
        column = int(np.searchsorted(self.variable, variable))
        left = self.variable[column - 1] if column > 0 else 0.0
        share = (variable - left) / (self.variable[column] - left)
        estimates = []
        for index in product(*around):
            row = self.worst[index]
            start = float(row[column - 1]) if column > 0 else 0.0
            end = float(row[column])
            estimates.append(end if share == 1.0 or not np.isfinite(end) else start + share * (end - start))
        return max(estimates)
