"""What every kernel answers a solver, the scales it bends at, and quadrature of it over the wavenumber.

`Kernel` is all that a solver of the contact problem asks of the body under an indenter: 1 - L(u), the change of
the surface compliance with u, the wavenumber times the thickness on top. To add a body, derive from it and
implement `values`, `scales`, `rule`, `contrast` and `uniform`: every solver then takes it. `Scales` say where
in u it bends, and `u_rule` are nodes and weights for integrals int_0^inf [1 - L(u)] cos(s u) cos(t u) du.

Three scales shape that integrand. Near u = 0 a substrate of another stiffness bends L: with `ratio` its elastic
constant over the layer's, a soft one at u ~ ratio (the layer stretches) and ratio^(1/3) (it bends), a stiff one
at u ~ ratio^(-1/3). From there to the roots of the layer it varies slowly on a logarithmic scale, its poles
standing 60 degrees or more off the real axis: panels that triple in width serve, each with the same few
Gauss-Legendre nodes. Beyond, it decays as exp(-2 slow u), `slow` the slowest decay rate, while the cosines
oscillate: panels of equal width, with as many nodes as make them cheapest.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import dataclass
from math import ceil, e, factorial, hypot, inf, lgamma, log
from typing import Any, NamedTuple, Protocol, Self

import numpy as np

from underlay._arrays import ArrayLike, FloatArray, as_finite, read_only
from underlay.errors import InputError, RangeError
from underlay.mechanics.body import Base, Layer, PlaneConstants, Real

# The node counts were fitted to roots that decay without turning, and hold where they turn up to this share of the
# rate at which they decay: beyond, the poles of L stand too near to the real axis (measured on 6000 materials).
_MOST_TURN = 0.5
#: Smallest theta of a part over that of the layer: below, the layer bends in the rounding of 1 - L.
SOFTEST = 1e-20
_MOST_COEFFICIENTS = 12
_LARGEST_ORDER = 40
#: Most nodes of a rule: a hundred times those of any pair of real materials at a/h = 20.
MOST_NODES = 100_000
_ORDERS = np.arange(1.0, _LARGEST_ORDER + 1.0)
_GROWTH = 3.0
# n nodes leave rho^(-2 n), rho the Bernstein ellipse through the nearest pole: 3.85 in a tripling panel with
# a pole at 60 degrees, 3.7 in [0, 1] with the pole at 0.74i of nu = 0.5 on a rigid base.
_PER_NODE = log(3.7)


def lowest(value: Any) -> float:
    """Smallest entry of an array, or the float itself."""
    return float(value.min()) if isinstance(value, np.ndarray) else float(value)


@dataclass(frozen=True)
class Scales:
    """Characteristic rates and stiffness ratios of a body, from which node counts are chosen.

    theta is the elastic constant of a material (half its indentation modulus). For a batch of bodies each number is
    that of the most demanding one.

    Parameters
    ----------
    decay : float
        Slowest decay rate of the surface layer's displacements with depth, per wavenumber; 1 when isotropic.
    fastest : float
        Fastest decay rate.
    ratio : float
        theta of what is under the layer over theta of the layer, the smallest of a batch; inf when rigid.
    stretch : float
        Wavenumber times thickness below which a softer base lets the layer stretch with it.
    firmness : float
        How incompressible the layer is: 1 at nu = 0.5, 0 at nu = 0.3 and below.
    stiffest, softest : float
        theta of the stiffest and of the softest of what is under the layer over theta of the layer; inf when
        rigid. Zero for `softest` where an interface is on springs.
    charted : bool
        Whether the fitted node counts cover bodies of this kind; for others they are checked by doubling.
    """

    decay: float
    fastest: float
    ratio: float
    stretch: float
    firmness: float
    stiffest: float
    softest: float
    charted: bool = True

    @classmethod
    def of(cls, layer: PlaneConstants, substrate: PlaneConstants | None) -> Self:
        """Compute them from the constants of one layer on a base, floats or (batch, 1); `substrate` None is rigid.

        Raises
        ------
        RangeError
            If the substrate is more than 1e20 times softer than the layer.
        """
        half, p = 0.5 * layer.sigma, layer.p
        square = half * half - p
        spread = (square * (square > 0.0)) ** 0.5
        slow = p / (half + spread)
        decay = min(lowest(slow), lowest(half))
        fastest = -lowest(-(half + spread))
        charted = lowest(square + (_MOST_TURN * half) ** 2) >= 0.0
        # (p - q)/p is 0 for an incompressible material and 4/7 for nu = 0.3.
        firmness = max(0.0, 1.0 - 1.75 * lowest(layer.p_minus_q / p))
        if substrate is None:
            return cls(decay, fastest, inf, inf, firmness, inf, inf, charted)
        ratio = lowest(substrate.theta / layer.theta)
        if not ratio >= SOFTEST:
            raise RangeError(
                f"the substrate is {ratio:.3g} times as stiff as the layer, and the exact law ends at "
                f"{SOFTEST:g}: check the units of the moduli; a layer on nothing carries no load"
            )
        stretch = lowest(substrate.g / (layer.g * substrate.sigma))
        return cls(decay, fastest, ratio, stretch, firmness, ratio, ratio, charted)

    @property
    def softness(self) -> float:
        """Inverse of the a/h, contact radius over thickness, at which a softer substrate matters; 0 if stiffer."""
        return 0.0 if self.ratio >= 1.0 else self.ratio ** (-2.0 / 3.0) - 1.0


class Layers(NamedTuple):
    """Layers from the top down, the half-space under them, and messages saying which layers were merged."""

    layers: tuple[Layer, ...]
    base: Base
    said: tuple[str, ...] = ()


class Compliance(NamedTuple):
    """Change of the surface's compliance, radial, mixed and axial, each (nodes,) at wavenumbers.

    With theta and p the constants of the surface layer, C the 2 x 2 compliance of the body's surface (radial,
    axial) per wavenumber and gamma its coupling: `radial` is 1 - theta p C_11, `mixed` theta sqrt(p) C_12 + gamma,
    `axial` 1 - theta C_22, which is 1 - L.
    """

    radial: FloatArray
    mixed: FloatArray
    axial: FloatArray


class Kernel(ABC):
    """1 - L(u) of one body or a batch: the change of surface compliance by what lies under the layer on top.

    L(u) is the compliance of the surface under normal load over that of a half-space of the top layer's material; u
    is the wavenumber times the thickness of the layer on top.
    """

    @abstractmethod
    def values(self, u: FloatArray) -> FloatArray:
        """1 - L at `u` (nodes,), zero or more: (nodes,) or (batch, nodes). Unchecked, for inner loops.

        1 - L(u) is the relative change of surface compliance by what is under the top layer, u the
        wavenumber times its thickness.
        """

    @property
    @abstractmethod
    def scales(self) -> Scales:
        """Characteristic rates and stiffness ratios of the body, from which node counts are chosen.

        Raises
        ------
        RangeError
            If the body is too soft somewhere for 1 - L to be told from rounding.
        """

    @abstractmethod
    def rule(self, eps_max: float, rtol: float, *, power: int = 0) -> tuple[FloatArray, FloatArray]:
        """Quadrature for int_0^inf [1 - L(u)] u^power cos(s u) cos(t u) du with s, t up to `eps_max`.

        `eps_max` is the largest contact radius over thickness, `rtol` the error wanted. Returns nodes and weights,
        each (n,).

        1 - L(u) is the relative change of surface compliance by what is under the top layer, u the
        wavenumber times its thickness.
        """

    @property
    @abstractmethod
    def contrast(self) -> float:
        """delta, the largest relative difference in compliance between the body and a half-space of its surface.

        Its elastic energy is between those of half-spaces (1 +- delta) times as compliant.
        """

    @property
    @abstractmethod
    def uniform(self) -> bool:
        """Whether the whole body is of the surface's material, bonded: then the kernel is zero."""

    def compliance(self, u: FloatArray) -> Compliance:
        """Change of the surface's compliance under normal and shear load, as contacts with friction need it.

        Parameters
        ----------
        u : ndarray (nodes,)
            Wavenumbers times the thickness on top, zero or more.

        Raises
        ------
        InputError
            If this kernel knows the axial compliance alone.
        """
        del u
        raise InputError(
            f"{type(self).__name__} says nothing of shear: friction needs its compliance in shear and its coupling"
        )

    @property
    def coupling(self) -> float:
        """gamma of the surface, the coupling of shear load to normal displacement: (p - q)/(sigma sqrt p).

        p, q and sigma are constants of the surface layer (`PlaneConstants`); (1 - 2 nu)/(2 (1 - nu)) when
        isotropic.

        Raises
        ------
        InputError
            If this kernel knows the axial compliance alone.
        """
        raise InputError(
            f"{type(self).__name__} says nothing of shear: friction needs its compliance in shear and its coupling"
        )

    def simpler(self, eps: float, allowed: float) -> Layers | None:
        """Return an equivalent body with fewer layers, the same for these contacts within `allowed`.

        Parameters
        ----------
        eps : float
            Largest contact radius over the thickness on top.
        allowed : float
            Relative change of force, contact radius and stiffness allowed for all merged layers together.

        Returns
        -------
        Layers or None
            None where no layer can be merged with another.
        """
        del eps, allowed
        return None

    @property
    def description(self) -> str:
        """Materials, thicknesses and bonds of the body as text, for messages."""
        return repr(self)

    @property
    def decay(self) -> float:
        """Slowest rate at which displacements decay below the surface, per wavenumber; 1 when isotropic."""
        return self.scales.decay

    def one_minus_L(self, u: ArrayLike) -> FloatArray:
        """1 - L(u), shape of `u` (wavenumber times thickness, dimensionless, zero or more).

        1 - L(u) is the relative change of surface compliance by what is under the top layer, u the
        wavenumber times its thickness.

        Raises
        ------
        InputError
            If a `u` is negative or not finite.
        """
        nodes = as_finite(u, "u")
        if (nodes < 0.0).any():
            raise InputError(f"the kernel needs u of zero or more; got {nodes.min():.6g}")
        flat = np.atleast_1d(nodes).ravel()
        return self.values(flat).reshape(nodes.shape)[()]

    def coefficients(self, count: int) -> FloatArray:
        """The first `count` coefficients a_0, a_1, ... of (1.7) by (1.8), near machine precision: (count,).

        Equation numbers are those of Argatov and Sabina.

        Raises
        ------
        InputError
            If `count` is not in 1..12; each asymptotic order needs a_m only up to m = 1.
        """
        if not 1 <= count <= _MOST_COEFFICIENTS:
            raise InputError(f"count of coefficients must be in 1..{_MOST_COEFFICIENTS}; got {count!r}")
        return self.moments(count)

    def moments(self, count: int, rtol: float = 1e-15) -> FloatArray:
        """a_m = (-1)^m/((2m)!!)^2 int_0^inf [1 - L(u)] u^(2m) du (1.8), m < `count`, without checks.

        1 - L(u) is the relative change of surface compliance by what is under the top layer, u the
        wavenumber times its thickness. Equation numbers are those of Argatov and Sabina.

        Parameters
        ----------
        count : int
            Number of coefficients.
        rtol : float
            Wanted error of the integrals.

        Returns
        -------
        array (count,) or (batch, count)
        """
        u, weights = self.rule(0.0, rtol, power=2 * count - 2)
        powers = weights[:, None] * u[:, None] ** (2.0 * np.arange(count))
        scale = [(-1.0) ** m / (2.0**m * factorial(m)) ** 2 for m in range(count)]
        return self.values(u) @ powers * scale


