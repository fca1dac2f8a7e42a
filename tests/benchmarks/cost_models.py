"""What the forward models and the fits cost: the rows of the tables, each timed beside its unit.

The unit of a model is the explicit fourth-order formula (5.9) in plain numpy on the same depths, term by term after
one square root; that of a fit is lmfit's fit of Hertz's formula to the same points. It is timed in turns with each
case and every ratio is the median over the rounds. Times are processor times: a busy machine makes calls wait, and
the longer a call the more of it is waiting. What is kept for the whole process, tables of exact laws, is there
after the first round, which does not count. To add a case: one line in `CASES`; its `prepare` takes the depths (m)
and returns the call that is timed.
"""

import platform
import time
from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
import pandas as pd

import underlay as ul
from underlay.inference.answer_cost import plain_hertz_fit
from underlay.mechanics.body import isotropic_constants
from underlay.mechanics.exact.batch import ExactBatch
from underlay.mechanics.kernel import LayerKernel
from underlay.mechanics.response import Remembered
from underlay.scene.accuracy_cost import explicit_formula

TIP, MODULUS, THICKNESS, NU = ul.Paraboloid(1e-3), 3e6, 1e-3, 0.5
GEL = ul.Layer(ul.Isotropic(MODULUS, NU), THICKNESS)
STIFF, SOFT = ul.Isotropic(3e7, 0.3), ul.Isotropic(3e5, 0.3)
RIGID_BASE, STIFF_BASE, SOFT_BASE = (ul.Scene(TIP, GEL, base) for base in (ul.RIGID, STIFF, SOFT))
BALL = ul.Scene(ul.Sphere(4e-3), GEL, ul.RIGID)
FIBROUS = ul.TransverselyIsotropic(E=6e6, E_axial=MODULUS, nu=0.3, nu_axial=0.2, G_axial=1.2e6)
FIBROUS_LAYER = ul.Scene(TIP, ul.Layer(FIBROUS, THICKNESS), ul.RIGID)
GLUED = ul.Scene(TIP, GEL, ul.Stack([ul.Layer(SOFT, THICKNESS)], ul.RIGID))
# The same paraboloid, as measured heights.
RADII = np.linspace(0.0, 1.6e-3, 300)
MEASURED_TIP = ul.Scene(ul.Profile(RADII, 0.5 * RADII**2 / TIP.radius), GEL, ul.RIGID)
# A bead on a thin layer of strongly coupled fibres, a/h up to 13: the hardest transversely isotropic law.
SHEARED = ul.TransverselyIsotropic(E=6e6, E_axial=MODULUS, nu=0.3, nu_axial=0.2, G_axial=3e5)
THIN, SHEARED_LAYER = (
    ul.Scene(ul.Sphere(8e-3), ul.Layer(material, 5e-5), ul.RIGID)
    for material in (ul.Isotropic(MODULUS, 0.3), SHEARED)
)
THIN_SHARE = 1.0 / 60.0
STICKY = ul.Scene(
    ul.Paraboloid(1e-5),
    ul.Layer(ul.Isotropic(5e3, 0.45), 8e-6),
    ul.RIGID,
    adhesion=ul.JKR(2e-4, branch="cycle"),
)
SMALL_BALL = ul.Sphere(1e-3)  # the fits' paraboloid with its true shape: a/R up to 0.7
# a/h = 2 on the rigid base; a fiftieth of it is a/h = 0.2, where every asymptotic form answers.
DEEPEST, SHALLOW = 1.8e-3, 0.02
# The ball is larger: a fifth of the depth gives it a/h = 1.6.
BALL_SHARE = 0.2
# Of the depths, in fits: there a/h is up to 0.8, where thickness and base are both felt.
FIT_SHARE = 0.2
BEFORE, CONTACT = 0.15, 0.05  # of the largest depth: where the readings of a fit begin, and where contact is
NOISE = 0.005  # of the largest force
POINTS, SETS, ROUNDS = 1000, 256, 41
COUNTS = (10, 100, 1000, 10_000, 100_000, 1_000_000)
E_H_CONTACT = ("layer.E", "layer.thickness", "instrument.contact_depth")
RELAXATION = ("fractions[0]", "fractions[1]", "times[0]", "times[1]")
# The start of a fit, over the truth; the contact starts at zero.
WRONG = {
    "layer.E": 3.0,
    "layer.nu": 0.8,
    "layer.thickness": 0.5,
    "substrate.E": 0.3,
    "instrument.contact_depth": 0.0,
    "adhesion.work": 2.0,
    **{f"layer.relaxation.{name}": 0.5 if "fractions" in name else 2.0 for name in RELAXATION},
}
# Times (s) and shares of the largest depth between which the depth goes evenly.
RAMP_AND_HOLD = (0.0, 1.0, 10.0), (0.0, 1.0, 1.0)
CYCLE = (0.0, 4.0, 10.0), (0.0, 1.0, 0.0)
THREE_TERMS = ul.Prony((0.3, 0.2, 0.1), (0.1, 1.0, 10.0))
TWO_TERMS = ul.Prony((0.4, 0.3), (0.2, 3.0))


