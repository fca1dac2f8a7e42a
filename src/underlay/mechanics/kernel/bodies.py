"""Kernels of one layer bonded to a base, and of several layers, bonded, slipping or on springs.

`LayerKernel` and `SubstrateKernel` take the formula of `recursion`, in closed form where both are isotropic.
`StackKernel` compiles the formula of `recursion` for its layers. Layers too much like a neighbour, or too thin or
deep, to affect a contact are merged with the neighbour first (`joined`). Elastic energy is monotone in the surface
compliance, and that is diagonal in the wavenumber: if the compliance of two bodies differs by a share of at most
delta at every wavenumber, so does the force at a given depth, whatever the contact. Where the contact is small,
what counts is the mean over the wavenumbers it sees: to first order the flat punch's factor kappa changes by (2
eps/pi) int |L' - L| du, with L and L' those of the two bodies and eps the contact radius over the thickness on top
(`relative_effect`).
"""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from math import inf, pi, sqrt

import numpy as np

from underlay._arrays import FloatArray
from underlay.errors import InputError, RangeError
from underlay.mechanics.body import Base, Bond, Layer, Material, PlaneConstants, Real, Spring, magnitude
from underlay.mechanics.kernel.kernel import SOFTEST, Compliance, Kernel, Layers, Scales, lowest, u_rule
from underlay.mechanics.kernel.recursion import Recursion, Sheet, scaled

# On softer bases, in shear, the closed form loses digits: at the switch it errs by 1e-14 of L, the recursion by
# 3e-15. Where 1 - L decays it keeps 1e-14 of it, at any ratio down to there.
_SOFTEST_BASE = 1e-3
# How far p and sigma of an isotropic material are from 1 and 2 by rounding.
_ROUNDING = 8.0 * float(np.finfo(float).eps)


class _OneLayer(Kernel):
    """Kernel of one layer bonded to a base, from the plane constants that a subclass gives."""

    @property
    @abstractmethod
    def constants(self) -> tuple[PlaneConstants, PlaneConstants | None]:
        """Constants q, c, g, S (`PlaneConstants`) of layer and base; None for a rigid base."""

    def values(self, u: FloatArray) -> FloatArray:
        """1 - L at `u` (nodes,); (nodes,) or (batch, nodes).

        1 - L(u) is the relative change of surface compliance by what is under the top layer, u the
        wavenumber times its thickness.
        """
        return self._formula(u)

    @cached_property
    def _formula(self) -> Callable[[FloatArray], FloatArray]:
        return isotropic_formula(*self.constants) or self._recursion.one_minus_L

    def compliance(self, u: FloatArray) -> Compliance:
        """Change of the surface's compliance under normal and shear load at `u` (nodes,)."""
        return self._recursion.compliance(u)

    @cached_property
    def _recursion(self) -> Recursion:
        """The general formula (`recursion`) for one layer, in units of its constant g."""
        layer, base = self.constants
        sheet = Sheet(scaled(layer, layer.g), thickness=1.0, opening=0.0, sliding=0.0)
        return Recursion((sheet,), None if base is None else scaled(base, layer.g))

    @property
    def coupling(self) -> float:
        """Coupling gamma of the layer, defined at `Kernel.coupling`."""
        return self.constants[0].coupling

    @cached_property
    def scales(self) -> Scales:
        """Characteristic rates and stiffness ratios, from the constants of layer and base."""
        return Scales.of(*self.constants)

    def rule(self, eps_max: float, rtol: float, *, power: int = 0) -> tuple[FloatArray, FloatArray]:
        """Quadrature nodes and weights by `u_rule`; parameters as in `Kernel.rule`."""
        return u_rule(*self.constants, eps_max, rtol, power=power)

    @property
    def contrast(self) -> float:
        """Largest relative difference in compliance of the two materials (`material_contrast`); not for batches."""
        return material_contrast(*self.constants)


