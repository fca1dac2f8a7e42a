"""Synthetic curves of a scene: `simulate` without noise, `synthesize` with noise and disturbances.

Both keep the true parameters they were made from. The order is that of an instrument: the tip goes to its depth,
the contact gives a force, the instrument adds its baseline; then come noise, drift and outliers, and the load cell
rounds last. Every effect is off unless given. Each draws from a random stream of its own, spawned from the seed, so
that switching one on or off leaves the others unchanged. Contact offset, tilted baseline and compliance belong to
the scene's instrument.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import ClassVar

import numpy as np

from underlay._arrays import ArrayLike, FloatArray, as_finite, finite, positive
from underlay._given import require_given
from underlay.data.curve import Curve
from underlay.errors import InputError
from underlay.mechanics.solvers import AnySolver
from underlay.quantities import Part, field_quantities, quantity
from underlay.scene.noise import Noise, NoiseModel
from underlay.scene.scene import Scene


@dataclass(frozen=True)
class Disturbances(Part):
    """What an instrument does to a force besides its noise: drift, outliers, and steps of its load cell.

    Every part is off unless named.

    Parameters
    ----------
    drift : float, default 0
        Drift of the force reading (N/s), from the first point on; needs times.
    quantisation : float, default 0
        Step of the load cell (N): the force is rounded to multiples of it.
    outliers : float, default 0
        Probability of a point to be an outlier, in [0, 1].
    outlier_sd : float, default 0
        Standard deviation (N) of what an outlier adds; needed when `outliers` is not zero.

    Raises
    ------
    InputError
        If a number is not allowed, or outliers have no size.
    """

    parts: ClassVar[tuple[str, ...]] = ("disturbances",)

    drift: float = field(default=0.0, metadata=quantity("loading rate", "drift of the force"))
    quantisation: float = field(default=0.0, metadata=quantity("force", "step of the load cell"))
    outliers: float = field(default=0.0, metadata=quantity("dimensionless", "share of outliers"))
    outlier_sd: float = field(default=0.0, metadata=quantity("force", "size of the outliers"))

    def __post_init__(self) -> None:
        for name, unit in (
            ("drift", "N/s"),
            ("quantisation", "N"),
            ("outliers", "probability of a point"),
            ("outlier_sd", "N"),
        ):
            object.__setattr__(self, name, finite(getattr(self, name), name, unit))
        for name in ("quantisation", "outlier_sd"):
            if getattr(self, name) < 0.0:
                raise InputError(f"{name} must be zero or positive (N); got {getattr(self, name)!r}")
        if not (0.0 <= self.outliers <= 1.0):
            raise InputError(
                f"outliers is the probability of a point, between 0 and 1; got {self.outliers!r}"
            )
        if self.outliers and not self.outlier_sd:
            raise InputError("outliers need their size: give outlier_sd, a standard deviation (N)")

    @property
    def numbers(self) -> dict[str, float]:
        """Drift, quantisation, outliers and outlier_sd by name (SI)."""
        return {name: getattr(self, name) for name in field_quantities(type(self))}

    def on(self, force: FloatArray, clock: FloatArray | None, rng: np.random.Generator) -> FloatArray:
        """Return force readings (N), (n,), with the disturbances; `clock` (s), (n,), is needed for drift.

        Raises
        ------
        InputError
            If there is a drift and no clock.
        """
        if self.drift:
            if clock is None:
                raise InputError(
                    "drift (N/s) needs the times of the points: pass time (s) or sampling_rate (Hz)"
                )
            force = force + self.drift * (clock - clock[0])
        if self.outliers:
            hit = rng.random(force.size) < self.outliers
            force = force + hit * rng.normal(scale=self.outlier_sd, size=force.size)
        return np.round(force / self.quantisation) * self.quantisation if self.quantisation else force


def simulate(
    scene: Scene,
    depth: ArrayLike | None = None,
    time: ArrayLike | None = None,
    *,
    force: ArrayLike | None = None,
    solver: AnySolver = "auto",
) -> Curve:
    """Make the curve that an ideal instrument would read of a scene, without noise.

    Parameters
    ----------
    scene : Scene
        The test.
    depth : ArrayLike, optional
        Depth readings (m), (n,): depth control. `Program` makes them.
    time : ArrayLike, optional
        Times of the readings (s), (n,).
    force : ArrayLike, optional
        Force readings (N), (n,), in place of the depths: load control, under which a relaxing layer creeps.
    solver : Solver or str, default "auto"
        Which contact law; see `contact_law`.

    Returns
    -------
    Curve
        Its ``truth`` holds every parameter of the scene by path.

    Raises
    ------
    InputError
        If depth, force or time cannot be used.
    RangeError
        If the law is not valid up to the deepest point.
    """
    require_given(scene, "scene", Scene)
    if depth is None:
        if force is None:
            raise InputError("give the depths (m) or the forces (N) of the readings")
        loads = _column(force, "force")
        clock = None if time is None else _times(time, loads.size, "force")
        return Curve(scene.depth(loads, clock, solver=solver), loads, time=clock, truth=scene.parameters)
    if force is not None:
        raise InputError("give depths or forces, not both: one follows from the other")
    readings = _column(depth, "depth")
    clock = None if time is None else _times(time, readings.size)
    return Curve(
        depth=readings,
        force=scene.force(readings, clock, solver=solver),
        time=clock,
        truth=scene.parameters,
    )


def synthesize(
    scene: Scene,
    depth: ArrayLike,
    noise: NoiseModel | None = None,
    rng: int | np.random.Generator = 0,
    *,
    time: ArrayLike | None = None,
    sampling_rate: float | None = None,
    disturbances: Disturbances | None = None,
    solver: AnySolver = "auto",
) -> Curve:
    """Make a curve of a scene as a real instrument would read it, with noise and disturbances.

    Parameters
    ----------
    scene : Scene
        The test; contact offset, tilted baseline and compliance are its instrument's.
    depth : ArrayLike
        True depth axis (m), (n,). Depth noise is added to what the curve reports, not to where the tip is.
    noise : Noise or another NoiseModel, optional
        White, proportional, correlated and depth noise. A white noise of None is left out. With a
        correlation time, force and depth noise are both correlated.
    rng : int or numpy Generator, default 0
        Seed, recorded in the truth, or a generator to spawn from. The same seed gives the same curve.
    time : ArrayLike, optional
        Times of the points (s), (n,).
    sampling_rate : float, optional
        Points per second (Hz), instead of `time`.
    disturbances : Disturbances, optional
        Drift, outliers and the steps of the load cell.
    solver : Solver or str, default "auto"
        Which contact law; see `contact_law`.

    Returns
    -------
    Curve
        ``truth`` holds every parameter of the scene by its path, ``noise.force`` and the other noise
        settings, ``drift``, ``quantisation``, ``outliers``, ``outlier_sd``, and ``sampling_rate`` and
        ``seed`` where given.

    Raises
    ------
    InputError
        If a number is not allowed, or times are needed and missing.
    RangeError
        If the law cannot reach the deepest point.

    Examples
    --------
    >>> from underlay import Isotropic, Layer, Paraboloid, Scene
    >>> scene = Scene(Paraboloid(1e-3), Layer(Isotropic(1e6, 0.5)))
    >>> curve = synthesize(scene, np.linspace(0.0, 1e-5, 200), Noise(force=1e-6), rng=7)
    >>> curve.truth["layer.E"], curve.truth["noise.force"], curve.truth["seed"]
    (1000000.0, 1e-06, 7)
    """
    readings = _column(depth, "depth")
    clock = _clock(time, sampling_rate, readings.size)
    others = Disturbances() if disturbances is None else disturbances
    for_noise, for_depth, for_outliers = _generator(rng).spawn(3)

    # One evaluation of the law: the proportional noise needs the contact force without the baseline.
    bare = replace(scene, instrument=replace(scene.instrument, baseline=0.0, baseline_slope=0.0))
    contact = bare.force(readings, clock, solver=solver)
    force = scene.instrument.chain.reading(contact, readings)
    shown = readings
    if noise is not None:
        force = force + _force_noise(noise, for_noise, contact, clock)
        if noise.depth_deviation:
            spread = np.full(readings.size, noise.depth_deviation)
            shown = readings + noise.sample(for_depth, spread, clock)
    force = others.on(force, clock, for_outliers)

    truth: dict[str, float] = scene.parameters | _noise_settings(noise) | others.numbers
    if sampling_rate is not None:
        truth["sampling_rate"] = float(sampling_rate)
    if not isinstance(rng, np.random.Generator):
        truth["seed"] = int(rng)
    return Curve(depth=shown, force=force, time=clock, truth=truth)


def _force_noise(
    noise: NoiseModel, rng: np.random.Generator, contact: FloatArray, clock: FloatArray | None
) -> FloatArray:
    """Draw the noise of the force reading (N), (n,), for contact forces (N), (n,), without that of the depth."""
    drawn = noise.of_force()
    if drawn is None:
        return np.zeros_like(contact)
    return drawn.sample(rng, drawn.sigma(contact, None, clock), clock)


def _noise_settings(noise: NoiseModel | None) -> dict[str, float]:
    if noise is None:
        return {f"noise.{name}": 0.0 for name in field_quantities(Noise)}
    return {f"noise.{name}": float(getattr(noise, name) or 0.0) for name in field_quantities(noise)}


def _generator(rng: int | np.random.Generator) -> np.random.Generator:
    try:
        return np.random.default_rng(rng)
    except (TypeError, ValueError) as error:
        raise InputError(f"rng must be a seed (an integer, 0 or more) or a Generator; got {rng!r}") from error


def _clock(time: ArrayLike | None, sampling_rate: float | None, count: int) -> FloatArray | None:
    if time is not None:
        if sampling_rate is not None:
            raise InputError("pass time or sampling_rate, not both: they say the same thing")
        return _times(time, count)
    if sampling_rate is None:
        return None
    return np.arange(count) / positive(sampling_rate, "sampling_rate", "Hz")


def _times(time: ArrayLike, count: int, what: str = "depth") -> FloatArray:
    times = _column(time, "time")
    if times.size != count:
        raise InputError(f"time has {times.size} points and {what} {count}; they must match")
    return times


def _column(values: ArrayLike, name: str) -> FloatArray:
    array = as_finite(values, name)
    if array.ndim != 1 or array.size == 0:
        raise InputError(f"{name} must be a list of numbers, (n,); got shape {array.shape}")
    return array
