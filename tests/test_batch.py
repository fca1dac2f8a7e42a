"""Many curves: each once, whatever fails, whatever ends the run, and the same to the last bit."""

import multiprocessing
import os
import re
import signal
import subprocess
import sys
import time

import numpy as np
import pandas as pd
import pytest

import underlay as ul
from support import maps
from support.maps import (
    FREE,
    SCENE,
    SCENE_TOML,
    SOLVER,
    TrapCurve,
    made_curve,
    made_manifest,
    numbers,
    rows_in,
    truth,
    write_folder,
)
from underlay.inference.batch import processes
from underlay.inference.batch import work as batch_work
from underlay.inference.batch.curves import CurvePlace
from underlay.inference.batch.model import BatchModel
from underlay.inference.batch.results_table import Layout
from underlay.inference.journal import Journal

COUNT = 24
RESUME = ul.MapOptions(resume=True)


def run(curves, manifest=None, *, workers=0, **options):
    return maps.fit(curves, manifest, workers=workers, **options)


@pytest.fixture(scope="module")
def curves():
    return [made_curve(index) for index in range(COUNT)]


@pytest.fixture(scope="module")
def manifest():
    return made_manifest(COUNT)


@pytest.fixture(scope="module")
def serial(curves, manifest):
    return run(curves, manifest)


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    return write_folder(tmp_path_factory.mktemp("map") / "curves", COUNT)


@pytest.fixture
def scene_file(tmp_path):
    path = tmp_path / "scene.toml"
    path.write_text(SCENE_TOML, encoding="utf-8")
    return path


def deviations(table, path):
    """Standard deviations of the statistical part."""
    return (table[f"{path}.stat.high"] - table[f"{path}.stat.low"]) / 3.92


def test_the_truth_is_found_with_its_uncertainty(serial):
    assert (serial["status"] == "fitted").all()
    true = pd.DataFrame([truth(index) for index in range(COUNT)])
    for path in FREE:
        pull = (serial[path] - true[path]) / deviations(serial, path)
        # 24 standard normal numbers: beyond 4.2 once in two thousand runs.
        assert np.abs(pull).max() < 4.2
        assert 0.5 < pull.std() < 1.7
    np.testing.assert_array_equal(serial["layer.thickness"], true["layer.thickness"])


def test_every_number_is_that_of_a_single_fit(curves, manifest, serial):
    quick = run(curves, manifest, answers=False)
    for index in (0, 7, COUNT - 1):
        scene = SCENE.with_values({"layer.thickness": manifest[index]["layer.thickness"]})
        single = ul.fit(ul.Problem(scene, curves[index], FREE, solver=SOLVER))
        row = serial.iloc[index]
        # Laws of a problem and of a map are solved over other ranges: each is within its tolerance of the
        # exact one.
        assert row["layer.E"] == pytest.approx(single.values["layer.E"], rel=1e-4)
        for path in FREE:
            known = single.answer(path)
            ends = [row[f"{path}.{end}"] for end in ("low", "high", "stat.low", "stat.high")]
            alone = [known.low, known.high, known.statistical.low, known.statistical.high]
            assert ends == pytest.approx(alone, rel=1e-3)
            # Without answers a row has the values and the errors of the fit, to a share of a standard error.
            assert quick[path][index] == pytest.approx(row[path], abs=0.01 * single.stderr[path])
            assert quick[f"{path}.stderr"][index] == pytest.approx(single.stderr[path], rel=1e-3)
        assert row["rms"] == pytest.approx(np.sqrt(np.mean(single.residuals[0] ** 2)), rel=1e-4)
        assert row["verdict"] == single.verdict.word
        assert all(reason in row["reason"] for reason in single.verdict.reasons)


