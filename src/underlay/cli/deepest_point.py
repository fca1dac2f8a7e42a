"""How exactly a command looks at a scene: from its option, else from the scene file."""

from __future__ import annotations

from underlay.mechanics.accuracy import Accuracy
from underlay.scene.scene_file import SceneFile

__all__ = ["wanted_accuracy"]


def wanted_accuracy(file: SceneFile, option: float | None) -> Accuracy:
    """Return the accuracy of the option, else of the scene file, else the default."""
    if option is not None:
        return Accuracy(option)
    stated = file.solver.get("accuracy")
    return stated if isinstance(stated, Accuracy) else Accuracy()
