"""The verdict whether a fit can be used: one word, one clause, the likeliest cause, and the next step.

It rests on how much a disturbance changes the fitted number, not on a significance test: the change of the apparent
modulus over the fitted range, the force step at contact and the drift of the baseline (`Seen`), and the widths of
the intervals. Correlated noise alone is no reason for doubt.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from typing import TYPE_CHECKING, TypeAlias

import numpy as np

from underlay.data.segments import LOADING, runs_of
from underlay.errors import CurveError, InputError
from underlay.inference.least_squares.diagnostics import diagnose
from underlay.inference.least_squares.fit_warnings import NO_CONTACT
from underlay.inference.uncertainty.answer import Advice, Answer
from underlay.inference.uncertainty.reading import Reading
from underlay.mechanics.response import WholeHistory
from underlay.quantities import path_of
from underlay.scene.fit_range import BEYOND
from underlay.scene.instrument import ContactDepth
from underlay.units import format_quantity

if TYPE_CHECKING:
    from underlay.data.curve import Curve
    from underlay.inference.least_squares.fit_result import Fit
    from underlay.inference.uncertainty.seen import Seen
    from underlay.scene.scene import Scene

# Cause, next step and setting of an advice.
_Remedy: TypeAlias = tuple[str, str, tuple[str, str] | tuple[()]]
#: Words of a verdict.
GOOD, CHECK, REJECT = "good", "check", "reject"
# Changes of the apparent modulus over the range from which a model is to be checked, and rejected; and how many
# standard deviations a change must exceed: of 2000 clean curves one in a thousand exceeds it by chance.
_CHANGED, _WRONG, SURE = math.log(1.10), math.log(1.30), 4.0
# Residuals, as a share of the largest force, below which a model is not rejected: the first of three real curves of
# cartilage changes by 41 % near its contact point and is fitted to 0.8 %; the poor ones have residuals of 2.2 and 9
# %.
_DESCRIBED = 0.02
# Residuals, as the same share, above which any model is rejected, unless they are white noise: three ramps of a
# stepwise test fitted as one leave residuals of 20 %.
_NOT_DESCRIBED = 0.05
# Steps of time, over the median, from which readings are left out between two loadings.
_GAP = 10.0
# Residuals over the stated noise from which the noise is not as stated, or the model not right.
_BEYOND_NOISE = 3.0
# Rises of a half-space's modulus (in ln) from which a stiffer base is the likely cause, and from which there may be
# one: a base twelve depths below makes E 13 % too large and shows 5 %, since the contact point hides the rest.
_CHANGED_HALF_SPACE, _RISES = math.log(1.20), math.log(1.03)
# Share of the depth over which a step at contact rises, and share of the depth that counts as shallow.
_RISE, _TENTH = 0.03, 0.1
# Share of a misfit in the first fifth of the depth from which contact is judged to be gradual.
_FOOT = 0.7
# Probability from which a step, a ramp or a turn is reported, and the share of the largest force that it must pass.
_LIKELY, _VISIBLE = 0.9, 0.02
# Share of the variance due to one input, and half width of the interval, from which that input is reported.
_ONE_INPUT, _WIDE = 0.8, 0.30
# 1/Jm of soft tissue, the middle of its prior (the study of stiffening layers, section 3).
_USUAL_LIMIT = 0.5
# Ratio of the ends of an interval from which a number is reported as known to a factor only.
_FACTOR = 2.0
# Next step and setting where the baseline is not constant.
_FIT_SLOPE = ("fit a baseline slope", ("fit.instrument.baseline_slope", "{}"))
_SETTLE = ("let the instrument settle before a test, or fit the readings before the turn",)
_WORDS = {
    "indenter.radius": "the tip radius",
    "layer.thickness": "the thickness",
    "layer.nu": "Poisson's ratio",
}
# Warnings of a fit that decide whether its numbers can be used: cause and next step.
_WARNED = {
    "not-converged": ("the search met no optimum", "give a start nearer to the sample's values"),
    "law-range": ("the contact model's range ends before the curve", "fit a smaller depth"),
    "too-deep": ("indentation deeper than the layer is thick", "fit a smaller depth, or a smaller tip"),
    "file": ("scene file of another test", "enter what the curve's file says"),
    "over-whitened": ("the stated correlation time is too long", "state a shorter one, or none"),
    "prior": ("a prior that does not fit this sample, or a model that does not", "check the prior"),
    "correlated-residuals": (
        "the noise is not as stated",
        "leave the noise out: what the curve shows is allowed for",
    ),
    "contradiction": (
        "curves of unlike sites or samples, or a tip whose size is not as entered",
        "fit each curve alone, or leave out of shared what differs between them",
    ),
    "second-optimum": ("two quantities trade off along the curve", "add a curve with a second tip radius"),
}


def verdict_of(fit: Fit, reading: Reading, answer: Callable[[str], Answer]) -> Advice:
    """Judge a fit by the disturbances of its curves and by its answers.

    Parameters
    ----------
    fit : Fit
        The fit.
    reading : Reading
        Intervals, draws and disturbances from its likelihood.
    answer : callable
        Answer of a quantity by its name.
    """
    found = list(_found(fit, reading, answer))
    if not found:
        return Advice(GOOD, f"the model describes the curve{_residuals(fit)}")
    first = next((entry for entry in found if entry.word == REJECT), found[0])
    return replace(first, others=tuple(entry for entry in found if entry is not first))


def _residuals(fit: Fit) -> str:
    """The residuals as text: root mean square as a percentage of the largest force, the worst curve's."""
    share = 100.0 * max(_left(fit, i) for i in range(len(fit.curves)))
    return f" (residuals {f'{share:.0f}' if share >= 1.0 else f'{share:.1g}'} %)"


