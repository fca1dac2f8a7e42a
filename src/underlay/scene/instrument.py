"""The instrument between the contact and the numbers in the file: its parameters, and how they act in turn.

The links stand between the readings of an instrument and the contact::

    depth reading d -> [contact point: d - d0] -> [frame: w + C P(w) = d - d0] -> depth w
    force P(w)      -> [baseline: + F0] -> [its slope: + s d] -> force reading F

with d0 the contact depth, C the compliance, F0 the baseline and s its slope. Each link states its step and its
derivative once, for one set of numbers or for many: a number is a float, or an array (sets, 1) with readings (n,).
A link that a scene does not need is absent and runs no code. With the stiffness S = dP/dw, a change of w at fixed d
- d0 is divided by 1 + C S, and

    dF/dd0 = -S / (1 + C S),   dF/dC = -P S / (1 + C S),   dF/dF0 = 1,   dF/ds = d.

`Instrument` declares these numbers, `Lever` the calibration of a cantilever.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Collection, Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import ClassVar, Self

import numpy as np

from underlay._arrays import FloatArray, PerSet, finite
from underlay.errors import InputError, RangeError
from underlay.mechanics.response import Response
from underlay.quantities import Part, field_quantities, quantity
from underlay.units import KINDS

# Largest number of steps of Newton's method: from the stiff side of a convex function it converges monotonically,
# far sooner.
_MAX_STEPS = 50
#: Paths of the two ratios of a cantilever's true calibration to the one used.
SPRING_CONSTANT_RATIO = "lever.spring_constant_ratio"
SENSITIVITY_RATIO = "lever.sensitivity_ratio"
#: Path of the spring constant used to compute the curve.
SPRING_CONSTANT = "lever.spring_constant"
#: Range of laws over the depth readings with a lever: if it bends less than was subtracted, the tip is deeper.
FURTHER = 2.0
# Bounds of a ratio.
_POSITIVE = (0.0, np.inf)


@dataclass(frozen=True)
class ContactDepth:
    """Converts depth readings to travel since contact; `depth` is the depth reading (m) at first contact."""

    path: ClassVar[str] = "instrument.contact_depth"

    depth: PerSet

    def travel(self, reading: FloatArray) -> FloatArray:
        """Travel since contact (m) at depth readings (m)."""
        return reading - self.depth


@dataclass(frozen=True)
class Frame:
    """A frame or cantilever in series with the contact, whose `compliance` (m/N) takes a part of the travel."""

    path: ClassVar[str] = "instrument.compliance"

    compliance: float

    def tip_depth(self, response: Response, travel: FloatArray) -> FloatArray:
        """Solve w + C P(w) = s for the tip depth w (m), s the travel since contact (m), C the compliance.

        Contact exists from s_0 = w_0 + C P_0 on, w_0 and P_0 being the depth and force at which it begins or is
        lost: zero, or the pull-off. P is convex in w for every law without jumps and P_0 its minimum, so Newton's
        method from w = s - C P_0 descends monotonically to the root. A law that jumps has its own solution.
        """
        own = response.tip_depth(travel, self.compliance)
        if own is not None:
            return own
        first, least = response.beginning
        held_back = self.compliance * least
        w = np.array(travel, dtype=np.float64)
        touching = w > first + held_back
        s = w[touching]
        # The start must be inside the range of the law; the root is below it wherever one exists in the range.
        x = np.minimum(s - held_back, response.max_depth)
        small = 4.0 * np.finfo(float).eps * (np.abs(s) + abs(held_back))
        for _ in range(_MAX_STEPS):
            excess = x + self.compliance * response.force(x) - s
            step = excess * self.share(response.stiffness(x))
            x = np.where(step < x - first, x - step, 0.5 * (x + first))
            if (np.abs(step) <= small).all():
                break
        w[touching] = x
        return w

    def require_standing(self, stiffness: FloatArray) -> None:
        """Raise RangeError for a compliance so negative that the depth of the tip is not unique.

        Raises
        ------
        RangeError
            If the lever would give way faster than the sample resists.
        """
        if not (self.share(stiffness) > 0.0).all():
            raise RangeError(
                f"a lever that bends {-self.compliance:.3g} m/N less than was taken off explains no reading here: "
                "it would give way faster than the sample resists"
            )

    def share(self, stiffness: FloatArray) -> FloatArray:
        """The tip's share of a small change of the travel, 1 / (1 + C S), at stiffness S (N/m)."""
        return np.asarray(1.0 / (1.0 + self.compliance * stiffness))

    def slope(self, force: FloatArray, stiffness: FloatArray) -> FloatArray:
        """dP/dC at a given travel, - P S / (1 + C S), for force P (N) and stiffness S (N/m)."""
        return -force * stiffness * self.share(stiffness)