@pytest.mark.parametrize(
    ("scene", "own"),
    [
        (SCENE, {"layer.nu": 0.3}),
        (ul.Scene(ul.Sphere(5e-4), SCENE.layer, ul.RIGID), {"layer.nu": 0.3}),
        (ul.Scene(ul.Paraboloid(5e-4), SCENE.layer, ul.Isotropic(3e5, 0.3)), {"layer.nu": 0.3}),
        (ul.Scene(ul.Sphere(5e-4), SCENE.layer, ul.Isotropic(1e7, 0.3)), {"layer.nu": 0.3}),
        # The buried layer stays as thick.
        (
            ul.Scene(ul.Paraboloid(5e-4), SCENE.layer, ul.Stack([SCENE.layer], ul.Isotropic(1e7, 0.3))),
            {"layer.thickness": 5e-4},
        ),
    ],
)
def test_a_row_with_a_number_of_its_own_is_that_of_a_map_of_it(scene, own):
    there = scene.with_values(own)
    depth = np.linspace(-3e-5, 6e-5, 200)
    curve = ul.synthesize(there, depth, ul.Noise(force=2e-4 * there.force(6e-5)), rng=3)
    with_own, plain = (
        ul.fit_many([curve], start, FREE, manifest, workers=0)
        for start, manifest in ((scene, [{"file": "curve 0", **own}]), (there, None))
    )
    for path in FREE:
        assert with_own[path][0] == pytest.approx(plain[path][0], rel=1e-9)


def test_any_number_of_workers_gives_the_same_bits(curves, manifest, serial):
    pd.testing.assert_frame_equal(
        numbers(run(curves, manifest, workers=2)), numbers(serial), check_exact=True
    )


def test_the_order_of_the_curves_leaves_no_trace(curves, manifest, serial):
    turned = run(curves[::-1], manifest)
    pd.testing.assert_frame_equal(
        numbers(turned).iloc[::-1].reset_index(drop=True), numbers(serial), check_exact=True
    )


def test_a_folder_a_list_of_files_and_memory_agree(folder, scene_file, serial):
    from_folder = ul.fit_many(folder, scene_file, manifest=folder / "manifest.csv", workers=0)
    files = sorted(folder.glob("site-*.csv"))
    from_files = ul.fit_many(files, scene_file, manifest=folder / "manifest.csv", workers=0)
    pd.testing.assert_frame_equal(numbers(from_folder), numbers(from_files), check_exact=True)
    assert list(from_folder["name"]) == list(serial["name"])
    assert np.allclose(from_folder["x"], serial["x"])
    # The same site with fewer points and rounded to seven digits: within its errors.
    pull = (from_folder["layer.E"] - serial["layer.E"]) / deviations(from_folder, "layer.E")
    assert np.abs(pull).max() < 5.0


def test_the_table_may_stand_among_its_curves(tmp_path, scene_file):
    folder = write_folder(tmp_path / "curves", 3)
    options = {"manifest": folder / "manifest.csv", "workers": 0, "output": folder}
    first = ul.fit_many(folder, scene_file, **options)
    again = ul.fit_many(folder, scene_file, options=RESUME, **options)
    pd.testing.assert_frame_equal(again, first)


DAMAGE = {
    "site-0003.csv": (lambda text: text.replace(text.splitlines()[60], "nan,nan"), "nan"),
    "site-0007.csv": (lambda _: "", "empty"),
    "site-0011.csv": (lambda text: text.replace("(um)", "(N)"), "unit|length|depth"),
    "site-0015.csv": (lambda _: noise_only(), "no contact"),
    "site-0019.csv": (lambda text: "\n".join(text.splitlines()[:5]), "points"),
    "site-0020.csv": (lambda _: "once upon a time there was a gel", "not recognised|no "),
}


def noise_only():
    rng = np.random.default_rng(8)
    rows = zip(np.linspace(-20.0, 80.0, 120), rng.normal(0.0, 0.2, 120), strict=True)
    return "depth (um),force (mN)\n" + "\n".join(f"{d:.5g},{f:.5g}" for d, f in rows)


def test_damaged_curves_are_rows_with_reasons_and_harm_no_other(tmp_path, scene_file, folder):
    whole = ul.fit_many(folder, scene_file, manifest=folder / "manifest.csv", workers=0)
    broken = write_folder(tmp_path / "curves", COUNT)
    for name, (damage, _) in DAMAGE.items():
        path = broken / name
        path.write_text(damage(path.read_text(encoding="utf-8")), encoding="utf-8")
    table = ul.fit_many(broken, scene_file, manifest=broken / "manifest.csv", workers=0)
    failed = table[table["status"] == "failed"]
    assert sorted(failed["name"]) == sorted(DAMAGE)
    for name, reason in failed.set_index("name")["reason"].items():
        assert pd.Series([reason]).str.contains(DAMAGE[name][1]).all(), (name, reason)
    assert (failed["verdict"] == "refused").all()
    assert failed["layer.E"].isna().all()
    kept = ~whole["name"].isin(DAMAGE)
    pd.testing.assert_frame_equal(
        numbers(table)[kept].drop(columns="path"), numbers(whole)[kept].drop(columns="path"), check_exact=True
    )


