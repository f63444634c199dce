"""Elements, and what else http(s) addresses answer, kept as files that stay usable.

`Contents` says what an address must answer with.  It is requested when it has changed (ETag,
If-Modified-Since), and not more often than the source allows.  Only a whole answer replaces the
kept file; an error, a web page, half a file or no answer leaves it as it is.  A server may send the
request on to another one only where the user has named it: whoever holds the address must not reach
the ports of this computer.
"""

import fcntl
import functools
import hashlib
import re
import statistics
import threading
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from concurrent.futures import Future
from contextlib import contextmanager
from dataclasses import asdict, dataclass, field, replace
from email.utils import parsedate_to_datetime
from pathlib import Path
from typing import Any
from urllib.parse import SplitResult, urljoin, urlsplit

from rf_pointing.core import DATA_BYTES, KeptState, brief, write_whole
from rf_pointing.ephemeris.element_files import cache_folder, is_address, kept_file

HOUR_S = 3600.0
DEFAULT_RULE_S = 2.0 * HOUR_S
RULES_S = {
    "celestrak.org": 2.0 * HOUR_S, "celestrak.com": 2.0 * HOUR_S, "space-track.org": HOUR_S,
    "network.satnogs.org": 60.0,
}  # fmt: skip
"""Shortest time between two requests for the same data that a source allows.

Sources: celestrak.org/usage-policy.php (GP data change every 2 h; clients that request more often
are blocked), space-track.org/documentation (GP: once an hour) and the client of SatNOGS, which
requests its jobs once a minute.
"""
UNREACHED_S = 60.0
"""A server that was not reached got no request: it may be tried again after this time."""
LONGEST_WAIT_S = 24.0 * HOUR_S
"""Longest Retry-After that is obeyed; longer ones are slips of the server."""
MOST_BYTES = DATA_BYTES
"""Longest answer that is kept: no node reads a longer file."""
MOST_REDIRECTS = 5
LOOPBACK = ("127.0.0.1", "::1", "localhost")
FEWEST_SHARE = 0.5
"""A new file with fewer objects than this share of the kept one's is taken for half a file."""
_HEADER = re.compile(r"[!-~]([ -~]{0,500}[!-~])?")
"""Values of a header that can be sent back."""


@dataclass(frozen=True, kw_only=True)
class Record:
    """State of one address that is kept; times in UTC s since 1970, 0 for never."""

    address: str
    requested_t_s: float = 0.0
    interval_s: float = 0.0
    """Time between two requests when it was requested last."""
    hold_t_s: float = 0.0
    """Not requested before this time: the server wants to be left alone, or was not reached."""
    fresh_t_s: float = 0.0
    """When the source last confirmed the kept file, with a new one or with 304."""
    etag: str = ""
    last_modified: str = ""
    digest: str = ""
    """SHA-256 of the kept file as it was written."""
    objects: int = 0
    epochs_t_s: tuple[float, float, float] | None = None
    """Oldest, median and newest epoch; None for an ephemeris."""
    refused: str = ""
    """Which sets of the kept file are damaged, with line and reason."""
    problem: str = ""
    """Why the newest answer was not taken."""
    hosts: tuple[str, ...] = ()
    """Other servers to which this one may send the request on."""

    def again_t_s(self, every_s: float) -> float:
        """Return when the address may be requested again."""
        return max(self.requested_t_s + every_s, self.hold_t_s)


@dataclass(frozen=True, kw_only=True)
class Outcome:
    """Result of `refresh`: `state` is new, unchanged, not due, kept (with the problem) or none."""

    state: str
    file: Path
    record: Record

    @property
    def problem(self) -> str:
        """Why there are no elements, or only older ones; "" else."""
        return self.record.problem


