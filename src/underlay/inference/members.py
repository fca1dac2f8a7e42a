"""One curve of a problem, compiled: which entries of a vector it reads, its law and its noise."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from underlay._arrays import FloatArray
from underlay.data.curve import Curve, check_fittable
from underlay.data.noise import Noise, log_normalisation, standard_deviation, whiten
from underlay.errors import CurveError, InputError, ParameterError
from underlay.inference.acting import NOISE_PATHS, require_acting
from underlay.inference.coordinates import Coordinate, Spans, make_coordinate
from underlay.inference.forward import Forward, LawOptions, LawStore, Reading
from underlay.inference.noise_start import noise_start
from underlay.inference.priors import Prior
from underlay.mechanics.contact_law import ContactLaw
from underlay.scene.scene import Scene

if TYPE_CHECKING:
    from underlay.inference.problem import Given

__all__ = ["Member", "compile_members"]

_NUMBERED = re.compile(r"^(?P<path>.+)\[(?P<number>\d+)\]$")


@dataclass(frozen=True, eq=False)
class Member:
    """One scene and one curve of a problem.

    Parameters
    ----------
    scene, curve
        As given.
    forward : Forward
        The compiled scene.
    noise : Noise
        What disturbs the force; its `force` is None where the size is unknown.
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
    noise: Noise
    base: Mapping[str, float]
    entries: Mapping[str, int]
    noise_entries: Mapping[str, int]

    @property
    def force(self) -> FloatArray:
        """Measured force (N), (n,)."""
        return self.curve.force

    @property
    def scale_is_unknown(self) -> bool:
        """Whether the size of the noise is neither given nor a parameter."""
        return self.noise.force is None and "force" not in self.noise_entries

    def values_at(self, physical: FloatArray) -> dict[str, float]:
        """Every number of the scene (SI) at a physical vector (k,)."""
        values = dict(self.base)
        for path, entry in self.entries.items():
            values[path] = float(physical[entry])
        return values

    def scene_at(self, physical: FloatArray) -> Scene:
        """Scene with the numbers of a physical vector (k,)."""
        return self.scene.with_values({path: float(physical[j]) for path, j in self.entries.items()})

    def noise_at(self, physical: FloatArray) -> Noise:
        """Noise with the numbers of a physical vector (k,)."""
        return replace(self.noise, **{name: float(physical[j]) for name, j in self.noise_entries.items()})

    def reading(self, physical: FloatArray) -> Reading:
        """Model at a physical vector (k,); raises InputError where no law exists."""
        return self.forward.reading(self.values_at(physical))

    def law(self, physical: FloatArray) -> ContactLaw:
        """Contact law at a physical vector (k,), as a caller of the scene would get it."""
        scene = self.scene_at(physical)
        deepest = float(self.curve.depth.max()) - scene.instrument.contact_depth
        return self.forward.options.build(scene, max(deepest, 0.0))

    def jacobian(self, physical: FloatArray) -> tuple[Reading, FloatArray]:
        """Model and d force / d vector (SI), (n, k); zero for entries this curve does not read."""
        reading, own = self.forward.jacobian(self.values_at(physical), tuple(self.entries))
        columns = np.zeros((len(self.force), len(physical)))
        columns[:, list(self.entries.values())] = own
        return reading, columns

    def sigma(self, reading: Reading, noise: Noise) -> FloatArray:
        """Standard deviation (N), (n,); the force's range where the size is unknown."""
        known = noise if noise.force is not None else replace(noise, force=float(np.ptp(self.force)))
        return known.sigma(reading.contact, reading.stiffness)

    def whitened(self, physical: FloatArray) -> FloatArray:
        """Whitened residuals (n,) at a physical vector (k,)."""
        reading, noise = self.reading(physical), self.noise_at(physical)
        return noise.whiten((self.force - reading.force) / self.sigma(reading, noise), self.curve.time)

    def log_likelihood(self, physical: FloatArray) -> FloatArray:
        """Log-likelihood (B,) at physical vectors (B, k); -inf where no law exists."""
        contact, stiffness, force, possible = self.readings(physical)
        numbers = {name: physical[possible, j] for name, j in self.noise_entries.items()}
        result = np.full(len(physical), -np.inf)
        if not possible.any():
            return result
        tau = numbers.get("correlation_time", self.noise.correlation_time)
        force_sd = numbers.get("force", self.noise.force)
        sigma = standard_deviation(
            contact[possible],
            stiffness[possible],
            force_sd=1.0 if force_sd is None else force_sd,
            relative=numbers.get("relative", self.noise.relative),
            depth_sd=numbers.get("depth", self.noise.depth),
        )
        residuals = whiten((self.force - force[possible]) / sigma, self.curve.time, tau)
        square = np.einsum("...n,...n->...", residuals, residuals)
        normalisation = log_normalisation(sigma, self.curve.time, tau)
        if force_sd is not None:
            result[possible] = normalisation - 0.5 * square
        else:
            # int dsigma/sigma sigma^-n exp(-S / (2 sigma^2)) is S^(-n/2) up to a constant.
            result[possible] = normalisation - 0.5 * len(self.force) * np.log(square)
        return result

    def readings(self, physical: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray, np.ndarray]:
        """Contact force, stiffness and instrument force, each (B, n), and which of the B exist, (B,)."""
        shape = (len(physical), len(self.force))
        contact, stiffness, force = np.zeros(shape), np.zeros(shape), np.zeros(shape)
        possible = np.ones(len(physical), dtype=bool)
        for row, vector in enumerate(physical):
            try:
                reading = self.reading(vector)
            except InputError:
                possible[row] = False
                continue
            contact[row], stiffness[row], force[row] = reading.contact, reading.stiffness, reading.force
        return contact, stiffness, force, possible


