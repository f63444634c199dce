"""The door of Hamlib's line protocols: lines in, orders out, answers in the client's form.

A prefix `+` requests the extended form, with the lines of an answer joined by newlines; `;`, `|`
and `,` join them by themselves.  `LineServer` serves the clients in a thread of its own, whichever
the protocol (`ServedWords`).  What changes anything goes to the station, one order of each client
at a time; memory for each client is bounded.

Any web page can have a browser on this computer send bytes here: the body of its request would be
read as lines.  So a line that no client of Hamlib writes ends the connection: the head of an HTTP
request, bytes that are not text, as those of TLS, or more than 200 of them without an end.
"""

import asyncio
import math
import re
import socket
import threading
import time
from collections.abc import Callable, Iterator, Mapping
from contextlib import suppress
from dataclasses import dataclass, field, replace
from ipaddress import ip_address, ip_network
from typing import ClassVar, Self

from rf_pointing.core import Params, parameter
from rf_pointing.drives.protocols import LONGEST_LINE

INVALID, NOT_IMPLEMENTED, TIMED_OUT, IO_ERROR, REJECTED = -1, -4, -5, -6, -9
"""Codes of `RPRT_ERRORS` that this side gives."""
# A page of another site may choose the method where a name of its own leads here: the first header
# that browsers then send is Host.
_OF_HTTP = re.compile(
    r"(?i)(GET|HEAD|POST|PUT|PATCH|DELETE|OPTIONS|CONNECT|TRACE|PRI)\b|host\s*:|.*\bHTTP/\d"
)
_READ_BYTES = 4096
_ANSWER_S = 3.0
WRONG_S = 0.3
"""Delay of the answer to a wrong password."""


@dataclass(frozen=True, kw_only=True)
class ServerParams(Params):
    """Where clients connect, and how many."""

    host: str = parameter(
        "127.0.0.1", "address of the port; others reach any but loopback: see allow, password_file"
    )
    port: int = parameter(4533, "TCP port; 0: any free one", 0, 65535)
    allow: str = parameter(
        "", "addresses and networks of the clients, separated by commas; empty: any"
    )
    password_file: str = parameter(
        "", "file (mode 600) of the word that \\password must give first; empty: none"
    )
    most_refused: int = parameter(20, "lines refused in a row that end a connection", 1, 1000)
    most_clients: int = parameter(
        100, "clients at one time; then one that has sent no line gives way, else further ones are refused",
        1, 500,
    )  # fmt: skip
    idle_s: float = parameter(
        600.0, "a client that sends nothing for so long is disconnected", 1.0, 86400.0
    )
    patience_s: float = parameter(
        5.0, "a client that reads no answer for so long is disconnected", 0.1, 60.0
    )

    def check_together(self) -> None:
        """Refuse a list of clients that cannot be read."""
        self.allows("127.0.0.1")

    def allows(self, address: str) -> bool:
        """Return whether a client may come from an address."""
        try:
            networks = [ip_network(each.strip()) for each in self.allow.split(",") if each.strip()]
        except ValueError as error:
            must = f"must be addresses or networks, as 10.0.0.0/24: {error}"
            raise ValueError(f"allow={self.allow!r} {must}") from None
        with suppress(ValueError):
            given = ip_address(address.partition("%")[0].removeprefix("::ffff:"))
            return not networks or any(given in each for each in networks)
        return not networks


NUMBER = re.compile(r"[+-]?([0-9]+\.?[0-9]*|\.[0-9]+)([eE][+-]?[0-9]{1,3})?")
"""A number of a client; float() reads "nan", "inf" and "1_0", too."""
Fields = tuple[tuple[str, str], ...]
"""Lines of an answer, each in the extended and in the plain form."""
Judgement = tuple[int, str, tuple[float, ...]]
"""0 or the code of an error, the reason, and the numbers in the arguments of a command."""


def labelled(*values: tuple[str, object]) -> Fields:
    """Return the lines of values, which bear their labels in the extended form."""
    return tuple((f"{label}: {value}", f"{value}") for label, value in values)


