"""Samples of finite width: their free sides are, to leading order, a spring in series with the law without sides.

    P(w) = F(w - kappa P/(E W)),

P the force at depth w, F the law of the layer on its rigid base, h its thickness, W the half-width of a round
plug with free sides (of a square block 2/sqrt(pi) of its half-width), E Young's modulus at small strains,
kappa(h/W; nu, base) a number that does not depend on the size of the contact: under the tip a force acts, and
the sides see no more of it (Saint-Venant).

    kappa = (h/W)/pi + S(h/W):

a long bar is compressed by h P/(pi E W^2); S is a spline in q = (h/W)/(h/W + 2) through finite elements
(linear, axisymmetric), with the two terms of its far end.
Between the points it is within 0.0004 of the cubic spline in h/W and of the far end's formula that the study
measured, over the whole range: nothing is switched. Errors against finite elements: 0.002 or 4 % for a/W up to
0.2, 3.5 % at h/W = 2 up to 0.5; fourteen more of our own (nu 0.3 to 0.4995, h/W 0.35 to 5, a/W 0.1) are met
within 0.0019, 0.04 % of the force. Of public three-dimensional blocks (211 curves, W from 5 R) the force is
within 0.4 % rms where it is 15 % lower.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from functools import cache
from typing import Any, Literal, NamedTuple, Self

import numpy as np
from numpy.typing import NDArray
from scipy import interpolate

from underlay._arrays import ArrayLike, FloatArray, PerSet, positive
from underlay.errors import InputError, LawError
from underlay.mechanics.body import SHAPES, Body, Layer, Rigid
from underlay.mechanics.contact_law import ContactLaw, LawOnLaw, OnLaw
from underlay.mechanics.materials import Isotropic
from underlay.mechanics.stiffening.factors import finite_elements, poisson_shares
from underlay.mechanics.stiffening.law import StiffeningLaw

# A square as a round of the same area; by its half-width alone forces are 6.5 % off at w/R = 0.5, W 5 to 6.5
# R.
_OF_BLOCK = 2.0 / float(np.sqrt(np.pi))

_LEAST_NU = 0.3
# Scale of q: of 0.5, 1 and 2 the last is nearest to the study's own spline (0.0012, 0.0007 and 0.0004).
_BEND = 2.0
# Of kappa: as a share, and where it is small.
_RELATIVE_ERROR, _LEAST_ERROR = 0.04, 0.002
# Largest a/W at which kappa was measured, at h/W = 2; 0.2 at other ratios.
_WIDEST = 0.5


def equivalent_radius(half_width: float, shape: str = "plug") -> float:
    """Radius (m) of the round plug equivalent to a sample of this half-width (m), round or square.

    Raises
    ------
    InputError
        If the half-width is not positive, or the shape not one of `SHAPES`.
    """
    if shape not in SHAPES:
        raise InputError(f"a sample of finite width is one of {', '.join(SHAPES)}; got {shape!r:.60}")
    # Of a round plug it is its radius, of a square block half its side.
    return positive(half_width, "the layer's half_width", "m") * (_OF_BLOCK if shape == "block" else 1.0)


def kappa(ratio: FloatArray, nu: PerSet, *, sliding: bool = False) -> FloatArray:
    """Dimensionless compliance of free sides, compliance times E W (module's head), broadcast shape.

    Parameters
    ----------
    ratio : FloatArray
        h/W, thickness over radius of the equivalent round plug, positive and finite.
    nu : float or FloatArray
        Poisson's ratio, 0.3 to 0.5.
    sliding : bool, default False
        Whether the layer slides on its rigid base; else it is bonded.

    Raises
    ------
    InputError
        If a ratio is not positive and finite, or nu below 0.3.
    """
    t = np.asarray(ratio, dtype=np.float64)
    if not (np.isfinite(t) & (t > 0.0)).all():
        raise InputError(
            f"a sample of finite width has a finite thickness on a rigid base; got h/W = {t.ravel()[0]!r}"
        )
    if not (np.asarray(nu) >= _LEAST_NU).all():
        raise InputError(f"finite width is known for nu from {_LEAST_NU:g}; got {float(np.min(nu)):g}")
    q = t / (t + _BEND)
    own, *below = _splines(sliding)
    found = t / np.pi + own(q)
    for share, spline in zip(poisson_shares(nu)[1:], below, strict=True):
        found = found - share * spline(q)
    return np.asarray(found)


@cache
def _splines(sliding: bool) -> tuple[interpolate.CubicSpline, ...]:
    """Splines in q (module's head) of S at nu = 1/2, and of its decrease at nu = 0.45 and at 0.3."""
    table = finite_elements()["finite_width"]
    known = table["sliding" if sliding else "bonded"]
    ratio, (end, falling) = np.array(table["ratios"]), known["far_end"]
    # At the far end 1/t is (1 - q)/(q bend): dS/dq = -falling/bend. Where a bonded layer is flat its sides
    # are not seen: kappa begins with slope zero.
    start = None if sliding else -_BEND / np.pi
    own = _spline(
        ratio / (ratio + _BEND), np.array(known["kappa"]) - ratio / np.pi, end, start, -falling / _BEND
    )
    fewer = np.array(table["fewer_ratios"])
    q = fewer / (fewer + _BEND)
    below = []
    for row in known["below"]:
        less = fewer / np.pi + own(q) - np.array(row)
        # Straight in W/h from h/W = 4 and 8 to the far end.
        below.append(_spline(q, less, 2.0 * less[-1] - less[-2], None if sliding else 0.0, None))
    return own, *below


def _spline(
    q: FloatArray, values: FloatArray, end: float, start_slope: float | None, end_slope: float | None
) -> interpolate.CubicSpline:
    """Cubic spline from (0, 0) through the values to `end` at q = 1, not-a-knot where no slope is given."""
    free: Literal["not-a-knot"] = "not-a-knot"
    slope: Literal[1] = 1
    return interpolate.CubicSpline(
        np.concatenate(([0.0], q, [1.0])),
        np.concatenate(([0.0], values, [end])),
        bc_type=(
            free if start_slope is None else (slope, np.array(start_slope)),
            free if end_slope is None else (slope, np.array(end_slope)),
        ),
    )


def standard_error(value: FloatArray) -> FloatArray:
    """Standard error of kappa: 4 % of `value`, at least 0.002; same shape."""
    return np.asarray(np.maximum(_RELATIVE_ERROR * value, _LEAST_ERROR))


def is_wide(contact_radius: FloatArray, radius: PerSet) -> NDArray[np.bool_]:
    """Whether contact radii (m) are at most half of the plug's `radius` W (m), broadcast shape."""
    return np.asarray(contact_radius <= _WIDEST * radius)


def require_wide(contact_radius: float, radius: float) -> None:
    """Raise for a contact radius (m) larger than half of the plug's `radius` W (m).

    Raises
    ------
    InputError
        With both radii.
    """
    if not is_wide(np.array(contact_radius), radius):
        raise InputError(
            f"finite width is known for contacts up to {_WIDEST:g} of the half-width; a = {contact_radius:.4g} m "
            f"is {contact_radius / radius:.2g} of it (half_width, as a round plug: {radius:.4g} m)"
        )


# Newton's method on a force that rises ever faster comes from above and never passes: 4 to 6 steps.
_MOST_STEPS = 50
# Of the depth: it converges quadratically, so that after such a step rounding is left.
_SETTLED = 1e-12

# Sides matter where 1.5 kappa P/(E W w), what they do to the force on a half-space, passes this (the study of
# stiffening layers, section 5).
_MATTERS = 0.01

#: Force (N) and dP/dw (N/m) of the law without sides at depths (m), (..., n), in contact.
Inner = Callable[[FloatArray], tuple[FloatArray, FloatArray]]
# What a test may not have beside its sides.
_BESIDE = {
    "relaxation": "layers that do not relax",
    "history": "samples without a history",
    "adhesion": "tips without adhesion",
    "friction": "tips without friction",
    "discrepancy": "laws without a discrepancy",
}


class Sprung(NamedTuple):
    """Balance of layer and spring, each (..., n): depth u (m) of the layer alone, force F(u) (N), stiffnesses.

    `inner_stiffness` is dF/du of the layer alone, `stiffness` that of layer and spring together (N/m).
    """

    depth: FloatArray
    force: FloatArray
    inner_stiffness: FloatArray
    stiffness: FloatArray


@dataclass(frozen=True)
class Sides(OnLaw):
    """Free sides of a layer on a rigid base, as a spring in series; for many samples entries are (sets, 1).

    Parameters
    ----------
    compliance : float or FloatArray
        kappa/(E W) (m/N), see `compliance`.
    error : float or FloatArray
        Its standard error (m/N).
    radius : float or FloatArray
        Radius W (m) of the equivalent round plug.

    Examples
    --------
    >>> from underlay.mechanics.body import RIGID
    >>> slice_of_brain = Layer(Isotropic(1e3, 0.5), 3e-3, half_width=2e-3, shape="block")
    >>> sides = Sides.of(slice_of_brain, RIGID)
    >>> f"{sides.compliance:.3g} +- {sides.error:.1g} m/N"
    '0.0677 +- 0.003 m/N'
    """

    compliance: PerSet
    error: PerSet
    radius: PerSet

    @classmethod
    def of(cls, layer: Layer, base: Body | None) -> Self:
        """Sides of a layer that has a `half_width`, on its base.

        Raises
        ------
        InputError
            If the layer has no rigid base, or is not isotropic, or held by springs, or nu is below 0.3.
        """
        material = layer.material
        if not isinstance(material, Isotropic):
            raise InputError(f"finite width is known for isotropic layers; here {type(material).__name__}")
        if not isinstance(base, Rigid) or not np.isfinite(layer.thickness) or layer.half_width is None:
            raise InputError(
                "finite width (layer.half_width) is known for one layer on a rigid base: give thickness and a "
                "rigid base, or leave the width out"
            )
        if layer.bond not in {"bonded", "slip", "unknown"}:
            raise InputError("finite width is known for a bonded or a sliding base; here springs")
        radius = equivalent_radius(layer.half_width, layer.shape)
        return cls.round(layer.thickness, radius, material.E, material.nu, sliding=layer.bond == "slip")

    @classmethod
    def round(cls, thickness: PerSet, radius: PerSet, E: PerSet, nu: PerSet, *, sliding: bool) -> Self:
        """Sides of a round plug of given thickness and radius (m), E (Pa) and nu; bonded, or `sliding`."""
        value = kappa(np.asarray(thickness / radius), nu, sliding=sliding)
        error = standard_error(value) / (E * radius)
        if value.ndim == 0 and np.ndim(error) == 0:
            return cls(float(value / (E * radius)), float(error), radius)
        return cls(value / (E * radius), error, radius)

    def sprung(self, inner: Inner, depth: FloatArray) -> Sprung:
        """Balance u + C F(u) = w at depths w (m), (..., n), in contact, by Newton's method.

        `inner` gives the force F (N) and stiffness (N/m) without sides at depths u (m); C is the sides' compliance.
        """
        u = depth.astype(np.float64)
        for _ in range(_MOST_STEPS):
            force, slope = inner(u)
            step = (u + self.compliance * force - depth) / (1.0 + self.compliance * slope)
            if (np.abs(step) <= _SETTLED * np.abs(depth)).all():
                return Sprung(u, force, slope, slope / (1.0 + self.compliance * slope))
            u = u - step
        raise LawError(f"the spring of the sides found no balance within {_MOST_STEPS} steps")

    def law(self, inner: Callable[[float], ContactLaw], max_depth: float) -> NarrowLaw:
        """Law of the layer with these sides up to `max_depth` (m); `inner` builds the one without.

        Raises
        ------
        InputError
            If the contact radius of linear elasticity is larger than half of W.
        """
        wide = inner(max_depth)
        require_wide(float(wide.linear_law.contact_radius(max(max_depth, 0.0))), float(self.radius))
        reason = f"{wide.reason}; sides as a spring of {self.compliance:.4g} m/N"
        return NarrowLaw.over(wide, reason=reason, inner=wide, sides=self)


@dataclass(frozen=True, kw_only=True)
class NarrowLaw(LawOnLaw):
    """Law of a layer with free sides: P(w) = F(u), where the depth u of the layer alone solves u + C F(u) = w.

    Parameters
    ----------
    inner : ContactLaw
        F, of the layer without sides.
    sides : Sides
        C (m/N), the compliance of the sides.
    """

    sides: Sides
    _last: dict[bytes, Sprung] = field(default_factory=dict, init=False, repr=False, compare=False)

    @property
    def linear_law(self) -> ContactLaw:
        """The linear elastic law without sides."""
        return self.inner.linear_law

    def known_errors(self, depth: FloatArray) -> dict[str, FloatArray]:
        """Standard errors (N) of the force at depths (m), (n,), by source: the sides, and those of stiffening."""
        force, slope = self.force_and_stiffness(depth)
        inner = self._through(depth, lambda law, u: law.known_errors(u))
        return {**inner, "sides": np.asarray(force * slope * self.sides.error)}

    def own_slope(self, name: str, depth: FloatArray) -> FloatArray:
        """dP/d(parameter of the layer's stiffening) at depths (m), (n,), by its name; zero without stiffening."""
        found = self._through(depth, lambda law, u: {name: law.own_slope(name, u)})
        return found.get(name, np.zeros_like(depth))

    def _through(
        self, depth: FloatArray, of: Callable[[StiffeningLaw, FloatArray], Mapping[str, FloatArray]]
    ) -> dict[str, FloatArray]:
        """Changes (N) of the force at depths (m), (n,), by name, from changes of the law without sides.

        `of` gives the latter from that law and its own depths u (m); empty if that law does not stiffen.
        """
        if not isinstance(self.inner, StiffeningLaw):
            return {}
        u, kept = depth.astype(np.float64), np.ones(len(depth))
        touching = depth > self.domain[0]
        found = self._sprung(depth[touching])
        u[touching], kept[touching] = found.depth, found.stiffness / found.inner_stiffness
        return {name: kept * change for name, change in of(self.inner, u).items()}

    def depth(self, force: ArrayLike) -> FloatArray:
        """Depth (m), shape of `force` (N): that without sides plus the spring's compression."""
        return np.asarray(
            self.inner.depth(force) + self.sides.compliance * np.asarray(force, dtype=np.float64)
        )

    def own_depth(self, depth: FloatArray) -> FloatArray:
        """Depth u (m), (n,), of the layer alone, at depths (m) in contact."""
        return self._sprung(depth).depth

    def _sprung(self, depth: FloatArray) -> Sprung:
        """Balance of layer and sides' spring at depths (m) in contact, (n,); the last result is cached."""
        key = depth.tobytes()
        if key not in self._last:
            self._last.clear()
            self._last[key] = self.sides.sprung(self.inner.force_and_stiffness, depth)
        return self._last[key]

    def _force(self, depth: FloatArray) -> FloatArray:
        return self._sprung(depth).force

    def _stiffness(self, depth: FloatArray) -> FloatArray:
        return self._sprung(depth).stiffness

    def _force_and_stiffness(self, depth: FloatArray) -> FloatArray:
        found = self._sprung(depth)
        return np.stack((found.force, found.stiffness))

    def _contact_radius(self, depth: FloatArray) -> FloatArray:
        return np.asarray(self.inner.contact_radius(self.own_depth(depth)))


def sides_of(layer: Layer, base: Body | None, beside: Mapping[str, bool]) -> Sides:
    """Sides of a layer, after checking that finite width is known for the test.

    `beside` maps the names of other effects (relaxation, history, adhesion, friction, discrepancy) to whether the
    test has them.

    Raises
    ------
    InputError
        If finite width is not known together with one of these.
    """
    for part, words in _BESIDE.items():
        if beside.get(part) or (part == "relaxation" and layer.relaxation is not None):
            raise InputError(
                f"finite width (layer.half_width) is known for {words}: leave out one of them, or say "
                'shape = "ignored"'
            )
    return Sides.of(layer, base)


def sides_at(values: Mapping[str, Any], layer: Layer, gain: PerSet = 1.0) -> Sides:
    """Sides from the values of a scene's parameters (SI), by path; values may be (sets, 1).

    `gain` is the factor on forces of a lever whose calibration is off.
    """
    wider = equivalent_radius(1.0, layer.shape)
    radius, E = wider * values["layer.half_width"], gain * values["layer.E"]
    sliding = layer.bond == "slip"
    return Sides.round(values["layer.thickness"], radius, E, values["layer.nu"], sliding=sliding)


def why_not_ignored(layer: Layer, base: Body | None, force: float, depth: float) -> str:
    """Warning that the sides, left out of the law, matter at this force (N) and depth (m); "" below 1 %."""
    try:
        sides = Sides.of(layer, base)
    except InputError as error:
        return f"the sample's sides are ignored, and what they do is not known: {error}"
    share = 1.5 * float(sides.compliance) * force / depth
    if share <= _MATTERS:
        return ""
    return (
        f"the sample's sides take about {100.0 * share:.2g} % off the force at {depth:.4g} m, and the model "
        'ignores them: say shape = "plug" or "block" in [layer]'
    )
