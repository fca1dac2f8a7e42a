"""The same curve with a face free to slip, where nobody knows how it holds: the other end of a bracket."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import TypeAlias

from underlay.errors import FitError, InputError
from underlay.inference.least_squares.fit_result import Fit, StatedBonds, StatedInterval
from underlay.inference.problem import Problem
from underlay.scene.scene import has_face, unknown_faces, with_bond

__all__ = ["OtherBond", "Refit", "bracket", "other_bonds", "stated_bonds"]

#: Fits a problem.
Refit: TypeAlias = Callable[[Problem], Fit]


@dataclass(frozen=True)
class OtherBond:
    """A face that nobody knows, free to slip.

    Parameters
    ----------
    face : str
        The layer whose lower face it is.
    fit : Fit or None
        Of the same data.
    refused : str
        Why there is none.
    """

    face: str
    fit: Fit | None
    refused: str = ""

    @property
    def words(self) -> str:
        """What nobody knows."""
        return "the layer's bond" if self.face == "layer" else f"the bond of {self.face}"


def other_bonds(fit: Fit, refit: Refit) -> tuple[OtherBond, ...]:
    """Fit the data of a fit with each unknown face free to slip; others stay unknown, and say so themselves."""
    scenes = fit.problem.base_scenes
    names = dict.fromkeys(face for scene in scenes for face in unknown_faces(scene))
    found = []
    for face in names:
        slipping = [with_bond(scene, face, "slip") if has_face(scene, face) else scene for scene in scenes]
        try:
            found.append(OtherBond(face, refit(fit.problem.revised(scenes=slipping))))
        except (InputError, FitError) as error:
            found.append(OtherBond(face, None, str(error)))
    return tuple(found)


def bracket(
    known: StatedInterval, others: Sequence[OtherBond], *, find: Callable[[Fit], StatedInterval]
) -> StatedInterval:
    """Stretch an interval over those that `find` has of the fits with other bonds."""
    told = [find(other.fit) for other in others if other.fit is not None]
    low = min([known.low, *(entry.low for entry in told)])
    high = max([known.high, *(entry.high for entry in told)])
    return replace(known, low=low, high=high, kind="with model error") if told else known


def stated_bonds(fit: Fit, others: Sequence[OtherBond]) -> tuple[StatedBonds, ...]:
    """What each bond gives, of the faces that could be fitted both ways."""
    return tuple(
        StatedBonds(
            other.face,
            {name: fit.interval(name) for name in fit.names},
            {name: other.fit.interval(name) for name in fit.names},
            other.fit.statistics.aic - fit.statistics.aic,
        )
        for other in others
        if other.fit is not None
    )