@dataclass(frozen=True, eq=False)
class LayerKernel(_OneLayer):
    """The kernel of one layer on one base by their plane constants, or of a batch of such layers.

    Parameters
    ----------
    layer, base : PlaneConstants
        Entries floats, or arrays (batch, 1); the base is bonded, and rigid if None.
    """

    layer: PlaneConstants
    base: PlaneConstants | None

    @property
    def constants(self) -> tuple[PlaneConstants, PlaneConstants | None]:
        """Constants q, c, g, S (`PlaneConstants`) of layer and base, as given."""
        return self.layer, self.base

    @property
    def uniform(self) -> bool:
        """Whether layer and base are the same constants: then the kernel is zero."""
        return self.base is self.layer


@dataclass(frozen=True)
class SubstrateKernel(_OneLayer):
    """The kernel of one layer material on one substrate.

    Parameters
    ----------
    layer : Isotropic or TransverselyIsotropic
        Material of the layer.
    substrate : Isotropic, TransverselyIsotropic or RIGID
        Material of the half-space bonded under it.

    Raises
    ------
    InputError
        If one of them is not such a material.

    Examples
    --------
    >>> from underlay.mechanics.body import RIGID
    >>> from underlay.mechanics.materials import Isotropic
    >>> kernel = SubstrateKernel(Isotropic(E=1.0, nu=0.5), RIGID)
    >>> [round(float(a), 10) for a in kernel.coefficients(2)]
    [1.7702167734, -0.9577692889]
    """

    layer: Material
    substrate: Base

    def __post_init__(self) -> None:
        if not isinstance(self.layer, Material):
            raise InputError(f"the layer material is Isotropic or TransverselyIsotropic; got {self.layer!r}")
        if not isinstance(self.substrate, Base):
            raise InputError(
                f"the substrate is Isotropic, TransverselyIsotropic or rigid; got {self.substrate!r}"
            )

    @property
    def description(self) -> str:
        """Layer and substrate as text, for messages."""
        return f"{self.layer!r} on {self.substrate!r}"

    @cached_property
    def constants(self) -> tuple[PlaneConstants, PlaneConstants | None]:
        """Constants q, c, g, S (`PlaneConstants`) of layer and substrate; None for a rigid substrate."""
        return self.layer.plane_constants, self.substrate.plane_constants

    @property
    def uniform(self) -> bool:
        """Whether layer and substrate are the same material: then the kernel is zero."""
        return self.substrate == self.layer


def isotropic_formula(
    layer: PlaneConstants, base: PlaneConstants | None
) -> Callable[[FloatArray], FloatArray] | None:
    """Closed form of 1 - L(u) for an isotropic layer on an isotropic or rigid base; None where there is none.

    None for anisotropic materials, and for bases more than a thousand times softer than the layer in shear, where
    the form loses digits. With kappa_i = 3 - 4 nu_i, m the layer's shear modulus over the base's, x = exp(-2u), a =
    (1 - m)/(kappa_1 + m) and b = (kappa_1 - m kappa_2)/(1 + m kappa_2) (Burmister 1945, J. Appl. Phys. 16, 89):

        1 - L = x [a (1 + b) + b (1 + a) - 2 a b (1 - x) + 4 a u (1 + u)]
                / {[1 - x + (1 + a) x] [1 - x + (1 + b) x] + 4 a u^2 x},

    u (nodes,) the wavenumber times the thickness.

    1 - L(u) is the relative change of surface compliance by what is under the top layer, u the
    wavenumber times its thickness.
    """
    if not (is_isotropic(layer) and (base is None or is_isotropic(base))):
        return None
    kappa = (3.0 - layer.q) / (1.0 + layer.q)
    ratio, kappa_base = (0.0, 1.0) if base is None else (base.S / layer.S, (3.0 - base.q) / (1.0 + base.q))
    if not -lowest(-ratio) <= 1.0 / _SOFTEST_BASE:
        return None
    a, b = (1.0 - ratio) / (kappa + ratio), (kappa - ratio * kappa_base) / (1.0 + ratio * kappa_base)
    more_a, more_b = (1.0 + kappa) / (kappa + ratio), (1.0 + kappa) / (1.0 + ratio * kappa_base)

    def one_minus_L(u: FloatArray) -> FloatArray:
        x, rest = np.exp(-2.0 * u), -np.expm1(-2.0 * u)
        change = 4.0 * a * u
        above = (a * more_b + b * more_a) - (2.0 * a * b) * rest + change * (1.0 + u)
        return np.asarray(x * above / ((rest + more_a * x) * (rest + more_b * x) + change * u * x))

    return one_minus_L