def depths(count=POINTS):
    return np.linspace(DEEPEST / count, DEEPEST, count)


# --- models -----------------------------------------------------------------------------------------------


def formula(depth):
    explicit = explicit_formula(RIGID_BASE)
    return lambda: explicit(depth)


def cold(scene, solver, share=1.0):
    """From the materials to the forces, at `share` of the depths."""

    def prepare(depth):
        asked, deepest = share * depth, share * float(depth[-1])
        return lambda: scene.contact_law(deepest, solver=solver).force(asked)

    return prepare


def held(scene, solver, share=1.0):
    """Forces from a law that is there already."""

    def prepare(depth):
        built = scene.contact_law(share * float(depth[-1]), solver=solver)
        shallow = share * depth
        return lambda: built.force(shallow)

    return prepare


def held_from(begin):
    """Forces from a law that is there, at as many depths from `begin` of the largest: zero or before contact."""

    def prepare(depth):
        built = RIGID_BASE.contact_law(float(depth[-1]), solver=ul.Exact(1e-6))
        readings = np.linspace(begin, 1.0, len(depth)) * depth[-1]
        return lambda: built.force(readings)

    return prepare


def relaxing_force(motion):
    """Forces of three Prony terms along a motion, from an elastic law that is there already."""
    memory = replace(RIGID_BASE, layer=replace(GEL, relaxation=THREE_TERMS)).memory

    def prepare(depth):
        law = RIGID_BASE.contact_law(float(depth[-1]), solver=ul.Exact(1e-6))
        path, times = moved(depth, motion)
        response = Remembered(law, memory)
        return lambda: response.force(path, times)

    return prepare


def moved(depth, motion):
    """Depths (m) and times (s), as many as `depth` has, up to its last."""
    ends, shares = motion
    times = np.linspace(ends[0], ends[-1], len(depth))
    return float(depth[-1]) * np.interp(times, ends, shares), times


def batched(depth):
    """Parameter sets that differ in both materials and in thickness, from materials to forces."""
    rng = np.random.default_rng(0)
    modulus = MODULUS * np.exp(0.1 * rng.standard_normal((SETS, 1)))
    nu = rng.uniform(0.4, 0.5, (SETS, 1))
    thickness = THICKNESS * rng.uniform(0.95, 1.05, SETS)
    layer, base = isotropic_constants(modulus, nu), isotropic_constants(10.0 * modulus, nu - 0.1)
    batch = ExactBatch.compile(
        TIP,
        LayerKernel(isotropic_constants(MODULUS, 0.45), isotropic_constants(10.0 * MODULUS, 0.35)),
        thickness=float(thickness.min()),
        max_depth=float(depth[-1]),
        rtol=1e-6,
    )
    theta = np.ravel(layer.theta)
    return lambda: batch.curves(layer, base).force(depth, theta, thickness)


# --- fits -------------------------------------------------------------------------------------------------


def stack(count):
    """The gel over so many layers, each a third as thick, from softer to stiffer."""
    layers = [ul.Layer(ul.Isotropic(3e5 * (1 + one), 0.3), THICKNESS / 3.0) for one in range(count)]
    return ul.Scene(TIP, GEL, ul.Stack(layers, ul.RIGID))


