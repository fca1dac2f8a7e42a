"""Check an inverse problem and compile it: every mistake is found here, before anything is computed."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from underlay.data.curve import Curve, check_fittable
from underlay.errors import CurveError, InputError, ParameterError
from underlay.inference.model.acting import require_acting
from underlay.inference.model.coordinates import Coordinate, Spans, make_coordinate
from underlay.inference.model.forward import Forward
from underlay.inference.model.laws import LawStore, quiet_law
from underlay.inference.model.members import Member
from underlay.inference.model.noise_start import noise_start
from underlay.inference.model.soft_lever import against_travel
from underlay.inference.priors.prior import Given, Prior
from underlay.mechanics.finite_strain import require_measured
from underlay.mechanics.response import checked_times
from underlay.mechanics.solver import Solver
from underlay.quantities import Quantity, curve_of, field_quantities, path_of
from underlay.scene.chain import ContactDepth, Frame
from underlay.scene.noise import Noise
from underlay.scene.noise_model import NoiseModel
from underlay.scene.scene import Scene

__all__ = ["compile_members"]


def compile_members(
    tests: Sequence[tuple[Scene, Curve]],
    free: Mapping[str, Given],
    shared: tuple[str, ...],
    noise: NoiseModel | Sequence[NoiseModel | None] | None,
    solver: Solver,
    store: LawStore,
) -> tuple[tuple[Member, ...], tuple[Coordinate, ...]]:
    """Check a problem and compile it; see `Problem` for what is refused."""
    noises = _noises(noise, len(tests))
    _check_tests(tests)
    if noise is None:
        tests = [against_travel(scene, curve, free) for scene, curve in tests]
    requests = _requests(free, shared, len(tests))
    if not requests:
        raise ParameterError("nothing is free: name at least one parameter, for example 'layer.E'")
    coordinates = []
    entries: list[dict[str, int]] = [{} for _ in tests]
    paths = [request.path for request in requests]
    spans = [_spans(curve) for _, curve in tests]
    of_noises = [_quantities_of(noise) for noise in noises]
    for index, request in enumerate(requests):
        own = [tests[i] for i in request.curves]
        first = noises[request.curves[0]]
        of_noise = of_noises[request.curves[0]]
        for scene, _ in own:
            require_acting(request.path, scene, paths, solver, of_noise)
        known = of_noise.get(request.path) or own[0][0].quantities[request.path]
        start = _common_start(request, own, first, of_noise)
        widest = Spans(
            depth=max(spans[i].depth for i in request.curves),
            force=max(spans[i].force for i in request.curves),
        )
        coordinates.append(make_coordinate(request.name, request.path, known, start, request.given, widest))
        for i in request.curves:
            entries[i][request.path] = index
    members = tuple(
        _member(scene, curve, noises[i], of_noises[i], entries[i], solver, store)
        for i, (scene, curve) in enumerate(tests)
    )
    points = sum(len(curve) for _, curve in tests)
    if points <= len(coordinates):
        raise InputError(
            f"{len(coordinates)} parameters are free but there are only {points} points: free fewer"
        )
    return members, tuple(coordinates)


def _quantities_of(noise: NoiseModel) -> dict[str, Quantity]:
    """What the numbers of a noise model are, by path."""
    return {f"noise.{name}": known for name, known in field_quantities(noise).items()}


def _noises(noise: NoiseModel | Sequence[NoiseModel | None] | None, count: int) -> list[NoiseModel]:
    given = list(noise) if isinstance(noise, Sequence) else [noise] * count
    if len(given) != count:
        raise InputError(f"give one noise model for all curves or one for each of {count}; got {len(given)}")
    for entry in given:
        if not isinstance(entry, NoiseModel | None):
            raise InputError(f"noise must be a Noise, another NoiseModel or None; got {entry!r}")
    return [Noise() if entry is None else entry for entry in given]


def _check_tests(tests: Sequence[tuple[Scene, Curve]]) -> None:
    if not tests:
        raise InputError("no curve given: pass at least one (scene, curve)")
    seen: dict[tuple[object, ...], int] = {}
    for number, (scene, curve) in enumerate(tests):
        _require(scene, Scene, number)
        _require(curve, Curve, number)
        check_fittable(curve, withdrawn=scene.adhesion is not None)
        if scene.finite_strain:
            require_measured(scene.contact, float(curve.depth.max()) - scene.instrument.contact_depth)
        for key, what in _identities(curve) if len(tests) > 1 else ():
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
    for path in dict.fromkeys(path_of(key) for key in free):
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
        path, number = path_of(key), curve_of(key)
        if number is None:
            continue
        if number >= count:
            raise ParameterError(f"{key!r}: there are {count} curves, numbered from 0")
        if path in shared:
            raise ParameterError(f"{path!r} is shared by all curves; {key!r} cannot be its own")
        single.setdefault(path, {})[number] = given
    return single


def _common_start(
    request: _Request, own: Sequence[tuple[Scene, Curve]], noise: NoiseModel, of_noise: Mapping[str, Quantity]
) -> float:
    if request.path in of_noise:
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
    # numpy.ptp takes twice as long.
    depth, force = curve.depth, curve.force
    return Spans(depth=float(depth.max() - depth.min()), force=float(force.max() - force.min()))


def _member(
    scene: Scene,
    curve: Curve,
    noise: NoiseModel,
    of_noise: Mapping[str, Quantity],
    entries: Mapping[str, int],
    solver: Solver,
    store: LawStore,
) -> Member:
    mechanical = {path: index for path, index in entries.items() if path not in of_noise}
    noisy = {path.partition(".")[2]: index for path, index in entries.items() if path in of_noise}
    _check_history(scene, curve, mechanical)
    if ContactDepth.path not in mechanical:
        # A tip that sticks is in contact down to the pull-off, which the scene's own numbers place.
        begins = 0.0 if scene.adhesion is None else quiet_law(scene, solver, 0.0).domain[0]
        check_fittable(curve, scene.instrument.contact_depth + begins, withdrawn=scene.adhesion is not None)
    noise.check(noisy, len(curve), curve.time)
    forward = Forward.compile(scene, curve.depth, tuple(mechanical), solver, store, curve.time, curve.force)
    return Member(scene, curve, forward, noise, scene.parameters, mechanical, noisy)


def _check_history(scene: Scene, curve: Curve, free: Mapping[str, int]) -> None:
    if scene.memory is None:
        return
    if curve.time is None:
        raise CurveError("this scene remembers: give the curve the times of its points (s)")
    if scene.ages:
        raise InputError(
            "a layer that relaxes on an elastic base is simulated but not fitted: its force is not one elastic "
            "force seen through a memory; take a rigid base, or one 1000 times stiffer"
        )
    scene.memory.require_told(tuple(free), checked_times(curve.time, curve.depth))
    if Frame.path in free:
        raise ParameterError(
            f"{Frame.path} cannot be fitted beside a history or a relaxation: take the frame's share out of "
            "the depth first"
        )