def compile_members(
    tests: Sequence[tuple[Scene, Curve]],
    free: Mapping[str, Given],
    shared: tuple[str, ...],
    noise: Noise | Sequence[Noise | None] | None,
    options: LawOptions,
    store: LawStore,
) -> tuple[tuple[Member, ...], tuple[Coordinate, ...]]:
    """Check a problem and compile it; see `Problem` for what is refused."""
    noises = _noises(noise, len(tests))
    _check_tests(tests)
    requests = _requests(free, shared, len(tests))
    if not requests:
        raise ParameterError("nothing is free: name at least one parameter, for example 'layer.E'")
    coordinates = []
    entries: list[dict[str, int]] = [{} for _ in tests]
    for index, (name, path, given, curves) in enumerate(requests):
        own = [tests[i] for i in curves]
        for scene, _ in own:
            require_acting(path, scene, [request[1] for request in requests], options.method)
        start = _common_start(name, path, own, [noises[i] for i in curves], given)
        coordinates.append(make_coordinate(name, path, start, given, _spans([curve for _, curve in own])))
        for i in curves:
            entries[i][path] = index
    members = tuple(
        _member(scene, curve, noises[i], entries[i], options, store) for i, (scene, curve) in enumerate(tests)
    )
    points = sum(len(curve) for _, curve in tests)
    if points <= len(coordinates):
        raise InputError(
            f"{len(coordinates)} parameters are free but there are only {points} points: free fewer"
        )
    return members, tuple(coordinates)


def _noises(noise: Noise | Sequence[Noise | None] | None, count: int) -> list[Noise]:
    given = [noise] * count if noise is None or isinstance(noise, Noise) else list(noise)
    if len(given) != count:
        raise InputError(f"give one noise model for all curves or one for each of {count}; got {len(given)}")
    for entry in given:
        if not isinstance(entry, Noise | None):
            raise InputError(f"noise must be a Noise or None; got {entry!r}")
    return [Noise() if entry is None else entry for entry in given]


def _check_tests(tests: Sequence[tuple[Scene, Curve]]) -> None:
    if not tests:
        raise InputError("no curve given: pass at least one (scene, curve)")
    seen: dict[tuple[object, ...], int] = {}
    for number, (scene, curve) in enumerate(tests):
        if not isinstance(scene, Scene) or not isinstance(curve, Curve):
            raise InputError(f"test {number} must be a (Scene, Curve); got {(scene, curve)!r:.100}")
        check_fittable(curve)
        source = curve.metadata.get("sha256") or curve.metadata.get("path")
        keys: list[tuple[object, ...]] = [("data", curve.depth.tobytes(), curve.force.tobytes())]
        if source is not None:
            keys.append(("file", source, curve.metadata.get("test")))
        for key in keys:
            if key in seen:
                what = (
                    f"the same file ({curve.metadata.get('path', source)})"
                    if key[0] == "file"
                    else "the same data"
                )
                raise CurveError(
                    f"curves {seen[key]} and {number} are {what}: a curve counted twice makes intervals too "
                    "narrow; pass it once"
                )
            seen[key] = number


