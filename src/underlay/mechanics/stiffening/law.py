"""A layer that stiffens: its numbers (`Gent`), and the law of its contact with a sphere (`StiffeningLaw`).

With `limits` all that this folder knows of layers, tips and laws; `factors` and `gradual` know arrays.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from typing import Any, ClassVar, NamedTuple, Protocol, Self

import numpy as np

from underlay._arrays import FloatArray, PerSet, finite
from underlay.errors import InputError
from underlay.mechanics.body import Body, Layer, Stiffening
from underlay.mechanics.contact_law import ContactLaw, LawOnLaw, OnLaw
from underlay.mechanics.stiffening.factors import (
    FIRST_TOUCH,
    GradualDepth,
    LogFactor,
    Medium,
    Place,
    form,
    gent,
    gradual_depth,
    known_errors,
    neo_hookean,
)
from underlay.mechanics.stiffening.limits import FORM_KNOWN_TO, largest_by_depth, require_known, require_reach
from underlay.quantities import quantity

# Step in ln w of d ln a/d ln w of the linear law, by central differences of fourth order: 1e-12 of it on laws
# of the exact problem and on half-spaces, for steps of 3e-4 to 3e-3.
_STEP = 1e-3
_STENCIL, _WEIGHTS = np.array([-2.0, -1.0, 0.0, 1.0, 2.0]), np.array([1.0, -8.0, 0.0, 8.0, -1.0]) / 12.0
#: What the linear law must reach beyond the largest depth for that.
MARGIN = 1.0 + 3.0 * _STEP


@dataclass(frozen=True)
class FormUnknown:
    """Warning of a contact law: so deep on a layer, the form of the energy matters more than its size c allows for.

    Another form of the strain energy would then give another modulus; c is `StiffLayer.form`.

    Parameters
    ----------
    ratio : float
        Depth over thickness, w/h.
    """

    ratio: float

    def __str__(self) -> str:
        return (
            f"the tip goes {self.ratio:.2g} of the thickness deep; beyond {FORM_KNOWN_TO:g} another form of the "
            "strain energy gives another modulus, by more than its interval says: use less of the curve ([curve] "
            "max_depth)"
        )


class Linear(Protocol):
    """What `StiffLayer` needs of the linear elastic law of a sphere, at depths (m), (..., n), in contact."""

    def force_and_stiffness(self, depth: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Force P (N) and stiffness dP/dw (N/m), (..., n) each, at depths w (m)."""

    def force(self, depth: FloatArray) -> FloatArray:
        """Force (N), (..., n), at depths (m)."""

    def contact_radius(self, depth: FloatArray) -> FloatArray:
        """Contact radius (m), (..., n), at depths (m)."""


class Pressed(NamedTuple):
    """Force, stiffness and what they were computed from, at given depths of the tip, each (..., n).

    Parameters
    ----------
    asked : GradualDepth
        Equivalent depth (m), at which the linear law is evaluated where contact is gradual.
    place : Place
        Dimensionless depth and contact radius there.
    force, stiffness : FloatArray
        Force (N) and stiffness (N/m), all factors included.
    in_limit, in_form : FloatArray
        Derivatives d ln G/ds of the stiffening factor G, s = 1/Jm, and d ln F/dc of the form's; that is None at
        c = 0.
    """

    asked: GradualDepth
    place: Place
    force: FloatArray
    stiffness: FloatArray
    in_limit: FloatArray
    in_form: FloatArray | None


