"""The web server of the operator's page: who may read, who may command, what a bad request is answered."""

import asyncio
import contextlib
import io
import json
import time
from collections.abc import Awaitable, Callable
from pathlib import Path
from typing import Any

import pytest
from aiohttp import ClientSession
from aiohttp.test_utils import TestClient, TestServer

from rf_pointing.core.secret_files import read_token
from rf_pointing.station.clients.board import PageParams
from rf_pointing.web import page_server
from rf_pointing.web.metrics import CONTENT_TYPE, STALE_S, Family
from rf_pointing.web.page_server import LONGEST_BODY, PageApp, PageServer, Request, shown

TOKEN = "a-token-of-the-test"
BEARER = {"Authorization": f"Bearer {TOKEN}"}
JSON = {"Content-Type": "application/json"}


class Station:
    """Takes commands, and answers them at once unless it is `silent`."""

    def __init__(self) -> None:
        self.taken: list[tuple[str, dict[str, Any]]] = []
        self.antennas: list[str] = []
        self.silent = False

    def put(self, request: Request) -> None:
        self.taken.append((request.name, dict(request.arguments)))
        self.antennas.append(request.antenna)
        if not self.silent:
            request.reply(True, "parking")
            # A second answer, and one to a viewer that has gone, reach nobody.
            request.reply(False, "late")


def served(work: Callable[[TestClient, PageApp, Station], Awaitable[None]], **params: Any) -> None:
    """Run `work` against a page of its own."""

    async def run() -> None:
        station = Station()
        page = PageApp(PageParams(port=0, **params), TOKEN)
        page.requests = station  # type: ignore[assignment]
        async with TestClient(TestServer(page.application())) as client:
            await work(client, page, station)

    asyncio.run(run())


async def post(client: Any, body: Any, **headers: str) -> tuple[int, dict[str, Any]]:
    data = body if isinstance(body, (str, bytes)) else json.dumps(body)
    data = io.BytesIO(data.encode() if isinstance(data, str) else data)
    async with client.post("/command", data=data, headers={**JSON, **BEARER, **headers}) as response:
        return response.status, await response.json()


