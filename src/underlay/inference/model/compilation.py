"""Check an inverse problem and compile it: every mistake is found here, before anything is computed.

Two things are found on the way: a free parameter that cannot act on the curve (`require_acting`), and a cantilever
softer than the sample, whose noise is in depth and force alike (`lever_seen`, `against_travel`).
"""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from underlay._arrays import FloatArray
from underlay.data.curve import Curve, check_fittable
from underlay.errors import CurveError, InputError, ParameterError
from underlay.inference.model.coordinates import Coordinate, Spans, make_coordinate
from underlay.inference.model.forward import Forward
from underlay.inference.model.laws import LawStore, quiet_law
from underlay.inference.model.members import Member, means_alone, noise_start, scatter
from underlay.inference.model.on_law import begun, require_thickness_prior, usual_prior
from underlay.inference.priors import Given, Prior
from underlay.mechanics.discrepancy import require_measured
from underlay.mechanics.response import WholeHistory, checked_times
from underlay.mechanics.solver import Solver
from underlay.quantities import Quantity, curve_of, field_quantities, path_of
from underlay.scene.instrument import SPRING_CONSTANT_RATIO, ContactDepth, Frame
from underlay.scene.noise import Noise, NoiseModel
from underlay.scene.parameters import unknown_parameter
from underlay.scene.scene import Scene
from underlay.units import format_quantity

# Correlations of second differences below which depth and force share their noise, and where the file states its
# constant too: independent noises of 100 readings reach neither in 10^9 curves.
_SHARED_NOISE, _CONFIRMED = -0.97, -0.9
_NOTHING = 1e-12  # share of a column's span that is no change
_FEWEST_READINGS = 30  # readings from which a record can tell its lever
_ROUNDED = 0.1  # share of second differences that are exactly zero, from which digits decide and not noise
_ALIKE = 1.6  # ratio by which the constants of the record's halves may differ
#: Entry of a curve's metadata: its depth is the travel, and its lever a compliance in series.
IN_SERIES = "lever_in_series"
# Relative difference within which the constant seen is that of the file: noise of a hundred readings makes it off
# by 6 %; files state it to two or three digits.
_LIKE_THE_FILE = 0.12
# Share of the readings, the shallowest, whose force is that of a free lever.
_BEFORE = 0.05


def require_acting(
    path: str, scene: Scene, free: Collection[str], solver: Solver, noise: Collection[str]
) -> None:
    """Refuse a parameter that the scene does not have, or that cannot change the curve.

    Parameters
    ----------
    path : str
        The parameter.
    scene : Scene
        The test.
    free : collection of str
        Paths of all free parameters, `path` included.
    solver : Solver
        Solver of the contact laws.
    noise : collection of str
        Paths of the numbers of its noise model.

    Raises
    ------
    ParameterError
        With what to do instead.
    """
    known = scene.parameters
    part = path.partition(".")[0]
    numberless = not any(name.startswith("substrate.") for name in known)
    if part == "substrate" and scene.substrate is not None and numberless:
        raise ParameterError(
            f"{path} cannot act: the substrate is rigid; give it a material (E and nu) to fit its constants"
        )
    if part == "substrate" and scene.substrate is None:
        raise ParameterError(f"{path} cannot act: the scene has no substrate")
    if path not in known and path not in noise:
        raise unknown_parameter(path, (*known, *noise))
    if path == "lever.spring_constant":
        raise ParameterError(
            f"{path} cannot act: it is the one that made the curve; free {SPRING_CONSTANT_RATIO} with a prior such "
            'as { prior = "lognormal", median = 1.0, sigma = 0.1 } for one that is known to 10 %'
        )
    if part != "substrate" and path != "layer.thickness":
        return
    if not np.isfinite(scene.layer.thickness):
        raise ParameterError(
            f"{path} cannot act: the layer is a half-space (infinite thickness); give it a thickness and a "
            "substrate, or leave the parameter out"
        )
    if not solver.sees_base:
        raise ParameterError(
            f"{path} cannot act: laws by {solver.name} depend on what the indenter touches alone; use another "
            "solver or leave it out"
        )
    if path == "layer.thickness" and scene.substrate == scene.layer.material:
        materials = [p for p in free if p.startswith(("layer.", "substrate.")) and p != path]
        if not materials:
            raise ParameterError(
                "layer.thickness cannot act: layer and substrate are the same material, and no constant of "
                "either is free"
            )


