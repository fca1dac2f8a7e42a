"""A picture and where its axes lie in it, for pages that draw over it."""

from __future__ import annotations

from dataclasses import dataclass

__all__ = ["Canvas"]


@dataclass(frozen=True)
class Canvas:
    """A picture as bytes, and where its horizontal axis lies in it.

    Parameters
    ----------
    data : bytes
        Of a PNG file.
    width, height : int
        In pixels.
    left, right, top, bottom : float
        Of the axes, in pixels from the upper left corner.
    low, high : float
        Ends of the horizontal axis (SI).
    """

    data: bytes
    width: int
    height: int
    left: float
    right: float
    top: float
    bottom: float
    low: float
    high: float
