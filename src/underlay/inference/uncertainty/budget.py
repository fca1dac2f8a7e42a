"""The systematic part of an interval: how far uncertain inputs and the model's omissions shift the fitted numbers.

An error of an input or of the model adds a force to the readings, which the fit attributes to the sample. To first
order the scaled vector of fitted numbers shifts as in least squares weighted by the noise (`Likelihood.moved`);
where that shift is large, the curve is fitted again with the input changed. A source with several independent
shapes has one row of shifts for each; each row is a pair, for the input lowered and raised.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, NamedTuple, Self, TypeAlias

import numpy as np

from underlay._arrays import FloatArray
from underlay.errors import FitError, InputError, UnderlayError
from underlay.inference.model.compilation import IN_SERIES
from underlay.inference.model.on_law import FORM, LEFT_OPEN
from underlay.inference.priors import Normal
from underlay.inference.problem import Problem
from underlay.inference.uncertainty.answer import NORMAL_95
from underlay.inference.uncertainty.form_of_energy import shifts_by_form
from underlay.inference.uncertainty.inputs import (
    DEPTH,
    FORCE,
    HEIGHTS,
    SENSITIVITY,
    SPRING_CONSTANT,
    Input,
    inputs_of,
)
from underlay.inference.uncertainty.known_errors import KnownError, Pressed, known_errors, left_out
from underlay.mechanics.profile import Profile
from underlay.scene.instrument import ContactDepth, Frame
from underlay.scene.scene import Scene, has_face, unknown_faces, with_bond

if TYPE_CHECKING:
    from underlay.inference.least_squares.fit_result import Fit
    from underlay.inference.model.forward import Forward, Reading
    from underlay.inference.model.members import Member

#: Function from forces (N), one array for each curve, to the shift (k,) of the scaled vector by them.
Moved: TypeAlias = Callable[[Sequence[FloatArray]], FloatArray]
#: Function that fits a problem, with the values of its scenes as the starting point.
Refit: TypeAlias = Callable[[Problem], "Fit"]
#: Name of the general error of a contact law.
LAW = "contact model"
# Inputs that have no path in a scene.
_NO_PATHS = {FORCE, SPRING_CONSTANT, SENSITIVITY, DEPTH, HEIGHTS}
# Sections of a scene whose numbers act on a curve.
_ACTING = ("indenter.", "layer.", "substrate.", "instrument.compliance", "adhesion.", "history.")
# Standard deviation of the law's own relative error at full depth: an assumption, marked as such. At 3 % it alone
# makes 7.4 to 8.4 % of a modulus with the contact free, and drowns clean data.
_LAW_SIZE = 0.01
# Shift in scaled coordinates up to which a source is computed to first order (an error of half its square, 1 %).
_STRAIGHT = 0.15


@dataclass(frozen=True, eq=False)
class Source:
    """One source of a systematic error.

    Parameters
    ----------
    name, size, origin : str
        As in `Contribution`.
    moves : FloatArray
        Shifts of the scaled vector at 95 %, (rows, places, k): rows are independent, and each has two places, for
        the input lowered and raised, or more between where the shift does not grow with it.
    bias : FloatArray
        Mean shift of the scaled vector from the fitted one, (k,), for an error whose mean size is not zero.
    """

    name: str
    size: str
    origin: str
    moves: FloatArray
    bias: FloatArray | float = 0.0


def sources_of(
    fit: Fit, moved: Callable[[Sequence[FloatArray]], FloatArray], refit: Refit
) -> tuple[Source, ...]:
    """Sources of the systematic error of a fit, without those that shift nothing.

    Parameters
    ----------
    fit : Fit
        The fit.
    moved : callable
        Shift (k,) of the scaled vector, to first order, by given forces (N), one array for each curve.
    refit : callable
        Fits a problem again; called for inputs that shift the vector far, and for another bond of a face.
    """
    if fit.problem.base_scenes[0].uncertainties == "none":
        return ()
    curves = [CurveAtOptimum.of(fit, member) for member in fit.problem.members]
    budget = _Budget(fit, moved, refit, curves)
    return tuple(source for source in budget.sources() if np.any(source.moves))


@dataclass(frozen=True, eq=False)
class _Budget:
    """Computes the sources of systematic error of a fit from its curves at the optimum."""

    fit: Fit
    moved: Moved
    refit: Refit
    curves: Sequence[CurveAtOptimum]

    def sources(self) -> Iterator[Source]:
        """Sources of the systematic error: inputs, errors of the model, unstated stiffening, bonds and drainage."""
        yield from self._inputs()
        yield self._law()
        yield from self._left_out()
        yield from self._left_open()
        yield from self._bonds()
        yield from self._drainage()

    # --- inputs -------------------------------------------------------------------------------------------
    def _inputs(self) -> Iterator[Source]:
        """Sources that are uncertain inputs; one of the same name and size has the same error in all curves."""
        problem = self.fit.problem
        free = {coordinate.path for coordinate in problem.coordinates}
        of_curves: dict[tuple[str, str], dict[int, Input]] = {}
        for i, member in enumerate(problem.members):
            for entry in inputs_of(member.scene, member.curve, free):
                of_curves.setdefault((entry.source, entry.size), {})[i] = entry
        slopes = _input_slopes(self.fit, {source for source, _ in of_curves} & set(self.fit.scene.parameters))
        for (source, size), entries in of_curves.items():
            first = next(iter(entries.values()))
            moves = self._of_input(source, entries, slopes)
            if moves is not None:
                yield Source(source, size, first.origin, moves)

    def _of_input(
        self, source: str, entries: dict[int, Input], slopes: dict[str, list[FloatArray]]
    ) -> FloatArray | None:
        """Shifts (1, 2, k) of the scaled vector by one input, lowered and raised; None where it does not act.

        Parameters
        ----------
        source : str
            Path of the input, or a name such as `FORCE`.
        entries : dict of int to Input
            The input of each curve that has it, by the curve's index.
        slopes : dict of str to list of FloatArray
            d force / d input, one array a curve, by path.
        """
        if source not in _NO_PATHS and source not in slopes:
            return None
        sides = []
        for sign in (-1.0, 1.0):
            amounts = [
                sign * (entries[i].up if sign > 0.0 else entries[i].down) if i in entries else 0.0
                for i in range(len(self.curves))
            ]
            columns = [
                self._column(source, i, amount, slopes)
                if amount
                else np.zeros_like(self.curves[i].reading.force)
                for i, amount in enumerate(amounts)
            ]
            # If the input were larger by this amount, the same readings would come from another sample: the sign is
            # reversed.
            near = -self.moved(columns)
            far = bool((np.abs(near) > _STRAIGHT).any()) and source in slopes
            sides.append(self._moved_input(source, amounts, near) if far else near)
        return np.array([sides])

    def _column(self, source: str, i: int, amount: float, slopes: dict[str, list[FloatArray]]) -> FloatArray:
        """Change of the force (N) of curve `i`, (n,), if the input were larger by `amount`."""
        member, (_, reading, kept, penetration) = self.fit.problem.members[i], self.curves[i]
        if source == HEIGHTS:
            return _of_heights(self.fit, i, amount) - reading.force
        if source in slopes:
            return amount * slopes[source][i]
        if source == DEPTH:
            return amount * kept * reading.stiffness * penetration
        # With a larger scale of the force the same sample gives a smaller reading.
        if source == SPRING_CONSTANT and member.curve.metadata.get(IN_SERIES):
            # The deflection is measured: a stiffer lever presses harder and bends no more.
            return -amount * kept * reading.contact
        if source == SENSITIVITY:
            # The bending that was subtracted from the travel is larger by the same share.
            bending = member.force / float(member.curve.metadata.get("spring_constant", math.inf))
            return -amount * (member.force + kept * reading.stiffness * bending)
        return -amount * member.force

    def _moved_input(self, source: str, amounts: Sequence[float], near: FloatArray) -> FloatArray:
        """Shift (k,) of the optimum by a changed input: a new fit, begun at `near`, which stands if it fails."""
        fit = self.fit
        begin = fit.problem.physical(np.clip(fit.vector + near, *fit.problem.bounds.T))
        try:
            scenes = [
                scene.with_values(
                    {
                        path: float(begin[entry])
                        for path, entry in member.entries.items()
                        if path in scene.parameters
                    }
                    | ({source: scene.parameters[source] + amount} if amount else {})
                )
                for scene, amount, member in zip(fit.scenes, amounts, fit.problem.members, strict=True)
            ]
            again = self.refit(fit.problem.revised(scenes=scenes, noise=fit.noises))
        except (InputError, FitError):
            return near
        return fit.problem.vector(again.values) - fit.vector

    # --- what the model leaves out ------------------------------------------------------------------------
    def _law(self) -> Source:
        """General error of a contact law: a relative error of the force that grows with depth.

        It has two independent shapes, s and s^2 with s = sqrt(w / w_max), w being the indentation depth and w_max
        the largest.
        """
        rows = []
        for power in (1, 2):
            columns = []
            for curve in self.curves:
                w = np.maximum(curve.penetration, 0.0)
                s = np.sqrt(w / max(float(w.max()), 1e-300))
                columns.append(curve.kept * curve.reading.contact * s**power)
            shift = self.moved([NORMAL_95 * _LAW_SIZE / np.sqrt(2.0) * column for column in columns])
            rows.append([-shift, shift])
        return Source(
            LAW, f"± {100.0 * NORMAL_95 * _LAW_SIZE:.2g} % at full depth", "assumed", np.array(rows)
        )

    def _left_out(self) -> Iterator[Source]:
        """Sources of known shape that the model omits: friction, finite strain, a paraboloid for a sphere."""
        errors: dict[str, KnownError] = {}
        for scene, curve in zip(self.fit.problem.base_scenes, self.fit.curves, strict=True):
            deepest = max(float(curve.depth.max()) - scene.instrument.contact_depth, 0.0)
            found = (*left_out(scene, deepest).errors, *known_errors([scene]))
            errors |= {error.words: error for error in found}
        for error in errors.values():
            try:
                columns = [
                    curve.kept * error.column(curve.pressed(member.forward, scene))
                    for curve, member, scene in zip(
                        self.curves, self.fit.problem.members, self.fit.scenes, strict=True
                    )
                ]
            except InputError:
                # The error was not computed at this test's numbers: the report states which errors are not known.
                continue
            shift = self.moved(columns)
            spread = NORMAL_95 * error.deviation
            # The fit has attributed to its parameters what the law lacks.
            yield Source(
                error.words,
                error.size,
                "model",
                np.array([[-spread * shift, spread * shift]]),
                -error.mean * shift,
            )

    def _left_open(self) -> Iterator[Source]:
        """Sources of error from strain stiffening that the scene does not state, within its usual range.

        The curves are fitted again with the stiffening's numbers: where stiffening is strong, a first-order step
        from the fit without them is too short or has the wrong sign (Ogden's energy of exponent -16). The spread of
        heights is free; its rows are its contribution to the covariance. Beside 1/Jm the shift does not grow with
        the size of the form of the energy: that is held at several sizes within its range, and its places are those
        that the curves allow.
        """
        problem = self.fit.problem
        free = {coordinate.path for coordinate in problem.coordinates}
        open_ = [
            path
            for path in LEFT_OPEN
            if path not in free and any(scene.parameters.get(path) == 0.0 for scene in problem.base_scenes)
        ]
        if not open_:
            return
        others = [path for path in open_ if path != FORM]
        try:
            opened = {**problem.free, **dict.fromkeys(others)}
            again = self.refit(problem.revised(free=opened, scenes=self.fit.scenes, noise=self.fit.noises))
            if FORM in open_:
                largest = [float(curve.reading.contact.max()) for curve in self.curves]
                yield Source(*LEFT_OPEN[FORM], "model", shifts_by_form(self.fit, again, largest)[None])
        except (InputError, FitError):
            return
        covariance = again.scaled_covariance
        own = [again.names.index(name) for name in self.fit.names]
        way = problem.vector({name: again.values[name] for name in self.fit.names}) - self.fit.vector
        for path in others:
            sizes = [i for i, coordinate in enumerate(again.problem.coordinates) if coordinate.path == path]
            sizes = [i for i in sizes if covariance[i, i] > 0.0]
            factor = np.linalg.cholesky(covariance[np.ix_(sizes, sizes)])
            rows = NORMAL_95 * np.linalg.solve(factor, covariance[np.ix_(sizes, own)])
            bias = 0.0 if FORM in open_ else way
            yield Source(*LEFT_OPEN[path], "model", np.stack((-rows, rows), axis=1), bias)

    def _bonds(self) -> Iterator[Source]:
        """Sources that are bonds of a face not stated in the scene: the shift if that face slips."""
        problem = self.fit.problem
        for face in dict.fromkeys(face for scene in problem.base_scenes for face in unknown_faces(scene)):
            scenes = [
                with_bond(scene, face, "slip") if has_face(scene, face) else scene
                for scene in problem.base_scenes
            ]
            yield from self._other_test(f"bond of {face}", "bonded to slipping", scenes)

    def _drainage(self) -> Iterator[Source]:
        """Source for a tip of unstated drainage: the shift if water leaves through it."""
        own = self.fit.problem.base_scenes
        scenes = [replace(one, drainage="porous") if one.drainage == "unknown" else one for one in own]
        if scenes == list(own):
            return
        yield from self._other_test("drainage at the tip", "solid to porous", scenes)

    def _other_test(self, name: str, size: str, scenes: Sequence[Scene]) -> Iterator[Source]:
        """Source that is the shift if the curves come from other scenes; none where these cannot be fitted."""
        try:
            again = self.refit(self.fit.problem.revised(scenes=scenes))
        except (InputError, FitError):
            return
        move = self.fit.problem.vector(again.values) - self.fit.vector
        yield Source(name, size, "model", np.array([[np.zeros_like(move), move]]))


def _input_slopes(fit: Fit, paths: set[str]) -> dict[str, list[FloatArray]]:
    """d force / d input (SI), one array (n,) for each curve, by path, for the inputs that act in this scene."""
    together = _slopes_of(fit, sorted(paths))
    if together is not None:
        return together
    alone = [_slopes_of(fit, [path]) or {} for path in sorted(paths)]
    return {path: slopes for own in alone for path, slopes in own.items()}


def _slopes_of(fit: Fit, paths: Sequence[str]) -> dict[str, list[FloatArray]] | None:
    """d force / d input of several inputs in one evaluation, as in `_input_slopes`.

    None where one of them does not act in this scene, or where a finite difference leaves the allowed values.
    """
    if not paths:
        return {}
    # Only derivatives are needed; but a free thickness with stiffening is refused without a prior.
    known = {path: Normal(fit.scene.parameters[path], 1.0) for path in paths}
    # Other free parameters do not change a derivative, and one hold of a stepwise test allows no second number.
    beside = fit.problem.free if fit.problem.n_points > len(fit.problem.names) + len(paths) else {}
    free = {**beside, **known}
    scenes = [replace(scene, uncertainties=None) for scene in fit.scenes]
    try:
        problem = fit.problem.revised(free=free, scenes=scenes, noise=fit.noises)
        physical = problem.physical(problem.start)
        jacobians = [member.jacobian(physical, rough=True)[1] for member in problem.members]
    except UnderlayError:
        return None
    return {
        path: [
            jacobian[:, member.entries[path]] if path in member.entries else np.zeros(len(jacobian))
            for member, jacobian in zip(problem.members, jacobians, strict=True)
        ]
        for path in paths
    }


class CurveAtOptimum(NamedTuple):
    """One curve of a fit at the optimum.

    Parameters
    ----------
    values : mapping of str to float
        Every number of the scene (SI) by path.
    reading : Reading
        The model's.
    kept : FloatArray
        Share (n,) of a change of the contact force that appears in the reading: 1 / (1 + C dP/dw), with C the
        compliance of frame and lever in series with the contact, P the contact force and w the depth of the tip.
    penetration : FloatArray
        Indentation depth of the tip (m), (n,); negative before contact.
    """

    values: Mapping[str, float]
    reading: Reading
    kept: FloatArray
    penetration: FloatArray

    @classmethod
    def of(cls, fit: Fit, member: Member) -> Self:
        """Compute the model of a fitted curve."""
        values = member.values_at(fit.problem.physical(fit.vector))
        reading = member.forward.reading(values)
        compliance = float(values[Frame.path] + member.forward.lever_compliances(values))
        gone = values[ContactDepth.path] + compliance * reading.contact
        kept = np.asarray(1.0 / (1.0 + compliance * reading.stiffness))
        return cls(values, reading, kept, np.asarray(member.forward.depth - gone))

    def pressed(self, forward: Forward, scene: Scene) -> Pressed:
        """State of the test, of this model and fitted scene, as functions of known errors take it."""
        law = forward.law(self.values, max(float(self.penetration.max()), 0.0))
        return Pressed(
            self.values, law, self.penetration, self.reading.contact, self.reading.stiffness, scene
        )


def _of_heights(fit: Fit, i: int, share: float) -> FloatArray:
    """Force readings (N) of curve `i` with all heights of its measured tip profile larger by a relative `share`."""
    scenes = list(fit.scenes)
    tip = scenes[i].indenter
    if not isinstance(tip, Profile):
        return fit.problem.members[i].reading(fit.problem.physical(fit.vector)).force
    scenes[i] = replace(scenes[i], indenter=Profile(tip.r, (1.0 + share) * tip.height))
    member: Member = fit.problem.revised(scenes=scenes, noise=fit.noises).members[i]
    return member.reading(fit.problem.physical(fit.vector)).force


def sensitivities(fit: Fit, moved: Moved) -> dict[str, dict[str, float]]:
    """d ln(value) / d ln(input) of every fitted number that is positive by nature.

    Returns
    -------
    dict of dict of float
        By fitted number, then by the path of the input, or `FORCE`: the scale of all forces. Inputs that are zero,
        infinite or do not act are left out, as are numbers that lie on a bound.
    """
    problem = fit.problem
    free = {coordinate.path for coordinate in problem.coordinates}
    known = {path: value for path, value in fit.scene.parameters.items() if path.startswith(_ACTING)}
    paths = {path for path, value in known.items() if path not in free and value and math.isfinite(value)}
    shifts = {
        path: -moved([known[path] * column for column in columns])
        for path, columns in _input_slopes(fit, paths).items()
    }
    shifts[FORCE] = moved([member.force for member in problem.members])
    left_out = {*fit.no_error_bars, *fit.bounds_hit}
    shown = [
        i
        for i, coordinate in enumerate(problem.coordinates)
        if coordinate.scale is None and i not in problem.noise_entries and coordinate.name not in left_out
    ]
    return {fit.names[i]: {path: float(shift[i]) for path, shift in shifts.items()} for i in shown}