def is_isotropic(of: PlaneConstants) -> bool:
    """Whether constants, all of a batch, are those of isotropic materials up to rounding."""
    nearest = min(lowest(-magnitude(of.p - 1.0)), lowest(-magnitude(of.sigma - 2.0)))
    return nearest >= -_ROUNDING


def material_contrast(inner: PlaneConstants, outer: PlaneConstants | None) -> float:
    """delta, the largest relative difference in compliance: (1 - delta) C_1 <= C_2 <= (1 + delta) C_1.

    C_1 and C_2 are the 2 x 2 surface compliances of half-spaces of the two materials. Energy is monotone in the
    stiffness of a part, so the layered body is between two half-spaces of moduli E_1/(1 +- delta), and the force at
    a given depth within a relative delta/(1 - delta) of the half-space's, at any contact size. 1 for a rigid
    substrate (`outer` None).
    """
    if outer is None:
        return 1.0
    (a, b, d), (A, B, D) = _compliance(inner), _compliance(outer)
    # Eigenvalues of C_1^-1 (C_2 - C_1) from trace and determinant of the 2 x 2 product.
    x, y, z = A - a, B - b, D - d
    determinant = a * d - b * b
    half_trace = 0.5 * (d * x - 2.0 * b * y + a * z) / determinant
    product = (x * z - y * y) / determinant
    return abs(half_trace) + sqrt(max(half_trace * half_trace - product, 0.0))


def _compliance(constants: PlaneConstants) -> tuple[float, float, float]:
    """C_11, C_12 and C_22 (radial, mixed, axial) of the surface of a half-space (1/Pa)."""
    p, sigma, g = float(constants.p), float(constants.sigma), float(constants.g)
    return sigma / g, -float(constants.p_minus_q) / g, p * sigma / g


# Radius and stiffness move by up to twice as much as the force; the rest is margin, as for `Auto`.
_MARGIN = 4.0
# First order holds below this.
_LARGEST_SHALLOW = 0.02
# Only a layer this thin and alike, for its depth, or this deep for the contact, is worth a look.
_THIN, _DEEP = 1e-2, 5.0


def joined(body: Layers, eps: float) -> Iterator[Layers]:
    """Iterate over bodies with one layer less that might be equivalent for a/h up to `eps`.

    h is the thickness of the layer on top. Each candidate gives a layer the material of a neighbour; whether it is
    in fact equivalent is for the caller to check (`relative_effect`).
    """
    layers, base = body[:2]
    depth = 0.0
    for number, layer in enumerate(layers):
        lower = layers[number + 1] if number + 1 < len(layers) else None
        beneath = base if lower is None else lower.material
        name = f"layer {number + 1}" if number else "the layer on top"
        below = "the base" if lower is None else f"layer {number + 2}"
        deep = depth + layer.thickness
        if layer.bond == "bonded":
            if lower is not None and _worth(layer, lower.material, lower.thickness, deep, eps, layers[0]):
                one = replace(layer, thickness=deep - depth + lower.thickness, bond=lower.bond)
                left = (*layers[:number], one, *layers[number + 2 :])
                yield Layers(left, base, (*body.said, f"{below} as {name}"))
            if number and _worth(layer, beneath, layer.thickness, depth, eps, layers[0]):
                said = (*body.said, f"{name} as {below}")
                if lower is None:
                    yield Layers((*layers[:number], *layers[number + 1 :]), base, said)
                else:
                    one = replace(lower, thickness=layer.thickness + lower.thickness)
                    yield Layers((*layers[:number], one, *layers[number + 2 :]), base, said)
            if number and lower is None and deep >= _DEEP * eps * layers[0].thickness:
                yield Layers(layers[:number], layer.material, (*body.said, f"{below} as {name}"))
        depth = deep


