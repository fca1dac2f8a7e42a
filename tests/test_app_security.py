"""Who is let in to the page, and what a name of a file can do."""

import asyncio
import contextlib

import httpx
import pytest
from starlette.applications import Starlette
from starlette.responses import PlainTextResponse
from starlette.routing import Route, WebSocketRoute

import underlay as ul
from underlay.app.folder import AnalysisFolder, analyses, new_analysis, safe_name
from underlay.app.security import Doorkeeper, Guard

HOST = "127.0.0.1:8123"
HERE = f"http://{HOST}"


async def _page(_request):
    return PlainTextResponse("the page")


async def _socket(socket):
    await socket.accept()
    await socket.close()


def guarded():
    keeper = Doorkeeper([HOST], "underlay_8123")
    routes = [Route("/{rest:path}", _page, methods=["GET", "POST"]), WebSocketRoute("/ws", _socket)]
    return keeper, Guard(Starlette(routes=routes), keeper)


def ask(app, method="GET", path="/", jar=None, **headers):
    async def asked():
        transport = httpx.ASGITransport(app)
        async with httpx.AsyncClient(transport=transport, base_url=HERE, cookies=jar) as client:
            return await client.request(
                method, path, headers={k.replace("_", "-"): v for k, v in headers.items()}
            )

    return asyncio.run(asked())


def admitted():
    keeper, app = guarded()
    answer = ask(app, path=f"/?token={keeper.new_token()}")
    return keeper, app, dict(answer.cookies)


def test_a_token_opens_once_and_becomes_a_strict_cookie():
    keeper, app = guarded()
    token = keeper.new_token()
    answer = ask(app, path=f"/?token={token}")
    assert (answer.status_code, answer.headers["location"]) == (303, "/")
    said = answer.headers["set-cookie"].lower()
    assert "httponly" in said
    assert "samesite=strict" in said
    assert ask(app, jar=dict(answer.cookies)).text == "the page"
    assert ask(app, path=f"/?token={token}").status_code == 403
    assert ask(app, path="/?token=").status_code == 403
    assert ask(app).status_code == 403
    assert ask(app, jar={"underlay_8123": "guessed"}).status_code == 403


@pytest.mark.parametrize("path", ["/analysis/x", "/_nicegui/client/1/upload/2"])
def test_a_token_opens_the_front_door_only(path):
    keeper, app = guarded()
    assert ask(app, path=f"{path}?token={keeper.new_token()}").status_code == 403


def test_another_page_is_refused_even_with_the_cookie():
    _, app, jar = admitted()
    assert ask(app, "POST", jar=jar, origin=HERE).text == "the page"
    assert ask(app, "POST", jar=jar, origin="https://example.org").status_code == 403
    assert ask(app, "GET", jar=jar, origin="http://127.0.0.1:9").status_code == 403
    assert ask(app, "POST", jar=jar).status_code == 403
    assert ask(app, "GET", jar=jar, sec_fetch_site="cross-site").status_code == 403


def test_a_name_that_was_made_to_point_here_is_refused():
    _, app, jar = admitted()
    for host in ("example.org", "example.org:8123", "127.0.0.1", ""):
        assert ask(app, jar=jar, host=host).status_code == 421


def test_more_than_the_bound_is_refused_before_it_is_read():
    _, app, jar = admitted()
    for headers in (
        {"content_length": "999999999999"},
        {"transfer_encoding": "chunked"},
        {"content_length": "-1"},
    ):
        assert ask(app, "POST", jar=jar, origin=HERE, **headers).status_code == 413


def test_every_answer_forbids_other_hosts():
    _, app, jar = admitted()
    for answer in (ask(app, jar=jar), ask(app)):
        policy = answer.headers["content-security-policy"]
        assert "default-src 'self'" in policy
        assert "connect-src 'self'" in policy
        assert "http" not in policy.replace("'self'", "")


@pytest.mark.parametrize(
    ("host", "origin", "with_cookie", "opens"),
    [
        (HOST, HERE, True, True),
        (HOST, None, True, False),
        (HOST, "https://example.org", True, False),
        ("example.org", HERE, True, False),
        (HOST, HERE, False, False),
    ],
)
def test_sockets_are_guarded_as_pages_are(host, origin, with_cookie, opens):
    _, app, jar = admitted()
    headers = [(b"host", host.encode())]
    headers += [] if origin is None else [(b"origin", origin.encode())]
    headers += [(b"cookie", f"underlay_8123={jar['underlay_8123']}".encode())] if with_cookie else []
    scope = {"type": "websocket", "path": "/ws", "headers": headers, "query_string": b"", "subprotocols": []}
    sent = []

    async def receive():
        return {"type": "websocket.connect"}

    async def send(message):
        sent.append(message["type"])

    with contextlib.suppress(RuntimeError):
        asyncio.run(app(scope, receive, send))
    assert (sent[0] == "websocket.accept") is opens


@pytest.mark.parametrize(
    "name",
    [
        "../../etc/passwd",
        "..\\..\\boot.ini",
        "/etc/passwd",
        ".bashrc",
        "a/../../b",
        "\x00x",
        "=cmd|x",
        "",
        "..",
        "." * 300,
    ],
)
def test_no_name_leads_out_of_the_folder(tmp_path, name):
    folder = AnalysisFolder(tmp_path / "one")
    kept = folder.add_curve(name, b"content")
    assert kept.parent == folder.curves
    assert kept.name[0] not in ".="
    assert [path.name for path in folder.curve_files()] == [kept.name]
    with pytest.raises(ul.InputError, match="no curve"):
        folder.curve_file("../scene.toml")


def test_names_that_are_taken_are_counted_and_the_same_file_is_not_kept_twice(tmp_path):
    folder = AnalysisFolder(tmp_path / "one")
    names = [folder.add_curve("a.csv", content).name for content in (b"1", b"2", b"1", b"2")]
    assert names == ["a.csv", "a-2.csv", "a.csv", "a-2.csv"]
    assert safe_name("my curve (2).csv") == "my curve (2).csv"


def test_an_empty_file_and_one_too_many_are_refused(tmp_path, monkeypatch):
    folder = AnalysisFolder(tmp_path / "one")
    with pytest.raises(ul.InputError, match="is empty"):
        folder.add_curve("a.csv", b"")
    monkeypatch.setattr("underlay.app.folder.MOST_FILES", 1)
    folder.add_curve("a.csv", b"1")
    with pytest.raises(ul.InputError, match="takes up to 1 files"):
        folder.add_curve("b.csv", b"2")


def test_only_folders_of_analyses_are_listed(tmp_path):
    new_analysis(tmp_path)
    (tmp_path / "other").mkdir()
    (tmp_path / "..hidden").mkdir()
    assert len(analyses(tmp_path)) == 1
