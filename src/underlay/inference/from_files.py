"""A curve file and a scene file -> a Problem."""

from __future__ import annotations

import os
from collections.abc import Mapping
from typing import Any

import numpy as np

from underlay.data.contact_point import find_contact
from underlay.data.curve import Curve
from underlay.data.noise import Noise
from underlay.data.readers import JpkMapCurve, read, read_from_map
from underlay.errors import CurveError, InputError, UnderlayError
from underlay.inference.priors import Normal, prior_from_numbers
from underlay.inference.problem import Given, Problem
from underlay.scene.fit_section import FreeParameter
from underlay.scene.scene_file import SceneFile, read_scene_file

__all__ = ["chosen_part", "free_of", "load_problem", "problem_from", "read_for", "read_whole", "whole_curve"]


def load_problem(curve: str | os.PathLike[str], scene: str | os.PathLike[str]) -> Problem:
    """Build the problem that a curve file and a scene file state.

    Parameters
    ----------
    curve : path
        Measured curve, in any known format.
    scene : path
        Scene file; its ``[fit]`` section says what is free, ``[curve]`` which part of the curve is used.

    Raises
    ------
    FileAccessError, FileFormatError, InputError, CurveError
        If a file cannot be read, or its content cannot be used; the message says which and why.
    """
    file = read_scene_file(scene)
    return problem_from(file, read_for(file, curve).with_metadata(scene_path=str(file.path)))


def read_for(file: SceneFile, path: str | os.PathLike[str] | JpkMapCurve) -> Curve:
    """Read the part of a curve file that the scene file asks for."""
    return chosen_part(read_whole(file, path), file.curve)


def read_whole(file: SceneFile, path: str | os.PathLike[str] | JpkMapCurve) -> Curve:
    """Read a curve file, or a curve of a map, as the scene file says it must be read, with every segment."""
    options = {key: file.curve[key] for key in ("format", "columns", "calibration") if key in file.curve}
    if isinstance(path, JpkMapCurve):
        return read_from_map(path, **options)
    return read(path, test=file.curve.get("test"), **options)


def whole_curve(part: Curve) -> Curve | None:
    """Read again the whole curve of which `part` was taken.

    Parameters
    ----------
    part : Curve
        Its metadata say from which file, and by which scene file, if it was read from one.

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
    """Return the segment and depth range of `curve` that the ``[curve]`` section names."""
    segment = choice.get("segment", "loading")
    part = {
        "all": lambda: curve,
        "loading": curve.loading,
        "unloading": curve.unloading,
        "hold": curve.hold,
        "equilibrium": curve.equilibrium,
    }[segment]()
    low, high = choice.get("min_depth", -np.inf), choice.get("max_depth", np.inf)
    inside = (part.depth >= low) & (part.depth <= high)
    if not inside.any():
        raise CurveError(
            f"no point of the {segment} part of {curve.metadata.get('name', 'the curve')} is left between "
            f"min_depth and max_depth; its depths run from {curve.depth.min():.6g} to "
            f"{curve.depth.max():.6g} m"
        )
    return part if inside.all() else part.select(inside)


def problem_from(file: SceneFile, curve: Curve) -> Problem:
    """Build the problem that a scene file states for `curve`.

    Raises
    ------
    InputError
        If the scene file frees nothing.
    """
    if not file.free:
        raise InputError(
            f"{file.path.name} says nothing to fit: add a [fit] section such as layer.E = {{}} with "
            'bounds like { min = "1 kPa", max = "10 MPa" }'
        )
    noise = Noise(**file.noise) if file.noise else None
    return Problem(file.scene, curve, free_of(file, curve), noise, **file.solver)


def free_of(file: SceneFile, curve: Curve | None = None) -> dict[str, Given]:
    """Priors of what a scene file frees, by path; empty if it frees nothing.

    The prior ``"found"`` of the contact depth is what `find_contact` says of `curve`: a normal density with
    its estimate and uncertainty. It uses the foot of the curve twice, so it steadies a fit and a sampler's
    start; for an interval that covers, bounds are the better choice.

    Raises
    ------
    InputError
        If ``"found"`` is asked of another parameter, or where there is no curve.
    """
    return {entry.path: _prior_of(entry, file, curve) for entry in file.free}


def _prior_of(entry: FreeParameter, file: SceneFile, curve: Curve | None) -> Given:
    if entry.prior != "found":
        return prior_from_numbers(entry.prior, entry.low, entry.high, entry.numbers)
    if entry.path != "instrument.contact_depth" or curve is None:
        raise InputError(
            f"[fit] {entry.path}: the prior 'found' is for instrument.contact_depth of a measured curve; give "
            "bounds or another prior here"
        )
    contact = find_contact(curve, scene=file.scene)
    return Normal(contact.depth, contact.uncertainty).truncated(entry.low, entry.high)