def _worth(layer: Layer, other: Base, thickness: float, depth: float, eps: float, top: Layer) -> bool:
    if other == layer.material or depth >= _DEEP * eps * top.thickness:
        return True
    contrast = material_contrast(layer.material.plane_constants, other.plane_constants)
    return contrast * thickness <= _THIN * depth


def relative_effect(whole: Kernel, simpler: Kernel, stretch: float, eps: float) -> float:
    """Bound on the relative change of force, radius and stiffness when `simpler` replaces `whole`.

    For contact radii up to `eps` thicknesses of the layer on top. `stretch` is the thickness on top of the simpler
    body over that of the whole.
    """
    u, weights = whole.rule(eps, 1e-3)
    L: FloatArray = 1.0 - whole.values(u)
    change = abs(1.0 - simpler.values(u * stretch) - L)
    # What the rest of the kernel does to the contact enters twice.
    around = 1.0 + (2.0 * eps / pi) * float(abs(1.0 - L) @ weights)
    shallow = _MARGIN * around**2 * (2.0 * eps / pi) * float(change @ weights)
    anywhere = _MARGIN * float((change / L).max())
    return min(anywhere, shallow) if shallow <= _LARGEST_SHALLOW else anywhere


@dataclass(frozen=True)
class StackKernel(Kernel):
    """The kernel of layers on a base; u is the wavenumber times the thickness of the layer on top.

    Parameters
    ----------
    layers : tuple of Layer
        From the top down, each of finite thickness and with the bond of its lower face.
    base : Isotropic, TransverselyIsotropic or RIGID
        The half-space under them.

    Examples
    --------
    Free to slip on a rigid base, whatever its Poisson's ratio:

    >>> from underlay.mechanics.body import RIGID
    >>> from underlay.mechanics.materials import Isotropic
    >>> kernel = StackKernel((Layer(Isotropic(E=1.0, nu=0.3), 1.0, bond="slip"),), RIGID)
    >>> round(float(kernel.coefficients(1)[0]), 10)
    1.1675768374
    """

    layers: tuple[Layer, ...]
    base: Base

    def values(self, u: FloatArray) -> FloatArray:
        """1 - L at `u` (nodes,).

        1 - L(u) is the relative change of surface compliance by what is under the top layer, u the
        wavenumber times its thickness.
        """
        return self._recursion.one_minus_L(u)

    def compliance(self, u: FloatArray) -> Compliance:
        """Change of the surface's compliance under normal and shear load at `u` (nodes,)."""
        return self._recursion.compliance(u)

    @property
    def coupling(self) -> float:
        """Coupling gamma of the layer on top, defined at `Kernel.coupling`."""
        return self.layers[0].material.plane_constants.coupling

    @cached_property
    def _recursion(self) -> Recursion:
        return Recursion(*self._sheets)

    @cached_property
    def _sheets(self) -> tuple[tuple[Sheet, ...], PlaneConstants | None]:
        """The layers and the base, made dimensionless by the top layer's thickness and constant g."""
        return sheets_of(
            [layer.material.plane_constants for layer in self.layers],
            self.base.plane_constants,
            [layer.thickness for layer in self.layers],
            [layer.bond for layer in self.layers],
        )

    @cached_property
    def scales(self) -> Scales:
        """Characteristic rates and stiffness ratios of the stack, from which first node counts are chosen.

        In place of the one ratio of a single layer stands the smallest of the wavenumbers at which the layers
        together, H thick and s times as stiff as the one on top at the stiffest, bend or slide on something
        softer: 1/H of the whole, (r/s)^(1/3)/H on a half-space of ratio r, (k/(s H^3))^(1/4) on springs or a
        soft layer of stiffness k, (k/(s H))^(1/2) in shear. They need be right in order of magnitude: node
        counts are checked by doubling.
        """
        sheets, base = self._sheets
        top = Scales.of(sheets[0].constants, None)
        parts = [sheet.constants for sheet in sheets[1:]] + ([] if base is None else [base])
        ratios = [float(part.theta / sheets[0].constants.theta) for part in parts]
        softest = min(ratios, default=1.0)
        if not softest >= SOFTEST:
            raise RangeError(
                f"a part under the surface is {softest:.3g} times as stiff as the layer on top, and the exact law "
                f"ends at {SOFTEST:g}: check the units of the moduli; a layer on nothing carries no load"
            )
        thicknesses = [layer.thickness / self.layers[0].thickness for layer in self.layers]
        height = sum(thicknesses)
        # A base bends no more than the layers let it: only they are plates.
        stiff = max([1.0, *ratios[: len(sheets) - 1]])
        turns = [1.0 / height, (min(softest, 1.0) / stiff) ** (1.0 / 3.0) / height]
        stretch = min(1.0, softest) / (stiff * height)
        gives = [(1.0 / r, thick) for r, thick in zip(ratios, thicknesses[1:], strict=False) if r < 1.0]
        for sheet in sheets:
            if sheet.opening:
                turns.append((1.0 / (sheet.opening * stiff * height**3)) ** 0.25)
            if 0.0 < sheet.sliding < inf:
                turns.append((1.0 / (sheet.sliding * stiff * height)) ** 0.5)
        turns += [(1.0 / (soft * thick * stiff * height)) ** 0.5 for soft, thick in gives]
        ratio = min(1.0, *turns) ** 3
        stiffest = inf if base is None else max(ratios)
        fastest = max(
            Scales.of(sheet.constants, None).fastest * thick
            for sheet, thick in zip(sheets, thicknesses, strict=True)
        )
        soft = 0.0 if any(isinstance(layer.bond, Spring) for layer in self.layers) else softest
        return Scales(
            top.decay,
            max(top.fastest, fastest),
            ratio,
            stretch,
            top.firmness,
            stiffest,
            soft,
            charted=False,
        )

    def rule(self, eps_max: float, rtol: float, *, power: int = 0) -> tuple[FloatArray, FloatArray]:
        """Quadrature by `u_rule`, graded from the kernel's smallest wavenumber; parameters as in `Kernel.rule`."""
        layer = self._sheets[0][0].constants
        return u_rule(layer, None, eps_max, rtol, power=power, smallest=self.scales.ratio ** (1.0 / 3.0))

    @cached_property
    def contrast(self) -> float:
        """Largest relative difference in compliance of any part from the layer on top; infinite with springs."""
        top = self.layers[0].material.plane_constants
        parts = [layer.material.plane_constants for layer in self.layers[1:]] + [self.base.plane_constants]
        if any(isinstance(layer.bond, Spring) for layer in self.layers):
            return inf
        slips = any(layer.bond == "slip" for layer in self.layers)
        return max(material_contrast(top, part) for part in parts) + (1.0 if slips else 0.0)

    @property
    def uniform(self) -> bool:
        """Whether all parts are one material, bonded: then the kernel is zero."""
        first = self.layers[0].material
        alike = all(layer.material == first and layer.bond == "bonded" for layer in self.layers)
        return alike and self.base == first

    def simpler(self, eps: float, allowed: float) -> Layers | None:
        """Merge layers with neighbours one by one while contacts change by at most `allowed`; None if none can be.

        `eps` is the largest contact radius over the thickness on top, `allowed` the relative change of force,
        contact radius and stiffness.
        """
        found = Layers(self.layers, self.base)
        changed = len(found.layers) > 1
        while changed:
            changed = False
            for trial in joined(found, eps * self.layers[0].thickness / found.layers[0].thickness):
                stretch = trial.layers[0].thickness / self.layers[0].thickness
                if relative_effect(self, StackKernel(*trial[:2]), stretch, eps) <= allowed:
                    found, changed = trial, len(trial.layers) > 1
                    break
        return found if found.said else None

    @property
    def description(self) -> str:
        """Every layer and the base as text, for messages."""
        layers = (f"{layer.material!r} ({layer.thickness:.4g} m, {layer.bond})" for layer in self.layers)
        return " on ".join((*layers, repr(self.base)))


