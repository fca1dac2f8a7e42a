"""What a command takes a test to be: from its options, a measured curve, the scene file, else a stated default.

A scene alone says neither how deep it was pressed nor how well was read. What is not said anywhere gets a
default that is printed, so that every command answers for every scene.
"""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

from underlay.cli.console import say_warnings
from underlay.errors import InputError

if TYPE_CHECKING:
    from underlay.data.curve import Curve
    from underlay.scene.noise import NoiseModel
    from underlay.scene.scene import Scene
    from underlay.scene.scene_file import SceneFile, SimulatedDepths

__all__ = ["deepest_point", "doubt_depth", "expected_depths", "expected_noise", "measured_curve"]

_NOISE_SHARE = 0.01
# Share of the readings before contact, as `underlay plan` takes it.
_APPROACH, _POINTS = 0.25, 200


def measured_curve(file: SceneFile, option: Path | None) -> Curve | None:
    """Read the curve of --curve, else the one that the scene file names; None if there is neither."""
    from underlay.inference.from_files import read_for

    path = option if option is not None else file.curve_path
    return None if path is None else read_for(file, path)


def deepest_point(file: SceneFile, option: str | None, curve: Curve | None = None) -> float:
    """Deepest point since contact (m): of the option, the curve, [simulate], else a default that is said.

    Raises
    ------
    InputError
        If what was given is not positive.
    """
    from underlay.scene.program import default_depth
    from underlay.units import format_quantity, parse_quantity

    if option is not None:
        depth = parse_quantity(option, "length")
    elif curve is not None:
        depth = float(curve.depth.max()) - _contact_of(file, curve)
    elif file.simulate is not None:
        depth = file.simulate.max_depth - file.scene.instrument.contact_depth
    else:
        depth = default_depth(file.scene)
        say_warnings(
            [
                (
                    f"pressed to {format_quantity(depth, 'length')} by default; --max-depth, --curve, "
                    "[simulate] max_depth or [curve] file says otherwise"
                )
            ]
        )
    if not depth > 0.0:
        raise InputError(f"the deepest point since contact must be positive; got {depth:.6g} m")
    doubt_depth(file.scene, depth)
    return depth


def doubt_depth(scene: Scene, depth: float) -> None:
    """Warn where a depth since contact (m) is more than the layer's thickness."""
    from underlay.mechanics.contact_law import DeeperThanLayer

    doubt = DeeperThanLayer.of(depth, scene.layer.thickness)
    if doubt is not None:
        say_warnings([str(doubt)])


def expected_noise(file: SceneFile, deepest: float, curve: Curve | None = None) -> NoiseModel:
    """Noise of [noise], else what the curve scatters, else a default that is said."""
    import numpy as np

    from underlay.inference.model.members import scatter
    from underlay.scene.noise import Noise
    from underlay.units import format_quantity

    if file.noise is not None:
        return file.noise
    if curve is not None:
        spread = scatter(curve)
        if spread > 0.0:
            say_warnings([f"noise {format_quantity(spread, 'force')}, as the curve scatters"])
            return Noise(force=spread)
    ideal = replace(file.scene, instrument=type(file.scene.instrument)())
    force = _NOISE_SHARE * float(ideal.force(np.array([deepest]), solver=file.solver)[0])
    say_warnings(
        [
            (
                f"noise {format_quantity(force, 'force')} by default, {_NOISE_SHARE:.0%} of the force at the "
                "deepest point; [noise] force or --curve says otherwise"
            )
        ]
    )
    return Noise(force=force)


def expected_depths(file: SceneFile, deepest: float) -> SimulatedDepths:
    """Depth readings of [simulate], else a ramp that begins before contact."""
    from underlay.scene.scene_file import SimulatedDepths

    if file.simulate is not None:
        return file.simulate
    contact = file.scene.instrument.contact_depth
    before = _APPROACH / (1.0 - _APPROACH) * deepest
    return SimulatedDepths(contact + deepest, contact - before, _POINTS)


def _contact_of(file: SceneFile, curve: Curve) -> float:
    from underlay.data.contact_point import find_contact

    stated = "instrument.contact_depth" in file.stated
    return file.scene.instrument.contact_depth if stated else find_contact(curve, scene=file.scene).depth
