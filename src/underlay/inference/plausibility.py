"""Refuses depth, force and scene that do not belong together, such as mistaken columns or units.

Each refusal needs a mismatch that no material explains: deeper than the layer is thick, ten radii deep, a modulus
ten times beyond its own bounds, a force proportional to the depth from the first point on, or a lever that bends
more than it travels. Depths are the indentation also where a curve is fitted against the travel, which holds the
deflection of a compliance in series.
"""

from __future__ import annotations

import itertools
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from underlay.data.foot import approach_of, foot_of, require_going_in
from underlay.errors import CurveError, InputError
from underlay.inference.model.compilation import IN_SERIES
from underlay.mechanics.solvers import Auto
from underlay.units import format_quantity, kind_of

if TYPE_CHECKING:
    from underlay.data.curve import Curve
    from underlay.inference.least_squares.fit_result import Fit
    from underlay.inference.priors import Prior
    from underlay.inference.problem import Problem
    from underlay.scene.scene import Scene

# Depth over the radius of a ball from which a curve is refused: real laboratories indent to 1.4 radii, with sharp
# tips to some; at ten no law holds.
_RADII = 10.0
# Lengths of a scene with which the depth is compared, the multiple of each from which it is refused, and words for
# messages.
_SIZES = (("layer.thickness", 1.0, "thick"), ("indenter.radius", _RADII, "in radius"))
# Factor beyond the forces of all moduli within bounds from which a force is refused; the depth since contact is
# known to a factor of two, which is a factor of three in a force ~ depth^1.5.
_BEYOND = 10.0
_COARSE = Auto(1e-2)  # the law used for it: far more accurate than that factor
# A mistaken unit is off by 1000, and so is the modulus if it is the unit of the force or of the spring constant; if
# it is that of a ball's radius R, by 1000^0.5: the force on a half-space is ~ E R^0.5 depth^1.5. The ratio of a
# modulus to its starting value, right to its size, is far from the geometric mean of right and mistaken on.
_MISTAKEN = 1000.0
_FAR, _FAR_BY_RADIUS = _MISTAKEN**0.5, _MISTAKEN**0.25
# The ratio by a radius counts where the depth is as many radii as a mistaken one makes of the least depth of real
# tests, 0.001 radii (of hard samples), and of the largest.
_DEEP, _SHALLOW = 1e-3 * _MISTAKEN, _RADII / _MISTAKEN
# Residual of a straight line through all points, as a share of the force, below which it is that of a spring: a
# contact leaves 3 % and more.
_STRAIGHT = 1e-3
# Force at the start of that line, as a share of its range, up to which it counts as zero.
_FROM_NOTHING = 0.05
# Parameters in which the force is monotonic, so that its extremes are at corners of their bounds.
_MONOTONE = ("layer.E", "layer.thickness", "substrate.E", "indenter.radius")


def require_plausible(problem: Problem) -> None:
    """Raise CurveError for curves whose depth or force is impossible for the scene.

    Raises
    ------
    CurveError
        With both numbers, and what to check.
    """
    require_travel(problem)
    require_sizes(problem)


def require_travel(problem: Problem) -> None:
    """Raise CurveError where the depth of a curve is the deflection of a spring, or where its lever bends too far.

    A fit of such a curve may end inside its bounds.

    Raises
    ------
    CurveError
        With the stiffness of that spring, or by how much the lever bends more than it travels.
    """
    for member in problem.members:
        # A lever of the scene may have its sensitivity fitted, and a compliance that a person states is of a frame.
        in_series = member.curve.metadata.get(IN_SERIES, False)
        if member.scene.lever is None and (in_series or member.scene.instrument.compliance == 0.0):
            require_going_in(_indentation(member.scene, member.curve))
        if not member.scene.indenter.has_edge:
            _refuse_deflection(member.curve)


def _indentation(scene: Scene, curve: Curve) -> Curve:
    """Return the curve with the deflection of a compliance in series taken off its depth.

    Readings of depth before contact change by one number (m), which no difference of two depths holds.
    """
    compliance = scene.instrument.compliance
    if compliance == 0.0:
        return curve
    return replace(curve, depth=curve.depth - compliance * curve.force)


def in_doubt(found: Fit) -> bool:
    """Whether a fit may come from a mistaken unit or column: on a bound, without an error bar, or too deep."""
    if found.bounds_hit or found.no_error_bars:
        return True
    physical = found.problem.physical(found.vector)
    for member in found.problem.members:
        values = member.values_at(physical)
        in_series = values["instrument.compliance"] * float(np.ptp(member.curve.force))
        pressed = float(member.curve.depth.max()) - values["instrument.contact_depth"] - in_series
        if any(pressed > times * values.get(path, np.inf) for path, times, _ in _SIZES):
            return True
    return False


def require_sizes(problem: Problem) -> None:
    """Raise CurveError for curves whose depth or force is out of reach of the scene with its bounds.

    Raises
    ------
    CurveError
        With both numbers, and what to check.
    """
    for member in problem.members:
        priors = {path: problem.coordinates[entry].prior for path, entry in member.entries.items()}
        try:
            pressed, peak = _pressed(member.scene, member.curve)
        except (
            CurveError
        ):  # no contact: `check_quality` says it in more detail, `require_travel` what goes back
            continue
        if pressed > 0.0:
            _refuse_too_deep(member.scene, pressed, priors)
            _refuse_beyond_bounds(member.scene, pressed, peak, priors)