def values_of(kernels: Sequence[Kernel], u: FloatArray, stretches: Sequence[float]) -> FloatArray:
    """1 - L of several bodies, (bodies, nodes), each at u (nodes,) times its own factor in `stretches`.

    Stacks with the same number of layers and bonds are computed in one call, which is faster.

    1 - L(u) is the relative change of surface compliance by what is under the top layer, u the
    wavenumber times its thickness.
    """
    stacks = [kernel for kernel in kernels if isinstance(kernel, StackKernel)]
    kinds = {
        (tuple(layer.bond for layer in body.layers), body.base.plane_constants is None) for body in stacks
    }
    sprung = any(isinstance(bond, Spring) for bonds, _ in kinds for bond in bonds)
    if len(stacks) < len(kernels) or len(kinds) > 1 or sprung:
        return np.array([kernel.values(u * own) for kernel, own in zip(kernels, stretches, strict=True)])
    ((bonds, rigid),) = kinds
    constants = [
        _constants([body.layers[number].material for body in stacks]) for number in range(len(bonds))
    ]
    base = None if rigid else _constants([body.base for body in stacks])
    thicknesses = np.array([[layer.thickness for layer in body.layers] for body in stacks])
    sheets, under = sheets_of(constants, base, list(thicknesses.T[..., None]), bonds)
    taller = np.array(stretches)[:, None]
    sheets = tuple(replace(sheet, thickness=sheet.thickness * taller) for sheet in sheets)
    return Recursion(sheets, under).one_minus_L(u)


