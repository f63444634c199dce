"""Web server of the operator's page: files, a live stream, commands with a token, reports.

What is shown arrives as sections of JSON (`PageServer.put`), each serialised once for all viewers.
What is requested waits in `requests`.

    GET  /           the page; /page.css, /page.js
    GET  /live       WebSocket: every message is an object of the sections that have changed
    GET  /reports/…  files of the reports folder
    GET  /metrics    the newest values as OpenMetrics (`web/metrics.py`)
    POST /command    {"name": …, "arguments": {…}} with `Authorization: Bearer TOKEN`
    …    /at/gs1/…   page, live stream and commands of one antenna, where / is that of a network

A request under a foreign host name or from the page of another origin is refused: a name that an
attacker points at this computer, or a form of another site, must not reach the antenna.
"""

import asyncio
import hmac
import json
import logging
import math
import os
import threading
import time
from collections.abc import Awaitable, Callable, Iterator, Mapping, Sequence
from concurrent.futures import Future
from contextlib import suppress
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from queue import SimpleQueue
from typing import Any
from urllib.parse import quote, urlsplit

from aiohttp import web

from rf_pointing.core.whole_file import parse_json
from rf_pointing.station.clients.board import LARGEST, PageParams
from rf_pointing.station.pointing.status import Level, Report
from rf_pointing.web.metrics import CONTENT_TYPE, STALE_S, Family, exposition, page_metrics

FILES = Path(__file__).with_name("page")
"""Folder of the page itself; it is installed with the package."""
LONGEST_BODY = 4096
MOST_COMMANDS = 8
"""Commands that may wait for their answers at one time."""
UNLOCK = "unlock"
"""Command that does nothing: whether the token is the right one."""
ANSWER_S = 5.0
"""Until a command is answered by the node that it goes to."""
WRONG_TOKEN_S = 0.3
"""Delay of the answer to a wrong token, so that short ones cannot be tried out."""
HEADER_S = 5.0
"""Time for the head of a request, and for its body; what is idle for longer is closed."""
MORE_CONNECTIONS = 50
"""Connections besides those of viewers; then the oldest one without a request gives way."""
HEARTBEAT_S = 15.0
SLOW_S = 15.0
"""A viewer that takes no message for so long is dropped."""
LONGEST_TEXT = 600
"""Longest text sent to a viewer, in characters."""
BUFFER_BYTES = 32 * 1024
"""Buffer of one viewer's socket: a slow viewer sees old values no longer than this lasts."""
REPORTS = ("report.html", "night.html")
REPORT_TYPES = {
    ".html": "text/html", ".png": "image/png", ".svg": "image/svg+xml", ".json": "application/json",
    ".csv": "text/csv", ".txt": "text/plain",
}  # fmt: skip
REPORTS_SHOWN = 20
REPORTS_S = 10.0
REPORTS_SEARCHED = 5000
"""Folders that a search for reports looks into at most."""
STRICT = (
    "default-src 'none'; script-src 'self'; style-src 'self'; img-src 'self'; connect-src 'self'; "
    "base-uri 'none'; form-action 'none'; frame-ancestors 'none'"
)
# A report brings its own style and pictures, and names that somebody else has chosen.
OF_REPORTS = (
    "sandbox allow-same-origin; default-src 'none'; style-src 'unsafe-inline'; img-src 'self' data:"
)
HEADERS = {
    "X-Content-Type-Options": "nosniff", "Referrer-Policy": "no-referrer", "Cache-Control": "no-cache",
    "Cross-Origin-Resource-Policy": "same-origin", "X-Frame-Options": "DENY",
}  # fmt: skip


@dataclass(frozen=True, slots=True)
class Request:
    """A command of a viewer, `who` by address."""

    name: str
    arguments: Mapping[str, Any]
    who: str
    answer: "Future[tuple[bool, str]]"
    antenna: str = ""
    """Its path, "" for the page of a single antenna."""

    def reply(self, accepted: bool, text: str) -> None:
        """Say whether it was accepted, in any thread; a viewer may have gone."""
        if not self.answer.done():
            self.answer.set_result((accepted, text))