def measured(scene, depth):
    """The scene with its contact point, a curve of it with as many points as `depth` (m), and its noise."""
    deepest = FIT_SHARE * float(depth[-1])
    scene = replace(scene, instrument=ul.Instrument(contact_depth=CONTACT * deepest))
    readings = np.linspace(-BEFORE, 1.0, len(depth)) * deepest
    noise = ul.Noise(force=NOISE * float(scene.force(readings[-1])))
    return scene, ul.synthesize(scene, readings, noise=noise, rng=0), noise


def started(scene, free):
    """The scene with the numbers at `free` as wrong as a user's first guess."""
    return scene.with_values({path: scene.parameters[path] * WRONG[path] for path in free})


def stated_fit(scene, free, solver="exact"):
    """Fit the parameters at `free` with stated noise: a new problem each time."""

    def prepare(depth):
        known, curve, noise = measured(scene, depth)
        start = started(known, free)
        return lambda: ul.fit(ul.Problem(start, curve, free, noise=noise, solver=solver))

    return prepare


def sticky_fit(depth):
    """Fit E, contact and work of adhesion of a tip that goes in and out: a new problem each time."""
    path, times = moved(depth * 1e-6 / depth[-1], CYCLE)
    known = replace(STICKY, instrument=ul.Instrument(contact_depth=2e-7))
    noise = ul.Noise(force=NOISE * float(known.force(path, times).max()))
    curve = ul.synthesize(known, path, noise, rng=0, time=times)
    free = {"layer.E": (1e1, 1e7), "instrument.contact_depth": (-1e-6, 1e-6), "adhesion.work": (1e-7, 1.0)}
    start = started(known, free)
    return lambda: ul.fit(ul.Problem(start, curve, free, noise=noise))


def relaxing_fit(depth):
    """Fit E, thickness, contact and two Prony terms of a ramp with a hold: a new problem each time."""
    scene = replace(RIGID_BASE, layer=replace(GEL, relaxation=TWO_TERMS))
    path, times = moved(FIT_SHARE * depth, RAMP_AND_HOLD)
    noise = ul.Noise(force=NOISE * float(scene.force(path, times).max()))
    curve = ul.synthesize(scene, path, noise, rng=0, time=times)
    free = (*E_H_CONTACT, *(f"layer.relaxation.{name}" for name in RELAXATION))
    start = started(scene, free)
    return lambda: ul.fit(ul.Problem(start, curve, free, solver="exact"))


def hertz_fit(base):
    """Fit Hertz's formula to the same points, from the same modulus and contact."""

    def prepare(depth):
        curve = measured(replace(RIGID_BASE, substrate=base), depth)[1]
        start = WRONG["layer.E"] * MODULUS
        return lambda: plain_hertz_fit(curve.depth, curve.force, TIP.radius, NU, E=start)

    return prepare


# --- the rows ---------------------------------------------------------------------------------------------


@dataclass(frozen=True)
class Case:
    """One row: what is computed, depths to the call that is timed, sets in a call, depths to the unit's call."""

    name: str
    prepare: Callable
    sets: int = 1
    unit: Callable = formula

    @property
    def is_fit(self):
        """Whether it is a fit, which is measured in fits."""
        return self.unit is not formula


