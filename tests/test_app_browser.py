"""The page in a real browser: one analysis by keyboard, mouse and finger, and a decision that outlives a kill."""

import json
import tomllib
import zipfile
from pathlib import Path

import pytest

import underlay as ul
from support.browser_page import (
    CONTACT,
    choose,
    downloaded,
    drag,
    drop,
    drop_from_outside,
    enter,
    eventually,
    key,
    kill,
    press,
    says,
    server,
    step_by_arrows,
    swipe,
    tab_to,
    tap,
    until,
)
from support.chromium import browser, chromium

pytest.importorskip("nicegui")
pytestmark = pytest.mark.skipif(
    chromium() is None, reason="no Chromium on this machine: the page is not opened"
)

SAMPLES = Path(__file__).parents[1] / "data_samples"
SIZE = {"width": 1280, "scheme": "light"}


def words(tab, name):
    """What stands beside a slider."""
    return tab.evaluate(
        f"[...document.querySelectorAll('.slide')].find(e => e.innerText.startsWith({name!r}))"
        ".querySelector('.slide-value').innerText"
    )


def modulus(tab, before=""):
    """What the half-space says at this contact point, when it is there and another than before."""
    there = (
        "([...document.querySelectorAll('.fact')].find(e => e.innerText.startsWith('half-space'))?.innerText)"
    )
    return until(tab, f"{there} !== {before!r} && {there}")


def said_of_the_test(folder):
    return tomllib.loads((folder / "scene.toml").read_text())


def first_analysis_by_keyboard(tab, taken):
    """From nothing to a number and its spreadsheet with Tab, Enter and arrows alone."""
    enter(tab, "New analysis")
    choose(tab, SAMPLES / "cartilage_on_bone.csv", SAMPLES / "gel_on_glass.csv")
    until(tab, says("loading 681"))
    enter(tab, "Next: the test")
    enter(tab, "Cartilage on bone")
    enter(tab, "Next: the fit")
    before = modulus(tab), words(tab, "Contact")
    tab_to(tab, CONTACT)
    for _ in range(30):
        key(tab, "ArrowRight")
    modulus(tab, before[0])
    assert words(tab, "Contact") != before[1]
    for _ in range(30):
        key(tab, "ArrowLeft")
    enter(tab, "Fit")
    until(tab, says("Effects that were considered"))
    assert tab.evaluate(says("0.617"))
    step_by_arrows(tab, "5")
    enter(tab, "Spreadsheet")
    assert zipfile.is_zipfile(downloaded(taken, ".xlsx"))


def middle(tab, handle):
    """Where a handle of the curve can be taken, in the window."""
    return tab.evaluate(
        "(() => { document.querySelector('.handle').scrollIntoView({block: 'center'});"
        f"const b = document.querySelector('.handle .{handle} rect').getBoundingClientRect();"
        "return [b.x + b.width / 2, b.y + b.height / 2]; })()"
    )


def move(tab, handle, by, folder, *path, hand=drag):
    """Drag a handle: the laws follow, it stays where it was let go; what the scene file says then."""
    section, name = path

    def written():
        return said_of_the_test(folder).get(section, {}).get(name)

    x, y = middle(tab, handle)
    before, stood = modulus(tab), written()
    hand(tab, (x, y), (x + by, y))
    modulus(tab, before)
    # Pixels of the window are whole.
    assert eventually(lambda: abs(middle(tab, handle)[0] - x - by) < 2.0)
    # The file follows the handle, which may have stood in it before.
    said = eventually(lambda: now if (now := written()) != stood else None)
    return float(said.split()[0])


def handles_follow_the_mouse(tab, folder):
    """Contact point and both ends of the range, dragged; a pixel is worth the same everywhere on the axis."""
    press(tab, "3")
    modulus(tab)
    left, right = middle(tab, "low")[0], middle(tab, "high")[0]
    # The ends of the curve, in metres.
    first, last = -4e-5, 3e-4
    pixel = (last - first) / (right - left)
    start = first + (middle(tab, "contact")[0] - left) * pixel
    contact = move(tab, "contact", 60, folder, "instrument", "contact_depth")
    low = move(tab, "low", 20, folder, "curve", "min_depth")
    high = move(tab, "high", -90, folder, "curve", "max_depth")
    assert (contact, low, high) == pytest.approx(
        (start + 60 * pixel, first + 20 * pixel, last - 90 * pixel), abs=2.0 * pixel
    )
    until(tab, says("was changed since: press Fit again"))
    # Away from every handle there is nothing to take.
    x, y = middle(tab, "contact")
    drag(tab, (x + 40, y - 60), (x + 200, y - 60))
    assert middle(tab, "contact")[0] == pytest.approx(x, abs=0.5)


