"""Executable `scan`: scan sources with a simulated station, and print what the powers tell.

    scripts/run scan Sun --station my_dish.yaml --start 2026-06-21T09:00:00
    scripts/run scan Sun Moon "Cassiopeia A" --station my_dish.yaml --start 2026-06-21T18:00:00 \
        --count 25 --every 20 --table offsets.csv

Offset, width and level of the beam come from every scan; of a body with a known flux Y-factor, G/T,
system noise and efficiency, too.  With `--count` the targets are scanned in turn, the next that is
up each time.  `fit_bias_model offsets.csv` makes a model of the table.  No graph is needed; a
station that runs scans with `station scan`.
Exit code 0: every scan gave its offset; 1: some did not; 2: the command line is wrong.
"""

import argparse
import itertools
import sys
from pathlib import Path
from typing import Any

from rf_pointing.api.target import Target
from rf_pointing.commands.options import add_options, between, command, ending_with_reason, requested, say
from rf_pointing.radiometry.sources import FLUX_SOURCES
from rf_pointing.tracking.scan_program import FRAMES, PATTERNS

PROGRAM = "scan"
# Options of the pattern, by the fields of the request.
FIELDS = (
    "pattern", "frame", "half_width_deg", "rate_deg_s", "baseline_deg", "dwell_s", "lines",
    "repetitions", "sun_flux_sfu",
)  # fmt: skip


def add_pattern(add: Any) -> None:
    """Add the options of a scan, those of `ScanRequest`, and where the result goes."""
    add("--pattern", choices=PATTERNS, default="cross", help="way of the beam (default: cross)")
    add(
        "--frame", choices=FRAMES, default="",
        help="axes of the pattern (default: cross_elevation; a drift: right_ascension)",
    )  # fmt: skip
    add("--half-width", dest="half_width_deg", type=between(0.001, 20.0), metavar="DEG",
        help="from the target to the edge (default: 1.5 beamwidths and the source)")  # fmt: skip
    add("--rate", dest="rate_deg_s", type=between(1e-4, 10.0), metavar="DEG/S",
        help="(default: a beamwidth in 4 s)")  # fmt: skip
    add("--baseline", dest="baseline_deg", type=between(0.0, 30.0), metavar="DEG",
        help="off the source before and after; 0: not (default: on noise only)")  # fmt: skip
    add(
        "--dwell", dest="dwell_s", type=between(0.1, 3600.0), default=5.0, metavar="S",
        help="at each point (default: 5)",
    )  # fmt: skip
    add("--lines", type=int, default=9, help="of a raster (default: 9)")
    add("--repetitions", type=int, default=2, help="(default: 2)")
    add("--sun-flux", dest="sun_flux_sfu", type=between(0.1, 1e6), metavar="SFU",
        help="the day's flux of the Sun at this frequency (default: of the quiet Sun)")  # fmt: skip
    add("--table", type=Path, metavar="FILE", help="append the offset for fit_bias_model")
    add("--output", type=Path, metavar="DIR", help="folder of numbers (JSON) and pictures")


def live_scan(client: Any, **given: Any) -> bool:
    """Scan with a station that runs, as `api.live.scan`."""
    # Imported late: its libraries take time that the other requests of an operator have not.
    from rf_pointing.api import live

    return live.scan(client, **given)


def arguments() -> argparse.ArgumentParser:
    """Return the parser of the command line."""
    parser = command(PROGRAM, "Scan sources with a simulated station.")
    add = parser.add_argument
    add("targets", nargs="+", help=f"{', '.join(FLUX_SOURCES)}, or satellites of --elements")
    add_options(parser, "elements station band")
    add("--model", dest="bias_model", type=Path, metavar="FILE",
        help="bias model in force (default: the station's)")  # fmt: skip
    add_options(parser, "start", start={"required": True, "help": "begin of the first scan"})
    add("--count", type=int, default=1, metavar="N", help="scans (default: 1)")
    add("--every", type=between(0.1, 1440.0), default=20.0, metavar="MIN",
        help="from scan to scan (default: 20)")  # fmt: skip
    add_options(parser, "seed", seed={"default": 1, "help": "seed of every noise source (default: 1)"})
    add_pattern(add)
    return parser


def main(argv: list[str] | None = None) -> None:
    """Entry point of `ros2 run rf_pointing scan`."""
    failed = 0
    with ending_with_reason(PROGRAM):
        given = requested(arguments, dict, argv)
        station, location = given["station"], given["target"].location
        fields = {name: given[name] for name in FIELDS}
        targets = [Target(location=location, satellite=name) for name in given["targets"]]
        for target in targets:
            _ = target.found
        begin_s, turn = given["start_s"], itertools.cycle(targets)
        for number in range(given["count"]):
            at_s = begin_s + 60.0 * given["every"] * number
            # The next in turn that is up; where none is, the first waits for its rise.
            tried = list(itertools.islice(turn, len(targets)))
            heights = [station.track_of(each).target_at(at_s).elevation_rad for each in tried]
            up = [place for place, height in enumerate(heights) if height > station.lowest_rad]
            target = tried[up[0] if up else 0]
            while next(turn) is not target:
                pass
            try:
                found = station.scan(target, start_t_s=at_s, seed=given["seed"] + number, **fields)
                found.keep(given["output"], given["table"])
            except ValueError as error:
                failed += 1
                say(PROGRAM, f"{target.name}: {error}", "ERROR")
    sys.exit(1 if failed else 0)
