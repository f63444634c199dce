"""Executable `station`: the operator's client of a running station, real or simulated.

    station passes                          the schedule, or the coming passes of the present target
    station track SATELLITE                 track its next pass: live line, recording, report
    station scan Moon                       scan it: offset, beam, G/T, table of offsets
    station queue night.csv --start         hand a schedule over, and let the executive run it
    station status --watch                  what it does, and the alarms
    station go 120 45                       turn the axes to azimuth and elevation, deg
    station jog right --seconds 2           move it a little; without a direction by the arrow keys
    station park | stow | pause | release | disable | stop | reset
    station permit-sun --band X --until 2026-06-21T15:00:00Z --by "A. Name"
    station offset --along 0.3 --cross 0.01 | --clear | --keep NAME | --recall NAME
    station night pause | resume | stop | abort | skip [ID] | run PROCEDURE | ack [ALARM]
    station log -n 50                       the journal of the executive
    station test-alarms                     a message by every way out, and what came of it

What moves or resets the antenna is signed with its key, if this user can read it: then it is served
in somebody's pass too.

Exit code 0: done, or all well; 1: the pass was not tracked, a request was refused, or an error
lasts; 2: the station could not be reached, or the command line is wrong.
"""

import argparse
import getpass
import math
import sys
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from datetime import datetime
from functools import partial
from pathlib import Path
from typing import Any

from rf_pointing.commands.options import add_options, between, command, ending_with_reason, named, refusing
from rf_pointing.commands.scan import add_pattern, live_scan
from rf_pointing.core import DATA_BYTES, leaves, parse_utc, read_whole
from rf_pointing.ephemeris.target_offsets import TargetOffsets
from rf_pointing.operations.pass_list import read_passes
from rf_pointing.ros.station_client import JOG, NIGHT, StationClient
from rf_pointing.ros.station_run import run_to_end
from rf_pointing.station.antenna.modes import OPERATED
from rf_pointing.tracking.sensors import SENSOR_CHOICES, load_trackers

OF_SETS = {
    "keep": "keep the offsets under a name, for this band", "recall": "set the offsets of a name",
    "forget": "forget a name",
}  # fmt: skip
"""Requests about named offsets, and their help."""
SHORT = {
    "along_track": "along", "cross_track": "cross", "azimuth": "az", "elevation": "el",
    "cross_elevation": "cross-el", "right_ascension": "ra", "declination": "dec",
}  # fmt: skip
"""Options of the offsets by their names, where they are shorter."""


@dataclass(frozen=True)
class StationRequest:
    """Request to the station in a namespace: a call that returns whether it was granted."""

    namespace: str
    key: Path | None
    call: Callable[..., bool]
    arguments: Mapping[str, Any]


def live_service(client: Any, targets: list[str], station: str) -> bool:
    """Serve with a station that runs, as `api.live.serve`."""
    # Imported late: its libraries take time that the other requests of an operator have not.
    from rf_pointing.api import live

    parts = [each.partition("@") for each in targets]
    hours = [_hour(time) if time else 0.0 for _, _, time in parts]
    return live.serve(client, [name for name, _, _ in parts], hours, station=station)


def _hour(text: str) -> float:
    try:
        moment = datetime.strptime(text, "%H:%M")
    except ValueError as error:
        raise ValueError(f"time={text!r} must be HH:MM, UTC") from error
    return moment.hour + moment.minute / 60.0