def handles_follow_a_finger(tab, folder):
    """On a tablet: a tap opens a step, and the contact point goes where a finger puts it."""
    tab.call("Emulation.setTouchEmulationEnabled", enabled=True, maxTouchPoints=1)
    tab.resize(820, 1180)
    for step in ("2", "3"):
        tap(tab, step)
        until(tab, f"document.querySelector('.q-tab--active').innerText.trim().startsWith({step!r})")
    modulus(tab)
    curve = said_of_the_test(folder)["curve"]
    low, high = (float(curve[end].split()[0]) for end in ("min_depth", "max_depth"))
    left, right = (middle(tab, end)[0] for end in ("low", "high"))
    move(tab, "contact", -30, folder, "instrument", "contact_depth", hand=swipe)
    pixel = (high - low) / (right - left)
    there = low + (middle(tab, "contact")[0] - left) * pixel

    def is_kept():
        return abs(float(said_of_the_test(folder)["instrument"]["contact_depth"].split()[0]) - there) < pixel

    assert eventually(is_kept)
    tab.call("Emulation.setTouchEmulationEnabled", enabled=False)


def many_and_a_decision(tab):
    press(tab, "4")
    press(tab, "Fit all curves")
    press(tab, "Reject ...")
    until(tab, "Boolean(document.querySelector('.q-dialog input'))")
    tab.evaluate("document.querySelector('.q-dialog input').focus()")
    tab.call("Input.insertText", text="air bubble")
    until(tab, "document.querySelector('.q-dialog input').value === 'air bubble'")
    press(tab, "Reject", ".q-dialog button")
    until(tab, says("decided: refuse air bubble"))


def nothing_is_cut_off(tab):
    """At the width of a small screen, and of a tablet both ways, there is nothing to scroll sideways."""
    for width, height in ((1180, 820), (820, 1180), (1280, 800)):
        tab.resize(width, height)
        until(tab, f"innerWidth === {width}")
        assert tab.evaluate("document.documentElement.scrollWidth") <= width


def listens_here_only(address):
    """No other machine reaches the page."""
    port = int(address.split(":")[2].split("/")[0])
    lines = [
        line.split()
        for table in ("tcp", "tcp6")
        for line in Path(f"/proc/net/{table}").read_text().splitlines()
    ]
    listening = [line[1] for line in lines if line[3] == "0A" and int(line[1].split(":")[1], 16) == port]
    assert listening == [f"0100007F:{port:04X}"]


def a_page_of_another_site_gets_nothing(tab, port):
    """What a page elsewhere can send to this machine, with the cookie that the browser has, is refused."""
    frame = f"http://127.0.0.1:{port}/"
    tab.open("data:text/html,elsewhere", **SIZE)
    assert tab.evaluate(
        f"fetch({frame!r}, {{credentials: 'include'}}).then(() => 'read', () => 'refused')"
    ) == ("refused")
    socket = f"ws://127.0.0.1:{port}/_nicegui_ws/socket.io/?EIO=4&transport=websocket"
    assert (
        tab.evaluate(
            f"new Promise(done => {{ const s = new WebSocket({socket!r});"
            "s.onopen = () => done('open'); s.onerror = () => done('refused'); })"
        )
        == "refused"
    )


