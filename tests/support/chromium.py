"""A page in a headless Chromium, driven through the DevTools protocol over two pipes; no package needed."""

import json
import os
import select
import shutil
import signal
import subprocess
import sys
import tempfile
import time
from contextlib import contextmanager

BINARIES = ("chromium", "chromium-browser", "google-chrome", "chrome")
OPTIONS = (
    "--headless",
    "--no-sandbox",
    "--disable-gpu",
    "--disable-quic",
    "--no-first-run",
    "--disable-background-networking",
    "--disable-component-update",
    "--disable-sync",
    "--disable-dev-shm-usage",
    "--hide-scrollbars",
    "--remote-debugging-pipe",
)
PATIENCE = 60.0
# The protocol is spoken on descriptors 3 and 4. Copies first: one of the two may be 3 or 4 already.
ON_3_AND_4 = (
    "import os, sys; read, write = (os.dup(int(n)) for n in sys.argv[1:3]); "
    "read, write = os.dup(read), os.dup(write); os.dup2(read, 3); os.dup2(write, 4); "
    "os.execv(sys.argv[3], sys.argv[3:])"
)


def chromium():
    """Path of the browser, or None."""
    return next((path for name in BINARIES if (path := shutil.which(name))), None)


@contextmanager
def browser():
    """Start a browser with a fresh profile and end it, and it alone, afterwards."""
    to_read, to_write = os.pipe()
    from_read, from_write = os.pipe()
    with tempfile.TemporaryDirectory(prefix="underlay-page-", ignore_cleanup_errors=True) as profile:
        process = subprocess.Popen(
            [
                *(sys.executable, "-c", ON_3_AND_4, str(to_read), str(from_write)),
                *(chromium(), *OPTIONS, f"--user-data-dir={profile}", "about:blank"),
            ],
            pass_fds=(to_read, from_write),
            stdin=subprocess.DEVNULL,
            stdout=subprocess.DEVNULL,
            stderr=subprocess.DEVNULL,
            start_new_session=True,
        )
        os.close(to_read)
        os.close(from_write)
        try:
            yield Browser(to_write, from_read)
        finally:
            os.killpg(process.pid, signal.SIGTERM)
            try:
                process.wait(10.0)
            except subprocess.TimeoutExpired:
                os.killpg(process.pid, signal.SIGKILL)
                process.wait()
            os.close(to_write)
            os.close(from_read)


class Browser:
    """One tab of a running browser."""

    def __init__(self, write, read):
        self._write, self._read, self._held, self._count, self._session = write, read, b"", 0, None
        self.events = []
        target = next(
            entry for entry in self.call("Target.getTargets")["targetInfos"] if entry["type"] == "page"
        )
        attached = self.call("Target.attachToTarget", targetId=target["targetId"], flatten=True)
        self._session = attached["sessionId"]
        for domain in ("Page", "Network", "Runtime", "Log"):
            self.call(f"{domain}.enable")

    def call(self, method, **parameters):
        """Send a command and return its answer."""
        self._count += 1
        message = {"id": self._count, "method": method, "params": parameters}
        if self._session:
            message["sessionId"] = self._session
        os.write(self._write, json.dumps(message).encode() + b"\0")
        number = self._count
        answer = self._until(lambda entry: entry.get("id") == number)
        assert "error" not in answer, answer
        return answer["result"]

    def open(self, url, *, width, scheme, height=900):
        """Open `url` in a window of that size (pixels), light or dark; return the events of its loading."""
        self.events = []
        self.resize(width, height)
        self.call("Emulation.setEmulatedMedia", features=[{"name": "prefers-color-scheme", "value": scheme}])
        self.call("Page.navigate", url=url)
        self._until(lambda entry: entry.get("method") == "Page.loadEventFired")
        # The pictures of a data: address may be decoded after the load event.
        self.evaluate("Promise.all([...document.images].map(i => i.decode().catch(() => 0)))")
        return self.events

    def resize(self, width, height):
        """Make the window that large (pixels)."""
        self.call(
            "Emulation.setDeviceMetricsOverride",
            width=width,
            height=height,
            deviceScaleFactor=1,
            mobile=False,
        )

    def evaluate(self, expression):
        """Return the value of a JavaScript expression in the page."""
        answer = self.call("Runtime.evaluate", expression=expression, returnByValue=True, awaitPromise=True)
        assert "exceptionDetails" not in answer, answer
        return answer["result"].get("value")

    def wait_for(self, method):
        """Return the next event of that name, or the last one since the page was opened."""
        known = [entry for entry in self.events if entry["method"] == method]
        return known[-1] if known else self._until(lambda entry: entry.get("method") == method)

    def _until(self, wanted):
        end = time.monotonic() + PATIENCE
        while True:
            while b"\0" in self._held:
                text, _, self._held = self._held.partition(b"\0")
                entry = json.loads(text)
                if "method" in entry:
                    self.events.append(entry)
                if wanted(entry):
                    return entry
            ready, _, _ = select.select([self._read], [], [], max(0.0, end - time.monotonic()))
            piece = os.read(self._read, 1 << 20) if ready else b""
            assert piece, "the browser did not answer"
            self._held += piece
