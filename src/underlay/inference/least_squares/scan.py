"""Starting points of a fit from the data alone: a grid over the nonlinear parameters, the linear ones solved for.

Thickness, modulus ratio and contact depth are laid on a coarse grid of scale-free values, within the bounds of the
problem; for each, the layer's modulus (which scales the force when the ratio is held), the baseline and its slope
follow by linear least squares. Where the modulus of the base, which is what the layer stands on, is known, each
thickness takes the ratio that agrees with the layer's modulus found there. The scene's own values are only one more
grid point, so a start wrong by orders of magnitude, or the last curve's result, does not decide where a fit ends.
Between the points of the grid residuals change so smoothly that they are interpolated by parabolas. Every local
minimum is a start, and so are places thinner and thicker than the best: thin and stiffly backed can look like thick
and stiff.

Layers that drain have a memory that is not linear in one elastic force: their model of time (`WholeHistory`)
estimates its numbers from the readings.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import NamedTuple, Self

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view

from underlay._arrays import FloatArray
from underlay.data.curve import Curve
from underlay.errors import RangeError
from underlay.inference.least_squares.adhesive import adhesive_starts
from underlay.inference.least_squares.models import misfit_of, with_values
from underlay.inference.least_squares.objective import log_share
from underlay.inference.least_squares.scan_curve import (
    BASE_MODULUS,
    CONTACT,
    MODULUS,
    THICKNESS,
    Blocks,
    GridFit,
    ScanCurve,
    blocked_forward,
)
from underlay.inference.model.coordinates import Coordinate
from underlay.inference.model.members import Member
from underlay.inference.problem import Problem
from underlay.mechanics.response import WholeHistory, checked_times
from underlay.scene.scene import Scene

# Contact radius over thickness: below the first the layer is a half-space, above the last a fit is hopeless.
_RADIUS_RATIOS = (0.06, 4.6)
# Thicknesses tried, as shares of the way from the thinnest to the thickest in the logarithm.
_SHARES = np.linspace(0.0, 1.0, 9)
# The scene's own thickness is not one more if it is this close to one tried, in the same shares.
_NEAR = 0.25 * _SHARES[1]
# Moduli of the base tried, over the layer's.
_MODULUS_RATIOS = np.array([0.02, 0.2, 1.5, 10.0, 100.0])
# Contact depths tried, from the first depth on, over the range of depth.
_CONTACT_STEPS = np.linspace(-0.2, 0.9, 8)
# Relative tolerance of the laws of a grid.
_SCAN_RTOL = 1e-2
# What a grid tries, and what scales out of its laws with that.
_TRIED = (MODULUS, BASE_MODULUS, THICKNESS)
_BETWEEN = 8  # steps from a thickness tried to the next
# Of the three points that a parabola goes through: each, and the two others.
_OWN = np.arange(3)
_NEXT, _LAST = np.roll(_OWN, -1), np.roll(_OWN, 1)
_BLOCKS = 16  # blocks of a curve: enough to tell a contact to a grid step
# Share of the largest depth of a law that the first contact tried may ask for: other thicknesses reach less deep.
_REACH = 0.9
# Share of the spread of all depths below which that of the readings beyond a contact is rounding.
_ROUNDED = 1e-9
# Readings this close to the deepest one, over the range of depths, count as a hold there.
_RESTS = 0.01
# Misfit over the best's from which a place is no start. A start's misfit is 1.2 to 5 times that of the optimum
# below it (medians), so that next to none would end lower; where noise decides all are alike, and stay.
_HOPELESS = 25.0
#: Misfit over the best's from which a start is not searched from where the best one explains the data: nothing
#: explains them better than down to their scatter.
LIKELY = 2.0
# ln of the ratio of thicknesses at which a rival is looked for, and below which two starts are one.
_RIVAL, _APART = np.log(2.7), np.log(1.6)


class Start(NamedTuple):
    """A point to search from: scaled vector (k,), and its misfit divided by that of the best start."""

    vector: FloatArray
    misfit: float


def tried_contacts(free: Mapping[str, Coordinate], blocks: Blocks, known: float) -> FloatArray:
    """Contact depths (m) to try, (c,), ascending; `known` (m) alone where the contact depth is not free.

    `free` are the free parameters by path, `blocks` the curve.
    """
    if CONTACT not in free:
        return np.array([known])
    coordinate = free[CONTACT]
    grid = blocks.depth[0] + _CONTACT_STEPS * blocks.span
    low, high = coordinate.low, coordinate.high
    if high - low < grid[-1] - grid[0]:
        grid = np.linspace(low, high, len(grid))
    inside = grid[(grid >= low) & (grid <= high)]
    # Bounds beside the curve leave none: then the scene's own value is all there is to try.
    return inside if len(inside) > 1 else np.array([coordinate.reference])


def tried_thicknesses(free: Mapping[str, Coordinate], radii: tuple[float, float]) -> FloatArray:
    """Thicknesses (m) to try, ascending; empty where the thickness is not free.

    Parameters
    ----------
    free : mapping of path to Coordinate
        The free parameters.
    radii : (float, float)
        Smallest and largest contact radius (m) of the curves, as on a half-space.
    """
    if THICKNESS not in free:
        return np.zeros(0)
    coordinate = free[THICKNESS]
    lowest, highest = radii[0] / _RADIUS_RATIOS[1], radii[1] / _RADIUS_RATIOS[0]
    low, high = coordinate.low, coordinate.high
    narrow = low > 0.0 and np.isfinite(high) and high / low < highest / lowest
    first, last = (low, high) if narrow else (lowest, highest)
    grid = first * (last / first) ** _SHARES
    inside = grid[(grid >= low) & (grid <= high)]
    # The scene's own value is added, but not next to one of these, nor where a fit is hopeless: the law of so thin
    # a layer takes long to compute.
    own = coordinate.reference
    near = np.abs(np.log(inside / own)).min(initial=np.inf) < _NEAR * np.log(last / first)
    return _with(inside, own) if not inside.size or (own >= lowest and not near) else inside


def tried_base_moduli(free: Mapping[str, Coordinate], base: Mapping[str, float]) -> FloatArray:
    """Moduli (Pa) of the base to try under a layer of the scene's modulus, ascending.

    Empty where neither modulus is free, or there is no elastic base. `free` are the free parameters and `base` all
    numbers of the scene (SI), by path.
    """
    if BASE_MODULUS not in base or not {MODULUS, BASE_MODULUS} & free.keys():
        return np.zeros(0)
    (softest, hardest), (lowest, highest) = (
        (free[path].low, free[path].high) if path in free else (base[path], base[path])
        for path in (MODULUS, BASE_MODULUS)
    )
    # No ratio but those that the bounds leave.
    low, high = lowest / hardest, highest / softest if softest > 0.0 else np.inf
    # numpy.clip takes three times as long on so few.
    ratios, own = np.minimum(np.maximum(_MODULUS_RATIOS, low), high), base[BASE_MODULUS] / base[MODULUS]
    # The scene's own is one more where the others do not reach.
    beyond = not ratios[0] <= own <= ratios[-1]
    return base[MODULUS] * (_with(ratios, own) if beyond else _with(ratios))


def _with(values: FloatArray, *own: float) -> FloatArray:
    """The values (n,) and `own` in ascending order, each once: numpy.unique takes ten times as long on so few."""
    return np.array(sorted({*values.tolist(), *own}))


@dataclass(frozen=True)
class _Grid:
    """Fit of one curve at every thickness and modulus ratio of the grid.

    Parameters
    ----------
    misfit : FloatArray
        Sum of squared residuals (N^2), (thicknesses, moduli).
    values : dict of path to FloatArray
        Best parameter values (SI), (thicknesses, moduli).
    residuals : FloatArray
        Residuals (N) of the curve's m blocks, (thicknesses, moduli, m).
    """

    misfit: FloatArray
    values: dict[str, FloatArray]
    residuals: FloatArray

    def best_along(self, axis: int) -> _Grid:
        """The grid with the best entry along one axis (0 thicknesses, 1 moduli), which then has length one."""
        which = np.argmin(self.misfit, axis=axis)
        others = np.arange(len(which))
        best = (which[None], others[None]) if axis == 0 else (others[:, None], which[:, None])
        values = {path: value[best] for path, value in self.values.items()}
        return replace(self, misfit=self.misfit[best], values=values, residuals=self.residuals[best])

    def between(self, weights: FloatArray) -> _Grid:
        """The grid at other thicknesses, interpolated by weights (others, thicknesses)."""
        count = len(self.residuals)
        residuals = (weights @ self.residuals.reshape(count, -1)).reshape(-1, *self.residuals.shape[1:])
        values = {
            # A contact may be negative; moduli and thickness go along with powers of each other.
            path: weights @ value if path == CONTACT else np.exp(weights @ np.log(value))
            for path, value in self.values.items()
        }
        return _Grid(np.einsum("tkm,tkm->tk", residuals, residuals), values, residuals)


def scan(problem: Problem, count: int = 3) -> list[Start]:
    """Starting points of a fit: local minima of the misfit over a grid, best first.

    Thickness and moduli that curves share are scanned together; what is a curve's own is chosen by it alone. For
    adhesive contacts the pull-off is used instead: see `adhesive_starts`.

    Parameters
    ----------
    problem : Problem
        What will be fitted.
    count : int
        Largest number of local minima; starts thinner and thicker than the best come on top.

    Returns
    -------
    list of Start
        Empty if no grid point has a law.
    """
    if problem.adheres:
        return [Start(vector, 1.0) for vector in adhesive_starts(problem, count)]
    if any(isinstance(member.forward.history, WholeHistory) for member in problem.members):
        return memory_starts(problem, count)
    landscape = Landscape.of(problem)
    places = landscape.minima(count)
    misfits = [float(landscape.misfit[place]) for place in places]
    return [
        Start(landscape.vector(place), misfit / misfits[0] if misfits[0] > 0.0 else 1.0)
        for place, misfit in zip(places, misfits, strict=True)
    ]


def memory_starts(problem: Problem, count: int) -> list[Start]:
    """At most `count` starts, best first, from values that each sample's memory estimates from its curve.

    Each start takes such values for one curve (`history.starts`) and the first of them for the others; a curve
    whose memory gives none keeps the values of its scene.
    """
    read_off = [_read_off(member, problem) for member in problem.members]
    own = problem.start
    for member, values in zip(problem.members, read_off, strict=True):
        own = with_values(problem, member, values[0], own) if values else own
    vectors = [
        with_values(problem, member, each, own)
        for member, values in zip(problem.members, read_off, strict=True)
        for each in values
    ] or [own]
    ranked = sorted(
        ((misfit_of(problem, vector), tuple(vector)) for vector in vectors), key=lambda one: one[0]
    )
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


@dataclass(frozen=True)
class Landscape:
    """Misfit of all curves of a problem over the grid of thicknesses and modulus ratios.

    Parameters
    ----------
    problem : Problem
        The problem.
    curves : tuple of ScanCurve
        Each curve in blocks.
    grids : tuple of _Grid
        Fit of each curve over the grid.
    steps : int
        Rows from one thickness of the coarse grid to the next, interpolated ones between.
    """

    problem: Problem
    curves: tuple[ScanCurve, ...]
    grids: tuple[_Grid, ...]
    steps: int = 1

    @classmethod
    def of(cls, problem: Problem) -> Self:
        """Scan the curves of a problem without adhesion."""
        curves = tuple(_scanned(member, problem) for member in problem.members)
        radii = [
            _radius_scale(m.scene, curve.blocks) for m, curve in zip(problem.members, curves, strict=True)
        ]
        grids = tuple(
            _grid_of(member, curve, problem, (min(radii), max(radii)))
            for member, curve in zip(problem.members, curves, strict=True)
        )
        if len(grids[0].misfit) > 2 and all(np.isfinite(grid.misfit).all() for grid in grids):
            weights = _parabolas(np.log(grids[0].values[THICKNESS][:, 0]))
            return cls(problem, curves, tuple(grid.between(weights) for grid in grids), _BETWEEN)
        return cls(problem, curves, grids)

    @cached_property
    def misfit(self) -> FloatArray:
        """Sum of squared residuals (N^2) of all curves, (thicknesses, moduli); inf where there is no law."""
        first, *others = (grid.misfit for grid in self.grids)
        return sum(others, first)

    def minima(self, count: int) -> list[tuple[int, int]]:
        """Up to `count` local minima, best first, then places thinner and thicker than the best, as grid indices.

        Places whose misfit is more than 25 times the best are left out.
        """
        total = self.misfit
        minima = np.isfinite(total)
        minima[1:] &= total[1:] <= total[:-1]
        minima[:-1] &= total[:-1] <= total[1:]
        if total.shape[1] > 1:
            # A valley that crosses the ratios aslant is at its lowest once in each: between the thicknesses of the
            # grid as many rows away as its neighbour there may be.
            away = self.steps - 1
            around = np.full((len(total) + 2 * away, total.shape[1]), np.inf)
            around[away : away + len(total)] = total
            near = sliding_window_view(around, 2 * away + 1, axis=0).min(axis=2)
            minima[:, 1:] &= total[:, 1:] <= near[:, :-1]
            minima[:, :-1] &= total[:, :-1] <= near[:, 1:]
        # The thin end of the grid is a minimum only if it is the lowest: else the curve is only falling there.
        if len(total) > 1:
            minima[0] &= total[0] == total.min()
        rows, columns = np.nonzero(minima)
        order = np.argsort(total[rows, columns], kind="stable")[:count]
        chosen = list(zip(rows[order].tolist(), columns[order].tolist(), strict=True))
        # With the base's modulus free the thin and the thick minimum are joined by one valley.
        one_base = not any(BASE_MODULUS in member.entries for member in self.problem.members)
        if one_base and THICKNESS in self.grids[0].values:
            chosen += _rivals(total, np.log(self.grids[0].values[THICKNESS].max(axis=1)), chosen)
        return [place for place in chosen if total[place] <= _HOPELESS * total[chosen[0]]]

    def vector(self, place: tuple[int, int]) -> FloatArray:
        """Scaled vector (k,) of a place, given by its indices (thickness, modulus).

        Of the values that each curve found there a shared parameter takes the mean.
        """
        coordinates = self.problem.coordinates
        found: list[list[float]] = [[] for _ in coordinates]
        for member, curve, grid in zip(self.problem.members, self.curves, self.grids, strict=True):
            values = {path: float(value[place]) for path, value in grid.values.items()}
            values |= curve.linear({**member.base, **values})
            for path, entry in member.entries.items():
                if path in values:
                    coordinate = coordinates[entry]
                    value = min(max(values[path], coordinate.low), coordinate.high)
                    if value > 0.0 or coordinate.scale is not None:
                        found[entry].append(coordinate.scaled(value))
        return np.array([sum(values) / len(values) if values else 0.0 for values in found])


def _rivals(
    total: FloatArray, log_thickness: FloatArray, chosen: Sequence[tuple[int, int]]
) -> list[tuple[int, int]]:
    """Grid indices a factor of 2.7 thinner and thicker than the best place, where none is chosen yet.

    A second minimum may be as narrow as the noise and lie between the points of the grid: then no local minimum of
    the grid shows it. Second minima were found 2.5 to 3 times thinner or thicker than the best.

    Parameters
    ----------
    total : FloatArray
        Misfit of all curves, (thicknesses, moduli).
    log_thickness : FloatArray
        ln of each thickness, (thicknesses,).
    chosen : sequence of (int, int)
        Places chosen so far, best first.
    """
    added: list[tuple[int, int]] = []
    for aim in (log_thickness[chosen[0][0]] + side * _RIVAL for side in (-1.0, 1.0)) if chosen else ():
        near = int(np.argmin(np.abs(log_thickness - aim)))
        known = [log_thickness[i] for i, _ in (*chosen, *added)]
        if np.abs(log_thickness[near] - known).min() > _APART and np.isfinite(total[near]).any():
            added.append((near, int(np.argmin(total[near]))))
    return added


def _scanned(member: Member, problem: Problem) -> ScanCurve:
    blocks = Blocks.of(_way_in(member), _BLOCKS)
    free = {path: problem.coordinates[entry] for path, entry in member.entries.items()}
    # What the grid does not try stays where it is: laws that would vary with it are those of a table here.
    tried = [path for path in free if path in _TRIED]
    forward = blocked_forward(member.by_power_law or member.forward, blocks, _SCAN_RTOL, tried)
    scales = MODULUS in free and (BASE_MODULUS not in member.base or BASE_MODULUS in free)
    scene = member.scene
    # On such a tip the force rises in a straight line from contact on.
    is_straight = (
        scene.indenter.has_edge and scene.layer.stiffening is None and member.forward.history is None
    )
    kink = kink_of(member.curve, free[CONTACT]) if CONTACT in free and is_straight else None
    contacts = tried_contacts(free, blocks, member.base[CONTACT]) if kink is None else np.array([kink])
    if len(contacts) > 1:
        first = _first_within_reach(member, float(contacts[0]))
        last = min(float(blocks.depth[-1]), free[CONTACT].high)
        if contacts[0] < first < last:
            contacts = np.linspace(first, last, len(contacts) + 1)[:-1]
    return ScanCurve(forward, blocks, free, contacts, scales)


def _first_within_reach(member: Member, contact: float) -> float:
    """The contact depth (m), or the first after it from which the tip is large enough for the deepest reading.

    A ball that travels through air by ten of its radii has no law from most contacts on.
    """
    deepest = float(member.curve.depth.max())
    if not (np.isfinite(member.scene.indenter.max_radius) and deepest > contact):
        return contact
    try:
        member.forward.bare_law(member.base, deepest - contact)
    except RangeError as error:
        return contact if error.max_depth is None else deepest - _REACH * error.max_depth
    return contact


def kink_of(curve: Curve, contact: Coordinate) -> float | None:
    """Depth (m), within the bounds of the contact depth, from which on a straight line that rises fits best.

    Such is the force on a tip with an edge, and the best of all readings is its optimum. Contacts before the first
    reading all explain it equally badly, and no search leaves them: where the way to contact is short, they are the
    best of contacts a seventh of the curve apart. None where no reading lies within the bounds.
    """
    order = np.argsort(curve.depth, kind="stable")
    depth, force = curve.depth[order], curve.force[order]
    d, f = depth - depth.mean(), force - force.mean()
    count, sum_d, sum_f, sum_dd, sum_df = (
        np.cumsum(own[::-1])[::-1] for own in (np.ones_like(d), d, f, d * d, d * f)
    )
    # Sums of x = max(d - d_j, 0) over all readings, for the contact at each reading j.
    x, xx, xf = sum_d - count * d, sum_dd - d * (2.0 * sum_d - count * d), sum_df - d * sum_f
    spread = xx - x * x / len(d)
    possible = (spread > _ROUNDED * spread[0]) & (xf > 0.0) & (depth >= contact.low) & (depth <= contact.high)
    if not possible.any():
        return None
    explained = np.where(possible, xf * xf / np.where(possible, spread, 1.0), 0.0)
    return float(depth[int(np.argmax(explained))])


def _way_in(member: Member) -> Curve:
    """The readings that the grid is fitted to: of a sample with memory, those up to its deepest one.

    The laws of the grid do not depend on time. To them a force that relaxes at one depth is a noise at the deepest
    readings, and what explains it best is a layer as thin as possible.
    """
    curve = member.curve
    if member.forward.history is None:
        return curve
    deep = curve.depth >= curve.depth.max() - _RESTS * np.ptp(curve.depth)
    count = int(np.argmax(deep)) + 1
    return curve.select(np.arange(len(curve)) < count) if count > 2 else curve


def _grid_of(member: Member, curve: ScanCurve, problem: Problem, radii: tuple[float, float]) -> _Grid:
    """Fit of one curve at every place of the grid; `radii` as in `tried_thicknesses`.

    Axes of parameters that curves do not share are reduced to the curve's best value.
    """
    alone = len(problem.members) == 1
    thicknesses = tried_thicknesses(curve.free, radii)
    moduli_are_shared = alone or not {MODULUS, BASE_MODULUS}.isdisjoint(problem.shared)
    # A grid that curves share is laid about the values of the first of them.
    bases = tried_base_moduli(curve.free, problem.members[0].base if moduli_are_shared else member.base)
    base_is_known = bases.size > 0 and BASE_MODULUS not in curve.free
    asked = replace(curve, scales=True) if base_is_known else curve
    shape = (max(bases.size, 1), max(thicknesses.size, 1))
    fits = _fits(asked, member, thicknesses, bases)
    misfit, contact, amplitude = (
        part.reshape(shape).T for part in (fits.misfit, fits.contact, fits.amplitude)
    )
    values = {CONTACT: contact}
    if asked.scales:
        values[MODULUS] = amplitude * member.base[MODULUS]
    if bases.size and not base_is_known:
        values[BASE_MODULUS] = amplitude * bases
    if thicknesses.size:
        values[THICKNESS] = np.repeat(thicknesses[:, None], shape[0], axis=1)
    grid = _Grid(misfit, values, fits.residuals.reshape(*shape, -1).swapaxes(0, 1))
    if base_is_known:
        log_ratios = np.log(bases / member.base[MODULUS])
        grid = _consistent(grid, log_ratios, np.log(bases / member.base[BASE_MODULUS]) + np.log(amplitude))
    if not (alone or THICKNESS in problem.shared):
        grid = grid.best_along(0)
    return grid if moduli_are_shared else grid.best_along(1)


def _parabolas(x: FloatArray) -> FloatArray:
    """Weights (p, t) that interpolate values at x (t,) to p places, by parabolas through the nearest three."""
    count = _BETWEEN * (len(x) - 1) + 1
    row = np.arange(count)
    steps = row / _BETWEEN
    at = np.interp(steps, row[: len(x)], x)
    first = np.minimum(np.maximum(np.rint(steps).astype(np.intp) - 1, 0), len(x) - 3)
    which = first[:, None] + _OWN
    nodes = x[which]
    off, one, other = at[:, None] - nodes, nodes[:, _NEXT], nodes[:, _LAST]
    weights = np.zeros((count, len(x)))
    weights[row[:, None], which] = off[:, _NEXT] * off[:, _LAST] / ((nodes - one) * (nodes - other))
    return weights


def _fits(curve: ScanCurve, member: Member, thicknesses: FloatArray, bases: FloatArray) -> GridFit:
    """Fit of the curve at every thickness on the first base, then on the second, and so on.

    `thicknesses` are in m and `bases` are moduli (Pa) of the base; either may be empty.
    """
    rows: dict[str, float | FloatArray] = dict(member.base)
    if thicknesses.size:
        rows[THICKNESS] = np.tile(thicknesses, max(bases.size, 1))
    if bases.size:
        rows[BASE_MODULUS] = np.repeat(bases, max(thicknesses.size, 1))
    laws = curve.laws(rows)
    found = curve.best_contact(rows, laws)
    return curve.refined(rows, laws, found) if len(curve.contacts) > 1 else found


def _consistent(grid: _Grid, log_ratios: FloatArray, beyond: FloatArray) -> _Grid:
    """Fit at each thickness with the base's known modulus, interpolated between the ratios tried.

    Parameters
    ----------
    grid : _Grid
        Fit at ratios of the base's modulus to the layer's, the layer's modulus free.
    log_ratios : FloatArray
        ln of those ratios, (moduli,).
    beyond : FloatArray
        ln of the base's modulus that the ratio and the fitted layer give, over the known one, (thicknesses,
        moduli).
    """
    usable = np.isfinite(grid.misfit)
    below, above = beyond[:, :-1], beyond[:, 1:]
    crosses = usable[:, :-1] & usable[:, 1:] & (below <= 0.0) & (above > 0.0)
    straight = np.where(crosses, -below / np.where(crosses, above - below, 1.0), 0.0)
    # Between the ratios tried all values are linear in u = -ln(1 + 1/k), k the ratio (see `log_share`).
    crossing = log_ratios[:-1] + straight * np.diff(log_ratios)
    start, at, end = (log_share(crossing + past) for past in (below, 0.0, above))
    share = np.where(crosses, (at - start) / np.where(crosses, end - start, 1.0), 0.0)

    def between(values: FloatArray) -> FloatArray:
        """Values at the crossings of the known modulus, then at the ratios tried."""
        inside = (1.0 - share) * values[:, :-1] + share * values[:, 1:]
        return np.concatenate((inside, values), axis=1)

    # Residuals go straight from ratio to ratio; their squares, large on both sides, may nearly vanish between.
    part, own = share[:, :, None], grid.residuals
    residuals = np.concatenate(((1.0 - part) * own[:, :-1] + part * own[:, 1:], own), axis=1)
    misfit = np.einsum("tkm,tkm->tk", residuals, residuals)
    # A base stiffer or softer than all that were tried is as good as rigid, or absent: the last ratio gives the
    # layer's modulus.
    nearest = np.where(usable, np.abs(beyond), np.inf).argmin(axis=1)
    alone = ~np.any(crosses, axis=1, keepdims=True)
    ends = (np.arange(beyond.shape[1]) == nearest[:, None]) & usable & alone
    misfit = np.where(np.concatenate((crosses, ends), axis=1), misfit, np.inf)
    values = {path: between(value) for path, value in grid.values.items()}
    values[MODULUS] = np.exp(between(np.log(grid.values[MODULUS])))
    return _Grid(misfit, values, residuals).best_along(1)


def _radius_scale(scene: Scene, blocks: Blocks) -> float:
    """Contact radius (m) on a half-space when the tip is pressed by the curve's whole range of depth."""
    travel = np.array([blocks.span])
    limit = scene.indenter.max_radius
    if np.isfinite(limit) and not scene.indenter.has_edge:
        travel = np.minimum(travel, scene.indenter.abel(np.array([limit])))
    return float(scene.indenter.halfspace_radius(travel)[0])
