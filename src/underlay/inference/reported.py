"""Numbers reported beside the parameters: moduli as others compute them, the modulus by depth, adhesive numbers.

An instrument's modulus differs from ours for reasons that can be separated: the points that were fitted, the
quantity that was minimised, the shape of the tip, and the substrate. `steps_to_ours` repeats its fit; each step
changes one of them and fits again.

Of a relaxation test laboratories report two moduli, without any fit of the transient (`relaxation_moduli`). The
instantaneous one, before any water has moved, comes from the rise of the force over each ramp, by the elastic law
at nu = 0.5; the equilibrium one, after drainage, from the force at the end of each hold, by the law at the drained
Poisson's ratio. Each is the least-squares slope over all steps, for an isotropic layer of known thickness.

Of an adhesive contact they are pull-off force and depth and the zero-load radius (`adhesive_estimates`).
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple, TypeAlias

import numpy as np
from numpy.typing import NDArray
from scipy import optimize

from underlay._arrays import FloatArray
from underlay._given import require_given
from underlay.data.curve import Curve
from underlay.data.segments import LOADING
from underlay.errors import CurveError, InputError
from underlay.inference.from_files import whole_curve
from underlay.inference.least_squares.fit_result import Fit
from underlay.inference.least_squares.fitting import quick_fit
from underlay.inference.pointwise import halfspace_of
from underlay.inference.problem import Problem
from underlay.inference.sampling.derived import ADHESIVE, adhesive_numbers
from underlay.mechanics.indenters import Paraboloid
from underlay.mechanics.materials import Isotropic
from underlay.mechanics.solver import Solver
from underlay.scene.noise import Noise
from underlay.scene.scene import Scene

_CONTACT = "instrument.contact_depth"
# Least number of readings for a fit.
_FEWEST = 8
# Share of the depth on both sides of the software's contact point in which a contact point is searched, and number
# of places tried first.
_REACH, _TRIED = 0.5, 81
# Last share of each hold, whose mean force is taken as the equilibrium force.
_LATE = 0.05
# Poisson's ratio before drainage.
_INCOMPRESSIBLE = 0.5
# Relative step of central differences of the adhesive numbers, which are smooth in every parameter.
_STEP = 1e-3
# Relative change of a number over that of a parameter below which it does not depend on the parameter.
_ACTS = 0.02


class HertzFit(NamedTuple):
    """Reduced modulus E / (1 - nu^2) (Pa) and contact point (m) of a half-space fit, and the points it used."""

    reduced: float
    contact_depth: float
    points: NDArray[np.intp]


@dataclass(frozen=True)
class LineInPower:
    """How a Bioindenter fits its modulus E_r: a straight line through F^(2/3) against depth.

    Its slope gives E_r, its zero h0; forces are those of the file.

    Parameters
    ----------
    low, high : float
        Shares of the largest force between which points are used.
    """

    low: float
    high: float

    def find(self, curve: Curve, radius: float) -> HertzFit:
        """Repeat the software's fit on the loading part of a whole curve with a tip of `radius` (m).

        Raises
        ------
        CurveError
            If fewer than eight points lie in its range, or the force does not grow there.
        """
        largest = float(curve.force.max())
        kept = (curve.segments() == LOADING) & (curve.force >= self.low * largest)
        points = np.flatnonzero(kept & (curve.force <= self.high * largest))
        _require(points)
        slope, zero = np.polyfit(curve.depth[points], curve.force[points] ** (2.0 / 3.0), 1)
        if not slope > 0.0:
            raise CurveError(f"the force does not grow over the range of the recipe: {self}")
        return HertzFit(float(0.75 * slope**1.5 / math.sqrt(radius)), float(-zero / slope), points)

    def __str__(self) -> str:
        return f"a line through F^(2/3) from {100.0 * self.low:g} to {100.0 * self.high:g} % of the force"


@dataclass(frozen=True)
class LeastSquaresFromContact:
    """How an Optics11 fits its modulus E_r: least squares in the force with a free contact point.

    Points are used up to a share of the largest force. Forces are relative to their mean before the software's
    contact point. Files of Optics11 do not state this procedure: it was chosen because it reproduces their numbers
    (0.5 % on 11 Piuma files, 0.2 % on a Chiaro's, 1.1 % on one of a later Piuma).

    Parameters
    ----------
    contact : float
        Depth reading of the contact point that the software chose (m).
    high : float
        Share of the largest force up to which points are used: until it is first passed.
    before : float
        Time before that contact from which points are used (s).
    """

    contact: float
    high: float = 0.5
    before: float = 0.2

    def find(self, curve: Curve, radius: float) -> HertzFit:
        """Repeat the software's fit on a whole curve with a tip of `radius` (m).

        Raises
        ------
        CurveError
            If fewer than eight points lie in its range.
        """
        first = int(np.argmax(curve.depth > self.contact))
        baseline = float(curve.force[: max(first, 1)].mean())
        force = curve.force - baseline
        largest = float(force[: int(np.argmax(curve.depth)) + 1].max())
        last = int(np.argmax(force >= self.high * largest))
        time = np.arange(len(curve), dtype=np.float64) if curve.time is None else curve.time
        points = np.arange(int(np.searchsorted(time, time[first] - self.before)), last)
        _require(points)
        depth, force = curve.depth[points], force[points]
        contact = _contact_of(depth, force, self.contact)
        grown = np.maximum(depth - contact, 0.0) ** 1.5
        slope = float(grown @ force / (grown @ grown))
        return HertzFit(0.75 * slope / math.sqrt(radius), contact, points)

    def __str__(self) -> str:
        return f"Hertz with a free contact point, up to {100.0 * self.high:g} % of the force"


#: How an instrument's software fits its modulus E_r: Hertz (1882), F = (4/3) E_r sqrt(R) (h - h0)^(3/2), with F the
#: force, R the tip radius, h the depth and h0 the contact point. Its text is the procedure in words.
Recipe: TypeAlias = LineInPower | LeastSquaresFromContact


def _require(points: NDArray[np.intp]) -> None:
    if len(points) < _FEWEST:
        raise CurveError(f"only {len(points)} points lie in the range of the instrument's recipe")


def _contact_of(depth: FloatArray, force: FloatArray, near: float) -> float:
    """Contact point (m) of the least-squares fit, searched about `near` (m); E is linear and solved for."""

    def misfit(contact: float) -> float:
        grown = np.maximum(depth - contact, 0.0) ** 1.5
        return float(force @ force - (grown @ force) ** 2 / (grown @ grown))

    reach = float(depth.max()) - near
    tried = near + reach * np.linspace(-_REACH, _REACH, _TRIED)
    best = float(tried[int(np.argmin([misfit(float(one)) for one in tried]))])
    step = float(tried[1] - tried[0])
    # In units of the grid's step, since the tolerance of the search is absolute.
    found = optimize.minimize_scalar(
        lambda place: misfit(best + place * step), bounds=(-1.0, 1.0), method="bounded"
    )
    return best + float(found.x) * step


class Step(NamedTuple):
    """One step from the instrument's number to ours: what was changed, and Young's modulus after it (Pa)."""

    what: str
    modulus: float


def recipe_of(curve: Curve) -> Recipe | None:
    """Return the fit procedure behind the modulus in a curve's file; None where it is not known.

    Files of the Bioindenter state the range of force that was fitted. Those of Optics11 do not; see
    `LeastSquaresFromContact`.
    """
    ends, contact = (curve.metadata.get(key) for key in ("instrument_fit_range", "software_contact_depth"))
    if isinstance(ends, tuple) and len(ends) == 2:
        low, high = (float(end) for end in ends)
        return LineInPower(low, high) if 0.0 <= low < high <= 1.0 else None
    if curve.metadata.get("format") == "optics11" and isinstance(contact, float):
        return LeastSquaresFromContact(contact)
    return None


def steps_to_ours(fit: Fit) -> list[Step]:
    """Return the steps from the instrument's modulus to ours; empty where the file states no modulus or procedure.

    Every step keeps the changes of those before it; the last is the least-squares value of the fit.
    """
    require_given(fit, "fit", Fit)
    stated = fit.instrument_moduli.get("layer.E")
    recipe = recipe_of(fit.curves[0])
    radius = fit.scene.parameters.get("indenter.radius")
    if stated is None or recipe is None or radius is None or len(fit.curves) > 1:
        return []
    return [Step("the instrument's own number", stated.youngs), *_steps(fit, recipe, radius)]


def _steps(fit: Fit, recipe: Recipe, radius: float) -> Iterator[Step]:
    measured, ours = fit.curves[0], fit.values["layer.E"]
    whole = whole_curve(measured) or measured
    material = fit.scene.layer.material
    # Young's modulus over the reduced one, at constant ratios of an anisotropic layer.
    per_reduced = material.E / (2.0 * material.theta)
    try:
        found = recipe.find(whole, radius)
        yield Step(f"its recipe repeated: {recipe}", found.reduced * per_reduced)
        hertz = replace(halfspace_of(fit.scene.elastic), indenter=Paraboloid(radius))
        if isinstance(recipe, LineInPower):
            same = whole.select(found.points)
            yield Step(
                "the same points, the force itself fitted", _fitted(fit, hertz, same, found.contact_depth)
            )
        yield Step("the points and the baseline of this fit", _fitted(fit, hertz, measured, None))
        if fit.scene.indenter.shape != "paraboloid":
            shaped = replace(hertz, indenter=fit.scene.indenter)
            yield Step(
                f"the shape of the tip: {fit.scene.indenter.shape}", _fitted(fit, shaped, measured, None)
            )
    except (CurveError, InputError):
        # A step that fails ends the list; the steps before it are kept.
        return
    if fit.scene.substrate is not None or not fit.scene.is_elastic:
        yield Step("the layer, what it stands on, and all else of the scene", ours)


def _fitted(fit: Fit, scene: Scene, curve: Curve, contact: float | None) -> float:
    """Modulus (Pa) of a half-space fitted to a curve.

    With a given `contact` only the contact point is free besides it; else all instrument parameters that the fit
    frees.
    """
    given = fit.problem.free
    instrument = {path: prior for path, prior in given.items() if path.startswith("instrument.")}
    free = {"layer.E": None, **(instrument if contact is None else {_CONTACT: None})}
    if contact is not None:
        scene = scene.with_values(
            {_CONTACT: contact, "instrument.baseline": 0.0, "instrument.baseline_slope": 0.0}
        )
    return quick_fit(Problem(scene, curve, free, Noise(), solver="halfspace")).values["layer.E"]


@dataclass(frozen=True)
class RelaxationModuli:
    """The two moduli that a laboratory reports from a relaxation test.

    Parameters
    ----------
    instantaneous, equilibrium : float
        Young's moduli (Pa): the initial one, of an incompressible layer, and the one after drainage.
    depth, peak, settled : ndarray (steps,)
        Depth (m) of each hold since contact, largest force (N) of its step and the force at its end.
    """

    instantaneous: float
    equilibrium: float
    depth: FloatArray
    peak: FloatArray
    settled: FloatArray


def relaxation_moduli(curve: Curve, scene: Scene) -> RelaxationModuli:
    """Instantaneous and equilibrium modulus of a record of ramps and holds.

    Parameters
    ----------
    curve : Curve
        One or more steps, with times.
    scene : Scene
        The test: tip, thickness, contact depth, baseline, and the drained Poisson's ratio of an isotropic layer.

    Returns
    -------
    RelaxationModuli

    Raises
    ------
    CurveError
        If there are no times, or no hold.
    InputError
        If the layer is not isotropic.
    """
    material = scene.layer.material
    if not material.isotropic:
        raise InputError("instantaneous and equilibrium moduli are reported of an isotropic layer")
    if curve.time is None:
        raise CurveError("a relaxation test needs the times of its points (s)")
    # Loaded only where it is used.
    from underlay.mechanics.biphasic.history import ramps_and_holds  # noqa: PLC0415  see above

    w = curve.depth - scene.instrument.contact_depth
    force = curve.force - scene.instrument.chain.reading(np.zeros_like(w), curve.depth)
    line = ramps_and_holds(w, curve.time).in_contact
    tops = np.flatnonzero(np.diff(line.value) > 0.0) + 1
    starts = [*line.time[tops - 1], curve.time[-1]]
    steps = [
        (float(line.value[top]), *_step(curve.time, force, starts[i : i + 2])) for i, top in enumerate(tops)
    ]
    if not steps:
        raise CurveError("a relaxation test has a ramp and a hold: the depth never rises")
    depth, peak, settled = np.array(steps).T
    quick, slow = (_unit_force(scene, nu, depth) for nu in (_INCOMPRESSIBLE, material.nu))
    rises = peak - np.concatenate(([0.0], settled[:-1]))
    grown = np.diff(quick, prepend=0.0)
    return RelaxationModuli(
        float(rises @ grown / (grown @ grown)), float(settled @ slow / (slow @ slow)), depth, peak, settled
    )


def _step(time: FloatArray, force: FloatArray, ends: list[float]) -> tuple[float, float]:
    """Largest force (N) of a step, between the starts of its ramp and of the next, and mean force at its end."""
    mine = np.flatnonzero((time >= ends[0]) & (time <= ends[1]))
    late = mine[-max(int(_LATE * mine.size), 1) :]
    return float(force[mine].max()), float(force[late].mean())


def _unit_force(scene: Scene, nu: float, depth: FloatArray) -> FloatArray:
    """Force (N), (steps,), on the elastic layer with Young's modulus 1 Pa and Poisson's ratio `nu`."""
    elastic = replace(scene.elastic, uncertainties=None)
    layer = replace(elastic.layer, material=Isotropic(1.0, nu))
    law = replace(elastic, layer=layer).contact_law(float(depth.max()))
    return np.asarray(law.force(depth))


class AdhesiveNumber(NamedTuple):
    """A number of an adhesive contact: value (SI) and 95 % interval, infinite where the data set no limit."""

    name: str
    value: float
    low: float
    high: float


def adhesive_estimates(result: Fit, curve: int = 0) -> list[AdhesiveNumber]:
    """Pull-off force and depth and zero-load radius of one curve of a fit, with intervals; empty without adhesion.

    A number that depends on one parameter alone has that parameter's interval, converted; others have the interval
    of `Fit.band`, which is infinite where a parameter that they depend on is not determined.
    """
    scene, member = result.scenes[curve], result.problem.members[curve]
    if not scene.adheres:
        return []
    paths = [
        path for path in member.entries if path in scene.parameters and not path.startswith("instrument.")
    ]
    rows = [member.entries[path] for path in paths]
    numbers = adhesive_numbers(scene, result.solver)
    at = np.array([*numbers.values()])
    slopes = _slopes(scene, result.solver, paths)
    optimum = result.problem.physical(result.vector)[rows]
    shares = slopes * optimum[:, None] / at

    def of(physical: FloatArray) -> FloatArray:
        # Absolute values, with the logarithms to first order.
        return np.asarray(np.abs(at) * np.exp((physical[:, rows] - optimum) @ (slopes / at)))

    band = np.sort(np.sign(at) * np.array(result.band(of)), axis=0)
    found = []
    for column, name in enumerate(numbers):
        acting = np.flatnonzero(~(np.abs(shares[:, column]) < _ACTS))
        stated = [result.interval(result.problem.names[rows[row]]) for row in acting]
        low, value, high = (float(end) for end in band[:, column])
        if len(stated) == 1:
            path, slope = paths[acting[0]], float(slopes[acting[0], column])
            ends = (stated[0].low, stated[0].value, stated[0].high)
            low, value, high = sorted(_followed(scene, result.solver, name, path, end, slope) for end in ends)
        elif any(known.is_open for known in stated):
            low, high = -math.inf, math.inf
        found.append(AdhesiveNumber(name, value, low, high))
    return found


def _followed(scene: Scene, solver: Solver, name: str, path: str, end: float, slope: float) -> float:
    """An adhesive number with its one parameter at the end of that one's interval; infinite for an infinite end.

    `slope` is the derivative of the number, whose sign gives the side.
    """
    if math.isfinite(end):
        try:
            return adhesive_numbers(scene.with_values({path: end}), solver)[name]
        except InputError:
            end = math.copysign(math.inf, end - scene.parameters[path])
    return math.copysign(math.inf, end * slope)


def _slopes(scene: Scene, solver: Solver, paths: Sequence[str]) -> FloatArray:
    """d number / d parameter, (parameters, numbers), by differences; one-sided where only one side is possible."""
    values, slopes = scene.parameters, np.zeros((len(paths), len(ADHESIVE)))
    middle = np.array([*adhesive_numbers(scene, solver).values()])
    for row, path in enumerate(paths):
        step = _STEP * (abs(values[path]) or 1.0)
        sides = []
        for sign in (1.0, -1.0):
            try:
                moved = scene.with_values({path: values[path] + sign * step})
                numbers = adhesive_numbers(moved, solver)
            except InputError:
                continue
            sides.append((np.array([*numbers.values()]) - middle) / (sign * step))
        slopes[row] = np.mean(sides, axis=0) if sides else np.nan
    return slopes
