"""The open benchmark: its files are made again to the bit, its references hold, and any program can be scored."""

import sys
from pathlib import Path

import numpy as np
import pytest

import underlay as ul
from support.reference_solver import STORED
from underlay.inference.benchmark import (
    Estimate,
    Program,
    against_finite_elements,
    against_references,
    benchmark_cases,
    rows_of,
)

sys.path.insert(0, str(Path(__file__).parent / "studies"))
import benchmark as study

FOLDER = study.FOLDER


def test_making_it_again_gives_the_same_bytes(tmp_path):
    study.make(tmp_path)
    made = {path.name for path in tmp_path.iterdir()}
    kept = {path.name for path in FOLDER.iterdir()}
    assert kept - made == {"finite_elements.csv", "README.md"}
    assert made <= kept
    for name in made:
        assert (tmp_path / name).read_bytes() == (FOLDER / name).read_bytes(), name


def test_every_file_says_how_it_was_made_and_it_is_small():
    for path in FOLDER.glob("*.[ct][so][vm]*"):
        assert path.read_text(encoding="utf-8").startswith("# made by: python tests/studies/benchmark.py"), (
            path
        )
    assert sum(path.stat().st_size for path in FOLDER.iterdir()) < 1_000_000


def test_the_files_of_a_user_do_not_hold_the_truth():
    for case in benchmark_cases():
        told = ul.load_scene(case.scene).parameters["layer.E"]
        assert abs(told / case.modulus - 1.0) > 0.5


def test_finite_elements_are_what_the_support_makes():
    # A coarse mesh meets the stored curve to its own error at the deepest points (two parts in a thousand).
    rows = study.finite_element_rows(0.3, "neo-Hookean", "none", elements=8, steps=6)
    depth, force = study.finite_element_curve(0.3, "neo-Hookean", "none")
    again = np.array([float(row["P/(E h^2)"]) for row in rows])
    at = np.array([float(row["w/h"]) for row in rows])
    assert again[3:] == pytest.approx(np.interp(at[3:], depth, force), rel=5e-3)


def test_the_exact_law_meets_every_reference():
    table = against_references(ul.Exact(rtol=1e-12))
    assert (table["pairs"].str.split(" of ").map(lambda pair: pair[0] == pair[1])).all()
    assert table["largest error"].max() < 1e-12
    # The control: a half-space is a tenth off where the contact is a tenth of the thickness.
    assert against_references("halfspace")["median error"].min() > 0.05


def test_the_references_hold_twelve_digits():
    for row in rows_of("contact_references.csv"):
        assert len(row["P/(4 theta a H(a))"].replace(".", "").lstrip("0")) >= 12
    assert STORED.exists()


def law_errors(solver, material, friction):
    """Errors of a law at each Poisson's ratio (rows) and depth (columns)."""
    table = against_finite_elements(solver)
    own = table[(table["material"] == material) & (table["friction"] == friction)]
    return own.sort_values("nu")[[name for name in table if name.startswith("w/h")]].to_numpy()


def test_finite_elements_of_a_linear_layer_meet_the_law():
    sliding = law_errors("exact", "linear", "none")
    assert np.isfinite(sliding).all()
    assert np.abs(sliding).max() < 1e-3
    # Points are held where they were at the end of the step that touched them: first order in the steps.
    assert np.abs(law_errors("stuck", "linear", "stuck")).max() < 5e-3
    # What linear elasticity leaves out of the neo-Hookean layer shows.
    assert law_errors("exact", "neo-Hookean", "none")[0, -1] < -0.1


def test_a_constant_is_scored_as_one():
    found = ul.benchmark(estimate=lambda case: 1.1 * case.modulus, kinds=["elastic", "stuck"])
    table = found.summary()
    assert table["kind"].tolist() == ["elastic", "stuck"]
    assert table["median error (%)"].tolist() == pytest.approx([10.0, 10.0])
    assert table["intervals hold the truth"].tolist() == ["", ""]


def test_intervals_and_failures_are_scored():
    def sometimes(case):
        if case.noise == "white":
            raise RuntimeError("not\ntoday")
        if case.noise == "depth":
            return float("nan")
        off = 2.0 if case.noise == "drifting" else 1.0
        return Estimate(off * case.modulus, 0.9 * off * case.modulus, 1.1 * off * case.modulus)

    found = ul.benchmark(estimate=sometimes, kinds=["elastic"])
    row = found.summary().iloc[0]
    assert row["answered"] == "3 of 5"
    assert row["intervals hold the truth"] == "2 of 3"
    assert row["largest error (%)"] == pytest.approx(100.0)
    reasons = found.to_frame().set_index("noise")["reason"]
    assert reasons["white"] == r"RuntimeError: not\ntoday"
    assert reasons["depth"] == "the estimate is nan"