EXPLICIT, PARAMETRIC, COMPLIANCE = (
    ul.Asymptotic(form=form) for form in ("explicit", "parametric", "compliance")
)
FITS = {
    "E, thickness, contact, rigid base": (ul.RIGID, E_H_CONTACT),
    "E, thickness, contact, base ten times stiffer": (STIFF, E_H_CONTACT),
    "E, thickness, contact, base modulus": (STIFF, (*E_H_CONTACT, "substrate.E")),
}
CASES = (
    Case("half-space, law held", held(RIGID_BASE, ul.HalfSpace())),
    Case("asymptotic, explicit form, from cold", cold(RIGID_BASE, EXPLICIT, SHALLOW)),
    Case("asymptotic, explicit form, law held", held(RIGID_BASE, EXPLICIT, SHALLOW)),
    Case("asymptotic, parametric form, law held", held(RIGID_BASE, PARAMETRIC, SHALLOW)),
    Case("asymptotic, compliance form, law held", held(RIGID_BASE, COMPLIANCE, SHALLOW)),
    Case("exact to 1e-6, rigid base, from cold", cold(RIGID_BASE, ul.Exact(1e-6))),
    Case("exact to 1e-6, base ten times stiffer, from cold", cold(STIFF_BASE, ul.Exact(1e-6))),
    Case("exact to 1e-6, base ten times softer, from cold", cold(SOFT_BASE, ul.Exact(1e-6))),
    Case("exact to 1e-6, true sphere, a/R up to 0.4, from cold", cold(BALL, ul.Exact(1e-6), BALL_SHARE)),
    Case("exact to 1e-6, transversely isotropic layer, from cold", cold(FIBROUS_LAYER, ul.Exact(1e-6))),
    Case("exact to 1e-6, two layers, the lower ten times softer, from cold", cold(GLUED, ul.Exact(1e-6))),
    Case("exact to 1e-6, true sphere, a/h up to 13, from cold", cold(THIN, ul.Exact(1e-6), THIN_SHARE)),
    Case("exact to 1e-6, the same, transversely isotropic", cold(SHEARED_LAYER, ul.Exact(1e-6), THIN_SHARE)),
    Case(
        "exact to 1e-6, measured tip of 300 points, from cold", cold(MEASURED_TIP, ul.Exact(1e-6), FIT_SHARE)
    ),
    Case("stuck to 1e-6, rigid base, from cold", cold(RIGID_BASE, ul.Stuck(1e-6))),
    Case("exact to 1e-10, rigid base, from cold", cold(RIGID_BASE, ul.Exact(1e-10))),
    Case("auto to 1e-6, a/h up to 0.2, from cold", cold(RIGID_BASE, ul.Auto(1e-6), SHALLOW)),
    Case("exact to 1e-6, law held", held(RIGID_BASE, ul.Exact(1e-6))),
    Case("exact to 1e-6, law held, a zero among the depths", held_from(0.0)),
    Case("exact to 1e-6, law held, a tenth before contact", held_from(-1.0 / 9.0)),
    Case("exact to 1e-6, true sphere, a/R up to 0.4, law held", held(BALL, ul.Exact(1e-6), BALL_SHARE)),
    Case("three Prony terms, ramp and hold, law held", relaxing_force(RAMP_AND_HOLD)),
    Case("three Prony terms, in and out, law held", relaxing_force(CYCLE)),
    Case(f"exact to 1e-6, {SETS} sets of materials at once, per set", batched, SETS),
    *(
        Case(f"{kind}: {what}", stated_fit(ul.Scene(tip, GEL, base), free), unit=hertz_fit(base))
        for kind, tip in (("fit", TIP), ("fit, true sphere", SMALL_BALL))
        for what, (base, free) in FITS.items()
    ),
    Case(
        "fit: E, nu, contact, base ten times stiffer",
        stated_fit(STIFF_BASE, ("layer.E", "layer.nu", "instrument.contact_depth")),
        unit=hertz_fit(STIFF),
    ),
    *(
        Case(
            f"fit: E, thickness, contact, {what}",
            stated_fit(scene, E_H_CONTACT, solver),
            unit=hertz_fit(ul.RIGID),
        )
        for what, scene, solver in (
            ("measured tip of 300 points", MEASURED_TIP, "exact"),
            ("transversely isotropic", FIBROUS_LAYER, "exact"),
            ("over one further layer", stack(1), "exact"),
            ("over three further layers", stack(3), "exact"),
            ("over seven further layers", stack(7), "exact"),
            ("stuck tip", RIGID_BASE, "stuck"),
        )
    ),
    Case("fit: E, contact, work of adhesion (JKR), in and out", sticky_fit, unit=hertz_fit(ul.RIGID)),
    Case("fit: E, thickness, contact, two Prony terms", relaxing_fit, unit=hertz_fit(ul.RIGID)),
)


# --- the tables -------------------------------------------------------------------------------------------


