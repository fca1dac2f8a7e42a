"""What the page costs: memory with many files, and the time from a moved handle to the new picture.

    python tests/studies/page.py [memory] [speed] [--files 200] [--points 2000] [--moves 40] [--output FILE]

`underlay app` runs as people start it, in front of a headless Chromium. Memory is the proportional set size (a page
of memory that several processes share counts once) of the server and all its processes, without the browser, read
five times a second; the largest of each stage is kept. Times are of the browser's own clock on the curve of the
demo at 1280 x 800: from the key, or the move of the mouse, to both laws drawn for it; beside them stands the
load of the machine (processes that want one of its processors) before and after. Without a name both are measured;
results go to ``results/page.json``, where what was not measured stays. Needs Linux and Chromium.
"""

from __future__ import annotations

import argparse
import json
import os
import platform
import statistics
import sys
import tempfile
import threading
import time
from contextlib import suppress
from pathlib import Path

import numpy as np

HERE = Path(__file__).resolve().parent
sys.path[:0] = [str(HERE.parent), str(HERE.parents[1] / "src")]

import underlay as ul  # noqa: E402
from support import browser_page  # noqa: E402
from support.browser_page import (  # noqa: E402  after the path is set
    CONTACT,
    drag,
    drop,
    family,
    key,
    press,
    says,
    server,
    tab_to,
    until,
)
from support.chromium import browser  # noqa: E402

DEMO = HERE.parents[1] / "data_samples" / "cartilage_on_bone.csv"
# Puts the time of every new pair of laws over the curve, counted from the last key or move, into window.waits.
CLOCK = """(() => {
  window.waits = [];
  const begin = () => { window.began = performance.now(); };
  for (const name of ["keydown", "pointermove"]) document.addEventListener(name, begin, true);
  const laws = () => [...document.querySelectorAll(".handle polyline")].map(e => e.getAttribute("points")).join();
  let before = laws();
  new MutationObserver(() => {
    const now = laws();
    if (now && now !== before) { before = now; window.waits.push(performance.now() - window.began); }
  }).observe(document.querySelector(".handle"), {childList: true, subtree: true, attributes: true});
})()"""
TARGET_MB, TARGET_MS = 500.0, 200.0


class Scale:
    """The memory of a process and all that it started, by stage."""

    def __init__(self, number: int) -> None:
        self.peaks: dict[str, dict[str, float]] = {}
        self._number, self._stage, self._ends = number, "", threading.Event()
        self._thread = threading.Thread(target=self._watch, daemon=True)
        self._thread.start()

    def stage(self, name: str) -> None:
        """Count what follows under this name."""
        time.sleep(0.2)
        self._stage = name

    def end(self) -> None:
        """Stop reading."""
        self._ends.set()
        self._thread.join()

    def _watch(self) -> None:
        while not self._ends.wait(0.2):
            shares = [size for number in family(self._number) if (size := _proportional(number)) > 0.0]
            peak = self.peaks.setdefault(self._stage, {"MB": 0.0, "processes": 0})
            if sum(shares) > peak["MB"]:
                peak |= {"MB": round(sum(shares), 1), "processes": len(shares)}


def _proportional(number: int) -> float:
    """Proportional set size of a process (MB); zero if it is gone."""
    with suppress(OSError):
        for line in Path(f"/proc/{number}/smaps_rollup").read_text().splitlines():
            if line.startswith("Pss:"):
                return float(line.split()[1]) * 1024.0 / 1e6
    return 0.0


def write_curves(folder: Path, files: int, points: int) -> list[Path]:
    """Write curves on cartilage, each of its own stiffness."""
    rng = np.random.default_rng(23)
    depth = np.linspace(-3e-5, 2e-4, points)
    written = []
    for number in range(files):
        layer = ul.Layer(ul.Isotropic(1e6 * rng.lognormal(0.0, 0.2), 0.46), 2e-3)
        curve = ul.synthesize(
            ul.Scene(ul.Sphere(1e-3), layer, ul.RIGID),
            depth,
            ul.Noise(force=2e-4),
            rng=rng,
            solver=ul.Exact(1e-5),
        )
        rows = "".join(f"{d!r},{f!r}\n" for d, f in zip(depth.tolist(), curve.force.tolist(), strict=True))
        written.append(folder / f"animal{number % 10}-site{number:03d}.csv")
        written[-1].write_text("depth (m),force (N)\n" + rows)
    return written