def test_by_keyboard_and_mouse_from_drop_to_report_and_a_decision_that_outlives_a_kill(tmp_path):
    home, taken = tmp_path / "home", tmp_path / "taken"
    taken.mkdir()
    with browser() as tab:
        with server(home) as (process, address):
            tab.call("Page.setDownloadBehavior", behavior="allow", downloadPath=str(taken))
            tab.open(address, **SIZE)
            assert "token" not in tab.evaluate("location.href")
            first_analysis_by_keyboard(tab, taken)
            press(tab, "Report")
            assert "0.617" in downloaded(taken, ".html").read_text()
            (folder,) = home.iterdir()
            nothing_is_cut_off(tab)
            handles_follow_the_mouse(tab, folder)
            handles_follow_a_finger(tab, folder)
            many_and_a_decision(tab)
            nothing_is_cut_off(tab)
            listens_here_only(address)
            kill(process)
        (decision,) = ul.read_decisions(folder / "decisions.csv").by_curve.values()
        assert (decision.accepted, decision.reason) == (False, "air bubble")

        before = list(tab.events)
        with server(home) as (process, address):
            later = tab.open(address, **SIZE)
            press(tab, folder.name)
            press(tab, "4")
            until(tab, says("decided: refuse air bubble"))
            press(tab, "3")
            until(tab, says("Effects that were considered"))
            events = [*before, *later]
            a_page_of_another_site_gets_nothing(tab, address.partition("1:")[2].partition("/")[0])
    asked = [e["params"]["request"]["url"] for e in events if e["method"] == "Network.requestWillBeSent"]
    foreign = [url for url in asked if not url.startswith(("http://127.0.0.1:", "data:", "blob:"))]
    assert len(asked) > 10
    assert not foreign
    wrong = {"Runtime.exceptionThrown", "Log.entryAdded", "Runtime.consoleAPICalled"}
    # A server that was killed is missed by the browser: what it says of that is no fault of the page.
    said = [json.dumps(e["params"]) for e in events if e["method"] in wrong]
    # On a busy machine the socket's first try is late: then the page asks in turns, and tells the console so.
    harmless = ("ERR_CONNECTION", "WebSocket", "falling back to polling")
    assert not [entry for entry in said if not any(words in entry for words in harmless)]


# What stands out of its column, or has to be scrolled sideways within it; code has lines as long as they are.
_CUT_OFF = """
[...document.querySelectorAll('.side, .main')].filter(e => e.getClientRects().length).flatMap(column =>
  [...column.querySelectorAll('*')].filter(e => !e.closest('.code, .code-entry') && e.getClientRects().length
    && (e.getBoundingClientRect().right > column.getBoundingClientRect().right + 1
      || (e.matches('.q-table__middle') && e.scrollWidth > e.clientWidth + 1))
  ).map(e => `${e.tagName} ${e.className} ${(e.innerText || '').slice(0, 40)}`))
"""


def test_long_names_stay_in_their_places(tmp_path):
    name = "knee_left_medial_condyle_site_17_ball_1mm_after_thaw_second_load_operator_AB.csv"
    curve, words_only = tmp_path / name, tmp_path / f"no_curve_{name}"
    curve.write_bytes((SAMPLES / "cartilage_on_bone.csv").read_bytes())
    words_only.write_text("hello\nworld\n")
    with browser() as tab, server(tmp_path / "home") as (_, address):
        tab.open(address, **SIZE)
        enter(tab, "New analysis")
        choose(tab, curve, words_only)
        until(tab, says("loading 681"))
        assert tab.evaluate(_CUT_OFF) == []
        press(tab, "3")
        # A form that nobody filled in names what it misses.
        until(tab, says("Poisson's ratio of the layer"))
        press(tab, "2")
        press(tab, "Cartilage on bone")
        press(tab, "3")
        modulus(tab)
        press(tab, "Fit")
        until(tab, says("Effects that were considered"))
        assert tab.evaluate(_CUT_OFF) == []
        press(tab, "4")
        press(tab, "Fit all curves")
        until(tab, "document.querySelectorAll('.card').length === 2")
        assert tab.evaluate(_CUT_OFF) == []
        press(tab, "5")
        until(tab, says("Picture: fit.png"))
        assert tab.evaluate(_CUT_OFF) == []


def dismiss(tab, words):
    """Wait for a message that stays, and close it."""
    until(tab, says(words))
    press(tab, "OK", ".q-notification button")
    until(tab, f"!{says(words)}")


def is_seen(tab, handle):
    return tab.evaluate(f"Boolean(document.querySelector('.handle .{handle} rect'))")


