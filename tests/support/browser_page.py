"""`underlay app` in a real browser: the server, and what a hand does at keyboard and mouse."""

import os
import re
import signal
import subprocess
import sys
import time
from contextlib import contextmanager, suppress
from pathlib import Path

PATIENCE = 60.0
# Name, virtual key code and what it writes.
KEYS = {
    "Tab": (9, ""),
    "Enter": (13, "\r"),
    "ArrowLeft": (37, ""),
    "ArrowRight": (39, ""),
    "ArrowUp": (38, ""),
    "ArrowDown": (40, ""),
}
# What of the slider takes the focus.
CONTACT = "document.querySelector('[aria-label=\"contact point\"] [tabindex]')"
# A page whose socket is late on a busy machine loads itself again: nothing is done before it is there.
CONNECTED = "window.did_handshake === true"
# More stops than a page has for Tab.
MOST_TABS = 250


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
        process.wait(60.0)
        process.stdout.close()


def family(number):
    """A process and all that it started, by number; those it started last come first."""
    found = [number]
    with suppress(OSError):
        for task in Path(f"/proc/{number}/task").iterdir():
            for child in (task / "children").read_text().split():
                found = [*family(int(child)), *found]
    return found


def kill(process):
    """End a process and all that it started as a failing machine would: at once."""
    for number in family(process.pid):
        with suppress(ProcessLookupError):
            os.kill(number, signal.SIGKILL)


def eventually(ask):
    """Ask until the answer is true; return it, or None where it never was."""
    end = time.monotonic() + PATIENCE
    while time.monotonic() < end:
        if value := ask():
            return value
        time.sleep(0.05)
    return None


def until(tab, expression):
    """Wait until an expression is true in the page; return its value."""

    def ask():
        # Between two pages there is none that could answer.
        with suppress(AssertionError):
            return tab.evaluate(expression)

    if value := eventually(ask):
        return value
    raise AssertionError(f"{expression} never came: {tab.evaluate('document.body.innerText')[:3000]}")


def says(words):
    return f"document.body?.innerText.includes({words!r})"


def button(words, kind="button, a, .q-tab"):
    """What begins with these words and can be pressed; undefined while there is no such thing."""
    return (
        f"[...document.querySelectorAll({kind!r})].find(e => e.innerText.trim().startsWith({words!r}) "
        "&& !e.disabled && e.getClientRects().length)"
    )


def press(tab, words, kind="button, a, .q-tab"):
    """Press what begins with these words, when it is there."""
    until(tab, f"Boolean({button(words, kind)})")
    tab.evaluate(f"{button(words, kind)}.click()")


def key(tab, name):
    """Press a key."""
    code, text = KEYS[name]
    parts = {"key": name, "code": name, "windowsVirtualKeyCode": code}
    tab.call("Input.dispatchKeyEvent", type="keyDown" if text else "rawKeyDown", text=text, **parts)
    tab.call("Input.dispatchKeyEvent", type="keyUp", **parts)


def tab_to(tab, wanted):
    """Press Tab until what an expression says has the focus."""
    until(tab, f"Boolean({wanted})")
    for _ in range(MOST_TABS):
        if tab.evaluate(f"document.activeElement === {wanted}"):
            return
        key(tab, "Tab")
    raise AssertionError(f"Tab never comes to {wanted}")


def enter(tab, words):
    """Go to what begins with these words by Tab, and press Enter."""
    tab_to(tab, button(words))
    key(tab, "Enter")


def step_by_arrows(tab, number):
    """Go to a step of the page: Tab stops at the one that is open, arrows go on from there."""
    tab_to(tab, "document.querySelector('.q-tab--active')")
    for _ in range(5):
        if tab.evaluate(f"document.activeElement.innerText.trim().startsWith({number!r})"):
            key(tab, "Enter")
            return
        key(tab, "ArrowRight")
    raise AssertionError(f"no arrow leads to step {number}")


