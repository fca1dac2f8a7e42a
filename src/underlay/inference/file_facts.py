"""Combines the numbers of a scene with those that a curve's file states, and compares them.

A scene may leave out what a file states; then the file's number is used and a note says so. Where both state it and
differ it is an error that names both, unless the scene file says in ``[curve]`` that it overrules the file:
``overrule = ["indenter.radius"]``. A free parameter is not compared: the scene gives only its starting value.
"""

from __future__ import annotations

from collections.abc import Collection, Iterable, Mapping
from dataclasses import dataclass, field

from underlay._arrays import physical_length
from underlay.data.curve import Curve
from underlay.errors import InputError
from underlay.scene.scene import Scene
from underlay.units import format_quantity

# Numbers of a scene that files may state too, by path: key of the metadata, and physical kind.
_OF_SCENE = {
    "indenter.radius": ("indenter_radius", "length"),
    "lever.spring_constant": ("spring_constant", "stiffness"),
}
# Calibrations that [curve] may give, each with its kind; the file's own has the prefix "file_".
_CALIBRATIONS = {"spring_constant": "stiffness", "sensitivity": "sensitivity"}
_COMPLIANCE = "instrument.compliance"
#: For `settle`: the scene takes precedence for all of these, and notes state the differences.
EVERYTHING = (*_OF_SCENE, *(f"calibration.{name}" for name in _CALIBRATIONS), _COMPLIANCE)
# Relative difference up to which two numbers count as the same: files and people write three digits or more. It
# changes E by half of this.
_SAME = 1e-3
# Ratios to the compliance of the cantilever between which a compliance is taken as the cantilever's: a factor of
# two.
_CANTILEVER = (0.5, 2.0)


@dataclass(frozen=True)
class Settled:
    """What a curve's file adds to a scene.

    Parameters
    ----------
    values : mapping of path to float
        Numbers of the scene (SI) that the file states and the scene leaves out.
    notes : tuple of str
        Sentences on what was taken from the file and what the scene overrules.
    """

    values: Mapping[str, float] = field(default_factory=dict)
    notes: tuple[str, ...] = ()


def settle(
    scene: Scene,
    curve: Curve,
    *,
    left_out: Collection[str] = (),
    overrule: Collection[str] = (),
    free: Iterable[str] = (),
) -> Settled:
    """Compare a scene with what the file of its curve states, and fill in what the scene leaves out.

    Parameters
    ----------
    scene : Scene
        The test, with placeholder values for what it leaves out.
    curve : Curve
        The curve; its metadata are what the file states.
    left_out : collection of str
        Paths of the scene that are left to the file.
    overrule : collection of str
        Paths for which the scene's number is used where the two differ.
    free : iterable of str
        Paths that are fitted.

    Raises
    ------
    InputError
        If the file does not state what is left out, or the two differ.
    """
    values: dict[str, float] = {}
    notes: list[str] = []
    fitted = set(free)
    for path, (key, kind) in _OF_SCENE.items():
        of_file = _number(curve, key)
        if path in left_out:
            if of_file is None:
                raise InputError(
                    f"{_name(curve)} does not say {path}, which the scene leaves out: give it there"
                )
            values[path] = physical_length(of_file, f"{_name(curve)}: {path}")
            notes.append(f"{path} = {format_quantity(of_file, kind)} is taken from the file of the curve")
        elif of_file is not None and path in scene.parameters and path not in fitted:
            stated = scene.parameters[path]
            notes += _compared(curve, path, stated, of_file, kind, overrule)
    for name, kind in _CALIBRATIONS.items():
        of_file, used = _number(curve, f"file_{name}"), _number(curve, name)
        if of_file is not None and used is not None:
            notes += _compared(curve, f"calibration.{name}", used, of_file, kind, overrule)
    notes += _cantilever_twice(scene, curve, overrule)
    return Settled(values, tuple(notes))


def _number(curve: Curve, key: str) -> float | None:
    value = curve.metadata.get(key)
    if isinstance(value, bool) or not isinstance(value, int | float) or not value > 0.0:
        return None
    return float(value)


def _compared(
    curve: Curve, path: str, stated: float, of_file: float, kind: str, overrule: Collection[str]
) -> list[str]:
    """A note where two numbers differ and the scene overrules, none where they agree; else InputError."""
    if abs(stated - of_file) <= _SAME * abs(of_file):
        return []
    file, scene = _apart(of_file, stated, kind)
    if path in overrule:
        return [f"{path} = {scene} of the scene overrules the {file} of the curve's file"]
    raise InputError(
        f"{_name(curve)} says {path} = {file}, the scene {scene}: leave it out of the scene to take the file's, "
        f'or, where the scene is right, write overrule = ["{path}"] in its [curve] section'
    )


def _apart(first: float, second: float, kind: str) -> tuple[str, str]:
    """Both numbers as text, with more digits where four would make them look the same."""
    texts = format_quantity(first, kind), format_quantity(second, kind)
    return texts if texts[0] != texts[1] else (f"{texts[0]} ({first:.8g})", f"{texts[1]} ({second:.8g})")


def _cantilever_twice(scene: Scene, curve: Curve, overrule: Collection[str]) -> list[str]:
    """Raise InputError where a compliance would subtract the cantilever's bending from the depth a second time.

    Returns a note instead where the scene file overrules that.
    """
    stiffness, compliance = _number(curve, "spring_constant"), scene.instrument.compliance
    if stiffness is None or not curve.metadata.get("bending_taken_off"):
        return []
    low, high = _CANTILEVER
    if not low <= compliance * stiffness <= high:
        return []
    said = f"{compliance:.4g} m/N of the scene"
    if _COMPLIANCE in overrule:
        return [
            f"{_COMPLIANCE} = {said} is taken off a depth without the bending of the cantilever, as asked"
        ]
    raise InputError(
        f"{_name(curve)} says that the cantilever has {format_quantity(stiffness, 'stiffness')}, and its bending "
        f"is off the depth already; {_COMPLIANCE} = {said} would take it off again: leave it out, or write "
        f'overrule = ["{_COMPLIANCE}"] in [curve]'
    )


def _name(curve: Curve) -> str:
    name = curve.metadata.get("name")
    return f"the file of curve {name!r}" if name else "the curve"
