"""Executable `fetch_schedule`: schedules of http(s) addresses, kept and written as passes.

Jobs of the SatNOGS network, calendars (also of CalDAV), CCSDS simple schedules and lists of
`plan_passes`; `station queue` takes what it writes.  Without an address the kept ones are requested
again.  Exit code 0: as fresh as the source allows; 1: an older schedule is kept, or a result was
not taken; 2: nothing is kept.
"""

import argparse
import sys
import time
from pathlib import Path

from rf_pointing.commands.fetch_elements import show
from rf_pointing.commands.options import between, command, ending_with_reason, say, written
from rf_pointing.core.secret_files import secret_in
from rf_pointing.core.whole_file import write_whole
from rf_pointing.ephemeris import Outcome, cache_folder, fetched, kept_outcomes
from rf_pointing.operations.pass_list import to_calendar, to_csv, to_simple_schedule
from rf_pointing.operations.schedule import ScheduledPass, require_each_once
from rf_pointing.station.clients.fetched_schedule import SCHEDULES, passes_to_come, question, report_results

PROGRAM = "fetch_schedule"


def options_from(argv: list[str] | None) -> argparse.Namespace:
    """Return the options of a command line."""
    parser = command(PROGRAM, "Fetch schedules and write them as passes.")
    add = parser.add_argument
    add("addresses", nargs="*", metavar="URL", help="http(s) address of jobs, a calendar or a list of passes "
        "(default: all that are kept)")  # fmt: skip
    add("--token-file", type=Path, metavar="FILE", help="file, of its owner alone, with a token or user:password; "
        "over https only")  # fmt: skip
    add("--caldav", type=between(0.1, 400.0), metavar="DAYS", default=0.0, help="the addresses are CalDAV collections: "
        "request the events of so many days")  # fmt: skip
    for name, what in (("csv", "table"), ("ics", "calendar"), ("ccsds", "simple schedule in XML")):
        add(f"--{name}", type=Path, metavar="FILE", help=f"write the passes to come as a {what}")
    add("--report", type=Path, metavar="NIGHT", help="tell the network of one address of jobs what has become of "
        "them: the night.json of a morning report, or its folder")  # fmt: skip
    add("--cache", metavar="DIR", default="", help="folder of the kept answers (default: rf_pointing/schedules in "
        "$XDG_CACHE_HOME or ~/.cache)")  # fmt: skip
    add("--every", metavar="MINUTES", type=between(0.0, 43200.0), help="time between two requests (default and least: "
        "the source's rule; 5 min where none is known)")  # fmt: skip
    add("--timeout", metavar="S", type=between(0.1, 3600.0), default=60.0, help="for a whole answer (default: 60)")
    add("--redirect-to", metavar="HOST", action="append", default=[], help="server to which that of the address may "
        "send the request on; never with the token")  # fmt: skip
    add("--list", action="store_true", help="tell what is kept; send no request")
    given = parser.parse_args(argv)
    if given.report and len(given.addresses) != 1:
        parser.error(f"--report needs one address, {len(given.addresses)} are given")
    return given


def write_files(given: argparse.Namespace, passes: list[ScheduledPass], now_s: float) -> None:
    """Write the passes of all addresses in the forms that are wanted."""
    require_each_once(passes)
    own = passes, PROGRAM, now_s
    written(PROGRAM, given.csv, lambda path: write_whole(path, to_csv(passes)))
    written(PROGRAM, given.ics, lambda path: write_whole(path, to_calendar(*own)))
    written(PROGRAM, given.ccsds, lambda path: write_whole(path, to_simple_schedule(*own)))


def secret_of(path: Path | None) -> str:
    """Return the token or user:password in a file, "" without one."""
    if path is None:
        return ""
    if not path.is_file() or not (secret := secret_in(path)):
        raise ValueError(f"--token-file {path} must be a file with a token or user:password")
    return secret


def main(argv: list[str] | None = None) -> None:
    """Entry point of `ros2 run rf_pointing fetch_schedule`."""
    given, now_s = options_from(argv), time.time()
    outcomes: list[Outcome] = []
    with ending_with_reason(PROGRAM):
        folder = cache_folder(given.cache, "schedules")
        secret = secret_of(given.token_file)
        if given.report:
            night = given.report / "night.json" if given.report.is_dir() else given.report
            lines = report_results(given.addresses[0], night, secret, folder, timeout_s=given.timeout)
            print("\n".join(lines) or "nothing new to report")
            sys.exit(int(any(" 200 " not in line for line in lines)))
        if given.list:
            outcomes = kept_outcomes(given.addresses, folder, SCHEDULES)
        else:
            every_s = None if given.every is None else 60.0 * given.every
            known = given.addresses or [one.record.address for one in kept_outcomes((), folder, SCHEDULES)]
            for address in known:
                asked = question(address, secret, caldav_days=given.caldav, now_s=now_s)
                outcomes += fetched(
                    [address], folder, now_s, every_s=every_s, timeout_s=given.timeout, hosts=given.redirect_to,
                    contents=SCHEDULES, question=asked,
                )  # fmt: skip
        passes = [each for one in outcomes if one.state != "none" for each in passes_to_come(one, now_s)]
        for outcome in outcomes:
            show(outcome, now_s, "passes")
            if outcome.problem:
                say(PROGRAM, outcome.problem)
        write_files(given, passes, now_s)
    sys.exit(2 if any(o.state == "none" for o in outcomes) else int(any(o.problem for o in outcomes)))
