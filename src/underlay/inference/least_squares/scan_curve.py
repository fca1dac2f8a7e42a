"""One curve in blocks of neighbouring readings, and its misfit at the points of the grid of `scan`.

A start is found with blocks, and searched from with them: a step on blocks costs a fraction of what it costs on all
readings, and their averages lose little of the information. On a grid every contact depth is tried at once, linear
parameters solved for, and the contact laws of all rows are computed together.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import groupby
from typing import Any, NamedTuple, Self, TypeAlias

import numpy as np
from numpy.typing import NDArray

from underlay._arrays import FloatArray
from underlay.data.curve import Curve
from underlay.errors import InputError, RangeError
from underlay.inference.least_squares.models import FrozenNoise
from underlay.inference.least_squares.objective import Objective
from underlay.inference.model.coordinates import Coordinate
from underlay.inference.model.forward import Forward, TipOverPowerLaw
from underlay.inference.model.forward_batch import can_batch_jacobians
from underlay.inference.model.laws import LawStore
from underlay.inference.problem import Problem
from underlay.mechanics.contact_law import ContactLaw
from underlay.scene.noise import Noise

# Relative tolerance of the laws at blocks, and number of blocks of a curve that starts are searched from with.
_RTOL = 1e-3
_BLOCKS = 32
# Blocks from the middle of the parabola of `Blocks.straightened` to its ends.
_AWAY = 3
#: Every number of a scene by path: one for all rows of a grid, or one each, (r,).
Rows: TypeAlias = Mapping[str, float | FloatArray]
#: Paths of the parameters that a grid tries.
MODULUS, BASE_MODULUS, THICKNESS = "layer.E", "substrate.E", "layer.thickness"
CONTACT = "instrument.contact_depth"
# Contacts tried again about the lowest point of a parabola, in `_NEAR` of a step between contacts: three beside
# each other.
_NEAR, _OFFSETS = 0.3, np.array([-1.0, 0.0, 1.0])
# Paths of the parameters in which a reading is linear.
_LINEAR = ("instrument.baseline", "instrument.baseline_slope")


@dataclass(frozen=True)
class Blocks:
    """A curve with neighbouring readings combined into m blocks.

    Parameters
    ----------
    depth, force : FloatArray
        Depth (m) and force (N) of the blocks, (m,).
    variance : FloatArray, optional
        Variance (m^2) of the depths within each block, (m,), where blocks are averages.
    """

    depth: FloatArray
    force: FloatArray
    variance: FloatArray | None = None

    @property
    def span(self) -> float:
        """Range of depth (m), from the first block to the last."""
        return float(self.depth[-1] - self.depth[0])

    @classmethod
    def of(cls, curve: Curve, count: int, *, averages: bool = False) -> Blocks:
        """Combine neighbouring depths into `count` blocks: medians, so that no outlier decides, or averages."""
        order = np.argsort(curve.depth, kind="stable")
        count = min(count, len(order))
        size, longer = divmod(len(order), count)
        end = longer * (size + 1)

        def in_blocks(values: FloatArray, middle: Callable[[FloatArray], FloatArray]) -> FloatArray:
            """Reduce sorted values (n,) to one number per block by `middle`.

            The first blocks have one point more where n is no multiple of the number of blocks.
            """
            first, others = values[:end].reshape(longer, size + 1), values[end:].reshape(-1, size)
            return np.concatenate((middle(first), middle(others)))

        depth, force = curve.depth[order], curve.force[order]
        if not averages:
            return cls(in_blocks(depth, _middles), in_blocks(force, _medians))
        mean = in_blocks(depth, _means)
        return cls(mean, in_blocks(force, _means), in_blocks(depth * depth, _means) - mean * mean)

    def straightened(self) -> Blocks:
        """The blocks without what curvature adds to an average: f(mean w) = mean f - f'' var(w)/2.

        w is the depth and f the force. f'' is that of the parabola through a block and two some blocks away:
        through its neighbours it would bring a tenth of a block's scatter along.
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
    """Residuals over block averages of the curves; the noise is the scatter of the readings about a smooth curve.

    Parameters
    ----------
    problem : Problem
        What is fitted.
    robust : bool
        Whether blocks are medians; else they are averages, whose optimum is nearly that of all readings.
    forwards : sequence of Forward, optional
        Models to use in place of those of the curves.
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
    """`blocked_objective` with spheres replaced by paraboloids, whose laws are cheaper; None where that is no gain.

    None too where the tip's size is free or the curves cannot be computed in batches.
    """
    forwards = [
        forward
        for member in problem.members
        if member.forward.left_out is None
        and (forward := member.by_power_law) is not None
        and not any(path.startswith("indenter.") for path in member.entries)
        and can_batch_jacobians(forward, member.base, tuple(member.entries))
    ]
    if len(forwards) < len(problem.members):
        return None
    return blocked_objective(problem, robust=robust, forwards=forwards)


def blocked_forward(
    forward: Forward, blocks: Blocks, rtol: float, tried: Sequence[str] | None = None
) -> Forward:
    """Model of a curve at the depths of its blocks, with less accurate laws kept separately.

    Parameters
    ----------
    forward : Forward
        Model of the whole curve.
    blocks : Blocks
        The curve in blocks.
    rtol : float
        Relative tolerance of the laws.
    tried : sequence of str, optional
        Paths of the parameters that a grid tries: laws are then far apart, and nothing else varies in them.
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
    """Medians (rows,) of rows (rows, n) whose values are in order."""
    middle = ordered.shape[1] // 2
    return ordered[:, middle] if ordered.shape[1] % 2 else 0.5 * (ordered[:, middle - 1] + ordered[:, middle])


