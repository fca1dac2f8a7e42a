"""One curve of a problem, compiled: its parameters, law and noise, and errors shared by several curves."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from underlay._arrays import FloatArray
from underlay.data.curve import Curve
from underlay.data.foot import converter_noise
from underlay.errors import InputError
from underlay.inference.model.forward import Forward, Reading, TipOverPowerLaw
from underlay.inference.model.forward_batch import batched_readings
from underlay.inference.model.laws import LawStore
from underlay.inference.model.parameter_sets import Readings, Values
from underlay.inference.priors import Prior
from underlay.mechanics.contact_law import ContactLaw
from underlay.mechanics.indenters import Sphere
from underlay.quantities import field_quantities
from underlay.scene.noise import LowRankNoise, NoiseModel
from underlay.scene.scene import Scene

# Median absolute second difference of white noise over its standard deviation sigma: second differences have
# variance 6 sigma^2, and the median absolute value of a normal variable is 0.6745 of its deviation. Those of a
# smooth curve are small.
_SECOND_DIFFERENCE = 6.0**0.5 * 0.6744897501960817


def means_alone(curve: Curve) -> bool:
    """Whether a curve is one or two mean values of holds, with known errors, too few to estimate scatter from."""
    return not np.diff(curve.force, 2).size


def scatter(curve: Curve) -> float:
    """Standard deviation (N) of the force about a smooth curve, from second differences; robust, never zero."""
    force = curve.force[np.argsort(curve.depth, kind="stable")] if curve.time is None else curve.force
    # In order, which takes a third of numpy.median's time.
    second = np.sort(np.abs(np.diff(force, 2)))
    if not second.size:
        errors = curve.metadata.get("force_standard_error", ())
        return max(*(float(error) for error in errors), 1e-9 * float(np.abs(curve.force).max()))
    median = 0.5 * float(second[(len(second) - 1) // 2] + second[len(second) // 2])
    floor = 1e-9 * float(np.ptp(curve.force))
    return max(median / _SECOND_DIFFERENCE, floor, converter_noise(curve.force))


def noise_start(
    field: str,
    noise: NoiseModel,
    curves: Sequence[Curve],
    prior: Prior | None,
    bounds: tuple[float, float] | None,
) -> float:
    """Starting value (SI) of a free number of the noise: the model's own, else a guess from the curves.

    Parameters
    ----------
    field : str
        Name of the number in the noise model.
    noise : NoiseModel
        The model.
    curves : sequence of Curve
        Curves that the number acts on.
    prior : Prior or None
        Its prior; the guess lies inside.
    bounds : (float, float) or None
        Its bounds (SI); the guess lies inside.
    """
    given = getattr(noise, field)
    if given:
        return float(given)
    known = field_quantities(noise)[field]
    guesses: dict[str, Callable[[], float]] = {
        "force": lambda: float(np.median([scatter(curve) for curve in curves])),
        "length": lambda: 1e-3 * max(float(np.ptp(curve.depth)) for curve in curves),
        "time": lambda: 3.0 * float(np.median([_time_step(curve) for curve in curves])),
    }
    guess = guesses.get(known.kind, lambda: known.natural_scale)()
    low, high = prior.support if prior is not None else bounds or (0.0, np.inf)
    if low <= guess <= high:
        return guess
    if prior is not None and prior.proper:
        return float(prior.quantile(np.array(0.5)))
    if np.isfinite(high):
        return float(np.sqrt(low * high)) if low > 0.0 else 0.5 * (low + high)
    return 2.0 * low


def _time_step(curve: Curve) -> float:
    return 1.0 if curve.time is None else float(np.median(np.abs(np.diff(curve.time))))


@dataclass(frozen=True, eq=False)
class Member:
    """One scene and one curve of a problem, compiled.

    A parameter vector (k,) holds all free parameters of the problem; a curve may depend on some of them only.

    Parameters
    ----------
    scene, curve
        The test and its curve, as given.
    forward : Forward
        The compiled scene.
    noise : NoiseModel
        Noise of the force; its size may be unknown.
    base : mapping
        Every number of the scene (SI).
    entries : mapping of path to int
        Entry of a parameter vector that holds a number of the scene.
    noise_entries : mapping of field name to int
        Entry of a parameter vector that holds a number of the noise.
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
        """Approximate model with a sphere's paraboloid in place of the sphere, for searches.

        None where the tip is no sphere, or that saves no work.
        """
        tip, laws = self.scene.indenter, self.forward.laws
        if not isinstance(tip, Sphere) or laws.tips is None:
            return None
        rounded = tip.power_law
        forward = Forward.compile(
            replace(self.scene, indenter=rounded, layer=self.scene.layer.linear),
            self.curve.depth,
            tuple(self.entries),
            laws.solver,
            LawStore(),
            force=self.force,
        )
        return replace(forward, over=TipOverPowerLaw(tip, rounded))

    def values_at(self, physical: FloatArray) -> dict[str, float]:
        """Every number of the scene (SI), by path, with the problem's parameters (k,), in SI, put in."""
        values = dict(self.base)
        for path, entry in self.entries.items():
            values[path] = float(physical[entry])
        return values

    def scene_at(self, physical: FloatArray) -> Scene:
        """Scene with the problem's parameters (k,), in SI, put in."""
        return self.scene.with_values({path: float(physical[j]) for path, j in self.entries.items()})

    def noise_at(self, physical: FloatArray) -> NoiseModel:
        """Noise model with the problem's parameters (k,), in SI, put in."""
        return self.noise.at({name: float(physical[j]) for name, j in self.noise_entries.items()})

    def noise_of(self, physical: FloatArray) -> NoiseModel:
        """Noise model for B parameter vectors (B, k) at once, in SI; of size 1 N where its size is unknown."""
        known = self.noise.of_size(1.0) if self.scale_is_unknown else self.noise
        return known.at({name: physical[:, j, None] for name, j in self.noise_entries.items()})

    def model(self, physical: FloatArray) -> FloatArray:
        """Force reading of the instrument (N), (n,), predicted at parameters (k,), SI; raises as `reading` does."""
        return self.forward.reading(self.values_at(physical), stiffness=False).force

    def reading(self, physical: FloatArray) -> Reading:
        """Predicted force and stiffness at parameters (k,), SI; raises InputError where no contact law exists."""
        return self.forward.reading(self.values_at(physical))

    def law(self, physical: FloatArray) -> ContactLaw:
        """Contact law behind the model at parameters (k,), SI, for its error estimate and warnings.

        Except for layers that stiffen or have sides it is the law of the reference contact (`Similarity`), before
        scaling. The exact solver's law may reach up to twice as deep as the curve, and its error estimate covers
        that whole range.
        """
        return self.forward.law_behind(self.values_at(physical))

    def jacobian(self, physical: FloatArray, *, rough: bool = False) -> tuple[Reading, FloatArray]:
        """Model at parameters (k,), SI, and the derivatives of its force in them, (n, k).

        Columns of parameters that this curve does not depend on are zero. `rough` as in `Forward.jacobian`.
        """
        reading, own = self.forward.jacobian(self.values_at(physical), tuple(self.entries), rough=rough)
        columns = np.zeros((len(self.force), len(physical)))
        columns[:, list(self.entries.values())] = own
        return reading, columns

    def sigma(self, reading: Reading | None, noise: NoiseModel) -> FloatArray:
        """Standard deviation of the noise (N), (n,); the range of the forces where its size is unknown.

        Noise whose size does not depend on the force needs no `reading`.
        """
        known = noise.of_size(float(np.ptp(self.force))) if noise.size_is_unknown else noise
        if reading is None:
            return known.sigma(self.force, None, self.curve.time)
        return known.sigma(reading.contact, reading.stiffness, self.curve.time)

    def whitened(self, physical: FloatArray) -> FloatArray:
        """Whitened residuals, data minus model, (n,), at parameters (k,), SI."""
        reading, noise = self.reading(physical), self.noise_at(physical)
        return noise.whiten((self.force - reading.force) / self.sigma(reading, noise), self.curve.time)

    def log_likelihood(self, physical: FloatArray) -> FloatArray:
        """Log-likelihood (B,) at parameter vectors (B, k), SI; -inf where no law exists."""
        return self.log_likelihood_along(physical, np.zeros((len(self.force), 0)))[0]

    def log_likelihood_along(
        self, physical: FloatArray, directions: FloatArray
    ) -> tuple[FloatArray, FloatArray]:
        """Log-likelihood (B,) at parameter vectors (B, k), SI, and projections of the whitened residuals.

        The projections are on the columns of `directions` (n, m), so (B, m). -inf and zero where no law exists.
        """
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
        """Predicted forces and stiffnesses at B parameter vectors (B, k), SI.

        The stiffness is computed if `stiffness` is true, and left zero otherwise.
        """
        return batched_readings(self.forward, self.values_of(physical), len(physical), stiffness=stiffness)

    def values_of(self, physical: FloatArray) -> Values:
        """Every number of the scene (SI) by path, at B parameter vectors (B, k): (B,) where it is free."""
        values: dict[str, float | FloatArray] = dict(self.base)
        for path, entry in self.entries.items():
            values[path] = physical[:, entry]
        return values