@pytest.fixture(autouse=True)
def quick(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(page_server, "WRONG_TOKEN_S", 0.0)


def test_metrics_are_for_who_may_read_the_page_and_never_old() -> None:
    async def work(client: TestClient, page: PageApp, _station: Station) -> None:
        one = Family("axis_error", "degrees", "Error.", [({"axis": "azimuth"}, 0.5)])
        for age_s, shown_there in ((0.0, True), (STALE_S + 1.0, False)):
            page.measured = time.monotonic() - age_s, [one]
            async with client.get("/metrics") as response:
                text = await response.text()
                assert (response.status, response.headers["Content-Type"]) == (200, CONTENT_TYPE)
            assert ('rf_pointing_axis_error_degrees{axis="azimuth"} 0.5\n' in text) == shown_there
            assert text.endswith("rf_pointing_page_refusals_total 0.0\n# EOF\n")
        for headers in ({"Host": "evil.example"}, {"Origin": "http://evil.example"}):
            async with client.get("/metrics", headers=headers) as response:
                assert response.status == 403

    served(work)


def test_a_command_with_the_token_reaches_the_station() -> None:
    async def work(client: TestClient, _page: PageApp, station: Station) -> None:
        assert await post(client, {"name": "park"}) == (200, {"accepted": True, "message": "parking"})
        assert (await post(client, {"name": "set", "arguments": {"value": 1}}))[0] == 200
        assert station.taken == [("park", {}), ("set", {"value": 1})]

    served(work)


@pytest.mark.parametrize(
    ("headers", "status", "words"),
    [
        ({"Authorization": "Bearer wrong"}, 401, "the token is wrong"),
        ({"Authorization": f"Bearer {TOKEN}x"}, 401, "the token is wrong"),
        ({"Authorization": "Bearer "}, 401, "needs the token"),
        ({"Authorization": f"Basic {TOKEN}"}, 401, "the token is wrong"),
        ({"Authorization": "Bearer \u20ac"}, 401, "the token is wrong"),
        ({"Origin": "http://evil.example"}, 403, "may not use this one"),
        ({"Origin": "null"}, 403, "may not use this one"),
        ({"Host": "evil.example:8080"}, 403, "not in page.hosts"),
        ({"Host": "[::1"}, 403, "not in page.hosts"),
        ({"Content-Type": "text/plain"}, 415, "must be application/json"),
        ({"Content-Type": "application/json; charset=bogus"}, 400, "unknown encoding"),
    ],
)
def test_who_may_not_command_moves_nothing(headers: dict[str, str], status: int, words: str) -> None:
    async def work(client: TestClient, _page: PageApp, station: Station) -> None:
        found, answer = await post(client, {"name": "park"}, **headers)
        assert (found, answer["accepted"]) == (status, False)
        assert words in answer["message"]
        assert station.taken == []

    served(work)


def test_a_token_in_the_address_is_none() -> None:
    async def work(client: TestClient, _page: PageApp, station: Station) -> None:
        async with client.post(f"/command?token={TOKEN}", data='{"name": "park"}', headers=JSON) as response:
            assert response.status == 401
        assert station.taken == []

    served(work)


@pytest.mark.parametrize(
    ("body", "status", "words"),
    [
        ("", 400, "not JSON"),
        ("{", 400, "not JSON"),
        ("[]", 400, "an object of name and arguments"),
        ('{"name": 1}', 400, "name must be a text"),
        ('{"name": "park", "arguments": []}', 400, "arguments an object"),
        ('{"name": "park", "more": 1}', 400, "an object of name and arguments"),
        ('{"name": "set", "arguments": {"value": NaN}}', 400, "NaN is not a number"),
        (b'{"name": "\xff"}', 400, "decode"),
        ('{"name": "\\ud800"}', 400, "half a character"),
        ('{"name": "set", "arguments": {"\\udfff": "\\ud800"}}', 400, "half a character"),
        ('{"name": "set", "arguments": {"value": 1' + "0" * 400 + "}}", 400, "must be at most 1e+18"),
        ('{"name": "set", "arguments": {"value": -1e400}}', 400, "must be at most 1e+18"),
        ("[" * (LONGEST_BODY - 1), 400, "nested more than|not JSON"),
        ("x" * (LONGEST_BODY + 1), 413, "Maximum request body size"),
        ("x" * 10_000_000, 413, "Maximum request body size"),
    ],
)
def test_a_bad_body_is_answered_with_a_sentence(body: Any, status: int, words: str) -> None:
    async def work(client: TestClient, _page: PageApp, station: Station) -> None:
        found, answer = await post(client, body)
        assert (found, answer["accepted"]) == (status, False)
        assert any(each in answer["message"] for each in words.split("|")), answer
        assert station.taken == []

    served(work)


def test_the_station_that_does_not_answer_is_reported(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(page_server, "ANSWER_S", 0.2)

    async def work(client: TestClient, _page: PageApp, station: Station) -> None:
        station.silent = True
        answers = await asyncio.gather(*(post(client, {"name": "park"}) for _ in range(page_server.MOST_COMMANDS + 3)))
        found = [status for status, _ in answers]
        assert found.count(504) == page_server.MOST_COMMANDS
        assert found.count(429) == 3
        assert (await post(client, {"name": "park"}))[0] == 504

    served(work)


@pytest.mark.parametrize("path", ["/", "/page.css", "/page.js", "/icon.svg"])
def test_the_page_allows_nothing_but_itself(path: str) -> None:
    async def work(client: TestClient, _page: PageApp, _station: Station) -> None:
        async with client.get(path) as response:
            assert response.status == 200
            policy = response.headers["Content-Security-Policy"]
            assert "default-src 'none'" in policy
            assert "unsafe" not in policy
            assert response.headers["X-Content-Type-Options"] == "nosniff"
            assert "Access-Control-Allow-Origin" not in response.headers
            text = await response.text()
        # Nothing from elsewhere, no script or style in the text, no markup made from text.
        banned = ("https://", "//cdn", "innerHTML", "insertAdjacent", "document.write", "eval(", " style=", " onclick=")
        assert not [each for each in banned if each in text]

    served(work)


@pytest.fixture
def reports(tmp_path: Path) -> Path:
    folder = tmp_path / "runs"
    (folder / "pass 1" / "bag").mkdir(parents=True)
    (folder / "pass 1" / "report.html").write_text("<h1>pass</h1><script>alert(1)</script>")
    (folder / "pass 1" / "picture.png").write_bytes(b"png")
    (folder / "pass 1" / "bag" / "report.html").write_text("of the bag")
    (folder / "key.pem").write_text("secret")
    (tmp_path / "outside.html").write_text("secret")
    (folder / "link.html").symlink_to(tmp_path / "outside.html")
    (folder / "up").symlink_to(tmp_path)
    return folder


OUTSIDE = ("../outside.html", "..%2foutside.html", "%2e%2e/outside.html", "pass 1/../../outside.html", "up/outside.html",
           "link.html", "key.pem", "pass 1", "/etc/passwd", "%2fetc%2fpasswd", "pass 1/report.html%00.html", "x" * 5000,
           "....//outside.html", "..\\outside.html")  # fmt: skip


@pytest.mark.parametrize("wanted", OUTSIDE)
def test_nothing_outside_the_reports_is_served(reports: Path, wanted: str) -> None:
    async def work(client: TestClient, page: PageApp, _station: Station) -> None:
        # On a socket: a client library would make the path harmless.
        reader, writer = await asyncio.open_connection(client.host, client.port)
        path = wanted.replace(" ", "%20").encode()
        writer.write(b"GET /reports/" + path + b" HTTP/1.1\r\nHost: localhost\r\nConnection: close\r\n\r\n")
        answer = await asyncio.wait_for(reader.read(), 5.0)
        writer.close()
        assert answer.split()[1] in (b"404", b"400"), answer[:200]
        assert b"secret" not in answer

    served(work, reports=str(reports))


def test_reports_are_listed_and_served_without_scripts(reports: Path) -> None:
    async def work(client: TestClient, _page: PageApp, _station: Station) -> None:
        async with client.ws_connect("/live") as socket:
            (row,) = json.loads((await asyncio.wait_for(socket.receive(), 5.0)).data)["reports"]
        assert (row["title"], row["kind"], row["path"]) == ("pass 1", "report", "/reports/pass%201/report.html")
        async with client.get(row["path"]) as response:
            assert (response.status, response.content_type) == (200, "text/html")
            assert "script-src" not in response.headers["Content-Security-Policy"]
            assert response.headers["Content-Security-Policy"].startswith("sandbox")
            assert "alert(1)" in await response.text()

    served(work, reports=str(reports))


# The live stream


async def sections(socket: Any) -> dict[str, Any]:
    """Return the next sections besides the reports, which are looked for in a thread."""
    found: dict[str, Any] = {}
    while not found:
        found = json.loads((await asyncio.wait_for(socket.receive(), 5.0)).data)
        found.pop("reports", None)
    return found


def test_twenty_viewers_see_every_section_and_then_what_changes() -> None:
    async def work(client: TestClient, page: PageApp, _station: Station) -> None:
        sockets = [await client.ws_connect("/live") for _ in range(20)]
        assert page.viewers == 20
        page.board.put({"live": "1", "sky": "[1]"})
        assert [await sections(each) for each in sockets] == [{"live": 1, "sky": [1]}] * 20
        page.board.put({"live": "2", "sky": "[1]"})
        assert [await sections(each) for each in sockets] == [{"live": 2}] * 20
        late = await client.ws_connect("/live")
        assert await sections(late) == {"live": 2, "sky": [1]}
        for each in (*sockets, late):
            await each.close()
        await until(lambda: page.viewers == 0)

    served(work)


def test_who_comes_to_an_unwatched_page_sees_nothing_old() -> None:
    async def work(client: TestClient, page: PageApp, _station: Station) -> None:
        page.board.put({"live": "1"})
        socket = await client.ws_connect("/live")
        page.board.put({"live": "2"})
        assert await sections(socket) == {"live": 2}

    served(work)


def test_each_antenna_of_a_network_has_its_page_its_viewers_and_its_commands() -> None:
    async def work(client: TestClient, page: PageApp, station: Station) -> None:
        paths = {"gs1": "/at/gs1", "site/gs2": "/at/site/gs2", "": ""}
        for antenna in ("gs1", "site/gs2"):
            page.add(antenna)
        sockets = {antenna: await client.ws_connect(f"{start}/live") for antenna, start in paths.items()}
        for antenna, socket in sockets.items():
            page.antennas.get(antenna, page.board).put({"live": json.dumps(antenna)})
            assert await sections(socket) == {"live": antenna}
            assert page.watching(antenna) == 1
            async with client.get(f"{paths[antenna]}/") as response:
                assert ('id="lines"' in await response.text()) == (antenna == "")
            async with client.post(f"{paths[antenna]}/command", json={"name": "park"}, headers=BEARER) as response:
                assert (await response.json())["accepted"]
        assert station.antennas == list(paths)
        for path in ("/at/gs3/", "/at/gs3/live"):
            async with client.get(path) as response:
                assert (response.status, (await response.json())["message"]) == (404, "no such antenna: gs3")
        for socket in sockets.values():
            await socket.close()

    served(work, antennas="/gs1 /site/gs2")


def test_a_viewer_too_many_and_one_of_another_origin_are_refused() -> None:
    async def work(client: TestClient, _page: PageApp, _station: Station) -> None:
        async with client.get("/live", headers={"Origin": "http://evil.example"}) as response:
            assert response.status == 403
        first = await client.ws_connect("/live")
        async with client.get("/live") as response:
            assert response.status == 503
            assert "must be < page.viewers" in (await response.json())["message"]
        await first.close()

    served(work, viewers=1)


def test_a_slow_viewer_drops_frames_and_does_not_grow(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(page_server, "SLOW_S", 1.0)
    frames, size = 400, 20_000

    async def work(client: TestClient, page: PageApp, _station: Station) -> None:
        reader, writer = await asyncio.open_connection(client.host, client.port, limit=1024)
        writer.write(
            b"GET /live HTTP/1.1\r\nHost: localhost\r\nUpgrade: websocket\r\nConnection: Upgrade\r\n"
            b"Sec-WebSocket-Version: 13\r\nSec-WebSocket-Key: AAAAAAAAAAAAAAAAAAAAAA==\r\n\r\n"
        )
        await reader.readuntil(b"\r\n\r\n")
        quick = await client.ws_connect("/live")
        seen = 0
        for number in range(frames):
            page.board.put({"live": f'["{number}","{"x" * size}"]'})
            seen += (await sections(quick))["live"][0] == str(number)
        # The quick one has every frame; what waits for the slow one is bounded by its socket's buffers.
        assert seen == frames
        waiting = [transport.get_write_buffer_size() for transport in page.transports]
        assert max(waiting) < 10 * size, waiting
        for number in range(40):
            page.board.put({"live": f"[{number}]"})
            await asyncio.sleep(0.05)
            if page.dropped:
                break
        assert page.dropped == 1
        await until(lambda: page.viewers == 1)
        writer.close()

    served(work)


def test_half_open_requests_give_way_and_are_closed_in_time(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(page_server, "HEADER_S", 3.0)
    server = PageServer(PageParams(port=0, viewers=5), TOKEN)

    async def work() -> None:
        async with ClientSession() as session, session.ws_connect(f"{server.address}/live") as socket:
            opened = [await asyncio.open_connection("127.0.0.1", server.port) for _ in range(300)]
            for _, writer in opened:
                writer.write(b"POST /command HTTP/1.1\r\nHost: local")
            # As many as are accepted between two looks may be there beside the 54.
            await until(lambda: sum(not reader.at_eof() for reader, _ in opened) <= 54 + 100)
            assert await post(Base(session, server.address), {"name": page_server.UNLOCK}) == (
                200, {"accepted": True, "message": "the token is right"},
            )  # fmt: skip
            # A body that never comes, and heads that never end.
            reader, writer = opened[-1]
            head = f"host\r\nAuthorization: Bearer {TOKEN}\r\nContent-Type: application/json\r\n"
            writer.write(f"{head}Content-Length: 9\r\n\r\n".encode())
            assert b"408" in (await asyncio.wait_for(reader.read(), 5.0)).split(b"\r\n")[0]
            for reader, _ in opened[:-1]:
                # One that was closed before its head was read is reset.
                with contextlib.suppress(ConnectionResetError):
                    assert await asyncio.wait_for(reader.read(), 5.0) == b""
            for _, writer in opened:
                writer.close()
            server.put({"live": 1})
            assert await sections(socket) == {"live": 1}

    try:
        asyncio.run(work())
    finally:
        server.close()


class Base:
    """A session that knows its address, as the client of aiohttp's tests does."""

    def __init__(self, session: ClientSession, address: str) -> None:
        self._session, self._address = session, address

    def post(self, path: str, **how: Any) -> Any:
        return self._session.post(f"{self._address}{path}", **how)


async def until(condition: Callable[[], bool]) -> None:
    deadline_s = time.monotonic() + 5.0
    while not condition():
        assert time.monotonic() < deadline_s
        await asyncio.sleep(0.01)


@pytest.mark.parametrize(("length", "cut"), [(0, False), (600, False), (601, True), (5000, True)])
def test_values_become_json_and_a_text_is_cut_behind_its_600th_letter(length: int, cut: bool) -> None:
    values = shown({"a": [float("nan"), -float("inf"), 1.5], "b": ("x" * length,), "c": None, "d": True})
    text = "x" * 600 + "…" if cut else "x" * length
    assert json.loads(json.dumps(values)) == {"a": [None, None, 1.5], "b": [text], "c": None, "d": True}


# Token


def test_a_token_is_made_once_for_this_user_alone(tmp_path: Path) -> None:
    own = tmp_path / "page.token"
    token, path = read_token("token_file", "", own)
    assert (path, len(token) >= 32, own.stat().st_mode & 0o777) == (own, True, 0o600)
    assert read_token("token_file", "", own)[0] == token


@pytest.mark.parametrize(
    ("content", "mode", "words"),
    [("short", 0o600, "has 5 characters, must be >= 16"), (TOKEN, 0o644, "can be read by others: chmod 600"),
     ("", 0o600, "has 0 characters"), ("\u20ac" * 20, 0o600, "plain ASCII")],
)  # fmt: skip
def test_a_token_that_is_no_secret_is_refused(tmp_path: Path, content: str, mode: int, words: str) -> None:
    path = tmp_path / "token"
    path.write_text(content)
    path.chmod(mode)
    with pytest.raises(ValueError, match=words):
        read_token("token_file", str(path), tmp_path / "own")


def test_a_token_file_that_is_missing_or_a_link_is_refused(tmp_path: Path) -> None:
    with pytest.raises(ValueError, match="does not exist"):
        read_token("token_file", str(tmp_path / "none"), tmp_path / "own")
    (tmp_path / "real").write_text(TOKEN)
    (tmp_path / "link").symlink_to(tmp_path / "real")
    with pytest.raises(ValueError, match="cannot be used"):
        read_token("token_file", str(tmp_path / "link"), tmp_path / "own")


def test_the_server_runs_in_its_own_thread_and_frees_its_port() -> None:
    server = PageServer(PageParams(port=0), TOKEN)
    port = server.port

    async def work() -> None:
        async with ClientSession() as session, session.ws_connect(f"{server.address}/live") as socket:
            server.put({"live": {"value": float("nan")}})
            assert await sections(socket) == {"live": {"value": None}}

    try:
        asyncio.run(work())
        with pytest.raises(ValueError, match=f"127.0.0.1:{port} cannot be used: .*in use"):
            PageServer(PageParams(port=port), TOKEN)
    finally:
        server.close()
    again = PageServer(PageParams(port=port), TOKEN)
    again.close()