class NewestSections:
    """The newest sections; a viewer takes those that it has not seen.

    Nothing is queued for a viewer: one that is slow finds the newest of each section, so frames are
    dropped and memory does not grow.
    """

    def __init__(self) -> None:
        self._texts: dict[str, tuple[int, str]] = {}
        self._count = 0
        self.changed = asyncio.Event()
        """It is set by the next `put`."""

    def put(self, sections: Mapping[str, str]) -> None:
        """Take sections as JSON texts, and wake the viewers."""
        for name, text in sections.items():
            if self._texts.get(name, (0, ""))[1] != text:
                self._count += 1
                self._texts[name] = self._count, text
        self.changed.set()
        self.changed = asyncio.Event()

    def clear(self) -> None:
        """Forget what is shown: it is older than a viewer who comes now may believe."""
        self._texts.clear()

    def news(self, seen: dict[str, int]) -> str:
        """Return the sections newer than those `seen`, "" for none, and note them there."""
        news = {
            name: text for name, (count, text) in self._texts.items() if seen.get(name) != count
        }
        seen.update((name, self._texts[name][0]) for name in news)
        return (
            "{" + ",".join(f'"{name}":{text}' for name, text in news.items()) + "}" if news else ""
        )


class PageApp:
    """The handlers of the page, and what they share: board, token, counters."""

    def __init__(self, params: PageParams, token: str) -> None:
        self.board = NewestSections()
        """Sections of the page at /."""
        self.antennas: dict[str, NewestSections] = {}
        """Sections of the antennas of a network, by their paths below /at."""
        self.transports: dict[asyncio.Transport, str] = {}
        """Those of the viewers, with the paths at which they look."""
        self.commands = self.refused = 0
        self.dropped = 0
        """Viewers that were too slow."""
        self.requests: SimpleQueue[Request] = SimpleQueue()
        self.measured: tuple[float, Sequence[Family]] = -math.inf, ()
        """The newest metrics of the station, and the steady time at which they were made."""
        self._params, self._token = params, token.encode()
        own = ("localhost", "127.0.0.1", "::1", params.address)
        self._names = {
            name.strip().lower() for name in (*own, *params.hosts.split(",")) if name.strip()
        }
        self._waiting = 0
        self._in_request = set[Any]()
        self._headless = dict[Any, asyncio.TimerHandle]()
        self._reports = Path(params.reports).expanduser().resolve() if params.reports else None
        # In memory, under their names: no request is turned into a path.
        self._files = {
            path.name: path.read_bytes() for path in FILES.iterdir() if path.suffix in PAGE_TYPES
        }

    @property
    def viewers(self) -> int:
        """How many look at the page."""
        return len(self.transports)

    def add(self, antenna: str) -> None:
        """Serve the page of an antenna below /at, from any thread."""
        self.antennas = {**self.antennas, antenna: NewestSections()}

    def watching(self, antenna: str) -> int:
        """Return how many look at an antenna, for "" at /."""
        return sum(each == antenna for each in list(self.transports.values()))

    def application(self) -> web.Application:
        """Return the application of aiohttp."""
        app = web.Application(middlewares=[self._guarded], client_max_size=LONGEST_BODY)
        for start in ("", "/at/{antenna:.+}"):
            app.router.add_get(f"{start}/", self._file)
            app.router.add_get(f"{start}/live", self._live)
            app.router.add_post(f"{start}/command", self._take)
        app.router.add_get("/reports/{path:.+}", self._report)
        app.router.add_get("/metrics", self._metrics)
        app.router.add_get("/{name:[a-z.]+}", self._file)
        return app

    @web.middleware
    async def _guarded(
        self, request: web.Request, handler: Callable[[web.Request], Awaitable[web.StreamResponse]]
    ) -> web.StreamResponse:
        """Refuse foreign hosts and origins; turn every error into a sentence."""
        self._in_request.add(request.protocol)
        if timer := self._headless.pop(request.protocol, None):
            timer.cancel()
        try:
            self._require_ours(request)
            response = await handler(request)
        except web.HTTPException as error:
            response = _sentence(error.status, error.text or error.reason)
        except (ValueError, LookupError) as error:
            # LookupError: a charset that nobody knows.
            response = _sentence(400, str(error))
        except TimeoutError:
            response = _sentence(408, f"the body has not arrived within {HEADER_S:.0f} s")
        finally:
            self._in_request.discard(request.protocol)
        if not response.prepared:
            for name, value in {**HEADERS, "Content-Security-Policy": STRICT}.items():
                response.headers.setdefault(name, value)
        return response

    def admit(self, server: Any) -> Any:
        """Return a connection that ends unless a head comes; the oldest idle ones give way."""
        # One that is being closed has no transport any more.
        alive = [each for each in server.connections if each.transport is not None]
        more = max(0, len(alive) + 1 - self._params.viewers - MORE_CONNECTIONS)
        for each in [each for each in alive if each not in self._in_request][:more]:
            each.force_close()
        # The time limits of aiohttp begin after the first request, in some of its versions.
        new = server()
        self._headless[new] = asyncio.get_running_loop().call_later(HEADER_S, self._end, new)
        return new

    def _end(self, connection: Any) -> None:
        del self._headless[connection]
        connection.force_close()

    def _require_ours(self, request: web.Request) -> None:
        host = request.headers.get("Host", "")
        if _name_of(f"//{host}") not in self._names:
            self.refused += 1
            raise web.HTTPForbidden(text=f"host {host[:80]!r} is not in page.hosts")
        origin = request.headers.get("Origin")
        if origin is not None and origin not in (f"http://{host}", f"https://{host}"):
            self.refused += 1
            raise web.HTTPForbidden(text=f"a page of {origin[:80]!r} may not use this one")

    async def _metrics(self, _: web.Request) -> web.Response:
        made_s, families = self.measured
        # A node that has stalled measures nothing, and its last values are old.
        known = families if time.monotonic() - made_s <= STALE_S else ()
        text = exposition([*known, *page_metrics(self.viewers, self.commands, self.refused)])
        return web.Response(body=text.encode(), headers={"Content-Type": CONTENT_TYPE})

    async def _file(self, request: web.Request) -> web.Response:
        antenna = self._antenna(request)
        start = "network.html" if self._params.antennas and not antenna else "index.html"
        name = request.match_info.get("name", start)
        if name not in self._files:
            raise web.HTTPNotFound(text=f"no such page: {name[:80]}")
        return web.Response(
            body=self._files[name], content_type=PAGE_TYPES[Path(name).suffix], charset="utf-8"
        )

    def _antenna(self, request: web.Request) -> str:
        """Return the path of the requested antenna, "" for that of /."""
        antenna = request.match_info.get("antenna", "")
        if antenna and antenna not in self.antennas:
            raise web.HTTPNotFound(text=f"no such antenna: {antenna[:80]}")
        return antenna

    # The live stream

    async def _live(self, request: web.Request) -> web.StreamResponse:
        antenna = self._antenna(request)
        board = self.antennas.get(antenna, self.board)
        if self.viewers >= self._params.viewers:
            raise web.HTTPServiceUnavailable(text=f"{self.viewers} viewers, must be < page.viewers")
        socket = web.WebSocketResponse(heartbeat=HEARTBEAT_S, max_msg_size=1024, compress=False)
        await socket.prepare(request)
        transport = request.transport
        if transport is None:
            return socket
        transport.set_write_buffer_limits(high=BUFFER_BYTES)
        if not self.watching(antenna):
            board.clear()
        if not self.transports:
            self._searching = asyncio.ensure_future(self._show_reports())
        self.transports[transport] = antenna
        sender = asyncio.ensure_future(self._send(socket, board))
        try:
            # What a viewer sends is read, for pings and the end, and not used.
            reader = asyncio.ensure_future(_drain(socket))
            await asyncio.wait({sender, reader}, return_when=asyncio.FIRST_COMPLETED)
            reader.cancel()
        finally:
            del self.transports[transport]
            if not self.transports:
                self._searching.cancel()
            sender.cancel()
            # One that takes nothing takes no farewell either.
            transport.abort()
        return socket

    async def _send(self, socket: web.WebSocketResponse, board: NewestSections) -> None:
        seen: dict[str, int] = {}
        while not socket.closed:
            # Before the look: what is put while a viewer takes its news is news again.
            changed = board.changed
            if text := board.news(seen):
                try:
                    await asyncio.wait_for(socket.send_str(text), SLOW_S)
                except TimeoutError:
                    self.dropped += 1
                    return
                except ConnectionError:
                    return
            await changed.wait()

    # Commands

    async def _take(self, request: web.Request) -> web.Response:
        antenna = self._antenna(request)
        kind, _, given = request.headers.get("Authorization", "").partition(" ")
        if kind != "Bearer" or not hmac.compare_digest(
            given.strip().encode(errors="replace"), self._token
        ):
            self.refused += 1
            await asyncio.sleep(WRONG_TOKEN_S)
            raise web.HTTPUnauthorized(
                text="the token is wrong" if given else "a command needs the token"
            )
        if request.content_type != "application/json":
            raise web.HTTPUnsupportedMediaType(
                text=f"content type {request.content_type} must be application/json"
            )
        name, arguments = _parsed(await asyncio.wait_for(request.text(), HEADER_S))
        if name == UNLOCK:
            return _sentence(200, "the token is right", accepted=True)
        if self._waiting >= MOST_COMMANDS:
            raise web.HTTPTooManyRequests(text=f"{self._waiting} commands wait for their answers")
        self._waiting += 1
        self.commands += 1
        try:
            wanted = Request(name, arguments, str(request.remote), Future(), antenna)
            self.requests.put(wanted)
            accepted, message = await asyncio.wait_for(asyncio.wrap_future(wanted.answer), ANSWER_S)
        except TimeoutError:
            raise web.HTTPGatewayTimeout(
                text=f"{name}: no answer within {ANSWER_S:.0f} s"
            ) from None
        finally:
            self._waiting -= 1
        return _sentence(200, message, accepted=accepted)

    # Reports

    async def _report(self, request: web.Request) -> web.StreamResponse:
        path = await asyncio.to_thread(self._inside, request.match_info["path"])
        if path is None:
            raise web.HTTPNotFound(text="no such report")
        own = {"Content-Type": REPORT_TYPES[path.suffix], "Content-Security-Policy": OF_REPORTS}
        return web.FileResponse(path, headers=HEADERS | own)

    def _inside(self, wanted: str) -> Path | None:
        """Return the file of a report that lies in the folder, links followed, else None."""
        if self._reports is None:
            return None
        try:
            path = (self._reports / wanted).resolve()
            inside = (
                path.is_relative_to(self._reports)
                and path.suffix in REPORT_TYPES
                and path.is_file()
            )
        except (ValueError, OSError):
            return None
        return path if inside else None

    async def _show_reports(self) -> None:
        while True:
            # The folder is searched by another thread.
            text = json.dumps(await asyncio.to_thread(self.reports))
            for each in (self.board, *list(self.antennas.values())):
                each.put({"reports": text})
            await asyncio.sleep(REPORTS_S)

    def reports(self) -> list[dict[str, Any]]:
        """Return the newest reports of the folder: title, kind, path and UTC s of the file."""
        if self._reports is None:
            return []
        found = sorted(_report_files(self._reports), key=lambda row: -row[1])[:REPORTS_SHOWN]
        return [
            {"title": path.parent.name, "kind": path.stem, "utc_s": round(changed_s),
             "path": "/reports/" + quote(path.relative_to(self._reports).as_posix())}
            for path, changed_s in found
        ]  # fmt: skip


