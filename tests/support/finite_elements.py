"""Finite elements of a rigid tip on one layer: shares nothing with the contact laws but the shapes of the tips.

Axisymmetric 8-node quadrilaterals with four points each (reduced: nearly incompressible layers do not lock), on a
mesh fine under the contact; contact by a stiff penalty at the points of the surface, loading in steps. Small
strains of Hooke's law, or a Gent layer, -(mu Jm/2) ln(1 - (J^(-2/3) I1 - 3)/Jm) + K/2 (J - 1)^2, neo-Hookean where
Jm is infinite, or one of Ogden's, 2 mu/alpha^2 sum (J^(-1/3) lambda)^alpha in place of the logarithm, bonded to its
base or sliding on it. A tip slides freely, or holds every point of the surface
where it was when it was touched, interpolated inside the step.

Nearly incompressible layers (nu = 0.4995) are solved by a mixed Newton's method: the tangent takes the pressure of
a point for an unknown of its own, p = K (J - 1) only when settled, so that a step may leave the dilatation it had.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np
import skfem
from numpy.typing import NDArray
from scipy import sparse
from scipy.sparse.linalg import splu

Array = NDArray[np.float64]

# Penalty in units of E over the element under the tip: points enter the tip by 1e-4 of that at a pressure of E.
_PENALTY = 1e4
_MOST_NEWTON = 50
# Points at the edge of contact may come and go for ever: from so many turns on, every other one goes half its way.
_PATIENCE = 14
# Parts of a step that are tried where the whole finds no equilibrium.
_PARTS = (1, 3, 7, 17)
# Holding what a step touches moves the edge a little, which may touch a point more.
_MOST_HOLDS = 3
_CONVERGED = 1e-8
_MOST_TRIALS, _FLATTER = 10, 0.5
_POINTS = 5  # per side, on the surface
# Components of F - I in order: rr, rz, zr, zz, and the hoop.
_ROWS, _COLUMNS = (0, 0, 1, 1, 2), (0, 1, 0, 1, 2)


class NoEquilibriumError(RuntimeError):
    """Newton's method did not find one."""


@dataclass(frozen=True)
class Tip:
    """A sphere or a paraboloid of radius R."""

    radius: float
    sphere: bool

    def shape(self, r: Array) -> tuple[Array, Array]:
        """Height and slope at `r`."""
        R = self.radius
        if not self.sphere:
            return r**2 / (2.0 * R), r / R
        inside = np.minimum(np.abs(r), 0.98 * R)
        root = np.sqrt(R**2 - inside**2)
        return R - root, inside / root


@dataclass(frozen=True)
class Layer:
    """A layer of Young's modulus one, as wide as `width`, held or `sliding` below; Gent's Jm, or Ogden's alpha."""

    nu: float
    thickness: float = 1.0
    width: float = 8.0
    finite: bool = False
    sliding: bool = False
    limit: float = np.inf
    exponent: float | None = None


class Stressed(NamedTuple):
    """First Piola-Kirchhoff stress, its derivative in F at a given pressure, K (J - 1), and K J F^-T."""

    stress: Array
    tangent: Array
    pressure: Array
    dilating: Array


class Loaded(NamedTuple):
    """Force and contact radius at every depth."""

    depth: Array
    force: Array
    radius: Array