class ForceLink(ABC):
    """A step from the contact force to the force reading, linear in its one number."""

    path: ClassVar[str]

    @abstractmethod
    def reading(self, force: FloatArray, depth: FloatArray) -> FloatArray:
        """Force after this step (N) from the force before it (N), at depth readings (m)."""

    @classmethod
    @abstractmethod
    def slope(cls, depth: FloatArray) -> FloatArray:
        """d force reading / d number of this step at depth readings (m), (n,); it does not depend on the number."""


@dataclass(frozen=True)
class Baseline(ForceLink):
    """Offset of the force reading: `force` (N) is the reading without contact at zero of the depth axis."""

    path: ClassVar[str] = "instrument.baseline"

    force: PerSet

    def reading(self, force: FloatArray, depth: FloatArray) -> FloatArray:
        """Force reading F + F0: the force before this step plus the baseline (N)."""
        del depth
        return force + self.force

    @classmethod
    def slope(cls, depth: FloatArray) -> FloatArray:
        """d force / d baseline: ones, (n,)."""
        return np.ones(depth.shape)


@dataclass(frozen=True)
class BaselineSlope(ForceLink):
    """Baseline that changes linearly with the depth reading, by `stiffness` (N/m)."""

    path: ClassVar[str] = "instrument.baseline_slope"

    stiffness: PerSet

    def reading(self, force: FloatArray, depth: FloatArray) -> FloatArray:
        """Force reading F + s d: the force before this step plus slope times depth reading (N)."""
        return force + self.stiffness * depth

    @classmethod
    def slope(cls, depth: FloatArray) -> FloatArray:
        """d force / d slope: the depth readings (m), (n,)."""
        return depth


@dataclass(frozen=True)
class Chain:
    """Conversion between an instrument's readings and the contact, in the steps that a scene needs.

    Parameters
    ----------
    contact : ContactDepth or None
        First step of the depth: the contact point.
    frame : Frame or None
        Second step of the depth: the frame's compliance; for one set of numbers only.
    offsets : tuple of ForceLink
        Steps of the force, in order: baseline and its slope.
    """

    contact: ContactDepth | None
    frame: Frame | None
    offsets: tuple[ForceLink, ...]

    @classmethod
    def of(cls, values: Mapping[str, PerSet], free: Collection[str] = ()) -> Self:
        """Steps for the instrument's numbers of a scene, by path, for those that are not zero or are free."""

        def called(path: str) -> bool:
            value = values[path]
            return path in free or bool(value.any() if isinstance(value, np.ndarray) else value)

        frame = values[Frame.path]
        if called(Frame.path) and not isinstance(frame, float):
            raise InputError("a frame's compliance is solved for one set of numbers at a time")
        return cls(
            ContactDepth(values[ContactDepth.path]) if called(ContactDepth.path) else None,
            Frame(float(frame)) if called(Frame.path) else None,
            tuple(link(values[link.path]) for link in (Baseline, BaselineSlope) if called(link.path)),
        )

    def with_compliance(self, compliance: float) -> Chain:
        """Return the chain with another frame's compliance (m/N), of either sign; without a frame if it is zero."""
        return replace(self, frame=Frame(compliance) if compliance else None)

    def travel(self, depth: FloatArray) -> FloatArray:
        """Travel since contact (m) at depth readings (m)."""
        return depth if self.contact is None else self.contact.travel(depth)

    def tip_depth(self, response: Response, depth: FloatArray) -> FloatArray:
        """Depth of the tip into the sample (m) at depth readings (m)."""
        travel = self.travel(depth)
        return travel if self.frame is None else self.frame.tip_depth(response, travel)

    def reading(self, force: FloatArray, depth: FloatArray) -> FloatArray:
        """Force reading (N) from contact forces (N) at depth readings (m)."""
        for link in self.offsets:
            force = link.reading(force, depth)
        return force

    def at_fixed_travel(self, slope: FloatArray, stiffness: FloatArray) -> FloatArray:
        """Derivative of the force at fixed travel, from that at fixed tip depth: times 1 / (1 + C S).

        C is the frame's compliance and S the contact's stiffness (N/m).
        """
        return slope if self.frame is None else slope * self.frame.share(stiffness)

    def offset_slopes(self, depth: FloatArray) -> dict[str, FloatArray]:
        """d force reading / d number, (n,), of every step of the force (baseline, slope), by path."""
        return {link.path: link.slope(depth) for link in self.offsets}


