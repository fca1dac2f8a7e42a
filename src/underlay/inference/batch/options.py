"""What a map may be told beside its curves and its scene: each has a default that suits most maps."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

from underlay.errors import InputError
from underlay.inference.batch.progress import Told
from underlay.inference.batch.results_table import RESERVED
from underlay.mechanics.solvers import AnySolver, as_solver
from underlay.scene.noise_model import NoiseModel

__all__ = ["MapOptions", "Sampling"]

# A fit takes milliseconds, and seconds where it is hard: one of ten minutes does not end (s).
_LONGEST_FIT = 600.0


@dataclass(frozen=True)
class Sampling:
    """How posteriors are sampled; every curve draws from a stream of its own, named by seed and curve.

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
    """What `fit_many` may be told beside its curves and its scene.

    Parameters
    ----------
    noise : Noise or another NoiseModel, optional
        As in `Problem`; by default what the scene file says.
    solver : Solver or str, optional
        What builds the contact law, as in `Problem`; by default what the scene file says.
    quality : bool, default False
        Judge every curve by `check_quality` first. It takes longer than the fit. Without it the verdict is
        ``"good"`` where the fit has no warnings, ``"doubtful"`` where it has, ``"refused"`` where there is
        no fit.
    sampling : Sampling or bool, default False
        Sample the posterior of every curve. The table then holds medians, standard deviations and the ends
        of 95 % intervals.
    intervals : bool, default False
        Give every curve the 95 % intervals and the verdict that `Fit.interval` and `Fit.verdict` state, averaged
        over noise and misfit where no noise is stated. It takes some ten times as long as the fits alone.
    resume : bool, default False
        Continue the run in the output; rows that were written are not computed again.
    folders : sequence of str, default ()
        What the folders stand for in which the curves lie, outermost first: ``("group", "animal")`` reads
        ``curves/<group>/<animal>/<file>`` and labels the rows so. Without it a folder's own files are read.
    time_limit : float, optional
        Longest time that a worker process may take over one curve (s); it is then ended, and the curve is a
        row with that reason. By default 600, and no limit where posteriors are sampled. Neither this process
        (``workers=0``) nor a Dask scheduler's workers can be ended so.
    timeout : float, default 10
        How long a scheduler may take to answer (s).
    progress : bool or callable, optional
        Show curves per second and time left; by default only on a terminal. A function is called with the curves
        done and all curves in place of that.

    Raises
    ------
    InputError
        If a time is not positive, or the solver is none.
    """

    noise: NoiseModel | None = None
    solver: AnySolver | None = None
    quality: bool = False
    sampling: Sampling | bool = False
    intervals: bool = False
    resume: bool = False
    time_limit: float | None = None
    timeout: float = 10.0
    progress: bool | Told | None = None
    folders: Sequence[str] = ()

    def __post_init__(self) -> None:
        if isinstance(self.folders, str) or len(set(self.folders)) < len(self.folders):
            raise InputError(
                f"folders must be different names, such as ('group', 'animal'); got {self.folders!r}"
            )
        taken = [name for name in self.folders if not name or name in RESERVED or "." in name]
        if taken:
            raise InputError(f"folders cannot stand for {taken[0]!r}; the table has such a column of its own")
        for name, value in (("time_limit", self.time_limit), ("timeout", self.timeout)):
            if value is not None and not value > 0.0:
                raise InputError(f"{name} must be positive (s); got {value!r}")
        if self.intervals and self.sampling:
            raise InputError("posteriors have intervals of their own: ask for intervals or for sampling")
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
