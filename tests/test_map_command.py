"""`underlay map` as a user meets it."""

from functools import partial

import pandas as pd
import pytest

from support.maps import SCENE_TOML, write_folder
from underlay.inference.batch import work as batch_work
from underlay.inference.batch.curves import list_curves

COUNT = 12


@pytest.fixture
def run(run):
    """Call `underlay map`: (exit code, stdout, stderr)."""
    return partial(run, "map")


@pytest.fixture
def site(tmp_path):
    """Arguments of a run, all but the output, and the folder of the curves."""
    folder = write_folder(tmp_path / "curves", COUNT)
    (folder / "site-0005.csv").write_text("", encoding="utf-8")
    scene = tmp_path / "scene.toml"
    scene.write_text(SCENE_TOML, encoding="utf-8")
    words = (folder, "--scene", scene, "--manifest", folder / "manifest.csv", "--workers", 0)
    return words, folder


def test_it_writes_a_table_and_a_picture_and_names_what_failed(run, site, tmp_path):
    words, _ = site
    book = tmp_path / "map.xlsx"
    code, out, _ = run(*words, "--output", tmp_path / "new" / "out", "--excel", book)
    assert code == 0
    sheets = pd.read_excel(book, sheet_name=None)
    assert list(sheets) == ["results", "settings", "curves"]
    assert list(sheets["curves"]["name"]) == [f"site-{index:04d}.csv" for index in range(COUNT)]
    assert "[indenter]" in set(sheets["settings"]["value"])
    assert "12: 11 good, 0 check, 0 reject, 1 without a fit" in out
    assert "failed: site-0005.csv: site-0005.csv is empty" in out
    table = pd.read_csv(tmp_path / "new" / "out" / "map.csv")
    assert list(table["name"]) == [f"site-{index:04d}.csv" for index in range(COUNT)]
    assert table["layer.thickness"].between(0.9e-3, 2.1e-3).all()
    assert (tmp_path / "new" / "out" / "map.png").read_bytes().startswith(b"\x89PNG")


def test_the_next_step_names_the_groups(run, site, tmp_path):
    words, folder = site
    manifest = pd.read_csv(folder / "manifest.csv")
    for column, groups, told in (
        ("group", ["sham", "treated"], "--by animal --group group"),
        ("group", ["sham", "sham"], "--by animal"),
    ):
        labels = {
            "animal": [f"a{i % 6}" for i in range(COUNT)],
            column: [groups[i % 2] for i in range(COUNT)],
        }
        manifest.assign(**labels).to_csv(folder / "manifest.csv", index=False)
        code, out, _ = run(*words, "--quick", "--output", tmp_path / f"out-{groups[1]}")
        assert code == 0
        assert out.splitlines()[-1 if "failed" not in out.splitlines()[-1] else -2].endswith(told)


def test_a_review_is_filled_in_and_read_back(run, site, tmp_path):
    words, _ = site
    out = tmp_path / "out"
    assert run(*words, "--output", out, "--review")[0] == 0
    assert (out / "review.html").read_text().count("<article") == COUNT
    filled = (out / "decisions.csv").read_text().replace("site-0003.csv,,", "site-0003.csv,refuse,on glass")
    (tmp_path / "mine.csv").write_text(filled)
    again = ("--output", out, "--resume", "--decisions", tmp_path / "mine.csv", "--review")
    code, printed, _ = run(*words, *again)
    assert code == 0
    assert "12: 10 good, 0 check, 0 reject, 2 without a fit" in printed
    row = pd.read_csv(out / "map.csv").set_index("name").loc["site-0003.csv"]
    assert (row["decision"], row["decision_reason"]) == ("refuse", "on glass")
    assert row["layer.E"] > 0.0
    assert "site-0003.csv,refuse,on glass" in (out / "decisions.csv").read_text()
    (tmp_path / "mine.csv").write_text("curve,decision,reason\nsite-0003.csv,refuse,\n")
    code, printed, err = run(*words, *again)
    assert (code, printed) == (2, "")
    assert "say in the column 'reason'" in err


def test_what_a_killed_run_leaves_among_the_curves_is_no_curve(site):
    _, folder = site
    before = [place.name for place in list_curves(folder)]
    for end in ("", "-wal", "-shm", "-journal"):
        (folder / f"map.csv.journal{end}").write_bytes(b"rows")
        (folder / f"a.chain{end}").write_bytes(b"rows")
    assert [place.name for place in list_curves(folder)] == before


def test_a_review_among_the_curves_is_no_curve(run, site):
    words, folder = site
    assert run(*words, "--output", folder, "--review")[0] == 0
    again = ("--output", folder, "--resume", "--decisions", folder / "decisions.csv", "--review")
    code, printed, err = run(*words, *again)
    assert (code, err) == (0, "")
    assert "12: 11 good" in printed


def test_an_excel_file_among_the_curves_is_refused(run, refused, site, tmp_path):
    """A workbook may be a curve: a run that is continued would find one more, and be another."""
    words, folder = site
    for where in (words, (tmp_path, *words[1:], "--folders", "group")):
        asked = ("--output", tmp_path / "out", "--excel", folder / "map.xlsx")
        assert "lies among the curves" in refused(*where, *asked)
    assert not (tmp_path / "out").exists()
    beside = folder / "made" / "map.xlsx"
    assert run(*words, "--output", tmp_path / "out", "--excel", beside)[0] == 0
    assert run(*words, "--output", tmp_path / "out", "--excel", beside, "--resume")[0] == 0


def test_ctrl_c_keeps_everything_and_resume_goes_on(run, done, refused, site, tmp_path, monkeypatch):
    words, _ = site
    original = batch_work.CurveFitter._row
    fitted = []

    def row(self, place):
        if len(fitted) == 4:
            raise KeyboardInterrupt
        fitted.append(place.index)
        return original(self, place)

    with monkeypatch.context() as patch:
        patch.setattr(batch_work.CurveFitter, "_row", row)
        code, _, err = run(*words, "--output", tmp_path / "out")
    assert code == 130
    assert "what was finished is kept" in err
    assert len(pd.read_csv(tmp_path / "out" / "map.csv")) == 4
    assert "--resume" in refused(*words, "--output", tmp_path / "out")
    assert "Curves          12:" in done(*words, "--output", tmp_path / "out", "--resume")


def test_bad_input_is_one_line(refused, site, tmp_path):
    words, folder = site
    a_file = tmp_path / "a file"
    a_file.write_text("x", encoding="utf-8")
    manifest = folder / "manifest.csv"
    manifest.write_text(manifest.read_text(encoding="utf-8") + "ghost.csv,1,0,0\n", encoding="utf-8")
    for given, message in (
        ((*words, "--output", tmp_path / "out"), "ghost.csv"),
        ((*words, "--output", a_file), "cannot write"),
        ((*words, "--format", "xlsx"), "csv or parquet"),
        ((tmp_path / "nowhere", *words[1:], "--output", tmp_path / "out"), "nowhere"),
    ):
        assert message in refused(*given)
    assert not (tmp_path / "out" / "map.csv").exists()