@dataclass
class Press:
    """One tip on one layer.

    `fine` elements lie side by side under the largest contact radius expected, `contact`.
    """

    tip: Tip
    layer: Layer
    contact: float
    fine: int = 24
    stuck: bool = False
    _u: Array = field(init=False)
    _linear: sparse.csr_matrix | None = field(init=False, default=None)
    _depth: float = field(init=False, default=0.0)
    _stressed: Stressed = field(init=False)

    def __post_init__(self) -> None:
        size = self.contact / self.fine
        r = _graded(size, 1.25 * self.contact, self.layer.width)
        z = -_graded(size, 0.3 * min(self.contact, self.layer.thickness), self.layer.thickness)[::-1]
        mesh = skfem.MeshQuad.init_tensor(r, z)
        element = skfem.ElementVector(skfem.ElementQuadS2())
        self._basis = skfem.Basis(mesh, element, intorder=3)
        top = mesh.facets_satisfying(lambda x: (np.abs(x[1]) < 1e-12) & (x[0] < 1.2 * self.contact))
        self._surface = skfem.FacetBasis(mesh, element, facets=top, intorder=2 * _POINTS - 1)
        below = self._basis.get_dofs(lambda x: np.abs(x[1] + self.layer.thickness) < 1e-12)
        fixed = below.all(["u^2"]) if self.layer.sliding else below.all()
        axis = self._basis.get_dofs(lambda x: np.abs(x[0]) < 1e-12).all(["u^1"])
        self._free = np.setdiff1d(np.arange(self._basis.N), np.concatenate((fixed, axis)))
        self._penalty = _PENALTY / size
        self._u = np.zeros(self._basis.N)
        self._gradients, self._volumes = _strains(self._basis)
        self._pressure = np.zeros(self._volumes.shape)
        self._values = np.array(
            [np.asarray(part[0]) for part in self._surface.basis]
        )  # (dofs, 2, facets, points)
        where = np.asarray(self._surface.global_coordinates())[0]
        self._radius = where
        self._areas = 2.0 * np.pi * where * self._surface.dx
        self._home = np.full(where.shape, np.nan)

    def load(self, depths: Array) -> Loaded:
        """Press to every depth in turn, as far as there is an equilibrium on this mesh."""
        found = []
        for depth in depths:
            try:
                found.append(self._in_parts(float(depth)))
            except NoEquilibriumError:
                break
        if not found:
            raise NoEquilibriumError(f"no equilibrium at the first depth, {depths[0]:.4g}")
        return Loaded(depths[: len(found)], *np.array(found).T)

    def _in_parts(self, depth: float) -> tuple[float, float]:
        """Press on to a depth, in parts where it takes them."""
        state = self._u, self._pressure, self._home, self._depth
        for parts in _PARTS:
            self._u, self._pressure, self._home, self._depth = state
            try:
                return [self._to(float(part)) for part in np.linspace(state[-1], depth, parts + 1)[1:]][-1]
            except NoEquilibriumError:
                continue
        raise NoEquilibriumError(f"no equilibrium at depth {depth:.4g}")

    def _to(self, depth: float) -> tuple[float, float]:
        before = self._surface_displacement()[0], self._gap(self._depth)[0]
        self._settle(depth)
        for _ in range(_MOST_HOLDS if self.stuck else 0):
            if not self._hold(depth, *before):
                break
            self._settle(depth)
        self._depth = depth
        gap = self._gap(depth)[0]
        touched = gap > 0.0
        pressure = self._penalty * np.where(touched, gap, 0.0)
        return float((pressure * self._areas).sum()), float(self._radius[touched].max(initial=0.0))

    def _hold(self, depth: float, radial: Array, gap: Array) -> bool:
        """Hold the points touched first in this step where they were when they touched; whether there are any."""
        now = self._gap(depth)[0]
        new = (now > 0.0) & np.isnan(self._home)
        # Between the ends of the step gap and displacement are taken for linear in depth.
        share = np.where(new & (gap < 0.0), gap / np.where(new, gap - now, 1.0), 0.0)
        place = radial + share * (self._surface_displacement()[0] - radial)
        self._home = np.where(new, place, self._home)
        return bool(new.any())

    def _settle(self, depth: float) -> None:
        """Find the equilibrium at a depth from where the layer is."""
        for turn in range(_MOST_NEWTON):
            stiffness, residual = self._system(depth)
            step = np.zeros_like(self._u)
            system = stiffness[self._free][:, self._free].tocsc()
            step[self._free] = splu(system).solve(-residual[self._free])
            if self.layer.finite:
                self._go(depth, step, 0.5 if turn > _PATIENCE and turn % 2 else 1.0)
            else:
                self._u = self._u + self._share(depth, step, float(step @ residual)) * step
            if np.abs(step).max() <= _CONVERGED * depth:
                break
        else:
            raise NoEquilibriumError(f"no equilibrium at depth {depth:.4g}")

    def _system(self, depth: float) -> tuple[sparse.csr_matrix, Array]:
        """Stiffness and unbalanced force of layer and contact."""
        stiffness, residual = self._body()
        own, unbalanced = self._touch(depth)
        return stiffness + own, residual + unbalanced

    def _share(self, depth: float, step: Array, start: float) -> float:
        """How much of a step to go: to where the energy along it is least, roughly."""
        here, low, high = self._u, 0.0, 1.0
        for _ in range(_MOST_TRIALS):
            self._u = here + high * step
            slope = float(step @ self._system(depth)[1])
            self._u = here
            if not np.isfinite(slope):
                high *= 0.5  # an element turned inside out
                continue
            if slope < _FLATTER * abs(start):
                return high
            # The slope is negative at `low`: between, by a weighted mean.
            high = low + (high - low) * max(abs(start) / (abs(start) + slope), 0.1)
        return high

    def _go(self, depth: float, step: Array, share: float) -> None:
        """Go a share of a step, of displacements and of what it makes of pressures; less where an element turns."""
        strained = np.einsum("dceq,de->ceq", self._gradients, step[self._basis.element_dofs])
        further = self._stressed.pressure + (self._stressed.dilating * strained).sum(axis=0) - self._pressure
        u, pressure = self._u, self._pressure
        for halving in range(_MOST_TRIALS):
            part = share * 0.5**halving
            self._u, self._pressure = u + part * step, pressure + part * further
            if np.isfinite(self._system(depth)[1]).all():
                return
        raise NoEquilibriumError(f"an element turns inside out at depth {depth:.4g}")

    def _surface_displacement(self) -> Array:
        """Radial and axial, (2, facets, points)."""
        local = self._u[self._surface.element_dofs]
        return np.einsum("dcfp,df->cfp", self._values, local)

    def _gap(self, depth: float) -> tuple[Array, Array]:
        """Overlap, positive inside the tip, and the tip's slope there."""
        radial, axial = self._surface_displacement()
        place = self._radius + radial if self.layer.finite else self._radius
        height, slope = self.tip.shape(place)
        return axial + depth - height, slope if self.layer.finite else np.zeros_like(slope)

    def _touch(self, depth: float) -> tuple[sparse.csr_matrix, Array]:
        """Stiffness and force of the penalty."""
        gap, slope = self._gap(depth)
        inside = gap > 0.0
        weight = np.where(inside, self._penalty * self._areas, 0.0)
        normal = self._values[:, 1] - slope * self._values[:, 0]
        force = np.einsum("dfp,fp->df", normal, weight * gap)
        stiff = np.einsum("dfp,fp,efp->def", normal, weight, normal)
        # The tip's own curvature is left out of the stiffness, which it would make indefinite; the force is exact.
        if self.stuck:
            holds = np.where(np.isnan(self._home), 0.0, self._penalty * self._areas)
            away = np.where(np.isnan(self._home), 0.0, self._surface_displacement()[0] - self._home)
            force += np.einsum("dfp,fp->df", self._values[:, 0], holds * away)
            stiff += np.einsum("dfp,fp,efp->def", self._values[:, 0], holds, self._values[:, 0])
        return _assembled(self._surface.element_dofs, stiff, force, self._basis.N)

    def _body(self) -> tuple[sparse.csr_matrix, Array]:
        """Stiffness and force of the layer."""
        if not self.layer.finite and self._linear is not None:
            return self._linear, self._linear @ self._u
        local = self._u[self._basis.element_dofs]
        strain = np.einsum("dceq,de->ceq", self._gradients, local)
        if self.layer.finite:
            own = self.layer
            if own.exponent is None:
                self._stressed = _gent(strain, own.nu, own.limit, self._pressure)
            else:
                self._stressed = _ogden(strain, own.nu, own.exponent, self._pressure)
            stress, tangent = self._stressed[:2]
        else:
            stress, tangent = _hooke(strain, self.layer.nu)
        force = np.einsum("dceq,ceq->de", self._gradients, stress * self._volumes)
        pushed = np.einsum("cgeq,hgeq->hceq", tangent * self._volumes, self._gradients)
        stiff = np.einsum("dceq,hceq->dhe", self._gradients, pushed, optimize=True)
        found = _assembled(self._basis.element_dofs, stiff, force, self._basis.N)
        self._linear = found[0]
        return found