@dataclass(frozen=True)
class LawRows:
    """Contact laws of the r rows of a grid: neighbouring rows of equal ratios share one.

    Parameters
    ----------
    b, c : FloatArray
        Factors of similarity in P(w) = c P_ref(b w), with P the force and w the depth, each (r, 1, 1).
    possible : ndarray of bool (r,)
        Which rows have a law.
    shared : list of (slice, law)
        The rows that one law serves, in order.
    over : TipOverPowerLaw, optional
        The tip, where the laws are those of its power law.
    batch : callable, optional
        Used in place of `shared` where every law serves rows of the same b: forces (N), (laws, n), of all laws at
        depths (m), (laws, n) or (1, n) for all.
    places : int
        Rows that each of these laws serves.
    """

    b: FloatArray
    c: FloatArray
    possible: NDArray[np.bool_]
    shared: list[tuple[slice, ContactLaw]]
    over: TipOverPowerLaw | None = None
    batch: Callable[[FloatArray], FloatArray] | None = None
    places: int = 0

    @classmethod
    def of(cls, forward: Forward, rows: Rows, deepest: float) -> Self:
        """Find or build the laws of a model at the numbers `rows`, for tip depths up to `deepest` (m)."""
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
            batch = forward.laws.side_by_side([key for key, _ in rows_of], float(depths.max()))
            if batch is not None:
                return cls(*scales, possible, shared, forward.over, batch, places)
        end = 0
        starts = np.cumsum([0, *(len(group) for _, group in rows_of[:-1])])
        deepest_of = np.maximum.reduceat(depths, starts).tolist()
        forward.laws.laws_of([key for key, _ in rows_of], deepest_of)
        for key, group in rows_of:
            part = slice(end, end := end + len(group))
            law, possible[part] = _reaching(forward, key, depths[part])
            if law is not None:
                shared.append((part, law))
        return cls(*scales, possible, shared, forward.over)

    def force(self, depth: FloatArray) -> FloatArray:
        """Force (N), (r, c, n), of every row at tip depths (m); zero where there is no law.

        The depths have the same shape, or (1, c, n) if they are those of all rows.
        """
        if self.over is None:
            return self._asked(depth) * self.c
        asked, ratio = self.over.seen(depth)
        return self._asked(asked) * (ratio * self.c)

    def _asked(self, depth: FloatArray) -> FloatArray:
        if self.batch is not None:
            alike = len(depth) == 1  # then the rows of every law ask for the same depths
            w = (self.b[: self.places] if alike else self.b) * depth
            laws = 1 if alike else len(self.b) // self.places
            return self.batch(w.reshape(laws, -1)).reshape(len(self.b), *w.shape[1:])
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
    """Law that reaches as many of the depths (m), (r,), as any can, and a mask (r,) of those it reaches.

    `ratios` identify the law, as `Similarity.reduced` returns them. None where no law reaches any.
    """
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


