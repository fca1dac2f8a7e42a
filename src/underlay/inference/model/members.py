"""One curve of a problem, compiled: which entries of a vector it reads, its law and its noise."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from underlay._arrays import FloatArray
from underlay.data.curve import Curve
from underlay.inference.model.batch_readings import Readings
from underlay.inference.model.forward import Forward, Reading
from underlay.inference.model.forward_batch import batched_readings
from underlay.inference.model.laws import LawStore
from underlay.inference.model.noise_start import scatter
from underlay.inference.model.parameter_sets import Values
from underlay.inference.model.tip_over_power_law import TipOverPowerLaw
from underlay.mechanics.contact_law import ContactLaw
from underlay.mechanics.indenters import Sphere
from underlay.scene.noise_model import NoiseModel
from underlay.scene.scene import Scene

__all__ = ["Member"]


@dataclass(frozen=True, eq=False)
class Member:
    """One scene and one curve of a problem.

    Parameters
    ----------
    scene, curve
        As given.
    forward : Forward
        The compiled scene.
    noise : NoiseModel
        What disturbs the force; its size may be unknown.
    base : mapping
        Every number of the scene (SI).
    entries : mapping of path to int
        Which entry of a vector holds which number of the scene.
    noise_entries : mapping of field name to int
        The same for the numbers of the noise.
    """

    scene: Scene
    curve: Curve
    forward: Forward
    noise: NoiseModel
    base: Mapping[str, float]
    entries: Mapping[str, int]
    noise_entries: Mapping[str, int]

    @property
    def force(self) -> FloatArray:
        """Measured force (N), (n,)."""
        return self.curve.force

    @cached_property
    def scatter(self) -> float:
        """Standard deviation (N) of the force about a smooth curve."""
        return scatter(self.curve)

    @cached_property
    def scale_is_unknown(self) -> bool:
        """Whether the size of the noise is neither given nor a parameter."""
        return self.noise.at(dict.fromkeys(self.noise_entries, 1.0)).size_is_unknown

    @cached_property
    def by_power_law(self) -> Forward | None:
        """The model by the laws of a sphere's paraboloid, to search with; None where they are no less work."""
        tip, laws = self.scene.indenter, self.forward.laws
        if not isinstance(tip, Sphere) or laws.tips is None:
            return None
        rounded = tip.apex
        forward = Forward.compile(
            replace(self.scene, indenter=rounded),
            self.curve.depth,
            tuple(self.entries),
            laws.solver,
            LawStore(),
            force=self.force,
        )
        return replace(forward, over=TipOverPowerLaw(tip, rounded))

    def values_at(self, physical: FloatArray) -> dict[str, float]:
        """Every number of the scene (SI) at a physical vector (k,)."""
        values = dict(self.base)
        for path, entry in self.entries.items():
            values[path] = float(physical[entry])
        return values

    def scene_at(self, physical: FloatArray) -> Scene:
        """Scene with the numbers of a physical vector (k,)."""
        return self.scene.with_values({path: float(physical[j]) for path, j in self.entries.items()})

    def noise_at(self, physical: FloatArray) -> NoiseModel:
        """Noise with the numbers of a physical vector (k,)."""
        return self.noise.at({name: float(physical[j]) for name, j in self.noise_entries.items()})

    def noise_of(self, physical: FloatArray) -> NoiseModel:
        """Noise with the numbers of physical vectors (B, k); of size 1 N where that is unknown."""
        known = self.noise.of_size(1.0) if self.scale_is_unknown else self.noise
        return known.at({name: physical[:, j, None] for name, j in self.noise_entries.items()})

    def model(self, physical: FloatArray) -> FloatArray:
        """Instrument's force (N), (n,), at a physical vector (k,); raises as `reading` does."""
        return self.forward.force(self.values_at(physical))

    def reading(self, physical: FloatArray) -> Reading:
        """Model at a physical vector (k,); raises InputError where no law exists."""
        return self.forward.reading(self.values_at(physical))

    def law(self, physical: FloatArray) -> ContactLaw:
        """Contact law behind the model at a physical vector (k,), at the reference of the similarity.

        The range of the exact law is up to twice the curve's, so its error estimate is not below that of the
        curve.
        """
        return self.forward.law_behind(self.values_at(physical))

    def jacobian(self, physical: FloatArray, *, rough: bool = False) -> tuple[Reading, FloatArray]:
        """Model and d force / d vector (SI), (n, k); zero for entries this curve does not read."""
        reading, own = self.forward.jacobian(self.values_at(physical), tuple(self.entries), rough=rough)
        columns = np.zeros((len(self.force), len(physical)))
        columns[:, list(self.entries.values())] = own
        return reading, columns

    def sigma(self, reading: Reading | None, noise: NoiseModel) -> FloatArray:
        """Standard deviation (N), (n,); the force's range where the size is unknown.

        Noise that does not follow the force needs no `reading`.
        """
        known = noise.of_size(float(np.ptp(self.force))) if noise.size_is_unknown else noise
        if reading is None:
            return known.sigma(self.force, None, self.curve.time)
        return known.sigma(reading.contact, reading.stiffness, self.curve.time)

    def whitened(self, physical: FloatArray) -> FloatArray:
        """Whitened residuals (n,) at a physical vector (k,)."""
        reading, noise = self.reading(physical), self.noise_at(physical)
        return noise.whiten((self.force - reading.force) / self.sigma(reading, noise), self.curve.time)

    def log_likelihood(self, physical: FloatArray) -> FloatArray:
        """Log-likelihood (B,) at physical vectors (B, k); -inf where no law exists."""
        return self.log_likelihood_along(physical, np.zeros((len(self.force), 0)))[0]

    def log_likelihood_along(
        self, physical: FloatArray, directions: FloatArray
    ) -> tuple[FloatArray, FloatArray]:
        """The same, and the whitened residuals along directions (n, m): (B, m), zero where no law exists."""
        noise, time = self.noise_of(physical), self.curve.time
        readings = self.readings(physical, stiffness=noise.needs_stiffness)
        possible = readings.possible
        result, along = np.full(len(physical), -np.inf), np.zeros((len(physical), directions.shape[1]))
        if not possible.any():
            return result, along
        contact, stiffness, force = readings[:3]
        # A copy of the rows that exist costs as much as the noise does: mostly all of them do.
        if not possible.all():
            contact, stiffness, force = (part[possible] for part in readings[:3])
            noise = self.noise_of(physical[possible])
        sigma = noise.sigma(contact, stiffness, time)
        residuals = noise.whiten((self.force - force) / sigma, time)
        square = np.einsum("...n,...n->...", residuals, residuals)
        normalisation = noise.log_normalisation(sigma, time)
        if self.scale_is_unknown:
            # int dsigma/sigma sigma^-n exp(-S / (2 sigma^2)) is S^(-n/2) up to a constant.
            result[possible] = normalisation - 0.5 * len(self.force) * np.log(square)
        else:
            result[possible] = normalisation - 0.5 * square
        if directions.size:
            along[possible] = residuals @ directions
        return result, along

    def readings(self, physical: FloatArray, *, stiffness: bool = True) -> Readings:
        """Model at physical vectors (B, k); without `stiffness` that is left zero."""
        return batched_readings(self.forward, self.values_of(physical), len(physical), stiffness=stiffness)

    def values_of(self, physical: FloatArray) -> Values:
        """Every number of the scene at physical vectors (B, k): (B,) where it is free."""
        values: dict[str, float | FloatArray] = dict(self.base)
        for path, entry in self.entries.items():
            values[path] = physical[:, entry]
        return values
