"""Builds a `Problem` from a curve file and a scene file: selects the part of the curve, and the free parameters."""

from __future__ import annotations

import os
from collections.abc import Collection, Mapping
from dataclasses import replace
from typing import Any

import numpy as np

from underlay.data.contact_point import find_contact
from underlay.data.curve import Curve
from underlay.data.fit_range import in_range
from underlay.data.readers import MapCurve, read, read_from_map
from underlay.data.segments import LOADING, UNLOADING, runs_of
from underlay.data.signs import flipped, require_signs
from underlay.data.withdrawal import imprint_of, remembering_withdrawal
from underlay.errors import CurveError, InputError, UnderlayError
from underlay.inference.file_facts import settle
from underlay.inference.plausibility import require_plausible, size_notes
from underlay.inference.priors import Given, Normal, prior_from_numbers
from underlay.inference.problem import Problem
from underlay.scene.fit_range import PRESETS, FitRange
from underlay.scene.scene import Scene
from underlay.scene.scene_file import SceneFile, read_scene_file
from underlay.scene.scene_keys import RUN

# Share of the loading work that is not recovered from which a sample is not elastic: more than a tenth is not due
# to inexact ends of the segments.
_LOST = 0.1
_CONTACT = "instrument.contact_depth"
# Half width of the default prior of a baseline, in spans of the curve's force.
_WEAK = 10.0


def load_problem(curve: str | os.PathLike[str], scene: str | os.PathLike[str]) -> Problem:
    """Build the problem that a curve file and a scene file state.

    Parameters
    ----------
    curve : path
        Measured curve, in any known format.
    scene : path
        Scene file; its ``[fit]`` section names the free parameters, ``[curve]`` the part of the curve that is used.

    Raises
    ------
    FileAccessError, FileFormatError, InputError, CurveError
        If a file cannot be read, or its content cannot be used; the message says which and why.
    """
    file = read_scene_file(scene)
    return problem_from(file, read_for(file, curve).with_metadata(scene_path=str(file.path)))


def read_for(file: SceneFile, path: str | os.PathLike[str] | MapCurve) -> Curve:
    """Read the part of a curve file that the scene file selects.

    With a sharp tip a note is added to the curve's metadata if the test left an imprint.
    """
    whole = read_whole(file, path)
    part = chosen_part(whole, file.curve)
    if file.draft.indenter.opening is None or file.curve.get("segment", LOADING) == UNLOADING:
        return part
    # A sharp tip strains a sample equally at every depth, and most samples yield to that.
    reason = imprint_of(whole, file.draft.instrument.contact_depth).reason
    return part.with_metadata(imprint=reason) if reason else part


def require_elastic(scene: Scene, curve: Curve, overrule: Collection[str] = ()) -> None:
    """Raise CurveError for the loading part of a test that left an imprint: no elastic law holds for it.

    Raises
    ------
    CurveError
        If it did, and the scene file does not overrule it.
    """
    reason = curve.metadata.get("imprint")
    if not reason or scene.memory is not None or "imprint" in overrule:
        return
    raise CurveError(
        f"{_name(curve)}: the loading is elastoplastic, {reason}; the elastic number is "
        "in how it springs back: fit the contact stiffness S(h) instead (underlay film; fit_stiffness in Python), "
        'or write overrule = ["imprint"] in [curve] to fit the loading all the same'
    )


def read_whole(file: SceneFile, path: str | os.PathLike[str] | MapCurve) -> Curve:
    """Read a curve file, or a curve of a map, with the reading options of the scene file and all segments.

    Raises
    ------
    CurveError
        If a sign is reversed and the scene file does not state how to treat it.
    """
    options = {key: file.curve[key] for key in ("format", "columns", "calibration") if key in file.curve}
    if isinstance(path, MapCurve):
        whole = read_from_map(path, **options)
    else:
        whole = read(path, test=file.curve.get("test"), **options)
    return turned(whole, file.curve)


def turned(curve: Curve, choice: Mapping[str, Any]) -> Curve:
    """Return the curve with the signs reversed that the ``[curve]`` section names in ``flip``.

    Without ``flip`` a curve whose signs look reversed is refused.
    """
    if "flip" in choice:
        return flipped(curve, choice["flip"] or ())
    require_signs(curve)
    return curve


