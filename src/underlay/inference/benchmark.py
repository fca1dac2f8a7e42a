"""The open benchmark of layered indentation: curves with known moduli, and the scores of estimates.

A case is a curve, the scene as a user would state it, and the true modulus (`benchmark_cases`). What is scored on
the cases (`benchmark`) is a function from a case to a modulus: the whole model, one contact law (`one_law`),
another program (`Program`). A contact law is also compared with solutions of the exact contact problem in twenty
digits (`against_references`) and with finite elements (`against_finite_elements`).
"""

from __future__ import annotations

import csv
import math
import shlex
import subprocess
import warnings
from collections.abc import Callable, Collection, Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any, NamedTuple, TypeAlias

import numpy as np
import pandas as pd

from underlay._arrays import FloatArray
from underlay._door import FileKind, read_text
from underlay._text import one_line
from underlay.data.samples import sample
from underlay.errors import FitError, InputError, UnderlayError, UnderlayWarning
from underlay.inference.from_files import load_problem
from underlay.inference.least_squares import fit
from underlay.inference.least_squares.fitting import quick_fit
from underlay.inference.problem import Problem
from underlay.mechanics.body import RIGID, Layer
from underlay.mechanics.contact import Contact
from underlay.mechanics.indenters import Cone, FlatPunch, Indenter, Paraboloid, PowerLaw, Sphere
from underlay.mechanics.materials import Isotropic, TransverselyIsotropic
from underlay.mechanics.solver import Solver
from underlay.mechanics.solvers import AnySolver, as_solver
from underlay.scene.scene_file import load_scene

# Files that are read, with the bytes that each may have.
_TABLE = FileKind("a table of the benchmark", 1_000_000, "install underlay again")
_MODULUS = "layer.E"
# Parameters that the user of one law fits.
_FREE = (_MODULUS, "instrument.contact_depth", "instrument.baseline")
_ANSWER = FileKind("the answer of a program", 100_000, "let it write one number, the modulus in Pa")
_SHOWN = 200  # characters of a failed program's output that are shown
# Constants of an isotropic material in a cell of the references.
_KINDS = {"E", "nu"}
# Depth over thickness at which finite elements are compared.
_DEPTHS = (0.1, 0.2, 0.3)


@dataclass(frozen=True)
class Case:
    """One curve of the benchmark.

    Parameters
    ----------
    kind : str
        The effect that a simple formula leaves out: ``"elastic"`` (none), ``"stuck"``, ``"finite_strain"``, ...
    noise : str
        The noise it was made with: ``"white"``, ``"proportional"``, ``"correlated"``, ``"depth"``, ``"drifting"``.
    curve, scene : Path
        Files of the readings in SI, and of what is known of the test.
    modulus : float
        True Young's modulus of the layer (Pa); the instantaneous one where it relaxes.
    """

    kind: str
    noise: str
    curve: Path
    scene: Path
    modulus: float


def benchmark_cases(kinds: Collection[str] = ()) -> tuple[Case, ...]:
    """Return the cases of some kinds of sample; of all kinds where none is named.

    Raises
    ------
    InputError
        If there is no such kind.
    FileAccessError
        If the installation lacks the benchmark.
    """
    rows = rows_of("truth.csv")
    known = list(dict.fromkeys(row["kind"] for row in rows))
    for kind in kinds:
        if kind not in known:
            raise InputError(f"the benchmark has no kind {kind!r}; it has {', '.join(known)}")
    return tuple(
        Case(
            row["kind"],
            row["noise"],
            sample(f"benchmark/{row['curve']}"),
            sample(f"benchmark/{row['kind']}.toml"),
            float(row["E (Pa)"]),
        )
        for row in rows
        if row["kind"] in (kinds or known)
    )


def rows_of(name: str) -> list[dict[str, str]]:
    """Rows of one of the benchmark's CSV tables, by column, without the comments above its header."""
    lines = read_text(sample(f"benchmark/{name}"), _TABLE).splitlines()
    return list(csv.DictReader(line for line in lines if not line.startswith("#")))