def _left(fit: Fit, i: int) -> float:
    """Root mean square of one curve's residuals over its largest force."""
    residual = fit.residuals[i]
    return float((residual @ residual / len(residual)) ** 0.5) / float(abs(fit.curves[i].force).max())


def _found(fit: Fit, reading: Reading, answer: Callable[[str], Answer]) -> Iterator[Advice]:
    for i, seen in enumerate(reading.likelihood.seen):
        yield from _of_memory(fit, i)  # first: it knows the cause
        yield from _of_misfit(fit, i, seen)
        yield from _of_the_rest(fit, i)
    if reading.pareto > 0.7:
        yield Advice(
            CHECK,
            "the intervals rest on few draws",
            "parameters that trade off along a curved ridge",
            "sample the posterior by a long chain (method emcee)",
        )
    others = ("noise.", "instrument.", "lever.", "discrepancy.")
    answers = [answer(name) for name in fit.names if not name.startswith(others)]
    for name, bound in fit.bounds_hit.items():
        yield Advice(
            CHECK,
            f"{name} ended on its {bound}",
            "bounds too narrow, or a number that this curve does not determine",
            "widen its bounds, or enter its value and leave it out of the fit",
        )
    yield from _of_widths(fit, reading, answers)
    yield from _of_inputs(answers)
    for i, seen in enumerate(reading.likelihood.seen):
        yield from _of_readings(fit, i, seen)
    yield from _of_warnings(fit)


def _in_words(change: float) -> str:
    """A change of a logarithm in words: per cents, or the power of ten of a factor beyond a thousand."""
    if change > math.log(1e3):
        return f"a factor of 1e{change / math.log(10.0):.0f}"
    return f"{100.0 * abs(math.expm1(change)):.0f} %"


