"""Ten mistakes made on purpose, one at a time, in a copy of the package: does the gate catch each?

    python tests/studies/mutations.py [--only 3 7]    # writes their rows of results/mutations.csv

Each is a change of a few characters that leaves the program running. The gate has caught it where one of the named
test files fails; the control, the copy without a mistake, must pass all of them.
"""

import argparse
import csv
import os
import shutil
import subprocess
import sys
import tempfile
from pathlib import Path
from typing import NamedTuple

ROOT = Path(__file__).resolve().parents[2]
RESULT = Path(__file__).with_name("results") / "mutations.csv"


class Mistake(NamedTuple):
    """What is wrong, where, the text before and after, and the test files that are asked."""

    what: str
    file: str
    right: str
    wrong: str
    tests: tuple[str, ...]


MISTAKES = (
    Mistake(
        "the stiffness of a half-space is 0.1 % low",
        "mechanics/halfspace.py",
        "return 4.0 * self.theta * self.indenter.halfspace_radius(depth)",
        "return 3.996 * self.theta * self.indenter.halfspace_radius(depth)",
        ("test_halfspace.py",),
    ),
    Mistake(
        "the exact force is off by 1e-7",
        "mechanics/exact/contact_problem.py",
        "(1.0 + 1.0 / exponent) * force / (depth * swell)",
        "(1.0 + 1.0 / exponent) * force / (depth * swell) * (1.0 + 1e-7)",
        ("test_exact.py", "test_exact_references.py"),
    ),
    Mistake(
        "the closed form of the kernel serves bases so soft that it loses digits",
        "mechanics/kernel/bodies.py",
        "_SOFTEST_BASE = 1e-3",
        "_SOFTEST_BASE = 1e-9",
        ("test_kernel.py", "test_hard_cases.py"),
    ),
    Mistake(
        "a relaxing layer answers a step of the load to first order",
        "mechanics/viscoelastic/memory.py",
        "return np.asarray(-np.expm1(-x) / x)",
        "return np.asarray(np.exp(-0.5 * x))",
        ("test_viscoelastic.py", "test_relaxation.py"),
    ),
    Mistake(
        "the derivative of the force in a length has the wrong factor",
        "inference/model/similarity.py",
        "return (-1.0, 2.0) if self.exponent is None",
        "return (-1.0, 3.0) if self.exponent is None",
        ("test_law_slopes.py",),
    ),
    Mistake(
        "the contact point moves the reading the other way in the derivatives",
        "inference/model/forward_batch.py",
        "np.negative(stiffness, out=columns[:, row])",
        "columns[:, row] = stiffness",
        ("test_engine.py", "test_least_squares.py"),
    ),
    Mistake(
        "the density of several hypotheses counts the freedom once more",
        "inference/uncertainty/density.py",
        "found = self.height - 0.5 * (freedom + k) * np.log1p(square / freedom)",
        "found = self.height - 0.5 * (freedom + 2 * k) * np.log1p(square / freedom)",
        ("test_likelihood.py",),
    ),
    Mistake(
        "a step at contact is put in, not taken out",
        "inference/uncertainty/moments.py",
        "coefficients[corrects] -= taken[corrects]",
        "coefficients[corrects] += taken[corrects]",
        ("test_answer.py", "test_likelihood.py"),
    ),
    Mistake(
        "systematic parts add up as they are, not in quadrature",
        "inference/uncertainty/statement.py",
        "systematic = np.sqrt(sum((own * own for own in arms), np.zeros(2)))",
        "systematic = sum(arms, np.zeros(2))",
        ("test_answer.py",),
    ),
    Mistake(
        "weighted quantiles are those of draws of one weight",
        "inference/uncertainty/mixture.py",
        "    order = np.argsort(values",
        "    weights = np.full(len(values), 1.0 / len(values))\n    order = np.argsort(values",
        ("test_likelihood.py", "test_posterior.py"),
    ),
)


def passes(source, tests):
    """Whether the test files pass with the package of a folder."""
    paths = f"pythonpath={source} {ROOT / 'tests'}"
    files = [f"tests/{name}" for name in tests]
    words = [sys.executable, "-m", "pytest", "-q", "-x", "-o", paths, "-p", "no:cacheprovider", *files]
    environment = os.environ | {"PYTHONPATH": str(source)}
    done = subprocess.run(words, cwd=ROOT, env=environment, capture_output=True, text=True, check=False)
    if done.returncode not in {0, 1}:
        raise SystemExit(done.stdout[-3000:] + done.stderr[-2000:])
    failed = [line for line in done.stdout.splitlines() if line.startswith("FAILED")]
    return done.returncode == 0, failed[0].removeprefix("FAILED tests/").partition(" - ")[0] if failed else ""


def tried(mistake, folder):
    """Whether a mistake is caught, and by which test."""
    source = Path(folder) / "src"
    shutil.copytree(ROOT / "src", source, ignore=shutil.ignore_patterns("__pycache__"))
    path = source / "underlay" / mistake.file
    text = path.read_text(encoding="utf-8")
    if text.count(mistake.right) != 1:
        raise SystemExit(
            f"{mistake.file} holds {mistake.right!r} {text.count(mistake.right)} times, not once"
        )
    path.write_text(text.replace(mistake.right, mistake.wrong), encoding="utf-8")
    fine, by = passes(source, mistake.tests)
    return not fine, by


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--only", type=int, nargs="*", default=range(1, len(MISTAKES) + 1))
    asked = parser.parse_args()
    everything = sorted({name for number in asked.only for name in MISTAKES[number - 1].tests})
    fine, by = passes(ROOT / "src", everything)
    rows = [("nothing", "", "no" if fine else "yes", by)]
    for number in asked.only:
        mistake = MISTAKES[number - 1]
        with tempfile.TemporaryDirectory() as folder:
            caught, by = tried(mistake, folder)
        rows.append((mistake.what, mistake.file, "yes" if caught else "no", by))
        print(*rows[-1], sep=" | ", flush=True)
    known = {}
    if RESULT.exists():
        with RESULT.open(newline="", encoding="utf-8") as file:
            known = {row[0]: row for row in list(csv.reader(file))[1:]}
    known |= {row[0]: row for row in rows}
    with RESULT.open("w", newline="", encoding="utf-8") as file:
        csv.writer(file).writerows([("mistake", "file", "caught", "by"), *known.values()])


if __name__ == "__main__":
    main()
