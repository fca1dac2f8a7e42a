"""The force of a paraboloid on isotropic draining layers, under a ramp and hold of depth, as a table.

Three numbers remain besides time: a0/h (a0 the undrained contact radius at the depth held), nu, and the ramp's
duration T = tr c/a0^2, tr in s. Tabulated is what has not drained yet,

    q = (P - P_drained(w))/(P_undrained(w) - P_drained(w)),

with the elastic forces of the present depth, on the ramp over t/tr, in the hold over the time since, from a share
of T to 10 a0^2/c in even ratios: every entry is smooth in ln T. A sphere differs from its paraboloid in the elastic
laws, which are exact, and in q: by 5e-3 at a0 = R/2, as the square of it. Error of q: see `STATED_ERROR`.

To build it again: ``python -m underlay.mechanics.biphasic.tip_table FILE`` (a quarter of an hour).
"""

from __future__ import annotations

import sys
from dataclasses import dataclass
from functools import cache, cached_property, partial
from pathlib import Path

import numpy as np
from scipy.interpolate import CubicSpline

from underlay._arrays import FloatArray, read_only
from underlay.mechanics.biphasic.contacts import DrainingTip
from underlay.mechanics.biphasic.elastic_ends import elastic_law
from underlay.mechanics.biphasic.history import ramp_and_hold
from underlay.mechanics.biphasic.material import Biphasic
from underlay.mechanics.biphasic.punch_table import Axis, ResponseTable
from underlay.mechanics.indenters import Paraboloid

#: Largest error of q, on the ramp times the part of P0 reached: of P/P0 it is less.
STATED_ERROR = 1.5e-3

_AXES = (Axis(0.0, 2.0 / 3.0, 12), Axis(0.0, 0.48, 5), Axis(float(np.log(0.01)), float(np.log(3.0)), 7))
_TABULATED = ("solid", "porous")
# The table reaches to a0/h = 2, where its polynomials miss by 3.5e-3: it is read up to here.
_LARGEST_EPS = 1.0
_ON_RAMP, _IN_HOLD = 12, 40
_FIRST_LAG, _LAST_LAG = 0.02, 10.0  # of T, and of a0^2/c
_FILE = Path(__file__).with_name("isotropic_tip.npz")


def _ramp_nodes() -> FloatArray:
    """Times on the ramp at which the table has values, over the ramp's duration; evenly spaced in their root."""
    return np.linspace(0.15, 1.0, _ON_RAMP) ** 2


def _lags(ramp: float) -> FloatArray:
    """Times since the end of a ramp of duration `ramp` at which the table has values; both in a0^2/c."""
    return np.geomspace(_FIRST_LAG * ramp, _LAST_LAG, _IN_HOLD)


def _solved(shape: float, nu: float, log_ramp: float, drainage: str) -> FloatArray:
    """Solve for one entry of the table: the undrained share q of the force (module) at its times, (times,).

    Parameters
    ----------
    shape : float
        eps/(1 + eps), eps = a0/h: undrained contact radius at the depth held over the thickness.
    nu : float
        Drained Poisson's ratio.
    log_ramp : float
        Natural logarithm of the ramp's duration in a0^2/c, c the diffusivity.
    drainage : str
        "solid" (impervious tip) or "porous".
    """
    thickness = np.inf if shape == 0.0 else (1.0 - shape) / shape
    E = 2.0 * (1.0 + nu)
    material = Biphasic(E, nu, 1.0 / Biphasic(E, nu, 1.0).aggregate_modulus)
    tip = Paraboloid(1.0)
    depth = _depth_of_unit_radius(material, thickness)
    ramp = float(np.exp(log_ramp))
    time = np.concatenate((ramp * _ramp_nodes(), ramp + _lags(ramp)))
    contact = DrainingTip(tip, material, thickness, drainage)
    history = ramp_and_hold(depth, ramp)
    kept = _kept(contact, history.at(time), depth)
    ratio = contact.record(history, float(time[-1])).ratio_at(time)
    return np.asarray((ratio - kept) / (1.0 - kept))


def _kept(contact: DrainingTip, w: FloatArray, depth: float) -> FloatArray:
    """Drained over undrained elastic force, (n,), at depths `w`, (n,), none above `depth`."""
    return np.asarray(contact.drained(depth).force(w) / contact.undrained(depth).force(w))


def _depth_of_unit_radius(material: Biphasic, thickness: float) -> float:
    """Depth at which a paraboloid of radius 1 has a contact of radius 1 on the undrained layer."""
    low, high = 0.2, 1.0  # a^2/R times 1/2 or less on thin layers, 1 on a half-space
    law = elastic_law(material.undrained.plane_constants, Paraboloid(1.0), thickness, high)
    for _ in range(60):
        middle = 0.5 * (low + high)
        low, high = (middle, high) if float(law.contact_radius(middle)) < 1.0 else (low, middle)
    return high


