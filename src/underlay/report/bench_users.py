"""What a user waits for: start-up, reading, quality, maps, stacks and a million points, each beside its unit.

Processor times, of this process or of a child of its own; of several rounds, taken in turns with the unit, the
median ratio counts, and for seconds the shortest. A row whose peer is not installed says so. To add a row: one
line in `USER_CASES`; its call says the value.
"""

from __future__ import annotations

import os
import platform
import subprocess
import sys
import tempfile
from collections.abc import Callable
from dataclasses import dataclass
from importlib.metadata import PackageNotFoundError, version
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from underlay._arrays import FloatArray
from underlay.data.export import curve_csv
from underlay.data.quality import check_quality
from underlay.data.readers import read
from underlay.inference.least_squares import fit
from underlay.inference.problem import Problem
from underlay.mechanics.body import RIGID, Layer
from underlay.mechanics.indenters import Paraboloid
from underlay.mechanics.kernel import StackKernel, SubstrateKernel
from underlay.mechanics.materials import Isotropic
from underlay.report.bench_made import made_curve, made_files, over, scene_of
from underlay.report.bench_maps import LAYERED, map_of_files, map_over_nanite, map_over_rigid
from underlay.report.bench_stated import STATED

__all__ = ["USER_CASES", "UserCase", "machine", "user_markdown", "user_table"]

_ROUNDS = 7
_PACKAGES = ("underlay", "numpy", "scipy", "pandas", "lmfit", "emcee", "matplotlib")


@dataclass(frozen=True)
class UserCase:
    """One row.

    Parameters
    ----------
    what : str
        What the user does.
    unit : str
        What the value is in.
    measure : callable
        Rounds to the value.
    needs : str
        Package that must be installed; empty if none.
    """

    what: str
    unit: str
    measure: Callable[[int], float]
    needs: str = ""


def user_table(cases: tuple[UserCase, ...] | None = None, rounds: int = _ROUNDS) -> pd.DataFrame:
    """Measure the rows.

    Returns
    -------
    pandas.DataFrame
        ``what``, ``value``, ``unit``; a row that cannot be measured here (another system) is left out, and one
        that lacks a package has no value and says in ``unit`` which.
    """
    rows = []
    for case in USER_CASES if cases is None else cases:
        if case.needs and find_spec(case.needs) is None:
            rows.append((case.what, np.nan, f"not measured: {case.needs} is not installed"))
            continue
        value = case.measure(rounds)
        if np.isfinite(value):
            rows.append((case.what, value, case.unit))
    return pd.DataFrame(rows, columns=["what", "value", "unit"])


def user_markdown(table: pd.DataFrame) -> str:
    """Return the table as Markdown."""
    values = ("" if np.isnan(value) else f"{value:.3g} " for value in table["value"])
    rows = (
        f"| {row.what} | {value}{row.unit} |" for row, value in zip(table.itertuples(), values, strict=True)
    )
    return "\n".join(["| What a user waits for | processor time |", "|---|---:|", *rows])


def machine() -> dict[str, str]:
    """What the figures were measured with: the machine, Python, and the versions of what computes."""
    facts = {
        "machine": platform.machine(),
        "processor": _processor(),
        "processors": str(os.cpu_count()),
        "system": platform.system(),
        "python": platform.python_version(),
    }
    for package in _PACKAGES:
        try:
            facts[package] = version(package)
        except PackageNotFoundError:
            continue
    return facts


def _processor() -> str:
    """Model of the processor, as far as the system says it."""
    try:
        lines = Path("/proc/cpuinfo").read_text(encoding="utf-8").splitlines()
    except OSError:
        return platform.processor()
    names = (line.partition(":")[2].strip() for line in lines if line.startswith("model name"))
    return next(names, platform.processor())


# --- children --------------------------------------------------------------------------------------------------


