"""Executable `check_receiver`: checks a receiver against what the trackers rely on.

    scripts/run check_receiver --station my_dish.yaml
    scripts/run check_receiver --station my_dish.yaml --receiver rtl_tcp://localhost:1234

The receiver is that of the station's description.  Stop signal_receiver first: most sources serve
one client.  Prints pass or FAIL for every property with what was measured; the exit code is 0 when
all passed, 1 when one failed, 2 when the receiver could not be made.
"""

import sys
import time

from rf_pointing.api.requests import receiver_section
from rf_pointing.commands.options import between, command, ending_with_reason
from rf_pointing.receiver import SignalReceiver, SignalReceiverParams
from rf_pointing.receiver.conformance import ReceiverCheck
from rf_pointing.receiver.registry import SIMULATED, TOPIC
from rf_pointing.station.description import read_station
from rf_pointing.station.description.writing import received_by

PROGRAM, TICK_S = "check_receiver", 0.02


def main(argv: list[str] | None = None) -> None:
    """Entry point of `ros2 run rf_pointing check_receiver`."""
    parser = command(PROGRAM, __doc__)
    parser.add_argument("--station", required=True, help="station description: a file, or a name that is shipped")
    parser.add_argument("--band", help="(default: the station's)")
    parser.add_argument("--receiver", default="", help="address of another receiver, as rtl_tcp://localhost:1234")
    parser.add_argument("--seconds", type=between(2.0, 3600.0), default=10.0, help="how long (default: 10)")
    given = parser.parse_args(argv)
    with ending_with_reason(PROGRAM):
        receiver = SignalReceiver(receiver_of(given.station, given.band, given.receiver), time.time)
    sys.exit(check(receiver, given.seconds))


def receiver_of(name: str, band: str | None, address: str) -> SignalReceiverParams:
    """Return the receiver of a station; ValueError says why nothing can be checked."""
    station = read_station(name)
    if address:
        station = received_by(
            station, receiver_section(address, station.content.receiver_in(band or station.default_band))
        )
    if station.receiver in (SIMULATED, TOPIC):
        raise ValueError(f"receiver.type={station.receiver} of {station.name} has no device to check")
    params: SignalReceiverParams = station.sets("signal_receiver", band)["receiver"]
    return params


def check(receiver: SignalReceiver, seconds: float) -> int:
    """Check the receiver and print every line; return the exit code."""
    try:
        lines = ReceiverCheck(receiver, tick).lines(seconds)
    except KeyboardInterrupt:
        return 2
    finally:
        receiver.end()
    for line in lines:
        print(line, flush=True)
    failed = sum(not line.passed for line in lines)
    print(f"{len(lines) - failed} of {len(lines)} passed", flush=True)
    return 1 if failed else 0


def tick() -> float:
    """Wait for a tick of real time."""
    time.sleep(TICK_S)
    return time.time()
