"""What all curves of a map have in common: said once, checked before any work, sent once to every worker."""

from __future__ import annotations

import hashlib
import os
from collections.abc import Iterable, Mapping
from dataclasses import dataclass

import numpy as np

from underlay._arrays import FloatArray
from underlay.data.curve import Curve
from underlay.errors import InputError
from underlay.inference.batch.options import MapOptions, Sampling
from underlay.inference.from_files import free_of
from underlay.inference.priors.prior import Prior
from underlay.inference.problem import Given, Problem
from underlay.mechanics.solver import Solver
from underlay.mechanics.solvers import Auto, as_solver
from underlay.scene.noise_model import NoiseModel
from underlay.scene.scene import Scene
from underlay.scene.scene_file import SceneFile, read_scene_file

__all__ = ["BatchModel", "batch_model", "scene_file_of"]


@dataclass(frozen=True)
class BatchModel:
    """The common part of a map.

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
        Says how a curve file is read and which part of it is used; None reads the loading part.
    quality : bool
        Whether each curve is judged by `check_quality` before it is fitted.
    sampling : Sampling or None
        Whether the posterior is sampled after the fit.
    intervals : bool
        Whether the fit states its intervals and its verdict.
    """

    scene: Scene
    free: Mapping[str, Given]
    noise: NoiseModel | None
    solver: Solver
    file: SceneFile | None = None
    quality: bool = False
    sampling: Sampling | None = None
    intervals: bool = False

    def problem(self, scene: Scene, curve: Curve) -> Problem:
        """Build the problem of one curve."""
        return Problem(scene, curve, self.free, self.noise, solver=self.solver)

    @property
    def template(self) -> Problem:
        """The problem of a made-up curve: what is wrong with the model is wrong here already.

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
        """Refuse starts of free parameters, (where, values by path), that are outside their bounds."""
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
        """SHA-256 of everything that decides the numbers of the table, by what it is."""
        file = self.file
        return {
            "scene": _hash(self.scene, sorted(self.scene.parameters.items())),
            "fit": _hash(sorted(self.free.items())),
            "noise": _hash(self.noise),
            "solver": _hash(self.solver),
            "curve section": _hash(None if file is None else (sorted(file.curve.items()), file.left_out)),
            "sampling": _hash(self.sampling, self.quality, *([self.intervals] if self.intervals else [])),
        }


def _clock(scene: Scene, ramp: FloatArray) -> FloatArray:
    """Times (s) that rise with `ramp`, of a record that tells every relaxation time of the scene."""
    told = [value for path, value in scene.parameters.items() if ".times[" in path]
    if not told:
        return ramp
    # Most steps are half of the shortest time, and the last ones make the record longer than the longest.
    steps = np.full(len(ramp) - 1, 0.5 * min(told))
    steps[3 * len(steps) // 4 :] = max(told)
    return np.concatenate(([0.0], np.cumsum(steps)))


def batch_model(
    scene: Scene | SceneFile | str | os.PathLike[str],
    free: Mapping[str, Given] | Iterable[str] | None,
    options: MapOptions,
) -> BatchModel:
    """Join what a scene file says and what the caller says, who has the last word, and check it.

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
            "nothing is free: pass free={'layer.E': (1e4, 1e8), ...}, or a scene file with [fit]"
        )
    paths = dict(free) if isinstance(free, Mapping) else dict.fromkeys(free)
    wanted = Auto() if solver is None else as_solver(solver)
    model = BatchModel(
        scene, paths, noise, wanted, file, options.quality, options.how_sampled, options.intervals
    )
    template = model.template
    if model.sampling is not None:
        _require_proper(template.priors)
    return model


def scene_file_of(scene: Scene | SceneFile | str | os.PathLike[str]) -> SceneFile | None:
    """The scene file of a map, read if it is a path; None where a `Scene` was given."""
    if isinstance(scene, str | os.PathLike):
        return read_scene_file(scene)
    return scene if isinstance(scene, SceneFile) else None


def _require_proper(priors: Mapping[str, Prior]) -> None:
    improper = [name for name, prior in priors.items() if not prior.proper]
    if improper:
        raise InputError(
            f"the prior of {', '.join(improper)} is improper and cannot be sampled: give finite bounds or a "
            "prior such as LogUniform(low, high) or Normal(mean, sd)"
        )


def _hash(*parts: object) -> str:
    # The reprs of frozen dataclasses and floats say every bit; arrays are cut short by repr, so they are
    # written out.
    with np.printoptions(threshold=10**9, floatmode="unique"):
        return hashlib.sha256("\n".join(map(repr, parts)).encode()).hexdigest()