PAGE_TYPES = {
    ".html": "text/html", ".css": "text/css", ".js": "text/javascript", ".svg": "image/svg+xml",
}  # fmt: skip


class PageServer:
    """A `PageApp` on its address, in a thread of its own."""

    def __init__(self, params: PageParams, token: str) -> None:
        self._params = params
        self._loop = asyncio.new_event_loop()
        self._thread = threading.Thread(target=self._loop.run_forever, daemon=True)
        self._thread.start()
        # aiohttp would log what the middleware answers.
        logging.getLogger("aiohttp.server").setLevel(logging.CRITICAL)
        try:
            self.app, self._runner, self.port = self._wait(self._start(token))
        except OSError as error:
            self._end_loop()
            raise ValueError(
                f"{params.address}:{params.port} cannot be used: {error.strerror}"
            ) from error

    @property
    def address(self) -> str:
        """The address of the page, for a browser."""
        host = f"[{self._params.address}]" if ":" in self._params.address else self._params.address
        return f"http://{host}:{self.port}"

    def put(self, sections: Mapping[str, Any], antenna: str = "") -> None:
        """Show sections, from any thread; NaN and infinity are shown as missing."""
        texts = {
            name: json.dumps(shown(value), separators=(",", ":"))
            for name, value in sections.items()
        }
        board = self.app.antennas.get(antenna, self.app.board)
        self._loop.call_soon_threadsafe(board.put, texts)

    @property
    def requests(self) -> "SimpleQueue[Request]":
        """The commands of viewers that nobody has taken yet."""
        return self.app.requests

    def close(self) -> None:
        """Close every connection and the port."""
        self._loop.call_soon_threadsafe(self._port.close)
        with suppress(TimeoutError):
            self._wait(self._runner.cleanup())
        self._end_loop()

    async def _start(self, token: str) -> tuple[PageApp, web.AppRunner, int]:
        app = PageApp(self._params, token)
        runner = web.AppRunner(
            app.application(),
            access_log=None,
            shutdown_timeout=0.5,
            keepalive_timeout=HEADER_S,
            lingering_time=1.0,
        )
        await runner.setup()
        try:
            self._port = await self._loop.create_server(
                partial(app.admit, runner.server), self._params.address, self._params.port
            )
        except OSError:
            await runner.cleanup()
            raise
        return app, runner, int(self._port.sockets[0].getsockname()[1])

    def _wait(self, work: Any) -> Any:
        return asyncio.run_coroutine_threadsafe(work, self._loop).result(5.0)

    def _end_loop(self) -> None:
        self._loop.call_soon_threadsafe(self._loop.stop)
        self._thread.join(5.0)
        self._loop.close()