def test_a_curve_in_air_is_no_contact_for_a_map_and_for_a_single_fit():
    """With labels too: the likelihood that a population needs is not asked of a curve without one."""
    depth = np.linspace(-6e-7, 1e-6, 300)
    air = [ul.Curve(depth, np.random.default_rng(seed).normal(0.0, 3e-11, 300)) for seed in range(3)]
    scene = ul.Scene(ul.Paraboloid(5e-6), ul.Layer(ul.Isotropic(1e4, 0.5), 4e-6), ul.RIGID)
    free = {
        "layer.E": (10.0, 1e6),
        "instrument.contact_depth": (-3e-7, 4e-7),
        "instrument.baseline": None,
    }
    labels = [{"file": f"curve {number}", "animal": "M1"} for number in range(3)]
    for options in (ul.MapOptions(), ul.MapOptions(answers=False)):
        table = ul.fit_many(air, scene, free, manifest=labels, workers=0, options=options)
        assert (table["status"] == "failed").all()
        assert table["reason"].str.startswith("no contact: a constant force explains the curve").all()
    for curve in air:
        verdict = ul.fit(ul.Problem(scene, curve, free)).verdict
        assert verdict == "reject"
        assert verdict.reason.startswith("no contact: a constant force explains the curve")


def test_a_folder_without_curves_is_named_as_it_was_given(tmp_path):
    with pytest.raises(ul.InputError, match=f"^no curve in {re.escape(str(tmp_path))}: give a folder"):
        ul.fit_many(tmp_path, SCENE, FREE, workers=0)


def test_laws_are_shared_between_curves_of_other_thickness(curves, manifest, monkeypatch):
    built = []
    original = ul.Scene.contact_law
    monkeypatch.setattr(
        ul.Scene, "contact_law", lambda *given, **named: built.append(1) or original(*given, **named)
    )
    run(curves, manifest, answers=False)
    # Thickness between 0.65 and 1.35 of the middle: depth over thickness squared spans 4.3.
    assert len(built) <= 4


def test_the_verdict_speaks_of_what_the_fit_says(curves):
    depth = np.maximum(curves[0].depth, 0.0)
    stiffer = ul.Curve(curves[0].depth, curves[0].force * (1.0 + depth / depth.max()))
    row = run([stiffer]).iloc[0]
    alone = ul.fit(ul.Problem(SCENE, stiffer, FREE, solver=SOLVER))
    assert row["verdict"] == alone.verdict.word != "good"
    assert alone.verdict.reason in row["reason"]
    assert row["cause"] == alone.verdict.cause


def test_the_quality_check_can_be_asked_for(curves):
    table = run(curves[:2], quality=True)
    assert set(table["verdict"]) <= {"good", "check"}
    flat = ul.Curve(curves[0].depth, np.random.default_rng(1).normal(0, 1e-4, len(curves[0])))
    assert run([flat], quality=True).loc[0, "status"] == "failed"


# --- what ends a run ---------------------------------------------------------------------------------


def test_resume_computes_nothing_again(curves, manifest, serial, tmp_path, monkeypatch):
    output = tmp_path / "out"
    first = interrupted_after(5, curves, manifest, output, monkeypatch)
    assert first == 5
    fitted = count_fits(monkeypatch)
    table = run(curves, manifest, output=output, resume=True)
    assert len(fitted) == COUNT - 5
    pd.testing.assert_frame_equal(numbers(table), numbers(serial), check_exact=True)
    again = run(curves, manifest, output=output, resume=True)
    assert len(fitted) == COUNT - 5
    pd.testing.assert_frame_equal(again, table, check_exact=True)


