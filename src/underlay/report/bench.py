"""What the forward models and the fits cost: the cases of the README's tables, timed in one process.

The unit of a model is the explicit fourth-order formula (5.9) in plain numpy on the same depths; that of a fit is
lmfit's fit of Hertz's formula to the same points. It is timed in turns with each case and every ratio is the
median over the rounds. Times are processor times: a busy machine makes calls wait, and the longer a call the
more of it is waiting. What is kept for the whole process, tables of exact laws, is there after the first round,
which does not count. To add a case: one line in `CASES`; its `prepare` takes the depths and returns the call that
is timed.
"""

from __future__ import annotations

import platform
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
import pandas as pd

from underlay._arrays import FloatArray
from underlay.mechanics.body import RIGID, Layer, isotropic_constants
from underlay.mechanics.exact.batch import ExactBatch
from underlay.mechanics.indenters import Paraboloid, Sphere
from underlay.mechanics.materials import Isotropic
from underlay.mechanics.solver import Solver
from underlay.mechanics.solvers import Asymptotic, Auto, Exact, HalfSpace
from underlay.report.bench_fits import exact_fit, hertz_fit
from underlay.report.bench_relaxing import CYCLE, RAMP_AND_HOLD, relaxing_fit, relaxing_force
from underlay.report.bench_users import user_markdown
from underlay.scene.accuracy_cost import explicit_formula
from underlay.scene.scene import Scene

__all__ = ["CASES", "BenchCase", "bench_markdown", "bench_table", "depth_table", "fit_table"]

#: A call that is timed.
Call = Callable[[], object]

_GEL = Layer(Isotropic(3e6, 0.5), 1e-3)
_TIP = Paraboloid(1e-3)
_RIGID_BASE = Scene(_TIP, _GEL, RIGID)
_STIFF_BASE_MATERIAL = Isotropic(3e7, 0.3)
_STIFF_BASE = Scene(_TIP, _GEL, _STIFF_BASE_MATERIAL)
_SOFT_BASE = Scene(_TIP, _GEL, Isotropic(3e5, 0.3))
_BALL = Scene(Sphere(4e-3), _GEL, RIGID)
_SMALL_BALL = Sphere(1e-3)  # the fits' paraboloid with its true shape: a/R up to 0.7
# a/h = 2 on the rigid base; a fiftieth of it is a/h = 0.2, where every asymptotic form answers.
_DEEPEST, _SHALLOW = 1.8e-3, 0.02
# The ball is larger: a fifth of the depth gives it a/h = 1.6.
_BALL_SHARE = 0.2
_E_H_CONTACT = ("layer.E", "layer.thickness", "instrument.contact_depth")
_POINTS, _SETS, _ROUNDS = 1000, 256, 41
_COUNTS = (10, 100, 1000, 10_000, 100_000, 1_000_000)


def _formula(depth: FloatArray) -> Call:
    formula = explicit_formula(_RIGID_BASE)
    return lambda: formula(depth)


@dataclass(frozen=True)
class BenchCase:
    """One row of the table.

    Parameters
    ----------
    name : str
        What is computed.
    prepare : callable
        Depths (m, shape (n,)) to the call that is timed.
    sets : int, default 1
        Parameter sets per call: the time is given for one.
    unit : callable
        Depths to the call whose time is the unit; the explicit formula unless said otherwise.
    """

    name: str
    prepare: Callable[[FloatArray], Call]
    sets: int = 1
    unit: Callable[[FloatArray], Call] = _formula

    @property
    def is_fit(self) -> bool:
        """Whether it is a fit, which is measured in fits."""
        return self.unit is not _formula


def _cold(scene: Scene, solver: Solver, share: float = 1.0) -> Callable[[FloatArray], Call]:
    """From the materials to the forces, at `share` of the depths."""

    def prepare(depth: FloatArray) -> Call:
        asked, deepest = share * depth, share * float(depth[-1])
        return lambda: scene.contact_law(deepest, solver=solver).force(asked)

    return prepare