class ServedWords:
    """The words of one protocol, as one client speaks them; a subclass answers and judges."""

    title = ""
    letters: ClassVar[Mapping[str, tuple[str, int]]] = {}
    """Name and number of arguments of each command, by its letter."""
    names: ClassVar[Mapping[str, int]] = {}
    """Number of arguments of the commands without a letter."""
    of_station: tuple[str, ...] = ()
    """Commands that the station carries out."""

    def client(self) -> Self:
        """Return the words of another client."""
        return self

    def count(self, name: str) -> int | None:
        """Return the number of arguments of a command, None for one that is not known."""
        return {**dict(self.letters.values()), **self.names, "password": 1}.get(name)

    def judged(self, name: str, arguments: list[str]) -> Judgement:
        """Return whether the station or this side may carry a command out."""
        raise NotImplementedError

    def fields(self, order: "Order") -> Fields | None:
        """Return the lines of an answer, None where it is not known yet."""
        raise NotImplementedError

    @property
    def reason(self) -> str:
        """Why the station has refused the newest order, in words; "" if it has not."""
        return ""

    def obeyed(self, order: "Order") -> None:
        """Note an order that the station has carried out."""


@dataclass(frozen=True, slots=True)
class Order:
    """One line of a client.

    `text` are the arguments as they were written, `separator` joins the lines of an extended
    answer ("" for the plain form).  A line that is refused has a `code` and the `reason`; one that
    is `foreign` is not of this protocol.
    """

    name: str
    values: tuple[float, ...] = ()
    text: str = ""
    separator: str = ""
    code: int = 0
    reason: str = ""
    foreign: bool = False


class Session:
    """The lines of one client, in the words of its protocol."""

    def __init__(self, words: ServedWords) -> None:
        self.words = words
        self._rest = b""

    def take(self, data: bytes) -> Iterator[Order]:
        """Yield the orders of the lines that are complete; a half line waits for its end."""
        *lines, self._rest = (self._rest + data).split(b"\n")
        for line in lines:
            if (order := _order(line, self.words)) is not None:
                yield order
        if len(self._rest) > LONGEST_LINE:
            # A foreign line ends the connection: nobody waits for its end.
            yield _foreign(_TOO_LONG)

    @staticmethod
    def answer(order: Order, code: int = 0, fields: Fields = (), reason: str = "") -> bytes:
        """Return the answer; `fields` are its lines in the extended and in the plain form.

        The extended form has room for the `reason` of a refused order, the plain one has its code.
        """
        if order.separator:
            head = f"{order.name}: {order.text}" if order.text else f"{order.name}:"
            refused = [f"Reason: {reason}"] if code and reason else []
            lines = [head, *(extended for extended, _ in fields), *refused, f"RPRT {code}"]
            return (order.separator.join(lines) + "\n").encode()
        plain = [text for _, text in fields] if fields and not code else [f"RPRT {code}"]
        return ("\n".join(plain) + "\n").encode()


def _order(line: bytes, words: ServedWords) -> Order | None:
    """Return the order of a line without its end, None for an empty line or a comment."""
    text = line.strip(b" \t\r").decode("ascii", errors="replace")
    if len(line) > LONGEST_LINE:
        return _foreign(_TOO_LONG)
    if not text or text.startswith("#"):
        return None
    if not text.isascii() or not text.isprintable():
        return _foreign("a line holds bytes that are not text")
    if _OF_HTTP.match(text):
        return _foreign(f"{shown(text)} is of a web page")
    separator = {"+": "\n", ";": ";", "|": "|", ",": ","}.get(text[0], "")
    word, *arguments = text[1 if separator else 0 :].split() or [""]
    name, count = word, None
    if word.startswith("\\"):
        name, count = word[1:], words.count(word[1:])
    elif len(word) == 1:
        name, count = words.letters.get(word, (word, None))
    else:
        return Order("", (), "", separator, INVALID, f"{shown(word)} is not a command")
    judged: Judgement = NOT_IMPLEMENTED, f"command {shown(name)} is not known", ()
    if count is not None:
        judged = INVALID, f"{name} has {len(arguments)} arguments, must have {count}", ()
    if len(arguments) == count:
        judged = words.judged(name, arguments)
    code, reason, values = judged
    return Order(name, values, " ".join(arguments), separator, code, reason)