class GridFit(NamedTuple):
    """Fit of one curve at the r rows of a grid.

    Parameters
    ----------
    misfit : FloatArray
        Sum of squared residuals (N^2), (r,); infinite where no law reaches.
    contact : FloatArray
        Best contact depth (m), (r,).
    amplitude : FloatArray
        Best factor on the moduli at that contact depth, (r,).
    lowest : FloatArray
        Contact depth (m) where the parabola through the misfits of the best and its neighbours is lowest, (r,).
    residuals : FloatArray
        Residuals of the blocks (N), (r, m).
    """

    misfit: FloatArray
    contact: FloatArray
    amplitude: FloatArray
    lowest: FloatArray
    residuals: FloatArray

    def better(self, other: GridFit) -> GridFit:
        """Take from each row the fit, this or the other, of the smaller misfit."""
        lower = other.misfit < self.misfit

        def chosen(ours: FloatArray, theirs: FloatArray) -> FloatArray:
            return np.where(lower if ours.ndim == 1 else lower[:, None], theirs, ours)

        return GridFit(*map(chosen, self, other))


class _Tried(NamedTuple):
    """Fits of c contact depths at each of r rows: multiples of computed forces to the m measured ones.

    Parameters
    ----------
    target : FloatArray
        Measured forces (N) less what the baseline explains, (m,).
    shapes : FloatArray
        Computed forces (N), less the same, (r, c, m).
    amplitude : FloatArray
        Best factor on them, (r, c).
    misfit : FloatArray
        Sum of squared residuals (N^2), (r, c); infinite where there is no law.
    """

    target: FloatArray
    shapes: FloatArray
    amplitude: FloatArray
    misfit: FloatArray