class Estimate(NamedTuple):
    """A modulus (Pa) and the ends of its 95 % interval; NaN where none is given."""

    modulus: float
    low: float = np.nan
    high: float = np.nan


#: An estimator takes a case and returns an estimate, or a modulus (Pa).
Estimator: TypeAlias = Callable[[Case], Estimate | float]


def whole_model(case: Case) -> Estimate:
    """Fit all that the case's scene file states, as `underlay fit` does."""
    fitted = fit(load_problem(case.curve, case.scene))
    answer = fitted.answer(_MODULUS)
    return Estimate(answer.value, answer.low, answer.high)


def one_law(solver: Solver) -> Estimator:
    """Return an estimator that fits one elastic contact law, without friction, relaxation and adhesion.

    Of a test with a hold only the loading part is fitted, as a user of such a law does.
    """

    def estimate(case: Case) -> Estimate:
        whole = load_problem(case.curve, case.scene)
        scene, curve = whole.base_scenes[0], whole.curves[0]
        relaxes = scene.memory is not None
        plain = replace(scene.elastic, adhesion=None, friction="none", finite_strain=None)
        problem = Problem(
            plain,
            curve.loading() if relaxes else curve,
            {path: whole.free[path] for path in _FREE},
            solver=solver,
        )
        return Estimate(quick_fit(problem).values[_MODULUS])

    return estimate


@dataclass(frozen=True)
class Program:
    """An external program, run on every curve of the benchmark.

    Parameters
    ----------
    command : str
        The command line. ``{curve}`` stands for the CSV (SI, names in the first row that is no comment),
        ``{scene}`` for the scene file, ``{answer}`` for the file that it writes the modulus (Pa) to, and any number
        of the scene by its path, e.g. ``{indenter.radius}``, for its value in SI. Without ``{answer}`` the modulus
        is the last word that it prints.
    timeout : float
        Seconds after which it is stopped.
    """

    command: str
    timeout: float = 600.0

    def __call__(self, case: Case) -> Estimate:
        """Run the program on a case, without a shell, in an empty folder, and read the modulus it gives.

        Raises
        ------
        FitError
            If it cannot be run, fails, or answers with anything but a number.
        """
        with TemporaryDirectory() as folder:
            answer = Path(folder) / "answer.txt"
            printed = self._run(self._words(case, answer), folder)
            text = read_text(answer, _ANSWER) if "{answer}" in self.command else printed
        words = text.split()
        try:
            return Estimate(float(words[-1]))
        except (IndexError, ValueError):
            said = one_line(text, _SHOWN) or "nothing"
            raise FitError(f"the program wrote {said} where a modulus in Pa was expected") from None

    def _words(self, case: Case, answer: Path) -> list[str]:
        known = {"curve": str(case.curve), "scene": str(case.scene), "answer": str(answer)}
        known |= {path: repr(value) for path, value in load_scene(case.scene).parameters.items()}
        words = shlex.split(self.command)
        for path, value in known.items():
            words = [word.replace(f"{{{path}}}", value) for word in words]
        left = [word for word in words if "{" in word and "}" in word]
        if left:
            raise InputError(f"{left[0]}: the scene has no such number; there are {', '.join(known)}")
        return words

    def _run(self, words: list[str], folder: str) -> str:
        try:
            done = subprocess.run(  # noqa: S603  the user's own command, without a shell
                words, cwd=folder, capture_output=True, text=True, timeout=self.timeout, check=False
            )
        except subprocess.TimeoutExpired:
            raise FitError(f"the program was stopped after {self.timeout:g} s") from None
        except OSError as error:
            raise FitError(f"{words[0]} cannot be run: {error.strerror or error}") from error
        if done.returncode:
            last = (done.stderr.strip() or done.stdout.strip() or "without a word").splitlines()[-1]
            raise FitError(f"the program failed with exit code {done.returncode}: {one_line(last, _SHOWN)}")
        return done.stdout