# --- the model ----------------------------------------------------------------------------------------------
def _of_misfit(fit: Fit, i: int, seen: Seen) -> Iterator[Advice]:
    """Advice where the law does not fit: everywhere, or by an amount that changes with depth."""
    signed, deviation = change_with_depth(fit, i)
    change, scene = abs(signed), fit.scenes[i]
    half_space = scene.substrate is None and signed > 0.0
    if change < (_RISES if half_space else _CHANGED) or change < SURE * deviation:
        if _left(fit, i) > _NOT_DESCRIBED and seen.white < _LIKELY:
            yield Advice(
                REJECT, f"the model does not describe the curve{_residuals(fit)}", *_undescribed(fit, i)
            )
        elif (times := _over_stated_noise(fit, i)) > _BEYOND_NOISE:
            yield Advice(
                CHECK,
                f"the model does not describe the curve: residuals are {times:.2g} times the noise that you stated",
                "noise larger than stated, or a tip or an effect that is not in the model",
                "look at the picture; leave the noise out, and what the curve shows is allowed for",
            )
        return
    curve, share = fit.curves[i], _in_words(signed)
    caused = _cause_in_curve(fit, i)
    if seen.foot > _FOOT and not caused:
        yield Advice(
            CHECK,
            f"contact is made gradually: the first fifth of the depth is off by {share}",
            "a rough, tilted or brushy surface; or the tip or the thickness is not as entered",
            "fit from a fifth of the force on, and report the modulus of that range",
            ("curve.fit_from", "20 % of force"),
        )
        return
    if half_space and not scene.adheres and change > _CHANGED_HALF_SPACE:
        change = max(change, _WRONG)
    word = REJECT if change >= _WRONG and (half_space or _left(fit, i) > _DESCRIBED) else CHECK
    if scene.adheres:
        yield Advice(
            word,
            f"the model of a tip that adheres does not describe the curve{_residuals(fit)}",
            "this curve hardly tells E from the work of adhesion, or the tip's radius or shape is not as entered",
            "enter the tip radius from its data sheet, and fit the approach too where it was recorded",
            ("curve.segment", "all"),
        )
        return
    pressed = float(curve.depth.max()) - scene.instrument.contact_depth
    stiffens = signed > 0.0 and _may_stiffen(scene, pressed)
    if half_space:
        reason = f"the half-space model does not describe the curve: E rises with depth by {share}"
        remedy: _Remedy = (
            "a stiffer base below the layer"
            + (", or a sample that stiffens with strain" if stiffens else ""),
            "enter the thickness of the layer, and its substrate",
            ("layer.thickness", "<your thickness>"),
        )
    else:
        reason = f"the curve is {'stiffer' if signed > 0.0 else 'softer'} at depth than the model, by {share}"
        half = format_quantity(0.5 * pressed, "length", digits=3)
        following = f"check these numbers; if they are right, fit up to half of the depth ({half})"
        remedy = (_cause(scene, signed), following, ("curve.fit_to", half))
        if stiffens:
            following = "fit its strain stiffening too, inverse_limit (1/Jm, such as 0.5) free"
            remedy = (remedy[0], following, ("layer.stiffening.model", "gent"))
    yield Advice(word, reason, *(caused or remedy))


def _undescribed(fit: Fit, i: int) -> _Remedy:
    """Why a model describes nothing of a curve: what the curve shows, or a modulus that cannot follow."""
    moduli = [name for name in fit.names if path_of(name).startswith("layer.E")]
    for name in moduli:
        if name in fit.bounds_hit:
            return (f"{name} ended on its {fit.bounds_hit[name]}", "widen its bounds", ())
    if caused := _cause_in_curve(fit, i):
        return caused
    if not moduli:
        cause = "the layer's modulus is held at the number that you entered"
        return (cause, "fit it too", ("fit.layer.E", "{}"))
    return (
        "a tip or an effect that is not in the model",
        "look at the picture, and check the tip's shape and size and the units of the file",
        (),
    )


def _over_stated_noise(fit: Fit, i: int) -> float:
    """Root mean square of a curve's residuals over the noise that was stated; zero where none was.

    What the contact law itself may be off by counts as noise.
    """
    if fit.problem.noise is None or fit.statistics.noise_estimated:
        return 0.0
    residual, peak = fit.residuals[i], float(abs(fit.curves[i].force).max())
    allowed = np.hypot(fit.sigmas[i], fit.statistics.law_error * peak)
    return float(np.mean((residual / allowed) ** 2) ** 0.5)