def drop(tab, *files):
    """Put files into the place for them."""
    until(tab, f"{CONNECTED} && Boolean(document.querySelector('input[type=file]'))")
    answer = tab.call("Runtime.evaluate", expression="document.querySelector('input[type=file]')")
    names = [str(file) for file in files]
    tab.call("DOM.setFileInputFiles", files=names, objectId=answer["result"]["objectId"])


def drop_from_outside(tab, *paths):
    """Drag files or folders from the desktop onto the place for curves, and let go."""
    until(tab, f"{CONNECTED} && Boolean(document.querySelector('.q-uploader'))")
    x, y = tab.evaluate(
        "(() => { const b = document.querySelector('.q-uploader').getBoundingClientRect();"
        "return [b.x + b.width / 2, b.y + b.height / 2]; })()"
    )
    data = {"items": [], "files": [str(path) for path in paths], "dragOperationsMask": 1}
    for kind in ("dragEnter", "dragOver", "drop"):
        tab.call("Input.dispatchDragEvent", type=kind, x=x, y=y, data=data)


def choose(tab, *files):
    """Open the choice of files by Tab and Enter, and choose some."""
    tab.call("Page.setInterceptFileChooserDialog", enabled=True)
    # The start page takes files too, and makes an analysis of its own of them.
    until(tab, "location.pathname.startsWith('/analysis/')")
    until(tab, CONNECTED)
    tab_to(tab, "document.querySelector('.q-uploader input[type=file]')?.closest('a, button')")
    key(tab, "Enter")
    opened = tab.wait_for("Page.fileChooserOpened")
    names = [str(file) for file in files]
    tab.call("DOM.setFileInputFiles", files=names, backendNodeId=opened["params"]["backendNodeId"])


def drag(tab, start, end, steps=8):
    """Drag with the left button from a point of the window to another; each is (x, y) in pixels."""
    points = [
        tuple(a + (b - a) * step / steps for a, b in zip(start, end, strict=True))
        for step in range(steps + 1)
    ]
    mouse = {"button": "left", "clickCount": 1}
    tab.call("Input.dispatchMouseEvent", type="mouseMoved", x=start[0], y=start[1])
    tab.call("Input.dispatchMouseEvent", type="mousePressed", x=start[0], y=start[1], **mouse)
    for x, y in points[1:]:
        tab.call("Input.dispatchMouseEvent", type="mouseMoved", x=x, y=y, button="left", buttons=1)
    tab.call("Input.dispatchMouseEvent", type="mouseReleased", x=end[0], y=end[1], **mouse)


def swipe(tab, start, end, steps=8):
    """Drag with a finger from a point of the window to another."""
    for step in range(steps + 1):
        x, y = (a + (b - a) * step / steps for a, b in zip(start, end, strict=True))
        kind = "touchMove" if step else "touchStart"
        tab.call("Input.dispatchTouchEvent", type=kind, touchPoints=[{"x": x, "y": y}])
    tab.call("Input.dispatchTouchEvent", type="touchEnd", touchPoints=[])


def tap(tab, words):
    """Tap what begins with these words with a finger, when it is there."""
    until(tab, f"Boolean({button(words)})")
    x, y = tab.evaluate(
        f"(() => {{ const e = {button(words)}; e.scrollIntoView({{block: 'center'}});"
        "const b = e.getBoundingClientRect(); return [b.x + b.width / 2, b.y + b.height / 2]; })()"
    )
    tab.call("Input.dispatchTouchEvent", type="touchStart", touchPoints=[{"x": x, "y": y}])
    tab.call("Input.dispatchTouchEvent", type="touchEnd", touchPoints=[])


def downloaded(folder, ending):
    """Wait for a file to be there whole."""
    found = eventually(lambda: next(folder.glob(f"*{ending}"), None))
    assert found, f"no {ending} among {[path.name for path in folder.iterdir()]}"
    return found
