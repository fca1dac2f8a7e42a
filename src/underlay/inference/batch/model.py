"""The model that all curves of a map share, checked once and sent to every worker, and the map's options."""

from __future__ import annotations

import hashlib
import math
import os
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import TypeAlias

import numpy as np

from underlay._arrays import FloatArray
from underlay.data.curve import Curve
from underlay.errors import InputError
from underlay.inference.batch.results_table import RESERVED
from underlay.inference.from_files import free_of
from underlay.inference.priors import Given, require_proper
from underlay.inference.problem import Problem
from underlay.mechanics.solver import Solver
from underlay.mechanics.solvers import AnySolver, Auto, as_solver
from underlay.scene.noise import NoiseModel
from underlay.scene.scene import Scene
from underlay.scene.scene_file import SceneFile, read_scene_file

#: A caller's own progress line: called with how many curves are done, and how many there are.
Reporter: TypeAlias = Callable[[int, int], None]
# Default time limit of a fit (s): a fit takes milliseconds, or seconds where it is hard; after ten minutes it will
# not end.
_LONGEST_FIT = 600.0


@dataclass(frozen=True)
class Sampling:
    """How posteriors are sampled; each curve has its own random stream, seeded by the map's seed and its name.

    Parameters
    ----------
    walkers, max_steps : int
        As in `sample`.
    seed : int
        Seed of the whole map.
    """

    walkers: int = 64
    max_steps: int = 20_000
    seed: int = 0


@dataclass(frozen=True)
class MapOptions:
    """Options of `fit_many` besides its curves and its scene; each has a default that suits most maps.

    Parameters
    ----------
    noise : Noise or another NoiseModel, optional
        As in `Problem`; by default what the scene file states.
    solver : Solver or str, optional
        What builds the contact law, as in `Problem`; by default what the scene file states.
    quality : bool, default False
        Check every curve by `check_quality` first. It takes longer than the fit. Without it the verdict is
        ``"good"`` where the fit has no warnings, ``"check"`` where it has, ``"refused"`` where there is no fit.
    sampling : Sampling or bool, default False
        Sample the posterior of every curve; its answers are then those of the posterior.
    answers : bool, default True
        Give every curve the answers and the verdict that `Fit.answer` and `Fit.verdict` state. Without them the
        table holds values and their least-squares standard errors only, in a tenth of the time.
    resume : bool, default False
        Continue the run in the output; rows that were written are not computed again.
    folders : sequence of str, default ()
        Names of the labels that nested folders stand for, outermost first: ``("group", "animal")`` reads
        ``curves/<group>/<animal>/<file>`` and labels the rows so. Without it only the folder's own files are read.
    time_limit : float, optional
        Longest time that a worker process may take over one curve (s); it is then ended, and the curve is a row
        with that reason. By default 600, and no limit where posteriors are sampled. It has no effect in this
        process (``workers=0``) and on a Dask scheduler's workers.
    timeout : float, default 10
        How long a scheduler may take to answer (s).
    progress : bool or callable, optional
        Show curves per second and time left; by default only on a terminal. A function is called with the curves
        done and all curves in place of that.

    Raises
    ------
    InputError
        If a time is not positive, or `solver` is not a solver.
    """

    noise: NoiseModel | None = None
    solver: AnySolver | None = None
    quality: bool = False
    sampling: Sampling | bool = False
    answers: bool = True
    resume: bool = False
    time_limit: float | None = None
    timeout: float = 10.0
    progress: bool | Reporter | None = None
    folders: Sequence[str] = ()

    def __post_init__(self) -> None:
        if isinstance(self.folders, str) or len(set(self.folders)) < len(self.folders):
            raise InputError(
                f"folders must be different names, such as ('group', 'animal'); got {self.folders!r}"
            )
        wrong = [name for name in self.folders if not name or name in RESERVED or "." in name]
        if wrong:
            raise InputError(f"folders cannot stand for {wrong[0]!r}; the table has such a column of its own")
        for name, value in (("time_limit", self.time_limit), ("timeout", self.timeout)):
            if value is not None and not value > 0.0:
                raise InputError(f"{name} must be positive (s); got {value!r}")
        if self.solver is not None:
            as_solver(self.solver)

    @property
    def how_sampled(self) -> Sampling | None:
        """How posteriors are sampled, or None where they are not."""
        return (
            self.sampling if isinstance(self.sampling, Sampling) else (Sampling() if self.sampling else None)
        )

    @property
    def longest(self) -> float | None:
        """Longest time for one curve (s), or None for no limit."""
        default = None if self.sampling else _LONGEST_FIT
        limit = default if self.time_limit is None else self.time_limit
        return None if limit is None or math.isinf(limit) else limit


