"""Laws that differ in one number, interpolated by a polynomial surface in that number and the depth.

For a no-slip contact, whose laws cost most, and for a sphere, whose size over the thickness no scaling removes.
Where of all ratios of a scene one alone varies between parameter sets (Poisson's ratio, a modulus of the base, a
radius over a thickness), the law of the reference is built at a few values of it, and ln(P/w^(1+1/p)) is a
polynomial in that number and in w^(1/p), to which the contact radius is proportional at first; P is the force at
the depth w, p the exponent of the tip's shape. Cells of the number and ranges of the depth are fixed, so that the
result of a set does not depend on the other sets of the batch. Where the number is a length of the tip, depths are
counted in it: a sphere ends on its own scale, and a curve's depth is known on it. The error of a surface is
measured at values and depths between its own, and one that is off by more than the tolerance is not used.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import product
from typing import Self

import numpy as np
from numpy.polynomial import chebyshev
from numpy.typing import NDArray

from underlay._arrays import FloatArray
from underlay.errors import InputError
from underlay.inference.model.laws import LawSource
from underlay.mechanics.contact_law import ContactLaw
from underlay.quantities import kind_of

# Widths and edges of cells, of logarithms and of Poisson's ratios; 0.5 is an edge, beyond which nothing is solved.
_LOG_CELL, _LOG_EDGE = np.log(2.0), np.log(1.37)
_CELL, _EDGE = 0.1, 0.5
# Numbers of values and of terms in depth that are tried one after the other.
_VALUES, _TERMS = (6, 10, 16), (16, 32, 64)
# Places in the cell, in [-1, 1], and depths over the largest at which a surface is judged.
_JUDGED, _JUDGED_DEPTHS = np.array([-0.86, 0.31]), np.linspace(0.02, 0.99, 29) ** 2
# Shares of the tolerance: error of the laws behind a surface, and error that it may show where it is judged.
_SPARE, _SEEN = 0.2, 0.5


@dataclass(frozen=True)
class RatioSurface:
    """ln(P/w^(1+1/p)) over one cell of the varying number and depths w up to `reach`.

    P is the force at the depth w, p the exponent of the tip's shape.

    Parameters
    ----------
    low, high : float
        Ends of the cell, in the number or its logarithm.
    reach : float
        Largest depth of the reference (m), or over the tip's length if `in_lengths`.
    power : float
        1/p.
    in_lengths : bool
        Whether the number is a length of the tip, in which depths are counted, and not in metres.
    coefficients : ndarray (values, terms)
        Chebyshev coefficients in the place in the cell and in (w/reach)^(1/p), each mapped to [-1, 1].
    """

    low: float
    high: float
    reach: float
    power: float
    in_lengths: bool
    coefficients: FloatArray

    @classmethod
    def of(
        cls, source: LawSource, entry: int, ratios: tuple[float, ...], cell: float, octave: float
    ) -> Self | None:
        """Compute the surface of one cell of the varying ratio; None where that fails.

        It fails where a law of the cell does not exist, or the error exceeds the tolerance.

        Parameters
        ----------
        source : LawSource
            Source of the laws.
        entry : int
            Index of the ratio that varies.
        ratios : tuple of float
            As `Similarity.reduced` returns them; the entry that varies is not used.
        cell : float
            Number of the cell.
        octave : float
            Binary logarithm of the largest depth, as in `reach`.
        """
        width, edge = _cells(source, entry)
        low, high, reach = edge + (cell - 1.0) * width, edge + cell * width, float(np.exp2(octave))
        tolerance = source.solver.tolerance
        finer = replace(source, solver=source.solver.with_tolerance(_SPARE * tolerance), table=None)
        in_lengths = source.similarity.ratio_paths[entry] in source.similarity.lengths
        power = 1.0 / (source.similarity.exponent or 2.0)

        def logs(places: Sequence[float], shares: FloatArray) -> FloatArray:
            """ln(P/w^(1+1/p)), (places, n), at places in [-1, 1] in the cell and depths w as `shares` (n,).

            The shares are those of the largest depth.
            """
            numbers = [0.5 * (low + high + place * (high - low)) for place in places]
            values = [float(np.exp(number)) if _in_log(source, entry) else number for number in numbers]
            reduced = [(*ratios[:entry], value, *ratios[entry + 1 :]) for value in values]
            reaches = [reach * value if in_lengths else reach for value in values]
            finer.laws_of(reduced, reaches)
            asked = zip(reduced, reaches, strict=True)
            return np.array([_logs(finer.law(own, deep), deep * shares, power) for own, deep in asked])

        judged = _JUDGED_DEPTHS**power
        try:
            judge = logs(_JUDGED.tolist(), _JUDGED_DEPTHS)
            for values, terms in product(_VALUES, _TERMS):
                known = logs(_nodes(values).tolist(), (0.5 + 0.5 * _nodes(terms)) ** (1.0 / power))
                coefficients = _coefficients(_coefficients(known).T).T
                found = cls(low, high, reach, power, in_lengths, coefficients)
                off = found.logs(_JUDGED, np.tile(judged, (len(_JUDGED), 1))) - judge
                if np.abs(off).max() <= _SEEN * tolerance:
                    return found
        except InputError:
            return None
        return None

    def logs(self, place: FloatArray, root: FloatArray) -> FloatArray:
        """ln(P/w^(1+1/p)), (sets, n), at places in the cell (sets,) in [-1, 1] and (w/reach)^(1/p), (sets, n).

        P is the force at the depth w, p the exponent of the tip's shape.
        """
        # Not by a product of matrices: its last bit depends on how many sets there are.
        table = chebyshev.chebvander(place, len(self.coefficients) - 1)
        own = (table[:, :, None] * self.coefficients).sum(axis=1)
        z = 2.0 * root - 1.0
        return np.asarray(chebyshev.chebval(z, own.T[:, :, None], tensor=False))

    def force(self, number: FloatArray, depth: FloatArray) -> FloatArray:
        """Force (N), (sets, n), at values (sets,) of the number and depths (m) of the reference, (sets, n).

        The values are logarithms where the cell is one of logarithms.
        """
        place = 2.0 * (number - self.low) / (self.high - self.low) - 1.0
        reach = self.reach * np.exp(number)[:, None] if self.in_lengths else self.reach
        inside = np.where(depth > 0.0, depth, reach)
        # A square root costs a tenth of another power.
        root = inside**self.power
        force = np.exp(self.logs(place, root / reach**self.power)) * inside * root
        return np.where(depth > 0.0, force, 0.0)


def surfaces(
    source: LawSource, entry: int, ratios: tuple[float, ...], value: FloatArray, depth: FloatArray
) -> list[tuple[NDArray[np.intp], FloatArray, RatioSurface | None]]:
    """Assign sets to the surfaces that cover them, and compute missing surfaces.

    Parameters
    ----------
    source : LawSource
        Source of the laws.
    entry : int
        Index of the ratio that varies.
    ratios : tuple of float
        As `Similarity.reduced`; the entry that varies is not used.
    value : FloatArray
        Value of that ratio in each set, (sets,).
    depth : FloatArray
        Largest depth (m) of each set at the reference, (sets,), positive.

    Returns
    -------
    list of (ndarray of int, FloatArray, RatioSurface or None)
        Rows of the sets of one surface, their values as `RatioSurface.force` takes them, and the surface, None
        where there is none.
    """
    width, edge = _cells(source, entry)
    number = np.log(value) if _in_log(source, entry) else value
    in_lengths = source.similarity.ratio_paths[entry] in source.similarity.lengths
    scaled_depth = depth / value if in_lengths else depth
    keys = np.column_stack((np.ceil((number - edge) / width), np.ceil(np.log2(scaled_depth))))
    others = (*ratios[:entry], *ratios[entry + 1 :])
    kept = source.store.surfaces
    found = []
    for cell, octave in np.unique(keys, axis=0).tolist():
        rows = np.flatnonzero((keys == (cell, octave)).all(axis=1))
        key = (source.number, source.solver, entry, others, cell, octave)
        if key not in kept:
            kept[key] = RatioSurface.of(source, entry, ratios, cell, octave)
        surface = kept[key]
        found.append((rows, number[rows], surface if isinstance(surface, RatioSurface) else None))
    return found


def _in_log(source: LawSource, entry: int) -> bool:
    """Whether the ratio at index `entry` is interpolated in its logarithm: not a Poisson's ratio."""
    path = source.similarity.ratio_paths[entry]
    return path not in source.similarity.direct or kind_of(path) != "dimensionless"


def _cells(source: LawSource, entry: int) -> tuple[float, float]:
    """Width of the interpolation cells of the ratio at index `entry`, and one of their edges.

    Both are in the ratio or its logarithm, see `_in_log`.
    """
    return (_LOG_CELL, _LOG_EDGE) if _in_log(source, entry) else (_CELL, _EDGE)


def _nodes(count: int) -> FloatArray:
    return np.asarray(np.cos(np.pi * (np.arange(count) + 0.5) / count))


def _logs(law: ContactLaw, depth: FloatArray, power: float) -> FloatArray:
    return np.asarray(np.log(law.force(depth) / depth ** (1.0 + power)))


def _coefficients(values: FloatArray) -> FloatArray:
    """Chebyshev coefficients (n, m) of the columns of values (n, m) at the Chebyshev nodes."""
    count = len(values)
    vander = chebyshev.chebvander(_nodes(count), count - 1)
    vander[:, 0] *= 0.5
    return np.asarray((2.0 / count) * vander.T @ values)
