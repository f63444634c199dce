"""Executable `check_drive`: checks a drive against what the control unit relies on.

    scripts/run check_drive --station my_dish.yaml           without motion
    scripts/run check_drive --station my_dish.yaml --move    moves both axes by 10 deg and back
    scripts/run check_drive --station my_dish.yaml --namespace /gs1     a drive behind topics

The drive is that of the station's description, or of a parameter file of antenna_servo.  Stop
antenna_servo first: a drive has one master.  Prints pass or FAIL for every property with what was
measured; the exit code is 0 when all passed, 1 when one failed, 2 when the drive could not be made.
"""

import argparse
import math
import sys
import time
from contextlib import ExitStack
from pathlib import Path

from rf_pointing.commands.options import between, command, ending_with_reason
from rf_pointing.core import AXES, Line, Pair, read_parameter_files, with_leaves
from rf_pointing.drives import Drive, DriveParams, make_drive
from rf_pointing.drives.conformance import ConformanceCheck
from rf_pointing.station.antenna.simulated_antenna import AntennaParams
from rf_pointing.station.description import read_station
from rf_pointing.station.description.description import require_known

PROGRAM = "check_drive"


def main() -> None:
    """Entry point of `ros2 run rf_pointing check_drive`."""
    options = _parser().parse_args()
    with ending_with_reason(PROGRAM), ExitStack() as ends:
        params = read_drive(options.params_file or [], options.station)
        drive = made(params, options.namespace, ends)
        travel_rad = flown_rad(options.station) if options.station else None
        run(drive, params, options, travel_rad)


def made(params: DriveParams, namespace: str, ends: ExitStack) -> Drive:
    """Return the drive of these parameters; one behind topics gets a node of its own."""
    if params.type != "topic":
        return make_drive(params)
    if not namespace:
        raise ValueError("drive.type=topic needs --namespace, that of the driver's topics drive/...")
    # Imported here: a device on a cable needs no ROS.
    from rf_pointing.ros.topic_drive import drive_beside

    return drive_beside(PROGRAM, namespace, params, ends)


def run(drive: Drive, params: DriveParams, options: argparse.Namespace, travel_rad: tuple[Pair, Pair] | None) -> None:
    """Check the drive, print every line, and exit with the code of the whole."""
    try:
        axes = read_station(options.station).content.mount.kind.axes if options.station else AXES
        subject = ConformanceCheck(drive, params, tick, math.radians(options.degrees), travel_rad, axes)
        lines = check(subject, options.move)
    except KeyboardInterrupt:
        sys.exit(2)
    finally:
        drive.stop()
        drive.step(time.time())
        drive.close()
    failed = sum(not line.passed for line in lines)
    print(f"{len(lines) - failed} of {len(lines)} passed", flush=True)
    sys.exit(1 if failed else 0)


def check(subject: ConformanceCheck, move: bool) -> list[Line]:
    """Run the checks and print every line; motion only where all is well without it."""
    lines = subject.still()
    _print(lines)
    if move and all(line.passed for line in lines):
        moved = subject.moving()
        _print(moved)
        lines = lines + moved
    return lines


def read_drive(files: list[Path], station: str = "") -> DriveParams:
    """Return the drive of a station, or of these files; ValueError says what is wrong."""
    written = read_parameter_files(files).get("antenna_servo", {})
    require_known("antenna_servo", written)
    if station:
        described = read_station(station)
        drive: DriveParams = described.sets("antenna_servo", changes=written)["drive"]
        return drive
    try:
        of_drive = {name: value for name, value in written.items() if name.startswith("drive.")}
        return with_leaves(AntennaParams(), of_drive).drive
    except ValueError as error:
        raise ValueError(f"antenna_servo: {error}") from error


def flown_rad(station: str) -> tuple[Pair, Pair]:
    """Return the lower and the upper ends of the travel that a station's description writes."""
    mount = read_station(station).content.mount
    low, high = zip(*(axis.travel_deg for axis in mount.pair), strict=True)
    return (math.radians(low[0]), math.radians(low[1])), (math.radians(high[0]), math.radians(high[1]))


def tick(longest_s: float) -> float:
    """Wait for a tick of real time; states of a drive behind topics are stamped with it."""
    time.sleep(longest_s)
    return time.time()


def _print(lines: list[Line]) -> None:
    for line in lines:
        print(line, flush=True)


def _parser() -> argparse.ArgumentParser:
    parser = command(PROGRAM, __doc__)
    where = parser.add_mutually_exclusive_group(required=True)
    where.add_argument("--station", help="station description: a file, or a name that is shipped")
    where.add_argument("--params-file", type=Path, action="append", help="parameters of antenna_servo")
    parser.add_argument("--namespace", default="", help="of the driver of a drive behind topics, e.g. /gs1")
    parser.add_argument("--move", action="store_true", help="move both axes, towards the middle of the travel and back")
    parser.add_argument("--degrees", type=between(0.1, 90.0), default=10.0, help="how far (default: 10)")
    return parser
