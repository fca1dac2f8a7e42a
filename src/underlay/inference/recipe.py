"""Recipes of instruments: their fit repeated, and the steps from their modulus to ours.

An instrument's modulus differs from ours for reasons that can be separated: the points that were fitted, the
quantity that was minimised, the shape of the tip, and the substrate. `steps_to_ours` repeats its fit; each step
changes one of them and fits again.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
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
from underlay.mechanics.indenters import Paraboloid
from underlay.scene.noise import Noise
from underlay.scene.scene import Scene

_CONTACT = "instrument.contact_depth"
# Least number of readings for a fit.
_FEWEST = 8
# Share of the depth on both sides of the software's contact point in which a contact point is searched, and number
# of places tried first.
_REACH, _TRIED = 0.5, 81


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