def _held(scene: Scene, solver: Solver, share: float = 1.0) -> Callable[[FloatArray], Call]:
    """Forces from a law that is there already."""

    def prepare(depth: FloatArray) -> Call:
        built = scene.contact_law(share * float(depth[-1]), solver=solver)
        shallow = share * depth
        return lambda: built.force(shallow)

    return prepare


def _held_from(begin: float) -> Callable[[FloatArray], Call]:
    """Forces from a law that is there, at as many depths from `begin` of the largest: zero or before contact."""

    def prepare(depth: FloatArray) -> Call:
        built = _RIGID_BASE.contact_law(float(depth[-1]), solver=Exact(1e-6))
        readings = np.linspace(begin, 1.0, len(depth)) * depth[-1]
        return lambda: built.force(readings)

    return prepare


def _batched(depth: FloatArray) -> Call:
    """Parameter sets that differ in both materials and in thickness, from materials to forces."""
    rng = np.random.default_rng(0)
    modulus = 3e6 * np.exp(0.1 * rng.standard_normal((_SETS, 1)))
    nu = rng.uniform(0.4, 0.5, (_SETS, 1))
    thickness = 1e-3 * rng.uniform(0.95, 1.05, _SETS)
    layer, base = isotropic_constants(modulus, nu), isotropic_constants(10.0 * modulus, nu - 0.1)
    batch = ExactBatch.compile(
        _TIP,
        isotropic_constants(3e6, 0.45),
        isotropic_constants(3e7, 0.35),
        thickness=float(thickness.min()),
        max_depth=float(depth[-1]),
        rtol=1e-6,
    )
    theta = np.ravel(layer.theta)
    return lambda: batch.curves(layer, base).force(depth, theta, thickness)


