"""What a user waits for: start-up, reading, quality, maps, stacks and a million points, each beside its unit.

Processor times, of this process or of a child of its own; of several rounds, taken in turns with the unit, the
median ratio counts, and for seconds the shortest. A row whose peer is not installed says so. To add a row: one
line in `CASES`; its call takes the rounds and says the value.
"""

import os
import platform
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from importlib import import_module
from importlib.metadata import PackageNotFoundError, version
from importlib.util import find_spec
from pathlib import Path

import numpy as np
import pandas as pd

import underlay as ul
from underlay.data.export import curve_csv
from underlay.mechanics.kernel import StackKernel, SubstrateKernel

ROUNDS = 7
PACKAGES = ("underlay", "numpy", "scipy", "pandas", "lmfit", "emcee", "matplotlib")
# Of a map in memory, and of one in files: there, what a map costs once (its scene file, its table) must weigh as
# little as it does in the maps that people make.
CURVES, IN_FILES = 24, 256
POINTS, THICKNESS = 1000, 1e-3
LEVER = 1e3  # N/m
TIP, BALL, STIFF = ul.Paraboloid(1e-3), ul.Sphere(1e-3), ul.Isotropic(3e7, 0.3)
E_CONTACT = {"layer.E": (3e4, 3e8), "instrument.contact_depth": (-1e-4, 1e-4)}
SCENE_FILE = """
indenter = { shape = "paraboloid", radius = "1 mm" }
layer = { E = "3 MPa", nu = 0.5, thickness = "1 mm" }
substrate = { rigid = true }
solver = { name = "exact", rtol = 1e-4 }

[fit]
layer.E = { min = "30 kPa", max = "300 MPa" }
instrument.contact_depth = { min = "-100 um", max = "100 um" }
"""


# --- what is made -----------------------------------------------------------------------------------------


def scene_of(tip=TIP, base=ul.RIGID, thickness=THICKNESS, relaxation=None):
    """A layer of 3 MPa under a tip."""
    return ul.Scene(tip, ul.Layer(ul.Isotropic(3e6, 0.5), thickness, relaxation=relaxation), base)


def made_curve(scene, points=POINTS, seed=0):
    """A curve of so many points, a/h up to 0.8, and its noise."""
    depth = np.linspace(-5e-5, 3.6e-4, points)
    noise = ul.Noise(force=0.005 * float(scene.force(depth[-1], solver=ul.Exact(1e-4))))
    return ul.synthesize(scene, depth, noise=noise, rng=seed), noise


def made_files(folder, count):
    """A scene file and so many curves as CSV."""
    scene, curves = folder / "scene.toml", folder / "curves"
    scene.write_text(SCENE_FILE, encoding="utf-8")
    curves.mkdir()
    paths = [curves / f"{number:03d}.csv" for number in range(count)]
    for seed, path in enumerate(paths):
        path.write_text(curve_csv(made_curve(scene_of(), seed=seed)[0]), encoding="utf-8")
    return scene, paths


def seconds(call):
    """Processor time (s) of a call."""
    began = time.process_time()
    call()
    return time.process_time() - began


def over(unit, call, rounds):
    """Median ratio of two calls made in turns, after a round that does not count."""
    unit(), call()
    return float(np.median([seconds(call) / seconds(unit) for _ in range(rounds)]))


# --- children ---------------------------------------------------------------------------------------------


def child(*arguments, **environment):
    """Processor time (s) of a Python of its own, and what it says; NaN where the system does not count it."""
    try:
        import resource  # noqa: PLC0415  Unix alone has it
    except ImportError:
        return np.nan, ""

    def used():
        spent = resource.getrusage(resource.RUSAGE_CHILDREN)
        return spent.ru_utime + spent.ru_stime

    before = used()
    done = subprocess.run(
        [sys.executable, *arguments],
        env=os.environ | environment,
        capture_output=True,
        text=True,
        check=False,
    )
    return used() - before, done.stdout


def over_lmfit(rounds, *arguments, **environment):
    """Start of a child over that of one that imports lmfit."""
    ratios = [child(*arguments, **environment)[0] / child("-c", "import lmfit")[0] for _ in range(rounds)]
    return float(np.median(ratios))


