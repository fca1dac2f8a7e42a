"""What a newcomer does for a first number, a map, a posterior and a report, in the shell and on the page.

    python tests/studies/newcomer.py [--output FILE]

Every job is done from a file of a curve and what is known of the test: tip radius, Poisson's ratio, thickness. A
step is a command, a file that is filled in, a field that is typed into, or something pressed or dropped. Seconds
are what the program takes, from the first step to the result on the screen: the hand here has no pauses. Results
go to ``results/newcomer.csv``, with state ``after``; rows of an earlier state, which stand there with the commit
they were measured on by the same jobs, are kept. Needs Chromium.
"""

from __future__ import annotations

import argparse
import csv
import os
import re
import subprocess
import sys
import tempfile
import time
from pathlib import Path

HERE = Path(__file__).resolve().parent
sys.path[:0] = [str(HERE.parent), str(HERE.parents[1] / "src")]

from support import browser_page  # noqa: E402  after the path is set
from support.browser_page import CONNECTED, downloaded, says, server, until  # noqa: E402
from support.chromium import browser  # noqa: E402

SAMPLES = HERE.parents[1] / "data_samples"
#: Of each curve: file, and what its owner knows, by the key of a scene file and by the field of the page.
AFM = ("gel_on_glass.csv", {"radius": "5 um", "E": "5 kPa", "nu": "0.5", "thickness": "6 um"})
CARTILAGE = ("cartilage_on_bone.csv", {"radius": "1 mm", "E": "1 MPa", "nu": "0.46", "thickness": "2 mm"})
FIELDS = {"radius": "Indenter radius", "nu": "Poisson's ratio of the layer", "thickness": "Layer thickness"}
NUMBER = r"(?:Layer modulus|mean|median)[^\n]*?(\d[\d.]* (?:±|\()[^\n]*?[kM]?Pa|\d[\d.]* [kM]Pa)"


class Shell:
    """Commands in a folder, counted and timed."""

    def __init__(self, folder: Path) -> None:
        self.folder, self.steps, self.seconds, self.said = folder, 0, 0.0, ""

    def run(self, *words: object) -> None:
        """Run one command."""
        environment = os.environ | {"PYTHONPATH": os.pathsep.join(sys.path)}
        began = time.perf_counter()
        done = subprocess.run(
            [sys.executable, "-m", "underlay", *map(str, words)],
            cwd=self.folder,
            env=environment,
            capture_output=True,
            text=True,
            check=True,
        )
        self.seconds += time.perf_counter() - began
        self.steps, self.said = self.steps + 1, done.stdout

    def scene(self, curve: Path, known: dict[str, str]) -> Path:
        """Have a starter scene written and fill it in."""
        scene = self.folder / "scene.toml"
        self.run("formats", curve, "--new-scene", scene)
        text = scene.read_text(encoding="utf-8").replace('shape = "TODO"', 'shape = "sphere"')
        for key, value in known.items():
            quoted = value if key == "nu" else f'"{value}"'
            text = re.sub(rf'^{key} = "TODO[^"]*"', f"{key} = {quoted}", text, flags=re.MULTILINE)
        scene.write_text(text, encoding="utf-8")
        self.steps += 1
        return scene


class Page:
    """Actions in a tab, counted and timed."""

    def __init__(self, tab) -> None:
        self.tab, self.steps, self._began = tab, 0, time.perf_counter()

    @property
    def seconds(self) -> float:
        """Since the first action."""
        return time.perf_counter() - self._began

    def press(self, words: str) -> None:
        """Press a button."""
        browser_page.press(self.tab, words)
        self.steps += 1

    def drop(self, *files: Path) -> None:
        """Drop files on the start page, which begins an analysis of them."""
        browser_page.drop(self.tab, *files)
        self.steps += 1
        until(self.tab, f"location.pathname.startsWith('/analysis/') && {CONNECTED}")

    def enter(self, known: dict[str, str]) -> None:
        """Type what is known of the test into its form."""
        for key, label in FIELDS.items():
            number, _, unit = known[key].partition(" ")
            field = f"[...document.querySelectorAll('input')].find(e => e.ariaLabel === {label!r})"
            until(self.tab, f"Boolean({field})")
            self.tab.evaluate(f"(() => {{ const e = {field}; e.focus(); e.select(); }})()")
            self.tab.call("Input.insertText", text=number)
            self.steps += 1
            if unit and self._unit(label) != unit.replace("u", "µ"):
                self._choose(label, unit.replace("u", "µ"))
            time.sleep(0.6)

    def _unit(self, label: str) -> str:
        return self.tab.evaluate(f"{self._select(label)}.innerText.trim()")

    def _select(self, label: str) -> str:
        words = f'[aria-label="unit of {label}"]'
        return f"document.querySelector({words!r}).closest('.q-field')"

    def _choose(self, label: str, unit: str) -> None:
        self.tab.evaluate(f"{self._select(label)}.querySelector('.q-field__control').click()")
        browser_page.press(self.tab, unit, ".q-menu .q-item")
        self.steps += 1

    def shown(self, words: str) -> str:
        """Wait for words; return what the page says then."""
        until(self.tab, says(words))
        return self.tab.evaluate("document.body.innerText")


