"""Axisymmetric rigid indenters: shape Phi(r) and its Abel transform.

Every solver needs a shape only through the half-space depth at which the contact radius is r,

    H(r) = r int_0^r Phi'(s) ds / sqrt(r^2 - s^2)           (first term of the paper's (2.13)),

and two moments of it. With V(s) = 2 theta (w - H(s)) in (3.1) and (4.8), integration by parts gives

    int_0^a H(s) ds     = a H(a) - int_0^a Phi'(rho) rho^2 drho / sqrt(a^2 - rho^2),
    int_0^a H(s) s^2 ds = int_0^a Phi(rho) (2 rho^2 - a^2) rho drho / sqrt(a^2 - rho^2),

so the three integrals of (4.12) are H and its moments: no shape needs more.

To add an indenter: a frozen dataclass that derives from `Indenter` (or from `PowerLawShape`). Where it is round, a
cone, smooth or ends in an edge it says so (`curvature_radius`, `opening`, `smooth`, `has_edge`): what is known of
such tips then holds for it.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable
from dataclasses import dataclass, field
from functools import cached_property
from typing import TYPE_CHECKING, Any, ClassVar, Self

import numpy as np
from scipy import special

from underlay._arrays import FloatArray, finite, positive
from underlay.errors import InputError
from underlay.plugins import INDENTERS, Plugin, plugins
from underlay.quantities import Part, quantity

# Below this a/R the closed forms of (6.3) and (6.4) subtract nearly equal numbers; the series does not.
# At 0.5 the 26-term series is exact to 0.5^54 and the closed forms lose 1.3 digits (5e-15).
_SERIES_LIMIT = 0.5
_TERM = np.arange(26)
_FIRST = 1.0 / ((2 * _TERM + 1) * (2 * _TERM + 3))
_STEEPEST = 0.9999
_SECOND = 1.0 / ((2 * _TERM + 5) * (2 * _TERM + 1))
# Cubic convergence: 3.2 % becomes 2e-6, and that nothing.
_HALLEY_STEPS = 2


class Indenter(Part, ABC):
    """A rigid, convex, axisymmetric indenter; all lengths in metres.

    A concrete class names itself in `shape`; scene files know it by that name.
    """

    parts: ClassVar[tuple[str, ...]] = ("indenter",)
    chosen_by: ClassVar[str] = "shape"
    shape: ClassVar[str] = ""

    @classmethod
    def kinds(cls) -> dict[str, type[Self]]:
        """Every indenter class by the name of its shape, those of plug-in packages included."""
        plugged_indenters()
        return super().kinds()

    #: Whether the contact keeps its radius at every depth: a flat end with an edge.
    has_edge: ClassVar[bool] = False
    #: Whether H has no corners in its derivatives between the apex and `max_radius`: integrals take fewer nodes.
    smooth: ClassVar[bool] = False

    @property
    def max_radius(self) -> float:
        """Largest contact radius (m) the shape allows; inf where it never ends."""
        return np.inf

    @property
    def curvature_radius(self) -> float | None:
        """Radius of curvature (m) at the apex of a round tip; None for one that is flat or pointed."""
        return None

    @property
    def opening(self) -> float | None:
        """Half-angle of a cone (radians, from its axis); None for any other shape."""
        return None

    def in_its_unit(self) -> tuple[Indenter, float]:
        """The tip scaled to a unit of length in which tips of all sizes coincide, and that unit (m)."""
        return self, 1.0

    @property
    def power_law(self) -> PowerLawShape:
        """Power-law shape by which depths are made dimensionless in the exact law.

        The shape itself if it is a power law, the paraboloid of its curvature, or a power law as deep at its end.

        Raises
        ------
        InputError
            If the shape is none of these and has no end, so that no power law can be chosen.
        """
        if self.curvature_radius is not None:
            return Paraboloid(self.curvature_radius)
        if not np.isfinite(self.max_radius):
            name = type(self).__name__
            raise InputError(
                f"{name}.max_radius is {self.max_radius!r}, and {name} is no power law: the exact law measures "
                "such a shape up to its largest contact radius. Give the class a finite max_radius (m), e.g. the "
                "radius at which the shank begins, or derive it from PowerLawShape"
            )
        near, far = self.abel(self.max_radius * np.array([1e-6, 2e-6])).tolist()
        exponent = max(1.0, round(float(np.log2(far / near))))
        deepest = float(self.abel(np.array(self.max_radius)))
        return PowerLaw(exponent, deepest / (abel_factor(exponent) * self.max_radius**exponent))

    @abstractmethod
    def surface(self, radius: FloatArray) -> FloatArray:
        """Shape Phi(r) (m) at `radius` (m), any shape of array."""

    @abstractmethod
    def abel(self, radius: FloatArray) -> FloatArray:
        """H(r) (m): depth at which the contact radius on a half-space is `radius` (m)."""

    @abstractmethod
    def abel_slope(self, radius: FloatArray) -> FloatArray:
        """H'(r) (dimensionless) at `radius` (m); never negative.

        H(r) is the depth at which the contact radius on a half-space is r.
        """

    @abstractmethod
    def abel_moments(self, radius: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Moments int_0^a H ds (m^2) and int_0^a H s^2 ds (m^4) of H for contact radii a = `radius` (m).

        H(r) is the depth at which the contact radius on a half-space is r.
        """

    @abstractmethod
    def halfspace_radius(self, depth: FloatArray) -> FloatArray:
        """Inverse of `abel`: contact radius (m) on a half-space at positive `depth` (m)."""

    def halfspace_force(self, depth: FloatArray, radius: FloatArray) -> FloatArray:
        """P/(4 theta) (m^2) on a half-space, w a - int_0^a H ds, at a `depth` (m) and its contact `radius` (m).

        theta is the elastic constant of the surface.
        """
        return np.asarray(depth * radius - self.abel_moments(radius)[0])


