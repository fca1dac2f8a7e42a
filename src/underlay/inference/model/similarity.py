"""Similar contacts: one law serves every modulus, every thickness and every tip radius of the same ratios.

For a power-law shape Phi = A r^lambda, r the distance from the axis, on a layer of thickness h the force P at the
depth w is

    P(w) = theta A h^(lambda+1) F(w / (A h^lambda); ratios),

theta being half the indentation modulus of the layer and F a function of the shape exponent, the Poisson's
ratios and the ratios of the moduli alone: equations (5.2) and (5.3) of Argatov and Sabina divided by theta A
h^(lambda+1) and A h^lambda. For any other shape, of size R, all lengths scale together, P(w) = theta h^2 F(w /
h; ratios, R / h). A work of adhesion dgamma counts as dgamma / (theta A^2 h^(2 lambda - 1)), or as dgamma /
(theta h).

So a law built once at reference values serves others through two factors, P(w) = c P_ref(b w), and its
logarithmic derivatives in a number p follow without a new law:

    dP/d ln p = P d(ln c)/d(ln p) + w P'(w) d(ln b)/d(ln p) + sum_k dP/dk dk/d(ln p),

where the k (ratios) need differences of laws, and only where a free parameter moves them.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, fields, replace
from typing import Any

import numpy as np

from underlay.mechanics.indenters import Indenter, PowerLawShape
from underlay.mechanics.solver import Scaling
from underlay.quantities import kind_of
from underlay.scene.instrument import SENSITIVITY_RATIO, SPRING_CONSTANT_RATIO
from underlay.scene.scene import Scene

# Numbers of a lever that scale the force reading.
_GAINS = (SPRING_CONSTANT_RATIO, SENSITIVITY_RATIO)
_ANGLE_STEP = 1e-6  # relative; central difference of cot(half_angle): error 1e-12, rounding 1e-10


@dataclass(frozen=True)
class Similarity:
    """Scaling of a scene's contact law from the law of a reference scene: P(w) = c P_ref(b w).

    P is the force at the depth w. Numbers of the scene act through the factors b and c, or through ratios for which
    a law of the reference is built.

    Parameters
    ----------
    scene : Scene
        The reference.
    moduli : tuple of str
        Paths of its moduli; the first, ``layer.E``, carries the force scale, the others act as ratios to it. Empty
        where nothing scales.
    direct : tuple of str
        Paths of numbers taken as they are: Poisson's ratios, and lengths and shapes that no scaling removes.
    lengths : tuple of str
        Lengths of the indenter that count relative to the layer's thickness (shapes without a power law).
    length : str or None
        The length that sets the scale: the thickness, or the radius on a half-space.
    shape : tuple of str
        Paths of the indenter that act through the coefficient A of its power law only.
    exponent : float or None
        The shape exponent, where a power law is used.
    values : mapping
        Every number of the reference (SI).
    energies : tuple of str
        Works of adhesion: they count relative to force times length over area.
    """

    scene: Scene
    moduli: tuple[str, ...]
    direct: tuple[str, ...]
    lengths: tuple[str, ...]
    length: str | None
    shape: tuple[str, ...]
    exponent: float | None
    values: Mapping[str, float]
    energies: tuple[str, ...] = ()

    def reduced(self, values: Mapping[str, float]) -> tuple[float, ...]:
        """Ratios that a law of the reference is built with, in the order of `ratio_paths`.

        Moduli over ``layer.E``, works of adhesion and lengths over their scales, and the numbers of `direct`.
        `values` are all numbers of the scene (SI) by path.
        """
        E, s = self._modulus_ratio(values), self.length_ratio(values)
        return (
            *(values[path] / E for path in self.moduli[1:]),
            *(values[path] / self._energy_ratio(values) for path in self.energies),
            *(values[path] / s for path in self.lengths),
            *(values[path] for path in self.direct),
        )

    @property
    def ratio_paths(self) -> tuple[str, ...]:
        """Paths of the numbers that act through ratios, for each value of which a law must be built."""
        return (*self.moduli[1:], *self.energies, *self.lengths, *self.direct)

    @property
    def force_scales(self) -> tuple[str, ...]:
        """Paths of moduli and works of adhesion, of which one factor on all multiplies the force.

        Empty where nothing scales.
        """
        return (*self.moduli, *self.energies) if self.moduli else ()

    def factors(self, values: Mapping[str, float]) -> tuple[float, float]:
        """Factors (b, c) by which the law follows from that of the reference scene, P(w) = c P_ref(b w).

        P is the force at the depth w; `values` are all numbers of the scene (SI) by path. c contains the gain of a
        cantilever whose calibration is off.
        """
        E, s = self._modulus_ratio(values) * self.gain(values), self.length_ratio(values)
        if self.exponent is None:
            return 1.0 / s, E * s * s
        A = self._coefficient_ratio(values)
        return s**-self.exponent / A, E * A * s ** (self.exponent + 1.0)

    def factor_slopes(self, path: str, values: Mapping[str, float]) -> tuple[float, float]:
        """Derivatives d(ln b)/d(ln p) and d(ln c)/d(ln p) of the factors in P(w) = c P_ref(b w).

        p is the parameter at `path`, P the force at the depth w.
        """
        if path in _GAINS:
            return 0.0, -1.0
        if path in self.moduli[:1]:
            return 0.0, 1.0
        if path == self.length:
            return (-1.0, 2.0) if self.exponent is None else (-self.exponent, self.exponent + 1.0)
        if path in self.shape:
            A = self._coefficient_slope(path, values)
            return -A, A
        return 0.0, 0.0

    def ratio_slopes(self, path: str, values: Mapping[str, float]) -> dict[str, float]:
        """Derivatives of the ratios k that the parameter p at `path` changes, by path of the ratio.

        d(ln k)/d(ln p), or dk/dp of a number in `direct`; ratios that do not change are left out.
        """
        if path in self.moduli[:1]:
            return dict.fromkeys((*self.moduli[1:], *self.energies), -1.0)
        if path in self.ratio_paths:
            return {path: 1.0}
        if path == self.length:
            power = 1.0 if self.exponent is None else 2.0 * self.exponent - 1.0
            return dict.fromkeys(self.lengths, -1.0) | dict.fromkeys(self.energies, -power)
        if path in self.shape and self.energies:
            return dict.fromkeys(self.energies, -2.0 * self._coefficient_slope(path, values))
        return {}

    def _coefficient_slope(self, path: str, values: Mapping[str, Any]) -> Any:  # a number, or one per set
        """d(ln A)/d(ln p) of the tip's coefficient A, in A r^lambda, for the parameter p at `path`."""
        up, down = ({**values, path: values[path] * (1.0 + step)} for step in (_ANGLE_STEP, -_ANGLE_STEP))
        change = self._coefficient_ratio(up) / self._coefficient_ratio(down)
        return np.log(change) / (2.0 * _ANGLE_STEP)

    def _energy_ratio(self, values: Mapping[str, float]) -> float:
        """Factor on works of adhesion, relative to the reference scene, that gives a similar contact."""
        E, s = self._modulus_ratio(values), self.length_ratio(values)
        if self.exponent is None:
            return E * s
        ratio: float = E * self._coefficient_ratio(values) ** 2 * s ** (2.0 * self.exponent - 1.0)
        return ratio

    def gain(self, values: Mapping[str, Any]) -> Any:  # a number, or one per set
        """Force reading over true force: one unless the calibration of a cantilever is off.

        A number, or one per parameter set.
        """
        return 1.0 / (values[_GAINS[0]] * values[_GAINS[1]]) if self.scene.lever is not None else 1.0

    def _modulus_ratio(self, values: Mapping[str, float]) -> float:
        return values["layer.E"] / self.values["layer.E"] if self.moduli else 1.0

    def length_ratio(self, values: Mapping[str, float]) -> float:
        """Factor on all lengths of the contact, relative to the reference scene."""
        return values[self.length] / self.values[self.length] if self.length else 1.0

    def _coefficient_ratio(self, values: Mapping[str, Any]) -> Any:  # a number, or one per set
        sets = [value.size for path in self.shape if isinstance(value := values[path], np.ndarray)]
        if sets:
            shapes = np.array([np.broadcast_to(values[path], sets[0]) for path in self.shape]).T
            rows = (dict(zip(self.shape, shape, strict=True)) for shape in shapes.tolist())
            return np.array([self._coefficient_ratio(row) for row in rows])
        if all(values[path] == self.values[path] for path in self.shape):
            return 1.0
        changed = {path.partition(".")[2]: values[path] for path in self.shape}
        indenter: Any = self.scene.indenter  # a frozen dataclass, which its abstract base does not say
        return _coefficient(replace(indenter, **changed)) / _coefficient(indenter)


