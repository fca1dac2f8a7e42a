"""A relaxing layer on an elastic base, where the ratio of moduli and so the kernel changes with time.

A base 1000 times stiffer than the layer is as good as rigid, and relaxation only makes the layer softer against it.
Otherwise

- a *flat punch* is exact. Against the layer's modulus E its stiffness is K(E) = E sum_j A_j / (E + b_j), with
  A_j, b_j > 0 that only depend on what is below and on the geometry: springs in series with the layer's
  material, found by rational approximation (AAA: Nakatsukasa, Sete and Trefethen 2018) of K(E) / E over ten
  decades of E. Each of these is a sum of exponentials where e(t) is one, so the punch relaxes as a Prony series
  (`punch_relaxation`);
- any other tip while the contact grows is *quasi-elastic*, P = int k(w(s); E(t - s)) dw(s), k the elastic stiffness
  (`QuasiElastic`). Approximate: against the exact punch and rings of pressure it is up to 2.2 % too low where
  at most half of the modulus relaxes, and along a ramp shorter than half of the shortest relaxation time; in a
  hold 31 % where nine tenths relax, 81 % where 99 % do (tests/test_elastic_base.py). It is used only where the
  caller accepts that error as tolerance, and refused otherwise.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import ClassVar

import numpy as np

from underlay._arrays import ArrayLike, FloatArray, as_finite
from underlay.errors import InputError
from underlay.mechanics.body import Body, Layer
from underlay.mechanics.contact_law import ContactLaw
from underlay.mechanics.exact.master_curve import lagrange
from underlay.mechanics.relaxation import Modes, Relaxation
from underlay.mechanics.response import Response, checked_times
from underlay.mechanics.viscoelastic.bed import Creep

# A base this much stiffer than the layer is as good as rigid.
_AS_GOOD_AS_RIGID = 1e3
#: Stated error of the quasi-elastic force where it is taken.
QUASI_ELASTIC_ERROR = 0.022
# Largest errors seen in a hold, by the largest ratio E(0) / E(infinity) they hold for.
_ERRORS = ((2.0, QUASI_ELASTIC_ERROR), (10.0, 0.31), (np.inf, 0.81))
# Ramp over the shortest relaxation time up to which the error is that where half relaxes.
_SHORT_RAMP = 0.5
# Ratio of moduli up to which that was measured for a sphere.
_RAMPED = 10.0
# Moduli over the layer's own at which the punch is asked, and what the rational function may miss of them.
_DECADES, _PER_DECADE, _RTOL = 5.0, 8, 1e-8
# The moduli between which the quasi-elastic stiffness is interpolated in the logarithm: 1e-5 of it over a factor 2.
_NODES_PER_OCTAVE, _MOST_NODES = 4, 24


def ages(layer: Layer, substrate: Body | None) -> bool:
    """Whether a relaxing layer lies on an elastic base less than 1000 times as stiff: its kernel changes."""
    if layer.relaxation is None or layer.thickness == np.inf or substrate is None:
        return False
    below = [*(deeper.material for deeper in substrate.layers), substrate.base]
    elastic = [part.plane_constants for part in below if part.plane_constants is not None]
    stiffness = min((float(plane.theta) / layer.material.theta for plane in elastic), default=np.inf)
    return stiffness < _AS_GOOD_AS_RIGID


def stated_error(relaxation: Relaxation, time: FloatArray, depth: FloatArray) -> float:
    """Stated relative error of the quasi-elastic force for a motion: the largest that was measured.

    `time` (s) and `depth` (m) are those of the motion, (n,).
    """
    if not relaxation.bounded:
        return _ERRORS[-1][1]
    kept = relaxation.equilibrium
    # A sum of fractions is rounded.
    ratio = (1.0 - 1e-12) / kept if kept else np.inf
    error = next(error for most, error in _ERRORS if ratio <= most)
    touching = np.flatnonzero(depth > 0.0)
    if not touching.size:
        return 0.0
    ramp = float(time[-1] - time[max(int(touching[0]) - 1, 0)])
    shortest = float(relaxation.modes(0.0, np.inf).times.min())
    return min(error, QUASI_ELASTIC_ERROR) if ramp <= _SHORT_RAMP * shortest and ratio <= _RAMPED else error


@dataclass(frozen=True)
class PunchRelaxation(Relaxation):
    """Relaxation of the force under a flat punch held at a depth, as a sum of exponentials that is 1 at t = 0.

    Parameters
    ----------
    known : Modes
        The exponentials, and the share of the force that remains.
    relaxes : str
        As for the layer's own relaxation.
    """

    model: ClassVar[str] = ""

    known: Modes = field(metadata={"no number": True})
    relaxes: str = "shear_and_bulk"

    @property
    def equilibrium(self) -> float:
        """Share of the force that remains at long times."""
        return self.known.constant

    @property
    def longest_time(self) -> float:
        """Longest relaxation time (s)."""
        return float(self.known.times.max())

    def modulus(self, time: ArrayLike) -> FloatArray:
        """Force at `time` (s) after a sudden depth over the instantaneous force, shape of `time`."""
        return self.known(as_finite(time, "time"))

    def modes(self, shortest: float, longest: float) -> Modes:
        """Its exponentials, which do not depend on the times `shortest` and `longest` (s)."""
        del shortest, longest
        return self.known


def punch_relaxation(stiffness: Callable[[float], float], relaxation: Modes) -> PunchRelaxation:
    """Relaxation of a flat punch on a relaxing layer on whatever elastic body.

    Parameters
    ----------
    stiffness : callable
        Stiffness (N/m) of the punch as a function of the layer's modulus over its instantaneous modulus.
    relaxation : Modes
        Of the layer's material; e(0) = 1.

    Raises
    ------
    InputError
        If the stiffness is no such sum of springs.
    """
    from scipy import interpolate  # noqa: PLC0415  as long to load as all of the mechanics; only here

    ratio = 10.0 ** np.linspace(-_DECADES, _DECADES, int(2 * _DECADES * _PER_DECADE) + 1)
    at = np.array([stiffness(m) for m in ratio])
    rational = interpolate.AAA(ratio, at / ratio, rtol=_RTOL)
    poles, residues = rational.poles(), rational.residues()
    b, parts = -poles.real, residues.real
    if np.abs(poles.imag).max() > 0.0 or b.min() <= 0.0 or parts.min() <= 0.0:
        raise InputError("this punch does not relax as springs in series with its layer do; use a rigid base")
    # What is left at infinity is a part that relaxes as the layer does: nil but for the rational function's error.
    rest = float(rational.weights @ rational.support_values / rational.weights.sum())
    constant, weights, times = rest * relaxation.constant, [rest * relaxation.weights], [relaxation.times]
    for spring, part in zip(b.tolist(), parts.tolist(), strict=True):
        # E / (E + b) = 1 - b / (E + b), and 1 / (E + b) is the compliance of the material beside a spring b.
        creep = Creep.of(Modes(relaxation.constant + spring, relaxation.weights, relaxation.times)).modes
        constant += part * (1.0 - spring * creep.constant)
        weights.append(-part * spring * creep.weights)
        times.append(creep.times)
    weight, time = np.concatenate(weights), np.concatenate(times)
    whole = constant + float(weight.sum())
    return PunchRelaxation(Modes(constant / whole, weight / whole, time))


@dataclass(frozen=True)
class QuasiElastic(Response):
    """Quasi-elastic response P(t) = int k(w(s); E(t - s)) dw(s), k the elastic stiffness, while contact grows.

    Parameters
    ----------
    build : callable
        Elastic law as a function of the layer's modulus over its instantaneous modulus.
    relaxation : Relaxation
        Of the layer.
    max_depth : float
        Largest depth (m).
    """

    build: Callable[[float], ContactLaw]
    relaxation: Relaxation
    max_depth: float

    def force(self, depth: ArrayLike, time: ArrayLike | None = None) -> FloatArray:
        """Force (N), (n,), at depths (m) that do not decrease, at times (s), (n,).

        Raises
        ------
        InputError
            If a depth decreases, or the times do not match.
        """
        w = as_finite(depth, "depth")
        clock = checked_times(time, w)
        w = np.maximum(w, 0.0)
        if (np.diff(w) < 0.0).any():
            raise InputError(
                "a layer that relaxes on an elastic base is simulated while the contact grows or rests: leave the "
                "unloading out, or use a rigid base"
            )
        modulus = self.relaxation.modulus(np.append(0.0, clock[1:] - clock[0]))
        lowest = float(modulus.min())
        if lowest == 1.0:
            return self.build(1.0).force(w)
        count = min(2 + int(np.ceil(_NODES_PER_OCTAVE * np.log2(1.0 / lowest))), _MOST_NODES)
        nodes = lowest ** (0.5 - 0.5 * np.cos(np.pi * np.arange(count) / (count - 1)))
        loads = np.stack([self.build(m).force(w) / m for m in nodes])
        grown = np.diff(loads, axis=1)
        middle = 0.5 * (clock[1:] + clock[:-1])
        force = np.empty(len(w))
        for n, now in enumerate(clock):
            lags = np.append(now - clock[0], now - middle[:n])
            moduli = self.relaxation.modulus(lags)
            share = lagrange(np.log(moduli), np.log(nodes)).T
            steps = np.concatenate((loads[:, :1], grown[:, :n]), axis=1)
            force[n] = float((moduli * (share * steps).sum(axis=0)).sum())
        return force

    def stiffness(self, depth: ArrayLike, time: ArrayLike | None = None) -> FloatArray:
        """Instantaneous elastic stiffness (N/m)."""
        return self.build(1.0).stiffness(depth, time)