def lever_seen(depth: FloatArray, force: FloatArray, stated: float | None = None) -> float | None:
    """Spring constant (N/m) of a cantilever whose noise depth and force share; None where they do not.

    Depth is the scanner's travel z less the deflection, w = z - F/k, with F the force and k the spring constant.
    The detector's noise is then in both with opposite signs: their second differences correlate at -1, and the
    ratio of their sizes is k.

    Parameters
    ----------
    depth, force : FloatArray
        Readings in order of time (m, N), (n,).
    stated : float, optional
        The constant that the curve's file states (N/m): where the noise confirms it, a weaker correlation will do.

    Returns
    -------
    float or None
        The ratio of the second differences' sizes, where they correlate in the whole record and in each of its
        halves, with constants that agree.
    """
    if len(depth) < _FEWEST_READINGS:
        return None
    rows = np.diff(np.vstack((depth, force)), 2, axis=1)
    spans = np.ptp(np.vstack((depth, force)), axis=1)[:, None]
    if (np.abs(rows) <= _NOTHING * spans).mean(axis=1).max() > _ROUNDED:
        return None
    half = rows.shape[1] // 2
    limit = _SHARED_NOISE if stated is None else _CONFIRMED
    found = [
        k for part in (rows, rows[:, :half], rows[:, half:]) if (k := _constant(part, limit)) is not None
    ]
    if len(found) < 3 or max(found) > _ALIKE * min(found):
        return None
    if stated is not None and abs(found[0] / stated - 1.0) < _LIKE_THE_FILE:
        return stated
    return found[0] if _constant(rows, _SHARED_NOISE) is not None else None


def _constant(rows: FloatArray, limit: float) -> float | None:
    """Spring constant (N/m) from the second differences of depth (m) and force (N), (2, n).

    None unless they correlate below `limit`. Noise of the scanner is in the depth alone, and does not enter the
    ratio.
    """
    (xx, xy), (_, yy) = rows @ rows.T
    if not (xx > 0.0 and yy > 0.0) or xy / (xx * yy) ** 0.5 > limit:
        return None
    return float(-yy / xy)


def against_travel(scene: Scene, curve: Curve, free: Collection[str]) -> tuple[Scene, Curve]:
    """Return scene and curve with the depth replaced by the travel and the cantilever as a compliance in series.

    This is done where the noise shows that depth and force share it; otherwise both come back unchanged. Against
    the travel z = w + F/k, with w the depth, F the force and k the spring constant, the noise of the detector is in
    the force alone and white again. Fitted against the depth it is an error in the variable, which no weight of the
    force's residuals corrects (Fuller 1987, doi:10.1002/9780470316665).

    The travel is counted so that depth readings before contact stay as they are: the contact depth keeps its
    meaning. A scene with a cantilever or a frame compliance of its own is left as it is.
    """
    if scene.lever is not None or scene.instrument.compliance != 0.0 or Frame.path in free:
        return scene, curve
    stated = curve.metadata.get("spring_constant")
    stiffness = lever_seen(curve.depth, curve.force, stated if isinstance(stated, float) else None)
    if stiffness is None:
        return scene, curve
    count = max(int(_BEFORE * len(curve)), 1)
    at_rest = float(np.median(curve.force[np.argpartition(curve.depth, count)[:count]]))
    travel = curve.depth + (curve.force - at_rest) / stiffness
    note = (
        f"fitted against the piezo position, with the cantilever of {format_quantity(stiffness, 'stiffness')} in "
        "series: noise of its deflection is in indentation and force alike"
    )
    instrument = replace(scene.instrument, compliance=1.0 / stiffness)
    notes = (*curve.metadata.get("notes", ()), note)
    seen = {"spring_constant": stiffness, IN_SERIES: True, "bending_taken_off": False, "notes": notes}
    return replace(scene, instrument=instrument), replace(curve, depth=travel).with_metadata(**seen)


def compile_members(
    tests: Sequence[tuple[Scene, Curve]],
    free: Mapping[str, Given],
    shared: tuple[str, ...],
    noise: NoiseModel | Sequence[NoiseModel | None] | None,
    solver: Solver,
    store: LawStore,
) -> tuple[tuple[Member, ...], tuple[Coordinate, ...]]:
    """Check a problem and compile each curve with its scene; see `Problem` for what is refused.

    Parameters
    ----------
    tests : sequence of (Scene, Curve)
        The curves and their scenes.
    free : mapping of str to Prior, (low, high) or None
        Free parameters, with what is known of them.
    shared : tuple of str
        Paths of parameters with one value for all curves.
    noise : NoiseModel, a sequence of them, or None
        Noise of all curves, or one for each; None where it is unknown.
    solver : Solver
        Solver of the contact laws.
    store : LawStore
        Where laws are kept.

    Returns
    -------
    tuple of Member, tuple of Coordinate
        The compiled curves, and the free parameters with their scaling.
    """
    stated = _noises(noise, len(tests))
    _check_tests(tests)
    noises = [_noise_of(entry, curve) for entry, (_, curve) in zip(stated, tests, strict=True)]
    if noise is None:
        tests = [against_travel(scene, curve, free) for scene, curve in tests]
    requests = _requests(free, shared, len(tests))
    if not requests:
        raise ParameterError("nothing is free: name at least one parameter, for example 'layer.E'")
    stiffens = any(scene.layer.stiffening is not None for scene, _ in tests)
    if stiffens:
        require_thickness_prior(free)
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
            _require_unstated(request.path, scene)
        known = of_noise.get(request.path) or own[0][0].quantities[request.path]
        given, start = request.given, _common_start(request, own, first, of_noise)
        if stiffens:
            given = usual_prior(request.path, given, own[0][0])
            start = begun(request.path, start, given)
        widest = Spans(
            depth=max(spans[i].depth for i in request.curves),
            force=max(spans[i].force for i in request.curves),
        )
        coordinates.append(make_coordinate(request.name, request.path, known, start, given, widest))
        for i in request.curves:
            entries[i][request.path] = index
    for (scene, curve), own_entries in zip(tests, entries, strict=True):
        contact = own_entries.get(ContactDepth.path)
        _require_contact(scene, curve, None if contact is None else coordinates[contact])
    members = tuple(
        _member(scene, curve, noises[i], of_noises[i], entries[i], solver, store)
        for i, (scene, curve) in enumerate(tests)
    )
    points = sum(len(curve) for _, curve in tests)
    exact = points == len(coordinates) and not any(member.scale_is_unknown for member in members)
    if points <= len(coordinates) and not exact:
        raise InputError(
            f"{len(coordinates)} parameters are free but there are only {points} points: free fewer"
        )
    return members, tuple(coordinates)