def _graded(size: float, even: float, end: float) -> Array:
    """Edges from 0: of one size up to `even`, then wider and wider to `end`."""
    edges = list(np.linspace(0.0, even, max(2, round(even / size)) + 1))
    step = size
    while edges[-1] < end:
        step *= 1.3
        edges.append(edges[-1] + step)
    edges[-1] = end
    if len(edges) > 2 and edges[-1] - edges[-2] < 0.3 * step:
        edges.pop(-2)
    return np.array(edges)


def _strains(basis: skfem.Basis) -> tuple[Array, Array]:
    """Displacement gradients of every local function, (dofs, 5, elements, points), and volumes."""
    r = np.asarray(basis.global_coordinates())[0]
    parts = []
    for function in basis.basis:
        value, slope = np.asarray(function[0]), np.asarray(function[0].grad)
        parts.append(np.stack((slope[0, 0], slope[0, 1], slope[1, 0], slope[1, 1], value[0] / r)))
    return np.array(parts), 2.0 * np.pi * r * basis.dx


def _assembled(dofs: Array, stiff: Array, force: Array, size: int) -> tuple[sparse.csr_matrix, Array]:
    rows = np.broadcast_to(dofs[:, None], stiff.shape).ravel()
    columns = np.broadcast_to(dofs[None], stiff.shape).ravel()
    matrix = sparse.csr_matrix((stiff.ravel(), (rows, columns)), shape=(size, size))
    return matrix, np.bincount(dofs.ravel(), force.ravel(), minlength=size)


