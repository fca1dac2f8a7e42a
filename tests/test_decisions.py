"""Curves accepted and refused by hand: the gallery, its CSV, and what becomes of a decision."""

import re

import numpy as np
import pandas as pd
import pytest

import underlay as ul
from support.maps import SCENE, SOLVER, fit, made_curve, made_manifest, name
from underlay.inference.batch.decisions import REFUSED_BY_HAND, without_refused
from underlay.report import maps

COUNT = 6


def reviewed(table, curves, folder, **more):
    """The pages and the CSV of a review."""
    return ul.write_review(table, curves, SCENE, folder, options=ul.MapOptions(solver=SOLVER), **more)


@pytest.fixture(scope="module")
def gallery(tmp_path_factory):
    """(table, curves, folder, paths) of a map in which one curve has a step and one no contact."""
    curves = [made_curve(index, 120) for index in range(COUNT)]
    force = curves[2].force.copy()
    force[60:] += 6e-3
    curves[2] = ul.Curve(curves[2].depth, force, metadata={"name": "<script>alert(1)</script>"})
    flat = np.random.default_rng(0).normal(0.0, 1e-4, 120)
    curves[4] = ul.Curve(curves[4].depth, flat, metadata={"name": name(4)})
    rows = [{**row, "file": curves[n].metadata["name"]} for n, row in enumerate(made_manifest(COUNT))]
    table = fit(curves, rows, workers=0)
    folder = tmp_path_factory.mktemp("review")
    return table, curves, folder, reviewed(table, curves, folder)


def test_the_gallery_shows_every_curve_worst_first(gallery):
    table, _, _, paths = gallery
    assert [path.name for path in paths] == ["review.html", "decisions.csv"]
    text = paths[0].read_text(encoding="utf-8")
    assert text.count("<article") == text.count("<svg") == COUNT
    order = re.findall(r"<h2>\d+\. (.*?)</h2>", text)
    assert order[:2] == [name(4), "&lt;script&gt;alert(1)&lt;/script&gt;"]
    assert set(table["verdict"][[2, 4]]) == {"check", "refused"}
    # Blue is the fit: a curve without one has none.
    assert text.count('class="contact"') == COUNT - 1


def test_the_page_needs_nothing_from_outside_and_runs_nothing(gallery):
    text = gallery[3][0].read_text(encoding="utf-8")
    assert "<script" not in text
    assert "default-src 'none'" in text
    assert not re.findall(r'(?:src|href)="(?!review)', text)


def test_what_is_drawn_is_the_fit_of_the_table(gallery):
    """The misfit of each good curve is that of averaged white noise: rms / sqrt(6) of the largest force."""
    listed = pd.read_csv(gallery[3][1]).set_index("curve")
    good = listed[listed["verdict"] == "good"]["misfit (% of the force)"]
    expected = 100.0 * 2e-4 / np.sqrt(120 / 20) / np.ptp(made_curve(0, 120).force)
    assert (good < 3.0 * expected).all()
    assert listed["misfit (% of the force)"].max() > 5.0 * expected


def test_more_curves_than_a_page_holds_are_paged(gallery, tmp_path):
    table, curves, *_ = gallery
    paths = reviewed(table, curves, tmp_path, per_page=4)
    assert [path.name for path in paths] == ["review.html", "review-2.html", "decisions.csv"]
    assert [path.read_text().count("<article") for path in paths[:2]] == [4, 2]
    assert "<h2>5. " in paths[1].read_text()


def write(tmp_path, text):
    path = tmp_path / "decisions.csv"
    path.write_text(text, encoding="utf-8")
    return path


def test_decisions_come_back_and_are_kept_in_the_csv(gallery, tmp_path):
    table, curves, _, paths = gallery
    filled = pd.read_csv(paths[1], dtype={"decision": "str", "reason": "str"})
    filled.loc[filled["curve"] == name(1), ["decision", "reason"]] = ["Refuse", "=1+1 bubble; on glass"]
    filled.loc[filled["curve"].str.startswith("<"), "decision"] = "accept"
    filled.to_csv(tmp_path / "filled.csv", index=False)
    decisions = ul.read_decisions(tmp_path / "filled.csv")
    assert decisions.by_curve == {
        name(1): ul.Decision(False, "=1+1 bubble; on glass"),
        "<script>alert(1)</script>": ul.Decision(True),
    }
    again = reviewed(table, curves, tmp_path, decisions=decisions)
    assert ul.read_decisions(again[-1]) == decisions
    assert "decided: refuse: =1+1 bubble; on glass" in again[0].read_text()
    # In the file no cell begins as a formula does.
    assert "'=1+1" in again[-1].read_text()


