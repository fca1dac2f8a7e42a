"""How deep, and how exactly, a command looks at a scene: from its options, else from the scene file."""

from __future__ import annotations

from underlay.errors import InputError
from underlay.mechanics.accuracy import Accuracy
from underlay.scene.scene_file import SceneFile
from underlay.units import parse_quantity

__all__ = ["deepest_point", "wanted_accuracy"]


def deepest_point(file: SceneFile, option: str | None) -> float:
    """Deepest point since contact (m).

    Raises
    ------
    InputError
        If neither the option nor a [simulate] section says it, or it is not positive.
    """
    if option is not None:
        depth = parse_quantity(option, "length")
    elif file.simulate is not None:
        depth = file.simulate.max_depth - file.scene.instrument.contact_depth
    else:
        raise InputError('say how deep with --max-depth, e.g. --max-depth "100 um"')
    if not depth > 0.0:
        raise InputError(f"the deepest point since contact must be positive; got {depth:.6g} m")
    return depth


def wanted_accuracy(file: SceneFile, option: float | None) -> Accuracy:
    """Return the accuracy of the option, else of the scene file, else the default."""
    if option is not None:
        return Accuracy(option)
    stated = file.solver.get("accuracy")
    return stated if isinstance(stated, Accuracy) else Accuracy()