def whole_curve(part: Curve) -> Curve | None:
    """Read again the whole curve that `part` is a part of.

    Parameters
    ----------
    part : Curve
        A part of a curve. Its metadata name its file, and the scene file it was read with, if it was read from one.

    Returns
    -------
    Curve or None
        None where there was no file, or it is gone, has changed or cannot be read in the same way.
    """
    path, scene = part.metadata.get("path"), part.metadata.get("scene_path")
    if not path:
        return None
    try:
        whole = (
            read_whole(read_scene_file(scene), path)
            if scene
            else read(path, part.metadata.get("format"), test=part.metadata.get("test"))
        )
    except UnderlayError:
        return None
    return whole if whole.metadata.get("sha256") == part.metadata.get("sha256") else None


def chosen_part(curve: Curve, choice: Mapping[str, Any]) -> Curve:
    """Return the segment and depth range of `curve` that the ``[curve]`` section selects."""
    segment = choice.get("segment", LOADING)
    curve = _in_window(curve, choice)
    parts = {
        "all": lambda: curve,
        LOADING: curve.loading,
        UNLOADING: curve.unloading,
        "equilibrium": curve.equilibrium,
    }
    part = parts[segment]() if segment in parts else _run(curve, segment)
    if not len(part):
        there = ", ".join(sorted(set(curve.segments().tolist()))) or "none"
        raise CurveError(
            f"{_name(curve)} has no {segment} part, only {there}: choose another "
            'segment in [curve], or check the sign of the depth (flip = ["depth"] turns it)'
        )
    if segment == LOADING:
        part = remembering_withdrawal(part, curve)
    if segment == UNLOADING:
        part = part.with_metadata(notes=(*part.metadata.get("notes", ()), *_inelastic(curve)))
    low, high = choice.get("min_depth", -np.inf), choice.get("max_depth", np.inf)
    inside = (part.depth >= low) & (part.depth <= high)
    if not inside.any():
        raise CurveError(
            f"no point of the {segment} part of {_name(curve)} is left between "
            f"min_depth and max_depth; its depths run from {curve.depth.min():.6g} to "
            f"{curve.depth.max():.6g} m"
        )
    return part if inside.all() else part.select(inside)


def _in_window(curve: Curve, choice: Mapping[str, Any]) -> Curve:
    """The points of a curve between two times, and of one step, as the ``[curve]`` section selects."""
    name = _name(curve)
    low, high = choice.get("from_time", -np.inf), choice.get("to_time", np.inf)
    if np.isfinite([low, high]).any():
        if curve.time is None:
            raise CurveError(
                f"{name} has no time: from_time and to_time in [curve] need one; choose a part by step or segment"
            )
        inside = (curve.time >= low) & (curve.time <= high)
        if not inside.any():
            raise CurveError(
                f"no reading of {name} lies between from_time and to_time; its clock runs from "
                f"{curve.time.min():.6g} s to {curve.time.max():.6g} s"
            )
        curve = replace(curve, segment=curve.segments()).select(inside)
    step = choice.get("step")
    if step is None:
        return curve
    runs = runs_of(curve.segments())
    # A step begins with a ramp that does not follow another ramp.
    starts = [first for first, _, label in runs if label == LOADING]
    if step > len(starts):
        times = "once" if len(starts) == 1 else f"{len(starts)} times"
        raise CurveError(f"{name} has no step {step}: it goes in {times}")
    end = starts[step] if step < len(starts) else len(curve)
    return replace(curve, segment=curve.segments()).select(slice(starts[step - 1], end))


def _run(curve: Curve, segment: str) -> Curve:
    """One segment of several, such as ``"ramp 2"``."""
    matched = RUN.fullmatch(segment)
    if matched is None:
        raise InputError(f"[curve] segment: there is no {segment!r:.40}")
    wanted = LOADING if matched[1] == "ramp" else matched[1]
    found = [(first, last) for first, last, label in runs_of(curve.segments()) if label == wanted]
    number = int(matched[2])
    if number > len(found):
        raise CurveError(
            f"{_name(curve)} has no {segment}: it holds {len(found)} of {matched[1]}; "
            "underlay formats draws its segments"
        )
    first, last = found[number - 1]
    return replace(curve, segment=curve.segments()).select(slice(first, last))


def _name(curve: Curve) -> str:
    return str(curve.metadata.get("name", "the curve"))


def within_range(file: SceneFile, scene: Scene, curve: Curve) -> Curve:
    """Return the points of a curve within the fit range of the ``[curve]`` section; all points without one.

    Depths count from the contact point that the scene file states, or from the one found in the curve.

    Raises
    ------
    CurveError, InputError
        If no point is left, or the scene lacks the length that the range is a multiple of.
    """
    choice = file.curve
    preset = PRESETS.get(choice.get("preset") or "", FitRange())
    wanted = FitRange.of(choice.get("fit_from", preset.low), choice.get("fit_to", preset.high))
    known = _CONTACT in file.stated and all(entry.path != _CONTACT for entry in file.free)
    return in_range(curve, wanted, scene, scene.instrument.contact_depth if known else None)