def _child(*arguments: str, **environment: str) -> tuple[float, str]:
    """Processor time (s) of a Python of its own, and what it says; NaN where the system does not count it."""
    try:
        import resource  # noqa: PLC0415  Unix alone has it
    except ImportError:
        return np.nan, ""

    def used() -> float:
        spent = resource.getrusage(resource.RUSAGE_CHILDREN)
        return spent.ru_utime + spent.ru_stime

    before = used()
    said = subprocess.run(  # noqa: S603  our own interpreter, and what stands in this file
        [sys.executable, *arguments],
        env=os.environ | environment,
        capture_output=True,
        text=True,
        check=False,
    )
    return used() - before, said.stdout


def _over_lmfit(*arguments: str, **environment: str) -> Callable[[int], float]:
    """Start of a child over that of one that imports lmfit."""

    def measure(rounds: int) -> float:
        ratios = [
            _child(*arguments, **environment)[0] / _child("-c", "import lmfit")[0] for _ in range(rounds)
        ]
        return float(np.median(ratios))

    return measure


def _fit_command(*further: str) -> Callable[[int], float]:
    """`underlay fit` of a curve of its own over `import lmfit`."""

    def measure(rounds: int) -> float:
        with tempfile.TemporaryDirectory() as name:
            scene, curve = made_files(Path(name), 1)
            asked = ["-m", "underlay", "fit", str(curve[0]), "--scene", str(scene)]
            output = ["--output", str(Path(name) / "out")] if further else []
            return _over_lmfit(*asked, *output)(rounds)

    return measure


_FIRST = """
import time
import numpy as np
import underlay as ul
scene = ul.Scene(ul.Paraboloid(1e-3), ul.Layer(ul.Isotropic(3e6, 0.5), 1e-3), ul.Isotropic(3e7, 0.3))
depth = np.linspace(-5e-5, 3.6e-4, 1000)
noise = ul.Noise(force=0.005 * float(scene.force(depth[-1])))
curve = ul.synthesize(scene, depth, noise=noise, rng=0)
free = ("layer.E", "layer.thickness", "instrument.contact_depth")
def one():
    began = time.process_time()
    ul.fit(ul.Problem(scene, curve, free, noise=noise, solver="exact"))
    return time.process_time() - began
ul.fit(ul.Problem(scene, curve, free[:1], noise=noise, solver="halfspace"))
first = one()
print(first - min(one() for _ in range(5)))
"""


def _first_fit(rounds: int) -> float:
    """What the first fit of a process takes more than the next ones (ms)."""
    said = [_child("-c", _FIRST)[1] for _ in range(min(rounds, 3))]
    return min((1e3 * float(text) for text in said if text), default=np.nan)


_MILLION = """
import resource, sys, time
import underlay as ul
def used():
    return time.process_time()
def most():
    # Where the system tells, since this program began: the other counts its parent's before it.
    try:
        lines = dict(line.split(":", 1) for line in open("/proc/self/status"))
    except OSError:
        return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024
    return int(lines["VmHWM"].split()[0]) / 1024
scene = ul.Scene(ul.Paraboloid(1e-3), ul.Layer(ul.Isotropic(3e6, 0.5), 1e-3), ul.RIGID)
began = used()
curve = ul.read(sys.argv[1])
judged = ul.check_quality(curve, scene)
free = ("layer.E", "instrument.contact_depth")
ul.fit(ul.Problem(scene, curve, free, noise=ul.Noise(force=1e-3), solver="exact"))
print(used() - began, most())
"""


def _million(which: int) -> Callable[[int], float]:
    """Seconds, and megabytes at most, of reading, judging and fitting a million points."""

    def measure(rounds: int) -> float:
        del rounds
        with tempfile.TemporaryDirectory() as name:
            path = Path(name) / "long.csv"
            path.write_text(
                curve_csv(made_curve(scene_of(Paraboloid(1e-3), RIGID), 1_000_000)[0]), encoding="utf-8"
            )
            said = _child("-c", _MILLION, str(path))[1]
        return float(said.split()[which]) if said else np.nan

    return measure


