"""Pointing and loss of the shipped ship in sea state 5, while it turns, and with a late IMU.

    scripts/run-python benchmarks/moving_base.py [--seconds 300] [--station ship_2m4]

A pass is flown by program track: errors of elements are the tracker's, so the satellite is where it
is predicted.  A turn by 180 deg is flown above mast and funnel.
"""

import argparse
import math
import sys
import time
from collections.abc import Mapping

import numpy as np

from rf_pointing.core import gaussian_loss_db
from rf_pointing.ephemeris import first_pass_above
from rf_pointing.ephemeris.source import load_elements
from rf_pointing.simulation import PassLog, StationSetup, simulate_pass

LEAD_S = 30.0
MOST_RMS_DEG, MOST_LOSS_DB = 0.2, 0.5
SETTLED_S = 10.0
TURN, TURN_S = {"turn_rate_deg_s": 3.0}, 60.0
LOW_DEG, CLEAR_DEG = 10.0, 32.0
"""Elevations from which a pass is flown: of the station, and above mast and funnel in a roll."""


def fly(
    station: str, band: str, seconds: float, motion: Mapping[str, object], still: bool = False
) -> tuple[PassLog, float]:
    """Return the log of a pass from its rise on, and the processor time of a simulated second."""
    turns = "turn_rate_deg_s" in motion
    plain = StationSetup(station, band)
    begin_s = load_elements(plain.sets("ephemeris_publisher")["source"]).epoch_t_s
    least_rad = math.radians(CLEAR_DEG if turns else LOW_DEG)
    window = first_pass_above(plain.track(), begin_s, math.radians(40.0), least_rad, 4 * 86400.0)
    changes: dict[str, dict[str, object]] = {
        "antenna_servo": {f"base_motion.{name}": value for name, value in motion.items()},
        "rf_receiver": {"source.along_track_offset_s": 0.0},
    }
    if turns:
        seconds = TURN_S
        changes["antenna_servo"]["base_motion.turn_from_t_s"] = window.aos_t_s
    if still:
        changes["antenna_servo"] |= dict.fromkeys(
            (f"base_motion.{axis}_rms_deg" for axis in ("roll", "pitch", "yaw")), 0.0
        )
    setup = StationSetup(station, band, changes=changes)
    began, until_s = time.process_time(), window.aos_t_s + seconds
    log = simulate_pass(
        setup, window, math.floor(window.aos_t_s) - LEAD_S, "program",
        enough=lambda log: bool(log.t_s) and log.t_s[-1] >= until_s,
    )  # fmt: skip
    return log, (time.process_time() - began) / (seconds + LEAD_S)


def measured(log: PassLog, beamwidth_rad: float) -> tuple[float, float, float]:
    """Return rms and largest error in deg, and mean loss in dB, once the axes have settled."""
    t_s = np.array(log.t_s)
    off = np.degrees(np.hypot(log.cross_elevation_rad, log.elevation_rad))[t_s > t_s[0] + LEAD_S + SETTLED_S]
    loss = float(np.mean([gaussian_loss_db(math.radians(each), beamwidth_rad) for each in off]))
    return float(np.sqrt(np.mean(off**2))), float(off.max()), loss


def main() -> None:
    """Fly the cases, print a row for each, and fail where a bound is exceeded."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--seconds", type=float, default=300.0, help="of each pass (default: 300)")
    parser.add_argument("--station", default="ship_2m4")
    parser.add_argument("--cases", nargs="*", default=None, help="a part of them")
    options = parser.parse_args()
    rows = {
        "at rest, Ku": ("Ku", {}, True), "sea state 5, Ku": ("Ku", {}, False), "sea state 5, X": ("X", {}, False),
        "sea state 5 and a turn, X": ("X", TURN, False), "latency 100 ms, X": ("X", {"latency_s": 0.1}, False),
    }  # fmt: skip
    failed = False
    for name, (band, motion, still) in rows.items():
        if options.cases and not any(each in name for each in options.cases):
            continue
        log, cost = fly(options.station, band, options.seconds, motion, still)
        width = StationSetup(options.station, band).sets("pointing_controller")["machine"].half_power_beamwidth_rad
        rms, most, loss = measured(log, width)
        failed = failed or rms > MOST_RMS_DEG or loss > MOST_LOSS_DB or bool(log.fault)
        print(f"{name:28} rms {rms:.4f} deg, largest {most:.3f} deg, loss {loss:.3f} dB, "
              f"{1e3 * cost:.1f} ms of processor time per s  {log.fault}", flush=True)  # fmt: skip
    print(f"bounds: rms {MOST_RMS_DEG} deg, loss {MOST_LOSS_DB} dB")
    sys.exit(failed)


if __name__ == "__main__":
    main()