@dataclass(frozen=True)
class StiffLayer(OnLaw):
    """Factors by which stiffening changes the linear law of a sphere; parameters (sets, 1) for many contacts.

    Parameters
    ----------
    radius, thickness : float or FloatArray
        Radius R of the sphere and thickness h of the layer (m); h infinite for a half-space.
    medium : Medium
        Poisson's ratio and base of the layer.
    inverse_limit : float or FloatArray
        s = 1/Jm, the inverse limit of the first invariant in Gent's energy.
    form : float or FloatArray, default 0
        Size c of the difference from Gent's form of energy (`factors.form`).
    spread : float or FloatArray, default 0
        Standard deviation (m) of the heights of a gradual contact.
    """

    radius: PerSet
    thickness: PerSet
    medium: Medium
    inverse_limit: PerSet
    form: PerSet = 0.0
    spread: PerSet = 0.0

    def asked(self, depth: FloatArray) -> GradualDepth:
        """Equivalent depths (m) at which to evaluate the linear law; `depth` itself if contact is not gradual."""
        if not np.any(self.spread):
            return GradualDepth(depth, np.ones_like(depth), np.zeros_like(depth))
        return gradual_depth(depth, self.spread)

    def place(self, depth: FloatArray, wide: FloatArray) -> Place:
        """Make depths and linear contact radii `wide` (m), (..., n), dimensionless, by radius and thickness."""
        return Place(depth / self.radius, depth / self.thickness, wide / self.thickness, wide / self.radius)

    def factor(self, place: Place) -> tuple[LogFactor, FloatArray, FloatArray | None]:
        """Product N G F of the factors (neo-Hookean, stiffening, form); d ln G/ds and d ln F/dc as in `Pressed`."""
        stiff, in_limit = gent(place, self.medium, self.inverse_limit)
        found = neo_hookean(place, self.medium).times(stiff)
        if not np.any(self.form):
            return found, in_limit, None
        other, in_form = form(place, self.medium, self.form)
        return found.times(other), in_limit, in_form

    def force(self, linear: Linear, depth: FloatArray) -> FloatArray:
        """Force (N), (..., n), at depths (m) in contact, without derivatives: a third of the work of `pressed`."""
        asked = self.asked(depth).depth
        factor, *_ = self.factor(self.place(asked, linear.contact_radius(asked)))
        return np.asarray(linear.force(asked) * factor.value)

    def pressed(self, linear: Linear, depth: FloatArray) -> Pressed:
        """Force, stiffness and intermediate results at depths (m), (..., n), in contact, from the linear law."""
        asked = self.asked(depth)
        steps = np.exp(_STEP * _STENCIL).reshape(-1, *(1,) * depth.ndim)
        wide = linear.contact_radius(asked.depth * steps)
        rate = np.tensordot(_WEIGHTS, np.log(wide), 1) / _STEP
        place = self.place(asked.depth, wide[2])
        factor, in_limit, in_form = self.factor(place)
        force, slope = linear.force_and_stiffness(asked.depth)
        rising = force * factor.along_depth(rate) / asked.depth
        value = factor.value
        return Pressed(asked, place, force * value, asked.slope * (slope + rising) * value, in_limit, in_form)

    def slope(self, name: str, found: Pressed) -> FloatArray:
        """Derivative of the force at fixed depth, (..., n), in one parameter of `Gent`, by its field name.

        In ``inverse_limit`` and ``form`` (N), or in ``height_spread`` (N/m).
        """
        if name == "inverse_limit":
            return found.force * found.in_limit
        if name == "form":
            known = found.in_form
            return found.force * (form(found.place, self.medium, self.form)[1] if known is None else known)
        if not np.any(self.spread):
            return np.zeros_like(found.force)
        return found.stiffness / found.asked.slope * found.asked.in_spread / self.spread

    def law(self, inner: Callable[[float], ContactLaw], max_depth: float) -> StiffeningLaw:
        """Build the law for depths up to `max_depth` (m); `inner` builds the linear law up to a depth (m).

        Raises
        ------
        RangeError
            If the factors are not known so deep, with the largest depth (m) that works.
        """
        radius, thickness, limit = float(self.radius), float(self.thickness), float(self.inverse_limit)
        end = self.asked(np.array([max_depth])).depth
        deepest = float(end[0])
        known = min(deepest, float(largest_by_depth(radius, thickness)))
        linear = inner(MARGIN * known)

        def place_at(depth: float) -> Place:
            at = end if depth == max_depth else self.asked(np.array([depth])).depth
            wide = linear.contact_radius(at) if at[0] <= known else np.full(1, np.nan)
            return self.place(at, wide)

        if max_depth > 0.0:
            require_reach(place_at, max_depth, self.medium, limit)
        doubt = () if deepest <= FORM_KNOWN_TO * thickness else (FormUnknown(deepest / thickness),)
        return StiffeningLaw.over(
            linear,
            reason=f"stiffening, 1/Jm = {limit:.4g}, on: {linear.reason}",
            max_depth=max_depth,
            warnings=(*linear.warnings, *doubt),
            inner=linear,
            layer=self,
        )