def interrupted_after(count, curves, manifest, output, monkeypatch):
    """Press Ctrl-C after so many rows; rows in the table that is left."""
    original = batch_work.CurveFitter._row
    calls = []

    def row(self, place):
        if len(calls) == count:
            raise KeyboardInterrupt
        calls.append(place.index)
        return original(self, place)

    with monkeypatch.context() as patch:
        patch.setattr(batch_work.CurveFitter, "_row", row)
        with pytest.raises(KeyboardInterrupt):
            run(curves, manifest, output=output)
    return len(pd.read_csv(output / "map.csv"))


def count_fits(monkeypatch):
    original = batch_work.CurveFitter._row
    calls = []
    monkeypatch.setattr(
        batch_work.CurveFitter, "_row", lambda self, place: calls.append(place.index) or original(self, place)
    )
    return calls


SCRIPT = """
import os, signal, sys, threading
sys.path[:0] = {path!r}
from support.maps import *
from underlay.inference.journal import Journal
append, armed = Journal.append, []
def appended(self, rows):
    new = append(self, rows)
    if new and not armed:
        armed.append(threading.Timer({seconds}, os.kill, (os.getpid(), signal.SIGKILL)))
        armed[0].start()
    return new
Journal.append = appended
curves = [SlowCurve(made_curve(i)) for i in range({count})]
fit(curves, made_manifest({count}), workers={workers}, output={output!r}, resume=True)
"""


@pytest.mark.parametrize("workers", [0, 1])
def test_killed_at_any_time_each_curve_is_there_once(tmp_path, workers, serial):
    """kill -9 again and again at random times, then let it end: the table is the serial one."""
    output = tmp_path / "out"
    rng = np.random.default_rng(workers)
    environment = os.environ | {"OMP_NUM_THREADS": "1", "OPENBLAS_NUM_THREADS": "1"}
    rows = [0]
    for _ in range(2):
        # From its first row on a run has so long to live: a curve takes 0.05 s and more.
        script = SCRIPT.format(
            path=sys.path,
            seconds=rng.uniform(0.0, 0.1),
            count=COUNT,
            workers=workers,
            output=str(output),
        )
        done = subprocess.run([sys.executable, "-c", script], env=environment, timeout=120.0, check=False)
        assert done.returncode == -signal.SIGKILL
        rows.append(rows_in(output / "map.csv.journal"))
    # Each run was cut short, and each began where the one before had ended.
    assert 0 < rows[1] < rows[2] < COUNT
    curves = [made_curve(index) for index in range(COUNT)]
    table = run(curves, made_manifest(COUNT), output=output, resume=True)
    pd.testing.assert_frame_equal(numbers(table), numbers(serial), check_exact=True)


def test_a_killed_worker_costs_no_curve(curves, manifest, serial, monkeypatch):
    """A worker is killed when it has answered once."""
    original = processes._Worker.receive
    victims = []

    def receive(self):
        answer = original(self)
        if answer and not victims:
            victims.append(self)
            self._process.kill()
        return answer

    monkeypatch.setattr(processes._Worker, "receive", receive)
    table = run(curves, manifest, workers=1)
    assert victims
    pd.testing.assert_frame_equal(numbers(table), numbers(serial), check_exact=True)


def test_a_curve_that_kills_its_worker_or_keeps_it_costs_itself_only(curves):
    """In the middle of a chunk: those before it and after it are fitted."""
    curves = [curves[index % COUNT].with_metadata(name=f"c{index}") for index in range(32)]
    curves[5], curves[6] = TrapCurve(curves[5], "die"), TrapCurve(curves[6], "stay")
    table = run(curves, workers=1, time_limit=1.0)
    assert list(table.index[table["status"] == "failed"]) == [5, 6]
    assert "died" in table.loc[5, "reason"]
    assert "longer than 1 s" in table.loc[6, "reason"]


def test_workers_that_do_not_start_are_one_error(curves, monkeypatch):
    monkeypatch.setattr("multiprocessing.spawn.get_executable", lambda: b"/bin/false")
    with pytest.raises(ul.UnderlayError, match="did not start"):
        run(curves[:3], workers=1)