def _cause_in_curve(fit: Fit, i: int) -> _Remedy | tuple[()]:
    """A fault that one curve shows by itself: a saturated detector, several loadings, or a tip that adheres."""
    # Loaded only where a verdict is in doubt.
    from underlay.data.quality import flat_tops  # noqa: PLC0415  see above

    scene = fit.scenes[i]
    loading = fit.curves[i].way_in()
    for flat in flat_tops(loading, float(loading.depth.max()) - scene.instrument.contact_depth):
        return (
            f"a saturated detector: {flat}",
            "fit up to 95 % of the force",
            ("curve.fit_to", "95 % of force"),
        )
    if scene.memory is None and _loadings(fit.curves[i]) > 1:
        return (
            "several loadings fitted as one, or a tip or an effect that is not in the model",
            "look at the picture, and fit one ramp of it",
            ("curve.segment", "ramp 1"),
        )
    if not scene.adheres and _dips(loading):
        return (
            "the tip adheres: the force dips below the baseline while it goes in",
            "fit with adhesion (JKR) and its work of adhesion",
            ("adhesion.model", "jkr"),
        )
    return ()


def _loadings(curve: Curve) -> int:
    """Number of loadings of a curve: runs of them, or stretches between gaps in time, where holds are left out."""
    runs = sum(label == LOADING for _, _, label in runs_of(curve.segments()))
    if curve.time is None:
        return runs
    steps = np.diff(curve.time)
    return max(runs, 1 + int(np.count_nonzero(steps > _GAP * np.median(steps))))


def _dips(loading: Curve) -> bool:
    """Whether the force of a way in falls below its own baseline; the baseline of a wrong fit is no judge."""
    # Loaded only where a verdict is in doubt.
    from underlay.data.foot import foot_of  # noqa: PLC0415  see above
    from underlay.data.quality import ADHESION, CLEAR  # noqa: PLC0415  see above

    try:
        foot = foot_of(loading)
    except CurveError:  # it has no foot to dip
        return False
    noise = float(np.median(np.abs(np.diff(loading.force))))
    return foot.dip > max(ADHESION * foot.peak, CLEAR * noise)


def _may_stiffen(scene: Scene, deepest: float) -> bool:
    """Whether a strain-stiffening layer could be used for this test, to the depth `deepest` (m), and is not yet."""
    # Loaded only for a curve that its model does not fit.
    from underlay.mechanics.stiffening.law import Gent  # noqa: PLC0415  see above

    if scene.layer.stiffening is not None:
        return False
    try:
        replace(scene, layer=replace(scene.layer, stiffening=Gent(_USUAL_LIMIT))).contact_law(deepest)
    except InputError:
        return False
    return True


def change_with_depth(fit: Fit, i: int) -> tuple[float, float]:
    """ln of the apparent modulus at full depth over that at a tenth of it, and its standard deviation.

    By linear regression of one curve's residuals on a relative error of the force that grows as sqrt(w), w the
    indentation depth, together with all free parameters and a step at contact, whose shape is similar. The standard
    deviation allows for the correlation of the remaining residuals.
    """
    problem = fit.problem
    member, physical = problem.members[i], problem.physical(fit.vector)
    reading, jacobian = member.jacobian(physical, rough=True)
    w = member.forward.depth - member.values_at(physical)[ContactDepth.path]
    deepest = float(w.max())
    grown, stepped = np.sqrt(np.maximum(w, 0.0) / deepest), np.clip(w / (_RISE * deepest), 0.0, 1.0)
    acting = np.abs(jacobian).max(axis=0) > 0.0
    columns = np.column_stack((reading.contact * grown, stepped, jacobian[:, acting]))
    scale = np.abs(columns).max(axis=0)
    design, residual = columns / scale, member.force - reading.force
    found = np.linalg.lstsq(design, residual, rcond=None)[0]
    left = residual - design @ found
    variance = float(left @ left) / max(len(left) - len(scale), 1)
    inverse = np.linalg.pinv(design.T @ design)
    over = (1.0 - _TENTH**0.5) / scale[0]
    deviation = (variance * float(inverse[0, 0])) ** 0.5 * diagnose(left, left).too_narrow_by
    return float(found[0]) * over, deviation * over