@dataclass(frozen=True, kw_only=True)
class Contents:
    """A kind of answer: `note` returns its record, or raises ValueError for another kind.

    `text` makes of the answer what is kept.
    """

    name: str
    whole: str
    command: str
    note: Callable[[str, Record], Record]
    text: Callable[[str], str] = str
    suffix: str = ".elements"
    rule_s: float = DEFAULT_RULE_S
    """Time between two requests where the source has no rule."""
    shrinks: bool = False
    """Whether a new file may hold far fewer objects than the kept one."""


@dataclass(frozen=True, kw_only=True)
class Question:
    """How an address is requested; the headers may be secret, and go to no other server."""

    method: str = "GET"
    body: str = ""
    headers: Mapping[str, str] = field(default_factory=dict)


class NotTakenError(Exception):
    """An answer that cannot be used; `reached` tells whether the server got the request."""

    def __init__(self, reason: str, *, reached: bool = True, wait_s: float = 0.0) -> None:
        super().__init__(reason)
        self.reached, self.wait_s = reached, wait_s


def refresh(
    address: str, folder: Path, now_s: float, *, every_s: float | None = None, timeout_s: float = 60.0,
    hosts: Sequence[str] = (), contents: Contents | None = None, question: Question | None = None,
) -> Outcome:  # fmt: skip
    """Bring the kept file of `address` up to date where the source's rule allows a request.

    Parameters
    ----------
    now_s : UTC in s since 1970.
    every_s : time between two requests; None for the source's rule, below which it must not be.
    timeout_s : longest time for the whole answer, however steadily its bytes arrive.
    hosts : other servers to which this one may send the request on, from now on.
    contents, question : elements, requested by GET, if None.

    ValueError for an interval below the rule of the source, secret headers for an address that
    anybody on the way can read, and a record that cannot be kept.
    """
    contents, question = contents or ELEMENTS, question or Question()
    every_s = allowed_interval_s(address, every_s, contents.rule_s)
    require_secure(address, question)
    file = kept_file(address, folder, contents.suffix)
    state = KeptState(str(file.with_name(f".{file.name}.json")))
    with _alone(file):
        record = _recovered(state, address)
        kept = _digest(file)
        # A clock that was set back must not block an address for as long.
        if now_s < record.again_t_s(every_s) <= now_s + max(every_s, LONGEST_WAIT_S):
            return Outcome(state=_kept_state(record, kept, "not due"), file=file, record=record)
        # Before it is sent: a process that is killed while it waits must not send another at once.
        allowed = tuple(dict.fromkeys((*record.hosts, *hosts)))
        requested = replace(record, requested_t_s=now_s, interval_s=every_s, hold_t_s=0.0, hosts=allowed)
        state.keep(asdict(requested))
        try:
            # "Not modified" would say nothing about a file that is gone or was changed by hand.
            whole = bool(kept) and kept == record.digest
            known = requested if whole else replace(requested, etag="", last_modified="")
            answer = _get(known, timeout_s, contents, question)
            if answer is None:
                done, name = replace(requested, fresh_t_s=now_s, problem=""), "unchanged"
            else:
                done, name = _taken(answer, requested, file, now_s, contents), "new"
        except NotTakenError as error:
            # A server that was not reached got no request.
            requested_t_s, wait_s = (now_s, error.wait_s) if error.reached else (record.requested_t_s, UNREACHED_S)
            hold_t_s = now_s + min(wait_s, LONGEST_WAIT_S)
            done = replace(requested, requested_t_s=requested_t_s, hold_t_s=hold_t_s, problem=str(error))
            name = _kept_state(done, kept, "kept")
        state.keep(asdict(done))
        if state.problem:
            raise ValueError(state.problem)
        return Outcome(state=name, file=file, record=done)


def require_secure(address: str, question: Question) -> None:
    """Raise ValueError for a token or a password to an address that anybody on the way can read."""
    parts = urlsplit(address)
    seen = parts.scheme.casefold() != "https" and parts.hostname not in LOOPBACK
    if seen and "Authorization" in question.headers:
        raise ValueError(f"address {address!r} must begin with https:// for a token or a password")


