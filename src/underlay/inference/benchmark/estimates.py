"""Ways from a curve of the benchmark to a modulus: the whole model, one contact law, another program."""

from __future__ import annotations

import shlex
import subprocess
from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import NamedTuple, TypeAlias

import numpy as np

from underlay._door import FileKind, read_text
from underlay._text import one_line
from underlay.errors import FitError, InputError
from underlay.inference.benchmark.cases import Case
from underlay.inference.from_files import load_problem
from underlay.inference.least_squares import fit
from underlay.inference.least_squares.fitting import quick_fit
from underlay.inference.problem import Problem
from underlay.mechanics.solver import Solver
from underlay.scene.scene_file import load_scene

__all__ = ["Estimate", "Estimator", "Program", "one_law", "whole_model"]

_MODULUS = "layer.E"
_FREE = (_MODULUS, "instrument.contact_depth", "instrument.baseline")
_ANSWER = FileKind("the answer of a program", 100_000, "let it write one number, the modulus in Pa")
_SHOWN = 200  # characters of what a failed program said


class Estimate(NamedTuple):
    """A modulus (Pa) and the ends of its 95 % interval; NaN where none is given."""

    modulus: float
    low: float = np.nan
    high: float = np.nan


#: What is scored: takes a case and gives an estimate, or a modulus (Pa).
Estimator: TypeAlias = Callable[[Case], Estimate | float]


def whole_model(case: Case) -> Estimate:
    """Fit the scene as it is told, with all that it says of the sample: what `underlay fit` prints."""
    fitted = fit(load_problem(case.curve, case.scene))
    told = fitted.interval(_MODULUS, model_error=True)
    return Estimate(told.value, told.low, told.high)


def one_law(solver: Solver) -> Estimator:
    """Return what a user of one elastic contact law does: friction, time and adhesion are not in his model.

    Of a test with a hold he fits the way in.
    """

    def estimate(case: Case) -> Estimate:
        told = load_problem(case.curve, case.scene)
        scene, curve = told.base_scenes[0], told.curves[0]
        relaxes = scene.memory is not None
        plain = replace(scene.elastic, adhesion=None, friction="none", finite_strain=None)
        problem = Problem(
            plain,
            curve.loading() if relaxes else curve,
            {path: told.free[path] for path in _FREE},
            solver=solver,
        )
        return Estimate(quick_fit(problem).values[_MODULUS])

    return estimate


@dataclass(frozen=True)
class Program:
    """Another program, run on every curve.

    Parameters
    ----------
    command : str
        Its command line. ``{curve}`` stands for the CSV (SI, names in the first row that is no comment),
        ``{scene}`` for the scene file, ``{answer}`` for the file that it writes the modulus (Pa) to, and any
        number of the scene by its path, e.g. ``{indenter.radius}``, for its value in SI. Without ``{answer}`` the
        modulus is the last word that it prints.
    timeout : float
        Seconds after which it is stopped.
    """

    command: str
    timeout: float = 600.0

    def __call__(self, case: Case) -> Estimate:
        """Run it, without a shell, in an empty folder.

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
