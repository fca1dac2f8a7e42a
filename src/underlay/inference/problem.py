"""An inverse problem: scenes, curves, free parameters with priors, and noise.

All that a fit or a sampler needs is a pure function of one vector of scaled coordinates (`coordinates.py`);
`log_prior`, `log_likelihood` and `log_posterior` take any number of vectors at once, (..., k).
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from copy import copy
from functools import cached_property
from typing import Self, TypeAlias

import numpy as np

from underlay._arrays import FloatArray, read_only
from underlay.data.curve import Curve
from underlay.errors import InputError
from underlay.inference.model.compilation import compile_members
from underlay.inference.model.coordinates import FAR, ScaledSpace
from underlay.inference.model.laws import LawStore
from underlay.inference.model.members import CommonErrors, means_alone
from underlay.inference.priors import Given, Prior
from underlay.mechanics.solver import Solver
from underlay.mechanics.solvers import AnySolver, as_solver
from underlay.scene.noise import NoiseModel
from underlay.scene.scene import Scene

#: A log-density of the data that replaces that of the noise model: (sets,) at physical vectors (sets, k), SI; -inf
#: where no law exists.
Likelihood: TypeAlias = Callable[[FloatArray], FloatArray]


class Problem:
    """One scene and one curve, with some numbers of the scene free.

    Parameters
    ----------
    scene : Scene
        The test; its numbers are the starting values of the free parameters and the values of the others.
    curve : Curve
        The points to be fitted, usually ``curve.loading()``. Points before contact belong to the model.
    free : mapping of path to prior
        Paths of the scene (``"layer.E"``, ``"instrument.contact_depth"``, ...) or of the noise (``"noise.force"``,
        ...), each with a `Prior`, bounds ``(low, high)`` (SI) or None. Finite bounds mean LogUniform for a quantity
        that is positive by nature and Uniform for another.
    noise : Noise or another NoiseModel, optional
        Noise of the force. Without it, or with ``Noise()``, the noise is white (or AR(1)) of unknown size: a fit
        estimates it, and the likelihood has it integrated out under 1/sigma. ``Noise()`` states that it is white,
        and intervals and posteriors assume that; without any, both are averaged over what else the residuals may be
        (`marginalised`).
    solver : Solver or str, default "auto"
        What builds the contact law; see `contact_law`.

    Attributes
    ----------
    names : tuple of str
        The free parameters, in the order of a vector; the noise's too.

    Raises
    ------
    ParameterError
        If a path is not the scene's, has no effect in it, or none is free.
    InputError
        If a start is outside its bounds, the noise is zero, or there are not more points than parameters.
    CurveError
        If the curve cannot be fitted.
    """

    def __init__(
        self,
        scene: Scene,
        curve: Curve,
        free: Mapping[str, Given] | Iterable[str],
        noise: NoiseModel | None = None,
        *,
        solver: AnySolver = "auto",
    ) -> None:
        self._compile([(scene, curve)], free, (), noise, as_solver(solver))

    @classmethod
    def joint(
        cls,
        tests: Sequence[tuple[Scene, Curve]],
        free: Mapping[str, Given] | Iterable[str],
        shared: Iterable[str] = (),
        noise: NoiseModel | Sequence[NoiseModel | None] | None = None,
        *,
        solver: AnySolver = "auto",
    ) -> Self:
        """A problem of several curves with shared parameters and parameters of single curves.

        Parameters
        ----------
        tests : sequence of (Scene, Curve)
            The curves, each with its scene.
        free : mapping of path to prior
            As for one curve. A path named in `shared` is one parameter for all curves and keeps its name; any other
            is one parameter per curve, named ``"layer.E[0]"``, ``"layer.E[1]"``, ... A path with a number, such as
            ``"indenter.radius[1]"``, frees it, or gives another prior, for that curve only.
        shared : iterable of str
            Paths that all curves have in common.
        noise : Noise, or one per curve
            As for one curve.
        solver : Solver or str, default "auto"
            As for one curve.

        Raises
        ------
        InputError
            As for one curve; also if two curves are the same, or a shared start differs between scenes.
        """
        problem = cls.__new__(cls)
        # A second public constructor with the same checks.
        problem._compile(list(tests), free, tuple(shared), noise, as_solver(solver))  # noqa: SLF001  own class
        return problem

    def _compile(
        self,
        tests: Sequence[tuple[Scene, Curve]],
        free: Mapping[str, Given] | Iterable[str],
        shared: tuple[str, ...],
        noise: NoiseModel | Sequence[NoiseModel | None] | None,
        solver: Solver,
    ) -> None:
        self.free = by_path(free)
        self.shared = shared
        self.noise = noise
        #: What builds the contact laws.
        self.solver = solver
        self.store = LawStore()
        self.members, self.coordinates = compile_members(tests, self.free, shared, noise, solver, self.store)
        self.space = ScaledSpace.of(self.coordinates)
        #: Errors that the curves have in common; see `LowRankNoise`.
        self.common = CommonErrors.of(self.members)
        #: Replaces the noise model's likelihood, if not None; see `with_likelihood`.
        self.likelihood: Likelihood | None = None
        #: Indices of the entries of a vector that are parameters of the noise.
        self.noise_entries = frozenset(i for member in self.members for i in member.noise_entries.values())

    def revised(
        self,
        *,
        free: Mapping[str, Given] | None = None,
        noise: NoiseModel | Sequence[NoiseModel | None] | None = None,
        solver: AnySolver | None = None,
        scenes: Sequence[Scene] | None = None,
        curves: Sequence[Curve] | None = None,
    ) -> Problem:
        """Return the problem with some of its parts replaced; parts that are None stay.

        Parameters are those of `Problem`; `scenes` and `curves` have one entry for each curve.
        """
        wanted = self.free if free is None else free
        return Problem.joint(
            list(zip(scenes or self.base_scenes, curves or self.curves, strict=True)),
            wanted,
            [path for path in self.shared if path in wanted],
            self.noise if noise is None else noise,
            solver=self.solver if solver is None else solver,
        )

    def with_likelihood(self, likelihood: Likelihood) -> Self:
        """Return the problem with another log-density of its data, which `revised` does not carry over."""
        changed = copy(self)
        changed.likelihood = likelihood
        return changed

    # --- what it is made of ---------------------------------------------------------------------------

    @cached_property
    def names(self) -> tuple[str, ...]:
        """Names of the free parameters, in the order of a vector."""
        return tuple(coordinate.name for coordinate in self.coordinates)

    @property
    def priors(self) -> dict[str, Prior]:
        """Prior of every free parameter, in SI; `Flat` where none was given."""
        return {coordinate.name: coordinate.prior for coordinate in self.coordinates}

    @property
    def curves(self) -> tuple[Curve, ...]:
        """The curves of the problem."""
        return tuple(member.curve for member in self.members)

    @property
    def base_scenes(self) -> tuple[Scene, ...]:
        """The scenes as given, one per curve."""
        return tuple(member.scene for member in self.members)

    @cached_property
    def n_points(self) -> int:
        """Number of points of all curves."""
        return sum(len(member.force) for member in self.members)

    @cached_property
    def bounds(self) -> FloatArray:
        """Lower and upper bounds in scaled coordinates, (k, 2), read-only; infinite where there are none."""
        return read_only(np.array([coordinate.bounds for coordinate in self.coordinates]))

    @property
    def noise_is_stated(self) -> bool:
        """Whether a noise was given for any curve, or its points are means with known errors."""
        given = [self.noise] if isinstance(self.noise, NoiseModel) else self.noise or ()
        return any(entry is not None for entry in given) or any(map(means_alone, self.curves))

    @property
    def noise_is_open(self) -> bool:
        """Whether no noise was given and none of it is free: intervals then average over possible noises."""
        return not (self.noise_is_stated or self.noise_entries)

    @property
    def adheres(self) -> bool:
        """Whether the scene of any curve has adhesion."""
        return any(member.scene.adheres for member in self.members)

    @property
    def start(self) -> FloatArray:
        """Scaled coordinates of the scene's own numbers, all zero, (k,)."""
        return np.zeros(len(self.coordinates))

    # --- vectors and values -----------------------------------------------------------------------------

    def values(self, vector: FloatArray) -> dict[str, float]:
        """Parameters (SI) by name at a vector (k,)."""
        physical = self.physical(self._one(vector))
        return dict(zip(self.names, physical.tolist(), strict=True))

    def vector(self, values: Mapping[str, float]) -> FloatArray:
        """Scaled coordinates (k,) of parameters (SI) by name; those not named keep the scene's value.

        Raises
        ------
        InputError
            If a name is not free here.
        """
        unknown = sorted(set(values) - set(self.names))
        if unknown:
            raise InputError(f"{unknown[0]!r} is not free here; free are {', '.join(self.names)}")
        given = [values.get(coordinate.name, coordinate.reference) for coordinate in self.coordinates]
        return np.array([c.scaled(value) for c, value in zip(self.coordinates, given, strict=True)])

    def physical(self, vectors: FloatArray) -> FloatArray:
        """Parameters (SI), (..., k), at scaled vectors (..., k)."""
        return self.space.physical(np.asarray(vectors, dtype=np.float64))

    def slopes(self, vector: FloatArray) -> FloatArray:
        """d parameter (SI) / d scaled coordinate, (k,), at a vector (k,)."""
        return self.space.slopes(self.physical(self._one(vector)))

    def scenes(self, vector: FloatArray) -> tuple[Scene, ...]:
        """One scene per curve with the numbers of a vector (k,)."""
        physical = self.physical(self._one(vector))
        return tuple(member.scene_at(physical) for member in self.members)

    def noises(self, vector: FloatArray) -> tuple[NoiseModel, ...]:
        """One noise model per curve with the numbers of a vector (k,)."""
        if not self.noise_entries:
            return tuple(member.noise for member in self.members)
        physical = self.physical(self._one(vector))
        return tuple(member.noise_at(physical) for member in self.members)

    # --- pure functions of a vector ---------------------------------------------------------------------

    def residuals(self, vector: FloatArray) -> FloatArray:
        """Whitened residuals (data - model) / sigma of all points, (n,), at a vector (k,).

        Where the size of the noise is unknown, sigma is the range of the curve's force.

        Raises
        ------
        InputError
            If no law exists at these values.
        """
        physical = self.physical(self._one(vector))
        own = [member.whitened(physical) for member in self.members]
        return np.concatenate(own if self.common is None else self.common.whitened(own))

    def log_prior(self, vectors: FloatArray) -> FloatArray:
        """Log-prior of scaled vectors (..., k), (...); -inf outside the bounds and beyond `FAR`.

        A density in the scaled coordinates q: that of the physical parameters x times |dx/dq|.
        """
        q = np.asarray(vectors, dtype=np.float64)
        # Far outside the bounds, and far from the scene, physical values may overflow.
        low, high = self.bounds.T
        near = ((q >= np.maximum(low - 1.0, -FAR)) & (q <= np.minimum(high + 1.0, FAR))).all(axis=-1)
        inside = np.where(near[..., None], q, self.start)
        return np.where(near, self.space.log_prior(inside, self.space.physical(inside)), -np.inf)

    def log_likelihood(self, vectors: FloatArray) -> FloatArray:
        """Logarithm of the probability density of the data at scaled vectors (..., k), (...).

        -inf where no law exists (an impossible material, a depth out of the law's reach): a vector with a finite
        prior and zero likelihood is a failed evaluation, and a sampler counts it.
        """
        q = np.asarray(vectors, dtype=np.float64)
        return self._likelihood_at(self.physical(q.reshape(-1, q.shape[-1]))).reshape(q.shape[:-1])

    def log_posterior(self, vectors: FloatArray) -> FloatArray:
        """log_prior + log_likelihood at scaled vectors (..., k), (...); without a law where the prior is zero."""
        q = np.asarray(vectors, dtype=np.float64)
        flat = q.reshape(-1, q.shape[-1])
        posterior = self.log_prior(flat)
        possible = np.isfinite(posterior)
        if possible.any():
            posterior[possible] += self._likelihood_at(self.physical(flat[possible]))
        return posterior.reshape(q.shape[:-1])

    def _likelihood_at(self, physical: FloatArray) -> FloatArray:
        if self.likelihood is not None:
            return self.likelihood(physical)
        total = np.zeros(len(physical))
        if self.common is None:
            for member in self.members:
                total = total + member.log_likelihood(physical)
            return total
        projected = np.zeros((len(physical), len(self.common.sizes)))
        for member, directions in zip(self.members, self.common.directions, strict=True):
            own, along = member.log_likelihood_along(physical, directions)
            total, projected = total + own, projected + along
        return total + self.common.log_density(projected)

    def _one(self, vector: FloatArray) -> FloatArray:
        q = np.asarray(vector, dtype=np.float64)
        if q.shape != (len(self.coordinates),):
            raise InputError(
                f"a vector here has {len(self.coordinates)} entries ({', '.join(self.names)}); "
                f"got shape {q.shape}"
            )
        return q


def by_path(free: object) -> dict[str, Given]:
    """Priors of the free parameters by path, from a mapping or from paths without priors (None)."""
    if isinstance(free, Iterable) and not isinstance(free, str):
        paths = list(free)
        if all(isinstance(path, str) for path in paths):
            return dict(free) if isinstance(free, Mapping) else dict.fromkeys(paths)
    raise InputError(
        'free must be paths with their priors, such as {"layer.E": None} or '
        f'{{"layer.E": ul.LogUniform(1e3, 1e6)}}, or paths alone; got {free!r:.80}'
    )