def send(address: str, data: Mapping[str, str], question: Question, timeout_s: float) -> tuple[int, str]:
    """Send fields to an address; return status and reason of the answer, or 0 and why none came."""
    import requests

    require_secure(address, question)
    try:
        answer = requests.request(
            question.method, address, data=dict(data), headers=dict(question.headers), timeout=timeout_s,
            allow_redirects=False,
        )  # fmt: skip
    except requests.RequestException as error:
        return 0, str(error)
    return answer.status_code, answer.reason


def allowed_interval_s(address: str, every_s: float | None, default_s: float = DEFAULT_RULE_S) -> float:
    """Return the time between two requests; ValueError for one below the rule of the source."""
    host = (urlsplit(address).hostname or "").casefold()
    rule_s = next((rule for name, rule in RULES_S.items() if host == name or host.endswith(f".{name}")), None)
    if every_s is None:
        return default_s if rule_s is None else rule_s
    if rule_s is not None and every_s < rule_s:
        raise ValueError(f"every={every_s / HOUR_S:g} h must be >= {rule_s / HOUR_S:g} h, the rule of {host}")
    return every_s


@functools.cache
def current_elements(address: str) -> str:
    """Renew the kept elements once a process; return "" or why not, ValueError without any."""
    found = refresh(address, cache_folder(), time.time())
    if found.state == "none":
        raise ValueError(f"elements={address!r}: {found.problem}")
    if not found.problem:
        return ""
    age = age_text(time.time() - found.record.fresh_t_s)
    return f"{found.problem}; the elements that were confirmed {age} ago are used"


def fetched(addresses: Sequence[str], folder: Path, now_s: float, **options: Any) -> list[Outcome]:
    """Refresh every address, or all that `folder` keeps, by `options`; ValueError without any."""
    _require_addresses(addresses)
    kept = [] if addresses else kept_outcomes((), folder, options.get("contents"))
    found = addresses or [one.record.address for one in kept]
    return [refresh(one, folder, now_s, **options) for one in found]


def kept_outcomes(addresses: Sequence[str], folder: Path, contents: Contents | None = None) -> list[Outcome]:
    """Return what `folder` keeps of some addresses or all, in order; ValueError for nothing."""
    _require_addresses(addresses)
    contents = contents or ELEMENTS
    states = folder.glob(f".*{contents.suffix}.json")
    found = [_recovered(KeptState(str(path)), "") for path in states]
    known = [one for one in found if one.address and (not addresses or one.address in addresses)]
    records = sorted(known, key=lambda one: one.address)
    if not records:
        those = " of these addresses" if addresses else ""
        raise ValueError(f"{folder} keeps no {contents.name}{those}: give an address")
    rows = ((record, kept_file(record.address, folder, contents.suffix)) for record in records)
    return [Outcome(state=_kept_state(r, _digest(f), "kept"), file=f, record=r) for r, f in rows]


def _require_addresses(addresses: Sequence[str]) -> None:
    for address in addresses:
        if not is_address(address):
            raise ValueError(f"address {address!r} must begin with http:// or https://")


@contextmanager
def _alone(file: Path) -> Iterator[None]:
    """Let one process at a time request a file; the lock goes with the process."""
    file.parent.mkdir(parents=True, exist_ok=True)
    with file.with_name(f".{file.name}.lock").open("w") as lock:
        fcntl.flock(lock, fcntl.LOCK_EX)
        yield


def _recovered(state: KeptState, address: str) -> Record:
    try:
        return Record(**{"address": address, **state.recover()})
    except (ValueError, TypeError):
        # Without its record an address is requested once more; the kept elements stay.
        return Record(address=address)


def _digest(file: Path) -> str:
    return hashlib.sha256(file.read_bytes()).hexdigest() if file.is_file() else ""