def against_references(solver: AnySolver = "auto") -> pd.DataFrame:
    """Compare the force of a law with reference solutions of the exact contact problem.

    Returns
    -------
    DataFrame
        One row for each tip shape and contact radius over thickness: number of material pairs to which the law
        applies, median and largest absolute relative error of the force.
    """
    law = as_solver(solver)
    found = pd.DataFrame(
        {"shape": row["shape"], "a/h": float(row["a/h"]), "error": abs(_reference_error(row, law))}
        for row in rows_of("contact_references.csv")
    )
    pairs = found.groupby(["shape", "a/h"], sort=False)["error"]
    return pd.DataFrame(
        {
            "pairs": pairs.agg(lambda errors: f"{errors.count()} of {len(errors)}"),
            "median error": pairs.median(),
            "largest error": pairs.max(),
        }
    ).reset_index()


def _reference_error(row: Mapping[str, str], solver: Solver) -> float:
    """Relative error of the force against one reference solution; NaN where the law does not apply."""
    radius = float(row["a/h"])
    tip, halfspace_depth = _tip(row["shape"], radius)
    # A flat punch has the same contact radius at every depth.
    depth = float(row["w/H(a)"] or 1.0) * halfspace_depth
    layer, base = _material(row["layer"]), _material(row["base"])
    contact = Contact.of(tip, Layer(layer, 1.0), base)
    force = float(row["P/(4 theta a H(a))"]) * 4.0 * contact.theta * radius * halfspace_depth
    return float(_force(solver, contact, np.array([depth]))[0]) / force - 1.0


def _force(solver: Solver, contact: Contact, depth: FloatArray) -> FloatArray:
    """Force of the solver's law at increasing depths, (n,); NaN where the law does not apply.

    Warnings that a law is used outside its range are suppressed: its errors there are what is measured.
    """
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", UnderlayWarning)
            return np.asarray(solver.law(contact, float(depth[-1])).force(depth))
    except UnderlayError:
        return np.full_like(depth, np.nan)


def _tip(shape: str, radius: float) -> tuple[Indenter, float]:
    """A tip of the named shape for a layer of thickness 1, and its half-space depth H(a) at a contact radius."""
    small = 1e-3  # depths far below the thickness, so that nothing but a/h matters
    if shape == "flat punch":
        return FlatPunch(radius), small
    exponent = float(shape.removeprefix("r^"))
    coefficient = small / radius**exponent
    tips = {1.0: Cone(np.arctan(1.0 / coefficient)), 2.0: Paraboloid(0.5 / coefficient)}
    tip = tips.get(exponent, PowerLaw(exponent, coefficient))
    return tip, float(tip.abel(np.array(radius)))


def _material(cell: str) -> Any:
    if cell == "rigid":
        return RIGID
    constants = {name: float(value) for name, value in (word.split("=") for word in cell.split())}
    return Isotropic(**constants) if set(constants) == _KINDS else TransverselyIsotropic(**constants)


def against_finite_elements(solver: AnySolver = "auto") -> pd.DataFrame:
    """Compare the force of a law with finite elements of a sphere on a layer as thick as its radius.

    Linear elements show the error of the law for the linear contact problem; neo-Hookean ones the error of linear
    elasticity.

    Returns
    -------
    DataFrame
        One row for each Poisson's ratio, material and friction under the tip: relative error of the law at three
        depths.
    """
    law, table = as_solver(solver), []
    rows = pd.DataFrame(rows_of("finite_elements.csv"))
    for (ratio, material, friction), points in rows.groupby(["nu", "material", "friction"], sort=False):
        nu = float(str(ratio))
        depth, force = points[["w/h", "P/(E h^2)"]].to_numpy(float).T
        contact = Contact.of(Sphere(1.0), Layer(Isotropic(1.0, nu), 1.0), RIGID)
        # A curve ends early where the finite elements found no equilibrium.
        found = dict(zip(depth.tolist(), (_force(law, contact, depth) / force - 1.0).tolist(), strict=True))
        errors = {f"w/h = {w:g}": found.get(w, np.nan) for w in _DEPTHS}
        table.append({"nu": nu, "material": material, "friction": friction, **errors})
    return pd.DataFrame(table)