# --- in this process -------------------------------------------------------------------------------------------


def _reading(points: int) -> Callable[[int], float]:
    """A plain CSV over numpy's reader of the same file."""

    def measure(rounds: int) -> float:
        with tempfile.TemporaryDirectory() as name:
            path = Path(name) / "plain.csv"
            curve = made_curve(scene_of(Paraboloid(1e-3), RIGID), points)[0]
            columns = np.column_stack((curve.depth, curve.force))
            np.savetxt(path, columns, delimiter=",", header="depth (m),force (N)", comments="")
            return over(lambda: np.loadtxt(path, delimiter=",", skiprows=1), lambda: read(path), rounds)

    return measure


def _quality(points: int) -> Callable[[int], float]:
    """`check_quality` over the fit of modulus and contact."""

    def measure(rounds: int) -> float:
        scene = scene_of(Paraboloid(1e-3), RIGID)
        curve, noise = made_curve(scene, points)
        free = ("layer.E", "instrument.contact_depth")

        def fitted() -> object:
            return fit(Problem(scene, curve, free, noise=noise, solver="exact"))

        return over(fitted, lambda: check_quality(curve, scene), max(3, rounds // (1 + points // 100_000)))

    return measure


def _stack_kernel(rounds: int) -> float:
    """Two layers on a base over one, at the same hundred wavenumbers."""
    u: FloatArray = np.linspace(0.0, 20.0, 100)
    soft, base = Isotropic(1e6, 0.45), Isotropic(3e7, 0.3)
    one = SubstrateKernel(soft, base)
    two = StackKernel((Layer(soft, 1e-3), Layer(Isotropic(5e6, 0.4), 1e-3)), base)

    def many(kernel: Any) -> Callable[[], Any]:
        return lambda: [kernel.values(u) for _ in range(50)]

    return over(many(one), many(two), rounds)


#: The rows of the table.
USER_CASES = (
    UserCase("`underlay --help`", "of `import lmfit`", _over_lmfit("-m", "underlay", "--help")),
    UserCase("`underlay --version`", "of `import lmfit`", _over_lmfit("-m", "underlay", "--version")),
    UserCase(
        "one TAB",
        "of `import lmfit`",
        _over_lmfit(
            "-m", "underlay", _UNDERLAY_COMPLETE="complete_bash", COMP_WORDS="underlay f", COMP_CWORD="1"
        ),
    ),
    UserCase("`import underlay`", "of `import lmfit`", _over_lmfit("-c", "import underlay")),
    UserCase("command `fit`, 1000 points, no pictures", "of `import lmfit`", _fit_command()),
    UserCase("command `fit`, 1000 points, with pictures", "of `import lmfit`", _fit_command("output")),
    UserCase("first fit of a process, more than the next", "ms", _first_fit),
    *(
        UserCase(f"reading a plain CSV of {points} points", "of `np.loadtxt`", _reading(points))
        for points in (1000, 4000)
    ),
    *(
        UserCase(f"`check_quality`, {points:,} points", "of the fit", _quality(points))
        for points in (1000, 100_000)
    ),
    *(UserCase(f"fit, interval and verdict: {name}", "of the fit", measure) for name, measure in STATED),
    *(
        UserCase(
            f"map with a thickness column: {name}", "of the rigid paraboloid's", map_over_rigid(tip, base)
        )
        for name, tip, base in LAYERED
    ),
    UserCase("map from CSV, 1000 points", "ms a curve", map_of_files),
    UserCase(
        "map from HDF5, 1000 points",
        "times the curves of nanite's Hertz fit",
        map_over_nanite,
        needs="nanite",
    ),
    UserCase("kernel of two layers on a base, 100 wavenumbers", "of one layer's", _stack_kernel),
    UserCase("a million points: read, judged, fitted", "s", _million(0)),
    UserCase("a million points: memory at most", "MB", _million(1)),
)