def test_semicolons_and_order_of_columns_do_not_matter(tmp_path):
    path = write(tmp_path, "Reason;Curve;Decision\nwet;a.csv;REFUSE\n;b.csv;\n")
    assert ul.read_decisions(path) == ul.Decisions({"a.csv": ul.Decision(False, "wet")})


def test_a_refused_curve_keeps_its_numbers_and_counts_nowhere(gallery):
    table = gallery[0]
    judged = ul.Decisions({name(1): ul.Decision(False, "bubble"), name(3): ul.Decision(True)}).applied(table)
    row = judged.set_index("name").loc[name(1)]
    assert (row["status"], row["verdict"]) == (REFUSED_BY_HAND, "refused")
    assert row["reason"] == "refused by hand: bubble"
    assert row["layer.E"] == table["layer.E"][1]
    assert table["status"][1] == "fitted"
    assert np.isnan(without_refused(judged)["layer.E"][1])
    assert maps.decision_words(judged).startswith("By hand 1 refused and 1 accepted")
    assert list(maps.decision_table(judged).index) == [name(1), name(3)]
    assert maps.decision_words(table) == ""


def test_the_gallery_shows_the_fit_of_a_curve_refused_by_hand(gallery, tmp_path):
    table, curves, _, before = gallery
    decided = ul.Decisions({name(1): ul.Decision(False, "bubble")})
    pages = reviewed(decided.applied(table), curves, tmp_path, decisions=decided)
    text = pages[0].read_text(encoding="utf-8")
    assert text.count('class="contact"') == COUNT - 1
    card = re.search(rf"<h2>\d+\. {re.escape(name(1))}</h2>(.*?)</article>", text, re.DOTALL)[1]
    assert "refused; misfit " in card
    misfits = [pd.read_csv(path).set_index("curve").loc[name(1)].iloc[-2] for path in (before[1], pages[1])]
    assert misfits[0] == misfits[1]
    assert "± of one curve is at 95 %" in text
    # A path, since the file stands in the folder of the output.
    assert "--decisions</code> and the path of that file" in text


def test_a_population_leaves_out_the_refused_and_keeps_the_accepted():
    table = pd.DataFrame(
        {
            "name": list("abcdef"),
            "status": "fitted",
            "verdict": ["good", "good", "good", "good", "check", "check"],
            "reason": "",
            "animal": [1, 1, 2, 2, 3, 3],
            "layer.E": [1e6, 1.1e6, 1.2e6, 5e6, 1.1e6, 1.0e6],
            "layer.E.stderr": 2e4,
        }
    )
    decisions = ul.Decisions({"d": ul.Decision(False, "glass"), "e": ul.Decision(True, "looked at")})
    found = ul.population(decisions.applied(table), by=["animal"], doubtful="drop")
    left = [(entry.name, entry.reason) for entry in found.left_out]
    assert left == [("d", REFUSED_BY_HAND), ("f", "verdict check")]
    assert found.groups[""].curves == 4


@pytest.mark.parametrize(
    ("text", "error", "words"),
    [
        ("", ul.FileFormatError, "no line of names"),
        ("curve,decision\na,accept\n", ul.FileFormatError, "no column 'reason'"),
        ("curve,decision,reason\na,maybe,\n", ul.InputError, r"line 2 \(a\): decision must be accept, ref"),
        ("curve,decision,reason\na,refuse,\n", ul.InputError, "say in the column 'reason'"),
        ("curve,decision,reason\na,accept,\na,refuse,x\n", ul.InputError, "line 3 .*decided twice"),
        ("curve,decision,reason\na,accept,x,y,z\n", ul.FileFormatError, "line 2 has more cells"),
        ("curve,decision,reason\n" + "z" * 200_000 + ",accept,\n", ul.FileFormatError, "field larger"),
    ],
)
def test_a_wrong_table_of_decisions_is_refused_in_words(tmp_path, text, error, words):
    with pytest.raises(error, match=words):
        ul.read_decisions(write(tmp_path, text))


def test_decisions_of_another_map_are_refused(gallery):
    table, curves, folder, _ = gallery
    with pytest.raises(ul.InputError, match="no curve 'x' in this map"):
        ul.Decisions({"x": ul.Decision(True)}).applied(table)
    with pytest.raises(ul.InputError, match="has no fit"):
        ul.Decisions({name(4): ul.Decision(True)}).applied(table)
    with pytest.raises(ul.InputError, match="6 rows, but there are 5 curves"):
        reviewed(table, curves[:5], folder)