@dataclass(frozen=True, eq=False)
class Scores:
    """Scores of one estimator on the cases of a benchmark.

    Parameters
    ----------
    label : str
        Name of what was scored.
    table : DataFrame
        One row per curve: true modulus, estimate, interval (Pa), error (%), and why there is no estimate.
    """

    label: str
    table: pd.DataFrame

    def to_frame(self) -> pd.DataFrame:
        """A copy of the table."""
        return self.table.copy()

    def summary(self) -> pd.DataFrame:
        """One row per kind of sample: median and largest absolute error (%), intervals that contain the truth."""
        return pd.DataFrame(_summed(str(kind), own) for kind, own in self.table.groupby("kind", sort=False))


def _summed(kind: str, own: pd.DataFrame) -> dict[str, Any]:
    """The summary row of one kind of sample, from the rows of its curves."""
    sizes = own["error (%)"].abs().dropna()
    given = own[own["low (Pa)"] < own["high (Pa)"]]
    held = given["truth (Pa)"].between(given["low (Pa)"], given["high (Pa)"]).sum()
    return {
        "kind": kind,
        "answered": f"{len(sizes)} of {len(own)}",
        "median error (%)": sizes.median() if len(sizes) else math.nan,
        "largest error (%)": sizes.max(),
        "intervals hold the truth": f"{held} of {len(given)}" if len(given) else "",
    }


def benchmark(
    solver: AnySolver | None = None,
    *,
    estimate: Estimator | None = None,
    kinds: Collection[str] = (),
    progress: Callable[[Case], None] | None = None,
) -> Scores:
    """Score an estimator of the modulus on the open benchmark of layered indentation.

    Accuracy is measured here; `tests/benchmarks/cost.py` measures speed.

    Parameters
    ----------
    solver : Solver or str, optional
        One elastic contact law, as most programs fit it. Without it, and without `estimate`, the whole model is
        scored: what ``underlay fit`` gives for the scene file.
    estimate : callable, optional
        Takes a `Case` (with the paths ``curve`` and ``scene``) and returns a modulus (Pa), or an `Estimate` with an
        interval. An error that it raises is recorded as the score of that curve.
    kinds : collection of str
        Kinds of sample; all by default.
    progress : callable, optional
        Called with each case before it is estimated.

    Returns
    -------
    Scores
        With ``to_frame()`` and ``summary()``.

    Raises
    ------
    InputError
        If both a solver and an estimate are given, or a name is not known.

    Examples
    --------
    >>> found = benchmark(estimate=lambda case: 2e3, kinds=["elastic"])
    >>> found.summary()["answered"].tolist()
    ['5 of 5']
    """
    if solver is not None and estimate is not None:
        raise InputError("give a solver or an estimate, not both")
    if estimate is None:
        chosen = None if solver is None else as_solver(solver)
        way, label = (whole_model, "whole model") if chosen is None else (one_law(chosen), chosen.label)
    else:
        way, label = estimate, getattr(estimate, "__name__", type(estimate).__name__)
    rows = []
    for case in benchmark_cases(kinds):
        if progress is not None:
            progress(case)
        rows.append(_scored(case, way))
    return Scores(label, pd.DataFrame(rows))


def _scored(case: Case, way: Estimator) -> dict[str, Any]:
    """The row of one case."""
    found, reason = Estimate(np.nan), ""
    try:
        with warnings.catch_warnings():
            # The curves were made to be difficult: warnings about them are not part of the score.
            warnings.simplefilter("ignore", UnderlayWarning)
            given = way(case)
        estimate = given if isinstance(given, Estimate) else Estimate(float(given))
        if np.isfinite(estimate.modulus):
            found = estimate
        else:
            reason = f"the estimate is {estimate.modulus}"
    except UnderlayError as error:
        reason = one_line(error)
    except Exception as error:  # noqa: BLE001  another's code: that it failed is its score
        reason = one_line(f"{type(error).__name__}: {error}")
    return {
        "kind": case.kind,
        "noise": case.noise,
        "truth (Pa)": case.modulus,
        "estimate (Pa)": found.modulus,
        "low (Pa)": found.low,
        "high (Pa)": found.high,
        "error (%)": 100.0 * (found.modulus / case.modulus - 1.0),
        "reason": reason,
    }
