"""Thresholds of a profile that come from drawn curves; `drawing.py` draws them."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

from underlay._arrays import FloatArray
from underlay.errors import InputError

__all__ = ["Calibration", "Draws", "require_chance", "require_draws"]


@dataclass(frozen=True, eq=False)
class Draws:
    """Rises t of a value in curves drawn where it is the truth.

    Parameters
    ----------
    value : float
        The value (SI).
    delta_chi_squares : FloatArray
        t in every curve, (N,), increasing.
    failures : int
        Curves that could not be fitted.
    """

    value: float
    delta_chi_squares: FloatArray
    failures: int = 0

    def threshold(self, level: float) -> float:
        """The rise t that ends an interval of this confidence.

        Raises
        ------
        InputError
            If there are too few curves for the level.
        """
        return float(self.delta_chi_squares[_rank(len(self.delta_chi_squares), level) - 1])


@dataclass(frozen=True, eq=False)
class Calibration:
    """Thresholds from drawn curves, one set per end.

    Parameters
    ----------
    level : float
        Confidence whose ends the curves were drawn at.
    draws, seed : int
        Curves per centre, and where their chance came from.
    below, above : tuple of Draws
        Centres at the lower and at the upper end; none where the data set no end.
    """

    level: float
    draws: int
    seed: int
    below: tuple[Draws, ...] = ()
    above: tuple[Draws, ...] = ()

    def side(self, *, upper: bool) -> tuple[Draws, ...]:
        """Centres of one end."""
        return self.above if upper else self.below

    def with_side(self, centres: tuple[Draws, ...], *, upper: bool) -> Calibration:
        """Return the same with other centres at one end."""
        return replace(self, above=centres) if upper else replace(self, below=centres)


def _rank(curves: int, level: float) -> int:
    """Which of the rises, counted from the smallest, is the threshold; raises as `Draws.threshold`."""
    if not 0.0 < level < 1.0:
        raise InputError(f"level must be between 0 and 1; got {level!r}")
    # Rounded first: 20 times 0.95 is 19, not a rounding error above it.
    rank = math.ceil(round((curves + 1) * level, 9))
    if rank > curves:
        needed = math.ceil(round(level / (1.0 - level), 9))
        raise InputError(
            f"a level of {level:g} needs at least {needed} curves; there are {curves}: "
            f"use profile(..., calibrate={needed}) or more"
        )
    return rank


def require_draws(draws: int, level: float, seed: int) -> None:
    """Refuse a number of curves that cannot tell the level.

    Raises
    ------
    InputError
        If the number is too small or negative, or the seed is negative.
    """
    require_chance(draws, seed)
    _rank(draws, level)


def require_chance(draws: int, seed: int) -> None:
    """Refuse, by InputError, a number of curves or a seed that is none."""
    for name, value, least in (("the number of curves to draw", draws, 1), ("the seed", seed, 0)):
        if value != int(value) or value < least:
            raise InputError(f"{name} must be a whole number, {least} or more; got {value!r}")