@dataclass(frozen=True)
class BatchModel:
    """The common part of a map, checked before any work.

    Parameters
    ----------
    scene : Scene
        The test; rows of a manifest replace some of its numbers.
    free : mapping of path to prior
        As in `Problem`.
    noise : Noise or None
        As in `Problem`.
    solver : Solver
        As in `Problem`.
    file : SceneFile or None
        States how a curve file is read and which part of it is used; None reads the loading part.
    quality : bool
        Whether each curve is checked by `check_quality` before it is fitted.
    sampling : Sampling or None
        How the posterior is sampled after the fit; None for no sampling.
    answers : bool
        Whether the rows hold answers and verdicts, and not just values and standard errors.
    """

    scene: Scene
    free: Mapping[str, Given]
    noise: NoiseModel | None
    solver: Solver
    file: SceneFile | None = None
    quality: bool = False
    sampling: Sampling | None = None
    answers: bool = True

    def problem(self, scene: Scene, curve: Curve) -> Problem:
        """Build the problem of one curve."""
        return Problem(scene, curve, self.free, self.noise, solver=self.solver)

    @property
    def template(self) -> Problem:
        """The problem of the scene with a synthetic curve, to detect errors of the model before any work.

        Raises
        ------
        InputError
            As `Problem` does.
        """
        ramp = np.linspace(0.0, 1.0, 256)
        scale = 1e-6
        shift = max(self.scene.instrument.contact_depth, 0.0)
        return self.problem(
            self.scene, Curve(shift + scale * (ramp - 0.1), ramp**1.5, _clock(self.scene, ramp))
        )

    def check_starts(self, starts: Iterable[tuple[str, Mapping[str, float]]]) -> None:
        """Raise InputError for starting values outside the bounds; `starts` are pairs (source, values by path)."""
        coordinates = self.template.coordinates
        for where, values in starts:
            for coordinate in coordinates:
                start = values.get(coordinate.path)
                if start is not None and not coordinate.low <= start <= coordinate.high:
                    raise InputError(
                        f"{where}: {coordinate.path} = {start:.6g} is outside its bounds "
                        f"[{coordinate.low:.6g}, {coordinate.high:.6g}] (SI)"
                    )

    def hashes(self) -> dict[str, str]:
        """SHA-256 of everything that decides the numbers of the table, by name (scene, fit, noise, ...)."""
        file = self.file
        return {
            "scene": _hash(self.scene, sorted(self.scene.parameters.items())),
            "fit": _hash(sorted(self.free.items())),
            "noise": _hash(self.noise),
            "solver": _hash(self.solver),
            "curve section": _hash(None if file is None else (sorted(file.curve.items()), file.left_out)),
            "sampling": _hash(self.sampling, self.quality, self.answers),
        }


def _clock(scene: Scene, ramp: FloatArray) -> FloatArray:
    """Times (s), rising with `ramp` (n,), of a record that resolves all relaxation times of the scene."""
    times = [value for path, value in scene.parameters.items() if ".times[" in path]
    if not times:
        return ramp
    # Most steps are half of the shortest relaxation time, and the last ones make the record longer than the
    # longest.
    steps = np.full(len(ramp) - 1, 0.5 * min(times))
    steps[3 * len(steps) // 4 :] = max(times)
    return np.concatenate(([0.0], np.cumsum(steps)))


def batch_model(
    scene: Scene | SceneFile | str | os.PathLike[str],
    free: Mapping[str, Given] | Iterable[str] | None,
    options: MapOptions,
) -> BatchModel:
    """Combine a scene file with the caller's options, which take precedence, and check the model.

    Parameters
    ----------
    scene : Scene, SceneFile or path of a scene file
        What the curves have in common.
    free : mapping of path to prior, or paths, optional
        Free parameters; None takes those of the scene file.
    options : MapOptions
        Options of the map.

    Raises
    ------
    InputError
        If nothing is free, or as `Problem` does.
    FileAccessError, FileFormatError
        If a scene file cannot be read.
    """
    file = scene_file_of(scene)
    noise, solver = options.noise, options.solver
    if file is not None:
        solver = file.solver if solver is None else solver
        noise = file.noise if noise is None else noise
        free = free_of(file) if free is None else free
        scene = file.draft
    if not isinstance(scene, Scene):
        raise InputError(f"scene must be a Scene or the path of a scene file; got {scene!r:.100}")
    if free is None:
        raise InputError(
            "nothing is free: say which numbers are fitted, within which bounds (free, or [fit] of a scene file)"
        )
    paths = dict(free) if isinstance(free, Mapping) else dict.fromkeys(free)
    wanted = Auto() if solver is None else as_solver(solver)
    model = BatchModel(
        scene, paths, noise, wanted, file, options.quality, options.how_sampled, options.answers
    )
    template = model.template
    if model.sampling is not None:
        require_proper(template.priors)
    return model


def scene_file_of(scene: Scene | SceneFile | str | os.PathLike[str]) -> SceneFile | None:
    """The scene file of a map, read if it is a path; None where a `Scene` was given."""
    if isinstance(scene, str | os.PathLike):
        return read_scene_file(scene)
    return scene if isinstance(scene, SceneFile) else None


def _hash(*parts: object) -> str:
    # The reprs of frozen dataclasses and floats are exact; those of arrays are abbreviated, so arrays are printed
    # in full.
    with np.printoptions(threshold=10**9, floatmode="unique"):
        return hashlib.sha256("\n".join(map(repr, parts)).encode()).hexdigest()