def in_the_shell(folder: Path) -> list[list[object]]:
    """Do every job with commands."""
    rows = []
    for job, (name, known) in (("AFM curve", AFM), ("cartilage curve", CARTILAGE)):
        place = folder / name
        place.mkdir()
        shell = Shell(place)
        scene = shell.scene(SAMPLES / name, known)
        if job == "cartilage curve":
            text = scene.read_text(encoding="utf-8")
            text = text.replace("[fit]\n", '[fit]\nlayer.thickness = { min = "0.2 mm", max = "10 mm" }\n')
            scene.write_text(text, encoding="utf-8")
        shell.run("fit", SAMPLES / name, "--scene", scene)
        rows.append([job, "shell", shell.steps, shell.seconds, _number(shell.said)])
    joint = SAMPLES / "joint"
    place, scene, curve = folder / "more", folder / AFM[0] / "scene.toml", SAMPLES / AFM[0]
    place.mkdir()
    jobs = {
        "map of six curves": (
            "map",
            joint / "curves",
            "--scene",
            joint / "scene.toml",
            "--manifest",
            joint / "manifest.csv",
        ),
        "posterior": ("sample", curve, "--scene", scene),
        "report": ("report", curve, "--scene", scene, "--output", place / "report.html"),
    }
    for job, words in jobs.items():
        shell = Shell(place)
        shell.run(*words)
        rows.append([job, "shell", shell.steps, shell.seconds, _number(shell.said) or "one page"])
    return rows


def on_the_page(folder: Path) -> list[list[object]]:
    """Do every job in a browser; the posterior and the report are of the AFM curve, once it is fitted."""
    rows = []
    taken = folder / "taken"
    taken.mkdir()
    with browser() as tab, server(folder / "home") as (_process, address):
        tab.open(address, width=1280, height=900, scheme="light")
        tab.call("Page.setDownloadBehavior", behavior="allow", downloadPath=str(taken))
        until(tab, CONNECTED)
        for job, (name, known) in (("cartilage curve", CARTILAGE), ("AFM curve", AFM)):
            page = Page(tab)
            page.drop(SAMPLES / name)
            page.press("2")
            if job == "cartilage curve":
                page.press("Cartilage on bone")
                until(tab, says("Next: the fit"))
            page.enter(known)
            page.press("Next: the fit")
            until(tab, says("half-space"))
            page.press("Fit")
            said = page.shown("Effects that were considered")
            rows.append([job, "page", page.steps, page.seconds, _number(said)])
            if job == "cartilage curve":
                browser_page.press(tab, "underlay")
                until(tab, f"location.pathname === '/' && {CONNECTED}")
        page = Page(tab)
        page.press("5")
        page.press("Report")
        downloaded(taken, ".html")
        rows.append(["report", "page", page.steps, page.seconds, "one page"])
        page = Page(tab)
        page.press("5")
        page.press("Sample")
        said = page.shown("Data and prediction")
        rows.append(["posterior", "page", page.steps, page.seconds, _number(said)])
        browser_page.press(tab, "underlay")
        until(tab, f"location.pathname === '/' && {CONNECTED}")
        page = Page(tab)
        page.press("Joint, six sites")
        page.press("4")
        page.press("Fit all curves")
        said = page.shown("Curves, worst first")
        rows.append(["map of six curves", "page", page.steps, page.seconds, _number(said)])
    return rows


def _number(said: str) -> str:
    """The first modulus that is said, with its interval."""
    found = re.search(NUMBER, said.replace("\n", " ")) or re.search(NUMBER, said)
    return "" if found is None else " ".join(found[1].split())


def _lines(path: Path) -> list[str]:
    return path.read_text(encoding="utf-8").splitlines(keepends=True) if path.exists() else []


def main() -> None:
    """Measure and write."""
    options = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    options.add_argument("--output", type=Path, default=HERE / "results" / "newcomer.csv")
    given = options.parse_args()
    with tempfile.TemporaryDirectory(prefix="underlay-newcomer-") as place:
        (Path(place) / "shell").mkdir()
        (Path(place) / "page").mkdir()
        rows = [*in_the_shell(Path(place) / "shell"), *on_the_page(Path(place) / "page")]
    rows.sort(key=lambda row: str(row[0]))
    load = f"load {os.getloadavg()[1]:.1f}, {os.cpu_count()} processors"
    kept = [line for line in _lines(given.output) if line.startswith(("before,", "# before"))]
    with given.output.open("w", encoding="utf-8", newline="") as file:
        file.write(f"# after: made by python tests/studies/newcomer.py; {load}\n")
        file.writelines(line for line in kept if line.startswith("#"))
        table = csv.writer(file)
        table.writerow(["state", "job", "where", "steps", "seconds", "result"])
        file.writelines(line for line in kept if not line.startswith("#"))
        table.writerows(
            ["after", job, where, steps, f"{seconds:.1f}", said] for job, where, steps, seconds, said in rows
        )
    print(given.output.read_text(encoding="utf-8"))


if __name__ == "__main__":
    main()
