"""The contact laws of the rows of a grid, asked all at once."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from itertools import groupby, pairwise
from typing import Any, Self, TypeAlias

import numpy as np
from numpy.typing import NDArray

from underlay._arrays import FloatArray
from underlay.errors import InputError, RangeError
from underlay.inference.model.forward import Forward
from underlay.inference.model.tip_over_power_law import TipOverPowerLaw
from underlay.mechanics.contact_law import ContactLaw

__all__ = ["LawRows", "Rows"]

#: Every number of a scene by path: one for all rows of a grid, or one each, (r,).
Rows: TypeAlias = Mapping[str, float | FloatArray]


@dataclass(frozen=True)
class LawRows:
    """Laws of some rows: neighbours of equal ratios share one.

    Parameters
    ----------
    b, c : FloatArray
        Factors of P(w) = c P_ref(b w), each (r, 1, 1).
    possible : ndarray of bool (r,)
        Which rows have a law.
    shared : list of (slice, law)
        The rows that one law serves, in order.
    over : TipOverPowerLaw, optional
        The tip, where the laws are those of its power law.
    together : callable, optional
        Forces (N), (laws, n), at depths (m), (laws, n) or (1, n) for all, of laws that serve the same factors each,
        in place of `shared`.
    places : int
        Rows that each of these laws serves.
    """

    b: FloatArray
    c: FloatArray
    possible: NDArray[np.bool_]
    shared: list[tuple[slice, ContactLaw]]
    over: TipOverPowerLaw | None = None
    together: Callable[[FloatArray], FloatArray] | None = None
    places: int = 0

    @classmethod
    def of(cls, forward: Forward, rows: Rows, deepest: float) -> Self:
        """Find or build the laws for tip depths up to `deepest` (m)."""
        similarity = forward.similarity
        count = max(value.size if isinstance(value, np.ndarray) else 1 for value in rows.values())
        # `factors` and `reduced` divide and multiply: arrays go through them as numbers do.
        numbers: Any = rows
        b, c = (np.broadcast_to(factor, count) for factor in similarity.factors(numbers))
        depths = b * max(deepest, 0.0)
        ratios = similarity.reduced(numbers)
        keys = zip(*(np.broadcast_to(ratio, count).tolist() for ratio in ratios), strict=True)
        possible = np.ones(count, dtype=bool)
        rows_of = [(key, list(group)) for key, group in groupby(keys)] if ratios else [((), [()] * count)]
        shared: list[tuple[slice, ContactLaw]] = []
        scales = b[:, None, None], c[:, None, None]
        places = len(rows_of[0][1])
        if {len(group) for _, group in rows_of} == {places} and (b.reshape(-1, places) == b[:places]).all():
            together = forward.laws.side_by_side([key for key, _ in rows_of], float(depths.max()))
            if together is not None:
                return cls(*scales, possible, shared, forward.over, together, places)
        end = 0
        forward.laws.laws_of([key for key, _ in rows_of], _deepest(depths, rows_of))
        for key, group in rows_of:
            part = slice(end, end := end + len(group))
            law, possible[part] = _reaching(forward, key, depths[part])
            if law is not None:
                shared.append((part, law))
        return cls(*scales, possible, shared, forward.over)

    def force(self, depth: FloatArray) -> FloatArray:
        """P (N), (r, c, n), at tip depths (m) of that shape or (1, c, n); zero where there is no law."""
        if self.over is None:
            return self._asked(depth) * self.c
        asked, ratio = self.over.seen(depth)
        return self._asked(asked) * (ratio * self.c)

    def _asked(self, depth: FloatArray) -> FloatArray:
        if self.together is not None:
            alike = len(depth) == 1  # then the rows of every law ask for the same depths
            w = (self.b[: self.places] if alike else self.b) * depth
            laws = 1 if alike else len(self.b) // self.places
            return self.together(w.reshape(laws, -1)).reshape(len(self.b), *w.shape[1:])
        w = self.b * depth
        if not self.possible.all():
            w *= self.possible[:, None, None]
        result = np.zeros_like(w)
        for part, law in self.shared:
            result[part] = law.force(w[part])
        return result


def _reaching(
    forward: Forward, ratios: tuple[float, ...], depths: FloatArray
) -> tuple[ContactLaw | None, NDArray[np.bool_]]:
    """Law that reaches as many of `depths` (m), (r,), as can be, and which those are."""
    within = np.ones(len(depths), dtype=bool)
    try:
        return forward.laws.law(ratios, float(depths.max())), within
    except RangeError as error:
        within = depths <= (error.max_depth or -1.0)
    except InputError:
        within[:] = False
    if not within.any():
        return None, within
    return forward.laws.law(ratios, float(depths[within].max())), within


def _deepest(depths: FloatArray, groups: Sequence[tuple[tuple[float, ...], Sequence[object]]]) -> list[float]:
    """Largest of the depths (r,) of every group of neighbours."""
    ends = np.cumsum([0] + [len(group) for _, group in groups])
    return [float(depths[start:stop].max()) for start, stop in pairwise(ends.tolist())]