def zoomed_by_button_and_wheel_and_moved_aside(tab):
    """Zooming in takes an end of the range out of sight, dragging beside the handles moves what is seen."""
    assert is_seen(tab, "low")
    press(tab, "zoom_in")
    until(tab, "!document.querySelector('.handle .low rect')")
    x, y = middle(tab, "contact")
    drag(tab, (x + 60, y - 80), (x + 160, y - 80))
    assert eventually(lambda: abs(middle(tab, "contact")[0] - x - 100) < 3.0)
    press(tab, "zoom_out_map")
    until(tab, "Boolean(document.querySelector('.handle .low rect'))")
    x, y = middle(tab, "contact")
    tab.call("Input.dispatchMouseEvent", type="mouseWheel", x=x, y=y - 80, deltaX=0, deltaY=-240)
    until(tab, "!document.querySelector('.handle .low rect')")
    # What is under the pointer stays there.
    assert eventually(lambda: abs(middle(tab, "contact")[0] - x) < 3.0)
    press(tab, "zoom_out_map")
    until(tab, "Boolean(document.querySelector('.handle .low rect'))")


def test_a_folder_a_failed_upload_and_zoom(tmp_path):
    folder = tmp_path / "curves"
    folder.mkdir()
    (folder / "inside.csv").write_bytes((SAMPLES / "gel_on_glass.csv").read_bytes())
    with browser() as tab, server(tmp_path / "home") as (_, address):
        tab.open(address, **SIZE)
        enter(tab, "New analysis")
        until(tab, "location.pathname.startsWith('/analysis/')")
        drop_from_outside(tab, folder)
        dismiss(tab, "a folder cannot be dropped")
        tab.call("Network.setBlockedURLs", urls=["*upload*"])
        drop(tab, SAMPLES / "gel_on_glass.csv")
        dismiss(tab, "The upload failed")
        tab.call("Network.setBlockedURLs", urls=[])
        drop(tab, SAMPLES / "gel_on_glass.csv", SAMPLES / "cartilage_on_bone.csv")
        until(tab, says("cartilage_on_bone.csv"))
        until(tab, says("loading 741"))
        press(tab, "2")
        press(tab, "Gel on glass")
        press(tab, "Next: the fit")
        modulus(tab)
        zoomed_by_button_and_wheel_and_moved_aside(tab)


# Words under a field that lie on something else than what the field stands in.
_WORDS_ON_OTHERS = """
[...document.querySelectorAll('.q-field__bottom')].filter(e => e.innerText.trim() && e.getClientRects().length)
  .flatMap(words => [...document.querySelectorAll(
      '.q-field__control, .q-field__bottom, .q-checkbox, .quiet, button')]
    .filter(other => {
      const a = words.getBoundingClientRect(), b = other.getBoundingClientRect();
      const beside = a.left < b.right - 1 && b.left < a.right - 1;
      return other !== words && b.width && beside && a.top < b.bottom - 1 && b.top < a.bottom - 1;
    }).map(other => `${words.innerText} | ${other.innerText || other.className}`))
"""


def type_into(tab, label, text):
    """Write into the first field of that name, in place of what stands there."""
    field = f"[...document.querySelectorAll('input')].find(e => e.getAttribute('aria-label') === {label!r})"
    until(tab, f"Boolean({field})")
    tab.evaluate(f"(() => {{ const e = {field}; e.focus(); e.select(); }})()")
    tab.call("Input.insertText", text=text)


def test_what_is_wrong_with_a_number_can_be_read_under_its_field(tmp_path):
    with browser() as tab, server(tmp_path / "home") as (_, address):
        tab.open(address, **SIZE)
        enter(tab, "New analysis")
        choose(tab, SAMPLES / "gel_on_glass.csv")
        until(tab, says("loading"))
        press(tab, "2")
        for number, label in enumerate(("Poisson's ratio of the layer", "Layer thickness", "min", "max"), 1):
            type_into(tab, label, "0,45")
            until(
                tab,
                "[...document.querySelectorAll('.q-field__bottom')].filter(e => e.innerText.includes("
                f"'with a point')).length === {number}",
            )
        # They come and go with a movement.
        assert eventually(lambda: tab.evaluate(_WORDS_ON_OTHERS) == [])
        nothing_is_cut_off(tab)