@dataclass(frozen=True)
class FlatPunch(Indenter):
    """A flat-ended cylinder of the given radius (m); its contact radius never changes."""

    shape: ClassVar[str] = "flat_punch"
    has_edge: ClassVar[bool] = True

    radius: float = field(
        metadata=quantity("length", "{part} radius", symbol="R", bounds=(0.0, np.inf), scales="length")
    )

    def __post_init__(self) -> None:
        object.__setattr__(self, "radius", positive(self.radius, "punch radius", "m"))

    @property
    def max_radius(self) -> float:
        """The punch's own radius (m)."""
        return self.radius

    def surface(self, radius: FloatArray) -> FloatArray:
        """Phi(r) (m): zero under the face, infinite outside."""
        return np.where(radius <= self.radius, 0.0, np.inf)

    def abel(self, radius: FloatArray) -> FloatArray:
        """H(r) = 0, because the face is flat.

        H(r) is the depth at which the contact radius on a half-space is r.
        """
        return np.zeros_like(radius)

    def abel_slope(self, radius: FloatArray) -> FloatArray:
        """H'(r) = 0, because the face is flat.

        H(r) is the depth at which the contact radius on a half-space is r.
        """
        return np.zeros_like(radius)

    def abel_moments(self, radius: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Both moments of H are zero, because the face is flat."""
        return np.zeros_like(radius), np.zeros_like(radius)

    def halfspace_radius(self, depth: FloatArray) -> FloatArray:
        """The punch's radius at every positive depth."""
        return np.full_like(depth, self.radius)


def plugged_indenters() -> tuple[Plugin, ...]:
    """Load the indenters that other packages add; see `underlay.plugins`."""
    return plugins(INDENTERS, _fault)


def _fault(name: str, thing: object) -> str:
    del name  # scene files know an indenter by its shape
    if not (isinstance(thing, type) and issubclass(thing, Indenter)):
        return "it is no class that derives from Indenter"
    if not thing.shape:
        return "it has no name: give its class a `shape`"
    others = [kind for kind in _heirs(Indenter) if kind.shape == thing.shape and kind is not thing]
    return f"another indenter is called {thing.shape!r}" if others else ""


def _heirs(kind: type[Part]) -> list[type[Any]]:
    return [heir for child in kind.__subclasses__() for heir in (child, *_heirs(child))]


def abel_factor(exponent: float | FloatArray) -> FloatArray:
    """F_2(lambda) of (5.5), with H(r) = A F_2 r^lambda for the shape A r^lambda; lambda = `exponent`.

    F_2 = lambda 2^(lambda-2) Gamma(lambda/2)^2 / Gamma(lambda) = (lambda/2) B(lambda/2, 1/2), written with the beta
    function so that lambda = 200 does not overflow.

    H(r) is the depth at which the contact radius on a half-space is r. Equation numbers are those of
    Argatov and Sabina.
    """
    return np.asarray(0.5 * exponent * special.beta(0.5 * exponent, 0.5))


class PowerLawShape(Indenter):
    """Phi(r) = A r^lambda (5.1): the family in which every relation has a closed form.

    Equation numbers are those of Argatov and Sabina.
    """

    smooth: ClassVar[bool] = True

    # Not abstract properties: `PowerLaw` holds both as plain fields, which cannot replace a property.
    if TYPE_CHECKING:

        @property
        def exponent(self) -> float:
            """The paper's lambda (dimensionless), at least 1."""

        @property
        def coefficient(self) -> float:
            """The paper's A (m^(1-lambda)), positive."""

    @property
    def power_law(self) -> Self:
        """The shape itself, which is a power law."""
        return self

    @cached_property
    def abel_coefficient(self) -> float:
        """A F_2(lambda), the coefficient in H(r) = A F_2 r^lambda.

        The shape is A r^lambda. F_2(lambda) is `abel_factor`. H(r) is the depth at which the contact radius
        on a half-space is r.
        """
        return self.coefficient * float(abel_factor(self.exponent))

    @cached_property
    def _steepness(self) -> float:
        """(A F_2)^(1/lambda) (m^(1/lambda-1)), with H(r) = (steepness r)^lambda; avoids underflow of A F_2.

        The shape is A r^lambda. F_2(lambda) is `abel_factor`. H(r) is the depth at which the contact radius
        on a half-space is r.
        """
        return float(
            (self.coefficient ** (1.0 / self.exponent)) * abel_factor(self.exponent) ** (1.0 / self.exponent)
        )

    @cached_property
    def unit_radius(self) -> float:
        """Half-space contact radius over w^(1/lambda), w the depth (m^(1-1/lambda)).

        The shape is A r^lambda.
        """
        return 1.0 / self._steepness

    def surface(self, radius: FloatArray) -> FloatArray:
        """Phi(r) = A r^lambda (5.1).

        Equation numbers are those of Argatov and Sabina.
        """
        return np.asarray((self.coefficient ** (1.0 / self.exponent) * radius) ** self.exponent)

    def abel(self, radius: FloatArray) -> FloatArray:
        """H(r) = A F_2(lambda) r^lambda, the leading term of (5.3).

        The shape is A r^lambda. F_2(lambda) is `abel_factor`. H(r) is the depth at which the contact radius
        on a half-space is r. Equation numbers are those of Argatov and Sabina.
        """
        return np.asarray((self._steepness * radius) ** self.exponent)

    def abel_slope(self, radius: FloatArray) -> FloatArray:
        """H'(r) = lambda A F_2(lambda) r^(lambda-1).

        The shape is A r^lambda. F_2(lambda) is `abel_factor`. H(r) is the depth at which the contact radius
        on a half-space is r.
        """
        steepness = self._steepness
        return np.asarray(self.exponent * steepness * (steepness * radius) ** (self.exponent - 1.0))

    def abel_moments(self, radius: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Moments int_0^a H ds = A F_2 a^(lambda+1)/(lambda+1) and int_0^a H s^2 ds, a = `radius` (m).

        The shape is A r^lambda. F_2(lambda) is `abel_factor`.
        """
        depth = self.abel(radius)
        return depth * radius / (self.exponent + 1.0), depth * radius**3 / (self.exponent + 3.0)

    def halfspace_force(self, depth: FloatArray, radius: FloatArray) -> FloatArray:
        """P/(4 theta) (m^2) on a half-space: w a lambda/(lambda + 1), at a `depth` w (m) and its `radius` a (m).

        The shape is A r^lambda. theta is the elastic constant of the surface.
        """
        return np.asarray(self.exponent / (self.exponent + 1.0) * depth * radius)

    def halfspace_radius(self, depth: FloatArray) -> FloatArray:
        """a = (w / (A F_2))^(1/lambda) (m) at `depth` w (m): the paper's varpi times h, (5.8).

        The shape is A r^lambda. F_2(lambda) is `abel_factor`.
        """
        return np.asarray(depth ** (1.0 / self.exponent) / self._steepness)


@dataclass(frozen=True)
class Paraboloid(PowerLawShape):
    """Phi(r) = r^2/(2R) (5.11): what most AFM software calls a sphere. `radius` R in metres.

    Equation numbers are those of Argatov and Sabina.
    """

    shape: ClassVar[str] = "paraboloid"

    radius: float = field(
        metadata=quantity("length", "{part} radius", symbol="R", bounds=(0.0, np.inf), scales="length")
    )

    def __post_init__(self) -> None:
        object.__setattr__(self, "radius", positive(self.radius, "paraboloid radius", "m"))

    @property
    def curvature_radius(self) -> float:
        """Radius of curvature R (m) at the apex."""
        return self.radius

    @property
    def exponent(self) -> float:
        """Exponent of the power law, 2."""
        return 2.0

    @property
    def coefficient(self) -> float:
        """A = 1/(2R) (1/m) of the shape A r^2."""
        return 0.5 / self.radius


@dataclass(frozen=True)
class Cone(PowerLawShape):
    """A cone of the given half-angle, from its axis, in radians, in (0, pi/2).

    The paper's gamma (section 5.2) is the complement: Phi = r tan(gamma) = r / tan(half_angle).
    """

    shape: ClassVar[str] = "cone"

    half_angle: float = field(
        metadata=quantity("angle", "half-angle of the {part}", bounds=(0.0, 0.5 * np.pi))
    )

    def __post_init__(self) -> None:
        angle = finite(self.half_angle, "cone half-angle", "radians from the axis")
        if not (0.0 < angle < 0.5 * np.pi):
            raise InputError(
                f"cone half-angle must be in (0, pi/2) radians from the axis; got {self.half_angle!r} "
                "(is it in degrees?)"
            )
        object.__setattr__(self, "half_angle", angle)

    @property
    def opening(self) -> float:
        """Half-angle (radians, from the axis)."""
        return self.half_angle

    @property
    def exponent(self) -> float:
        """Exponent of the power law, 1."""
        return 1.0

    @property
    def coefficient(self) -> float:
        """A = cot(half_angle) (dimensionless) of the shape A r."""
        return 1.0 / float(np.tan(self.half_angle))

    @classmethod
    def berkovich(cls) -> Self:
        """Cone with the projected area of a Berkovich pyramid, A_p = 3 sqrt(3) tan^2(65.27 deg) d^2."""
        return cls(float(np.arctan(np.sqrt(3.0 * np.sqrt(3.0) / np.pi) * np.tan(np.deg2rad(65.27)))))

    @classmethod
    def vickers(cls) -> Self:
        """Cone with the projected area of a Vickers pyramid, A_p = 4 tan^2(68 deg) d^2."""
        return cls(float(np.arctan(np.sqrt(4.0 / np.pi) * np.tan(np.deg2rad(68.0)))))


@dataclass(frozen=True)
class PowerLaw(PowerLawShape):
    """Phi(r) = `coefficient` * r^`exponent` (5.1).

    Equation numbers are those of Argatov and Sabina.

    Parameters
    ----------
    exponent : float
        The paper's lambda, at least 1 (below that the shape is not convex).
    coefficient : float
        The paper's A (m^(1-lambda)), positive.
    """

    shape: ClassVar[str] = "power_law"

    exponent: float = field(
        metadata=quantity("dimensionless", "exponent of the {part}'s shape", bounds=(1.0, np.inf))
    )
    coefficient: float = field(
        metadata=quantity("dimensionless", "coefficient of the {part}'s shape", bounds=(0.0, np.inf))
    )

    def __post_init__(self) -> None:
        exponent = finite(self.exponent, "shape exponent", "dimensionless")
        if exponent < 1.0:
            raise InputError(f"shape exponent must be at least 1 (a convex shape); got {self.exponent!r}")
        object.__setattr__(self, "exponent", exponent)
        object.__setattr__(
            self, "coefficient", positive(self.coefficient, "shape coefficient", "m^(1-exponent)")
        )


@dataclass(frozen=True)
class Sphere(Indenter):
    """A true sphere, Phi = R - sqrt(R^2 - r^2) (6.1); `radius` R in metres, contact radius a < R.

    Equation numbers are those of Argatov and Sabina.
    """

    shape: ClassVar[str] = "sphere"
    smooth: ClassVar[bool] = True

    radius: float = field(
        metadata=quantity("length", "{part} radius", symbol="R", bounds=(0.0, np.inf), scales="length")
    )

    def __post_init__(self) -> None:
        object.__setattr__(self, "radius", positive(self.radius, "sphere radius", "m"))

    @property
    def curvature_radius(self) -> float:
        """Radius R (m)."""
        return self.radius

    def in_its_unit(self) -> tuple[Sphere, float]:
        """The sphere of unit radius, and the radius R (m) as the unit."""
        return Sphere(1.0), self.radius

    @cached_property
    def power_law(self) -> Paraboloid:
        """The paraboloid of the same curvature."""
        return Paraboloid(self.radius)

    @property
    def max_radius(self) -> float:
        """0.9999 R: there the flank is 89.2 degrees steep and H(r) grows without bound towards R.

        H(r) is the depth at which the contact radius on a half-space is r.
        """
        return _STEEPEST * self.radius

    def surface(self, radius: FloatArray) -> FloatArray:
        """Phi(r), as r^2 / (R + sqrt(R^2 - r^2)): no cancellation near the apex."""
        return np.asarray(radius**2 / (self.radius + np.sqrt(self.radius**2 - radius**2)))

    def abel(self, radius: FloatArray) -> FloatArray:
        """H(r) = r artanh(r/R), the first identity of section 6.

        H(r) is the depth at which the contact radius on a half-space is r.
        """
        return np.asarray(radius * np.arctanh(radius / self.radius))

    def abel_slope(self, radius: FloatArray) -> FloatArray:
        """H'(r) = artanh(r/R) + (r/R)/(1 - (r/R)^2).

        H(r) is the depth at which the contact radius on a half-space is r.
        """
        alpha = np.asarray(radius, dtype=np.float64) / self.radius
        return np.asarray(np.arctanh(alpha) + alpha / ((1.0 - alpha) * (1.0 + alpha)))

    def abel_moments(self, radius: FloatArray) -> tuple[FloatArray, FloatArray]:
        """First and second moment of H: the second and third identities of section 6, by (3.2).

        Equation numbers are those of Argatov and Sabina.
        """
        alpha = np.asarray(radius, dtype=np.float64) / self.radius
        second = _from_series(
            alpha,
            5,
            _SECOND,
            lambda large: 0.25 * large + large**3 / 12.0 - 0.25 * (1.0 - large**4) * np.arctanh(large),
        )
        return self.radius**2 * _first_moment(alpha), self.radius**4 * second

    def halfspace_force(self, depth: FloatArray, radius: FloatArray) -> FloatArray:
        """P/(4 theta) (m^2) on a half-space at a `depth` (m) and its `radius` (m), from the first moment alone.

        theta is the elastic constant of the surface.
        """
        alpha = np.asarray(radius, dtype=np.float64) / self.radius
        return np.asarray(depth * radius - self.radius**2 * _first_moment(alpha))

    def halfspace_radius(self, depth: FloatArray) -> FloatArray:
        """Contact radius a (m) on a half-space at `depth` w (m): root of a artanh(a/R) = w by Halley's method.

        In the variable t = artanh(a/R), where t tanh(t) = w/R.
        """
        target = np.asarray(depth, dtype=np.float64) / self.radius
        # Right to the second order where w/R = y is small, and where it is large: within 3.2 % everywhere.
        t = np.sqrt(target * (target + 1.0 / (1.0 + target * (2.0 / 3.0 + 0.35 * target))))
        for _ in range(_HALLEY_STEPS):
            tanh = np.tanh(t)
            left, sech_squared = t * tanh - target, 1.0 - tanh * tanh
            slope = tanh + t * sech_squared
            t = t - left * slope / (slope * slope - left * sech_squared * (1.0 - t * tanh))
        return np.asarray(self.radius * np.tanh(t))


def _first_moment(alpha: FloatArray) -> FloatArray:
    """int_0^alpha H ds of a unit sphere at `alpha`, radii over R."""
    return _from_series(alpha, 3, _FIRST, lambda large: 0.5 * (large - (1.0 - large**2) * np.arctanh(large)))


def _from_series(
    alpha: FloatArray, power: int, coefficients: FloatArray, closed: Callable[[FloatArray], FloatArray]
) -> FloatArray:
    """alpha^power times an even series at small alpha, and the closed form `closed` at large alpha.

    The closed form loses digits at small alpha, by cancellation.
    """
    small = np.minimum(alpha, _SERIES_LIMIT)
    value = small**power * _even_series(coefficients, small * small)
    if (alpha > _SERIES_LIMIT).any():
        value = np.where(alpha <= _SERIES_LIMIT, value, closed(np.maximum(alpha, _SERIES_LIMIT)))
    return value


def _even_series(coefficients: FloatArray, square: FloatArray) -> FloatArray:
    """Sum of coefficients_n * square^n; terms below 1e-17 of the first, at the largest square, are left out."""
    largest = max(float(np.max(square, initial=0.0)), 1e-17)
    count = min(1 + int(np.log(1e-17) / np.log(largest)), coefficients.size)
    total = np.full_like(square, coefficients[count - 1])
    for coefficient in coefficients[count - 2 :: -1] if count > 1 else ():
        total *= square
        total += coefficient
    return total