def _quantities_of(noise: NoiseModel) -> dict[str, Quantity]:
    """Description (unit, bounds, scale) of each number of a noise model, by path."""
    return {f"noise.{name}": known for name, known in field_quantities(noise).items()}


def _noises(noise: NoiseModel | Sequence[NoiseModel | None] | None, count: int) -> list[NoiseModel | None]:
    given = list(noise) if isinstance(noise, Sequence) else [noise] * count
    if len(given) != count:
        raise InputError(f"give one noise model for all curves or one for each of {count}; got {len(given)}")
    for entry in given:
        if not isinstance(entry, NoiseModel | None):
            raise InputError(f"noise must be a Noise, another NoiseModel or None; got {entry!r}")
    return given


def _noise_of(given: NoiseModel | None, curve: Curve) -> NoiseModel:
    """The given noise model; else one of unknown size, or of known size for a curve of one or two mean values."""
    return given or Noise(scatter(curve) if means_alone(curve) else None)


def _require_contact(scene: Scene, curve: Curve, contact: Coordinate | None) -> None:
    """Refuse bounds of the contact depth beyond the deepest reading; a tip that adheres is in contact before it."""
    first, last = float(curve.depth.min()), float(curve.depth.max())
    if contact is None or scene.adheres or contact.low < last:
        return
    low, high, first_word, last_word = (
        format_quantity(end, "length") for end in (contact.low, contact.high, first, last)
    )
    raise InputError(
        f"no reading lies beyond contact: {contact.name} is sought from {low} to {high}, and the readings are "
        f"from {first_word} to {last_word}; widen its bounds, or check the unit of the depth"
    )


def _require_unstated(path: str, scene: Scene) -> None:
    """Refuse a parameter that is fitted although its value is given with an uncertainty."""
    if isinstance(scene.uncertainties, Mapping) and path in scene.uncertainties:
        raise InputError(
            f"{path} is free and has an uncertainty: state it as a prior of the fit (Normal) or leave it out of fit"
        )


def _check_tests(tests: Sequence[tuple[Scene, Curve]]) -> None:
    if not tests:
        raise InputError("no curve given: pass at least one (scene, curve)")
    seen: dict[tuple[object, ...], int] = {}
    for number, (scene, curve) in enumerate(tests):
        _require(scene, Scene, number)
        _require(curve, Curve, number)
        check_fittable(curve, withdrawn=scene.adheres)
        if scene.finite_strain and scene.layer.stiffening is None:
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
    """Keys that no two curves of a problem may share (their data, their file), each with a name for messages."""
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
    """One free parameter: its name, its path, its prior or bounds as given, and the curves it acts on."""

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
    """Priors or bounds given for single curves, with keys such as ``"layer.E[1]"``, by path and curve number."""
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
    if request.path == ContactDepth.path and request.given is None:
        first = min(float(curve.depth.min()) for _, curve in own)
        last = max(float(curve.depth.max()) for _, curve in own)
        # A start beside the readings is no start; coordinates count from it in ranges of the depth.
        return starts[0] if first <= starts[0] <= last else 0.5 * (first + last)
    return starts[0]


def _spans(curve: Curve) -> Spans:
    # numpy.ptp takes twice as long.
    depth, force = curve.depth, curve.force
    if len(curve) == 1:  # the mean of one hold: as far as it is from nothing
        return Spans(depth=abs(float(depth[0])), force=abs(float(force[0])))
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
        begins = quiet_law(scene, solver, 0.0).domain[0] if scene.adheres else 0.0
        check_fittable(curve, scene.instrument.contact_depth + begins, withdrawn=scene.adheres)
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
    times = checked_times(curve.time, curve.depth)
    scene.memory.require_told(tuple(free), times)
    if isinstance(scene.memory, WholeHistory):
        scene.memory.require_record(curve.depth - scene.instrument.contact_depth, curve.force, times)
    if Frame.path in free:
        raise ParameterError(
            f"{Frame.path} cannot be fitted beside a history or a relaxation: take the frame's share out of "
            "the depth first"
        )