def command(*words, **environment):
    """A row's call: `underlay WORDS` over `import lmfit`."""
    return lambda rounds: over_lmfit(rounds, "-m", "underlay", *words, **environment)


def fit_command(rounds, *, pictures):
    """`underlay fit` of a curve of its own over `import lmfit`."""
    with tempfile.TemporaryDirectory() as name:
        scene, (curve,) = made_files(Path(name), 1)
        output = ["--output", str(Path(name) / "out")] if pictures else []
        return command("fit", str(curve), "--scene", str(scene), *output)(rounds)


FIRST = """
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


def first_fit(rounds):
    """What the first fit of a process takes more than the next ones (ms)."""
    said = [child("-c", FIRST)[1] for _ in range(min(rounds, 3))]
    return min((1e3 * float(text) for text in said if text), default=np.nan)


MILLION = """
import resource, sys, time
import underlay as ul
def most():
    # Where the system tells, since this program began: the other counts its parent's before it.
    try:
        lines = dict(line.split(":", 1) for line in open("/proc/self/status"))
    except OSError:
        return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024
    return int(lines["VmHWM"].split()[0]) / 1024
scene = ul.Scene(ul.Paraboloid(1e-3), ul.Layer(ul.Isotropic(3e6, 0.5), 1e-3), ul.RIGID)
began = time.process_time()
curve = ul.read(sys.argv[1])
judged = ul.check_quality(curve, scene)
free = ("layer.E", "instrument.contact_depth")
ul.fit(ul.Problem(scene, curve, free, noise=ul.Noise(force=1e-3), solver="exact"))
print(time.process_time() - began, most())
"""


def million(rounds, *, which):
    """Seconds (0), or megabytes at most (1), of reading, judging and fitting a million points."""
    del rounds
    with tempfile.TemporaryDirectory() as name:
        path = Path(name) / "long.csv"
        path.write_text(curve_csv(made_curve(scene_of(), 1_000_000)[0]), encoding="utf-8")
        said = child("-c", MILLION, str(path))[1]
    return float(said.split()[which]) if said else np.nan


# --- in this process --------------------------------------------------------------------------------------


def reading(rounds, *, points):
    """A plain CSV over numpy's reader of the same file."""
    with tempfile.TemporaryDirectory() as name:
        path = Path(name) / "plain.csv"
        curve = made_curve(scene_of(), points)[0]
        columns = np.column_stack((curve.depth, curve.force))
        np.savetxt(path, columns, delimiter=",", header="depth (m),force (N)", comments="")
        return over(lambda: np.loadtxt(path, delimiter=",", skiprows=1), lambda: ul.read(path), rounds)