def _of_memory(fit: Fit, i: int) -> Iterator[Advice]:
    """Advice from the sample's time-dependent model about its record at the fitted numbers."""
    scene, curve = fit.scenes[i], fit.curves[i]
    memory = scene.memory
    if isinstance(memory, WholeHistory) and curve.time is not None:
        force = curve.force - scene.instrument.chain.reading(np.zeros_like(curve.depth), curve.depth)
        for doubt in memory.doubts(curve.depth - scene.instrument.contact_depth, force, curve.time):
            yield Advice(*doubt)


def _cause(scene: Scene, change: float) -> str:
    if change > 0.0:
        return "the tip or the thickness is not as entered, or the sample stiffens with strain"
    changes = (
        "the sample relaxes while it is loaded"
        if scene.memory is None
        else "strains are too large for the model"
    )
    return f"the tip, the thickness or the frame's compliance is not as entered, or {changes}"


def _of_the_rest(fit: Fit, i: int) -> Iterator[Advice]:
    """Advice where the model of a fitted range does not foretell the readings beyond the range's upper end."""
    curve, scene, problem = fit.curves[i], fit.scenes[i], fit.problem
    rest = curve.metadata.get(BEYOND)
    if rest is None or not scene.is_elastic:
        return
    depth, force = np.asarray(rest, dtype=np.float64)
    member = problem.members[i]
    try:
        found = member.forward.moved(depth, force).reading(member.values_at(problem.physical(fit.vector)))
    except InputError:  # no law reaches so deep: nothing is foretold
        return
    if not found.contact.min() > 0.0:
        return
    off = float(np.mean((force - found.force) / found.contact))
    by_chance = SURE * float(np.std(fit.residuals[i]) / found.contact.mean()) / len(depth) ** 0.5
    if abs(off) > max(math.expm1(_CHANGED), by_chance):
        yield Advice(
            CHECK,
            f"beyond the fitted range the force is {100.0 * abs(off):.0f} % "
            f"{'above' if off > 0.0 else 'below'} the model",
            "the tip's shape or size, the thickness or the frame's compliance is not as entered, or the sample "
            "changes with depth",
            "check these numbers; the modulus is that of the fitted range alone",
        )


# --- the answers --------------------------------------------------------------------------------------------
def _of_widths(fit: Fit, reading: Reading, answers: Sequence[Answer]) -> Iterator[Advice]:
    for known in answers:
        if known.is_open:
            yield Advice(
                CHECK,
                f"{known.name} is not determined by this curve",
                "two quantities trade off along the curve",
                "enter one of them, or add a curve with a second tip radius",
            )
        elif known.low == 0.0:
            yield Advice(
                CHECK,
                f"{known.name} may as well be zero: it is below {known.high:.2g}",
                "strains too small to show it, or nothing to show",
                "indent deeper, or leave it out",
            )
        elif known.low > 0.0 and known.high > _FACTOR * known.low:
            first = known.contributions[0]
            rests = f"{first.source} makes {100.0 * first.share:.0f} % of the variance"
            remedy = (rests, "measure that better, and state its uncertainty", ())
            yield Advice(
                CHECK,
                f"{known.name} is known to a factor of {known.high / known.low:.2g} only",
                *(_why_wide(fit, reading) if first.origin == "seen" else remedy),
            )


