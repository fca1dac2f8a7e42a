"""The law of a sample of finite width: that of the layer without sides, in series with a spring (`compliance`)."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Any, NamedTuple, Self

import numpy as np

from underlay._arrays import ArrayLike, FloatArray, PerSet
from underlay.errors import InputError, LawError
from underlay.mechanics.body import Body, Layer, Rigid
from underlay.mechanics.contact_law import ContactLaw, OnLaw
from underlay.mechanics.finite_width.compliance import equivalent_radius, kappa, require_wide, standard_error
from underlay.mechanics.materials import Isotropic
from underlay.mechanics.stiffening import StiffeningLaw

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
        return NarrowLaw(
            method=wide.method,
            reason=f"{wide.reason}; sides as a spring of {self.compliance:.4g} m/N",
            max_depth=wide.max_depth,
            error_estimate=wide.error_estimate,
            warnings=wide.warnings,
            inner=wide,
            sides=self,
        )


@dataclass(frozen=True, kw_only=True)
class NarrowLaw(ContactLaw):
    """Law of a layer with free sides: P(w) = F(u), where the depth u of the layer alone solves u + C F(u) = w.

    Parameters
    ----------
    inner : ContactLaw
        F, of the layer without sides.
    sides : Sides
        C (m/N), the compliance of the sides.
    """

    inner: ContactLaw
    sides: Sides
    _last: dict[bytes, Sprung] = field(default_factory=dict, init=False, repr=False, compare=False)

    @property
    def domain(self) -> tuple[float, float]:
        """Smallest and largest depth (m): from that of the law without sides to `max_depth`."""
        return self.inner.domain[0], self.max_depth

    @property
    def nodes(self) -> int | None:
        """Number of radial nodes of the law without sides."""
        return self.inner.nodes

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

    @property
    def _beyond(self) -> str:
        return self.inner._beyond  # noqa: SLF001  the law behind this one

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