_TOO_LONG = f"a line is longer than {LONGEST_LINE} bytes"


def _foreign(reason: str) -> Order:
    return Order("", code=INVALID, reason=reason, foreign=True)


def shown(text: str) -> str:
    """Return a client's text as a reason may show it."""
    return repr(text[:24])


@dataclass(frozen=True, slots=True)
class Inquiry:
    """An order for the station, read at `at_s` (steady); `reply` takes its code, in any thread."""

    order: Order
    client: str
    at_s: float
    reply: Callable[[int], None]


@dataclass(slots=True)
class ServerCounts:
    """Counts of the port since it was opened."""

    refused_clients: int = 0
    refused_lines: int = 0
    ended: int = 0
    """Clients that were disconnected for what they sent."""
    last_refusal: str = ""
    connected: dict[str, float] = field(default_factory=dict)
    """Clients by address and port, with the steady time of the last bytes of each."""


class LineServer:
    """Serves one of Hamlib's protocols on a TCP port until `close`.

    `inbox` is called in the thread of the server with what the station carries out, and
    `refused` with each line that was refused, in words.  With a `password` a client must give it
    first, as text or as its MD5 in hexadecimal digits, which is what Hamlib sends.  Raises
    ValueError where the port cannot be opened.
    """

    def __init__(
        self, params: ServerParams, words: ServedWords, inbox: Callable[[Inquiry], None],
        refused: Callable[[str], object] = str, password: str = "",
    ) -> None:  # fmt: skip
        self._params, self.words, self._inbox, self._refused = params, words, inbox, refused
        self._password = password
        self._unheard: dict[str, asyncio.StreamWriter] = {}
        self.counts = ServerCounts()
        self._socket = socket.socket(socket.AF_INET6 if ":" in params.host else socket.AF_INET)
        self._socket.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        try:
            self._socket.bind((params.host, params.port))
            self._socket.listen(128)
        except OSError as error:
            self._socket.close()
            place = f"server.host={params.host}, server.port={params.port}"
            raise ValueError(f"{place}: {error.strerror}") from error
        self.port: int = self._socket.getsockname()[1]
        self._loop = asyncio.new_event_loop()
        self._tasks: set[asyncio.Task[None]] = set()
        self._stop = asyncio.Event()
        self._thread = threading.Thread(target=self._run, name=words.title, daemon=True)
        self._thread.start()

    def heard_s(self, client: str) -> float:
        """Return the steady time of a client's last bytes, minus infinity if it is gone."""
        return self.counts.connected.get(client, -math.inf)

    def values(self) -> dict[str, object]:
        """Return what became of clients and lines, as /diagnostics shows it."""
        counts = self.counts
        return {
            "port": self.port, "clients": len(counts.connected),
            "refused lines": counts.refused_lines, "last refused": counts.last_refusal,
            "refused clients": counts.refused_clients,
        }  # fmt: skip

    def close(self) -> None:
        """Disconnect every client and free the port."""
        self._loop.call_soon_threadsafe(self._stop.set)
        self._thread.join(timeout=5.0)

    def _run(self) -> None:
        with asyncio.Runner(loop_factory=lambda: self._loop) as runner:
            runner.run(self._serve())

    async def _serve(self) -> None:
        server = await asyncio.start_server(self._client, sock=self._socket, limit=_READ_BYTES)
        await self._stop.wait()
        server.close()
        for task in list(self._tasks):
            task.cancel()
        await asyncio.gather(*self._tasks, return_exceptions=True)

    async def _client(self, reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        task = asyncio.current_task()
        assert task is not None
        self._tasks.add(task)
        host, port = (writer.get_extra_info("peername") or ("?", 0))[:2]
        name = f"{host}:{port}"
        try:
            full = len(self.counts.connected) >= self._params.most_clients
            allowed = self._params.allows(host)
            if full and allowed and (silent := next(iter(self._unheard), "")):
                self._unheard.pop(silent).transport.abort()
                self.counts.connected.pop(silent)
                full = False
            if not allowed:
                self._refuse_client(writer, f"{name} is not in server.allow={self._params.allow}")
            elif full:
                many = f"{self._params.most_clients} clients are connected"
                self._refuse_client(writer, f"{name}: {many}")
            else:
                self.counts.connected[name], self._unheard[name] = time.monotonic(), writer
                await self._talk(reader, writer, name)
        except (TimeoutError, OSError, asyncio.CancelledError):
            # Gone, silent, or it reads no answers: its half line is forgotten.
            writer.transport.abort()
        finally:
            self.counts.connected.pop(name, None)
            self._unheard.pop(name, None)
            self._tasks.discard(task)
            writer.close()

    def _refuse_client(self, writer: asyncio.StreamWriter, reason: str) -> None:
        self.counts.refused_clients += 1
        self._refused(reason)
        writer.write(f"RPRT {REJECTED}\n".encode())

    async def _talk(
        self, reader: asyncio.StreamReader, writer: asyncio.StreamWriter, name: str
    ) -> None:
        session, refused, known = Session(self.words.client()), 0, not self._password
        while data := await asyncio.wait_for(reader.read(_READ_BYTES), self._params.idle_s):
            at_s = self.counts.connected[name] = time.monotonic()
            for order in session.take(data):
                self._unheard.pop(name, None)
                if order.name == "quit" and not order.code:
                    return
                if order.name == "password" and not order.code:
                    known = known or self._is_password(order.text)
                    code = 0 if known else REJECTED
                    order = replace(order, text="", code=code, reason="the password is wrong")
                    await asyncio.sleep(0.0 if known else WRONG_S)
                elif not known and not order.foreign:
                    order = replace(order, code=REJECTED, reason="\\password must come first")
                writer.write(await self._answer(session, order, name, at_s))
                refused = refused + 1 if order.code else 0
                if order.foreign or refused >= self._params.most_refused:
                    self.counts.ended += 1
                    ended = f"{name} is disconnected after {refused} refused lines"
                    self._refused(f"{ended}; the last: {order.reason}")
                    return
            await asyncio.wait_for(writer.drain(), self._params.patience_s)

    def _is_password(self, given: str) -> bool:
        import hashlib
        import hmac

        wanted = self._password.encode()
        # Not a secret's protection: the form in which Hamlib's own clients send it.
        digest = hashlib.md5(wanted, usedforsecurity=False).hexdigest().encode()
        return any(hmac.compare_digest(given.encode(), each) for each in (wanted, digest))

    async def _answer(self, session: Session, order: Order, name: str, at_s: float) -> bytes:
        code, fields = order.code, None
        if code:
            self.counts.refused_lines += 1
            self.counts.last_refusal = f"{name}: {order.reason}"
            self._refused(self.counts.last_refusal)
        elif order.name in session.words.of_station:
            code = await self._carried_out(order, name, at_s)
            if not code:
                session.words.obeyed(order)
        elif order.name != "password":
            fields = session.words.fields(order)
            code = IO_ERROR if fields is None else 0
        # A wrong line is answered as by Hamlib's own program, byte for byte.
        return session.answer(order, code, fields or (), "" if order.code else session.words.reason)

    async def _carried_out(self, order: Order, name: str, at_s: float) -> int:
        """Hand an order to the station; return its code, or that of a station that is silent."""
        answered: asyncio.Future[int] = self._loop.create_future()

        def take(code: int) -> None:
            if not answered.done():
                answered.set_result(code)

        def reply(code: int) -> None:
            # The server may have been closed meanwhile.
            with suppress(RuntimeError):
                self._loop.call_soon_threadsafe(take, code)

        self._inbox(Inquiry(order, name, at_s, reply))
        try:
            return await asyncio.wait_for(answered, _ANSWER_S)
        except TimeoutError:
            return TIMED_OUT