@dataclass(frozen=True)
class ScanCurve:
    """A curve in blocks, to be fitted at the rows of a grid.

    Parameters
    ----------
    forward : Forward
        Compiled for the depths of `blocks`.
    blocks : Blocks
        The curve.
    free : mapping of path to Coordinate
        Its free parameters.
    contacts : FloatArray
        Contact depths to try (m), (c,), in even steps; one where the contact is known.
    scales : bool
        Whether the layer's modulus is free and scales the force: alone, or with the base's at a fixed ratio.
    """

    forward: Forward
    blocks: Blocks
    free: Mapping[str, Coordinate]
    contacts: FloatArray
    scales: bool

    def laws(self, rows: Rows) -> LawRows:
        """Contact laws at the numbers `rows`, deep enough for every contact depth tried."""
        return LawRows.of(self.forward, rows, float(self._travel(rows).max() - self.contacts[0]))

    def best_contact(self, rows: Rows, laws: LawRows) -> GridFit:
        """Fit of every row of numbers, with their `laws`, at the best of the contact depths tried."""
        tried = self._tried(rows, laws, self.contacts[None])
        best = np.argmin(tried.misfit, axis=1)
        chosen = np.arange(len(best)), best
        contact = self.contacts[best]
        lowest = contact.copy()
        inside = np.flatnonzero((best > 0) & (best < len(self.contacts) - 1))
        if inside.size:
            adjacent = (tried.misfit[inside, best[inside] + i] for i in (-1, 0, 1))
            lowest[inside] += self._step * _steps_to_lowest(*adjacent)
        amplitude, misfit = tried.amplitude[chosen], tried.misfit[chosen]
        residuals = tried.target - amplitude[:, None] * tried.shapes[chosen]
        return GridFit(misfit, contact, amplitude, lowest, residuals)

    def refined(self, rows: Rows, laws: LawRows, found: GridFit) -> GridFit:
        """Fit every row of numbers at three contact depths about the best one found, and keep the better fit.

        The three lie about the lowest point of the parabola through the misfits. Between contacts so close together
        the residuals themselves are interpolated by parabolas.
        """
        step = _NEAR * self._step
        # No earlier than the first: the laws reach no deeper.
        lowest = np.maximum(found.lowest, self.contacts[0] + step)
        tried = self._tried(rows, laws, lowest[:, None] + step * _OFFSETS)
        share = np.minimum(np.maximum(_steps_to_lowest(*tried.misfit.T), -1.0), 1.0)
        parts = np.empty((len(share), 3))
        parts[:, 1] = 1.0 - share * share
        parts[:, 0] = 0.5 * (share * share - share)
        parts[:, 2] = parts[:, 0] + share
        weights = (parts * tried.amplitude)[:, None, :]
        # The target whole: the parts sum to one.
        residuals = tried.target - (weights @ tried.shapes)[:, 0]
        misfit = np.einsum("rm,rm->r", residuals, residuals)
        if not laws.possible.all():
            misfit[~laws.possible] = np.inf
        contact, amplitude = lowest + step * share, weights[:, 0].sum(axis=1)
        return found.better(GridFit(misfit, contact, amplitude, contact, residuals))

    @property
    def _step(self) -> float:
        """Distance (m) between the contact depths tried."""
        return float(self.contacts[1] - self.contacts[0])

    def _tried(self, rows: Rows, laws: LawRows, contacts: FloatArray) -> _Tried:
        """Fit every row of numbers, with their `laws`, at given contact depths (m), (r, c) or (1, c)."""
        forces = laws.force(self._travel(rows) - contacts[:, :, None])
        basis = self._linear_basis
        target = _project_out(self.blocks.force - self._fixed_offset(rows), basis)
        shapes = _project_out(forces, basis)
        power, along = np.einsum("rcm,rcm->rc", shapes, shapes), shapes @ target
        amplitude = self._amplitudes(rows, power, along)
        # From products: what these lose in digits is far below the error of so coarse a law.
        misfit = float(target @ target) - amplitude * (2.0 * along - amplitude * power)
        if not laws.possible.all():
            misfit[~laws.possible] = np.inf
        return _Tried(target, shapes, amplitude, misfit)

    def linear(self, values: Mapping[str, float]) -> dict[str, float]:
        """Least-squares baseline (N) and its slope (N/m) by path, only those that are free.

        `values` are all numbers of the scene (SI) by path.
        """
        columns = self._linear_columns
        if columns is None:
            return {}
        travel = self._travel(values) - values[CONTACT]
        laws = LawRows.of(self.forward, values, float(travel.max()))
        rest = self.blocks.force - self._fixed_offset(values) - laws.force(travel[None, None])[0, 0]
        solved = np.linalg.lstsq(columns, rest, rcond=None)[0]
        return dict(zip((path for path in _LINEAR if path in self.free), solved.tolist(), strict=True))

    def _amplitudes(self, rows: Rows, power: FloatArray, along: FloatArray) -> FloatArray:
        """Least-squares factor (r, c) on the layer's modulus, within its bounds; one where the modulus is fixed.

        `power` are the sums of squares of the computed forces and `along` their products with the measured ones,
        (r, c).
        """
        if not self.scales:
            return np.ones(power.shape)
        # A contact beyond the last point gives no force at all: it explains nothing.
        felt = power > 0.0
        amplitude = along / power if felt.all() else np.where(felt, along / np.where(felt, power, 1.0), 0.0)
        start = np.reshape(rows[MODULUS], (-1, 1))
        coordinate = self.free[MODULUS]
        lowest = max(coordinate.low, 1e-12 * float(start.min()))
        # numpy.clip takes three times as long on so few.
        return np.asarray(np.minimum(np.maximum(amplitude, lowest / start), coordinate.high / start))

    def _travel(self, rows: Rows) -> FloatArray:
        """Depth (m), (m,), less the deflection of the frame under the measured force."""
        compliance = rows["instrument.compliance"]
        return self.blocks.depth - compliance * self.blocks.force if compliance else self.blocks.depth

    @cached_property
    def _linear_columns(self) -> FloatArray | None:
        """Derivatives (m, p) of the force reading in the baseline and its slope, as far as these are free.

        None where neither is.
        """
        depth = self.blocks.depth
        free = [
            column
            for path, column in zip(_LINEAR, (np.ones(depth.shape), depth), strict=True)
            if path in self.free
        ]
        return np.stack(free, axis=1) if free else None

    @cached_property
    def _linear_basis(self) -> FloatArray | None:
        """Orthonormal columns (m, p) that span the free ones of baseline and slope; None where none is free."""
        columns = self._linear_columns
        # Columns are brought to unit length first: metres beside ones would cost digits.
        return None if columns is None else np.linalg.qr(columns / np.linalg.norm(columns, axis=0))[0]

    def _fixed_offset(self, rows: Rows) -> FloatArray:
        baseline, slope = (0.0 if path in self.free else rows[path] for path in _LINEAR)
        return np.asarray(baseline + slope * self.blocks.depth)


def _steps_to_lowest(before: FloatArray, here: FloatArray, after: FloatArray) -> FloatArray:
    """Steps (r,) from the middle of three values to the minimum of the parabola through them; zero without one."""
    # Where no law reaches all three are infinite.
    reached = here < np.inf
    if not reached.all():
        before, here, after = (np.where(reached, each, 0.0) for each in (before, here, after))
    bend = before - 2.0 * here + after
    return np.divide(0.5 * (before - after), bend, out=np.zeros_like(bend), where=bend > 0.0)


def _project_out(rows: FloatArray, basis: FloatArray | None) -> FloatArray:
    """Residuals of `rows` (..., m) after a least-squares fit by the orthonormal columns `basis` (m, p)."""
    return rows if basis is None else np.asarray(rows - (rows @ basis) @ basis.T)