def model_table(cases=CASES, rounds=ROUNDS):
    """Time the models on 1000 depths up to a/h = 2.

    A table of ``case``, ``ratio`` (median over the rounds of its time over that of the explicit formula) and ``us``
    (median time in microseconds); the formula itself is the first row.
    """
    models = [case for case in cases if not case.is_fit]
    return timed("explicit formula, coefficients at hand", models, rounds)


def fit_table(cases=CASES, rounds=ROUNDS):
    """Time the fits of 1000 points with noise of 0.5 % at a/h up to 0.8, from the problem to the result.

    As `model_table`, in units of lmfit's fit of Hertz's formula to the same points, which is the first row.
    """
    fits = [case for case in cases if case.is_fit]
    return timed("Hertz's formula by lmfit: E, contact, baseline", fits, rounds)


def timed(unit_name, cases, rounds):
    depth = depths()
    rows, units = [], []
    for case in cases:
        unit, taken = in_turns(case.unit(depth), case.prepare(depth), rounds)
        units.append(unit)
        per_set = taken / case.sets
        rows.append((case.name, float(np.median(per_set / unit)), 1e6 * float(np.median(per_set))))
    first = (unit_name, 1.0, 1e6 * float(np.median(units)))
    return pd.DataFrame([first, *rows], columns=["case", "ratio", "us"])


def depth_table(counts=COUNTS, rounds=ROUNDS):
    """Time formula and exact law (1e-6, rigid base) against the number of depths.

    A table of ``depths``, ``formula us``, ``cold us``, ``held us`` (medians, microseconds), ``cold ratio`` and
    ``held ratio`` (to the formula on the same depths).
    """
    rows = []
    for count in counts:
        depth = depths(count)
        few = max(5, min(rounds, 2_000_000 // count))
        row = {"depths": float(count)}
        for name, prepare in (("cold", cold), ("held", held)):
            unit, taken = in_turns(formula(depth), prepare(RIGID_BASE, ul.Exact(1e-6))(depth), few)
            row |= {
                "formula us": 1e6 * float(np.median(unit)),
                f"{name} us": 1e6 * float(np.median(taken)),
                f"{name} ratio": float(np.median(taken / unit)),
            }
        rows.append(row)
    columns = ["depths", "formula us", "cold us", "held us", "cold ratio", "held ratio"]
    return pd.DataFrame(rows)[columns]


def in_turns(unit, call, rounds):
    """Processor times (s) of the unit and of the call, each (rounds,), after a round that does not count."""
    taken = np.empty((2, rounds + 1))
    for turn in range(rounds + 1):
        for row, one in enumerate((unit, call)):
            start = time.process_time()
            one()
            taken[row, turn] = time.process_time() - start
    return taken[0, 1:], taken[1, 1:]


def markdown(table, curve, fits):
    """The tables as Markdown, with what they were measured with."""
    made_with = f"Python {platform.python_version()}, numpy {np.__version__}, {platform.machine()}"
    cells = curve[["depths", "formula us", "cold us", "held us", "held ratio"]].to_numpy()
    hertz = f"{1e-3 * fits['us'].iloc[0]:.1f} ms"
    unit = f"{table['us'].iloc[0]:.0f} us for 1000"
    lines = [
        f"Times in units of the explicit fourth-order formula in plain numpy, with one square root ({unit}):",
        f"medians of processor time in one process, {made_with}.",
        "",
        "| Paraboloid, 1000 depths, a/h up to 2 | time |",
        "|---|---:|",
        *(f"| {row.case} | {short(row.ratio)} |" for row in table.itertuples()),
        "",
        "| Depths | formula (us) | exact, from cold (us) | exact, law held (us) | held / formula |",
        "|---:|---:|---:|---:|---:|",
        *("| " + " | ".join(map(short, row)) + " |" for row in cells),
        "",
        f"| Fit of 1000 points, exact law to 1e-6, a/h up to 0.8 | time, in Hertz fits ({hertz}) |",
        "|---|---:|",
        *(f"| {row.case} | {short(row.ratio)} |" for row in fits.itertuples()),
    ]
    return "\n".join(lines)


def short(value):
    return f"{value:.2g}" if value < 10.0 else f"{value:,.0f}"