def _moduli(nu: float) -> tuple[float, float]:
    """Shear and bulk modulus at E = 1."""
    return 0.5 / (1.0 + nu), 1.0 / (3.0 * (1.0 - 2.0 * nu))


def _hooke(strain: Array, nu: float) -> tuple[Array, Array]:
    mu, bulk = _moduli(nu)
    tangent = np.zeros((5, 5))
    for i, (a, b) in enumerate(zip(_ROWS, _COLUMNS, strict=True)):
        for j, (c, d) in enumerate(zip(_ROWS, _COLUMNS, strict=True)):
            shear = mu * ((a == c and b == d) + (a == d and b == c))
            tangent[i, j] = shear + (bulk - 2.0 / 3.0 * mu) * (a == b) * (c == d)
    tangent = np.broadcast_to(tangent[:, :, None, None], (5, 5, *strain.shape[1:]))
    return np.einsum("cgeq,geq->ceq", tangent, strain), tangent


def _gent(strain: Array, nu: float, limit: float, pressure: Array) -> Stressed:
    """Of a Gent solid; NaN where it is turned inside out or locked."""
    mu, bulk = _moduli(nu)
    F = np.zeros((3, 3, *strain.shape[1:]))
    for i, (a, b) in enumerate(zip(_ROWS, _COLUMNS, strict=True)):
        F[a, b] = strain[i] + (a == b)
    plane = F[0, 0] * F[1, 1] - F[0, 1] * F[1, 0]
    J = plane * F[2, 2]
    I1 = (F * F).sum(axis=(0, 1))
    left = 1.0 - (np.abs(J) ** (-2.0 / 3.0) * I1 - 3.0) / limit
    if not ((J > 0.0) & (left > 0.0)).all():
        nowhere = np.full_like(strain, np.nan)
        return Stressed(nowhere, np.full((5, 5, *J.shape), np.nan), nowhere[0], nowhere)
    inverse = np.zeros_like(F)
    inverse[0, 0], inverse[1, 1], inverse[2, 2] = F[1, 1] / plane, F[0, 0] / plane, 1.0 / F[2, 2]
    inverse[0, 1], inverse[1, 0] = -F[0, 1] / plane, -F[1, 0] / plane
    scale = mu * J ** (-2.0 / 3.0) / left
    deviator = np.array([F[a, b] - I1 / 3.0 * inverse[b, a] for a, b in zip(_ROWS, _COLUMNS, strict=True)])
    back = np.array([inverse[b, a] for a, b in zip(_ROWS, _COLUMNS, strict=True)])
    stress = scale * deviator + bulk * (J - 1.0) * J * back
    tangent = np.zeros((5, 5, *J.shape))
    for j, (c, d) in enumerate(zip(_ROWS, _COLUMNS, strict=True)):
        for i, (a, b) in enumerate(zip(_ROWS, _COLUMNS, strict=True)):
            turned = inverse[d, a] * inverse[b, c]
            tangent[i, j] = (
                scale * ((i == j) - 2.0 / 3.0 * inverse[d, c] * deviator[i])
                - scale * (2.0 / 3.0 * F[c, d] * back[i] - I1 / 3.0 * turned)
                + 2.0 / (mu * limit) * scale**2 * deviator[i] * deviator[j]
                + bulk * J**2 * inverse[d, c] * back[i]
                + pressure * J * (inverse[d, c] * back[i] - turned)
            )
    return Stressed(stress, tangent, bulk * (J - 1.0), bulk * J * back)


