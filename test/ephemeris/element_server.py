"""A server of elements on loopback that also refuses, breaks off, lies, and drips."""

import contextlib
import time
from collections.abc import Iterator
from dataclasses import dataclass, field
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from threading import Thread
from typing import Any

from rf_pointing.ephemeris import tle_lines, verification_elements

NOW_S = 1_151_500_000.0
RULE_S = 7200.0
FRESH = [one for one in verification_elements() if abs(one.epoch_t_s - NOW_S) < 10 * 86400.0]


def tle_text(count: int = 4) -> str:
    return "".join(f"{one.name}\n" + "".join(f"{line}\n" for line in tle_lines(one)) for one in FRESH[:count])


@dataclass
class Source:
    """A server whose answers the test sets, and what it was asked."""

    address: str = ""
    status: int = 200
    body: bytes = field(default_factory=lambda: tle_text().encode())
    headers: dict[str, str] = field(default_factory=dict)
    promised: int | None = 0
    """Content-Length beyond that of the body; None sends none."""
    drip_s: float = 0.0
    redirects: list[str] = field(default_factory=list)
    """Where the next requests are sent on."""
    asked: list[dict[str, str]] = field(default_factory=list)


@contextlib.contextmanager
def serving() -> Iterator[Source]:
    """Give a server on loopback, while it runs."""
    made = Source()

    class Handler(BaseHTTPRequestHandler):
        def do_GET(self) -> None:
            made.asked.append(dict(self.headers))
            if made.redirects:
                self.send_response(302)
                self.send_header("Location", made.redirects.pop(0))
                self.send_header("Content-Length", "0")
                self.end_headers()
                return
            self.send_response(made.status)
            for name, value in made.headers.items():
                self.send_header(name, value)
            if made.promised is not None and made.status != 304:
                self.send_header("Content-Length", str(len(made.body) + made.promised))
            self.end_headers()
            # The client may have had enough before the last byte.
            with contextlib.suppress(ConnectionError):
                for at in range(len(made.body) if made.drip_s else 0):
                    self.wfile.write(made.body[at : at + 1])
                    time.sleep(made.drip_s)
                if not made.drip_s and made.status != 304:
                    self.wfile.write(made.body)

        def log_message(self, *arguments: Any) -> None:
            pass

    server = ThreadingHTTPServer(("127.0.0.1", 0), Handler)
    server.daemon_threads = True
    Thread(target=server.serve_forever, daemon=True).start()
    made.address = f"http://127.0.0.1:{server.server_port}/gp.php?GROUP=active&FORMAT=tle"
    yield made
    server.shutdown()
    server.server_close()
