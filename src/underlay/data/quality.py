"""Can this curve be fitted, and what speaks against it? A verdict with reasons, before any fit.

``good``: nothing speaks against it. ``doubtful``: a fit is possible and should be looked at. ``refused``: no
contact law can be fitted; the reasons say why.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np

from underlay._arrays import FloatArray
from underlay._given import require_given
from underlay.data.contact_point import ContactPoint, contact_of, reach_of
from underlay.data.curve import Curve
from underlay.data.foot import Foot, foot_of
from underlay.data.segments import HOLD, LOADING, UNLOADING, one_of_each, runs_of
from underlay.data.withdrawal import lowest_of
from underlay.errors import CurveError, RangeError
from underlay.mechanics.contact_law import ContactLaw
from underlay.mechanics.halfspace import largest_halfspace_depth
from underlay.mechanics.indenters import Indenter, PowerLawShape, Sphere
from underlay.mechanics.solvers import Auto
from underlay.scene.scene import Scene
from underlay.units import format_quantity

GOOD = "good"
DOUBTFUL = "doubtful"
REFUSED = "refused"

# A force-depth exponent this far from the expected one, and further than the contact depth leaves open, is
# no accident: good spherical tests tried here lay within 0.15 (0.23 with a poorly known contact), ones that
# their laboratory set aside at 0.31 and 0.78.
_EXPONENT = 0.25
# The exponent is taken over the deeper half, where the contact depth matters least.
_DEEP = 0.5
# A peak below this many standard deviations of noise gives a modulus no better than some ten per cent.
_SIGNAL = 20.0
# A fall of the force by this share of its peak while the indenter goes in is a slip or a break.
_SLIP = 0.03
# A detector at its end writes one value, to a thousandth of the range, over so many points at least.
_TOP, _FEW_ON_TOP = 1e-3, 5
# The depth is held where its ends differ by less than this share of its range.
_STILL = 0.01
ADHESION = 0.1
_CONTACT_SHARE = 0.15
_FEW_POINTS = 20
# Further below the baseline than noise goes in a million points.
CLEAR = 6.0
# What to do about a dip.
_FIT_IT = "the tip adheres: fit it with adhesion (JKR) and its work of adhesion"
# With fewer points before contact there is no baseline to see it leave.
_FEW_BEFORE = 4
# A law's share in what is judged here: an exponent to 0.02, a contact depth beside its own noise.
_COARSE = Auto(1e-3)
# A paraboloid may stand for a ball while their forces differ by less than this.
_SHAPE = 0.02
# Over the radius: there they differ by half as much.
_SHALLOW = 0.1
# From one loading point to the next the indenter came back by this share of the depth pressed: another cycle.
_BACK = 0.1
# A test in air swings about the force at which the stage was told to stop; a real one goes far beyond it.
_BEYOND_SEARCH = 3.0


@dataclass(frozen=True)
class Quality:
    """Verdict on a curve before a fit.

    Parameters
    ----------
    verdict : str
        ``"good"``, ``"doubtful"`` or ``"refused"``.
    reasons : tuple of str
        One line each; empty for a good curve.
    contact : ContactPoint or None
        Contact point that was found.
    exponent, exponent_uncertainty, expected_exponent : float
        Exponent of force against indentation, its standard error, and the exponent that the scene (or a ball on a
        half-space) gives; NaN where there is none.
    signal_to_noise : float
        Peak force over the noise; NaN where there is no contact.
    """

    verdict: str
    reasons: tuple[str, ...]
    contact: ContactPoint | None = None
    exponent: float = float("nan")
    exponent_uncertainty: float = float("nan")
    expected_exponent: float = float("nan")
    signal_to_noise: float = float("nan")

    def require(self) -> None:
        """Raise an error with the reasons if the curve was refused.

        Raises
        ------
        CurveError
            With the reasons.
        """
        if self.verdict == REFUSED:
            raise CurveError("; ".join(self.reasons))


def check_quality(curve: Curve, scene: Scene | None = None) -> Quality:
    """Judge a curve before it is fitted.

    Parameters
    ----------
    curve : Curve
        The curve as it was read.
    scene : Scene, optional
        The scene it would be fitted with: gives the expected exponent and the shape of the indenter. Without it a
        ball on a half-space is assumed.

    Returns
    -------
    Quality
        The verdict. A bad curve raises no error here; see `Quality.require`.
    """
    require_given(curve, "curve", Curve)
    if "equilibrium_share" in curve.metadata:
        return _of_steps(curve)
    try:
        foot = foot_of(curve)
        loading = curve.way_in()
        law = _law(scene, foot, loading)
        contact = contact_of(foot, law, exponent=_shape_exponent(None if scene is None else scene.indenter))
        _refuse_failed_search(curve, contact)
        beyond = _Beyond.of(loading, contact)
        _refuse_nothing_beyond(beyond)
    except CurveError as error:
        return Quality(REFUSED, (str(error),))
    to_noise = float(beyond.force.max() / contact.noise) if contact.noise > 0.0 else float("inf")
    expected = _expected_exponent(scene, law, beyond)
    found = Quality(GOOD, (), contact, *_exponent(loading, contact), expected, to_noise)
    reasons = tuple(_doubts(curve, loading, contact, beyond, scene, found))
    return replace(found, verdict=DOUBTFUL, reasons=reasons) if reasons else found


def _of_steps(curve: Curve) -> Quality:
    """Judge the equilibrium points of a stepwise test: they have no baseline and no continuous loading to check."""
    if not (curve.force > 0.0).any():
        return Quality(REFUSED, ("no contact: no hold of the test has a force",))
    order = np.argsort(curve.depth)
    fell = np.flatnonzero(np.diff(curve.force[order]) < 0.0)
    told = [
        f"hold {order[at + 1] + 1} is deeper than hold {order[at] + 1} and its force is smaller"
        for at in fell
    ]
    if len(curve) == 1:
        told.append("one hold alone: no other reading can speak against the model")
    return Quality(DOUBTFUL if told else GOOD, tuple(told))


def _law(scene: Scene | None, foot: Foot, loading: Curve) -> ContactLaw | None:
    """Return the scene's contact law up to the largest depth of the loading, or at least of its part near contact.

    None without a scene, and where the law is not valid that deep: then a power law takes its place.
    """
    if scene is None:
        return None
    shallow = reach_of(foot)
    for reach in (shallow + float(loading.depth.max() - foot.depth[0]), shallow):
        try:
            # Curves of one map ask for the same law.
            kept = _COARSE.kept_law(scene.contact, reach) if scene.discrepancy is None else None
            return kept or scene.contact_law(reach, solver=_COARSE)
        except RangeError:
            continue
    return None


@dataclass(frozen=True)
class _Beyond:
    """Loading points after contact: indentation (m) and force above the baseline (N), both (n,)."""

    depth: FloatArray
    force: FloatArray

    @classmethod
    def of(cls, loading: Curve, contact: ContactPoint, shift: float = 0.0) -> _Beyond:
        pressed = loading.depth - (contact.depth + shift)
        force = loading.force - (contact.baseline + contact.baseline_slope * loading.depth)
        inside = pressed > 0.0
        return cls(pressed[inside], force[inside])


def _refuse_nothing_beyond(beyond: _Beyond) -> None:
    if not len(beyond.depth) or not beyond.force.max() > 0.0:
        raise CurveError(
            "no contact: no point of the way in with a force lies beyond where the contact was found; check the "
            "depth, which should grow all through the way in"
        )


def _refuse_failed_search(curve: Curve, contact: ContactPoint) -> None:
    """Raise an error for a test in air, by the record of the instrument's search for contact.

    Its search stopped below the force that was asked for, and the test's own force stayed as small.
    """
    asked = curve.metadata.get("search_criterion")
    reached = curve.metadata.get("search_reached")
    if asked is None or reached is None or reached >= 0.9 * asked:
        return
    peak = float(np.max(curve.force) - (contact.baseline + contact.baseline_slope * contact.depth))
    if peak < _BEYOND_SEARCH * asked:
        raise CurveError(
            f"no contact: the search for it stopped at {_grams(reached)} where {_grams(asked)} was asked, "
            f"and the peak force {_grams(peak)} is no more than the swings of the load cell in air"
        )


def _grams(force: float) -> str:
    return f"{force / 9.80665e-3:.3f} gf"


def _doubts(
    curve: Curve,
    loading: Curve,
    contact: ContactPoint,
    beyond: _Beyond,
    scene: Scene | None,
    found: Quality,
) -> Iterator[str]:
    peak = float(beyond.force.max())
    deepest = float(beyond.depth.max())
    if contact.noise > 0.0 and peak < _SIGNAL * contact.noise:
        sigmas = peak / contact.noise
        yield f"the largest force, {format_quantity(peak, 'force')}, is only {sigmas:.0f} times the noise"
    before = int(np.count_nonzero(loading.depth < contact.depth))
    # An instrument that searched for contact begins its record there, and says so.
    if before < _FEW_BEFORE and curve.metadata.get("search_criterion") is None:
        yield (
            f"the curve begins in contact ({before} points lie before it): its contact point, and with it the "
            "modulus, rests on the shape of the model; record a longer approach"
        )
    if len(beyond.depth) < _FEW_POINTS:
        yield f"only {len(beyond.depth)} points beyond contact"
    if not np.isfinite(found.exponent):
        yield "too few points beyond contact to see how the force grows with the depth"
    elif abs(found.exponent - found.expected_exponent) > max(_EXPONENT, 2.0 * found.exponent_uncertainty):
        yield _about_exponent(found.exponent, found.expected_exponent)
    yield from (
        f"a flat top: {flat}: a saturated detector; fit up to 95 % of the force"
        for flat in flat_tops(loading, deepest)
    )
    yield from _risen_holds(curve, peak, contact.noise)
    ways = _ways_in(curve, beyond)
    if len(ways) > 1:
        yield (
            f"the sample is loaded {len(ways)} times: all loadings are fitted as one, which holds for an elastic "
            "sample alone; fit one of them (ramp 1)"
        )
    fall = max(_largest_fall(force) for force in ways)
    if fall > _SLIP * peak + 6.0 * contact.noise:
        yield (
            f"the force falls by {format_quantity(fall, 'force')} ({100.0 * fall / peak:.0f} % of its peak) "
            "while the indenter goes in: the tip slipped, or the sample broke"
        )
    unsure = max(contact.uncertainty, contact.scatter)
    if unsure > _CONTACT_SHARE * deepest:
        yield (
            f"the contact point is uncertain by {format_quantity(unsure, 'length', digits=2)}, "
            f"{100.0 * unsure / deepest:.0f} % of the indentation"
        )
    if scene is None or not scene.adheres:
        yield from _stickiness(curve, contact, beyond, peak)
    yield from _shape_doubts(curve, scene, deepest)


def flat_tops(loading: Curve, deepest: float) -> Iterator[str]:
    """Yield a clause if the force stays at its maximum while the depth grows, as of a saturated detector.

    `deepest` is the largest indentation (m).
    """
    top = loading.force >= loading.force.max() - _TOP * float(np.ptp(loading.force))
    first = len(top) - int(np.argmin(top[::-1])) if not top.all() else 0
    count, went = len(top) - first, float(np.ptp(loading.depth[first:])) if first < len(top) else 0.0
    if count >= _FEW_ON_TOP and went > _SLIP * deepest:
        yield (
            f"the force stays at {format_quantity(float(loading.force.max()), 'force')} over the last "
            f"{count} points while the indenter goes in by {format_quantity(went, 'length')}"
        )


def _risen_holds(curve: Curve, peak: float, noise: float) -> Iterator[str]:
    """Yield a doubt if the force rises while the depth is held: a real sample relaxes."""
    for first, last, label in runs_of(curve.segments()):
        if label != HOLD or first == 0 or last - first < _FEW_POINTS:
            continue
        width = max(3, (last - first) // 20)
        depth, force = (
            float(column[last - width : last].mean() - column[first : first + width].mean())
            for column in (curve.depth, curve.force)
        )
        if force > max(_SLIP * peak, CLEAR * noise) and abs(depth) < _STILL * float(np.ptp(curve.depth)):
            yield (
                f"the force rises by {format_quantity(force, 'force')} ({100.0 * force / peak:.0f} % of its peak) "
                "while the depth is held, where a sample would relax: look for drift of the force or the stage"
            )
            return


def _stickiness(curve: Curve, contact: ContactPoint, beyond: _Beyond, peak: float) -> Iterator[str]:
    """Yield a doubt, with adhesion as remedy, if the force falls below the baseline in loading or unloading."""
    dip = -float(beyond.force.min())
    if dip > ADHESION * peak:
        yield (
            f"the force dips by {100.0 * dip / peak:.0f} % of its peak while the indenter goes in: {_FIT_IT}"
        )
    lowest = lowest_of(curve)
    if lowest is None:
        return
    below = contact.baseline + contact.baseline_slope * lowest.depth - lowest.force
    if below > max(ADHESION * peak, CLEAR * lowest.scatter):
        yield (
            f"the unloading shows a pull-off force of {format_quantity(below, 'force', digits=3)}: {_FIT_IT}, from "
            "the unloading"
        )


def _about_exponent(exponent: float, expected: float) -> str:
    why = (
        "a slip, a wrong contact point, or a tip that does not stay in contact"
        if exponent < expected
        else "a contact point set too early, a stiffer substrate, or a sample that stiffens with strain"
    )
    return f"the force grows as depth^{exponent:.2f} where depth^{expected:.2f} is expected: {why}"


def _exponent(loading: Curve, contact: ContactPoint) -> tuple[float, float]:
    """Return the slope of log force against log indentation, and its error by that of the contact depth."""
    best = _slope(_Beyond.of(loading, contact))
    if not np.isfinite(best):
        return best, np.inf
    shifted = [_slope(_Beyond.of(loading, contact, sign * contact.uncertainty)) for sign in (-1.0, 1.0)]
    return best, float(np.nanmax(np.abs(np.array(shifted) - best))) if np.isfinite(shifted).any() else np.inf


def _slope(beyond: _Beyond) -> float:
    if not len(beyond.depth):
        return float("nan")
    used = (beyond.depth > _DEEP * beyond.depth.max()) & (beyond.force > 0.0)
    if np.count_nonzero(used) < 4:
        return float("nan")
    return _slope_of(np.log(beyond.depth[used]), np.log(beyond.force[used]))


def _slope_of(x: FloatArray, y: FloatArray) -> float:
    """Return the slope of the least-squares line through points with coordinates `x` and `y`, (n,)."""
    x = x - x.mean()
    squares = float(x @ x)
    return float(x @ y) / squares if squares > 0.0 else float("nan")


def _ways_in(curve: Curve, beyond: _Beyond) -> list[FloatArray]:
    """Return the forces (N) of each loading, split where the indenter was withdrawn in between."""
    labels = one_of_each(curve.segments())
    out = np.flatnonzero(labels == UNLOADING)
    # Noise of the depth alone makes no cycles.
    if not out.size or not (labels[out[0] :] == LOADING).any():
        return [beyond.force]
    back = np.diff(beyond.depth) < -_BACK * beyond.depth.max()
    return np.split(beyond.force, np.flatnonzero(back) + 1)


def _largest_fall(force: FloatArray) -> float:
    """Return the largest drop of the force (N) below its running maximum, after smoothing over a few points."""
    width = max(1, len(force) // 50)
    total = np.cumsum(np.concatenate(([0.0], force)))
    smooth = (total[width:] - total[:-width]) / width
    return float(np.max(np.maximum.accumulate(smooth) - smooth)) if len(smooth) else 0.0


def _expected_exponent(scene: Scene | None, law: ContactLaw | None, beyond: _Beyond) -> float:
    """Return the exponent of the scene's own contact law over the same depths; 1.5 without a scene."""
    if scene is None:
        return 1.5
    if scene.adheres:
        return float("nan")  # no power law: the force begins below zero
    deepest = float(beyond.depth.max())
    depth = np.linspace(_DEEP * deepest, deepest, 24)
    if law is None or law.max_depth < deepest:
        try:
            law = scene.contact_law(deepest, solver=_COARSE)
        except RangeError:  # the scene's law does not reach as deep: the fit will say so itself
            return _shape_exponent(scene.indenter)
    return _slope_of(np.log(depth), np.log(law.force(depth)))