def memory(tab, folder: Path, files: int, points: int) -> dict[str, object]:
    """Go through an analysis of many files and weigh it."""
    curves = folder / "curves"
    curves.mkdir()
    written = write_curves(curves, files, points)
    with server(folder / "many") as (process, address):
        scale = Scale(process.pid)
        scale.stage("start")
        tab.open(address, width=1280, height=800, scheme="light")
        press(tab, "New analysis")
        until(tab, "location.pathname.startsWith('/analysis/')")
        scale.stage("files brought and read")
        drop(tab, *written)
        until(tab, says(f"loading {points}"))
        press(tab, "2")
        press(tab, "Cartilage on bone")
        scale.stage("one curve fitted")
        press(tab, "Next: the fit")
        until(tab, says("half-space"))
        press(tab, "Fit", "button")
        until(tab, says("Effects that were considered"))
        scale.stage("all curves fitted, gallery made")
        press(tab, "4")
        press(tab, "Fit all curves")
        until(tab, "document.querySelectorAll('article.card').length > 20")
        scale.stage("gallery turned page by page")
        first = "document.querySelector('article.card .card-name')?.innerText"
        for page in ("2", "3", "4"):
            before = tab.evaluate(first)
            press(tab, page, ".q-pagination button")
            until(tab, f"{first} && {first} !== {before!r}")
        scale.stage("population")
        press(tab, "Mean and spread")
        until(tab, "Boolean(document.querySelector('.more'))")
        scale.stage("spreadsheet of all")
        press(tab, "5")
        tab.call("Page.setDownloadBehavior", behavior="deny")
        press(tab, "Spreadsheet of all")
        time.sleep(5.0)
        scale.end()
    peak = max(entry["MB"] for entry in scale.peaks.values())
    whole = {"files": files, "points": points, "python": platform.python_version()}
    return {"peak_MB": peak, "target_MB": TARGET_MB, **whole, "stages": scale.peaks}


def new_pictures(tab, act, count: int) -> list[float]:
    """Times (ms) from an action to the picture that it calls for, one after the other."""
    for number in range(count):
        act(number)
        until(tab, f"window.waits.length > {number}")
    waits = [float(wait) for wait in tab.evaluate("window.waits")]
    tab.evaluate("window.waits = []")
    return waits


def speed(tab, folder: Path, moves: int) -> dict[str, object]:
    """Move slider and handle of the demo's curve and time the pictures."""
    before = os.getloadavg()[0]
    with server(folder / "demo") as (_process, address):
        tab.open(address, width=1280, height=800, scheme="light")
        press(tab, "New analysis")
        # The start page takes files too, and makes an analysis of its own of them.
        until(tab, "location.pathname.startsWith('/analysis/')")
        drop(tab, DEMO)
        until(tab, says("loading 681"))
        press(tab, "2")
        press(tab, "Cartilage on bone")
        press(tab, "Next: the fit")
        until(tab, says("half-space"))
        time.sleep(2.0)
        tab.evaluate(CLOCK)
        tab_to(tab, CONTACT)
        tab.evaluate("window.waits = []")
        by_key = new_pictures(tab, lambda _number: key(tab, "ArrowRight"), moves)
        box = tab.evaluate(
            "(() => { const b = document.querySelector('.handle .contact rect').getBoundingClientRect();"
            "return [b.x + b.width / 2, b.y + b.height / 2]; })()"
        )
        mouse = {"type": "mouseMoved", "y": box[1], "button": "left", "buttons": 1}
        tab.call("Input.dispatchMouseEvent", type="mouseMoved", x=box[0], y=box[1])
        tab.call(
            "Input.dispatchMouseEvent", type="mousePressed", x=box[0], y=box[1], button="left", clickCount=1
        )
        tab.evaluate("window.waits = []")
        by_mouse = new_pictures(
            tab,
            lambda number: tab.call("Input.dispatchMouseEvent", x=box[0] + 3 * (number + 1), **mouse),
            moves,
        )
        end = box[0] + 3 * moves
        tab.call(
            "Input.dispatchMouseEvent", type="mouseReleased", x=end, y=box[1], button="left", clickCount=1
        )
        time.sleep(2.0)
        # A quick hand: what counts is when the picture of the last place is there.
        after = []
        for sign in (-1, 1) * 5:
            drag(tab, (end, box[1]), (end + sign * 60, box[1]), steps=60)
            end += sign * 60
            time.sleep(2.0)
            until(tab, "window.waits.length > 0")
            after.append(float(tab.evaluate("window.waits[window.waits.length - 1]")))
    return {
        "target_ms": TARGET_MS,
        "load": [round(before, 1), round(os.getloadavg()[0], 1)],
        "processors": os.cpu_count(),
        "slider_by_key_ms": _summary(by_key),
        "handle_by_mouse_ms": _summary(by_mouse),
        "end_of_a_quick_drag_ms": _summary(after),
    }


def _summary(times: list[float]) -> dict[str, float]:
    return {
        "median": round(statistics.median(times), 1),
        "95 %": round(float(np.percentile(times, 95)), 1),
        "longest": round(max(times), 1),
        "count": len(times),
    }


def main() -> None:
    """Measure and write."""
    options = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    options.add_argument("parts", nargs="*", choices=["memory", "speed"], default=["memory", "speed"])
    options.add_argument("--files", type=int, default=200)
    options.add_argument("--points", type=int, default=2000)
    options.add_argument("--moves", type=int, default=40)
    options.add_argument("--output", type=Path, default=HERE / "results" / "page.json")
    given = options.parse_args()
    # A busy machine is waited for: what is measured is memory, and times that are taken one by one.
    browser_page.PATIENCE = 300.0
    with tempfile.TemporaryDirectory(prefix="underlay-page-study-") as place, browser() as tab:
        found = json.loads(given.output.read_text()) if given.output.exists() else {}
        found["made by"] = "python tests/studies/page.py"
        if "memory" in given.parts:
            found["memory"] = memory(tab, Path(place), given.files, given.points)
        if "speed" in given.parts:
            found["speed"] = speed(tab, Path(place), given.moves)
    given.output.write_text(json.dumps(found, indent=1) + "\n")
    print(json.dumps(found, indent=1))


if __name__ == "__main__":
    main()
