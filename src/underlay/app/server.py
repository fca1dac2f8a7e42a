"""The web server of the page: on this machine only, at an address with a one-time token."""

from __future__ import annotations

import html
import socket
import tempfile
import threading
import time
import webbrowser
from collections.abc import Callable
from pathlib import Path

from nicegui import app, ui

from underlay.app.pages.routes import add_pages
from underlay.app.security import Doorkeeper, Guard
from underlay.app.state import Home
from underlay.app.work import load_ahead

_HOST = "127.0.0.1"
_ICON = (
    "<svg xmlns='http://www.w3.org/2000/svg' viewBox='0 0 32 32'><rect y='18' width='32' height='7' "
    "fill='#56b4e9'/><rect y='25' width='32' height='7' fill='#5a5a5a'/><circle cx='16' cy='10' r='9' "
    "fill='#0072b2'/></svg>"
)
_REDIRECT = (
    '<!DOCTYPE html><meta charset="utf-8"><title>underlay</title>'
    '<meta http-equiv="refresh" content="0; url={address}"><a href="{address}">open the page</a>'
)
# Seconds that the file stays for a slow browser, and that the server may take to listen.
_KEPT, _LONGEST_START = 60.0, 30.0


def serve(folder: Path, port: int = 0, *, show: bool = True, tell: Callable[[str], None] = print) -> None:
    """Serve the page until Ctrl-C.

    Parameters
    ----------
    folder : Path
        Where the analyses are stored, made if absent.
    port : int
        Port on this machine; 0 takes a free one.
    show : bool
        Open a browser.
    tell : callable
        Called with the address.

    Raises
    ------
    FileAccessError
        If the folder cannot be written.
    """
    port = port or _free_port()
    names = [f"{name}:{port}" for name in (_HOST, "localhost")]
    keeper = Doorkeeper(names, f"underlay_{port}")
    home = Home(folder, keeper, f"http://{_HOST}:{port}")
    prepare(home)

    def begin() -> None:
        load_ahead()
        tell(home.new_address())
        if show:
            threading.Thread(target=_open_browser, args=(home, port), daemon=True).start()

    app.on_startup(begin)
    ui.run(
        host=_HOST,
        port=port,
        title="underlay",
        favicon=_ICON,
        show=False,
        reload=False,
        tailwind=False,
        show_welcome_message=False,
        language="en-US",
        reconnect_timeout=30.0,
        message_history_length=200,
        server_header=False,
    )


def prepare(home: Home) -> None:
    """Register pages, access control and shutdown of `home` with the application, before the server runs."""
    app.add_middleware(Guard, keeper=home.keeper)
    app.on_shutdown(home.close)
    add_pages(home)


def _open_browser(home: Home, port: int) -> None:
    """Open a browser once the port answers, by way of a private file.

    Every user of the machine can see command lines: the address with its token is in a file that only this user may
    read, and the browser is given only the file's name.
    """
    if not _listens(port):
        return
    with tempfile.TemporaryDirectory(prefix="underlay-") as folder:
        page = Path(folder) / "open.html"
        page.touch(mode=0o600)
        page.write_text(_REDIRECT.format(address=html.escape(home.new_address())), encoding="utf-8")
        webbrowser.open(page.as_uri())
        time.sleep(_KEPT)


def _listens(port: int) -> bool:
    """Wait until the port answers; return False if it does not within 30 s."""
    until = time.monotonic() + _LONGEST_START
    while time.monotonic() < until:
        with socket.socket() as probe:
            if probe.connect_ex((_HOST, port)) == 0:
                return True
        time.sleep(0.1)
    return False


def _free_port() -> int:
    with socket.socket() as probe:
        probe.bind((_HOST, 0))
        return int(probe.getsockname()[1])