def _requests(
    free: Mapping[str, Given], shared: tuple[str, ...], count: int
) -> list[tuple[str, str, Given, list[int]]]:
    """(name, path, prior, curves) of every free parameter."""
    for path in shared:
        if path not in free:
            raise ParameterError(f"{path!r} is shared but not free; free are {', '.join(free) or 'none'}")
    single: dict[str, dict[int, Given]] = {}
    for key, given in free.items():
        numbered = _NUMBERED.match(key)
        if numbered:
            number = int(numbered["number"])
            if number >= count:
                raise ParameterError(f"{key!r}: there are {count} curves, numbered from 0")
            if numbered["path"] in shared:
                raise ParameterError(
                    f"{numbered['path']!r} is shared by all curves; {key!r} cannot be its own"
                )
            single.setdefault(numbered["path"], {})[number] = given
    requests: list[tuple[str, str, Given, list[int]]] = []
    for path in dict.fromkeys(_NUMBERED.sub(r"\g<path>", key) for key in free):
        if path in shared or (count == 1 and path in free):
            requests.append((path, path, free[path], list(range(count))))
            continue
        for number in range(count):
            own = single.get(path, {})
            if number in own or path in free:
                given = own.get(number, free.get(path))
                requests.append((f"{path}[{number}]", path, given, [number]))
    return requests


def _common_start(
    name: str, path: str, own: Sequence[tuple[Scene, Curve]], noises: Sequence[Noise], given: Given
) -> float:
    if path in NOISE_PATHS:
        field = path.partition(".")[2]
        prior = given if isinstance(given, Prior) else None
        bounds = given if isinstance(given, tuple) else None
        return noise_start(field, noises[0], [curve for _, curve in own], prior, bounds)
    starts = [scene.parameters[path] for scene, _ in own]
    if not np.allclose(starts, starts[0], rtol=1e-9, atol=0.0):
        raise InputError(
            f"{name} is shared but its scenes start it at different values "
            f"({', '.join(f'{value:.6g}' for value in starts)}): give them one"
        )
    return starts[0]


def _spans(curves: Sequence[Curve]) -> Spans:
    return Spans(
        depth=max(float(np.ptp(curve.depth)) for curve in curves),
        force=max(float(np.ptp(curve.force)) for curve in curves),
    )


def _member(
    scene: Scene,
    curve: Curve,
    noise: Noise,
    entries: Mapping[str, int],
    options: LawOptions,
    store: LawStore,
) -> Member:
    mechanical = {path: index for path, index in entries.items() if path not in NOISE_PATHS}
    noisy = {path.partition(".")[2]: index for path, index in entries.items() if path in NOISE_PATHS}
    if "instrument.contact_depth" not in mechanical:
        check_fittable(curve, scene.instrument.contact_depth)
    unknown = noise.force is None and "force" not in noisy
    if unknown and (noise.relative or noise.depth or {"relative", "depth"} & noisy.keys()):
        raise InputError(
            "noise.force is unknown beside relative or depth noise: give its value (N), or free it "
            "(free={'noise.force': None, ...})"
        )
    forward = Forward.compile(scene, curve.depth, tuple(mechanical), options, store)
    member = Member(scene, curve, forward, noise, scene.parameters, mechanical, noisy)
    _check_noise_everywhere(member)
    return member


def _check_noise_everywhere(member: Member) -> None:
    noise = member.noise
    if noise.force == 0.0 and "force" not in member.noise_entries:
        raise InputError(
            "noise.force is zero: points before contact, where relative and depth noise vanish, would count "
            "as exact; give the white noise of the force reading (N)"
        )
    if noise.correlation_time or "correlation_time" in member.noise_entries:
        noise.whiten(np.zeros(len(member.force)), member.curve.time)