def size_notes(scene: Scene, curve: Curve) -> tuple[str, ...]:
    """A note where the modulus is as far from its starting value as a wrong unit of force or radius makes it.

    Parameters
    ----------
    scene : Scene
        The test with its starting values.
    curve : Curve
        The points that are fitted.
    """
    try:
        pressed, peak = _pressed(scene, curve)
        ratio = (
            peak / float(scene.contact_law(pressed, solver=_COARSE).force(pressed)) if pressed > 0.0 else 1.0
        )
    except (CurveError, InputError):  # the fit reports the error
        return ()
    if not (np.isfinite(ratio) and ratio > 0.0):
        return ()
    E = format_quantity(scene.parameters["layer.E"], "pressure")
    times = f"{ratio:.2g}" if ratio < 1.0 else f"{float(f'{ratio:.2g}'):.0f}"
    found = f"the modulus is about {times} times the {E} you began with"
    if not 1.0 / _FAR < ratio < _FAR:
        unit = _other_unit(curve, ratio)
        asked = "and are the depth, the spring constant and the radius in the units that are written?"
        return (f"{found}: is the force in {unit}, {asked}",)
    radius = scene.parameters.get("indenter.radius", np.inf)
    share = pressed / radius
    large = ratio < 1.0 / _FAR_BY_RADIUS and 0.0 < share < _SHALLOW
    small = ratio > _FAR_BY_RADIUS and share > _DEEP
    if not (large or small):
        return ()
    written, other = (
        format_quantity(length, "length")
        for length in (radius, radius / _MISTAKEN if large else radius * _MISTAKEN)
    )
    return (f"{found}, at a depth of {share:.2g} times the radius of {written}: is the radius {other}?",)


def _other_unit(curve: Curve, ratio: float) -> str:
    """The unit of force beside the one that the file says, for a modulus that is `ratio` times too large."""
    ladder = ("pN", "nN", "uN", "mN", "N", "kN")
    units = [unit for unit in (curve.metadata.get("units") or {}).values() if kind_of(str(unit)) == "force"]
    if units and (written := str(units[0]).replace("µ", "u")) in ladder:
        return ladder[min(max(ladder.index(written) + (-1 if ratio > 1.0 else 1), 0), len(ladder) - 1)]
    return "its unit"


def _pressed(scene: Scene, curve: Curve) -> tuple[float, float]:
    """Depth since contact (m) and force above the baseline (N) of the deepest loading point.

    Raises
    ------
    CurveError
        Where there is no contact.
    """
    curve = _indentation(scene, curve)
    foot = foot_of(curve)
    deepest = max(float(foot.depth[-1]), float(approach_of(curve).depth[-1]))
    return deepest - float(foot.depth[min(foot.rise, len(foot.depth) - 1)]), foot.peak


def _refuse_deflection(curve: Curve) -> None:
    """Raise CurveError for a force proportional to the depth: a deflection given as depth."""
    try:
        approach = approach_of(curve)
    except CurveError:  # no contact: reported elsewhere
        return
    x, force = approach.depth - approach.depth.mean(), approach.force
    power = float(x @ x)
    if len(x) < 3 or not power > 0.0:
        return
    slope, span = float(x @ force) / power, float(np.ptp(force))
    straight = float(np.std(force - slope * x)) < _STRAIGHT * span
    if straight and slope > 0.0 and abs(float(force[0])) < _FROM_NOTHING * span:
        raise CurveError(
            f"the force is proportional to the depth ({slope:.4g} N/m) from the first point on, as no contact is: "
            "the column given as depth looks like the deflection of the cantilever or frame; give the "
            "indentation, or the travel less the deflection"
        )


def _refuse_too_deep(scene: Scene, pressed: float, priors: dict[str, Prior]) -> None:
    for path, times, what in _SIZES:
        size = _bounds(path, scene, priors)[1]
        if pressed > times * size:
            part = path.partition(".")[0]
            raise CurveError(
                f"the depth or its unit looks wrong: pressed {format_quantity(pressed, 'length')} beyond contact "
                f"where the {part} is {format_quantity(size, 'length')} {what}; is the depth in the unit that its "
                f"column says (mm, um, nm), or does the scene need a larger {path.partition('.')[2]}?"
            )


def _refuse_beyond_bounds(scene: Scene, pressed: float, peak: float, priors: dict[str, Prior]) -> None:
    """Raise CurveError for a peak force (N) more than ten times beyond that of any modulus within its bounds."""
    low, high = _bounds("layer.E", scene, priors)
    if "layer.E" not in priors or not (low > 0.0 and np.isfinite(high)):
        return
    ends = {path: _bounds(path, scene, priors) for path in _MONOTONE if path in scene.parameters}
    ends = {path: pair for path, pair in ends.items() if path in priors}
    if not all(pair[0] > 0.0 and np.isfinite(pair[1]) for pair in ends.values()):
        return
    forces = []
    for corner in itertools.product(*ends.values()):
        try:
            law = scene.with_values(dict(zip(ends, corner, strict=True))).contact_law(pressed, solver=_COARSE)
            forces.append(float(law.force(pressed)))
        except InputError:  # a corner of the bounds without a law decides nothing
            return
    least, most = min(forces), max(forces)
    if peak > _BEYOND * most or peak < least / _BEYOND:
        times, side, end = (peak / most, "larger", high) if peak > most else (least / peak, "smaller", low)
        raise CurveError(
            f"depth, force or a unit looks wrong: {format_quantity(pressed, 'length')} beyond contact the force is "
            f"{times:.3g} times {side} than with layer.E at its bound of {format_quantity(end, 'pressure')}; check "
            "the units, which column is which, and the bounds"
        )


def _bounds(path: str, scene: Scene, priors: dict[str, Prior]) -> tuple[float, float]:
    """Smallest and largest value of a number of the scene; infinite where the scene does not have it."""
    if path in priors:
        return priors[path].support
    value = scene.parameters.get(path, np.inf)
    return value, value
