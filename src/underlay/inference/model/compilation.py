"""Check an inverse problem and compile it: every mistake is found here, before anything is computed."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from underlay.data.curve import Curve, check_fittable
from underlay.data.noise import Noise
from underlay.errors import CurveError, InputError, ParameterError
from underlay.inference.model.acting import NOISE_PATHS, require_acting
from underlay.inference.model.coordinates import Coordinate, Spans, make_coordinate
from underlay.inference.model.forward import Forward
from underlay.inference.model.laws import LawStore
from underlay.inference.model.members import Member
from underlay.inference.model.noise_start import noise_start
from underlay.inference.priors import Prior
from underlay.mechanics.solver import Solver
from underlay.scene.scene import Scene

if TYPE_CHECKING:
    from underlay.inference.problem import Given

__all__ = ["compile_members"]

_NUMBERED = re.compile(r"^(?P<path>.+)\[(?P<number>\d+)\]$")


def compile_members(
    tests: Sequence[tuple[Scene, Curve]],
    free: Mapping[str, Given],
    shared: tuple[str, ...],
    noise: Noise | Sequence[Noise | None] | None,
    solver: Solver,
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
    paths = [request.path for request in requests]
    spans = [_spans(curve) for _, curve in tests]
    for index, request in enumerate(requests):
        own = [tests[i] for i in request.curves]
        for scene, _ in own:
            require_acting(request.path, scene, paths, solver)
        start = _common_start(request, own, noises[request.curves[0]])
        widest = Spans(
            depth=max(spans[i].depth for i in request.curves),
            force=max(spans[i].force for i in request.curves),
        )
        coordinates.append(make_coordinate(request.name, request.path, start, request.given, widest))
        for i in request.curves:
            entries[i][request.path] = index
    members = tuple(
        _member(scene, curve, noises[i], entries[i], solver, store) for i, (scene, curve) in enumerate(tests)
    )
    points = sum(len(curve) for _, curve in tests)
    if points <= len(coordinates):
        raise InputError(
            f"{len(coordinates)} parameters are free but there are only {points} points: free fewer"
        )
    return members, tuple(coordinates)


def _noises(noise: Noise | Sequence[Noise | None] | None, count: int) -> list[Noise]:
    given = list(noise) if isinstance(noise, Sequence) else [noise] * count
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
        _require(scene, Scene, number)
        _require(curve, Curve, number)
        check_fittable(curve)
        for key, what in _identities(curve):
            if key in seen:
                raise CurveError(
                    f"curves {seen[key]} and {number} are {what}: a curve counted twice makes intervals too "
                    "narrow; pass it once"
                )
            seen[key] = number


def _require(part: object, kind: type, number: int) -> None:
    if not isinstance(part, kind):
        raise InputError(
            f"test {number} must be a pair (Scene, Curve); got {part!r:.100} for the {kind.__name__}"
        )


def _identities(curve: Curve) -> list[tuple[tuple[object, ...], str]]:
    """What no two curves of a problem may have in common, with its name."""
    identities: list[tuple[tuple[object, ...], str]] = [
        (("data", curve.depth.tobytes(), curve.force.tobytes()), "the same data")
    ]
    path = curve.metadata.get("path")
    source = curve.metadata.get("sha256") or path
    if source is not None:
        # One file may hold several tests; those are different curves.
        key = ("file", source, curve.metadata.get("member"), curve.metadata.get("test"))
        identities.append((key, f"the same file ({path or source})"))
    return identities


@dataclass(frozen=True)
class _Request:
    """One free parameter: its name, path, what is said of it, and the curves it acts on."""

    name: str
    path: str
    given: Given
    curves: list[int]


def _requests(free: Mapping[str, Given], shared: tuple[str, ...], count: int) -> list[_Request]:
    for path in shared:
        if path not in free:
            raise ParameterError(f"{path!r} is shared but not free; free are {', '.join(free) or 'none'}")
    single = _numbered(free, shared, count)
    requests: list[_Request] = []
    for path in dict.fromkeys(_NUMBERED.sub(r"\g<path>", key) for key in free):
        if path in shared or (count == 1 and path in free):
            requests.append(_Request(path, path, free[path], list(range(count))))
            continue
        for number in range(count):
            own = single.get(path, {})
            if number in own or path in free:
                given = own.get(number, free.get(path))
                requests.append(_Request(f"{path}[{number}]", path, given, [number]))
    return requests


def _numbered(free: Mapping[str, Given], shared: tuple[str, ...], count: int) -> dict[str, dict[int, Given]]:
    """What is said of single curves, ``"layer.E[1]"``, by path and number."""
    single: dict[str, dict[int, Given]] = {}
    for key, given in free.items():
        match = _NUMBERED.match(key)
        if match is None:
            continue
        path, number = match["path"], int(match["number"])
        if number >= count:
            raise ParameterError(f"{key!r}: there are {count} curves, numbered from 0")
        if path in shared:
            raise ParameterError(f"{path!r} is shared by all curves; {key!r} cannot be its own")
        single.setdefault(path, {})[number] = given
    return single


def _common_start(request: _Request, own: Sequence[tuple[Scene, Curve]], noise: Noise) -> float:
    if request.path in NOISE_PATHS:
        field, given = request.path.partition(".")[2], request.given
        prior = given if isinstance(given, Prior) else None
        bounds = given if isinstance(given, tuple) else None
        return noise_start(field, noise, [curve for _, curve in own], prior, bounds)
    starts = [scene.parameters[request.path] for scene, _ in own]
    if len(starts) > 1 and not np.allclose(starts, starts[0], rtol=1e-9, atol=0.0):
        raise InputError(
            f"{request.name} is shared but its scenes start it at different values "
            f"({', '.join(f'{value:.6g}' for value in starts)}): give them one"
        )
    return starts[0]


def _spans(curve: Curve) -> Spans:
    return Spans(depth=float(np.ptp(curve.depth)), force=float(np.ptp(curve.force)))


def _member(
    scene: Scene,
    curve: Curve,
    noise: Noise,
    entries: Mapping[str, int],
    solver: Solver,
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
    forward = Forward.compile(scene, curve.depth, tuple(mechanical), solver, store)
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