def _kept_state(record: Record, kept: str, name: str) -> str:
    return (name if not record.problem else "kept") if kept else "none"


_Answer = tuple[bytes, Record, bool]
"""Body, the record with what the server states of it, and whether its length was known."""


def _get(record: Record, timeout_s: float, contents: Contents, question: Question) -> _Answer | None:
    """Return the answer, None when nothing has changed; NotTakenError for everything else."""
    found: Future[_Answer | None] = Future()

    def work() -> None:
        try:
            found.set_result(_request(record, timeout_s, contents, question))
        except Exception as error:
            # A Location such as http://[ raises inside of requests.
            known = isinstance(error, NotTakenError)
            found.set_exception(error if known else NotTakenError(f"{record.address}: {error}"))

    # The timeouts of an HTTP client are those of one read: a byte a second would keep it for hours.
    threading.Thread(target=work, daemon=True).start()
    try:
        return found.result(timeout_s)
    except TimeoutError:
        raise NotTakenError(f"{record.address} has not answered in full after {timeout_s:g} s") from None


def _request(record: Record, timeout_s: float, contents: Contents, question: Question) -> _Answer | None:
    import requests

    wanted = {"User-Agent": "rf_pointing", "If-None-Match": record.etag, "If-Modified-Since": record.last_modified}
    # Also those that were kept before they were checked: nothing could be sent with them.
    headers = {name: value for name, value in wanted.items() if _sendable(value)}
    address, own = record.address, _server(urlsplit(record.address))
    try:
        for _ in range(MOST_REDIRECTS):
            secret = question.headers if _server(urlsplit(address)) == own else {}
            response = requests.request(
                question.method, address, data=question.body or None, headers={**headers, **secret}, stream=True,
                timeout=timeout_s, allow_redirects=False,
            )  # fmt: skip
            if not response.is_redirect:
                break
            response.close()
            address = _sent_on(address, response.headers["Location"], record, contents)
        else:
            raise NotTakenError(f"{record.address} was sent on {MOST_REDIRECTS} times")
        with response:
            status, found = response.status_code, response.headers
            if status == 304 and len(headers) > 1:
                return None
            # 207: the answer of WebDAV, which holds that of each of its files.
            if status not in (200, 207):
                wait_s = _retry_after_s(found.get("Retry-After", ""))
                raise NotTakenError(f"{response.url} answered {status} {response.reason}", wait_s=wait_s)
            body = bytearray()
            for part in response.iter_content(2**16):
                body += part
                if len(body) > MOST_BYTES:
                    raise NotTakenError(f"{response.url} sent {len(body)} bytes, must be <= {MOST_BYTES}")
            known = "Content-Length" in found or found.get("Transfer-Encoding", "") == "chunked"
            etag, modified = (_sendable(found.get(name, "")) for name in ("ETag", "Last-Modified"))
            return bytes(body), replace(record, etag=etag, last_modified=modified), known
    except requests.RequestException as error:
        raise _not_taken(record.address, error, timeout_s) from error


def _sendable(value: str) -> str:
    return value if _HEADER.fullmatch(value) else ""


def _sent_on(address: str, location: str, record: Record, contents: Contents) -> str:
    """Return where a request is sent on; NotTakenError for a server that was not named."""
    try:
        begin, end = urlsplit(address), urlsplit(target := urljoin(address, location))
        same, secure = _server(begin) == _server(end), end.scheme == "https" or begin.scheme != "https"
    except ValueError as error:
        raise NotTakenError(f"{address} was sent on to {brief(location)}: {error}") from error
    if not is_address(target) or not secure:
        raise NotTakenError(f"{address} was sent on to {brief(target)}, must be {begin.scheme}")
    if not same and end.hostname not in record.hosts:
        allows = f"{contents.command} --redirect-to {end.hostname}"
        raise NotTakenError(f"{address} was sent on to {end.hostname}, which only {allows} allows")
    return target