@dataclass(frozen=True, kw_only=True)
class StiffeningLaw(LawOnLaw):
    """Contact law of a sphere on a stiffening layer: P(w) = P_linear(u) N G F (module `factors`).

    w is the depth, u the equivalent depth where contact is gradual (else w).

    Parameters
    ----------
    inner : ContactLaw
        Linear elastic law of the sphere on the layer; it reaches a little deeper than `max_depth`.
    layer : StiffLayer
        The factors N (neo-Hookean), G (stiffening) and F (form of the energy).
    """

    layer: StiffLayer
    _last: dict[bytes, Pressed] = field(default_factory=dict, init=False, repr=False, compare=False)

    @property
    def domain(self) -> tuple[float, float]:
        """Smallest and largest depth (m): first touch, negative where contact is gradual, and `max_depth`."""
        return FIRST_TOUCH * float(self.layer.spread), self.max_depth

    @property
    def linear_law(self) -> ContactLaw:
        """The linear elastic law without stiffening."""
        return self.inner.linear_law

    def stiffening(self, depth: FloatArray) -> FloatArray:
        """Stiffening factor G, (n,), at depths (m) in contact: force over that of a neo-Hookean layer."""
        place = self._place(self.layer.asked(depth).depth)
        return gent(place, self.layer.medium, self.layer.inverse_limit)[0].value

    def known_errors(self, depth: FloatArray) -> dict[str, FloatArray]:
        """Standard errors (N) of the force at depths (m), (n,) each, by source: "stiffening", "finite strain"."""
        rows = self._in_contact(depth, self._known_errors, 2)
        return {"stiffening": rows[0], "finite strain": rows[1]}

    def _known_errors(self, depth: FloatArray) -> FloatArray:
        found = self._pressed(depth)
        factor, _ = gent(found.place, self.layer.medium, self.layer.inverse_limit)
        stiffening, soft = known_errors(factor, self.layer.medium)
        return np.asarray(found.force * np.stack((stiffening, np.broadcast_to(soft, stiffening.shape))))

    def own_slope(self, name: str, depth: FloatArray) -> FloatArray:
        """Derivative (SI), (n,), of the force in a field of `Gent` at depths (m), (n,); 0 before contact."""
        return self._in_contact(depth, lambda w: self.layer.slope(name, self._pressed(w)))

    def _pressed(self, depth: FloatArray) -> Pressed:
        """`StiffLayer.pressed` at depths (m) in contact, (n,); the last result is cached for derivatives."""
        key = depth.tobytes()
        if key not in self._last:
            self._last.clear()
            self._last[key] = self.layer.pressed(self.inner, depth)
        return self._last[key]

    @property
    def _beyond(self) -> str:
        return "the law was asked for up to there; ask for less depth, or build it for more"

    def _force(self, depth: FloatArray) -> FloatArray:
        return self.layer.force(self.inner, depth)

    def _stiffness(self, depth: FloatArray) -> FloatArray:
        return self._pressed(depth).stiffness

    def _force_and_stiffness(self, depth: FloatArray) -> FloatArray:
        found = self._pressed(depth)
        return np.stack((found.force, found.stiffness))

    def _contact_radius(self, depth: FloatArray) -> FloatArray:
        del depth
        raise InputError(
            "the contact radius on a layer that stiffens is not known: at 1/Jm = 10 it is 0.84 to 0.73 of the "
            "linear law's at w = 0.3 to 0.6 R, and 0.58 to 0.46 at 1/Jm = 33; leave out what asks for it, or "
            "stiffening"
        )

    def _place(self, depth: FloatArray) -> Place:
        return self.layer.place(depth, self.inner.contact_radius(depth))


