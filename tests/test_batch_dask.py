"""A cluster on one machine: the same table, also when a worker is killed in the middle."""

import os
import re
import signal
import subprocess
import sys
import threading
import time

import pandas as pd
import pytest

import underlay as ul
from support import maps
from support.maps import SCENE_TOML, made_curve, made_manifest, numbers, rows_in, write_folder
from underlay.errors import SchedulerError

distributed = pytest.importorskip("distributed")
COUNT = 40

WORKER = """
import sys, time
sys.path[:0] = {path!r}
from underlay.inference.batch import work as batch_work
row = batch_work.CurveFitter._row
batch_work.CurveFitter._row = lambda self, place: time.sleep({pause}) or row(self, place)
from distributed.cli.dask_worker import main
main([{address!r}, "--nthreads", "1", "--no-dashboard", "--death-timeout", "30", "--no-nanny"])
"""


SCHEDULER = [sys.executable, "-m", "distributed.cli.dask_scheduler", "--host", "127.0.0.1", "--port", "0"]
SCHEDULER += ["--no-dashboard"]


@pytest.fixture(scope="module")
def cluster():
    """Address of a scheduler with two worker processes, and the workers."""
    environment = os.environ | {
        "OMP_NUM_THREADS": "1",
        "OPENBLAS_NUM_THREADS": "1",
        "PYTHONPATH": os.pathsep.join(sys.path),
    }
    scheduler = subprocess.Popen(
        SCHEDULER,
        stderr=subprocess.PIPE,
        text=True,
        env=environment,
    )
    address = next(
        match[0] for line in scheduler.stderr if (match := re.search(r"tcp://127\.0\.0\.1:\d+", line))
    )
    script = WORKER.format(path=sys.path, address=address, pause=0.15)
    workers = [
        subprocess.Popen([sys.executable, "-c", script], stderr=subprocess.DEVNULL, env=environment)
        for _ in range(2)
    ]
    yield address, workers
    for process in (*workers, scheduler):
        process.kill()
        process.wait()
    scheduler.stderr.close()


@pytest.fixture(scope="module")
def serial():
    return fit(workers=0)


def fit(**options):
    curves = [made_curve(index) for index in range(COUNT)]
    return maps.fit(curves, made_manifest(COUNT), **options)


def test_a_cluster_gives_the_same_bits_though_a_worker_is_killed(cluster, serial, tmp_path):
    address, workers = cluster
    journal = tmp_path / "map.csv.journal"
    killed = []

    def kill_when_it_runs():
        while not journal.exists() or rows_in(journal) < 5:
            time.sleep(0.01)
        killed.append(rows_in(journal))
        workers[0].send_signal(signal.SIGKILL)

    killer = threading.Thread(target=kill_when_it_runs, daemon=True)
    killer.start()
    table = fit(scheduler=address, timeout=60.0, output=tmp_path)
    killer.join(timeout=10.0)
    # Killed in the middle: some rows were there, most were not.
    assert 0 < killed[0] < COUNT
    assert table["name"].is_unique
    pd.testing.assert_frame_equal(numbers(table), numbers(serial), check_exact=True)


def test_files_that_the_workers_do_not_see_are_refused(cluster, tmp_path, monkeypatch):
    address, _ = cluster
    folder = write_folder(tmp_path / "curves", 3)
    scene = tmp_path / "scene.toml"
    scene.write_text(SCENE_TOML, encoding="utf-8")
    options = {"manifest": folder / "manifest.csv", "scheduler": address}
    options["options"] = ul.MapOptions(timeout=60.0)
    seen = ul.fit_many(folder, scene, **options)
    assert (seen["status"] == "fitted").all()
    monkeypatch.setattr("underlay.inference.batch.dask._sees", lambda _: False)
    with pytest.raises(SchedulerError, match="does not see"):
        ul.fit_many(folder, scene, **options)


def test_a_scheduler_without_workers_is_one_error():
    scheduler = subprocess.Popen(
        SCHEDULER,
        stderr=subprocess.PIPE,
        text=True,
    )
    try:
        address = next(
            match[0] for line in scheduler.stderr if (match := re.search(r"tcp://127\.0\.0\.1:\d+", line))
        )
        # A scheduler loads much when it is first spoken to: that is not what is timed here.
        distributed.Client(address, timeout=60.0, set_as_default=False).close()
        with pytest.raises(SchedulerError, match="has no workers"):
            fit(scheduler=address, timeout=3.0)
    finally:
        scheduler.kill()
        scheduler.wait()
        scheduler.stderr.close()
