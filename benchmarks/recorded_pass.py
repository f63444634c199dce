"""Print a digest of one simulated pass per sensor: two trees that print the same fly the same pass, bit for bit.

scripts/run-python benchmarks/recorded_pass.py [SENSOR ...]

The digest covers true errors, modes, C/N0 and commands of a CBERS-2 pass over DSS-13 at X band. It
belongs to one processor and one set of libraries; it shows that a change of structure changed nothing.
"""

import hashlib
import math
import sys

import numpy as np

from rf_pointing.core import Sensor
from rf_pointing.ephemeris import first_pass_above
from rf_pointing.ephemeris.source import SourceParams, load_elements, load_track
from rf_pointing.simulation import PassLog, StationSetup, simulate_pass

LEAD_S = 150.0
"""Time before the pass for the slew to its start."""


def digest(log: PassLog) -> str:
    """Return the first 16 digits of the SHA-256 of everything that the pass has left."""
    numbers = (
        log.t_s,
        log.cross_elevation_rad,
        log.elevation_rad,
        log.carrier_to_noise_db_hz,
        log.command_t_s,
        log.command_rad,
    )
    sums = hashlib.sha256()
    for values in numbers:
        sums.update(np.asarray(values, dtype=np.float64).tobytes())
    sums.update("\n".join(map(str, log.mode)).encode())
    return sums.hexdigest()[:16]


def main() -> None:
    """Fly the pass with each sensor of the command line, without one with all of them."""
    source = SourceParams(satellite="28057")
    window = first_pass_above(
        load_track(source), load_elements(source).epoch_t_s, math.radians(40.0), math.radians(5.0), 86400.0
    )
    for sensor in sys.argv[1:] or (Sensor.MONOPULSE, Sensor.CONSCAN, Sensor.STEPTRACK, Sensor.AUTO):
        setup = StationSetup("dss13", "X")
        log = simulate_pass(setup, window, math.floor(window.aos_t_s) - LEAD_S, sensor)
        print(f"{sensor:12}{len(log.t_s):6} errors  {digest(log)}", flush=True)


if __name__ == "__main__":
    main()