def _why_wide(fit: Fit, reading: Reading) -> _Remedy:
    """Why the curves themselves leave a number wide: a fault of a curve, its baseline, the tip, or noise."""
    for i, seen in enumerate(reading.likelihood.seen):
        if caused := _cause_in_curve(fit, i):
            return caused
        peak = float(abs(fit.curves[i].force).max())
        drifts = max(abs(seen.ramp_force), seen.turn_force) > _VISIBLE * peak
        # Likelier than not.
        if not _slopes(fit) and drifts and seen.ramp + seen.turn > 0.5:
            return ("a baseline that may drift, or bend", *_FIT_SLOPE)
    straight = all(scene.indenter.has_edge for scene in fit.scenes)
    if straight and any(path_of(name) == "layer.thickness" for name in fit.names):
        return (
            "a flat punch reads one stiffness: modulus and thickness trade off along a straight line",
            "measure the thickness, or add a curve with a second tip radius",
            (),
        )
    return ("noise and misfit of the curve itself", "indent deeper, or with a second tip too", ())


def _of_inputs(answers: Sequence[Answer]) -> Iterator[Advice]:
    for known in answers:
        first = known.contributions[0]
        half = max(known.high - known.value, known.value - known.low)
        is_input = first.origin in {"given", "assumed"}
        if known.is_open or not is_input or first.share < _ONE_INPUT or half < _WIDE * abs(known.value):
            continue
        what = _WORDS.get(first.source, first.source)
        moved = f"{100.0 * first.half_width / abs(known.value):.0f} %" if known.value else "all of it"
        yield Advice(
            CHECK,
            f"{known.name} rests on {what} that you entered",
            f"{first.size} in {what} moves it by {moved}",
            f"measure {what} and state its uncertainty",
        )


# --- the readings -------------------------------------------------------------------------------------------
def _of_readings(fit: Fit, i: int, seen: Seen) -> Iterator[Advice]:
    peak = float(abs(fit.curves[i].force).max())
    if seen.step > _LIKELY and abs(seen.step_force) > _VISIBLE * peak and not fit.scenes[i].adheres:
        yield Advice(
            CHECK,
            f"the force jumps at contact by {format_quantity(seen.step_force, 'force', digits=2)}",
            "snap-in, adhesion, or drag of the approach",
            "fit with adhesion, or leave out the first 5 % of the force",
            ("curve.fit_from", "5 % of force"),
        )
    if seen.ramp > _LIKELY and abs(seen.ramp_force) > _VISIBLE * peak:
        yield Advice(
            CHECK,
            f"the baseline drifts by {format_quantity(seen.ramp_force, 'force', digits=2)} over the record",
            "thermal drift, or drag of the approach",
            *_FIT_SLOPE,
        )
    if seen.turn > _LIKELY and seen.turn_force > _VISIBLE * peak:
        yield Advice(
            CHECK,
            f"the baseline turns during the record, by {format_quantity(seen.turn_force, 'force', digits=2)}",
            "thermal drift that changed on the way, or a cable or fluid that pulls",
            *(_SETTLE if _slopes(fit) else _FIT_SLOPE),
        )


def _slopes(fit: Fit) -> bool:
    return any(path_of(name) == "instrument.baseline_slope" for name in fit.names)


def _of_warnings(fit: Fit) -> Iterator[Advice]:
    for warning in fit.warnings:
        if warning.code == NO_CONTACT:
            yield Advice(
                REJECT,
                warning.message,
                "the tip did not touch the sample, or units or bounds are not as meant",
                "look at the picture, and check the units and the bounds of the contact point",
            )
    if fit.alternatives:
        yield Advice(CHECK, "other values explain the curve as well, or nearly", *_WARNED["second-optimum"])
    for warning in fit.warnings:
        # What open noise allows for is no reason for doubt.
        if warning.code in _WARNED and not (
            warning.code == "correlated-residuals" and fit.problem.noise_is_open
        ):
            yield Advice(CHECK, warning.message, *_WARNED[warning.code])
