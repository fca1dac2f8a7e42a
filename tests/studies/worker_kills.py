"""What killed workers do to a run: pools of pebble, whose workers share a pipe, against ours.

    python tests/studies/worker_kills.py [--kills 40] [--output FILE]

Two workers each. A worker is killed (SIGKILL) at a random moment, again and again; a pool that gives nothing
for 15 s has stopped. pebble's pools get tasks of about the size and length of our chunks (64 curves of 300
points, 20 ms) and begin anew where one stopped. Ours is `through_processes` itself, and every curve must come
out, once. Results go to ``results/worker_kills.json``. Needs the package pebble, which the library does without.
"""

from __future__ import annotations

import argparse
import json
import multiprocessing
import os
import signal
import sys
import threading
import time
from concurrent.futures import FIRST_COMPLETED, wait
from pathlib import Path

import numpy as np

import underlay as ul
from underlay.inference.batch.curves import CurvePlace
from underlay.inference.batch.model import BatchModel
from underlay.inference.batch.processes import through_processes
from underlay.inference.batch.results_table import Layout

STOPPED = 15.0
SCENE = ul.Scene(ul.Paraboloid(5e-4), ul.Layer(ul.Isotropic(1e6, 0.45), 1.5e-3), ul.RIGID)
FREE = {"layer.E": (1e4, 1e8), "instrument.contact_depth": (-5e-5, 5e-5)}


def chunk(curves: bytes) -> list[tuple[int, str]]:
    """Work for 20 ms and answer with 64 rows."""
    end = time.perf_counter() + 0.02
    while time.perf_counter() < end:
        pass
    return [(len(curves), "x" * 300)] * 64


def pebble_pool(rng: np.random.Generator, most: int) -> tuple[int, str]:
    """Kill workers of one pool; after how many kills it stopped, and how."""
    from pebble import ProcessExpired, ProcessPool  # noqa: PLC0415  of this study only

    pool = ProcessPool(2, context=multiprocessing.get_context("spawn"))
    curves = bytes(64 * 300 * 16)
    under_way = {pool.schedule(chunk, (curves,), timeout=60) for _ in range(4)}
    kills, last = 0, time.monotonic()
    following = last + 2.0
    while kills < most:
        done, under_way = wait(under_way, timeout=0.02, return_when=FIRST_COMPLETED)
        for future in done:
            error = future.exception()
            if error is None:
                last = time.monotonic()
            elif not isinstance(error, ProcessExpired):
                return kills, type(error).__name__
            under_way.add(pool.schedule(chunk, (curves,), timeout=60))
        now = time.monotonic()
        if now - last > STOPPED:
            return kills, f"nothing for {STOPPED:g} s"
        workers = [child for child in multiprocessing.active_children() if child.name.startswith("pebble")]
        if now > following and now - last < 0.5 and workers:
            os.kill(workers[rng.integers(len(workers))].pid or 0, signal.SIGKILL)
            kills, following = kills + 1, now + rng.uniform(0.4, 0.8)
    pool.stop()
    pool.join()
    return kills, ""


def ours(rng: np.random.Generator, most: int) -> tuple[int, str]:
    """Kill our workers; how many were killed, and what was wrong with the rows."""
    depth = np.linspace(-2e-5, 8e-5, 300)
    curve = ul.synthesize(SCENE, depth, ul.Noise(force=2e-4), rng=0)
    model = BatchModel(SCENE, FREE, None, ul.Auto(1e-4))
    layout = Layout.of(list(FREE), (), sampled=False)
    places = [CurvePlace(index, f"c{index}", curve=curve) for index in range(64 * 1000)]
    chunks = [places[start : start + 64] for start in range(0, len(places), 64)]
    rows, last, kills, given_up = 0, time.monotonic(), 0, 0
    over = threading.Event()

    def kill() -> None:
        nonlocal kills
        while not over.wait(rng.uniform(0.4, 0.8)) and kills < most:
            workers = multiprocessing.active_children()
            if workers and time.monotonic() - last < 0.5:
                os.kill(workers[rng.integers(len(workers))].pid or 0, signal.SIGKILL)
                kills += 1

    killer = threading.Thread(target=kill, daemon=True)
    killer.start()
    found: set[int] = set()
    for answer in through_processes(model, layout, chunks, 2):
        rows, last = rows + len(answer), time.monotonic()
        found.update(index for index, _ in answer)
        given_up += sum("died on this curve" in text for _, text in answer)
        if kills == most and rows > len(places) // 10:
            break
    over.set()
    killer.join()
    twice = rows - len(found)
    return kills, "" if not twice and not given_up else f"{twice} rows twice, {given_up} curves given up"


def main() -> None:
    """Measure and write."""
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0] if __doc__ else None)
    parser.add_argument("--kills", type=int, default=40)
    parser.add_argument("--pools", type=int, default=8)
    parser.add_argument(
        "--output", type=Path, default=Path(__file__).parent / "results" / "worker_kills.json"
    )
    given = parser.parse_args()
    rng = np.random.default_rng(0)
    results: dict[str, object] = {"ours (kills, what went wrong)": ours(rng, given.kills)}
    results["pebble (kills until it stopped, how), a pool each"] = [
        pebble_pool(rng, given.kills) for _ in range(given.pools)
    ]
    text = json.dumps(results, indent=2) + "\n"
    given.output.write_text(text, encoding="utf-8")
    sys.stdout.write(text)
    # A pool that stopped cannot be joined.
    sys.stdout.flush()
    for child in multiprocessing.active_children():
        child.kill()
    os._exit(0)


if __name__ == "__main__":
    main()
