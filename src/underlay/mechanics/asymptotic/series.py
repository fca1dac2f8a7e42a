"""The asymptotic relations as curves (w, P, a)(s) of one parameter s, for every shape and form.

A form of the fourth-order model is a curve in depth w, force P and contact radius a:

==============  ===========================================  ===================================  ==========
form            parameter s (m)                              equations                            shapes
==============  ===========================================  ===================================  ==========
``explicit``    half-space radius varpi h at the depth w     w = H(s); P (5.9); a (5.7)           power laws
``parametric``  the contact radius a                         (5.2), (5.3); else (4.14), (4.15)    all
``compliance``  half-space radius at the force P             (8.4), (8.5); else England            all
==============  ===========================================  ===================================  ==========

Orders: a curve of order n keeps the terms up to eps^n.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import dataclass

import numpy as np

from underlay._arrays import FloatArray
from underlay.mechanics._roots import invert_increasing
from underlay.mechanics.indenters import FlatPunch, Indenter

__all__ = ["ContactSeries", "PunchSeries"]


class ContactSeries(ABC):
    """A curve (w, P, a)(s); s is positive and all arrays are 1-D."""

    shape: Indenter

    @property
    @abstractmethod
    def end(self) -> float:
        """Largest s up to which w and P both increase and the shape is defined; inf where none."""

    @property
    @abstractmethod
    def radius_end(self) -> float:
        """Largest s up to which the contact radius increases; inf where none."""

    @abstractmethod
    def start(self, depth: FloatArray) -> FloatArray:
        """First guess of s at `depth` (m)."""

    @abstractmethod
    def depth(self, s: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Depth w (m) and dw/ds."""

    @abstractmethod
    def force(self, s: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Force P (N) and dP/ds."""

    @abstractmethod
    def radius(self, s: FloatArray) -> FloatArray:
        """Contact radius a (m)."""

    @property
    def is_explicit(self) -> bool:
        """Whether `start` is already the solution of w(s) = depth."""
        return False

    def load(self, depth: FloatArray, s: FloatArray) -> FloatArray:
        """Force P (N) at s, where w(s) = `depth` (m): as `force`, possibly cheaper."""
        del depth
        return self.force(s)[0]

    def parameter(self, depth: FloatArray, end: float | None = None) -> FloatArray:
        """Solve w(s) = `depth` (m, positive, at most w(`end`)); a known `end` (m) saves finding it again."""
        start = self.start(depth)
        if self.is_explicit:
            return start
        return invert_increasing(self.depth, depth, start, self.end if end is None else end)


@dataclass(frozen=True)
class PunchSeries(ContactSeries):
    """The flat punch: P = 4 theta a kappa_inf w, with s = w."""

    shape: FlatPunch
    theta: float
    kappa: float

    @property
    def is_explicit(self) -> bool:
        """The parameter is the depth."""
        return True

    @property
    def end(self) -> float:
        """A flat punch is linear: no end."""
        return np.inf

    @property
    def radius_end(self) -> float:
        """No end."""
        return np.inf

    def start(self, depth: FloatArray) -> FloatArray:
        """The depth itself."""
        return depth

    def depth(self, s: FloatArray) -> tuple[FloatArray, FloatArray]:
        """The parameter itself."""
        return s, np.ones_like(s)

    def force(self, s: FloatArray) -> tuple[FloatArray, FloatArray]:
        """P = 4 theta a kappa_inf w, (9.5) integrated."""
        stiffness = 4.0 * self.theta * self.shape.radius * self.kappa
        return stiffness * s, np.full_like(s, stiffness)

    def radius(self, s: FloatArray) -> FloatArray:
        """The punch's radius."""
        return np.full_like(s, self.shape.radius)
