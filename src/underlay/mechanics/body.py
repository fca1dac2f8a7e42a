"""What a tip is pressed into: layers, their bonds, a base, and the constants on which indentation depends.

A `Layer` stands on a `Body`: a half-space (`Base`) of a `Material` or `RIGID`, or a `Stack` of further layers
on one. It is bonded to what is under it, free to slip, or held by springs (`Spring`); the bond may be unknown.

A transversely isotropic material (axis along the indentation) has five constants, but a frictionless
axisymmetric indentation depends on only four combinations of them (`PlaneConstants`), finite at nu = 0.5:

- q = A13/A33,  c = 1/A33,  g = A11 - A13^2/A33,  S = 1/A44  (stiffnesses A_ij, the paper's appendix);
- from engineering constants, with n = E/E': q = n nu'/(1-nu), c = (1 - 2 n nu'^2/(1-nu))/E',
  g = E/(1-nu^2), S = 1/G'.

From them p = sqrt(q^2 + c g), sigma = sqrt(S g - 2q + 2p), and theta = g/(p sigma), which is the paper's 1/(2 pi
H): half the indentation modulus. Isotropic: p = 1, sigma = 2, theta = E/(2(1-nu^2)). p and sigma are product and
sum of the two decay roots: displacements at wavenumber xi decay with depth z as exp(-root xi z).
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any, ClassVar, NamedTuple, Self, TypeAlias

import numpy as np

from underlay._arrays import FloatArray, finite, positive
from underlay.errors import InputError
from underlay.mechanics.contact_law import OnLaw
from underlay.mechanics.relaxation import Relaxation
from underlay.quantities import Part, inlined, no_number, one_of, quantity

#: Bonds that have a name: no gap and no slip; no gap and no friction; and one that nobody knows, which is computed
#: as bonded, and a fit says what slip would give.
BONDS = ("bonded", "slip", "unknown")
#: How water leaves a draining layer at the tip: not through it, or freely; an unknown one is computed as solid,
#: and a fit spans both.
TIP_DRAINAGES = ("solid", "porous", "unknown")
Real: TypeAlias = "float | FloatArray"
#: A sample of finite width is round, or square.
SHAPES = ("plug", "block", "ignored")
#: Most layers of a body, the one on top included: graded materials want another method.
MOST_LAYERS = 8


@dataclass(frozen=True)
class Spring(Part):
    """An imperfect interface: it opens and slides in proportion to the stress on it.

    Parameters
    ----------
    normal : float, default inf
        Stress per opening (Pa/m), positive; infinite where it does not open.
    shear : float, default inf
        Stress per sliding (Pa/m), zero or more; zero slides freely, infinite does not slide. A glue of
        thickness t and moduli M (confined) and G has normal = M/t and shear = G/t.
    """

    parts: ClassVar[tuple[str, ...]] = ("layer", "substrate")

    normal: float = field(
        default=np.inf,
        metadata=quantity(
            "stiffness per area", "normal stiffness of the {part}'s bond", bounds=(0.0, np.inf)
        ),
    )
    shear: float = field(
        default=np.inf,
        metadata=quantity("stiffness per area", "shear stiffness of the {part}'s bond", bounds=(0.0, np.inf)),
    )

    def __post_init__(self) -> None:
        for name, least in (("normal", "positive"), ("shear", "zero or more")):
            given = getattr(self, name)
            value = np.inf if given == np.inf else finite(given, f"the spring's {name} stiffness", "Pa/m")
            if not (value > 0.0 or (value == 0.0 and name == "shear")):
                why = ": nothing would hold the layer" if value == 0.0 else ""
                raise InputError(f"the spring's {name} stiffness must be {least} (Pa/m); got {value!r}{why}")
            object.__setattr__(self, name, value)


Bond: TypeAlias = str | Spring


def as_bond(given: object) -> Bond:
    """Check and return a bond: ``"bonded"``, ``"slip"``, ``"unknown"`` or a `Spring`.

    Raises
    ------
    InputError
        If it is none of these.
    """
    if isinstance(given, Spring) or (isinstance(given, str) and given in BONDS):
        return given
    raise InputError(
        f'unknown bond {given!r:.60}: a layer\'s lower face is "bonded", "slip", "unknown" or a Spring'
    )


def magnitude(value: Real) -> Real:
    """|value|, a float for a float (faster than a numpy scalar) and an array for an array."""
    return np.abs(value) if isinstance(value, np.ndarray) else abs(value)


class PlaneConstants(NamedTuple):
    """The four constants q, c, g, S of a material on which axisymmetric indentation depends (module's head).

    q is dimensionless; c and S are compliances (1/Pa); g is a stiffness (Pa). Each is a float or an array (batch,).
    """

    q: Real
    c: Real
    g: Real
    S: Real

    @property
    def p(self) -> Real:
        """Product of the two decay roots of the material (dimensionless).

        Displacements at wavenumber xi decay with depth z as exp(-root xi z).
        """
        return (self.q * self.q + self.c * self.g) ** 0.5

    @property
    def p_minus_q(self) -> Real:
        """p - q (dimensionless, zero or more), computed without cancellation; p is the property, q the entry."""
        size = magnitude(self.q)
        return self.c * self.g / (self.p + size) + (size - self.q)

    @property
    def sigma(self) -> Real:
        """Sum of the two decay roots of the material (dimensionless).

        Displacements at wavenumber xi decay with depth z as exp(-root xi z).
        """
        return (self.S * self.g + 2.0 * self.p_minus_q) ** 0.5

    @property
    def theta(self) -> Real:
        """The paper's elastic constant theta (Pa), half the indentation modulus; isotropic E/(2 (1 - nu^2))."""
        return self.g / (self.p * self.sigma)

    @property
    def coupling(self) -> float:
        """gamma, the coupling of shear load to normal displacement; (1 - 2 nu)/(2 (1 - nu)) when isotropic."""
        return float(self.p_minus_q / (self.sigma * self.p**0.5))


def isotropic_constants(E: Real, nu: Real) -> PlaneConstants:
    """Plane constants of isotropic materials; `E` (Pa) and `nu` may be arrays of one shape."""
    return PlaneConstants(
        q=nu / (1.0 - nu),
        c=(1.0 + nu) * (1.0 - 2.0 * nu) / (E * (1.0 - nu)),
        g=E / ((1.0 - nu) * (1.0 + nu)),
        S=2.0 * (1.0 + nu) / E,
    )


def transversely_isotropic_constants(
    E: Real, E_axial: Real, nu: Real, nu_axial: Real, G_axial: Real
) -> PlaneConstants:
    """Plane constants from the paper's engineering constants E, E', nu, nu', G' (moduli in Pa); arrays allowed."""
    n = E / E_axial
    return PlaneConstants(
        q=n * nu_axial / (1.0 - nu),
        c=(1.0 - 2.0 * n * nu_axial * nu_axial / (1.0 - nu)) / E_axial,
        g=E / ((1.0 - nu) * (1.0 + nu)),
        S=1.0 / G_axial,
    )


class Body(Part, ABC):
    """What a layer stands on: a half-space, or further layers on one."""

    parts: ClassVar[tuple[str, ...]] = ("layer", "substrate")

    #: Further layers, from the top down; none of a half-space.
    layers: Sequence[Layer] = ()

    @property
    @abstractmethod
    def base(self) -> Base:
        """The half-space at the bottom; a half-space returns itself."""

    @abstractmethod
    def on(self, base: Base) -> Body:
        """Copy of the body with `base` as the half-space at the bottom."""

    @property
    @abstractmethod
    def in_plane(self) -> Body:
        """The body with each anisotropic material replaced by the isotropic one with its in-plane E and nu."""

    @property
    def bonded(self) -> Body:
        """The body with all its interfaces bonded: without slip and springs."""
        return self


class Base(Body):
    """A half-space of one material, or a rigid one."""

    #: Whether its constants are those of an isotropic material; a rigid base has none and fits any.
    isotropic: ClassVar[bool] = False

    @property
    @abstractmethod
    def plane_constants(self) -> PlaneConstants | None:
        """The constants q, c, g, S on which indentation depends; None for a rigid base."""

    @staticmethod
    @abstractmethod
    def constants_of(**numbers: Any) -> PlaneConstants | None:
        """`plane_constants` from the values of its fields by name, each a float or an array (sets,)."""

    @property
    def base(self) -> Self:
        """The half-space itself."""
        return self

    def on(self, base: Base) -> Base:
        """Return `base` in place of this half-space."""
        return base

    @property
    @abstractmethod
    def in_plane(self) -> Base:
        """The isotropic material with the in-plane E and nu."""


class Material(Base):
    """An elastic material, of a layer or of a half-space.

    To add one: a frozen dataclass that derives from it, its constants declared in its fields, ``E`` and ``nu`` (in
    the plane of the surface) among them.
    """

    #: Whether it is filled with water that drains.
    drains: ClassVar[bool] = False

    E: float
    nu: float

    @property
    def drained(self) -> Material:
        """The elastic material at drained equilibrium; the material itself unless it is poroelastic."""
        return self

    @property
    @abstractmethod
    def plane_constants(self) -> PlaneConstants:
        """The constants q, c, g, S on which indentation depends."""

    @property
    @abstractmethod
    def in_plane(self) -> Material:
        """The isotropic material with its in-plane E and nu."""

    @property
    def theta(self) -> float:
        """Elastic constant theta (Pa), the paper's 1/(2 pi H): half the indentation modulus."""
        return float(self.plane_constants.theta)

    def relaxed_in_shear(self, kept: float) -> Material | None:
        """The material with `kept` times its shear modulus and the same bulk modulus; None where not known."""
        del kept
        return None


@dataclass(frozen=True)
class Rigid(Base):
    """A base that does not deform; the layer is bonded to it."""

    isotropic: ClassVar[bool] = True

    @staticmethod
    def constants_of(**numbers: Any) -> None:
        """None: a rigid base has no plane constants."""
        del numbers

    @property
    def plane_constants(self) -> None:
        """None: a rigid base has no plane constants."""
        return

    @property
    def in_plane(self) -> Self:
        """The rigid base itself."""
        return self

    @property
    def choice(self) -> dict[str, Any]:
        """Entry of a scene file that stands for a rigid base, ``{"rigid": True}``."""
        return {"rigid": True}

    def __repr__(self) -> str:
        return "RIGID"


#: A bonded rigid base.
RIGID = Rigid()


class Stiffening(Part, ABC):
    """How a layer stiffens as it is indented; its parameters have paths that begin with ``layer.stiffening.``.

    A concrete class names itself in `model`; scene files know it by that name.
    """

    parts: ClassVar[tuple[str, ...]] = ("layer",)
    chosen_by: ClassVar[str] = "model"
    #: Name in scene files, and section.
    model: ClassVar[str] = ""
    section: ClassVar[str] = "layer.stiffening"

    @property
    @abstractmethod
    def unstiffened(self) -> Self:
        """The model at large strains without strain stiffening, for comparison."""

    @abstractmethod
    def on(self, indenter: Any, layer: Layer, base: Body | None, effects: Mapping[str, bool]) -> OnLaw:
        """Modification of the linear law of an indenter on a layer on a base, for this model of stiffening.

        `effects` maps the names of the test's other effects (friction, adhesion, a history) to whether they are
        present.

        Raises
        ------
        InputError
            Outside the range in which the model was computed; the message names the number, the limit, and what to
            do.
        """


@dataclass(frozen=True)
class Layer(Part):
    """A layer of uniform thickness.

    Parameters
    ----------
    material : Isotropic or TransverselyIsotropic
        What it is made of.
    thickness : float, default inf
        Thickness h (m), positive; infinite means a half-space.
    bond : "bonded", "slip", "unknown" or Spring, default "bonded"
        How its lower face is held by what is under it: without gap and slip, without gap and friction, or by
        springs. An unknown one is computed as bonded, and a fit reports what slip would give.
    relaxation : Relaxation, optional
        How its modulus falls with time, e.g. `Prony`; without one it is elastic, and no times are needed.
    stiffening : Stiffening, optional
        How it stiffens as it is indented, e.g. `Gent`; its E is then that of small strains.
    half_width : float, optional
        Half-width (m) of a sample with free sides, centred under the tip; None or infinite: no sides.
    shape : "plug", "block" or "ignored", default "plug"
        Whether a sample with sides is round or square; with "ignored" the law leaves the sides out, and a fit warns
        where they would matter.

    Raises
    ------
    InputError
        If a part is of the wrong kind, or shear alone relaxes in a layer that is not incompressible.
    """

    parts: ClassVar[tuple[str, ...]] = ("layer", "substrate")

    material: Material = field(metadata=inlined())
    thickness: float = field(
        default=np.inf,
        metadata=quantity("length", "{part} thickness", symbol="h", bounds=(0.0, np.inf), scales="length"),
    )
    bond: Bond = field(default="bonded", metadata=no_number())
    relaxation: Relaxation | None = None
    stiffening: Stiffening | None = None
    half_width: float | None = field(
        default=None,
        metadata=quantity(
            "length", "half-width of the {part}", symbol="W", bounds=(0.0, np.inf), scales="length"
        ),
    )
    shape: str = field(default="plug", metadata=no_number() | one_of(*SHAPES))

    def __post_init__(self) -> None:
        if not isinstance(self.material, Material):
            raise InputError(
                "a layer is made of Isotropic, TransverselyIsotropic, Biphasic or BiphasicTransverse material; got "
                f"{self.material!r}"
            )
        if self.thickness != np.inf:
            object.__setattr__(self, "thickness", positive(self.thickness, "layer thickness", "m"))
        as_bond(self.bond)
        if self.relaxation is not None:
            _check_relaxation(self.relaxation, self.material)
        if not isinstance(self.stiffening, Stiffening | None):
            raise InputError(
                f"a layer's stiffening must be a Stiffening such as Gent; got {self.stiffening!r:.80}"
            )
        _check_sides(self)

    @property
    def has_sides(self) -> bool:
        """Whether the free sides of the sample enter its law."""
        return self.half_width is not None and self.shape != "ignored"

    @property
    def linear(self) -> Layer:
        """The layer without stiffening and sides, as in linear elasticity; itself where it has none."""
        plain = self.stiffening is None and not self.has_sides
        return self if plain else replace(self, stiffening=None, half_width=None, shape="plug")

    @property
    def held(self) -> Layer:
        """The layer as it is computed: an unknown bond is taken as bonded."""
        return replace(self, bond="bonded") if self.bond == "unknown" else self

    @property
    def in_plane(self) -> Layer:
        """The layer of the isotropic material with its in-plane E and nu."""
        return replace(self, material=self.material.in_plane)


def _check_sides(layer: Layer) -> None:
    """Refuse an unknown shape or a half-width that is not positive; set an infinite half-width to None."""
    if layer.shape not in SHAPES:
        raise InputError(f"a sample of finite width is one of {', '.join(SHAPES)}; got {layer.shape!r:.60}")
    if layer.half_width is not None:
        wide = (
            None if layer.half_width == np.inf else positive(layer.half_width, "the layer's half_width", "m")
        )
        object.__setattr__(layer, "half_width", wide)


def _check_relaxation(relaxation: Relaxation, material: Material) -> None:
    if not isinstance(relaxation, Relaxation):
        raise InputError(f"a layer's relaxation must be a Relaxation such as Prony; got {relaxation!r}")
    compressible = material.plane_constants.c > 0.0
    if relaxation.relaxes == "shear" and compressible:
        raise InputError(
            "shear alone cannot relax in a compressible layer here: Poisson's ratio would rise in time, and a "
            "constant one misses the force by 1 % (nu = 0.49, half of the shear modulus relaxing) to 30 % "
            '(nu = 0.3); take nu = 0.5, or relaxes = "shear_and_bulk"'
        )


@dataclass(frozen=True)
class Stack(Body):
    """Layers on a base, under the layer of a scene.

    Parameters
    ----------
    layers : sequence of Layer
        From the top down, each of finite thickness; one to seven.
    base : Isotropic, TransverselyIsotropic or RIGID, default RIGID
        The half-space under them.

    Raises
    ------
    InputError
        If a part is of the wrong kind, a layer has no finite thickness, or there are too many.

    Examples
    --------
    A gel stuck to a film of PDMS on glass:

    >>> from underlay.mechanics.materials import Isotropic
    >>> film = Layer(Isotropic(E=2e6, nu=0.49), thickness=50e-6)
    >>> Stack([film], base=Isotropic(E=70e9, nu=0.2)).layers[0].material.E
    2000000.0
    """

    parts: ClassVar[tuple[str, ...]] = ("substrate",)

    layers: Sequence[Layer] = field(metadata=no_number())
    base: Base = field(default=RIGID, metadata=inlined())

    def __post_init__(self) -> None:
        given = (self.layers,) if isinstance(self.layers, Layer) else tuple(self.layers)
        if not given:
            raise InputError("a Stack has one layer or more; without one pass its base as substrate")
        for number, layer in enumerate(given):
            if not isinstance(layer, Layer):
                raise InputError(
                    f"layers[{number}] of a Stack must be Layer(material, thickness); got {layer!r}"
                )
            if not np.isfinite(layer.thickness):
                raise InputError(
                    f"layers[{number}] of a Stack needs a finite thickness: what goes on for ever is its base"
                )
            if layer.linear is not layer:
                raise InputError(
                    f"layers[{number}] of a Stack has stiffening or a half_width: one layer on a rigid base may"
                )
        if len(given) >= MOST_LAYERS:
            raise InputError(
                f"a Stack has up to {MOST_LAYERS - 1} layers, {MOST_LAYERS} with the one on top; got {len(given)}. "
                "Join layers that are alike"
            )
        if not isinstance(self.base, Base):
            raise InputError(f"the base of a Stack must be a material or rigid; got {self.base!r}")
        object.__setattr__(self, "layers", given)

    def on(self, base: Base) -> Stack:
        """Copy with the same layers on another half-space."""
        return replace(self, base=base)

    @property
    def in_plane(self) -> Stack:
        """The stack with each material replaced by the isotropic one with its in-plane E and nu."""
        return Stack([layer.in_plane for layer in self.layers], self.base.in_plane)

    @property
    def bonded(self) -> Stack:
        """The stack with all its interfaces bonded: without slip and springs."""
        return replace(self, layers=tuple(replace(layer, bond="bonded") for layer in self.layers))


def stacked(layers: Sequence[Layer], base: Base) -> Body:
    """Body of layers, from the top down, on a base; the base alone where there are no layers."""
    return Stack(layers, base) if layers else base