@dataclass(frozen=True)
class Instrument(Part):
    """Contact point, force baseline and compliance of an instrument; the default is ideal.

    Parameters
    ----------
    contact_depth : float
        Reading of the depth axis at first contact (m).
    baseline : float
        Force reading without contact at zero of the depth axis (N).
    baseline_slope : float
        Change of that reading along the depth axis (N/m).
    compliance : float
        Compliance of frame or cantilever not yet removed from the depth (m/N), zero or positive.
    """

    parts: ClassVar[tuple[str, ...]] = ("instrument",)

    contact_depth: float = field(
        default=0.0, metadata=quantity("length", "contact point", nearly_linear=True)
    )
    baseline: float = field(default=0.0, metadata=quantity("force", "baseline", linear=True))
    baseline_slope: float = field(default=0.0, metadata=quantity("stiffness", "baseline slope", linear=True))
    compliance: float = field(
        default=0.0,
        metadata=quantity("compliance", "instrument compliance", symbol="C", bounds=(0.0, np.inf)),
    )

    def __post_init__(self) -> None:
        for name, known in field_quantities(self).items():
            object.__setattr__(self, name, finite(getattr(self, name), name, KINDS[known.kind].si))
        if self.compliance < 0.0:
            raise InputError(f"instrument compliance must be zero or positive (m/N); got {self.compliance!r}")

    @cached_property
    def chain(self) -> Chain:
        """The steps between readings and contact, for the numbers that are not zero."""
        return Chain.of({f"instrument.{name}": getattr(self, name) for name in field_quantities(self)})


@dataclass(frozen=True)
class Lever(Part):
    """A cantilever and how far its true calibration is from the one used to compute the curve.

    Its bending was subtracted from the depth. A detector's voltage V gives the bending delta = s V by the
    sensitivity s, and the force F = k s V by the spring constant k; the depth reading is the scanner's travel less
    the bending. With the true values k' = kappa k and s' = sigma s,

        force reading = P(w) / (kappa sigma),        w = depth reading - d0 - (sigma - 1) F / k,

    P being the contact force, w the tip depth, d0 the contact depth, and F the force reading itself, as modelled
    without noise. The spring constant alone scales the force and not the depth; the sensitivity acts on both, in
    the same direction: for a sphere d ln E / d ln s is about 1 + 3/2 of bending over depth.

    The thermal method finds k from the same sensitivity, k ~ s^-2 (Hutter & Bechhoefer 1993,
    doi:10.1063/1.1143970): kappa is then sigma**-2 times its remaining uncertainty, and to take the two as
    independent is cautious.

    Parameters
    ----------
    spring_constant : float
        Spring constant used to compute the curve (N/m): that of the file, or given in its place.
    spring_constant_ratio : float
        True spring constant over that.
    sensitivity_ratio : float
        True sensitivity of the detector over the one used to compute the curve.

    Raises
    ------
    InputError
        If one of them is not positive.

    Examples
    --------
    A spring constant that is known to 10 % is a parameter of the fit with that prior:

    >>> from underlay import Isotropic, Layer, Lever, LogNormal, Paraboloid, Scene
    >>> scene = Scene(Paraboloid(5e-6), Layer(Isotropic(1e3, 0.5)), lever=Lever(0.04))
    >>> free = {"layer.E": None, "lever.spring_constant_ratio": LogNormal(1.0, 0.1)}
    >>> sorted(path for path in scene.parameters if path.startswith("lever."))
    ['lever.sensitivity_ratio', 'lever.spring_constant', 'lever.spring_constant_ratio']
    """

    parts: ClassVar[tuple[str, ...]] = ("lever",)

    spring_constant: float = field(
        metadata=quantity("stiffness", "spring constant of the lever", symbol="k", bounds=_POSITIVE)
    )
    spring_constant_ratio: float = field(
        default=1.0,
        metadata=quantity(
            "dimensionless", "true over stated spring constant", symbol=r"\kappa", bounds=_POSITIVE
        ),
    )
    sensitivity_ratio: float = field(
        default=1.0,
        metadata=quantity(
            "dimensionless", "true over stated sensitivity", symbol=r"\sigma", bounds=_POSITIVE
        ),
    )

    def __post_init__(self) -> None:
        for name, known in field_quantities(self).items():
            value = finite(getattr(self, name), f"lever {name}", KINDS[known.kind].si)
            if not value > 0.0:
                raise InputError(f"lever {name} must be positive; got {value!r}")
            object.__setattr__(self, name, value)

    @property
    def gain(self) -> float:
        """Force reading over contact force, 1 / (kappa sigma), kappa and sigma being the two ratios."""
        return 1.0 / (self.spring_constant_ratio * self.sensitivity_ratio)

    @property
    def compliance(self) -> float:
        """Bending that was not subtracted, over the force reading: (sigma - 1) / k (m/N), of either sign."""
        return (self.sensitivity_ratio - 1.0) / self.spring_constant

    def bending(self, force: FloatArray) -> FloatArray:
        """Bending (m) that was subtracted from the depth at force readings (N)."""
        return np.asarray(force / self.spring_constant)