#: The rows of the table.
CASES = (
    BenchCase("half-space, law held", _held(_RIGID_BASE, HalfSpace())),
    BenchCase(
        "asymptotic, explicit form, from cold", _cold(_RIGID_BASE, Asymptotic(form="explicit"), _SHALLOW)
    ),
    BenchCase(
        "asymptotic, explicit form, law held",
        _held(_RIGID_BASE, Asymptotic(form="explicit"), _SHALLOW),
    ),
    BenchCase(
        "asymptotic, parametric form, law held",
        _held(_RIGID_BASE, Asymptotic(form="parametric"), _SHALLOW),
    ),
    BenchCase(
        "asymptotic, compliance form, law held",
        _held(_RIGID_BASE, Asymptotic(form="compliance"), _SHALLOW),
    ),
    BenchCase("exact to 1e-6, rigid base, from cold", _cold(_RIGID_BASE, Exact(1e-6))),
    BenchCase("exact to 1e-6, base ten times stiffer, from cold", _cold(_STIFF_BASE, Exact(1e-6))),
    BenchCase("exact to 1e-6, base ten times softer, from cold", _cold(_SOFT_BASE, Exact(1e-6))),
    BenchCase("exact to 1e-6, true sphere, a/R up to 0.4, from cold", _cold(_BALL, Exact(1e-6), _BALL_SHARE)),
    BenchCase("exact to 1e-10, rigid base, from cold", _cold(_RIGID_BASE, Exact(1e-10))),
    BenchCase("auto to 1e-6, a/h up to 0.2, from cold", _cold(_RIGID_BASE, Auto(1e-6), _SHALLOW)),
    BenchCase("exact to 1e-6, law held", _held(_RIGID_BASE, Exact(1e-6))),
    BenchCase("exact to 1e-6, law held, a zero among the depths", _held_from(0.0)),
    BenchCase("exact to 1e-6, law held, a tenth before contact", _held_from(-1.0 / 9.0)),
    BenchCase(
        "exact to 1e-6, true sphere, a/R up to 0.4, law held",
        _held(_BALL, Exact(1e-6), _BALL_SHARE),
    ),
    BenchCase("three Prony terms, ramp and hold, law held", relaxing_force(_RIGID_BASE, RAMP_AND_HOLD)),
    BenchCase("three Prony terms, in and out, law held", relaxing_force(_RIGID_BASE, CYCLE)),
    BenchCase(f"exact to 1e-6, {_SETS} sets of materials at once, per set", _batched, _SETS),
    BenchCase(
        "fit: E, thickness, contact, rigid base",
        exact_fit(RIGID, _E_H_CONTACT),
        unit=hertz_fit(RIGID),
    ),
    BenchCase(
        "fit: E, thickness, contact, base ten times stiffer",
        exact_fit(_STIFF_BASE_MATERIAL, _E_H_CONTACT),
        unit=hertz_fit(_STIFF_BASE_MATERIAL),
    ),
    BenchCase(
        "fit: E, thickness, contact, base modulus",
        exact_fit(_STIFF_BASE_MATERIAL, (*_E_H_CONTACT, "substrate.E")),
        unit=hertz_fit(_STIFF_BASE_MATERIAL),
    ),
    BenchCase(
        "fit, true sphere: E, thickness, contact, rigid base",
        exact_fit(RIGID, _E_H_CONTACT, _SMALL_BALL),
        unit=hertz_fit(RIGID),
    ),
    BenchCase(
        "fit, true sphere: E, thickness, contact, base ten times stiffer",
        exact_fit(_STIFF_BASE_MATERIAL, _E_H_CONTACT, _SMALL_BALL),
        unit=hertz_fit(_STIFF_BASE_MATERIAL),
    ),
    BenchCase(
        "fit, true sphere: E, thickness, contact, base modulus",
        exact_fit(_STIFF_BASE_MATERIAL, (*_E_H_CONTACT, "substrate.E"), _SMALL_BALL),
        unit=hertz_fit(_STIFF_BASE_MATERIAL),
    ),
    BenchCase(
        "fit: E, nu, contact, base ten times stiffer",
        exact_fit(_STIFF_BASE_MATERIAL, ("layer.E", "layer.nu", "instrument.contact_depth")),
        unit=hertz_fit(_STIFF_BASE_MATERIAL),
    ),
    BenchCase(
        "fit: E, thickness, contact, two Prony terms",
        relaxing_fit(_RIGID_BASE, RAMP_AND_HOLD),
        unit=hertz_fit(RIGID),
    ),
)


def bench_table(cases: tuple[BenchCase, ...] = CASES, rounds: int = _ROUNDS) -> pd.DataFrame:
    """Time the cases on 1000 depths up to a/h = 2.

    Returns
    -------
    pandas.DataFrame
        ``case``, ``ratio`` (median over the rounds of its time over that of the explicit formula), ``us``
        (median time in microseconds); the formula itself is the first row.
    """
    models = [case for case in cases if not case.is_fit]
    return _timed("explicit formula, coefficients at hand", models, rounds)


def fit_table(cases: tuple[BenchCase, ...] = CASES, rounds: int = _ROUNDS) -> pd.DataFrame:
    """Time the fits of 1000 points with noise of 0.5 % at a/h up to 0.8, from the problem to the result.

    Returns
    -------
    pandas.DataFrame
        As `bench_table`, in units of lmfit's fit of Hertz's formula to the same points, which is the first row.
    """
    fits = [case for case in cases if case.is_fit]
    return _timed("Hertz's formula by lmfit: E, contact, baseline", fits, rounds)