def compile_similarity(
    scene: Scene, free: Iterable[str], *, scaling: Scaling = Scaling.POWER_LAW
) -> Similarity:
    """Determine which numbers of a scene act on its law by scaling, and which through ratios.

    Parameters
    ----------
    scene : Scene
        The reference.
    free : iterable of str
        Paths of the parameters that vary.
    scaling : Scaling
        How far the solver's laws may be scaled: the less, the more parameters need laws of their own.
    """
    values, known = scene.parameters, scene.quantities
    layered = scene.substrate is not None and np.isfinite(scene.layer.thickness)
    materials = [
        path for path in values if path.startswith("layer.") or (layered and path.startswith("substrate."))
    ]
    moduli = tuple(path for path in materials if known[path].scales == "force" and path != "layer.E")
    ratios = tuple(path for path in materials if known[path].scales is None)
    deeper = tuple(path for path in materials if known[path].scales == "length" and path != "layer.thickness")
    thickness = ("layer.thickness", *deeper) if layered else ()
    if any(known[path].scales is None and known[path].kind != "dimensionless" for path in materials):
        # A spring's stiffness is neither a ratio nor a modulus nor a length: nothing is scaled out.
        scaling = Scaling.NONE
    shape = tuple(path for path in values if path.startswith("indenter."))
    adhesion = tuple(path for path in values if path.startswith("adhesion."))
    energies = tuple(path for path in adhesion if known[path].kind == "surface energy")
    ranges = tuple(path for path in adhesion if path not in energies)
    direct: tuple[str, ...] = ratios
    lengths: tuple[str, ...] = ()
    through_coefficient: tuple[str, ...] = ()
    length: str | None = None
    exponent: float | None = None
    if scaling is Scaling.NONE:
        return Similarity(scene, (), (*materials, *shape, *adhesion), (), None, (), None, values)
    if (
        scaling is Scaling.POWER_LAW
        and not ranges
        and isinstance(scene.indenter, PowerLawShape)
        and "indenter.exponent" not in set(free)
    ):
        through_coefficient = tuple(path for path in shape if path != "indenter.exponent")
        exponent = scene.indenter.exponent
        length = "layer.thickness" if layered else None
        lengths = deeper
    elif _is_made_of_lengths(scene.indenter):
        length, lengths = ("layer.thickness", (*shape, *deeper)) if layered else (shape[0], shape[1:])
        lengths = (*lengths, *ranges)
    else:
        direct = (*ratios, *shape, *thickness, *ranges)
    return Similarity(
        scene, ("layer.E", *moduli), direct, lengths, length, through_coefficient, exponent, values, energies
    )


def _is_made_of_lengths(indenter: Indenter) -> bool:
    numbers = {field.name: getattr(indenter, field.name) for field in fields(indenter)}  # type: ignore[arg-type]  # every indenter is a dataclass
    return bool(numbers) and all(
        isinstance(value, float) and kind_of(f"indenter.{name}") == "length"
        for name, value in numbers.items()
    )


def _coefficient(indenter: Indenter) -> float:
    if not isinstance(indenter, PowerLawShape):
        raise TypeError(f"{indenter!r} has no power-law coefficient")
    return indenter.coefficient