def _inelastic(curve: Curve) -> list[str]:
    """A warning where the unloading returns at least a tenth less work than the loading took; else none."""
    spent, back = (abs(_work(part)) for part in (curve.loading(), curve.unloading()))
    lost = 1.0 - back / spent if spent > 0.0 else 0.0
    if lost < _LOST:
        return []
    note = (
        f"the way back gives {100.0 * lost:.0f} % less work than the way in took: the sample is not elastic, and "
        "the modulus of its unloading is not that of its loading"
    )
    return [note]


def _work(part: Curve) -> float:
    """Integral of the force over the depth (J)."""
    return float(0.5 * (part.force[1:] + part.force[:-1]) @ np.diff(part.depth))


def problem_from(file: SceneFile, curve: Curve) -> Problem:
    """Build the problem that a scene file states for a curve.

    Parameters
    ----------
    file : SceneFile
        The test, and the free parameters.
    curve : Curve
        The part of a curve that is fitted.

    Raises
    ------
    InputError
        If the scene file frees nothing, or differs from what the file of the curve states.
    CurveError
        If depth or force are impossible for the scene.
    """
    if not file.free:
        raise InputError(
            f"{file.path.name} says nothing to fit: add a [fit] section such as layer.E = {{}} with "
            'bounds like { min = "1 kPa", max = "10 MPa" }'
        )
    settled = settle(
        file.draft,
        curve,
        left_out=file.left_out,
        overrule=file.curve.get("overrule", ()),
        free=[entry.path for entry in file.free],
    )
    file = replace(file, draft=file.draft.with_values(settled.values), left_out=())
    assumed = [path for path in file.assumed if all(entry.path != path for entry in file.free)]
    curve = curve.with_metadata(
        notes=(*curve.metadata.get("notes", ()), *settled.notes), **({"assumed": assumed} if assumed else {})
    )
    require_elastic(file.draft, curve, file.curve.get("overrule", ()))
    _require_history(file.draft, file.curve.get("step"))
    curve = within_range(file, file.draft, curve)
    free = free_of(file, curve)
    started = _started(file, curve)
    if "layer.E" in free and "layer.E" in file.stated:
        curve = curve.with_metadata(notes=(*curve.metadata.get("notes", ()), *size_notes(started, curve)))
    problem = Problem(started, curve, free, file.noise, solver=file.solver)
    require_plausible(problem)
    return problem


def _require_history(scene: Scene, step: int | None) -> None:
    """Refuse a later step of a record for a sample that remembers the steps before it."""
    if step is not None and step > 1 and scene.memory is not None:
        raise InputError(
            f"a sample with a memory remembers what came before step {step} of this record: fit all steps together "
            '(leave step out, with segment = "all"), or step 1 alone'
        )


def _started(file: SceneFile, curve: Curve) -> Scene:
    """The scene, with a contact depth estimated from the data where the file gives bounds for it and no start."""
    entry = next((entry for entry in file.free if entry.path == _CONTACT), None)
    start = file.scene.instrument.contact_depth
    if entry is None or _CONTACT in file.stated or entry.low < start < entry.high:
        return file.scene
    found = find_contact(curve, scene=file.scene).depth
    inside = [depth for depth in (found, 0.5 * (entry.low + entry.high)) if entry.low < depth < entry.high]
    return file.scene.with_values({_CONTACT: inside[0]}) if inside else file.scene


def free_of(file: SceneFile, curve: Curve | None = None) -> dict[str, Given]:
    """Priors of the parameters that a scene file frees, by path; empty if it frees none.

    The prior ``"found"`` of the contact depth is a normal density with the estimate and the uncertainty of
    `find_contact` for `curve`. It uses the data near contact twice, so it helps a fit's convergence and a sampler's
    start; for intervals with the stated coverage, bounds are the better choice.

    Raises
    ------
    InputError
        If ``"found"`` is given for another parameter, or where there is no curve.
    """
    priors: dict[str, Given] = {}
    for entry in file.free:
        if entry.prior != "found":
            priors[entry.path] = prior_from_numbers(entry.prior, entry.low, entry.high, entry.numbers)
            continue
        if entry.path != _CONTACT or curve is None:
            raise InputError(
                f"[fit] {entry.path}: the prior 'found' is for instrument.contact_depth of a measured curve; give "
                "bounds or another prior here"
            )
        contact = find_contact(curve, scene=file.scene)
        priors[entry.path] = Normal(contact.depth, contact.uncertainty).truncated(entry.low, entry.high)
    return priors