class Family(Protocol):
    """Bodies that differ in one positive number, such as a ratio of moduli.

    Hashable, because equal families share their cached tables.
    """

    def kernel(self, ratio: float) -> Kernel:
        """Kernel of the body for which that number is `ratio`.

        Raises
        ------
        InputError
            If there is no such body.
        """

    def __hash__(self) -> int: ...


_GAUSS = tuple(
    tuple(read_only(array) for array in np.polynomial.legendre.leggauss(n))
    for n in range(1, _LARGEST_ORDER + 1)
)


def u_rule(
    layer: PlaneConstants,
    substrate: PlaneConstants | None,
    eps_max: float,
    rtol: float,
    *,
    power: int = 0,
    smallest: float = np.inf,
) -> tuple[FloatArray, FloatArray]:
    """Quadrature for int_0^inf [1 - L(u)] u^power cos(s u) cos(t u) du with s, t up to `eps_max`.

    1 - L(u) is the relative change of surface compliance by what is under the top layer, u the
    wavenumber times its thickness. Equation numbers are those of Argatov and Sabina.

    Parameters
    ----------
    layer, substrate : PlaneConstants
        Entries floats, or arrays (batch, 1): then one rule serves all members. `substrate` None is rigid.
    eps_max : float
        Largest frequency: the largest contact radius over thickness.
    rtol : float
        Wanted error of the integral, relative to int |1 - L(u)| u^power du: kept for 99 % of
        random pairs of anisotropic materials, within a factor 2 for the rest.
    power : int, default 0
        Power of u in the integrand, for the moments of (1.8).
    smallest : float, optional
        A smaller scale of u than those of layer and substrate, where the body has one.

    Returns
    -------
    nodes, weights : array (n,)
        Nodes in increasing order.

    Raises
    ------
    RangeError
        If there would be more than `MOST_NODES`; checked before any is computed.
    """
    digits = 1.0 - log(rtol)
    slow, fast, turn = _rates(layer)
    rate = 2.0 * hypot(slow, eps_max + turn)
    reach = _reach(digits, power) / (2.0 * slow)
    # Complex roots bring the poles nearer to the real axis: found by trial over random materials.
    per_node = _PER_NODE / (1.0 + 0.3 * turn / slow)
    least = min(ceil(digits / (2.0 * per_node)) + 1 + power // 2, _LARGEST_ORDER - 6)
    first = 1.0 / fast
    if substrate is not None:
        first = min(first, _first_panel(layer, substrate, digits, least, fast))
    first = min(first, smallest)
    # Largest half-phase phi that n nodes hold: int_-1^1 exp(i phi x) dx to (e phi/(4 n))^(2 n).
    widths = (8.0 / (e * rate)) * _ORDERS * np.exp(-0.5 * digits / _ORDERS)
    plan = _plan(first, reach, widths, least, least)
    for order in (least + 2, least + 4, least + 6):
        if not plan.tail_panels:
            break
        plan = min(plan, _plan(first, reach, widths, least, order), key=_nodes)
    if not _nodes(plan) <= MOST_NODES:
        raise RangeError(
            f"the kernel of this layer takes {_nodes(plan):.3g} nodes, and the most is {MOST_NODES}: its "
            f"displacements decay as exp(-{slow:.2g} z) while they oscillate as cos({turn:.2g} z), for a/h up "
            f"to {eps_max:.3g}; check the moduli of the layer (E, E_axial, G_axial) and their units"
        )
    graded = _panels(np.array(plan.edges), plan.order)
    if not plan.tail_panels:
        return graded
    tail = _panels(np.linspace(plan.edges[-1], reach, plan.tail_panels + 1), plan.tail_order)
    return np.concatenate((graded[0], tail[0])), np.concatenate((graded[1], tail[1]))


class _Plan(NamedTuple):
    """Layout of a quadrature in u: panels that triple in width, then panels of equal width.

    `edges` and `order` (nodes per panel) are those of the tripling panels, the others number and order of the equal
    ones.
    """

    edges: list[float]
    order: int
    tail_panels: int
    tail_order: int


def _nodes(plan: _Plan) -> int:
    return (len(plan.edges) - 1) * plan.order + plan.tail_panels * plan.tail_order


def _plan(first: float, reach: float, widths: FloatArray, least: int, order: int) -> _Plan:
    """Triple the panels from width `first` while `order` nodes hold them, then add equal panels up to `reach`.

    `widths` (orders,) is the widest panel by number of nodes, `least` the fewest nodes per panel. The equal panels
    are those with the fewest nodes in all.
    """
    widest = float(widths[order - 1])
    edge = min(first, widest, reach)
    edges = [0.0, edge]
    while edge < reach and (_GROWTH - 1.0) * edge <= widest:
        edge = min(_GROWTH * edge, reach)
        edges.append(edge)
    if edge >= reach:
        return _Plan(edges, order, 0, 0)
    # A panel wider than its distance from zero also needs nodes for the poles near zero.
    allowed = np.minimum(widths[least - 1 :], ((_GROWTH - 1.0) * edge / least) * _ORDERS[least - 1 :])
    panels = np.ceil((reach - edge) / allowed)
    cheapest = int(np.argmin(panels * _ORDERS[least - 1 :]))
    return _Plan(edges, order, int(panels[cheapest]), least + cheapest)


def _rates(layer: PlaneConstants) -> tuple[float, float, float]:
    """Slowest decay rate, largest modulus and fastest oscillation of the layer's decay roots, over the batch."""
    p, half = layer.p, 0.5 * layer.sigma
    d2 = half * half - p
    d = np.maximum(d2, 0.0) ** 0.5
    slow = _extremes(np.minimum(half, p / (half + d)))[0]
    # sqrt(p) is the modulus of complex roots; of real ones it is between the two.
    fast = _extremes(np.maximum(half + d, p**0.5))[1]
    return slow, fast, _extremes(np.maximum(-d2, 0.0) ** 0.5)[1]


def _extremes(value: Real) -> tuple[float, float]:
    if isinstance(value, np.ndarray):
        return float(value.min()), float(value.max())
    return float(value), float(value)


def _first_panel(
    layer: PlaneConstants, substrate: PlaneConstants, digits: float, order: int, fast: float
) -> float:
    """Width of the first quadrature panel over a substrate that is not rigid.

    A pole at -x is resolved on [0, x/delta] by n nodes to exp(-4 n sqrt(delta)). With r the ratio of the
    thetas: the pole of a stretching layer, at -1/(sigma1 + sigma2 g1/g2), carries r^(2/3) of the integral on
    a soft base; the bend on a stiff base, at r^(-1/3), carries r^(-4/3). What is below the tolerance needs
    no panel. `digits` is about -ln of the error, `order` the nodes per panel, `fast` the largest decay root.
    """
    softest, stiffest = _extremes(substrate.theta / layer.theta)
    width = min(1.0, 2.0 * softest ** (1.0 / 3.0)) / fast
    wanted = digits + 1.0 + 2.0 / 3.0 * log(min(stiffest, 1.0))
    if wanted > 0.0:
        stretch = _extremes(1.0 / (layer.sigma + layer.g / substrate.g * substrate.sigma))[0]
        width = min(width, stretch * (4.0 * order / wanted) ** 2)
    if stiffest > 1.0:
        wanted = digits - 4.0 / 3.0 * log(max(softest, 1.0))
        if wanted > 0.0:
            width = min(width, stiffest ** (-1.0 / 3.0) * (4.0 * order / wanted) ** 2 / fast)
    return float(width)


def _reach(digits: float, power: int) -> float:
    """x beyond which the integral of x^(power + 2) exp(-x) is exp(-digits) of that from zero."""
    x = digits + power + 2.0
    for _ in range(6):
        x = digits + (power + 2.0) * log(x) - lgamma(power + 3.0)
    return x


def _panels(edges: FloatArray, order: int) -> tuple[FloatArray, FloatArray]:
    x, w = _GAUSS[order - 1]
    half = 0.5 * np.diff(edges)[:, None]
    middle = edges[:-1, None] + half
    return (middle + half * x).ravel(), (half * w).ravel()