def _ogden(strain: Array, nu: float, exponent: float, pressure: Array) -> Stressed:
    """Of an Ogden solid of one term; NaN where it is turned inside out; its tangent by differences."""
    mu, _ = _moduli(nu)
    volume = _gent(strain, nu, np.inf, pressure)
    shear = _ogden_shear(strain, mu, exponent)
    tangent = np.zeros_like(volume.tangent)
    step = 1e-6
    for j in range(len(strain)):
        away = np.zeros_like(strain)
        away[j] = step
        sides = [
            _ogden_shear(strain + sign * away, mu, exponent) - _ogden_shear(strain + sign * away, mu, 2.0)
            for sign in (1.0, -1.0)
        ]
        tangent[:, j] = (sides[0] - sides[1]) / (2.0 * step)
    # Neo-Hookean (alpha = 2), and what another exponent makes other.
    stress = volume.stress + shear - _ogden_shear(strain, mu, 2.0)
    return Stressed(stress, volume.tangent + tangent, volume.pressure, volume.dilating)


def _ogden_shear(strain: Array, mu: float, exponent: float) -> Array:
    """First Piola-Kirchhoff stress (5, ...) without that of the volume: tau F^-T, tau of principal stretches."""
    F = np.moveaxis(np.zeros((2, 2, *strain.shape[1:])), (0, 1), (-2, -1)) + np.eye(2)
    for i, (a, b) in enumerate(zip(_ROWS[:4], _COLUMNS[:4], strict=True)):
        F[..., a, b] += strain[i]
    hoop = 1.0 + strain[4]
    left = F @ np.swapaxes(F, -1, -2)
    square, axes = np.linalg.eigh(left)
    volume = np.linalg.det(F) * hoop
    scale = np.where(volume > 0.0, np.abs(volume), np.nan) ** (-1.0 / 3.0)
    parts = np.stack((*np.moveaxis(np.sqrt(square), -1, 0), hoop)) * scale
    powers = parts**exponent
    tau = 2.0 * mu / exponent * (powers - powers.mean(axis=0))
    plane = np.einsum("...ai,i...,...bi->...ab", axes, tau[:2], axes)
    found = plane @ np.swapaxes(np.linalg.inv(F), -1, -2)
    return np.stack(
        (*(found[..., a, b] for a, b in zip(_ROWS[:4], _COLUMNS[:4], strict=True)), tau[2] / hoop)
    )
