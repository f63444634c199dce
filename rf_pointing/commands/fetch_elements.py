"""Executable `fetch_elements`: elements of http(s) addresses, kept as files that stay usable.

Without an address the kept ones are requested again.  `ephemeris/fetching.py` says what is
requested when, and what replaces a kept file.
Exit code 0: as fresh as the source allows; 1: an older file is kept; 2: there are no elements.
"""

import json
import sys
import time
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

from rf_pointing.commands.options import between, command, ending_with_reason, say
from rf_pointing.core.dates import utc_text
from rf_pointing.ephemeris.element_files import cache_folder
from rf_pointing.ephemeris.fetching import HOUR_S, Outcome, age_text, fetched, kept_outcomes

PROGRAM = "fetch_elements"


@dataclass(frozen=True)
class FetchRequest:
    """Elements to fetch at a time (UTC in s since 1970), and whether JSON is printed."""

    find: Callable[[float], list[Outcome]]
    json: bool


def values(outcome: Outcome, now_s: float) -> dict[str, Any]:
    """Return an outcome as names and plain values: times in UTC, ages in hours."""
    record = outcome.record
    found: dict[str, Any] = {"address": record.address, "state": outcome.state, "problem": outcome.problem}
    found |= {"file": str(outcome.file), "objects": record.objects}
    found["confirmed_age_h"] = round((now_s - record.fresh_t_s) / HOUR_S, 3) if record.fresh_t_s else None
    ages = [round((now_s - t_s) / HOUR_S, 3) for t_s in record.epochs_t_s or ()]
    found |= dict(zip(("oldest_h", "median_h", "newest_h"), ages or (None,) * 3, strict=True))
    return {**found, "again_utc": utc_text(record.again_t_s(record.interval_s))}


def show(outcome: Outcome, now_s: float, what: str = "objects") -> None:
    """Print what is kept of an address, how many of `what`, and how old it is."""
    record = outcome.record
    print(f"{record.address}: {outcome.state}")
    if outcome.problem:
        print(f"  problem: {outcome.problem}")
    if record.refused:
        print(f"  not used: {record.refused}")
    if outcome.state != "none":
        print(f"  {record.objects} {what}, confirmed {age_text(now_s - record.fresh_t_s)} ago, in {outcome.file}")
    if record.epochs_t_s and outcome.state != "none":
        oldest, median, newest = (age_text(now_s - t_s) for t_s in record.epochs_t_s)
        print(f"  age of the elements: newest {newest}, median {median}, oldest {oldest}")
    print(f"  may be requested again at {utc_text(record.again_t_s(record.interval_s))}")


def request_from(argv: list[str] | None = None) -> FetchRequest:
    """Return the request of a command line."""
    parser = command(PROGRAM, "Fetch elements and keep them as files.")
    add = parser.add_argument
    add("addresses", nargs="*", metavar="URL", help="http(s) address (default: all that are kept)")
    add("--cache", metavar="DIR", default="", help="folder of the files, which --elements takes like any folder "
        "(default: rf_pointing/elements in $XDG_CACHE_HOME or ~/.cache, where --elements URL looks)")  # fmt: skip
    add("--every", metavar="HOURS", type=between(0.0, 720.0), help="time between two requests for the same address "
        "(default and least: the source's rule; 2 h where none is known)")  # fmt: skip
    add("--timeout", metavar="S", type=between(0.1, 3600.0), default=60.0, help="for a whole answer (default: 60)")
    add("--redirect-to", metavar="HOST", action="append", default=[], help="server to which that of the address may send "
        "the request on, now and later (default: none but itself); may be given again")  # fmt: skip
    add("--list", action="store_true", help="tell what is kept and how old it is; send no request")
    add("--json", action="store_true", help="print JSON")
    options = parser.parse_args(argv)
    folder, addresses = cache_folder(options.cache), options.addresses
    if options.list:
        return FetchRequest(lambda _now_s: kept_outcomes(addresses, folder), options.json)
    every_s = None if options.every is None else options.every * HOUR_S
    given = {"every_s": every_s, "timeout_s": options.timeout, "hosts": options.redirect_to}
    return FetchRequest(lambda now_s: fetched(addresses, folder, now_s, **given), options.json)


def main(argv: list[str] | None = None) -> None:
    """Entry point of `ros2 run rf_pointing fetch_elements`."""
    request, now_s = request_from(argv), time.time()
    with ending_with_reason(PROGRAM):
        outcomes = request.find(now_s)
    if request.json:
        print(json.dumps([values(one, now_s) for one in outcomes], indent=1))
    for outcome in outcomes:
        if not request.json:
            show(outcome, now_s)
        if outcome.problem:
            say(PROGRAM, outcome.problem)
    sys.exit(2 if any(o.state == "none" for o in outcomes) else int(any(o.problem for o in outcomes)))
