"""A cluster on one machine: the same table, also when a worker is killed in the middle."""

import os
import re
import signal
import subprocess
import sys

import pandas as pd
import pytest

import underlay as ul
from support import maps
from support.maps import SCENE_TOML, made_curve, made_manifest, numbers, write_folder

distributed = pytest.importorskip("distributed")
COUNT = 40
# A worker of two gets at least ten curves at once (`through_dask`): it dies within its first ones.
LAST = 6

WORKER = """
import os, signal, sys, time
sys.path[:0] = {path!r}
from underlay.inference.batch import work as batch_work
row, begun = batch_work.CurveFitter._row, []
def slowly(self, place):
    begun.append(place)
    if len(begun) == {last}:
        os.kill(os.getpid(), signal.SIGKILL)
    time.sleep({pause})
    return row(self, place)
batch_work.CurveFitter._row = slowly
from distributed.cli.dask_worker import main
main([{address!r}, "--nthreads", "1", "--no-dashboard", "--death-timeout", "30", "--no-nanny"])
"""


SCHEDULER = [sys.executable, "-m", "distributed.cli.dask_scheduler", "--host", "127.0.0.1", "--port", "0"]
SCHEDULER += ["--no-dashboard"]


@pytest.fixture(scope="module")
def cluster():
    """Address of a scheduler with two workers, and these: the first is killed at its sixth curve."""
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
    scripts = [WORKER.format(path=sys.path, address=address, pause=0.05, last=last) for last in (LAST, 0)]
    workers = [
        subprocess.Popen([sys.executable, "-c", script], stderr=subprocess.DEVNULL, env=environment)
        for script in scripts
    ]
    with distributed.Client(address, timeout=60.0, set_as_default=False) as client:
        client.wait_for_workers(len(workers), timeout=60.0)
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
    table = fit(scheduler=address, timeout=60.0, output=tmp_path)
    assert [worker.poll() for worker in workers] == [-signal.SIGKILL, None]
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
    monkeypatch.setattr("underlay.inference.batch.processes._sees", lambda _: False)
    with pytest.raises(ul.SchedulerError, match="does not see"):
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
        with pytest.raises(ul.SchedulerError, match="has no workers"):
            fit(scheduler=address, timeout=3.0)
    finally:
        scheduler.kill()
        scheduler.wait()
        scheduler.stderr.close()
