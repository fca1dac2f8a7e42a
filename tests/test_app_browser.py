"""The page in a real browser: from a dropped file to report and spreadsheet; a decision outlives a kill."""

import os
import re
import signal
import subprocess
import sys
import time
import zipfile
from contextlib import contextmanager
from pathlib import Path

import pytest

from support.chromium import browser, chromium
from underlay.inference.batch.decisions import read_decisions

pytest.importorskip("nicegui")
pytestmark = pytest.mark.skipif(
    chromium() is None, reason="no Chromium on this machine: the page is not opened"
)

SAMPLES = Path(__file__).parents[1] / "data_samples"
PATIENCE = 120.0


@contextmanager
def server(folder):
    """`underlay app` on a folder: its process and its address."""
    # Told that it is tested, the server would wait for another tool's port.
    environment = {name: value for name, value in os.environ.items() if not name.startswith("PYTEST_")}
    environment |= {"PYTHONPATH": os.pathsep.join(sys.path), "PYTHONUNBUFFERED": "1"}
    process = subprocess.Popen(
        [sys.executable, "-m", "underlay", "app", str(folder), "--no-browser"],
        env=environment,
        stdout=subprocess.PIPE,
        text=True,
    )
    try:
        said = ""
        while (found := re.search(r"http://127\.0\.0\.1:\d+/\?token=\S+", said)) is None:
            line = process.stdout.readline()
            assert line, said
            said += line
        yield process, found[0]
    finally:
        process.terminate()
        process.wait(30.0)
        process.stdout.close()


def until(tab, expression):
    """Wait until an expression is true in the page."""
    end = time.monotonic() + PATIENCE
    while time.monotonic() < end:
        if tab.evaluate(f"Boolean({expression})"):
            return
        time.sleep(0.1)
    raise AssertionError(f"{expression} never came: {tab.evaluate('document.body.innerText')[:3000]}")


def says(words):
    return f"document.body.innerText.includes({words!r})"


def press(tab, words, kind="button, a, .q-tab"):
    """Press what begins with these words, when it is there."""
    there = (
        f"[...document.querySelectorAll({kind!r})].find(e => e.innerText.trim().startsWith({words!r}) "
        "&& !e.disabled && e.getClientRects().length)"
    )
    until(tab, there)
    tab.evaluate(f"{there}.click()")


def drop(tab, *files):
    """Put files into the place for them."""
    until(tab, "document.querySelector('input[type=file]')")
    answer = tab.call("Runtime.evaluate", expression="document.querySelector('input[type=file]')")
    names = [str(file) for file in files]
    tab.call("DOM.setFileInputFiles", files=names, objectId=answer["result"]["objectId"])


def downloaded(folder, ending):
    """Wait for a file to be there whole."""
    end = time.monotonic() + PATIENCE
    while time.monotonic() < end:
        for path in folder.iterdir():
            if path.name.endswith(ending):
                return path
        time.sleep(0.1)
    raise AssertionError(f"no {ending} among {[path.name for path in folder.iterdir()]}")


def kill(process):
    """End a process and its children as a failing machine would: at once."""
    children = Path(f"/proc/{process.pid}/task/{process.pid}/children").read_text().split()
    for number in [process.pid, *map(int, children)]:
        os.kill(number, signal.SIGKILL)


def test_from_drop_to_report_and_a_decision_that_outlives_a_kill(tmp_path):
    home, taken = tmp_path / "home", tmp_path / "taken"
    taken.mkdir()
    with browser() as tab:
        with server(home) as (process, address):
            tab.call("Page.setDownloadBehavior", behavior="allow", downloadPath=str(taken))
            tab.open(address, width=1280, scheme="light")
            assert "token" not in tab.evaluate("location.href")
            press(tab, "New analysis")
            drop(tab, SAMPLES / "cartilage_on_bone.csv", SAMPLES / "gel_on_glass.csv")
            until(tab, says("loading 681"))
            press(tab, "3")
            until(tab, says("half-space"))
            press(tab, "Fit", "button")
            until(tab, says("What acts in this test"))
            assert tab.evaluate(says("Layer modulus 0.6"))
            press(tab, "5")
            press(tab, "Excel")
            assert zipfile.is_zipfile(downloaded(taken, ".xlsx"))
            press(tab, "The page")
            assert "Layer modulus 0.6" in downloaded(taken, ".html").read_text()

            press(tab, "4")
            press(tab, "Fit all curves")
            press(tab, "Refuse ...")
            until(tab, "document.querySelector('.q-dialog input')")
            tab.evaluate("document.querySelector('.q-dialog input').focus()")
            tab.call("Input.insertText", text="air bubble")
            until(tab, "document.querySelector('.q-dialog input').value === 'air bubble'")
            press(tab, "Refuse", ".q-dialog button")
            until(tab, says("decided: refuse air bubble"))
            kill(process)
        (folder,) = home.iterdir()
        (decision,) = read_decisions(folder / "decisions.csv").by_curve.values()
        assert (decision.accepted, decision.reason) == (False, "air bubble")

        before = list(tab.events)
        with server(home) as (process, address):
            later = tab.open(address, width=1280, scheme="light")
            press(tab, folder.name)
            press(tab, "4")
            until(tab, says("decided: refuse air bubble"))
            press(tab, "3")
            until(tab, says("What acts in this test"))
            events = [*before, *later]
    asked = [e["params"]["request"]["url"] for e in events if e["method"] == "Network.requestWillBeSent"]
    foreign = [url for url in asked if not url.startswith(("http://127.0.0.1:", "data:", "blob:"))]
    assert len(asked) > 10
    assert not foreign
    wrong = {"Runtime.exceptionThrown", "Log.entryAdded", "Runtime.consoleAPICalled"}
    # A server that was killed is missed by the browser: what it says of that is no fault of the page.
    said = [e["params"] for e in events if e["method"] in wrong]
    assert not [
        entry for entry in said if "ERR_CONNECTION" not in str(entry) and "WebSocket" not in str(entry)
    ]