def _shape_exponent(indenter: Indenter | None) -> float:
    if indenter is not None and indenter.has_edge:
        return 1.0
    return 1.0 + 1.0 / indenter.exponent if isinstance(indenter, PowerLawShape) else 1.5


def _shape_doubts(curve: Curve, scene: Scene | None, deepest: float) -> Iterator[str]:
    """Yield a doubt if a ball is pressed so deep that a paraboloid does not approximate it."""
    indenter = None if scene is None else scene.indenter
    radius = curve.metadata.get("indenter_radius") if indenter is None else indenter.curvature_radius
    if radius is None or (indenter is not None and indenter.power_law is not indenter):
        return
    if deepest > largest_halfspace_depth(Sphere(float(radius))):
        yield f"indented to {deepest / radius:.2g} tip radii: no sphere holds contact so deep; is the radius right?"
        return
    if deepest < _SHALLOW * radius:
        return
    difference = _ball_against_paraboloid(deepest / float(radius))
    if difference > _SHAPE:
        yield (
            f"indented to {deepest / radius:.2g} tip radii: there a paraboloid is off by "
            f"{100.0 * difference:.0f} % in force; choose the sphere"
        )


def _ball_against_paraboloid(ratio: float) -> float:
    """Return the relative difference of force between ball and paraboloid on a half-space, at depth over radius."""
    depth, ball = np.array([ratio]), Sphere(1.0)
    force, rounded = (
        tip.halfspace_force(depth, tip.halfspace_radius(depth)) for tip in (ball, ball.power_law)
    )
    return abs(float(rounded[0] / force[0]) - 1.0)