def _server(parts: SplitResult) -> tuple[str, int | None]:
    port = None if parts.port in (80, 443) else parts.port
    return (parts.hostname or "").removeprefix("www."), port


def _not_taken(address: str, error: Any, timeout_s: float) -> NotTakenError:
    """Return what a failed request means to the user, and whether the server had it."""
    from requests import exceptions
    from urllib3.exceptions import NewConnectionError

    reason = getattr(error.args[0] if error.args else None, "reason", None)
    refused = exceptions.ConnectTimeout, exceptions.SSLError, exceptions.ProxyError
    if isinstance(error, refused) or isinstance(reason, NewConnectionError):
        return NotTakenError(f"{address} cannot be reached: {str(reason or error).rsplit(': ', 1)[-1]}", reached=False)
    if isinstance(error, exceptions.Timeout):
        return NotTakenError(f"{address} has not answered after {timeout_s:g} s")
    if isinstance(error, (exceptions.ChunkedEncodingError, exceptions.ConnectionError)):
        return NotTakenError(f"{address} broke off: {error}")
    return NotTakenError(f"{address}: {error}")


def _retry_after_s(text: str) -> float:
    """Return the seconds of a Retry-After header, which may be a number or a date; 0 for none."""
    if text.isdecimal():
        return float(text)
    try:
        return max(0.0, parsedate_to_datetime(text).timestamp() - time.time())
    except ValueError:
        return 0.0


def _taken(answer: _Answer, requested: Record, file: Path, now_s: float, contents: Contents) -> Record:
    """Replace the kept file by an answer that is whole; NotTakenError leaves it alone."""
    from rf_pointing.ephemeris.orbit_file import decoded

    body, answered, known_length = answer
    try:
        text = contents.text(decoded(body))
        found = contents.note(text, requested)
    except ValueError as error:
        start = " ".join(body[:60].decode("utf-8", "replace").split())
        page = start.casefold().startswith(("<!doctype html", "<html"))
        what = "a web page" if page else f"no whole {contents.whole}"
        raise NotTakenError(f"{requested.address} answered {what} ({start!r}): {error}") from error
    # A connection that ends early looks like a whole answer when no length was promised.
    if not known_length and text.lstrip()[:1] not in "[{<" and not text.endswith(("\n", "\r")):
        raise NotTakenError(f"{requested.address} ended in the middle of a line: {text[-40:].splitlines()[-1]!r}")
    if not contents.shrinks and file.is_file() and found.objects < FEWEST_SHARE * requested.objects:
        few = f"{found.objects} objects, fewer than half of the {requested.objects} that are kept"
        raise NotTakenError(f"{requested.address} holds {few}; delete {file} to take them")
    write_whole(file, text)
    validators: dict[str, Any] = {"etag": answered.etag, "last_modified": answered.last_modified}
    return replace(found, fresh_t_s=now_s, problem="", digest=_digest(file), **validators)


def _record_of(text: str, requested: Record) -> Record:
    from rf_pointing.ephemeris.orbit_file import keep_orbits, read_orbits

    found = read_orbits(text)
    # So that a node takes them as fast as it finds the file.
    keep_orbits(text.encode(), found)
    objects = {one.catalogue_number for one in found.elements} | {one.object_id for one in found.segments}
    epochs = sorted(one.epoch_t_s for one in found.elements)
    ages = (epochs[0], statistics.median(epochs), epochs[-1]) if epochs else None
    return replace(requested, objects=len(objects), epochs_t_s=ages, refused="; ".join(found.problems))


ELEMENTS = Contents(name="elements", whole="set of elements", command="fetch_elements", note=_record_of)


def age_text(seconds: float) -> str:
    """Return an age for people: hours up to two days, then days."""
    return f"{seconds / HOUR_S:.1f} h" if abs(seconds) < 48.0 * HOUR_S else f"{seconds / (24.0 * HOUR_S):.1f} d"
