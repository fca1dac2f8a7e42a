"""The seam: what every solver hands back.

A `ContactLaw` turns indentation depth into force, contact radius and stiffness for one indenter on one
layer and substrate. Callers never ask which solver stands behind it. To add a solver: derive a frozen
dataclass, implement the three primitives for positive depths, and leave the border (scalars, Series,
points before contact, depths beyond the range) to this base class.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from underlay._arrays import ArrayLike, FloatArray, as_finite
from underlay.errors import InputError, RangeError
from underlay.mechanics.response import Response

__all__ = ["CHOSEN_FOR_DEPTH", "ContactLaw"]

#: Why a law ends at the depth it was built for; completes the sentence of a RangeError.
CHOSEN_FOR_DEPTH = "the law was chosen for depths up to there; build it with a larger max_depth"

# Newton in log-log coordinates on a smooth increasing law: quadratic after the first steps.
_MAX_NEWTON_STEPS = 60
_LARGEST = float(np.finfo(float).max)


@dataclass(frozen=True, kw_only=True)
class ContactLaw(Response, ABC):
    """Force against depth for one indenter, layer and substrate: the response that ignores time.

    Depth is the indentation depth w (m) from first contact, positive into the sample; force is positive
    in compression (N). Zero or negative depth means no contact: force, radius and stiffness are zero.

    Parameters
    ----------
    method : str
        Name of the solver, e.g. ``"halfspace"``, ``"asymptotic"``, ``"exact"``.
    reason : str
        Why this solver was taken, in words.
    max_depth : float
        Largest depth (m) at which the law may be asked.
    error_estimate : float
        Estimated relative error of the force against the exact contact problem, for depths up to
        `max_depth`.
    """

    method: str
    reason: str
    max_depth: float
    error_estimate: float

    def force(self, depth: ArrayLike, time: ArrayLike | None = None) -> FloatArray:
        """Force P (N), shape of `depth` (m); an elastic sample does not ask for `time`.

        Raises
        ------
        RangeError
            If a depth is beyond `max_depth`.
        InputError
            If a depth is not finite.
        """
        del time
        return self._in_contact(depth, self._force)

    def contact_radius(self, depth: ArrayLike) -> FloatArray:
        """Contact radius a (m), shape of `depth` (m); raises as `force` does."""
        return self._in_contact(depth, self._contact_radius)

    def stiffness(self, depth: ArrayLike, time: ArrayLike | None = None) -> FloatArray:
        """Incremental stiffness dP/dw (N/m) (9.1), shape of `depth` (m); raises as `force` does."""
        del time
        return self._in_contact(depth, self._stiffness)

    def force_and_stiffness(self, depth: ArrayLike) -> tuple[FloatArray, FloatArray]:
        """Force P (N) and dP/dw (N/m), each of the shape of `depth` (m), for less than the two alone cost.

        Raises as `force` does.
        """
        both = self._in_contact(depth, self._force_and_stiffness, 2)
        return both[0], both[1]

    def depth(self, force: ArrayLike) -> FloatArray:
        """Indentation depth (m) at `force` (N, not negative): the inverse of `force`.

        Raises
        ------
        InputError
            If a force is negative or not finite.
        RangeError
            If a force is beyond that at `max_depth`.
        """
        load = as_finite(force, "force")
        if (load < 0.0).any():
            raise InputError(f"depth(force) needs forces of zero or more; got {load.min():.6g} N")
        flat = np.atleast_1d(load).ravel()
        depth = np.zeros_like(flat)
        loaded = flat > 0.0
        if loaded.any():
            depth[loaded] = self._solve_depth(flat[loaded])
        return depth.reshape(load.shape)[()]

    @abstractmethod
    def _force(self, depth: FloatArray) -> FloatArray:
        """Force (N) at positive depths (m), 1-D."""

    @abstractmethod
    def _contact_radius(self, depth: FloatArray) -> FloatArray:
        """Contact radius (m) at positive depths (m), 1-D."""

    @abstractmethod
    def _stiffness(self, depth: FloatArray) -> FloatArray:
        """dP/dw (N/m) at positive depths (m), 1-D."""

    def _force_and_stiffness(self, depth: FloatArray) -> FloatArray:
        """Force (N) and dP/dw (N/m) at positive depths (m), (n,), as rows (2, n)."""
        return np.stack((self._force(depth), self._stiffness(depth)))

    @property
    @abstractmethod
    def _beyond(self) -> str:
        """Why `max_depth` is the end, and what to do next; completes the sentence of a RangeError."""

    def _in_contact(
        self, depth: ArrayLike, primitive: Callable[[FloatArray], FloatArray], *rows: int
    ) -> FloatArray:
        """Ask `primitive` where there is contact; `rows` are the axes that it puts before that of the depths."""
        w = np.asarray(depth, dtype=np.float64)
        flat = np.atleast_1d(w).ravel()
        # NaN fails the comparison too, and so does inf where the law has no end: as_finite names them.
        if not (flat <= min(self.max_depth, _LARGEST)).all():
            as_finite(w, "depth")
            raise RangeError(
                f"depth {flat.max():.6g} m is beyond the largest that works here, "
                f"{self.max_depth:.6g} m: {self._beyond}",
                max_depth=self.max_depth,
            )
        touching = flat > 0.0
        if touching.all():
            return primitive(flat).reshape((*rows, *w.shape))[()]
        as_finite(w, "depth")
        values = np.zeros((*rows, flat.size))
        if touching.any():
            values[..., touching] = primitive(flat[touching])
        return values.reshape((*rows, *w.shape))[()]

    def _solve_depth(self, load: FloatArray) -> FloatArray:
        """Invert an increasing law by Newton's method on ln P(ln w), kept inside a shrinking bracket."""
        target = np.log(load)
        high = np.full_like(load, np.log(self._depth_ceiling(load)))
        # Power laws have 1 <= dlnP/dlnw <= 2 or so; the bracket only has to exist, not to be tight.
        low = np.full_like(load, np.log(np.finfo(float).tiny))
        x = high.copy()
        for _ in range(_MAX_NEWTON_STEPS):
            w = np.exp(x)
            force = self._force(w)
            error = np.log(force) - target
            high = np.where(error > 0.0, np.minimum(high, x), high)
            low = np.where(error < 0.0, np.maximum(low, x), low)
            miss, slope = error * force, self._stiffness(w) * w
            # An asymptotic law ends where its stiffness is zero (no step: halve the bracket) ...
            step = np.divide(miss, slope, out=np.where(miss == 0.0, 0.0, np.inf), where=slope > 0.0)
            proposal = x - step
            # ... or infinite, where Newton's step is zero: halve then too.
            stuck = (np.abs(step) < 1e-12) & (np.abs(error) > 1e-9)
            outside = (proposal > high) | (proposal < low) | stuck
            proposal = np.where(outside, 0.5 * (low + high), proposal)
            if (np.abs(proposal - x) <= 4.0 * np.finfo(float).eps * (1.0 + np.abs(x))).all():
                return np.exp(proposal)
            x = proposal
        return np.exp(x)

    def _depth_ceiling(self, load: FloatArray) -> float:
        """A depth (m) whose force is at least the largest `load`, within the law's range."""
        top = float(load.max())
        if np.isfinite(self.max_depth):
            ceiling = self.max_depth
            largest = float(self._force(np.array([ceiling]))[0])
            if top > largest * (1.0 + 1e-12):
                raise RangeError(
                    f"force {top:.6g} N is beyond {largest:.6g} N, the force at the largest depth that "
                    f"works here, {ceiling:.6g} m: {self._beyond}",
                    max_depth=ceiling,
                )
            return ceiling
        ceiling = 1.0
        while float(self._force(np.array([ceiling]))[0]) < top:
            ceiling *= 16.0
        return ceiling
