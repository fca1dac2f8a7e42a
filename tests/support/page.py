"""A person in front of the page, without a browser: NiceGUI's simulation, behind our guard."""

import asyncio
import contextlib
import logging

import httpx
from nicegui import Client, core, ui
from nicegui.elements.upload_files import SmallFileUpload
from nicegui.testing import User
from nicegui.testing.user_simulation import user_simulation

from support.reports import text_in
from underlay.app.security import Doorkeeper
from underlay.app.server import prepare
from underlay.app.state import Home
from underlay.app.work import Worker

HOST = "test"
# How long (s) is waited for what comes; only a failure takes it.
PATIENCE = 60.0


@contextlib.asynccontextmanager
async def page(folder):
    """The page of a folder as a user sees it, let in; every error in a log is a failure."""
    complaints = []
    handler = logging.Handler(logging.ERROR)
    handler.emit = lambda record: complaints.append(record.getMessage())
    logging.getLogger("nicegui").addHandler(handler)
    home = Home(folder, Doorkeeper([HOST]), f"http://{HOST}")
    try:
        async with user_simulation(lambda: None) as user:
            prepare(home)
            user.home = home
            await user.open(home.new_address())
            try:
                yield user
            finally:
                home.close()
                for client in list(Client.instances.values()):
                    client.delete()
                # What the simulation tidies away would be this package: its pages live in it.
                Client.page_routes.clear()
    finally:
        logging.getLogger("nicegui").removeHandler(handler)
    # On a busy machine the simulation's own end is slower than it allows itself.
    assert not [words for words in complaints if not words.startswith("Could not cancel")], complaints


async def until(user: User, marker=None, seconds=PATIENCE, **what):
    """Wait until what has a mark is seen, or another `content`."""
    said = len(user.notify.messages)
    for _ in range(int(seconds / 0.1)):
        with contextlib.suppress(AssertionError):
            await user.should_see(**({"marker": marker} if marker else what), retries=1)
            return
        assert len(user.notify.messages) == said, user.notify.messages[said:]
    raise AssertionError(f"{marker or what} was not seen")


def press(user: User, marker):
    """Press what has a mark."""
    user.find(marker=marker).click()


async def bring(user: User, *files):
    """Drop files, given as paths or as (name, bytes)."""
    pairs = [(file.name, file.read_bytes()) if hasattr(file, "read_bytes") else file for file in files]
    (upload,) = user.find(kind=ui.upload, marker="drop").elements
    await upload.handle_uploads([SmallFileUpload(name, "text/csv", content) for name, content in pairs])


async def begin(user: User):
    """Start an analysis; its folder."""
    before = set(user.home._open)
    press(user, "new")
    await until(user, "drop")
    (name,) = set(user.home._open) - before
    return user.home._open[name].folder


async def at_the_fit(user: User, curve, task):
    """Begin an analysis of a curve of the gel, whose long tasks are `task`, and go to its fit: its folder."""
    folder = await begin(user)
    user.home.analysis(folder.name).long = Worker(f"support.worker_tasks:{task}", str(folder.path))
    await bring(user, curve)
    press(user, "step-2")
    press(user, "preset-gel_on_glass")
    await until(user, "to-fit")
    press(user, "step-3")
    await until(user, "modulus-half-space")
    return folder


def text_of(user: User, marker):
    """What the one element of that mark says."""
    (element,) = user.find(marker=marker).elements
    return element.text


def sheet_of(user: User):
    """What the page of the result says, as text: the last one that is shown."""
    return text_in(list(user.find(marker="sheet").elements)[-1].content)


def run(scenario):
    """Run a person's actions."""
    return asyncio.run(scenario)


def write(user: User, marker, text):
    """Write into a field, in place of what stands there."""
    for element in user.find(marker=marker).elements:
        with user.client:
            element.set_value(text)


async def until_said(user: User, words, seconds=PATIENCE):
    """Wait for a message with these words."""
    await wait_for(lambda: any(words in message for message in user.notify.messages), seconds)


def marks(user: User):
    """Every mark on the page."""
    return {mark for element in user.client.elements.values() for mark in element._markers}


def seen(user: User):
    """Marks of what is visible."""
    return {mark for element in user.client.elements.values() if element.visible for mark in element._markers}


async def changed(user: User, marker, before, seconds=PATIENCE):
    """Wait until a text is another one."""

    def is_another():
        # While it is drawn again there is none.
        with contextlib.suppress(AssertionError, ValueError):
            return text_of(user, marker) != before

    await wait_for(is_another, seconds)


def stranger(user: User):
    """Somebody on this machine who was not given an address."""
    client = httpx.AsyncClient(transport=httpx.ASGITransport(core.app), base_url=f"http://{HOST}")
    other = User(client)
    other.home = user.home
    return other


@contextlib.asynccontextmanager
async def second_browser(user: User):
    """Another browser, with an address of its own."""
    other = stranger(user)
    async with other.http_client:
        await other.open(user.home.new_address())
        yield other


async def press_until(user: User, marker, is_true, seconds=PATIENCE):
    """Press what has a mark until a condition holds: a press while the last task is tidied away is lost."""
    for _ in range(int(seconds / 5.0)):
        press(user, marker)
        with contextlib.suppress(AssertionError):
            await wait_for(is_true, 5.0)
            return
    raise AssertionError("it never came true")


async def wait_for(is_true, seconds=PATIENCE):
    """Wait until a condition holds."""
    for _ in range(int(seconds / 0.05)):
        if is_true():
            return
        await asyncio.sleep(0.05)
    raise AssertionError("it never came true")