def report(server: PageServer | None) -> Report:
    """Return who looks at the page, and what became of their requests."""
    if server is None:
        return Report(Level.WARN, "not served", {})
    app = server.app
    values: dict[str, object] = {
        "viewers": app.viewers, "slow_viewers_dropped": app.dropped, "commands": app.commands, "requests_refused": app.refused
    }  # fmt: skip
    return Report(Level.OK, f"{server.address}, {app.viewers} viewers", values)


def shown(value: Any) -> Any:
    """Return a value for JSON, which has neither NaN nor inf; a text is cut at its longest."""
    if isinstance(value, float):
        return value if math.isfinite(value) else None
    if isinstance(value, str):
        return value if len(value) <= LONGEST_TEXT else f"{value[:LONGEST_TEXT]}…"
    if isinstance(value, Mapping):
        return {name: shown(each) for name, each in value.items()}
    return [shown(each) for each in value] if isinstance(value, (list, tuple)) else value


def _parsed(body: str) -> tuple[str, Mapping[str, Any]]:
    """Return name and arguments of a command; ValueError says what is wrong with the body."""

    def no_number(word: str) -> None:
        raise ValueError(f"{word} is not a number of JSON")

    def number(kind: Callable[[str], float], word: str) -> float:
        if abs(float(word)) > LARGEST:
            raise ValueError(f"{word[:20]} must be at most {LARGEST:g}")
        return kind(word)

    try:
        content = parse_json(
            body,
            parse_constant=no_number,
            parse_int=partial(number, int),
            parse_float=partial(number, float),
        )
    except json.JSONDecodeError as error:
        raise ValueError(f"the body is not JSON: {error}") from error
    if not isinstance(content, Mapping) or not set(content) <= {"name", "arguments"}:
        raise ValueError("the body must be an object of name and arguments")
    name, arguments = content.get("name"), content.get("arguments", {})
    if not isinstance(name, str) or not isinstance(arguments, Mapping):
        raise ValueError("name must be a text and arguments an object")
    return name, arguments


def _name_of(address: str) -> str:
    try:
        return (urlsplit(address).hostname or "").lower()
    except ValueError:
        return ""


def _sentence(status: int, text: str, *, accepted: bool = False) -> web.Response:
    return web.json_response({"accepted": accepted, "message": text}, status=status)


async def _drain(socket: web.WebSocketResponse) -> None:
    async for _ in socket:
        pass


def _report_files(folder: Path) -> Iterator[tuple[Path, float]]:
    """Yield the reports below a folder with the times of their last change; links are left out."""
    for searched, (place, folders, names) in enumerate(os.walk(folder)):
        if searched >= REPORTS_SEARCHED:
            return
        # A bag has no report inside, and hidden folders are nobody's reports.
        folders[:] = [name for name in folders if name != "bag" and not name.startswith(".")]
        for name in set(names) & set(REPORTS):
            path = Path(place) / name
            with suppress(OSError):
                yield path, path.lstat().st_mtime