def quality(rounds, *, points):
    """`check_quality` over the fit of modulus and contact."""
    scene = scene_of()
    curve, noise = made_curve(scene, points)
    return over(
        lambda: ul.fit(ul.Problem(scene, curve, list(E_CONTACT), noise=noise, solver="exact")),
        lambda: ul.check_quality(curve, scene),
        max(3, rounds // (1 + points // 100_000)),
    )


def stated(rounds, *, made, fitted, noise_is_stated=False):
    """A fit of modulus and contact with its interval and verdict over the fit alone.

    The curve is one of the scene `made`, fitted with another one.
    """
    depth, times = np.linspace(-5e-5, 3.6e-4, POINTS), np.linspace(0.0, 1.0, POINTS)
    noise = ul.Noise(force=0.005 * float(ul.simulate(made, depth, time=times).force.max()))
    curve = ul.synthesize(made, depth, noise=noise, rng=0, time=times)

    def found():
        return ul.fit(ul.Problem(fitted, curve, list(E_CONTACT), noise=noise if noise_is_stated else None))

    def told():
        result = found()
        return result.interval("layer.E"), result.verdict

    return over(found, told, rounds)


def stack_kernel(rounds):
    """Two layers on a base over one, at the same hundred wavenumbers."""
    u = np.linspace(0.0, 20.0, 100)
    soft, base = ul.Isotropic(1e6, 0.45), ul.Isotropic(3e7, 0.3)
    one = SubstrateKernel(soft, base)
    two = StackKernel((ul.Layer(soft, 1e-3), ul.Layer(ul.Isotropic(5e6, 0.4), 1e-3)), base)

    def many(kernel):
        return lambda: [kernel.values(u) for _ in range(50)]

    return over(many(one), many(two), rounds)


# --- maps -------------------------------------------------------------------------------------------------


def layered_map(tip, base):
    """A map with a thickness of its own for every curve."""
    thickness = THICKNESS * np.linspace(0.7, 1.3, CURVES)
    made = [made_curve(scene_of(tip, base, h), seed=seed) for seed, h in enumerate(thickness.tolist())]
    names = [f"{number:03d}" for number in range(CURVES)]
    curves = [
        ul.Curve(curve.depth, curve.force, metadata={"name": name})
        for name, (curve, _) in zip(names, made, strict=True)
    ]
    manifest = pd.DataFrame({"file": names, "layer.thickness": thickness})
    options = ul.MapOptions(noise=made[0][1], solver=ul.Exact(1e-4))
    return lambda: ul.fit_many(curves, scene_of(tip, base), E_CONTACT, manifest, workers=0, options=options)


def map_over_rigid(rounds, *, tip, base):
    """A map over that of a paraboloid on a rigid base."""
    return over(layered_map(TIP, ul.RIGID), layered_map(tip, base), max(2, rounds // 2))


def map_of_files(rounds):
    """A map from a folder of CSV, ms a curve."""
    with tempfile.TemporaryDirectory() as name:
        scene, paths = made_files(Path(name), IN_FILES)

        def call():
            return ul.fit_many(paths[0].parent, scene, workers=0)

        call()
        # The shortest counts, and a clock that wanders does so for seconds on end: more rounds than of a ratio.
        return 1e3 * min(seconds(call) for _ in range(2 * rounds)) / IN_FILES


def map_over_nanite(rounds):
    """Curves a second of a map over those of nanite's plain Hertz fit: both read, prepare and fit one HDF5 file."""
    options = ul.MapOptions(solver=ul.Exact(1e-4))
    with tempfile.TemporaryDirectory() as name:
        path = Path(name) / "map.h5"
        export(path)
        return over(
            lambda: ul.fit_many(path, scene_of(), E_CONTACT, workers=0, options=options),
            lambda: by_nanite(path),
            max(2, rounds // 2),
        )


def export(path):
    """Write a map as afmformats exports it."""
    with import_module("h5py").File(path, "w") as file:
        # Without a version that they know they find no curve in it.
        file.attrs["software"], file.attrs["software version"] = "afmformats", "0.18.0"
        for number in range(IN_FILES):
            made = made_curve(scene_of(), seed=number)[0]
            group = file.create_group(str(number))
            group.attrs["imaging mode"], group.attrs["enum"] = "force-distance", number
            group.attrs["spring constant"] = LEVER
            group["force"], group["height (measured)"] = made.force, -made.depth - made.force / LEVER
            group["segment"] = np.zeros(POINTS, dtype=np.uint8)
            group["time"] = 1e-3 * np.arange(POINTS)


def by_nanite(path):
    """What nanite's own users do with such a file."""
    group = import_module("nanite.group").load_group(path)
    assert len(group) == IN_FILES
    for test in group:
        test.apply_preprocessing(["compute_tip_position", "correct_force_offset", "correct_tip_offset"])
        start = test.get_initial_fit_parameters(model_key="hertz_para")
        start["R"].value, start["nu"].value = 1e-3, 0.5
        test.fit_model(model_key="hertz_para", params_initial=start)


# --- the rows ---------------------------------------------------------------------------------------------


@dataclass(frozen=True)
class Case:
    """One row: what the user does, what its value is in, rounds to the value, a package that must be installed."""

    what: str
    unit: str
    measure: Callable
    needs: str = ""


TAB = {"_UNDERLAY_COMPLETE": "complete_bash", "COMP_WORDS": "underlay f", "COMP_CWORD": "1"}
LAYER = scene_of()
RELAXING = scene_of(relaxation=ul.Prony((0.4,), (0.3,)))
HALF_SPACE = scene_of(base=None, thickness=np.inf)
STATED = {
    "noise stated": {"made": LAYER, "fitted": LAYER, "noise_is_stated": True},
    "noise not stated": {"made": LAYER, "fitted": LAYER},
    "the sample relaxes": {"made": RELAXING, "fitted": LAYER},
    "a layer taken for a half-space": {"made": LAYER, "fitted": HALF_SPACE},
}
LAYERED = {
    "base ten times stiffer": (TIP, STIFF),
    "true sphere, rigid base": (BALL, ul.RIGID),
    "true sphere, base ten times stiffer": (BALL, STIFF),
}
CASES = (
    Case("`underlay --help`", "of `import lmfit`", command("--help")),
    Case("`underlay --version`", "of `import lmfit`", command("--version")),
    Case("one TAB", "of `import lmfit`", command(**TAB)),
    Case(
        "`import underlay`", "of `import lmfit`", lambda rounds: over_lmfit(rounds, "-c", "import underlay")
    ),
    Case(
        "command `fit`, 1000 points, no pictures", "of `import lmfit`", partial(fit_command, pictures=False)
    ),
    Case(
        "command `fit`, 1000 points, with pictures", "of `import lmfit`", partial(fit_command, pictures=True)
    ),
    Case("first fit of a process, more than the next", "ms", first_fit),
    *(
        Case(f"reading a plain CSV of {points} points", "of `np.loadtxt`", partial(reading, points=points))
        for points in (1000, 4000)
    ),
    *(
        Case(f"`check_quality`, {points:,} points", "of the fit", partial(quality, points=points))
        for points in (1000, 100_000)
    ),
    *(
        Case(f"fit, interval and verdict: {name}", "of the fit", partial(stated, **scenes))
        for name, scenes in STATED.items()
    ),
    *(
        Case(
            f"map with a thickness column: {name}",
            "of the rigid paraboloid's",
            partial(map_over_rigid, tip=tip, base=base),
        )
        for name, (tip, base) in LAYERED.items()
    ),
    Case("map from CSV, 1000 points", "ms a curve", map_of_files),
    Case("map from HDF5, 1000 points", "times the curves of nanite's Hertz fit", map_over_nanite, "nanite"),
    Case("kernel of two layers on a base, 100 wavenumbers", "of one layer's", stack_kernel),
    Case("a million points: read, judged, fitted", "s", partial(million, which=0)),
    Case("a million points: memory at most", "MB", partial(million, which=1)),
)


def user_table(cases=CASES, rounds=ROUNDS):
    """Measure the rows: ``what``, ``value``, ``unit``.

    A row that cannot be measured here (another system) is left out, and one that lacks a package has no value and
    says in ``unit`` which.
    """
    rows = []
    for case in cases:
        if case.needs and find_spec(case.needs) is None:
            rows.append((case.what, np.nan, f"not measured: {case.needs} is not installed"))
            continue
        value = case.measure(rounds)
        if np.isfinite(value):
            rows.append((case.what, value, case.unit))
    return pd.DataFrame(rows, columns=["what", "value", "unit"])


def markdown(table):
    """The table as Markdown."""
    values = ("" if np.isnan(value) else f"{value:.3g} " for value in table["value"])
    rows = (
        f"| {row.what} | {value}{row.unit} |" for row, value in zip(table.itertuples(), values, strict=True)
    )
    return "\n".join(["| What a user waits for | processor time |", "|---|---:|", *rows])


def machine():
    """What the figures were measured with: the machine, Python, and the versions of what computes."""
    facts = {
        "machine": platform.machine(),
        "processor": processor(),
        "processors": str(os.cpu_count()),
        "system": platform.system(),
        "python": platform.python_version(),
    }
    for package in PACKAGES:
        try:
            facts[package] = version(package)
        except PackageNotFoundError:
            continue
    return facts


def processor():
    """Model of the processor, as far as the system says it."""
    try:
        lines = Path("/proc/cpuinfo").read_text(encoding="utf-8").splitlines()
    except OSError:
        return platform.processor()
    names = (line.partition(":")[2].strip() for line in lines if line.startswith("model name"))
    return next(names, platform.processor())
