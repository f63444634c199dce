"""Simulated passes from 60 to 120 dB-Hz: does an error, or the time lost, grow with the carrier?

scripts/run-python benchmarks/strong_carriers.py [SEED [SENSORS [LEVEL ...]]]

A CBERS-2 pass above 20 deg over DSS-13 at X band, wind 8 m/s, for each of SENSORS (comma).  The link of the
controller is that of the receiver.  Prints the true error from half a minute after the first
tracking of the sensor, its lost time, and the C/N0 that the receiver states against the link's.
The exit status says whether every level is within 1.3 times the error at the weakest one.
"""

import math
import sys

import numpy as np

from rf_pointing.core import MDEG, Sensor
from rf_pointing.papers.autotrack_cases import Case, fly, low_orbit_pass
from rf_pointing.simulation import PassLog

LEVELS_DB_HZ = (60.0, 75.0, 90.0, 100.0, 110.0, 120.0)
SENSORS = (Sensor.MONOPULSE, Sensor.CONSCAN, Sensor.STEPTRACK)
REFERENCE_M = 780e3
SETTLED_S, LARGEST_GROWTH = 30.0, 1.3


def fly_at(level_db_hz: float, sensor: str, seed: int) -> PassLog:
    """Return the pass with that C/N0 at the zenith at the reference range."""
    link = {"link.zenith_carrier_to_noise_db_hz": level_db_hz, "link.reference_range_m": REFERENCE_M}
    changes: dict[str, dict[str, object]] = {
        "rf_receiver": {f"signal.{name}": value for name, value in link.items()},
        "pointing_controller": dict(link),
    }
    return fly(Case("X", sensor, 1000.0, changes, seed), low_orbit_pass(40.0, 20.0))


def main() -> int:
    """Print a line for each sensor and level; 1 where an error grows with the carrier."""
    seed = int(sys.argv[1]) if len(sys.argv) > 1 else 41
    sensors = sys.argv[2].split(",") if len(sys.argv) > 2 else SENSORS
    levels = [float(text) for text in sys.argv[3:]] or LEVELS_DB_HZ
    grown = False
    for sensor in sensors:
        first_mdeg = math.inf
        for level in levels:
            log = fly_at(level, sensor, seed)
            times, tracking = np.array(log.t_s), np.array(log.mode) == sensor
            begun_s = float(times[np.argmax(tracking)]) if np.any(tracking) else math.inf
            settled = times >= begun_s + SETTLED_S
            errors = log.errors_rad()
            rms_mdeg = math.sqrt(np.mean(np.sum(errors[settled] ** 2, axis=1))) / MDEG if np.any(settled) else math.inf
            lost_s = 0.1 * int(np.count_nonzero(settled & ~tracking))
            stated = float(np.median(np.array(log.carrier_to_noise_db_hz)[settled])) if np.any(settled) else math.nan
            print(f"{sensor:10} {level:5.0f} dB-Hz: {rms_mdeg:8.3f} mdeg rms, lost {lost_s:6.1f} s, "
                  f"median C/N0 {stated:6.2f} dB-Hz", flush=True)  # fmt: skip
            first_mdeg = min(first_mdeg, rms_mdeg) if math.isfinite(first_mdeg) else rms_mdeg
            grown |= rms_mdeg > LARGEST_GROWTH * first_mdeg or lost_s > 1.0
    return int(grown)


if __name__ == "__main__":
    sys.exit(main())