@dataclass(frozen=True)
class Gent(Stiffening):
    """A layer that stiffens as Gent's solid does: W = -(mu Jm/2) ln(1 - (I1 - 3)/Jm).

    The layer's E is that of small strains. Known for true spheres on one layer on a rigid base or on a
    half-space, up to w = 0.6 R.

    Parameters
    ----------
    inverse_limit : float
        1/Jm, zero or more; zero is neo-Hookean. Soft tissue 0.02 to 12, gels and rubber about 0.1.
    form : float, default 0
        Size c of the difference of another form of strain energy; 0 is Gent's, 0.3 is Ogden's of exponent -7.
    height_spread : float, default 0
        Standard deviation (m) of the heights at which tip and surface meet; above 0 contact is made gradually.

    Raises
    ------
    InputError
        If 1/Jm is negative, as softening is not simulated, or the spread of heights is.

    Examples
    --------
    >>> import underlay as ul
    >>> gel = ul.Layer(ul.Isotropic(3e3, 0.5), 50e-6, stiffening=ul.Gent(1.0))
    >>> law = ul.contact_law(ul.Sphere(25e-6), gel, ul.RIGID, max_depth=7.5e-6)
    >>> f"{law.force(7.5e-6):.4g} N, G = {law.stiffening(np.array([7.5e-6]))[0]:.4f}"
    '7.88e-07 N, G = 1.0880'
    """

    model: ClassVar[str] = "gent"

    inverse_limit: float = field(
        metadata=quantity(
            "dimensionless",
            "stiffening 1/Jm of the {part}",
            symbol="1/J_m",
            bounds=(0.0, np.inf),
            nearly_linear=True,
            from_zero=True,
            power=1.0,
        )
    )
    form: float = field(
        default=0.0,
        metadata=quantity("dimensionless", "form of the strain energy", symbol="c", natural_scale=0.3),
    )
    height_spread: float = field(
        default=0.0,
        metadata=quantity(
            "length", "spread of heights at contact", symbol="s_z", bounds=(0.0, np.inf), power=2.0
        ),
    )

    def __post_init__(self) -> None:
        for name, unit in (
            ("inverse_limit", "dimensionless"),
            ("form", "dimensionless"),
            ("height_spread", "m"),
        ):
            object.__setattr__(self, name, finite(getattr(self, name), f"layer.stiffening.{name}", unit))
        if self.inverse_limit < 0.0:
            raise InputError(
                f"layer.stiffening.inverse_limit (1/Jm) is zero (neo-Hookean) or more; got {self.inverse_limit:g}: "
                "a layer that softens is not simulated"
            )
        if self.height_spread < 0.0:
            raise InputError(f"layer.stiffening.height_spread is zero or more; got {self.height_spread:g} m")

    @classmethod
    def locking_at(cls, stretch: float) -> Self:
        """Make a `Gent` that locks at this uniaxial stretch (above 1): Jm = stretch^2 + 2/stretch - 3."""
        if not stretch > 1.0:
            raise InputError(f"a locking stretch is above 1; got {stretch!r}")
        return cls(1.0 / (stretch**2 + 2.0 / stretch - 3.0))

    @property
    def unstiffened(self) -> Self:
        """The same with 1/Jm = 0: a neo-Hookean layer, which does not stiffen."""
        return replace(self, inverse_limit=0.0)

    def on(self, indenter: Any, layer: Layer, base: Body | None, beside: Mapping[str, bool]) -> StiffLayer:
        """Return the factors for an indenter on a layer on a base; InputError for contacts they are not known for.

        `beside` says which other effects the test has: keys "friction", "adhesion", "history", "small strains" and
        "discrepancy", True where present.

        Raises
        ------
        InputError
            With the number that is beyond, the end of what is known, and what to do.
        """
        medium = require_known(indenter, layer, base, beside)
        thickness = layer.thickness if base is not None else np.inf
        return StiffLayer(
            indenter.radius, thickness, medium, self.inverse_limit, self.form, self.height_spread
        )


def at_values(values: Mapping[str, PerSet], *, sliding: bool, layered: bool) -> StiffLayer:
    """Return the factors of stiffening at the parameter values of a scene (SI).

    Parameters
    ----------
    values : mapping
        Parameter values by path, such as "layer.nu"; floats, or (sets, 1) where they differ between sets.
    sliding : bool
        Whether the layer slides on its base without friction instead of being bonded.
    layered : bool
        Whether there is a base; otherwise the layer is a half-space.
    """
    return StiffLayer(
        values["indenter.radius"],
        values["layer.thickness"] if layered else np.inf,
        Medium(values["layer.nu"], sliding),
        values["layer.stiffening.inverse_limit"],
        values["layer.stiffening.form"],
        values["layer.stiffening.height_spread"],
    )
