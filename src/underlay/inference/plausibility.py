"""Refuses depth, force and scene that do not belong together, such as mistaken columns or units.

Each refusal needs a mismatch that no material explains: deeper than the layer is thick, ten radii deep, a modulus
ten times beyond its own bounds, or a force proportional to the depth from the first point on.
"""

from __future__ import annotations

import itertools
from typing import TYPE_CHECKING

import numpy as np

from underlay.data.foot import approach_of, foot_of
from underlay.errors import CurveError, InputError
from underlay.mechanics.solvers import Auto
from underlay.units import format_quantity, kind_of

if TYPE_CHECKING:
    from underlay.data.curve import Curve
    from underlay.inference.least_squares.fit_result import Fit
    from underlay.inference.priors import Prior
    from underlay.inference.problem import Problem
    from underlay.scene.scene import Scene

# Depth over the radius of a ball from which a curve is refused: real laboratories indent to 1.4 radii; at ten no
# law holds.
_RADII = 10.0
# Lengths of a scene with which the depth is compared, the multiple of each from which it is refused, and words for
# messages.
_SIZES = (("layer.thickness", 1.0, "thick"), ("indenter.radius", _RADII, "in radius"))
# Factor beyond the forces of all moduli within bounds from which a force is refused; the depth since contact is
# known to a factor of two, which is a factor of three in a force ~ depth^1.5.
_BEYOND = 10.0
_COARSE = Auto(1e-2)  # the law used for it: far more accurate than that factor
# Ratio of a modulus to its starting value that indicates a mistaken unit.
_FAR = 100.0
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
    """Raise CurveError where the depth of a curve is the deflection of a spring.

    A fit of such a curve may end inside its bounds.

    Raises
    ------
    CurveError
        With the stiffness of that spring.
    """
    for member in problem.members:
        if not member.scene.indenter.has_edge:
            _refuse_deflection(member.curve)


def in_doubt(found: Fit) -> bool:
    """Whether a fit may come from a mistaken unit or column: on a bound, without an error bar, or too deep."""
    if found.bounds_hit or found.no_error_bars:
        return True
    physical = found.problem.physical(found.vector)
    for member in found.problem.members:
        values = member.values_at(physical)
        pressed = float(member.curve.depth.max()) - values["instrument.contact_depth"]
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
        _require_sizes(member.scene, member.curve, priors)


def size_notes(scene: Scene, curve: Curve) -> tuple[str, ...]:
    """A note where the force differs from that of the starting modulus by a factor of 100, as by a wrong unit.

    Parameters
    ----------
    scene : Scene
        The test with its starting values.
    curve : Curve
        The points that are fitted.
    """
    try:
        foot = foot_of(curve)
        pressed = float(foot.depth[-1] - foot.depth[min(foot.rise, len(foot.depth) - 1)])
        pressed = max(
            pressed, float(approach_of(curve).depth[-1] - foot.depth[min(foot.rise, len(foot.depth) - 1)])
        )
        ratio = (
            foot.peak / float(scene.contact_law(pressed, solver=_COARSE).force(pressed))
            if pressed > 0.0
            else 1.0
        )
    except (CurveError, InputError):  # the fit reports the error
        return ()
    if not np.isfinite(ratio) or 1.0 / _FAR < ratio < _FAR:
        return ()
    units = [unit for unit in (curve.metadata.get("units") or {}).values() if kind_of(str(unit)) == "force"]
    ladder = ("pN", "nN", "uN", "mN", "N", "kN")
    asked = "its unit"
    if units and (written := str(units[0]).replace("µ", "u")) in ladder:
        asked = ladder[min(max(ladder.index(written) + (-1 if ratio > 1.0 else 1), 0), len(ladder) - 1)]
    E = format_quantity(scene.parameters["layer.E"], "pressure")
    times = f"{ratio:.2g}" if ratio < 1.0 else f"{float(f'{ratio:.2g}'):.0f}"
    note = (
        f"the modulus is about {times} times the {E} you began with: is the force in {asked}, and are the spring "
        "constant and the radius in the units that are written?"
    )
    return (note,)


def _require_sizes(scene: Scene, curve: Curve, priors: dict[str, Prior]) -> None:
    try:
        foot = foot_of(curve)
    except CurveError:  # no contact: other checks report it in more detail
        return
    pressed = float(foot.depth[-1] - foot.depth[foot.rise]) if foot.rise < len(foot.depth) else 0.0
    pressed = max(
        pressed, float(approach_of(curve).depth[-1] - foot.depth[min(foot.rise, len(foot.depth) - 1)])
    )
    if not pressed > 0.0:
        return
    _refuse_too_deep(scene, pressed, priors)
    _refuse_beyond_bounds(scene, pressed, foot.peak, priors)


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