def _timed(unit_name: str, cases: Sequence[BenchCase], rounds: int) -> pd.DataFrame:
    depth = _depths(_POINTS)
    rows, units = [], []
    for case in cases:
        unit, taken = _in_turns(case.unit(depth), case.prepare(depth), rounds)
        units.append(unit)
        per_set = taken / case.sets
        rows.append((case.name, float(np.median(per_set / unit)), 1e6 * float(np.median(per_set))))
    first = (unit_name, 1.0, 1e6 * float(np.median(units)))
    return pd.DataFrame([first, *rows], columns=["case", "ratio", "us"])


def depth_table(counts: tuple[int, ...] = _COUNTS, rounds: int = _ROUNDS) -> pd.DataFrame:
    """Time formula and exact law (1e-6, rigid base) against the number of depths.

    Returns
    -------
    pandas.DataFrame
        ``depths``, ``formula us``, ``cold us``, ``held us`` (medians, microseconds), ``cold ratio`` and
        ``held ratio`` (to the formula on the same depths).
    """
    rows = []
    for count in counts:
        depth = _depths(count)
        held = _held(_RIGID_BASE, Exact(1e-6))(depth)
        few = max(5, min(rounds, 2_000_000 // count))
        row = {"depths": float(count)}
        for name, call in (("cold", _cold(_RIGID_BASE, Exact(1e-6))(depth)), ("held", held)):
            unit, taken = _in_turns(_formula(depth), call, few)
            row |= {
                "formula us": 1e6 * float(np.median(unit)),
                f"{name} us": 1e6 * float(np.median(taken)),
                f"{name} ratio": float(np.median(taken / unit)),
            }
        rows.append(row)
    columns = ["depths", "formula us", "cold us", "held us", "cold ratio", "held ratio"]
    return pd.DataFrame(rows)[columns]


def bench_markdown(table: pd.DataFrame, curve: pd.DataFrame, fits: pd.DataFrame, users: pd.DataFrame) -> str:
    """Return the tables as Markdown, with what they were measured with."""
    made_with = f"Python {platform.python_version()}, numpy {np.__version__}, {platform.machine()}"
    cells = curve[["depths", "formula us", "cold us", "held us", "held ratio"]].to_numpy()
    unit = f"{table['us'].iloc[0]:.0f} us for 1000"
    lines = [
        f"Times in units of the explicit fourth-order formula in plain numpy on the same depths ({unit}):",
        f"medians of processor time in one process, {made_with}.",
        "",
        "| Paraboloid, 1000 depths, a/h up to 2 | time |",
        "|---|---:|",
        *(f"| {case} | {_short(ratio)} |" for case, ratio in zip(table["case"], table["ratio"], strict=True)),
        "",
        "| Depths | formula (us) | exact, from cold (us) | exact, law held (us) | held / formula |",
        "|---:|---:|---:|---:|---:|",
        *("| " + " | ".join(map(_short, row)) + " |" for row in cells),
        "",
        f"| Fit of 1000 points, exact law to 1e-6, a/h up to 0.8 | time, in Hertz fits ({_ms(fits)} ms) |",
        "|---|---:|",
        *(f"| {case} | {_short(ratio)} |" for case, ratio in zip(fits["case"], fits["ratio"], strict=True)),
        "",
        user_markdown(users),
    ]
    return "\n".join(lines)


def _ms(table: pd.DataFrame) -> str:
    return f"{1e-3 * table['us'].iloc[0]:.1f}"


def _short(value: float) -> str:
    return f"{value:.2g}" if value < 10.0 else f"{value:,.0f}"


def _depths(count: int) -> FloatArray:
    return np.linspace(_DEEPEST / count, _DEEPEST, count)


def _in_turns(unit: Call, call: Call, rounds: int) -> tuple[FloatArray, FloatArray]:
    """Processor times (s) of the unit and of the call, each (rounds,), after a round that does not count."""
    taken = np.empty((2, rounds + 1))
    for turn in range(rounds + 1):
        for row, timed in enumerate((unit, call)):
            start = time.process_time()
            timed()
            taken[row, turn] = time.process_time() - start
    return taken[0, 1:], taken[1, 1:]
