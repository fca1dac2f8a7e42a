"""The law of a tip that sticks: force against depth along the stable part of a branch of equilibria."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from underlay._arrays import ArrayLike, FloatArray, as_finite, finite
from underlay.errors import InputError, RangeError
from underlay.mechanics.adhesion.branch import AdhesiveBranch
from underlay.mechanics.adhesion.stable_path import Jump, StablePath
from underlay.mechanics.contact_law import ContactLaw, ContactState

__all__ = ["STATES", "AdhesiveLaw", "in_touch"]

#: Which states a law takes: see `JKR`.
STATES = ("separating", "approaching", "cycle")


# Points of the equilibria that a picture draws.
_DRAWN = 600


def in_touch(states: str, travel: FloatArray, end: float | FloatArray) -> NDArray[np.bool_]:
    """Whether there is contact at travels (..., n) that are reached in this order; it is lost at `end`."""
    if states == "approaching":
        return np.asarray(travel > 0.0)
    if states == "separating":
        return np.asarray(travel > end)
    # In between the last that happened counts: a touch at zero, or the loss at `end`.
    event = np.where(travel > 0.0, 1, np.where(travel <= end, -1, 0))
    last = np.maximum.accumulate(np.where(event != 0, np.arange(travel.shape[-1]), -1), axis=-1)
    return np.asarray((last >= 0) & (np.take_along_axis(event, np.maximum(last, 0), axis=-1) > 0))


@dataclass(frozen=True, kw_only=True)
class AdhesiveLaw(ContactLaw):
    """A rounded or pointed tip that sticks; the law's domain reaches to the pull-off.

    Parameters
    ----------
    branch : AdhesiveBranch
        All equilibria.
    path : StablePath
        Those that are stable when the depth is given.
    rtol : float
        Relative error of interpolations.
    states : str
        One of `STATES`.
    """

    branch: AdhesiveBranch
    path: StablePath
    rtol: float
    states: str = "separating"

    # --- what adhesion adds ------------------------------------------------------------------------------

    @property
    def pull_off_force(self) -> float:
        """Tension (N, positive) that takes the tip off when the load is given: the largest the contact bears."""
        return -self.load_path.end

    @property
    def pull_off_depth(self) -> float:
        """Depth (m, negative for most) at which the contact is lost when the depth is given."""
        return self.path.end

    @cached_property
    def zero_load_radius(self) -> float:
        """Contact radius (m) at which the tip rests without load."""
        return float(self.load_path.radius(np.zeros(1))[0])

    @cached_property
    def load_path(self) -> StablePath:
        """States that are stable when the load is given, by force (N)."""
        return self.branch.path(np.inf, self.rtol)

    @property
    def jumps(self) -> tuple[Jump, ...]:
        """Depths (m) at which the contact radius jumps to another while the tip is withdrawn; mostly none."""
        return tuple(jump for jump in self.path.jumps if jump.inner)

    def pull_off(self, compliance: float = 0.0) -> ContactState:
        """Where the tip comes off behind a spring (m/N): 0 for a given depth, inf for a given load."""
        path = self._behind(compliance)
        here = self.branch.at(np.array([path.end_radius]))
        return ContactState(float(here.depth[0]), float(here.force[0]), path.end_radius)

    def jump_in(self, compliance: float = 0.0) -> ContactState:
        """State (depth, force, radius) right after the first touch behind a spring (m/N)."""
        path = self._behind(compliance)
        radius = path.radius(np.zeros(1))
        here = self.branch.at(radius)
        return ContactState(float(here.depth[0]), float(here.force[0]), float(radius[0]))

    def jump_travels(self, compliance: float = 0.0) -> tuple[float, ...]:
        """See `ContactLaw`; on a film that folds there may be several."""
        touch, lost = (0.0,), tuple(jump.at for jump in self._behind(compliance).jumps)
        return {"approaching": touch, "separating": lost, "cycle": (*touch, *lost)}[self.states]

    def equilibria(self, max_depth: float) -> tuple[FloatArray, FloatArray]:
        """See `ContactLaw`; from a tenth of the pull-off's radius outwards."""
        widest = float(self.path.radius(np.array([max_depth]))[0])
        narrowest = max(0.1 * self.path.end_radius, self.branch.start)
        radius = np.geomspace(narrowest, widest, _DRAWN)
        radius[0], radius[-1] = narrowest, widest  # to the last bit: beyond its ends a branch is not solved
        here = self.branch.at(radius)
        return here.depth, here.force

    def work_slope(self, depth: FloatArray) -> FloatArray | None:
        """dP/d ln(work) (N) at fixed depth, (n,), at depths (m); zero where there is no contact.

        None where the model does not know it.
        """
        slope, here = np.zeros_like(depth), self._touching(depth)
        values, slopes = self.path.values(depth[here], slopes=True)
        radius = np.exp(values[:, 0])
        known = self.branch.work_slope(radius, radius * slopes[:, 0])
        if known is None:
            return None
        slope[here] = known
        return slope

    # --- what every law does -----------------------------------------------------------------------------

    @property
    def domain(self) -> tuple[float, float]:
        """From the depth at which the contact is lost (of an approach: zero) to `max_depth` (m)."""
        return (0.0 if self.states == "approaching" else self.path.end), self.max_depth

    @property
    def nodes(self) -> int | None:
        """Radial nodes of the solution behind it."""
        return self.branch.nodes

    def depth(self, force: ArrayLike) -> FloatArray:
        """Depth (m) at forces (N), the widest contact that bears them when the load is given.

        Raises
        ------
        InputError
            If a force is below the pull-off.
        RangeError
            If a force is beyond that at `max_depth`.
        """
        load = as_finite(force, "force")
        flat, path = np.atleast_1d(load).ravel(), self.load_path
        if (flat < path.end).any():
            raise InputError(
                f"no contact bears {flat.min():.6g} N: the tip comes off at {path.end:.6g} N when the load is given"
            )
        most = float(self.force(self.max_depth))
        if (flat > most * (1.0 + 1e-12)).any():
            raise RangeError(
                f"force {flat.max():.6g} N is beyond {most:.6g} N, the force at the largest depth that works "
                f"here, {self.max_depth:.6g} m: {self._beyond}",
                max_depth=self.max_depth,
            )
        depth: FloatArray = self.branch.at(path.radius(flat)).depth.reshape(load.shape)[()]
        return depth

    def tip_depth(self, travel: FloatArray, compliance: float) -> FloatArray:
        """Depth (m) behind a spring of this compliance (m/N) at travels (m), (n,); the travel where it is off.

        Below zero it is a lever that bends less than was taken off.
        """
        path = self.branch.path(compliance, self.rtol) if compliance < 0.0 else self._behind(compliance)
        here = in_touch(self.states, travel, path.end)
        depth = np.array(travel, dtype=np.float64)
        if here.any():
            depth[here] = self.branch.at(path.radius(depth[here])).depth
        return depth

    @property
    def _beyond(self) -> str:
        return "the law was solved up to there; build it with a larger max_depth"

    def _behind(self, compliance: float) -> StablePath:
        if compliance == 0.0:
            return self.path
        if compliance == np.inf:
            return self.load_path
        if not finite(compliance, "compliance", "m/N") > 0.0:
            raise InputError(f"compliance must be zero or more (m/N); got {compliance!r}")
        return self.branch.path(compliance, self.rtol)

    def _touching(self, depth: FloatArray) -> NDArray[np.bool_]:
        return in_touch(self.states, depth, self.path.end)

    def _force(self, depth: FloatArray) -> FloatArray:
        return self.branch.force_scale * np.sinh(self.path.values(depth)[0][:, 1])

    def _contact_radius(self, depth: FloatArray) -> FloatArray:
        return self.path.radius(depth)

    def _stiffness(self, depth: FloatArray) -> FloatArray:
        return np.asarray(self._force_and_stiffness(depth)[1])

    def _force_and_stiffness(self, depth: FloatArray) -> FloatArray:
        values, slopes = self.path.values(depth, slopes=True)
        scale = self.branch.force_scale
        return np.stack((scale * np.sinh(values[:, 1]), scale * np.cosh(values[:, 1]) * slopes[:, 1]))