@dataclass(frozen=True, eq=False)
class RampedTip:
    """Undrained share q of the force under one ramp and hold, interpolated in time.

    q = (P - P_drained)/(P_undrained - P_drained): force P, and the elastic forces at the present depth.

    Parameters
    ----------
    ramp : float
        Duration of the ramp, in a0^2/c: a0 the contact radius (module), c the diffusivity.
    kept : FloatArray
        Values of q at the table's times, (times,).
    """

    ramp: float
    kept: FloatArray

    @cached_property
    def _rising(self) -> CubicSpline:
        return CubicSpline(np.sqrt(_ramp_nodes()), self.kept[:_ON_RAMP])

    @cached_property
    def _holding(self) -> CubicSpline:
        """Spline of q over the logarithm of the time since the ramp's end, shifted to be finite at that end."""
        lags = np.concatenate(([0.0], _lags(self.ramp)))
        return CubicSpline(self._clock(lags), self.kept[_ON_RAMP - 1 :])

    def _clock(self, lag: FloatArray) -> FloatArray:
        return np.asarray(np.log(np.sqrt(lag) + np.sqrt(_FIRST_LAG * self.ramp)))

    def at(self, time: FloatArray) -> FloatArray:
        """Undrained share q of the force at times (a0^2/c) since the ramp began, at most 10 after its end."""
        found = np.ones(time.shape)
        rising, holding = (time > 0.0) & (time <= self.ramp), time > self.ramp
        found[rising] = self._rising(np.sqrt(time[rising] / self.ramp))
        found[holding] = self._holding(self._clock(time[holding] - self.ramp))
        return found


@dataclass(frozen=True)
class TipTable:
    """Table of ramps and holds of a paraboloid on isotropic layers, for one drainage.

    `table` holds q by eps/(1 + eps), eps = a0/h, by Poisson's ratio and by the logarithm of the ramp's duration.
    """

    drainage: str
    table: ResponseTable

    def covers(self, eps: float, nu: float, ramp: float, end: float) -> bool:
        """Whether the table holds a0/h (`eps`), Poisson's ratio `nu`, ramp duration and the hold's end.

        `ramp` and `end` in a0^2/c: a0 the undrained contact radius at the depth held, h thickness, c diffusivity.
        """
        inside = eps <= _LARGEST_EPS and end - ramp <= _LAST_LAG and ramp > 0.0
        return inside and bool(self.table.covers((eps / (1.0 + eps), nu, float(np.log(ramp)))))

    def __call__(self, eps: float, nu: float, ramp: float) -> RampedTip:
        """Interpolate at a0/h (`eps`, contact radius over thickness), Poisson's ratio and ramp duration (a0^2/c).

        Raises
        ------
        InputError
            If one of them is outside the table.
        """
        return RampedTip(ramp, self.table.at((eps / (1.0 + eps), nu, float(np.log(ramp)))))


def build(path: Path) -> None:
    """Solve for the tables of all drainages and write them to an .npz file at `path`."""
    falls = {
        drainage: ResponseTable.solved(_AXES, partial(_solved, drainage=drainage)).fall
        for drainage in _TABULATED
    }
    np.savez_compressed(path, **falls)  # type: ignore[arg-type]  # stubs: allow_pickle


@cache
def shipped(drainage: str) -> TipTable:
    """Load the table shipped with the package for a `drainage` of "solid" (impervious tip) or "porous"."""
    with np.load(_FILE, allow_pickle=False) as stored:
        return TipTable(drainage, ResponseTable(_AXES, read_only(stored[drainage])))


def measured_error(table: TipTable, count: int, seed: int) -> tuple[float, tuple[float, float, float]]:
    """Largest error of the undrained share q at `count` random points, and the point of the table's axes.

    On the ramp the error is weighted by (t/tr)^(3/2), the largest share of the peak force reached at time t of tr.
    """
    rng = np.random.default_rng(seed)
    reached = np.concatenate((_ramp_nodes() ** 1.5, np.ones(_IN_HOLD)))
    worst, where = 0.0, (0.0, 0.0, 0.0)
    for _ in range(count):
        shape, nu, log_ramp = (float(rng.uniform(axis.low, axis.high)) for axis in _AXES)
        shape *= _LARGEST_EPS / (1.0 + _LARGEST_EPS) / _AXES[0].high
        exact = _solved(shape, nu, log_ramp, table.drainage)
        error = float(np.abs(reached * (table.table.at((shape, nu, log_ramp)) - exact)).max())
        if error > worst:
            worst, where = error, (shape, nu, log_ramp)
    return worst, where


if __name__ == "__main__":
    build(Path(sys.argv[1]))