def test_what_the_running_script_defines_is_refused_with_the_way_out(tmp_path):
    """A prior of one's own in a script: workers do not run the script, and say so."""
    script = tmp_path / "script.py"
    script.write_text(OWN_PRIOR, encoding="utf-8")
    environment = os.environ | {"PYTHONPATH": os.pathsep.join(sys.path)}
    done = subprocess.run(
        [sys.executable, script], env=environment, capture_output=True, text=True, check=True, timeout=120
    )
    assert done.stdout.partition("worker")[0] == "one run of the script\n"
    assert "module that can be imported" in done.stdout


OWN_PRIOR = """
from support.maps import *
class Mine(ul.LogUniform):
    pass
print("one run of the script")
try:
    ul.fit_many([made_curve(0)], SCENE, {"layer.E": Mine(1e4, 1e8)}, workers=1)
except ul.UnderlayError as error:
    print(error)
"""


def test_leaving_early_ends_the_processes(curves):
    model = BatchModel(SCENE, FREE, None, SOLVER)
    layout = Layout.of(list(FREE), (), sampled=False)
    places = [CurvePlace(i, f"c{i}", curve=curve) for i, curve in enumerate(curves)]
    batches = processes.through_processes(model, layout, [[place] for place in places], 1)
    next(batches)
    assert len(multiprocessing.active_children()) == 1
    batches.close()
    assert not multiprocessing.active_children()


def test_a_full_disk_keeps_what_was_written(curves, manifest, serial, tmp_path, monkeypatch):
    output = tmp_path / "out"
    original = Journal._write
    calls = []

    def write(self, rows):
        calls.append(len(rows))
        if len(calls) == 7:
            # No further page: what SQLite meets where the disk is full.
            (pages,) = self._file.execute("PRAGMA page_count").fetchone()
            self._file.execute(f"PRAGMA max_page_count = {pages}")
            rows = dict(rows) | dict.fromkeys(range(100, 110), "x" * 4000)
        original(self, rows)

    with monkeypatch.context() as patch:
        patch.setattr(Journal, "_write", write)
        patch.setattr(batch_work, "HANDED_ON", -1.0)
        with pytest.raises(ul.FileAccessError, match=r"full.*6 curves are kept.*resume"):
            run(curves, manifest, output=output)
    assert len(pd.read_csv(output / "map.csv")) == 6
    table = run(curves, manifest, output=output, resume=True)
    pd.testing.assert_frame_equal(numbers(table), numbers(serial), check_exact=True)


# --- what is refused before any work -----------------------------------------------------------------


def test_another_run_in_the_same_place_is_refused(curves, manifest, tmp_path):
    output = tmp_path / "out"
    run(curves, manifest, output=output)
    with pytest.raises(ul.InputError, match="holds a run already"):
        run(curves, manifest, output=output)
    other = [dict(row) for row in manifest]
    other[3]["layer.thickness"] *= 1.0 + 1e-15
    resumed = ul.MapOptions(solver=SOLVER, resume=True)
    for change, what in (
        (lambda: run(curves, other, output=output, resume=True), "the manifest changed"),
        (lambda: run([*curves[1:], curves[0]], manifest, output=output, resume=True), "curves"),
        (
            lambda: ul.fit_many(
                curves,
                SCENE.with_values({"layer.nu": 0.46}),
                FREE,
                manifest,
                workers=0,
                output=output,
                options=resumed,
            ),
            "the scene changed",
        ),
        (
            lambda: ul.fit_many(
                curves,
                SCENE,
                {**FREE, "layer.E": (1e4, 1e7)},
                manifest,
                workers=0,
                output=output,
                options=resumed,
            ),
            "the fit changed",
        ),
    ):
        with pytest.raises(ul.InputError, match=what):
            change()


def test_a_changed_curve_file_is_not_mixed_in(tmp_path, scene_file):
    folder = write_folder(tmp_path / "curves", 4)
    output = tmp_path / "out"
    options = {"manifest": folder / "manifest.csv", "workers": 0, "output": output}
    ul.fit_many(folder, scene_file, **options)
    path = folder / "site-0002.csv"
    path.write_text(path.read_text(encoding="utf-8") + "81,1\n", encoding="utf-8")
    with pytest.raises(ul.InputError, match=r"site-0002\.csv"):
        ul.fit_many(folder, scene_file, options=RESUME, **options)