def test_what_cannot_be_scored_is_said():
    with pytest.raises(ul.InputError, match="not both"):
        ul.benchmark("exact", estimate=float)
    with pytest.raises(ul.InputError, match="no kind 'plastic'; it has elastic, stuck"):
        ul.benchmark(kinds=["plastic"])
    refused = ul.benchmark("garcia2018", kinds=["stacked"])
    assert refused.summary().iloc[0]["answered"] == "0 of 5"
    assert "rigid substrate" in refused.table["reason"][0]


PROGRAM = """
import csv, sys
curve, radius, nu, answer = sys.argv[1:]
lines = [line for line in open(curve) if not line.startswith("#")]
rows = [(float(r["depth (m)"]), float(r["force (N)"])) for r in csv.DictReader(lines)]
base = min(force for _, force in rows)
(w0, _), (w, P) = rows[len(rows) // 2], rows[-1]
text = f"modulus: {0.75 * (P - base) * (1 - float(nu) ** 2) / float(radius) ** 0.5 / (w - 0) ** 1.5}"
open(answer, "w").write(text) if answer != "-" else print(text)
"""


@pytest.mark.parametrize("answer", ["{answer}", "-"])
def test_another_program_is_scored(answer, tmp_path):
    script = tmp_path / "program.py"
    script.write_text(PROGRAM, encoding="utf-8")
    case = benchmark_cases(["elastic"])[0]
    command = f"{sys.executable} {script} {{curve}} {{indenter.radius}} {{layer.nu}} {answer}"
    found = Program(command)(case)
    # Hertz's formula on the deepest point: twice too stiff, in the right units.
    assert 1.2 < found.modulus / case.modulus < 4.0


@pytest.mark.parametrize(
    ("command", "message"),
    [
        ("no-such-program {curve}", "no-such-program cannot be run: No such file"),
        (
            f"{sys.executable} -c 'import sys; sys.exit(\"no licence\")'",
            "failed with exit code 1: no licence",
        ),
        (f'{sys.executable} -c \'print("about", "ten")\'', "wrote about ten.* where a modulus in Pa"),
        (f"{sys.executable} -c pass", "wrote nothing where a modulus"),
    ],
)
def test_a_program_that_does_not_answer_is_an_error_of_ours(command, message):
    with pytest.raises(ul.FitError, match=message):
        Program(command)(benchmark_cases(["elastic"])[0])


def test_a_program_that_hangs_is_stopped():
    with pytest.raises(ul.FitError, match=r"stopped after 0\.5 s"):
        Program(f"{sys.executable} -c 'import time; time.sleep(60)'", timeout=0.5)(benchmark_cases()[0])


def test_a_name_that_no_scene_has_is_said():
    with pytest.raises(
        ul.InputError, match=r"{layer.stiffness}: the scene has no such number; there are curve"
    ):
        Program("program {layer.stiffness}")(benchmark_cases()[0])


def test_the_command_scores_a_program(run, tmp_path):
    program = f"{sys.executable} -c 'print(2e3)'"
    words = ("--program", program, "--kind", "elastic", "--output", tmp_path)
    assert "5 of 5" in run("benchmark", *words)[1]
    assert (tmp_path / "benchmark.csv").read_text().count("\n") == 6


def test_the_page_prints_the_stored_scores():
    text = study.PAGE.read_text(encoding="utf-8")
    assert study.score_table() in text.split(study.START)[1].split(study.END)[0]


@pytest.mark.parametrize("way", ["underlay, exact law alone", "dimitriadis2002", "Hertz (half-space)"])
def test_the_stored_scores_are_those_of_today(way):
    asked = dict(study.ways())[way]
    stored = [
        float(row["error (%)"])
        for row in study.table(study.RESULTS.read_text(encoding="utf-8"))
        if (row["way"], row["kind"]) == (way, "elastic")
    ]
    found = ul.benchmark(**asked, kinds=["elastic"]).to_frame()["error (%)"]
    # A fit stops within a thousandth of its standard error, some 1 % here.
    assert found.tolist() == pytest.approx(stored, abs=0.01)
