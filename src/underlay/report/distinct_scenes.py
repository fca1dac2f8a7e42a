"""The distinct scenes behind the curves of a result: what a report draws and lists once each."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

from underlay.data.curve import Curve
from underlay.scene.scene import Scene

__all__ = ["DistinctScene", "distinct_scenes"]


@dataclass(frozen=True)
class DistinctScene:
    """A scene and the curves that were measured on it.

    Parameters
    ----------
    scene : Scene
        With the instrument of the curve that went deepest.
    curves : tuple of int
        Numbers of the curves, from 1.
    reading : float
        Deepest depth reading (m) of that curve.
    label : str
        ``"curve 2"``, ``"curves 1 and 3"``; empty where there is no other scene.
    """

    scene: Scene
    curves: tuple[int, ...]
    reading: float
    label: str

    @property
    def deepest(self) -> float:
        """How deep the tip went since contact (m); zero where it never touched."""
        return max(self.reading - self.scene.instrument.contact_depth, 0.0)


def distinct_scenes(scenes: Sequence[Scene], curves: Sequence[Curve]) -> tuple[DistinctScene, ...]:
    """Group curves by indenter, layer, substrate and compliance; contact point and baseline may differ.

    Parameters
    ----------
    scenes, curves : sequence
        One scene per curve.

    Returns
    -------
    tuple of DistinctScene
        In the order of their first curves.
    """
    groups: list[tuple[Scene, list[int]]] = []
    for number, scene in enumerate(scenes):
        level = replace(
            scene, instrument=replace(scene.instrument, contact_depth=0.0, baseline=0.0, baseline_slope=0.0)
        )
        members = next((members for known, members in groups if known == level), None)
        if members is None:
            groups.append((level, [number]))
        else:
            members.append(number)
    found = []
    for _, members in groups:
        deepest = max(
            members, key=lambda i: float(curves[i].depth.max()) - scenes[i].instrument.contact_depth
        )
        numbers = tuple(number + 1 for number in members)
        label = _label(numbers) if len(groups) > 1 else ""
        found.append(DistinctScene(scenes[deepest], numbers, float(curves[deepest].depth.max()), label))
    return tuple(found)


def _label(numbers: tuple[int, ...]) -> str:
    if len(numbers) == 1:
        return f"curve {numbers[0]}"
    return f"curves {', '.join(map(str, numbers[:-1]))} and {numbers[-1]}"