def test_bad_input_is_refused_before_any_work(curves, manifest, tmp_path, monkeypatch):
    fitted = count_fits(monkeypatch)
    a_file = tmp_path / "a file"
    a_file.write_text("x", encoding="utf-8")
    with pytest.raises(ul.InputError, match="given twice"):
        run([curves[0], curves[0]])
    with pytest.raises(ul.InputError, match=r"no row for 'site-0023\.csv'"):
        run(curves, manifest[:-1])
    with pytest.raises(ul.InputError, match="no such curve"):
        run(curves[:-1], manifest)
    with pytest.raises(ul.FileAccessError):
        run(curves, output=a_file / "below")
    with pytest.raises(ul.InputError, match="xlsx"):
        run(curves, output=tmp_path / "table.xlsx")
    with pytest.raises(ul.InputError, match="outside its bounds"):
        run(curves[:1], [{"file": "site-0000.csv", "layer.E": 1.0}])
    with pytest.raises(ul.UnderlayError, match="no folder or file"):
        run(tmp_path / "nowhere")
    (tmp_path / "void").mkdir()
    with pytest.raises(ul.InputError, match="no curve"):
        run(tmp_path / "void")
    with pytest.raises(ul.UnderlayError, match=r"layer\.thicknes"):
        ul.fit_many(curves, SCENE, {"layer.thicknes": None}, workers=0)
    with pytest.raises(ul.InputError, match="nothing is free"):
        ul.fit_many(curves, SCENE, workers=0)
    with pytest.raises(ul.InputError, match="workers"):
        run(curves, workers=-1)
    with pytest.raises(ul.InputError, match="Did you mean 'exact'"):
        ul.MapOptions(solver="exat")
    with pytest.raises(ul.InputError, match=r"a solver is a name.*got \{'methd': 'exact'\}"):
        ul.MapOptions(solver={"methd": "exact"})
    with pytest.raises(TypeError, match="'methd'"):
        ul.MapOptions(methd="exact")
    with pytest.raises(TypeError, match="'accuracy'"):
        ul.fit_many(curves, SCENE, FREE, workers=0, accuracy="quick")
    with pytest.raises(ul.InputError, match="time_limit"):
        ul.MapOptions(time_limit=0.0)
    with pytest.raises(ul.InputError, match="improper"):
        ul.fit_many(curves, SCENE, {"layer.E": None}, workers=0, options=ul.MapOptions(sampling=True))
    assert not fitted


def test_a_scheduler_that_does_not_answer_times_out_with_its_address(curves):
    pytest.importorskip("distributed")
    address = "tcp://127.0.0.1:9"
    before = time.monotonic()
    with pytest.raises(ul.SchedulerError, match=address):
        run(curves, scheduler=address, timeout=1.0)
    assert time.monotonic() - before < 20.0


def test_parquet_holds_the_same_table(curves, manifest, serial, tmp_path):
    pytest.importorskip("pyarrow")
    run(curves, manifest, output=tmp_path / "table.parquet")
    written = pd.read_parquet(tmp_path / "table.parquet")
    pd.testing.assert_frame_equal(numbers(written), numbers(serial), check_exact=True, check_dtype=False)


def test_posteriors_have_their_own_seeds_whatever_the_number_of_workers(curves):
    """The same draws from a worker and from this process."""
    options = {"sampling": ul.Sampling(walkers=8, max_steps=60, seed=3), "noise": ul.Noise()}
    one = run(curves[:3], workers=0, **options)
    two = run(curves[2::-1], workers=1, **options)
    pd.testing.assert_frame_equal(
        numbers(one), numbers(two).iloc[::-1].reset_index(drop=True), check_exact=True
    )
    assert one["seed"].is_unique
    assert list(one["converged"]) == [1, 1, 1]
    best = run(curves[:3])
    for path in FREE:
        assert (one[f"{path}.low"] < one[path]).all()
        assert (one[path] < one[f"{path}.high"]).all()
        assert (np.abs(one[path] - best[path]) < 3.0 * deviations(best, path)).all()
    other = run(
        curves[:1], workers=0, sampling=ul.Sampling(walkers=8, max_steps=60, seed=4), noise=ul.Noise()
    )
    assert other.loc[0, "layer.E"] == one.loc[0, "layer.E"]
    assert other.loc[0, "layer.E.stat.low"] != one.loc[0, "layer.E.stat.low"]
