"""Motion of a test's tip: ramps at a rate, holds, triangles and steps, and a default depth."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Self

import numpy as np

from underlay._arrays import FloatArray, finite, positive
from underlay.errors import InputError
from underlay.quantities import one_of, quantity, takes
from underlay.scene.scene import Scene

# Of `default_depth`: contact radius over the thickness (a contact as wide as the layer is thick, where the
# substrate affects the force and strains are small); largest depth over the thickness, or over a tip's radius on a
# half-space; depth (m) for a tip without a length, such as a cone.
_WIDE, _SHALLOW, _CONE_DEPTH = 0.5, 0.1, 1e-6


def default_depth(scene: Scene) -> float:
    """Return a depth since contact (m) at which the substrate affects the force and strains are small.

    The contact diameter then equals the layer's thickness, or the contact radius half the tip's largest radius, by
    the half-space's relation of depth and contact radius (Sneddon 1965), but the depth is at most a tenth of the
    thickness; on a half-space it is a tenth of the tip's radius, and 1 um for a tip without any length.

    Examples
    --------
    >>> import underlay as ul
    >>> soft = ul.Isotropic(1e6, 0.45)
    >>> default_depth(ul.Scene(ul.Sphere(1e-3), ul.Layer(soft, 1e-3), ul.RIGID))
    0.0001
    >>> default_depth(ul.Scene(ul.Cone(1.2), ul.Layer(soft)))
    1e-06
    """
    radius = scene.parameters.get("indenter.radius")
    thickness = scene.layer.thickness
    if not np.isfinite(thickness):
        return _CONE_DEPTH if radius is None else _SHALLOW * radius
    wide = min(_WIDE * thickness, _WIDE * scene.indenter.max_radius)
    depth: FloatArray = scene.indenter.abel(np.array([wide]))
    return min(float(depth[0]), _SHALLOW * thickness) or _SHALLOW * thickness


@dataclass(frozen=True)
class Program:
    """A piecewise linear motion: depth readings at its corners, and the times at which they are reached.

    Begin with ``Program()`` or ``Program.at(depth)``, add `ramp` and `hold`, and call `sampled`.

    Parameters
    ----------
    depths : tuple of float
        Depth readings (m) at the corners.
    times : tuple of float
        Their times (s), increasing from 0.

    Examples
    --------
    >>> program = Program().ramp(to=1e-4, rate=1e-5).hold(300.0).ramp(to=0.0, rate=1e-4)
    >>> program.times
    (0.0, 10.0, 310.0, 311.0)
    >>> depth, time = program.sampled(points=4)
    >>> [round(float(t), 2) for t in time]
    [0.0, 103.67, 207.33, 311.0]
    """

    depths: tuple[float, ...] = (0.0,)
    times: tuple[float, ...] = (0.0,)

    @classmethod
    def at(cls, depth: float) -> Self:
        """A program that begins at a depth reading (m)."""
        return cls((finite(depth, "depth", "m"),))

    @classmethod
    def triangle(cls, depth: float, rate: float, *, start: float = 0.0, hold: float = 0.0) -> Self:
        """A ramp from `start` to `depth` (m) at a rate (m/s), a hold (s), and a ramp back."""
        return cls.at(start).ramp(depth, rate).hold(hold).ramp(start, rate)

    @classmethod
    def steps(cls, depths: Sequence[float], rate: float, hold: float, *, start: float = 0.0) -> Self:
        """Ramps to each of `depths` (m) in turn at a rate (m/s), each followed by a hold (s)."""
        program = cls.at(start)
        for depth in depths:
            program = program.ramp(depth, rate).hold(hold)
        return program

    def ramp(self, to: float, rate: float) -> Self:
        """Return the program with a further ramp to a depth reading (m), deeper or shallower, at a rate (m/s)."""
        there = finite(to, "to", "m")
        travel = abs(there - self.depths[-1])
        if not travel:
            raise InputError(f"a ramp needs a depth to go to: the tip is at {there:.6g} m already")
        return self._then(there, travel / positive(rate, "rate", "m/s"))

    def hold(self, duration: float) -> Self:
        """Return the program with a further hold for a time (s); the program itself for zero."""
        seconds = finite(duration, "hold", "s")
        if seconds < 0.0:
            raise InputError(f"a hold lasts zero seconds or longer; got {duration!r}")
        return self if not seconds else self._then(self.depths[-1], seconds)

    def sampled(
        self, points: int | None = None, *, sampling_rate: float | None = None
    ) -> tuple[FloatArray, FloatArray]:
        """Depth readings (m) and times (s) of the motion, (n,) each, equally spaced in time.

        Parameters
        ----------
        points : int, optional
            Number of readings, two or more; the last is the end of the program.
        sampling_rate : float, optional
            Readings per second (Hz), instead of `points`.

        Raises
        ------
        InputError
            If not exactly one of the two is given, or the program does not move.
        """
        end = self.times[-1]
        if not end:
            raise InputError("this program does not last: add a ramp or a hold")
        if points is not None and sampling_rate is None:
            if points < 2:
                raise InputError(f"points must be 2 or more; got {points!r}")
            time = np.linspace(0.0, end, points)
        elif points is not None or sampling_rate is None:
            raise InputError("say how many points, or how many a second: one of them")
        else:
            rate = positive(sampling_rate, "sampling_rate", "Hz")
            # The last point may miss the end by rounding.
            time = np.arange(int(end * rate * (1.0 + 1e-12)) + 1) / rate
        return np.interp(time, self.times, self.depths), time

    def _then(self, depth: float, seconds: float) -> Self:
        return type(self)((*self.depths, depth), (*self.times, self.times[-1] + seconds))


@dataclass(frozen=True)
class SimulatedDepths:
    """Depth readings of a simulated curve, as the [simulate] section of a scene file states them.

    Parameters
    ----------
    max_depth : float
        Deepest reading (m).
    start : float
        First reading (m).
    points : int
        Number of readings.
    duration : float
        Time from the first to the last reading (s); not used where a `rate` is given.
    program : {"ramp", "triangle", "steps"}
        Loading; loading and unloading; or loading in equal steps.
    rate : float, optional
        Speed of every ramp (m/s).
    hold : float
        Duration of a hold after every loading ramp (s).
    steps : int
        Number of steps, for "steps".

    Raises
    ------
    InputError
        If `start` is not below `max_depth`, or the holds leave no time to move.
    """

    max_depth: float
    start: float = field(default=0.0, metadata=quantity("length"))
    points: int = field(default=200, metadata=takes(range(2, 10_000_001)))
    duration: float = field(default=1.0, metadata=quantity("time"))
    program: str = field(default="ramp", metadata=one_of("ramp", "triangle", "steps"))
    rate: float | None = field(default=None, metadata=quantity("speed"))
    hold: float = field(default=0.0, metadata=quantity("time"))
    steps: int = field(default=1, metadata=takes(range(1, 1001)))

    def __post_init__(self) -> None:
        if not self.start < self.max_depth:
            raise InputError("[simulate] start must be below max_depth")
        if self.hold < 0.0:
            raise InputError(f"[simulate] hold must be zero or longer; got {self.hold:.6g} s")
        if self.rate is not None and not self.rate > 0.0:
            raise InputError(f"[simulate] rate must be positive; got {self.rate:.6g} m/s")
        if self.steps != 1 and self.program != "steps":
            raise InputError(f'[simulate] steps belongs to program = "steps", not to {self.program!r}')
        if not self._moving > 0.0:
            raise InputError(
                f"[simulate] duration {self.duration:.6g} s leaves no time to move beside the holds: make it "
                "longer, or say the rate instead"
            )

    @property
    def depth(self) -> FloatArray:
        """The readings (m), (points,)."""
        return self._sampled[0]

    @property
    def time(self) -> FloatArray:
        """The times of the readings (s), (points,)."""
        return self._sampled[1]

    @property
    def is_timed(self) -> bool:
        """Whether the scene file states how fast the tip moves or how long it is held."""
        return self.rate is not None or bool(self.hold) or self.program != "ramp"

    @property
    def _sampled(self) -> tuple[FloatArray, FloatArray]:
        return self.motion.sampled(self.points)

    @property
    def motion(self) -> Program:
        """The motion as a `Program`."""
        travel = self.max_depth - self.start
        rate = self.rate or travel * (2.0 if self.program == "triangle" else 1.0) / self._moving
        if self.program == "triangle":
            return Program.triangle(self.max_depth, rate, start=self.start, hold=self.hold)
        depths = np.linspace(self.start, self.max_depth, self.steps + 1)[1:]
        return Program.steps(depths.tolist(), rate, self.hold, start=self.start)

    @property
    def _moving(self) -> float:
        """Time that the holds leave for the ramps (s)."""
        return self.duration - self.steps * self.hold if self.rate is None else np.inf