def request_of(argv: list[str] | None = None) -> StationRequest:
    """Return the request of a command line."""
    load_trackers()
    parser = command("station", "Operate a running station.")
    add_options(parser, "namespace")
    parser.add_argument(
        "--key", type=_file, metavar="FILE", help="key of the commands (default: that of antenna_servo)"
    )
    every = parser.add_subparsers(required=True, metavar="COMMAND")

    def add(word: str, text: str, call: Callable[..., bool], /, **fixed: str) -> Callable[..., Any]:
        below = every.add_parser(word, allow_abbrev=False, help=text, description=text)
        below.set_defaults(call=call, **fixed)
        return below.add_argument

    passes = add("passes", "show the schedule, or the coming passes of the present target", StationClient.show_passes)
    passes("--json", dest="as_json", action="store_true", help="print JSON")
    track = add("track", "track the next pass of a satellite, record it and report on it", StationClient.track)
    track("satellite", help="catalogue number or name")
    track("--sensor", type=named(SENSOR_CHOICES), choices=tuple(SENSOR_CHOICES), default="auto", help="(default: auto)")
    track("--band", default="", help="band of the station (default: the one in use)")
    track("--min-peak", dest="min_peak_rad", metavar="MIN_PEAK", type=_degrees(0.0, 90.0), default=0.0,
        help="least peak elevation in deg (default: 0)")  # fmt: skip
    track("--near", dest="near_s", type=refusing(parse_utc), metavar="UTC",
        help="the pass at or nearest to this time (default: the next)")  # fmt: skip
    track("--output", type=Path, metavar="DIR", help="folder of recording and report (default: runs/SATELLITE-TIME)")
    track("--no-record", dest="record", action="store_false", help="neither recording nor report")
    scan = add("scan", "scan a target, and say what the received power tells", live_scan)
    scan("target", help="catalogue number or name, or a body of the sky")
    scan("--station", default="", metavar="FILE|NAME", help="(default: that of its nodes)")
    add_pattern(scan)
    service = add("service", "hold targets that never set, each from its hour on, until Ctrl-C", live_service)
    service("targets", nargs="+", help="names in the elements, or Moon, Sun, a radio source; NAME@HH:MM from that time "
            "of every day (UTC) on")  # fmt: skip
    service("--station", default="", metavar="FILE|NAME", help="(default: that of its nodes)")
    queue = add("queue", "hand passes over to the executive: JSON, CSV or ICS of plan_passes", StationClient.queue)
    queue("text", metavar="file", nargs="?", type=refusing(_passes), help="file of the passes")
    queue("--remove", nargs="+", default=[], metavar="ID", help="take passes out")
    queue("--start", action="store_true", help="run the schedule, and follow it to its end")
    status = add("status", "show what the station does, and the alarms", StationClient.show_status)
    status("--watch", action="store_true", help="until Ctrl-C, a line a second")
    status("--forget", action="store_true", help="forget what passes taught of the target")
    status("--json", dest="as_json", action="store_true", help="print JSON")
    go = add("go", "turn the axes to a position and hold there", StationClient.go)
    go("azimuth_rad", metavar="azimuth", type=_degrees(-1000.0, 1000.0), help="deg, the turn of the cables counts")
    go("elevation_rad", metavar="elevation", type=_degrees(-20.0, 200.0), help="deg")
    jog = add("jog", "move the antenna while a key is held, or for some seconds", StationClient.jog)
    jog("direction", nargs="?", choices=tuple(JOG), help="(default: the arrow keys)")
    jog("--seconds", type=between(0.0, 60.0), default=1.0, help="with a direction (default: 1)")
    jog("--fast", action="store_true", help="half the largest rate; else a quarter beam a second")
    for service, (word, text) in OPERATED.items():
        add(word, text, StationClient.ask, name=f"antenna_servo/{service}")
    add("stop", "end the pass under control", StationClient.ask, name="pointing_controller/stop")(
        "--antenna", dest="name", action="store_const", const="antenna_servo/stop",
        help="stop the antenna itself: latches a fault",
    )  # fmt: skip
    words = "let the beam look into the Sun, once, until a time"
    permit = add("permit-sun", words, StationClient.permit_sun)
    permit("--band", required=True, help="band that may; the transmitter stays off")
    permit("--by", default=getpass.getuser(), help="who permits it (default: the user)")
    permit("--until", type=refusing(parse_utc), metavar="UTC", help="at most 12 h ahead")
    permit("--withdraw", action="store_true", help="end a permission")
    offset = add("offset", "set the target off its elements; show its offsets", StationClient.offsets)
    for name, (field, _) in leaves(TargetOffsets()).items():
        word, _, unit = name.rpartition("_offset_")
        largest = 60.0 if unit == "s" else 5.7
        offset(f"--{SHORT.get(word, word).replace('_', '-')}", dest=name, type=between(-largest, largest),
               metavar=unit.upper(), help=field.metadata["description"])  # fmt: skip
    for word, text in OF_SETS.items():
        offset(f"--{word}", dest="request", type=partial(_named, word), metavar="NAME", help=text)
    offset("--clear", dest="request", action="store_const", const=("clear", ""), help="all to zero")
    night = add("night", "request something of the executive", StationClient.night)
    night("request", choices=tuple(NIGHT))
    night("name", nargs="?", default="", help="pass, procedure or alarm (default: present pass, all)")
    add("test-alarms", "send a message by every way out of the station, and say what came of it",
        StationClient.test_alarms)  # fmt: skip
    log = add("log", "show the journal of the executive", StationClient.show_journal)
    log("-n", dest="count", metavar="N", type=int, default=30, help="last lines (default: 30)")
    given = vars(parser.parse_args(argv))
    if given["call"] is StationClient.jog and not given["direction"] and not sys.stdin.isatty():
        parser.error("jog needs a direction, or a terminal with arrow keys")
    numbers = (value for name, value in given.items() if "_offset_" in name)
    if any(each is not None for each in numbers) and given["request"]:
        parser.error("offset takes numbers, or one of --clear, --keep, --recall and --forget")
    ends = given["call"] is StationClient.permit_sun and given.pop("withdraw")
    if given["call"] is StationClient.permit_sun and ends == (given["until"] is not None):
        parser.error("permit-sun needs --until, or --withdraw")
    if given["call"] is StationClient.queue and not given["text"] and Path((given["remove"] or [""])[-1]).is_file():
        # argparse gives a list of passes the file that follows it.
        given["text"] = _passes(given["remove"].pop())
    if given["call"] is StationClient.queue and not (given["text"] or given["remove"] or given["start"]):
        parser.error("queue needs a file, --remove or --start")
    return StationRequest(given.pop("namespace"), given.pop("key"), given.pop("call"), given)


def _named(word: str, name: str) -> tuple[str, str]:
    return word, name


def _file(text: str) -> Path:
    if not Path(text).is_file():
        raise argparse.ArgumentTypeError(f"{text}: no such file")
    return Path(text)


def _passes(name: str) -> str:
    """Return the text of a file of passes, refused here with its row rather than by a node."""
    if not Path(name).is_file():
        raise ValueError(f"no such file: {name}")
    read_passes(text := read_whole(Path(name), DATA_BYTES), every=False)
    return text


def _degrees(low: float, high: float) -> Callable[[str], float]:
    return lambda text: math.radians(between(low, high)(text))


def main(argv: list[str] | None = None) -> None:
    """Entry point of `ros2 run rf_pointing station`."""
    with ending_with_reason("station"):
        request = request_of(argv)

    def work(client: StationClient) -> int:
        try:
            return 0 if request.call(client, **request.arguments) else 1
        except ValueError as error:
            client.say(str(error))
            return 2

    sys.exit(run_to_end("station", lambda: StationClient(request.namespace, request.key), work))