def _constants(materials: Sequence[Base]) -> PlaneConstants:
    """Plane constants, entries (materials, 1), of materials none of which is rigid."""
    found = np.array([material.plane_constants for material in materials], dtype=np.float64)
    return PlaneConstants(*found.T[..., None])


def sheets_of(
    constants: Sequence[PlaneConstants],
    base: PlaneConstants | None,
    thicknesses: Sequence[Real],
    bonds: Sequence[Bond],
) -> tuple[tuple[Sheet, ...], PlaneConstants | None]:
    """Layers, from the top down, and base, dimensionless by the top layer's thickness and constant g.

    `constants` and `thicknesses` (m) are floats, or (sets, 1); `bonds` are those of the lower faces.
    """
    g, t = constants[0].g, thicknesses[0]
    sheets = []
    for own, thickness, bond in zip(constants, thicknesses, bonds, strict=True):
        opening, sliding = (give if give in {0.0, inf} else float(g / t) * give for give in _give(bond))
        sheets.append(Sheet(scaled(own, g), thickness / t, opening, sliding))
    return tuple(sheets), None if base is None else scaled(base, g)


def _give(bond: Bond) -> tuple[float, float]:
    """Compliances of a bond: opening and sliding per stress (m/Pa), zero bonded and infinite free."""
    if isinstance(bond, Spring):
        return 1.0 / bond.normal, 1.0 / bond.shear if bond.shear else inf
    return 0.0, inf if bond == "slip" else 0.0