@dataclass(frozen=True)
class CommonErrors:
    """Errors that several curves have in common: one contact law is wrong in the same way in all of them.

    The readings of all curves over their noise, each whitened by its own, are e = z + A u, z and u independent and
    of unit variance, the rows of A those of the curves one after the other. With A = U S V' their covariance is I +
    A A', whose inverse root is

        P = I - U (1 - (1 + S^2)^(-1/2)) U',

    and half the logarithm of whose determinant is sum ln(1 + s^2) / 2. A depends on no parameter: sizes are
    relative to the noise, and that is given.

    Parameters
    ----------
    rows : tuple of FloatArray
        Rows of A of every curve, (n, m): what each error of size one adds to its whitened readings.
    directions : tuple of FloatArray
        Rows of U of every curve, (n, m).
    sizes : FloatArray
        Singular values S, (m,).
    """

    rows: tuple[FloatArray, ...]
    directions: tuple[FloatArray, ...]
    sizes: FloatArray

    @classmethod
    def of(cls, members: Sequence[Member]) -> CommonErrors | None:
        """Find the common errors in the noise models of these curves; None where there are none.

        Raises
        ------
        InputError
            If the curves' noise models do not all have the same number of them.
        """
        columns = [_common(member) for member in members]
        counts = {own.shape[1] for own in columns}
        if counts == {0}:
            return None
        if len(counts) > 1:
            raise InputError(
                "errors that curves have in common are of one size in all of them: give each curve as many "
                f"columns; got {', '.join(str(own.shape[1]) for own in columns)}"
            )
        rows = [
            member.noise.whiten(own.T, member.curve.time).T
            for member, own in zip(members, columns, strict=True)
        ]
        ends = np.cumsum([len(own) for own in rows])[:-1]
        directions, sizes, _ = np.linalg.svd(np.concatenate(rows), full_matrices=False)
        return cls(tuple(rows), tuple(np.split(directions, ends)), sizes)

    @property
    def log_determinant(self) -> float:
        """Half the logarithm of the determinant of I + A A', the covariance of the whitened readings."""
        return 0.5 * float(np.log1p(self.sizes**2).sum())

    def whitened(self, parts: Sequence[FloatArray]) -> list[FloatArray]:
        """Whiten the residuals of the common errors too, after each curve's own noise, (..., n) each."""
        summed = sum(own @ along for own, along in zip(parts, self.directions, strict=True))
        less = summed * (1.0 - 1.0 / np.sqrt(1.0 + self.sizes**2))
        return [own - less @ along.T for own, along in zip(parts, self.directions, strict=True)]

    def log_density(self, along: FloatArray) -> FloatArray:
        """Contribution of errors that curves have in common to the log-likelihood, (...).

        `along` (..., m) are the whitened residuals of all curves projected on `directions`.
        """
        share = self.sizes**2 / (1.0 + self.sizes**2)
        return np.asarray(0.5 * np.square(along) @ share - self.log_determinant)

    def innovations(self, white: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Whitened readings of all curves (..., n) less the predictions of each from the readings before it.

        Also returned are the logarithms of the standard deviations of these differences, (n,).
        """
        noise = LowRankNoise(force=1.0, columns=np.concatenate(self.rows))
        return noise.whiten(white), noise.log_deviations(np.ones(white.shape[-1]))


def _common(member: Member) -> FloatArray:
    noise = member.noise
    return noise.common if isinstance(noise, LowRankNoise) else np.zeros((len(member.force), 0))
